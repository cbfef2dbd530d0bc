"""The contract of all planners at once, against brute force, and what each one guarantees."""

import json
import math
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import msgspec
import numpy as np
import pytest
from brute_force import all_paths, bonus_of, optimum, pixels_of, weights_of
from hypothesis import assume, given
from hypothesis import strategies as st
from pool import meetings, problems
from strategies import (
    WALL,
    drawn_meetings,
    drawn_problems,
    examples,
    number_of_plans,
    standing,
    tiny,
)

from cocap_opt.coordination.low_level import (
    LowLevel,
    PlannedTeam,
    SingleRobotPath,
    SingleRobotTask,
    value_iteration,
)
from cocap_opt.graph.charges import Charges
from cocap_opt.graph.networks import time_expanded_graph
from cocap_opt.method import Method
from cocap_opt.model import Model
from cocap_opt.objective import objective
from cocap_opt.planners import PLANNERS, constraint_tree
from cocap_opt.planners.cocap import cocap
from cocap_opt.planners.greedy import greedy, greedy_rounds
from cocap_opt.planners.joint import joint
from cocap_opt.planners.results import hovering
from cocap_opt.planners.sequential import sequential
from cocap_opt.planners.view_search import Compounded, Undiscounted, ViewSearch
from cocap_opt.problem import (
    NO_RULES,
    VERTEX_ONLY,
    Actor,
    Camera,
    CollisionRules,
    Cone,
    Conflict,
    Motion,
    Objective,
    Plan,
    Problem,
    Robot,
    State,
    VertexConflict,
)
from cocap_opt.referee import _Referee, check
from cocap_opt.result import Reason, Result, UnsupportedError, relative_gap
from cocap_opt.scenarios import load_scene
from cocap_opt.stop import (
    FirstOf,
    Interrupt,
    Limit,
    LimitReached,
    Stop,
    TimeLimit,
    WorkLimit,
    never,
)
from cocap_opt.world.workspace import HeightMap

CALLS = 3000  # how often a planner may ask whether to stop: cuts constraint trees off


class Patience(Stop):
    """Stopping criterion that is reached after so many questions: the same on any machine."""

    def __init__(self, calls: int = CALLS) -> None:
        self._left = calls

    def reached(self) -> Limit | None:
        """Count down."""
        self._left -= 1
        return Limit.WORK if self._left < 0 else None


def close(a: float, b: float) -> bool:
    """Equal to 1e-9 relative."""
    return a == b or math.isclose(a, b, rel_tol=1e-9, abs_tol=1e-9)


def takes(planner: Method[Result], problem: Problem) -> bool:
    """True if a planner takes so many robots."""
    return planner.most_robots is None or len(problem.robots) <= planner.most_robots


def check_contract(name: str, problem: Problem, result: Result) -> None:
    """What holds for every result of every planner."""
    assert result.seconds >= 0
    assert (result.reason is Reason.STOPPED) == (result.limit is not None)
    if result.plan is None:
        assert result.value == -math.inf
        assert result.reason in (Reason.INFEASIBLE, Reason.FAILED, Reason.STOPPED)
        return
    assert result.reason in (Reason.OPTIMAL, Reason.FINISHED, Reason.STOPPED)
    verdict = check(problem, result.plan)
    assert verdict.violations == ()
    assert close(result.value, verdict.reward)
    assert result.bound >= result.value
    if PLANNERS[name].obeys_rules:
        assert verdict.conflicts == ()


@examples(24)
@given(st.one_of(drawn_problems(), drawn_meetings(), drawn_meetings(team=3)))
def test_contract(problem: Problem) -> None:
    """Every planner: a plan that can be flown and is worth what it says, never above the optimum.

    Those that claim it obey the rules; the exact ones attain the optimum; complete ones fail
    only where brute force finds no plan, and call a failure of theirs a proof only there.
    """
    best = optimum(problem)
    free = optimum(problem.without_rules())
    for name, planner in PLANNERS.items():
        if not takes(planner, problem):
            with pytest.raises(UnsupportedError, match="two drones"):
                planner(problem, never)
            continue
        result = planner(problem, Patience())
        check_contract(name, problem, result)
        limit = best.value if planner.obeys_rules else free.value
        assert result.value <= limit or close(result.value, limit), name
        if result.reason is Reason.INFEASIBLE:
            assert (best if planner.obeys_rules else free).plan is None, name
        if best.plan is None and planner.complete:
            assert result.plan is None, name
        if planner.complete and result.reason is not Reason.STOPPED:
            assert (result.plan is None) == (best.plan is None), name
        if planner.optimal:
            assert close(result.value, best.value), name
            assert result.reason in (Reason.OPTIMAL, Reason.INFEASIBLE)
        if name == "greedy" and free.plan is not None:
            assert result.value >= free.value / 2 - 1e-9


@pytest.mark.parametrize("name", PLANNERS)
def test_tiny_instance(name: str) -> None:
    """Every planner solves the tiny instance, and none beats its known optimum."""
    problem = tiny()
    result = PLANNERS[name](problem, never)
    check_contract(name, problem, result)
    best = optimum(problem)
    assert result.plan is not None
    assert 0.5 * best.value <= result.value <= best.value * (1 + 1e-9)


