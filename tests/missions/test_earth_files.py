import json
import re
from datetime import UTC, datetime, timedelta
from itertools import pairwise
from pathlib import Path
from typing import Any

import fastkml
import numpy as np
import pandas as pd
import pyproj
import pytest
import shapely
from fastkml.gx import Track as KmlTrack
from fastkml.utils import find_all
from hypothesis import given
from hypothesis import strategies as st
from strategies import examples
from test_cli import Run

import cocap_opt as co
from cocap_opt.missions.earth_tracks import EarthTrack

RECIPE = """
steps = 4
step = 0.5
[map]
size = [12, 8]
[[walk]]
points = [[3, 4], [9, 4]]
[[drones]]
starts = [{{ x = 2.5, y = 2.5 }}, {{ x = 2.5, y = 6.5, heading = 45 }}]
tilts = [10, 40]
{earth}
"""
EARTH = """[earth]
crs = "{crs}"
latitude = {latitude}
longitude = {longitude}
{heights}
"""
# The north of the second one's grid is 4.7 degrees off true north.
PLACES = {"EPSG:32719": (-33.4, -70.6), "EPSG:2154": (48.85, -3.5)}
SEA, ELLIPSOID = (f'height = 20.0\nheights = "above-{name}"' for name in ("sea", "ellipsoid"))
WGS84 = pyproj.Geod(ellps="WGS84")
EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


def write(
    folder: Path, plan: co.Plan, crs: str = "", place: Any = None, heights: str = ""
) -> tuple[Path, Path]:
    """The files of a scene at a place, and of a plan for it."""
    latitude, longitude = place or PLACES.get(crs, (0, 0))
    earth = EARTH.format(crs=crs, latitude=latitude, longitude=longitude, heights=heights)
    scene, file = folder / "scene.toml", folder / "plan.json"
    scene.write_text(RECIPE.format(earth=earth if crs else ""))
    co.save(file, plan, co.load(scene))
    return scene, file


@pytest.fixture(scope="module")
def plan(tmp_path_factory: pytest.TempPathFactory) -> co.Plan:
    """A plan of the scene, which is the same wherever it is on the Earth."""
    scene = tmp_path_factory.mktemp("earth") / "scene.toml"
    scene.write_text(RECIPE.format(earth=""))
    found = co.plan(co.load(scene), "sequential").plan
    assert found is not None
    return found


class Truth:
    """Where drones and people are, by pyproj alone from the coordinates of the scene."""

    def __init__(self, scene: Path, plan: co.Plan, crs: str, smooth: bool) -> None:
        problem = co.load(scene)
        self.table = co.trajectory(problem.replace(earth=None), plan, smooth=smooth)
        self.walk = problem.actors[0].poses
        self._system = pyproj.Proj(crs)
        self._corner = self._system(*PLACES[crs][::-1])

    def degrees(self, x: Any, y: Any) -> Any:
        """Longitudes and latitudes."""
        return self._system(self._corner[0] + x, self._corner[1] + y, inverse=True)

    def compass(self, longitude: float, latitude: float, yaw: float) -> float:
        """The azimuth of a yaw (degrees)."""
        factors = self._system.get_factors(longitude, latitude)
        return float((90 - yaw + factors.meridian_convergence) % 360)

    def of_drone(self, drone: int) -> pd.DataFrame:
        """The rows of a drone."""
        return self.table[self.table.drone == drone]


def metres(one: Any, other: Any) -> float:
    """The largest distance between points, each with longitudes and latitudes."""
    _, _, found = WGS84.inv(*map(np.asarray, (*one, *other)))
    return float(np.max(found))


def seconds(text: str, start: datetime = EPOCH) -> float:
    """Seconds from the start to a date."""
    return (datetime.fromisoformat(text) - start) / timedelta(seconds=1)


