"""Rasters of heights: axes, windows and missing heights, and the square cells of a problem.

Readers return rows [Y, X] with the northernmost first, the order of files; `Layout.raster` turns
them. The height of a cell of a `Grid` is the highest of the source cells that it overlaps, or their
level: the mean of finer cells, and an interpolation between coarser ones.
"""

import math
from collections.abc import Callable, Iterable
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from cocap_opt.data import LARGEST, SMALLEST, FloatArray, ProblemError
from cocap_opt.text import plain

MOST_READ = 200_000_000  # cells, 1.6 GB: a small compressed file can expand to far more
LEAST_CELL = 0.01  # m; an edge of 10 to 30 arc seconds, read as metres, is smaller
LOWEST, HIGHEST = -500.0, 9000.0  # m; all land on Earth lies between -430 and 8849
# Usual codes for no data; in centimetres or millimetres, they would be heights of land. They are
# apart from all other stored values; the ends of a range into which heights are packed are not.
_LOW_CODES, _HIGH_CODES = (-999, -9999, -32767, -32768, -99999), (9999, 32767, 65535)
_APART = 50
SLIVER = 1e-6  # cells; smaller overlaps are rounding errors of large coordinates
TINY_CELL, TINY_MAP = 0.05, 10.0  # m; such small maps are probably in degrees
MOST_CELLS = 1_000_000  # cells of a grid; coverage of larger grids cannot be computed
SQUARE = 0.1  # cells; greatest deviation from square cells over the whole length of a raster
ROUNDING = 1e-9  # relative; edges that differ by less are the same

How = Literal["highest", "level"]
Window = tuple[float, float, float, float]  # m: x0, y0, x1, y1


class Raster(NamedTuple):
    """Heights on a grid of rectangular cells, numbered as the cells of a `HeightMap`."""

    values: FloatArray  # [X, Y] m, x east and y north; nan where there is no data
    cell: tuple[float, float]  # m, edges of a cell along x and y
    origin: tuple[float, float]  # m, lower left corner
    crs: str | None = None  # reference system that the file states, as a code or WKT

    def level_in(self, other: "Raster") -> FloatArray:
        """Returns the heights [X, Y] (m) that bare terrain has in the cells of another raster.

        They are the means of finer cells, weighted by the area of the overlap, and interpolated
        linearly between the middles of coarser ones. The height is nan outside and in holes.
        """
        values = self.values
        for axis in (0, 1):
            size = other.cell[axis] / self.cell[axis]
            first = (other.origin[axis] - self.origin[axis]) / self.cell[axis]
            edges = _snapped(first + size * np.arange(other.values.shape[axis] + 1))
            values = _level(values, np.clip(edges, 0, len(values))).T
        return values

    def sample(self, x: ArrayLike, y: ArrayLike) -> FloatArray:
        """Returns the heights (m) of the cells that contain the points (x, y) in m.

        The height is nan outside and in holes. A cell contains its lower edges, but not its upper
        ones, as in `HeightMap.cell_of`. The arrays may have any shapes that broadcast.
        """
        with np.errstate(invalid="ignore"):  # inf and nan lie outside
            i = np.floor((np.asarray(x, dtype=float) - self.origin[0]) / self.cell[0])
            j = np.floor((np.asarray(y, dtype=float) - self.origin[1]) / self.cell[1])
        i, j = np.broadcast_arrays(i, j)
        width, height = self.values.shape
        inside = (i >= 0) & (i < width) & (j >= 0) & (j < height)
        heights = np.full(inside.shape, np.nan)
        heights[inside] = self.values[i[inside].astype(int), j[inside].astype(int)]
        return heights