@examples(15)
@given(problems(robots=[1]))
def test_one_robot_is_planned_optimally(problem: Problem) -> None:
    """For one robot greedy, sequential, CoCap and joint planning are all exact."""
    best = optimum(problem)
    for planner in (greedy, sequential, cocap, joint):
        assert close(planner(problem).value, best.value)


def line(length: int, *starts: int, goals: tuple[int, ...] = (), horizon: int = 2) -> Problem:
    """Robots of one heading on a line of cells, a wall of actors in view of none of them."""
    motion = Motion(headings=1)
    robots = tuple(
        Robot(start=State(x, 0), motion=motion, goal=(goals[i], 0) if goals else None)
        for i, x in enumerate(starts)
    )
    heights = np.zeros((length, 1))
    return Problem(
        name="", height_map=HeightMap(heights=heights), robots=robots, actors=(), horizon=horizon
    )


def test_robots_that_must_pass_each_other_have_no_plan() -> None:
    """On a line no two robots can change sides: proved by those that can prove it."""
    problem = line(3, 0, 2, goals=(2, 0), horizon=4)
    assert optimum(problem).plan is None
    for planner in (cocap, joint):
        result = planner(problem, Patience())
        assert (result.plan, result.reason, result.value) == (None, Reason.INFEASIBLE, -math.inf)
    assert sequential(problem).reason is Reason.FAILED
    free = problem.replace(rules=NO_RULES)
    assert joint(free).reason is Reason.OPTIMAL
    swapping = line(2, 0, 1, goals=(1, 0), horizon=1)
    assert joint(swapping).reason is Reason.INFEASIBLE
    assert joint(swapping.replace(rules=VERTEX_ONLY)).reason is Reason.OPTIMAL


def test_sequential_planning_may_fail_where_there_is_a_plan() -> None:
    """A bad order leaves the second robot no way: that is a failure, not a proof."""
    # The first robot may stay in the only niche; the second must pass it.
    heights = np.full((5, 2), WALL)
    heights[:, 0] = 0.0
    heights[2, 1] = 0.0
    motion = Motion(headings=1)
    robots = (
        Robot(start=State(2, 0), motion=motion, goal=(2, 0)),
        Robot(start=State(0, 0), motion=motion, goal=(4, 0)),
    )
    problem = Problem(
        name="", height_map=HeightMap(heights=heights), robots=robots, actors=(), horizon=4,
        objective=Objective(stationarity=1.0),
    )  # fmt: skip
    result = sequential(problem)
    assert (result.plan, result.reason, result.limit) == (None, Reason.FAILED, None)
    assert result.statistics["failed_robot"] == 1
    for planner in (joint, cocap):
        assert check(problem, planner(problem).plan or Plan(paths=())).valid


def test_goal_out_of_reach() -> None:
    """Where a goal is too far every planner says that there is no plan, with its own reason."""
    problem = line(6, 0, goals=(5,), horizon=3)
    for name, planner in PLANNERS.items():
        result = planner(problem, never)
        check_contract(name, problem, result)
        assert result.plan is None
        can_prove = planner.complete or not planner.obeys_rules or name == "one-step"
        expected = Reason.INFEASIBLE if can_prove else Reason.FAILED
        assert result.reason is expected


# -- single-robot planners ----------------------------------------------------------------


def seen_by_others(model: Model, seed: int) -> np.ndarray:
    """Random pixels [Z] that other robots might have."""
    rng = np.random.default_rng(seed)
    pixels = rng.choice([0.0, 10.0, 4000.0], len(model.problem.no_pixels()))
    return pixels * rng.random(len(pixels))


def blocked_at_random(model: Model, seed: int) -> Charges:
    """Closed places and moves of the first robot's graph."""
    rng, graph = np.random.default_rng(seed), model.class_of[0].graph
    horizon, free = model.problem.horizon, np.flatnonzero(graph.free)
    places = {
        (int(rng.integers(1, horizon + 1)), int(rng.choice(free))): math.inf
        for _ in range(int(rng.integers(0, 4)))
    }
    moves = {}
    for _ in range(int(rng.integers(0, 8))):
        tail = int(rng.choice(free))
        head = int(rng.choice(graph.neighbours(np.array([tail]))[:, 0]))
        if head != -1:
            moves[int(rng.integers(0, horizon)), tail, head] = math.inf
    return Charges(places, moves)


def marginal_values(model: Model, paths: list[tuple[State, ...]], seen: np.ndarray) -> np.ndarray:
    """What each path of the first robot adds to J on top of what others see."""
    problem = model.problem
    own = pixels_of(problem, 0, paths)
    others = seen.reshape(own.shape[1:])
    gain = (np.sqrt(others + own) - np.sqrt(others)) * weights_of(problem)
    return gain.sum(axis=(1, 2)) + [bonus_of(problem, path) for path in paths]


def obeys(model: Model, charges: Charges, path: tuple[State, ...]) -> bool:
    """True where a path of the first robot uses nothing that is closed."""
    graph = model.class_of[0].graph
    places = [graph.place(s.layer, s.x, s.y) for s in path]
    return not any(
        (t, place) in charges.places or (t - 1, places[t - 1], place) in charges.moves
        for t, place in enumerate(places)
    )


