"""How far one surely sees past the terrain, and how far at most, in every direction.

The directions around the middle of a cell are cut into sectors. Two ranges are known of each:
within the first no ray in the sector meets anything, and at the second every ray in it has met
something. Of an actor wholly within the first all sample points of faces are seen past the
terrain, of one wholly beyond the second none. In between rays have to be cast.
"""

import math
from typing import NamedTuple

import numpy as np

from cocap_opt.data import BoolArray, FloatArray, IntArray
from cocap_opt.workspace import HeightMap

SECTORS = 256
PER_OCTANT = SECTORS // 8  # so that none lies across an axis or a diagonal
MOST_SECTORS = 24  # that an actor may take up; one so near is looked at by rays
SLACK = 1e-9  # cells, sectors; far more than rounding

# Of each octant, counter-clockwise from +x: the axis along which a ray crosses one column of
# cells after the other, and the side to which it leans.
OCTANTS = (
    ((1, 0), (0, 1)), ((0, 1), (1, 0)), ((0, 1), (-1, 0)), ((-1, 0), (0, 1)),
    ((-1, 0), (0, -1)), ((0, -1), (-1, 0)), ((0, -1), (1, 0)), ((1, 0), (0, -1)),
)  # fmt: skip

# Which part of its octant a sector is, counted from the axis, and the parts' edges in rad.
PARTS = np.array([[*range(PER_OCTANT)], [*range(PER_OCTANT)][::-1]] * 4).ravel()
EDGES = np.arange(PER_OCTANT + 1) * (2 * math.pi / SECTORS)
# How much longer a ray is than the columns that it crosses, at least and at most.
LEAST_SLANT, MOST_SLANT = 1 / np.cos(EDGES[PARTS]), 1 / np.cos(EDGES[PARTS + 1])


class Heights(NamedTuple):
    """Heights of the rays' ends."""

    eye: float  # m
    lowest: float  # m, of all that rays are sent to
    highest: float  # m


class Known(NamedTuple):
    """What is known of actors without casting rays; neither where it is not known."""

    hidden: BoolArray  # [n, A] nothing of it is seen
    clear: BoolArray  # [n, A] nothing is in the way to any sample point of it


class Sightlines:
    """Both ranges of all sectors from the middle of every cell, at one height.

    Parameters
    ----------
    margin : m, by which a ray may be off its way
    """

    def __init__(self, height_map: HeightMap, heights: Heights, margin: float) -> None:
        tops, self._shape = height_map.heights, height_map.shape
        self._resolution, self._margin = height_map.resolution, margin
        # Across a way along a diagonal a ray may be off by more along the row.
        self._slack = math.sqrt(2) * margin / height_map.resolution + SLACK  # cells
        # A border wider than rays are long makes each step along a ray one flat shift. The
        # outside surely neither lets a ray pass nor stops it.
        self._n_columns = max(self._shape) + 1
        border = ((self._n_columns + 1,) * 2, (0, self._n_columns))
        low = tops <= min(heights.eye, heights.lowest) - margin
        high = tops >= max(heights.eye, heights.highest) + margin
        self._low = np.pad(low, border).ravel()
        self._not_high = np.pad(~high, border, constant_values=True).ravel()
        self._row = self._shape[1] + self._n_columns
        self._in_the_air = (tops <= heights.eye - margin).ravel()
        kind = np.uint8 if self._n_columns < np.iinfo(np.uint8).max else np.uint16
        self._endless = int(np.iinfo(kind).max)
        # Of each sector and cell, how many columns are surely free, the cell's own included,
        # and how many beyond it some ray may get past.
        self._free = np.zeros((SECTORS, tops.size), dtype=kind)
        self._passed = np.full((SECTORS, tops.size), self._endless, dtype=kind)
        self._n_done = 0

    @property
    def whole(self) -> bool:
        """Whether all sectors have been looked into."""
        return self._n_done == SECTORS

    def look(self, sectors: int) -> None:
        """Look into some more sectors, from all cells at once."""
        for sector in range(self._n_done, min(self._n_done + sectors, SECTORS)):
            self._look(sector)
            self._n_done = sector + 1

    def _look(self, sector: int) -> None:
        low, high = np.tan(EDGES[PARTS[sector] :][:2]).tolist()
        n = self._shape[0] * self._row
        is_free, passes = np.ones((2, n), dtype=bool)
        free, passed = np.zeros((2, n), dtype=self._free.dtype)
        for k in range(self._n_columns):
            for row in self._rows(low * max(k - 0.5, 0.0), high * (k + 0.5)):
                is_free &= self._shifted(self._low, sector, k, row)
            free += is_free
            if not k:
                continue
            # In one of these cells each ray crosses the middle of the column.
            middle = [
                self._shifted(self._not_high, sector, k, row)
                for row in self._rows(low * k, high * k)
            ]
            passes &= np.logical_or.reduce(middle)
            passed += passes
        passed[passes] = self._endless
        self._free[sector] = self._inside(free)
        # From inside the ground a ray may go on inside it.
        self._passed[sector] = np.where(self._in_the_air, self._inside(passed), self._endless)

    def _rows(self, low: float, high: float) -> range:
        """Rows of cells which a line across a column touches, from `low` to `high` aside."""
        first = math.floor(low + 0.5 - self._slack)
        return range(first, math.floor(high + 0.5 + self._slack) + 1)

    def _shifted(self, cells: BoolArray, sector: int, k: int, row: int) -> BoolArray:
        """What is k columns further along the rays, and so many rows aside, from all cells."""
        along, aside = (x * self._row + y for x, y in OCTANTS[sector // PER_OCTANT])
        first = (self._n_columns + 1) * self._row + k * along + row * aside
        return cells[first : first + self._shape[0] * self._row]

    def _inside(self, values: IntArray) -> IntArray:
        """Values of the cells that are on the map."""
        return values.reshape(-1, self._row)[:, : self._shape[1]].ravel()

    def known(self, cells: IntArray, ways: FloatArray, radii: FloatArray) -> Known:
        """What the terrain surely does, all sectors having been looked into.

        Parameters
        ----------
        cells : [n] numbers x Y + y of cells, from the middle of which one looks
        ways : [n, A, 2] m, from there to the actors' middles
        radii : [A] m, of the circles in which the actors are
        """
        distance = np.sqrt(ways[..., 0] ** 2 + ways[..., 1] ** 2)
        radius = radii + self._margin
        apart = distance > 1.01 * radius
        half = np.arcsin(radius / np.where(apart, distance, 2 * radius))
        angle, unit = np.arctan2(ways[..., 1], ways[..., 0]), SECTORS / (2 * math.pi)
        first = np.floor((angle - half) * unit - SLACK).astype(np.int64)
        more = np.floor((angle + half) * unit + SLACK).astype(np.int64) - first
        known = apart & (more < MOST_SECTORS)
        more = np.where(known, more, 0)
        width = int(more.max(initial=0)) + 1
        sectors = (first[..., None] + np.minimum(np.arange(width), more[..., None])) % SECTORS
        at = sectors, cells[:, None, None]
        passed = self._passed[at]
        free = ((self._free[at] - 0.5) * LEAST_SLANT[sectors]).min(axis=-1) * self._resolution
        met = ((passed + 1.0) * MOST_SLANT[sectors]).max(axis=-1) * self._resolution
        all_meet = passed.max(axis=-1) < self._endless
        return Known(
            hidden=known & all_meet & (met < distance - radius),
            clear=known & (free > distance + radius),
        )
