import logging
import math
import re
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from flown_recipes import drawn_recipe, fate
from test_cli import Run

import cocap_opt as co
from cocap_opt.flight.flights import Flight
from cocap_opt.problem import Stride
from cocap_opt.scenarios.maps.terrain import _rise_bounded

HEAVY = """
steps = 4
{top}
[map]
size = [16, 12]
[[walk]]
points = [[2, 6], [14, 6]]
[[drones]]
camera = "greedy-perspectives"
starts = [{{ x = 4.5, y = 2.5, heading = 90 }}, {{ x = 10.5, y = 2.5, heading = 90 }}]
{drones}
[airspace]
people = 2
"""


@pytest.mark.long
@pytest.mark.slow(seconds=60)
def test_no_plan_of_a_recipe_with_an_airframe_is_refused_a_smooth_flight(tmp_path: Path) -> None:
    """Recipes as people write them: what is planned is flown, or hovers; nothing is refused."""
    logging.disable(logging.WARNING)
    ends = Counter[str]()
    try:
        for seed in range(20):
            folder = tmp_path / str(seed)
            folder.mkdir()
            path = drawn_recipe(np.random.default_rng(seed), folder)
            end, words = fate(path, 10.0, "sequential")
            assert end in ("flown", "hovering", "plan", "recipe"), f"seed {seed}: {words}"
            assert end != "recipe" or "motion." not in words, words
            ends[end] += 1
    finally:
        logging.disable(logging.NOTSET)
    assert ends["flown"] >= 12, ends


def scene_of(tmp_path: Path, top: str = "", drones: str = 'airframe = "px4"') -> Path:
    """Writes a recipe of two drones beside somebody who walks."""
    path = tmp_path / "scene.toml"
    path.write_text(HEAVY.format(top=top, drones=drones), encoding="utf-8")
    return path


