"""The surface of a map as few rectangles: adjacent cells of equal height are merged, and so are
walls.
"""

from typing import NamedTuple

import numpy as np

from cocap_opt.data import BoolArray, FloatArray, IntArray
from cocap_opt.world import HeightMap

MOST_RECTANGLES = 150_000  # rectangles of 72 bytes each
_FINER = 16  # factor by which the map is finer in the relevant part


class Relief(NamedTuple):
    """The surface of a map: level cells, and walls where two of them differ in height.

    Attributes
    ----------
    ground, obstacles : [n, 4, 3] m, corners of rectangles from the corner of the map; obstacles
        are the cells above the ground
    fine, coarse : edge of a drawn cell, in cells of the map, in the relevant part and elsewhere; it
        is as high as its highest cell
    """

    ground: FloatArray
    obstacles: FloatArray
    fine: int
    coarse: int

    @classmethod
    def of(
        cls, height_map: HeightMap, heights: tuple[float, float], part: tuple[IntArray, IntArray]
    ) -> "Relief":
        """Returns the surface of a map, with drawn cells as small as the number of rectangles
        allows.

        Parameters
        ----------
        heights : m, the altitudes between which it is shown
        part : the first cells along x and y of the part that matters, and the cells after its last
        """
        shown, stands = np.clip(height_map.heights, *heights), height_map.stands_out
        coarse = 1
        while True:
            fine = max(1, coarse // _FINER)
            starts = [
                _starts(count, int(first), int(last), fine, coarse)
                for count, first, last in zip(height_map.shape, *part, strict=True)
            ]
            parts = _Grid.of(shown, stands, height_map.resolution, starts).rectangles()
            if sum(map(len, parts)) <= MOST_RECTANGLES:
                return cls(*parts, fine, coarse)
            coarse *= 2


def _starts(count: int, first: int, last: int, fine: int, coarse: int) -> IntArray:
    """Returns where cells begin as they are drawn, of so many cells of the map."""
    parts = [
        np.arange(0, first, coarse), np.arange(first, last, fine),
        np.arange(last, count, coarse),
    ]  # fmt: skip
    return np.concatenate(parts)


class _Grid(NamedTuple):
    """The cells of a map as they are drawn."""

    heights: FloatArray  # [X, Y] m
    stands: BoolArray  # [X, Y]
    x: FloatArray  # [X+1] m
    y: FloatArray  # [Y+1] m

    @classmethod
    def of(
        cls, heights: FloatArray, stands: BoolArray, size: float, starts: list[IntArray]
    ) -> "_Grid":
        x, y = (
            np.append(cells, count) * size
            for cells, count in zip(starts, heights.shape, strict=True)
        )
        for axis, cells in enumerate(starts):
            heights = np.maximum.reduceat(heights, cells, axis=axis)
            stands = np.logical_or.reduceat(stands, cells, axis=axis)
        return cls(heights, stands, x, y)

    def rectangles(self) -> tuple[FloatArray, FloatArray]:
        """Returns the rectangles of the ground and of what stands on it."""
        found = [self._tops(), self._walls(), self._turned()._walls(turned=True)]
        ground = [quads[~stands] for quads, stands in found]
        obstacles = [quads[stands] for quads, stands in found]
        return np.concatenate(ground), np.concatenate(obstacles)

    def _turned(self) -> "_Grid":
        """Returns the grid with its axes exchanged."""
        return _Grid(self.heights.T, self.stands.T, self.y, self.x)

    def _tops(self) -> tuple[FloatArray, BoolArray]:
        _, numbers = np.unique(self.heights, return_inverse=True)
        i0, i1, j0, j1 = _blocks(2 * numbers.reshape(self.heights.shape) + self.stands)
        x0, x1, y0, y1 = self.x[i0], self.x[i1], self.y[j0], self.y[j1]
        z = self.heights[i0, j0]
        corners = [(x0, y0), (x1, y0), (x1, y1), (x0, y1)]
        return _quads([(x, y, z) for x, y in corners]), self.stands[i0, j0]

    def _walls(self, turned: bool = False) -> tuple[FloatArray, BoolArray]:
        """Returns the walls across x; the surroundings are as low as the lowest cell."""
        frame = np.pad(self.heights, ((1, 1), (0, 0)), constant_values=self.heights.min())
        stood = np.pad(self.stands, ((1, 1), (0, 0)))
        below, above = np.minimum(frame[:-1], frame[1:]), np.maximum(frame[:-1], frame[1:])
        stands = np.where(frame[1:] > frame[:-1], stood[1:], stood[:-1])
        _, low = np.unique(below, return_inverse=True)
        _, high = np.unique(above, return_inverse=True)
        pairs = (low * (high.max() + 1) + high).reshape(below.shape)
        pairs = np.where(below < above, 2 * pairs + stands, -1)
        i, j0, j1 = _runs(pairs)
        x, y0, y1, z0, z1 = self.x[i], self.y[j0], self.y[j1], below[i, j0], above[i, j0]
        corners = [(x, y0, z0), (x, y1, z0), (x, y1, z1), (x, y0, z1)]
        if turned:
            corners = [(y, x, z) for x, y, z in corners]
        return _quads(corners), stands[i, j0]


def _runs(values: IntArray) -> tuple[IntArray, IntArray, IntArray]:
    """Returns rows i, and columns from j0 to before j1, in which values [X, Y] are alike.

    Negative values are left out.
    """
    new = np.ones(values.shape, dtype=np.bool_)
    new[:, 1:] = values[:, 1:] != values[:, :-1]
    first = np.flatnonzero(new)
    last = np.append(first[1:], values.size)
    kept = values.ravel()[first] >= 0
    i, j0 = np.divmod(first[kept], values.shape[1])
    return i, j0, j0 + (last - first)[kept]


def _blocks(values: IntArray) -> tuple[IntArray, IntArray, IntArray, IntArray]:
    """Returns rectangles i0, i1, j0, j1 of alike values [X, Y]: alike runs of successive rows."""
    i, j0, j1 = _runs(values)
    kind = values[i, j0]
    order = np.lexsort((i, kind, j1, j0))
    i, j0, j1, kind = i[order], j0[order], j1[order], kind[order]
    new = np.ones(len(i), dtype=np.bool_)
    same = (np.diff(j0) == 0) & (np.diff(j1) == 0) & (np.diff(kind) == 0)
    new[1:] = ~(same & (np.diff(i) == 1))
    first = np.flatnonzero(new)
    last = np.append(first[1:], len(i)) - 1
    return i[first], i[last] + 1, j0[first], j1[first]


def _quads(corners: list[tuple[FloatArray, FloatArray, FloatArray]]) -> FloatArray:
    return np.stack([np.column_stack(corner) for corner in corners], axis=1)
