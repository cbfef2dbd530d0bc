"""Drones that choose their start, before they have one: the ground above which they may start."""

import re
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from matplotlib.colors import to_hex
from pool import problems
from strategies import examples, tiny

import cocap_opt as co
from cocap_opt.cli.commands import run
from cocap_opt.plausibility import warnings
from cocap_opt.problem import Actor, Plan, Problem, StartArea
from cocap_opt.problem.pictures import TopView, drone_colour
from cocap_opt.problem.start_ground import StartGround
from cocap_opt.referee import check
from cocap_opt.world.workspace import HeightMap


def half_open() -> Problem:
    """Two drones: the first may start anywhere, the second at its place; it sees somebody."""
    problem = tiny()
    person = Actor(poses=np.array([[6.0, 10.0, 0.0, 0.0]] * 3))
    first, second = problem.robots
    return problem.replace(robots=(first.replace(start=StartArea()), second), actors=(person,))


def all_open() -> Problem:
    """The same, both of whom may start anywhere."""
    problem = half_open()
    return problem.replace(robots=tuple(r.replace(start=StartArea()) for r in problem.robots))


@examples(60)
@given(problem=problems())
def test_the_ground_is_that_of_all_starts(problem: Problem) -> None:
    """Each drone with several starts is in one area; its cells are those of its starts."""
    areas = StartGround.all_of(problem)
    several = [i for i, starts in enumerate(problem.starts) if len(list(starts)) > 1]
    assert sorted(i for area in areas for i in area.drones) == several
    width, depth = problem.height_map.shape
    for area in areas:
        for i in area.drones:
            at = {(state.x, state.y) for state in problem.starts[i]}
            for x, y in product(range(width), range(depth)):
                assert area.cells[x, y] == ((x, y) in at)


@pytest.mark.parametrize(
    ("numbers", "words"),
    [
        ((3,), "drone 3 may start here"),
        ((0, 2), "drones 0 and 2 may start here"),
        ((0, 1, 2, 3), "drones 0, 1, 2 and 3 may start here"),
        ((0, 1, 2, 3, 9), "drones 0, 1, 2 .. 9 may start here"),
    ],
)
def test_a_legend_names_the_drones(numbers: tuple[int, ...], words: str) -> None:
    """Of many the first and the last."""
    assert StartGround(numbers, np.ones((1, 1), dtype=np.bool_)).words == words


def test_pictures_have_no_start_that_nobody_chose() -> None:
    """A ring for the drone that has a start, an area for the other; with a plan both fly."""
    problem = half_open()
    view = TopView.of(problem)
    assert list(view.flights) == [1] and [area.drones for area in view.areas] == [(0,)]
    assert not TopView.of(all_open()).flights
    plan = Plan(paths=tuple((state,) * 3 for state in problem.first_starts))
    view = TopView.of(problem, plan)
    assert list(view.flights) == [0, 1] and not view.areas


def test_a_legend_has_the_colours_of_the_drones_and_covers_no_map() -> None:
    """Marks are in the colours of what is drawn; below the map there is room for all lines."""
    axes = half_open().plot()
    legend = axes.get_legend()
    assert legend is not None
    handles = dict(
        zip((t.get_text() for t in legend.get_texts()), legend.legend_handles, strict=True)
    )
    assert {"drones' starts and headings", "drone 0 may start here"} <= set(handles)
    found = [patch.get_edgecolor() for patch in legend.get_patches()]
    assert to_hex(drone_colour(0)) in map(to_hex, found)
    lines = [line.get_markeredgecolor() for line in legend.get_lines()]
    assert to_hex(drone_colour(1)) in map(to_hex, lines)
    axes.figure.draw_without_rendering()
    frame, within = legend.get_window_extent(), axes.figure.bbox
    assert frame.y1 < axes.get_window_extent().y0 and within.y0 <= frame.y0
    assert within.x0 <= frame.x0 and frame.x1 <= within.x1


def test_the_player_has_no_start_that_nobody_chose() -> None:
    """No path, and no reward: those of the other drones are the referee's without it."""
    problem = half_open()
    data = co.show(problem).data()
    (shown,) = data["plans"]
    assert shown["paths"][0] == [] == shown["heights"][0]
    assert len(shown["paths"][1]) == 3 and shown["title"] == "drones at their starts"
    alone = problem.replace(robots=problem.robots[1:])
    verdict = check(alone, Plan(paths=((problem.starts[1][0],) * 3,)))
    assert shown["reward"] == verdict.reward > 0
    assert shown["adds"][0] == [0, 0, 0] and shown["adds"][1] == pytest.approx(
        [0, *verdict.reward_per_step], rel=1e-4
    )
    assert data["starts"]["words"] == "drone 0 may start here"
    cells = np.reshape([int(digit) for digit in data["starts"]["cells"]], (4, 3))
    np.testing.assert_array_equal(cells, StartGround.all_of(problem)[0].cells)


def test_where_all_choose_the_player_has_the_ground_alone() -> None:
    """And says so; without people it is drawn, too. With a plan nothing is said of starts."""
    data = co.show(all_open()).data()
    (shown,) = data["plans"]
    assert shown["title"] == "where drones may start"
    assert shown["paths"] == [[], []] and set(shown["rewards"]) == {0}
    assert not np.any(shown["seen"])
    assert co.show(all_open().replace(actors=())).data()["plans"][0]["paths"] == [[], []]
    plan = co.plan(all_open(), "greedy")
    assert co.show(all_open(), plan).data()["starts"] is None


def test_no_drone_is_said_to_be_shut_in_where_it_need_not_start() -> None:
    """The first free cell may be a yard; the drone may start elsewhere."""
    heights = np.zeros((6, 4))
    heights[1, :] = heights[0, 1] = 20.0
    problem = tiny().replace(height_map=HeightMap(heights=heights, resolution=4.0))
    shut = [words for words in warnings(problem) if "can reach only" in words]
    assert shut == ["drone 0 can reach only 1 cell"]
    robots = tuple(robot.replace(start=StartArea()) for robot in problem.robots)
    assert not [words for words in warnings(problem.replace(robots=robots)) if "reach" in words]


def test_show_says_where_drones_may_start(tmp_path: Path) -> None:
    """In a recipe whose drones may start anywhere; the page and the picture are written."""
    path = tmp_path / "scene.toml"
    path.write_text(
        "steps = 2\n[map]\nsize = [9, 6]\n[[walk]]\npoints = [[2, 2], [4, 2]]\n[[drones]]\n"
        'count = 2\nstarts = { area = "anywhere" }\nmotion = { layers = [4] }\n'
    )
    for name in ("scene.png", "scene.html"):
        assert run(["show", str(path), "-o", str(tmp_path / name)]) == 0
    page = (tmp_path / "scene.html").read_text()
    found = re.search(r'"starts":\{"words":"([^"]*)"', page)
    assert found is not None and found[1] == "drones 0 and 1 may start here"
