"""The terrain of a recipe: a height map, and the ground on which people stand."""

import logging
import math
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np

from cocap_opt.data import FloatArray, ProblemError
from cocap_opt.scenarios.recipe.rasters import Raster, read_raster, sample
from cocap_opt.scenarios.recipe.resample import MOST_CELLS, filled, to_grid
from cocap_opt.scenarios.recipe.tables import Coordinate, Length, Point, Size, Table
from cocap_opt.world.workspace import HeightMap

log = logging.getLogger(__name__)

SURFACE = "surface"  # in place of the ground's file
DEEP = 1.0  # m below the ground; more in a map of heights above it is a mistake

Flight = Literal["above-ground", "above-sea"]


class MapTable(Table):
    """Table `map` of a recipe, see `cocap_opt.scenarios.recipe.recipe.EXAMPLE`."""

    file: str | None = None
    size: tuple[Length, Length] | None = None
    origin: Point = (0.0, 0.0)
    heights: Literal["above-ground", "absolute"] = "above-ground"
    ground: str | None = None
    resolution: Length | None = None
    window: tuple[Coordinate, Coordinate, Coordinate, Coordinate] | None = None
    band: int | None = None
    nodata: float | None = None
    fill: float | None = None
    lowest: Size = 0.0


class Terrain(NamedTuple):
    """A height map, and the ground below what stands on it."""

    height_map: HeightMap
    ground: FloatArray  # [X, Y] m

    def floor(self, x: float, y: float) -> float:
        """Altitude of the ground at a point (m); outside the map, that of the nearest cell."""
        i, j = self.height_map.cell_of(x, y)
        width, depth = self.height_map.shape
        return float(self.ground[min(max(i, 0), width - 1), min(max(j, 0), depth - 1)])


def make_terrain(given: MapTable, folder: Path, flight: Flight) -> Terrain:
    """Build the terrain that a table describes.

    What stands on the ground keeps its height above it, so that on a slope nobody is sunk into
    a coarse cell: a cell's ground is the mean of what it covers, and its obstacle the highest.

    Parameters
    ----------
    folder : of the files that the table names
    flight : what flight heights are above; above the ground it becomes the map's datum

    Raises
    ------
    ProblemError
        If a file cannot be read, or fields do not fit together; one line.
    """
    if (given.file is None) == (given.size is None):
        raise ProblemError("must have either a file or a size")
    if given.size is not None:
        return _flat(given, given.size)
    if given.heights == "absolute" and given.ground is None:
        raise ProblemError(
            'ground: must be given where heights are absolute: a file, or "surface" if the map '
            "is bare terrain"
        )
    if given.heights == "above-ground" and given.ground == SURFACE:
        raise ProblemError('heights: must be "absolute" where the ground is the surface')
    surface = _surface(given, folder)
    bare = _bare(given, folder, surface)
    highest = to_grid(surface._replace(values=_above(given, surface, bare)), given.resolution)
    level = to_grid(surface._replace(values=bare), given.resolution, "mean")
    above, ground = filled(highest, None, "file"), filled(level, None, "ground")
    datum = ground if flight == "above-ground" and ground.any() else None
    height_map = HeightMap(
        heights=ground + above, resolution=level.resolution, origin=level.origin, datum=datum
    )
    return Terrain(height_map, ground)


def _flat(given: MapTable, size: tuple[float, float]) -> Terrain:
    for field in ("ground", "window", "band", "nodata", "fill"):
        if getattr(given, field) is not None:
            raise ProblemError(f"{field}: must be left out where the map has a size and no file")
    resolution = given.resolution or 1.0
    cells = [max(math.ceil(length / resolution - 1e-9), 1) for length in size]
    if math.prod(cells) > MOST_CELLS:
        raise ProblemError(
            f"size: must be at most {MOST_CELLS} cells, not {cells[0]} x {cells[1]} of "
            f"{resolution:g} m"
        )
    flat = np.zeros(cells)
    return Terrain(HeightMap(heights=flat, resolution=resolution, origin=given.origin), flat)


def _surface(given: MapTable, folder: Path) -> Raster:
    raster = read_raster(
        folder / str(given.file), band=given.band, nodata=given.nodata, window=given.window
    )
    if given.fill is None:
        return raster
    return raster._replace(values=np.where(np.isnan(raster.values), given.fill, raster.values))


def _bare(given: MapTable, folder: Path, surface: Raster) -> FloatArray:
    """Altitude of the bare terrain in the cells of a raster [X, Y]."""
    if given.ground is None:
        return np.zeros_like(surface.values)
    if given.ground == SURFACE:
        return surface.values
    (ox, oy), (dx, dy), (width, depth) = surface.origin, surface.cell, surface.values.shape
    around = ox, oy, ox + width * dx, oy + depth * dy
    terrain = read_raster(folder / given.ground, nodata=given.nodata, window=around)
    x, y = ox + (np.arange(width) + 0.5) * dx, oy + (np.arange(depth) + 0.5) * dy
    return sample(terrain, x[:, None], y[None, :])


def _above(given: MapTable, surface: Raster, bare: FloatArray) -> FloatArray:
    """Heights above the ground [X, Y] of what stands on it."""
    above = surface.values if given.heights == "above-ground" else surface.values - bare
    lowest = float(np.nanmin(above, initial=np.inf))
    if lowest < -DEEP:
        log.warning("%s: is %.3g m below the ground somewhere; it counts as 0", given.file, -lowest)
    if given.heights == "above-ground" and DEEP < lowest < np.inf:
        log.warning(
            '%s: is nowhere lower than %.3g m; if heights are above the sea, heights = "absolute"',
            given.file, lowest,
        )  # fmt: skip
    # Holes stay holes.
    result: FloatArray = np.where(above < given.lowest, 0.0, np.maximum(above, 0.0))
    return result
