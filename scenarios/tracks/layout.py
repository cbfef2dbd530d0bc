"""The layout of a text file of tracks: the lines before its rows, and the names of its columns.

Source of the names and of the comments: the files of PeTrack, JuPedSim, PedPy and Pathfinder, and
similar tables.
"""

import csv
import io
import re
from collections.abc import Iterable, Iterator, Sequence
from itertools import chain, islice, pairwise
from typing import NamedTuple

from cocap_opt.data import ProblemError
from cocap_opt.scenarios.earth.lengths import unit_of_length
from cocap_opt.scenarios.tables import PER_METRE, PER_SECOND
from cocap_opt.scenarios.text import require_no_comma
from cocap_opt.scenarios.tracks.table import settled_rate

_ORDER = ("id", "frame", "x", "y", "z")  # if nothing names the columns; z may be missing

_ANNOTATIONS = 10  # values in a row of annotations.txt; the last one is a word

# What files with this many values in a row may be.
_KNOWN_ORDERS = {
    8: 'set columns in [[tracks]], ["frame", "id", "x", "-", "y", "-", "-", "-"] for obsmat.txt of '
    'ETH, ["time", "id", "x", "y", "z", "-", "-", "-"] for ATC, with "-" for unused ones',
    _ANNOTATIONS: "if it is of the MOT Challenge, with boxes in pixels, write the place where each "
    'person stands in m; else set columns in [[tracks]], with "-" for unused ones',
}

_UNIT = (
    r"(mm|cm|m|(?:centi|milli)?met(?:re|er)s?"
    r"|(?:(?:us|american|international|survey)[\s_-]*){0,2}(?:ft|foot|feet)|ft[\s_-]*us"
    r"|px|pixels?|inch(?:es)?|yards?|dm|km)(?![\w/])"  # the last ones are rejected
)
_UNIT_OF_COMMENT = re.compile(
    r"(?:\bunits?\s*[:=]\s*|(?<![\w/])[xyz]\s*[/\[(]\s*)" + _UNIT, re.IGNORECASE
)
_ABOUT_PLACES = re.compile(
    r"\b(?:x|y|units?|data|coordinates?|positions?|points?|trajector(?:y|ies))\b", re.IGNORECASE
)
_IN_UNIT = re.compile(r"\bin\s+" + _UNIT, re.IGNORECASE)
_EPSG = re.compile(r"\bEPSG\s*:{0,2}\s*(\d{4,6})\b", re.IGNORECASE)
_CLAUSE = re.compile(r"[,;]|\.(?=\s|$)")
# What other lengths are of: their units are not those of x and y.
_OTHER_LENGTH = re.compile(
    r"error|accura|precision|uncertain|deviation|sigma|\bstd\b|\brms|noise|resolution|threshold"
    r"|\bsteps?\b|stride|spacing|\bradi|diameter|baseline|\bdop\b",
    re.IGNORECASE,
)
_TIME_UNIT_OF_COMMENT = re.compile(
    r"\btime(?:stamp)?s?(?:\s+units?)?\s*(?:[:=\[(/]|(?:\bare\s+|\bis\s+)?\bin\b)\s*([^\W\d_]+)",
    re.IGNORECASE,
)
_PER_SECOND = r"(?:fps|hz|frames?\s*(?:per|/)\s*s(?:ec(?:onds?)?)?)\b"
_DATE_AND_CLOCK = re.compile(r"\d{4}[-/.]\d\d?[-/.]\d\d? \d\d?:\d\d(:\S+)?")
_COMMENT = re.compile(r"(?:^|(?<=\s))#")
_EXCEL = re.compile(r"sep=.", re.IGNORECASE)  # tells Excel the separator
_OTHER_COMMENT = re.compile(r"\s*(?:%+|//+)\s*")
# The whole word after it, so that 30000/1001 is not read as 30000.
_FRAME_RATE = re.compile(
    rf"\b(?:frame[\s_-]?rate|{_PER_SECOND})\s*[:=]\s*([-+]?[\d.]\S*)", re.IGNORECASE
)
_AFTER_RATE = re.compile(r"(?:fps|hz|/s(?:ec)?|frames?.*)?[,;:)\]]*$", re.IGNORECASE)
_RATE_IN_WORDS = re.compile(rf"(?<![\w.,/])(\d+(?:[.,]\d+)?)\s*{_PER_SECOND}", re.IGNORECASE)
_OTHER_RATE = re.compile(r"filter|smooth|cut-?off|low-?pass|camera", re.IGNORECASE)
_PLAIN_NUMBER = re.compile(
    r"[-+]?(?:(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:e[-+]?[0-9]+)?|nan|inf(?:inity)?)", re.IGNORECASE
)

