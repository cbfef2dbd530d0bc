"""Lazy value iteration: its upper bounds, and that it finds the path of value iteration."""

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from pool import meetings, problems
from strategies import Calls, examples
from test_planners import blocked_at_random, close, meadow, seen_by_others

from cocap_opt.coordination.low_level import SingleRobotPath, SingleRobotTask, value_iteration
from cocap_opt.experiments.lab.studies.coverage.town import town
from cocap_opt.graph.charges import Charges
from cocap_opt.graph.value_iteration import backward_sweep
from cocap_opt.model import Model, compiled
from cocap_opt.objective import marginal_reward
from cocap_opt.planners import PLANNERS, lazy_value_iteration
from cocap_opt.planners.cocap import cocap
from cocap_opt.planners.greedy import greedy
from cocap_opt.planners.lazy_value_iteration import LazyValueIteration
from cocap_opt.planners.optimistic_coverage import OptimisticCoverage
from cocap_opt.problem import Camera, Problem
from cocap_opt.referee import check
from cocap_opt.result import Reason
from cocap_opt.scenarios import load_scene
from cocap_opt.stop import Limit, LimitReached, Stop, TimeLimit, never
from cocap_opt.vision import unhidden
from cocap_opt.vision.faces import FaceGeometry
from cocap_opt.vision.unhidden import Screens, UnhiddenViews

SLACK = 1e-9  # relative, of sums
LAZY_TWINS = ["greedy", "sequential", "cocap"]  # planners that have a lazy one of the same plan


class Asked(Stop):
    """Stopping criterion that notes the times before its end that it is asked for."""

    def __init__(self, left: float) -> None:
        self.left, self.kept = left, list[float]()

    @property
    def seconds_left(self) -> float:
        """Always the same."""
        return self.left

    def before(self, seconds: float) -> Stop:
        """Note the time that is to be kept."""
        self.kept.append(seconds)
        return never


def test_time_is_kept_for_each_model_and_stop() -> None:
    """One low level that plans two problems keeps for each what that one needs, or half."""
    low_level, stops = LazyValueIteration(), (Asked(math.inf), Asked(1e-9))
    for name in ("tiny-share", "tiny-queue"):
        model = compiled(load_scene(name, 0))
        for stop in stops:
            low_level(SingleRobotTask(model, 0, model.problem.no_pixels(), stop=stop))
            low_level(SingleRobotTask(model, 1, model.problem.no_pixels(), stop=stop))
    long, short = (stop.kept for stop in stops)
    assert long[0] == long[1] and long[2] == long[3]
    assert len(set(long)) == 2
    assert short == [5e-10] * 4


@examples(10)
@given(problem=problems())
def test_nobody_sees_more_than_if_nothing_hid_anybody(problem: Problem) -> None:
    """State by state and face by face; what is not listed is not seen. Parts change no bit."""
    model = Model(problem, use_cache=False)
    for robot_class in model.classes:
        views, reachable = model.views(robot_class), model.reachable(robot_class)
        unhidden_views = UnhiddenViews(views)
        for t in range(problem.first_step, problem.horizon + 1):
            found, states = unhidden_views.at(t, reachable[t]), np.flatnonzero(reachable[t])
            most = np.zeros((views.n_states, model.n_faces))
            most[found.rows, found.columns] = found.amounts
            assert (found.amounts > 0).all() and np.isin(found.rows, states).all()
            assert (np.diff(found.rows * max(model.n_faces, 1) + found.columns) > 0).all()
            assert (views.coverage(t, states) <= most[states]).all()
            with pytest.MonkeyPatch.context() as patch:
                patch.setattr(unhidden, "_AT_ONCE", 1)
                assert all(map(np.array_equal, found, unhidden_views.at(t, reachable[t])))


def test_nothing_hides_anybody_on_a_meadow() -> None:
    """Where nothing does, and no border cuts a face, the upper bound is the coverage."""
    model = Model(meadow(), use_cache=False)
    views = model.views(model.classes[0])
    found = UnhiddenViews(views).at(6, model.reachable(model.classes[0])[6])
    exact = views.coverage(6, found.rows)[np.arange(len(found.rows)), found.columns]
    assert np.isclose(found.amounts, exact, rtol=1e-6, atol=0).mean() > 0.5


@examples(7)
@given(problem=problems(robots=[1], over_time=True), seed=st.integers(0, 10**6))
def test_rewards_are_bounds_until_they_are_evaluated(problem: Problem, seed: int) -> None:
    """On top of whatever others see, in any order; those evaluated are exact to the last bit."""
    model, rng = Model(problem, use_cache=False), np.random.default_rng(seed)
    robot_class = model.classes[0]
    coverage = OptimisticCoverage(model, robot_class, never)
    for part in range(3):
        pixels = seen_by_others(model, seed + part)
        coverage.put_on_top_of(pixels)
        exact = marginal_reward(model, robot_class, pixels)
        reachable = model.reachable(robot_class)
        assert (coverage.rewards[reachable] >= exact[reachable]).all()
        nodes = coverage.unknown(np.flatnonzero(reachable & (rng.random(exact.shape) < 0.3)))
        coverage.evaluate(nodes, never)
        assert not len(coverage.unknown(nodes))
        assert np.array_equal(coverage.rewards.ravel()[nodes], exact.ravel()[nodes])
        assert (coverage.rewards[reachable] >= exact[reachable]).all()


