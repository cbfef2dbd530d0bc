"""Bounds after a limit that came before coverage was whole."""

import math
from contextlib import suppress
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from brute_force import optimum
from counting import either
from hypothesis import given
from hypothesis import strategies as st
from pool import meetings, problems
from strategies import Calls, examples

from cocap_opt.formulations import BOUNDS, EXACT
from cocap_opt.formulations.certificates import CertificateFile, verify
from cocap_opt.formulations.simple_bounds import _StepMultipliers, early_bound
from cocap_opt.model import Model, compiled
from cocap_opt.planners import PLANNERS
from cocap_opt.problem import Plan, Problem
from cocap_opt.referee import check
from cocap_opt.result import Reason
from cocap_opt.scenarios import load_scene
from cocap_opt.stop import Limit, LimitReached, TimeLimit
from cocap_opt.vision.ceilings import ceiling

SLACK = 1e-9  # relative, of sums


@pytest.fixture(autouse=True)
def small_batches(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """A limit can fall between any two steps, and no table is known from before."""
    monkeypatch.setattr("cocap_opt.vision.sights._BATCH", 50)
    monkeypatch.setenv("COCAP_OPT_CACHE", str(tmp_path))


def covered_in_part(problem: Problem, looks: int) -> Model:
    """The compiled problem, whose coverage was stopped after so many looks at a limit."""
    compiled.cache_clear()
    model = compiled(problem)
    with suppress(LimitReached):
        model.prepare_all(Calls(looks))
    return model


@examples(20)
@given(
    problem=st.one_of(problems(over_time=True), meetings()),
    looks=st.integers(0, 6),
    many=st.sampled_from([(math.inf, math.inf), (math.inf, math.inf), (0, math.inf), (0, 0)]),
)
def test_a_bound_holds_whatever_coverage_is_known(
    problem: Problem, looks: int, many: tuple[float, float]
) -> None:
    """It is no less than the optimum, and its numbers prove it on the true coverage.

    So are those of scenes that are large, where few value iterations are done, or none.
    """
    covered_in_part(problem, looks)
    with pytest.MonkeyPatch.context() as patch:
        for name, number in zip(("_MANY", "_TOO_MANY"), many, strict=True):
            patch.setattr(f"cocap_opt.formulations.simple_bounds.{name}", number)
        result = early_bound(problem, Limit.TIME)
    best = optimum(problem)
    assert result.bound >= best.value - SLACK * abs(best.value)
    certificate = result.certificate
    assert isinstance(certificate, CertificateFile)
    proved = verify(problem, certificate).bound
    assert best.value - SLACK * abs(best.value) <= proved <= result.bound


def test_drones_that_jump_need_little_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where there are too many states for value iteration, the most of each step suffices."""
    model, found = covered_in_part(load_scene("passage", 0), 20), []
    for many in (math.inf, 0):
        monkeypatch.setattr("cocap_opt.formulations.simple_bounds._TOO_MANY", many)
        prices = _StepMultipliers(model)
        found.append([prices.without_motion(s) for s in (prices.alone(), *prices.tangents())])
    assert 0 < model.covered_steps < model.problem.horizon and len(found[0]) > 2
    assert found[1] == pytest.approx(found[0], rel=1e-12)


@examples(20)
@given(problem=either(problems()))
def test_nobody_sees_more_than_the_ceiling(problem: Problem) -> None:
    """State by state, of the sums of pixels, roots and people; what is not marked is not seen."""
    model = Model(problem, use_cache=False)
    for robot_class in model.classes:
        graph, views = robot_class.graph, model.views(robot_class)
        shape = graph.n_orientations, graph.n_places
        for t in range(problem.first_step, problem.horizon + 1):
            reachable = model.reachable(robot_class)[t].reshape(shape)
            places = np.flatnonzero(reachable.any(axis=0))
            states = (np.arange(shape[0])[:, None] * shape[1] + places).ravel()
            weights = problem.view_sum_weights[problem.view_sums_at(t)]
            coverage = views.coverage(t, np.sort(states))[np.argsort(np.argsort(states))]
            most, n = ceiling(views, t, places, weights), model.n_faces
            for sums, values, part in (
                (most.pixels, coverage, slice(0, n)),
                (most.roots, np.sqrt(coverage), slice(0, n)),
                (most.people, coverage, slice(n, None)),
            ):
                seen = values[:, part] @ weights[part]
                assert (seen <= sums.ravel() * (1 + SLACK) + 1e-12).all()
            assert not coverage[:, ~most.visible & (weights > 0)].any()


@pytest.mark.parametrize("method", [*BOUNDS, *EXACT])
def test_every_method_has_a_bound_after_no_time(method: str) -> None:
    """Its certificate says that the coverage was not the true one, and holds on the true one."""
    if method == "scip-nonlinear":
        pytest.importorskip("pyscipopt")
    problem = load_scene("tiny-share", 0)
    compiled.cache_clear()
    result = {**BOUNDS, **EXACT}[method](problem, TimeLimit(0))
    assert (result.reason, result.limit) == (Reason.STOPPED, Limit.TIME)
    assert isinstance(result.certificate, CertificateFile)
    assert optimum(problem).value <= result.bound < math.inf
    assert verify(problem, result.certificate).bound <= result.bound


@pytest.mark.slow
def test_a_certificate_says_which_coverage_it_was_made_with() -> None:
    """Steps that are known leave less open; once all are, the coverage is the true one."""
    problem, bounds = load_scene("passage", 0), []
    for looks in (0, 20, 200):
        model = covered_in_part(problem, looks)
        certificate = early_bound(problem, Limit.TIME).certificate
        assert isinstance(certificate, CertificateFile)
        whole = model.covered_steps == problem.horizon + 1
        assert (certificate.coverage == "optimistic") is not whole
        bounds.append(certificate.proved)
    assert bounds == sorted(bounds, reverse=True) and len(set(bounds)) == 3


@pytest.mark.slow
def test_coverage_is_computed_once_with_rules_and_without() -> None:
    """Rules change nothing of what is seen: one search goes on where the other had to end."""
    problem = load_scene("passage", 0)
    model = covered_in_part(problem, 20)
    free = compiled(problem.without_rules())
    assert free.problem.rules.none and not model.problem.rules.none
    assert 0 < free.covered_steps == model.covered_steps <= problem.horizon
    free.prepare_all()
    assert model.covered_steps == problem.horizon + 1
    assert model.tables.seconds == free.tables.seconds


def test_a_plan_is_judged_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """It passes from planner to bound, and each has it judged."""
    problem = load_scene("tiny-share", 0)
    plan = Plan.hovering(problem)
    assert plan is not None
    verdict = check(problem, plan)
    monkeypatch.delattr("cocap_opt.referee._Referee")
    assert check(problem, Plan(paths=plan.paths)) is verdict


@cache
def covered_for_some_steps() -> tuple[Problem, Model]:
    """The bottleneck, and its model after a limit among its steps."""
    problem = load_scene("bottleneck", 0)
    model = Model(problem, use_cache=False)
    with pytest.MonkeyPatch.context() as patch:
        # As many looks at the limit, whether coverage is found by compiled code or not.
        patch.setattr(type(model.tables.views(problem.robots[0])), "batch", 100)
        return problem, model.covered_by(Calls(30))


@pytest.mark.long
@pytest.mark.parametrize(
    "planner",
    [name for name, planner in PLANNERS.items() if not (planner.lazy or planner.most_robots)],
)
def test_planners_use_the_coverage_that_is_there(
    planner: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Their J is the true one all the same, better than staying, and the message says it."""
    problem, part = covered_for_some_steps()
    assert 3 < part.covered_steps < 12
    monkeypatch.setattr(Model, "covered_by", lambda model, stop: part)
    result = PLANNERS[planner](problem)
    assert result.plan is not None and not result.plan.stays
    assert result.value == pytest.approx(check(problem, result.plan).reward, rel=1e-9)
    assert (result.reason, result.limit) == (Reason.STOPPED, Limit.TIME)
    assert f"for only {part.covered_steps} of 12 steps" in result.message
