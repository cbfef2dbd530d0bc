"""Paths of a team as they are found robot by robot, and the results made of them."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from cocap_opt.data import FloatArray
from cocap_opt.model import Model, Path
from cocap_opt.objective import objective
from cocap_opt.planners.low_level import SingleRobotPath
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
        pixels = self.model.problem.no_pixels()
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
        return objective(self.model, self.paths, self.others(EVERYBODY))

    @property
    def collides(self) -> bool:
        """True where two of the paths conflict."""
        plan = self.model.plan(self.paths)
        return next(plan.conflicts(self.model.problem), None) is not None

    def with_path(self, robot: int, single: SingleRobotPath) -> "Team":
        """Return the team with another path for one robot, or with the next robot's first one."""
        return Team(self.model, (*self.found[:robot], single, *self.found[robot + 1 :]))

    def hovering(self) -> "Team":
        """Return the team in which all robots without a path stay at their starts.

        A robot whose goal is elsewhere has no path then.
        """
        robots = range(len(self.found), len(self.model.problem.robots))
        return Team(self.model, (*self.found, *map(self._hover, robots)))

    def _hover(self, robot: int) -> SingleRobotPath:
        """The path that stays at the start, which needs no time to be found."""
        problem, robot_class = self.model.problem, self.model.class_of[robot]
        pixels = problem.no_pixels()
        if not problem.robots[robot].may_hover:
            return SingleRobotPath(None, pixels, 0)
        views, state = self.model.views(robot_class), self.model.start(robot)
        steps = range(problem.first_step, problem.horizon + 1)
        along = views.along(problem.first_step, np.full(len(steps), state))
        for t, coverage in zip(steps, along, strict=True):
            pixels[problem.view_sums_at(t)] += coverage
        return SingleRobotPath((state,) * (problem.horizon + 1), pixels, len(steps))

    # -- results --------------------------------------------------------------------------

    def result(
        self, limit: Limit | None = None, statistics: Mapping[str, float] | None = None
    ) -> Result:
        """Make the result of a planner that has a path for every robot."""
        evaluated = sum(single.evaluated for single in self.found)
        return Result(
            plan=self.model.plan(self.paths),
            value=self.value,
            reason=Reason.STOPPED if limit else Reason.FINISHED,
            limit=limit or Limit.NONE,
            message=ONE_STEP_AT_A_TIME if self.model.problem.objective.over_time else "",
            statistics={"evaluated": evaluated} if statistics is None else statistics,
        )

    def without_conflicts(self, limit: Limit, statistics: Mapping[str, float]) -> Result:
        """Make the result of a planner that is stopped before its paths obey the rules.

        All robots stay at their starts, which obeys every rule; then one after the other takes
        its path, where that collides with nobody and increases J. There is no plan where a
        robot has a goal elsewhere.
        """
        team = Team(self.model).hovering()
        if any(single.path is None for single in team.found):
            return Result.stopped_without_plan(limit, statistics)
        for robot, single in enumerate(self.found):
            changed = team.with_path(robot, single)
            if changed.value > team.value and not changed.collides:
                team = changed
        return team.result(limit, statistics)

    @staticmethod
    def no_path(robot: int) -> Result:
        """Make the result of a team of which one robot alone has no path."""
        words = f"drone {robot} has no path, even alone"
        return Result.without_plan(Reason.INFEASIBLE, words)