@pytest.mark.parametrize("kind", ["value iteration", "view search", "view search, undiscounted"])
@examples(24)
@given(problem=problems(robots=[1]), seed=st.integers(0, 10**6))
def test_low_levels(kind: str, problem: Problem, seed: int) -> None:
    """A low level finds a path that obeys goal and charges wherever there is one.

    Value iteration finds the best for what others see; view search never claims pixels that
    its path does not have.
    """
    low_level: LowLevel = {
        "value iteration": value_iteration,
        "view search": ViewSearch(),
        "view search, undiscounted": ViewSearch(Undiscounted()),
    }[kind]
    model = Model(problem, use_cache=False)
    seen, charges = seen_by_others(model, seed), blocked_at_random(model, seed)
    paths = [path for path in all_paths(problem, 0) if obeys(model, charges, path)]
    found = low_level(SingleRobotTask(model, 0, seen, charges))
    assert (found.path is None) == (not paths)
    if found.path is None:
        assert not found.pixels.any()
        return
    states = model.plan([found.path]).paths[0]
    assert states in paths
    np.testing.assert_allclose(found.pixels, pixels_of(problem, 0, [states])[0].ravel(), rtol=1e-12)
    if kind == "value iteration":
        best = marginal_values(model, paths, seen).max()
        assert close(float(marginal_values(model, [states], seen)[0]), float(best))


def test_view_search_heeds_weights() -> None:
    """A face of little weight does not draw view search away from one of more weight."""
    faces = (0.01,) * 5
    near, far = standing(12.0, 18.0, 0.0, 0.3), standing(12.0, 4.0, 0.0, 0.3)
    robot = (
        meadow()
        .robots[0]
        .replace(start=State(6, 6), motion=Motion(radius=0, headings=4, layers=(2.5,)))
    )
    problem = meadow().replace(
        robots=(robot,), actors=(near.replace(weights=faces), far), horizon=1
    )
    for actors, heading in ((problem.actors, 3), ((near, far), 1)):
        plan = greedy(problem.replace(actors=actors), low_level=ViewSearch()).plan
        assert plan is not None
        assert plan.paths[0][-1].heading == heading


@examples(20)
@given(problems(robots=[1]), st.integers(0, 10**6))
def test_view_search_takes_the_best_of_one_step(problem: Problem, seed: int) -> None:
    """Over a single step from one start it is exact: it takes the best of all weighted views."""
    assume(isinstance(problem.robots[0].start, State))
    model = Model(problem.replace(horizon=1), use_cache=False)
    seen, charges = seen_by_others(model, seed), blocked_at_random(model, seed)
    task = SingleRobotTask(model, 0, seen, charges)
    found, best = ViewSearch()(task), value_iteration(task)
    assert (found.path is None) == (best.path is None)
    if found.path is not None and best.path is not None:
        values = marginal_values(model, list(model.plan([found.path]).paths), seen)
        expected = marginal_values(model, list(model.plan([best.path]).paths), seen)
        assert close(float(values[0]), float(expected[0]))


def literal_view_search(task: SingleRobotTask, gamma: float) -> tuple[int, ...] | None:
    """CoCap's Alg. 2 with lists and dictionaries only; None where ties would decide.

    Rbar_{k+1} = (R_{k+1} + Rbar_k) gamma^(k-1), k from 1; a state includes its step; dominance
    compares the compounded value; processed states are skipped.
    """
    model, graph = task.model, task.model.class_of[0].graph
    views = model.views(model.class_of[0])
    start = (1, model.first_start(0))
    rbar, path_to, processed = {start: 0.0}, {start: (start[1],)}, set()
    waiting = [(0.0, *start)]
    while waiting:
        best = max(value for value, _, _ in waiting)
        top = [entry for entry in waiting if entry[0] == best]
        if len(top) > 1:
            return None
        waiting.remove(top[0])
        _, k, state = top[0]
        if k == model.problem.horizon + 1:
            return path_to[k, state]
        if (k, state) in processed:
            continue
        processed.add((k, state))
        for head in graph.successors(k - 1, state).tolist():
            seen = views.coverage(k, np.array([head]))[0]
            others = task.pixels[model.problem.view_sums_at(k)]
            weights = model.problem.view_sum_weights[model.problem.view_sums_at(k)]
            reward = float(((np.sqrt(others + seen) - np.sqrt(others)) * weights).sum())
            value = (reward + rbar[k, state]) * gamma ** (k - 1)
            child = (k + 1, head)
            if child not in processed and value > rbar.get(child, -math.inf):
                rbar[child], path_to[child] = value, (*path_to[k, state], head)
                waiting.append((value, *child))
    return None


@pytest.mark.parametrize("gamma", [0.7, 0.95, 1.0])
@examples(15)
@given(problem=problems(robots=[1], goals=False), seed=st.integers(0, 10**6))
def test_view_search_is_its_algorithm(gamma: float, problem: Problem, seed: int) -> None:
    """The discount compounds, k counts from 1, and dominance compares compounded values."""
    problem = problem.replace(objective=Objective())
    model = Model(problem, use_cache=False)
    task = SingleRobotTask(model, 0, seen_by_others(model, seed))
    expected = literal_view_search(task, gamma)
    assume(expected is not None)
    assert ViewSearch(Compounded(gamma))(task).path == expected


