"""Goals of several cells, in one of which a drone must end."""

from itertools import product

import numpy as np
import pytest
from brute_force import optimum
from goals import with_areas
from hypothesis import given
from strategies import examples, tiny

import cocap_opt as co
from cocap_opt.data import ProblemError
from cocap_opt.files import documents
from cocap_opt.files.documents import SceneFile, decode_document, encode, problem_digest
from cocap_opt.formulations import BOUNDS, EXACT
from cocap_opt.formulations.certificates import CertificateError
from cocap_opt.model import compiled
from cocap_opt.output.long_tables import TABLES
from cocap_opt.planners import PLANNERS
from cocap_opt.problem import GoalArea, Problem, State, may_end
from cocap_opt.referee import check
from cocap_opt.result import Reason
from cocap_opt.stop import never


def cells_of(problem: Problem, drone: int) -> tuple[tuple[int, int], ...]:
    """The cells of a drone's goal."""
    goal = problem.robots[drone].goal
    assert goal is not None
    return goal.cells if isinstance(goal, GoalArea) else (goal,)


@pytest.mark.long
@examples(30)
@given(with_areas())
def test_the_optimum_is_the_best_over_all_choices_of_goals(problem: Problem) -> None:
    """Planners keep to the goals, and plans, optima, bounds and certificates stand in order."""
    chosen = product(*(cells_of(problem, i) for i in range(len(problem.robots))))
    best = max(
        optimum(
            problem.replace(robots=tuple(
                robot.replace(goal=cell)
                for robot, cell in zip(problem.robots, cells, strict=True)
            ))
        ).value
        for cells in chosen
    )  # fmt: skip
    result = EXACT["branch-and-price"](problem)
    if best == -np.inf:
        assert result.reason is Reason.INFEASIBLE
        obeying = [planner for planner in PLANNERS.values() if planner.obeys_rules]
        assert all(planner(problem, never).plan is None for planner in obeying)
        return
    assert result.value == pytest.approx(best)
    assert EXACT["brute-force"](problem).value == pytest.approx(best)
    for name, planner in PLANNERS.items():
        plan = planner(problem, never).plan
        if plan is None:
            continue
        verdict = check(problem, plan)
        assert not verdict.violations, name
        if not verdict.conflicts:
            assert verdict.reward <= best * (1 + 1e-9) + 1e-9, name
    for name, method in BOUNDS.items():
        bound = method(problem).bound
        assert bound is None or bound >= best * (1 - 1e-9) - 1e-9, name
    assert result.certificate is not None
    # Raises where code that shares nothing with it finds another bound.
    verified = co.verify(problem, result.plan, result.certificate, second_opinion=True)
    assert verified.bound == pytest.approx(result.bound)
    first, *others = problem.robots
    other = problem.replace(robots=(first.replace(goal=None), *others))
    with pytest.raises(CertificateError, match="digest"):  # of a scene with other goals
        co.verify(other, result.certificate)


def line() -> Problem:
    """One drone in a lane of six cells, two of which are its goal, on either side of its start."""
    problem = tiny()
    robot = co.Robot(start=State(2, 0), motion=co.Motion(headings=1), camera=co.Camera())
    return problem.replace(
        name="lane", height_map=co.HeightMap(heights=np.zeros((6, 1))), horizon=2,
        robots=(robot.replace(goal=GoalArea(cells=((4, 0), (1, 0)))),),
    )  # fmt: skip


def test_the_referee_and_the_scene_name_goals() -> None:
    """A plan that ends elsewhere is told; cells off the map, or blocked, are refused in a line."""
    problem = line()
    stays = co.Plan(paths=((State(2, 0),) * 3,))
    assert check(problem, stays).violations == (
        "paths[0]: must end in one of its goals, not in cell (2, 0)",
    )
    assert not problem.may_hover(0, problem.starts[0]).any()
    for cells, words in (
        (((1, 0), (6, 0)), r"robots\[0\].goal.cells: .*, not \(6, 0\)"),
        (((0, 1), (1, 0), (2, 0)), r"robots\[0\].goal.cells: .*, not \(0, 1\)"),
        (((1, 0), (10**19, 0)), r"robots\[0\].goal.cells: .*, not \(10000000000000000000, 0\)"),
        ((), "cells: must hold at least one cell"),
        (((1, 0), (1, 0)), "cells: must all be different"), (((0.5, 0), (1, 0)), "cells"),
    ):  # fmt: skip
        with pytest.raises(ProblemError, match=words):
            problem.replace(robots=(problem.robots[0].replace(goal=GoalArea(cells=cells)),))
    walls = np.zeros((6, 1))
    walls[[1, 4]] = 20.0
    with pytest.raises(ProblemError, match=r"robots\[0\].goal.cells: are blocked at every"):
        problem.replace(height_map=co.HeightMap(heights=walls))
    single = co.Robot(start=State(2, 0), goal=GoalArea(cells=((4, 0),)))
    assert single.goal == (4, 0)


def test_files_keep_goals_of_several_cells() -> None:
    """They are part of the digest, in whatever order they are given, and of the table of goals."""
    problem = line()
    again = decode_document(encode(SceneFile(problem=problem)), "scene", SceneFile).problem
    assert again.robots == problem.robots and hash(again.robots[0]) == hash(problem.robots[0])
    assert problem_digest(again) == problem_digest(problem)
    turned = problem.robots[0].replace(goal=GoalArea(cells=((1, 0), (4, 0))))
    assert problem_digest(problem.replace(robots=(turned,))) == problem_digest(problem)
    fewer = problem.replace(robots=(turned.replace(goal=(1, 0)),))
    assert problem_digest(fewer) != problem_digest(problem)
    model = compiled(problem)
    model.prepare_all()
    ((drone, x, y),) = TABLES["goals"].chunks(model)
    assert (drone, [*x], [*y]) == (0, [1, 4], [0, 0])
    ((*_, goal_x, goal_y),) = TABLES["drones"].chunks(model)
    assert (goal_x, goal_y) == (-2, -2)


def test_digests_read_no_goals_back(monkeypatch: pytest.MonkeyPatch) -> None:
    """With eight drones above a large map that took half a minute for each command."""
    read, read_back = list[Problem](), documents._read_back
    monkeypatch.setattr(
        documents, "_read_back", lambda problem: read_back(read.append(problem) or problem)
    )
    problem_digest.cache_clear()
    problem_digest(line())
    assert [robot.goal for problem in read for robot in problem.robots] == [None]


def test_cells_of_goals_are_found_in_arrays() -> None:
    """As one by one, also beyond the cells of the goal."""
    goal = GoalArea(cells=((1, 3), (2, 0)))
    x, y = (part.ravel() for part in np.indices((5, 9)))
    expected = [cell in goal.inside for cell in zip(x.tolist(), y.tolist(), strict=True)]
    assert may_end(goal, x, y).tolist() == expected
    assert may_end((1, 3), x, y).sum() == 1 and may_end(None, x, y).all()
