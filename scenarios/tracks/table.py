"""Files of tracked people as tables of numbers, in seconds and metres.

A row is a person at a moment. In text, fields are separated by blanks, commas or semicolons; `#`
begins a comment; numbers have decimal points. Before the rows may stand a line of names, and
comments that state the columns, their unit and the frame rate, as PeTrack and JuPedSim write them:

    # framerate: 25 fps
    # id frame x/m y/m z/m

A row of units may stand below the names, as Pathfinder writes it. JuPedSim's own files are
databases, which say all of this (`track_database`); GPX is what receivers of GPS record (`gpx`).
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from itertools import islice
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cocap_opt.data import LARGEST, FloatArray, IntArray, ProblemError
from cocap_opt.scenarios.earth.place import Projection
from cocap_opt.scenarios.foreign import GPX, SQLITE, kind_of
from cocap_opt.scenarios.tables import PER_METRE
from cocap_opt.scenarios.text import read_text
from cocap_opt.scenarios.tracks.columns import PER_SECOND, Name, Places, places_of, settled
from cocap_opt.scenarios.tracks.database import Database
from cocap_opt.scenarios.tracks.gpx import Gpx
from cocap_opt.scenarios.tracks.layout import Layout, check_rate, settled_rate
from cocap_opt.scenarios.tracks.order import in_likely_order
from cocap_opt.scenarios.tracks.rows import Values, column_of, row_lines, values_of
from cocap_opt.scenarios.tracks.times import (
    Clock,
    is_date,
    times_of_dates,
    times_of_numbers,
)

DELIMITERS = (" ", "\t", ",", ";")
MOST = 1e12  # of ids, frames and times
HEADS = 0.9, 2.5  # m, the median of what is called a height; names such as z promise less
_MOST = {"x": LARGEST, "y": LARGEST, "z": LARGEST, "latitude": 90.0, "longitude": 180.0}


class Form(NamedTuple):
    """The form of a file as the caller states it; None: the file states it."""

    columns: Sequence[str] | None = None
    unit: str | None = None
    fps: float | None = None
    delimiter: str | None = None
    time_unit: str | None = None

    def require_left_out(self, what: str, *fields: str) -> None:
        """Raises a ProblemError if a field is given that a kind of files has no use for."""
        for field in fields:
            if getattr(self, field) is not None:
                raise ProblemError(f"{field}: must be left out for {what}")


class TrackTable(NamedTuple):
    """The rows of a file, in its order."""

    ids: IntArray | NDArray[np.str_]  # [n]
    times: FloatArray  # [n] s
    points: FloatArray  # [n, 2] m
    heights: FloatArray | None  # [n] m, the column z
    where: Callable[[int], str]  # names a row's place, such as "line 7"; slow, for messages
    unit: str  # of the file
    rate: float | None  # frames/s; None: the file has times
    clock: Clock | None = None  # of times that are dates
    segments: IntArray | None = None  # [n] numbers of parts between which nothing was recorded
    stamps: FloatArray | None = None  # [n] s, of a column of times where frames are used instead

    @classmethod
    def read(cls, path: Path, form: Form, projection: Projection) -> "TrackTable":
        """Reads the rows of a file.

        Raises
        ------
        ProblemError
            If something is missing, not allowed, or stated otherwise by the file; one line,
            without the file's name.
        """
        _check_options(form)
        kind = kind_of(path)
        if kind is SQLITE:
            return cls._of_database(path, form)
        if kind is GPX:
            return cls._of_gpx(path, form, projection)
        return cls._of_text(read_text(path), form, projection)

    @classmethod
    def _of_database(cls, path: Path, form: Form) -> "TrackTable":
        form.require_left_out("a database of JuPedSim", "columns", "delimiter", "time_unit")
        database = Database.read(path)
        _check(database.values, Database.where)
        rate = settled_rate(database.rates, form.fps)
        unit = settled("unit", {database.unit}, form.unit)
        return cls._of(database.values, None, Database.where, unit, rate)

    @classmethod
    def _of_gpx(cls, path: Path, form: Form, projection: Projection) -> "TrackTable":
        form.require_left_out("GPX", "columns", "delimiter", "time_unit", "fps")
        gpx = Gpx.read(path)
        return cls(
            ids=np.array(gpx.ids),
            times=gpx.times.seconds,
            points=projection.metres(*gpx.degrees.T),
            heights=None,
            where=gpx.places.__getitem__,
            unit=settled("unit", {"m"}, form.unit),
            rate=None,
            clock=gpx.times.clock,
            segments=gpx.segments,
        )

    @classmethod
    def _of_text(cls, text: str, form: Form, projection: Projection) -> "TrackTable":
        layout = Layout.of(text, form.delimiter)
        names = layout.names(form.columns)
        with _in_guessed_order(form.columns is None and layout.names_nothing()):
            return cls._of_layout(text, layout, names, form, projection)

    @classmethod
    def _of_layout(
        cls, text: str, layout: Layout, names: Sequence[str], form: Form, projection: Projection
    ) -> "TrackTable":
        places = places_of(names, "columns" if form.columns else "header")
        is_in_degrees = "latitude" in places
        default = "m" if is_in_degrees and not form.unit else form.unit
        unit = settled("unit", layout.units(names), default)
        time_unit = _time_unit(layout, names, places, form.time_unit)
        rate = layout.rate(places, form.fps)
        stamps = None
        if rate is not None:
            form.require_left_out("frames, whose rate is fps", "time_unit")
            with suppress(ProblemError):  # what is not used may be anything
                if "time" in places:
                    stamps = _values(text, layout, places, len(names), time_unit)[0]["time"]
            places.pop("time", None)
        if "time" in places and is_date(layout.row[places["time"]]):
            form.require_left_out("dates", "time_unit")
        values, words, clock = _values(text, layout, places, len(names), time_unit)

        def where(row: int) -> str:
            return f"line {next(islice(row_lines(text, layout), row, None))[0]}"

        _check(values, where)
        if is_in_degrees:
            points = projection.metres(values.pop("latitude"), values.pop("longitude"))
            values["x"], values["y"] = PER_METRE[unit] * points.T
        if form.columns is None and layout.names_nothing():
            values = in_likely_order(values, PER_METRE[unit], 1.0 if rate is None else rate)
        table = cls._of(values, words, where, unit, rate)._replace(clock=clock, stamps=stamps)
        if "z" in places and names[places["z"]].strip().lower().startswith("height"):
            _require_heads(table, names)
        return table

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


def _values(
    text: str, layout: Layout, places: Places, count: int, time_unit: str | None
) -> tuple[Values, NDArray[np.str_] | None, Clock | None]:
    """Returns the columns with times in seconds, the ids where they are words, and the clock."""
    if "time" not in places:
        return *values_of(text, layout, places, count), None

    def texts() -> Iterator[tuple[int, str]]:
        return column_of(text, layout, places["time"], count)

    if is_date(layout.row[places["time"]]):
        times = times_of_dates(texts())
        others = {role: place for role, place in places.items() if role != "time"}
        values, words = values_of(text, layout, others, count)
    else:
        values, words = values_of(text, layout, places, count)
        ids = values["id"] if words is None else None
        times = times_of_numbers(values["time"], ids, time_unit, texts)
    return values | {"time": times.seconds}, words, times.clock


def _time_unit(
    layout: Layout, names: Sequence[str], places: Places, given: str | None
) -> str | None:
    """Returns the unit of times that the file or the caller states; None if neither does."""
    stated = layout.time_units(names, places["time"]) if "time" in places else set()
    return settled("time_unit", stated, given) if stated or given else None


def _require_heads(table: TrackTable, names: Sequence[str]) -> None:
    """Raises a ProblemError if a column called height is hardly one of heads above the floor."""
    heights = table.heights
    if heights is None or not (heights > 0).any():
        return
    median = float(np.median(heights[heights > 0]))
    if HEADS[0] <= median <= HEADS[1]:
        return
    kept = ", ".join(
        f'"{"-" if Name.of(name).role == "z" else Name.of(name).role or "-"}"' for name in names
    )
    raise ProblemError(
        f"height: must be that of heads above the floor, {HEADS[0]:g}..{HEADS[1]:g} m, not "
        f"{median:.3g} m, its median: is it that of boxes, or is the unit {table.unit} right? "
        f"columns = [{kept}] in [[tracks]] leaves it out"
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


def _check_options(form: Form) -> None:
    if form.unit is not None and form.unit not in PER_METRE:
        raise ProblemError(f"unit: must be {', '.join(PER_METRE)}, not {form.unit!r}")
    if form.time_unit is not None and form.time_unit not in PER_SECOND:
        raise ProblemError(f"time_unit: must be {', '.join(PER_SECOND)}, not {form.time_unit!r}")
    if form.fps is not None:
        check_rate(form.fps)
    if form.delimiter is not None and form.delimiter not in DELIMITERS:
        allowed = "a blank, a tabulator, a comma or a semicolon"
        raise ProblemError(f"delimiter: must be {allowed}, not {form.delimiter!r}")


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
                + ("; is it a time? Name it time in columns" if role == "frame" else "")
            )
