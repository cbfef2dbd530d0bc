"""Best responses: one robot's best path given what the others see, and what a plan gains by it."""

from typing import NamedTuple

from cocap_opt.coordination.constraints import avoid_paths
from cocap_opt.data import FloatArray
from cocap_opt.graph.charges import NO_CHARGES, Charges
from cocap_opt.graph.move_rewards import Bonuses
from cocap_opt.graph.value_iteration import backward_sweep, best_path
from cocap_opt.model import Model, Path
from cocap_opt.objective import marginal_reward, objective
from cocap_opt.problem import Plan
from cocap_opt.stop import Stop, never


def best_response(
    model: Model,
    robot: int,
    pixels: FloatArray,
    charges: Charges = NO_CHARGES,
    stop: Stop = never,
) -> Path | None:
    """Returns a robot's path of the largest marginal gain; None where the charges leave none.

    One backward sweep over all states of the time-expanded graph, then the path is read off
    forward. It is exact and needs the coverage of every reachable state.

    Parameters
    ----------
    pixels : [Z] px/m2 that the other robots have in every view sum
    charges : costs of places, moves and states; infinite where the robot must not go
    stop : stopping criterion, checked at every step

    Raises
    ------
    LimitReached
        If a limit is reached before the path is there.
    """
    robot_class, bonuses = model.class_of[robot], Bonuses.of(model.problem.objective)
    graph, reward = robot_class.graph, marginal_reward(model, robot_class, pixels)
    # Another array of that size would take as long to make as the sweep itself.
    in_place = (reward, len(reward) - 1)
    value = backward_sweep(graph, reward, bonuses, charges, robot_class.goal, stop, in_place)
    path = best_path(graph, value, model.start(robot), bonuses, charges)
    return None if path is None else tuple(path)


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
    for robot, flown in enumerate(paths):
        others = [k for k in range(len(paths)) if k != robot]
        seen = sum((pixels[k] for k in others), model.problem.no_pixels())
        passing = (model.places.cells_along(k, paths[k]) for k in others)
        charges = avoid_paths(model, model.class_of[robot], passing)
        new = best_response(model, robot, seen, charges, stop)
        if new is None:
            continue
        changed = [*paths[:robot], new, *paths[robot + 1 :]]
        gain = 0.0 if new == flown else objective(model, changed) - value
        found.append(Replan(robot, gain, model.plan(changed)))
    return found