# Names of columns, in lower case, without blanks, underscores and units.
_SPELLINGS = {
    "id": "id persid personid person pedid pedestrianid pedestrian ped agentid agent trackid track",
    "frame": "frame frames fr frameid framenumber",
    "time": "time t times timestamp timestamps ts stamp datetime unixtime unixtimestamp unix epoch "
    "epochtime utc utctime timeutc timestamputc gpstime",
    "x": "x posx positionx",
    "y": "y posy positiony",
    "z": "z posz positionz height",
    "latitude": "lat latitude",
    "longitude": "lon lng long longitude",
}
# Names that count only if no column has one of the above for the same role.
_RARER = {
    "id": "tag tagid player playerid name deviceid subject subjectid participant participantid",
    "frame": "frameno frameindex frameidx framenum",
    "time": "simtime elapsed elapsedtime",
    "x": "xcenter centerx xcentre centrex xest xpos xposition xcoord coordx xcoordinate xloc "
    "locationx easting eastings utmeasting",
    "y": "ycenter centery ycentre centrey yest ypos yposition ycoord coordy ycoordinate yloc "
    "locationy northing northings utmnorthing",
}
_ROLES = {
    word: role
    for names in (_RARER, _SPELLINGS)
    for role, words in names.items()
    for word in words.split()
}
_AXES = {"x", "y"}, {"latitude", "longitude"}  # a file uses one of these pairs

_RADIANS = {"rad", "radian", "radians"}
_REFUSED = {
    "px", "pixel", "pixels", "inch", "inches", "yd", "yard", "yards", "dm", "km", "deg", "degree",
    "degrees", *_RADIANS,
}  # fmt: skip

_TIMES = {
    "s": "s sec secs second seconds",
    "ms": "ms msec msecs milli millis millisec millisecs millisecond milliseconds",
    "us": "us usec usecs \u00b5s \u03bcs \u00b5sec \u03bcsec micro micros microsec microsecs "
    "microsecond microseconds",
    "ns": "ns nsec nsecs nano nanos nanosec nanosecs nanosecond nanoseconds",
}
_TIME_UNITS = {word: unit for unit, words in _TIMES.items() for word in words.split()}
# words that may take the place of a unit but are not units
_NO_UNIT = {"utc", "gmt", "local", "iso", "iso8601", "unix", "epoch"}

# words in names of x and y that say that they point elsewhere
_ELSEWHERE = {
    "x": re.compile(r"\b(?:n|north(?:ing)?|south|west|down)\b", re.IGNORECASE),
    "y": re.compile(r"\b(?:e|east(?:ing)?|south|west|down)\b", re.IGNORECASE),
}

# entries below a header that mean "no unit"
_NONE = {"", "-", "--", "n/a", "na", "none", "nan", "unitless"}
# Matches "x/m", "x [m]" and "x (US survey feet)"; any word but an axis counts as a unit.
_UNIT_OF_NAME = re.compile(r"(.*?)\s*[/\[(]\s*(([^\W_]+|\N{DEGREE SIGN})[^\])]*)")
_IN_BRACKETS = re.compile(r"[\[(]\s*(.*?)\s*[\])]")

# Columns of a table of boxes in an image besides x and y, spelt as above.
_BOX = r"(?:bb|bbox|box|boundingbox|rect)?"
_WIDTH, _HEIGHT = re.compile(rf"{_BOX}(?:w|width)"), re.compile(rf"{_BOX}(?:h|height)")
_CORNERS = {"left", "top", "right", "bottom", "xmin", "ymin", "xmax", "ymax", "x1", "y1", "x2",
            "y2", "bbleft", "bbtop", "bboxleft", "bboxtop"}  # fmt: skip
