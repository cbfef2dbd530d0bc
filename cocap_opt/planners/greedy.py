"""Greedy planning over robots, ignoring collisions: the "unconstrained" reference.

Each robot in turn gets its best path given what the earlier ones see. Without collision
rules the plan has at least half the optimal J, if the low level is exact.
"""

import time
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from cocap_opt.model import Model, Path, compiled
from cocap_opt.planners.single import LowLevel, SingleRobotPath, SingleRobotTask
from cocap_opt.planners.value_iteration import value_iteration
from cocap_opt.problem import FloatArray, Problem
from cocap_opt.result import Limit, Reason, Result
from cocap_opt.reward import no_pixels, objective
from cocap_opt.stop import Stop, never


@dataclass
class Team:
    """Paths found so far and the pixels of each robot, the state of all greedy planners."""

    model: Model
    found: list[SingleRobotPath]

    def others(self, robot: int) -> FloatArray:
        """Pixels [G] of all robots but one."""
        pixels = no_pixels(self.model.problem)
        for i, single in enumerate(self.found):
            if i != robot:
                pixels = pixels + single.pixels
        return pixels

    @property
    def paths(self) -> list[Path]:
        """Paths of all robots, which must all have been found."""
        return [single.path for single in self.found if single.path is not None]

    @property
    def value(self) -> float:
        """J."""
        pixels = self.others(robot=-1)
        return objective(self.model.problem, pixels, self.paths)

    @property
    def evaluated(self) -> int:
        """Number of states whose coverage was needed."""
        return sum(single.evaluated for single in self.found)


def greedy(
    problem: Problem,
    stop: Stop = never,
    low_level: LowLevel = value_iteration,
    rounds: int = 1,
) -> Result:
    """Plan the robots in order, each best given the earlier ones; collisions are ignored.

    With `rounds` > 1 each robot is planned again in turn against all others, until that
    gains nothing or the rounds are over; only gains are kept.
    """
    begin = time.perf_counter()
    model = compiled(problem)
    team = Team(model, [])
    limit = Limit.NONE
    for robot in range(len(problem.robots)):
        limit = stop()
        single = (
            low_level(SingleRobotTask(model, robot, team.others(robot), stop=stop))
            if limit is Limit.NONE
            else hover(model, robot)
        )
        if single.path is None:
            limit = limit if limit is not Limit.NONE else stop()
            return no_plan(limit, begin, no_path(robot))
        team.found.append(single)
    improved = limit is Limit.NONE
    for _ in range(rounds - 1):
        improved = improved and _improve(team, low_level, stop)
    return team_result(team, limit if limit is not Limit.NONE else stop(), begin)


def team_result(team: Team, limit: Limit, begin: float) -> Result:
    """Result of a planner that went through all robots, hovering where time was up."""
    return Result(
        plan=team.model.plan(team.paths),
        value=team.value,
        reason=Reason.FINISHED if limit is Limit.NONE else Reason.STOPPED,
        limit=limit,
        seconds=time.perf_counter() - begin,
        statistics={"evaluated": team.evaluated},
    )


def _improve(team: Team, low_level: LowLevel, stop: Stop) -> bool:
    """Plan each robot again against all others; say whether J grew."""
    before = team.value
    for robot in range(len(team.found)):
        if stop() is not Limit.NONE:
            break
        single = low_level(SingleRobotTask(team.model, robot, team.others(robot), stop=stop))
        if single.path is not None:
            changed = Team(team.model, [*team.found])
            changed.found[robot] = single
            if changed.value > team.value:
                team.found[robot] = single
    return team.value > before


def hover(model: Model, robot: int) -> SingleRobotPath:
    """The path that stays at the start: what a robot does for which no time is left."""
    problem, group = model.problem, model.class_of[robot]
    start, pixels = problem.robots[robot].start, no_pixels(problem)
    if group.goal not in (None, (start.x, start.y)):
        return SingleRobotPath(None, pixels, 0)
    views, state = model.views(group), np.array([model.start(robot)])
    for t in range(problem.first_step, problem.horizon + 1):
        pixels[t * model.n_faces : (t + 1) * model.n_faces] = views.coverage(t, state)[0]
    return SingleRobotPath((model.start(robot),) * (problem.horizon + 1), pixels, views.evaluated)


def no_plan(
    limit: Limit,
    begin: float,
    otherwise: tuple[Reason, str],
    statistics: Mapping[str, float] | None = None,
) -> Result:
    """Result without a plan: stopped by a limit, or `otherwise` for this reason, in words."""
    reason, message = otherwise
    if limit is not Limit.NONE:
        reason, message = Reason.STOPPED, f"no plan was found before the {limit} limit"
    return Result(
        plan=None,
        value=float("-inf"),
        reason=reason,
        limit=limit,
        seconds=time.perf_counter() - begin,
        message=message,
        statistics=statistics or {},
    )


def no_path(robot: int) -> tuple[Reason, str]:
    """Why there is no plan where a robot alone has no path."""
    return Reason.INFEASIBLE, f"robot {robot} has no path, even alone"
