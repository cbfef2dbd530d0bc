"""Why a scene has no plan is said of goals; a search says only that there is none."""

import logging
from pathlib import Path

import numpy as np
import pytest
from brute_force import all_paths, optimum
from goals import with_areas
from hypothesis import given
from strategies import examples, tiny

import cocap_opt as co
from cocap_opt.cli.commands import run
from cocap_opt.files.documents import PlanFile, SceneFile, encode
from cocap_opt.problem import GoalArea, Problem
from cocap_opt.run.no_plan import why_no_plan

FAR = "cannot reach"
FULL = "must end in one goal"


@examples(40)
@given(with_areas((1, 2, 3)))
def test_what_is_said_of_goals_is_true(problem: Problem) -> None:
    """Drones named are those without a path; goals that are too small leave no plan."""
    said = [words for words in why_no_plan(problem) if FAR in words or FULL in words]
    without = [i for i in range(len(problem.robots)) if not all_paths(problem, i)]
    assert any(FAR in words for words in said) == bool(without)
    if said:
        assert optimum(problem).plan is None


def goals(*cells: tuple[int, int], **changes: object) -> Problem:
    """The tiny instance, whose drones must end in one of some cells."""
    problem = tiny()
    robots = tuple(robot.replace(goal=GoalArea(cells=cells)) for robot in problem.robots)
    return problem.replace(robots=robots, **changes)


def test_goals_out_of_reach_are_named_with_a_remedy() -> None:
    """Each drone with a goal that it cannot reach, and what to change."""
    (words,) = why_no_plan(goals((0, 0), (0, 1), horizon=1))
    assert words == (
        "drone 1 cannot reach its goal in 1 step, even alone: allow more steps, a nearer start or "
        "another goal (in a recipe `steps`, `starts` or `land`)"
    )
    assert not any(FAR in words for words in why_no_plan(goals((0, 0), (2, 0))))
    assert [*why_no_plan(tiny())] == []


def test_people_who_leave_drones_no_room_are_named() -> None:
    """The goal is not to blame, and without a goal there is still a reason."""
    problem = tiny()
    middle = [[200.0, 200.0, 0.0, 0.0], *([[8.0, 6.0, 0.0, 0.0]] * problem.horizon)]
    actors = (problem.actors[0].replace(poses=np.array(middle)),)
    airspace = problem.airspace.replace(people_aside=100.0)
    for goal in None, GoalArea(cells=((0, 0), (3, 2))):
        robots = tuple(robot.replace(goal=goal) for robot in problem.robots)
        crowded = problem.replace(actors=actors, robots=robots)
        assert [*why_no_plan(crowded)] == []
        crowded = crowded.replace(airspace=airspace)
        (words,) = why_no_plan(crowded)
        done = "fly for" if goal is None else "reach their goals in"
        assert words.startswith(f"drones 0-1 cannot {done} 2 steps, even alone: they have to keep")
        assert "keep 100 m from people; allow a smaller distance" in words
        result = co.plan(crowded, "sequential")
        assert result.plan is None and result.message == "drone 0 has no path, even alone"


def test_goals_with_less_room_than_drones_are_named() -> None:
    """Layers count, cells blocked do not, and without rules there is room for all."""
    small = goals((2, 1), (1, 1))  # the latter is blocked
    (words,) = (words for words in why_no_plan(small) if FULL in words)
    assert words.startswith("2 drones must end in one goal, which has room for only 1: ")
    assert co.solve(small).plan is None
    assert not any(FULL in words for words in why_no_plan(small.without_rules()))
    layers = tuple(
        robot.replace(motion=robot.motion.replace(layers=(5.0, 9.0))) for robot in small.robots
    )
    assert not any(FULL in words for words in why_no_plan(small.replace(robots=layers)))


@pytest.mark.parametrize("command", ["plan", "bound", "solve", "front", "gap"])
def test_commands_say_why_there_is_no_plan(
    command: str, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """Once, beside the answer that there is none."""
    path = tmp_path / "far.json"
    path.write_bytes(encode(SceneFile(problem=goals((0, 0), (0, 1), horizon=1))))
    caplog.set_level(logging.WARNING)
    more = ["--planner", "sequential", "--work-limit", "0"] if command == "gap" else []
    run([command, str(path), *more])
    assert caplog.text.count(FAR) == 1


def test_the_rest_of_a_mission_names_the_drones_of_the_mission(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """Whoever has flown away from the goal is told so, by the number that the crew knows."""
    scene, flown = tmp_path / "scene.json", tmp_path / "plan.json"
    problem = goals((0, 0), (1, 2))
    scene.write_bytes(encode(SceneFile(problem=problem)))
    stays = co.Plan(paths=tuple((start,) * 3 for start in problem.first_starts))
    flown.write_bytes(encode(PlanFile.of(problem, stays, 0.0, "hand")))
    run(["plan", str(scene), "--plan", str(flown), "--from-step", "1", "--without", "0"])
    assert caplog.text.count("drone 1 of the mission cannot reach its goal in 1 step") == 1
