"""The trade-off between J and views: all plans are in its half-planes, and its plans are plans."""

import math
from itertools import product

import numpy as np
import pytest
from brute_force import all_paths
from hypothesis import given
from hypothesis import strategies as st
from pool import problems
from strategies import examples

from cocap_opt.formulations.certificates import verify
from cocap_opt.problem import Plan, Problem
from cocap_opt.referee import check
from cocap_opt.run.front import Direction, Front, as_rows
from cocap_opt.scenarios import load_scene

METHODS = {"planner": "greedy-rounds", "bound": "alone"}


def all_points(front: Front) -> np.ndarray:
    """V and J of every plan that obeys the rules [n, 2]."""
    problem = front.problem
    paths = [all_paths(problem, robot) for robot in range(len(problem.robots))]
    points = (front.point(Plan(paths=chosen)) for chosen in product(*paths))
    return np.array([(p.views, p.reward) for p in points if p is not None]).reshape(-1, 2)


@examples(12)
@given(problems(most_plans=300), st.sampled_from([1, 2]), st.sampled_from([0.1, 0.6]))
def test_all_plans_are_inside(problem: Problem, cameras: int, at_least: float) -> None:
    """Of every half-plane; and no plan with so many views has more J than is said."""
    front = Front.of(problem, cameras, at_least).explored(directions=4, **METHODS)
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
            assert plane.bound >= proved * (plane.direction.reward or 1.0) - slack
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
    front = Front.of(load_scene("tiny-share", 0))
    before = math.inf
    for number in range(4):
        front = front.explored(directions=1, **METHODS)
        assert len(front.half_planes) == number + 1
        if number >= 2:
            assert front.gap <= before + 1e-9
        before = front.gap
    rows = as_rows(front)
    assert [row["kind"] for row in rows].count("bound") == 4
    assert [row["kind"] for row in rows].count("plan") == len(front.plans) > 0


def test_directions_are_scenes() -> None:
    """Their J is the weighted sum, but for the scale."""
    front = Front.of(load_scene("corridor", 0), cameras=2)
    plan = Plan(
        paths=tuple((robot.start,) * (front.problem.horizon + 1) for robot in front.problem.robots)
    )
    point = front.point(plan)
    assert point is not None
    for direction in (Direction(1.0, 0.0), Direction(0.0, 2.0), Direction(2.0, 30.0)):
        value = check(front.scene(direction), plan).reward * (direction.reward or 1.0)
        assert value == pytest.approx(direction.of(point.reward, point.views))
