import json
import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import rasterio
from rasterio.crs import CRS
from rasterio.transform import Affine

from cocap_opt.data import ProblemError
from cocap_opt.files.documents import SceneFile, problem_digest
from cocap_opt.flight.earth import Geodesy
from cocap_opt.problem import Earth, Problem
from cocap_opt.scenarios.earth import same_system
from cocap_opt.scenarios.earth.place import EarthTable
from cocap_opt.scenarios.earth.units import require_true
from cocap_opt.scenarios.recipe import read
from cocap_opt.world.workspace import HeightMap

pyproj = pytest.importorskip("pyproj")

RECIPE = """
steps = 2
[map]
{map}
[[drones]]
starts = [{{ x = {x}, y = {y}, height = 5 }}]
{more}
"""
# A projection's code and a place in it, m; the second is no UTM.
PLACES = {"EPSG:25830": (505_000.0, 4_789_000.0), "EPSG:2154": (652_000.0, 6_862_000.0)}


def write_tif(path: Path, crs: str, east: float, north: float) -> None:
    """A flat GeoTIFF of 8 x 6 m whose lower left corner is there."""
    with rasterio.open(
        path, "w", driver="GTiff", width=8, height=6, count=1, dtype="float32", crs=crs,
        transform=Affine(1, 0, east, 0, -1, north + 6),
    ) as file:  # fmt: skip
        file.write(np.zeros((6, 8), dtype=np.float32), 1)


def recipe(
    folder: Path, *, crs: str = "", more: str = "", corner: tuple[float, float] = (0.0, 0.0)
) -> Problem:
    """The scene of a recipe; with `crs` its map is a GeoTIFF in that system."""
    east, north = PLACES.get(crs, corner)
    flat = f"size = [8, 6]\norigin = [{east}, {north}]"
    if crs:
        write_tif(folder / "map.tif", crs, east, north)
        flat = 'file = "map.tif"'
    path = folder / "scene.toml"
    path.write_text(RECIPE.format(map=flat, x=east + 2.5, y=north + 2.5, more=more))
    return read(path)


def degrees(problem: Problem, x: float, y: float) -> tuple[float, float]:
    """Latitude and longitude of a point of a scene."""
    from cocap_opt.flight.earth import Geodesy

    assert problem.earth is not None
    geodesy = Geodesy(problem.earth, problem.height_map.centre(0, 0))
    latitude, longitude = geodesy.degrees(np.array([x]), np.array([y]))
    return float(latitude[0]), float(longitude[0])


@pytest.mark.parametrize("crs", PLACES)
def test_a_map_says_where_it_is(tmp_path: Path, crs: str) -> None:
    """Its system goes through the scene and its file; points are where the projection has them."""
    problem = recipe(tmp_path, crs=crs)
    assert problem.earth == Earth(crs=crs)
    SceneFile(problem=problem).save(tmp_path / "scene.json")
    again = SceneFile.read(tmp_path / "scene.json").problem
    assert again.earth == problem.earth
    assert problem_digest(again) == problem_digest(problem)
    east, north = PLACES[crs]
    found = degrees(problem, east + 3, north + 4)
    longitude, latitude = pyproj.Proj(crs)(east + 3, north + 4, inverse=True)
    assert found == pytest.approx((latitude, longitude), abs=1e-9)
    # By the ellipsoid alone: the point 100 m further east is 100 m away, times the scale.
    other = degrees(problem, east + 103, north + 4)
    _, _, metres = pyproj.Geod(ellps="GRS80").inv(*found[::-1], *other[::-1])
    scale = pyproj.Proj(crs).get_factors(longitude, latitude).parallel_scale
    assert metres == pytest.approx(100 / scale, abs=1e-3)


def test_known_points_are_found() -> None:
    """A meridian's length on the ellipsoid, and the false origin of Lambert-93."""
    flat = recipe_problem(Earth(crs="EPSG:25830"))
    latitude, longitude = degrees(flat, 500_000.0, 4_789_000.0)
    assert longitude == pytest.approx(-3.0, abs=1e-9)
    _, _, metres = pyproj.Geod(ellps="GRS80").inv(-3, 0, -3, latitude)
    assert metres == pytest.approx(4_789_000.0 / 0.9996, abs=1e-3)
    lambert = recipe_problem(Earth(crs="EPSG:2154"))
    assert degrees(lambert, 700_000.0, 6_600_000.0) == pytest.approx((46.5, 3.0), abs=1e-9)