def evaluated_nodes(patch: pytest.MonkeyPatch) -> list[int]:
    """Notes all nodes that are evaluated from now on."""
    nodes: list[int] = []
    evaluate = OptimisticCoverage.evaluate

    def noting(self: OptimisticCoverage, some: np.ndarray, *rest: object) -> None:
        nodes.extend(some.tolist())
        evaluate(self, some, *rest)  # type: ignore[arg-type]

    patch.setattr(OptimisticCoverage, "evaluate", noting)
    return nodes


@pytest.mark.parametrize("width", [1, 4])
@examples(9)
@given(problem=problems(robots=[1], over_time=True), seed=st.integers(0, 10**6))
def test_it_finds_the_path_of_value_iteration(width: int, problem: Problem, seed: int) -> None:
    """Task after task, past obstacles, constraints and others' pixels; no state twice."""
    model = Model(problem, use_cache=False)
    low_level, evaluated = LazyValueIteration(), 0
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(lazy_value_iteration, "_WIDTH", width)
        nodes = evaluated_nodes(patch)
        for part in range(3):
            pixels, charges = seen_by_others(model, seed + part), blocked_at_random(model, seed)
            task = SingleRobotTask(model, 0, pixels, charges)
            found, expected = low_level(task), value_iteration(task)
            assert found.path == expected.path
            assert np.array_equal(found.pixels, expected.pixels)
            evaluated += found.evaluated
    assert len(set(nodes)) == len(nodes) == evaluated
    reachable = np.flatnonzero(model.reachable(model.classes[0])[problem.first_step :])
    first = problem.first_step * model.classes[0].graph.n_states
    assert set(nodes) <= set((reachable + first).tolist())


@pytest.mark.parametrize("name", LAZY_TWINS)
@examples(5)
@given(problem=st.one_of(problems(over_time=True), meetings(), meetings(team=3)))
def test_lazy_planners_find_the_same_plan(name: str, problem: Problem) -> None:
    """Plan, J and reason are those of the planner with value iteration, to the last bit."""
    stop = Calls(3000) if name != "cocap" else never
    lazy, exact = PLANNERS[f"{name}-lazy"](problem, stop), PLANNERS[name](problem, never)
    assert (lazy.plan, lazy.value, lazy.reason) == (exact.plan, exact.value, exact.reason)


def test_it_finds_the_same_plan_from_few_views() -> None:
    """On a scene with a mesh, where most views are never evaluated, as statistics say."""
    problem = load_scene("bridge", 0)
    model = Model(problem, use_cache=False)
    lazy = greedy(problem, low_level=LazyValueIteration())
    reachable = int(np.count_nonzero(model.reachable(model.classes[0])[problem.first_step :]))
    assert 0 < lazy.statistics["evaluated"] < 0.02 * reachable
    verdict = check(problem, lazy.plan) if lazy.plan else None
    assert verdict is not None and close(verdict.reward, lazy.value)


def test_a_second_task_needs_no_view_again() -> None:
    """Views that one task has evaluated are remembered for the next."""
    model, low_level = Model(meadow(), use_cache=False), LazyValueIteration()
    task = SingleRobotTask(model, 0, meadow().no_pixels())
    first, second = low_level(task), low_level(task)
    assert first.path == second.path and first.evaluated > 0 == second.evaluated


@examples(20)
@given(problem=problems(robots=[1]), seed=st.integers(0, 10**6))
def test_screens_hide_only_what_nobody_sees(problem: Problem, seed: int) -> None:
    """What a column is known to hide a pinhole camera does not see at all, to the last bit."""
    assume(isinstance(problem.robots[0].camera, Camera))
    model, rng = Model(problem, use_cache=False), np.random.default_rng(seed)
    robot_class, geometry = model.classes[0], FaceGeometry(problem)
    views, graph = model.views(robot_class), robot_class.graph
    t = int(rng.integers(0, problem.horizon + 1))
    planes, places = geometry.planes(t), np.flatnonzero(graph.free)
    hidden = Screens.of(geometry.columns, problem.height_map.resolution, geometry.radius).hide(
        planes.middles[:, :2], planes.radii, planes.middles[:, 2] + planes.halves,
        graph.positions(problem.height_map, places) - geometry.origin,
    )  # fmt: skip
    for orientation in range(graph.n_orientations):
        coverage = views.coverage(t, orientation * graph.n_places + places)
        assert not coverage[hidden[:, problem.face_owner]].any()