_POINTS = {"wkt", "geometry", "geom", "thegeom"}  # names of columns of points as WKT
_NUMBERED = re.compile(r"[xy]_?\d+")  # x1, y1, x2, y2, .. may also be a pair for each person
_EDGES = 2  # edges of a box that the columns must name to be recognised as corners

Places = dict[str, int]  # role -> place in a row


class TextLayout(NamedTuple):
    """The layout of a file: its comments, header and units, and the first row."""

    comments: list[str]  # before the first row, without #
    header: list[str] | None
    below: list[str]  # units in the row below the header, by column; empty without such a row
    first: int  # line of the first row, from 1
    row: list[str]  # fields of the first row
    delimiter: str | None  # None: blanks
    later: list[str]  # comments after the first row, without #

    @classmethod
    def of(cls, text: str, delimiter: str | None) -> "TextLayout":
        """Returns the layout of a text; by default, the delimiter is that of the first row.

        Raises
        ------
        ProblemError
            If there are no rows.
        """
        comments: list[str] = []
        header, head = None, ""
        below: list[str] = []
        for line, raw in enumerate(io.StringIO(text), start=1):
            content, comment = without_comment(raw)
            if header is None and _EXCEL.fullmatch(content.strip()):
                continue
            if not content.strip():
                comments.append(comment.strip(" \t\n#"))
                continue
            found = _separator(content) if delimiter is None else delimiter
            if delimiter is None and found == " " and _has_tabs(content, head):
                found = "\t"
            separator = None if found == " " else found
            fields = fields_of(content, separator)
            # All fields are checked, because an id may be a word.
            is_row = any(map(is_number, fields))
            if not (is_row or below) and (header or any(comments)) and _is_units(fields):
                below = _units_of(content, fields, header, line)
                continue
            if not is_row and (header is None or not _names_people(header)):
                comments += [] if header is None else [head.strip()]  # a title above the header
                header, head = _bare_header(content, separator), content
                continue
            return cls(comments, header, below, line, fields, separator, _comments(text, line))
        raise ProblemError("must contain at least one row of numbers")

    def names(self, columns: Sequence[str] | None) -> Sequence[str]:
        """Returns the names of the columns; columns without a name are called "-"."""
        count = len(self.row)
        names = columns or self.header
        if names is not None:
            require_values(self.first, len(names), self.row, self.delimiter)
            return names
        named = self.names_of_comment()
        if named is None and count == _ANNOTATIONS and not is_number(self.row[-1]):
            raise ProblemError(
                "looks like the annotations.txt of the Stanford drone dataset, boxes in pixels: "
                "write the centres of the boxes in m, with the columns id frame x y"
            )
        if named is None and count not in (len(_ORDER) - 1, len(_ORDER)):
            raise ProblemError(
                f"columns: must be given, as the file has no header and rows of {count} values; "
                + _KNOWN_ORDERS.get(count, 'set columns in [[tracks]], with "-" for unused ones')
            )
        return [*(named or _ORDER)[:count], *["-"] * (count - len(named or _ORDER))]

    def names_nothing(self) -> bool:
        """Returns True if neither a header nor a comment names the columns."""
        return self.header is None and self.names_of_comment() is None

    def names_of_comment(self) -> list[str] | None:
        """Returns the names of columns that a comment before the rows states; None if none does."""
        found = (self._names_in(comment) for comment in reversed(self.comments))
        return next((names for names in found if names), None)

    def require_one_order(self, names: Sequence[str]) -> None:
        """Raises a ProblemError if a comment between or below the rows names other columns.

        It begins another table, as in files that were joined.
        """
        order = _roles(names)
        for comment in self.later:
            other = self._names_in(comment)
            if other and _roles(other) != order:
                raise ProblemError(
                    f"columns: must be the same for all rows, {', '.join(names)}, but a later "
                    f"comment names {', '.join(other)}; write each table to a file of its own"
                )

    def _names_in(self, comment: str) -> list[str] | None:
        """Returns the names of columns that a comment states, or None."""
        found = (fields_of(comment, delimiter) for delimiter in (self.delimiter, None))
        return next((names for names in found if _names_people(names)), None)

    def units(self, names: Sequence[str]) -> set[str]:
        """Returns the units of length that comments, the header and the names of columns state."""
        found = [unit for comment in self._all for unit in _units_of_comment(comment)]
        found += _units_of_length(names, self.below)
        found += _units_of_length(self.header or (), ())  # `columns` may have renamed them
        return {_require_known_unit(unit) for unit in sorted(found)}

    def systems(self) -> list[str]:
        """Returns the codes of reference systems that comments name, as EPSG:n."""
        found = (code for comment in self._all for code in _EPSG.findall(comment))
        return [f"EPSG:{code}" for code in dict.fromkeys(found)]

    def time_units(self, names: Sequence[str], place: int) -> set[str]:
        """Returns the units of time that comments, the header and the column's name state."""
        said = [word for text in self._all for word in _TIME_UNIT_OF_COMMENT.findall(text)]
        stated = [word for word in said if word.lower() in _TIME_UNITS]
        stated += self.below[place : place + 1]
        header = self.header or ()
        of_header = _units_of_time(header[place], ()) if place < len(header) else set()
        return _units_of_time(names[place], stated) | of_header

    def rate(self, places: Places, fps: float | None) -> float | None:
        """Returns the frames per second; None if the column of times is used instead."""
        if "time" in places and (fps is None or "frame" not in places):
            if fps is not None:
                raise ProblemError("fps: must be left out if the file has times instead of frames")
            return None
        named = (rate for comment in self._all for rate in _FRAME_RATE.findall(comment))
        said = (
            rate
            for comment in self._all
            if not (_OTHER_RATE.search(comment) or _FRAME_RATE.search(comment))
            for rate in _RATE_IN_WORDS.findall(comment)
        )
        stated = _rates(_AFTER_RATE.sub("", rate) for rate in named)
        mentioned = _rates(said)  # as in 10 frames per second
        return settled_rate(stated or mentioned, fps, mentioned if stated else ())

    @property
    def _all(self) -> list[str]:
        """The comments of the whole file: what one states holds for all rows."""
        return [*self.comments, *self.later]