@pytest.mark.slow
@pytest.mark.parametrize("gamma", [0.9, 0.95, 0.99])
def test_view_search_is_its_algorithm_in_the_open(gamma: float) -> None:
    """The same on a meadow, where no ties decide, and gamma makes a difference."""
    model = Model(meadow(), use_cache=False)
    task = SingleRobotTask(model, 0, meadow().no_pixels())
    expected = literal_view_search(task, gamma)
    assert expected is not None
    assert ViewSearch(Compounded(gamma))(task).path == expected


def meadow(horizon: int = 6) -> Problem:
    """One robot with eight headings over an open field, one actor in sight."""
    camera = Camera(width=400, height=300, focal=200.0, tilts=(0.6,))
    return Problem(
        name="",
        height_map=HeightMap(heights=np.zeros((12, 12)), resolution=2.0),
        robots=(Robot(start=State(2, 2), camera=camera),),
        actors=(standing(14.0, 13.0, 0.0, 0.4, steps=horizon),),
        horizon=horizon,
    )


@pytest.mark.slow
def test_view_search_is_lazy() -> None:
    """View search evaluates far fewer states than can be reached, and says how many."""
    problem = meadow()
    reachable = len(time_expanded_graph(problem, 0)) - 1
    model = Model(problem, use_cache=False)
    search = ViewSearch()
    found = search(SingleRobotTask(model, 0, problem.no_pixels()))
    assert found.path is not None
    assert 0 < found.evaluated < reachable / 4
    assert _Referee(problem).violations(model.plan([found.path])) == []
    assert found.pixels.sum() > 0
    again = search(SingleRobotTask(model, 0, problem.no_pixels()))
    assert (again.path, again.evaluated) == (found.path, 0)  # remembered
    result = greedy(problem, low_level=ViewSearch())
    assert result.statistics["evaluated"] == found.evaluated


def test_view_search_reaches_its_goal() -> None:
    """View search turns to its goal in time though the views are elsewhere."""
    problem = meadow()
    goal = (0, 6)
    problem = problem.replace(robots=(problem.robots[0].replace(goal=goal),))
    result = greedy(problem, low_level=ViewSearch())
    assert result.plan is not None
    last = result.plan.paths[0][-1]
    assert (last.x, last.y) == goal


def test_view_search_backtracks_from_dead_ends() -> None:
    """Where all ways on from the first choice are closed, view search takes another."""
    problem = line(3, 1, horizon=2)
    model = Model(problem, use_cache=False)
    graph = model.class_of[0].graph
    left, middle, right = (graph.place(0, x, 0) for x in range(3))
    places = {(2, middle): math.inf, (2, left): math.inf, (1, right): math.inf}
    charges = Charges(places, {(1, middle, right): math.inf})
    task = SingleRobotTask(model, 0, problem.no_pixels(), charges)
    assert ViewSearch()(task).path is None
    assert value_iteration(task).path is None
    task = SingleRobotTask(model, 0, problem.no_pixels(), Charges(places))
    assert ViewSearch()(task).path == value_iteration(task).path == (middle, middle, right)


# -- limits -------------------------------------------------------------------------------


@pytest.mark.parametrize("name", PLANNERS)
@pytest.mark.parametrize("robots", [1, 2])
def test_no_time_at_all(name: str, robots: int) -> None:
    """With the time already up a planner returns at once and says that time stopped it."""
    problem = tiny().replace(robots=tiny().robots[:robots])
    begin = time.perf_counter()
    result = PLANNERS[name](problem, TimeLimit(0))
    assert time.perf_counter() - begin < 2
    check_contract(name, problem, result)
    assert (result.reason, result.limit) == (Reason.STOPPED, Limit.TIME)
    if name in ("greedy", "greedy-rounds", "sequential", "formation", "myopic", "one-step"):
        assert result.plan is not None


@examples(12)
@given(problems(), st.integers(0, 12))
def test_stopped_at_any_moment(problem: Problem, calls: int) -> None:
    """Whenever a planner is stopped, what it returns still keeps the contract."""
    for name, planner in PLANNERS.items():
        if not takes(planner, problem):
            continue
        result = planner(problem, Patience(calls))
        check_contract(name, problem, result)


@examples(10)
@given(problems(goals=False))
def test_a_plan_without_time_is_legal(problem: Problem) -> None:
    """Without goals, greedy and sequential planning have a plan even if no time is left.

    The sequential one obeys the rules: robots for which no time is left stay at their starts,
    which the earlier ones have kept free.
    """
    for calls in range(len(problem.robots) + 1):
        assert greedy(problem, Patience(calls)).plan is not None
        plan = sequential(problem, Patience(calls)).plan
        if plan is not None:
            assert check(problem, plan).valid
        assert plan is not None or sequential(problem).reason is Reason.FAILED


@dataclass
class Leaf:
    """Node of the constraint tree in the plain algorithm below."""

    paths: list[tuple[int, ...]]
    closed: list[Charges]  # per robot
    value: float


