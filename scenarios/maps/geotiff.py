"""Reader of GeoTIFF files, through rasterio (GDAL), which is imported only here.

Source of the format: Open Geospatial Consortium, "OGC GeoTIFF Standard", 19-008r4, 2019.
"""

import logging
import math
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from cocap_opt.data import FloatArray, ProblemError
from cocap_opt.flight.earth import STRETCH
from cocap_opt.scenarios.earth import utm
from cocap_opt.scenarios.earth.lengths import (
    Stated,
    metres_of_heights,
    same_length,
    stated_heights,
    unknown,
)
from cocap_opt.scenarios.earth.units import units_of
from cocap_opt.scenarios.maps.raster import SLIVER, Layout, Raster, Window
from cocap_opt.scenarios.tables import Unit
from cocap_opt.text import pair

MAGIC = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")  # TIFF and BigTIFF, in either byte order
APART, EARTH = 100.0, 6_371_008.8  # m, distance between compared points; radius of the Earth
WEB_MERCATOR = 3857  # EPSG
_COLOURS = {"palette", "red", "green", "blue", "alpha", "hue", "saturation", "lightness", "cyan",
            "magenta", "yellow", "black"}  # fmt: skip
FULL, STEEP = 255, 50  # the largest byte, and by how much it may exceed all other heights
CACHE = 64  # MB; by default, GDAL uses a share of all memory


def read(
    path: Path, band: int | None, nodata: float | None, window: Window | None, unit: Unit | None
) -> Raster:
    """Reads a band; see `cocap_opt.scenarios.maps.raster_files.read_raster`."""
    with path.open("rb") as file:
        if file.read(4) not in MAGIC:
            raise ProblemError("must be a TIFF file, as its name says")
    try:
        import rasterio
        from rasterio.errors import CRSError, NotGeoreferencedWarning, RasterioError
    except ImportError as error:
        raise ProblemError("needs rasterio: pip install 'cocap-opt[maps]'") from error
    try:
        with warnings.catch_warnings(), _unlogged(), rasterio.Env(GDAL_CACHEMAX=CACHE):
            warnings.simplefilter("ignore")
            warnings.simplefilter("error", NotGeoreferencedWarning)
            with rasterio.open(path, driver="GTiff") as dataset:
                return _read(dataset, band, nodata, window, unit)
    except NotGeoreferencedWarning as error:
        raise _no_geotransform() from error
    except Exception as error:
        # GDAL's own errors have no public base class; any call may raise them.
        is_known = isinstance(error, RasterioError | CRSError | UnicodeError)
        if isinstance(error, ProblemError) or not (is_known or _is_of_gdal(error)):
            raise
        raise ProblemError(
            "cannot be read as GeoTIFF: it is damaged, truncated, or compressed in an unknown way"
        ) from error


def _is_of_gdal(error: Exception) -> bool:
    """Returns True for the errors of GDAL that rasterio passes on."""
    return type(error).__module__.partition(".")[0] == "rasterio"


@contextmanager
def _unlogged() -> Iterator[None]:
    """Suppresses GDAL's own messages about a file in rasterio's log."""
    log = logging.getLogger("rasterio")
    before = log.level
    log.setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        log.setLevel(before)


def _read(
    dataset: Any, band: int | None, nodata: float | None, window: Window | None, unit: Unit | None
) -> Raster:
    band = _band(dataset, band)
    _refuse_coordinates(dataset.crs)
    _refuse_stretched(dataset)
    metres = metres_of_heights(_stated_heights(dataset, band), unit, Path(dataset.name).name)
    layout = _layout(dataset)
    if not dataset.crs:
        layout.refuse_degrees("state their system with gdal_translate -a_srs EPSG:326ZZ")
    columns, rows = layout.met(window)
    a, e = dataset.transform.a, dataset.transform.e
    across = _in_file(columns, layout.cells[0], a > 0)
    down = _in_file(rows, layout.cells[1], e > 0)
    part = ((down.start, down.stop), (across.start, across.stop))
    values = dataset.read(band, window=part, out_dtype="float64")
    values[dataset.read_masks(band, window=part) == 0] = np.nan
    if dataset.dtypes[band - 1] == "uint8" and nodata != FULL:
        _refuse_full_bytes(values)
    northernmost_first = values[:: -1 if e > 0 else 1, :: -1 if a < 0 else 1]
    raster = layout.cut(columns, rows).raster(
        northernmost_first,
        (nodata,),
        scale=dataset.scales[band - 1] * metres,
        offset=dataset.offsets[band - 1] * metres,
    )
    return raster._replace(crs=_named(dataset.crs))


def _named(crs: Any) -> str | None:
    """Returns a projection's code, or its WKT if it has none; None for any other system."""
    if not (crs and crs.is_projected):
        return None
    code = crs.to_epsg()
    return f"EPSG:{code}" if code else str(crs.to_wkt())


def _refuse_full_bytes(values: FloatArray) -> None:
    """Raises a ProblemError if 255 in a raster of bytes can only mean that there is no data.

    Parameters
    ----------
    values : stored, [Y, X]; nan where there is no data
    """
    others = values[values != FULL]
    below = float(np.fmax.reduce(others, initial=-np.inf))
    if len(others) < values.size and below < FULL - STEEP:
        raise ProblemError(
            f"heights: must not jump from {max(below, 0.0):g} to {FULL}, the largest byte, which "
            f"looks like a code for no data; if it is one, set nodata={FULL}; if it is a height, "
            "convert the map with gdal_translate -ot Int16"
        )


