"""Files of tracked people as tables of numbers, in seconds and metres.

A row is a person at a moment. Fields are separated by blanks, commas or semicolons; `#` begins a
comment; numbers have decimal points. Before the rows may stand a line of names, and comments that
state the columns, their unit and the frame rate, as PeTrack and JuPedSim write them:

    # framerate: 25 fps
    # id frame x/m y/m z/m
"""

import io
import logging
import math
import re
from collections.abc import Callable, Iterator, Sequence
from itertools import islice
from pathlib import Path
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from cocap_opt.data import LARGEST, FloatArray, IntArray, ProblemError
from cocap_opt.scenarios.recipe.tables import PER_METRE
from cocap_opt.scenarios.text import read_text

log = logging.getLogger(__name__)

DELIMITERS = (" ", "\t", ",", ";")
MOST_FPS = 1e6
MOST = 1e12  # of ids, frames and times, which may count seconds since 1970

# Names of columns, spelt without capitals, blanks and underscores, and without a unit.
_SPELLINGS = {
    "id": "id persid personid person pedid pedestrianid pedestrian ped agentid agent trackid track",
    "frame": "frame frames fr frameid framenumber",
    "time": "time t seconds",
    "x": "x posx positionx",
    "y": "y posy positiony",
    "z": "z posz positionz height",
}
_ROLES = {word: role for role, words in _SPELLINGS.items() for word in words.split()}
_ORDER = ("id", "frame", "x", "y", "z")  # where nothing names the columns; z may be missing

_ANNOTATIONS = 10  # values in a row of annotations.txt; the last is a word
_FAR_CLEARER = 10.0  # times farther apart are the rows of one id in the wrong order of columns
_FASTEST = 12.0  # m/s, of people

_SHORT = {"centim": "cm", "millim": "mm", "foot": "ft", "feet": "ft"}
_UNIT = (
    r"(mm|cm|m|ft|foot|feet|(?:centi|milli)?met(?:re|er)s?"
    r"|px|pixels?|inch(?:es)?|yards?|dm|km)(?![\w/])"  # the last are refused
)
# As in "x/m", "x [m]" and "x_m", where any word but an axis is a unit.
_UNIT_OF_NAME = re.compile(r"^(.*?)(?:\s*[/\[(]\s*([^\W_]+)|_(m|cm|mm|ft|px)$)", re.IGNORECASE)
_DECIMAL_COMMA = re.compile(r"[-+]?\d*,\d+")
_UNIT_OF_TIME = re.compile(r"[/\[(]\s*(\w+)")
_UNIT_OF_COMMENT = re.compile(
    r"(?:\bunits?\s*[:=]\s*|(?<![\w/])[xyz]\s*[/\[(]\s*"
    r"|\b(?:x|y|units?|data|coordinates?|positions?|points?|trajector(?:y|ies))\b.*\bin\s+)"
    + _UNIT,
    re.IGNORECASE,
)
_PER_SECOND = r"(?:fps|hz|frames?\s*(?:per|/)\s*s(?:ec(?:onds?)?)?)\b"
_FRAME_RATE = re.compile(
    rf"\b(?:frame[\s_-]?rate|{_PER_SECOND})\s*[:=]\s*([-+]?[\d.]+(?:,\d+|e[-+]?\d+)?)",
    re.IGNORECASE,
)
_RATE_IN_WORDS = re.compile(rf"(?<![\w.,/])(\d+(?:[.,]\d+)?)\s*{_PER_SECOND}", re.IGNORECASE)
_OTHER_RATE = re.compile(r"filter|smooth|cut-?off|low-?pass|camera", re.IGNORECASE)
_PLAIN_NUMBER = re.compile(
    r"[-+]?(?:(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:e[-+]?[0-9]+)?|nan|inf(?:inity)?)", re.IGNORECASE
)


class _Layout(NamedTuple):
    """The form of a file: its comments and header, and the first row."""

    comments: list[str]  # before the first row, without #
    header: list[str] | None
    first: int  # line of the first row, from 1
    row: list[str]  # fields of the first row
    delimiter: str | None  # None: blanks


_Columns = dict[str, int]  # role -> place in a row
_Values = dict[str, FloatArray]  # role -> [n]; ids that are words are kept apart
T = TypeVar("T", str, float)


