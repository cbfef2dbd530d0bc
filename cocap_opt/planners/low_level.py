"""Low levels: planners of one robot against what the others see and occupy.

A low level is complete: it finds a path wherever there is one. That is what lets CoCap call an
exhausted constraint tree a proof.
"""

from collections.abc import Callable
from typing import NamedTuple

from cocap_opt.data import FloatArray
from cocap_opt.graph.move_rewards import bonuses_of
from cocap_opt.graph.timegraph import NO_CHARGES, Charges
from cocap_opt.model import Model, Path
from cocap_opt.objective import marginal_reward, no_pixels, robot_pixels
from cocap_opt.stop import Stop, never


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


# Plans a task, or raises LimitReached.
LowLevel = Callable[[SingleRobotTask], SingleRobotPath]


def value_iteration(task: SingleRobotTask) -> SingleRobotPath:
    """Find the best path of one robot for its marginal view reward over what the others see.

    One backward sweep over all states of the time-expanded graph, then the path is read off
    forward. It needs the coverage of every reachable state, and is exact.

    Raises
    ------
    LimitReached
        If a limit is reached before the coverage is whole.
    """
    model, robot_class = task.model, task.model.class_of[task.robot]
    task.stop.check()
    model.prepare(robot_class, task.stop)
    bonuses = bonuses_of(model.problem.objective)
    reward = marginal_reward(model, robot_class, task.pixels)
    graph, goal = robot_class.graph, robot_class.goal
    value = graph.backward_sweep(reward, bonuses, task.charges, goal)
    path = graph.best_path(value, model.start(task.robot), bonuses, task.charges)
    if path is None:
        return SingleRobotPath(None, no_pixels(model.problem), 0)
    return SingleRobotPath(tuple(path), robot_pixels(model, task.robot, tuple(path)), 0)
