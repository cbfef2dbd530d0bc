"""The terrain of a recipe: a height map, and the ground on which people stand."""

import logging
import math
from pathlib import Path
from typing import Literal, NamedTuple

import msgspec
import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from cocap_opt.data import FloatArray, ProblemError
from cocap_opt.scenarios.earth import require_system_of_map
from cocap_opt.scenarios.maps.building_heights import TALLEST
from cocap_opt.scenarios.maps.raster import Grid, Raster, refuse_too_many
from cocap_opt.scenarios.maps.raster_files import read_raster
from cocap_opt.scenarios.tables import (
    Coordinate,
    Flight,
    Length,
    Point,
    Size,
    Table,
    Unit,
)
from cocap_opt.scenarios.text import naming
from cocap_opt.world.workspace import HeightMap

log = logging.getLogger(__name__)

SURFACE = "surface"  # instead of a file for the ground
DEEP = 1.0  # m below the ground; a lower value in a map of heights above the ground is an error


_HARDLY = 1e-3  # m; smaller lifts are ignored
_EDGE = 1e-6  # cells; areas that reach no farther into a cell only touch it


class Ground(NamedTuple):
    """The ground below an area.

    Attributes
    ----------
    lowest : altitude (m) of the lowest cell that the area reaches
    base : altitude (m) of the lowest cell of which it covers at least half as much as of any, so
        that a ditch or a wall beside it does not count
    """

    lowest: float
    base: float


class Terrain(NamedTuple):
    """A height map, and the ground below the obstacles on it."""

    height_map: HeightMap
    ground: FloatArray  # [X, Y] m
    crs: str | None = None  # reference system that the map's file states

    def divided(self, parts: int) -> "Terrain":
        """Returns the same terrain with each cell divided into this number of parts along x and
        along y.

        Flight heights above the ground are interpolated between cells, so that they do not jump.
        """
        if parts == 1:
            return self
        height_map = self.height_map
        finer = HeightMap(
            heights=_repeated(height_map.heights, parts),
            resolution=height_map.resolution / parts,
            origin=height_map.origin,
            datum=None if height_map.datum is None else _between(height_map.datum, parts),
            bare=None if height_map.bare is None else _repeated(height_map.bare, parts),
        )
        return self._replace(height_map=finer, ground=_repeated(self.ground, parts))

    def lifted(self, slope: float, most: float) -> "Terrain":
        """Returns the terrain with flight heights whose slope is at most the given one, m per m.

        They are nowhere closer to the ground than before, and at most `most` (m) higher.
        """
        height_map = self.height_map
        if height_map.datum is None:
            return self
        level = _rise_bounded(height_map.datum, slope * height_map.resolution)
        lift = np.minimum(level - height_map.datum, most)
        if lift.max() < _HARDLY:
            return self
        return self._replace(height_map=height_map.replace(lift=lift))

    def below(self, area: BaseGeometry) -> "Ground":
        """Returns the ground below polygons (m); off the map, that of the nearest cells."""
        size, origin = self.height_map.resolution, np.array(self.height_map.origin)
        corners = np.array(area.bounds).reshape(2, 2)
        most = np.array(self.height_map.shape) - 1
        first, last = np.floor((corners - origin) / size).clip(0, most).astype(np.int64)
        part = self.ground[first[0] : last[0] + 1, first[1] : last[1] + 1]
        if part.min() == part.max():
            return Ground(float(part.min()), float(part.min()))
        i, j = (axis.ravel() for axis in np.mgrid[first[0] : last[0] + 1, first[1] : last[1] + 1])
        low = origin[:, None] + size * (np.array([i, j]) + _EDGE)
        high = low + size * (1 - 2 * _EDGE)
        boxes = np.asarray(shapely.box(*low, *high))
        shapely.prepare(area)
        touched = np.asarray(shapely.intersects(area, boxes))
        shares = np.where(touched, 1.0, 0.0)
        partly = touched & ~shapely.contains(area, boxes)
        shares[partly] = shapely.area(shapely.intersection(area, boxes[partly])) / size**2
        if not touched.any():  # off the map
            touched, shares = np.ones_like(touched), np.ones_like(shares)
        mostly = shares >= 0.5 * shares.max()
        heights = part.ravel()
        return Ground(float(heights[touched].min()), float(heights[mostly].min()))

    def floor(self, x: float, y: float) -> float:
        """Returns the altitude of the ground at a point (m); outside the map, the altitude of the
        nearest cell.
        """
        i, j = self.height_map.cell_of(x, y)
        width, depth = self.height_map.shape
        return float(self.ground[min(max(i, 0), width - 1), min(max(j, 0), depth - 1)])


