"""The units of a reference system, read from its text: WKT, proj4, a code, Arc/Info.

pyproj reads such texts. If it is not installed, units are read directly from WKT and proj4, whose
specifications say where they are; this is impossible for codes.

Sources: OGC 01-009 (WKT 1) and OGC 18-010r11 (WKT 2); https://proj.org/usage/projections.html for
proj4; ESRI, "ArcInfo Workstation: PROJECTDEFINE", for Arc/Info.
"""

import re
import warnings
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from cocap_opt.data import ProblemError
from cocap_opt.flight.earth import STRETCH, scales_of
from cocap_opt.scenarios.earth import utm
from cocap_opt.scenarios.earth.lengths import Stated, stated_length
from cocap_opt.text import pair

WEB_MERCATOR = "Pseudo-Mercator", "Pseudo Mercator", "Mercator_Auxiliary_Sphere", "webmerc"
_CODE = re.compile(
    r"(?:urn:ogc:def:crs:|https?://www\.opengis\.net/def/crs/)?"
    r"([A-Za-z]+)(?:[:\s]+(?:[\d.]*:)?|/[\d.]+/)(\w+(?:\+\d+)?)"
)
_PROJ4 = re.compile(r"\+?(?:proj|init)\s*=", re.IGNORECASE)
_WKT = re.compile(r"[A-Za-z_]+\s*[\[(]")
_ARC_INFO = re.compile(r"projection\s", re.IGNORECASE)
_DAMAGED = (
    "must be a reference system in WKT or proj4, or a code such as EPSG:25830, but is damaged "
    "or of another kind"
)
_NEEDED = (
    "pyproj, which checks whether it is in metres, is not installed: pip install 'cocap-opt[earth]'"
)
_SLOPPY = 1e-3  # relative tolerance between a factor and the named unit


class NeedsPyprojError(ProblemError):
    """A reference system that only pyproj can interpret, which is not installed."""


class NotTrueError(ProblemError):
    """A projection whose metres are not true metres on the ground."""


class Units(NamedTuple):
    """Units of a reference system."""

    across: Stated | None  # unit of x and y; None: the system has no lengths on a plane
    heights: Stated | None = None  # unit of heights; None: none stated
    kind: str = "degrees"  # the kind of x and y, if they are not lengths on a plane


def units_of(text: str) -> Units:
    """Returns the units of a reference system, given its text.

    Raises
    ------
    NeedsPyprojError
        If it cannot be interpreted without pyproj.
    NotTrueError
        If its metres are not true metres on the ground, as in web Mercator.
    ProblemError
        If it is empty or damaged; all messages are one line.
    """
    text = text.strip().strip("\0")
    if not text:
        raise ProblemError("must name a reference system, but is empty")
    if any(name in text for name in WEB_MERCATOR):
        raise _web_mercator()
    if _ARC_INFO.match(text):
        return _of_arc_info(text)
    is_wkt, is_proj4, code = _WKT.match(text), _PROJ4.match(text), _CODE.fullmatch(text)
    if not (is_wkt or is_proj4 or code):
        raise ProblemError(f"{_DAMAGED}: {text[:40]!r}")
    # This also rejects WKT without units, for which pyproj would assume metres.
    written = _of_wkt(text) if is_wkt else None
    found = _by_pyproj(f"{code[1]}:{code[2]}" if code else text) or written
    if found is not None:
        # If the text contains several systems, one below another, PROJ reads only the first.
        beside = written.heights if written is not None else None
        return found if found.heights else found._replace(heights=beside)
    if code:
        raise NeedsPyprojError(f"{text[:40]}: {_NEEDED}")
    return _of_proj4(text)


def _web_mercator() -> NotTrueError:
    return NotTrueError(
        "must be a projection in true metres, not web Mercator; convert the map with "
        "gdalwarp -t_srs EPSG:326ZZ, where ZZ is the UTM zone"
    )