def _rates(words: Iterable[str]) -> set[float]:
    """Returns the numbers of frames per second that words are."""
    rates = [*words]
    for rate in rates:
        require_no_comma(rate, "fps")
        if not is_number(rate):
            raise ProblemError(
                f"fps: must be a number of frames per second, but a comment states "
                f"{rate[:40]!r}: write it as a number such as 29.97"
            )
    return {float(rate) for rate in rates}


def _comments(text: str, first: int) -> list[str]:
    """Returns the different comments from a line on, without #."""
    if "#" not in text:
        return []
    rest = islice(io.StringIO(text), first - 1, None)
    found = (without_comment(raw)[1].strip(" \t\n#") for raw in rest)
    return list(dict.fromkeys(comment for comment in found if comment))


def without_comment(line: str) -> tuple[str, str]:
    """Returns the part of a line before a comment, and the comment without its first #, which is
    the first character of the line or follows a blank: P#1 may be an id.
    """
    if "#" not in line:
        return line, ""
    content, *comment = _COMMENT.split(line, maxsplit=1)
    return content, "".join(comment)


def _has_tabs(line: str, header: str) -> bool:
    """Returns True if the fields of a line are between tabs: of a header with words in brackets, or
    below a header with as many tabs.
    """
    tabs = line.rstrip("\n").count("\t")
    if header:
        return tabs > 0 and header.rstrip("\n").count("\t") == tabs
    return tabs > 0 and not any(map(is_number, line.split())) and " " in line.strip()


def _bare_header(line: str, separator: str | None) -> list[str]:
    """Returns the names in a header, which may begin like a comment of MATLAB or C."""
    return fields_of(_OTHER_COMMENT.sub("", line), separator)


def fields_of(line: str, delimiter: str | None) -> list[str]:
    """Returns the fields of a line."""
    if delimiter is not None and '"' in line:  # a field between quotes may contain the delimiter
        (row,) = csv.reader([line.strip(" \n")], delimiter=delimiter, skipinitialspace=True)
        return [field.strip(' \t\n"') for field in row]
    return [field.strip(' \t\n"') for field in line.strip(" \n").split(delimiter)]


def is_number(text: str) -> bool:
    """Returns True if other programs also read the text as a number, unlike 1_0 in Python."""
    return _PLAIN_NUMBER.fullmatch(text) is not None