class Layout(NamedTuple):
    """The cells of a raster along both axes, numbered from the south-west; pairs are x, y."""

    lower: tuple[float, float]  # m, lower left corner
    cell: tuple[float, float]  # m, edges of a cell
    cells: tuple[int, int]

    @property
    def upper(self) -> tuple[float, float]:
        """Upper right corner, m."""
        return self._edge(0, self.cells[0]), self._edge(1, self.cells[1])

    def met(self, window: Window | None) -> tuple[range, range]:
        """Returns the cells along x and along y that a window overlaps, or all without a window.

        Raises
        ------
        ProblemError
            If the axes are out of range, the window is not a rectangle or misses the raster, or
            there are too many cells.
        """
        self._require_room()
        columns, rows = range(self.cells[0]), range(self.cells[1])
        if window is not None:
            _require_rectangle(window)
            columns, rows = self._met(0, window[0::2]), self._met(1, window[1::2])
            (low_x, low_y), (high_x, high_y) = self.lower, self.upper
            _require(
                len(columns) > 0 and len(rows) > 0,
                f"window: must overlap the raster, which covers x {low_x:.3f}..{high_x:.3f} and "
                f"y {low_y:.3f}..{high_y:.3f} m",
            )
        _require(
            len(columns) * len(rows) <= MOST_READ,
            f"window: must contain at most {MOST_READ} cells, not {len(columns)} x {len(rows)}",
        )
        return columns, rows

    def refuse_degrees(self, way_out: str) -> None:
        """Raises a ProblemError if the cells are tiny and the coordinates could be degrees.

        Parameters
        ----------
        way_out : advice in case the coordinates are metres after all
        """
        low, high = np.array(self.lower), np.array(self.upper)
        on_globe = bool((low >= (-180, -90)).all() and (high <= (180, 90)).all())
        if on_globe and max(self.cell) < TINY_CELL and (high - low).max() < TINY_MAP:
            (x, y), (upper_x, upper_y) = self.lower, self.upper
            raise ProblemError(
                f"coordinates: must be metres of a projection, but cells of {max(self.cell):.6g} "
                f"at x {x:.6g}..{upper_x:.6g} and y {y:.6g}..{upper_y:.6g} look like degrees; "
                "convert the map with gdalwarp -s_srs EPSG:4326 -t_srs EPSG:326ZZ, where ZZ is the "
                f"UTM zone; if they are metres, {way_out}"
            )

    def cut(self, columns: range, rows: range) -> "Layout":
        """Returns the layout of only the given cells along x and along y."""
        corner = self._edge(0, columns.start), self._edge(1, rows.start)
        return Layout(corner, self.cell, (len(columns), len(rows)))

    def raster(
        self,
        rows: FloatArray,
        nodata: Iterable[float | None],
        *,
        scale: float = 1.0,
        offset: float = 0.0,
    ) -> Raster:
        """Returns the raster of these cells from rows of stored values, which are overwritten.

        Parameters
        ----------
        rows
            Stored values [Y, X], the northernmost row first; nan where there is no data.
        nodata
            Stored values that mean that there is no data.
        scale, offset
            A height (m) is `scale * value + offset`.

        Raises
        ------
        ProblemError
            If the scale is not usable, or a height is outside the range of all land.
        """
        for value in nodata:
            _mark_holes(rows, value)
        _require(
            math.isfinite(scale) and scale != 0 and math.isfinite(offset),
            f"scale and offset: must be finite and the scale not 0, not {scale:g} and {offset:g}",
        )
        self._require_land(rows, scale, offset)
        if (scale, offset) != (1.0, 0.0):
            rows *= scale
            rows += offset
        values = rows[::-1].T
        values.flags.writeable = False
        return Raster(values, self.cell, self.lower)

    def _edge(self, axis: int, cell: int) -> float:
        """Returns the coordinate (m) of the lower edge of a cell."""
        return self.lower[axis] + cell * self.cell[axis]

    def _met(self, axis: int, ends: tuple[float, ...]) -> range:
        """Returns the cells that an interval (m) overlaps by more than a sliver."""
        low, high = ((end - self.lower[axis]) / self.cell[axis] for end in ends)
        start, stop = math.floor(low + SLIVER), math.ceil(high - SLIVER)
        cells = self.cells[axis]
        return range(min(max(start, 0), cells), min(max(stop, 0), cells))

    def _require_room(self) -> None:
        for lower, upper, cell in zip(self.lower, self.upper, self.cell, strict=True):
            _require(cell >= LEAST_CELL, f"cell: must be >= {LEAST_CELL} m, not {cell:.9g}")
            inside = -LARGEST <= lower <= upper <= LARGEST
            _require(inside, f"origin: all of the raster must lie within +-{plain(LARGEST)} m")

    def _require_land(self, rows: FloatArray, scale: float, offset: float) -> None:
        """Raises a ProblemError if values can only be an unstated mark of missing data.

        Codes are looked for among the stored values, since -9999 cm would be land at -99.99 m.
        """
        least, most = sorted((limit - offset) / scale for limit in (LOWEST, HIGHEST))
        low, high = np.fmin.reduce(rows, axis=None), np.fmax.reduce(rows, axis=None)
        is_out = low < least or high > most  # false for nan, if all cells are holes
        is_low, is_high = (
            (low < least, high > most)
            if is_out
            else (_is_code(low, rows, _LOW_CODES), _is_code(high, rows, _HIGH_CODES))
        )
        if not (is_low or is_high):
            return
        wrong = low if is_low else high
        value = f"{wrong:.9g}"
        marked = (rows < least) | (rows > most) if is_out else rows == wrong
        row, column = np.unravel_index(np.argmax(marked), rows.shape)
        cells = int(column), len(rows) - 1 - int(row)
        x, y = (a + (k + 0.5) * d for a, k, d in zip(self.lower, cells, self.cell, strict=True))
        if is_out:
            land, way_out = "", "" if is_low else ", or unit if heights are not in metres"
        else:
            land = " and not be a usual code for no data"
            way_out = "; if it is a height, convert the map to metres"
        raise ProblemError(
            f"heights: must lie within {LOWEST:g}..{HIGHEST:g} m{land}, but the raster contains "
            f"{value}, and the first such cell is at ({x:.3f}, {y:.3f}) m; set nodata={value} if "
            f"it means no data{way_out}"
        )


