"""What every single-robot planner ("low level") takes and returns."""

from collections.abc import Callable
from typing import NamedTuple

from cocap_opt.data import FloatArray
from cocap_opt.graph.timegraph import NO_CHARGES, Charges
from cocap_opt.model import Model, Path
from cocap_opt.stop import Limit, Stop, never


class SingleRobotTask(NamedTuple):
    """Plan one robot against what the others see and occupy."""

    model: Model
    robot: int
    pixels: FloatArray  # [Z] px/m2 that the other robots have on every (step, face)
    charges: Charges = NO_CHARGES  # infinite where the robot must not go
    stop: Stop = never


class SingleRobotPath(NamedTuple):
    """A robot's path and what it sees along it."""

    path: Path | None  # None: there is no path, or `limit` stopped the search
    pixels: FloatArray  # [Z] px/m2 along the path
    evaluated: int  # states whose coverage was needed for the first time
    limit: Limit = Limit.NONE  # what stopped the search; NONE: it ran to its end


# A low level is complete: it returns no path without a limit only where there is none. That
# is what lets CoCap call an exhausted constraint tree a proof.
LowLevel = Callable[[SingleRobotTask], SingleRobotPath]
