"""Reading height maps from ESRI ASCII grids and GeoTIFF files."""

import math
import sys
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_array_equal
from others import data
from strategies import examples

from cocap_opt.data import ProblemError
from cocap_opt.scenarios.maps import geotiff, raster, raster_files
from cocap_opt.scenarios.maps.raster import Grid, Raster
from cocap_opt.scenarios.maps.raster_files import read_raster
from cocap_opt.world.workspace import HeightMap

# Two rows as files hold them, the northernmost first, and what they are with x first.
ROWS = [[1.0, 2.0, 3.5], [4.0, 5.0, 6.0]]
VALUES = np.array([[4.0, 1.0], [5.0, 2.0], [6.0, 3.5]])
HEADER = "ncols 3\nnrows 2\nxllcorner 500000.5\nyllcorner 4800000.25\ncellsize 2.5\n"
NUMBERS = "1 2 3.5\n4 5 6\n"

Write = Callable[..., Path]


@pytest.fixture
def grid(tmp_path: Path) -> Callable[[str], Path]:
    """Write a text as an ESRI ASCII grid."""

    def write(text: str) -> Path:
        path = tmp_path / "map.asc"
        path.write_text(text)
        return path

    return write


@pytest.fixture
def tiff(tmp_path: Path) -> Write:
    """Write rows as a GeoTIFF of cells of 2 x 3 m; None leaves out the geotransform."""
    rasterio = pytest.importorskip("rasterio")

    def write(
        rows: Any = ROWS,
        dtype: str = "float32",
        transform: tuple[float, ...] | None = (2, 0, 500000.5, 0, -3, 4800006.25),
        change: Callable[[Any], None] = lambda dataset: None,
        **options: Any,
    ) -> Path:
        path = tmp_path / "map.tif"
        bands = np.array(rows, dtype=dtype)
        bands = bands if bands.ndim == 3 else bands[None]
        count, height, width = bands.shape
        options |= {"count": count, "height": height, "width": width, "dtype": dtype}
        if transform is not None:
            options["transform"] = rasterio.Affine(*transform)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # that there is no geotransform
            dataset = rasterio.open(path, "w", driver="GTiff", **options)
        with dataset:
            dataset.write(bands)
            change(dataset)
        return path

    return write


def refused(path: Path, message: str, **options: Any) -> None:
    """Reading must give one line that names the file and matches the message."""
    with pytest.raises(ProblemError, match=message) as caught:
        read_raster(path, **options)
    text = str(caught.value)
    assert text.startswith(f"{path}: ") and "\n" not in text


@pytest.mark.parametrize(
    ("projection", "message"),
    [
        ('PROJCS["UTM_Zone_30N",GEOGCS["GCS",UNIT["Degree",0.017]],UNIT["Meter",1.0]]', ""),
        ('PROJCS["WGS_1984_Web_Mercator_Auxiliary_Sphere",UNIT["Meter",1.0]]', "true metres, not"),
        ('PROJCS["NAD83",GEOGCS["GCS",UNIT["Degree",0.017]],UNIT["Foot_US",0.3048006096012192]]',
         "metres, not in Foot_US"),
        ('GEOGCS["WGS 84",UNIT["Degree",0.0174532925199433]]', "metres, not in degrees"),
    ],
)  # fmt: skip
def test_the_projection_beside_a_grid_counts(
    grid: Callable[[str], Path], projection: str, message: str
) -> None:
    """A grid of other units than metres is not read as one of metres."""
    path = grid(HEADER + NUMBERS)
    path.with_suffix(".prj").write_text(projection)
    if message:
        refused(path, rf"map\.prj: must be a projection in {message}")
    else:
        assert_array_equal(read_raster(path).values, VALUES)


