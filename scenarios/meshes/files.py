"""Readers of mesh files; each reads all that a file declares, or refuses it and says why.

There is a reader of our own for each format, for libraries leave out in silence what they do not
know: trimesh 5.2 sparse accessors, strips beside faces and negative numbers of vertices, assimp 5
strips and indented lines; plyfile 1.1 takes lists of length -3, and bytes after the last row.
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from cocap_opt.data import LARGEST, FloatArray, IntArray, ProblemError
from cocap_opt.scenarios.meshes.faces import Faces
from cocap_opt.scenarios.meshes.gltf import read_gltf
from cocap_opt.scenarios.meshes.obj import read_obj
from cocap_opt.scenarios.meshes.off import read_off
from cocap_opt.scenarios.meshes.ply import read_ply
from cocap_opt.scenarios.meshes.stl import read_stl
from cocap_opt.text import unread

READERS: dict[str, Callable[[Path], Faces]] = {
    ".obj": read_obj,
    ".glb": read_gltf,
    ".gltf": read_gltf,
    ".stl": read_stl,
    ".ply": read_ply,
    ".off": read_off,
}


def read_mesh(path: Path, per_metre: float = 1.0) -> tuple[FloatArray, IntArray]:
    """Reads the vertices [V, 3] (m) and the triangles [M, 3] of a file.

    Vertices at the same place become one. Left out are triangles with two equal corners, and
    vertices that no triangle has.

    Parameters
    ----------
    path : regular file, whose ending names its format
    per_metre : units of the file in a metre

    Raises
    ------
    ProblemError
        If the file cannot be read whole, or holds no triangles; one line.
    """
    try:
        with np.errstate(over="ignore", invalid="ignore"):  # what is infinite is refused below
            faces = READERS[path.suffix.lower()](path)
    except OSError as error:
        raise ProblemError(unread(error)) from error
    faces = faces._replace(vertices=faces.vertices / per_metre)
    _require_sound(faces)
    welded = faces.welded()
    triangles = welded.triangles()
    if not len(triangles):
        raise ProblemError("must hold at least one triangle that is no line or point")
    used, corners = np.unique(triangles, return_inverse=True)
    return welded.vertices[used], corners.reshape(-1, 3)


def _require_sound(faces: Faces) -> None:
    """Raises a ProblemError if corners are no numbers of vertices, or vertices no places."""
    last = len(faces.vertices) - 1
    wrong = (faces.corners < 0) | (faces.corners > last)
    if wrong.any():
        raise ProblemError(f"faces: must name vertices 0..{last}, not {faces.corners[wrong][0]}")
    if not np.isfinite(faces.vertices).all():
        raise ProblemError("vertices: must be finite numbers x, y, z, not NaN or infinite")
    if len(faces.vertices) and np.abs(faces.vertices).max() > LARGEST:
        raise ProblemError(f"vertices: must be within +-{LARGEST:g} m")
