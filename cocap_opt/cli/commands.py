"""The program `cocap-opt`: all its commands, by family."""

import inspect
import logging
import sys
from collections.abc import Callable, Sequence
from importlib.metadata import version
from importlib.util import find_spec
from typing import Annotated, Literal, TypedDict, get_args, get_origin

from cyclopts import (
    App,
    CoercionError,
    CycloptsError,
    Group,
    Parameter,
    UnknownCommandError,
    UnusedCliTokensError,
)

from cocap_opt.cli import (
    audit_command,
    export_command,
    fly_command,
    front_command,
    gap_command,
    limits_command,
    picture_commands,
    quality_command,
    result_commands,
    robustness_command,
    scene_commands,
    sheet_command,
    solver_commands,
    takes_command,
    team_command,
    verify_command,
)
from cocap_opt.console.exit_codes import WRONG_INPUT
from cocap_opt.console.streams import say
from cocap_opt.console.usage import usage_of
from cocap_opt.data import ProblemError
from cocap_opt.experiments.sweeps.crew import ClusterError
from cocap_opt.files.documents import FileError
from cocap_opt.run.options import Option, UsageError

_MOST_PARAGRAPHS = 4  # paragraphs of a command above its options, besides the example


class _Help(TypedDict):
    """The text above the options of a command, and the text below."""

    help: str
    help_epilogue: str | None


def _help(command: Callable[..., int]) -> _Help:
    """Returns a command's docstring, with each paragraph on one line, which is wrapped when shown.

    Of a long docstring, the first two paragraphs and the example are above the options.
    """
    texts = (inspect.getdoc(command) or "").split("\n\n")
    *told, example = [" ".join(text.split()) for text in texts]
    above = 2 if len(told) > _MOST_PARAGRAPHS else len(told)
    return {
        "help": "\n\n".join([*told[:above], example]),
        "help_epilogue": "\n\n".join(told[above:]) or None,
    }


_NAMES = {
    "Plan": ("scenes", "recipe", "plan", "team", "takes", "front", "limits"),
    "Prove": ("bound", "solve", "verify", "export", "audit", "library"),
    "Look": ("show", "quality", "render", "figure"),
    "Fly": ("fly", "sheet", "robustness"),
    "Measure": ("gap", "table", "report", "columns", "study"),
    "This program": ("compile", "completion"),
}
_GROUPS = {title: Group(title, sort_key=number) for number, title in enumerate(_NAMES)}


class _Place(TypedDict):
    """The place of a command on the help page."""

    group: Group
    sort_key: int


def _place(name: str) -> _Place:
    """Returns the place that the table of groups gives a command."""
    title, names = next(found for found in _NAMES.items() if name in found[1])
    return {"group": _GROUPS[title], "sort_key": names.index(name)}


app = App(
    name="cocap-opt",
    help="Plan the views of several camera drones, and prove how good the plans are.",
    help_format="plaintext",
    version=lambda: version("cocap-opt"),
    version_flags=["--version"],
    suppress_keyboard_interrupt=False,
    # a file may have the name [x].json, which is no list
    default_parameter=Parameter(json_list=False, json_dict=False),
)
for _flag in ("--help", "--version"):
    app[_flag].group = _GROUPS["This program"]
for _family in (
    scene_commands, export_command, solver_commands, limits_command, verify_command,
    audit_command, quality_command, gap_command, team_command, takes_command, front_command,
    result_commands, picture_commands, fly_command, sheet_command,
    robustness_command,
):  # fmt: skip
    for _name, _command in _family.COMMANDS.items():
        app.command(
            _command, name=_name, usage=usage_of(f"cocap-opt {_name}", _command),
            **_help(_command), **_place(_name),
        )  # fmt: skip
