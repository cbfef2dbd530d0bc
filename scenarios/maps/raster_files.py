"""Height maps that surveys publish: ESRI ASCII grids, and GeoTIFF files through `geotiff`.

They become a `Raster` with the file's own cells, and with holes where the file has no data;
`cocap_opt.scenarios.maps.raster` converts it to the square cells of a planning problem.

Source of the format of ESRI ASCII grids (`.asc`): ESRI, "Esri ASCII raster format", ArcGIS
documentation: a header of keys and values, then `nrows` times `ncols` numbers, the northernmost row
first. As in GDAL, `dx` and `dy` are accepted for cells that are not square, and a comma in a number
is a decimal comma.
"""

import logging
import re
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

import numpy as np

from cocap_opt.data import FloatArray, IntArray, ProblemError
from cocap_opt.scenarios.earth.lengths import Stated, metres_of_heights, stated_heights, unknown
from cocap_opt.scenarios.earth.units import (
    NeedsPyprojError,
    NotTrueError,
    Units,
    require_metres,
    require_true,
    units_of,
)
from cocap_opt.scenarios.kinds import ESRI_ASCII, TIFF, kind_of, require
from cocap_opt.scenarios.maps import geotiff
from cocap_opt.scenarios.maps.raster import Layout, Raster, Window
from cocap_opt.scenarios.tables import Unit
from cocap_opt.scenarios.text import UTF_16, integer, naming, number, plain_number, xml_root
from cocap_opt.text import unread

log = logging.getLogger(__name__)

KEYS = (
    "ncols", "nrows", "xllcorner", "yllcorner", "xllcenter", "yllcenter", "cellsize", "dx", "dy",
    "nodata_value",
)  # fmt: skip
_CONVERTED = "with gdal_translate to .tif"
CHUNK = 1 << 20  # bytes; a file is never kept in memory as text
LONGEST = 200  # bytes, longest line of the header

_DECIMAL_COMMA = re.compile(rb"[-+]?\d*,\d+(?:[eE][-+]?\d+)?")

_PLAIN = {"Scale": 1, "Offset": 0}  # GDAL's fields for heights without scale and offset
_MOST_BESIDE = 1 << 20  # bytes of a file beside a grid; WKT has a few thousand

# The reference system, None if a file states only its units, and the unit of the heights.
_Said = tuple[str | None, Stated | None]
Header = dict[str, str]


def read_raster(
    path: Path,
    *,
    band: int | None = None,
    nodata: float | None = None,
    window: Window | None = None,
    unit: Unit | None = None,
) -> Raster:
    """Reads a height map (`.asc`, `.tif`, `.tiff`); any type of number becomes float64.

    A GeoTIFF may be south-up, have cells that are not square, and contain integers with a scale and
    an offset. It must have a geotransform. Coordinates must be in metres, which is assumed if
    neither the file nor a file beside it (`.prj`, `.aux.xml`) states their unit.

    Parameters
    ----------
    path
        The file.
    band
        Number of the band, from 1; needed if a GeoTIFF has several bands.
    nodata
        A stored value that marks missing data, in addition to the one that the file states.
    window
        x0, y0, x1, y1 in m: only cells that overlap it are kept, and of a GeoTIFF only those are
        read. None: all.
    unit
        Unit of the heights in the file; those of the raster are in m. None: as the file states,
        else m.

    Raises
    ------
    ProblemError
        If the file cannot be read, if a value in it or an argument is not allowed, if rasterio is
        needed but not installed, or if a height is outside the range of all land (-500..9000 m),
        like most values that mean that there is no data; one line that names the file.
    """
    with naming(path):
        try:
            return _read(path, band, nodata, window, unit)
        except OSError as error:
            raise ProblemError(unread(error)) from error


