"""Height maps that surveys publish: ESRI ASCII grids and GeoTIFF files.

They become a `Raster`, with the file's own cells, and holes where the file has no data;
`cocap_opt.scenarios.recipe.resample` brings it to the square cells of a planning problem.
"""

from pathlib import Path

from cocap_opt.data import ProblemError
from cocap_opt.scenarios.recipe import esri_ascii, geotiff
from cocap_opt.scenarios.recipe.raster import Raster, Window
from cocap_opt.scenarios.text import naming


def read_raster(
    path: Path,
    *,
    band: int | None = None,
    nodata: float | None = None,
    window: Window | None = None,
) -> Raster:
    """Reads a height map (`.asc`, `.tif`, `.tiff`) as float64, whatever numbers the file holds.

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
        A stored value that means that there is no data, besides the one that the file states.
    window
        x0, y0, x1, y1 in m: only cells that overlap it are kept, and of a GeoTIFF only those are
        read. None: all.

    Raises
    ------
    ProblemError
        If the file cannot be read, a value of it or an argument is not allowed, rasterio is
        needed and not installed, or a height lies beyond all land (-500..9000 m), as do values
        that mean that there is no data; one line, naming the file.
    """
    with naming(path):
        try:
            return _read(path, band, nodata, window)
        except OSError as error:
            raise ProblemError(f"cannot be read: {error.strerror}") from error


def _read(path: Path, band: int | None, nodata: float | None, window: Window | None) -> Raster:
    match path.suffix.lower():
        case ".asc":
            if band not in (None, 1):
                raise ProblemError(f"band: must be 1 in an ESRI ASCII grid, not {band}")
            return esri_ascii.read(path, nodata, window)
        case ".tif" | ".tiff":
            return geotiff.read(path, band, nodata, window)
    raise ProblemError("must be named .asc, .tif or .tiff")