@pytest.mark.parametrize(("crs", "heights"), [("EPSG:32719", SEA), ("EPSG:2154", ELLIPSOID)])
def test_geojson_has_tracks_steps_footprints_and_walks(
    tmp_path: Path, plan: co.Plan, capsys: pytest.CaptureFixture[str], crs: str, heights: str
) -> None:
    """Shapely reads them; they are to a centimetre where pyproj has them, at the right times."""
    (scene, file), path = write(tmp_path, plan, crs, heights=heights), tmp_path / "flight.geojson"
    run = Run(capsys, "fly", scene, file, "--smooth", "-o", path, "--json")
    assert run.code == 0, run.err
    truth = Truth(scene, plan, crs, smooth=True)
    content = json.loads(path.read_text())
    assert (content["type"], content["name"]) == ("FeatureCollection", "scene")
    by_kind: dict[str, list[tuple[Any, dict[str, Any]]]] = {}
    for feature in content["features"]:
        row = shapely.geometry.shape(feature["geometry"]), feature["properties"]
        by_kind.setdefault(row[1]["kind"], []).append(row)
    assert {kind: len(rows) for kind, rows in by_kind.items()} == {
        "track": 2, "step": 10, "footprint": 10, "walk": 1, "take-off": 2, "landing": 2,
    }  # fmt: skip
    for line, values in by_kind["track"]:
        own = truth.of_drone(values["drone"])
        assert metres(line.xy, truth.degrees(own.x, own.y)) < 0.01
        np.testing.assert_allclose([seconds(t) for t in values["coordTimes"]], own.t)
        of_points = values["coordinateProperties"]
        np.testing.assert_allclose(of_points["t"], own.t)
        np.testing.assert_allclose(of_points["above_ground"], own.z)
        assert line.has_z == (heights == ELLIPSOID)
        if line.has_z:
            np.testing.assert_allclose(
                shapely.get_coordinates(line, include_z=True)[:, 2], own.z + 20
            )
    name = "above_sea" if heights == SEA else "above_ellipsoid"
    for point, values in by_kind["step"]:
        own = truth.of_drone(values["drone"]).iloc[10 * values["step"]]
        assert metres((point.x, point.y), truth.degrees(own.x, own.y)) < 0.01
        assert (values["t"], seconds(values["time"])) == (own.t, own.t)
        off = (values["yaw"] - truth.compass(point.x, point.y, own.yaw) + 180) % 360 - 180
        assert abs(off) < 0.01
        assert values["pitch"] == pytest.approx(own.pitch)
        assert (values[name], values["above_takeoff"]) == pytest.approx((25.0, 5.0))
    for ring, values in by_kind["footprint"]:
        assert ring.is_valid and ring.exterior.is_ccw
        assert values["reach"] == pytest.approx(50)
        # Level ground: the camera looks there, from 5 m.
        at = by_kind["step"][5 * values["drone"] + values["step"]]
        ahead = WGS84.fwd(at[0].x, at[0].y, at[1]["yaw"], 5 / np.tan(-np.radians(at[1]["pitch"])))
        assert ring.contains(shapely.Point(ahead[:2]))
        assert max(WGS84.inv(at[0].x, at[0].y, *c)[2] for c in ring.exterior.coords) < 50.1
    ((line, values),) = by_kind["walk"]
    assert metres(line.xy, truth.degrees(*truth.walk[:5, :2].T)) < 0.01
    assert [seconds(t) for t in values["coordTimes"]] == [0, 0.5, 1, 1.5, 2]