def _read(
    path: Path, band: int | None, nodata: float | None, window: Window | None, unit: Unit | None
) -> Raster:
    require(path, (TIFF, ESRI_ASCII))
    is_grid = kind_of(path) is ESRI_ASCII  # such files are also called .txt, .grd and .agr
    match ".asc" if is_grid else path.suffix.lower():
        case ".asc":
            if band not in (None, 1):
                raise ProblemError(f"band: must be 1 in an ESRI ASCII grid, not {band}")
            told = _beside(path)
            crs, heights = told or (None, None)
            scale = metres_of_heights(heights, unit, path.name)
            raster = _read_esri_ascii(path, nodata, window, scale, in_metres=told is not None)
            return _in_system(raster, crs)
        case ".tif" | ".tiff":
            raster = geotiff.read(path, band, nodata, window, unit)
            if raster.crs is not None:
                return raster
            # GDAL reads a world file and .aux.xml beside it, but no .prj
            crs, heights = _beside(path, by_gdal=True) or (None, None)
            metres_of_heights(heights, unit or "m", path.name)  # rejects another unit
            return _in_system(raster, crs)
    raise ProblemError(
        "must be an ESRI ASCII grid (.asc) or a GeoTIFF (.tif); convert other grids, such as "
        f".xyz, .bil, .flt and .hgt, {_CONVERTED}, and scattered points with gdal_grid"
    )


def _in_system(raster: Raster, crs: str | None) -> Raster:
    """Returns a raster in the reference system that a file beside it states, if one does."""
    if crs:
        with naming("the reference system beside it"):
            require_true(crs, *raster.origin)
    return raster._replace(crs=crs)


def _read_esri_ascii(
    path: Path, nodata: float | None, window: Window | None, scale: float, in_metres: bool
) -> Raster:
    """Reads an ESRI ASCII grid whose heights are in units of `scale` m."""
    with path.open("rb") as file:
        header = _read_header(file)
        (x, dx, width), (y, dy, height) = _axis(header, "x"), _axis(header, "y")
        layout = Layout((x, y), (dx, dy), (width, height))
        if not in_metres:
            layout.refuse_degrees("add a .prj file that states their system")
        columns, rows = layout.met(window)
        _require_rows(file, layout)
        values = _read_values(file, layout, columns, rows)
    part = layout.cut(columns, rows)
    return part.raster(values, (_nodata(header), nodata), scale=scale)


def _read_header(file: BinaryIO) -> Header:
    """Reads the lines before the first one that starts with a number."""
    if file.read(2) in UTF_16:
        raise ProblemError("must be a grid in ASCII or UTF-8, not in UTF-16; save it as UTF-8")
    file.seek(0)
    header: Header = {}
    line = 0
    while True:
        line += 1
        start = file.tell()
        text = file.readline(LONGEST)
        fields = text.decode("utf-8-sig", errors="replace").split()
        if not text or (fields and (_is_number(fields[0]) or not fields[0][0].isalpha())):
            file.seek(start)
            return header
        if fields:
            key, value = _entry(fields, line)
            if key in header:
                raise ProblemError(f"line {line}: {key} must be given once")
            header[key] = value


def _entry(fields: list[str], line: int) -> tuple[str, str]:
    key = fields[0].lower()
    if key not in KEYS or len(fields) != 2:
        raise ProblemError(
            f"line {line}: must be a value after one of {', '.join(KEYS)}, "
            f"not {' '.join(fields)[:40]!r}"
        )
    value = fields[1]
    return key, value.replace(",", ".") if _DECIMAL_COMMA.fullmatch(value.encode()) else value


def _is_number(text: str | bytes) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _axis(header: Header, name: str) -> tuple[float, float, int]:
    """Returns the lower end (m), the length of a cell (m) and the number of cells of an axis."""
    cell = _edge(header, f"d{name}")
    key = {"x": "ncols", "y": "nrows"}[name]
    cells = integer(_required(header, key), key)
    if cells < 1:
        raise ProblemError(f"{key}: must be >= 1, not {cells}")
    return _lower(header, name, cell), cell, cells


def _required(header: Header, key: str) -> str:
    if key not in header:
        raise ProblemError(f"header: must have {key}")
    return header[key]


