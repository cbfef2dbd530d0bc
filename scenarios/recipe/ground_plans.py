"""Ground plans in files: polygons of the walkable area and of the obstacles in it.

They are JSON of PedPy's kind, {name: {"walkable": [[x, y], ..], "obstacles": [[[x, y], ..], ..]}},
or GeoJSON or WKT, whose polygons are obstacles or walkable areas as the recipe says. GeoJSON and
WKT may be in longitudes and latitudes of WGS 84, as GeoJSON is by its standard.
"""

import math
import re
from collections.abc import Iterator, Sequence
from typing import Annotated, Any, Literal, NamedTuple

import msgspec
import numpy as np
import shapely
from msgspec import Meta
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from cocap_opt.data import LARGEST, ProblemError
from cocap_opt.files.messages import in_words
from cocap_opt.files.strict_json import decode_json
from cocap_opt.scenarios.kinds import CITYJSON, GEOJSON, WAYS_OUT, WKT, kind_of
from cocap_opt.scenarios.recipe.earth import NOWHERE, Projection
from cocap_opt.scenarios.recipe.geotiff import is_geographic
from cocap_opt.scenarios.recipe.systems import same_system, short_name, utm
from cocap_opt.scenarios.recipe.tables import PER_METRE, Point

Ring = Annotated[list[Point], Meta(min_length=3)]
Meaning = Literal["obstacles", "walkable"]

SLIVER = 0.01  # m2, which rings may enclose twice by rounding
_SCHEME = '{"name": {"walkable": [[x, y], ..], "obstacles": [[[x, y], ..], ..]}}'
DEGREES = ("4326", "CRS84")  # names of systems of longitude and latitude that become metres
OTHER_DEGREES = ("4258", "4269")  # such systems of another datum
MERCATOR = ("3857", "900913")
_GEOGRAPHIC = range(4000, 5000)  # codes, of which most are; newer ones are elsewhere
_LARGEST_ANGLE = 360.0  # degrees
_SOUND = {
    GEOJSON: '{"type": "Polygon", "coordinates": [[[0, 0], [4, 0], [4, 3], [0, 0]]]}',
    WKT: "POLYGON ((0 0, 4 0, 4 3, 0 0))",
}
_DIGITS = 9  # of a code, more than any has
_SYSTEM = re.compile(r"\s*SRID\s*=\s*([0-9]+)\s*;", re.IGNORECASE)  # as PostGIS writes it first
_NAMED_SYSTEM = re.compile(r"EPSG[:/]+(?:[0-9.]*[:/])?([0-9]+)", re.IGNORECASE)


class GroundPlan(NamedTuple):
    """A ground plan, in m."""

    walkable: tuple[BaseGeometry, ...]
    obstacles: tuple[BaseGeometry, ...]
    heights: tuple[float | None, ...] = ()  # m, those that the file says, of the first obstacles
    properties: tuple[str, ...] = ()  # of the features of GeoJSON that these obstacles are in

    def told(self, k: int) -> str:
        """Says why an obstacle or a border of this number has no height of its own."""
        if k >= len(self.properties):
            return "the file has none"
        own = self.properties[k] or "none"
        return f"polygon {k + 1} has no property `height` of metres, but {own}"


class _Stated(NamedTuple):
    """The reference system that a file of GeoJSON or WKT states, if it does."""

    field: str
    name: str = ""  # as GeoJSON has it
    code: int | None = None  # of EPSG

    @classmethod
    def of(cls, text: str, kind: str) -> "_Stated":
        """Returns what a text says."""
        if kind != GEOJSON:
            found = _SYSTEM.match(text)
            return cls("SRID", code=int(found[1][:_DIGITS]) if found else None)
        name = str(decode_json(text, dict[str, Any]).get("crs") or "")
        found = _NAMED_SYSTEM.search(name)
        return cls("crs", name, int(found[1][:_DIGITS]) if found else None)

    def is_one_of(self, systems: Sequence[str]) -> bool:
        """Returns True if the name or the code is one of some."""
        return str(self.code) in systems or any(name in self.name for name in systems)

    def is_degrees(self, geometry: BaseGeometry) -> bool:
        """Returns True for longitudes and latitudes of WGS 84, as it says or as they look."""
        if self.name or self.code is not None:
            return self.is_one_of(DEGREES)
        x0, y0, x1, y1 = geometry.bounds
        return bool(max(x1 - x0, y1 - y0) < 1 and max(-x0, x1) <= 180 and max(-y0, y1) <= 90)


class _Plan(msgspec.Struct):
    """One ground plan of a file."""

    walkable: Ring
    obstacles: list[Ring] = []
    unit: str = ""  # the last word counts: "cm in file; polygon in m"

    def settled_unit(self, stated: str | None) -> str:
        """Returns the unit that the file states, or else the recipe."""
        own = self.unit.split()[-1:]
        if own and own[0] not in PER_METRE:
            raise ProblemError(f"unit: must be {', '.join(PER_METRE)}, not {self.unit!r}")
        if own and stated and own[0] != stated:
            raise ProblemError(f"unit: is {own[0]!r} in the file, but {stated!r} in the recipe")
        return (own or [stated or "m"])[0]


