"""Constraints of one robot, as charges on its graph: from other robots' paths, or one conflict."""

from collections.abc import Iterable

import numpy as np

from cocap_opt.data import IntArray
from cocap_opt.graph.charges import NO_CHARGES, Charges
from cocap_opt.model import Model, RobotClass
from cocap_opt.problem import Cell, Conflict, PassConflict, SwapConflict, VertexConflict


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
    when they are nearest. Any two that do not are too near, so that no plan is lost in both.

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


def _at(t: int, what: IntArray) -> IntArray:
    """Returns what [n, k] is closed at a step as keys of charges [n, k + 1]."""
    return np.column_stack([np.full(len(what), t), what])