def _by_pyproj(text: str) -> Units | None:
    """Returns the units as pyproj reads them; None if it is not installed or finds the WKT invalid.

    WKT without a datum, as small programs write it, still states its units.
    """
    try:
        import pyproj
        import pyproj.exceptions
    except ImportError:
        return None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # the warning that +init is deprecated
            crs = pyproj.CRS.from_user_input(text)
    except pyproj.exceptions.CRSError as error:
        if _WKT.match(text):
            return None
        raise ProblemError(f"{_DAMAGED}: {text[:40]!r}") from error
    plane = _plane(crs)
    if "Pseudo Mercator" in str(getattr(plane.coordinate_operation, "method_name", "")):
        raise _web_mercator()
    whole: Any = crs.source_crs if crs.is_bound else crs
    axes = whole.axis_info
    heights = [axis for axis in axes if axis.direction in ("up", "down")]
    across = [axis for axis in axes if axis.direction not in ("up", "down")]
    if any(axis.direction == "down" for axis in heights):
        raise _depths()
    if not across:
        return Units(None, _first(heights), "heights only")
    if plane.is_geographic or plane.is_geocentric:
        return Units(None, _first(heights), "x, y, z" if plane.is_geocentric else "degrees")
    if len({axis.unit_conversion_factor for axis in across}) > 1:
        raise ProblemError("must have x and y in one unit")
    return Units(_first(across), _first(heights))


def _depths() -> ProblemError:
    return ProblemError("must have heights, which count upwards, not depths, which count downwards")


def _plane(crs: Any) -> Any:
    """Returns the part of a reference system that has x and y."""
    while crs.is_bound or crs.is_compound:
        crs = crs.source_crs if crs.is_bound else crs.sub_crs_list[0]
    return crs


def _first(axes: list[Any]) -> Stated | None:
    if not axes:
        return None
    return _consistent(Stated(axes[0].unit_name, axes[0].unit_conversion_factor))


def _consistent(unit: Stated) -> Stated:
    """Returns a unit; raises ProblemError if its name means another length."""
    known = stated_length(unit.name)
    if known is not None and abs(known.metres - unit.metres) > _SLOPPY * unit.metres:
        raise ProblemError(f"contradicts itself: a unit {unit.name!r} of {unit.metres:g} m")
    return unit


def require_true(text: str, x: float, y: float) -> None:
    """Raises ProblemError if a projection's metres are not true metres on the ground at a point
    (m).

    Without pyproj, only web Mercator is recognised, by its name; see `units_of`.
    """
    try:
        import pyproj
        import pyproj.exceptions
    except ImportError:
        return
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            crs = _plane(pyproj.CRS.from_user_input(text))
            if not crs.is_projected:
                return
            longitude, latitude = pyproj.Proj(crs)(x, y, inverse=True)
            scales = scales_of(crs, latitude, longitude)
    except pyproj.exceptions.CRSError:
        return  # WKT of a small program, see `_by_pyproj`
    except pyproj.exceptions.ProjError as error:
        raise _undefined(x, y) from error
    if not np.isfinite([*scales, longitude, latitude]).all():
        raise _undefined(x, y)
    if max(abs(scale - 1) for scale in scales) > STRETCH:
        zone = utm(longitude, latitude)
        raise ProblemError(
            f"must be a projection in true metres, but those of {crs.name} are "
            f"{1 / max(scales):.3g} m long at latitude {latitude:.1f}; convert the map "
            f"with gdalwarp -t_srs {zone}"
        )


def utm_of(text: str) -> tuple[int, bool] | None:
    """Returns the zone of UTM that a reference system is, and whether it is of the north.

    Returns None if it is no zone of UTM, or if pyproj is not installed.
    """
    crs = _known(text)
    zone = None if crs is None else _plane(crs).utm_zone
    return (int(zone[:-1]), zone[-1] == "N") if zone else None


def has_ellipsoid_heights(text: str) -> bool:
    """Returns True if a projection has heights above its ellipsoid; False without pyproj."""
    crs = _known(text)
    if crs is None:
        return False
    return bool(crs.is_projected and not crs.is_compound and len(crs.axis_info) == 3)


def _known(text: str) -> Any | None:
    """Returns a reference system of pyproj; None if it is unknown, or pyproj is not installed."""
    try:
        import pyproj
        import pyproj.exceptions
    except ImportError:
        return None
    try:
        return pyproj.CRS.from_user_input(text)
    except pyproj.exceptions.CRSError:
        return None


