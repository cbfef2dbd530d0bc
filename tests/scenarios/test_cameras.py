"""Real cameras by name, and gimbals."""

import csv
import math
from pathlib import Path

import pytest
from others import data
from strategies import tiny

from cocap_opt.cli.commands import run
from cocap_opt.data import ProblemError
from cocap_opt.formulations import EXACT
from cocap_opt.planners import PLANNERS
from cocap_opt.problem import Camera, Cone
from cocap_opt.referee import check
from cocap_opt.scenarios import load_scene
from cocap_opt.scenarios.hardware import CAMERAS, with_cameras
from cocap_opt.stop import never
from cocap_opt.vision.default_weights import default_weights


def test_angles_of_view_are_those_of_the_makers() -> None:
    """90 degrees of AirSim, 1.74 and 2.0 rad of the Gazebo models."""
    assert math.degrees(2 * CAMERAS["airsim"].half_angle) == pytest.approx(90.0)
    assert 2 * CAMERAS["px4-mono"].half_angle == pytest.approx(1.74, abs=1e-3)
    assert 2 * CAMERAS["px4-gimbal"].half_angle == pytest.approx(2.0, abs=1e-3)


def test_cameras_are_those_of_the_table_of_facts() -> None:
    """Every camera that the table has, number for number."""
    path = data("cameras/cameras.csv")
    ours = {(c.width, c.height, c.focal) for c in CAMERAS.values()}
    with path.open() as file:
        for row in csv.DictReader(file):
            assert (int(row["width"]), int(row["height"]), float(row["fx_px"])) in ours, row["name"]


def test_a_gimbal_sees_no_less() -> None:
    """With more pitches to choose from, the optimum is at least as high."""
    problem = load_scene("tiny-share")
    tilt = math.degrees(problem.robots[0].camera.tilts[0])
    fixed = EXACT["brute-force"](problem).value
    gimbal = with_cameras(problem, tilts=(tilt - 10, tilt, tilt + 10))
    assert all(robot.start.pitch == 1 for robot in gimbal.robots)
    assert EXACT["branch-and-price"](gimbal).value >= fixed * (1 - 1e-6)


@pytest.mark.slow
def test_all_planners_take_teams_of_different_cameras() -> None:
    """A gimbal beside a fixed camera beside a cone, at other heights and speeds."""
    problem = tiny()
    first, second = problem.robots
    gimbal = first.replace(camera=CAMERAS["airsim"].replace(tilts=(0.2, 0.6, 1.0)))
    motion = second.motion.replace(layers=(3.0, 5.0), radius=2)
    mixed = problem.replace(
        robots=(gimbal, second.replace(motion=motion, camera=CAMERAS["px4-mono"])),
        horizon=1,
    )
    best = EXACT["brute-force"](mixed).value
    assert best > 0
    for name, planner in PLANNERS.items():
        result = planner(mixed, never)
        if result.plan is not None and check(mixed, result.plan).valid:
            assert result.value <= best * (1 + 1e-9), name
    for name in ("branch-and-price", "highs", "cp-sat"):
        assert EXACT[name](mixed).value == pytest.approx(best, rel=1e-6), name


def test_what_cannot_be_exchanged_is_said() -> None:
    """Unknown names, and sensors that have no picture."""
    problem = tiny()
    with pytest.raises(ProblemError, match="must be one of"):
        with_cameras(problem, "kodak")
    with pytest.raises(ProblemError, match=r"not 'airsin'; did you mean airsim\?$"):
        with_cameras(problem, "airsin")
    cones = problem.replace(robots=tuple(r.replace(camera=Cone()) for r in problem.robots))
    for name, tilts in (("airsim", None), (None, (10.0,))):
        with pytest.raises(ProblemError, match="pinhole"):
            with_cameras(cones, name, tilts)
    with pytest.raises(ProblemError, match="tilts"):
        with_cameras(problem, tilts=(91.0,))


@pytest.mark.slow
def test_export_exchanges_cameras(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The scene file has the camera and the pitches that were asked for."""
    path = tmp_path / "scene.json"
    words = ["export", "tiny-share", "--camera", "skydio-2", "--tilts", "0,20,40", "-o", str(path)]
    plain = load_scene("tiny-share")
    assert run(words) == 0
    camera = load_scene(str(path)).robots[0].camera
    assert isinstance(camera, Camera)
    assert (camera.width, camera.focal) == (4056, 2389.2)
    assert [round(math.degrees(tilt)) for tilt in camera.tilts] == [0, 20, 40]
    assert run([*words[:2], "--tilts", "steep", "-o", str(path)]) == 2
    assert run([*words[:2], "--tilts", "10,60,30", "-o", str(path)]) == 2
    assert run([*words[:2], "--camera", "kodak", "-o", str(path)]) == 2
    assert "kodak" in capsys.readouterr().err
    assert run(["export", "tiny-share", "--views", "2", *words[2:]]) == 0
    views = load_scene(str(path)).objective.views
    assert views is not None
    # by the camera that the drones then have: those of the scene have 60 px
    assert views.weights(2)[0] > 50 * default_weights(plain.actors, plain.robots)[0] > 0
    assert run(["scenes"]) == 0
    assert "dji-mavic-pro" in capsys.readouterr().out
