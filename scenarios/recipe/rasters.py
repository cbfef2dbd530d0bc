"""Height maps that surveys publish: ESRI ASCII grids and GeoTIFF files.

What is read is a `Raster`, with the file's own cells and holes where it has no data;
`cocap_opt.scenarios.recipe.resample` brings it to the square cells of a planning problem.
"""

from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from cocap_opt.data import FloatArray, ProblemError
from cocap_opt.scenarios.recipe import esri_ascii, geotiff
from cocap_opt.scenarios.recipe.raster import Raster, Window
from cocap_opt.scenarios.text import naming

__all__ = ["Raster", "Window", "read_raster", "sample"]


def read_raster(
    path: Path,
    *,
    band: int | None = None,
    nodata: float | None = None,
    window: Window | None = None,
) -> Raster:
    """Read a height map (`.asc`, `.tif`, `.tiff`) as float64, whatever the file holds.

    A GeoTIFF may be south-up, have cells that are not square, and hold integers with a scale
    and an offset. It must have a geotransform, and all units must be metres; where the file
    does not say which they are, metres are taken for granted.

    Parameters
    ----------
    path
        The file.
    band
        Number of the band, from 1; needed where a GeoTIFF has several.
    nodata
        A stored value that means that there is no data, besides what the file says.
    window
        x0, y0, x1, y1 in m: only cells that overlap it are kept, and of a GeoTIFF only those are
        read. None: all.

    Raises
    ------
    ProblemError
        If the file cannot be read, a value of it or an argument is not allowed, rasterio is
        needed and not installed, or a height lies beyond all land (-500..9000 m), as values do
        that mean that there is no data; one line, naming the file.
    """
    with naming(path):
        try:
            return _read(path, band, nodata, window)
        except OSError as error:
            raise ProblemError(f"cannot be read: {error.strerror}") from error


def sample(raster: Raster, x: ArrayLike, y: ArrayLike) -> FloatArray:
    """Heights (m) of the cells in which points (x, y) in m lie; nan outside and in holes.

    A cell holds its lower edges, not its upper ones, as in `HeightMap.cell_of`. The arrays may
    have any shapes that broadcast.
    """
    with np.errstate(invalid="ignore"):  # inf and nan lie outside
        i = np.floor((np.asarray(x, dtype=float) - raster.origin[0]) / raster.cell[0])
        j = np.floor((np.asarray(y, dtype=float) - raster.origin[1]) / raster.cell[1])
    i, j = np.broadcast_arrays(i, j)
    width, height = raster.values.shape
    inside = (i >= 0) & (i < width) & (j >= 0) & (j < height)
    heights = np.full(inside.shape, np.nan)
    heights[inside] = raster.values[i[inside].astype(int), j[inside].astype(int)]
    return heights


def _read(path: Path, band: int | None, nodata: float | None, window: Window | None) -> Raster:
    match path.suffix.lower():
        case ".asc":
            if band not in (None, 1):
                raise ProblemError(f"band: must be 1 in an ESRI ASCII grid, not {band}")
            return esri_ascii.read(path, nodata, window)
        case ".tif" | ".tiff":
            return geotiff.read(path, band, nodata, window)
    raise ProblemError("must be named .asc, .tif or .tiff")
