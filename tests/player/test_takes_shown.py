"""People of several takes, told apart in the player, in pictures and in what cameras see."""

from pathlib import Path

import numpy as np
import pytest
from strategies import tiny

import cocap_opt as co
from cocap_opt.cli.commands import run
from cocap_opt.problem.pictures import TAKE_COLOURS
from cocap_opt.vision.render import Renderer


def two_takes() -> co.Problem:
    """Somebody who is two metres farther along x in a second take."""
    problem = tiny()
    person = problem.actors[0]
    there = person.replace(poses=person.poses + np.array([2.0, 0, 0, 0]), take="b")
    takes = co.Take(name="a", probability=0.5), co.Take(name="b", probability=0.5)
    return problem.replace(actors=(person.replace(take="a"), there), takes=takes)


def test_the_player_has_a_colour_for_each_take() -> None:
    """And names it beside each person; without takes nobody has one."""
    data = co.show(two_takes()).data()
    assert [person["take"] for person in data["people"]] == list(TAKE_COLOURS[:2])
    assert [person["called"] for person in data["people"]] == [
        "person 0 (take a)", "person 1 (take b)",
    ]  # fmt: skip
    assert data["about"] == "2 drones, 2 people, 2 steps, 2 takes"
    assert [person["take"] for person in co.show(tiny()).data()["people"]] == [None]


@pytest.mark.parametrize(
    ("take", "words"),
    [
        ("late", "take late"),
        ("take 1", "take 1"),
        ("Take 2", "Take 2"),
        ("as given", "as given"),
    ],
)
def test_no_label_says_take_twice(take: str, words: str) -> None:
    """Neither of a person, nor in the player, nor in the name of a take's own problem."""
    problem = two_takes()
    people = problem.actors[0].replace(take=take, name="Carla"), problem.actors[1]
    takes = problem.takes[0].replace(name=take), problem.takes[1]
    named = problem.replace(actors=people, takes=takes)
    assert named.person(0) == f"Carla (0, {words})"
    assert named.of_take(0).name == f"tiny, {words}"
    person = co.show(named).data()["people"][0]
    assert (person["name"], person["inTake"]) == ("Carla", words)


def test_pictures_have_a_colour_for_each_take() -> None:
    """Walks and their ends are drawn in them, and the legend names them."""
    axes = two_takes().plot()
    walked = [line for line in axes.get_lines() if line.get_linestyle() == ":"]
    assert [line.get_color() for line in walked] == list(TAKE_COLOURS[:2])
    for colour, walk in zip(TAKE_COLOURS, walked, strict=False):
        ends = [walk.get_xydata()[0], walk.get_xydata()[-1]]
        drawn = [
            line.get_xydata()[0] for line in axes.get_lines()
            if line.get_color() == colour and len(line.get_xdata()) == 1
        ]  # fmt: skip
        np.testing.assert_array_equal(drawn, ends)
    legend = axes.get_legend()
    assert legend is not None
    words = [text.get_text() for text in legend.get_texts()]
    assert [line.rpartition(", ")[2] for line in words if "people" in line] == ["a", "b"]


@pytest.mark.slow
def test_a_camera_sees_the_people_of_one_take(tmp_path: Path) -> None:
    """There is a picture of each, and nobody of another is in it."""
    problem = two_takes()
    plan = co.plan(problem, "sequential").plan
    assert plan is not None
    renderer, owners = Renderer(problem, 4), problem.face_owner
    for i, path in enumerate(plan.paths):
        for t, state in enumerate(path):
            for take in (0, 1):
                faces, _ = renderer.picture(problem.robots[i], t, state, take)
                assert set(problem.take_of[owners[faces[faces >= 0]]].tolist()) <= {take}
    co.save(tmp_path / "scene.json", problem)
    files = [str(tmp_path / "scene.json"), str(tmp_path / "plan.json")]
    assert run(["plan", files[0], "--planner", "sequential", "-o", files[1]]) == 0
    assert run(["render", *files, "-o", str(tmp_path / "views"), "--width", "100"]) == 0
    assert len(list((tmp_path / "views").glob("*-take1.png"))) == 6