def test_a_grid_of_tiny_cells_in_degrees_is_refused(grid: Callable[[str], Path]) -> None:
    """Cells of 45 arc seconds would be 12.5 mm; a projection beside the grid settles it."""
    header = "ncols 3\nnrows 2\nxllcorner {}\nyllcorner 43.2\ncellsize 0.0125\n"
    path = grid(header.format(-2.9) + NUMBERS)
    refused(path, "coordinates: must be metres of a projection, .* look like degrees; .* gdalwarp")
    path.with_suffix(".prj").write_text('PROJCS["Lab",UNIT["Meter",1.0]]')
    assert read_raster(path).cell == (0.0125, 0.0125)
    path.with_suffix(".prj").unlink()
    assert read_raster(grid(header.format(500) + NUMBERS)).cell == (0.0125, 0.0125)


def test_rows_are_turned_north(grid: Callable[[str], Path]) -> None:
    """The first row of the file is the largest y, and the origin is the lower left corner."""
    raster = read_raster(grid(HEADER + NUMBERS))
    assert_array_equal(raster.values, VALUES)
    assert (raster.cell, raster.origin) == ((2.5, 2.5), (500000.5, 4800000.25))
    assert not raster.values.flags.writeable


@pytest.mark.parametrize(
    "text",
    [
        HEADER.upper() + NUMBERS,
        "\n".join(reversed(HEADER.splitlines())) + "\n" + NUMBERS,
        "\ufeff" + HEADER.replace("\n", "\r\n") + NUMBERS.replace("\n", "\r\n"),
        HEADER + "1\n2 3.5 4\t5\n\n6",
        HEADER + " 1e0 +2.0 35e-1 4 5. 6.000\n\n",
        HEADER.replace("cellsize 2.5", "dy 2.5\ndx 2.5") + NUMBERS,
        HEADER.replace("xllcorner 500000.5", "xllcenter 500001.75") + NUMBERS,
        HEADER.replace("yllcorner 4800000.25", "yllcenter 4800001.5") + NUMBERS,
        HEADER + "NODATA_value -9999\n" + NUMBERS,
    ],
)
def test_spellings_of_one_grid(grid: Callable[[str], Path], text: str) -> None:
    """Case, order, line ends, wrapped rows, and corner or centre change nothing."""
    raster = read_raster(grid(text))
    assert_array_equal(raster.values, VALUES)
    assert (raster.cell, raster.origin) == ((2.5, 2.5), (500000.5, 4800000.25))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "header: must have"),
        (NUMBERS, "header: must have"),
        (HEADER.replace("ncols 3\n", "") + NUMBERS, "header: must have ncols"),
        (HEADER.replace("cellsize 2.5\n", "") + NUMBERS, "cellsize or both dx and dy"),
        (HEADER.replace("cellsize", "dx") + NUMBERS, "cellsize or both dx and dy"),
        (HEADER.replace("yllcorner", "xllcenter") + NUMBERS, "either xllcorner or xllcenter"),
        (HEADER + "ncols 3\n" + NUMBERS, "line 6: ncols must be given once"),
        (HEADER + "colour 3\n" + NUMBERS, "line 6: must be a value after one of .*'colour 3'"),
        (HEADER + "nodata_value\n" + NUMBERS, "line 6: must be a value after"),
        (HEADER + "nodata_value x\n" + NUMBERS, "nodata_value: must be a number, not 'x'"),
        (HEADER.replace("ncols 3", "ncols 3.5") + NUMBERS, "ncols: must be a whole number"),
        (HEADER.replace("ncols 3", "ncols -3") + NUMBERS, "ncols: must be >= 1, not -3"),
        (HEADER.replace("ncols 3", "ncols 300000000") + NUMBERS, "window: must contain at most"),
        (HEADER.replace("2.5", "-2.5") + NUMBERS, "cellsize: must be > 0 m"),
        (HEADER.replace("cellsize 2.5", "cellsize 0.000833") + NUMBERS, "cell: must be >= 0.01"),
        (HEADER.replace("500000.5", "1e11") + NUMBERS, "xllcorner: must be a number within"),
        (HEADER + NUMBERS + "7", "values: must be 3 x 2, but there are more"),
        (HEADER + "1 2 3.5 4 5", "values: must be 3 x 2 = 6, not 5"),
        (HEADER + NUMBERS[:-2], "row 2 from the north: must have ncols = 3 values, not 2"),
        (HEADER + "1 2\n3.5 4 5\n6", "row 1 from the north: must have ncols = 3 values, not 2"),
        (
            HEADER + "1 2\n3 4\n5 6",
            "ncols and nrows: must be 2 and 3, the number of values in a row ",
        ),
        (HEADER + "1 2 3,5,1\n4 5 6", "row 1, column 3 .* must be a number, not '3,5,1'"),
        (HEADER + "1 2 3.5\n4 five 6", "row 2, column 2 .* must be a number, not 'five'"),
        (HEADER + "1 2 3.5\n4 1_0 6", "row 2, column 2 .* must be a number, not '1_0'"),
        (HEADER + "1_0 2 3.5\n4 1 6", "row 1, column 1 .* must be a number, not '1_0'"),
        (HEADER.replace("500000.5", "5_0") + NUMBERS, "xllcorner: must be a number within"),
        (HEADER + "nodata_value -9_999\n" + NUMBERS, "nodata_value: must be a number, not '-9_9"),
        (HEADER + "1 2 3.5\n4 5 -", "row 2, column 3 .* must be a number, not '-'"),
        (HEADER + "1 2 3.5\n4 5 \u0661", "row 2, column 3 .* must be a number"),
    ],
)
def test_damaged_grids(grid: Callable[[str], Path], text: str, message: str) -> None:
    """Missing values, surplus ones and words are refused in one line."""
    refused(grid(text), message)


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-be"])
def test_grids_in_utf_16_are_named(tmp_path: Path, encoding: str) -> None:
    """PowerShell writes such files; a mark at their beginning tells them."""
    path = tmp_path / "map.asc"
    mark = "" if encoding == "utf-16" else "\ufeff"
    path.write_bytes((mark + HEADER + NUMBERS).encode(encoding))
    refused(path, "must be a grid in ASCII or UTF-8, not in UTF-16; save it as UTF-8")