def ground_plan(
    text: str,
    name: str | None,
    unit: str | None,
    meaning: Meaning | None,
    projection: Projection = NOWHERE,
) -> GroundPlan:
    """Reads a ground plan.

    Parameters
    ----------
    text : of the file
    name : of a ground plan in JSON; None: the only one
    unit : of the coordinates; None: as the file says, else m
    meaning : of the polygons of GeoJSON and WKT
    projection : makes metres of degrees; its system is that of the file if it states another

    Raises
    ------
    ProblemError
        If the text is of another kind or has no such ground plan, a polygon crosses itself, or
        coordinates are in another system, or degrees of a scene whose place nobody says.
    """
    if text.lstrip().startswith("<"):
        raise ProblemError(
            "is XML, as JuPedSim keeps geometries; write the corners of its walkable area and "
            f"obstacles as JSON: {_SCHEME}, in m"
        )
    kind = kind_of(text)
    if kind == CITYJSON:
        raise ProblemError(f"is CityJSON: {WAYS_OUT[CITYJSON]}")
    if kind in (GEOJSON, WKT):
        return _of_polygons(text, kind, name, unit, meaning, projection)
    own = _named(text, name)
    if meaning is not None:
        raise ProblemError("polygons: must be left out where the file says which are obstacles")
    per_metre = PER_METRE[own.settled_unit(unit)]
    obstacles = (
        sound(Polygon(np.array(ring) / per_metre), f"obstacles[{k}]")
        for k, ring in enumerate(own.obstacles)
    )
    walkable = sound(Polygon(np.array(own.walkable) / per_metre), "walkable")
    return GroundPlan((walkable,), tuple(obstacles))


def sound(polygon: Polygon, field: str) -> BaseGeometry:
    """Returns a polygon (m) as it is meant, or raises a ProblemError if nobody can know that.

    Rings may pass a point twice, or cross themselves by a rounding.

    Parameters
    ----------
    field : as the message names it
    """
    if shapely.is_valid(polygon):
        return polygon
    mended = shapely.make_valid(polygon)
    # A loop that is run through the other way round counts negative, or twice, in the one area.
    if abs(polygon.area - mended.area) > SLIVER:
        reason = shapely.is_valid_reason(polygon)
        at = re.search(r"\[(\S+) (\S+?)\]", reason)
        where = f" at ({float(at[1]):.6g}, {float(at[2]):.6g}) m" if at else ""
        if "ntersection" in reason:
            raise ProblemError(f"{field}: must not cross itself, as it does{where}")
        raise ProblemError(f"{field}: must be sound, but has: {reason.split('[')[0]}{where}")
    return mended


def _named(text: str, name: str | None) -> _Plan:
    """Returns the ground plan of this name in JSON."""
    try:
        decode_json(text, msgspec.Raw)  # first of all it must be JSON
    except (msgspec.MsgspecError, RecursionError) as error:
        raise ProblemError(in_words(error, text, msgspec.Raw)) from error
    try:
        plans = msgspec.json.decode(text, type=dict[str, _Plan])
    except msgspec.MsgspecError as error:
        words = in_words(error, text, dict[str, _Plan]).replace("[...].", "").replace("[...]: ", "")
        raise ProblemError(f"{words}; ground plans are {_SCHEME}") from error
    if not plans:
        raise ProblemError("holds no ground plan")
    if name is None and len(plans) != 1:
        raise ProblemError(f"name: must be one of {', '.join(plans)}")
    if name is not None and name not in plans:
        raise ProblemError(f"name: must be one of {', '.join(plans)}, not {name!r}")
    return plans[name] if name is not None else next(iter(plans.values()))


def _of_polygons(
    text: str,
    kind: str,
    name: str | None,
    unit: str | None,
    meaning: Meaning | None,
    projection: Projection,
) -> GroundPlan:
    """Returns the ground plan of GeoJSON or WKT, all of whose polygons mean the same."""
    if name is not None:
        raise ProblemError(f"name: must be left out where the file is {kind}")
    if meaning is None:
        raise ProblemError(
            f'polygons: must be "obstacles" or "walkable", whose holes are obstacles, for the '
            f"file is {kind} and does not say it"
        )
    stated = _Stated.of(text, kind)
    geometry = shapely.force_2d(_geometry(text, kind))
    given = shapely.MultiPolygon(list(_polygons(geometry)))
    _require_points(given)
    if stated.is_degrees(given):
        if unit is not None:
            raise ProblemError("unit: must be left out, for the coordinates are degrees")
        metres = shapely.transform(given, lambda points: projection.metres(*points.T[::-1]))
    else:
        _require_system(stated, given, projection)
        metres = shapely.transform(given, lambda points: points / PER_METRE[unit or "m"])
    polygons = [sound(part, f"polygon {k}") for k, part in enumerate(metres.geoms, start=1)]
    if meaning == "obstacles":
        own = list(_heights(text, geometry)) if kind == GEOJSON else []
        return GroundPlan((), tuple(polygons), *(zip(*own, strict=True) if own else ((), ())))
    parts = [part for polygon in polygons for part in _polygons(polygon)]
    holes = [Polygon(ring) for part in parts for ring in part.interiors]
    return GroundPlan(tuple(Polygon(part.exterior) for part in parts), tuple(holes))