def _is_code(end: float, rows: FloatArray, codes: tuple[int, ...]) -> bool:
    """Returns True if the lowest or highest stored value can only be a code for no data."""
    if end not in codes:
        return False
    gaps = np.abs(rows[~np.isin(rows, codes)] - end)
    return bool(np.fmin.reduce(gaps, axis=None, initial=np.inf) > _APART)


def _mark_holes(rows: FloatArray, nodata: float | None) -> None:
    """Sets cells with the value `nodata` to nan, compared in single precision.

    Files often write only a few digits of a single-precision limit such as -3.4e38.
    """
    if nodata is not None:
        with np.errstate(over="ignore"):
            rows[rows.astype(np.float32) == np.float32(nodata)] = np.nan


def _require(condition: bool, message: str) -> None:
    if not condition:
        raise ProblemError(message)


def _require_rectangle(window: Window) -> None:
    x0, y0, x1, y1 = window
    finite = all(map(math.isfinite, window))
    _require(
        finite and x0 < x1 and y0 < y1,
        f"window: must be x0, y0, x1, y1 in metres with x0 < x1 and y0 < y1, not {window}",
    )


# -- square cells: rows are reduced before columns, because both reductions are separable


class Grid(NamedTuple):
    """Heights on square cells, as in `HeightMap`, but with holes."""

    values: FloatArray  # [X, Y] m; nan where there is no data
    origin: tuple[float, float]  # m, lower left corner
    resolution: float  # m, edge of a cell

    @classmethod
    def of(cls, raster: Raster, resolution: float | None = None, how: How = "highest") -> "Grid":
        """Returns the raster on square cells, beginning at its lower left corner.

        The last cells may extend beyond the raster's edge by less than a cell; they have the
        heights that they overlap. A cell that overlaps a hole is a hole.

        Parameters
        ----------
        raster
            The raster.
        resolution
            Edge of a cell, m. None keeps the raster's own cells if they are square to within a
            tenth of a cell over the whole raster (the edge is then the mean of their edges);
            otherwise, it is the smaller of their edges.
        how
            "highest": no obstacle is lost, and obstacles grow by up to a cell. "level": the mean of
            finer cells, weighted by the area of the overlap, or interpolated between coarser ones.

        Raises
        ------
        ProblemError
            If the resolution is out of range, or the grid would have more than a million cells.
        """
        (dx, dy), (width, height) = raster.cell, raster.values.shape
        if resolution is None and _nearly_square(raster):
            dx = dy = resolution = (dx + dy) / 2
        resolution = min(dx, dy) if resolution is None else resolution
        if not SMALLEST <= resolution <= LARGEST:  # false for nan too
            raise ProblemError(
                f"resolution: must be within {SMALLEST:g}..{plain(LARGEST)} m, not {resolution:g}"
            )
        refuse_too_many("grid", "window", width * dx, height * dy, resolution)
        reduce = _REDUCTIONS[how]
        along_y = reduce(raster.values.T, _edges(height, resolution / dy))
        values = reduce(along_y.T, _edges(width, resolution / dx))
        return cls(values, raster.origin, resolution)

    def filled(
        self, fill: float | None, field: str, way_out: str = "set fill to the height to use there"
    ) -> FloatArray:
        """Returns the heights [X, Y], with `fill` (m) in the holes.

        Parameters
        ----------
        way_out : advice if there are holes and `fill` is None

        Raises
        ------
        ProblemError
            If there are holes and `fill` is None or not finite; the message starts with `field`.
        """
        holes = np.isnan(self.values)
        if not holes.any():
            return self.values
        if fill is None:
            i, j = np.argwhere(holes)[0].tolist()
            x, y = (
                o + (k + 0.5) * self.resolution for o, k in zip(self.origin, (i, j), strict=True)
            )
            raise ProblemError(
                f"{field}: must have a height everywhere, but {holes.sum()} of {holes.size} cells "
                f"have no data, the first at ({x:.3f}, {y:.3f}) m; {way_out}"
            )
        if not math.isfinite(fill):
            raise ProblemError(f"fill: must be finite, not {fill}")
        return np.where(holes, fill, self.values)