def _rise_bounded(ground: FloatArray, rise: float) -> FloatArray:
    """Returns the lowest surface [X, Y] that is nowhere below a given one and has a limited slope.

    Parameters
    ----------
    ground : [X, Y] m
    rise : greatest rise, m, between cells that share an edge; times sqrt(2) diagonally
    """
    found = ground.copy()
    slow = rise, rise * math.sqrt(2)
    while True:
        before = found.copy()
        for axis in (0, 1):
            rows = np.moveaxis(found, axis, 0)
            for order in (range(1, len(rows)), range(len(rows) - 2, -1, -1)):
                back = -1 if order.step > 0 else 1
                for i in order:
                    last = rows[i + back]
                    np.maximum(rows[i], last - slow[0], out=rows[i])
                    np.maximum(rows[i, 1:], last[:-1] - slow[1], out=rows[i, 1:])
                    np.maximum(rows[i, :-1], last[1:] - slow[1], out=rows[i, :-1])
        if (found == before).all():
            return found


def _repeated(values: FloatArray, parts: int) -> FloatArray:
    """Returns values [X, Y] on divided cells, where each part has the value of its cell."""
    return values.repeat(parts, axis=0).repeat(parts, axis=1)


def _between(values: FloatArray, parts: int) -> FloatArray:
    """Returns values [X, Y] on divided cells, interpolated linearly."""
    for axis in (0, 1):
        size = values.shape[axis]
        at = ((np.arange(size * parts) + 0.5) / parts - 0.5).clip(0, size - 1)
        low = np.floor(at).astype(np.int64)
        share = np.expand_dims(at - low, 1 - axis)
        high = np.minimum(low + 1, size - 1)
        values = (1 - share) * values.take(low, axis) + share * values.take(high, axis)
    return values


def refuse_too_tall(above: FloatArray, field: str) -> None:
    """Raises a ProblemError if heights above the ground (m; nan: unknown) are of nothing on Earth.

    They are codes for no data such as 9999, or heights above the sea.
    """
    highest = float(np.fmax.reduce(above, axis=None, initial=-np.inf))
    if highest > TALLEST:
        raise ProblemError(
            f"{field}: must be at most {TALLEST:g} m above the ground, but the highest is "
            f'{highest:.9g} m; set nodata if the value means no data, heights = "absolute" if it '
            "is above the sea, or unit if it is not in metres"
        )