def _geometry(text: str, kind: str) -> BaseGeometry:
    try:
        plain = text[found.end() :] if (found := _SYSTEM.match(text)) else text
        with np.errstate(over="ignore", invalid="ignore"):  # what is infinite is refused later
            return shapely.from_geojson(text) if kind == GEOJSON else shapely.from_wkt(plain)
    except (shapely.errors.ShapelyError, NotImplementedError) as error:
        if "closed" in str(error):
            raise ProblemError(f"{kind}: rings must end at the point where they begin") from error
        raise ProblemError(f"cannot be read as {kind}, which is such as {_SOUND[kind]}") from error


def _heights(text: str, geometry: BaseGeometry) -> Iterator[tuple[float | None, str]]:
    """Yields the property `height` (m) of each polygon of GeoJSON, or None, and all properties.

    Raises
    ------
    ProblemError
        If one is no number above 0, also not as text, "6" or "6 m", as OpenStreetMap has them.
    """
    content = decode_json(text, dict[str, Any])
    is_one = content.get("type") != "FeatureCollection"
    features = [content] if is_one else content["features"]
    parts = [geometry] if is_one else getattr(geometry, "geoms", ())
    for k, (feature, part) in enumerate(zip(features, parts, strict=True)):
        properties = feature.get("properties") or {}
        given = properties.get("height")
        own = None if given in (None, "") else _metres(given, f"features[{k}].properties.height")
        shown = ", ".join(f"{name} = {value!r:.20}" for name, value in properties.items())
        yield from ((own, shown) for _ in _polygons(part))


def _metres(value: Any, field: str) -> float:
    try:
        metres = float(value.removesuffix("m") if isinstance(value, str) else value)
    except (TypeError, ValueError):
        metres = math.nan
    if isinstance(value, bool) or not 0 < metres <= LARGEST:
        raise ProblemError(
            f"{field}: must be a number of metres above 0, or left out, not {value!r:.40}"
        )
    return metres


def _require_system(stated: _Stated, geometry: BaseGeometry, projection: Projection) -> None:
    """Raises a ProblemError if a file states a system without metres, or not the scene's.

    Without rasterio, which knows them all, systems of longitude and latitude are those with codes
    of 4000 to 4999, as have a few in metres, whose coordinates are larger.
    """
    field, code = stated.field, stated.code
    scene = projection.earth.crs if projection.earth else None
    small = bool(np.abs(shapely.get_coordinates(geometry)).max() <= _LARGEST_ANGLE)
    is_mercator = stated.is_one_of(MERCATOR)
    has_degrees = stated.is_one_of(OTHER_DEGREES) or (
        code is not None and small and _is_geographic(code)
    )
    if is_mercator or has_degrees:
        raise ProblemError(
            f"{field}: must be of a projection in metres, or of 4326, not {code or stated.name}, "
            f"{'web Mercator' if is_mercator else 'degrees'}; {_way_out(geometry, scene)}"
        )
    if code is None and stated.name:
        raise ProblemError("crs: must name an EPSG code, or be left out")
    if code is not None and scene is not None and not same_system(scene, f"EPSG:{code}"):
        raise ProblemError(
            f"{field}: must be the reference system of the scene, {short_name(scene)}, not "
            f"EPSG:{code}; {_way_out(geometry, scene)}"
        )


def _way_out(geometry: BaseGeometry, scene: str | None) -> str:
    """Returns the command of GDAL that writes a geometry in the scene's system, or in UTM."""
    x0, y0, x1, y1 = geometry.bounds
    system = scene
    if system is None and x0 >= -180 and x1 <= 180 and y0 >= -90 and y1 <= 90:
        system = utm((x0 + x1) / 2, (y0 + y1) / 2)
    zone = "" if system else ", ZZ the zone of UTM, in the south EPSG:327ZZ"
    return (
        f"`ogr2ogr -t_srs {short_name(system or 'EPSG:326ZZ')} NEW.geojson OLD.geojson` writes "
        f"the file OLD.geojson in metres{zone}"
    )


def _is_geographic(code: int) -> bool:
    known = is_geographic(code)
    return code in _GEOGRAPHIC if known is None else known


def _require_points(geometry: BaseGeometry) -> None:
    """Raises a ProblemError if there are no polygons, or endless ones."""
    if geometry.is_empty:
        raise ProblemError("must hold at least one polygon")
    if not np.abs(shapely.get_coordinates(geometry)).max() <= LARGEST:  # true for nan, too
        raise ProblemError(f"coordinates: must be finite numbers within +-{LARGEST:g} m")


def _polygons(geometry: BaseGeometry) -> Iterator[Polygon]:
    if isinstance(geometry, Polygon):
        yield geometry
    elif hasattr(geometry, "geoms"):
        for part in geometry.geoms:
            yield from _polygons(part)
    else:
        raise ProblemError(f"must hold polygons only, not a {geometry.geom_type}")