def _undefined(x: float, y: float) -> ProblemError:
    return ProblemError(f"must be a projection that is defined where the map is, at {pair(x, y)}")


# Arc/Info


def _of_arc_info(text: str) -> Units:
    fields = {
        words[0].casefold(): words[1]
        for line in text.splitlines()
        if len(words := line.split()) > 1
    }
    projection = fields["projection"].casefold() if "projection" in fields else ""
    if projection == "geographic":
        return Units(None)
    if "units" not in fields:
        raise ProblemError("must have a line Units with METERS or FEET")
    if projection == "mercator":
        raise NotTrueError(
            "must be a projection whose metres are true where the map is, not Mercator"
        )
    across = _of_arc_info_unit(fields["units"])
    if across is None:
        return Units(None)
    z = fields.get("zunits", "no")
    return Units(across, None if z.casefold() in ("no", "none") else _of_arc_info_unit(z))


def _of_arc_info_unit(text: str) -> Stated | None:
    """Returns the unit of length given by a name or by the number of units in a metre; None:
    angles.
    """
    if text.casefold() in ("dd", "ds", "dm", "dms", "degrees", "radians"):
        return None
    try:
        per_metre = float(text)
    except ValueError:
        found = stated_length(text)
    else:
        found = Stated("units", 1 / per_metre) if per_metre > 0 else None
    if found is None:
        raise ProblemError(f"Units, Zunits: must be METERS, FEET or a number, not {text[:40]!r}")
    return found


# proj4

_PLANES = (  # projections with true metres in their area of use
    "utm", "tmerc", "etmerc", "lcc", "laea", "aea", "stere", "sterea", "somerc", "omerc", "krovak",
    "poly", "cass", "nzmg", "ups", "eqdc", "bonne",
)  # fmt: skip


def _of_proj4(text: str) -> Units:
    words = [word.lstrip("+") for word in text.split()]
    fields = dict(word.partition("=")[::2] for word in words)
    projection = fields.get("proj", "").casefold()
    if projection in ("longlat", "latlong", "latlon", "lonlat"):
        return Units(None)
    if {"init", "step"} & fields.keys() or projection not in _PLANES:
        raise NeedsPyprojError(f"{text[:40]}: {_NEEDED}")
    across = _of_proj4_unit(fields, "units", "to_meter") or Stated("metre", 1.0)
    return Units(across, _of_proj4_unit(fields, "vunits", "vto_meter"))


def _of_proj4_unit(fields: dict[str, str], name: str, factor: str) -> Stated | None:
    if name in fields:  # takes precedence over a factor
        found = Stated("km", 1000.0) if fields[name] == "km" else stated_length(fields[name])
        if found is None:
            raise NeedsPyprojError(f"{fields[name][:40]}: {_NEEDED}")
        return found
    if factor not in fields:
        return None
    try:
        above, _, below = fields[factor].partition("/")
        return Stated("units", float(above) / float(below or 1))
    except (ValueError, ZeroDivisionError) as error:
        raise ProblemError(f"+{factor}: must be a number, not {fields[factor][:40]!r}") from error


# WKT


class _Keyword(NamedTuple):
    """A keyword of WKT with the content of its brackets: texts, numbers as texts, and nodes."""

    keyword: str
    content: "list[str | _Keyword]"

    def nodes(self, *keywords: str) -> "list[_Keyword]":
        """Returns the nodes inside it that have one of these keywords, or all nodes."""
        nodes = [part for part in self.content if isinstance(part, _Keyword)]
        return [node for node in nodes if not keywords or node.keyword in keywords]


_TOKEN = re.compile(r'\s*("(?:[^"]|"")*"|[\[\](),]|[^\s\[\](),"]+)')
_ANGULAR = ("GEOGCS", "GEOGCRS", "GEOGRAPHICCRS", "GEODCRS", "GEODETICCRS", "GEOCCS")
_PLANE = ("PROJCS", "PROJCRS", "PROJECTEDCRS", "LOCAL_CS", "ENGCRS", "ENGINEERINGCRS",
          "DERIVEDPROJCRS")  # fmt: skip
