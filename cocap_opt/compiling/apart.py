"""Compiling in a process of its own: it can be ended at any time, which numba cannot.

What it keeps is loaded by the process that has asked for it.
"""

import os
import subprocess
import sys
from importlib import import_module
from threading import Thread

from cocap_opt.compiling.functions import CompilingError, kept_files, kept_functions
from cocap_opt.compiling.marks import mark
from cocap_opt.stop import Stop

_LOOK = 0.1  # s, between two looks at the stop
_CODE = (
    "import sys; caller, functions, *sys.path = sys.argv[1:]; "
    "from cocap_opt.compiling.apart import end_with_parent, keep; end_with_parent(); "
    "keep(caller, functions)"
)


def compile_apart(caller: str, functions: str, stop: Stop) -> None:
    """Compiles a kernel in another process, so that it is kept.

    Parameters
    ----------
    caller : full name of the module whose `call_once()` makes numba compile it
    functions : full name of the module of the compiled functions
    stop : stopping criterion, which ends the process; so does any exception, such as by Ctrl-C

    Raises
    ------
    LimitReached
        If a limit is reached before.
    CompilingError
        If the process fails; its last words say why.
    OSError
        If there can be none.
    """
    if not sys.executable or getattr(sys, "frozen", False):
        raise OSError("no Python")
    command = [sys.executable, "-c", _CODE, caller, functions, *map(str, sys.path)]
    read, write = os.pipe()  # whose end is that of this process, however that is ended
    # In a session of its own: Ctrl-C in the terminal is for the one who waits.
    with os.fdopen(write, "wb"), os.fdopen(read) as stdin, subprocess.Popen(
        command, stdin=stdin, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
        text=True, errors="replace", start_new_session=True,
    ) as process:  # fmt: skip
        try:
            said = _last_words(process, stop)
        except BaseException:
            process.kill()
            raise
    if process.returncode:
        words = said.strip().rpartition("\n")[2] or f"its process ends with {process.returncode}"
        raise CompilingError(f"numba fails ({words})")


def end_with_parent() -> None:
    """Ends this process once its standard input ends, as it does when its parent is killed."""

    def watch() -> None:
        os.read(0, 1)  # it waits; a buffered reader would hold a lock when Python ends
        os._exit(1)

    Thread(target=watch, daemon=True).start()


def keep(caller: str, functions: str) -> None:
    """Compiles a kernel, or loads it, and marks it as kept."""
    import_module(caller).call_once()
    mark(functions, kept_files(kept_functions(functions)))


def _last_words(process: "subprocess.Popen[str]", stop: Stop) -> str:
    """Returns the text of a process's errors once it has ended."""
    while True:
        try:
            return process.communicate(timeout=_LOOK)[1]
        except subprocess.TimeoutExpired:
            stop.check()
