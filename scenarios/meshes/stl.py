"""Reader of STL, binary and text.

Source: StereoLithography Interface Specification, 3D Systems, 1988.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from cocap_opt.data import ProblemError
from cocap_opt.scenarios.meshes.faces import MeshFaces, lines, numbers

_HEAD = 84  # bytes before the triangles of a binary file; the last 4 are the number of triangles
_TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_WORDS = {"facet": 5, "outer": 2, "vertex": 4, "endloop": 1, "endfacet": 1}  # numbers of words
_NEXT = {  # statements that may follow each statement
    "solid": ("facet", "endsolid"), "facet": ("outer",), "outer": ("vertex",),
    "vertex": ("vertex", "endloop"), "endloop": ("endfacet",), "endfacet": ("facet", "endsolid"),
    "endsolid": ("solid",),
}  # fmt: skip


def read_stl(path: Path) -> MeshFaces:
    """Reads all triangles of all solids of a file.

    A file is binary if its length matches its number of triangles, even if it begins with the word
    solid.

    Raises
    ------
    ProblemError
        If it is truncated, or is not STL.
    """
    content = path.read_bytes()
    declared = int.from_bytes(content[_HEAD - 4 : _HEAD], "little")
    length = _HEAD + declared * _TRIANGLE.itemsize
    if len(content) >= _HEAD and len(content) == length:
        corners = np.frombuffer(content, _TRIANGLE, offset=_HEAD)["corners"]
        places = corners.reshape(-1, 3).astype(np.float64)
        return MeshFaces.of_triangles(places, np.arange(len(places)))
    if content.lstrip()[:5].lower() == b"solid" and b"\0" not in content:
        return _read_text(path)
    if len(content) < _HEAD:
        raise ProblemError("must be STL, which begins with `solid`, or with 84 bytes of a header")
    raise ProblemError(
        f"must have {length} bytes, as it declares {declared} triangles, but has {len(content)}: "
        "it is truncated, or is not STL"
    )


def _read_text(path: Path) -> MeshFaces:
    places: list[list[float]] = []
    ends: list[int] = [0]  # number of vertices at the end of each loop
    last = "endsolid"
    for number, line in lines(path):
        for name, values in _statements(line, number):
            if name not in _NEXT[last]:
                wanted = " or ".join(_NEXT[last])
                raise ProblemError(f"line {number}: must continue with {wanted}, not {name}")
            if name == "vertex":
                places.append(numbers(values, number))
            elif name == "endloop":
                ends.append(len(places))
                if ends[-1] - ends[-2] < 3:
                    raise ProblemError(f"line {number}: a loop must have at least 3 corners")
            last = name
    if last != "endsolid":
        raise ProblemError("ends before its `endsolid`: it is truncated")
    vertices = np.array(places, dtype=np.float64).reshape(-1, 3)
    return MeshFaces(vertices, np.diff(ends), np.arange(len(vertices)))


def _statements(line: str, number: int) -> Iterator[tuple[str, list[str]]]:
    """Yields the statements of a line and their values; the rest of a line is the name of a
    solid.
    """
    words = line.split()
    while words:
        name = words[0].lower()
        length = len(words) if name in ("solid", "endsolid") else _WORDS.get(name, 0)
        if not 0 < length <= len(words):
            raise ProblemError(
                f"line {number}: must be a statement of STL, not {' '.join(words)[:40]!r}"
            )
        yield name, words[1:length]
        words = words[length:]
