"""Ground plans in files: polygons of the walkable area and of the obstacles in it.

They are JSON of PedPy's kind, {name: {"walkable": [[x, y], ..], "obstacles": [[[x, y], ..], ..]}},
or GeoJSON or WKT, whose polygons are obstacles or walkable areas, as the recipe states. Their
coordinates are described in `cocap_opt.scenarios.maps.plan_systems`.
"""

import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
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
from cocap_opt.scenarios.earth.place import FARTHEST, NOWHERE, MapProjection
from cocap_opt.scenarios.kinds import CITYJSON, GEOJSON, WKT, Kind, kind_of_text
from cocap_opt.scenarios.maps.building_heights import STOREY, Extent, extent
from cocap_opt.scenarios.maps.footprints import SLIVER, Footprint, obstacles_of
from cocap_opt.scenarios.maps.geojson import FoundPolygon, read_geojson
from cocap_opt.scenarios.maps.parts import parts_of, polygons_of
from cocap_opt.scenarios.maps.plan_systems import StatedSystem, in_metres
from cocap_opt.scenarios.tables import PER_METRE, Point
from cocap_opt.text import pair, plain, shortened

Ring = Annotated[list[Point], Meta(min_length=3)]
Meaning = Literal["obstacles", "walkable"]

_SCHEME = '{"name": {"walkable": [[x, y], ..], "obstacles": [[[x, y], ..], ..]}}'
_OTHER_JSON = {  # keys of other formats of polygons, and the names of the formats
    "arcs": "is TopoJSON; convert it with `ogr2ogr NEW.geojson OLD.json`",
    "geometryType": "is Esri JSON; convert it with `ogr2ogr NEW.geojson OLD.json`",
    "elements": "is Overpass JSON; convert it with osmtogeojson",
}
_SOUND = "POLYGON ((0 0, 4 0, 4 3, 0 0))"


class GroundPlan(NamedTuple):
    """A ground plan, in m."""

    walkable: tuple[BaseGeometry, ...]
    obstacles: tuple[BaseGeometry, ...]
    # extents of the first obstacles, as far as the file states them
    extents: tuple[Extent, ...] = ()
    properties: tuple[str, ...] = ()  # properties in GeoJSON of the features of these obstacles
    notes: tuple[str, ...] = ()  # parts that were left out, and assumptions

    def told(self, k: int) -> str:
        """Explains why the obstacle or border with this number has no height of its own."""
        if k >= len(self.properties):
            return "the file states none"
        listed = self.properties[k] or "none"
        return f"polygon {k + 1} has no property `height` in metres; its properties: {listed}"

    def told_height(self, height: float) -> str:
        """Says how many polygons with properties get a height (m) as theirs is not known; empty if
        there are none.
        """
        without = [k for k, extent in enumerate(self.extents) if extent.top is None]
        telling = [k for k in without if k < len(self.properties) and self.properties[k]]
        if not telling:
            return ""
        return (
            f"{len(without)} of {len(self.extents)} polygons state no height that is read, and get "
            f"the {height:g} m of the table; properties of polygon {telling[0] + 1}: "
            f"{shortened(self.properties[telling[0]])}"
        )


class _Plan(msgspec.Struct):
    """One ground plan of a file."""

    walkable: Ring
    obstacles: list[Ring] = []
    unit: str = ""  # the last word of it is used: "cm in file; polygon in m"

    def settled_unit(self, stated: str | None) -> str:
        """Returns the unit that the file states or, if it states none, the unit of the recipe."""
        last = self.unit.split()[-1:]
        if last and last[0] not in PER_METRE:
            raise ProblemError(f"unit: must be {', '.join(PER_METRE)}, not {self.unit!r}")
        if last and stated and last[0] != stated:
            raise ProblemError(f"unit: must be {last[0]!r}, as in the file, not {stated!r}")
        return (last or [stated or "m"])[0]