class TrackTable(NamedTuple):
    """The rows of a file, in its order."""

    ids: IntArray | NDArray[np.str_]  # [n]
    times: FloatArray  # [n] s
    points: FloatArray  # [n, 2] m
    heights: FloatArray | None  # [n] m, the column z
    line: Callable[[int], int]  # number of a row's line, from 1; slow, for messages
    unit: str  # of the file

    @classmethod
    def read(
        cls,
        path: Path,
        columns: Sequence[str] | None,
        unit: str | None,
        fps: float | None,
        delimiter: str | None,
    ) -> "TrackTable":
        """Reads the rows of a file; the parameters are those of `Track.read_all`.

        Raises
        ------
        ProblemError
            If something is missing, not allowed, or stated otherwise by the file; one line,
            without the file's name.
        """
        _check_options(unit, fps, delimiter)
        text = read_text(path)
        layout = _layout(text, delimiter)
        names = _names(layout, columns)
        places = _places(names, "columns" if columns else "header")
        unit = _settled("unit", _stated_units(layout, names), unit)
        rate = _rate(layout, places, fps)
        values, words = _values(text, layout, places, len(names))

        def line(row: int) -> int:
            return next(islice(_row_lines(text, layout), row, None))[0]

        _check(values, line)
        if columns is None and layout.header is None and _names_of_comment(layout) is None:
            values = _in_likely_order(values, PER_METRE[unit], 1.0 if rate is None else rate)
        per_metre = PER_METRE[unit]
        return cls(
            ids=values["id"].astype(np.int64) if words is None else words,
            times=values["time"] if rate is None else values["frame"] / rate,
            points=np.column_stack([values["x"], values["y"]]) / per_metre,
            heights=values["z"] / per_metre if "z" in values else None,
            line=line,
            unit=unit,
        )


def _check_options(unit: str | None, fps: float | None, delimiter: str | None) -> None:
    if unit is not None and unit not in PER_METRE:
        raise ProblemError(f"unit: must be {', '.join(PER_METRE)}, not {unit!r}")
    if fps is not None:
        _check_rate(fps)
    if delimiter is not None and delimiter not in DELIMITERS:
        allowed = "a blank, a tabulator, a comma or a semicolon"
        raise ProblemError(f"delimiter: must be {allowed}, not {delimiter!r}")


def _check_rate(fps: float) -> None:
    if not 0 < fps <= MOST_FPS:  # false for nan, too
        raise ProblemError(f"fps: must be > 0 and at most {MOST_FPS:g} frames/s, not {fps:g}")


# -- before the rows ----------------------------------------------------------------------


def _layout(text: str, delimiter: str | None) -> _Layout:
    comments: list[str] = []
    header = None
    for line, raw in enumerate(io.StringIO(text), start=1):
        content, _, comment = raw.partition("#")
        if not content.strip():
            comments.append(comment.strip(" \t\n#"))
            continue
        found = _separator(content) if delimiter is None else delimiter
        separator = None if found == " " else found
        fields = _fields(content, separator)
        # All fields are looked at, since an id may be a word.
        if header is None and not any(map(_is_number, fields)):
            header = fields
            continue
        return _Layout(comments, header, line, fields, separator)
    raise ProblemError("must hold at least one row of numbers")


def _separator(line: str) -> str:
    """Returns the character that separates the fields of a line."""
    if ";" in line:
        return ";"
    first = line.partition(",")[0].split()
    # In a line like "1 0 2,5" commas are decimal; the numbers are refused later.
    return "," if "," in line and not (len(first) > 1 and _is_number(first[0])) else " "


def _fields(line: str, delimiter: str | None) -> list[str]:
    return [field.strip(' \t\n"') for field in line.strip(" \n").split(delimiter)]


def _is_number(text: str) -> bool:
    """Returns True for what other programs read as a number, too, unlike 1_0 in Python."""
    return _PLAIN_NUMBER.fullmatch(text) is not None


