import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from brute_force import all_paths, optimum
from counting import counting, either
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st
from pool import meetings, problems
from strategies import Calls, drawn_problems, examples, tiny

from cocap_opt.formulations.certificates import verify
from cocap_opt.formulations.relaxations import collision_rows
from cocap_opt.formulations.relaxations import flow as flows
from cocap_opt.formulations.relaxations.collision_rows import ConflictRows
from cocap_opt.formulations.relaxations.cone_program import (
    concave,
    envelope,
    single_view,
)
from cocap_opt.formulations.relaxations.flow import Flow
from cocap_opt.formulations.relaxations.separation import Seen
from cocap_opt.formulations.result import Snapshot
from cocap_opt.model import Model, Path, compiled
from cocap_opt.objective import objective
from cocap_opt.problem import (
    NO_RULES,
    VERTEX_ONLY,
    CollisionRules,
    Motion,
    Objective,
    Problem,
    Robot,
    State,
)
from cocap_opt.referee import _Referee
from cocap_opt.result import Reason, UnsupportedError
from cocap_opt.scenarios import load_scene
from cocap_opt.stop import Limit, TimeLimit, never
from cocap_opt.world.workspace import HeightMap

RELAXATIONS = {"concave": concave, "single-view": single_view, "envelope": envelope}
ACCURACY = {"rel": 1e-4, "abs": 1e-3}  # of an interior-point solution, certified


def any_problem() -> st.SearchStrategy[Problem]:
    """Small problems of all kinds, half of them with robots in one another's way."""
    return either(st.one_of(problems(), problems(over_time=True), meetings(), meetings(3)))


@pytest.mark.parametrize("name", ["tiny-trap", "tiny-share", "tiny-queue"])
def test_relaxations_of_tiny_scenes_are_ordered(name: str) -> None:
    """concave >= single view >= envelope >= optimum, each proved by its certificate."""
    assert_ordered(load_scene(name))


@pytest.mark.slow
@examples(12)
@given(problem=any_problem())
def test_relaxations_are_ordered_and_above_the_optimum(problem: Problem) -> None:
    """The same for random problems of all kinds."""
    assert_ordered(problem)


def assert_ordered(problem: Problem) -> None:
    """Each relaxation is at most the one before, and above the optimum."""
    best = optimum(problem)
    bounds = []
    for relaxation in RELAXATIONS.values():
        result = relaxation(problem)
        assert result.bound >= best.value
        assert result.reason in (Reason.FINISHED, Reason.INFEASIBLE)
        if result.reason is Reason.INFEASIBLE:
            assert best.plan is None
        assert verify(problem, result.certificate).bound == result.bound
        bounds.append(result.bound)
    if min(bounds) > 0:
        for weaker, stronger in pairwise(bounds):
            assert weaker >= stronger * (1 - ACCURACY["rel"]) - ACCURACY["abs"]


@examples(6)
@given(problem=counting(st.one_of(problems(over_time=True), meetings())))
def test_the_prices_of_counts_prove_what_the_program_is_worth(problem: Problem) -> None:
    """No multiplier is lost on its way from the solver to the certificate."""
    for relaxation in (concave, single_view):
        result = relaxation(problem)
        if "solver_value" in result.statistics and result.bound > 0:
            value = result.statistics["solver_value"]  # the bound of drones alone may be less
            assert result.bound <= value * (1 + ACCURACY["rel"]) + ACCURACY["abs"]


@pytest.mark.slow
@examples(10)
@given(problem=any_problem())
def test_one_flow_per_class_is_as_tight_as_one_per_robot(problem: Problem) -> None:
    """Aggregating the robots of a class loses nothing, with and without single-view cuts."""
    for relaxation in (concave, single_view):
        results = [
            replace(relaxation, compile_=compile_)(problem)
            for compile_ in (compiled, lambda problem: compiled(problem).disaggregated())
        ]
        assert results[0].reason is results[1].reason
        if results[0].bound > 0:
            assert results[0].bound == pytest.approx(results[1].bound, **ACCURACY)


