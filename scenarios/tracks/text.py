"""Reader of tracked people in text files.

Fields are separated by blanks, commas or semicolons; `#` begins a comment at the start of a line or
after a blank; numbers have decimal points; ids may be words. The rows may be preceded by a line of
names and by comments that state the columns, their unit and the frame rate, in the style of PeTrack
and JuPedSim:

    # framerate: 25 fps
    # id frame x/m y/m z/m

A row of units may follow the names, as in files of Pathfinder.
"""

import io
import logging
import math
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cocap_opt.data import BoolArray, FloatArray, IntArray, ProblemError
from cocap_opt.scenarios.earth import same_system, short_name
from cocap_opt.scenarios.earth.place import MapProjection
from cocap_opt.scenarios.tables import PER_METRE
from cocap_opt.scenarios.text import read_text, require_no_comma
from cocap_opt.scenarios.tracks.layout import (
    Name,
    Places,
    TextLayout,
    fields_of,
    is_number,
    places_of,
    require_degrees,
    require_ids,
    require_values,
    without_comment,
)
from cocap_opt.scenarios.tracks.other_columns import OtherColumns
from cocap_opt.scenarios.tracks.table import Form, TrackTable, Values, require_numbers, settled
from cocap_opt.scenarios.tracks.times import (
    A_CLOCK,
    A_DATE,
    Epoch,
    is_clock,
    is_date,
    require_no_clock_set_back,
    times_of_clock,
    times_of_dates,
    times_of_numbers,
)

log = logging.getLogger(__name__)

HEADS = 0.9, 2.5  # m, allowed median of a column called height; a name such as z is less specific
# smallest factor by which distances in the wrong order of columns exceed those in the right one
_FAR_CLEARER = 10.0
_FASTEST = 12.0  # m/s, of people
_STANDS = 0.5  # m, way of a person whose direction is not known from it
_AXES = {"x", "y", "latitude", "longitude"}
_ENDING_ZEROS = re.compile(r"\.0*$")
_MISSING = {"", "na", "n/a", "null", "none", "-"}  # besides nan, which is a number


def read_text_table(path: Path, form: Form, projection: MapProjection) -> TrackTable:
    """Reads the rows of a text file.

    Raises
    ------
    ProblemError
        If something is missing or not allowed, or if the file states something else; one line,
        without the file's name.
    """
    text = read_text(path)
    layout = TextLayout.of(text, form.delimiter)
    names = layout.names(form.columns)
    with _in_guessed_order(form.columns is None and layout.names_nothing()):
        return _of_layout(path, text, layout, names, form, projection)


def _of_layout(
    path: Path, text: str, layout: TextLayout, names: Sequence[str], form: Form,
    projection: MapProjection,
) -> TrackTable:  # fmt: skip
    field = "columns" if form.columns else "header"
    places = places_of(names, field)

    def fields(place: int) -> Iterator[tuple[int, str]]:
        return _column_of(text, layout, place, len(names))

    others = OtherColumns(names, places.copy(), fields)
    is_in_degrees = "latitude" in places
    if not is_in_degrees:
        _require_system(layout, projection)
        others.require_system(projection)
    stated = layout.units(names)
    default = "m" if is_in_degrees and not (form.unit or stated) else form.unit
    unit = settled("unit", stated, default)
    time_unit = _time_unit(layout, names, places, form.time_unit)
    rate = layout.rate(places, form.fps)
    stamps = None
    if rate is not None:
        form.require_left_out("frames, whose rate is fps", "time_unit")
        stamps = _stamps(text, layout, places, len(names), time_unit)
        places.pop("time", None)
    _require_no_time_unit(layout, places, form)
    values, words, clock = _values(text, layout, places, len(names), time_unit)
    if "id" not in places:
        words = _one_person(path, values, names, field)
    kept = _found(path, values, others.lost())
    values = {role: column[kept] for role, column in values.items()}
    words = words if words is None else words[kept]
    stamps = stamps if stamps is None else stamps[kept]

    def where(row: int) -> str:
        return f"line {next(islice(_row_lines(text, layout), int(kept[row]), None))[0]}"

    require_numbers(values, where)
    layout.require_one_order(names)
    others.require_one_recording()
    if rate is None:
        others.require_whole_times()
    if is_in_degrees:
        require_degrees(names, places)
        _require_signs(text, layout, names, values)
        points = projection.metres(values.pop("latitude"), values.pop("longitude"))
        values["x"], values["y"] = PER_METRE[unit] * points.T
    if form.columns is None and layout.names_nothing():
        values = _in_likely_order(values, PER_METRE[unit], 1.0 if rate is None else rate)
    table = TrackTable.of(values, words, where, unit, rate)._replace(clock=clock, stamps=stamps)
    first = layout.row[places["time"]] if "time" in places else ""
    if is_clock(first) or (clock is not None and not clock.is_universal):
        require_no_clock_set_back(table.ids, table.times, table.where)
    _warn_of_others(path, others, table)
    if "z" in places and names[places["z"]].strip().lower().startswith("height"):
        _require_heads(table, names)
    return table


