"""The pages of the command line, made from the commands themselves."""

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial

from cyclopts import App, Group
from cyclopts.argument import Argument

from cocap_opt.console.usage import usage_of

_FAMILIES = ("figure", "library", "study")  # commands with subcommands
_OWN_PAGES = ("library", "study")  # families that have their own pages


def _group(title: str, program: App) -> str:
    """Returns a part for each command of a group, except families that have their own pages."""
    return "\n\n".join(_parts(title, program))


def _parts(title: str, program: App) -> Iterator[str]:
    for name in _names(program):
        command = program[name]
        if name in _OWN_PAGES or title not in _titles(command):
            continue
        if name in _FAMILIES:
            yield _family(program, name)
        else:
            yield _command(f"cocap-opt {name}", command)


def _titles(command: App) -> list[str]:
    """Returns the groups of the help page that a command is in."""
    groups = command.group if isinstance(command.group, tuple) else (command.group,)
    return [group.name for group in groups if isinstance(group, Group)]


def _studies(chosen: slice, program: App) -> str:
    """Returns a part for some of the commands of `cocap-opt study`."""
    family = program["study"]
    return "\n\n".join(
        _command(f"cocap-opt study {name}", family[name]) for name in _names(family)[chosen]
    )


def _family(app: App, name: str) -> str:
    inner = app[name]
    return "\n\n".join(
        _command(f"cocap-opt {name} {command}", inner[command]) for command in _names(inner)
    )


def _names(family: App) -> Sequence[str]:
    return [name for name in family if not name.startswith("-")]


def _command(called: str, command: App) -> str:
    """Returns the part of one command, with its options as a table."""
    paragraphs = [" ".join(words.split()) for words in re.split(r"\n\s*\n", command.help or "")]
    above, *examples = "\n\n".join(paragraphs).split("Example: ")
    told = f"{above}{command.help_epilogue or ''}"
    lines = "\n".join(example.strip() for example in examples)
    arguments = [argument for argument in command.assemble_argument_collection() if argument.show]
    assert command.default_command is not None
    usage = usage_of(called, command.default_command).removeprefix("Usage: ")
    parts = [
        f"## {called.removeprefix('cocap-opt ')}",
        f"```text\n{usage}\n```",
        told.strip(),
        f"For example:\n\n```sh\n{lines}\n```" if lines else "",
        "| option | meaning | default |\n|---|---|---|\n" + "\n".join(map(_row, arguments)),
    ]
    return "\n\n".join(part for part in parts if part)


def _row(argument: Argument) -> str:
    """Returns the line of an option in the table."""
    names = ", ".join(f"`{name}`" for name in argument.names)
    choices = argument.get_choices() or ()
    several = len(choices) > 1  # a single choice is an alternative to a number, in the help text
    words = [argument.parameter.help, f"one of {', '.join(choices)}" if several else ""]
    meaning = "; ".join(filter(None, words)).replace("|", "\\|")
    return f"| {names} | {meaning} | {_default(argument)} |"


def _default(argument: Argument) -> str:
    if argument.required:
        return "required"
    default = argument.field_info.default
    is_none = any(default is absent for absent in (None, False, argument.field_info.empty))
    return "" if is_none else f"`{default}`"


_HALF = 14  # studies of the first page
COMMANDS: Mapping[str, Callable[[App], str]] = {
    **{
        f"commands_{name}": partial(_group, title)
        for name, title in (
            ("plan", "Plan"), ("prove", "Prove"), ("look", "Look"), ("fly", "Fly"),
            ("measure", "Measure"), ("program", "This program"),
        )
    },
    "commands_library": partial(_family, name="library"),
    "studies_first": partial(_studies, slice(_HALF)),
    "studies_second": partial(_studies, slice(_HALF, None)),
}  # fmt: skip
