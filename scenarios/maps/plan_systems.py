"""The coordinate systems of polygons in GeoJSON and WKT, and their conversion to metres.

GeoJSON is in longitudes and latitudes of WGS 84 unless it states another system (RFC 7946),
whatever its extent. WKT states its system by a number before the geometry, "SRID=4326;", the form
of PostGIS, or not at all.
"""

import re
from collections.abc import Sequence
from typing import Any, NamedTuple

import msgspec
import numpy as np
import shapely
from shapely import LineString, Point, Polygon

from cocap_opt.data import FloatArray, ProblemError
from cocap_opt.scenarios.earth import same_system, short_name, utm, wkt_of_code
from cocap_opt.scenarios.earth.place import FARTHEST, MapProjection
from cocap_opt.scenarios.earth.units import NeedsPyprojError, Units, units_of
from cocap_opt.scenarios.kinds import GEOJSON, Kind
from cocap_opt.scenarios.tables import PER_METRE
from cocap_opt.text import pair

# names of systems of longitude and latitude that are converted to metres
DEGREES = ("4326", "CRS84")
MERCATOR = ("3857", "900913")
SAYS_LENGTHS = 'if the coordinates are metres, set unit = "m" in [[walls]]'
_DIGITS = 9  # more digits than any code has
_SYSTEM = re.compile(r"\s*SRID\s*=\s*([0-9]+)\s*;", re.IGNORECASE)
_NAMED_SYSTEM = re.compile(r"EPSG[:/]+(?:[0-9.]*[:/])?([0-9]+)", re.IGNORECASE)
_MOST_EAST, _MOST_NORTH = 360.0, 90.0  # degrees; some files count longitudes from 0 to 360
_SMALL_PLAN, _SMALL_PART = 1.0, 0.05  # m, or degrees: smaller plans are unlikely to be in metres
_LONGEST = 0.01  # degrees, of an edge; up to latitude 60 it is straight on the map within 3 cm
_SAME_UNIT = 1e-5  # relative


class StatedSystem(NamedTuple):
    """The reference system that a file of GeoJSON or WKT states, if any."""

    field: str
    name: str = ""  # in the form of GeoJSON
    code: int | None = None  # code of EPSG
    is_null: bool = False  # the system is unknown, which GeoJSON 2008 writes as null

    @classmethod
    def by_srid(cls, text: str) -> tuple["StatedSystem", str]:
        """Returns the system at the beginning of WKT, and the rest of the text."""
        found = _SYSTEM.match(text)
        if found is None:
            return cls("SRID"), text
        return cls("SRID", code=int(found[1][:_DIGITS]) or None), text[found.end() :]

    @classmethod
    def by_crs(cls, crs: Any) -> "StatedSystem":
        """Returns the system that the member `crs` of GeoJSON names."""
        name = "" if crs is msgspec.UNSET or crs is None else str(crs)
        found = _NAMED_SYSTEM.search(name)
        return cls("crs", name, int(found[1][:_DIGITS]) if found else None, crs is None)

    @property
    def is_silent(self) -> bool:
        """True if the file states no system."""
        return not self.name and self.code is None

    def is_one_of(self, systems: Sequence[str]) -> bool:
        """Returns True if the code, or else a whole word of the name, is one of the given
        systems.
        """
        if self.code is not None:
            return str(self.code) in systems
        return bool(re.search(rf"(?<!\d)({'|'.join(systems)})(?!\d)", self.name))


def in_metres(
    polygons: Sequence[Polygon],
    kind: Kind,
    stated: StatedSystem,
    unit: str | None,
    projection: MapProjection,
) -> list[Polygon | None]:
    """Returns polygons in m of the scene, and None for those that are far from it.

    Parameters
    ----------
    kind : of the file, GeoJSON or WKT
    unit : of lengths, stated by the recipe; None: not stated

    Raises
    ------
    ProblemError
        If their system is unknown or differs from that of the scene, or if no polygon is near the
        scene.
    """
    if stated.is_one_of(DEGREES):
        if unit is not None:
            raise ProblemError("unit: must be left out, as the coordinates are degrees")
        return _of_degrees(polygons, projection, "")
    if not stated.is_silent:
        _require_system(stated, polygons, unit, projection)
    elif unit is None and kind == GEOJSON:
        if stated.is_null:
            raise ProblemError(
                f"crs: is null, so the coordinate system is unknown; {SAYS_LENGTHS}; if they are "
                "degrees, remove crs"
            )
        _require_degrees(polygons)
        return _of_degrees(polygons, projection, f"; {SAYS_LENGTHS}")
    elif unit is None and _may_be_degrees(polygons, projection):
        raise ProblemError(
            'coordinates: are they degrees or metres? If degrees, write "SRID=4326;" before the '
            f"WKT; {SAYS_LENGTHS}"
        )
    return list(shapely.transform(polygons, lambda points: points / PER_METRE[unit or "m"]))


def _require_degrees(polygons: Sequence[Polygon]) -> None:
    """Raises a ProblemError if coordinates of GeoJSON cannot be longitudes and latitudes."""
    points = shapely.get_coordinates(polygons)
    wrong = (np.abs(points) > (_MOST_EAST, _MOST_NORTH)).any(axis=1)
    if wrong.any():
        x, y = points[np.argmax(wrong)]
        raise ProblemError(
            "coordinates: must be longitudes and latitudes, as the standard of GeoJSON requires, "
            f"not {pair(x, y)}; {SAYS_LENGTHS}"
        )


