"""What the planners of whole teams share: paths found so far, and results made of them."""

import time
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from cocap_opt.data import FloatArray
from cocap_opt.model import Model, Path
from cocap_opt.objective import no_pixels, objective
from cocap_opt.planners.single import LowLevel, SingleRobotPath, SingleRobotTask
from cocap_opt.problem.plan import conflicts
from cocap_opt.problem.problem import Problem
from cocap_opt.result import Reason, Result
from cocap_opt.stop import Limit

EVERYBODY = -1  # no robot is left out


@dataclass(frozen=True)
class Team:
    """Paths found so far and the pixels along them, robot by robot."""

    model: Model
    found: list[SingleRobotPath]

    def others(self, robot: int) -> FloatArray:
        """Pixels [Z] of all robots but one (or of EVERYBODY)."""
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
        return objective(self.model, self.others(EVERYBODY), self.paths)

    @property
    def evaluated(self) -> int:
        """Number of states whose coverage was needed."""
        return sum(single.evaluated for single in self.found)

    def with_path(self, robot: int, single: SingleRobotPath) -> "Team":
        """The team with another path for one robot."""
        return Team(self.model, [*self.found[:robot], single, *self.found[robot + 1 :]])


def plan_or_hover(
    low_level: LowLevel, task: SingleRobotTask, limit: Limit
) -> tuple[SingleRobotPath, Limit]:
    """A robot's best path; once a limit is reached, the path that stays where it is."""
    if limit is Limit.NONE:
        single = low_level(task)
        if single.limit is Limit.NONE:
            return single, limit
        limit = single.limit
    return hover(task.model, task.robot), limit


def team_result(team: Team, limit: Limit, begin: float) -> Result:
    """Result of a planner that went through all robots, hovering where time was up."""
    return Result(
        plan=team.model.plan(team.paths),
        value=team.value,
        reason=Reason.FINISHED if limit is Limit.NONE else Reason.STOPPED,
        limit=limit,
        seconds=time.perf_counter() - begin,
        message=remark(team.model.problem),
        statistics={"evaluated": team.evaluated},
    )


def hover(model: Model, robot: int) -> SingleRobotPath:
    """The path that stays at the start: what a robot does for which no time is left."""
    problem, robot_class = model.problem, model.class_of[robot]
    start, pixels = problem.robots[robot].start, no_pixels(problem)
    if robot_class.goal not in (None, (start.x, start.y)):
        return SingleRobotPath(None, pixels, 0)
    views, state = model.views(robot_class), np.array([model.start(robot)])
    steps = range(problem.first_step, problem.horizon + 1)
    for t in steps:
        pixels[problem.view_sums_at(t)] += views.coverage(t, state)[0]
    return SingleRobotPath((model.start(robot),) * (problem.horizon + 1), pixels, len(steps))


def remark(problem: Problem) -> str:
    """What is to be said of plans made robot by robot, step by step."""
    if problem.objective.over_time:
        return "a heuristic: pixels add up over time, and this planner looks at one step at a time"
    return ""


def stopped(
    model: Model, limit: Limit, begin: float, statistics: Mapping[str, float], wanted: Team
) -> Result:
    """What a planner returns at a limit that has no plan which obeys the rules yet.

    All robots stay where they are, which obeys every rule, since starts do; then one after the
    other takes the path that it was to have, where that collides with nobody and is worth it.
    Robots that must go somewhere make it no plan.

    Parameters
    ----------
    wanted : paths with conflicts, of the first robots at least
    """
    team = Team(model, [hover(model, robot) for robot in range(len(model.problem.robots))])
    if any(single.path is None for single in team.found):
        return no_plan(limit, begin, (Reason.STOPPED, ""), statistics)
    for robot, single in enumerate(wanted.found):
        changed = team.with_path(robot, single)
        if changed.value > team.value and not _collides(changed):
            team = changed
    return replace(team_result(team, limit, begin), statistics=statistics)


def _collides(team: Team) -> bool:
    plan = team.model.plan(team.paths)
    return next(conflicts(team.model.problem, plan), None) is not None


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
