"""Constraints of one robot, as charges on its graph: from other robots' paths, or one conflict."""

from collections.abc import Iterable, Sequence
from itertools import pairwise

import numpy as np

from cocap_opt.data import IntArray
from cocap_opt.graph.charges import NO_CHARGES, Charges
from cocap_opt.model import Model, RobotClass
from cocap_opt.problem import Cell, Conflict, PassConflict, State, SwapConflict


def avoid_paths(
    model: Model, robot_class: RobotClass, others: Iterable[tuple[int, Sequence[State]]]
) -> Charges:
    """Returns charges that close all places and moves in conflict with other robots' paths.

    Parameters
    ----------
    others : (robot number, its T+1 states)
    """
    problem = model.problem
    if problem.rules.none:
        return NO_CHARGES
    places, moves = [_NOTHING[:, :2]], [_NOTHING]
    for robot, path in others:
        cells = [problem.cell(robot, state) for state in path]
        for t, cell in enumerate(cells):
            places.append(_at(t, model.places_too_close(robot_class, cell)[:, None]))
        for t, move in enumerate(pairwise(cells)):
            moves.append(_at(t, model.moves_too_close(robot_class, move)))
    return Charges.closing(np.concatenate(places), np.concatenate(moves))


def forbid(model: Model, conflict: Conflict, which: int, before: Charges) -> Charges:
    """Returns the charges `before` plus the one that keeps a robot out of a conflict.

    Parameters
    ----------
    which : 0 or 1, the robot of the conflict that gives way

    Raises
    ------
    ValueError
        If the robot cannot be where the conflict says that it is.
    """
    robot_class = model.class_of[conflict.robots[which]]
    cells: tuple[Cell, ...]
    if isinstance(conflict, PassConflict):
        cells = conflict.moves[which]
    elif isinstance(conflict, SwapConflict):
        cells = conflict.cells[which], conflict.cells[1 - which]
    else:
        cells = conflict.cells[which : which + 1]
    places = [model.place_of(robot_class, cell) for cell in cells]
    closed = [place for place in places if place is not None]
    if len(closed) < len(places):
        raise ValueError("the conflict is not one of this drone")
    what = _at(conflict.t, np.array([closed]))
    is_move = len(closed) > 1
    new = Charges.closing(_NOTHING[:, :2], what) if is_move else Charges.closing(what, _NOTHING)
    return Charges.joined([before, new])


_NOTHING = np.zeros((0, 3), dtype=np.int64)


def _at(t: int, what: IntArray) -> IntArray:
    """Returns what [n, k] is closed at a step as keys of charges [n, k + 1]."""
    return np.column_stack([np.full(len(what), t), what])