def test_screens_find_who_is_behind_a_house() -> None:
    """In a town they tell it of more than four of ten pairs of a place and a person."""
    problem = town(seed=0, robots=2, actors=6, cells=60, steps=20, resolution=1.0)
    geometry, graph = FaceGeometry(problem), Model(problem).classes[0].graph
    planes, places = geometry.planes(0), np.flatnonzero(graph.free)
    hidden = Screens.of(geometry.columns, problem.height_map.resolution, geometry.radius).hide(
        planes.middles[:, :2], planes.radii, planes.middles[:, 2] + planes.halves,
        graph.positions(problem.height_map, places) - geometry.origin,
    )  # fmt: skip
    assert hidden.mean() > 0.4


@examples(6)
@given(problem=problems(robots=[1]), seed=st.integers(0, 10**6))
def test_a_sweep_may_begin_where_rewards_have_changed(problem: Problem, seed: int) -> None:
    """It gives the same values as one over all steps, under a goal and charges, too."""
    model, rng = Model(problem, use_cache=False), np.random.default_rng(seed)
    robot_class, charges = model.classes[0], blocked_at_random(model, seed)
    graph, goal = robot_class.graph, robot_class.goal
    reward = marginal_reward(model, robot_class, problem.no_pixels())
    value = backward_sweep(graph, reward, charges=charges, goal=goal)
    last = int(rng.integers(0, problem.horizon + 1))
    reward[: last + 1] *= 0.5
    again = backward_sweep(graph, reward, charges=charges, goal=goal, earlier=(value, last))
    assert np.array_equal(again, backward_sweep(graph, reward, charges=charges, goal=goal))


@pytest.mark.parametrize("asked", [0, 1, 5, 12])
def test_a_limit_ends_it(asked: int) -> None:
    """At whatever moment it comes, it is said; nothing that is known is forgotten."""
    model, low_level = Model(meadow(), use_cache=False), LazyValueIteration()
    with pytest.raises(LimitReached):
        low_level(SingleRobotTask(model, 0, meadow().no_pixels(), stop=Calls(asked)))
    task = SingleRobotTask(model, 0, meadow().no_pixels())
    assert low_level(task).path == value_iteration(task).path
    result = PLANNERS["cocap-lazy"](meadow(), TimeLimit(0))
    assert result.limit is Limit.TIME and result.plan is not None


class Near(Stop):
    """A time limit that is near from the third look at the clock on, and never reached."""

    looks = 0

    @property
    def seconds_left(self) -> float:
        """Much at first, and then nearly nothing."""
        self.looks += 1
        return 100.0 if self.looks < 3 else 1e-9


@pytest.mark.slow
def test_near_a_limit_the_best_path_that_is_known_is_returned() -> None:
    """Every robot has a path whose views are evaluated, and the result says that time was short."""
    problem = load_scene("bottleneck", 0)
    for planner in ("greedy-lazy", "sequential-lazy", "cocap-lazy"):
        result = PLANNERS[planner](problem, Near())
        assert (result.reason, result.limit) == (Reason.STOPPED, Limit.TIME)
        assert "paths are based on few evaluated views, as a limit was near" in result.message
        assert result.plan is not None
        verdict = check(problem, result.plan)
        assert not verdict.violations and close(verdict.reward, result.value)
        assert 0.5 < result.value / PLANNERS[planner.removesuffix("-lazy")](problem).value < 1.1


@pytest.mark.parametrize("hurried", [0, 1, 3])
def test_a_hurried_path_anywhere_in_the_tree_is_said(hurried: int) -> None:
    """Also where no robot follows it in the end: it may have led the search elsewhere."""
    asked: list[SingleRobotTask] = []

    def low_level(task: SingleRobotTask) -> SingleRobotPath:
        asked.append(task)
        limit = Limit.TIME if len(asked) == hurried + 1 else None
        return value_iteration(task)._replace(limit=limit)

    result = cocap(load_scene("tiny-give-way", 0), low_level=low_level)
    assert len(asked) > hurried, "the tree is too small for this test"
    assert (result.reason, result.limit) == (Reason.STOPPED, Limit.TIME)


def test_where_all_ways_are_closed_there_is_no_path() -> None:
    """That needs no view at all."""
    model = Model(meadow(), use_cache=False)
    closed = {(1, int(place)): math.inf for place in np.flatnonzero(model.classes[0].graph.free)}
    task = SingleRobotTask(model, 0, meadow().no_pixels(), Charges(closed))
    found = LazyValueIteration()(task)
    assert found.path is None and found.evaluated == 0 and not found.pixels.any()


@pytest.mark.parametrize("name", PLANNERS)
def test_lazy_planners_are_those_that_ask_for_no_coverage_before(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The list of lazy planners agrees with what their low levels are."""
    asked: list[Model] = []
    covered_by, prepare = Model.covered_by, Model.prepare

    def spy(model: Model, *arguments: object) -> Model:
        asked.append(model)
        return covered_by(model, *arguments)

    def spy_too(model: Model, *arguments: object) -> None:
        asked.append(model)
        prepare(model, *arguments)

    monkeypatch.setattr(Model, "covered_by", spy)
    monkeypatch.setattr(Model, "prepare", spy_too)
    PLANNERS[name](load_scene("tiny-share", 0), never)
    assert (not asked) == PLANNERS[name].lazy