def _warn_of_others(path: Path, others: OtherColumns, table: TrackTable) -> None:
    """Warns of vehicles in the file, and of a stated direction of people who stand."""
    if kinds := others.not_people():
        log.warning("%s: %s, and all rows are read as people: name those to film in ids, or leave "
                    "the others out of the file", path, kinds)  # fmt: skip
    if (name := others.facing()) is None:
        return
    standing = [
        person
        for person in np.unique(table.ids)
        if np.ptp(table.points[table.ids == person], axis=0).max() < _STANDS
    ]
    if standing:
        log.warning(
            "%s: column %s is not read, and id %s stands: people look where they walk, and east if "
            "they never do; use a [[walk]] with one point and a heading for who stands",
            path, name, standing[0],
        )  # fmt: skip


def _require_system(layout: TextLayout, projection: MapProjection) -> None:
    """Raises ProblemError if comments name reference systems, but not that of the scene."""
    earth, named = projection.earth, layout.systems()
    if earth is None or earth.origin is not None or not named:
        return
    if not any(same_system(earth.crs, name) for name in named):
        raise ProblemError(
            f"x, y: must be in the reference system of the scene, {short_name(earth.crs)}, but a "
            f"comment names {named[0]}: convert them, e.g. with pyproj or cs2cs"
        )


def _stamps(
    text: str, layout: TextLayout, places: Places, columns: int, time_unit: str | None
) -> FloatArray | None:
    """Returns the times of rows that have frames as well; None if there are none, or no numbers,
    since values of unused columns are not checked.
    """
    if "time" in places:
        with suppress(ProblemError):
            return _values(text, layout, places, columns, time_unit)[0]["time"]
    return None


def _require_no_time_unit(layout: TextLayout, places: Places, form: Form) -> None:
    """Raises ProblemError if dates or times of day come with a unit of time."""
    if "time" not in places:
        return
    first = layout.row[places["time"]]
    for is_written, what in ((is_date, "dates"), (is_clock, "times of day")):
        if is_written(first):
            form.require_left_out(what, "time_unit")


def _one_person(path: Path, values: Values, names: Sequence[str], field: str) -> NDArray[np.str_]:
    """Returns the ids of rows without ids, which are the rows of one person, called like the file.

    Raises
    ------
    ProblemError
        If two rows have the same moment, so that several people must be in the file.
    """
    moments = values.get("time", values.get("frame", np.zeros(0)))
    if len(np.unique(moments)) < len(moments):
        require_ids(names, field)
    log.warning(
        "%s: no column is called id, so all rows are read as one person, %s", path, path.stem
    )
    return np.full(len(moments), path.stem)


def _found(path: Path, values: Values, marks: dict[str, BoolArray]) -> IntArray:
    """Returns the numbers of the rows that have a position, and are not marked as lost in columns.

    Cameras and tags lose people, and many programs write such moments as rows without numbers. If
    no row has a position, all are returned, so that the first one is reported.
    """
    axes = [values[role] for role in ("x", "y", "latitude", "longitude") if role in values]
    lost: BoolArray = np.asarray(np.isnan(axes).all(axis=0))
    for name, marked in marks.items():
        if marked.any():
            log.warning(
                '%s: %d of %d rows are left out, as column %s marks them; "-" in its place in '
                "columns of [[tracks]] keeps them",
                path, marked.sum(), len(marked), name,
            )  # fmt: skip
    gone = np.logical_or.reduce([lost, *marks.values()])
    if gone.all() and not lost.all():
        raise ProblemError(f"{', '.join(marks)}: must not mark all rows as rows without a person")
    if not lost.any() or lost.all():
        return np.flatnonzero(~gone) if not lost.all() else np.arange(len(lost))
    log.warning(
        "%s: %d of %d rows have no position and are left out; people are assumed to walk straight "
        "across short gaps, and to be absent during gaps longer than `gap`",
        path, lost.sum(), len(lost),
    )  # fmt: skip
    return np.flatnonzero(~gone)


