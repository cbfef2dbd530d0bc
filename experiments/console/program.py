"""The begin and the end of a command: exit codes, and one line for what is wrong."""

from collections.abc import Sequence

from cyclopts import App, CycloptsError

from cocap_opt.data import ProblemError
from cocap_opt.experiments.console.options import UsageError
from cocap_opt.experiments.console.streams import say
from cocap_opt.files.documents import FileError


def run_app(app: App, arguments: Sequence[str] | None, *errors: type[Exception]) -> int:
    """Runs a command and returns its exit code; wrong input is one line, and code 2.

    Parameters
    ----------
    errors : that mean wrong input, too
    """
    wrong: tuple[type[Exception], ...] = (CycloptsError, UsageError, FileError, ProblemError)
    try:
        code = app(arguments, exit_on_error=False, print_error=False, result_action="return_value")
    except (*wrong, *errors) as error:
        say(str(error))
        return 2
    except MemoryError:
        say("out of memory: the scene is too large for this method")
        return 2
    return int(code or 0)
