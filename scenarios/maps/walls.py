"""The ground plans of a recipe, and the extrusion of their walls to meshes."""

import logging
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np
import shapely
from shapely import Polygon
from shapely.affinity import translate
from shapely.geometry.base import BaseGeometry
from shapely.geometry.polygon import orient

from cocap_opt.data import FloatArray, ProblemError
from cocap_opt.scenarios.earth.place import NOWHERE, MapProjection
from cocap_opt.scenarios.kinds import JSON, WKT
from cocap_opt.scenarios.maps.building_heights import Extent
from cocap_opt.scenarios.maps.ground_plans import GroundPlan, Meaning, ground_plan
from cocap_opt.scenarios.maps.parts import polygons_of
from cocap_opt.scenarios.maps.terrain import Ground
from cocap_opt.scenarios.tables import (
    Coordinate,
    Length,
    Point,
    Size,
    Table,
    Unit,
)
from cocap_opt.scenarios.text import naming, read_text
from cocap_opt.world.workspace import Mesh

log = logging.getLogger(__name__)

_TALL = 300.0  # m; few buildings are taller


class WallsTable(Table):
    """One of the tables `walls` of a recipe, see `cocap_opt.scenarios.recipe.EXAMPLE`.

    The file is JSON: {name: {"walkable": [[x, y], ..], "obstacles": [[[x, y], ..], ..]}}, in m
    unless it has a "unit"; or GeoJSON, in degrees unless the file or the table states another unit;
    or WKT.
    """

    file: str
    height: Length | None = None  # m above base, of obstacles without a height in GeoJSON
    name: str | None = None  # name of a ground plan in the file; None: the only one
    polygons: Meaning | None = None  # the meaning of polygons in GeoJSON and WKT
    # None: as stated in the file, otherwise degrees in GeoJSON and m in other files
    unit: Unit | None = None
    border: Size = 0.0  # m, thickness of a wall around the walkable area; 0: there is none
    at: Point = (0.0, 0.0)  # m, position of the plan's origin
    base: Coordinate | None = None  # m, altitude of the foot; None: the lowest ground below each

    def meshes(
        self,
        folder: Path,
        below: Callable[[BaseGeometry], Ground],
        projection: MapProjection = NOWHERE,
        zero: float = 0.0,
    ) -> list[Mesh]:
        """Reads the ground plan and returns its walls.

        Parameters
        ----------
        folder : of the file that the table names
        below : the ground below an area on the map
        projection : converts longitudes and latitudes to metres
        zero : altitude (m) of z = 0

        Raises
        ------
        ProblemError
            If the file cannot be read, or has no such ground plan or no wall; one line that names
            the file.
        """
        foot = None if self.base is None else Ground(self.base - zero, self.base - zero)
        with naming(folder / self.file):
            text = read_text(folder / self.file, (JSON, WKT))
            plan = ground_plan(text, self.name, self.unit, self.polygons, projection)
            areas = list(plan.obstacles)
            if self.border > 0:
                if not plan.walkable:
                    raise ProblemError("border: must be left out, as all polygons are obstacles")
                inside = shapely.union_all(plan.walkable)
                areas.append(inside.buffer(self.border, join_style="mitre").difference(inside))
            if not areas:
                raise ProblemError(
                    "border: must be given, as the file has no obstacles: thickness of the outer "
                    "walls, m"
                )
            extents = [*plan.extents, *[Extent()] * (len(areas) - len(plan.extents))]
            areas = [translate(area, *self.at) for area in areas]
            walls = [
                _wall(area, foot or below(area), self._top(extent, k, plan), extent.bottom)
                for k, (area, extent) in enumerate(zip(areas, extents, strict=True))
            ]
        heights = [] if self.height is None else [plan.told_height(self.height)]
        heights += _doubts_of_heights(plan.extents)
        for note in filter(None, (*plan.notes, *heights)):
            log.warning("%s: %s", self.file, note)
        return walls

    def _top(self, extent: Extent, k: int, plan: GroundPlan) -> float:
        """Returns the top (m above the foot) of the wall with this number, by default the
        table's.
        """
        if extent.top is not None:
            return extent.top
        if self.height is None:
            raise ProblemError(f"height: must be given in [[walls]], as {plan.told(k)}")
        if not extent.bottom < self.height:
            raise ProblemError(
                f"height: must be above {extent.bottom:g} m, the bottom of polygon {k + 1}, whose "
                f"top the file does not state, not {self.height:g}"
            )
        return self.height


def _wall(area: BaseGeometry, ground: Ground, top: float, bottom: float) -> Mesh:
    """Returns the solid above an area on the map, between two heights (m) above the ground."""
    is_raised = bottom > 0 or ground.lowest >= ground.base
    foot = ground.base + bottom if is_raised else ground.lowest
    return extruded(area, ground.base + top, foot)


def _doubts_of_heights(extents: Sequence[Extent]) -> Iterator[str]:
    """Yields a question if a building is so tall that its height may count from the sea."""
    tops = [extent.top or 0.0 for extent in extents]
    tallest = max(tops, default=0.0)
    if tallest > _TALL:
        k = tops.index(tallest)
        yield (
            f"polygon {k + 1} is {tallest:g} m tall: are heights above the ground, not above the "
            "sea, and in metres?"
        )


def extruded(area: BaseGeometry, height: float, bottom: float) -> Mesh:
    """Returns the solid above an area (polygons, m) between two altitudes.

    Raises
    ------
    ProblemError
        If the area is empty, or the height is not above the bottom.
    """
    if not bottom < height:
        raise ProblemError(f"height: must be above {bottom:g} m, not {height:g}")
    # A repeated point would give a side without length, which a solid must not have.
    parts = [orient(shapely.remove_repeated_points(part)) for part in polygons_of(area)]
    if not parts:
        raise ProblemError("must have an area")
    flat = [_triangles(part) for part in parts]
    rings = [np.asarray(ring.coords) for part in parts for ring in (part.exterior, *part.interiors)]
    floors = np.concatenate([triangle for part in flat for triangle in part])  # [3 n, 2]
    corners = [
        np.column_stack([floors, np.full(len(floors), height)]).reshape(-1, 3, 3),
        np.column_stack([floors, np.full(len(floors), bottom)]).reshape(-1, 3, 3)[:, ::-1],
        *(_side(ring, bottom, height) for ring in rings),
    ]
    vertices, triangles = np.unique(
        np.concatenate(corners).reshape(-1, 3), axis=0, return_inverse=True
    )
    return Mesh(vertices=vertices, triangles=triangles.reshape(-1, 3))


def _triangles(polygon: Polygon) -> list[FloatArray]:
    """Cuts a polygon into triangles [3, 2], counter-clockwise."""
    pieces = shapely.constrained_delaunay_triangles(polygon).geoms
    triangles = (orient(piece) for piece in pieces if isinstance(piece, Polygon))
    return [np.asarray(triangle.exterior.coords)[:3] for triangle in triangles]


def _side(ring: FloatArray, bottom: float, height: float) -> FloatArray:
    """Returns the triangles [n, 3, 3] of walls along a closed ring whose inside is on its left."""
    a, b = ring[:-1], ring[1:]
    low, high = np.full(len(a), bottom), np.full(len(a), height)
    corners = [np.column_stack([*at.T, z]) for at, z in ((a, low), (b, low), (b, high), (a, high))]
    first, second = (np.stack([corners[k] for k in ks], axis=1) for ks in ((0, 1, 2), (0, 2, 3)))
    return np.concatenate([first, second])