def plain_cocap(problem: Problem) -> tuple[Plan | None, int]:
    """CoCap's Alg. 1 with a list instead of a queue; the plan and the number of nodes."""
    model, robots = Model(problem, use_cache=False), range(len(problem.robots))

    def planned(
        paths: list[tuple[int, ...]], robot: int, closed: Charges
    ) -> tuple[int, ...] | None:
        others = problem.no_pixels()
        for i, path in enumerate(paths):
            if i != robot:
                others = others + model.robot_pixels(i, path)
        return value_iteration(SingleRobotTask(model, robot, others, closed)).path

    paths: list[tuple[int, ...]] = []
    for robot in robots:
        path = planned(paths, robot, Charges())
        if path is None:
            return None, 0
        paths.append(path)
    leaves, nodes = [Leaf(paths, [Charges()] * len(paths), objective(model, paths))], 1
    while leaves:
        leaf = max(leaves, key=lambda leaf: leaf.value)  # the first of the greatest
        leaves.remove(leaf)
        plan = model.plan(leaf.paths)
        conflict = next(plan.conflicts(problem), None)
        if conflict is None:
            return plan, nodes
        for which, robot in enumerate(conflict.robots):
            graph, (own, other) = model.class_of[robot].graph, plan_states(plan, conflict, which)
            before = leaf.closed[robot]
            places, moves = dict(before.places), dict(before.moves)
            here = graph.place(own.layer, own.x, own.y)
            if not isinstance(conflict, VertexConflict):
                moves[conflict.t, here, graph.place(other.layer, other.x, other.y)] = math.inf
            else:
                places[conflict.t, here] = math.inf
            closed = [*leaf.closed]
            closed[robot] = Charges(places, moves)
            path = planned(leaf.paths, robot, closed[robot])
            if path is not None:
                paths = [*leaf.paths]
                paths[robot] = path
                leaves.append(Leaf(paths, closed, objective(model, paths)))
                nodes += 1
    return None, nodes


def plan_states(plan: Plan, conflict: Conflict, which: int) -> tuple[State, State]:
    """State in which a robot of a conflict is, and the one to which it moves."""
    path = plan.paths[conflict.robots[which]]
    return path[conflict.t], path[min(conflict.t + 1, len(path) - 1)]


@examples(20)
@given(st.one_of(meetings(), meetings(team=3)))
def test_cocap_is_its_algorithm(problem: Problem) -> None:
    """The constraint tree is searched as in the paper's Alg. 1: greatest J first, two children.

    The paper has no separation, and closes one place or move at a time.
    """
    if problem.rules.separation:
        problem = problem.replace(rules=CollisionRules())
    result = cocap(problem, Patience())
    assume(result.reason is not Reason.STOPPED)
    assert (result.plan, result.statistics["generated"]) == plain_cocap(problem)


def test_cocap_stops_at_a_number_of_nodes() -> None:
    """A limit on the nodes generated is kept and named."""
    problem = line(3, 0, 2, goals=(2, 0), horizon=4)
    result = cocap(problem, WorkLimit(3))
    assert (result.plan, result.reason, result.limit) == (None, Reason.STOPPED, Limit.WORK)
    assert result.statistics["generated"] <= 4


@pytest.mark.parametrize("nodes", [1, 2, 3])
def test_cocap_that_is_stopped_keeps_what_does_not_collide(nodes: int) -> None:
    """At a limit drones fly the paths that collide with nobody; only the others stay."""
    problem = load_scene("bottleneck", 0)
    result = cocap(problem, WorkLimit(nodes - 1))
    assert result.reason is Reason.STOPPED and result.plan is not None
    verdict = check(problem, result.plan)
    assert verdict.valid and verdict.reward == pytest.approx(result.value)
    flying = [path for path in result.plan.paths if len(set(path)) > 1]
    assert len(flying) >= 2
    without_time = cocap(problem, Patience(0))
    assert result.value > without_time.value