@examples(10)
@given(problem=either(problems(robots=[1])))
def test_single_view_cuts_are_exact_for_one_robot(problem: Problem) -> None:
    """For one robot the relaxation with single-view cuts is the shortest-path polytope."""
    best = optimum(problem).value
    for relaxation in (single_view, envelope):
        bound = relaxation(problem).bound
        if math.isfinite(best):
            assert bound == pytest.approx(best, rel=1e-5, abs=1e-4)
        else:
            assert bound < 0


@pytest.mark.slow
@settings(examples(10), suppress_health_check=[HealthCheck.filter_too_much])  # few teams are alike
@given(problem=drawn_problems(robots=st.sampled_from([2, 3]), goals=False), face=st.integers(0, 4))
def test_one_face_at_one_step_leaves_no_gap(problem: Problem, face: int) -> None:
    """Cells that robots can share out at one step form a transversal matroid.

    So the plan that takes the best cells one after the other has the most pixels of all
    mixtures, and even the plain relaxation is exact. (With more faces or steps it is not, be
    there ever so few robots: an envelope is exact for each root, not for their sum.)
    """
    assume(problem.actors)
    weights = np.eye(len(problem.actors[0].face_weights))[face % 3].tolist()
    one = problem.robots[0]
    alone = problem.replace(
        horizon=1,
        actors=(problem.actors[0].replace(weights=tuple(weights)),),
        robots=tuple(one.replace(start=robot.start) for robot in problem.robots),
        rules=VERTEX_ONLY,
        objective=Objective(),
    ) if same_states(problem) else None  # fmt: skip
    assume(alone is not None)
    best = optimum(alone).value
    for relaxation in RELAXATIONS.values():
        assert relaxation(alone).bound == pytest.approx(best, rel=1e-5, abs=1e-4)


def same_states(problem: Problem) -> bool:
    """True where all robots' starts are fixed states of the first, and no two in one cell."""
    if problem.has_free_starts:
        return False
    cells = [problem.cell(i, state) for i, state in enumerate(problem.first_starts)]
    alike = len({(robot.motion, robot.camera) for robot in problem.robots}) == 1
    return alike and len(set(cells)) == len(cells)


@examples(40)
@given(
    roots=st.lists(st.floats(0.5, 40.0), min_size=1, max_size=9, unique=True),
    shares=st.lists(st.floats(0.01, 1.0), min_size=9, max_size=9),
    total=st.floats(0.1, 2.0),
)
def test_the_envelope_of_two_robots_is_the_antitone_coupling(
    roots: list[float], shares: list[float], total: float
) -> None:
    """The best of one robot meets the worst of the other: no mixture of pairs has more."""
    points = np.sort(np.array(roots))
    assume(len(points) == 1 or np.diff(points).min() > 0.05)
    amounts = np.array(shares[: len(points)])
    amounts *= total / amounts.sum()
    seen = Seen(np.zeros(len(points), dtype=np.int64), points, amounts)
    cut = seen.best_cut(0, points[-1:], (2,))
    assert cut is not None
    height = seen.height(cut)
    # Each of the two has half of the amounts; what is left over sees nothing.
    values = np.append(0.0, points)
    ends = np.cumsum(np.append(2.0 - total, amounts)) / 2
    steps = np.unique(np.clip(np.concatenate([[0.0], ends, 1 - ends, [1.0]]), 0, 1))
    middle = (steps[1:] + steps[:-1]) / 2
    upper = values[np.minimum(np.searchsorted(ends, middle), len(points))]
    lower = values[np.minimum(np.searchsorted(ends, 1 - middle), len(points))]
    expected = float((np.diff(steps) * np.hypot(upper, lower)).sum())
    assert height == pytest.approx(expected, rel=1e-3)
    assert height >= expected * (1 - 1e-6)


