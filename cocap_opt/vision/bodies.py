"""Convex bodies that hide actors: columns of the terrain, convex meshes, and the other actors."""

from collections.abc import Sequence
from itertools import combinations
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from cocap_opt.data import BoolArray, FloatArray, IntArray
from cocap_opt.problem import Shape
from cocap_opt.problem.shapes import Cuboid, Prism
from cocap_opt.world.workspace import HeightMap, Mesh

_FLAT = 1e-9  # m; points closer than this to a plane lie in it
_MOST_PLANES = 64  # planes of a mesh that counts as one convex body
T = TypeVar("T", bound=np.generic)


class Bodies(NamedTuple):
    """A sequence of convex bodies; missing planes hide nothing, missing pairs are (0, 0)."""

    normals: FloatArray  # [B, P, 3] unit vectors, outward; 0 where missing
    offsets: FloatArray  # [B, P] m; 1 where missing
    neighbours: IntArray  # [B, N, 2] planes that share an edge
    low: FloatArray  # [B, 2] m, smallest x and y
    high: FloatArray  # [B, 3] m, greatest x, y and z
    endless: BoolArray  # [B] True for upright boxes without a lower end

    @classmethod
    def none(cls) -> "Bodies":
        """Returns no bodies."""
        return cls(
            np.zeros((0, 1, 3)), np.ones((0, 1)), np.zeros((0, 1, 2), dtype=np.int64),
            np.zeros((0, 2)), np.zeros((0, 3)), np.zeros(0, dtype=bool),
        )  # fmt: skip

    @classmethod
    def of_shape(cls, shape: Shape) -> "Bodies":
        """Returns the one body of an actor's shape, around its foot point."""
        # The two triangles of a side of a TriangulatedCuboid are one plane.
        whole: Cuboid | Prism
        if isinstance(shape, Prism):
            whole = shape
        else:
            whole = Cuboid(length=shape.length, width=shape.width, height=shape.height)
        faces = whole.faces()
        bottom = faces[-1][::-1].copy()
        bottom[:, 2] = 0.0
        return _between([*faces, bottom])

    @classmethod
    def of_mesh(cls, mesh: Mesh, origin: FloatArray) -> "Bodies | None":
        """Returns a closed mesh as one body if it is convex and has few sides, otherwise None.

        Parameters
        ----------
        origin : [3] m, new origin of the coordinates
        """
        if not mesh.is_solid or not len(mesh.surface):
            return None
        corners = mesh.vertices[np.unique(mesh.surface)] - origin
        # Convexity depends neither on position nor on size, except for rounding of coordinates.
        size, farthest = float(np.ptp(corners, axis=0).max()), float(np.abs(mesh.vertices).max())
        flat = _FLAT * max(1.0, size) + 8 * np.finfo(float).eps * farthest
        normals: list[FloatArray] = []
        for triangle in mesh.corners - origin:
            doubled = np.cross(triangle[1] - triangle[0], triangle[2] - triangle[0])
            length = float(np.linalg.norm(doubled))
            if length == 0:
                continue  # it has no area, and its corners belong to other triangles
            if ((corners - triangle[0]) @ doubled > flat * length).any():
                return None  # a corner is beyond this triangle's plane
            if not any(np.abs(doubled / length - normal).max() <= _FLAT for normal in normals):
                normals.append(doubled / length)
            if len(normals) > _MOST_PLANES:
                return None
        if not normals:
            return None
        offsets = (corners @ np.array(normals).T).max(axis=0)
        on = np.abs(corners @ np.array(normals).T - offsets) <= flat
        return _body(np.array(normals), offsets, on, corners)

    @classmethod
    def of_columns(cls, height_map: HeightMap, origin: FloatArray) -> "Bodies":
        """Returns the columns of a map; columns of equal height are merged into boxes without a
        bottom.

        Parameters
        ----------
        origin : [3] m, new origin of the coordinates
        """
        first, last, heights = _merged_cells(height_map.heights)
        corner = np.array(height_map.origin) - origin[:2]
        low = corner + height_map.resolution * first
        high = corner + height_map.resolution * (last + 1)
        n, tops = len(low), heights - origin[2]
        offsets = np.column_stack([tops, -low[:, 0], high[:, 0], -low[:, 1], high[:, 1]])
        return cls(
            np.broadcast_to(_COLUMN, (n, 5, 3)), offsets, np.broadcast_to(_COLUMN_EDGES, (n, 8, 2)),
            low, np.column_stack([high, tops]), np.ones(n, dtype=bool),
        )  # fmt: skip

    @classmethod
    def joined(cls, parts: Sequence["Bodies"]) -> "Bodies":
        """Returns the bodies of several parts, one after the other."""
        planes = max(part.normals.shape[1] for part in parts)
        pairs = max(part.neighbours.shape[1] for part in parts)
        wide = [
            part._replace(
                normals=widened(part.normals, planes, 0.0),
                offsets=widened(part.offsets, planes, 1.0),
                neighbours=widened(part.neighbours, pairs, 0),
            )
            for part in parts
        ]
        return cls(*(np.concatenate(column) for column in zip(*wide, strict=True)))

    def taken(self, which: IntArray) -> "Bodies":
        """Returns some of the bodies."""
        return Bodies._make(part[which] for part in self)


