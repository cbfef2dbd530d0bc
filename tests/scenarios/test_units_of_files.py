"""Units that files state: of heights in GeoTIFFs, and of reference systems beside grids."""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cocap_opt.data import ProblemError
from cocap_opt.scenarios.earth.lengths import stated_heights
from cocap_opt.scenarios.earth.units import require_metres, units_of
from cocap_opt.scenarios.maps.raster_files import read_raster

US_FOOT = 1200 / 3937
GRID = "ncols 2\nnrows 1\nxllcorner {}\nyllcorner {}\ncellsize 5\n10 20\n"
DEGREE = 'UNIT["degree",0.0174532925199433]'
WGS_84 = (
    'GEOGCS["WGS 84",DATUM["WGS_1984",SPHEROID["WGS 84",6378137,298.257223563]],'
    f'PRIMEM["Greenwich",0],{DEGREE}]'
)
METRE, US_SURVEY = 'UNIT["metre",1]', 'UNIT["Foot_US",0.3048006096012192]'
LEVEL = 'VERT_CS["sea",VERT_DATUM["sea",2005],{}]'  # of GDAL
ESRI_LEVEL = 'VERTCS["sea",VDATUM["sea"],PARAMETER["Vertical_Shift",0.0],{}]'


def utm(unit: str, geographic: str = WGS_84) -> str:
    """UTM, zone 30 in the north, in a unit: WKT 1."""
    false = {METRE: 500000.0, US_SURVEY: 1640416.6666666667}.get(unit, 500000.0)
    return (
        f'PROJCS["UTM zone 30N",{geographic},PROJECTION["Transverse_Mercator"],'
        'PARAMETER["latitude_of_origin",0],PARAMETER["central_meridian",-3],'
        'PARAMETER["scale_factor",0.9996],'
        f'PARAMETER["false_easting",{false}],PARAMETER["false_northing",0],{unit}]'
    )


def wkt_2(unit: str, *, in_axes: bool = False) -> str:
    """The same in WKT 2, whose units stand after the axes or in each of them."""
    metre = 'LENGTHUNIT["metre",1]'
    degree = 'ANGLEUNIT["degree",0.0174532925199433]'
    inside, after = (f",{unit}", "") if in_axes else ("", f",{unit}")
    return (
        'PROJCRS["UTM zone 30N",BASEGEOGCRS["WGS 84",DATUM["World Geodetic System 1984",'
        f'ELLIPSOID["WGS 84",6378137,298.257223563,{metre}]]],CONVERSION["UTM zone 30N",'
        'METHOD["Transverse Mercator",ID["EPSG",9807]],'
        f'PARAMETER["Latitude of natural origin",0,{degree}],'
        f'PARAMETER["Longitude of natural origin",-3,{degree}],'
        'PARAMETER["Scale factor at natural origin",0.9996,SCALEUNIT["unity",1]],'
        f'PARAMETER["False easting",500000,{metre}],PARAMETER["False northing",0,{metre}]],'
        f'CS[Cartesian,2],AXIS["(E)",east,ORDER[1]{inside}],AXIS["(N)",north,ORDER[2]{inside}]'
        f"{after}]"
    )


W2_FOOT, W2_METRE = 'LENGTHUNIT["US survey foot",0.304800609601219]', 'LENGTHUNIT["metre",1]'
W2_LEVEL = 'VERTCRS["sea",VDATUM["sea"],CS[vertical,1],AXIS["gravity-related height (H)",up,{}]]'
BOUND = (
    'BOUNDCRS[SOURCECRS[{}],TARGETCRS[GEOGCRS["WGS 84",DATUM["World Geodetic System 1984",'
    'ELLIPSOID["WGS 84",6378137,298.257223563]],CS[ellipsoidal,2],AXIS["lat",north],'
    'AXIS["lon",east],ANGLEUNIT["degree",0.0174532925199433]]],ABRIDGEDTRANSFORMATION["t",'
    'METHOD["Geocentric translations (geog2D domain)",ID["EPSG",9603]],'
    'PARAMETER["X-axis translation",0],PARAMETER["Y-axis translation",0],'
    'PARAMETER["Z-axis translation",0]]]'
)