def require_values(line: int, count: int, row: list[str], delimiter: str | None) -> None:
    """Raises a ProblemError if the number of fields in a row differs from the number of columns."""
    if len(row) == count:
        return
    more, advice = len(row) - count, ""
    if delimiter == "," and more in (2, 3):
        # A person has two or three coordinates; a decimal comma splits each of them in two.
        advice = "; are the commas decimal commas? Numbers must have decimal points"
    elif more == 1 and any(_DATE_AND_CLOCK.fullmatch(" ".join(pair)) for pair in pairwise(row)):
        advice = "; write dates with T before the time, as in 2026-05-01T10:00:00"
    elif more == 1 and not row[-1]:
        advice = "; does the row end with a separator? Leave it out"
    raise ProblemError(f"line {line}: must have {count} values, not {len(row)}{advice}")


def _units_of(content: str, fields: list[str], header: list[str] | None, line: int) -> list[str]:
    """Returns the fields of a row of units; some may be empty."""
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
    # In a line like "1 0 2,5" commas are decimal; the numbers are rejected later.
    return "," if "," in line and not (len(first) > 1 and is_number(first[0])) else " "


# -- the names of columns, with their units of length and of time


class Name(NamedTuple):
    """The role and the unit that the name of a column states."""

    role: str | None  # a key of `_SPELLINGS`; None: it is not used
    unit: str | None = None  # short name, if it is known

    @classmethod
    def of(cls, name: str) -> "Name":
        """Parses the name of a column, such as "pos_x [cm]" or "timestampUs"."""
        word, unit = _parts(name)
        plain = spelt(word)
        if role := _ROLES.get(plain):
            return cls(role, unit)
        if plain in _TIME_UNITS and len(plain) > 1:  # such as "seconds"
            return cls("time", _TIME_UNITS[plain])
        ends = (k for k in range(1, len(plain)) if plain[k:] in _TIME_UNITS)
        for k in ends:  # the first end gives the longest unit, as in "timestampmicroseconds"
            if _ROLES.get(plain[:k]) == "time":
                return cls("time", _TIME_UNITS[plain[k:]])
        return cls(None)


def _is_units(fields: Sequence[str]) -> bool:
    """Returns True if all words are units, as in a row below a header: s, -, m, m/s."""
    known = {*PER_METRE, *_REFUSED, *PER_SECOND}
    others = [field for field in fields if _of_row(field) not in known]
    return len(others) < len(fields) and not any(Name.of(field).role for field in others)


def _units_of_comment(comment: str) -> Iterator[str]:
    """Yields the units of length that a comment states, but not those of errors and the like."""
    clauses = [part for part in _CLAUSE.split(comment) if not _OTHER_LENGTH.search(part)]
    yield from chain.from_iterable(map(_UNIT_OF_COMMENT.findall, clauses))
    if any(map(_ABOUT_PLACES.search, clauses)):
        yield from chain.from_iterable(map(_IN_UNIT.findall, clauses))


def _units_of_length(names: Sequence[str], row: Sequence[str]) -> Iterator[str]:
    """Yields the units of x, y and z that the names of columns or the row of units state."""
    for place, name in enumerate(names):
        role, unit = Name.of(name)
        if role not in ("x", "y", "z"):
            continue
        if unit is not None:
            yield unit
        if place < len(row) and (stated := _of_row(row[place])):
            yield stated


def _require_known_unit(unit: str) -> str:
    """Returns the short name of a unit of length, if x and y may have it."""
    short = _short(unit)
    if short not in PER_METRE:
        raise ProblemError(
            f"unit: must be {', '.join(PER_METRE)}, but the file states {short!r}: write x and "
            "y in one of these"
        )
    return short


def _units_of_time(name: str, stated: Iterable[str]) -> set[str]:
    """Returns the units of time in the name of the column and in other statements of the file.

    Raises
    ------
    ProblemError
        If a unit is unknown.
    """
    known = Name.of(name)
    found = [known.unit if known.role == "time" else None, *map(_of_row, stated)]
    units = {_TIME_UNITS.get(unit, unit) for unit in found if unit and unit not in _NO_UNIT}
    for unit in sorted(units - PER_SECOND.keys()):
        raise ProblemError(f"time: must be in {', '.join(PER_SECOND)}, not {unit}")
    return units


