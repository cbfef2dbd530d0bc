"""The pages of the command line, made from the commands themselves."""

import re
from collections.abc import Sequence

from cyclopts import App
from cyclopts.argument import Argument

_FAMILIES = ("figure", "library", "study")  # commands that hold others


def commands_in_markdown(app: App) -> str:
    """Returns a part for each command but studies: how it is called, what it does, its options."""
    plain = [_command(f"cocap-opt {name}", app[name]) for name in _names(app, _FAMILIES)]
    return "\n\n".join([*plain, _family(app, "figure"), _family(app, "library")])


def studies_in_markdown(app: App) -> str:
    """Returns a part for each command of `cocap-opt study`."""
    return _family(app, "study")


def _family(app: App, name: str) -> str:
    inner = app[name]
    return "\n\n".join(
        _command(f"cocap-opt {name} {command}", inner[command]) for command in _names(inner)
    )


def _names(family: App, but: Sequence[str] = ()) -> list[str]:
    return [name for name in family if not name.startswith("-") and name not in but]


def _command(called: str, command: App) -> str:
    """Returns the part of one command, with its options as a table."""
    paragraphs = [" ".join(words.split()) for words in re.split(r"\n\s*\n", command.help or "")]
    told, _, example = "\n\n".join(paragraphs).partition("Example: ")
    arguments = [argument for argument in command.assemble_argument_collection() if argument.show]
    usage = " ".join([called, *(a.name for a in arguments if not a.name.startswith("-"))])
    parts = [
        f"## {called.removeprefix('cocap-opt ')}",
        f"```text\n{usage} [OPTIONS]\n```",
        told.strip(),
        f"For example:\n\n```sh\n{example.strip()}\n```" if example else "",
        "| option | meaning | default |\n|---|---|---|\n" + "\n".join(map(_row, arguments)),
    ]
    return "\n\n".join(part for part in parts if part)


def _row(argument: Argument) -> str:
    """Returns the line of an option in the table."""
    names = ", ".join(f"`{name}`" for name in argument.names)
    choices = argument.get_choices()
    words = [argument.parameter.help, f"one of {', '.join(choices)}" if choices else ""]
    meaning = "; ".join(filter(None, words)).replace("|", "\\|")
    return f"| {names} | {meaning} | {_default(argument)} |"


def _default(argument: Argument) -> str:
    if argument.required:
        return "required"
    default = argument.field_info.default
    is_none = any(default is absent for absent in (None, False, argument.field_info.empty))
    return "" if is_none else f"`{default}`"