IN_METRES = {  # texts of systems of metres, and metres in a unit of their heights if they say it
    utm(METRE): None,
    utm(METRE).replace("[", "(").replace("]", ")"): None,
    utm(METRE) + "," + ESRI_LEVEL.format(US_SURVEY): US_FOOT,
    f'COMPD_CS["both",{utm(METRE)},{LEVEL.format(US_SURVEY)}]': US_FOOT,
    f'COMPD_CS["both",{utm(METRE)},{LEVEL.format(METRE)}]': 1.0,
    wkt_2(W2_METRE): None,
    wkt_2(W2_METRE, in_axes=True): None,
    BOUND.format(wkt_2(W2_METRE)): None,
    f'COMPOUNDCRS["c",{wkt_2(W2_METRE)},{W2_LEVEL.format(W2_FOOT)}]': US_FOOT,
    'LOCAL_CS["site",UNIT["metre",1]]': None,
    "+proj=utm +zone=30 +datum=WGS84 +units=m +no_defs": None,
    "+proj=utm +zone=30 +datum=WGS84": None,
    "+proj=utm +zone=30 +datum=WGS84 +to_meter=0.3048 +units=m": None,  # as PROJ reads it
    "+proj=utm +zone=30 +units=m +vunits=us-ft": US_FOOT,
    "Projection    UTM\nZone 30\nUnits         METERS\nZunits        NO\nParameters\n": None,
    "projection utm\r\nzone 30\r\nunits meters\r\nzunits feet\r\nparameters\r\n": 0.3048,
    "Projection UTM\nUnits 1.0\nZunits 100\n": 0.01,
}
OTHERS = {  # texts of systems of something else, and how it is named
    utm(US_SURVEY): "metres, not in .*0.3048006",
    utm('UNIT["Foot",0.3048]'): "metres, not in .*0.3048 m",
    utm('UNIT["Kilometer",1000]'): "metres, not in .*1000 m",
    utm(US_SURVEY) + "," + ESRI_LEVEL.format(METRE): "metres, not in .*0.3048006",
    f'COMPD_CS["both",{utm(US_SURVEY)},{LEVEL.format(METRE)}]': "metres, not in .*0.3048006",
    wkt_2(W2_FOOT): "metres, not in US survey foot",
    wkt_2(W2_FOOT, in_axes=True): "metres, not in US survey foot",
    BOUND.format(wkt_2(W2_FOOT)): "metres, not in US survey foot",
    f'COMPOUNDCRS["c",{wkt_2(W2_FOOT)},{W2_LEVEL.format(W2_METRE)}]': "metres, not in US survey",
    WGS_84: "metres, not in degrees",
    f'COMPD_CS["both",{WGS_84},{LEVEL.format(METRE)}]': "metres, not in degrees",
    'LOCAL_CS["site",UNIT["foot",0.3048]]': "metres, not in foot",
    "+proj=utm +zone=30 +units=us-ft +vunits=m": "metres, not in .*0.3048006",
    "+proj=utm +zone=30 +to_meter=0.3048": "metres, not in .*0.3048 m",
    "proj=utm zone=30 units=ft": "metres, not in .*0.3048 m",
    "+proj=longlat +datum=WGS84 +no_defs": "metres, not in degrees",
    "Projection    STATEPLANE\nUnits         FEET\nZunits        METERS\n": "not in FEET of 0.3048",
    "Projection GEOGRAPHIC\nUnits DD\n": "metres, not in degrees",
    "Projection UTM\nUnits 3.280839895013123\n": "not in units of 0.3048",
    "Projection UTM\nZone 30\n": "must have a line Units",
    "Projection UTM\nUnits PACES\n": "Units, Zunits: must be METERS, FEET or a number",
    "Projection MERCATOR\nUnits METERS\n": "metres are true",
    utm('UNIT["Foot",1]'): "contradicts itself: a unit 'Foot' of 1 m",
    utm("").replace(",]", "]"): "must state the unit of x and y",
    'LOCAL_CS["site"]': "must state the unit of x and y",
    utm(METRE)[:-1]: "but is damaged",
    utm(METRE) + "]": "but is damaged",
    utm(METRE)[:-20]: "but is damaged",
    "PROJCS": "but is damaged",
    "metres": "but is damaged",
    "": "is empty",
    " \r\n": "is empty",
    'PROJCS["WGS_1984_Web_Mercator_Auxiliary_Sphere",UNIT["Meter",1.0]]': "not web Mercator",
    LEVEL.format(METRE): "not in heights only|but is damaged",
}
CODES = {  # what only pyproj knows
    "EPSG:25830": None,
    "epsg:25830+5703\n": 1.0,
    "EPSG:25830+6360": US_FOOT,
    "urn:ogc:def:crs:EPSG::25830": None,
    "http://www.opengis.net/def/crs/EPSG/0/25830": None,
    "EPSG:2225": "metres, not in US survey foot",
    "EPSG:2225+5703": "metres, not in US survey foot",
    "EPSG:4326": "metres, not in degrees",
    "EPSG:5703": "metres, not in heights only",
    "EPSG:4978": "metres, not in x, y, z",
    "EPSG:3857": "not web Mercator",
    "EPSG:999999": "but is damaged",
    "+init=epsg:2225": "metres, not in US survey foot",
}


