"""The columns of tracks: what their names say, with their units of length and of time.

Source of the names: the files of PeTrack, JuPedSim, PedPy and Pathfinder, and tables like them.
"""

import re
from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple, TypeVar

from cocap_opt.data import ProblemError
from cocap_opt.scenarios.earth.lengths import unit_of_length
from cocap_opt.scenarios.tables import PER_METRE

# Names of columns, spelt without capitals, blanks and underscores, and without a unit.
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
_ROLES = {word: role for role, words in _SPELLINGS.items() for word in words.split()}
_AXES = {"x", "y"}, {"latitude", "longitude"}  # of which a file has one pair

_REFUSED = {"px", "pixel", "pixels", "inch", "inches", "yd", "yard", "yards", "dm", "km"}

PER_SECOND = {"s": 1, "ms": 10**3, "us": 10**6, "ns": 10**9}
_TIMES = {
    "s": "s sec secs second seconds",
    "ms": "ms msec msecs milli millis millisec millisecs millisecond milliseconds",
    "us": "us usec usecs \u00b5s \u03bcs \u00b5sec \u03bcsec micro micros microsec microsecs "
    "microsecond microseconds",
    "ns": "ns nsec nsecs nano nanos nanosec nanosecs nanosecond nanoseconds",
}
_TIME_UNITS = {word: unit for unit, words in _TIMES.items() for word in words.split()}
_NO_UNIT = {"utc", "gmt", "local", "iso", "iso8601", "unix", "epoch"}  # what else may stand there

_NONE = {"", "-", "--", "n/a", "na", "none", "nan", "unitless"}  # what is no unit, below a header
# As in "x/m", "x [m]" and "x (US survey feet)", where any word but an axis is a unit.
_UNIT_OF_NAME = re.compile(r"(.*?)\s*[/\[(]\s*(([^\W_]+)[^\])]*)")
_IN_BRACKETS = re.compile(r"[\[(]\s*(.*?)\s*[\])]")

# What a table of boxes in an image has, spelt as above, besides x and y.
_BOX = r"(?:bb|bbox|box|boundingbox|rect)?"
_WIDTH, _HEIGHT = re.compile(rf"{_BOX}(?:w|width)"), re.compile(rf"{_BOX}(?:h|height)")
_CORNERS = {"left", "top", "right", "bottom", "xmin", "ymin", "xmax", "ymax", "x1", "y1", "x2",
            "y2", "bbleft", "bbtop", "bboxleft", "bboxtop"}  # fmt: skip
_EDGES = 2  # of a box, at least, where it is told by its corners

Places = dict[str, int]  # role -> place in a row
T = TypeVar("T", str, float)


class Name(NamedTuple):
    """The role and the unit that the name of a column states."""

    role: str | None  # a key of `_SPELLINGS`; None: it is not used
    unit: str | None = None  # short, where it is known

    @classmethod
    def of(cls, name: str) -> "Name":
        """Returns what a name such as "pos_x [cm]" or "timestampUs" says."""
        word, unit = _parts(name)
        plain = _spelt(word)
        if role := _ROLES.get(plain):
            return cls(role, unit)
        if plain in _TIME_UNITS and len(plain) > 1:  # such as "seconds"
            return cls("time", _TIME_UNITS[plain])
        ends = (k for k in range(1, len(plain)) if plain[k:] in _TIME_UNITS)
        for k in ends:  # the first leaves the longest unit, as in "timestampmicroseconds"
            if _ROLES.get(plain[:k]) == "time":
                return cls("time", _TIME_UNITS[plain[k:]])
        return cls(None)


def is_units(fields: Sequence[str]) -> bool:
    """Returns True for words that are units, as stand below a header: s, -, m, m/s."""
    known = {*PER_METRE, *_REFUSED, *PER_SECOND}
    others = [field for field in fields if _of_row(field) not in known]
    return len(others) < len(fields) and not any(Name.of(field).role for field in others)


def units_of_length(names: Sequence[str], row: Sequence[str]) -> Iterator[str]:
    """Yields the units of x, y and z by the names of columns, and by a row of units below."""
    for place, name in enumerate(names):
        role, unit = Name.of(name)
        if role not in ("x", "y", "z"):
            continue
        if unit is not None:
            yield unit
        if place < len(row) and (stated := _of_row(row[place])):
            yield stated


def require_known_unit(unit: str) -> str:
    """Returns the short name of a unit of length, if x and y may be in it."""
    short = _short(unit)
    if short not in PER_METRE:
        raise ProblemError(
            f"unit: must be {', '.join(PER_METRE)}, but the file states {short!r}: write x and "
            "y in one of these"
        )
    return short