def places_of(names: Sequence[str], field: str) -> Places:
    """Returns the places of the columns that are used, by role: x and y, or else degrees.

    Raises
    ------
    ProblemError
        If a column is missing or named twice, or if the columns describe boxes; the message names
        the field.
    """
    _refuse_boxes(names, field)
    places: Places = {}
    times = [name for name in names if Name.of(name).role == "time"]
    plain = [name for name in times if _is_plain_time(name)]
    for place, name in enumerate(names):
        role = Name.of(name).role
        if role == "time" and len(plain) == 1 < len(times) and name not in plain:
            continue  # the same moments in another form
        if role is None:
            continue
        _require_direction(name, role, field)
        if role in places:
            if _is_rare(name, role):
                continue
            if not _is_rare(names[places[role]], role):
                both = f"{names[places[role]]} and {name}"
                raise ProblemError(
                    f"{field}: must name one column {role}, not two, {both}; set columns in "
                    '[[tracks]], with "-" for unused ones'
                    + (", or add them if one has fractions of the other" if role == "time" else "")
                )
        places[role] = place
    metres, degrees = (axes <= places.keys() for axes in _AXES)
    if not (metres or degrees) or not places.keys() & {"frame", "time"}:
        raise ProblemError(_about_missing(names, field, places))
    for axis in _AXES[metres]:  # columns that are not used or not both present
        places.pop(axis, None)
    return places


def _require_direction(name: str, role: str, field: str) -> None:
    """Raises a ProblemError if the name of an axis says that it points elsewhere, as in "x
    (north)".
    """
    if role not in _ELSEWHERE:
        return
    if _ELSEWHERE[role].search(name):
        there = "east, y north" if role == "x" else "north, x east"
        raise ProblemError(
            f"{field}: {role} must point {there}, or along the axes of the map, not as "
            f"{name[:40]!r} says; if x and y are swapped, name them so with columns in [[tracks]]"
        )


def require_degrees(names: Sequence[str], places: Places) -> None:
    """Raises a ProblemError if a name states another unit of latitudes or longitudes."""
    for role in ("latitude", "longitude"):
        unit = Name.of(names[places[role]]).unit
        if unit in _RADIANS or unit in PER_METRE:
            raise ProblemError(f"{role}: must be in degrees, not in {unit}: convert the column")


def require_ids(names: Sequence[str], field: str) -> None:
    """Raises a ProblemError, naming the columns, if none has the ids of people."""
    places = {role: place for place, name in enumerate(names) if (role := Name.of(name).role)}
    if "id" not in places:
        raise ProblemError(_about_missing(names, field, places))


def _is_rare(name: str, role: str) -> bool:
    """Returns True if a name counts only if no other column has the role."""
    return spelt(_bare(name)) in _RARER.get(role, "").split()


def _about_missing(names: Sequence[str], field: str, places: Places) -> str:
    """Returns a message about missing columns, with the columns to set in a recipe."""
    words = (
        f"{field}: must name the columns id, frame or time, and x and y or latitude and "
        f"longitude, not {', '.join(names)}{_about_corners(names)}{_about_points(names)}"
    )
    axes = _AXES[not places.keys() & {"x", "y"} and bool(places.keys() & _AXES[1])]
    wanted = ["id", *([] if places.keys() & {"frame", "time"} else ["time"]), *sorted(axes)]
    missing = [role for role in wanted if role not in places]
    unused = len(names) - len(places)
    if unused < len(missing) and missing[0] == "id":  # a file of one person needs none
        missing = missing[1:]
    if field == "columns" or not missing or unused < len(missing):
        return words
    used = {place: role for role, place in places.items()}
    listed = ", ".join(f'"{used.get(place, "-")}"' for place in range(len(names)))
    *others, last = missing
    roles = f"{', '.join(others)} and {last}" if others else last
    ending = "s" if others else ""
    return (
        f"{words}; if it has {roles} under {'other names' if others else 'another name'}, set "
        f"columns = [{listed}] in [[tracks]] with {roles} in the right place{ending}: the words of "
        "this program in the order of the file's columns"
    )


