"""Walls from ground plans: areas that are extruded to meshes.

PedPy keeps the ground plans of experiments as polygons of the walkable area and of the
obstacles in it.
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
from cocap_opt.scenarios.recipe.tables import Point
from cocap_opt.scenarios.text import naming, one_line, read_text
from cocap_opt.world.workspace import Mesh

Ring = Annotated[list[Point], Meta(min_length=3)]


class _Plan(msgspec.Struct):
    """One ground plan of a PedPy geometry file."""

    walkable: Ring
    obstacles: list[Ring] = []


def read_walls(
    path: Path,
    *,
    name: str | None = None,
    height: float,
    border: float = 0.0,
    at: tuple[float, float] = (0.0, 0.0),
    base: float = 0.0,
) -> list[Mesh]:
    """Walls of a ground plan in metres, which stand at altitude `base`.

    The file is JSON: {name: {"walkable": [[x, y], ..], "obstacles": [[[x, y], ..], ..]}}.

    Parameters
    ----------
    path
        The file.
    name
        Which of its ground plans; None where it has one only.
    height
        Of the walls, m.
    border
        Thickness (m) of a wall around the walkable area; 0: there is none.
    at
        Where the plan's origin comes to lie (m).
    base
        Altitude (m) of their foot.

    Raises
    ------
    ProblemError
        If the file cannot be read, has no such ground plan, or there is no wall in it; one
        line, naming the file.
    """
    with naming(path):
        try:
            plans = msgspec.json.decode(read_text(path), type=dict[str, _Plan])
        except (msgspec.MsgspecError, RecursionError) as error:
            raise ProblemError(one_line(error)) from error
        if name is None and len(plans) != 1:
            raise ProblemError(f"name: must be one of {', '.join(plans)}")
        if name is not None and name not in plans:
            raise ProblemError(f"name: must be one of {', '.join(plans)}, not {name!r}")
        plan = plans[name] if name is not None else next(iter(plans.values()))
        walls = [extruded(_polygon(ring), base + height, base) for ring in plan.obstacles]
        if border > 0:
            area = _polygon(plan.walkable)
            around = area.buffer(border, join_style="mitre").difference(area)
            walls.append(extruded(around, base + height, base))
        if not walls:
            raise ProblemError("it has no obstacles: border must say how thick its outer walls are")
    return [wall.replace(vertices=wall.vertices + np.array([*at, 0.0])) for wall in walls]


def _polygon(ring: Sequence[Point]) -> BaseGeometry:
    # Rings in such files pass a point twice, or cross themselves by a rounding.
    return shapely.make_valid(Polygon(ring))


def extruded(area: BaseGeometry, height: float, bottom: float = 0.0) -> Mesh:
    """The solid above an area (m, of polygons), from one altitude to another.

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
    """Triangles [3, 2] of a polygon, counter-clockwise."""
    pieces = _polygons(shapely.constrained_delaunay_triangles(polygon))
    return [np.asarray(piece.exterior.coords)[:3] for piece in pieces]


def _side(ring: FloatArray, bottom: float, height: float) -> FloatArray:
    """Walls [n, 3, 3] along a closed ring whose inside is on its left."""
    a, b = ring[:-1], ring[1:]
    low, high = np.full(len(a), bottom), np.full(len(a), height)
    corners = [np.column_stack([*at.T, z]) for at, z in ((a, low), (b, low), (b, high), (a, high))]
    first, second = (np.stack([corners[k] for k in ks], axis=1) for ks in ((0, 1, 2), (0, 2, 3)))
    return np.concatenate([first, second])
