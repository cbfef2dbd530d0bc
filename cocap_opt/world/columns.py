"""Solid matter above every cell of a grid, as intervals of altitude.

The column of a height map is solid from minus infinity to its top. A mesh adds one interval to a
cell that it meets, or several where it overhangs itself.
"""

from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np

from cocap_opt.data import BoolArray, FloatArray, IntArray, ProblemError
from cocap_opt.world.triangles import clip, outward

MARGIN = 1e-6  # cells; a solid that reaches less far into a cell only touches it
_PAIRS = 200_000  # pairs of triangles and cells per batch, to limit the memory
_MOST_PAIRS = 10_000_000  # pairs of one mesh
# Point of a cell at which a mesh is probed; not the middle, which edges often pass.
PROBE = 0.5137, 0.4789


class Spans(NamedTuple):
    """Intervals of altitude in cells, in any order."""

    cells: IntArray  # [n] x Y + y
    low: FloatArray  # [n] m
    high: FloatArray  # [n] m

    @classmethod
    def of_mesh(
        cls, vertices: FloatArray, triangles: IntArray, shape: tuple[int, int], solid: bool
    ) -> "Spans":
        """Returns the altitudes at which a mesh has matter inside each cell.

        Parameters
        ----------
        vertices : [V, 3], x and y in cells, z in m
        triangles : [M, 3] numbers of vertices
        shape : number of cells along x and y
        solid : True if the mesh is the surface of a solid: its inside is matter, too, and cells
            that it merely touches are free. A thin plate counts on both sides

        Raises
        ------
        ProblemError
            If the mesh reaches into too many cells.
        """
        corners, margin = vertices[triangles], np.full(2, MARGIN if solid else -MARGIN)
        parts = []
        for triangle, x, y in _pairs(corners, shape, margin):
            inside, low, high = _surface(corners[triangle], x, y, margin)
            parts.append(cls((x * shape[1] + y)[inside], low, high))
        if not solid:
            return Spans.joined(parts).merged()
        parts.append(_interior(vertices, outward(vertices, triangles), shape))
        matter = Spans.joined(parts).merged()
        thin = [_thin(corners, axis, shape, matter) for axis in (0, 1)]
        return Spans.joined([matter, *thin]).merged()

    @classmethod
    def joined(cls, parts: Iterable["Spans"]) -> "Spans":
        """Returns the spans of several parts, one after the other."""
        return cls(*(np.concatenate(column) for column in zip(NO_SPANS, *parts, strict=True)))

    def merged(self) -> "Spans":
        """Returns the same matter with overlapping spans merged, by cell and from below."""
        if not len(self.cells):
            return NO_SPANS
        order = np.lexsort([self.low, self.cells])
        cells, low, high = self.cells[order], self.low[order], self.high[order]
        new = np.concatenate([[True], cells[1:] != cells[:-1]])
        # Cells are stacked in altitude, so that one running maximum handles all of them.
        floor = (np.cumsum(new) - 1) * (high.max() - low.min() + 1) - low.min()
        top = np.maximum.accumulate(high + floor)
        new[1:] |= (low + floor)[1:] > top[:-1]
        first = np.flatnonzero(new)
        return Spans(cells[first], low[first], np.maximum.reduceat(high, first))


NO_SPANS = Spans(np.zeros(0, dtype=np.int64), np.zeros(0), np.zeros(0))


class Columns(NamedTuple):
    """The solid intervals of every cell, from below; unused entries are empty intervals."""

    low: FloatArray  # [K, X, Y] m, inf where there is none
    high: FloatArray  # [K, X, Y] m, -inf where there is none

    @classmethod
    def of(cls, heights: FloatArray, spans: Spans) -> "Columns":
        """Returns the columns of a height map [X, Y] and of merged spans."""
        cells, bottom, top = spans.merged()
        _, first, counts = np.unique(cells, return_index=True, return_counts=True)
        rank = np.arange(len(cells)) - np.repeat(first, counts)
        size = 1 + int(counts.max(initial=0))
        low, high = np.full((size, heights.size), np.inf), np.full((size, heights.size), -np.inf)
        low[0], high[0] = -np.inf, heights.ravel()
        low[rank + 1, cells], high[rank + 1, cells] = bottom, top
        return cls(low.reshape(size, *heights.shape), high.reshape(size, *heights.shape))

    def solid(self, low: FloatArray, high: FloatArray) -> BoolArray:
        """Returns an array that is true where solid matter is at altitudes low..high.

        Both are [.., X, Y] in m.
        """
        found: BoolArray = np.zeros(np.broadcast_shapes(low.shape, high.shape), dtype=bool)
        for bottom, top in zip(self.low, self.high, strict=True):
            found |= (bottom <= high) & (top >= low)
        return found

    def solid_at(self, x: int, y: int, low: float, high: float) -> bool:
        """Returns True if one cell has solid matter at altitudes low..high (m)."""
        return any(bottom <= high and top >= low for bottom, top in self.at(x, y))

    def at(self, x: int, y: int) -> list[tuple[float, float]]:
        """Returns the solid intervals of one cell; the first is that of the height map."""
        intervals = zip(self.low[:, x, y].tolist(), self.high[:, x, y].tolist(), strict=True)
        return [(low, high) for low, high in intervals if low <= high]


