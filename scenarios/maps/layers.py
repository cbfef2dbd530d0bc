"""Layers on the map of a recipe: maps of the heights of buildings, canopies of trees, and others.

A layer adds obstacles on the ground and never removes any: if the map and a layer both have a
height in a cell, the greater one counts. Obstacles above free space, such as crowns above bare
trunks, become boxes.
"""

import logging
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np

from cocap_opt.data import BoolArray, FloatArray, IntArray, ProblemError
from cocap_opt.scenarios.earth import require_system_of_map
from cocap_opt.scenarios.maps.raster import SLIVER, Raster
from cocap_opt.scenarios.maps.raster_files import read_raster
from cocap_opt.scenarios.maps.terrain import Terrain, refuse_too_tall
from cocap_opt.scenarios.tables import Length, Size, Table, Unit
from cocap_opt.scenarios.text import naming, rectangle
from cocap_opt.world.workspace import HeightMap, Mesh

log = logging.getLogger(__name__)

UNDERSIDE, TOP = 0.5, 1.0  # m; crowns are rounded outwards to multiples, for fewer boxes
MOST_BOXES = 5_000  # boxes of a layer; each is a body that may hide people


class Layered(NamedTuple):
    """A terrain that includes a layer, and the bodies of the layer that do not reach the ground."""

    terrain: Terrain
    bodies: tuple[Mesh, ...]


class LayerTable(Table):
    """One of the tables `layer` of a recipe, see `cocap_opt.scenarios.recipe.EXAMPLE`."""

    file: str
    unit: Unit | None = None  # unit of the heights; None: as stated in the file, otherwise m
    heights: Literal["above-ground", "absolute"] = "above-ground"
    band: int | None = None
    nodata: float | None = None
    lowest: Size = 0.0  # m above the ground; lower things are not obstacles
    # m above the ground, height of the free space below crowns; None: no free space
    trunks: Length | None = None

    def onto(self, terrain: Terrain, folder: Path) -> Layered:
        """Returns a terrain with this layer added.

        The height of a cell is the greatest height that overlaps it. Cells without data add
        nothing. Obstacles up to the height `trunks` are solid down to the ground.

        Parameters
        ----------
        terrain : the terrain below the layer, including other layers
        folder : of the file that the table names

        Raises
        ------
        ProblemError
            If the file cannot be read, is in another reference system than the map, or does not
            overlap it, or if there are too many crowns; one line.
        """
        height_map = terrain.height_map
        raster = self._raster(folder, height_map)
        with naming(Path(self.file)):
            absolute = self.heights == "absolute"
            require_system_of_map(raster.crs, terrain.crs, has_altitudes=absolute)
            tops = highest_in_cells(raster, height_map)
            if self.heights == "above-ground":
                tops = tops + terrain.ground
            above = tops - terrain.ground
            self._say_holes(above)
            refuse_too_tall(above, "heights")
            stands = above > max(self.lowest, 0.0)  # false for nan, too
            hangs = stands & (above > (np.inf if self.trunks is None else self.trunks))
            solid = np.where(stands & ~hangs, tops, -np.inf)
            heights = np.maximum(height_map.heights, solid)
            bodies = () if self.trunks is None else self._crowns(terrain, tops, hangs)
        raised = terrain._replace(
            height_map=height_map.replace(heights=heights), crs=terrain.crs or raster.crs
        )
        return Layered(raised, bodies)

    def _raster(self, folder: Path, height_map: HeightMap) -> Raster:
        (x, y), (upper_x, upper_y) = (end.tolist() for end in height_map.ends)
        try:
            return read_raster(
                folder / self.file, band=self.band, nodata=self.nodata, unit=self.unit,
                window=(x, y, upper_x, upper_y),
            )  # fmt: skip
        except ProblemError as error:
            words = f"must overlap the map, {rectangle(*height_map.ends)}, but the raster covers"
            missed = "window: must overlap the raster, which covers"
            raise ProblemError(str(error).replace(missed, words)) from error

    def _say_holes(self, above: FloatArray) -> None:
        """Logs which share of the map has no data in the layer, if the share is large."""
        share = float(np.isnan(above).mean())
        if share >= 0.005:
            log.warning(
                "%s: has no data on %.0f %% of the map, and adds nothing there",
                self.file, 100 * share,
            )  # fmt: skip

    def _crowns(self, terrain: Terrain, tops: FloatArray, hangs: BoolArray) -> tuple[Mesh, ...]:
        """Returns boxes from the top of the trunks to the top of the crowns, both rounded
        outwards.
        """
        assert self.trunks is not None
        low = np.floor((terrain.ground + self.trunks) / UNDERSIDE).astype(np.int64)
        high = np.ceil(np.where(hangs, tops, 0.0) / TOP).astype(np.int64)
        boxes = merged(hangs, low, high)
        if len(boxes) > MOST_BOXES:
            raise ProblemError(
                f"trunks: must leave at most {MOST_BOXES} boxes of crowns, not {len(boxes)}; "
                "use a window of [map], or a coarser resolution"
            )
        (ox, oy), size = terrain.height_map.origin, terrain.height_map.resolution
        return tuple(
            Mesh.box(
                (ox + x0 * size, oy + y0 * size, bottom * UNDERSIDE),
                (ox + x1 * size, oy + y1 * size, top * TOP),
            )
            for x0, y0, x1, y1, bottom, top in boxes
        )


