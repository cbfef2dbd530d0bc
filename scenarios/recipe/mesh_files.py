"""Reader of mesh files, by trimesh."""

import re
import warnings
from pathlib import Path

import numpy as np
import trimesh
from trimesh.resolvers import Resolver

from cocap_opt.data import FloatArray, IntArray, ProblemError


class _Beside(Resolver):
    """Opens the files that a mesh file names, if they are regular files in its folder or below."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder.resolve()

    def get(self, name: str) -> bytes:
        path = (self._folder / name).resolve()
        if not path.is_relative_to(self._folder) or not path.is_file():
            raise FileNotFoundError(f"{name} is no file beside it")
        return path.read_bytes()

    def namespaced(self, namespace: str) -> "_Beside":
        return _Beside(self._folder / namespace)

    def keys(self) -> list[str]:
        return []

    def write(self, name: str, data: bytes) -> None:
        raise NotImplementedError


def read_mesh(path: Path) -> tuple[FloatArray, IntArray]:
    """Reads the vertices [V, 3] and the triangles [M, 3] of a file."""
    kind = path.suffix.lower()
    if not path.is_file():  # opening a pipe would wait for someone to write into it
        raise ProblemError("cannot be read: no such file")
    try:
        # trimesh warns of numbers that are refused below.
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            if kind == ".ply":
                _require_rows(path)
            with path.open("rb") as file:
                scene = trimesh.load_scene(
                    file, file_type=kind[1:], resolver=_Beside(path.parent), skip_materials=True,
                    process=False,  # which would leave out corners that are no numbers
                )  # fmt: skip
            shape = scene.to_mesh()
            _require_vertices(shape.faces, len(shape.vertices))
            finite = bool(np.isfinite(shape.vertices).all())
            shape.merge_vertices(merge_tex=True, merge_norm=True)
            vertices = np.array(shape.vertices, dtype=np.float64)
            triangles = np.array(shape.faces, dtype=np.int64)
    except ProblemError:
        raise
    except OSError as error:
        raise ProblemError(f"cannot be read: {error.strerror or error}") from error
    except Exception as error:  # trimesh names no set of errors for a damaged file
        raise ProblemError(
            f"cannot be read as {kind}: it is damaged, cut off, or of another format"
        ) from error
    if not finite or vertices.ndim != 2 or vertices.shape[1] != 3:
        raise ProblemError("vertices: must be finite numbers x, y, z, not NaN or infinite")
    if not len(triangles):
        raise ProblemError("must hold at least one triangle")
    return vertices, triangles


def _require_vertices(triangles: IntArray, vertices: int) -> None:
    """Raises a ProblemError if corners [M, 3] are no numbers of vertices; -1 is none."""
    wrong = (triangles < 0) | (triangles >= vertices)
    if wrong.any():
        raise ProblemError(
            f"faces: must name vertices 0..{vertices - 1}, not {triangles[wrong][0]}"
        )


def _require_rows(path: Path) -> None:
    """Raises a ProblemError if a PLY file of text has fewer rows than its header says."""
    head, _, body = path.read_bytes().partition(b"end_header")
    if not re.search(rb"^\s*format\s+ascii\b", head, re.MULTILINE):
        return  # trimesh compares the lengths of others
    wanted = sum(map(int, re.findall(rb"^\s*element\s+\S+\s+(\d{1,18})\s*$", head, re.MULTILINE)))
    rows = sum(1 for line in body.splitlines() if line.strip())
    if rows < wanted:
        raise ProblemError(f"must have {wanted} rows, as its header says, but ends after {rows}")