def is_unit_of_time(word: str) -> bool:
    """Returns True if a word is a unit of time that is known, short or spelt out."""
    return word.lower() in _TIME_UNITS


def units_of_time(name: str, stated: Iterable[str]) -> set[str]:
    """Returns the units of time by the name of the column, and by what else a file states.

    Raises
    ------
    ProblemError
        If one is none that is known.
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
        If one is missing or named twice, or they are of boxes; it names the field.
    """
    _refuse_boxes(names, field)
    places: Places = {}
    times = [name for name in names if Name.of(name).role == "time"]
    plain = [name for name in times if _is_plain_time(name)]
    for place, name in enumerate(names):
        role = Name.of(name).role
        if role == "time" and len(plain) == 1 < len(times) and name not in plain:
            continue  # the same moments, told otherwise
        if role in places:
            raise ProblemError(f"{field}: must name one column {role}, not two")
        if role is not None:
            places[role] = place
    metres, degrees = (axes <= places.keys() for axes in _AXES)
    if "id" not in places or not (metres or degrees) or not places.keys() & {"frame", "time"}:
        raise ProblemError(
            f"{field}: must name the columns id, frame or time, and x and y or latitude and "
            f"longitude, not {', '.join(names)}{_about_corners(names)}"
        )
    for axis in _AXES[metres]:  # that are not used, or not both there
        places.pop(axis, None)
    return places


def _is_plain_time(name: str) -> bool:
    """Returns True for the commonest names of times, which are taken where there are several."""
    return _spelt(_bare(name)) in ("time", "t", "seconds", "timestamp") and Name.of(name).unit in (
        None,
        "s",
        "ms",
    )


def names_people(names: Sequence[str]) -> bool:
    """Returns True if names have an id and a place."""
    roles = {Name.of(name).role for name in names}
    return "id" in roles and any(axes <= roles for axes in _AXES)


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


def _refuse_boxes(names: Sequence[str], field: str) -> None:
    """Raises a ProblemError where height is that of a box, and not of a head above the floor."""
    spelt = [_spelt(_bare(name)) for name in names]
    widths = [name for name, word in zip(names, spelt, strict=True) if _WIDTH.fullmatch(word)]
    heights = [name for name, word in zip(names, spelt, strict=True) if _HEIGHT.fullmatch(word)]
    if not widths or not heights:
        return
    used = ["-" if name in (*widths, *heights) else Name.of(name).role or "-" for name in names]
    listed = ", ".join(f'"{role}"' for role in used)
    way_out = (
        f"if x and y are where the person stands, columns = [{listed}] in [[tracks]] leaves the "
        'box out ("z" in place of "-" would be the height of a head)'
        if names_people(used)
        else "write where each person stands as x and y"
    )
    raise ProblemError(
        f"{field}: {widths[0]} and {heights[0]} are those of a box, and {heights[0]} is not the "
        f"height of a head above the floor; {way_out}"
    )


def _about_corners(names: Sequence[str]) -> str:
    """Returns what to do with boxes that are told by their corners."""
    edges = [name for name in names if _spelt(_bare(name)) in _CORNERS]
    if len(edges) < _EDGES:
        return ""
    return (
        f"; {', '.join(edges)} are edges of boxes: write where each person stands, in metres, as "
        "x and y"
    )


def _bare(name: str) -> str:
    """Returns a name without its unit."""
    return _parts(name)[0]


def _parts(name: str) -> tuple[str, str | None]:
    """Returns a name without its unit, and the short name of that, or the word as it stands."""
    if found := _UNIT_OF_NAME.match(name):
        return found[1], _unit(found[2], first=found[3])
    word, _, unit = name.rpartition("_")
    short = unit.lower() if unit.lower() in _REFUSED else _known(unit)
    return (word, short) if word and short else (name, None)


def _unit(text: str, first: str) -> str:
    """Returns the short name of the unit that a text is or begins with, or its first word."""
    if short := _known(text):
        return short
    return text.lower() if first == "US" else _short(first)  # US/Eastern is no microseconds


def _spelt(word: str) -> str:
    return re.sub(r"[\s_.-]", "", word).lower()


def _of_row(field: str) -> str:
    """Returns the unit that a field of a row of units states, maybe in brackets; "" if none."""
    found = _IN_BRACKETS.fullmatch(field)
    unit = _short(found[1] if found else field)
    return "" if unit in _NONE else unit


def _short(unit: str) -> str:
    """Returns the short name of a unit, which may be spelt out; of others the word itself."""
    return _known(unit) or unit.strip().lower()


def _known(unit: str) -> str | None:
    """Returns the short name of a unit of length or time that may be spelt out."""
    return unit_of_length(unit) or _TIME_UNITS.get(unit.strip().lower())
