"""Standard output and standard error, which the caller may have closed, filled or cut off."""

import os
import sys
from contextlib import suppress
from io import TextIOWrapper
from typing import TextIO


def open_streams() -> None:
    """Makes both streams writable: what is written to a closed one goes nowhere."""
    if sys.stdout is None:
        sys.stdout = open(os.devnull, "w")  # noqa: SIM115 (open until the process ends)
    if sys.stderr is None:
        sys.stderr = open(os.devnull, "w")  # noqa: SIM115
    if isinstance(sys.stdout, TextIOWrapper):  # a file's name need not be text
        sys.stdout.reconfigure(errors="backslashreplace")


def discard(stream: TextIO) -> None:
    """Sends nowhere what is still to be written to a stream."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def say(message: str) -> None:
    """Writes one line on standard error; where that fails, the work goes on without it."""
    try:
        sys.stderr.write("cocap-opt: " + " ".join(message.split()) + "\n")
        sys.stderr.flush()
    except OSError:
        with suppress(OSError):
            discard(sys.stderr)
