"""Exact optimum by enumerating all plans: the oracle for tiny instances."""

import math
from dataclasses import replace
from itertools import product
from typing import NamedTuple

import numpy as np

from cocap_opt.data import FloatArray
from cocap_opt.formulations.early_bound import early_bound
from cocap_opt.formulations.result import (
    OPTIMALITY,
    CertifiedResult,
    Report,
    StartPlan,
    silent,
)
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
    """Tries all plans, which is also what proves its bound: there is no certificate.

    It needs no start, but says why the one given could not be used.

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
            raise UnsupportedError(f"brute force tries at most {MOST_PLANS} plans, here are more")
    search = _Enumeration(model)
    try:
        model.prepare_all(stop)
        search.run(stop)
    except LimitReached as reached:
        if search.plan is None:
            stopped = CertifiedResult.of_start(problem, start, reached.limit)
            return stopped.with_bound_of(early_bound(problem, reached.limit))
        result = CertifiedResult(search.plan, search.value, Reason.STOPPED, reached.limit)
    else:
        reason = Reason.INFEASIBLE if search.plan is None else Reason.OPTIMAL
        result = CertifiedResult(search.plan, search.value, reason, bound=search.value)
    message = StartPlan.checked(problem, start).message
    return replace(result, message=message, statistics={"plans": plans})


class _Choice(NamedTuple):
    """A path of one robot, its pixels and its reward for moves."""

    path: Path
    pixels: FloatArray  # [Z]
    moves: float


class _Enumeration:
    """All plans of a problem, one after the other, and the best of them so far."""

    def __init__(self, model: Model) -> None:
        self.model = model
        self.plan: Plan | None = None
        self.value = -math.inf

    def run(self, stop: Stop) -> None:
        """Goes through all plans.

        Raises
        ------
        LimitReached
            If the limit is reached before the last one.
        """
        model = self.model
        choices = [self._choices(robot, stop) for robot in range(len(model.problem.robots))]
        for chosen in product(*choices):
            stop.check()
            seen = np.sum([choice.pixels for choice in chosen], axis=0)
            value = float(view_reward(model.problem, seen).sum())
            value += sum(choice.moves for choice in chosen)
            if value > self.value:
                plan = model.plan([choice.path for choice in chosen])
                if next(plan.conflicts(model.problem), None) is None:
                    self.value, self.plan = value, plan

    def _choices(self, robot: int, stop: Stop) -> list[_Choice]:
        """Returns all paths of a robot that end in its goal."""
        model, found = self.model, []
        bonuses = Bonuses.of(model.problem.objective)
        shape = model.class_of[robot].graph.shape
        for path in _all_paths(model, robot):
            stop.check()
            pixels = model.robot_pixels(robot, path)
            found.append(_Choice(path, pixels, bonuses.of_path(shape, path)))
        return found


def _count_paths(model: Model, robot: int) -> int:
    """Returns the number of paths of a robot (goal ignored), by dynamic programming."""
    graph = model.class_of[robot].graph
    counts = {model.start(robot): 1}
    for t in range(model.problem.horizon):
        following: dict[int, int] = {}
        for state, count in counts.items():
            for head in graph.successors(t, state).tolist():
                following[head] = following.get(head, 0) + count
        counts = following
    return sum(counts.values())


def _all_paths(model: Model, robot: int) -> list[Path]:
    """Returns all paths of a robot that end in its goal."""
    robot_class = model.class_of[robot]
    paths: list[Path] = [(model.start(robot),)]
    for t in range(model.problem.horizon):
        paths = [
            (*path, head)
            for path in paths
            for head in robot_class.graph.successors(t, path[-1]).tolist()
        ]
    if robot_class.goal is None:
        return paths
    ends = (robot_class.graph.state(path[-1]) for path in paths)
    return [p for p, end in zip(paths, ends, strict=True) if (end.x, end.y) == robot_class.goal]
