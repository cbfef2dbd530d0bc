"""Usage lines of commands, made from their functions."""

import inspect
from collections.abc import Callable, Iterator
from typing import Any, get_args

from cyclopts import App


def usage_of(called: str, command: Callable[..., Any]) -> str:
    """Returns the usage line of a command, with optional parts in brackets.

    Parameters
    ----------
    called : name of the command, preceded by those of the program and of the family
    """
    return " ".join(["Usage:", called, *_words(command)])


def set_usages(family: App, called: str) -> None:
    """Sets the usage lines of all commands of a family.

    Parameters
    ----------
    called : name of the family, preceded by that of the program
    """
    for name in family:
        if (command := family[name].default_command) is not None and not name.startswith("-"):
            family[name].usage = usage_of(f"{called} {name}", command)


def _words(command: Callable[..., Any]) -> Iterator[str]:
    """Yields the arguments, required options, and a word for all other options."""
    parameters = inspect.signature(command).parameters.values()
    for each in parameters:
        name = each.name.upper()
        if each.kind is each.VAR_POSITIONAL:
            yield f"[{name}...]"
        elif each.kind is each.POSITIONAL_ONLY:
            yield name if each.default is each.empty else f"[{name}]"
    options = [each for each in parameters if each.kind is each.KEYWORD_ONLY]
    for each in options:
        if each.default is each.empty:
            yield f"{_option(each)} PATH"
    if any(each.default is not each.empty for each in options):
        yield "[OPTIONS]"


def _option(parameter: inspect.Parameter) -> str:
    """Returns the first name of an option, as its annotation has it."""
    _, *notes = get_args(parameter.annotation)
    return next((name for note in notes for name in note.name), f"--{parameter.name}")
