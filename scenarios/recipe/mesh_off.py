"""Reader of OFF as text: numbers of vertices and faces, then one of them a line.

Source: Geomview's manual, "OFF Files".
"""

import re
from pathlib import Path

import numpy as np

from cocap_opt.data import ProblemError
from cocap_opt.scenarios.recipe.mesh_faces import Faces
from cocap_opt.scenarios.recipe.mesh_text import lines, numbers, whole

_HEADER = re.compile(r"(ST)?(C)?(N)?(4)?(n)?OFF\b\s*(BINARY\b)?")


def read_off(path: Path) -> Faces:
    """Reads all faces of a file; colours, normals and texture are left out.

    Raises
    ------
    ProblemError
        If it is binary or of other than three dimensions, or has not the rows that it declares.
    """
    rows = [
        (number, row) for number, line in lines(path) if (row := line.partition("#")[0].split())
    ]
    if not rows:
        raise ProblemError("is empty")
    (number, first), *rest = rows
    header = _HEADER.match(" ".join(first))
    if header:
        first = " ".join(first)[header.end() :].split()
        if header[6]:
            raise ProblemError("must be OFF as text, not binary; MeshLab writes it so")
        if header[4] or header[5]:
            raise ProblemError(f"must have three dimensions, not those of {header[0]}")
    rows = [(number, first), *rest] if first else rest
    if not rows:
        raise ProblemError("must say its numbers of vertices and faces, but ends before them")
    if not header and len(rows[0][1]) not in (2, 3):
        raise ProblemError("must begin with OFF")
    (number, declared), *rows = rows
    if len(declared) not in (2, 3):
        raise ProblemError(
            f"line {number}: must be the numbers of vertices, faces and edges, not "
            f"{' '.join(declared)[:40]!r}"
        )
    vertices, faces = whole(declared[:2], number)
    if len(rows) != max(vertices, 0) + max(faces, 0):
        raise ProblemError(
            f"must have a row for each of its {vertices} vertices and {faces} faces, as it "
            f"declares, not {len(rows)} rows"
        )
    places = [_vertex(row, line, header) for line, row in rows[:vertices]]
    return Faces.of_lists(
        np.array(places, dtype=np.float64), [_face(row, line) for line, row in rows[vertices:]]
    )


def _vertex(row: list[str], line: int, header: re.Match[str] | None) -> list[float]:
    """Returns x, y, z of a row, after which what the header names may follow."""
    if len(row) < 3:
        raise ProblemError(f"line {line}: a vertex must be x, y, z, not {' '.join(row)[:40]!r}")
    given = numbers(row, line)
    # Colours of 3 or 4 numbers are common without a C, too.
    if len(row) not in (3, 6, 7) and not (header and any(header.group(1, 2, 3))):
        raise ProblemError(f"line {line}: must be one vertex, x, y, z, not {len(row)} numbers")
    return given[:3]


def _face(row: list[str], line: int) -> list[int]:
    """Returns the corners of a row: their number, then they, then a colour."""
    (size,) = whole(row[:1], line)
    if not 0 <= size < len(row):
        raise ProblemError(f"line {line}: must have {size} corners, not {len(row) - 1}")
    return whole(row[1 : 1 + size], line)
