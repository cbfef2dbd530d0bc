"""Options of commands: lists of numbers, values by name, and words for what is not allowed."""

import math
from collections.abc import Iterable, Sequence

from cocap_opt.vision.coverage import usable_cores

LARGEST = 2**63 - 1  # what JSON readers can take
_MOST = 100_000  # numbers in a list


class UsageError(ValueError):
    """An option has a value that is not allowed; the message names it."""


def choose(option: str, value: str, allowed: Iterable[str]) -> None:
    """Refuses a value that is not among the allowed ones."""
    words = list(allowed)
    if value not in words:
        raise UsageError(f"{option}: must be one of {', '.join(words)}, not {value!r}")


def check_seconds(option: str, value: float) -> None:
    """Refuses what is no number of seconds; 0 is one, in which everything but a search is done."""
    if not (value >= 0 and math.isfinite(value)):
        raise UsageError(f"{option}: must be a finite number of seconds >= 0, not {value}")


def check_workers(option: str, count: int | None) -> None:
    """Refuses a number of processes unless there is at least one, and a core for each."""
    if count is not None and not 1 <= count <= usable_cores():
        raise UsageError(f"{option}: must be 1..{usable_cores()}, a core each, not {count}")


def numbers(option: str, text: str) -> tuple[int, ...]:
    """Returns the numbers of a list of numbers and ranges such as "0-9,12", each once.

    Raises
    ------
    UsageError
        If it is no such list; the message names the option.
    """
    found: list[int] = []
    for part in text.split(","):
        first, dash, last = part.partition("-")
        ends = (first, last) if dash else (first,)
        if not all(end.isdecimal() for end in ends):
            raise UsageError(f"{option}: must be numbers and ranges such as 0-9,12, not {text!r}")
        if max(map(len, ends)) >= len(str(LARGEST)):
            raise UsageError(f"{option}: must be 0..{LARGEST}")
        wanted = range(int(first), int(last or first) + 1)
        if not wanted:
            raise UsageError(f"{option}: ranges must go up, not {part!r}")
        if len(found) + len(wanted) > _MOST:
            raise UsageError(f"{option}: must be at most {_MOST} numbers")
        found += wanted
    return tuple(dict.fromkeys(found))


def values(option: str, words: Sequence[str]) -> dict[str, str]:
    """Returns values by name, from words NAME=VALUE.

    Raises
    ------
    UsageError
        If one is no such pair, or a name is there twice; the message names the option.
    """
    found: dict[str, str] = {}
    for word in words:
        name, equals, value = word.partition("=")
        if not equals:
            raise UsageError(f"{option}: must be NAME=VALUE, not {word!r}")
        if name in found:
            raise UsageError(f"{option}: {name!r} must be given only once")
        found[name] = value
    return found