def _roles(names: Sequence[str]) -> list[str]:
    """Returns the roles of the columns that are used, in order."""
    return [role for name in names if (role := Name.of(name).role)]


def _is_plain_time(name: str) -> bool:
    """Returns True for the most common names of times, which take precedence over others."""
    return spelt(_bare(name)) in ("time", "t", "seconds", "timestamp") and Name.of(name).unit in (
        None,
        "s",
        "ms",
    )


def _names_people(names: Sequence[str]) -> bool:
    """Returns True if the names include an id and a position."""
    roles = {Name.of(name).role for name in names}
    return "id" in roles and any(axes <= roles for axes in _AXES)


def _refuse_boxes(names: Sequence[str], field: str) -> None:
    """Raises a ProblemError if a column has the heights of boxes instead of heads."""
    words = [spelt(_bare(name)) for name in names]
    widths = [name for name, word in zip(names, words, strict=True) if _WIDTH.fullmatch(word)]
    heights = [name for name, word in zip(names, words, strict=True) if _HEIGHT.fullmatch(word)]
    if not widths or not heights:
        return
    used = ["-" if name in (*widths, *heights) else Name.of(name).role or "-" for name in names]
    listed = ", ".join(f'"{role}"' for role in used)
    way_out = (
        f"if x and y are where the person stands, set columns = [{listed}] in [[tracks]] to ignore "
        'the box ("z" in place of "-" is the height of a head)'
        if _names_people(used)
        else "write the place where each person stands as x and y"
    )
    raise ProblemError(
        f"{field}: {widths[0]} and {heights[0]} are the width and height of a box, but a height "
        f"must be that of a head above the floor; {way_out}"
    )


def _about_corners(names: Sequence[str]) -> str:
    """Returns advice on boxes that are given by their edges; empty if there are none."""
    edges = [name for name in names if spelt(_bare(name)) in _CORNERS]
    if len(edges) < _EDGES:
        return ""
    listed = ", ".join(edges)
    if all(_NUMBERED.fullmatch(spelt(_bare(name))) for name in edges):
        return f"; if {listed} are places of several people, write a row for each person and moment"
    return (
        f"; {listed} are edges of boxes: write the place where each person stands as x and y, in "
        "metres"
    )


def _about_points(names: Sequence[str]) -> str:
    """Returns advice on a column of points as WKT; empty if there is none."""
    points = [name for name in names if spelt(_bare(name)) in _POINTS]
    return f"; write the points in {points[0]} as columns x and y" if points else ""


def _bare(name: str) -> str:
    """Returns a name without its unit."""
    return _parts(name)[0]


def _parts(name: str) -> tuple[str, str | None]:
    """Returns a name without its unit, and the short name of the unit or else the original word."""
    if found := _UNIT_OF_NAME.match(name):
        # "z (height) [mm]" has the unit in the second bracket
        known = [unit for text in _IN_BRACKETS.findall(name) if (unit := _known(text))]
        return found[1], known[0] if known else _unit(found[2], first=found[3])
    word, _, unit = name.rpartition("_")
    short = unit.lower() if unit.lower() in _REFUSED else _known(unit)
    return (word, short) if word and short else (name, None)


def _unit(text: str, first: str) -> str:
    """Returns the short name of the unit that a text is or begins with, or else its first word."""
    if short := _known(text):
        return short
    # "us" in US/Eastern does not mean microseconds
    return text.lower() if first == "US" else _short(first)


def spelt(word: str) -> str:
    """Returns a name in lower case, without blanks, underscores, points and hyphens."""
    return re.sub(r"[\s_.-]", "", word).lower()


def _of_row(field: str) -> str:
    """Returns the unit that a field of a row of units states, possibly in brackets; "" if none."""
    found = _IN_BRACKETS.fullmatch(field)
    unit = _short(found[1] if found else field)
    return "" if unit in _NONE else unit


def _short(unit: str) -> str:
    """Returns the short name of a unit, which may be spelt out; an unknown word is returned as it
    is.
    """
    return _known(unit) or unit.strip().lower()


def _known(unit: str) -> str | None:
    """Returns the short name of a unit of length or time that may be spelt out."""
    return unit_of_length(unit) or _TIME_UNITS.get(unit.strip().lower())
