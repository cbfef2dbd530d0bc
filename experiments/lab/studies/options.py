"""Options that several studies share, with their help texts and allowed values."""

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter, Token

from cocap_opt.files.documents import FileError
from cocap_opt.run.options import Option, UsageError


def _positive(kind: object, tokens: Sequence[Token]) -> float:
    """Returns a number of seconds, which must be positive."""
    text = tokens[0].value
    try:
        seconds = float(text)
    except ValueError:
        seconds = math.nan
    if not 0 < seconds < math.inf:
        words = f"must be a positive number of seconds, not {text[:40]}"
        raise UsageError(f"{tokens[0].keyword}: {words}")
    return seconds


def _cores(kind: object, tokens: Sequence[Token]) -> int | None:
    """Returns a number of processes, which must not exceed the number of cores."""
    option = Option(tokens[0].keyword or "")
    return option.require_cores(option.whole(tokens[0].value))


positive_seconds = partial(Parameter, converter=_positive)


Out = Annotated[Path | None, Parameter(help="folder for the results")]
Scenes = Annotated[
    list[str] | None, Parameter(negative="", consume_multiple=True, help="scenes or files")
]
Seeds = Annotated[str, Parameter(help="seeds of each scene")]
Seconds = Annotated[float, positive_seconds(help="seconds for each run")]
Workers = Annotated[
    int | None,
    Parameter(converter=_cores, help="worker processes, one per core (default: this process only)"),
]


@contextmanager
def of_extra(extra: str) -> Iterator[None]:
    """Turns a missing package into an error that names the extra to install."""
    try:
        yield
    except ModuleNotFoundError as error:
        words = f"{error.name} is not installed: pip install -e '.[{extra}]'"
        raise FileError(words) from error


@contextmanager
def chromium(purpose: str) -> Iterator[None]:
    """Turns a missing browser or its missing packages into a readable error.

    Parameters
    ----------
    purpose : the file or the study that needs it
    """
    try:
        with of_extra("test"):
            yield
    except FileNotFoundError as error:
        raise FileError(f"{purpose}: {error}") from error