app.command(  # given by name, as matplotlib takes long to import
    "cocap_opt.cli.figure_commands:app",
    name="figure",
    **_place("figure"),
    help="Draw charts of results for papers.\n\nExample: cocap-opt figure gaps results -o gaps.pdf",
)
app.command(
    "cocap_opt.cli.library_command:app",
    name="library",
    **_place("library"),
    help="List the library's instances with their best plans and bounds; submit better ones.\n\n"
    "Example: cocap-opt library status --all",
)
if find_spec("cocap_opt.experiments.lab"):  # only in the repository
    app.command(
        "cocap_opt.experiments.lab.studies.app:app",
        name="study",
        **_place("study"),
        help="Re-run the project's benchmarks.\n\nExample: cocap-opt study planners",
    )
else:

    @app.command(name="study", show=False)
    def _study(*_words: Annotated[str, Parameter(allow_leading_hyphen=True)]) -> int:
        """Tell where the project's measurements are."""
        raise FileError("study: is only in the project's repository, not in the installed package")


@app.command(name="completion", usage="Usage: cocap-opt completion SHELL", **_place("completion"))
def _completion(
    shell: Annotated[Literal["bash", "zsh", "fish"], Parameter(help="which shell")], /
) -> int:
    """Print a shell-completion script.

    Example: cocap-opt completion bash > ~/.local/share/bash-completion/completions/cocap-opt
    """
    sys.stdout.write(app.generate_completion(shell=shell))
    return 0


def run(arguments: Sequence[str] | None) -> int:
    """Runs one command and returns its exit code; wrong input gives one line on standard error."""
    _log_to_stderr()
    try:
        code = app(arguments, exit_on_error=False, print_error=False, result_action="return_value")
    except (CycloptsError, UsageError, ClusterError, FileError, ProblemError) as error:
        has_words = isinstance(error.__cause__, UsageError)  # the message of an option is complete
        say(_reworded(error) or str(error.__cause__ if has_words else error))
        return WRONG_INPUT
    except MemoryError:
        say("out of memory: the scene is too large for this method")
        return WRONG_INPUT
    return int(code or 0)


def _reworded(error: Exception) -> str:
    """Returns this program's message for an error that Cyclopts reports; empty for other errors."""
    if isinstance(error, UnknownCommandError) and error.app is not None and error.unused_tokens:
        known = [name for name in error.app if not name.startswith("-") and error.app[name].show]
        return str(Option("COMMAND").not_among(error.unused_tokens[0], known))
    if isinstance(error, UnusedCliTokensError) and error.unused_tokens:
        given = " ".join(error.unused_tokens)
        return f"{given}: must be left out, as the command does not take it"
    if not isinstance(error, CoercionError) or error.token is None:
        return ""
    # from a converter of this project, with a better message
    if isinstance(error.__cause__, UsageError):
        return str(error.__cause__)
    given, choices = error.token.value, [*map(str, get_args(error.target_type))]
    name = error.token.keyword or (error.argument.name if error.argument is not None else "")
    if name and get_origin(error.target_type) is Literal:
        return str(Option(name).not_among(given, choices))
    allowed = {int: "a whole number", float: "a number"}.get(error.target_type or object)
    return f"{name}: must be {allowed}, not {given!r}" if allowed and name else ""


class _Once(logging.Filter):
    """Lets a message through once; `once` identifies its subject, for any seed or planner."""

    def __init__(self) -> None:
        super().__init__()
        self._seen: set[str] = set()

    def filter(self, record: logging.LogRecord) -> bool:
        message = str(getattr(record, "once", record.getMessage()))
        new = message not in self._seen
        self._seen.add(message)
        return new


class _ToStderr(logging.Handler):
    """Writes messages to the current standard error, above lines that change, if there are any."""

    def emit(self, record: logging.LogRecord) -> None:
        try:
            say(self.format(record))
        except Exception:  # like the handlers of `logging`
            self.handleError(record)


def _log_to_stderr() -> None:
    handler = _ToStderr()
    handler.addFilter(_Once())
    handler.setFormatter(logging.Formatter())  # otherwise `basicConfig` would prefix names
    logging.basicConfig(handlers=[handler], level=logging.WARNING)