_VERTICAL = ("VERTCS", "VERT_CS", "VERTCRS", "VERTICALCRS")
_AROUND = ("COMPD_CS", "COMPOUNDCRS", "BOUNDCRS", "SOURCECRS")
_LENGTH = ("UNIT", "LENGTHUNIT")


def _of_wkt(text: str) -> Units:
    """Reads units from WKT: those of x and y are in the brackets of the projection."""
    found = list(_systems(_nodes(text)))
    angular = [node for node in found if node.keyword in _ANGULAR]
    plane = [node for node in found if node.keyword in _PLANE]
    levels = [node for node in found if node.keyword in _VERTICAL]
    heights = [unit for node in levels for unit in _units(node)]
    if len(angular) + len(plane) != 1:
        raise ProblemError(_DAMAGED)
    if any(_counts_down(node) for node in levels):
        raise _depths()
    if len({unit.metres for unit in heights}) > 1:
        names = " and ".join(dict.fromkeys(unit.name for unit in heights))
        raise ProblemError(f"must state one unit of heights, not {names}")
    upwards = heights[0] if heights else None
    if angular:
        return Units(None, upwards)
    across = _units(plane[0])
    if not across or len({unit.metres for unit in across[:2]}) > 1:
        raise ProblemError("must state the unit of x and y")
    third = across[2] if len(across) > 2 else None
    return Units(across[0], upwards or third)


def _systems(nodes: "list[_Keyword]") -> Iterator[_Keyword]:
    for node in nodes:
        if node.keyword in _AROUND:
            yield from _systems(node.nodes())
        elif node.keyword in (*_ANGULAR, *_PLANE, *_VERTICAL):
            yield node


def _counts_down(node: _Keyword) -> bool:
    """Returns True for a vertical system of depths, by its axis or by Esri's parameter
    Direction.
    """
    axes = [word for axis in node.nodes("AXIS") for word in axis.content[1:2]]
    parameters = [parameter.content[:2] for parameter in node.nodes("PARAMETER")]
    downwards = [word for word in axes if isinstance(word, str) and word.casefold() == "down"]
    return bool(downwards) or any(
        name == "Direction" and isinstance(value, str) and value.startswith("-")
        for name, value in (pair for pair in parameters if len(pair) == 2)
    )


def _units(node: _Keyword) -> list[Stated]:
    """Returns the units of the axes, in order, or the single unit of all axes."""
    of_axes = [unit for axis in node.nodes("AXIS") for unit in axis.nodes(*_LENGTH)]
    return [_unit(unit) for unit in of_axes or node.nodes(*_LENGTH)]


def _unit(node: _Keyword) -> Stated:
    name, factor, *_ = [*[part for part in node.content if isinstance(part, str)], "", ""]
    try:
        metres = float(factor)
    except ValueError as error:
        raise ProblemError(_DAMAGED) from error
    return _consistent(Stated(name, metres))


def _nodes(text: str) -> list[_Keyword]:
    """Returns the nodes of WKT; all brackets must be closed.

    Raises
    ------
    ProblemError
        If it is cut off or is not WKT.
    """
    whole = _Keyword("", [])
    stack, position, word = [whole], 0, ""
    while found := _TOKEN.match(text, position):
        position, token = found.end(), found[1]
        if token in "[(":
            node = _Keyword(word.upper(), [])
            stack[-1].content[-1:] = [node]
            stack.append(node)
        elif token in "])":
            stack.pop()
            if not stack:
                break
        elif token != ",":
            word = token
            stack[-1].content.append(token.strip('"'))
    if len(stack) != 1 or text[position:].strip():
        raise ProblemError(f"{_DAMAGED}: its brackets do not close")
    return whole.nodes()


def require_metres(units: Units) -> None:
    """Raises ProblemError unless x and y of a system are in metres."""
    way_out = "convert the map with gdalwarp -t_srs EPSG:326ZZ, where ZZ is the UTM zone"
    if units.across is None:
        raise ProblemError(f"must be a projection in metres, not in {units.kind}; {way_out}")
    if units.across.metres != 1:
        name, metres = units.across
        raise ProblemError(
            f"must be a projection in metres, not in {name} of {metres:.9g} m; {way_out}"
        )
