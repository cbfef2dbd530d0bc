"""Rasters brought to the square cells of a planning problem.

A target cell takes the highest or the mean height of the source cells that it overlaps. Both
separate along the axes, so that rows are reduced first, and then columns.
"""

import math
from collections.abc import Callable
from typing import Literal, NamedTuple

import numpy as np

from cocap_opt.data import LARGEST, SMALLEST, FloatArray, ProblemError
from cocap_opt.scenarios.maps.raster import Raster

MOST_CELLS = 1_000_000  # of a grid; coverage of more cannot be computed
SQUARE = 0.1  # cells by which a raster of nearly square cells may be off over its whole length
ROUNDING = 1e-9  # relative: edges that agree so well are the same

How = Literal["highest", "mean"]


class Grid(NamedTuple):
    """Heights on square cells, as in `HeightMap`, but with holes."""

    values: FloatArray  # [X, Y] m; nan where there is no data
    origin: tuple[float, float]  # m, lower left corner
    resolution: float  # m, edge of a cell

    @classmethod
    def of(cls, raster: Raster, resolution: float | None = None, how: How = "highest") -> "Grid":
        """Returns the raster on square cells, from its lower left corner on.

        The last cells may reach over the raster's edge by less than a cell; they take the heights
        that they overlap. A cell that overlaps a hole is a hole.

        Parameters
        ----------
        raster
            The raster.
        resolution
            Edge of a cell, m. None keeps the raster's own cells where they are square, to within
            a tenth of a cell over the whole raster (the edge is then the mean of theirs); where
            they are not, it is the smaller of their edges.
        how
            "highest": no obstacle is lost, and obstacles grow by up to a cell. "mean": weighted by
            the area of the overlap.

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
                f"resolution: must be within {SMALLEST:g}..{LARGEST:g} m, not {resolution:g}"
            )
        refuse_too_many("grid", "window", width * dx, height * dy, resolution)
        reduce = _REDUCTIONS[how]
        along_y = reduce(raster.values.T, _edges(height, resolution / dy))
        values = reduce(along_y.T, _edges(width, resolution / dx))
        return cls(values, raster.origin, resolution)

    def filled(self, fill: float | None, field: str) -> FloatArray:
        """Returns the heights [X, Y], with `fill` (m) in the holes.

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
                f"have no data, the first at ({x:.3f}, {y:.3f}) m; fill gives them one"
            )
        if not math.isfinite(fill):
            raise ProblemError(f"fill: must be finite, not {fill}")
        return np.where(holes, fill, self.values)


def _nearly_square(raster: Raster) -> bool:
    dx, dy = raster.cell
    longest = max(len(raster.values), len(raster.values.T))
    return abs(dx - dy) * longest <= SQUARE * min(dx, dy)


def refuse_too_many(field: str, name: str, width: float, height: float, resolution: float) -> None:
    """Raises a ProblemError if width x height m have more cells than are allowed.

    Parameters
    ----------
    field : that has them, for the message
    name : of what makes them fewer
    """
    x, y = (math.ceil(length / resolution * (1 - ROUNDING)) for length in (width, height))
    if x * y > MOST_CELLS:
        # The r where (width / r + 1) (height / r + 1) = MOST_CELLS, rounded up for three digits.
        half, more = (width + height) / 2, MOST_CELLS - 1
        enough = 1.005 * (half + math.sqrt(half**2 + more * width * height)) / more
        edge = math.isqrt(MOST_CELLS) * resolution
        raise ProblemError(
            f"{field}: must have at most {MOST_CELLS} cells, not {x} x {y} of {resolution:.6g} m; "
            f"a smaller {name}, such as {edge:.6g} x {edge:.6g} m, makes it so, or a resolution of "
            f"{enough:.3g} m"
        )


def _edges(cells: int, ratio: float) -> FloatArray:
    """Returns the edges of the target cells that begin before the end of `cells` source cells.

    Edges are counted in source cells and cut off at the end; `ratio` is the length of a target
    cell in source cells. An edge that is a whole number up to rounding becomes that number, so
    that no cell overlaps a sliver of its neighbour.
    """
    edges = ratio * np.arange(math.ceil(cells / ratio) + 2)
    whole = np.rint(edges)
    same = np.abs(edges - whole) <= ROUNDING * np.maximum(edges, 1)
    edges[same] = whole[same]
    begun = int(np.searchsorted(edges, cells))
    clipped: FloatArray = np.minimum(edges[: begun + 1], cells)
    return clipped


def _highest(values: FloatArray, edges: FloatArray) -> FloatArray:
    first, last = np.floor(edges[:-1]).astype(int), np.ceil(edges[1:]).astype(int) - 1
    highest: FloatArray = values[first]
    for k in range(1, np.max(last - first) + 1):
        np.maximum(highest, values[np.minimum(first + k, last)], out=highest)
    return highest


def _mean(values: FloatArray, edges: FloatArray) -> FloatArray:
    first, last = np.floor(edges[:-1]).astype(int), np.ceil(edges[1:]).astype(int) - 1
    mean = np.zeros((len(first), values.shape[1]))
    for k in range(np.max(last - first) + 1):
        overlap = np.minimum(edges[1:], first + k + 1) - np.maximum(edges[:-1], first + k)
        share = np.maximum(overlap, 0) / np.diff(edges)
        mean += share[:, None] * values[np.minimum(first + k, last)]
    return mean


# Functions of values along the first axis and edges of target cells: one value per target cell.
_REDUCTIONS: dict[How, Callable[[FloatArray, FloatArray], FloatArray]] = {
    "highest": _highest,
    "mean": _mean,
}
