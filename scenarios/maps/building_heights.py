"""The bottom and the top of a building, given by its properties in a file.

Sources: the tags of OpenStreetMap, https://wiki.openstreetmap.org/wiki/Simple_3D_Buildings (heights
are in metres unless they have another unit, and count from the ground), and the properties of OSM
Buildings, https://osmbuildings.org/documentation/data/; the properties of Overture Maps,
https://docs.overturemaps.org/schema/reference/buildings/building/, and of CityGML. Microsoft's
footprints, https://github.com/microsoft/GlobalMLBuildingFootprints, have -1 for unknown heights.
"""

import math
import re
from collections.abc import Mapping
from typing import Any, NamedTuple

import msgspec

from cocap_opt.data import ProblemError
from cocap_opt.scenarios.earth.lengths import stated_length

STOREY = 3.0  # m; the value that Simple 3D Buildings proposes if only storeys are known

_TOP = "height", "buildingheight", "estheight", "measuredheight"
_STOREYS = "buildinglevels", "levels", "numfloors"
_ROOF, _ROOF_STOREYS = "roofheight", "rooflevels"
_BOTTOM = "minheight", "buildingminheight"
# Not min_level, which is the lowest storey of a building with an indoor map.
_BOTTOM_STOREYS = "buildingminlevel", "minfloor"
# Units of the heights, and columns that may also count dwellings.
_UNIT, _MAYBE_UNIT = ("heightunit", "heightunits", "unitofheight", "heightuom"), ("unit", "units")
_KNOWN = (*_TOP, *_STOREYS, _ROOF, _ROOF_STOREYS, *_BOTTOM, *_BOTTOM_STOREYS,
          *_UNIT, *_MAYBE_UNIT)  # fmt: skip

_ESTIMATE = "estheight"  # need not agree with the height
# Other properties that probably are a height or a bottom, in any spelling.
_LIKELY = re.compile(
    r"(?i:height|hgt)|(?<![A-Za-z])(?:[Bb]ase(?![a-z])|BASE(?![A-Za-z]))|(?<=[a-z])Base(?![a-z])"
)
# Numbers about heights that are none, and altitudes of the ground; the tag maxheight is that of
# vehicles that may pass.
_ABOUT = re.compile(
    r"elev|altitude|ground|terrain|source|accuracy|error|quality|confidence|date|year"
    r"|(?<![a-z])id(?![a-z])|^maxheight(?![a-z_])",
    re.IGNORECASE,
)

_LOWEST = re.compile(r"base|min|bottom|lower", re.IGNORECASE)
_UNKNOWN = -1, "-1", "-1.0"  # as a height

_LENGTH = re.compile(r"([+-]?(?:\d+(?:[.,]\d*)?|[.,]\d+)(?:[eE][+-]?\d+)?)\s*(.*)")
_FEET_AND_INCHES = re.compile(r"(\d+(?:\.\d+)?)\s*'\s*(?:(\d+(?:\.\d+)?)\s*\")?")
_LONGEST = 40  # letters of a value that a message quotes
_THOUSANDS = re.compile(r"[+-]?\d{1,3},\d{3}")  # thousands or a decimal comma; ambiguous
# the form in which GDAL writes all other tags of OpenStreetMap
_HSTORE = re.compile(r'"([^"]+)"=>"([^"]*)"')
_FROM_FOOT = re.compile(r"\s*\b(?:above ground(?: level)?|agl)$", re.IGNORECASE)
_FOOT, _INCH = 0.3048, 0.0254  # m
TALLEST = 1000.0  # m above the ground; no building or tree is as tall


class Extent(NamedTuple):
    """The bottom and the top of a building, m above its foot."""

    bottom: float = 0.0
    top: float | None = None  # None: the file states no height
    is_counted: bool = False  # computed from storeys


_Given = tuple[str, Any]  # name of a property as the file spells it, and its value


def extent(properties: Mapping[str, Any], field: str) -> Extent:
    """Returns the bottom and the top of a building.

    Names of properties may be in capitals or written as one word, and may be in `tags`. A height
    takes precedence over storeys, each of which has `STOREY` metres.

    Parameters
    ----------
    properties : of a feature
    field : name of the properties in messages

    Raises
    ------
    ProblemError
        If a value is not a length, the bottom is not below the top, or a number is probably a
        height but its name is unknown; one line.
    """
    given = _known(properties, field)
    _require_metres(given, field)
    bottom, top = _length(given, _BOTTOM, field, least=0), _length(given, _TOP, field)
    _refuse_likely(properties, field, top)
    is_counted = False
    if top is None and (storeys := _number(given, _STOREYS, field)) is not None:
        is_counted = True
        roof = _length(given, (_ROOF,), field, least=0)
        if roof is None:
            roof = STOREY * (_number(given, (_ROOF_STOREYS,), field) or 0.0)
        top = STOREY * storeys + roof
    if bottom is None and (below := _number(given, _BOTTOM_STOREYS, field)) is not None:
        is_counted = is_counted or below > 0
        bottom = STOREY * below
    bottom = bottom or 0.0
    if top is not None and not bottom < top:
        raise ProblemError(
            f"{field}: the top, {top:g} m, must be above the bottom, {bottom:g} m, which is "
            "min_height or comes from the number of lowest storeys"
        )
    return Extent(bottom, top, is_counted)