def _edge(header: Header, key: str) -> float:
    if ("cellsize" in header) == (key in header):
        raise ProblemError("header: must have either cellsize or both dx and dy")
    key = "cellsize" if "cellsize" in header else key
    edge = number(header[key], key)
    if edge <= 0:
        raise ProblemError(f"{key}: must be > 0 m, not {edge:g}")
    return edge


def _lower(header: Header, name: str, cell: float) -> float:
    corner, centre = f"{name}llcorner", f"{name}llcenter"
    if (corner in header) == (centre in header):
        raise ProblemError(f"header: must have either {corner} or {centre}")
    if corner in header:
        return number(header[corner], corner)
    return number(header[centre], centre) - cell / 2


def _nodata(header: Header) -> float | None:
    if "nodata_value" not in header:
        return None
    try:
        return plain_number(header["nodata_value"])  # may be far above all heights, or nan
    except ValueError as error:
        text = header["nodata_value"][:40]
        raise ProblemError(f"nodata_value: must be a number, not {text!r}") from error


def _require_rows(file: BinaryIO, layout: Layout) -> None:
    """Raises a ProblemError if the lines are rows but their length differs from the header.

    Values may be wrapped in any way; but if one line contains exactly a row, every line must.
    """
    width, height = layout.cells
    counts = _values_per_line(file)
    if width != height and len(counts) == width and (counts == height).all():
        raise ProblemError(
            f"ncols and nrows: must be {height} and {width}, the number of values in a row and the "
            f"number of rows, not {width} and {height}"
        )
    wrong = np.flatnonzero(counts[:height] != width)
    if len(wrong) and (counts == width).any():
        row = int(wrong[0])
        raise ProblemError(
            f"row {row + 1} from the north: must have ncols = {width} values, not {counts[row]}"
        )


def _values_per_line(file: BinaryIO) -> IntArray:
    """Counts the values on each line of the rest of a file; lines without values are left out.

    The position in the file does not change.
    """
    start, counts, begun, in_word = file.tell(), [np.zeros(0, int)], 0, False
    while chunk := file.read(CHUNK):
        text = np.frombuffer(chunk, np.uint8)
        inside = text > ord(" ")
        before = np.concatenate([[in_word], inside[:-1]])
        words = np.cumsum(inside & ~before)
        ended = words[text == ord("\n")]
        counts.append(np.diff(ended, prepend=-begun))
        begun = int(words[-1] - ended[-1]) if len(ended) else begun + int(words[-1])
        in_word = bool(inside[-1])
    file.seek(start)
    found: IntArray = np.concatenate([*counts, [begun]])
    return found[found > 0]


def _read_values(file: BinaryIO, layout: Layout, columns: range, rows: range) -> FloatArray:
    """Reads all values and returns those of `columns` and `rows`, the northernmost row first."""
    width, height = layout.cells
    kept = np.empty((len(rows), len(columns)))
    done = 0
    for block in _blocks(file, width):
        if done + len(block) > width * height:
            raise ProblemError(f"values: must be {width} x {height}, but there are more")
        row, column = np.divmod(np.arange(done, done + len(block)), width)
        row -= height - rows.stop
        column -= columns.start
        met = (row >= 0) & (row < len(rows)) & (column >= 0) & (column < len(columns))
        kept[row[met], column[met]] = block[met]
        done += len(block)
    if done < width * height:
        raise ProblemError(f"values: must be {width} x {height} = {width * height}, not {done}")
    return kept


def _blocks(file: BinaryIO, width: int) -> Iterator[FloatArray]:
    """Yields the numbers of the rest of a file in blocks; messages need the `width` of a row."""
    done, tail, has_commas = 0, b"", False
    while chunk := file.read(CHUNK):
        words = (tail + chunk).split()
        tail = b"" if chunk[-1:].isspace() else words.pop()
        yield _numbers(words, done, width)
        done += len(words)
        has_commas = has_commas or b"," in chunk
    yield _numbers(tail.split(), done, width)
    if has_commas:
        log.warning("%s: numbers have decimal commas: 12,5 is read as 12.5", file.name)


