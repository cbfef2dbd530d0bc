"""The ground plans of a recipe, from which walls are extruded to meshes.

They are polygons of the walkable area and of the obstacles in it, as the geometries of PedPy are.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import msgspec
import numpy as np
import shapely
from msgspec import Meta
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from cocap_opt.data import FloatArray, ProblemError
from cocap_opt.scenarios.recipe.tables import (
    PER_METRE,
    Coordinate,
    Length,
    Point,
    Size,
    Table,
    Unit,
)
from cocap_opt.scenarios.text import naming, one_line, read_text
from cocap_opt.world.workspace import Mesh

Ring = Annotated[list[Point], Meta(min_length=3)]


class _Plan(msgspec.Struct):
    """One ground plan of a file."""

    walkable: Ring
    obstacles: list[Ring] = []
    unit: str = ""  # the last word counts: "cm in file; polygon in m"

    def polygon(self, ring: Sequence[Point], unit: str) -> BaseGeometry:
        """Returns a ring in m."""
        # Rings in such files may pass a point twice, or cross themselves by a rounding.
        return shapely.make_valid(Polygon(np.array(ring) / PER_METRE[unit]))

    def settled_unit(self, stated: str | None) -> str:
        """Returns the unit that the file states, or else the recipe."""
        own = self.unit.split()[-1:]
        if own and own[0] not in PER_METRE:
            raise ProblemError(f"unit: must be {', '.join(PER_METRE)}, not {self.unit!r}")
        if own and stated and own[0] != stated:
            raise ProblemError(f"unit: is {own[0]!r} in the file, but {stated!r} in the recipe")
        return (own or [stated or "m"])[0]


class WallsTable(Table):
    """One of the tables `walls` of a recipe, see `cocap_opt.scenarios.recipe.recipe.EXAMPLE`.

    The file is JSON: {name: {"walkable": [[x, y], ..], "obstacles": [[[x, y], ..], ..]}}, in m
    unless it says "unit" there.
    """

    file: str
    height: Length
    name: str | None = None  # of a ground plan in the file; None: the only one
    unit: Unit | None = None  # None: as the file says, else m
    border: Size = 0.0  # m, thickness of a wall around the walkable area; 0: there is none
    at: Point = (0.0, 0.0)  # m, where the plan's origin comes to lie
    base: Coordinate | None = None  # m, altitude of the walls' foot; None: the lowest ground

    def meshes(self, folder: Path, lowest: float) -> list[Mesh]:
        """Reads the ground plan and returns its walls.

        Parameters
        ----------
        folder : of the file that the table names
        lowest : altitude (m) of the lowest ground

        Raises
        ------
        ProblemError
            If the file cannot be read, has no such ground plan, or there is no wall in it; one
            line, naming the file.
        """
        base = lowest if self.base is None else self.base
        with naming(folder / self.file):
            plan = self._plan(folder / self.file)
            unit = plan.settled_unit(self.unit)
            areas = [plan.polygon(ring, unit) for ring in plan.obstacles]
            if self.border > 0:
                inside = plan.polygon(plan.walkable, unit)
                areas.append(inside.buffer(self.border, join_style="mitre").difference(inside))
            if not areas:
                raise ProblemError(
                    "it has no obstacles: border must say how thick its outer walls are"
                )
            walls = [_extruded(area, base + self.height, base) for area in areas]
        return [wall.replace(vertices=wall.vertices + np.array([*self.at, 0.0])) for wall in walls]

    def _plan(self, path: Path) -> _Plan:
        text = read_text(path)
        if text.lstrip().startswith("<"):
            raise ProblemError(
                "is XML, as JuPedSim keeps geometries; write the corners of its walkable area and "
                'obstacles as JSON: {"name": {"walkable": [[x, y], ..], "obstacles": [..]}}, in m'
            )
        try:
            plans = msgspec.json.decode(text, type=dict[str, _Plan])
        except (msgspec.MsgspecError, RecursionError) as error:
            raise ProblemError(one_line(error)) from error
        if not plans:
            raise ProblemError("holds no ground plan")
        if self.name is None and len(plans) != 1:
            raise ProblemError(f"name: must be one of {', '.join(plans)}")
        if self.name is not None and self.name not in plans:
            raise ProblemError(f"name: must be one of {', '.join(plans)}, not {self.name!r}")
        return plans[self.name] if self.name is not None else next(iter(plans.values()))


def _extruded(area: BaseGeometry, height: float, bottom: float) -> Mesh:
    """Returns the solid above an area (m, of polygons), from one altitude to another.

    Raises
    ------
    ProblemError
        If the area is empty, or the height not above the bottom.
    """
    if not bottom < height:
        raise ProblemError(f"height: must be above {bottom:g} m, not {height:g}")
    parts = [part for part in _polygons(area) if part.area > 0]
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


def _polygons(area: BaseGeometry) -> list[Polygon]:
    if isinstance(area, Polygon):
        return [shapely.geometry.polygon.orient(area)]
    parts = getattr(area, "geoms", ())
    return [polygon for part in parts for polygon in _polygons(part)]


def _triangles(polygon: Polygon) -> list[FloatArray]:
    """Cuts a polygon into triangles [3, 2], counter-clockwise."""
    pieces = _polygons(shapely.constrained_delaunay_triangles(polygon))
    return [np.asarray(piece.exterior.coords)[:3] for piece in pieces]


def _side(ring: FloatArray, bottom: float, height: float) -> FloatArray:
    """Returns the triangles [n, 3, 3] of walls along a closed ring whose inside is on its left."""
    a, b = ring[:-1], ring[1:]
    low, high = np.full(len(a), bottom), np.full(len(a), height)
    corners = [np.column_stack([*at.T, z]) for at, z in ((a, low), (b, low), (b, high), (a, high))]
    first, second = (np.stack([corners[k] for k in ks], axis=1) for ks in ((0, 1, 2), (0, 2, 3)))
    return np.concatenate([first, second])
