"""QGIS reads the flights that are written for maps; skipped where it is not installed."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from test_cli import Run
from test_earth_files import ELLIPSOID, plan, write

import cocap_opt as co
from cocap_opt.missions.earth_tracks import colour_of

SCRIPT = Path(__file__).parents[1] / "support" / "qgis_layers.py"
START = "2026-05-01T10:00:00+02:00"
DELFT = (4.36, 52.01, 4.37, 52.02)  # degrees around the built-in place: west, south, east, north


__all__ = ["plan"]  # a fixture, used by its name


def python_of_qgis() -> str:
    """The Python that has QGIS, which is Debian's own; skips the test if there is none."""
    for python in ("/usr/bin/python3", sys.executable):
        try:
            done = subprocess.run(
                [python, "-c", "import qgis.core"], capture_output=True, check=False, timeout=60
            )
        except OSError:
            continue
        if done.returncode == 0:
            return python
    pytest.skip("needs QGIS and its Python: apt-get install --no-install-recommends python3-qgis")


def layers(folder: Path, first: str, seconds: float, *files: Path) -> list[dict[str, Any]]:
    """The layers that QGIS finds in files; it draws them into a picture of the folder."""
    done = subprocess.run(
        [python_of_qgis(), SCRIPT, folder / "map.png", first, str(seconds), *files],
        capture_output=True, text=True, check=False, timeout=120, env={"LC_ALL": "C.UTF-8"},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    found: list[dict[str, Any]] = json.loads(done.stdout)["layers"]
    assert all(layer["valid"] for layer in found)
    return found


def fly(capsys: pytest.CaptureFixture[str], scene: Path, plan: Path, path: Path) -> Path:
    """Writes a smooth flight."""
    start = () if path.suffix == ".csv" else ("--start", START)
    run = Run(capsys, "fly", scene, plan, "--smooth", *start, "-o", path)
    assert run.code == 0, run.err
    return path


@pytest.fixture(scope="module")
def delft(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """The built-in place as a file, and a plan for it."""
    folder = tmp_path_factory.mktemp("delft")
    scene, plan = folder / "delft.json", folder / "plan.json"
    problem = co.load("delft")
    found = co.plan(problem, "sequential").plan
    assert found is not None
    co.save(scene, problem)
    co.save(plan, found, problem)
    return scene, plan


def points(layer: dict[str, Any]) -> Any:
    """Longitudes, latitudes and heights [n, 3] of all features, in their order."""
    return np.array([at for feature in layer["features"] for at in feature["points"]], dtype=float)


@pytest.mark.slow(seconds=30)
def test_qgis_shows_a_flight_over_delft(
    tmp_path: Path, delft: tuple[Path, Path], capsys: pytest.CaptureFixture[str]
) -> None:
    """All files have the same places; numbers are numbers, times are times, colours are drawn."""
    python_of_qgis()
    files = [fly(capsys, *delft, tmp_path / f"flight.{end}") for end in ("geojson", "kml", "csv")]
    found = layers(tmp_path, "2026-05-01T08:00:04Z", 4.0, *files)
    table = found.pop()
    assert [(layer["name"], layer["kind"], len(layer["features"])) for layer in found] == [
        ("delft", "Point", 65), ("delft", "LineString", 9), ("delft", "Polygon", 56),
        ("drones", "LineStringZ", 5), ("people", "LineStringZ", 4), ("footprints", "Polygon", 55),
        ("no-fly zones", "Polygon", 1), ("take-off and landing", "Point", 10),
    ]  # fmt: skip
    assert (table["kind"], len(table["features"])) == ("PointZ", 5 * 101)
    for layer in (*found, table):
        assert layer["crs"] == "EPSG:4326"
        west, south, east, north = layer["box"]
        assert DELFT[0] < west < east < DELFT[2] and DELFT[1] < south < north < DELFT[3]
    steps, lines, areas, drones, *_ = found
    np.testing.assert_allclose(points(drones)[:, :2], points(table)[:, :2], atol=1e-8)
    np.testing.assert_allclose(points(drones)[:, 2], points(table)[:, 2], atol=1e-3)
    np.testing.assert_allclose(points(lines)[: 5 * 101, :2], points(table)[:, :2], atol=1e-8)
    for name in ("t", "yaw", "pitch", "above_ground", "above_takeoff", "above_sea"):
        assert steps["types"][name] == "Real"
    assert steps["types"]["time"] == areas["types"]["time"] == "DateTime"
    (step,) = (
        feature["values"] for feature in steps["features"]
        if (feature["values"]["drone"], feature["values"]["step"]) == (2, 3)
    )  # fmt: skip
    assert step["time"] == "2026-05-01T08:00:12.000Z"
    row = table["features"][2 * 101 + 30]["values"]
    assert row["t"] == step["t"] == 12
    assert step["above_sea"] == pytest.approx(row["above_sea"], abs=1e-3)
    line = lines["features"][0]["values"]["coordinateProperties"]
    assert len(line["above_sea"]) == 101
    # Of the second step: a point and a footprint of each drone, and all tracks of KML.
    assert [layer["shown"] for layer in found[:6]] == [5, 0, 5, 5, 4, 5]
    drawn = np.array(Image.open(tmp_path / "map.png").convert("RGB"), dtype=int)
    for drone in range(5):
        colour = [int(colour_of(drone)[at : at + 2], 16) for at in (1, 3, 5)]
        assert (abs(drawn - colour).max(axis=2) < 8).sum() > 50


@pytest.mark.slow(seconds=5)
def test_qgis_reads_heights_and_lines_that_are_cut(
    tmp_path: Path, plan: co.Plan, capsys: pytest.CaptureFixture[str]
) -> None:
    """Heights above the ellipsoid are Z; flights over the antimeridian have two parts."""
    python_of_qgis()
    scene, file = write(tmp_path, plan, "EPSG:32701", (-16.8, 179.99995), ELLIPSOID)
    files = [fly(capsys, scene, file, tmp_path / f"flight.{end}") for end in ("geojson", "kml")]
    read = layers(tmp_path, "2026-05-01T08:00:00Z", 0.5, *files)
    assert [(layer["name"], layer["kind"], len(layer["features"])) for layer in read] == [
        ("scene", "PointZ", 14), ("scene", "LineStringZ", 3), ("scene", "Polygon", 10),
        ("drones", "LineStringZ", 2), ("people", "LineStringZ", 1), ("footprints", "Polygon", 10),
        ("take-off and landing", "Point", 4),
    ]  # fmt: skip
    # GDAL has another name for WGS 84 with heights above its ellipsoid.
    assert {layer["crs"] for layer in read} <= {"EPSG:4326", "EPSG:4979"}
    steps, lines, *_ = read
    assert steps["types"]["above_ellipsoid"] == "Real"
    for feature in steps["features"]:
        if feature["values"]["kind"] == "step":
            assert [at[2] for at in feature["points"]] == [feature["values"]["above_ellipsoid"]]
    walk = lines["features"][-1]["points"]
    longitudes = [at[0] for at in walk]
    assert longitudes.count(180.0) == longitudes.count(-180.0) == 1
    assert len(walk) == 5 + 2