def _numbers(words: list[bytes], done: int, width: int) -> FloatArray:
    try:
        if b"_" in b" ".join(words):  # see `plain_number`, which would be too slow here
            raise ValueError
        return np.fromiter(map(float, words), np.float64, len(words))
    except ValueError as error:
        if any(map(_DECIMAL_COMMA.fullmatch, words)) and not any(b"." in word for word in words):
            return _numbers([word.replace(b",", b".") for word in words], done, width)
        k = next(k for k, word in enumerate(words) if b"_" in word or not _is_number(word))
        row, column = divmod(done + k, width)
        raise ProblemError(
            f"row {row + 1}, column {column + 1} from the north-west: must be a number, "
            f"not {words[k][:40].decode(errors='replace')!r}"
        ) from error


# -- files beside a grid that state its reference system


def _beside(path: Path, by_gdal: bool = False) -> _Said | None:
    """Reads the system and units of a grid from `.prj`, `.qpj` and `.aux.xml` beside it, if any.

    Their names are the grid's name with another or a second suffix, in upper or lower case.

    Parameters
    ----------
    by_gdal : True: without `.aux.xml`, which GDAL has read

    Raises
    ------
    ProblemError
        If a file states that x and y are not in metres, or states a system that is unknown; the
        message names the file.
    """
    files = [
        other
        for other in _files_beside(path)
        if not (by_gdal and other.suffix.casefold() == ".xml")
    ]
    found = [told for other in files for told in _read_beside(other)]
    if not found:
        return None
    units = [heights for _, heights in found if heights is not None]
    if len({unit.metres for unit in units}) > 1:
        raise ProblemError(
            "heights: files beside it must state the same unit, not "
            f"{' and '.join(dict.fromkeys(unit.name for unit in units))}"
        )
    systems = [crs for crs, _ in found if crs is not None]
    return systems[0] if systems else None, units[0] if units else None


def _files_beside(path: Path) -> list[Path]:
    names = [f"{path.stem}.prj", f"{path.name}.prj", f"{path.stem}.qpj", f"{path.name}.aux.xml"]
    wanted = [name.casefold() for name in names]
    files = [other for other in path.parent.iterdir() if other.name.casefold() in wanted]
    return sorted(files, key=lambda other: (wanted.index(other.name.casefold()), other.name))


def _read_beside(path: Path) -> Iterator[_Said]:
    with naming(path):
        with path.open("rb") as file:
            content = file.read(_MOST_BESIDE + 1)
        if len(content) > _MOST_BESIDE:
            raise ProblemError(f"must have at most {_MOST_BESIDE} bytes")
        if path.suffix.casefold() == ".xml":
            yield from _of_xml(content)
            return
        text = content.decode("utf-8-sig", errors="replace")
        try:
            units = units_of(text)
        except (NeedsPyprojError, NotTrueError):
            raise
        except ProblemError as error:
            raise ProblemError(f"{error}; without this file, metres are assumed") from error
        yield _of_system(text, units)


_OF_A_SITE = "local_cs", "engcrs", "engineeringcrs"


def _of_system(text: str, units: Units) -> _Said:
    require_metres(units)
    # Arc/Info's format is not machine-readable; a system of a site has no place on the Earth
    is_one = not text.strip().casefold().startswith(("projection", *_OF_A_SITE))
    return text.strip() if is_one else None, units.heights


def _of_xml(content: bytes) -> Iterator[_Said]:
    """Yields the system and the unit of heights that GDAL and ArcGIS store beside a raster."""
    for element in xml_root(content, "XML").iter():
        text = (element.text or "").strip()
        match element.tag.rpartition("}")[2]:
            case "SRS" | "WKT" if text:
                yield _of_system(text, units_of(text))
            case "UnitType" if text:
                unit = stated_heights(text)
                if unit is None:
                    raise unknown(text)
                yield None, unit
            case ("Scale" | "Offset") as tag if number(text, tag) != _PLAIN[tag]:
                raise ProblemError(
                    f"{tag}: must be {_PLAIN[tag]} for a grid of text, not {text[:40]}; "
                    "remove it with gdal_translate -unscale"
                )
