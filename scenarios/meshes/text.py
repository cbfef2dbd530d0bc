"""Lines and numbers of mesh files that are text, of any encoding."""

from collections.abc import Iterator, Sequence
from pathlib import Path

from cocap_opt.data import ProblemError
from cocap_opt.scenarios.text import plain_number


def lines(path: Path) -> Iterator[tuple[int, str]]:
    """Yields the lines of a file with their numbers from 1; comments need not be UTF-8."""
    content = path.read_bytes()
    if b"\0" in content:
        raise ProblemError("must be text of one byte a letter, not binary or UTF-16")
    text = content.decode("utf-8-sig", errors="replace")
    # Not by `splitlines`, which ends lines at letters of other encodings, too.
    ends = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    yield from enumerate(ends, start=1)


def numbers(values: Sequence[str], place: int | str) -> list[float]:
    """Returns the numbers that words spell at a place, the number of a line or a name.

    Raises
    ------
    ProblemError
        If one is no number.
    """
    try:
        return [plain_number(value) for value in values]
    except ValueError as error:
        raise ProblemError(
            f"{_named(place)}: must be numbers with a decimal point, not {' '.join(values)[:40]!r}"
        ) from error


def _named(place: int | str) -> str:
    return place if isinstance(place, str) else f"line {place}"


def whole(values: Sequence[str], line: int) -> list[int]:
    """Returns the whole numbers that words of a line spell.

    Raises
    ------
    ProblemError
        If one is no whole number.
    """
    found = numbers(values, line)
    if not all(value.is_integer() for value in found):
        raise ProblemError(f"line {line}: must be whole numbers, not {' '.join(values)[:40]!r}")
    return [int(value) for value in found]
