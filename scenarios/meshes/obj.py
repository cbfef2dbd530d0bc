"""Reader of Wavefront OBJ: polygons, whose corners are numbered from 1, or backwards from the last.

Source: Object Files (.obj), appendix B1 of the manual of Wavefront's Advanced Visualizer.
"""

import logging
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from cocap_opt.data import ProblemError
from cocap_opt.scenarios.meshes.faces import MeshFaces, lines, numbers

# Statements without geometry: names, groups, materials, texture and display.
_NO_GEOMETRY = (
    "vt", "vn", "vp", "g", "o", "s", "mg", "usemtl", "usemap", "mtllib", "maplib", "bevel",
    "c_interp", "d_interp", "lod", "shadow_obj", "trace_obj", "ctech", "stech",
)  # fmt: skip
_DRAWN = {"p": "points", "l": "lines"}
_FREE_FORM = (
    "cstype", "deg", "bmat", "step", "curv", "curv2", "surf", "parm", "trim", "hole", "scrv", "sp",
    "end", "con", "bsp", "bzp", "cdc", "cdp", "res",
)  # fmt: skip
_CORNER = re.compile(r"([-+]?[0-9]{1,18})(?:/(?:[-+]?[0-9]+)?){0,2}")  # 3, 3/1, 3//2 or 3/1/2
# x y z, optionally followed by a weight, or a colour, or a colour and its opacity
_COORDINATES = (3, 4, 6, 7)

_log = logging.getLogger(__name__)


def read_obj(path: Path) -> MeshFaces:
    """Reads all faces of a file.

    Raises
    ------
    ProblemError
        If a statement contains geometry other than polygons, or is not part of OBJ, or if a face
        names a vertex that does not exist.
    """
    vertices: list[list[float]] = []
    faces: list[list[int]] = []
    drawn = dict.fromkeys(_DRAWN, 0)
    for number, text in _statements(path):
        name, *values = text.split()
        if name == "v":
            vertices.append(_vertex(values, number))
        elif name in ("f", "fo"):  # fo means f in older versions
            faces.append([_corner(value, len(vertices), number) for value in values])
            if len(values) < 3:
                raise ProblemError(f"line {number}: a face must have at least 3 corners")
        elif name in _DRAWN:
            drawn[name] += 1
        elif name in _FREE_FORM:
            raise ProblemError(
                f"line {number}: {name} belongs to a curve or a free-form surface, but only "
                "polygons are read; export it as a mesh"
            )
        elif name not in _NO_GEOMETRY:
            raise ProblemError(f"line {number}: must be a statement of OBJ, not {name[:20]!r}")
    if left := ", ".join(f"{count} {_DRAWN[name]}" for name, count in drawn.items() if count):
        _log.warning("%s: %s are not surfaces and are left out", path, left)
    return MeshFaces.of_lists(np.array(vertices, dtype=np.float64), faces)


def _statements(path: Path) -> Iterator[tuple[int, str]]:
    """Yields each statement with the number of its first line; a backslash continues a line."""
    begun, first = "", 0
    for number, line in lines(path):
        first = first if begun else number
        begun += line.partition("#")[0].rstrip()
        if begun.endswith("\\"):
            begun = begun[:-1] + " "
            continue
        if begun.strip():
            yield first, begun
        begun = ""
    if begun.strip():
        raise ProblemError(f"line {first}: must continue after its backslash, but the file ends")


def _vertex(values: list[str], line: int) -> list[float]:
    if len(values) not in _COORDINATES:
        raise ProblemError(
            f"line {line}: a vertex must be x, y, z, with at most a colour, not {len(values)} "
            "numbers"
        )
    given = numbers(values, line)
    if len(given) == 4 and given[3] != 1:
        raise ProblemError(f"line {line}: the weight of a vertex must be 1, not {given[3]:g}")
    return given[:3]


def _corner(value: str, count: int, line: int) -> int:
    """Returns the vertex number, from 0, of a corner such as 3, 3/1, 3//2, 3/1/2 or -1."""
    found = _CORNER.fullmatch(value)
    if not found:
        raise ProblemError(
            f"line {line}: a corner must be written like 3, 3/1, 3//2 or 3/1/2, not {value[:20]!r}"
        )
    given = int(found[1])
    if given == 0:
        raise ProblemError(f"line {line}: vertices are numbered from 1, but a corner is 0")
    if given < -count:
        raise ProblemError(
            f"line {line}: corner {given} counts back beyond the {count} vertices before it"
        )
    return given - 1 if given > 0 else count + given