def _names(layout: _Layout, columns: Sequence[str] | None) -> Sequence[str]:
    """Returns the names of the columns; those that nothing names are called "-"."""
    count = len(layout.row)
    names = columns or layout.header
    if names is not None:
        _require_values(layout.first, len(names), layout.row, layout.delimiter)
        return names
    named = _names_of_comment(layout)
    if named is None and count == _ANNOTATIONS and not _is_number(layout.row[-1]):
        raise ProblemError(
            "looks like the annotations.txt of the Stanford drone dataset, boxes in pixels: write "
            "the middles of the boxes in m, with the columns id frame x y"
        )
    if named is None and count not in (len(_ORDER) - 1, len(_ORDER)):
        raise ProblemError(
            f"columns: must be given where nothing names them and rows have {count} values"
        )
    return [*(named or _ORDER)[:count], *["-"] * (count - len(named or _ORDER))]


def _names_of_comment(layout: _Layout) -> list[str] | None:
    for comment in reversed(layout.comments):
        for delimiter in (layout.delimiter, None):
            names = _fields(comment, delimiter)
            if {"id", "x", "y"} <= {_role(name) for name in names}:
                return names
    return None


def _role(name: str) -> str | None:
    word = found[1] if (found := _UNIT_OF_NAME.match(name)) else name
    return _ROLES.get(re.sub(r"[\s_-]", "", word).lower())


def _places(names: Sequence[str], field: str) -> _Columns:
    places: _Columns = {}
    for place, name in enumerate(names):
        role = _role(name)
        if role in places:
            raise ProblemError(f"{field}: must name one column {role}, not two")
        if role is not None:
            places[role] = place
    if not {"id", "x", "y"} <= places.keys() or not places.keys() & {"frame", "time"}:
        raise ProblemError(
            f"{field}: must name the columns id, frame or time, x and y, not {', '.join(names)}"
        )
    if "time" in places:
        _check_seconds(names[places["time"]])
    return places


def _check_seconds(name: str) -> None:
    unit = _UNIT_OF_TIME.search(name)
    if unit and unit[1].lower() not in ("s", "sec", "second", "seconds"):
        raise ProblemError(f"time: must be in s, not {unit[1]}")


def _stated_units(layout: _Layout, names: Sequence[str]) -> set[str]:
    """Returns the units of length that comments, the header and the names of columns state."""
    found = [unit for comment in layout.comments for unit in _UNIT_OF_COMMENT.findall(comment)]
    for name in (*names, *(layout.header or ())):
        if _role(name) in ("x", "y", "z") and (stated := _UNIT_OF_NAME.match(name)):
            found.append(stated[2] or stated[3])
    units = {_short(unit.lower()) for unit in found}
    for unit in sorted(units - PER_METRE.keys()):
        raise ProblemError(f"unit: must be {', '.join(PER_METRE)}, but the file states {unit!r}")
    return units


def _short(unit: str) -> str:
    """Returns the short name of a unit, which may be spelt out."""
    word = re.sub(r"met(re|er)s?$", "m", unit)
    return _SHORT.get(word, word)


def _rate(layout: _Layout, places: _Columns, fps: float | None) -> float | None:
    """Returns the frames per second; None where the column of times is used instead."""
    if "time" in places and (fps is None or "frame" not in places):
        if fps is not None:
            raise ProblemError("fps: must be left out where times stand in place of frames")
        return None
    stated = _stated_rates(layout)
    if fps is not None:  # 29.97 is 29.97003
        fps = next((rate for rate in stated if math.isclose(fps, rate, rel_tol=1e-5)), float(fps))
    settled = _settled("fps", stated, fps)
    _check_rate(settled)
    return settled


def _stated_rates(layout: _Layout) -> set[float]:
    """Returns the rates that comments state by name, or else in words: 10 frames per second."""
    named = [rate for comment in layout.comments for rate in _FRAME_RATE.findall(comment)]
    rates = named or [
        rate
        for comment in layout.comments
        if not _OTHER_RATE.search(comment)
        for rate in _RATE_IN_WORDS.findall(comment)
    ]
    for rate in rates:
        if "," in rate:
            raise ProblemError(f"fps: must have a decimal point, not a comma: {rate[:40]!r}")
    return {float(rate) for rate in rates if _is_number(rate)}


def _settled(field: str, stated: set[T], given: T | None) -> T:
    """Returns the value that the file states or the caller gives, which must be the same."""
    if len(stated) > 1:
        both = " and ".join(sorted(f"{value}" for value in stated))
        raise ProblemError(f"{field}: must be one, but the file states {both}")
    for value in stated:
        if given not in (None, value):
            raise ProblemError(f"{field}: must be {value}, as the file states, not {given}")
        return value
    if given is None:
        raise ProblemError(f"{field}: must be given, for the file does not state it")
    return given


