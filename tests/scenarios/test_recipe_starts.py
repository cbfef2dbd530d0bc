"""Recipes in which drones choose where they start."""

from pathlib import Path

import pytest

from cocap_opt.data import ProblemError
from cocap_opt.planners import PLANNERS
from cocap_opt.problem import Problem, StartArea, State
from cocap_opt.referee import check
from cocap_opt.scenarios.recipe import read
from cocap_opt.stop import never

RECIPE = """
steps = 3
[map]
size = [12, 8]
resolution = 1
[[walk]]
points = [[2, 3], [10, 4]]
[rules]
separation = 1.2
[[drones]]
count = 2
starts = {starts}
[drones.motion]
layers = [4, 6]
headings = 4
"""


def recipe(folder: Path, starts: str, more: str = "") -> Problem:
    """A scene whose drones start as these words say."""
    path = folder / "scene.toml"
    path.write_text(RECIPE.replace("{starts}", starts) + more)
    return read(path, seed=0)


def test_an_area_has_the_cells_whose_middles_it_has(tmp_path: Path) -> None:
    """At some heights and in some directions; without them at all, in all."""
    area = "{ area = [[1, 1], [3.2, 1], [3.2, 3], [1, 3]], heights = [6], headings = [0, 270] }"
    start = recipe(tmp_path, area).robots[0].start
    assert start == StartArea(cells=((1, 1), (1, 2), (2, 1), (2, 2)), layers=(1,), headings=(0, 3))
    problem = recipe(tmp_path, '{ area = "anywhere" }')
    assert [robot.start for robot in problem.robots] == [StartArea(), StartArea()]
    assert len(problem.starts[0]) == 12 * 8 * 2 * 4
    plan = PLANNERS["sequential"](problem, never).plan
    assert plan is not None and check(problem, plan).valid


def test_areas_and_stated_starts_stand_side_by_side(tmp_path: Path) -> None:
    """Drones that choose keep away from one that stands in their area."""
    stated = "[[drones]]\nstarts = [{ x = 1.5, y = 1.5, height = 4 }]\nmotion = { layers = [4] }\n"
    area = "{ area = [[1, 1], [3, 1], [3, 4], [1, 4]], heights = [4] }"
    problem = recipe(tmp_path, area, stated)
    assert problem.robots[2].start == State(1, 1, 0, 0)
    at = [state[:2] for state in problem.first_starts]
    assert len(set(at)) == 3 and problem.first_starts[2] == State(1, 1, 0, 0)
    counted = "[[drones]]\ncount = 1\nmotion = { layers = [4] }\n"
    assert isinstance(recipe(tmp_path, area, counted).robots[2].start, State)


@pytest.mark.parametrize(("starts", "words"), [
    ("{ area = [[1, 1], [3, 1]] }", "starts.area: must have at least 3 corners, not 2"),
    ("{ area = [[1, 1], [3, 3], [3, 1], [1, 3]] }", "starts.area.polygon: must not cross itself"),
    ("{ area = [[1.6, 1.6], [1.9, 1.6], [1.9, 1.9]] }", "starts.area: .* the middle of a cell"),
    ("{ area = [[50, 1], [53, 1], [53, 3]] }", "starts.area: .* the map is x 0..12"),
    ('{ area = "somewhere" }', "area"),
    ('{ area = "anywhere", heights = [5] }', "starts.heights: must be one of the layers 4, 6 m"),
    ('{ area = "anywhere", headings = [45] }', "starts.headings: must be one of the 4 directions"),
    ('{ area = "anywhere", heights = [] }', "heights: must"),
    ('{ area = "anywhere", height = 4 }', "unknown field .height."),
    ("{ heights = [4] }", "area"),
])  # fmt: skip
def test_areas_that_are_none_are_named(tmp_path: Path, starts: str, words: str) -> None:
    """With the table and the field, and what is allowed."""
    with pytest.raises(ProblemError, match=words):
        recipe(tmp_path, starts)


def test_a_start_that_is_none_is_named_by_its_row(tmp_path: Path) -> None:
    """Of several, the one that is wrong, and what is wrong with it."""
    fine, path = "{ x = 2, y = 6 }", tmp_path / "scene.toml"
    for wrong, words in (
        (
            "x = 9, y = 6, heading = 200",
            r"\[1\].heading: must be one of the 4 directions from 0 .* 200; ",
        ),
        ("x = 9, y = 6, height = 5", r"\[1\].height: must be one of the layers 4, 6 m, not 5 m"),
        ("x = 9, y = 60", r"\[1\]: must lie on the map"),
    ):
        rows = f"[{fine}, {{ {wrong} }}]"
        path.write_text(RECIPE.replace("{starts}", rows).replace("count = 2\n", ""))
        with pytest.raises(ProblemError, match=rf"drones\[0\].starts{words}"):
            read(path, seed=0)


def test_an_area_needs_a_count_and_room(tmp_path: Path) -> None:
    """It does not say how many drones there are; two do not fit into one cell."""
    path = tmp_path / "scene.toml"
    area = "{ area = [[1, 1], [2, 1], [2, 2], [1, 2]] }"
    path.write_text(RECIPE.replace("{starts}", area).replace("count = 2\n", ""))
    with pytest.raises(ProblemError, match=r"drones\[0\]: must have a count with the area"):
        read(path, seed=0)
    with pytest.raises(ProblemError, match="must have a start for every drone that obeys"):
        recipe(tmp_path, area.replace("}", ", heights = [4] }"))
    wall = "[[no_fly]]\npolygon = [[0, 0], [3, 0], [3, 3], [0, 3]]\n"
    with pytest.raises(ProblemError, match=r"drones\[0\].starts: must have a cell in which"):
        recipe(tmp_path, area, wall)