def _thin(corners: FloatArray, axis: int, shape: tuple[int, int], matter: Spans) -> Spans:
    """Returns spans of triangles [M, 3, 3] on an edge between cells, free of matter on both sides.

    A wall that is not thicker than the margin is the surface of a solid, but acts as a plate.
    """
    edge = np.rint(corners[:, 0, axis])
    between = (edge > 0) & (edge < shape[axis])  # robots do not cross the edge of the map
    flat = (np.abs(corners[..., axis] - edge[:, None]) <= MARGIN).all(axis=1)
    on_edge = np.flatnonzero(between & flat)
    if not len(on_edge):
        return NO_SPANS
    held: dict[int, list[tuple[float, float]]] = {}
    for cell, low, high in zip(*(part.tolist() for part in matter), strict=True):
        held.setdefault(cell, []).append((low, high))
    rows: list[tuple[int, float, float]] = []
    margin = np.where(np.arange(2) == axis, -MARGIN, MARGIN)  # both sides, but not beyond its ends
    for which, x, y in _pairs(corners[on_edge], shape, margin):
        triangle = on_edge[which]
        inside, lows, highs = _surface(corners[triangle], x, y, margin)
        other = [x, y]
        other[axis] = 2 * edge[triangle].astype(np.int64) - 1 - other[axis]
        sides = np.column_stack([x * shape[1] + y, other[0] * shape[1] + other[1]])[inside]
        for (lower, beyond), low, high in zip(
            sides.tolist(), lows.tolist(), highs.tolist(), strict=True
        ):
            backs = held.get(lower, []) + held.get(beyond, [])
            if not any(a <= low + MARGIN and b >= high - MARGIN for a, b in backs):
                rows.append((lower, low, high))
    if not rows:
        return NO_SPANS
    cells, low_ends, high_ends = zip(*rows, strict=True)
    return Spans(np.array(cells, dtype=np.int64), np.array(low_ends), np.array(high_ends))


def _pairs(
    corners: FloatArray, shape: tuple[int, int], margin: FloatArray
) -> Iterator[tuple[IntArray, IntArray, IntArray]]:
    """Yields triangles and the cells x, y that their bounding boxes meet, in batches.

    Parameters
    ----------
    corners : [M, 3, 3], x and y in cells
    shape : number of cells along x and y
    margin : [2] cells, the smallest depth to which triangles must reach into a cell along x and y
    """
    last = np.array(shape) - 1
    low, high = corners[..., :2].min(axis=1) + margin, corners[..., :2].max(axis=1) - margin
    # Far outside the grid, numbers of cells may not fit into integers.
    low, high = np.maximum(np.floor(low), 0), np.minimum(np.ceil(high) - 1, last)
    sizes = np.maximum(high - low + 1, 0).astype(np.int64)
    counts = sizes.prod(axis=1)
    if counts.sum() > _MOST_PAIRS:
        raise ProblemError(
            f"meshes: must reach into cells at most {_MOST_PAIRS} times, not {counts.sum()}; "
            "use coarser cells or fewer triangles"
        )
    filled = np.flatnonzero(counts)
    parts = np.cumsum(counts[filled]) // _PAIRS
    for part in np.split(filled, np.flatnonzero(np.diff(parts)) + 1):
        if not len(part):
            continue
        triangle = np.repeat(part, counts[part])
        ends = np.cumsum(counts[part])
        number = np.arange(len(triangle)) - np.repeat(ends - counts[part], counts[part])
        x, y = np.divmod(number, sizes[triangle, 1])
        first = low[triangle].astype(np.int64)
        yield triangle, first[:, 0] + x, first[:, 1] + y