def test_cocap_that_is_stopped_late_is_no_worse_than_sequential(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Once its tree has grown a plan without conflicts is kept; one that ends does not need it."""
    problem = load_scene("bottleneck", 0)
    without, finished = cocap(problem, WorkLimit(2)), cocap(problem)
    monkeypatch.setattr(constraint_tree, "SPARE_FROM", 3)
    result, spare = cocap(problem, WorkLimit(2)), sequential(problem)
    assert without.value < spare.value == result.value
    assert result.plan == spare.plan and result.reason is Reason.STOPPED
    assert "the plan of sequential planning" in result.message
    assert cocap(problem).plan == finished.plan
    assert finished.value > spare.value


def test_criteria_compose() -> None:
    """The first of several criteria that is reached is named; no limit is never reached."""
    assert never.reached() is None
    assert FirstOf().reached() is None
    assert FirstOf(never, TimeLimit(1e9)).reached() is None
    assert FirstOf(never, Patience(0), TimeLimit(0)).reached() is Limit.WORK
    assert FirstOf(TimeLimit(0), Patience(0)).reached() is Limit.TIME


def test_a_limit_is_raised_by_check() -> None:
    """`check` passes while there is time, and then raises one exception that names the limit."""
    never.check()
    with pytest.raises(LimitReached) as reached:
        FirstOf(never, TimeLimit(0)).check()
    assert reached.value.limit is Limit.TIME
    work = FirstOf(WorkLimit(2), never)
    work.begin_work()
    work.begin_work()
    work.check()
    with pytest.raises(LimitReached):
        work.begin_work()
    assert work.reached() is Limit.WORK


def test_seconds_left() -> None:
    """Solvers that take a time limit are told the shortest one; without one it is infinite."""
    assert never.seconds_left == math.inf
    assert FirstOf(never, Patience()).seconds_left == math.inf
    assert 9 < FirstOf(TimeLimit(100), never, TimeLimit(10)).seconds_left <= 10
    assert TimeLimit(-5).seconds_left == 0.0


def test_ctrl_c_is_a_stop_and_twice_an_interrupt() -> None:
    """The first Ctrl-C stops in good order, a second one at once; afterwards all is as before."""
    before = signal.getsignal(signal.SIGINT)
    with Interrupt.caught() as interrupt:
        assert interrupt.reached() is None
        signal.raise_signal(signal.SIGINT)
        assert interrupt.reached() is Limit.INTERRUPT
        result = greedy(tiny(), interrupt)
        assert (result.reason, result.limit) == (Reason.STOPPED, Limit.INTERRUPT)
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
    assert signal.getsignal(signal.SIGINT) is before


class PressedLater(Interrupt):
    """Ctrl-C comes when it is asked for the n-th time."""

    def __init__(self, asked: int) -> None:
        super().__init__()
        self._left = asked

    def reached(self) -> Limit | None:
        """Count how often it is asked."""
        self._left -= 1
        self.pressed = self.pressed or self._left < 0
        return super().reached()


def test_ctrl_c_during_coverage_gives_a_plan_with_what_is_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It waits until drones are planned, as a time limit leaves time for it, but only once."""
    monkeypatch.setenv("COCAP_OPT_CACHE", str(tmp_path))
    problem = load_scene("tiny-approach")
    stop = PressedLater(2)
    result = sequential(problem.replace(name="interrupted"), stop)
    assert stop.pressed and result.value > greedy(problem, TimeLimit(0)).value
    stop = PressedLater(0)
    stop.put_off(0.3)
    assert stop.reached() is None
    time.sleep(0.31)
    stop.put_off(60.0)
    assert FirstOf(stop, never).reached() is Limit.INTERRUPT


def test_in_other_threads_ctrl_c_is_never_pressed() -> None:
    """Only the main thread may handle signals: elsewhere the stop is there, and nothing changes."""
    handlers = []

    def wait() -> Limit | None:
        with Interrupt.caught() as interrupt:
            handlers.append(signal.getsignal(signal.SIGINT))
            return interrupt.reached()

    with ThreadPoolExecutor(1) as thread:
        assert thread.submit(wait).result() is None
    assert handlers == [signal.getsignal(signal.SIGINT)]


@pytest.mark.parametrize(
    ("value", "bound", "gap"),
    [
        (90.0, 100.0, 0.1),
        (100.0, 100.0, 0.0),
        (0.0, 0.0, 0.0),
        (0.0, 5.0, 1.0),
        (-math.inf, 5.0, math.inf),
        (5.0, math.inf, math.inf),
        (-math.inf, math.inf, math.inf),
        (-math.inf, -math.inf, math.inf),
    ],
)
def test_gap(value: float, bound: float, gap: float) -> None:
    """The gap is (bound - value) / bound, and infinite as long as one of them is."""
    assert relative_gap(value, bound) == pytest.approx(gap)
    result = Result(None, value, Reason.STOPPED, Limit.TIME, bound=bound)
    assert result.gap == pytest.approx(gap)


# -- determinism --------------------------------------------------------------------------

PLAN_ALL = """
import sys
import msgspec
from cocap_opt.planners import PLANNERS
from cocap_opt.stop import never
from strategies import tiny
from test_planners import crossing
for make in (tiny, crossing):
    for name, planner in PLANNERS.items():
        print(name, msgspec.json.encode(planner(make(), never).plan).decode())
"""


def crossing() -> Problem:
    """Two robots that face each other over a corridor and must repair conflicts."""
    heights = np.full((5, 3), WALL)
    heights[:, 1] = 0.0
    heights[2, :] = 0.0
    camera = Camera(width=800, height=600, focal=250.0, tilts=(0.6,))
    motion = Motion(headings=4)
    return Problem(
        name="crossing",
        height_map=HeightMap(heights=heights, resolution=3.0),
        robots=(
            Robot(start=State(0, 1), motion=motion, camera=camera, goal=(4, 1)),
            Robot(start=State(4, 1, 0, 2), motion=motion, camera=camera, goal=(0, 1)),
        ),
        actors=(standing(7.3, 2.2, 0.0, 0.3, steps=6), standing(8.1, 7.7, 0.0, 1.3, steps=6)),
        horizon=6,
        face_samples=1,
    )


def test_crossing_needs_the_constraint_tree() -> None:
    """The instance used below is one in which robots conflict and CoCap repairs."""
    problem = crossing()
    assert check(problem, greedy(problem).plan or Plan(paths=())).conflicts
    result = cocap(problem)
    assert result.statistics["expanded"] > 0
    assert check(problem, result.plan or Plan(paths=())).valid


def in_another_process(seed: str) -> str:
    """Plans of all planners, made by another process with this hash seed."""
    tests = Path(__file__).parents[1]
    folders = [tests.parent, tests / "core", tests / "support"]
    environment = os.environ | {
        "PYTHONHASHSEED": seed,
        "PYTHONPATH": os.pathsep.join(map(str, folders)),
    }
    done = subprocess.run(
        [sys.executable, "-c", PLAN_ALL], env=environment, capture_output=True, text=True,
        check=True, timeout=120,
    )  # fmt: skip
    return done.stdout


@pytest.mark.long
def test_plans_do_not_depend_on_the_process() -> None:
    """The same problem has the same plan in every process, byte for byte."""
    here = "".join(
        f"{name} {msgspec.json.encode(planner(make(), never).plan).decode()}\n"
        for make in (tiny, crossing)
        for name, planner in PLANNERS.items()
    )
    assert in_another_process("4242") == here
    assert json.loads(here.splitlines()[0].split(" ", 1)[1])["paths"]


@pytest.mark.long
@examples(6)
@given(problems())
def test_plans_do_not_depend_on_what_ran_before(problem: Problem) -> None:
    """Planning twice, or an equal problem made anew, gives the same plan and value."""
    for name, planner in PLANNERS.items():
        if not takes(planner, problem):
            continue
        first = planner(problem, Patience())
        for again in (problem, problem.replace(name="again")):
            second = planner(again, Patience())
            assert (first.plan, first.value) == (second.plan, second.value), name


# -- metamorphic --------------------------------------------------------------------------


@examples(15)
@given(problems(robots=[2]))
def test_order_of_robots_does_not_matter_to_the_optimum(problem: Problem) -> None:
    """Robots in another order have the same joint optimum."""
    swapped = problem.replace(robots=problem.robots[::-1])
    first, second = joint(problem), joint(swapped)
    assert close(first.value, second.value)
    assert first.reason is second.reason


@examples(12)
@given(problems(robots=[2]))
def test_fewer_rules_are_never_worse(problem: Problem) -> None:
    """Dropping a collision rule or a goal never lowers the optimum."""
    assume(problem.rules.vertex)
    rules = problem.rules
    value = joint(problem).value
    looser = [rules.replace(separation=0.0, vertical=0.0), rules.replace(swap=False), NO_RULES]
    if rules.vertical:
        looser.append(rules.replace(vertical=rules.vertical / 2))
    for fewer in looser:
        assert joint(problem.replace(rules=fewer)).value >= value - 1e-9
    free = problem.replace(robots=tuple(robot.replace(goal=None) for robot in problem.robots))
    assume(number_of_plans(free) < 10**6)
    assert joint(free).value >= value - 1e-9


def buried(problem: Problem) -> Problem:
    """The problem with one more actor, deep in the ground."""
    rows = [[1.0, 1.0, -50.0, 0.3]] * (problem.horizon + 1)
    return problem.replace(actors=(*problem.actors, Actor(poses=np.array(rows))))


@examples(15)
@given(problems())
def test_an_actor_nobody_can_see_changes_nothing(problem: Problem) -> None:
    """One more actor in the ground changes no value of the exact and the greedy planners."""
    assume(not any(isinstance(robot.camera, Cone) for robot in problem.robots))  # it sees all
    assume(problem.airspace.people_aside == 0)  # drones keep away from people they cannot see, too
    for name in ("greedy", "sequential", "joint"):
        planner = PLANNERS[name]
        if not takes(planner, problem):
            continue
        before, after = planner(problem, never), planner(buried(problem), never)
        assert close(before.value, after.value)
        assert before.reason is after.reason
        if name != "joint":  # ties between pairs may be broken by the order of a sum
            assert before.plan == after.plan


RATES = ("stationarity", "keep_cell", "keep_heading", "balanced")


@examples(15)
@given(problems(robots=[2]), st.floats(0.1, 50.0))
def test_scaled_weights_scale_the_optimum(problem: Problem, factor: float) -> None:
    """All weights times a factor is the optimum times the factor."""
    actors = tuple(
        actor.replace(weights=tuple((factor * actor.face_weights).tolist()))
        for actor in problem.actors
    )
    objective = problem.objective
    scaled = problem.replace(
        actors=actors,
        objective=objective.replace(**{rate: factor * getattr(objective, rate) for rate in RATES}),
    )
    assert close(joint(scaled).value, factor * joint(problem).value)


@pytest.mark.parametrize("low_level", [value_iteration, ViewSearch()])
@examples(12)
@given(problem=st.one_of(problems(robots=[2]), meetings(team=3)))
def test_rounds_never_lose(low_level: LowLevel, problem: Problem) -> None:
    """More rounds of greedy planning never lower J, even where the low level is not exact."""
    values = [planner(problem, never, low_level).value for planner in (greedy, greedy_rounds)]
    assert values == sorted(values)


def test_rounds_keep_gains_only() -> None:
    """A path that loses is not taken, whatever the low level returns in later rounds."""
    problem, calls = tiny(), [0]

    def worse_and_worse(task: SingleRobotTask) -> SingleRobotPath:
        calls[0] += 1
        if calls[0] <= len(problem.robots):
            return value_iteration(task)
        return hovering(PlannedTeam.nobody(task.model)).found[task.robot]

    once, often = greedy(problem), greedy_rounds(problem, never, worse_and_worse)
    assert calls[0] > len(problem.robots)
    assert (often.plan, often.value) == (once.plan, once.value)


# -- extremes -----------------------------------------------------------------------------


def cage(horizon: int = 3, **motion: object) -> Problem:
    """One cell, one robot, one actor below it."""
    return Problem(
        name="",
        height_map=HeightMap(heights=np.zeros((1, 1)), resolution=4.0),
        robots=(Robot(start=State(0, 0), motion=Motion(**motion),
                      camera=Camera(tilts=(1.5,))),),
        actors=(standing(2.1, 1.9, 0.0, 0.3, steps=horizon),),
        horizon=horizon,
    )  # fmt: skip


EXTREMES: dict[str, Callable[[], Problem]] = {
    "one cell": lambda: cage(),
    "one cell, one heading": lambda: cage(headings=1),
    "one cell, radius 0": lambda: cage(radius=0, headings=2),
    "one cell, no turning": lambda: cage(turn=0),
    "one cell, radius 3": lambda: cage(radius=3),
    "many headings": lambda: cage(headings=360, turn=7),
    "many layers": lambda: cage(layers=tuple(2.0 + k for k in range(12)), headings=2, climb=99),
    "long horizon": lambda: cage(horizon=100, headings=2),
    "nobody to see": lambda: line(3, 0, 2),
    "one robot, nobody": lambda: line(1, 0, horizon=1),
    "crowded": lambda: line(3, 0, 1, 2),
    "very crowded": lambda: line(4, 0, 1, 2, 3, horizon=3),
    "no motion at all": lambda: cage(radius=0, turn=0, climb=0, pitch_turn=0, headings=1),
    "stationarity above all": lambda: meadow(2).replace(objective=Objective(stationarity=1e6)),
    "the heading above all": lambda: meadow(2).replace(objective=Objective(keep_heading=1e6)),
    "balance above all": lambda: meadow(2).replace(objective=Objective(balanced=1e6)),
    "gimbal of many pitches": lambda: meadow(2).replace(
        robots=(
            Robot(
                start=State(2, 2),
                motion=Motion(pitch_turn=2),
                camera=Camera(tilts=tuple(np.linspace(-1.5, 1.5, 7).tolist())),
            ),
        )
    ),
    "wide separation": lambda: line(9, 0, 8).replace(rules=CollisionRules(separation=8.0)),
}


@pytest.mark.parametrize(
    "case",
    [pytest.param(c, marks=[pytest.mark.slow] if c == "long horizon" else []) for c in EXTREMES],
)
def test_extreme_problems(case: str) -> None:
    """Problems at the edge of what is allowed keep the contract, for every planner."""
    problem = EXTREMES[case]()
    values = {}
    for name, planner in PLANNERS.items():
        if not takes(planner, problem):
            continue
        result = planner(problem, Patience())
        check_contract(name, problem, result)
        values[name] = result.value
        if not name.startswith("cocap-vs"):
            assert result.plan is not None
    if len(problem.robots) == 1:
        inexact = ("cocap-vs", "cocap-vs-undiscounted", "formation", "one-step")
        exact = [v for name, v in values.items() if name not in inexact]
        assert all(close(value, exact[0]) for value in exact)


def test_wide_separation_between_high_layers() -> None:
    """A separation far wider than the map costs no time: layers may be that far apart."""
    layers = (5.0, 60.0)
    problem = line(3, 0, 2).replace(
        height_map=HeightMap(heights=np.zeros((3, 1)), resolution=0.1),
        robots=(
            Robot(start=State(0, 0, 0), motion=Motion(headings=1, layers=layers)),
            Robot(start=State(2, 0, 1), motion=Motion(headings=1, layers=layers)),
        ),
        rules=CollisionRules(separation=30.0),
        horizon=1,
    )
    begin = time.perf_counter()
    result = sequential(problem, Patience())
    assert result.plan is not None
    assert check(problem, result.plan).valid
    assert time.perf_counter() - begin < 1


def test_robots_of_different_clearance_meet() -> None:
    """A cell that one robot may enter and another may not is nothing to avoid for the latter."""
    heights = np.zeros((4, 3))
    heights[1:3, 1] = 4.5  # blocks a clearance of 1 m at 5 m, not one of 0 m
    low, high = Motion(headings=1), Motion(headings=1, clearance=1.0)
    camera = Camera(width=400, height=300, focal=100.0, tilts=(1.0,))
    problem = Problem(
        name="",
        height_map=HeightMap(heights=heights, resolution=2.0),
        robots=(
            Robot(start=State(0, 1), motion=low, camera=camera),
            Robot(start=State(3, 1), motion=high, camera=camera),
            Robot(start=State(3, 0), motion=low, camera=camera),
        ),
        actors=(Actor(poses=np.tile([3.1, 2.9, 0.0, 0.2], (3, 1))),),
        horizon=2,
    )
    best = optimum(problem)
    for name in ("sequential", "cocap", "cocap-vs"):
        result = PLANNERS[name](problem, never)
        assert result.plan is not None
        assert check(problem, result.plan).valid
        assert result.value <= best.value + 1e-9