def _require_signs(text: str, layout: TextLayout, names: Sequence[str], values: Values) -> None:
    """Raises a ProblemError if letters in a column, not signs, mean south or west."""
    for role, letters in {"latitude": ("N", "S"), "longitude": ("E", "W")}.items():
        for place, field in enumerate(layout.row):
            if field.upper() not in letters or (values[role] < 0).any():
                continue
            found = _column_of(text, layout, place, len(names))
            if any(word.upper() == letters[1] for _, word in found):
                raise ProblemError(
                    f"{names[place]}: must be left out, as degrees to the south and west must have "
                    f"a minus sign: write {role} as a negative number where it is {letters[1]}"
                )


def _values(
    text: str, layout: TextLayout, places: Places, count: int, time_unit: str | None
) -> tuple[Values, NDArray[np.str_] | None, Epoch | None]:
    """Returns the columns with times in seconds, the ids if they are words, and the clock."""
    if "time" not in places:
        return *_numbers_of(text, layout, places, count), None

    def texts() -> Iterator[tuple[int, str]]:
        return _column_of(text, layout, places["time"], count)

    first = layout.row[places["time"]]
    if is_date(first) or is_clock(first):
        seconds, clock = (
            times_of_dates(texts()) if is_date(first) else (times_of_clock(texts()), None)
        )
        others = {role: place for role, place in places.items() if role != "time"}
        values, words = _numbers_of(text, layout, others, count)
    else:
        values, words = _numbers_of(text, layout, places, count)
        ids = values.get("id")
        seconds, clock = times_of_numbers(values["time"], ids, time_unit, texts)
    return values | {"time": seconds}, words, clock


def _time_unit(
    layout: TextLayout, names: Sequence[str], places: Places, given: str | None
) -> str | None:
    """Returns the unit of times that the file or the caller states; None if neither does."""
    stated = layout.time_units(names, places["time"]) if "time" in places else set()
    return settled("time_unit", stated, given) if stated or given else None


def _require_heads(table: TrackTable, names: Sequence[str]) -> None:
    """Raises a ProblemError if a column called height is unlikely to contain heights of heads."""
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
        f"height: must be the height of heads above the floor, {HEADS[0]:g}..{HEADS[1]:g} m, but "
        f"its median is {median:.3g} m: is it the height of boxes, or is the unit {table.unit} "
        f"right? To leave it out, set columns = [{kept}] in [[tracks]]"
    )


@contextmanager
def _in_guessed_order(is_guessed: bool) -> Iterator[None]:
    """Adds to errors, if `is_guessed`, that nothing in the file names the columns."""
    try:
        yield
    except ProblemError as error:
        if not is_guessed or str(error).startswith("columns"):
            raise
        raise ProblemError(
            f"{error}; the file has no header, so its columns are read as id, frame, x, y; if the "
            'second column contains times, set columns = ["id", "time", "x", "y"]'
        ) from error


# -- rows


def _numbers_of(
    text: str, layout: TextLayout, places: Places, count: int
) -> tuple[Values, NDArray[np.str_] | None]:
    """Returns the numbers of columns, by their places, and the ids if they are words."""
    words = "id" in places and not is_number(layout.row[places["id"]])
    if not words:
        place = places.get("id", count)
        spelt: set[str] = set()
        try:
            # This is much faster than the loop, but reads only plain numbers.
            table = np.loadtxt(
                _noting(text, layout, place, spelt),
                delimiter=layout.delimiter, comments=None, ndmin=2,
            )  # fmt: skip
        except ValueError:  # the loop reads the rows or names the wrong line
            words = "id" in places and _has_words(text, layout, places["id"], count)
        else:
            _require_one_spelling(spelt)
            return {role: table[:, place] for role, place in places.items()}, None
    columns = {role: place for role, place in places.items() if not (words and role == "id")}
    rows = _rows(text, layout, count)
    numbers = (_number(row[k], line, role) for line, row in rows for role, k in columns.items())
    table = np.fromiter(numbers, np.float64).reshape(-1, len(columns))
    values = dict(zip(columns, table.T, strict=True))
    if "id" not in places:
        return values, None
    ids = [_word(field, line) for line, field in _column_of(text, layout, places["id"], count)]
    if not words:
        _require_one_spelling(set(ids))
        return values, None
    if places["id"] == count - 1:
        _require_whole_words(text, layout)
    return values, np.array(ids)


def _has_words(text: str, layout: TextLayout, place: int, count: int) -> bool:
    """Returns True if some id is no number; then all are words."""
    ids = {field for _, field in _column_of(text, layout, place, count)}
    return not all(map(is_number, ids))


def _noting(text: str, layout: TextLayout, place: int, spelt: set[str]) -> Iterator[str]:
    """Yields the rows, and adds the fields of a column, if there is one, to a set."""
    for _, content in _row_lines(text, layout):
        spelt.update(content.split(layout.delimiter, place + 1)[place : place + 1])
        yield content


