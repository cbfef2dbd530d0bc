"""Standard output and standard error, which the caller may have closed, filled or cut off."""

import logging
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import TextIO

from cocap_opt.text import printable, shortened

_LONGEST_WORD = 400  # characters; a file name with its folders counts as one word


def discard(stream: TextIO) -> None:
    """Discards everything that is still to be written to a stream."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def one_line(message: str) -> str:
    """Returns a message on one line.

    Parts of it may come from files, so characters that are not text or would control a terminal are
    escaped, and the middle of very long words is left out.
    """
    return printable(" ".join(shortened(word, _LONGEST_WORD) for word in message.split()))


def say(message: str) -> None:
    """Writes one line on standard error; if that fails, the work continues."""
    try:
        sys.stderr.write(f"cocap-opt: {one_line(message)}\n")
        sys.stderr.flush()
    except OSError:
        with suppress(OSError):
            discard(sys.stderr)


@contextmanager
def without_warnings(package: str) -> Iterator[None]:
    """Suppresses the warnings of a package within the block, as they were given before."""
    logger = logging.getLogger(package)
    level = logger.level
    logger.setLevel(logging.ERROR)
    try:
        yield
    finally:
        logger.setLevel(level)