# -- flows -------------------------------------------------------------------------------------


def random_paths(model: Model, rng: np.random.Generator) -> list[Path] | None:
    """A path for each robot, whatever the rules; None where one has none."""
    chosen = []
    for robot in range(len(model.problem.robots)):
        paths = all_paths(model.problem, robot)
        if not paths:
            return None
        graph = model.class_of[robot].graph
        path = paths[int(rng.integers(len(paths)))]
        chosen.append(tuple(graph.index(state) for state in path))
    return chosen


@examples(12)
@given(problem=any_problem(), seed=st.integers(0, 1000))
def test_paths_and_flows_go_over_into_one_another(problem: Problem, seed: int) -> None:
    """A flow's paths begin where the robots do, have its J and break rules where its rows do."""
    model, rng = compiled(problem), np.random.default_rng(seed)
    flow = Flow.of(model)
    paths = random_paths(model, rng)
    assert flow.serves_all == (paths is not None)
    assume(paths is not None)
    x, y = flow.amounts(paths)
    assert (flow.entering @ y + flow.supply == x).all()
    again = flow.paths(y)
    assert all(path[0] in model.starts(i) for i, path in enumerate(again))
    assert objective(model, again) == pytest.approx(objective(model, paths))
    rows = ConflictRows.of(flow)
    used = np.concatenate([rows.at_nodes @ x, rows.crossing @ y])
    for plan in (model.plan(paths), model.plan(again)):
        assert bool(_Referee(problem).conflicts(plan)) == bool((used > 1).any())
    for row in range(len(used)):
        resource = rows.resource(row)
        assert not resource.why_absent(model) and not resource.why_shared(problem)


def test_a_fractional_flow_of_integral_nodes_is_made_integral() -> None:
    """Half stay and half change places: a robot's path takes one way, the one that pays."""
    motion = Motion(headings=1)
    robots = (Robot(start=State(0, 0), motion=motion), Robot(start=State(1, 0), motion=motion))
    problem = Problem(
        name="pair", height_map=HeightMap(heights=np.zeros((2, 1))), robots=robots, actors=(),
        horizon=1, rules=NO_RULES, objective=Objective(stationarity=1.0),
    )  # fmt: skip
    model = compiled(problem)
    flow = Flow.of(model)
    stay = tuple((model.first_start(i), model.first_start(i)) for i in range(2))
    change = tuple((model.first_start(i), model.first_start(1 - i)) for i in range(2))
    x, half = (flow.amounts(stay)[k] / 2 + flow.amounts(change)[k] / 2 for k in range(2))
    assert flow.paths(half, x) == stay
    with pytest.raises(ValueError, match="integral"):
        flow.paths(half * 0.4)


@pytest.mark.parametrize(
    "cells", [0.0, 1.6, *(pytest.param(n, marks=pytest.mark.slow) for n in (1.2, 2.1, 2.9, 3.7))]
)
def test_separation_rows_hold_every_pair_that_is_too_close(cells: float) -> None:
    """Cliques are laid over all cells, so that any two that conflict are in one of them."""
    camera, motion = tiny().robots[0].camera, Motion(headings=1, layers=(5.0, 11.0), radius=6)
    problem = Problem(
        name="wide", height_map=HeightMap(heights=np.zeros((6, 5)), resolution=4.0), actors=(),
        robots=tuple(
            Robot(start=State(*at), motion=motion, camera=camera) for at in ((0, 0), (5, 4))
        ),
        horizon=1, rules=CollisionRules(swap=False, separation=4.0 * cells),
    )  # fmt: skip
    flow = Flow.of(compiled(problem))
    rows = ConflictRows.of(flow).at_nodes.toarray() > 0
    last = np.flatnonzero(flow.steps == 1)
    for n in last:
        for m in last:
            a, b = flow.cell(int(flow.places[n])), flow.cell(int(flow.places[m]))
            together = bool((rows[:, n] & rows[:, m]).any())
            assert together == problem.too_close(a, b)


