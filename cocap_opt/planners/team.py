"""Paths of a team as they are found robot by robot, and the results made of them."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

from cocap_opt.data import FloatArray
from cocap_opt.model import Model, Path, compiled
from cocap_opt.objective import objective
from cocap_opt.planners.low_level import LowLevel, SingleRobotPath
from cocap_opt.problem import Cell, Problem
from cocap_opt.result import Reason, Result
from cocap_opt.stop import Limit, Stop

EVERYBODY = -1  # no robot is left out
ONE_STEP_AT_A_TIME = (
    "a heuristic: pixels add up over time, and this planner looks at one step at a time"
)


@dataclass(frozen=True)
class Team:
    """Paths found so far and the pixels along them, robot by robot."""

    model: Model
    found: tuple[SingleRobotPath, ...] = ()

    @classmethod
    def of(cls, problem: Problem, low_level: LowLevel, stop: Stop) -> "Team":
        """Return a team of which nobody is planned, with the coverage that a low level needs.

        If a limit ends coverage early, the robots are planned with what there is
        (`Model.covered_by`).
        """
        model = compiled(problem)
        return cls(model if getattr(low_level, "is_lazy", False) else model.covered_by(stop))

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

    @cached_property
    def value(self) -> float:
        """J."""
        return objective(self.model, self.paths, self.others(EVERYBODY))

    def _cells(self, robot: int) -> list[Cell]:
        """Cells of a robot's path, which must have been found."""
        graph = self.model.class_of[robot].graph
        path = self.found[robot].path or ()
        return [self.model.problem.cell(robot, graph.state(state)) for state in path]

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
        problem = self.model.problem
        if not problem.may_hover(robot):
            return SingleRobotPath(None, problem.no_pixels(), 0)
        path = (self.model.start(robot),) * (problem.horizon + 1)
        evaluated = problem.horizon + 1 - problem.first_step
        return SingleRobotPath(path, self.model.evaluated_pixels(robot, path), evaluated)

    # -- results --------------------------------------------------------------------------

    def result(
        self, limit: Limit | None = None, statistics: Mapping[str, float] | None = None
    ) -> Result:
        """Make the result of a planner that has planned every robot, or let it stay.

        There is no plan where a robot has no path, since it may not stay at its start.
        """
        if any(single.path is None for single in self.found):
            return Result.stopped_without_plan(limit or Limit.NONE, statistics)
        evaluated = sum(single.evaluated for single in self.found)
        model = self.model
        messages = [ONE_STEP_AT_A_TIME] if model.problem.objective.over_time else []
        early = [single.limit for single in self.found if single.limit]
        if early:
            limit = limit or early[0]
            count = f"{len(early)} of {len(self.found)}"
            messages.append(f"{count} paths are chosen by few views: a limit was near")
        if model.cut_short_by:
            limit = limit or model.cut_short_by
            messages.append(
                f"coverage was there for {model.covered_steps} of {model.problem.horizon + 1} "
                "steps; the plan was made without looking at the others"
            )
        return Result(
            plan=self.model.plan(self.paths),
            value=self.value,
            reason=Reason.STOPPED if limit else Reason.FINISHED,
            limit=limit or Limit.NONE,
            message="; ".join(messages),
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
            return team.result(limit, statistics)
        cells = [team._cells(robot) for robot in range(len(team.found))]
        for robot, single in enumerate(self.found):
            own, others = self._cells(robot), cells[:robot] + cells[robot + 1 :]
            if any(self.model.problem.paths_conflict(own, other) for other in others):
                continue
            changed = team.with_path(robot, single)
            if changed.value > team.value:
                team, cells[robot] = changed, own
        result = team.result(limit, statistics)
        staying = sum(len(set(single.path or ())) == 1 for single in team.found)
        if not staying or staying == len(team.found):  # the latter is said of any plan
            return result
        words = f"{staying} of {len(team.found)} drones stay at their starts, clear of the others"
        return replace(result, message="; ".join(filter(None, (result.message, words))))

    @staticmethod
    def no_path(robot: int) -> Result:
        """Make the result of a team of which one robot alone has no path."""
        words = f"drone {robot} has no path, even alone"
        return Result.without_plan(Reason.INFEASIBLE, words)
