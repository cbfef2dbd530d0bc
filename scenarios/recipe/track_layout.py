"""The form of a text file of tracks: what stands before its rows, and what that says of them.

Source of the names: the files of PeTrack, JuPedSim and PedPy, and CSV files like them.
"""

import io
import math
import re
from collections.abc import Sequence
from typing import NamedTuple, TypeVar

from cocap_opt.data import ProblemError
from cocap_opt.scenarios.recipe.tables import PER_METRE

MOST_FPS = 1e6

# Names of columns, spelt without capitals, blanks and underscores, and without a unit.
_SPELLINGS = {
    "id": "id persid personid person pedid pedestrianid pedestrian ped agentid agent trackid track",
    "frame": "frame frames fr frameid framenumber",
    "time": "time t seconds timestamp",
    "x": "x posx positionx",
    "y": "y posy positiony",
    "z": "z posz positionz height",
    "latitude": "lat latitude",
    "longitude": "lon lng long longitude",
}
_ROLES = {word: role for role, words in _SPELLINGS.items() for word in words.split()}
_AXES = {"x", "y"}, {"latitude", "longitude"}  # of which a file has one pair
_ORDER = ("id", "frame", "x", "y", "z")  # where nothing names the columns; z may be missing

_ANNOTATIONS = 10  # values in a row of annotations.txt; the last is a word

_SHORT = {"centim": "cm", "millim": "mm", "foot": "ft", "feet": "ft"}
_UNIT = (
    r"(mm|cm|m|ft|foot|feet|(?:centi|milli)?met(?:re|er)s?"
    r"|px|pixels?|inch(?:es)?|yards?|dm|km)(?![\w/])"  # the last are refused
)
# As in "x/m", "x [m]" and "x_m", where any word but an axis is a unit.
_UNIT_OF_NAME = re.compile(r"^(.*?)(?:\s*[/\[(]\s*([^\W_]+)|_(m|cm|mm|ft|px|s|ms)$)", re.IGNORECASE)
_PER_SECOND_OF = {"s": 1.0, "sec": 1.0, "second": 1.0, "seconds": 1.0, "ms": 1e3, "msec": 1e3}
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

Columns = dict[str, int]  # role -> place in a row
T = TypeVar("T", str, float)


class Layout(NamedTuple):
    """The form of a file: its comments and header, and the first row."""

    comments: list[str]  # before the first row, without #
    header: list[str] | None
    first: int  # line of the first row, from 1
    row: list[str]  # fields of the first row
    delimiter: str | None  # None: blanks

    @classmethod
    def of(cls, text: str, delimiter: str | None) -> "Layout":
        """Returns the form of a text; without a delimiter as in the first row.

        Raises
        ------
        ProblemError
            If there are no rows.
        """
        comments: list[str] = []
        header = None
        for line, raw in enumerate(io.StringIO(text), start=1):
            content, _, comment = raw.partition("#")
            if not content.strip():
                comments.append(comment.strip(" \t\n#"))
                continue
            found = _separator(content) if delimiter is None else delimiter
            separator = None if found == " " else found
            fields = fields_of(content, separator)
            # All fields are looked at, since an id may be a word.
            if header is None and not any(map(is_number, fields)):
                header = fields
                continue
            return cls(comments, header, line, fields, separator)
        raise ProblemError("must hold at least one row of numbers")

    def names(self, columns: Sequence[str] | None) -> Sequence[str]:
        """Returns the names of the columns; those that nothing names are called "-"."""
        count = len(self.row)
        names = columns or self.header
        if names is not None:
            require_values(self.first, len(names), self.row, self.delimiter)
            return names
        named = self.names_of_comment()
        if named is None and count == _ANNOTATIONS and not is_number(self.row[-1]):
            raise ProblemError(
                "looks like the annotations.txt of the Stanford drone dataset, boxes in pixels: "
                "write the middles of the boxes in m, with the columns id frame x y"
            )
        if named is None and count not in (len(_ORDER) - 1, len(_ORDER)):
            raise ProblemError(
                f"columns: must be given where nothing names them and rows have {count} values"
            )
        return [*(named or _ORDER)[:count], *["-"] * (count - len(named or _ORDER))]

    def names_nothing(self) -> bool:
        """Returns True if neither a header nor a comment names the columns."""
        return self.header is None and self.names_of_comment() is None

    def names_of_comment(self) -> list[str] | None:
        """Returns the names of columns that a comment states, if one does."""
        for comment in reversed(self.comments):
            for delimiter in (self.delimiter, None):
                names = fields_of(comment, delimiter)
                roles = {_role(name) for name in names}
                if "id" in roles and any(axes <= roles for axes in _AXES):
                    return names
        return None

    def units(self, names: Sequence[str]) -> set[str]:
        """Returns the units of length that comments, the header and the names of columns state."""
        found = [unit for comment in self.comments for unit in _UNIT_OF_COMMENT.findall(comment)]
        for name in (*names, *(self.header or ())):
            if _role(name) in ("x", "y", "z") and (stated := _UNIT_OF_NAME.match(name)):
                found.append(stated[2] or stated[3])
        units = {_short(unit.lower()) for unit in found}
        for unit in sorted(units - PER_METRE.keys()):
            raise ProblemError(
                f"unit: must be {', '.join(PER_METRE)}, but the file states {unit!r}: write x and "
                "y in one of these"
            )
        return units

    def rate(self, places: Columns, fps: float | None) -> float | None:
        """Returns the frames per second; None where the column of times is used instead."""
        if "time" in places and (fps is None or "frame" not in places):
            if fps is not None:
                raise ProblemError("fps: must be left out where times stand in place of frames")
            return None
        return settled_rate(self._stated_rates(), fps)

    def _stated_rates(self) -> set[float]:
        """Returns the rates that comments state by name, or else in words: 10 frames per second."""
        named = [rate for comment in self.comments for rate in _FRAME_RATE.findall(comment)]
        rates = named or [
            rate
            for comment in self.comments
            if not _OTHER_RATE.search(comment)
            for rate in _RATE_IN_WORDS.findall(comment)
        ]
        for rate in rates:
            if "," in rate:
                raise ProblemError(f"fps: must have a decimal point, not a comma: {rate[:40]!r}")
        return {float(rate) for rate in rates if is_number(rate)}


