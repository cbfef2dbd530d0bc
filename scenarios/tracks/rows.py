"""The rows of a text file of tracks, as numbers; ids may be words."""

import io
import re
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from cocap_opt.data import FloatArray, ProblemError
from cocap_opt.scenarios.tracks.columns import Places
from cocap_opt.scenarios.tracks.layout import (
    Layout,
    fields_of,
    is_number,
    require_values,
)
from cocap_opt.scenarios.tracks.times import A_DATE

Values = dict[str, FloatArray]  # role -> [n]; ids that are words are kept apart
_DECIMAL_COMMA = re.compile(r"[-+]?\d*,\d+")


def values_of(
    text: str, layout: Layout, places: Places, count: int
) -> tuple[Values, NDArray[np.str_] | None]:
    """Returns the numbers of columns, by their places, and the ids where they are words."""
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
    numbers = (_number(row[k], line, role) for line, row in rows for role, k in columns.items())
    table = np.fromiter(numbers, np.float64).reshape(-1, len(columns))
    values = dict(zip(columns, table.T, strict=True))
    if not words:
        return values, None
    return values, np.array(
        [_word(field, line) for line, field in column_of(text, layout, places["id"], count)]
    )


def column_of(text: str, layout: Layout, place: int, count: int) -> Iterator[tuple[int, str]]:
    """Yields the fields of a column as they stand, each with the number of its line."""
    return ((line, row[place]) for line, row in _rows(text, layout, count))


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
    allowed = f"seconds, or {A_DATE}" if role == "time" else "a number"
    raise ProblemError(f"line {line}, {role}: must be {allowed}, not {text[:40]!r}")


def _word(text: str, line: int) -> str:
    if not text:
        raise ProblemError(f"line {line}, id: must not be empty")
    return text