@pytest.mark.parametrize(("crs", "heights"), [("EPSG:32719", SEA), ("EPSG:2154", ELLIPSOID)])
def test_kml_has_tracks_with_times_and_angles(
    tmp_path: Path, plan: co.Plan, capsys: pytest.CaptureFixture[str], crs: str, heights: str
) -> None:
    """Fastkml reads it and finds no fault by KML's schema; altitudes are as high as said."""
    (scene, file), path = write(tmp_path, plan, crs, heights=heights), tmp_path / "flight.kml"
    start = datetime(2026, 5, 1, 8, tzinfo=UTC)
    words = "--every", 0.25, "--start", "2026-05-01T10:00:00+02:00"
    run = Run(capsys, "fly", scene, file, *words, "-o", path, "--json")
    assert run.code == 0, run.err
    truth = Truth(scene, plan, crs, smooth=False)
    assert fastkml.validator.validate(file_to_validate=path)
    document = fastkml.KML.parse(path, strict=True)
    *drones, walk = find_all(document, of_type=KmlTrack)
    for drone, track in enumerate(drones):
        own, rows = truth.of_drone(drone), track.track_items
        assert len(rows) == 9
        times = [(row.when.dt - start) / timedelta(seconds=1) for row in rows]
        np.testing.assert_allclose(times, np.arange(9) / 4)
        at = rows[::2]
        places = [row.coord.x for row in at], [row.coord.y for row in at]
        assert metres(places, truth.degrees(own.x, own.y)) < 0.01
        np.testing.assert_allclose([row.coord.z for row in at], 25 if heights == SEA else 5)
        for row, yaw in zip(at, own.yaw, strict=True):
            off = row.angle.heading - truth.compass(row.coord.x, row.coord.y, yaw)
            assert abs((off + 180) % 360 - 180) < 0.01
        mode = fastkml.enums.AltitudeMode
        expected = mode.absolute if heights == SEA else mode.relative_to_ground
        assert track.altitude_mode == walk.altitude_mode == expected
    placemarks = list(find_all(document, of_type=fastkml.Placemark))
    prints = [place for place in placemarks if isinstance(place.geometry, fastkml.geometry.Polygon)
              or "step" in place.name]  # fmt: skip
    assert len(prints) == 10
    assert prints[1].times.begin.dt - start == timedelta(seconds=0.5)
    assert prints[1].times.end.dt - start == timedelta(seconds=1)


def test_files_are_cut_at_the_antimeridian(
    tmp_path: Path, plan: co.Plan, capsys: pytest.CaptureFixture[str]
) -> None:
    """No line or polygon of GeoJSON crosses it, and none gets shorter or smaller."""
    lines = []
    for longitude in (179.99995, 179.9):
        scene, file = write(tmp_path, plan, "EPSG:32701", (-16.8, longitude))
        path = tmp_path / "flight.geojson"
        assert Run(capsys, "fly", scene, file, "-o", path).code == 0
        shapes = [
            shapely.geometry.shape(feature["geometry"])
            for feature in json.loads(path.read_text())["features"]
        ]
        kept = [shape for shape in shapes if shape.geom_type != "Point"]
        lines.append([(shape.length, shape.area) for shape in kept])
        parts = [part for shape in kept for part in getattr(shape, "geoms", [shape])]
        assert all(part.bounds[2] - part.bounds[0] < 0.01 for part in parts)
        cut = sum(shape.geom_type.startswith("Multi") for shape in kept)
        assert (cut > 3) == (longitude > 179.99)
        if cut:
            assert Run(capsys, "fly", scene, file, "-o", tmp_path / "flight.kml").code == 0
            assert fastkml.validator.validate(file_to_validate=tmp_path / "flight.kml")
    for cut_one, whole in zip(*lines, strict=True):
        assert cut_one[1] == pytest.approx(whole[1], rel=1e-2)


