"""Joint planning: against brute force, within its memory, and stopped."""

import math
import sys
import tracemalloc

import numpy as np
import pytest
from brute_force import optimum
from hypothesis import given
from hypothesis import strategies as st
from pool import meetings, problems
from strategies import Calls, examples, standing, tiny

from cocap_opt.data import FloatArray
from cocap_opt.model import Model
from cocap_opt.planners.joint import PROCESS, Pair, bytes_needed, joint
from cocap_opt.problem import (
    Camera,
    CollisionRules,
    Motion,
    Objective,
    Problem,
    Robot,
    State,
)
from cocap_opt.referee import check
from cocap_opt.result import Reason, UnsupportedError
from cocap_opt.stop import Limit, never
from cocap_opt.world.workspace import HeightMap

PLANNER = sys.modules["cocap_opt.planners.joint"]  # the package's attribute is the function


def close(a: float, b: float) -> bool:
    """Equal to 1e-9 relative."""
    return a == b or math.isclose(a, b, rel_tol=1e-9, abs_tol=1e-9)


@pytest.mark.slow
@examples(24)
@given(st.one_of(problems(robots=[2]), meetings()))
def test_joint_is_optimal(problem: Problem) -> None:
    """Joint planning finds brute force's optimum under all rules, goals, classes and layers."""
    best, result = optimum(problem), joint(problem)
    assert close(result.value, best.value)
    assert (result.plan is None) == (best.plan is None)
    assert result.reason is (Reason.INFEASIBLE if best.plan is None else Reason.OPTIMAL)
    if result.plan is not None:
        assert check(problem, result.plan).valid
        assert result.bound == result.value


def _best(pair: Pair, value: FloatArray) -> float:
    """Returns the best value of a pair of starts, of the values of all pairs at step 0."""
    sides = pair.a, pair.b
    at = np.ix_(*(side.positions_of_states(0, side.starts) for side in sides))
    return float(value[at].max())


@examples(15)
@given(st.one_of(problems(robots=[2]), meetings()))
def test_joint_values_are_of_the_true_objective(problem: Problem) -> None:
    """The value that joint planning gives the pair of starts is the best J itself."""
    best = optimum(problem)
    pair = Pair(Model(problem, use_cache=False))
    values = pair.sweep()
    value = _best(pair, values[0])
    assert value == pytest.approx(best.value, rel=1e-9)


@pytest.mark.slow
@examples(20)
@given(meetings(), st.tuples(*[st.sampled_from([0.0, 3.0, 40.0])] * 3))
def test_joint_rewards_moves_beside_the_swap_rule(
    problem: Problem, rates: tuple[float, float, float]
) -> None:
    """Pairs of cells that could be exchanged have the rewards of both robots' moves, too."""
    stationarity, keep_cell, balanced = rates
    problem = problem.replace(
        rules=CollisionRules(),
        objective=Objective(stationarity=stationarity, keep_cell=keep_cell, balanced=balanced),
    )
    pair = Pair(Model(problem, use_cache=False))
    value = _best(pair, pair.sweep()[0])
    assert value == pytest.approx(optimum(problem).value, rel=1e-9)


def test_joint_rewards_the_move_into_the_cell_that_the_other_leaves() -> None:
    """A robot that takes an anti-diagonal to where another one was is rewarded for it."""
    motion = Motion(headings=1)
    problem = Problem(
        name="",
        height_map=HeightMap(heights=np.zeros((2, 2))),
        robots=(
            Robot(start=State(0, 1), motion=motion, goal=(1, 0)),
            Robot(start=State(1, 0), motion=motion, goal=(0, 0)),
        ),
        actors=(),
        horizon=1,
        objective=Objective(balanced=5.0),
    )
    pair = Pair(Model(problem, use_cache=False))
    assert _best(pair, pair.sweep()[0]) == 5.0
    assert joint(problem).value == 5.0


def test_memory_limit_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """Joint planning that would not fit into memory says so and does not try."""
    monkeypatch.setattr(PLANNER, "MEMORY_LIMIT", 10.0)
    result = joint(tiny())
    assert (result.plan, result.reason, result.limit) == (None, Reason.STOPPED, Limit.MEMORY)


def pair_on_a_meadow(size: int, horizon: int, motion: Motion) -> Problem:
    """Two robots side by side in the middle of an open field, one actor in sight."""
    camera = Camera(width=800, height=600, focal=200.0, tilts=(0.6,))
    starts = State(size // 2, size // 2), State(size // 2 + 1, size // 2)
    return Problem(
        name="",
        height_map=HeightMap(heights=np.zeros((size, size)), resolution=2.0),
        robots=tuple(Robot(start=start, motion=motion, camera=camera) for start in starts),
        actors=(standing(1.3 * size, 1.2 * size, 0.0, 0.4, steps=horizon),),
        horizon=horizon,
        objective=Objective(stationarity=1.0),
    )


@pytest.mark.long
@pytest.mark.parametrize(
    ("size", "horizon", "motion"),
    [
        (14, 4, Motion(headings=8)),
        (9, 12, Motion(headings=4)),
        (10, 3, Motion(headings=2, radius=3)),
        (11, 2, Motion(headings=1, radius=3)),  # every pair of places may exchange
    ],
)
def test_memory_of_joint_planning_is_known_before(size: int, horizon: int, motion: Motion) -> None:
    """The memory that the values of all pairs need is foreseen, and not by much too high."""
    model = Model(pair_on_a_meadow(size, horizon, motion), use_cache=False)
    model.prepare_all(never)
    pair = Pair(model)
    needed = bytes_needed(pair) - PROCESS
    tracemalloc.start()
    try:
        pair.sweep()
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert needed / 2 < peak <= needed


def test_joint_planning_looks_at_limits_within_a_step() -> None:
    """A single step can take many seconds: limits are asked for move by move."""
    stop = Calls()
    joint(pair_on_a_meadow(6, 1, Motion(headings=4)))  # its coverage is there from now on
    assert joint(pair_on_a_meadow(6, 1, Motion(headings=4)), stop).reason is Reason.OPTIMAL
    assert stop.asked > 30
    for calls in range(1, stop.asked, 7):
        result = joint(pair_on_a_meadow(6, 1, Motion(headings=4)), Calls(calls))
        assert (result.reason, result.limit) == (Reason.STOPPED, Limit.TIME)


def test_joint_planning_takes_two_robots() -> None:
    """Three robots are refused with a message that says how many are taken."""
    other = tiny().robots[0].replace(start=State(0, 2))
    with pytest.raises(UnsupportedError, match="one or two drones, not 3"):
        joint(tiny().replace(robots=(*tiny().robots, other)))