def places_of(names: Sequence[str], field: str) -> Columns:
    """Returns the places of the columns that are used, by role: x and y, or else degrees.

    Raises
    ------
    ProblemError
        If one is missing or named twice, or times have another unit; it names the field.
    """
    places: Columns = {}
    for place, name in enumerate(names):
        role = _role(name)
        if role in places:
            raise ProblemError(f"{field}: must name one column {role}, not two")
        if role is not None:
            places[role] = place
    metres, degrees = (axes <= places.keys() for axes in _AXES)
    if "id" not in places or not (metres or degrees) or not places.keys() & {"frame", "time"}:
        raise ProblemError(
            f"{field}: must name the columns id, frame or time, and x and y or latitude and "
            f"longitude, not {', '.join(names)}"
        )
    for axis in _AXES[metres]:  # that are not used, or not both there
        places.pop(axis, None)
    if "time" in places:
        per_second(names[places["time"]])
    return places


def settled(field: str, stated: set[T], given: T | None) -> T:
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


def settled_rate(stated: set[float], fps: float | None) -> float:
    """Returns the frames per second that the file states or the caller gives."""
    if fps is not None:  # 29.97 is 29.97003
        fps = next((rate for rate in stated if math.isclose(fps, rate, rel_tol=1e-5)), float(fps))
    rate = settled("fps", stated, fps)
    check_rate(rate)
    return rate


def check_rate(fps: float) -> None:
    """Raises a ProblemError if a frame rate is none."""
    if not 0 < fps <= MOST_FPS:  # false for nan, too
        raise ProblemError(f"fps: must be > 0 and at most {MOST_FPS:g} frames/s, not {fps:g}")


def fields_of(line: str, delimiter: str | None) -> list[str]:
    """Returns the fields of a line."""
    return [field.strip(' \t\n"') for field in line.strip(" \n").split(delimiter)]


def is_number(text: str) -> bool:
    """Returns True for what other programs read as a number, too, unlike 1_0 in Python."""
    return _PLAIN_NUMBER.fullmatch(text) is not None


def require_values(line: int, count: int, row: list[str], delimiter: str | None) -> None:
    """Raises a ProblemError if a row has another number of fields than there are columns."""
    if len(row) != count:
        # A person has two or three coordinates, each of which a decimal comma cuts in two.
        cut = delimiter == "," and len(row) - count in (2, 3)
        raise ProblemError(
            f"line {line}: must have {count} values, not {len(row)}"
            + ("; are commas decimal? Decimals must have points" if cut else "")
        )


def _separator(line: str) -> str:
    """Returns the character that separates the fields of a line."""
    if ";" in line:
        return ";"
    first = line.partition(",")[0].split()
    # In a line like "1 0 2,5" commas are decimal; the numbers are refused later.
    return "," if "," in line and not (len(first) > 1 and is_number(first[0])) else " "


def _role(name: str) -> str | None:
    word = found[1] if (found := _UNIT_OF_NAME.match(name)) else name
    return _ROLES.get(re.sub(r"[\s_-]", "", word).lower())


def per_second(name: str) -> float:
    """Returns how many units of time a second has, by the name of a column; s without any."""
    stated = _UNIT_OF_NAME.match(name)
    unit = (stated[2] or stated[3]).lower() if stated else "s"
    if unit not in _PER_SECOND_OF:
        raise ProblemError(f"time: must be in s or ms, not {unit}")
    return _PER_SECOND_OF[unit]


def _short(unit: str) -> str:
    """Returns the short name of a unit, which may be spelt out."""
    word = re.sub(r"met(re|er)s?$", "m", unit)
    return _SHORT.get(word, word)