# -- rows ---------------------------------------------------------------------------------


def _values(
    text: str, layout: _Layout, places: _Columns, count: int
) -> tuple[_Values, NDArray[np.str_] | None]:
    """Returns the numbers of all columns that are used, and the ids where they are words."""
    words = not _is_number(layout.row[places["id"]])
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
        [_word(row[places["id"]], line) for line, row in _rows(text, layout, count)]
    )


def _row_lines(text: str, layout: _Layout) -> Iterator[tuple[int, str]]:
    """Yields the lines that are rows, without comments, each with its number."""
    for line, raw in enumerate(io.StringIO(text), start=1):
        content = raw.partition("#")[0]
        if line >= layout.first and content.strip():
            yield line, content


def _rows(text: str, layout: _Layout, count: int) -> Iterator[tuple[int, list[str]]]:
    for line, content in _row_lines(text, layout):
        row = _fields(content, layout.delimiter)
        _require_values(line, count, row, layout.delimiter)
        yield line, row


def _require_values(line: int, count: int, row: list[str], delimiter: str | None) -> None:
    if len(row) != count:
        # A person has two or three coordinates, each of which a decimal comma cuts in two.
        cut = delimiter == "," and len(row) - count in (2, 3)
        raise ProblemError(
            f"line {line}: must have {count} values, not {len(row)}"
            + ("; are commas decimal? Decimals must have points" if cut else "")
        )


def _number(text: str, line: int, role: str) -> float:
    if _is_number(text):
        return float(text)
    if _DECIMAL_COMMA.fullmatch(text):
        raise ProblemError(
            f"line {line}, {role}: must have a decimal point, not a comma: {text[:40]!r}"
        )
    raise ProblemError(f"line {line}, {role}: must be a number, not {text[:40]!r}")


def _word(text: str, line: int) -> str:
    if not text:
        raise ProblemError(f"line {line}, id: must not be empty")
    return text


def _in_likely_order(values: _Values, metre: float, fps: float) -> _Values:
    """Returns the columns with id and frame in the order that the rows tell.

    Of one id, rows that follow in time are near each other and no faster than people are; rows of
    different people at one frame are not.

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
    (own, speed), (other, swapped) = (_pace(values[a], values[b], points) for a, b in orders)
    if own * _FAR_CLEARER <= other or speed * fps <= _FASTEST < swapped * fps:
        return values
    if other * _FAR_CLEARER <= own or swapped * fps <= _FASTEST < speed * fps:
        log.warning("nothing names its columns; by how people move they are frame id x y")
        return values | {"id": values["frame"], "frame": values["id"]}
    raise ProblemError(
        "columns: must be given, for nothing names them and the rows fit both readings: "
        'columns = ["id", "frame", "x", "y"] or ["frame", "id", "x", "y"], with "z" if it is there'
    )


def _pace(ids: FloatArray, frames: FloatArray, points: FloatArray) -> tuple[float, float]:
    """Returns the median way (m) between rows of one id that follow in time, and that per frame.

    Both are infinite if no id has two rows.
    """
    order = np.lexsort([frames, ids])
    same = np.flatnonzero((np.diff(ids[order]) == 0) & (np.diff(frames[order]) > 0))
    if not len(same):
        return math.inf, math.inf
    ways = np.diff(points[order], axis=0)[same]
    lengths = np.hypot(ways[:, 0], ways[:, 1])
    return float(np.median(lengths)), float(np.median(lengths / np.diff(frames[order])[same]))


def _check(values: _Values, line: Callable[[int], int]) -> None:
    """Raises unless all numbers are finite and within limits, ids and frames whole."""
    for role, column in values.items():
        most = LARGEST if role in ("x", "y", "z") else MOST
        whole = role in ("id", "frame")
        wrong = ~(np.abs(column) <= most)  # true for nan, too
        if whole:
            wrong |= column != np.floor(column)
        if wrong.any():
            row = int(np.argmax(wrong))
            kind = "a whole number" if whole else "a number"
            raise ProblemError(
                f"line {line(row)}, {role}: must be {kind} within +-{most:g}, not {column[row]:g}"
            )