@pytest.mark.parametrize("chunk", [1, 2, 7, 64])
def test_chunks_do_not_show(
    grid: Callable[[str], Path], monkeypatch: pytest.MonkeyPatch, chunk: int
) -> None:
    """A number that lies across two chunks is one number, and messages count from the start."""
    monkeypatch.setattr(raster_files, "CHUNK", chunk)
    path = grid(HEADER + " 1.000 2.00\n\n3.50000000000\t4 5 6")
    assert_array_equal(read_raster(path).values, VALUES)
    refused(grid(HEADER + NUMBERS[:-2] + "six"), "row 2, column 3 .* not 'six'")


@pytest.mark.slow
@examples(40)
@given(
    shape=st.tuples(st.integers(1, 5), st.integers(1, 5)),
    cell=st.tuples(st.sampled_from([0.1, 1.0, 2.502]), st.sampled_from([0.1, 2.5])),
    corners=st.tuples(*[st.integers(-2, 12)] * 4),
)
def test_a_window_is_cut_out(
    tmp_path_factory: pytest.TempPathFactory,
    shape: tuple[int, int],
    cell: tuple[float, float],
    corners: tuple[int, int, int, int],
) -> None:
    """A window of halves of cells gives just the cells that it overlaps, in both formats."""
    ox, oy = 500600.988, 4794197.109
    x0, x1, y0, y1 = *sorted(corners[:2]), *sorted(corners[2:])
    values = np.arange(math.prod(shape), dtype=float).reshape(shape)
    kept = values[max(x0, 0) // 2 : (x1 + 1) // 2, max(y0, 0) // 2 : (y1 + 1) // 2]
    (dx, dy), halves = cell, (x0, y0, x1, y1)
    window = tuple(o + k * d / 2 for o, k, d in zip((ox, oy) * 2, halves, cell * 2, strict=True))
    folder = tmp_path_factory.mktemp("window")
    for path in write_both(folder, Raster(values, cell, (ox, oy))):
        if kept.size == 0 or x0 == x1 or y0 == y1 or x1 <= 0 or y1 <= 0:
            refused(path, "window: must (overlap the raster|be x0, y0)", window=window)
        else:
            part = read_raster(path, window=window)
            assert_array_equal(part.values, kept)
            corner = ox + max(x0, 0) // 2 * dx, oy + max(y0, 0) // 2 * dy
            assert part.origin == pytest.approx(corner, abs=1e-8, rel=0)


def write_both(folder: Path, raster: Raster) -> list[Path]:
    """Write a raster in both formats, or in one where rasterio is not installed."""
    (dx, dy), (ox, oy) = raster.cell, raster.origin
    width, height = raster.values.shape
    rows = raster.values.T[::-1]
    text = folder / "map.asc"
    header = (
        f"ncols {width}\nnrows {height}\nxllcorner {ox!r}\nyllcorner {oy!r}\ndx {dx}\ndy {dy}\n"
    )
    text.write_text(header + "\n".join(" ".join(map(repr, row)) for row in rows.tolist()))
    try:
        import rasterio
    except ImportError:
        return [text]
    options = {"width": width, "height": height, "count": 1, "dtype": "float64"}
    transform = rasterio.Affine(dx, 0, ox, 0, -dy, oy + height * dy)
    path = folder / "map.tif"
    with rasterio.open(path, "w", driver="GTiff", transform=transform, **options) as dataset:
        dataset.write(rows, 1)
    return [text, path]


@pytest.mark.parametrize(
    "window", [(0, 0, 1, 1), (3, 0, 1, 9), (0, 0, math.nan, 1), (0, 0, math.inf, 1)]
)
def test_windows_that_are_none(
    grid: Callable[[str], Path], window: tuple[float, float, float, float]
) -> None:
    """A window beside the raster, or that is no rectangle, is refused."""
    refused(grid(HEADER + NUMBERS), "window: must", window=window)


@pytest.mark.parametrize("low", ["-9999", "-3.40282346639e+38", "nan", "-1.797693134862316E+308"])
def test_declared_nodata_becomes_holes(grid: Callable[[str], Path], low: str) -> None:
    """The header's value means no data, also where it is spelt with fewer digits, and so is nan."""
    path = grid(HEADER + f"NODATA_value {low}\n" + NUMBERS.replace("6", "nan").replace("2", low))
    values = read_raster(path, nodata=5.0).values
    assert_array_equal(values, [[4, 1], [math.nan, math.nan], [math.nan, 3.5]])


@pytest.mark.parametrize("low", ["-9999", "-999", "-32768", "3.4028235e38", "1e6", "inf", "65535"])
def test_undeclared_nodata_is_named(grid: Callable[[str], Path], low: str) -> None:
    """A value that is no height of land is named with its place and the option that helps."""
    path = grid(HEADER + NUMBERS.replace("2", low))
    with pytest.raises(ProblemError, match=r"heights: .* \(500004.250, 4800004.000\) m") as caught:
        read_raster(path)
    named = float(str(caught.value).split("nodata=")[1].split()[0])
    assert_array_equal(read_raster(path, nodata=named).values[1], [5, math.nan])


def test_tiff_is_turned_north(tiff: Write) -> None:
    """Rows, cells that are not square and large coordinates come out as float64."""
    raster = read_raster(tiff())
    assert_array_equal(raster.values, VALUES)
    assert (raster.cell, raster.origin) == ((2.0, 3.0), (500000.5, 4800000.25))
    assert raster.values.dtype == np.float64 and not raster.values.flags.writeable


@pytest.mark.parametrize("name", ["map.tif", "MAP.TIFF"])
@pytest.mark.parametrize("flip", [(1, -1), (-1, 1), (-1, -1)])
def test_tiff_the_other_way_round(tiff: Write, flip: tuple[int, int], name: str) -> None:
    """South-up and east-left files give the same raster, whole or through a window."""
    rows = np.array(ROWS)[:: flip[1], :: flip[0]]
    x = 500000.5 if flip[0] > 0 else 500006.5
    y = 4800006.25 if flip[1] > 0 else 4800000.25
    path = tiff(rows, transform=(2 * flip[0], 0, x, 0, -3 * flip[1], y))
    path = path.rename(path.with_name(name))
    raster = read_raster(path)
    assert_array_equal(raster.values, VALUES)
    assert (raster.cell, raster.origin) == ((2.0, 3.0), (500000.5, 4800000.25))
    part = read_raster(path, window=(500003, 4800004, 500006.5, 4800006))
    assert_array_equal(part.values, VALUES[1:, 1:])
    assert part.origin == (500002.5, 4800003.25)


@pytest.mark.parametrize(
    ("dtype", "nodata"),
    [
        ("int16", -32768),
        ("uint8", 255),
        ("float32", -9999),
        ("float32", math.nan),
        ("float32", float(np.finfo(np.float32).min)),
        ("float64", -1e300),
        ("uint32", 4294967295),
    ],
)
def test_tiff_nodata_tag(tiff: Write, dtype: str, nodata: float) -> None:
    """The file's nodata value becomes holes in any type."""
    values = read_raster(tiff([[1, nodata], [3, 4]], dtype, nodata=nodata)).values
    assert_array_equal(values, [[3, 1], [4, math.nan]])


def test_the_largest_byte_beside_low_ones_is_refused(tiff: Write) -> None:
    """It is a code for no data, unless heights near it are there, too."""
    path = tiff([[1, 255], [3, 4]], "uint8")
    refused(path, "heights: must not jump from 4 to 255, the largest byte, .* set nodata=255")
    assert_array_equal(read_raster(path, nodata=255).values, [[3, 1], [4, math.nan]])
    assert read_raster(tiff([[1, 255], [3, 240]], "uint8")).values.max() == 255
    assert read_raster(tiff([[1, 255], [3, 4]], "int16")).values.max() == 255


def test_tiff_mask(tiff: Write) -> None:
    """Cells that the dataset's mask leaves out are holes, whatever they hold."""
    path = tiff(change=lambda dataset: dataset.write_mask(np.array([[1, 1, 0], [1, 0, 1]]) > 0))
    assert_array_equal(read_raster(path).values, [[4, 1], [math.nan, 2], [6, math.nan]])


def test_tiff_scale_and_offset(tiff: Write) -> None:
    """Stored integers become metres; nodata is a stored value, also in the message about it."""

    def scale(dataset: Any) -> None:
        dataset.scales, dataset.offsets = [0.25], [100.0]

    path = tiff([[0, 4], [-32768, 8]], "int16", change=scale)
    refused(path, r"contains -32768, .*\(500001.500, 4800001.750\) m; set nodata=-32768 if")
    assert_array_equal(read_raster(path, nodata=-32768).values, [[math.nan, 100], [102, 101]])


@pytest.mark.parametrize(
    ("dtype", "code"),
    [("int16", -9999), ("int16", -32768), ("int16", -32767), ("int16", 32767), ("uint16", 65535),
     ("float32", -9999), ("int32", -99999), ("float32", np.finfo(np.float32).min)],
)  # fmt: skip
def test_codes_for_no_data_are_found_before_heights_are_scaled(
    tiff: Write, grid: Callable[[str], Path], dtype: str, code: float
) -> None:
    """In centimetres, -9999 would be land at -99.99 m; what is declared as no data is a hole."""

    def scale(dataset: Any) -> None:
        dataset.scales = [0.01]

    rows, words = [[0, 400], [code, 800]], f"contains {code:.9g}, .*; set nodata={code:.9g} if"
    heights = [[math.nan, 0], [8, 4]]
    refused(tiff(rows, dtype, change=scale), words.replace("+", r"\+"))
    refused(tiff(rows, dtype), words.replace("+", r"\+"), unit="cm")
    assert_array_equal(read_raster(tiff(rows, dtype), unit="cm", nodata=code).values, heights)
    assert_array_equal(read_raster(tiff(rows, dtype, nodata=code), unit="cm").values, heights)
    text = f"ncols 2\nnrows 2\nxllcorner 0\nyllcorner 0\ncellsize 2\n0 400\n{code:.9g} 800"
    refused(grid(text), words.replace("+", r"\+"), unit="cm")
    assert_array_equal(read_raster(grid(text), unit="cm", nodata=code).values, heights)


def test_ends_of_a_packed_range_are_heights(tiff: Write) -> None:
    """Some programs spread heights over all numbers of a type; values beside its ends show it."""

    def scale(dataset: Any) -> None:
        dataset.scales, dataset.offsets = [0.001], [40.0]

    path = tiff([[-32767, -32760], [32767, 32750]], "int16", change=scale)
    assert read_raster(path).values.max() == pytest.approx(72.767)


def test_tiff_bands(tiff: Write) -> None:
    """Of several bands one must be named."""
    path = tiff([ROWS, (np.array(ROWS) + 10).tolist()])
    assert_array_equal(read_raster(path, band=2).values, VALUES + 10)
    refused(path, r"band: must be given, 1\.\.2")
    for band in (0, 3):
        refused(path, r"band: must be within 1\.\.2", band=band)


@pytest.mark.parametrize(
    ("photometric", "rows", "word"), [("palette", ROWS, "palette"), ("rgb", [ROWS] * 3, "green")]
)
def test_colours_are_no_heights(tiff: Write, photometric: str, rows: list[Any], word: str) -> None:
    """Of a palette or an image, whatever their numbers."""

    def change(dataset: Any) -> None:
        if word == "palette":
            dataset.write_colormap(1, {k: (k, 0, 0, 255) for k in range(256)})

    path = tiff(rows, dtype="uint8", photometric=photometric, change=change)
    band = len(rows) - 1 if word == "green" else 1
    refused(path, f"band {band}: must contain heights, but .* colours \\({word}\\)", band=band)


@pytest.mark.parametrize("name", ["map.prj", "MAP.TIF.PRJ", "map.qpj"])
def test_the_projection_beside_a_tiff_counts_if_it_has_none(tiff: Write, name: str) -> None:
    """With a world file it is often written so."""
    feet = 'PROJCS["NAD83",GEOGCS["GCS",UNIT["Degree",0.017]],UNIT["Foot_US",0.3048006096012192]]'
    path = tiff()
    beside = path.with_name(name)
    beside.write_text(feet)
    refused(path, rf"{name}: must be a projection in metres, not in Foot_US")
    beside.write_text("EPSG:25830")
    assert read_raster(path).crs == "EPSG:25830"
    beside.write_text(feet)
    assert read_raster(tiff(crs="EPSG:25830")).crs == "EPSG:25830"


def test_a_grid_has_one_band(grid: Callable[[str], Path]) -> None:
    """A band that a text grid cannot have is refused."""
    path = grid(HEADER + NUMBERS)
    assert_array_equal(read_raster(path, band=1).values, VALUES)
    refused(path, "band: must be 1", band=2)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"transform": None}, "geotransform: must be given"),
        (
            {"transform": None, "crs": "EPSG:25830"},
            "geotransform: must be given.*`gdal_translate -a",
        ),
        (
            {"crs": "EPSG:3857"},
            r"web Mercator \(EPSG:3857\) are 0.7.* gdalwarp -t_srs EPSG:32631 m",
        ),
        ({"crs": "EPSG:3857", "transform": (2, 0, 0, 0, -3, 6)}, r"web Mercator .* EPSG:32631 map"),
        (
            {"crs": "EPSG:25830", "transform": (2, 0, -3e7, 0, -3, 3e7)},
            "projection is defined, not",
        ),
        ({"crs": "+proj=merc +datum=WGS84 +units=m"}, "must be true metres, but .* gdalwarp"),
        (
            {"crs": "EPSG:3395"},
            r"EPSG:3395 are 0.7.* m long at latitude 39",
        ),
        ({"transform": (2, 0.1, 0, 0.1, -2, 0)}, "must not be rotated or sheared"),
        ({"dtype": "complex64"}, "band 1: must contain real numbers, not complex64"),
        ({"crs": "EPSG:4326"}, "metres of a projection, not degrees"),
        ({"crs": "EPSG:2263"}, r"metres, not US survey foot \(0.30480061 m\)"),
        (
            {"transform": (1e-4, 0, -3, 0, -1e-4, 43)},
            "coordinates: .* look like degrees; .* gdalwarp .* if they are metres, .* gdal_tr",
        ),
        ({"transform": (1e-4, 0, 5e5, 0, -1e-4, 4.3e6)}, "cell: must be >= 0.01 m"),
        ({"transform": (2, 0, 1e12, 0, -2, 0)}, "origin: all of the raster must lie"),
    ],
)
def test_tiffs_that_are_no_maps_in_metres(
    tiff: Write, options: dict[str, Any], message: str
) -> None:
    """Rasters without a certain place or certain units are refused."""
    refused(tiff(**options), message)


