"""Polygons and the properties of their features in GeoJSON.

Source: RFC 7946. A feature may have no geometry, and any geometry may be empty; the member `crs`
belongs to GeoJSON 2008, https://geojson.org/geojson-spec.html.
"""

from collections import Counter
from collections.abc import Iterator
from typing import Annotated, Any, NamedTuple

import msgspec
import numpy as np
from msgspec import Meta
from shapely import Polygon

from cocap_opt.data import FloatArray, ProblemError
from cocap_opt.files.messages import in_words
from cocap_opt.files.strict_json import decode_json

Position = Annotated[list[float], Meta(min_length=2)]
Ring = list[Position]


class _Object(msgspec.Struct, tag_field="type", kw_only=True):
    crs: Any = msgspec.UNSET


class _Point(_Object, tag="Point"):
    coordinates: list[float]


class _MultiPoint(_Object, tag="MultiPoint"):
    coordinates: list[Position]


class _LineString(_Object, tag="LineString"):
    coordinates: Ring


class _MultiLineString(_Object, tag="MultiLineString"):
    coordinates: list[Ring]


class _Polygon(_Object, tag="Polygon"):
    coordinates: list[Ring]


class _MultiPolygon(_Object, tag="MultiPolygon"):
    coordinates: list[list[Ring]]


class _GeometryCollection(_Object, tag="GeometryCollection"):
    geometries: "list[_Geometry | None]"


_Geometry = (
    _Point | _MultiPoint | _LineString | _MultiLineString | _Polygon | _MultiPolygon
    | _GeometryCollection
)  # fmt: skip


class _Feature(_Object, tag="Feature"):
    geometry: _Geometry | None = None
    place: Any = None  # of JSON-FG: the geometry in another system, or of another kind
    properties: dict[str, Any] | None = None


class _FeatureCollection(_Object, tag="FeatureCollection"):
    features: list[_Feature]


class FoundPolygon(NamedTuple):
    """A polygon in GeoJSON, with the coordinates of the file."""

    polygon: Polygon
    field: str  # field of its feature, for messages
    properties: dict[str, Any]


def read_geojson(text: str) -> tuple[list[FoundPolygon], Counter[str], Any]:
    """Returns the polygons of GeoJSON; features with no or an empty geometry are left out.

    Returns
    -------
    the polygons, the number of geometries of each kind that are not polygons, and the reference
    system in the form of GeoJSON 2008 (msgspec.UNSET: it has none)

    Raises
    ------
    ProblemError
        If it is invalid, e.g. if a ring is not closed or a position is not a list of numbers; one
        line.
    """
    kind = _Feature | _FeatureCollection | _Geometry
    try:
        content: Any = decode_json(text, kind)  # type: ignore[arg-type]  # a union is no type
    except (msgspec.MsgspecError, RecursionError) as error:
        raise ProblemError(f"GeoJSON: {in_words(error, text, kind)}") from error
    others: Counter[str] = Counter()
    for field, feature in _features(content):
        if feature.geometry is None and feature.place is not None:
            raise ProblemError(
                f"{field}place: must not be given without a geometry, as in JSON-FG; convert it "
                "with `ogr2ogr NEW.geojson OLD.json`"
            )
    polygons = [
        FoundPolygon(polygon, field, feature.properties or {})
        for field, feature in _features(content)
        for polygon in _polygons(feature.geometry, f"{field}geometry", others)
    ]
    return polygons, others, _system(content)


def _system(content: Any) -> Any:
    """Returns the member `crs`, which any object may have in GeoJSON 2008, or UNSET."""
    inside = [(feature, feature.geometry) for _, feature in _features(content)]
    stated = [
        member.crs
        for member in (content, *(part for pair in inside for part in pair))
        if member is not None and member.crs is not msgspec.UNSET
    ]
    if any(crs != stated[0] for crs in stated):
        raise ProblemError("crs: must be the same throughout the file")
    return stated[0] if stated else msgspec.UNSET


def _features(content: Any) -> Iterator[tuple[str, _Feature]]:
    """Yields the features, each with the prefix of the names of its fields."""
    match content:
        case _FeatureCollection():
            yield from ((f"features[{k}].", feature) for k, feature in enumerate(content.features))
        case _Feature():
            yield "", content
        case _:
            yield "", _Feature(geometry=content)


def _polygons(geometry: Any, field: str, others: Counter[str]) -> Iterator[Polygon]:
    """Yields the non-empty polygons of a geometry, and counts the geometries that are not
    polygons.
    """
    match geometry:
        case _GeometryCollection():
            for k, part in enumerate(geometry.geometries):
                yield from _polygons(part, f"{field}.geometries[{k}]", others)
        case _Polygon():
            yield from _polygon(geometry.coordinates, f"{field}.coordinates")
        case _MultiPolygon():
            for k, rings in enumerate(geometry.coordinates):
                yield from _polygon(rings, f"{field}.coordinates[{k}]")
        case None:
            pass
        case _ if geometry.coordinates:
            others[geometry.__struct_config__.tag] += 1


def _polygon(rings: list[Ring], field: str) -> Iterator[Polygon]:
    """Yields the polygon with the given rings, unless it is empty."""
    if not rings or not rings[0]:
        return
    outer, *holes = (_ring(ring, f"{field}[{k}]") for k, ring in enumerate(rings) if ring)
    yield Polygon(outer, holes)


def _ring(ring: Ring, field: str) -> FloatArray:
    """Returns the points [n, 2] of a ring, without altitudes."""
    points = np.array([position[:2] for position in ring])
    if (points[0] != points[-1]).any():
        raise ProblemError(f"GeoJSON: {field}: must end at the point where it begins")
    if len(points) < 4:
        raise ProblemError(f"GeoJSON: {field}: must have at least four points")
    return points