@examples(50)
@given(st.lists(st.floats(-0.3, 0.3), min_size=1, max_size=8), st.sampled_from([-180.0, 0, 179.9]))
def test_tracks_that_are_cut_stay_whole(steps: list[float], first: float) -> None:
    """Parts follow each other without a jump but of 360 degrees, each on one side, in time."""
    along = first + np.cumsum([0.0, *steps])
    longitude = (along + 180) % 360 - 180
    t = np.arange(len(along), dtype=np.float64)
    parts = EarthTrack(t, longitude, -t, {"above_sea": 2 * t}, {"yaw": (350 + 5 * t) % 360}).parts()
    assert parts[0].t[0] == 0 and parts[-1].t[-1] == t[-1]
    for part in parts:
        assert len(part.t) >= 2
        assert (np.abs(part.longitude) <= 180 + 1e-9).all()
        assert (np.abs(np.diff(part.longitude)) <= 0.3 + 1e-9).all()
        turns = (np.interp(part.t, t, along) - part.longitude) / 360
        np.testing.assert_allclose(turns, np.rint(turns), atol=1e-9)
        np.testing.assert_allclose(part.heights["above_sea"], 2 * part.t)
    for one, other in pairwise(parts):
        assert one.t[-1] == other.t[0]
        assert abs(one.longitude[-1]) == pytest.approx(180)


def test_odd_flights_are_written(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """One step, a drone that stays, nobody to film, a map that does not tell its ground."""
    problem = co.Problem(
        name="odd <&> \ud83d", height_map=co.HeightMap(heights=np.arange(30.0).reshape(6, 5)),
        robots=[co.Robot(start=co.State(1, 1), motion=co.Motion(layers=(40.0,)))], actors=[],
        earth=co.Earth(crs="EPSG:2056", origin=(46.9, 7.4), heights="ellipsoid"), horizon=1,
        step=0.1,
    )  # fmt: skip
    scene, plan = tmp_path / "scene.json", tmp_path / "plan.json"
    co.save(scene, problem)
    co.save(plan, co.Plan(paths=[[co.State(1, 1)] * 2]), problem)
    for suffix in ("kml", "geojson"):
        path = tmp_path / f"flight.{suffix}"
        run = Run(capsys, "fly", scene, plan, "--hovering", "--smooth", "-o", path, "--json")
        assert run.code == 0, run.err
    assert fastkml.validator.validate(file_to_validate=tmp_path / "flight.kml")
    (track,) = find_all(fastkml.KML.parse(tmp_path / "flight.kml"), of_type=KmlTrack)
    np.testing.assert_allclose([row.coord.z for row in track.track_items], 34.0)
    features = json.loads(path.read_text())["features"]
    assert shapely.geometry.shape(features[0]["geometry"]).length == 0
    assert {"above_surface", "above_ellipsoid"} <= set(
        features[0]["properties"]["coordinateProperties"]
    )
    # Swiss heights are above Bessel's ellipsoid, which is not that of WGS 84.
    assert not shapely.geometry.shape(features[0]["geometry"]).has_z


def test_files_of_the_earth_are_refused_in_one_line(
    tmp_path: Path, plan: co.Plan, capsys: pytest.CaptureFixture[str]
) -> None:
    """The line says what is missing; nothing is written."""
    (tmp_path / "nowhere").mkdir()
    nowhere = write(tmp_path / "nowhere", plan)
    scene, file = write(tmp_path, plan, "EPSG:2154")
    for words, ending, expected in (
        (nowhere, "kml", r"nowhere.scene.toml: earth: must say where the scene is"),
        (nowhere, "geojson", r"nowhere.scene.toml: earth: must say where the scene is"),
        ((scene, file, "--local"), "geojson", "--local"),
        ((scene, file, "--start", "2026-05-01T10:00:00Z"), "csv", "--start: must be left out"),
        ((scene, file, "--start", "2026-05-01T10:00:00"), "kml", "--start: .* offset from UTC"),
        ((scene, file, "--start", "noon"), "kml", "--start: must be a date"),
        ((scene, file, "--start", "9999-12-31T23:59:59Z"), "kml", "--start: must be earlier, as"),
        ((scene, file, "--every", "0.25"), "glb", "--every: must be left out for .glb"),
    ):
        path = tmp_path / f"flight.{ending}"
        run = Run(capsys, "fly", *words, "-o", path)
        assert run.code == 2
        (line,) = run.err.splitlines()
        assert re.search(expected, line), line
        assert not path.exists()