def widened(values: NDArray[T], width: int, filling: float) -> NDArray[T]:
    """Returns values [n, w, ..] as [n, width, ..], padded with the filling."""
    n, has, *rest = values.shape
    if has == width:
        return values
    missing = np.full((n, width - has, *rest), filling, values.dtype)
    return np.concatenate([values, missing], axis=1)


# A column: its top, and the sides towards -x, +x, -y and +y.
_COLUMN = np.array(
    [[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 1.0, 0.0]]
)
_COLUMN_EDGES = np.array([[0, 1], [0, 2], [0, 3], [0, 4], [1, 3], [1, 4], [2, 3], [2, 4]])


def _merged_cells(heights: FloatArray) -> tuple[IntArray, IntArray, FloatArray]:
    """Returns rectangles that together cover the map [X, Y]: first and last cells [n, 2], heights.

    All cells of a rectangle have the same height; the lowest cells are one rectangle, the whole
    map, as nothing is below them.
    """
    lowest = heights.min()
    free = heights > lowest
    # On rough ground, most cells have no neighbour of equal height.
    alone = free & _differs_from_neighbours(heights)
    free &= ~alone
    rectangles = [(x, y, x, y) for x, y in np.argwhere(alone).tolist()]
    for x, y in np.argwhere(free).tolist():
        if not free[x, y]:
            continue
        depth = _run(free[x, y:] & (heights[x, y:] == heights[x, y]))
        strip = slice(x, None), slice(y, y + depth)
        width = _run((free[strip] & (heights[strip] == heights[x, y])).all(axis=1))
        free[x : x + width, y : y + depth] = False
        rectangles.append((x, y, x + width - 1, y + depth - 1))
    whole = (0, 0, heights.shape[0] - 1, heights.shape[1] - 1)
    cells = np.array([whole, *sorted(rectangles)])
    tops = heights[cells[:, 0], cells[:, 1]]
    tops[0] = lowest
    return cells[:, :2], cells[:, 2:], tops


def _differs_from_neighbours(values: FloatArray) -> BoolArray:
    """Returns an array [X, Y], True if no neighbour along x or y has the same value."""
    differs = np.ones(values.shape, dtype=bool)
    for part, same in ((differs, values), (differs.T, values.T)):
        equal = same[1:] == same[:-1]
        part[1:] &= ~equal
        part[:-1] &= ~equal
    return differs


def _run(values: BoolArray) -> int:
    """Returns the number of True values before the first False."""
    return len(values) if values.all() else int(values.argmin())


def _between(polygons: Sequence[FloatArray]) -> Bodies:
    """Returns the body bounded by polygons [V, 3], counter-clockwise seen from outside."""
    corners = np.unique(np.concatenate(polygons), axis=0)
    doubled = np.array([np.cross(p[1] - p[0], p[2] - p[0]) for p in polygons])
    normals = doubled / np.linalg.norm(doubled, axis=1, keepdims=True)
    offsets = np.array([normal @ p[0] for normal, p in zip(normals, polygons, strict=True)])
    on = np.array([[(p == corner).all(axis=1).any() for p in polygons] for corner in corners])
    return _body(normals, offsets, on, corners)


def _body(normals: FloatArray, offsets: FloatArray, on: BoolArray, corners: FloatArray) -> Bodies:
    """Returns the body with planes [P], normals [P, 3] and offsets [P], and corners [C, 3].

    Parameters
    ----------
    on : [C, P] True for corners on planes; two planes with two common corners share an edge
    """
    pairs = [
        (a, b) for a, b in combinations(range(on.shape[1]), 2) if (on[:, a] & on[:, b]).sum() >= 2
    ]
    return Bodies(
        normals[None], offsets[None], np.array(pairs, dtype=np.int64).reshape(1, -1, 2),
        corners[None, :, :2].min(axis=1), corners[None].max(axis=1), np.zeros(1, dtype=bool),
    )  # fmt: skip
