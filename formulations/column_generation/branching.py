"""Which resource to branch on: one that a fractional mixture of paths uses a fraction of.

A robot in a cell at a step, of all robots, then of one class; then a state, which settles the
heading; then a move. What is branched on stays a charge on places, states or moves, so that
pricing stays value iteration. If all states are used by whole robots, so are all moves but
where the swap rule couples them.
"""

from collections import defaultdict
from collections.abc import Iterable, Sequence

import numpy as np

from cocap_opt.data import FloatArray
from cocap_opt.formulations.certificates.resources import Cells, Move, Resource, Visit
from cocap_opt.formulations.column_generation.master import Column
from cocap_opt.model import Model, Path

WHOLE = 1e-4

Amounts = dict[Resource, float]  # how many robots of a mixture use a resource


def amounts_of(model: Model, columns: Sequence[Column], mixture: FloatArray) -> list[Amounts]:
    """Use of cells by all robots, of cells by a class, of states, and of moves."""
    cells: defaultdict[Resource, float] = defaultdict(float)
    own: defaultdict[Resource, float] = defaultdict(float)
    states: defaultdict[Resource, float] = defaultdict(float)
    moves: defaultdict[Resource, float] = defaultdict(float)
    several = len(model.classes) > 1
    for n in np.flatnonzero(mixture > 1e-9).tolist():
        flight, amount = columns[n].flight, float(mixture[n])
        graph = model.classes[flight.class_number].graph
        for t, (number, cell) in enumerate(zip(flight.path, flight.cells, strict=True)):
            cells[Cells(t, (cell,))] += amount
            if several:
                own[Cells(t, (cell,), flight.class_number)] += amount
            states[Visit(t, graph.state(number), flight.class_number)] += amount
            if t and cell != flight.cells[t - 1]:
                moves[Move(t - 1, (flight.cells[t - 1], cell), flight.class_number)] += amount
    return [dict(part) for part in (cells, own, states, moves)]


def fractional(amounts: Iterable[Amounts], whole: float = WHOLE) -> list[tuple[Resource, float]]:
    """Fractionally used resources of the first kind that has any.

    Parameters
    ----------
    whole : amounts nearer than this to a whole number count as whole
    """
    for part in amounts:
        found = [(r, a) for r, a in part.items() if abs(a - round(a)) > whole]
        if found:
            return found
    return []


def whole_paths(model: Model, columns: Sequence[Column], mixture: FloatArray) -> list[Path] | None:
    """Paths of all robots, if whole robots use every state; None if not.

    From step to step the robots in the states of t go where the mixture goes from there, as
    whole as it gets.
    """
    from scipy.optimize import linear_sum_assignment  # half of the time that imports take

    states = amounts_of(model, columns, mixture)[2]
    if fractional([states]):
        return None
    paths: list[list[int]] = [[model.start(i)] for i in range(len(model.problem.robots))]
    for number, robot_class in enumerate(model.classes):
        for t in range(model.problem.horizon):
            along: defaultdict[tuple[int, int], float] = defaultdict(float)
            for n in np.flatnonzero(mixture > 1e-9).tolist():
                flight = columns[n].flight
                if flight.class_number == number:
                    along[flight.path[t], flight.path[t + 1]] += float(mixture[n])
            heads: list[int] = []
            for resource, amount in states.items():
                assert isinstance(resource, Visit)
                if (resource.t, resource.class_number) == (t + 1, number):
                    heads += [robot_class.graph.index(resource.state)] * round(amount)
            if len(heads) != len(robot_class.robots):
                return None
            tails = [paths[robot][-1] for robot in robot_class.robots]
            gain = np.array([[along.get((a, b), -1e3) for b in heads] for a in tails])
            rows, chosen = linear_sum_assignment(-gain)
            if (gain[rows, chosen] < 0).any():
                return None
            for k, head in zip(rows.tolist(), chosen.tolist(), strict=True):
                paths[robot_class.robots[k]].append(heads[head])
    return [tuple(path) for path in paths]
