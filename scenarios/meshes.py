"""Meshes from files: what a height map cannot hold.

They are read by trimesh: OBJ, STL, PLY and OFF, and glTF (GLB), which by its standard has its y
axis upwards.
"""

import math
from pathlib import Path
from typing import Literal

import numpy as np
import trimesh

from cocap_opt.data import FloatArray, ProblemError
from cocap_opt.workspace import Mesh
from scenarios._text import naming, one_line

PER_METRE = {"m": 1.0, "cm": 100.0, "mm": 1000.0, "ft": 1 / 0.3048}
UP = {".glb": "y", ".gltf": "y"}  # of other files z, as in surveying
SUFFIXES = (".obj", ".glb", ".gltf", ".stl", ".ply", ".off")

Unit = Literal["m", "cm", "mm", "ft"]
Axis = Literal["y", "z"]


def read_mesh(
    path: Path,
    *,
    unit: Unit = "m",
    up: Axis | None = None,
    turn: float = 0.0,
    at: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> Mesh:
    """Read all geometry of a file as one mesh; vertices at the same place become one.

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
        return Mesh(vertices=_placed(vertices, turn, at), triangles=np.asarray(shape.faces))


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