def _may_be_degrees(polygons: Sequence[Polygon], projection: MapProjection) -> bool:
    """Returns True if coordinates of WKT could be degrees and are unlikely to be metres."""
    points = shapely.get_coordinates(polygons)
    if (np.abs(points) > (_MOST_EAST, _MOST_NORTH)).any():
        return False
    sizes = [max(x1 - x0, y1 - y0) for x0, y0, x1, y1 in shapely.bounds(polygons)]
    if np.ptp(points, axis=0).max() < _SMALL_PLAN or min(sizes) < _SMALL_PART:
        return True
    if projection.earth is None:
        return False
    latitude, longitude = projection.place
    here = Point(longitude, latitude)
    return bool(shapely.distance(shapely.MultiPolygon(list(polygons)), here) < _SMALL_PLAN)


def _of_degrees(
    polygons: Sequence[Polygon], projection: MapProjection, hint: str
) -> list[Polygon | None]:
    """Returns polygons of longitudes and latitudes in m, and None for those that are far away.

    Edges are straight in degrees and are subdivided, so that they can bend on the map.
    """
    here = None if projection.earth is None else projection.place[1]
    whole = [_unwrapped(polygon, here) for polygon in polygons]
    if projection.earth is not None:
        placed = shapely.transform(whole, lambda points: projection.plane(*points.T[::-1]))
        found = [part if _is_near(part, projection) else None for part in placed]
        if any(part is not None for part in found):
            return found
    longitude, latitude = shapely.get_coordinates(whole).T
    try:
        # raises an error with the reason if it cannot convert
        projection.metres(latitude, longitude)
    except ProblemError as error:
        raise ProblemError(f"{error}{hint}") from error
    raise AssertionError("points that are near the map make no polygon far from it")


def _is_near(polygon: Polygon, projection: MapProjection) -> bool:
    if not np.isfinite(shapely.get_coordinates(polygon)).all():
        return False
    area = polygon if shapely.is_valid(polygon) else shapely.make_valid(polygon)
    return bool(shapely.distance(area, Point(projection.point)) <= FARTHEST)


def _unwrapped(polygon: Polygon, longitude: float | None) -> Polygon:
    """Returns a polygon that may cross 180 degrees, with all longitudes near the given one.

    Its long edges are subdivided.
    """
    around = float(polygon.exterior.coords[0][0]) if longitude is None else longitude
    rings = []
    for ring in (polygon.exterior, *polygon.interiors):
        points: FloatArray = np.array(ring.coords)
        points[:, 0] = np.unwrap(points[:, 0], period=360)
        if points[0, 0] != points[-1, 0]:
            if abs(points[0, 0] - points[-1, 0]) > 1:
                raise ProblemError("coordinates: must not go around a pole")
            points[-1] = points[0]  # closes the ring, which rounding may have opened
        points[:, 0] += 360 * np.round((around - points[:, 0].mean()) / 360)
        around = float(points[:, 0].mean())
        rings.append(_cut(points))
    return Polygon(rings[0], rings[1:])


def _cut(ring: FloatArray) -> FloatArray:
    """Returns a ring [n, 2] (degrees) with more points, so that no edge is long.

    It is treated as a line, because for a polygon that crosses itself GEOS would change the area.
    """
    if not np.ptp(ring, axis=0).any():
        return ring
    return shapely.get_coordinates(shapely.segmentize(LineString(ring), _LONGEST))


def _require_system(
    stated: StatedSystem, polygons: Sequence[Polygon], unit: str | None, projection: MapProjection
) -> None:
    """Raises a ProblemError if the stated system is not in metres, or not that of the scene."""
    field, code = stated.field, stated.code
    scene = projection.earth.crs if projection.earth else None
    way_out = _way_out(polygons, scene)
    if stated.is_one_of(MERCATOR):
        raise ProblemError(
            f"{field}: must be a projection in metres, or 4326, not {code or stated.name}, web "
            f"Mercator; {way_out}"
        )
    if code is None:
        raise ProblemError("crs: must name an EPSG code, or be left out")
    if scene is not None and same_system(scene, f"EPSG:{code}"):
        return
    units = _units_of_code(field, code, unit)
    wrong = None
    if units is not None and units.across is None:
        wrong = units.kind
    elif units is not None and units.across is not None:
        metres = 1 / PER_METRE[unit] if units.across.metres != 1 and unit else 1.0
        wrong = units.across.name if abs(units.across.metres / metres - 1) > _SAME_UNIT else None
    if wrong is not None:
        raise ProblemError(
            f"{field}: must be a projection in metres, or 4326, not {code}, which is in {wrong}; "
            f"{way_out}"
        )
    if scene is not None:
        raise ProblemError(
            f"{field}: must be the reference system of the scene, {short_name(scene)}, not "
            f"EPSG:{code}; {way_out}"
        )


def _units_of_code(field: str, code: int, unit: str | None) -> Units | None:
    """Returns the units of a system; None if they are unknown and the recipe states a unit."""
    text = f"EPSG:{code}"
    try:
        return units_of(wkt_of_code(code) or text)
    except ProblemError as error:
        if unit is not None and isinstance(error, NeedsPyprojError):
            return None
        raise ProblemError(f"{field}: {error}") from error


def _way_out(polygons: Sequence[Polygon], scene: str | None) -> str:
    """Returns the command of GDAL that writes polygons in the scene's system, or in UTM."""
    x0, y0, x1, y1 = shapely.total_bounds(polygons)
    system = scene
    if system is None and x0 >= -180 and x1 <= 180 and y0 >= -90 and y1 <= 90:
        system = utm((x0 + x1) / 2, (y0 + y1) / 2)
    zone = "" if system else ", where ZZ is the UTM zone (EPSG:327ZZ in the south)"
    return (
        "convert it to metres with `ogr2ogr -t_srs "
        f"{short_name(system or 'EPSG:326ZZ')} NEW.geojson OLD.geojson`{zone}"
    )