def is_underground(properties: Mapping[str, Any]) -> bool:
    """Returns True for a structure that OpenStreetMap or Overture Maps says is below the ground."""
    return any(
        (_key(name) == "location" and value == "underground")
        or (_key(name) == "isunderground" and value in (True, "true", 1))
        for name, value in _flat(properties, "properties")
    )


def is_no_building(properties: Mapping[str, Any]) -> bool:
    """Returns True for an area of which OpenStreetMap says that it is no building."""
    flat = _flat(properties, "properties")
    return any(_key(name) == "building" and value == "no" for name, value in flat)


def is_part(properties: Mapping[str, Any]) -> bool:
    """Returns True for a part of a building, which replaces the outline of the whole building.

    Source: https://wiki.openstreetmap.org/wiki/Simple_3D_Buildings.
    """
    flat = _flat(properties, "properties")
    return any(
        _key(name) == "buildingpart" and value not in (None, "", "no") for name, value in flat
    )


def is_outline(properties: Mapping[str, Any]) -> bool:
    """Returns True for a whole building of OpenStreetMap, which may have parts."""
    flat = _flat(properties, "properties")
    return any(_key(name) == "building" and value not in (None, "") for name, value in flat)


def is_canopy(properties: Mapping[str, Any]) -> bool:
    """Returns True for a roof of OpenStreetMap without walls, whose underside is not stated."""
    flat = {_key(name): value for name, value in _flat(properties, "properties")}
    is_roof = "roof" in (flat.get("building"), flat.get("buildingpart"))
    return is_roof and not any(key in flat for key in (*_BOTTOM, *_BOTTOM_STOREYS))


def may_be_underground(properties: Mapping[str, Any]) -> bool:
    """Returns True for a building of OpenStreetMap with a negative layer: many are underground, but
    a layer only says what crosses what.
    """
    tags = {name.casefold(): str(value) for name, value in _flat(properties, "properties")}
    return "building" in tags and bool(re.fullmatch(r"\s*-\d+(\.0*)?\s*", tags.get("layer", "")))


def _quoted(value: object) -> str:
    """Returns the beginning of a value of JSON as messages quote it; words are as in the file."""
    said = repr(value) if isinstance(value, str) else msgspec.json.encode(value).decode()
    return said[:_LONGEST]


def _require_metres(given: Mapping[str, _Given], field: str) -> None:
    """Raises a ProblemError if a property of its own states that heights are not in metres."""
    for key in (*_UNIT, *_MAYBE_UNIT):
        name, value = given.get(key, (key, "m"))
        unit = stated_length(str(value))
        if (unit is None and key in _UNIT) or (unit is not None and unit.metres != 1):
            raise ProblemError(
                f"{field}.{name}: must be m, as plain heights are in metres, not {_quoted(value)}; "
                'write the unit with each height, such as "40 ft"'
            )


def _known(properties: Mapping[str, Any], field: str) -> dict[str, _Given]:
    """Returns the known properties, by names in lower case without separators."""
    found: dict[str, _Given] = {}
    for name, value in _flat(properties, field):
        key = _key(name)
        if key not in _KNOWN or value in (None, "") or (key in _TOP and value in _UNKNOWN):
            continue
        if key in found and not _is_same(found[key][1], value):
            first, other = found[key]
            raise ProblemError(
                f"{field}: {first} and {name} must agree, but are {_quoted(other)} and "
                f"{_quoted(value)}"
            )
        found[key] = name, value
    return found


def _refuse_likely(properties: Mapping[str, Any], field: str, top: float | None) -> None:
    """Raises a ProblemError that names a property with a number that is probably a height.

    Without it, a block in the air would become solid from the ground, or a building too low. What
    is no higher than the top, such as eaves, changes nothing.

    Parameters
    ----------
    top : the stated height, m; None: not stated
    """
    for name, value in _flat(properties, field):
        if _key(name) in _KNOWN or not _LIKELY.search(name) or _ABOUT.search(name):
            continue
        number = _LENGTH.fullmatch(str(value).strip())
        if number is None or (length := float(number[1].replace(",", "."))) in (0, -1):
            continue
        if top is not None and length <= top and not _LOWEST.search(name):
            continue
        raise ProblemError(
            f"{field}.{name}: must be called height or min_height, with its unit if it is not m, "
            'such as "40 ft", or be left out, as properties of this name are not read: '
            f"{_quoted(value)}"
        )


