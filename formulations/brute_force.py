"""Exact optimum by enumerating all plans: the oracle for tiny instances."""

import math
import time
from itertools import product

import numpy as np

from cocap_opt.data import FloatArray
from cocap_opt.formulations.result import (
    OPTIMALITY,
    CertifiedResult,
    Report,
    only_start,
    silent,
    usable_start,
)
from cocap_opt.model import Model, Path, compiled
from cocap_opt.objective import move_reward, robot_pixels, view_reward
from cocap_opt.problem.plan import Plan, conflicts
from cocap_opt.problem.problem import Problem
from cocap_opt.result import Reason, UnsupportedError
from cocap_opt.stop import Limit, Stop, never

MOST_PLANS = 2_000_000


def brute_force(
    problem: Problem,
    stop: Stop = never,
    start: Plan | None = None,
    report: Report = silent,
    gap: float = OPTIMALITY,
) -> CertifiedResult:
    """Best plan by trying all of them, which is also what proves its bound: no certificate.

    It needs no start, but says whether the one given could be used.

    Raises
    ------
    UnsupportedError
        If there are more than MOST_PLANS plans.
    """
    begin = time.perf_counter()
    model = compiled(problem)
    robots = range(len(problem.robots))
    plans = 1
    for robot in robots:
        plans *= count_paths(model, robot)
        if plans > MOST_PLANS:
            raise UnsupportedError(f"brute force tries at most {MOST_PLANS} plans, here are more")
    limit = model.prepare_all(stop)
    paths = [all_paths(model, robot) for robot in robots]
    pixels: list[list[FloatArray]] = [[] for _ in robots]
    moves: list[list[float]] = [[] for _ in robots]
    for robot in robots:
        for path in paths[robot]:
            limit = limit if limit is not Limit.NONE else stop()
            if limit is not Limit.NONE:
                return only_start(problem, start, limit, time.perf_counter() - begin)
            pixels[robot].append(robot_pixels(model, robot, path))
            moves[robot].append(move_reward(model, robot, path))
    best_value, best = -math.inf, None
    for choice in product(*(range(len(some)) for some in paths)):
        limit = stop()
        if limit is not Limit.NONE:
            break
        seen = np.sum([pixels[i][k] for i, k in zip(robots, choice, strict=True)], axis=0)
        value = float(view_reward(problem, seen).sum())
        value += sum(moves[i][k] for i, k in zip(robots, choice, strict=True))
        if value > best_value:
            plan = model.plan([paths[i][k] for i, k in zip(robots, choice, strict=True)])
            if next(conflicts(problem, plan), None) is None:
                best_value, best = value, plan
    if best is None and limit is not Limit.NONE:
        return only_start(problem, start, limit, time.perf_counter() - begin)
    reason = Reason.STOPPED
    if limit is Limit.NONE:
        reason = Reason.INFEASIBLE if best is None else Reason.OPTIMAL
    return CertifiedResult(
        plan=best,
        value=best_value,
        reason=reason,
        limit=limit,
        bound=best_value if limit is Limit.NONE else math.inf,
        seconds=time.perf_counter() - begin,
        message=usable_start(problem, start)[1],
        statistics={"plans": plans},
    )


def count_paths(model: Model, robot: int) -> int:
    """Number of paths of a robot (goal ignored), by dynamic programming."""
    graph = model.class_of[robot].graph
    counts = {model.start(robot): 1}
    for _ in range(model.problem.horizon):
        following: dict[int, int] = {}
        for state, count in counts.items():
            for head in graph.successors(state).tolist():
                following[head] = following.get(head, 0) + count
        counts = following
    return sum(counts.values())


def all_paths(model: Model, robot: int) -> list[Path]:
    """All paths of a robot that end in its goal."""
    robot_class = model.class_of[robot]
    paths: list[Path] = [(model.start(robot),)]
    for _ in range(model.problem.horizon):
        paths = [
            (*path, head)
            for path in paths
            for head in robot_class.graph.successors(path[-1]).tolist()
        ]
    if robot_class.goal is None:
        return paths
    ends = (robot_class.graph.state(path[-1]) for path in paths)
    return [p for p, end in zip(paths, ends, strict=True) if (end.x, end.y) == robot_class.goal]
