"""The rows of a text file of tracks, as numbers; ids may be words."""

import io
import re
from collections.abc import Iterator
from datetime import UTC, datetime

import numpy as np
from numpy.typing import NDArray

from cocap_opt.data import FloatArray, ProblemError
from cocap_opt.scenarios.recipe.track_layout import (
    Columns,
    Layout,
    fields_of,
    is_number,
    require_values,
)

Values = dict[str, FloatArray]  # role -> [n]; ids that are words are kept apart
_A_DATE = "a date with a time such as 2026-05-01T10:00:00.25"
_DATE = re.compile(r"\d{4}-\d\d-\d\d[T ]")
_DECIMAL_COMMA = re.compile(r"[-+]?\d*,\d+")


def values_of(
    text: str, layout: Layout, places: Columns, count: int
) -> tuple[Values, NDArray[np.str_] | None]:
    """Returns the numbers of all columns that are used, and the ids where they are words.

    Dates with times become seconds since the first of them.
    """
    words = not is_number(layout.row[places["id"]])
    if not words:
        try:
            # This is a hundred times faster than the loop, and refuses all but plain numbers.
            table = np.loadtxt(
                io.StringIO(text), delimiter=layout.delimiter, skiprows=layout.first - 1, ndmin=2
            )
            return {role: table[:, place] for role, place in places.items()}, None
        except ValueError:
            pass  # the loop reads it, or names the line that is wrong
    columns = {role: place for role, place in places.items() if not (words and role == "id")}
    rows = _rows(text, layout, count)
    is_dated = "time" in places and _DATE.match(layout.row[places["time"]])
    read = {role: _moment if is_dated and role == "time" else _number for role in columns}
    numbers = (read[role](row[k], line, role) for line, row in rows for role, k in columns.items())
    table = np.fromiter(numbers, np.float64).reshape(-1, len(columns))
    values = dict(zip(columns, table.T, strict=True))
    if is_dated:
        # Seconds since 1970 have no digits left for what is smaller.
        values["time"] = np.round(values["time"] - values["time"].min(), 6)
    if not words:
        return values, None
    return values, np.array(
        [_word(row[places["id"]], line) for line, row in _rows(text, layout, count)]
    )


def row_lines(text: str, layout: Layout) -> Iterator[tuple[int, str]]:
    """Yields the lines that are rows, without comments, each with its number."""
    for line, raw in enumerate(io.StringIO(text), start=1):
        content = raw.partition("#")[0]
        if line >= layout.first and content.strip():
            yield line, content


def _rows(text: str, layout: Layout, count: int) -> Iterator[tuple[int, list[str]]]:
    for line, content in row_lines(text, layout):
        row = fields_of(content, layout.delimiter)
        require_values(line, count, row, layout.delimiter)
        yield line, row


def _number(text: str, line: int, role: str) -> float:
    if is_number(text):
        return float(text)
    if _DECIMAL_COMMA.fullmatch(text):
        raise ProblemError(
            f"line {line}, {role}: must have a decimal point, not a comma: {text[:40]!r}"
        )
    allowed = f"seconds, or {_A_DATE}" if role == "time" else "a number"
    raise ProblemError(f"line {line}, {role}: must be {allowed}, not {text[:40]!r}")


def _moment(text: str, line: int, role: str) -> float:
    """Returns the seconds of a date with a time; without an offset, by a clock of its own."""
    try:
        found = datetime.fromisoformat(text)
    except ValueError:
        raise ProblemError(
            f"line {line}, {role}: must be {_A_DATE}, as in the first row, not {text[:40]!r}"
        ) from None
    return (found if found.tzinfo else found.replace(tzinfo=UTC)).timestamp()


def _word(text: str, line: int) -> str:
    if not text:
        raise ProblemError(f"line {line}, id: must not be empty")
    return text
