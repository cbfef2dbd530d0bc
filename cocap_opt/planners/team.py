"""Paths of a team as they are found robot by robot, and the results made of them."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from cocap_opt.data import FloatArray
from cocap_opt.model import Model, Path
from cocap_opt.objective import no_pixels, objective
from cocap_opt.planners.low_level import SingleRobotPath
from cocap_opt.problem.plan import conflicts
from cocap_opt.problem.problem import Problem
from cocap_opt.result import Reason, Result
from cocap_opt.stop import Limit

EVERYBODY = -1  # no robot is left out
ONE_STEP_AT_A_TIME = (
    "a heuristic: pixels add up over time, and this planner looks at one step at a time"
)


@dataclass(frozen=True)
class Team:
    """Paths found so far and the pixels along them, robot by robot."""

    model: Model
    found: tuple[SingleRobotPath, ...] = ()

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
    def collides(self) -> bool:
        """True where two of the paths conflict."""
        plan = self.model.plan(self.paths)
        return next(conflicts(self.model.problem, plan), None) is not None

    def with_path(self, robot: int, single: SingleRobotPath) -> "Team":
        """Return the team with another path for one robot, or with the next robot's first one."""
        return Team(self.model, (*self.found[:robot], single, *self.found[robot + 1 :]))

    def hovering(self) -> "Team":
        """Return the team in which all robots without a path stay at their starts."""
        robots = range(len(self.found), len(self.model.problem.robots))
        return Team(self.model, (*self.found, *(hover(self.model, robot) for robot in robots)))


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


# -- results ------------------------------------------------------------------------------


def team_result(
    team: Team, limit: Limit = Limit.NONE, statistics: Mapping[str, float] | None = None
) -> Result:
    """Result of a planner that has a path for every robot; hovering ones where time was up."""
    return Result(
        plan=team.model.plan(team.paths),
        value=team.value,
        reason=Reason.FINISHED if limit is Limit.NONE else Reason.STOPPED,
        limit=limit,
        message=remark(team.model.problem),
        statistics=statistics or {"evaluated": sum(single.evaluated for single in team.found)},
    )


def remark(problem: Problem) -> str:
    """Warning about plans made robot by robot, step by step; empty where there is none."""
    return ONE_STEP_AT_A_TIME if problem.objective.over_time else ""


def stopped(
    model: Model, limit: Limit, statistics: Mapping[str, float], wanted: Team | None = None
) -> Result:
    """Result of a planner that is stopped before it has a plan which obeys the rules.

    All robots stay at their starts, which obeys every rule; then one after the other takes the
    path that it was to have, where that collides with nobody and increases J. There is no
    plan where a robot has a goal elsewhere.

    Parameters
    ----------
    wanted : paths with conflicts, of the first robots at least
    """
    team = Team(model).hovering()
    if any(single.path is None for single in team.found):
        return no_plan_in_time(limit, statistics)
    for robot, single in enumerate(wanted.found if wanted else ()):
        changed = team.with_path(robot, single)
        if changed.value > team.value and not changed.collides:
            team = changed
    return team_result(team, limit, statistics)


def no_plan(reason: Reason, message: str, statistics: Mapping[str, float] | None = None) -> Result:
    """Result without a plan, for a reason and in words."""
    return Result(None, float("-inf"), reason, message=message, statistics=statistics or {})


def no_plan_in_time(limit: Limit, statistics: Mapping[str, float] | None = None) -> Result:
    """Result without a plan, since a limit was reached."""
    words = f"no plan was found before the {limit} limit"
    return Result(
        None, float("-inf"), Reason.STOPPED, limit, message=words, statistics=statistics or {}
    )


def no_path(robot: int) -> Result:
    """Result of a team of which one robot alone has no path."""
    return no_plan(Reason.INFEASIBLE, f"robot {robot} has no path, even alone")
