"""Low levels: planners of one robot against what the others see and occupy.

A low level is complete: it finds a path wherever there is one. That is what lets CoCap call an
exhausted constraint tree a proof. A lazy one, whose attribute `is_lazy` is true, evaluates only the
views that it touches; the others need the coverage of all states before.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from cocap_opt.coordination.best_response import best_response
from cocap_opt.coordination.team import Team
from cocap_opt.data import FloatArray, IntArray
from cocap_opt.graph.charges import NO_CHARGES, Charges
from cocap_opt.model import Model, Path
from cocap_opt.problem import Problem
from cocap_opt.stop import Limit, Stop, never
from cocap_opt.vision.views import StateViews


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
    if path is None:
        return SingleRobotPath(None, model.problem.no_pixels(), 0)
    return SingleRobotPath(path, model.robot_pixels(task.robot, path), 0)


class LazyCoverage:
    """Coverage of the states of one robot class, evaluated on first use and then remembered."""

    def __init__(self, views: StateViews) -> None:
        self._views = views
        self._known: dict[tuple[int, int], FloatArray] = {}

    @property
    def evaluated(self) -> int:
        """Number of states evaluated so far."""
        return len(self._known)

    def __call__(self, t: int, states: IntArray) -> FloatArray:
        """Coverage [n, W] of states [n] at step t, as `StateViews.coverage`."""
        at = [(t, s) for s in states.tolist()]
        self._evaluate(at)
        return np.array([self._known[key] for key in at])

    def along(self, problem: Problem, path: Path) -> FloatArray:
        """Pixels [Z] of a path, state numbers at the steps from 0 on; empty without one."""
        at = [(t, path[t]) for t in range(problem.first_step, len(path))]
        self._evaluate(at)  # all at once: a view of its own costs as much as hundreds among others
        pixels = problem.no_pixels()
        for t, state in at:
            pixels[problem.view_sums_at(t)] += self._known[t, state]
        return pixels

    def _evaluate(self, at: list[tuple[int, int]]) -> None:
        """Evaluates states at steps, (t, s), that are not known."""
        new = [key for key in at if key not in self._known]
        if new:
            rows = self._views.dense(np.array([t * self._views.n_states + s for t, s in new]))
            self._known.update(zip(new, rows, strict=True))

    @classmethod
    def of_robots(cls, model: Model) -> "list[LazyCoverage]":
        """Make fresh lazy coverage [R]; the robots of a class share one source."""
        sources = {c.robots: cls(model.views(c)) for c in model.classes}
        return [sources[robot_class.robots] for robot_class in model.class_of]
