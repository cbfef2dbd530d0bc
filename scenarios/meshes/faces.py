"""Shared parts of readers of mesh files: lines and numbers of text, faces, their triangles.

Faces may have any number of corners. Text may have any encoding.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple, Self

import numpy as np
import shapely
from shapely import Polygon
from shapely.geometry.base import BaseGeometry
from shapely.geometry.polygon import orient

from cocap_opt.data import BoolArray, FloatArray, IntArray, ProblemError
from cocap_opt.scenarios.text import plain_number
from cocap_opt.world.triangles import close, equal_rows, firsts

_FLAT = 1e-9  # relative to a face's size squared; smaller areas count as 0


class MeshFaces(NamedTuple):
    """The faces of a mesh file, given by the numbers of their vertices, face by face."""

    vertices: FloatArray  # [V, 3]
    sizes: IntArray  # [F] number of corners of each face
    corners: IntArray  # [sum of sizes]

    @classmethod
    def of_lists(cls, vertices: FloatArray, faces: Sequence[Sequence[int]]) -> Self:
        """Returns faces that are given as lists of vertex numbers.

        Raises
        ------
        ProblemError
            If a number is too large for any vertex.
        """
        sizes = np.array([len(face) for face in faces], dtype=np.int64)
        try:
            corners = np.array([corner for face in faces for corner in face], dtype=np.int64)
        except OverflowError as error:
            raise ProblemError("faces: must name vertices by numbers below 2^63") from error
        return cls(np.reshape(vertices, (-1, 3)), sizes, corners)

    @classmethod
    def of_triangles(cls, vertices: FloatArray, triangles: IntArray) -> Self:
        """Returns faces that are triangles [M, 3]."""
        corners = np.asarray(triangles, dtype=np.int64).ravel()
        return cls(vertices, np.full(len(corners) // 3, 3), corners)

    def welded(self) -> Self:
        """Returns the same faces with one vertex per place, without repeated corners.

        A corner is repeated if it is at the place of the previous corner in its face.
        """
        number = firsts(self.vertices)
        kept = np.flatnonzero(number == np.arange(len(number)))
        corners = np.searchsorted(kept, number)[self.corners]
        face = np.repeat(np.arange(len(self.sizes)), self.sizes)
        ends = np.cumsum(self.sizes)
        before = np.arange(len(corners)) - 1
        begins = (ends - self.sizes)[self.sizes > 0]
        before[begins] = ends[self.sizes > 0] - 1
        stays = corners != corners[before]
        sizes = np.bincount(face[stays], minlength=len(self.sizes))
        return self._replace(vertices=self.vertices[kept], sizes=sizes, corners=corners[stays])

    def triangles(self) -> IntArray:
        """Cuts the faces into triangles [M, 3] with the same corners and edges.

        Faces with fewer than three corners are points and lines, and are left out.

        Raises
        ------
        ProblemError
            If a face crosses itself.
        """
        parts = list(self._triangles())
        order = np.argsort(np.concatenate([faces for faces, _ in parts]), kind="stable")
        result: IntArray = np.concatenate([triangles for _, triangles in parts])[order]
        return result

    def _triangles(self) -> Iterator[tuple[IntArray, IntArray]]:
        """Yields triangles [n, 3] and the numbers [n] of their faces."""
        yield np.zeros(0, dtype=np.int64), np.zeros((0, 3), dtype=np.int64)
        begins = np.cumsum(self.sizes) - self.sizes
        for size in np.unique(self.sizes[self.sizes >= 3]).tolist():
            faces = np.flatnonzero(self.sizes == size)
            corners = self.corners[begins[faces, None] + np.arange(size)]
            corners = _alike(corners) if size > 3 else corners
            fans = fan(corners)
            if size > 3:
                places = self.vertices[corners]
                flat = _seen_from_ahead(places)
                for k in np.flatnonzero(~_turn_one_way(places, flat)).tolist():
                    fans[k] = _cut(corners[k], flat[k], int(faces[k]))
            yield np.repeat(faces, size - 2), fans.reshape(-1, 3)


def strip(corners: IntArray) -> IntArray:
    """Returns the triangles [n - 2, 3] of a strip [n], all with the same orientation."""
    k = np.arange(max(len(corners) - 2, 0))
    return np.column_stack([corners[k], corners[k + 1 + k % 2], corners[k + 2 - k % 2]])


def fan(corners: IntArray) -> IntArray:
    """Returns the triangles [.., n - 2, 3] from the first of some corners [.., n] to all others."""
    first = np.broadcast_to(corners[..., :1], corners[..., 2:].shape)
    return np.stack([first, corners[..., 1:-1], corners[..., 2:]], axis=-1)


def _alike(corners: IntArray) -> IntArray:
    """Returns faces [F, n]; faces with the same corners begin at the corner with the smallest
    number.

    So a face that is drawn from both sides is cut the same way twice.
    """
    _, same = equal_rows(np.sort(corners, axis=1))
    begin = np.where(np.bincount(same)[same] > 1, corners.argmin(axis=1), 0)
    order = (begin[:, None] + np.arange(corners.shape[1])) % corners.shape[1]
    result: IntArray = np.take_along_axis(corners, order, axis=1)
    return result


def _seen_from_ahead(corners: FloatArray) -> FloatArray:
    """Returns corners [F, n, 3] without the axis closest to each face's normal [F, n, 2].

    All faces are counter-clockwise there.
    """
    local = corners - corners[:, :1]
    normals = np.cross(local, np.roll(local, -1, axis=1)).sum(axis=1)  # Newell's method
    axis = np.abs(normals).argmax(axis=1)
    backwards = np.take_along_axis(normals, axis[:, None], axis=1)[:, 0] < 0
    axes = np.where(backwards[:, None], (axis[:, None] + [2, 1]) % 3, (axis[:, None] + [1, 2]) % 3)
    result: FloatArray = np.take_along_axis(local, axes[:, None, :], axis=2)
    return result


def _turn_one_way(corners: FloatArray, flat: FloatArray) -> BoolArray:
    """Returns an array [F], True if the triangles from a face's first corner cover exactly the
    face.

    They do if none of them is reversed, and also if none of them has an area.

    Parameters
    ----------
    corners : [F, n, 3]
    flat : [F, n, 2], the same without the axis closest to each face's normal
    """
    x, y = np.moveaxis(flat[:, 1:] - flat[:, :1], 2, 0)
    areas = x[:, :-1] * y[:, 1:] - y[:, :-1] * x[:, 1:]
    ways = corners[:, 1:] - corners[:, :1]
    all_areas = np.linalg.norm(np.cross(ways[:, :-1], ways[:, 1:]), axis=2).sum(axis=1)
    least = _FLAT * np.square(ways).max(axis=(1, 2))
    forwards = (areas >= -least[:, None]).all(axis=1)
    return np.asarray(forwards & ((areas.sum(axis=1) > least) | (all_areas <= least)))


def _cut(corners: IntArray, flat: FloatArray, face: int) -> IntArray:
    """Cuts a face [n] with plane coordinates [n, 2] into triangles [n - 2, 3]."""
    places = [tuple(place) for place in flat.tolist()]
    number = dict(zip(places, corners.tolist(), strict=True))
    try:
        pieces = shapely.constrained_delaunay_triangles(Polygon(places)).geoms
        found = [[number[place] for place in _ring(piece)] for piece in pieces]
    except (shapely.errors.GEOSException, KeyError):
        found = []
    triangles = np.array(found, dtype=np.int64).reshape(-1, 3)
    back = fan(corners[::-1])  # triangles with just the edges of the face close with it
    if len(triangles) != len(corners) - 2 or not close(np.concatenate([triangles, back])):
        raise ProblemError(
            f"faces[{face}]: must not cross itself; in Blender, Face > Triangulate Faces cuts such "
            "faces into triangles"
        )
    return triangles


def _ring(piece: BaseGeometry) -> list[tuple[float, float]]:
    """Returns the corners of a triangle, counter-clockwise."""
    return [(x, y) for x, y in orient(Polygon(piece.boundary.coords)).exterior.coords[:3]]


def lines(path: Path) -> Iterator[tuple[int, str]]:
    """Yields the lines of a file, numbered from 1; comments need not be UTF-8."""
    content = path.read_bytes()
    if b"\0" in content:
        raise ProblemError("must be text with one byte per letter, not binary or UTF-16")
    text = content.decode("utf-8-sig", errors="replace")
    # Not with `splitlines`, which also ends lines at letters of other encodings.
    ends = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    yield from enumerate(ends, start=1)


def numbers(values: Sequence[str], place: int | str) -> list[float]:
    """Returns the numbers in words; `place` is a line number or a name for messages.

    Raises
    ------
    ProblemError
        If one is not a number.
    """
    try:
        return [plain_number(value) for value in values]
    except ValueError as error:
        where = place if isinstance(place, str) else f"line {place}"
        raise ProblemError(
            f"{where}: must be numbers with a decimal point, not {' '.join(values)[:40]!r}"
        ) from error


def whole(values: Sequence[str], line: int) -> list[int]:
    """Returns the whole numbers in the words of a line.

    Raises
    ------
    ProblemError
        If one is not a whole number.
    """
    found = numbers(values, line)
    if not all(value.is_integer() for value in found):
        raise ProblemError(f"line {line}: must be whole numbers, not {' '.join(values)[:40]!r}")
    return [int(value) for value in found]
