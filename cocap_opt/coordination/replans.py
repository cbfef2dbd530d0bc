"""Single re-plans: what a plan would gain if one robot alone took another path."""

from typing import NamedTuple

from cocap_opt.coordination.best_response import best_response
from cocap_opt.coordination.constraints import avoid_paths
from cocap_opt.model import Model
from cocap_opt.objective import objective
from cocap_opt.problem import Plan
from cocap_opt.stop import Stop, never


class Replan(NamedTuple):
    """One robot's best path past all others, which keep theirs."""

    robot: int
    gain: float  # of J
    plan: Plan


def replans(model: Model, plan: Plan, stop: Stop = never) -> list[Replan]:
    """Returns what each robot alone could gain by a path that obeys the rules, robot by robot.

    A robot that no path leads past the others is left out. The gain is below 0 where the robot
    gives up a conflict for it. Where pixels add up over time, the path is not always the best.

    Parameters
    ----------
    plan : one that can be flown
    stop : stopping criterion, checked now and then

    Raises
    ------
    LimitReached
        If a limit is reached.
    """
    paths = model.paths(plan)
    pixels = [model.robot_pixels(robot, path) for robot, path in enumerate(paths)]
    value, found = objective(model, paths), []
    for robot, own in enumerate(paths):
        others = [k for k in range(len(paths)) if k != robot]
        seen = sum((pixels[k] for k in others), model.problem.no_pixels())
        passing = (model.places.cells_along(k, paths[k]) for k in others)
        charges = avoid_paths(model, model.class_of[robot], passing)
        new = best_response(model, robot, seen, charges, stop)
        if new is None:
            continue
        changed = [*paths[:robot], new, *paths[robot + 1 :]]
        gain = 0.0 if new == own else objective(model, changed) - value
        found.append(Replan(robot, gain, model.plan(changed)))
    return found
