"""Best responses: one robot's best path given what the others see, and the plan's gain by it.

Other robots' paths, or a conflict, that a robot must avoid are charges on its graph.
"""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from cocap_opt.data import FloatArray, IntArray
from cocap_opt.graph.charges import NO_CHARGES, Charges
from cocap_opt.graph.move_rewards import Bonuses
from cocap_opt.graph.value_iteration import backward_sweep, best_path
from cocap_opt.model import Model, Path, RobotClass
from cocap_opt.objective import marginal_reward, objective
from cocap_opt.problem import Cell, Conflict, PassConflict, Plan, SwapConflict, VertexConflict
from cocap_opt.stop import Stop, never


def avoid_paths(
    model: Model, robot_class: RobotClass, others: Iterable[tuple[Cell, ...]]
) -> Charges:
    """Returns charges that close all places and moves that conflict with other robots' paths.

    Parameters
    ----------
    others : the T+1 cells of each other robot's path
    """
    if model.problem.rules.none:
        return NO_CHARGES
    places, moves = [_NOTHING[:, :2]], [_NOTHING]
    for cells in others:
        near, passing = model.places.path_too_close(robot_class, cells)
        places.append(near)
        moves.append(passing)
    return Charges.closing(np.concatenate(places), np.concatenate(moves))


def forbid(model: Model, conflict: Conflict, which: int, before: Charges) -> Charges:
    """Returns the charges `before` plus charges that keep a robot out of a conflict.

    Under a separation rule, two robots cannot both be near the midpoint between them: the one that
    gives way keeps half the separation from it, at the step or at the moment of closest approach
    between two steps. Two robots that are both closer than that are too close to each other, so
    every valid plan satisfies one of the two constraints.

    Parameters
    ----------
    which : 0 or 1, the robot of the conflict that gives way

    Raises
    ------
    ValueError
        If the robot cannot be in the place that the conflict gives.
    """
    robot_class = model.class_of[conflict.robots[which]]
    if isinstance(conflict, VertexConflict):
        cells = conflict.cells[which : which + 1]
    else:
        cells = conflict.moves[which]
    places = [model.places.place_of(robot_class, cell) for cell in cells]
    closed = [place for place in places if place is not None]
    if len(closed) < len(places):
        raise ValueError("the conflict does not involve this drone")
    if isinstance(conflict, VertexConflict):
        near = _near_middle(model, robot_class, conflict)
        new = Charges.closing(_at(conflict.t, np.append(near, closed)[:, None]), _NOTHING)
    else:
        passing = _passing_middle(model, robot_class, conflict)
        moves = np.concatenate([passing, [closed]])
        new = Charges.closing(_NOTHING[:, :2], _at(conflict.t, moves))
    return Charges.joined([before, new])


def _near_middle(model: Model, robot_class: RobotClass, conflict: VertexConflict) -> IntArray:
    """Returns the places [n] of a class near the midpoint between two robots."""
    rules, graph = model.problem.rules, robot_class.graph
    first, second = model.problem.positions(conflict.cells)
    if not rules.near_point((second - first) / 2):
        return _NOTHING[:, 0]
    x, y, _ = conflict.cells[0]
    places = graph.places_around(x, y, model.problem.cells_apart)
    return places[rules.near_point(model.places.where(robot_class, places) - (first + second) / 2)]


def _passing_middle(
    model: Model, robot_class: RobotClass, conflict: SwapConflict | PassConflict
) -> IntArray:
    """Returns the moves [n, 2] of a class that pass near the place and moment of closest
    approach.
    """
    rules = model.problem.rules
    tails, heads = (model.problem.positions(cells) for cells in zip(*conflict.moves, strict=True))
    meeting = rules.meeting(tails, heads)
    if not rules.near_point(meeting.ways(tails, heads)).all():
        return _NOTHING[:, :2]
    return model.places.moves_through(robot_class, meeting, conflict.moves[0])[0]


_NOTHING = np.zeros((0, 3), dtype=np.int64)


def _at(t: int, closed: IntArray) -> IntArray:
    """Returns closed places or moves [n, k] of a step as keys of charges [n, k + 1]."""
    return np.column_stack([np.full(len(closed), t), closed])


def best_response(
    model: Model,
    robot: int,
    pixels: FloatArray,
    charges: Charges = NO_CHARGES,
    stop: Stop = never,
) -> Path | None:
    """Returns a robot's path of largest marginal gain; None if the charges leave no path.

    One backward sweep over all states of the time-expanded graph, then the path is read off
    forward. It is exact; the coverage of every reachable state must be available.

    Parameters
    ----------
    pixels : [Z] px/m2 that the other robots have of every view sum
    charges : costs of places, moves and states; infinite where the robot must not go
    stop : stopping criterion, checked at every step

    Raises
    ------
    LimitReached
        If a limit is reached before the path is found.
    """
    robot_class, bonuses = model.class_of[robot], Bonuses.of(model.problem.objective)
    graph, reward = robot_class.graph, marginal_reward(model, robot_class, pixels)
    # Allocating another array of that size would take as long as the sweep itself.
    in_place = (reward, len(reward) - 1)
    value = backward_sweep(graph, reward, bonuses, charges, robot_class.goal, stop, in_place)
    path = best_path(graph, value, model.starts(robot), bonuses, charges)
    return None if path is None else tuple(path)


class Replan(NamedTuple):
    """One robot's best path given all others, which keep their paths."""

    robot: int
    gain: float  # gain of J
    plan: Plan


def replans(model: Model, plan: Plan) -> list[Replan]:
    """Returns, for each robot, the best change of its path alone that obeys the rules, and its
    gain.

    Robots that have no such path are left out. The gain, in units of J, is negative if the new path
    sacrifices J to resolve a conflict. If pixels add up over time, the path is not always the best.

    Parameters
    ----------
    plan : a plan that can be flown
    """
    paths = model.paths(plan)
    pixels = [model.robot_pixels(robot, path) for robot, path in enumerate(paths)]
    value, found = objective(model, paths), []
    for robot, flown in enumerate(paths):
        others = [k for k in range(len(paths)) if k != robot]
        seen = sum((pixels[k] for k in others), model.problem.no_pixels())
        passing = (model.places.cells_along(k, paths[k]) for k in others)
        charges = avoid_paths(model, model.class_of[robot], passing)
        new = best_response(model, robot, seen, charges)
        if new is None:
            continue
        changed = [*paths[:robot], new, *paths[robot + 1 :]]
        gain = 0.0 if new == flown else objective(model, changed) - value
        found.append(Replan(robot, gain, model.plan(changed)))
    return found