@pytest.fixture(params=["pyproj", "no pyproj"])
def either(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    """Once with pyproj, if it is installed, and once as if it were not."""
    if request.param == "pyproj":
        pytest.importorskip("pyproj")
    else:
        monkeypatch.setitem(sys.modules, "pyproj", None)
    return str(request.param)


@pytest.mark.usefixtures("either")
@pytest.mark.parametrize(("text", "heights"), IN_METRES.items())
def test_systems_in_metres_are_read(text: str, heights: float | None) -> None:
    """With pyproj or without; the unit of heights is another one than that of x and y."""
    units = units_of(text)
    require_metres(units)
    assert (units.heights and units.heights.metres) == (heights and pytest.approx(heights, 1e-9))


@pytest.mark.usefixtures("either")
@pytest.mark.parametrize(("text", "words"), OTHERS.items())
def test_systems_of_other_units_are_refused(text: str, words: str) -> None:
    """With pyproj or without, whatever the unit of their heights is; so is what is damaged."""
    with pytest.raises(ProblemError, match=words) as error:
        require_metres(units_of(text))
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(("text", "answer"), CODES.items())
def test_codes_are_looked_up_or_refused(
    monkeypatch: pytest.MonkeyPatch, text: str, answer: str | float | None
) -> None:
    """Nobody knows the unit of a code by heart, so without pyproj none is taken for metres."""
    pytest.importorskip("pyproj")
    if isinstance(answer, str):
        with pytest.raises(ProblemError, match=answer):
            require_metres(units_of(text))
    else:
        units = units_of(text)
        require_metres(units)
        assert (units.heights and units.heights.metres) == (answer and pytest.approx(answer, 1e-9))
    monkeypatch.setitem(sys.modules, "pyproj", None)
    with pytest.raises(
        ProblemError, match=r"pyproj, .* not installed: pip install 'cocap-opt\[earth\]'"
    ):
        units_of(text)


@pytest.mark.parametrize("text", ["+proj=pipeline +step +proj=utm +zone=30", "+proj=nosuch",
                                  "+proj=utm +zone=30 +units=furlong"])  # fmt: skip
def test_proj4_that_is_not_judged_for_certain_is_refused(
    monkeypatch: pytest.MonkeyPatch, text: str
) -> None:
    """Without pyproj only projections and units that are known are judged."""
    monkeypatch.setitem(sys.modules, "pyproj", None)
    with pytest.raises(ProblemError, match="pyproj, which checks"):
        units_of(text)


Beside = Callable[..., Path]


@pytest.fixture
def beside(tmp_path: Path) -> Beside:
    """Write a grid in UTM, and files beside it."""

    def write(x: float = 500000, y: float = 4800000, **files: str) -> Path:
        for other in tmp_path.iterdir():
            other.unlink()
        path = tmp_path / "map.asc"
        path.write_text(GRID.format(x, y))
        for name, text in files.items():
            (tmp_path / name.replace("_", ".")).write_text(text)
        return path

    return write


@pytest.mark.usefixtures("either")
@pytest.mark.parametrize("name", ["map_prj", "map_PRJ", "map_Prj", "MAP_PRJ", "map_asc_prj",
                                  "map_ASC_PRJ", "map_qpj"])  # fmt: skip
def test_a_projection_beside_a_grid_counts_by_any_name(beside: Beside, name: str) -> None:
    """In large or small letters, with its ending in place of the grid's or after it."""
    with pytest.raises(ProblemError, match=rf"{name.replace('_', '.')}: .* not in .*0.3048006"):
        read_raster(beside(**{name: utm(US_SURVEY)}))
    raster = read_raster(beside(**{name: utm(METRE)}))
    assert raster.crs == utm(METRE) and raster.values.max() == 20
    with pytest.raises(ProblemError, match="is empty; without this file, metres are assumed"):
        read_raster(beside(**{name: ""}))


@pytest.mark.usefixtures("either")
@pytest.mark.parametrize(
    "text",
    ["Projection MERCATOR\nUnits METERS\n", 'PROJCS["Popular Visualisation Pseudo-Mercator"'],
)
def test_nobody_is_told_to_drop_a_file_that_is_right(beside: Beside, text: str) -> None:
    """Metres that are none on the ground are none without the file that says so, either."""
    with pytest.raises(ProblemError, match=r"map\.prj: .*true") as error:
        read_raster(beside(map_prj=text))
    assert "without this file" not in str(error.value)


def test_all_files_beside_a_grid_count(beside: Beside) -> None:
    """Also GDAL's XML, with the unit of heights; one in feet is enough to refuse the grid."""
    xml = "<PAMDataset><SRS>{}</SRS><PAMRasterBand band='1'>{}</PAMRasterBand></PAMDataset>"
    feet = xml.format(utm(US_SURVEY).replace('"', "&quot;"), "")
    with pytest.raises(ProblemError, match=r"map\.asc\.aux\.xml: must be .* metres, not in "):
        read_raster(beside(map_prj=utm(METRE), map_asc_aux_xml=feet))
    text = xml.format(utm(METRE), "<UnitType>US survey foot</UnitType><Scale>1</Scale>")
    raster = read_raster(beside(map_asc_aux_xml=text))
    assert raster.crs == utm(METRE) and raster.values.max() == pytest.approx(20 * US_FOOT)
    for odd, words in (
        ("<UnitType>paces</UnitType>", "heights: must be in m, cm, .* not in 'paces'"),
        ("<Scale>0.5</Scale>", "Scale: must be 1"),
        ("<Offset>x</Offset>", "Offset: must be a number"),
        ("<Offset>", "must be XML"),
    ):
        with pytest.raises(ProblemError, match=words):
            read_raster(beside(map_asc_aux_xml=xml.format("", odd)))
    for start, words in (
        ('<?xml version="1.0" encoding="foo"?>', "must be XML in UTF-8"),
        ('<?xml version="1.0" encoding="utf-7"?>', "must be XML in UTF-8"),
        ('<!DOCTYPE a [<!ENTITY x "m">]>', "must be XML without a DOCTYPE"),
        ("<", "line 1: must be XML; it is damaged"),
    ):
        with pytest.raises(ProblemError, match=rf"map\.asc\.aux\.xml: {words}"):
            read_raster(beside(map_asc_aux_xml=start + text))
    other = xml.format("", "<UnitType>cm</UnitType>")
    both = utm(METRE) + "," + ESRI_LEVEL.format(US_SURVEY)
    with pytest.raises(ProblemError, match="heights: files beside it must state the same unit"):
        read_raster(beside(map_prj=both, map_asc_aux_xml=other))


def test_heights_are_in_the_unit_of_the_file_beside(
    beside: Beside, caplog: pytest.LogCaptureFixture
) -> None:
    """A vertical system in feet says it, also where x and y are metres."""
    path = beside(map_prj=utm(METRE) + "," + ESRI_LEVEL.format(US_SURVEY))
    assert read_raster(path).values.max() == pytest.approx(20 * US_FOOT, rel=1e-9)
    assert "map.asc: its heights are in " in caplog.text
    with pytest.raises(ProblemError, match=r'must be metres, not .*; set unit = "us-ft"'):
        read_raster(path, unit="m")


def test_systems_of_heights_below_the_projection_count(beside: Beside) -> None:
    """Feet stay feet where no comma is between the systems, which PROJ does not read on."""
    for between in (",", "\n", ""):
        path = beside(map_prj=utm(METRE) + between + ESRI_LEVEL.format(US_SURVEY))
        assert read_raster(path).values.max() == pytest.approx(20 * US_FOOT, rel=1e-9)
    two = f"{ESRI_LEVEL.format(METRE)},{ESRI_LEVEL.format(US_SURVEY)}"
    with pytest.raises(ProblemError, match="must state one unit of heights, not metre and Foot_US"):
        read_raster(beside(map_prj=f"{utm(METRE)},{two}"))


@pytest.mark.parametrize(
    "level",
    [
        LEVEL.format(f'{METRE},AXIS["Depth",DOWN]'),
        ESRI_LEVEL.format(f'PARAMETER["Direction",-1.0],{METRE}'),
    ],
)
def test_depths_are_not_taken_for_heights(beside: Beside, level: str) -> None:
    """Nobody means a house of 12 m by a depth of 12 m."""
    text = f'COMPD_CS["both",{utm(METRE)},{level}]'
    with pytest.raises(ProblemError, match="not depths, which count downwards"):
        read_raster(beside(map_prj=text))


def test_a_projection_without_true_metres_is_refused(beside: Beside) -> None:
    """Those of Mercator's projection are too long for the ground by far, away from the equator."""
    pytest.importorskip("pyproj")
    mercator = "+proj=merc +datum=WGS84 +units=m"
    with pytest.raises(ProblemError, match=r"true metres, .* 0.7.* latitude 39.* EPSG:32631"):
        read_raster(beside(map_prj=mercator))
    assert read_raster(beside(y=0, map_prj=mercator)).values.max() == 20


@pytest.mark.parametrize(
    ("text", "metres"),
    [
        *((name, US_FOOT) for name in (
            "US survey foot", "us-ft", "ftUS", "Foot_US", "US_survey_foot", "U.S. Survey Feet",
            "ft (US)", "usft", "survey foot", "feet_us", "US SURVEY FEET",
        )),
        *((name, 0.3048) for name in (
            "ft", "FT", "feet", "Foot", "international foot", "Foot (International)", "ft.",
            "feet above mean sea level",
        )),
        *((name, 1.0) for name in (
            "m", "M", "m.", "metre", "Metre", "meters", "METERS", " m ", "[m]", "m above geoid",
            "m a.s.l.", "metres above sea level", "m NAVD88", "metre (EGM96)",
        )),
        ("cm", 0.01), ("Centimeters", 0.01), ("decimetre", 0.1), ("dm", 0.1), ("mm", 0.001),
        *((name, None) for name in (
            "", " ", "fathom", "yard", "km", "degree", "m/s", "m2", "metreXX", "US metre",
            "Clarke's foot", "m, ft", "1", "us international foot", "British foot", "us", "above",
        )),
    ],
)  # fmt: skip
def test_names_of_lengths(text: str, metres: float | None) -> None:
    """Letters, plurals and what heights are above do not matter; what is unknown is no length."""
    found = stated_heights(text)
    assert (None if found is None else found.metres) == (metres and pytest.approx(metres, 1e-12))


@pytest.mark.parametrize(
    ("stated", "unit", "metres"),
    [
        ("us-ft", None, US_FOOT),
        ("us-ft", "ft", US_FOOT),
        ("US survey foot", "us-ft", US_FOOT),
        ("FT", None, 0.3048),
        ("feet", "us-ft", US_FOOT),
        ("foot", "ft", 0.3048),
        ("m above geoid", None, 1.0),
        ("Metre", "m", 1.0),
        ("decimetres", None, 0.1),
        (
            "dm",
            "cm",
            "must be cm, the value of the field unit, not dm; leave unit out to use the file's",
        ),
        ("  ", "cm", 0.01),
        (None, "us-ft", US_FOOT),
        (None, None, 1.0),
        ("us-ft", "m", 'heights: must be metres, not us-ft; set unit = "us-ft"'),
        ("m", "ft", 'must be ft, the value of the field unit, not m; set unit = "m"'),
        ("paces", None, "must be in m, cm, mm, ft, us-ft, or .* not in 'paces'; .* gdal_edit.py"),
        ("paces", "m", "not in 'paces'"),
    ],
)
def test_heights_of_tiffs_are_in_the_unit_that_they_state(
    tmp_path: Path, stated: str | None, unit: Any, metres: float | str
) -> None:
    """Feet of the recipe are those of the file; what contradicts it or is unknown is refused."""
    rasterio = pytest.importorskip("rasterio")
    path = tmp_path / "map.tif"
    form = {"width": 2, "height": 1, "count": 1, "dtype": "int16", "crs": "EPSG:25830"}
    corner = rasterio.Affine(2, 0, 500000, 0, -2, 4800000)
    with rasterio.open(path, "w", driver="GTiff", transform=corner, **form) as file:
        file.write(np.array([[[100, 200]]], np.int16))
        file.scales, file.offsets = [0.5], [10.0]
        if stated is not None:
            file.units = (stated,)
    if isinstance(metres, str):
        with pytest.raises(ProblemError, match=metres):
            read_raster(path, unit=unit)
        return
    heights = read_raster(path, unit=unit).values[:, 0]
    np.testing.assert_allclose(heights, np.array([60, 110]) * metres, rtol=1e-12)


@pytest.mark.parametrize(("vertical", "metres"), [("6360", US_FOOT), ("8228", 0.3048), ("5703", 1)])
def test_vertical_systems_of_tiffs_tell_the_unit(
    tmp_path: Path, vertical: str, metres: float
) -> None:
    """Where the band says none, the compound reference system does."""
    rasterio = pytest.importorskip("rasterio")
    path = tmp_path / "map.tif"
    form = {"width": 1, "height": 1, "count": 1, "dtype": "float64"}
    corner = rasterio.Affine(2, 0, 500000, 0, -2, 4800000)
    crs = f"EPSG:26913+{vertical}"
    with rasterio.open(path, "w", driver="GTiff", transform=corner, crs=crs, **form) as file:
        file.write(np.array([[[90.0]]]))
    assert read_raster(path).values == pytest.approx(90 * metres, rel=1e-9)
    if metres != 1:
        assert read_raster(path, unit="ft").values == pytest.approx(90 * metres, rel=1e-9)


@pytest.mark.parametrize(
    ("system", "unit", "words"),
    [
        ("32633+5715", None, "must have heights, which count upwards, not depths"),
        ("32633+5715", "m", "must have heights, which count upwards, not depths"),
        ("26913+6360", "m", "must state the same unit, not m and US survey foot; .* -units"),
        ("26913+5703", "ft", "must state the same unit, not ft and metre; .* -units"),
        ("26913+6360", "ft", US_FOOT),
        ("26913+5703", "metres", 1.0),
    ],
)
def test_bands_of_tiffs_do_not_contradict_the_vertical_system(
    tmp_path: Path, system: str, unit: str | None, words: Any
) -> None:
    """A unit of the band's own does not make heights of depths, or metres of feet."""
    rasterio = pytest.importorskip("rasterio")
    path = tmp_path / "map.tif"
    form = {"width": 1, "height": 1, "count": 1, "dtype": "float64", "crs": f"EPSG:{system}"}
    corner = rasterio.Affine(2, 0, 500000, 0, -2, 4800000)
    with rasterio.open(path, "w", driver="GTiff", transform=corner, **form) as file:
        file.write(np.array([[[90.0]]]))
        if unit is not None:
            file.units = (unit,)
    if isinstance(words, str):
        with pytest.raises(ProblemError, match=words):
            read_raster(path)
    else:
        assert read_raster(path).values == pytest.approx(90 * words, rel=1e-9)
