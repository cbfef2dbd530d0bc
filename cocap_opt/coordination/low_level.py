"""Low levels: planners for one robot, given what the others see and occupy.

A low level is complete: it finds a path whenever one exists. Because of this, an exhausted
constraint tree of CoCap is a proof. A lazy low level, with the attribute `is_lazy` True, evaluates
only the views that it needs; the others need the coverage of all states in advance.
"""

from collections.abc import Callable
from typing import NamedTuple, Self

from cocap_opt.coordination.best_response import best_response
from cocap_opt.coordination.team import Team
from cocap_opt.data import FloatArray
from cocap_opt.graph.charges import NO_CHARGES, Charges
from cocap_opt.model import Model, Path
from cocap_opt.stop import Limit, Stop, never


class SingleRobotTask(NamedTuple):
    """A task: plan one robot, given what the others see and occupy."""

    model: Model
    robot: int
    pixels: FloatArray  # [Z] px/m2 that the other robots have of every view sum
    charges: Charges = NO_CHARGES  # infinite where the robot must not go
    stop: Stop = never


class SingleRobotPath(NamedTuple):
    """A robot's path and its view sums."""

    path: Path | None  # None: there is no path
    pixels: FloatArray  # [Z] px/m2 along the path
    evaluated: int  # number of states whose coverage was evaluated for the first time
    # the limit that ended the search early, if any: there may be a better path
    limit: Limit | None = None

    @classmethod
    def of(cls, model: Model, robot: int, path: Path | None) -> Self:
        """Returns a path for which no state was evaluated; None: there is no path."""
        pixels = model.problem.no_pixels() if path is None else model.robot_pixels(robot, path)
        return cls(path, pixels, 0)

    def add_to(self, pixels: FloatArray) -> None:
        """Adds the view sums along this path to view sums [Z]."""
        pixels += self.pixels


PlannedTeam = Team[SingleRobotPath]


# Plans a task, or raises LimitReached.
LowLevel = Callable[[SingleRobotTask], SingleRobotPath]


def value_iteration(task: SingleRobotTask) -> SingleRobotPath:
    """Finds the best path of one robot for its marginal view reward over what the others see.

    The path is exact (`coordination.best_response`); the coverage of every reachable state must be
    available.

    Raises
    ------
    LimitReached
        If a limit is reached before the path is found.
    """
    model = task.model
    task.stop.check()
    model.prepare(model.class_of[task.robot], task.stop)
    path = best_response(model, task.robot, task.pixels, task.charges, task.stop)
    return SingleRobotPath.of(model, task.robot, path)
