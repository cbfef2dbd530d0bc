"""How programs other than `cocap-opt` begin and end."""

from collections.abc import Sequence

from cyclopts import App, CycloptsError

from cocap_opt.data import ProblemError
from cocap_opt.experiments.cli.main import INTERRUPTED
from cocap_opt.experiments.console.streams import say
from cocap_opt.files.documents import FileError


def program(name: str, words: str) -> App:
    """A program to which commands are added.

    Parameters
    ----------
    words : what it does
    """
    return App(
        name=name,
        help=words,
        help_format="plaintext",
        version_flags=[],
        suppress_keyboard_interrupt=False,  # `run_app` says it in a line
    )


def run_app(app: App, arguments: Sequence[str] | None, *errors: type[Exception]) -> int:
    """Run a command: its exit code, 2 for wrong input (one line), or 130 after Ctrl-C.

    Parameters
    ----------
    errors : that mean wrong input, too
    """
    wrong_input: tuple[type[Exception], ...] = (CycloptsError, FileError, ProblemError, *errors)
    try:
        code = app(arguments, exit_on_error=False, print_error=False, result_action="return_value")
    except wrong_input as error:
        say(str(error))
        return 2
    except KeyboardInterrupt:
        say("interrupted")
        return INTERRUPTED
    return int(code or 0)
