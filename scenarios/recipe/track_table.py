"""Files of tracked people as tables of numbers, in seconds and metres.

A row is a person at a moment. In text, fields are separated by blanks, commas or semicolons; `#`
begins a comment; numbers have decimal points. Before the rows may stand a line of names, and
comments that state the columns, their unit and the frame rate, as PeTrack and JuPedSim write them:

    # framerate: 25 fps
    # id frame x/m y/m z/m

JuPedSim's own files are databases, which say all of this (`track_database`).
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from itertools import islice
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cocap_opt.data import LARGEST, FloatArray, IntArray, ProblemError
from cocap_opt.scenarios.foreign import GPX, SQLITE, require
from cocap_opt.scenarios.recipe.earth import Projection
from cocap_opt.scenarios.recipe.tables import PER_METRE
from cocap_opt.scenarios.recipe.track_database import Database
from cocap_opt.scenarios.recipe.track_layout import (
    Layout,
    check_rate,
    per_second,
    places_of,
    settled,
    settled_rate,
)
from cocap_opt.scenarios.recipe.track_order import in_likely_order
from cocap_opt.scenarios.recipe.track_rows import Values, row_lines, values_of
from cocap_opt.scenarios.text import read_text

DELIMITERS = (" ", "\t", ",", ";")
MOST = 1e12  # of ids, frames and times, which may count seconds since 1970


_MOST = {"x": LARGEST, "y": LARGEST, "z": LARGEST, "latitude": 90.0, "longitude": 180.0}


class TrackTable(NamedTuple):
    """The rows of a file, in its order."""

    ids: IntArray | NDArray[np.str_]  # [n]
    times: FloatArray  # [n] s
    points: FloatArray  # [n, 2] m
    heights: FloatArray | None  # [n] m, the column z
    where: Callable[[int], str]  # names a row's place, such as "line 7"; slow, for messages
    unit: str  # of the file
    rate: float | None  # frames/s; None: the file has times

    @classmethod
    def read(
        cls,
        path: Path,
        columns: Sequence[str] | None,
        unit: str | None,
        fps: float | None,
        delimiter: str | None,
        projection: Projection,
    ) -> "TrackTable":
        """Reads the rows of a file; the parameters are those of `Track.read_all`.

        Raises
        ------
        ProblemError
            If something is missing, not allowed, or stated otherwise by the file; one line,
            without the file's name.
        """
        _check_options(unit, fps, delimiter)
        require(path, (SQLITE, GPX))
        if not Database.is_one(path):
            return cls._of_text(read_text(path), columns, unit, fps, delimiter, projection)
        for field, value in {"columns": columns, "delimiter": delimiter}.items():
            if value is not None:
                raise ProblemError(f"{field}: must be left out for a database of JuPedSim")
        database = Database.read(path)
        _check(database.values, Database.where)
        rate = settled_rate(database.rates, fps)
        unit = settled("unit", {database.unit}, unit)
        return cls._of(database.values, None, Database.where, unit, rate)

    @classmethod
    def _of_text(
        cls,
        text: str,
        columns: Sequence[str] | None,
        unit: str | None,
        fps: float | None,
        delimiter: str | None,
        projection: Projection,
    ) -> "TrackTable":
        layout = Layout.of(text, delimiter)
        names = layout.names(columns)
        with _in_guessed_order(columns is None and layout.names_nothing()):
            return cls._of_layout(text, layout, columns, names, unit, fps, projection)

    @classmethod
    def _of_layout(
        cls,
        text: str,
        layout: Layout,
        columns: Sequence[str] | None,
        names: Sequence[str],
        unit: str | None,
        fps: float | None,
        projection: Projection,
    ) -> "TrackTable":
        places = places_of(names, "columns" if columns else "header")
        is_in_degrees = "latitude" in places
        unit = settled("unit", layout.units(names), "m" if is_in_degrees and not unit else unit)
        rate = layout.rate(places, fps)
        values, words = values_of(text, layout, places, len(names))

        def where(row: int) -> str:
            return f"line {next(islice(row_lines(text, layout), row, None))[0]}"

        _check(values, where)
        if is_in_degrees:
            points = projection.metres(values.pop("latitude"), values.pop("longitude"))
            values["x"], values["y"] = PER_METRE[unit] * points.T
        if "time" in places:
            values["time"] = values["time"] / per_second(names[places["time"]])
        if columns is None and layout.names_nothing():
            values = in_likely_order(values, PER_METRE[unit], 1.0 if rate is None else rate)
        return cls._of(values, words, where, unit, rate)

    @classmethod
    def _of(
        cls,
        values: Values,
        words: NDArray[np.str_] | None,
        where: Callable[[int], str],
        unit: str,
        rate: float | None,
    ) -> "TrackTable":
        per_metre = PER_METRE[unit]
        return cls(
            ids=values["id"].astype(np.int64) if words is None else words,
            times=values["time"] if rate is None else values["frame"] / rate,
            points=np.column_stack([values["x"], values["y"]]) / per_metre,
            heights=values["z"] / per_metre if "z" in values else None,
            where=where,
            unit=unit,
            rate=rate,
        )


@contextmanager
def _in_guessed_order(is_guessed: bool) -> Iterator[None]:
    """Says in errors that nothing names the columns, where that is so."""
    try:
        yield
    except ProblemError as error:
        if not is_guessed or str(error).startswith("columns"):
            raise
        raise ProblemError(
            f"{error}; the file has no header, so that its columns are read as id, frame, x, y: "
            'columns = ["id", "time", "x", "y"] would have times there'
        ) from error


def _check_options(unit: str | None, fps: float | None, delimiter: str | None) -> None:
    if unit is not None and unit not in PER_METRE:
        raise ProblemError(f"unit: must be {', '.join(PER_METRE)}, not {unit!r}")
    if fps is not None:
        check_rate(fps)
    if delimiter is not None and delimiter not in DELIMITERS:
        allowed = "a blank, a tabulator, a comma or a semicolon"
        raise ProblemError(f"delimiter: must be {allowed}, not {delimiter!r}")


def _check(values: Values, where: Callable[[int], str]) -> None:
    """Raises unless all numbers are finite and within limits, ids and frames whole."""
    for role, column in values.items():
        most = _MOST.get(role, MOST)
        whole = role in ("id", "frame")
        wrong = ~(np.abs(column) <= most)  # true for nan, too
        if whole:
            wrong |= column != np.floor(column)
        if wrong.any():
            row = int(np.argmax(wrong))
            kind = "a whole number" if whole else "a number"
            raise ProblemError(
                f"{where(row)}, {role}: must be {kind} within +-{most:g}, not {column[row]:g}"
            )
