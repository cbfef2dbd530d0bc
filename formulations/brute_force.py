"""Finds the exact optimum of a tiny instance by enumerating all plans; tests use it as an
oracle.
"""

import math
from collections.abc import Iterator
from dataclasses import replace
from itertools import product

import numpy as np

from cocap_opt.data import FloatArray
from cocap_opt.formulations.result import (
    OPTIMALITY,
    CertifiedResult,
    Report,
    checked_start,
    silent,
)
from cocap_opt.formulations.simple_bounds import early_bound
from cocap_opt.graph.move_rewards import Bonuses
from cocap_opt.model import Model, Path, compiled
from cocap_opt.objective import view_reward
from cocap_opt.problem import Plan, Problem
from cocap_opt.result import Reason, UnsupportedError
from cocap_opt.stop import LimitReached, Stop, never
from cocap_opt.timing import timed

__all__ = ["MOST_PLANS", "brute_force"]

MOST_PLANS = 2_000_000


@timed
def brute_force(
    problem: Problem,
    stop: Stop = never,
    start: Plan | None = None,
    report: Report = silent,
    gap: float = OPTIMALITY,
) -> CertifiedResult:
    """Tries all plans. This proves the bound, but gives no certificate.

    The method ignores its start, but if a start is given and cannot be used, the result's message
    gives the reason.

    Raises
    ------
    UnsupportedError
        If there are more than MOST_PLANS plans.
    """
    model = compiled(problem)
    plans = 1
    for robot in range(len(problem.robots)):
        plans *= _count_paths(model, robot)
        if plans > MOST_PLANS:
            raise UnsupportedError(
                f"brute force tries at most {MOST_PLANS} plans; this problem has more"
            )
    best: Plan | None = None
    value = -math.inf
    try:
        model.prepare_all(stop)
        for plan, reward in _better_and_better(model, stop):
            best, value = plan, reward
    except LimitReached as reached:
        if best is None:
            return early_bound(problem, reached.limit).with_start(problem, start)
        result = CertifiedResult(best, value, Reason.STOPPED, reached.limit)
    else:
        reason = Reason.INFEASIBLE if best is None else Reason.OPTIMAL
        result = CertifiedResult(best, value, reason, bound=value)
    _, message = checked_start(problem, start)
    return replace(result, message=message, statistics={"plans": plans})


def _better_and_better(model: Model, stop: Stop) -> Iterator[tuple[Plan, float]]:
    """Enumerates all plans, and yields each plan that is better than all before it, with its J.

    Raises
    ------
    LimitReached
        If the limit is reached before the last one.
    """
    problem, best = model.problem, -math.inf
    choices = [_choices(model, robot, stop) for robot in range(len(problem.robots))]
    for chosen in product(*choices):
        stop.check()
        seen = np.sum([pixels for _, pixels, _ in chosen], axis=0)
        value = float(view_reward(problem, seen).sum())
        value += sum(moves for _, _, moves in chosen)
        if value > best:
            plan = model.plan([path for path, _, _ in chosen])
            if next(plan.conflicts(problem), None) is None:
                best = value
                yield plan, value


def _choices(model: Model, robot: int, stop: Stop) -> list[tuple[Path, FloatArray, float]]:
    """Returns all paths of a robot that end in a goal, with their pixels [Z] and rewards for
    moves.
    """
    found = []
    bonuses = Bonuses.of(model.problem.objective)
    shape = model.class_of[robot].graph.shape
    for path in _all_paths(model, robot):
        stop.check()
        found.append((path, model.robot_pixels(robot, path), bonuses.of_path(shape, path)))
    return found


def _count_paths(model: Model, robot: int) -> int:
    """Returns the number of paths of a robot, ignoring its goal, by dynamic programming."""
    graph = model.class_of[robot].graph
    counts = dict.fromkeys(model.starts(robot).tolist(), 1)
    for t in range(model.problem.horizon):
        following: dict[int, int] = {}
        for state, count in counts.items():
            for head in graph.successors(t, state).tolist():
                following[head] = following.get(head, 0) + count
        counts = following
    return sum(counts.values())


def _all_paths(model: Model, robot: int) -> list[Path]:
    """Returns all paths of a robot that end in its goal, or in one of its goals if it has
    several.
    """
    robot_class = model.class_of[robot]
    paths: list[Path] = [(start,) for start in model.starts(robot).tolist()]
    for t in range(model.problem.horizon):
        paths = [
            (*path, head)
            for path in paths
            for head in robot_class.graph.successors(t, path[-1]).tolist()
        ]
    if robot_class.goal is None:
        return paths
    ends = (robot_class.graph.state(path[-1]) for path in paths)
    return [p for p, end in zip(paths, ends, strict=True) if robot_class.spec.may_end_in(end)]
