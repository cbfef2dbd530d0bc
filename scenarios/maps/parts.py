"""The parts of areas: an operation on polygons may give polygons, lines and points, nested."""

from collections.abc import Iterator

from shapely import Polygon
from shapely.geometry.base import BaseGeometry


def parts_of(geometry: BaseGeometry) -> Iterator[BaseGeometry]:
    """Yields the single geometries of a geometry, which may be a nested collection."""
    if hasattr(geometry, "geoms"):
        for part in geometry.geoms:
            yield from parts_of(part)
    elif not geometry.is_empty:
        yield geometry


def polygons_of(geometry: BaseGeometry) -> Iterator[Polygon]:
    """Yields the polygons of an area; polygons without area, lines and points are left out."""
    for part in parts_of(geometry):
        if isinstance(part, Polygon) and part.area > 0:
            yield part
