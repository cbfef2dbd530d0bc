"""Low levels: planners of one robot against what the others see and occupy.

A low level is complete: it finds a path wherever there is one. That is what lets CoCap call an
exhausted constraint tree a proof. A lazy one, whose attribute `is_lazy` is true, evaluates only the
views that it touches; the others need the coverage of all states before.
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
    """One robot to be planned against what the others see and occupy."""

    model: Model
    robot: int
    pixels: FloatArray  # [Z] px/m2 that the other robots have in every view sum
    charges: Charges = NO_CHARGES  # infinite where the robot must not go
    stop: Stop = never


class SingleRobotPath(NamedTuple):
    """A robot's path and what it sees along it."""

    path: Path | None  # None: there is no path
    pixels: FloatArray  # [Z] px/m2 along the path
    evaluated: int  # states whose coverage was needed for the first time
    limit: Limit | None = None  # that was near when it was found: there may be a better one

    @classmethod
    def of(cls, model: Model, robot: int, path: Path | None) -> Self:
        """Returns a path for which no state was evaluated; None: there is none."""
        pixels = model.problem.no_pixels() if path is None else model.robot_pixels(robot, path)
        return cls(path, pixels, 0)

    def added_to(self, pixels: FloatArray) -> FloatArray:
        """Returns view sums [Z] and those along this path together."""
        return pixels + self.pixels


PlannedTeam = Team[SingleRobotPath]


# Plans a task, or raises LimitReached.
LowLevel = Callable[[SingleRobotTask], SingleRobotPath]


def value_iteration(task: SingleRobotTask) -> SingleRobotPath:
    """Find the best path of one robot for its marginal view reward over what the others see.

    It is exact (`coordination.best_response`) and needs the coverage of every reachable state.

    Raises
    ------
    LimitReached
        If a limit is reached before the path is there.
    """
    model = task.model
    task.stop.check()
    model.prepare(model.class_of[task.robot], task.stop)
    path = best_response(model, task.robot, task.pixels, task.charges, task.stop)
    return SingleRobotPath.of(model, task.robot, path)
