"""What the readers of rasters share: axes, windows, and cells that hold no height.

Rows are [Y, X] with the northernmost first, as files hold them, until `finished` turns them.
"""

import math
from typing import NamedTuple

import numpy as np

from cocap_opt.data import LARGEST, FloatArray, ProblemError

MOST_READ = 200_000_000  # cells, 1.6 GB: a small compressed file can spell far more
LEAST_CELL = 0.01  # m; an edge of 10 to 30 arc seconds, taken for metres, is smaller
LOWEST, HIGHEST = -500.0, 9000.0  # m; all land on Earth lies between -430 and 8849
SLIVER = 1e-6  # cells; less than what rounding of large coordinates leaves

Window = tuple[float, float, float, float]  # m: x0, y0, x1, y1


class Raster(NamedTuple):
    """Heights on a grid of rectangular cells; cell (i, j) covers what `HeightMap` says."""

    values: FloatArray  # [X, Y] m, x east and y north; nan where there is no data
    cell: tuple[float, float]  # m, edges of a cell along x and y
    origin: tuple[float, float]  # m, lower left corner


class Axis(NamedTuple):
    """Cells along x or y, numbered from the west or the south."""

    lower: float  # m
    cell: float  # m, edge
    cells: int

    @property
    def upper(self) -> float:
        """End of the last cell, m."""
        return self.lower + self.cell * self.cells

    def met(self, low: float, high: float) -> range:
        """Cells that the interval [low, high] (m) overlaps by more than a sliver."""
        start = math.floor((low - self.lower) / self.cell + SLIVER)
        stop = math.ceil((high - self.lower) / self.cell - SLIVER)
        return range(min(max(start, 0), self.cells), min(max(stop, 0), self.cells))

    def cut(self, cells: range) -> "Axis":
        """The same axis with only these cells."""
        return Axis(self.lower + cells.start * self.cell, self.cell, len(cells))

    def middle(self, cell: int) -> float:
        """Coordinate (m) of the middle of a cell."""
        return self.lower + (cell + 0.5) * self.cell


def cells_met(x: Axis, y: Axis, window: Window | None) -> tuple[range, range]:
    """Cells along x and along y that a reader must read.

    Raises
    ------
    ProblemError
        If the axes are out of range, the window is no rectangle or misses the raster, or the
        cells are more than can be read.
    """
    for axis in (x, y):
        _require(axis.cell >= LEAST_CELL, f"cell: must be >= {LEAST_CELL} m, not {axis.cell:.9g}")
        inside = -LARGEST <= axis.lower <= axis.upper <= LARGEST
        _require(inside, f"origin: must lie, as all of the raster, within +-{LARGEST:g} m")
    columns, rows = range(x.cells), range(y.cells)
    if window is not None:
        _refuse_no_rectangle(window)
        columns, rows = x.met(window[0], window[2]), y.met(window[1], window[3])
        _require(
            len(columns) > 0 and len(rows) > 0,
            f"window: must meet the raster, which covers x {x.lower:.3f}..{x.upper:.3f} and "
            f"y {y.lower:.3f}..{y.upper:.3f} m",
        )
    _require(
        len(columns) * len(rows) <= MOST_READ,
        f"window: must hold at most {MOST_READ} cells, not {len(columns)} x {len(rows)}",
    )
    return columns, rows


def mark_holes(rows: FloatArray, nodata: float | None) -> None:
    """Make cells nan that hold the value `nodata`, as far as single precision tells them apart.

    Files often spell a single precision limit such as -3.4e38 with a few digits only.
    """
    if nodata is not None:
        with np.errstate(over="ignore"):
            rows[rows.astype(np.float32) == np.float32(nodata)] = np.nan


def finished(
    rows: FloatArray, x: Axis, y: Axis, *, scale: float = 1.0, offset: float = 0.0
) -> Raster:
    """Raster of rows of stored values; a height is `scale * value + offset`.

    Takes `rows` over. Raises `ProblemError` if a height is no height of land.
    """
    _require(
        math.isfinite(scale) and scale != 0 and math.isfinite(offset),
        f"scale and offset: must be finite and the scale not 0, not {scale:g} and {offset:g}",
    )
    _refuse_sentinels(rows, x, y, scale, offset)
    if (scale, offset) != (1.0, 0.0):
        rows *= scale
        rows += offset
    values = rows[::-1].T
    values.flags.writeable = False
    return Raster(values, (x.cell, y.cell), (x.lower, y.lower))


def _require(condition: bool, message: str) -> None:
    if not condition:
        raise ProblemError(message)


def _refuse_no_rectangle(window: Window) -> None:
    x0, y0, x1, y1 = window
    finite = all(map(math.isfinite, window))
    _require(
        finite and x0 < x1 and y0 < y1,
        f"window: must be x0, y0, x1, y1 in metres with x0 < x1 and y0 < y1, not {window}",
    )


def _refuse_sentinels(rows: FloatArray, x: Axis, y: Axis, scale: float, offset: float) -> None:
    """Refuse values that only mean that there is no data, though the file does not say so."""
    least, most = sorted((limit - offset) / scale for limit in (LOWEST, HIGHEST))
    low, high = np.fmin.reduce(rows, axis=None), np.fmax.reduce(rows, axis=None)
    if not (low < least or high > most):  # nan where all is a hole
        return
    value = f"{low if low < least else high:.9g}"
    row, column = np.unravel_index(np.argmax((rows < least) | (rows > most)), rows.shape)
    place = f"({x.middle(int(column)):.3f}, {y.middle(len(rows) - 1 - int(row)):.3f})"
    raise ProblemError(
        f"heights: must lie within {LOWEST:g}..{HIGHEST:g} m, but the raster holds {value}, and "
        f"the first such cell is at {place} m; nodata={value} says that it means no data"
    )
