"""Constraints of one robot, as charges on its graph: from other robots' paths, or one conflict."""

import math
from collections.abc import Iterable, Sequence
from itertools import pairwise

from cocap_opt.graph.charges import Charges
from cocap_opt.model import Model, RobotClass
from cocap_opt.problem import Conflict, State, SwapConflict

_CLOSED_CHARGE = math.inf


def avoid_paths(
    model: Model, robot_class: RobotClass, others: Iterable[tuple[int, Sequence[State]]]
) -> Charges:
    """Returns charges that close all places and moves in conflict with other robots' paths.

    Parameters
    ----------
    others : (robot number, its T+1 states)
    """
    problem = model.problem
    places: dict[tuple[int, int], float] = {}
    moves: dict[tuple[int, int, int], float] = {}
    for robot, path in others:
        cells = [problem.cell(robot, state) for state in path]
        if not problem.rules.none:
            for t, cell in enumerate(cells):
                near = model.places_too_close(robot_class, cell)
                places.update(((t, place), _CLOSED_CHARGE) for place in near)
        if problem.rules.swap:
            for t, (cell, following) in enumerate(pairwise(cells)):
                ends = model.place_of(robot_class, following), model.place_of(robot_class, cell)
                if cell != following and ends[0] is not None and ends[1] is not None:
                    moves[t, ends[0], ends[1]] = _CLOSED_CHARGE
    return Charges(places, moves)


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
    here, there = (model.place_of(robot_class, conflict.cells[k]) for k in (which, 1 - which))
    is_swap = isinstance(conflict, SwapConflict)
    if here is None or (is_swap and there is None):
        raise ValueError("the conflict is not one of this drone")
    if is_swap and there is not None:
        return Charges.joined([before, Charges(moves={(conflict.t, here, there): _CLOSED_CHARGE})])
    return Charges.joined([before, Charges({(conflict.t, here): _CLOSED_CHARGE})])