def test_control_points_are_no_geotransform(tiff: Write) -> None:
    """A file that is only tied to the ground by points is refused."""
    from rasterio.control import GroundControlPoint

    points = [GroundControlPoint(r, c, 5 * c, -5 * r) for r, c in ((0, 0), (0, 2), (2, 0))]
    refused(tiff(transform=None, gcps=points, crs="EPSG:25830"), "geotransform: must be given")


@pytest.mark.parametrize("crs", ["EPSG:25830", "EPSG:25830+5703", 'LOCAL_CS["x",UNIT["metre",1]]'])
def test_systems_in_metres(tiff: Write, crs: str) -> None:
    """Projected, compound and local systems in metres are taken."""
    assert_array_equal(read_raster(tiff(crs=crs)).values, VALUES)


def test_heights_may_be_centimetres(tiff: Write, grid: Callable[[str], Path]) -> None:
    """They are scaled where the recipe says so; codes for no data are not."""
    stored = [[120, 65535], [300, 25000]]
    raster = read_raster(tiff(stored, "uint16", nodata=65535), unit="cm")
    assert_array_equal(raster.values, [[3, 1.2], [250, math.nan]])
    refused(tiff(stored, "uint16", nodata=65535), "contains 25000.*, or unit if heights are not in")
    refused(
        tiff(crs="EPSG:25830+5703"), "must be cm, the value of the field unit, not metre", unit="cm"
    )
    feet = tiff([[10.0, 20.0]], crs="EPSG:25830+8228")
    assert read_raster(feet, unit="ft").values.max() == 6.096
    refused(feet, 'heights: must be metres, not foot; set unit = "ft"', unit="m")
    text = "ncols 2\nnrows 1\nxllcorner 0\nyllcorner 0\ncellsize 2\nnodata_value 9\n100 9"
    assert_array_equal(read_raster(grid(text), unit="cm").values, [[1.0], [math.nan]])