def _surface(
    corners: FloatArray, x: IntArray, y: IntArray, margin: FloatArray
) -> tuple[IntArray, FloatArray, FloatArray]:
    """Returns the numbers of triangles [n, 3, 3] that reach into their cells, and altitudes.

    The altitudes are the lowest and the highest within the cell.
    """
    polygons, alive = corners, np.ones(len(corners), dtype=bool)
    for axis, cell in ((0, x), (1, y)):
        for sign, edge in ((1.0, cell + margin[axis]), (-1.0, cell + 1 - margin[axis])):
            inside = sign * (polygons[..., axis] - edge[:, None])
            alive &= (inside >= 0).any(axis=1)
            polygons = clip(polygons, inside)
    reach = np.flatnonzero(alive)
    z = polygons[reach][..., 2]
    return reach, z.min(axis=1), z.max(axis=1)


def _interior(vertices: FloatArray, triangles: IntArray, shape: tuple[int, int]) -> Spans:
    """Returns the altitudes inside a solid, on the vertical line through one point of each cell.

    If no triangle is in a cell at an altitude, the cell is either wholly inside the solid there or
    wholly outside, so one point decides. `_surface` finds the altitudes with a triangle.
    """
    parts = []
    for triangle, x, y in _pairs(vertices[triangles], shape, np.zeros(2)):
        numbers = triangles[triangle]
        point = np.column_stack([x + PROBE[0], y + PROBE[1]])
        sides = np.column_stack(
            [_left(vertices, numbers[:, k], numbers[:, (k + 1) % 3], point) for k in range(3)]
        )
        up = np.asarray(sides.all(axis=1))
        down = ~np.asarray(sides.any(axis=1))
        hit = np.flatnonzero(up | down)
        altitude = _altitude(vertices[numbers[hit]], point[hit])
        # On the way up, a line enters a solid where its surface faces down.
        step = np.where(down[hit], 1.0, -1.0)
        parts.append(Spans((x * shape[1] + y)[hit], altitude, step))
    cells, altitude, step = Spans.joined(parts)
    order = np.lexsort([altitude, cells])
    cells, altitude = cells[order], altitude[order]
    winding = np.cumsum(step[order])
    # Each column begins outside. If rounding makes it end inside, all of it counts as solid.
    _, first, column = np.unique(cells, return_index=True, return_inverse=True)
    before = np.concatenate([[0.0], winding])[first]
    last = np.concatenate([first[1:], [len(cells)]])[: len(first)] - 1
    leaks = np.not_equal(winding[last], before)
    solid = np.not_equal(winding, before[column]) | leaks[column]
    inside = np.flatnonzero(solid[:-1] & np.equal(cells[:-1], cells[1:]))
    return Spans(cells[inside], altitude[inside], altitude[inside + 1])


def _left(vertices: FloatArray, a: IntArray, b: IntArray, point: FloatArray) -> BoolArray:
    """Returns an array [n], true if points [n, 2] are left of the edges from a to b.

    Two triangles always agree about the edge that they share.

    A point on an edge is moved by an infinitely small step along x, and a much smaller one
    along y.
    """
    first, second = np.minimum(a, b), np.maximum(a, b)
    way = vertices[second, :2] - vertices[first, :2]
    off = point - vertices[first, :2]
    cross = way[:, 0] * off[:, 1] - way[:, 1] * off[:, 0]
    moved = (way[:, 1] < 0) | ((way[:, 1] == 0) & (way[:, 0] > 0))
    left = np.where(cross == 0, moved, cross > 0)
    result: BoolArray = left == (a < b)
    return result


def _altitude(corners: FloatArray, point: FloatArray) -> FloatArray:
    """Returns the altitudes [n] of the planes of triangles [n, 3, 3] above points [n, 2]."""
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    off = point - corners[:, 0, :2]
    det = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
    u = (off[:, 0] * second[:, 1] - off[:, 1] * second[:, 0]) / det
    v = (first[:, 0] * off[:, 1] - first[:, 1] * off[:, 0]) / det
    result: FloatArray = corners[:, 0, 2] + u * first[:, 2] + v * second[:, 2]
    return result