def ground_plan(
    text: str,
    name: str | None,
    unit: str | None,
    meaning: Meaning | None,
    projection: MapProjection = NOWHERE,
) -> GroundPlan:
    """Reads a ground plan.

    Parameters
    ----------
    text : of the file
    name : of a ground plan in JSON; None: the only one
    unit : of the coordinates; None: as stated in the file, otherwise degrees in GeoJSON and m in
        other files
    meaning : of the polygons of GeoJSON and WKT
    projection : converts degrees to metres; if it has a system, and the file states a system of
        metres, the two must be the same

    Raises
    ------
    ProblemError
        If the text is of another kind or has no such ground plan, if a polygon crosses itself, if
        coordinates are in another system, or if they are degrees and the scene has no place on
        the Earth.
    """
    if text.lstrip().startswith("<"):
        raise ProblemError(
            "is XML, e.g. a geometry of JuPedSim; write the corners of its walkable area and of "
            f"its obstacles as JSON, in m: {_SCHEME}"
        )
    kind = kind_of_text(text)
    if kind == CITYJSON:
        raise ProblemError(f"is {CITYJSON.name}: {CITYJSON.way_out}")
    if kind in (GEOJSON, WKT):
        return _of_polygons(text, kind, name, unit, meaning, projection)
    plan = _named(text, name)
    if meaning is not None:
        raise ProblemError("polygons: must be left out, as the file states which are obstacles")
    per_metre = PER_METRE[plan.settled_unit(unit)]
    obstacles = (
        sound(Polygon(np.array(ring) / per_metre), f"obstacles[{k}]")
        for k, ring in enumerate(plan.obstacles)
    )
    walkable = sound(Polygon(np.array(plan.walkable) / per_metre), "walkable")
    return GroundPlan((walkable,), tuple(obstacles))


def sound(polygon: Polygon, field: str) -> BaseGeometry:
    """Returns a valid polygon (m), or raises a ProblemError if the polygon is ambiguous.

    Rings may pass through a point twice, or cross themselves slightly because of rounding.

    Parameters
    ----------
    field : name of the polygon in messages
    """
    if shapely.is_valid(polygon):
        return polygon
    mended = shapely.make_valid(polygon)
    # A loop with the opposite orientation counts as negative area, or twice.
    if abs(polygon.area - mended.area) > SLIVER:
        reason = shapely.is_valid_reason(polygon)
        at = re.search(r"\[(\S+) (\S+?)\]", reason)
        where = f" at {pair(float(at[1]), float(at[2]))} m" if at else ""
        if "ntersection" in reason:
            raise ProblemError(f"{field}: must not cross itself, as it does{where}")
        raise ProblemError(f"{field}: must be a valid polygon: {reason.split('[')[0]}{where}")
    return mended


def _named(text: str, name: str | None) -> _Plan:
    """Returns the ground plan with this name in JSON."""
    try:
        decode_json(text, msgspec.Raw)  # first check that it is JSON
    except (msgspec.MsgspecError, RecursionError) as error:
        raise ProblemError(in_words(error, text, msgspec.Raw)) from error
    _refuse_other_json(text)
    try:
        plans = msgspec.json.decode(text, type=dict[str, _Plan])
    except msgspec.MsgspecError as error:
        words = in_words(error, text, dict[str, _Plan]).replace("[...].", "").replace("[...]: ", "")
        raise ProblemError(f"{words}; ground plans are {_SCHEME}") from error
    if not plans:
        raise ProblemError("contains no ground plan")
    if name is None and len(plans) != 1:
        raise ProblemError(f"name: must be given, one of {', '.join(plans)}")
    if name is not None and name not in plans:
        raise ProblemError(f"name: must be one of {', '.join(plans)}, not {name!r}")
    return plans[name] if name is not None else next(iter(plans.values()))


def _refuse_other_json(text: str) -> None:
    """Raises a ProblemError that names another well-known kind of polygons in JSON."""
    try:
        keys = msgspec.json.decode(text, type=dict[str, msgspec.Raw])
    except msgspec.MsgspecError:
        return  # the next error describes the expected form
    for key in (key for key in _OTHER_JSON if key in keys):
        raise ProblemError(_OTHER_JSON[key])