def test_large_scenes_are_refused_in_words(monkeypatch: pytest.MonkeyPatch) -> None:
    """A flow model says what it takes before it fills the memory."""
    monkeypatch.setattr(flows, "MOST_EDGES", 10)
    with pytest.raises(UnsupportedError, match="at most 10 edges"):
        single_view(tiny())
    monkeypatch.undo()
    monkeypatch.setattr(collision_rows, "MOST_ENTRIES", 1)
    problem = tiny().replace(rules=CollisionRules(separation=5.0))
    with pytest.raises(UnsupportedError, match="separation rows"):
        single_view(problem)


# -- limits ------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("method", RELAXATIONS)
def test_wherever_it_is_stopped_there_is_a_certified_bound(method: str) -> None:
    """A limit ends every part of the work, building included, with a bound and no exception."""
    problem = load_scene("tiny-share")
    best, calls = optimum(problem).value, 0
    while True:
        result = RELAXATIONS[method](problem, Calls(calls))
        assert result.bound >= best
        if result.reason is Reason.FINISHED:
            break
        assert (result.reason, result.limit) == (Reason.STOPPED, Limit.TIME)
        calls += 1
    assert calls > 5


@pytest.mark.parametrize("method", RELAXATIONS)
def test_no_time_at_all(method: str) -> None:
    """With a time limit of 0 the reason is the limit."""
    problem = tiny()
    result = RELAXATIONS[method](problem, TimeLimit(0))
    assert (result.reason, result.limit) == (Reason.STOPPED, Limit.TIME)
    assert result.bound >= optimum(problem).value


def test_progress_never_goes_back() -> None:
    """Each round reports its bound; the last is the result's."""
    seen: list[Snapshot] = []
    result = envelope(load_scene("tiny-trap"), never, None, seen.append)
    bounds = [snapshot.bound for snapshot in seen]
    assert bounds == sorted(bounds, reverse=True) and bounds[-1] == result.bound


# -- special cases -----------------------------------------------------------------------------


@pytest.mark.parametrize("method", RELAXATIONS)
def test_nothing_to_see_and_nowhere_to_go(method: str) -> None:
    """No actors: the bound is the stationarity's. No path for a robot: there is no plan."""
    problem = tiny()
    empty = problem.replace(actors=())
    assert RELAXATIONS[method](empty).bound == pytest.approx(0.0, abs=1e-6)
    still = empty.replace(objective=Objective(stationarity=2.0))
    assert RELAXATIONS[method](still).bound == pytest.approx(8.0)
    robots = tuple(robot.replace(goal=(0, 0)) for robot in problem.robots)
    result = RELAXATIONS[method](problem.replace(horizon=1, robots=robots))
    assert (result.bound, result.reason) == (-math.inf, Reason.INFEASIBLE)


@pytest.mark.parametrize("method", RELAXATIONS)
def test_faces_of_no_weight_do_not_count(method: str) -> None:
    """A weight of 0 takes a face out of the bound, all of them everything."""
    problem = tiny()
    blind = problem.actors[0].replace(weights=(0.0,) * 5)
    assert RELAXATIONS[method](problem.replace(actors=(blind,))).bound == pytest.approx(
        0.0, abs=1e-6
    )
    counted = problem.replace(objective=Objective(count_start=True))
    assert RELAXATIONS[method](counted).bound >= optimum(counted).value


def test_rows_that_no_flow_obeys_prove_that_there_is_no_plan() -> None:
    """Where two robots must end in one cell, a negative bound says so."""
    problem = tiny().replace(horizon=2)
    robots = tuple(robot.replace(goal=(0, 2)) for robot in problem.robots)
    crowded = problem.replace(robots=robots, rules=VERTEX_ONLY)
    assert optimum(crowded).plan is None
    assert single_view(crowded).reason is Reason.INFEASIBLE