def _band(dataset: Any, band: int | None) -> int:
    if band is None and dataset.count > 1:
        raise ProblemError(f"band: must be given, 1..{dataset.count}")
    band = 1 if band is None else band
    if not 1 <= band <= dataset.count:
        raise ProblemError(f"band: must be within 1..{dataset.count}, not {band}")
    kind = dataset.dtypes[band - 1]
    if kind.startswith("complex"):
        raise ProblemError(f"band {band}: must contain real numbers, not {kind}")
    meaning = dataset.colorinterp[band - 1].name
    if meaning in _COLOURS:
        raise ProblemError(
            f"band {band}: must contain heights, but the file says that it contains colours "
            f"({meaning}); if they are heights, state it with gdal_edit.py -colorinterp_{band} gray"
        )
    return band


def _refuse_coordinates(crs: Any) -> None:
    """Raises a ProblemError if a system states that its coordinates are not metres."""
    if crs and crs.is_geographic:
        raise ProblemError(
            "coordinates: must be metres of a projection, not degrees; convert the map with "
            "gdalwarp -t_srs EPSG:326ZZ, where ZZ is the UTM zone"
        )
    if crs:
        other, factor = crs.units_factor
        if factor != 1:
            raise ProblemError(
                f"coordinates: must be metres, not {other} ({factor:.9g} m); convert the map with "
                "gdalwarp -t_srs EPSG:326ZZ, where ZZ is the UTM zone"
            )


def _stated_heights(dataset: Any, band: int) -> Stated | None:
    """Returns the unit of heights that the file's reference system states, or else a band.

    Raises
    ------
    ProblemError
        If the system is one of depths, or the two state different units.
    """
    # GDAL gives a band without a unit that of the vertical system, also if it is one of depths.
    of_system = units_of(dataset.crs.to_wkt()).heights if dataset.crs else None
    text = (dataset.units[band - 1] or "").strip()
    if not text:
        return of_system
    stated = stated_heights(text)
    if stated is None:
        raise unknown(text)
    if of_system is None:
        return stated
    if not same_length(stated.metres, of_system.metres):
        raise ProblemError(
            f"heights: band and reference system must state the same unit, not {stated.name} and "
            f"{of_system.name}; state that of band {band} with gdal_edit.py -units"
        )
    return of_system


def _refuse_stretched(dataset: Any) -> None:
    """Raises a ProblemError if metres of the projection differ from metres on the ground.

    A metre of web Mercator (EPSG:3857) is a metre at the equator, and half as long at 60 degrees.
    """
    if not (dataset.crs and dataset.crs.is_projected):
        return
    x, y = dataset.xy(dataset.height // 2, dataset.width // 2)
    east, north = _on_earth(dataset.crs, [x, x + APART, x], [y, y, y + APART])
    lengths = np.hypot((east - east[0]) * math.cos(north[0]), north - north[0])[1:] * EARTH / APART
    code = dataset.crs.to_epsg()
    if (np.abs(lengths - 1) <= STRETCH).all() and code != WEB_MERCATOR:
        return
    longitude, latitude = math.degrees(east[0]), math.degrees(north[0])
    zone = utm(longitude, latitude)
    name = Path(dataset.name).name
    title = f"EPSG:{code}" if code else "this projection"
    title = f"web Mercator ({title})" if code == WEB_MERCATOR else title
    raise ProblemError(
        f"coordinates: must be true metres, but those of {title} are {lengths.min():.3g} m long "
        f"at latitude {latitude:.1f}; convert the map with: gdalwarp -t_srs {zone} {name} "
        f"utm-{name}"
    )


def _on_earth(crs: Any, x: list[float], y: list[float]) -> tuple[FloatArray, FloatArray]:
    """Returns the longitudes and latitudes [n] (rad) of points in a system."""
    from rasterio.warp import transform

    try:
        east, north = np.radians(transform(crs, "EPSG:4326", x, y))
    except Exception as error:  # GDAL's own errors have no public base class
        raise ProblemError(
            f"coordinates: must lie where their projection is defined, not at {pair(x[0], y[0])}"
        ) from error
    if not (np.isfinite(east).all() and np.isfinite(north).all()):
        raise ProblemError(
            f"coordinates: must lie where their projection is defined, not at {pair(x[0], y[0])}"
        )
    return east, north


def _layout(dataset: Any) -> Layout:
    transform = dataset.transform
    if transform.is_identity:  # also returned by GDAL if the file has no transform
        raise _no_geotransform()
    turned = max(abs(transform.b) * dataset.height, abs(transform.d) * dataset.width)  # m
    if turned > SLIVER * min(abs(transform.a), abs(transform.e)):
        raise ProblemError(
            "geotransform: must not be rotated or sheared; write a north-up copy with gdalwarp"
        )
    if transform.a == 0 or transform.e == 0:
        raise ProblemError("geotransform: cells must have an area")
    (left, top), (dx, dy) = (transform.c, transform.f), (transform.a, transform.e)
    cells = width, height = dataset.width, dataset.height
    lower = min(left, left + dx * width), min(top, top + dy * height)
    return Layout(lower, (abs(dx), abs(dy)), cells)


def _in_file(met: range, cells: int, increasing: bool) -> range:
    """Returns the cells `met` of an axis in the numbering of the file, which may be descending."""
    return met if increasing else range(cells - met.stop, cells - met.start)


def _no_geotransform() -> ProblemError:
    return ProblemError(
        "geotransform: must be given, as it states the position of the raster and the size of its "
        "cells; add one with `gdal_translate -a_ullr WEST NORTH EAST SOUTH`"
    )
