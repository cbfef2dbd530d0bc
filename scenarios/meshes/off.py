"""Reader of OFF as text: numbers of vertices and faces, followed by one per line.

Source: Geomview's manual, "OFF Files".
"""

import re
from pathlib import Path

import numpy as np

from cocap_opt.data import ProblemError
from cocap_opt.scenarios.meshes.faces import MeshFaces, lines, numbers, whole

_BINARY = re.compile(rb"\s*\w*OFF\s+BINARY\b")
_HEADER = re.compile(r"(ST)?(C)?(N)?(4)?(n)?OFF\b")


def read_off(path: Path) -> MeshFaces:
    """Reads all faces of a file; colours, normals and texture are left out.

    Raises
    ------
    ProblemError
        If it is binary, does not have three dimensions, or does not have the declared rows.
    """
    if _BINARY.match(path.read_bytes()):
        raise ProblemError("must be OFF as text, not binary; MeshLab writes text")
    rows = [
        (number, row) for number, line in lines(path) if (row := line.partition("#")[0].split())
    ]
    if not rows:
        raise ProblemError("is empty")
    (number, first), *rest = rows
    header = _HEADER.match(" ".join(first))
    if header is None and not first[0].isdigit():  # Geomview accepts files without it, too
        raise ProblemError("must begin with OFF")
    if header and (header[4] or header[5]):
        raise ProblemError(f"must have three dimensions, not those of {header[0]}")
    counts = " ".join(first)[header.end() :].split() if header else first
    (number, declared), *rows = [(number, counts), *rest] if counts or not rest else rest
    if len(declared) not in (2, 3):
        raise ProblemError(
            f"line {number}: must be the numbers of vertices, faces and edges, not "
            f"{' '.join(declared)[:40]!r}"
        )
    vertices, faces = whole(declared[:2], number)
    if min(vertices, faces) < 0 or len(rows) != vertices + faces:
        raise ProblemError(
            f"must have a row for each of its {vertices} vertices and {faces} faces, as it "
            f"declares, not {len(rows)} rows"
        )
    places = [_vertex(row, line, header) for line, row in rows[:vertices]]
    return MeshFaces.of_lists(
        np.array(places, dtype=np.float64), [_face(row, line) for line, row in rows[vertices:]]
    )


def _vertex(row: list[str], line: int, header: re.Match[str] | None) -> list[float]:
    """Returns x, y, z of a row, which further values named in the header may follow."""
    if len(row) < 3:
        raise ProblemError(f"line {line}: a vertex must be x, y, z, not {' '.join(row)[:40]!r}")
    given = numbers(row, line)
    # Colours of 3 or 4 numbers are common even without a C in the header.
    if len(row) not in (3, 6, 7) and not (header and any(header.group(1, 2, 3))):
        raise ProblemError(f"line {line}: must be one vertex, x, y, z, not {len(row)} numbers")
    return given[:3]


def _face(row: list[str], line: int) -> list[int]:
    """Returns the corners of a row: their number, the corners, then an optional colour."""
    (size,) = whole(row[:1], line)
    if not 0 <= size < len(row):
        raise ProblemError(f"line {line}: must have {size} corners, not {len(row) - 1}")
    return whole(row[1 : 1 + size], line)
