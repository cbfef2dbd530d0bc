"""The command line, `cocap-opt`: the commands are in `cocap_opt.cli.commands`.

Results go to standard output, as a table or with --json as a single JSON object; progress and
messages go to standard error. Exit codes: 0 done (even if there is no plan: that is a result), 1 a
claim does not hold (verify) or differs (audit), 2 wrong input, 3 some of it is undecided (audit),
130 interrupted before any result was available, before all scenes and seeds were complete (gap,
team), or before a second opinion was available (verify).
"""

import os
import signal
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from io import TextIOWrapper
from types import FrameType

from cocap_opt.console.exit_codes import INTERRUPTED, WRONG_INPUT
from cocap_opt.console.streams import discard, say
from cocap_opt.console.threads import ONE_THREAD


def main(arguments: Sequence[str] | None = None) -> None:
    """Runs the command line and exits."""
    for name, count in ONE_THREAD.items():  # before NumPy loads
        os.environ.setdefault(name, count)
    _open_streams()
    try:
        with _told_to_end():
            with _leave_at_once():
                from cocap_opt.cli.commands import run  # half a second
            code = run(arguments)
            sys.stdout.flush()
    except BrokenPipeError:
        # The reader of our output has closed it, as with `| head`.
        discard(sys.stdout)
        code = 0
    except OSError as error:
        # errors of our files name the file; this one concerns the output
        if error.filename is None:
            discard(sys.stdout)
            say(f"standard output: cannot be written: {error.strerror}")
        else:  # a system file, e.g. in /proc if it is not mounted
            say(f"{error.filename}: {error.strerror}")
        code = WRONG_INPUT
    # a second Ctrl-C, or one before any result was available
    except KeyboardInterrupt as interrupt:
        say(", ".join(["interrupted", *map(str, interrupt.args)]))
        code = INTERRUPTED
    sys.exit(code)


def _open_streams() -> None:
    """Replaces a closed output stream by the null device, so that writing to it does not fail."""
    if sys.stdout is None:
        sys.stdout = open(os.devnull, "w")  # noqa: SIM115 (open until the process ends)
    if sys.stderr is None:
        sys.stderr = open(os.devnull, "w")  # noqa: SIM115
    if isinstance(sys.stdout, TextIOWrapper):  # a file's name need not be valid text
        sys.stdout.reconfigure(errors="backslashreplace")


@contextmanager
def _told_to_end() -> Iterator[None]:
    """Treats SIGTERM, which batch systems send before they kill a job, as Ctrl-C."""
    before = signal.getsignal(signal.SIGTERM)
    is_main = threading.current_thread() is threading.main_thread()
    if before is not signal.SIG_DFL or not is_main:  # the caller uses it for something else
        yield
        return
    process = os.getpid()

    def end(number: int, frame: FrameType | None) -> None:
        if os.getpid() == process:
            signal.raise_signal(signal.SIGINT)
        else:  # a child process, which has inherited this handler
            signal.signal(signal.SIGTERM, signal.SIG_DFL)
            signal.raise_signal(signal.SIGTERM)

    signal.signal(signal.SIGTERM, end)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


@contextmanager
def _leave_at_once() -> Iterator[None]:
    """Ends the process at Ctrl-C: modules that are being imported may swallow an exception."""
    before = signal.getsignal(signal.SIGINT)
    if before is not signal.default_int_handler:  # the caller uses it for something else
        yield
        return

    def leave(number: int, frame: FrameType | None) -> None:
        say("interrupted")
        os._exit(INTERRUPTED)

    signal.signal(signal.SIGINT, leave)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


if __name__ == "__main__":  # `python -m`, if the command is not on the path
    main()
