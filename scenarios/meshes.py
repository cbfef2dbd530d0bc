"""Meshes from files and from ground plans: what a height map cannot hold.

Files are read by trimesh: OBJ, STL, PLY and OFF, and glTF (GLB), which by its standard has its y
axis upwards. A ground plan is extruded to a wall; PedPy keeps those of experiments as polygons of
the walkable area and of the obstacles in it.
"""

import logging
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Literal

import msgspec
import numpy as np
import shapely
import trimesh
from msgspec import Meta
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from cocap_opt.data import LARGEST, FloatArray, ProblemError
from cocap_opt.workspace import Mesh
from scenarios._text import naming, one_line, read_text

log = logging.getLogger(__name__)

PER_METRE = {"m": 1.0, "cm": 100.0, "mm": 1000.0, "ft": 1 / 0.3048}
UP = {".glb": "y", ".gltf": "y"}  # of other files z, as in surveying
SUFFIXES = (".obj", ".glb", ".gltf", ".stl", ".ply", ".off")

Unit = Literal["m", "cm", "mm", "ft"]
Axis = Literal["y", "z"]
Coordinate = Annotated[float, Meta(ge=-LARGEST, le=LARGEST)]
Point = tuple[Coordinate, Coordinate]
Ring = Annotated[list[Point], Meta(min_length=3)]


def read_mesh(
    path: Path,
    *,
    unit: Unit = "m",
    up: Axis | None = None,
    turn: float = 0.0,
    at: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> Mesh:
    """Read all geometry of a file as one mesh; vertices at the same place become one.

    A surface that does not close is logged as a warning: only its triangles are solid then.

    Parameters
    ----------
    path
        An OBJ, GLB, glTF, STL, PLY or OFF file.
    unit
        Of its coordinates.
    up
        Its axis that is upwards. None: y for glTF, z for the others.
    turn
        Angle in rad, counter-clockwise seen from above, by which it is turned about its origin.
    at
        Where its origin comes to lie (m).

    Raises
    ------
    ProblemError
        If the file cannot be read or holds no triangles; one line, naming the file.
    """
    with naming(path):
        if path.suffix.lower() not in SUFFIXES:
            raise ProblemError(f"must be named {', '.join(SUFFIXES)}")
        shape = _load(path)
        vertices = np.asarray(shape.vertices, dtype=np.float64) / PER_METRE[unit]
        if (up or UP.get(path.suffix.lower(), "z")) == "y":
            vertices = vertices[:, [0, 2, 1]] * np.array([1.0, -1.0, 1.0])
        mesh = Mesh(vertices=_placed(vertices, turn, at), triangles=np.asarray(shape.faces))
    if not mesh.is_solid:
        log.warning("%s: its surface is not closed, so that only the surface is solid", path)
    return mesh


def _load(path: Path) -> trimesh.Trimesh:
    try:
        shape: trimesh.Trimesh = trimesh.load_scene(path).to_mesh()
    except OSError as error:
        raise ProblemError(f"cannot be read: {error.strerror or one_line(error)}") from error
    except Exception as error:  # trimesh names no set of errors for a damaged file
        kind = path.suffix.lower()
        raise ProblemError(f"cannot be read as {kind}: {one_line(error)}") from error
    if not len(shape.faces):
        raise ProblemError("must hold at least one triangle")
    shape.merge_vertices(merge_tex=True, merge_norm=True)
    return shape


def _placed(vertices: FloatArray, turn: float, at: tuple[float, float, float]) -> FloatArray:
    c, s = math.cos(turn), math.sin(turn)
    x, y, z = vertices.T
    placed: FloatArray = np.column_stack([c * x - s * y, s * x + c * y, z]) + np.array(at)
    return placed


class _Plan(msgspec.Struct):
    """One ground plan of a PedPy geometry file."""

    walkable: Ring
    obstacles: list[Ring] = []


def read_walls(
    path: Path, *, name: str | None = None, height: float, border: float = 0.0
) -> list[Mesh]:
    """Walls of a ground plan in metres, extruded from altitude 0 to `height`.

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
        walls = [extruded(_polygon(ring), height) for ring in plan.obstacles]
        if border > 0:
            area = _polygon(plan.walkable)
            around = area.buffer(border, join_style="mitre").difference(area)
            walls.append(extruded(around, height))
        if not walls:
            raise ProblemError("it has no obstacles: border must say how thick its outer walls are")
    return walls


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
