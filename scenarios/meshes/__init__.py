"""Meshes in files: bridges and other solids that a height map cannot represent.

Each reader reads everything that a file declares, or rejects the file with a reason. To add a
format: one module with a function `read_..(path)` that returns `MeshFaces`, and one line in
`FORMATS`.

The project has its own reader for each format, since libraries silently ignore what they do not
support: trimesh 5.2 ignores sparse accessors, strips beside faces, and negative numbers of
vertices; assimp 5 ignores strips and indented lines. plyfile 1.1 accepts lists of length -3, and
bytes after the last row.
"""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Literal

import numpy as np

from cocap_opt.data import LARGEST, FloatArray, IntArray, ProblemError
from cocap_opt.scenarios.kinds import GLB, JSON, OFF, PLY, STL, Kind, require
from cocap_opt.scenarios.meshes.faces import MeshFaces
from cocap_opt.scenarios.meshes.gltf import read_gltf
from cocap_opt.scenarios.meshes.obj import read_obj
from cocap_opt.scenarios.meshes.off import read_off
from cocap_opt.scenarios.meshes.ply import read_ply
from cocap_opt.scenarios.meshes.stated_units import settled_unit
from cocap_opt.scenarios.meshes.stl import read_stl
from cocap_opt.scenarios.tables import PER_METRE, Coordinate, Table, Unit
from cocap_opt.scenarios.text import naming
from cocap_opt.text import plain, unread
from cocap_opt.world.workspace import Mesh

# By ending: the reader, the axis that points up (z as in surveys), and the kind of file by its
# first bytes, if they identify it.
FORMATS: dict[str, tuple[Callable[[Path], MeshFaces], Literal["y", "z"], Kind | None]] = {
    ".obj": (read_obj, "z", None),
    ".glb": (read_gltf, "y", GLB),
    ".gltf": (read_gltf, "y", JSON),
    ".stl": (read_stl, "z", STL),
    ".ply": (read_ply, "z", PLY),
    ".off": (read_off, "z", OFF),
}


class MeshTable(Table):
    """One of the tables `mesh` of a recipe, see `cocap_opt.scenarios.recipe.EXAMPLE`."""

    file: str
    unit: Unit | None = None  # of its coordinates; None: as a comment states, otherwise m
    up: Literal["y", "z"] | None = None  # axis that points up; None: y for glTF, z for others
    turn: Coordinate = 0.0  # degrees about its origin, counter-clockwise seen from above
    at: tuple[Coordinate, Coordinate, Coordinate] = (0.0, 0.0, 0.0)  # m, position of its origin

    def mesh(self, folder: Path) -> Mesh:
        """Reads all geometry of the file as one mesh; vertices at the same place are merged.

        Raises
        ------
        ProblemError
            If the file cannot be read completely or contains no triangles; the message is one line
            that names the file.
        """
        path = folder / self.file
        with naming(path):
            require(path, [kind for _, _, kind in FORMATS.values() if kind])
            if path.suffix.lower() not in FORMATS:
                raise ProblemError(f"must be named {', '.join(FORMATS)}")
            _, up, _ = FORMATS[path.suffix.lower()]
            vertices, triangles = read_mesh(path, self.unit)
            if (self.up or up) == "y":
                vertices = vertices[:, [0, 2, 1]] * np.array([1.0, -1.0, 1.0])
            turn = math.radians(self.turn)
            mesh = Mesh(vertices=_placed(vertices, turn, self.at), triangles=triangles)
            if not len(mesh.surface):  # the corners of all triangles are on a line
                raise ProblemError(_NOTHING)
            return mesh


_NOTHING = "must contain at least one triangle with an area"


def _placed(vertices: FloatArray, turn: float, at: tuple[float, float, float]) -> FloatArray:
    """Returns the vertices turned by `turn` rad about the z axis, and shifted by `at`."""
    c, s = math.cos(turn), math.sin(turn)
    x, y, z = vertices.T
    placed: FloatArray = np.column_stack([c * x - s * y, s * x + c * y, z]) + np.array(at)
    return placed


def read_mesh(path: Path, unit: Unit | None = None) -> tuple[FloatArray, IntArray]:
    """Reads the vertices [V, 3] (m) and the triangles [M, 3] of a file.

    Vertices at the same place are merged. Triangles with two equal corners, and vertices without
    triangles, are left out.

    Parameters
    ----------
    path : regular file, whose ending names its format
    unit : of its coordinates; None: as a comment in the file states, otherwise m

    Raises
    ------
    ProblemError
        If the file cannot be read completely, or contains no triangles; the message is one line.
    """
    try:
        with np.errstate(over="ignore", invalid="ignore"):  # infinite values are rejected below
            read, _, _ = FORMATS[path.suffix.lower()]
            faces = read(path)
        per_metre = PER_METRE[settled_unit(path, unit)]
    except OSError as error:
        raise ProblemError(unread(error)) from error
    faces = faces._replace(vertices=faces.vertices / per_metre)
    _require_sound(faces)
    welded = faces.welded()
    triangles = welded.triangles()
    if not len(triangles):
        raise ProblemError(_NOTHING)
    used, corners = np.unique(triangles, return_inverse=True)
    return welded.vertices[used], corners.reshape(-1, 3)


def _require_sound(faces: MeshFaces) -> None:
    """Raises ProblemError if corners are not numbers of vertices, or vertices are not finite."""
    last = len(faces.vertices) - 1
    wrong = (faces.corners < 0) | (faces.corners > last)
    if wrong.any():
        raise ProblemError(f"faces: must name vertices 0..{last}, not {faces.corners[wrong][0]}")
    if not np.isfinite(faces.vertices).all():
        raise ProblemError("vertices: must be finite numbers x, y, z, not NaN or infinite")
    if len(faces.vertices) and np.abs(faces.vertices).max() > LARGEST:
        raise ProblemError(f"vertices: must be within +-{plain(LARGEST)} m")
