"""Paths of a team as they are found robot by robot, and the results made of them."""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

from cocap_opt.coordination.constraints import avoid_paths
from cocap_opt.data import FloatArray
from cocap_opt.graph.charges import Charges
from cocap_opt.model import Model, Path, compiled
from cocap_opt.objective import objective
from cocap_opt.planners.low_level import (
    LazyLowLevel,
    LowLevel,
    SingleRobotPath,
    SingleRobotTask,
)
from cocap_opt.problem import Cell, Conflict, Problem
from cocap_opt.result import Reason, Result
from cocap_opt.stop import Limit, Stop

_EVERYBODY = -1  # no robot is left out
_ONE_STEP_AT_A_TIME = (
    "a heuristic: pixels add up over time, and this planner looks at one step at a time"
)


@dataclass(frozen=True)
class Team:
    """Paths found so far and the pixels along them, robot by robot.

    Attributes
    ----------
    found : [R] a path of each robot; None where it is not planned yet
    """

    model: Model
    found: tuple[SingleRobotPath | None, ...]

    @classmethod
    def of(cls, problem: Problem, low_level: LowLevel, stop: Stop) -> "Team":
        """Returns a team of which nobody is planned, with the coverage that a low level needs.

        If a limit ends coverage early, the robots are planned with what there is
        (`Model.covered_by`).
        """
        model = compiled(problem)
        return cls.nobody(model if isinstance(low_level, LazyLowLevel) else model.covered_by(stop))

    @classmethod
    def nobody(cls, model: Model) -> "Team":
        """Returns a team of which nobody is planned."""
        return cls(model, (None,) * len(model.problem.robots))

    @property
    def size(self) -> int:
        """R, the number of robots, planned or not."""
        return len(self.found)

    @property
    def is_whole(self) -> bool:
        """True if every robot has a path."""
        return all(single is not None and single.path is not None for single in self.found)

    def others(self, robot: int) -> FloatArray:
        """Pixels [Z] of all robots but one (or of all, with _EVERYBODY)."""
        pixels = self.model.problem.no_pixels()
        for i, single in enumerate(self.found):
            if i != robot and single is not None:
                pixels = pixels + single.pixels
        return pixels

    def task(self, robot: int, charges: Charges, stop: Stop) -> SingleRobotTask:
        """Returns the task to plan a robot for what it adds to what the planned others see."""
        return SingleRobotTask(self.model, robot, self.others(robot), charges, stop)

    def avoiding(self, robot: int, waiting: Iterable[int] = ()) -> Charges:
        """Returns charges that keep a robot clear of the paths of all others that are planned.

        Parameters
        ----------
        waiting : robots that stay at their starts all the time, beside those that are planned
        """
        problem = self.model.problem
        paths = [self.cells(i) for i in range(self.size) if i != robot and self.found[i]]
        starts = (problem.cell(i, problem.robots[i].start) for i in waiting)
        paths += [(cell,) * (problem.horizon + 1) for cell in starts]
        return avoid_paths(self.model, self.model.class_of[robot], paths)

    @property
    def paths(self) -> list[Path]:
        """Paths of all robots, which must all have been found."""
        return [single.path for single in self.found if single is not None and single.path]

    def cells(self, robot: int) -> tuple[Cell, ...]:
        """Cells of a robot's path, which must have been found."""
        single = self.found[robot]
        return () if single is None else self.model.cells_along(robot, single.path or ())

    @cached_property
    def value(self) -> float:
        """J."""
        return objective(self.model, self.paths, self.others(_EVERYBODY))

    @cached_property
    def conflicts(self) -> tuple[Conflict, ...]:
        """Conflicts of the whole team, earliest step first."""
        return tuple(self.model.plan(self.paths).conflicts(self.model.problem))

    def with_path(self, robot: int, single: SingleRobotPath | None) -> "Team":
        """Returns the team with a first or another path for one robot; with None, with no path."""
        return Team(self.model, (*self.found[:robot], single, *self.found[robot + 1 :]))

    def without(self, robots: Collection[int]) -> "Team":
        """Returns the team in which some robots are not planned."""
        found = (None if i in robots else single for i, single in enumerate(self.found))
        return Team(self.model, tuple(found))

    def gains_over(self, other: "Team") -> bool:
        """Returns True if J is greater than another team's by more than rounding."""
        return self.value > other.value * (1 + 1e-9)

    def hovering(self) -> "Team":
        """Returns the team in which all robots without a path stay at their starts.

        A robot whose goal is elsewhere has no path then.
        """
        found = (single or self._hover(i) for i, single in enumerate(self.found))
        return Team(self.model, tuple(found))

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
        if not self.is_whole:
            assert limit is not None, "robots have no path, though no limit stopped the planner"
            return Result.stopped_without_plan(limit, statistics)
        evaluated = sum(single.evaluated for single in self.found if single is not None)
        model = self.model
        messages = [_ONE_STEP_AT_A_TIME] if model.problem.objective.over_time else []
        early = [single.limit for single in self.found if single and single.limit]
        if early:
            limit = limit or early[0]
            count = f"{len(early)} of {self.size}"
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
            limit=limit,
            in_coverage=model.cut_short_by is not None,
            message="; ".join(messages),
            statistics={"evaluated": evaluated} if statistics is None else statistics,
        )

    def without_conflicts(self, limit: Limit, statistics: Mapping[str, float]) -> Result:
        """Make the result of a planner that is stopped before its paths obey the rules.

        All robots stay at their starts, which obeys every rule; then one after the other takes
        its path, where that collides with nobody and increases J. There is no plan where a
        robot has a goal elsewhere.
        """
        team = self.nobody(self.model).hovering()
        if not team.is_whole:
            return team.result(limit, statistics)
        cells = [team.cells(robot) for robot in range(team.size)]
        for robot, single in enumerate(self.found):
            if single is None:
                continue
            own, others = self.cells(robot), cells[:robot] + cells[robot + 1 :]
            if any(self.model.problem.paths_conflict(own, other) for other in others):
                continue
            changed = team.with_path(robot, single)
            if changed.value > team.value:
                team, cells[robot] = changed, own
        result = team.result(limit, statistics)
        staying = sum(len(set(path)) == 1 for path in team.paths)
        if not staying or staying == team.size:  # the latter is said of any plan
            return result
        words = f"{staying} of {team.size} drones stay at their starts, clear of the others"
        return replace(result, message="; ".join(filter(None, (result.message, words))))

    @staticmethod
    def no_path(robot: int) -> Result:
        """Make the result of a team of which one robot alone has no path."""
        words = f"drone {robot} has no path, even alone"
        return Result.without_plan(Reason.INFEASIBLE, words)