def test_layers_too_far_apart_for_a_step_are_named(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """Otherwise a flight height that nobody can reach would drop out in silence."""
    words = "cannot change between the layers 9 and 14 m: in a step of 2 s they climb at most "
    for layers, is_told in (("[5, 6, 7]", False), ("[8, 9, 14]", True)):
        caplog.clear()
        drones = f'airframe = "px4"\nmotion = {{ layers = {layers} }}'
        co.load(scene_of(tmp_path, "step = 2", drones))
        assert (words in caplog.text) == is_told


def test_cells_are_divided_where_no_move_fits_a_step(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """Half a metre from rest to rest in a second is what 3 m/s2 allow; turns fit as they are."""
    problem = co.load(scene_of(tmp_path))
    assert problem.height_map.resolution == 0.5
    for robot in problem.robots:
        assert robot.motion.moves_on(problem.height_map) == [
            (0, 0, 0), (0, -1, 0), (0, 0, -1), (0, 0, 1), (0, 1, 0),
        ]  # fmt: skip
        assert robot.motion.headings == 8
    assert 0.14 < problem.airspace.people_stray < 0.15
    assert "cells are 0.5 m, not 1, moves are at most" in caplog.text
    assert '(5 moves, not 9); flown = "straight" keeps the moves' in caplog.text


def test_moves_that_are_left_are_told_by_what_bounds_them(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """The way in space, and no horizontal distance that is longer; and how many moves these are."""
    motion = 'airframe = "px4"\nmotion = { radius = 5 }'
    problem = co.load(scene_of(tmp_path, "step = 2", motion))
    left = len(problem.robots[0].motion.moves_on(problem.height_map))
    assert problem.height_map.resolution == 1 and left < 121
    words = rf"moves are at most [\d.]+ m long, [\d.]+ m up or down \(only {left} of the 121 moves "
    assert re.search(words, caplog.text)
    strides = Stride(aside=2.0, upright=1.0, space=3.0), Stride(aside=2.0)
    assert [str(stride) for stride in strides] == [
        "3 m long, 2 m horizontally, 1 m up or down", "2 m horizontally",
    ]  # fmt: skip


def test_recipes_whose_moves_all_fit_stay_as_they_are(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """Nothing is said, and cells, moves and turns are those of the recipe, or of straight ones."""
    problem = co.load(scene_of(tmp_path, "step = 3"))
    straight = co.load(scene_of(tmp_path, 'step = 3\nflown = "straight"'))
    assert not caplog.text
    assert straight.airspace.people_stray == 0
    assert problem.replace(airspace=straight.airspace).robots == straight.robots
    assert problem.height_map.resolution == 1
    short = co.load(scene_of(tmp_path, 'step = 1\nflown = "straight"'))
    assert short.height_map.resolution == 1 and short.robots[0].motion == co.Motion()


def test_headings_are_divided_where_a_turn_takes_longer_than_a_step(tmp_path: Path) -> None:
    """45 degrees in half a second are too much for 60 degrees/s; 22.5 are not."""
    motion = co.load(scene_of(tmp_path, "step = 0.5")).robots[0].motion
    assert (motion.headings, motion.turn) == (16, 1)
    start = co.load(scene_of(tmp_path, "step = 0.5")).robots[0].start
    assert start.heading == 4  # 90 degrees, as it is stated


def test_drones_in_one_team_keep_their_cells(tmp_path: Path) -> None:
    """Where cells are divided for one, others go from cell to cell as the recipe has it."""
    drones = 'airframe = "px4"\n[[drones]]\nstarts = [{ x = 7.5, y = 9.5 }]\nairframe = "skydio-2"'
    problem = co.load(scene_of(tmp_path, drones=drones))
    other = problem.robots[2].motion
    assert (other.radius, other.spacing, len(other.moves)) == (2, 2, 9)


@pytest.mark.parametrize("planner", ["sequential", "cocap"])
def test_plans_beside_people_have_smooth_flights_without_a_margin(
    tmp_path: Path, planner: str
) -> None:
    """Moves keep room for a drone that rests at both of their ends."""
    problem = co.load(scene_of(tmp_path, "step = 2"))
    plan = co.plan(problem, planner, time_limit=20).plan
    assert plan is not None and not plan.stays
    assert Flight.of(problem, plan, smooth=True).is_smooth


@pytest.mark.slow
def test_the_price_of_limits_is_that_of_lifted_heights_too(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Plans of the recipe without limits fly at its own heights, and have no more J than proved."""
    rows = [" ".join(str(3 * k) for k in range(12)) for _ in range(10)]
    head = "ncols 12\nnrows 10\nxllcorner 0\nyllcorner 0\ncellsize 1\n"
    (tmp_path / "steep.asc").write_text(head + "\n".join(rows) + "\n")
    steep = HEAVY.replace("size = [16, 12]", 'file = "steep.asc"\nheights = "absolute"\n'
                          'ground = "surface"').replace("14, 6", "9, 6")  # fmt: skip
    path, plan = tmp_path / "scene.toml", tmp_path / "plan.json"
    path.write_text(steep.format(top="step = 2", drones='airframe = "px4"'))
    problem = co.load(path)
    assert problem.height_map.lift is not None
    assert Run(capsys, "plan", path, "--time-limit", "10", "-o", plan).code == 0
    proved = Run(capsys, "limits", path, plan, "--time-limit", "10", "--json").json["bound"]
    path.write_text(steep.format(top="step = 2", drones=""))
    assert co.plan(co.load(path), "sequential", time_limit=10).value <= proved


@pytest.mark.slow
def test_heights_rise_no_more_steeply_than_drones(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """The lift is the least that does, by brute force; who states above-ground has none."""
    rng = np.random.default_rng(0)
    ground = rng.random((6, 7)) * 5
    found = _rise_bounded(ground, 0.7)
    x, y = np.indices(ground.shape)
    for i in range(6):
        for j in range(7):
            along, across = np.abs(x - i), np.abs(y - j)
            far = np.maximum(along, across) + (math.sqrt(2) - 1) * np.minimum(along, across)
            assert found[i, j] == pytest.approx((ground - 0.7 * far).max())
    rows = [" ".join(f"{50 + 3 * (k % 3)}" for k in range(12)) for _ in range(10)]
    head = "ncols 12\nnrows 10\nxllcorner 0\nyllcorner 0\ncellsize 1\n"
    (tmp_path / "hill.asc").write_text(head + "\n".join(rows) + "\n")
    hill = HEAVY.replace("size = [16, 12]", 'file = "hill.asc"\nheights = "absolute"\n'
                         'ground = "surface"').replace("14, 6", "9, 6")  # fmt: skip
    path = tmp_path / "scene.toml"
    path.write_text(hill.format(top="step = 2", drones='airframe = "px4"'))
    height_map = co.load(path).height_map
    assert height_map.lift is not None and 0 < height_map.lift.max() <= 6
    assert "flight: the ground is steeper than the drones can follow" in caplog.text
    path.write_text(hill.format(top='step = 2\nflight = "above-ground"', drones='airframe = "px4"'))
    assert co.load(path).height_map.lift is None


@pytest.mark.slow
def test_the_price_of_limits_is_certified(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The bound holds for the best plan of the recipe's moves from the same starts."""
    scene, plan = scene_of(tmp_path), tmp_path / "plan.json"
    assert Run(capsys, "plan", scene, "--time-limit", "20", "-o", plan).code == 0
    run = Run(capsys, "limits", scene, plan, "--time-limit", "20", "--json")
    assert run.code == 0
    assert run.json["lost"] == pytest.approx(max(run.json["bound"] - run.json["reward"], 0))
    problem = co.load(scene)
    free = [robot.replace(motion=co.Motion(radius=2, spacing=2), limits=None)
            for robot in problem.robots]  # fmt: skip
    wide = problem.replace(robots=tuple(free), airspace=problem.airspace.replace(people_stray=0.0))
    assert co.plan(wide, time_limit=20).value <= run.json["bound"] * (1 + 1e-9)
    assert [row["moves"] for row in run.json["drones"]] == [5, 5]
    assert [row["moves of recipe"] for row in run.json["drones"]] == [9, 9]
    assert "is below the best by at most" in run.json["notes"][0]
    assert Run(capsys, "limits", "corridor").code == 2
    assert "`cocap-opt recipe delft -o FOLDER`" in Run(capsys, "limits", "delft").err