def _nearly_square(raster: Raster) -> bool:
    dx, dy = raster.cell
    longest = max(len(raster.values), len(raster.values.T))
    return abs(dx - dy) * longest <= SQUARE * min(dx, dy)


def refuse_too_many(field: str, name: str, width: float, height: float, resolution: float) -> None:
    """Raises a ProblemError if an area of width x height m has more cells than allowed.

    Parameters
    ----------
    field : that determines the area, for the message
    name : of the quantity that reduces the number of cells
    """
    x, y = (math.ceil(length / resolution * (1 - ROUNDING)) for length in (width, height))
    if x * y > MOST_CELLS:
        # The r where (width / r + 1) (height / r + 1) = MOST_CELLS, rounded up for three digits.
        half, more = (width + height) / 2, MOST_CELLS - 1
        enough = 1.005 * (half + math.sqrt(half**2 + more * width * height)) / more
        edge = math.isqrt(MOST_CELLS) * resolution
        raise ProblemError(
            f"{field}: must have at most {MOST_CELLS} cells, not {x} x {y} of {resolution:.6g} m; "
            f"use a smaller {name}, such as {edge:.6g} x {edge:.6g} m, or a resolution of "
            f"{enough:.3g} m"
        )


def _edges(cells: int, ratio: float) -> FloatArray:
    """Returns the edges of the target cells that begin before the end of `cells` source cells.

    Edges are counted in source cells and cut off at the end; `ratio` is the length of a target
    cell in source cells. An edge that is a whole number up to rounding becomes that number, so
    that no cell overlaps a sliver of its neighbour.
    """
    edges = _snapped(ratio * np.arange(math.ceil(cells / ratio) + 2.0))
    begun = int(np.searchsorted(edges, cells))
    clipped: FloatArray = np.minimum(edges[: begun + 1], cells)
    return clipped


def _snapped(edges: FloatArray) -> FloatArray:
    """Returns edges, those that are whole numbers up to rounding as these numbers."""
    whole = np.rint(edges)
    same = np.abs(edges - whole) <= ROUNDING * np.maximum(np.abs(edges), 1)
    snapped: FloatArray = np.where(same, whole, edges)
    return snapped


def _highest(values: FloatArray, edges: FloatArray) -> FloatArray:
    first, last = np.floor(edges[:-1]).astype(int), np.ceil(edges[1:]).astype(int) - 1
    highest: FloatArray = values[first]
    for k in range(1, np.max(last - first) + 1):
        np.maximum(highest, values[np.minimum(first + k, last)], out=highest)
    return highest


def _level(values: FloatArray, edges: FloatArray) -> FloatArray:
    """Returns the means of finer cells, or heights between the middles of coarser ones; nan for
    cells of no width.
    """
    widths = np.diff(edges)
    is_finer = widths.max() >= 1 - ROUNDING
    found = _mean(values, edges) if is_finer else _between(values, (edges[:-1] + edges[1:]) / 2)
    found[widths <= SLIVER] = np.nan
    return found


def _between(values: FloatArray, at: FloatArray) -> FloatArray:
    """Returns values between the middles of cells; beyond the first and last, theirs.

    Parameters
    ----------
    at : positions, counted in cells from the lower edge of the first
    """
    at = (at - 0.5).clip(0, len(values) - 1)
    low = np.floor(at + SLIVER).astype(int)
    share = np.maximum(at - low, 0)[:, None]
    high = np.minimum(low + 1, len(values) - 1)
    between = (1 - share) * values[low] + share * values[high]
    # the next one may be nan
    found: FloatArray = np.where(share <= SLIVER, values[low], between)
    return found


def _mean(values: FloatArray, edges: FloatArray) -> FloatArray:
    first = np.minimum(np.floor(edges[:-1]).astype(int), len(values) - 1)
    last = np.maximum(np.ceil(edges[1:]).astype(int) - 1, first)
    mean = np.zeros((len(first), values.shape[1]))
    for k in range(np.max(last - first) + 1):
        overlap = np.minimum(edges[1:], first + k + 1) - np.maximum(edges[:-1], first + k)
        share = np.maximum(overlap, 0) / np.maximum(np.diff(edges), SLIVER)
        mean += share[:, None] * values[np.minimum(first + k, last)]
    return mean


# Functions of values along the first axis and of edges of target cells: a value per target cell.
_REDUCTIONS: dict[How, Callable[[FloatArray, FloatArray], FloatArray]] = {
    "highest": _highest,
    "level": _level,
}
