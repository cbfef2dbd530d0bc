"""Solid matter above every cell of a grid, as intervals of altitude.

The column of a height map is solid from below everything to its top. What a mesh has in the
cell, seen from the side, is one interval more, or several where it overhangs itself.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from cocap_opt.data import BoolArray, FloatArray, IntArray, ProblemError
from cocap_opt.world.polygons import clip

MARGIN = 1e-6  # cells; a solid that reaches less far into a cell only touches it
PAIRS = 200_000  # of triangles and cells at once, to bound the memory
MOST_PAIRS = 10_000_000  # of one mesh
# Where in a cell its inside is looked for; not in the middle, where edges like to be.
PROBE = 0.5137, 0.4789


class Spans(NamedTuple):
    """Intervals of altitude, in any order."""

    cells: IntArray  # [n] x Y + y
    low: FloatArray  # [n] m
    high: FloatArray  # [n] m


NO_SPANS = Spans(np.zeros(0, dtype=np.int64), np.zeros(0), np.zeros(0))


class Columns(NamedTuple):
    """Solid intervals of every cell, one above the other; those that a cell lacks are empty."""

    low: FloatArray  # [K, X, Y] m, inf where there is none
    high: FloatArray  # [K, X, Y] m, -inf where there is none

    def solid(self, low: FloatArray, high: FloatArray) -> BoolArray:
        """Whether there is solid matter at altitudes low..high, both [.., X, Y] in m."""
        found: BoolArray = np.zeros(np.broadcast_shapes(low.shape, high.shape), dtype=bool)
        for bottom, top in zip(self.low, self.high, strict=True):
            found |= (bottom <= high) & (top >= low)
        return found

    def solid_at(self, x: int, y: int, low: float, high: float) -> bool:
        """The same of one cell."""
        return any(bottom <= high and top >= low for bottom, top in self.at(x, y))

    def at(self, x: int, y: int) -> list[tuple[float, float]]:
        """Solid intervals of one cell."""
        intervals = zip(self.low[:, x, y].tolist(), self.high[:, x, y].tolist(), strict=True)
        return [(low, high) for low, high in intervals if low <= high]


def columns_of(heights: FloatArray, spans: Spans) -> Columns:
    """Columns of a height map [X, Y] and of spans; those of a cell that overlap are one."""
    cells, bottom, top = _merged(spans)
    _, first, counts = np.unique(cells, return_index=True, return_counts=True)
    rank = np.arange(len(cells)) - np.repeat(first, counts)
    size = 1 + int(counts.max(initial=0))
    low, high = np.full((size, heights.size), np.inf), np.full((size, heights.size), -np.inf)
    low[0], high[0] = -np.inf, heights.ravel()
    low[rank + 1, cells], high[rank + 1, cells] = bottom, top
    return Columns(low.reshape(size, *heights.shape), high.reshape(size, *heights.shape))


def _merged(spans: Spans) -> Spans:
    """The same matter, spans of a cell that overlap made one; by cell, then from below."""
    if not len(spans.cells):
        return NO_SPANS
    order = np.lexsort([spans.low, spans.cells])
    cells, low, high = spans.cells[order], spans.low[order], spans.high[order]
    new = np.concatenate([[True], cells[1:] != cells[:-1]])
    # Cells are put one above the other, so that one running maximum serves all.
    floor = (np.cumsum(new) - 1) * (high.max() - low.min() + 1) - low.min()
    top = np.maximum.accumulate(high + floor)
    new[1:] |= (low + floor)[1:] > top[:-1]
    first = np.flatnonzero(new)
    return Spans(cells[first], low[first], np.maximum.reduceat(high, first))


def mesh_spans(
    vertices: FloatArray, triangles: IntArray, shape: tuple[int, int], solid: bool
) -> Spans:
    """Altitudes at which a mesh has matter inside a cell.

    Parameters
    ----------
    vertices : [V, 3], x and y in cells, z in m
    triangles : [M, 3] numbers of vertices
    shape : number of cells along x and y
    solid : whether the mesh is the surface of a solid, so that its inside counts as well and
        what merely touches a cell does not; of a thin plate it does, on both sides
    """
    corners, margin = vertices[triangles], np.full(2, MARGIN if solid else -MARGIN)
    parts = [NO_SPANS]
    for triangle, x, y in _pairs(corners, shape, margin):
        inside, low, high = _surface(corners[triangle], x, y, margin)
        parts.append(Spans((x * shape[1] + y)[inside], low, high))
    if not solid:
        return _merged(_joined(parts))
    parts.append(_interior(vertices, triangles, shape))
    matter = _merged(_joined(parts))
    thin = [_thin(corners, axis, shape, matter) for axis in (0, 1)]
    return _merged(_joined([matter, *thin]))


def _joined(parts: list[Spans]) -> Spans:
    return Spans(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def _thin(corners: FloatArray, axis: int, shape: tuple[int, int], matter: Spans) -> Spans:
    """Triangles [M, 3, 3] on an edge between cells with no matter behind them on either side.

    A wall that is no thicker than the margin is the surface of a solid, and a plate in fact.
    """
    edge = np.rint(corners[:, 0, axis])
    between = (edge > 0) & (edge < shape[axis])  # nobody crosses the edge of the map
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
        for (own, beyond), low, high in zip(
            sides.tolist(), lows.tolist(), highs.tolist(), strict=True
        ):
            backs = held.get(own, []) + held.get(beyond, [])
            if not any(a <= low + MARGIN and b >= high - MARGIN for a, b in backs):
                rows.append((own, low, high))
    if not rows:
        return NO_SPANS
    cells, low_ends, high_ends = zip(*rows, strict=True)
    return Spans(np.array(cells, dtype=np.int64), np.array(low_ends), np.array(high_ends))


def _pairs(
    corners: FloatArray, shape: tuple[int, int], margin: FloatArray
) -> Iterator[tuple[IntArray, IntArray, IntArray]]:
    """Triangles and the cells x, y that their bounding boxes meet, some at a time.

    Parameters
    ----------
    margin : [2] cells, by which they must reach into a cell along x and y
    """
    last = np.array(shape) - 1
    low, high = corners[..., :2].min(axis=1) + margin, corners[..., :2].max(axis=1) - margin
    # Far outside the grid numbers of cells may not fit into integers.
    low, high = np.maximum(np.floor(low), 0), np.minimum(np.ceil(high) - 1, last)
    sizes = np.maximum(high - low + 1, 0).astype(np.int64)
    counts = sizes.prod(axis=1)
    if counts.sum() > MOST_PAIRS:
        raise ProblemError(
            f"meshes: must reach into cells at most {MOST_PAIRS} times, not {counts.sum()}; "
            "coarser cells or fewer triangles make it so"
        )
    some = np.flatnonzero(counts)
    parts = np.cumsum(counts[some]) // PAIRS
    for part in np.split(some, np.flatnonzero(np.diff(parts)) + 1):
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
    """Which triangles [n, 3, 3] reach into their cells, and at which altitudes, low and high."""
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
    """Altitudes inside a solid, on the vertical line through one point of each cell.

    Where no triangle is in a cell at some altitude, one point says whether all of it is
    inside; where there is one, `_surface` has it.
    """
    parts = [NO_SPANS]
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
        # Seen from below, a solid is entered where its surface looks down.
        step = np.where(down[hit], 1.0, -1.0)
        parts.append(Spans((x * shape[1] + y)[hit], altitude, step))
    cells, altitude, step = _joined(parts)
    order = np.lexsort([altitude, cells])
    cells, altitude = cells[order], altitude[order]
    winding = np.cumsum(step[order])
    # Each column begins outside. If rounding lets it end inside, all of it counts as solid.
    _, first, column = np.unique(cells, return_index=True, return_inverse=True)
    before = np.concatenate([[0.0], winding])[first]
    last = np.concatenate([first[1:], [len(cells)]])[: len(first)] - 1
    leaks = np.not_equal(winding[last], before)
    solid = np.not_equal(winding, before[column]) | leaks[column]
    inside = np.flatnonzero(solid[:-1] & np.equal(cells[:-1], cells[1:]))
    return Spans(cells[inside], altitude[inside], altitude[inside + 1])


def _left(vertices: FloatArray, a: IntArray, b: IntArray, point: FloatArray) -> BoolArray:
    """Whether points [n, 2] are left of the edges a to b; two triangles agree on their edge.

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
    """Altitude [n] of the planes of triangles [n, 3, 3] above points [n, 2]."""
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    off = point - corners[:, 0, :2]
    det = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
    u = (off[:, 0] * second[:, 1] - off[:, 1] * second[:, 0]) / det
    v = (first[:, 0] * off[:, 1] - first[:, 1] * off[:, 0]) / det
    result: FloatArray = corners[:, 0, 2] + u * first[:, 2] + v * second[:, 2]
    return result