def recipe_problem(earth: Earth) -> Problem:
    """A small scene at a place where both systems are defined."""
    from strategies import tiny

    x, y = PLACES[earth.crs]
    problem = tiny()
    return problem.replace(
        earth=earth, height_map=problem.height_map.replace(origin=(x, y)), actors=()
    )


def test_an_origin_is_where_it_is_said_to_be(tmp_path: Path) -> None:
    """The point x = y = 0 has the stated latitude and longitude; north is the grid's."""
    words = 'crs = "EPSG:2154"\nlatitude = 48.85\nlongitude = 2.35\n'
    height = 'height = 35.0\nheights = "above-ellipsoid"'
    problem = recipe(tmp_path, more=f"[earth]\n{words}{height}")
    assert problem.earth is not None
    assert (problem.earth.heights, problem.earth.base) == ("ellipsoid", 35.0)
    assert degrees(problem, 0.0, 0.0) == pytest.approx((48.85, 2.35), abs=1e-9)
    east, north = pyproj.Proj("EPSG:2154")(2.35, 48.85)
    longitude, latitude = pyproj.Proj("EPSG:2154")(east + 70, north - 30, inverse=True)
    assert degrees(problem, 70.0, -30.0) == pytest.approx((latitude, longitude), abs=1e-9)


def test_a_map_in_whose_system_no_flight_can_be_written_is_told(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """Not only after planning; a system of a site alone is no place on the Earth."""
    problem = recipe(tmp_path, crs="EPSG:2053", corner=(-30_000.0, 2_900_000.0))
    assert problem.earth is not None
    assert (
        "map: flights cannot be written in its reference system, which must have axes to the"
        in (caplog.text)
    )
    caplog.clear()
    (tmp_path / "map.asc").write_text(
        "ncols 2\nnrows 1\nxllcorner 0\nyllcorner 0\ncellsize 4\n0 0\n"
    )
    (tmp_path / "map.prj").write_text('LOCAL_CS["site",UNIT["metre",1],AXIS["X",EAST]]')
    path = tmp_path / "site.toml"
    path.write_text(RECIPE.format(map='file = "map.asc"', x=2.5, y=2.5, more=""))
    assert read(path).earth is None and "map:" not in caplog.text


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"more": '[earth]\ncrs = "EPSG:4326"'}, "crs: must be a projection in metres"),
        ({"more": '[earth]\ncrs = "EPSG:2263"'}, "crs: must be in metres, not US survey foot"),
        ({"more": '[earth]\ncrs = "EPSG:9999999"'}, "must be a known reference system"),
        ({"more": '[earth]\ncrs = "EPSG:3857"\nlatitude = 48\nlongitude = 2'}, "true metres"),
        # Where its metres are longest.
        ({"more": '[earth]\ncrs = "EPSG:3034"\nlatitude = 50\nlongitude = 10'}, "1.04 m long"),
        ({"more": '[earth]\ncrs = "EPSG:2053"'}, "axes to the east and to the north"),
        ({"more": "[earth]\nlatitude = 48.0\nlongitude = 2.0"}, "crs: must be given"),
        ({"more": '[earth]\ncrs = "EPSG:2154"\nlatitude = 48.0'}, "both must be given"),
        ({"more": '[earth]\ncrs = "EPSG:2154"\nheight = 3.0'}, "both must be given"),
        (
            {"crs": "EPSG:25830", "more": '[earth]\ncrs = "EPSG:2154"'},
            "left out, or the same as in",
        ),
        ({"crs": "EPSG:25830", "more": "[earth]\nlatitude = 43\nlongitude = -3"}, "left out"),
        (
            {"more": '[earth]\ncrs = "EPSG:27700"\nlatitude = 51.5\nlongitude = -0.1'},
            "needs uk_os_OSTN15.*, not installed here",
        ),
        (
            {"more": '[earth]\ncrs = "EPSG:2154"\nlatitude = 43.0\nlongitude = 170.0'},
            "is for another place than latitude 43, longitude 170",
        ),
    ],
)
def test_places_that_cannot_be_used_are_refused(
    tmp_path: Path, given: dict[str, Any], words: str
) -> None:
    """One line names the field; ballpark conversions, degrees and feet are among them."""
    with pytest.raises(ProblemError, match=rf"scene\.toml: earth.*{words}"):
        recipe(tmp_path, **given)