def highest_in_cells(raster: Raster, height_map: HeightMap) -> FloatArray:
    """Returns the highest value of a raster in each cell of a map [X, Y]; nan without data.

    A cell of the raster counts for every cell of the map that it overlaps.
    """
    result = np.full(height_map.shape, -np.inf)
    ranges = [
        _covered(
            (raster.origin[axis] - height_map.origin[axis]) / height_map.resolution,
            raster.cell[axis] / height_map.resolution, raster.values.shape[axis],
        )
        for axis in (0, 1)
    ]  # fmt: skip
    values = np.where(np.isnan(raster.values), -np.inf, raster.values)
    (first_x, last_x), (first_y, last_y) = ranges
    for i in range(int((last_x - first_x).max()) + 1):
        for j in range(int((last_y - first_y).max()) + 1):
            x, y = first_x + i, first_y + j
            in_x = np.flatnonzero((x <= last_x) & (x >= 0) & (x < height_map.shape[0]))
            in_y = np.flatnonzero((y <= last_y) & (y >= 0) & (y < height_map.shape[1]))
            np.maximum.at(result, np.ix_(x[in_x], y[in_y]), values[np.ix_(in_x, in_y)])
    result[np.isneginf(result)] = np.nan
    return result


def _covered(begin: float, length: float, count: int) -> tuple[IntArray, IntArray]:
    """Returns the first and the last cell [n] that each of n intervals of equal length overlaps.

    Parameters
    ----------
    begin : of the first interval, in cells
    length : of each, in cells
    """
    edges = begin + length * np.arange(count + 1)
    first = np.floor(edges[:-1] + SLIVER).astype(np.int64)
    last = np.ceil(edges[1:] - SLIVER).astype(np.int64) - 1
    return first, np.maximum(first, last)


Box = tuple[int, int, int, int, int, int]  # cells x0, y0, x1, y1 (x1, y1 excluded), low, high


def merged(there: BoolArray, low: IntArray, high: IntArray) -> list[Box]:
    """Returns boxes that fill the columns of the given cells from `low` to `high`; all [X, Y].

    Each box is a rectangle of cells with equal values: the longest run along y, extended along x as
    far as possible.
    """
    boxes: list[Box] = []
    left = there.copy()
    for x, y in np.argwhere(left).tolist():
        if not left[x, y]:
            continue
        kind = low[x, y], high[x, y]
        y1 = y + 1
        while y1 < left.shape[1] and left[x, y1] and (low[x, y1], high[x, y1]) == kind:
            y1 += 1
        x1 = x + 1
        while (
            x1 < left.shape[0]
            and left[x1, y:y1].all()
            and (low[x1, y:y1] == kind[0]).all()
            and (high[x1, y:y1] == kind[1]).all()
        ):
            x1 += 1
        left[x:x1, y:y1] = False
        boxes.append((x, y, x1, y1, int(kind[0]), int(kind[1])))
    return boxes