def _of_polygons(
    text: str,
    kind: Kind,
    name: str | None,
    unit: str | None,
    meaning: Meaning | None,
    projection: MapProjection,
) -> GroundPlan:
    """Returns the ground plan in GeoJSON or WKT, all of whose polygons have the same meaning."""
    if name is not None:
        raise ProblemError(f"name: must be left out, as the file is {kind.name}")
    if meaning is None:
        raise ProblemError(
            f'polygons: must be given for {kind.name}: write polygons = "obstacles" (houses), or '
            'polygons = "walkable" (an area to walk in, whose holes are obstacles)'
        )
    found, others, stated = _found(text, kind)
    if not found:
        held = f", but has {_counted(others)}" if others else ""
        raise ProblemError(f"must contain at least one polygon{held}")
    _require_points([item.polygon for item in found])
    placed = in_metres([item.polygon for item in found], kind, stated, unit, projection)
    whole = [
        None if part is None else sound(part, f"polygon {k}")
        for k, part in enumerate(placed, start=1)
    ]
    notes = list(_left_out(whole, others))
    kept = [
        Footprint(area, item.field, item.properties)
        for item, area in zip(found, whole, strict=True)
        if area is not None and area.area > 0
    ]
    if meaning == "obstacles":
        kept, more = obstacles_of(kept)
        notes += more
    if not kept:
        raise ProblemError(f"must contain at least one polygon with an area; {'; '.join(notes)}")
    if meaning == "obstacles":
        return _of_obstacles(kept, kind, notes)
    parts = [part for footprint in kept for part in polygons_of(footprint.area)]
    holes = [Polygon(ring) for part in parts for ring in part.interiors]
    outside = tuple(Polygon(part.exterior) for part in parts)
    return GroundPlan(outside, tuple(holes), notes=tuple(notes))


def _of_obstacles(footprints: Sequence[Footprint], kind: Kind, notes: Sequence[str]) -> GroundPlan:
    """Returns the ground plan of buildings, with the heights that the file states."""
    extents = [extent(found.properties, f"{found.field}properties") for found in footprints]
    if counted := sum(item.is_counted for item in extents):
        notes = [
            *notes, f"{counted} of {len(extents)} heights are computed from storeys of {STOREY:g} m"
        ]  # fmt: skip
    shown = [_shown(found.properties) for found in footprints] if kind == GEOJSON else []
    areas = tuple(found.area for found in footprints)
    return GroundPlan((), areas, tuple(extents), tuple(shown), tuple(notes))


def _found(text: str, kind: Kind) -> tuple[Sequence[FoundPolygon], Counter[str], StatedSystem]:
    """Returns the polygons of GeoJSON or WKT, counts of its other geometries, and the stated
    system.
    """
    if kind == GEOJSON:
        items, others, crs = read_geojson(text)
        found = [item._replace(polygon=_without_flat_holes(item.polygon)) for item in items]
        return found, others, StatedSystem.by_crs(crs)
    stated, plain = StatedSystem.by_srid(text)
    try:
        with np.errstate(over="ignore", invalid="ignore"):  # infinite values are rejected later
            geometry = shapely.force_2d(shapely.from_wkt(plain))
    except (shapely.errors.ShapelyError, NotImplementedError) as error:
        if "closed" in str(error):
            raise ProblemError(
                f"{kind.name}: rings must end at the point where they begin"
            ) from error
        raise ProblemError(f"cannot be read as {kind.name}, such as {_SOUND}") from error
    parts = list(parts_of(geometry))
    others = Counter(part.geom_type for part in parts if not isinstance(part, Polygon))
    polygons = [
        FoundPolygon(_without_flat_holes(part), "", {})
        for part in parts
        if isinstance(part, Polygon)
    ]
    return polygons, others, stated


def _without_flat_holes(polygon: Polygon) -> Polygon:
    """Returns the same area without holes of fewer than three points, which have no area."""
    holes = [
        hole for hole in polygon.interiors if len(np.unique(np.array(hole.coords), axis=0)) > 2
    ]
    return Polygon(polygon.exterior, holes)


def _left_out(polygons: Sequence[BaseGeometry | None], others: Counter[str]) -> Iterator[str]:
    """Describes the parts of a file that are left out, if any."""
    if others:
        yield f"only polygons count; left out: {_counted(others)}"
    if far := sum(part is None for part in polygons):
        yield (
            f"{far} of {len(polygons)} polygons are more than {FARTHEST / 1000:g} km from the map, "
            "and are left out"
        )
    if flat := sum(part is not None and part.area == 0 for part in polygons):
        yield f"{flat} of {len(polygons)} polygons have no area, and are left out"


def _counted(kinds: Counter[str]) -> str:
    return ", ".join(f"{count} {kind}" for kind, count in kinds.items())


def _shown(properties: Mapping[str, Any]) -> str:
    return ", ".join(f"{name} = {value!r:.20}" for name, value in properties.items())


def _require_points(polygons: Sequence[Polygon]) -> None:
    """Raises a ProblemError if polygons have infinite coordinates."""
    if not np.abs(shapely.get_coordinates(polygons)).max() <= LARGEST:  # true for nan, too
        raise ProblemError(f"coordinates: must be finite numbers within +-{plain(LARGEST)} m")