def test_a_projection_of_unknown_lengths_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Lengths that are no number are none that are true."""
    more = '[earth]\ncrs = "EPSG:3034"\nlatitude = 35\nlongitude = 10'
    assert recipe(tmp_path, more=more).earth is not None
    unknown = SimpleNamespace(meridional_scale=math.nan, parallel_scale=math.nan)
    monkeypatch.setattr(pyproj.Proj, "get_factors", lambda *_: unknown)
    with pytest.raises(ProblemError, match="must have true metres"):
        recipe(tmp_path, more=more)


def test_a_point_far_from_the_map_is_none_of_its_own(tmp_path: Path) -> None:
    """Coordinates of the system, with a latitude and longitude beside, would be added twice."""
    path = tmp_path / "scene.toml"
    where = '[earth]\ncrs = "EPSG:25830"\nlatitude = 43.26\nlongitude = -2.94'
    flat = "size = [8, 6]\norigin = [505000, 4790000]"
    path.write_text(RECIPE.format(map=flat, x=505002, y=4790002, more=where))
    with pytest.raises(ProblemError, match=r"earth: latitude, longitude: .* 4817 km from the map"):
        read(path)


def test_files_in_degrees_are_read_in_metres(tmp_path: Path) -> None:
    """Columns of latitude and longitude, and GeoJSON as its standard has it, are projected."""
    metres = np.array([[1.0, 2.0], [6.0, 2.0], [6.0, 5.0], [1.0, 2.0]])
    projection = pyproj.Proj("EPSG:32633")
    corner = projection(13.059, 52.401)
    degrees = [projection(*(corner + point), inverse=True) for point in metres]
    wall = {"type": "Polygon", "coordinates": [[list(place) for place in degrees]]}
    (tmp_path / "walls.geojson").write_text(json.dumps(wall))
    rows = [f"{t},{north!r},{east!r}" for t, (east, north) in enumerate(degrees[:3])]
    (tmp_path / "people.csv").write_text("\n".join(["id,t,lat,lon", *(f"1,{r}" for r in rows)]))
    files = (
        '[[walls]]\nfile = "walls.geojson"\npolygons = "obstacles"\nheight = 2\n'
        '[[tracks]]\nfile = "people.csv"\nids = [1]\n'
    )
    place = '[earth]\ncrs = "EPSG:32633"\nlatitude = 52.401\nlongitude = 13.059'
    problem = recipe(tmp_path, more=files + place)
    np.testing.assert_allclose(problem.actors[0].poses[:, :2], metres[:3], atol=1e-6)
    (walls,) = problem.meshes
    np.testing.assert_allclose(walls.vertices.min(axis=0), [1, 2, 0], atol=1e-6)
    np.testing.assert_allclose(walls.vertices.max(axis=0), [6, 5, 2], atol=1e-6)
    with pytest.raises(ProblemError, match=r"walls\[0\]: .*: need \[earth\] in the recipe"):
        recipe(tmp_path, more=files)
    swapped = {"type": "Polygon", "coordinates": [[place[::-1] for place in degrees]]}
    (tmp_path / "walls.geojson").write_text(json.dumps(swapped))
    with pytest.raises(ProblemError, match=r"are they swapped\? They must be near the map, which"):
        recipe(tmp_path, more=files + place)


def test_degrees_that_are_swapped_are_asked_about(tmp_path: Path) -> None:
    """A system is made for one place only of the two."""
    place = '[earth]\ncrs = "EPSG:32633"\nlatitude = 13.059\nlongitude = 52.401'
    with pytest.raises(ProblemError, match=r"earth: latitude, longitude: are they swapped\?"):
        recipe(tmp_path, more=place)


def test_a_map_at_the_origin_of_its_system_is_in_none(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """Coordinates of the scene's own would lie at latitude 0; a map there is doubted at least."""
    with pytest.raises(
        ProblemError, match=r"must be given, unless origin of \[map\] .*latitude 0\.0"
    ):
        recipe(tmp_path, more='[earth]\ncrs = "EPSG:32633"')
    assert not caplog.text
    recipe(tmp_path, more='[earth]\ncrs = "EPSG:32633"', corner=(5e5, 9.0))
    assert "latitude 0.0001, longitude 15.0000: is that right?" in caplog.text


