"""Best responses: one robot's best path given what the others see, and what a plan gains by it.

What a robot must keep clear of, other robots' paths or one conflict, are charges on its graph.
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
    """Returns charges that close all places and moves in conflict with other robots' paths.

    Parameters
    ----------
    others : the T+1 cells of each of them
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
    """Returns the charges `before` plus those that keep a robot out of a conflict.

    Under a separation not both robots may be near the point in the middle between them: the one
    that gives way keeps half the separation from it, at the step or at the moment between two
    when they are nearest. Any two that do not are too close, so that no plan is lost in both.

    Parameters
    ----------
    which : 0 or 1, the robot of the conflict that gives way

    Raises
    ------
    ValueError
        If the robot cannot be where the conflict says that it is.
    """
    robot_class = model.class_of[conflict.robots[which]]
    if isinstance(conflict, VertexConflict):
        cells = conflict.cells[which : which + 1]
    else:
        cells = conflict.moves[which]
    places = [model.places.place_of(robot_class, cell) for cell in cells]
    closed = [place for place in places if place is not None]
    if len(closed) < len(places):
        raise ValueError("the conflict is not one of this drone")
    if isinstance(conflict, VertexConflict):
        near = _near_middle(model, robot_class, conflict)
        new = Charges.closing(_at(conflict.t, np.append(near, closed)[:, None]), _NOTHING)
    else:
        passing = _passing_middle(model, robot_class, conflict)
        moves = np.concatenate([passing, [closed]])
        new = Charges.closing(_NOTHING[:, :2], _at(conflict.t, moves))
    return Charges.joined([before, new])


def _near_middle(model: Model, robot_class: RobotClass, conflict: VertexConflict) -> IntArray:
    """Returns the places [n] of a class near the point in the middle between two robots."""
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
    """Returns the moves [n, 2] of a class that pass where and when two robots are nearest."""
    rules = model.problem.rules
    tails, heads = (model.problem.positions(cells) for cells in zip(*conflict.moves, strict=True))
    meeting = rules.meeting(tails, heads)
    if not rules.near_point(meeting.ways(tails, heads)).all():
        return _NOTHING[:, :2]
    return model.places.moves_through(robot_class, meeting, conflict.moves[0])[0]


_NOTHING = np.zeros((0, 3), dtype=np.int64)


def _at(t: int, closed: IntArray) -> IntArray:
    """Returns the places or moves [n, k] closed at a step as keys of charges [n, k + 1]."""
    return np.column_stack([np.full(len(closed), t), closed])


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
    path = best_path(graph, value, model.starts(robot), bonuses, charges)
    return None if path is None else tuple(path)


class Replan(NamedTuple):
    """One robot's best path past all others, which keep theirs."""

    robot: int
    gain: float  # of J
    plan: Plan


def replans(model: Model, plan: Plan, stop: Stop = never) -> list[Replan]:
    """Returns for each robot the best change of its path alone that obeys the rules, and its gain.

    A robot that no path leads past the others is left out. The gain, in units of J, is below 0
    where the robot gives up a conflict for it. Where pixels add up over time, the path is not
    always the best.

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
