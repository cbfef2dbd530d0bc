"""The form of a text file of tracks: what stands before its rows, and what that says of them.

Source of the comments: the files of PeTrack, JuPedSim and PedPy.
"""

import io
import math
import re
from collections.abc import Sequence
from typing import NamedTuple

from cocap_opt.data import ProblemError
from cocap_opt.scenarios.tracks.columns import (
    Places,
    is_unit_of_time,
    is_units,
    names_people,
    require_known_unit,
    settled,
    units_of_length,
    units_of_time,
)

MOST_FPS = 1e6

_ORDER = ("id", "frame", "x", "y", "z")  # where nothing names the columns; z may be missing

_ANNOTATIONS = 10  # values in a row of annotations.txt; the last is a word

_UNIT = (
    r"(mm|cm|m|(?:centi|milli)?met(?:re|er)s?"
    r"|(?:(?:us|american|international|survey)[\s_-]*){0,2}(?:ft|foot|feet)|ft[\s_-]*us"
    r"|px|pixels?|inch(?:es)?|yards?|dm|km)(?![\w/])"  # the last are refused
)
_UNIT_OF_COMMENT = re.compile(
    r"(?:\bunits?\s*[:=]\s*|(?<![\w/])[xyz]\s*[/\[(]\s*"
    r"|\b(?:x|y|units?|data|coordinates?|positions?|points?|trajector(?:y|ies))\b.*\bin\s+)"
    + _UNIT,
    re.IGNORECASE,
)
_TIME_UNIT_OF_COMMENT = re.compile(
    r"\btime(?:stamp)?s?(?:\s+units?)?\s*(?:[:=\[(/]|(?:\bare\s+|\bis\s+)?\bin\b)\s*([^\W\d_]+)",
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


class TextLayout(NamedTuple):
    """The form of a file: its comments, header and units, and the first row."""

    comments: list[str]  # before the first row, without #
    header: list[str] | None
    below: list[str]  # units in the row below the header, by column; empty where there is none
    first: int  # line of the first row, from 1
    row: list[str]  # fields of the first row
    delimiter: str | None  # None: blanks

    @classmethod
    def of(cls, text: str, delimiter: str | None) -> "TextLayout":
        """Returns the form of a text; without a delimiter as in the first row.

        Raises
        ------
        ProblemError
            If there are no rows.
        """
        comments: list[str] = []
        header = None
        below: list[str] = []
        for line, raw in enumerate(io.StringIO(text), start=1):
            content, _, comment = raw.partition("#")
            if not content.strip():
                comments.append(comment.strip(" \t\n#"))
                continue
            found = _separator(content) if delimiter is None else delimiter
            separator = None if found == " " else found
            fields = fields_of(content, separator)
            # All fields are looked at, since an id may be a word.
            is_row = any(map(is_number, fields))
            if not (is_row or below) and (header or any(comments)) and is_units(fields):
                below = _units_of(content, fields, header, line)
                continue
            if header is None and not is_row:
                header = fields
                continue
            return cls(comments, header, below, line, fields, separator)
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
                if names_people(names):
                    return names
        return None

    def units(self, names: Sequence[str]) -> set[str]:
        """Returns the units of length that comments, the header and the names of columns state."""
        found = [unit for comment in self.comments for unit in _UNIT_OF_COMMENT.findall(comment)]
        found += units_of_length(names, self.below)
        found += units_of_length(self.header or (), ())  # that `columns` may have renamed
        return {require_known_unit(unit) for unit in sorted(found)}

    def time_units(self, names: Sequence[str], place: int) -> set[str]:
        """Returns the units of time that comments, the header and the column's name state."""
        said = [word for text in self.comments for word in _TIME_UNIT_OF_COMMENT.findall(text)]
        stated = [word for word in said if is_unit_of_time(word)]
        stated += self.below[place : place + 1]
        header = self.header or ()
        of_header = units_of_time(header[place], ()) if place < len(header) else set()
        return units_of_time(names[place], stated) | of_header

    def rate(self, places: Places, fps: float | None) -> float | None:
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


def _units_of(content: str, fields: list[str], header: list[str] | None, line: int) -> list[str]:
    """Returns the fields of a row of units, of which some may be empty."""
    if header is None or len(header) == len(fields):
        return fields
    between = fields_of(content, "\t")
    if len(header) == len(between):
        return between
    raise ProblemError(
        f"line {line}: must have a unit, or - for none, for each of {len(header)} columns, not "
        f"{len(fields)}"
    )


def _separator(line: str) -> str:
    """Returns the character that separates the fields of a line."""
    if ";" in line:
        return ";"
    first = line.partition(",")[0].split()
    # In a line like "1 0 2,5" commas are decimal; the numbers are refused later.
    return "," if "," in line and not (len(first) > 1 and is_number(first[0])) else " "
