"""Drones that see people, counted: coverage, J, and planners of all kinds."""

import numpy as np
import pytest
from brute_force import objective_from_scratch, optimum
from counting import counting, either
from hypothesis import given, reject
from hypothesis import strategies as st
from pool import problems
from strategies import examples

from cocap_opt.api.covering import coverage_digest
from cocap_opt.data import ProblemError
from cocap_opt.files.documents import problem_digest
from cocap_opt.model import Model
from cocap_opt.objective import objective
from cocap_opt.planners import PLANNERS
from cocap_opt.planners.joint import joint
from cocap_opt.problem import Objective, Problem, Views
from cocap_opt.referee import check
from cocap_opt.run.engine import run
from cocap_opt.scenarios import load_scene

COUNTED = counting(problems(over_time=True))


@examples(60)
@given(COUNTED)
def test_tables_have_faces_then_people(problem: Problem) -> None:
    """Those of whom a share is visible that is large enough, at their own steps."""
    model = Model(problem, use_cache=False)
    faces, people, views = model.n_faces, len(problem.actors), problem.objective.views
    assert views is not None
    for robot_class in model.classes:
        table, source = model.coverage(robot_class), model.views(robot_class)
        assert (table.view_sums[table.counts] >= problem.returns.n_roots).all()
        assert (table.pixels[table.counts] == 1).all()
        for node in table.nodes[:40].tolist():
            t, state = divmod(node, robot_class.graph.n_states)
            sums, pixels = table.row(node)
            seen = source.people(np.array([node]))
            shares = dict(
                zip(seen.people.tolist(), (seen.visible / seen.unhidden).tolist(), strict=True)
            )
            counted = [j for j in range(people) if shares.get(j, 0.0) >= views.at_least - 1e-9]
            expected = [problem.returns.n_roots + t * people + j for j in counted]
            assert sums[sums >= problem.returns.n_roots].tolist() == expected
            dense = model.coverage_at(robot_class, t, np.array([state]))[0]
            assert dense[faces:].tolist() == [float(j in counted) for j in range(people)]
            assert dense[:faces].sum() == pytest.approx(
                pixels[sums < problem.returns.n_roots].sum()
            )


@examples(20)
@given(either(problems()), st.integers(0, 10**6))
def test_sums_of_a_step_are_those_of_its_view_sums(problem: Problem, seed: int) -> None:
    """Of its faces and of its people."""
    values = np.random.default_rng(seed).normal(size=len(problem.view_sum_weights))
    expected = [values[view_sums].sum() for view_sums in problem.step_view_sums]
    assert problem.by_step(values) == pytest.approx(expected)
    nobody = problem.replace(actors=(), objective=Objective())
    assert nobody.by_step(nobody.no_pixels()).tolist() == [0.0] * (problem.horizon + 1)


@examples(100)
@given(COUNTED)
def test_the_optimum_has_one_value(problem: Problem) -> None:
    """From scratch, by the referee and by the planners' objective."""
    best = optimum(problem)
    if best.plan is None:
        reject()
    verdict = check(problem, best.plan)
    model = Model(problem, use_cache=False)
    expected = pytest.approx(best.value, rel=1e-9, abs=1e-9)
    assert verdict.reward == expected
    assert objective_from_scratch(problem, best.plan) == expected
    assert objective(model, model.paths(best.plan)) == expected
    parts = sum(verdict.face_reward) + sum(verdict.count_reward) + verdict.reward_moves
    assert parts == expected


@examples(60)
@given(COUNTED, st.sampled_from(sorted(PLANNERS)))
def test_planners_count_people(problem: Problem, name: str) -> None:
    """Their J is the referee's, and no better than the best; no method stumbles."""
    if PLANNERS[name].most_robots and len(problem.robots) > PLANNERS[name].most_robots:
        return
    if name == "joint" and problem.objective.over_time:
        return
    result, best = PLANNERS[name](problem), optimum(problem)
    if result.plan is None:
        reject()
    verdict = check(problem, result.plan)
    assert result.value == pytest.approx(verdict.reward, rel=1e-9, abs=1e-9)
    if not verdict.conflicts:
        assert result.value <= best.value + 1e-9 * (1 + best.value)


@examples(60)
@given(counting(problems((1, 2))))
def test_joint_planning_is_optimal_with_counts(problem: Problem) -> None:
    """As brute force; what two drones see together does not add up."""
    best, result = optimum(problem), joint(problem)
    assert (result.plan is None) == (best.plan is None)
    if best.plan is not None:
        assert result.value == pytest.approx(best.value, rel=1e-9, abs=1e-9)


@examples(40)
@given(COUNTED)
def test_lazy_planning_finds_what_the_table_does(problem: Problem) -> None:
    """To the last bit, view by view."""
    lazy, dense = (PLANNERS[name](problem) for name in ("sequential-lazy", "sequential"))
    assert lazy.plan == dense.plan and lazy.value == dense.value


def test_nothing_changes_where_nobody_counts() -> None:
    """Digests are those without the term."""
    problem = load_scene("bottleneck", 0)
    same = problem.replace(objective=problem.objective.replace(pixels=1.0, views=None))
    assert problem_digest(same) == problem_digest(problem)
    counted = problem.replace(objective=problem.objective.replace(views=Views()))
    assert problem_digest(counted) != problem_digest(problem)
    assert coverage_digest(counted) == coverage_digest(problem)


def test_a_plan_for_views_alone_is_not_blind() -> None:
    """Whoever is seen counts, whatever pixels are worth."""
    problem = load_scene("corridor", 0)
    objective = problem.objective.replace(pixels=0.0, views=Views())
    judged = run(problem.replace(objective=objective), "sequential")
    assert judged.verdict is not None and any(judged.verdict.count_reward)
    assert not judged.blind(problem)


@pytest.mark.parametrize(
    ("views", "words"),
    [
        ({"cameras": 0}, "cameras: must be 1..64"),
        ({"cameras": 1.5}, "cameras: must be a whole number"),
        ({"weight": -1.0}, "weight: must be 0..1,"),
        ({"at_least": 0.0}, "at_least: must be > 0"),
        ({"at_least": 1.2}, "at_least: must be 0..1"),
    ],
)
def test_wrong_fields_are_named(views: dict[str, float], words: str) -> None:
    """With what is allowed."""
    with pytest.raises(ProblemError, match=words):
        Views(**views)


def test_weights_are_of_all_people() -> None:
    """One for all, or one for each."""
    problem = load_scene("bottleneck", 0)
    with pytest.raises(ProblemError, match=r"objective\.views\.weight: .*for each of the"):
        problem.replace(objective=Objective(views=Views(weight=(1.0,))))