@pytest.mark.parametrize(
    ("crs", "x", "y"), [("EPSG:2154", 650_000, 6_860_000), ("EPSG:3035", 4_321_000, 3_210_000)]
)
def test_projections_that_are_true_there(tiff: Write, crs: str, x: float, y: float) -> None:
    """National and European systems are taken where their metres are as long as on the ground."""
    assert_array_equal(read_raster(tiff(crs=crs, transform=(2, 0, x, 0, -3, y))).values, VALUES)


@pytest.mark.parametrize("share", [0.02, 0.3, 0.99])
def test_truncated_tiff(
    tiff: Write,
    share: float,
    capfd: pytest.CaptureFixture[str],
    caplog: pytest.LogCaptureFixture,
) -> None:
    """A file that ends early is refused in one line, and GDAL says nothing of its own."""
    path = tiff(np.random.default_rng(0).random((80, 90)), crs="EPSG:25830")
    data = path.read_bytes()
    path.write_bytes(data[: int(share * len(data))])
    refused(path, "cannot be read as GeoTIFF: it is damaged, truncated")
    assert capfd.readouterr() == ("", "")
    assert not caplog.records


def test_what_gdal_raises_later_is_told_in_a_line(
    tiff: Write, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of some damaged keys it only says so at a later call; errors of our own are none of these."""
    path = tiff()
    errors = pytest.importorskip("rasterio._err")

    def raising(error: Exception) -> Callable[..., int]:
        def band(*_: Any) -> int:
            raise error

        return band

    late = errors.CPLE_AppDefinedError(3, 1, "Key GeogCitationGeoKey has offset=22")
    monkeypatch.setattr(geotiff, "_band", raising(late))
    refused(path, "cannot be read as GeoTIFF: it is damaged")
    monkeypatch.setattr(geotiff, "_band", raising(KeyError("ours")))
    with pytest.raises(KeyError, match="ours"):
        read_raster(path)


def test_tiff_with_text_of_another_encoding(tiff: Write) -> None:
    """A text in the file that is not UTF-8 is an error of one line like all others."""
    path = tiff(change=lambda dataset: setattr(dataset, "units", ["metreXX"]))
    refused(path, "heights: must be in m, cm, mm, ft, us-ft, .* not in 'metreXX'")
    path.write_bytes(path.read_bytes().replace(b"metreXX", b"metre\xa1\xa1"))
    refused(path, "cannot be read as GeoTIFF: it is damaged")


@pytest.mark.parametrize("name", ["map.tif", "map.asc"])
def test_files_that_are_none(tmp_path: Path, name: str) -> None:
    """A missing file, a folder, an empty file and other content are told apart in one line."""
    path = tmp_path / name
    refused(path, "no such file")
    path.touch()
    refused(path, "must ")
    path.write_bytes(bytes(range(256)) * 9)
    refused(path, "must ")
    path.unlink()
    path.mkdir()
    refused(path, "cannot be read: Is a directory")


def test_names_of_other_formats(tmp_path: Path) -> None:
    """A name says the format; others are refused with the names that are allowed."""
    refused(tmp_path / "map.png", r"must be an ESRI ASCII grid \(.asc\) or a GeoTIFF \(.tif\)")


def test_without_rasterio(tiff: Write, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without rasterio the message tells the command that installs it."""
    path = tiff()
    monkeypatch.setitem(sys.modules, "rasterio", None)
    refused(path, r"needs rasterio: pip install 'cocap-opt\[maps\]'")


def test_only_the_window_counts(tiff: Write, monkeypatch: pytest.MonkeyPatch) -> None:
    """A file of more cells than can be read at once can be read through a window."""
    monkeypatch.setattr(raster, "MOST_READ", 4)
    path = tiff()
    refused(path, "window: must contain at most 4 cells, not 3 x 2")
    assert_array_equal(
        read_raster(path, window=(500001, 4800001, 500004, 4800006)).values, VALUES[:2]
    )


def test_sample_finds_the_cells_of_points() -> None:
    """A point has the height of its cell, as `HeightMap.cell_of` finds it; nan outside."""
    raster = Raster(VALUES, (2.0, 3.0), (10.0, 20.0))
    x = [10.0, 11.9, 12.0, 15.9, 16.0, 9.9, math.nan, math.inf]
    y = [20.0, 22.9, 23.0, 25.9, 21.0, 21.0, 21.0, 21.0]
    nan = math.nan
    assert_array_equal(raster.sample(x, y), [4, 4, 2, 3.5, nan, nan, nan, nan])
    assert_array_equal(raster.sample([[11], [13]], [21, 24]), VALUES[:2])
    assert raster.sample(11, 21) == 4


@examples(40)
@given(point=st.tuples(st.floats(-1, 9), st.floats(-1, 9)))
def test_sample_agrees_with_height_maps(point: tuple[float, float]) -> None:
    """If cells are square, raster and height map put a point in the same cell."""
    raster = Raster(VALUES, (2.5, 2.5), (0.3, 0.7))
    x, y = HeightMap(VALUES, 2.5, (0.3, 0.7)).cell_of(*point)
    inside = 0 <= x < 3 and 0 <= y < 2
    assert_array_equal(raster.sample(*point), VALUES[x, y] if inside else math.nan)


def test_the_old_town_of_bilbao() -> None:
    """A real map is the same in both formats, up to the rounding of the text's cell size."""
    pytest.importorskip("rasterio")
    folder = data("heightmaps")
    text, image = (read_raster(folder / f"bilbao_crop_ndsm.{end}") for end in ("asc", "tif"))
    assert_array_equal(text.values, image.values)
    assert text.cell == pytest.approx(image.cell, abs=5e-4)
    assert text.origin == pytest.approx(image.origin, abs=5e-4)
    for read in (text, image):
        grid = Grid.of(read)
        assert_array_equal(grid.values, text.values)
        assert read.sample(*np.add(read.origin, 100.0)) == grid.values[39, 39]