def _key(name: str) -> str:
    """Returns a name in lower case without separators."""
    return re.sub(r"[\s_:\-]", "", name).casefold()


def _is_same(value: Any, other: Any) -> bool:
    """Returns True if two values are equal or are the same length, such as 9, "9" and "9 m"."""
    return value == other or _metres(value) == _metres(other)


def _flat(properties: Mapping[str, Any], field: str) -> list[tuple[str, Any]]:
    """Returns names and values, including those nested in `tags`, as by osmtogeojson and GDAL."""
    nested: list[tuple[str, Any]] = []
    for name in ("tags", "other_tags"):
        tags = properties.get(name)
        if isinstance(tags, str):
            tags = _tags(tags, f"{field}.{name}")
        if isinstance(tags, dict):
            nested += tags.items()
        elif isinstance(tags, list):
            nested += [_pair(tag, f"{field}.{name}") for tag in tags if isinstance(tag, dict)]
    return [*properties.items(), *nested]


def _pair(tag: Mapping[str, Any], field: str) -> tuple[str, Any]:
    """Returns the name and the value of a tag in a list, the form of OpenStreetMap's own XML."""
    for name, value in (("k", "v"), ("key", "value")):
        if isinstance(tag.get(name), str) and value in tag:
            return tag[name], tag[value]
    raise ProblemError(f'{field}: must be an object such as {{"height": "12"}}, not {_quoted(tag)}')


def _tags(text: str, field: str) -> dict[str, Any]:
    """Returns the tags in a text written by GDAL: JSON, or pairs `"name"=>"value"`."""
    if _HSTORE.search(text) or not text.strip():
        return dict(_HSTORE.findall(text))
    try:
        return msgspec.json.decode(text, type=dict[str, Any])
    except (msgspec.MsgspecError, RecursionError) as error:
        raise ProblemError(
            f'{field}: must be an object, or text such as "height"=>"12", not {text!r:.40}'
        ) from error


def _first(given: Mapping[str, _Given], names: tuple[str, ...], field: str) -> _Given | None:
    """Returns the first of some properties that is present, with which the others must agree."""
    found = [given[key] for key in names if key in given]
    others = [given[key] for key in names if key in given and key != _ESTIMATE]
    for name, value in others[1:]:
        if not _is_same(value, others[0][1]):
            raise ProblemError(
                f"{field}: {others[0][0]} and {name} must agree, but are "
                f"{_quoted(others[0][1])} and {_quoted(value)}"
            )
    return found[0] if found else None


def _length(
    given: Mapping[str, _Given], names: tuple[str, ...], field: str, least: float | None = None
) -> float | None:
    """Returns the first of some properties that is present, in m; None if none is.

    Parameters
    ----------
    least : smallest allowed value; None: it must be above 0
    """
    found = _first(given, names, field)
    if found is None:
        return None
    name, value = found
    metres = _metres(value)
    if metres > TALLEST:
        raise ProblemError(
            f"{field}.{name}: must be at most {TALLEST:g} m, not {_quoted(value)}; is it in cm or "
            "mm?"
        )
    if not (metres > 0 if least is None else metres >= least):  # true for nan, too
        above = "above" if least is None else ">="
        raise ProblemError(
            f"{field}.{name}: must be a number of metres {above} 0, or a length such as "
            f'"12.5 m" or "40 ft", or left out, not {_quoted(value)}'
        )
    return metres


def _number(given: Mapping[str, _Given], names: tuple[str, ...], field: str) -> float | None:
    """Returns the first of some numbers of storeys that is present; None if none is."""
    found = _first(given, names, field)
    if found is None:
        return None
    name, value = found
    try:
        count = math.nan if isinstance(value, bool) else float(value)
    except (TypeError, ValueError):
        count = math.nan
    most = TALLEST // STOREY
    if not 0 <= count <= most:
        raise ProblemError(
            f"{field}.{name}: must be a number of storeys from 0 to {most:g}, or left out, not "
            f"{_quoted(value)}"
        )
    return count


def _metres(value: Any) -> float:
    """Returns a length in m, which is also the unit of plain numbers; nan if it is not a length."""
    if isinstance(value, bool) or not isinstance(value, str | int | float):
        return math.nan
    text = str(value).strip().replace("\N{PRIME}", "'").replace("\N{DOUBLE PRIME}", '"')
    text = text.replace("\N{RIGHT SINGLE QUOTATION MARK}", "'")
    if parts := _FEET_AND_INCHES.fullmatch(text):
        return float(parts[1]) * _FOOT + float(parts[2] or 0) * _INCH
    found = _LENGTH.fullmatch(text)
    if found is None or _THOUSANDS.fullmatch(found[1]):
        return math.nan
    # Heights above the sea or a geoid do not count from the foot of the building.
    unit = stated_length(_FROM_FOOT.sub("", found[2]) or "m")
    return math.nan if unit is None else float(found[1].replace(",", ".")) * unit.metres