class MapTable(Table):
    """The table `map` of a recipe, see `cocap_opt.scenarios.recipe.EXAMPLE`."""

    file: str | None = None
    unit: Unit | None = None  # unit of heights in files; None: as stated in the file, otherwise m
    size: tuple[Length, Length] | None = None
    origin: Point | None = None
    heights: Literal["above-ground", "absolute"] = "above-ground"
    ground: str | None = None
    resolution: Length | None = None
    window: tuple[Coordinate, Coordinate, Coordinate, Coordinate] | None = None
    band: int | None = None
    nodata: float | None = None
    fill: float | None = None
    lowest: Size = 0.0

    def terrain(self, folder: Path, flight: Flight) -> Terrain:
        """Builds the terrain that the table describes.

        Obstacles keep their height above the ground, so that on a slope no person is inside a
        coarse cell: the ground of a cell is the mean of the ground that it covers, or interpolated
        if the ground's own cells are larger, and its obstacle is the highest one in it.

        Parameters
        ----------
        folder : of the files that the table names
        flight : datum of flight heights; "above-ground" makes the ground the map's datum, otherwise
            the map stores the ground separately

        Raises
        ------
        ProblemError
            If a file cannot be read, or fields do not fit together; one line.
        """
        if (self.file is None) == (self.size is None):
            raise ProblemError("must have either a file or a size")
        if self.size is not None:
            return self._flat(self.size)
        if self.origin is not None:
            raise ProblemError("origin: must be left out, as the map's file states it")
        if self.heights == "absolute" and self.ground is None:
            raise ProblemError(
                'ground: must be given, as heights = "absolute": a file, or "surface" if the map '
                "is bare terrain"
            )
        if self.heights == "above-ground" and self.ground == SURFACE:
            raise ProblemError('heights: must be "absolute" if ground = "surface"')
        surface = self._surface(folder)
        bare = self._bare(folder, surface)
        highest = Grid.of(surface._replace(values=self._above(surface, bare)), self.resolution)
        level = Grid.of(surface._replace(values=bare), self.resolution, "level")
        above, ground = highest.filled(None, "file"), level.filled(None, "ground")
        # Flat ground at 0 is not stored; a height map recognises it if many cells have its height.
        told = ground if ground.any() else None
        is_datum = flight == "above-ground"
        height_map = HeightMap(
            heights=ground + above, resolution=level.resolution, origin=level.origin,
            datum=told if is_datum else None, bare=None if is_datum else told,
        )  # fmt: skip
        return Terrain(height_map, ground, surface.crs)

    def _flat(self, size: tuple[float, float]) -> Terrain:
        for field in ("heights", "unit", "ground", "window", "band", "nodata", "fill", "lowest"):
            if getattr(self, field) != _FLAT_HAS[field]:
                raise ProblemError(f"{field}: must be left out, as the map has a size and no file")
        resolution = self.resolution or 1.0
        refuse_too_many("size", "size", *size, resolution)
        cells = [max(math.ceil(length / resolution - 1e-9), 1) for length in size]
        flat = np.zeros(cells)
        origin = self.origin or (0.0, 0.0)
        return Terrain(HeightMap(heights=flat, resolution=resolution, origin=origin), flat)

    def _surface(self, folder: Path) -> Raster:
        """Reads the map's own file and replaces missing data with `fill`."""
        raster = read_raster(
            folder / str(self.file), band=self.band, nodata=self.nodata, window=self.window,
            unit=self.unit,
        )  # fmt: skip
        if self.fill is None:
            return raster
        return raster._replace(values=np.where(np.isnan(raster.values), self.fill, raster.values))

    def _bare(self, folder: Path, surface: Raster) -> FloatArray:
        """Returns the altitude of the bare terrain in the cells of a raster [X, Y]."""
        if self.ground is None:
            return np.zeros_like(surface.values)
        if self.ground == SURFACE:
            return surface.values
        terrain = self._read_ground(folder / self.ground, surface, (0.0, 0.0))
        if any(coarse > fine for coarse, fine in zip(terrain.cell, surface.cell, strict=True)):
            # the cells around are needed to interpolate
            terrain = self._read_ground(folder / self.ground, surface, terrain.cell)
        level = terrain.level_in(surface)
        with naming("ground"):
            absolute = self.heights == "absolute"
            require_system_of_map(terrain.crs, surface.crs, has_altitudes=absolute)
        grid = Grid(level, surface.origin, surface.cell[0])
        grid.filled(None, "ground", "fill them in its file, e.g. with gdal_fillnodata.py")
        return level

    def _read_ground(self, path: Path, surface: Raster, around: tuple[float, float]) -> Raster:
        """Reads the ground below a raster, and some metres along x and y around it."""
        (ox, oy), (dx, dy), (width, depth) = surface.origin, surface.cell, surface.values.shape
        more_x, more_y = around
        window = ox - more_x, oy - more_y, ox + width * dx + more_x, oy + depth * dy + more_y
        return read_raster(path, nodata=self.nodata, window=window, unit=self.unit)

    def _above(self, surface: Raster, bare: FloatArray) -> FloatArray:
        """Returns the heights above the ground [X, Y] of the obstacles on it; holes stay holes."""
        above = surface.values if self.heights == "above-ground" else surface.values - bare
        lowest = float(np.nanmin(above, initial=np.inf))
        if lowest < -DEEP:
            log.warning(
                "%s: is up to %.3g m below the ground; heights below the ground count as 0",
                self.file,
                -lowest,
            )
        if self.heights == "above-ground" and DEEP < lowest < np.inf:
            log.warning(
                '%s: is nowhere lower than %.3g m; if its heights are above the sea, set '
                'heights = "absolute"',
                self.file, lowest,
            )  # fmt: skip
        refuse_too_tall(above, "heights")
        result: FloatArray = np.where(above < self.lowest, 0.0, np.maximum(above, 0.0))
        return result


# Default values of the fields that a flat map does not use.
_FLAT_HAS = {field.name: field.default for field in msgspec.structs.fields(MapTable)}
