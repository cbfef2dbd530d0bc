"""Constraints of one robot, as charges on its graph: from other robots' paths, or one conflict."""

import math
from collections.abc import Iterable, Sequence
from itertools import pairwise, product

from cocap_opt.graph.charges import Charges
from cocap_opt.model import Model, RobotClass
from cocap_opt.problem import Cell, Conflict, Problem, State, SwapConflict

_CLOSED_CHARGE = math.inf


def place_of(model: Model, robot_class: RobotClass, cell: Cell) -> int | None:
    """Returns the number of a cell among a class's places; None where the class never flies."""
    height = model.problem.layers[cell.layer]
    layers, (width, depth) = robot_class.spec.motion.layers, model.problem.height_map.shape
    inside = 0 <= cell.x < width and 0 <= cell.y < depth
    if height not in layers or not inside:
        return None
    place = robot_class.graph.place(layers.index(height), cell.x, cell.y)
    return place if robot_class.graph.free[place] else None


def places_too_close(model: Model, robot_class: RobotClass, cell: Cell) -> list[int]:
    """Returns the places of a class that conflict with a robot in `cell` at the same step."""
    problem = model.problem
    near = (other for other in _cells_around(problem, cell) if problem.too_close(cell, other))
    places = (place_of(model, robot_class, other) for other in near)
    return [place for place in places if place is not None]


def _cells_around(problem: Problem, cell: Cell) -> Iterable[Cell]:
    """Returns all cells that can be too close to a cell, and some more."""
    if not problem.rules.separation:
        return [cell]
    reach = int(problem.rules.separation / problem.height_map.resolution) + 1
    width, depth = problem.height_map.shape
    columns = range(max(0, cell.x - reach), min(width, cell.x + reach + 1))
    rows = range(max(0, cell.y - reach), min(depth, cell.y + reach + 1))
    return [Cell(*at) for at in product(columns, rows, range(len(problem.layers)))]


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
                near = places_too_close(model, robot_class, cell)
                places.update(((t, place), _CLOSED_CHARGE) for place in near)
        if problem.rules.swap:
            for t, (cell, following) in enumerate(pairwise(cells)):
                ends = place_of(model, robot_class, following), place_of(model, robot_class, cell)
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
    here, there = (place_of(model, robot_class, conflict.cells[k]) for k in (which, 1 - which))
    is_swap = isinstance(conflict, SwapConflict)
    if here is None or (is_swap and there is None):
        raise ValueError("the conflict does not belong to this robot")
    if is_swap and there is not None:
        return before._replace(moves={**before.moves, (conflict.t, here, there): _CLOSED_CHARGE})
    return before._replace(places={**before.places, (conflict.t, here): _CLOSED_CHARGE})
