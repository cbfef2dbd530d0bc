"""Compilation in a separate process, which can be ended at any time, unlike numba itself.

The process that requested it then loads the stored code.
"""

import os
import subprocess
import sys
from importlib import import_module
from threading import Thread

from cocap_opt.compiling.functions import CompilingError, kept_files, kept_functions
from cocap_opt.compiling.marks import mark
from cocap_opt.stop import Stop

_LOOK = 0.1  # s between two checks of the stopping criterion
_CODE = (
    "import sys; caller, functions, *sys.path = sys.argv[1:]; "
    "from cocap_opt.compiling.apart import end_with_parent, keep; end_with_parent(); "
    "keep(caller, functions)"
)


def compile_apart(caller: str, functions: str, stop: Stop) -> None:
    """Compiles a kernel in another process, which stores the code.

    Parameters
    ----------
    caller : full name of the module whose `call_once()` makes numba compile it
    functions : full name of the module of the compiled functions
    stop : stopping criterion that ends the process; any exception, e.g. from Ctrl-C, ends it, too

    Raises
    ------
    LimitReached
        If a limit is reached before the process has finished.
    CompilingError
        If the process fails; the message is the last line that it printed.
    OSError
        If no process can be started.
    """
    if not sys.executable or getattr(sys, "frozen", False):
        raise OSError("no Python")
    command = [sys.executable, "-c", _CODE, caller, functions, *map(str, sys.path)]
    read, write = os.pipe()  # closed when this process ends, for whatever reason
    # In its own session, so that Ctrl-C in the terminal reaches only the waiting process.
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
        words = said.strip().rpartition("\n")[2] or f"exit code {process.returncode}"
        raise CompilingError(f"numba fails ({words})")


def end_with_parent() -> None:
    """Ends this process once its standard input ends, as it does when its parent is killed."""

    def watch() -> None:
        os.read(0, 1)  # blocks; a buffered reader would hold a lock when Python ends
        os._exit(1)

    Thread(target=watch, daemon=True).start()


def keep(caller: str, functions: str) -> None:
    """Compiles a kernel, or loads it, and marks it as stored."""
    import_module(caller).call_once()
    mark(functions, kept_files(kept_functions(functions)))


def _last_words(process: "subprocess.Popen[str]", stop: Stop) -> str:
    """Returns the text of a process's errors once it has ended."""
    while True:
        try:
            return process.communicate(timeout=_LOOK)[1]
        except subprocess.TimeoutExpired:
            stop.check()