def test_maps_of_different_systems_are_refused(tmp_path: Path) -> None:
    """A map and its ground must be in one system."""
    write_tif(tmp_path / "ground.tif", "EPSG:25831", *PLACES["EPSG:25830"])
    write_tif(tmp_path / "map.tif", "EPSG:25830", *PLACES["EPSG:25830"])
    path = tmp_path / "scene.toml"
    files = 'file = "map.tif"\nground = "ground.tif"'
    path.write_text(RECIPE.format(map=files, x=505_002, y=4_789_002, more=""))
    with pytest.raises(ProblemError, match="ground: must be in the reference system of the map"):
        read(path)


UTM32 = "+proj=utm +zone=32 +datum=WGS84 +units=m +no_defs"


@pytest.mark.parametrize(
    ("one", "other", "is_same"),
    [
        (UTM32, UTM32.replace("=32", "=33"), False),
        (UTM32, "EPSG:32632", True),
        ("EPSG:32633", UTM32, False),
        ("EPSG:25832+5783", "EPSG:25832", True),
        ("EPSG:25832+EPSG:5783", "EPSG:25832", True),
        ("EPSG:5555", "EPSG:25832", True),  # the code of a compound system
        ("EPSG:5555", "EPSG:25833", False),
    ],
)
def test_systems_are_compared_without_their_heights(one: str, other: str, is_same: bool) -> None:
    """In all spellings, and not by what comes before a plus."""
    for crs in {one, CRS.from_user_input(one).to_wkt()}:
        assert same_system(crs, other) is same_system(other, crs) is is_same


def test_heights_that_contradict_the_system_are_refused() -> None:
    """A system with heights above the sea has none above the ellipsoid."""
    table = EarthTable(height=0.0, heights="above-ellipsoid")
    flat = HeightMap(heights=np.zeros((3, 3)), resolution=1.0, origin=(500000.0, 5800000.0))
    with pytest.raises(ProblemError, match='heights: must be "above-sea", as the reference'):
        table.earth("EPSG:25832+5783", flat)
    assert table.earth("EPSG:25832", flat).heights is not None
    solid = pyproj.CRS("EPSG:25832").to_3d().to_wkt()
    assert table.earth(solid, flat).heights == "ellipsoid"
    latitude, _ = Geodesy(table.earth(solid, flat), (5e5, 5.8e6)).degrees(*np.full((2, 1), 5.8e6))
    assert np.isfinite(latitude).all()
    with pytest.raises(ProblemError, match='heights: must be "above-ellipsoid", as the reference'):
        EarthTable(height=0.0, heights="above-sea").earth(solid, flat)


@pytest.mark.parametrize(
    ("code", "at", "place"),
    [
        ("EPSG:27572", (600000.0, 2400000.0), (48.5987, 2.3365)),  # grads, from Paris
        ("EPSG:31281", (-25000.0, 5228000.0), (47.189, 10.002)),  # degrees, from Ferro
    ],
)
def test_systems_from_other_meridians_are_where_they_are(
    code: str, at: tuple[float, float], place: tuple[float, float]
) -> None:
    """Latitudes and longitudes of such a system itself are no degrees from Greenwich."""
    geodesy = Geodesy(Earth(crs=code), at)
    latitude, longitude = geodesy.degrees(np.array(at[:1]), np.array(at[1:]))
    assert (latitude[0], longitude[0]) == pytest.approx(place, abs=2e-3)
    require_true(code, *at)
