"""The trade-off between J and views: all plans are in its half-planes, and its plans are plans."""

import math
from collections import Counter
from itertools import product

import numpy as np
import pytest
from brute_force import all_paths
from hypothesis import given
from hypothesis import strategies as st
from pool import problems
from strategies import examples
from trade_offs import crossroads

from cocap_opt.formulations.certificates import verify
from cocap_opt.problem import Plan, Problem
from cocap_opt.referee import check
from cocap_opt.run.front import REWARD_ALONE, VIEWS_ALONE, Direction, Front
from cocap_opt.run.front_search import explored
from cocap_opt.run.options import Allowance
from cocap_opt.scenarios import load_scene

METHODS = {"planner": "greedy-rounds", "bound": "alone"}


def all_points(front: Front) -> np.ndarray:
    """V and J of every plan that obeys the rules [n, 2]."""
    problem = front.problem
    paths = [all_paths(problem, robot) for robot in range(len(problem.robots))]
    points = (front.point(Plan(paths=chosen)) for chosen in product(*paths))
    return np.array([(p.views, p.reward) for p in points if p is not None]).reshape(-1, 2)


@examples(12)
@given(
    problems(most_plans=300, over_time=True), st.sampled_from([1, 2]), st.sampled_from([0.1, 0.6])
)
def test_all_plans_are_inside(problem: Problem, cameras: int, at_least: float) -> None:
    """Of every half-plane; and no plan with so many views has more J than is said."""
    front = explored(Front.of(problem, cameras, at_least), directions=4, **METHODS)
    points = all_points(front)
    if not len(points):
        assert not front.plans
        return
    views, reward = points.T
    slack = 1e-9 * (1 + reward.max())
    for plane in front.half_planes:
        assert (plane.direction.of(reward, views) <= plane.bound + slack).all()
        if plane.file is not None:
            proved = verify(front.scene(plane.direction), plane.file).bound
            assert plane.bound >= proved - slack
    assert views.max() <= front.views_bound + slack
    for asked in (0.0, *np.unique(views).tolist()):
        assert reward[views >= asked].max() <= front.reward_bound(asked) + slack
        found = front.best_with(asked)
        assert found is None or found.reward <= reward[views >= asked].max() + slack
    assert front.reward_bound(front.views_bound + 1) == -math.inf
    for point in front.plans:
        assert not any(
            other.views >= point.views and other.reward > point.reward for other in front.plans
        )


def test_a_front_gets_tighter_with_every_direction() -> None:
    """Plans and half-planes only join; the table has a row for each."""
    front = Front.of(load_scene("tiny-doorway", 0))
    before = math.inf
    for number in range(4):  # the bound leaves room, so that a direction is tried again
        front = explored(front, directions=1, **METHODS)
        assert len(front.half_planes) == number + 1 and not front.settled
        if number >= 2:
            assert front.gap <= before + 1e-9
        before = front.gap
    rows = front.rows()
    assert [row["kind"] for row in rows].count("bound") == 4
    assert [row["kind"] for row in rows].count("plan") == len(front.plans) > 0


def test_nothing_more_is_done_once_plans_and_proofs_meet() -> None:
    """Two plans, J and views alone, and the edge between them; each is worked out by hand."""
    before = explored(Front.of(crossroads()), directions=2, **METHODS)
    assert not before.settled and before.next_direction() == pytest.approx((1.0, 18.0))
    front = explored(before, directions=9, **METHODS)
    assert front.settled and len(front.half_planes) == 3
    assert [point[1:] for point in front.plans] == [pytest.approx(p) for p in ((40, 2), (4, 4))]
    assert explored(front, directions=9, **METHODS) is front
    assert front.reward_bound(3.0) == pytest.approx(22.0)  # halfway between them


def test_one_plan_may_be_the_best_of_both() -> None:
    """One direction tells, where all people are seen by as many drones as count."""
    front = explored(Front.of(load_scene("tiny-share", 0)), directions=6, seconds=2.0)
    assert front.settled and len(front.plans) == len(front.half_planes) == 1


def test_a_direction_that_is_tried_again_has_more_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """Twice as much each time: with no more it would come to the same end."""
    seconds: list[float] = []

    def allowance(allowed: float) -> Allowance:
        seconds.append(allowed)
        return Allowance(allowed)

    monkeypatch.setattr("cocap_opt.run.front_search.Allowance", allowance)
    front = Front.of(load_scene("tiny-doorway", 0))
    front = explored(front, directions=4, seconds=8.0, **METHODS)
    tries: Counter[Direction] = Counter()
    for plane, of_planner in zip(front.half_planes, seconds[::2], strict=True):
        assert of_planner == 2.0 * 2 ** tries[plane.direction]
        tries[plane.direction] += 1
    assert max(tries.values()) > 1


def test_directions_are_scenes() -> None:
    """Their J is the weighted sum, whatever weight pixels have, and whoever has none."""
    problem = load_scene("corridor", 0)
    first, *others = problem.actors
    actors = (first.replace(weights=(0.0,) * len(first.face_weights)), *others)
    objective = problem.objective.replace(pixels=0.5, keep_cell=3.0)
    problem = problem.replace(actors=actors, objective=objective)
    front = Front.of(problem, cameras=2)
    plan = Plan(paths=tuple((r.start,) * (problem.horizon + 1) for r in problem.robots))
    point = front.point(plan)
    assert point is not None
    assert point.reward == pytest.approx(check(problem, plan).reward)
    assert front.most_views == 2 * problem.horizon * len(others)  # without him who has no weight
    for direction in (REWARD_ALONE, VIEWS_ALONE, Direction(1.0, 30.0)):
        value = check(front.scene(direction), plan).reward
        assert value == pytest.approx(direction.of(point.reward, point.views))