def _require_one_spelling(ids: set[str]) -> None:
    """Raises a ProblemError if ids that are different texts are the same number, such as 7 and 07.

    They may be of different people; but 7 and 7.0 are one, as some programs write it as both.
    """
    first: dict[float, str] = {}
    for word in sorted({_ENDING_ZEROS.sub("", word.strip()) for word in ids}):
        # ids of many digits may be different whole numbers and the same double
        other = first.setdefault(int(word) if word.isdecimal() else float(word), word)
        if other != word:
            raise ProblemError(
                f"id: {other[:20]} and {word[:20]} must not both be ids, as they are the same "
                "number; write one of them if they are one person, or else different numbers"
            )


def _require_whole_words(text: str, layout: TextLayout) -> None:
    """Raises a ProblemError if a comment cuts off the number at the end of an id, as in P #1."""
    for line, raw in enumerate(io.StringIO(text), start=1):
        content, comment = without_comment(raw)
        if line >= layout.first and content.strip() and comment[:1].isdigit():
            raise ProblemError(
                f"line {line}, id: must not have a blank before #, which begins a comment: "
                f"#{comment.strip()[:40]}"
            )


def _column_of(text: str, layout: TextLayout, place: int, count: int) -> Iterator[tuple[int, str]]:
    """Yields the fields of a column as in the file, each with its line number."""
    return ((line, row[place]) for line, row in _rows(text, layout, count))


def _row_lines(text: str, layout: TextLayout) -> Iterator[tuple[int, str]]:
    """Yields the lines that are rows, without comments, each with its line number."""
    for line, raw in enumerate(io.StringIO(text), start=1):
        content, _ = without_comment(raw)
        if line >= layout.first and content.strip():
            yield line, content


def _rows(text: str, layout: TextLayout, count: int) -> Iterator[tuple[int, list[str]]]:
    for line, content in _row_lines(text, layout):
        row = fields_of(content, layout.delimiter)
        require_values(line, count, row, layout.delimiter)
        yield line, row


def _number(text: str, line: int, role: str) -> float:
    if is_number(text):
        return float(text)
    if role in _AXES and text.lower() in _MISSING:
        return math.nan
    require_no_comma(text, f"line {line}, {role}")
    allowed = f"seconds, {A_CLOCK}, or {A_DATE}" if role == "time" else "a number"
    raise ProblemError(f"line {line}, {role}: must be {allowed}, not {text[:40]!r}")


def _word(text: str, line: int) -> str:
    if not text:
        raise ProblemError(f"line {line}, id: must not be empty")
    return text


# -- the order of the columns id and frame in files without names of columns


def _in_likely_order(values: Values, metre: float, fps: float) -> Values:
    """Returns the columns; the rows decide which of the first two is the id and which the frame.

    In the right order, consecutive rows of one id are close together, and no faster than people
    are; rows of different people at one frame are not.

    Parameters
    ----------
    metre : one metre in the unit of the file

    Raises
    ------
    ProblemError
        If both orders fit.
    """
    if "frame" not in values or "id" not in values:
        return values
    points = np.column_stack([values["x"], values["y"]]) / metre
    orders = [("id", "frame"), ("frame", "id")]
    (usual, speed), (other, swapped) = (_pace(values[a], values[b], points) for a, b in orders)
    if usual * _FAR_CLEARER <= other or speed * fps <= _FASTEST < swapped * fps:
        return values
    if other * _FAR_CLEARER <= usual or swapped * fps <= _FASTEST < speed * fps:
        log.warning("the file has no header; judging by how people move, columns are frame id x y")
        return values | {"id": values["frame"], "frame": values["id"]}
    raise ProblemError(
        "columns: must be given, as the file has no header and its rows fit two orders: set "
        'columns = ["id", "frame", "x", "y"] or ["frame", "id", "x", "y"], with "z" if present'
    )


def _pace(ids: FloatArray, frames: FloatArray, points: FloatArray) -> tuple[float, float]:
    """Returns the median distance (m) between consecutive rows of one id, and the median per frame.

    Both are infinite if no id has two rows.
    """
    order = np.lexsort([frames, ids])
    same = np.flatnonzero((np.diff(ids[order]) == 0) & (np.diff(frames[order]) > 0))
    if not len(same):
        return math.inf, math.inf
    ways = np.diff(points[order], axis=0)[same]
    lengths = np.hypot(ways[:, 0], ways[:, 1])
    return float(np.median(lengths)), float(np.median(lengths / np.diff(frames[order])[same]))
