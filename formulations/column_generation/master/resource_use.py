"""The use of resources by mixtures: rules that they violate, and resources that they use
fractionally.

A fractionally used resource is a candidate for branching: a robot in a cell at a step, first over
all robots, then over one class; then a state, which fixes the heading; then a move. A decision
about any of these is a charge on places, states or moves, so pricing remains value iteration. If
every state is used by an integral number of robots, so is every move, except where the swap rule
couples moves.
"""

from collections import defaultdict
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple, TypeVar

import numpy as np

from cocap_opt.data import BoolArray, IntArray
from cocap_opt.formulations.certificates.resources import Cells, Move, Moves, Resource, Swap, Visit
from cocap_opt.formulations.relaxations.collision_rows import CliquesOfMoves
from cocap_opt.formulations.relaxations.separation import Seen
from cocap_opt.mixtures.columns import Column
from cocap_opt.mixtures.mixture import Mixture
from cocap_opt.model import Model
from cocap_opt.problem import Cell, Problem

INTEGRAL = 1e-4  # amounts closer than this to an integer count as integral
_LEAST_SEEN = 1e-7  # amount of a robot; columns with less are treated as seeing nothing


def roots_seen(mixture: Mixture, problem: Problem) -> list[tuple[int, Seen]]:
    """Returns the view sums of faces that a mixture sees, each with its roots."""
    n_roots = problem.returns.n_roots
    used = np.flatnonzero(mixture.amounts > _LEAST_SEEN).tolist()
    columns = [mixture.columns[n] for n in used]
    view_sums = [np.zeros(0, dtype=np.int64), *(column.view_sums for column in columns)]
    numbers = np.concatenate(view_sums)
    if not len(numbers):
        return []
    roots = np.sqrt(np.concatenate([column.pixels for column in columns]))
    counts = [len(column.view_sums) for column in columns]
    amounts = np.repeat(mixture.amounts[used], counts)
    classes = np.repeat([column.along.class_number for column in columns], counts)
    n_faces = n_roots // problem.view_sum_steps
    states = np.concatenate([_states_at(column, n_faces) for column in columns])
    order = np.argsort(numbers, kind="stable")
    distinct, first = np.unique(numbers[order], return_index=True)
    parts = np.split(order, first[1:])
    return [
        (view_sum, Seen(classes[p], roots[p], amounts[p], states[p]))
        for view_sum, p in zip(distinct.tolist(), parts, strict=True)
        if view_sum < n_roots
    ]


def _states_at(column: Column, n_faces: int) -> IntArray:
    """Returns the state of a column at the step of each view sum; the last one for counted people,
    and the first one if pixels add up over time.
    """
    path = np.array(column.path)
    states: IntArray = path[np.minimum(column.view_sums // n_faces, len(path) - 1)]
    return states


def violated_rows(mixture: Mixture, model: Model, tolerance: float) -> list[Cells | Swap | Moves]:
    """Returns the resources that a mixture uses more than once although only one robot may.

    Parameters
    ----------
    tolerance : excess over one use that is tolerated
    """
    problem = model.problem
    if problem.rules.none:
        return []
    occupied = defaultdict[int, _Uses[Cell]](lambda: defaultdict(float))  # uses by step
    flown = defaultdict[int, _Uses[_CellMove]](lambda: defaultdict(float))
    for column, amount in mixture.used():
        cells = column.along.cells
        for t, cell in enumerate(cells):
            occupied[t][cell] += amount
        for t, move in enumerate(pairwise(cells)):
            flown[t][move] += amount
    found: list[Cells | Swap | Moves] = []
    for t, cells_then in occupied.items():
        found += _crowded_cells(problem, t, cells_then, 1 + tolerance)
    cliques = CliquesOfMoves(model)
    for t, moves in flown.items():
        if problem.rules.separation:
            found += _crowded_moves(cliques, t, moves, 1 + tolerance)
        elif problem.rules.swap:
            found += _crowded_swaps(t, moves, 1 + tolerance)
    return list(dict.fromkeys(found))


_CellMove = tuple[Cell, Cell]
_User = TypeVar("_User", Cell, _CellMove)
_Uses = dict[_User, float]  # number of robots that are in a cell, or make a move


def _crowded_cells(problem: Problem, t: int, used: _Uses[Cell], most: float) -> list[Cells]:
    """Returns cliques of cells whose use exceeds the limit."""
    if not problem.rules.separation:
        return [Cells(t, (cell,)) for cell, amount in used.items() if amount > most]
    cells, at = list(used), problem.positions(list(used))
    near = problem.rules.too_near(at[None] - at[:, None])
    found = []
    for k in range(len(cells)):
        clique = [cells[n] for n in _clique(near, k, list(used.values()))]
        if sum(used[cell] for cell in clique) > most:
            found.append(Cells(t, tuple(sorted(clique))))
    return found


def _crowded_swaps(t: int, used: _Uses[tuple[Cell, Cell]], most: float) -> list[Swap]:
    """Returns swaps whose use exceeds the limit."""
    pairs = {(min(move), max(move)) for move in used if move[0] != move[1]}
    return [
        Swap(t, (a, b))
        for a, b in sorted(pairs)
        if used.get((a, b), 0.0) + used.get((b, a), 0.0) > most
    ]


def _crowded_moves(
    cliques: CliquesOfMoves, t: int, used: _Uses[tuple[Cell, Cell]], most: float
) -> list[Moves]:
    """Returns cliques of moves whose use exceeds the limit.

    All moves that pass near the place and moment at which two used moves are closest form a clique,
    whether used or not. If the use of that clique is within the limit, cliques of used moves are
    tried.
    """
    moves, amounts = list(used), list(used.values())
    near, between = cliques.conflicts(moves)
    found: dict[tuple[tuple[Cell, Cell], ...], None] = {}
    for first, second in np.argwhere(np.triu(between)).tolist():
        if amounts[first] + amounts[second] > most:
            found[cliques.around(moves[first], moves[second])] = None
            continue
        clique = [moves[n] for n in _clique(near & near[second], first, amounts)]
        if sum(used[move] for move in clique) > most:
            found[tuple(sorted(clique))] = None
    return [Moves(t, clique) for clique in found]


def _clique(near: BoolArray, first: int, amounts: Sequence[float]) -> list[int]:
    """Returns a clique that contains a given member, adding the most used moves first.

    Parameters
    ----------
    near : [n, n] True if two moves conflict
    """
    clique, open_ = [first], near[first].copy()
    open_[first] = False
    for k in np.lexsort([np.arange(len(amounts)), -np.array(amounts)]).tolist():
        if open_[k]:
            clique.append(k)
            open_ &= near[k]
    return clique


class ResourceUse(NamedTuple):
    """The number of robots of a mixture, possibly fractional, that use each resource, by kind."""

    cells: dict[Resource, float]  # use by all robots
    cells_of_classes: dict[Resource, float]  # use by one class; empty if there is only one class
    states: dict[Resource, float]
    moves: dict[Resource, float]

    @classmethod
    def of(cls, model: Model, mixture: Mixture) -> "ResourceUse":
        """Returns the use of resources by a mixture."""
        cells: defaultdict[Resource, float] = defaultdict(float)
        of_classes: defaultdict[Resource, float] = defaultdict(float)
        states: defaultdict[Resource, float] = defaultdict(float)
        moves: defaultdict[Resource, float] = defaultdict(float)
        several = len(model.classes) > 1
        for column, amount in mixture.used():
            along = column.along
            graph = model.classes[along.class_number].graph
            for t, (number, cell) in enumerate(zip(along.states, along.cells, strict=True)):
                cells[Cells(t, (cell,))] += amount
                if several:
                    of_classes[Cells(t, (cell,), along.class_number)] += amount
                states[Visit(t, graph.state(number), along.class_number)] += amount
                if t and cell != along.cells[t - 1]:
                    moves[Move(t - 1, (along.cells[t - 1], cell), along.class_number)] += amount
        return cls(dict(cells), dict(of_classes), dict(states), dict(moves))

    @property
    def has_integral_states(self) -> bool:
        """True if an integral number of robots is in every state, even if their paths are
        fractional.
        """
        return not any(_is_fractional(amount) for amount in self.states.values())

    def fractional(self, tolerance: float = INTEGRAL) -> dict[Resource, float]:
        """Returns the fractionally used resources of the first kind that has any.

        Parameters
        ----------
        tolerance : amounts closer than this to an integer count as integral
        """
        for part in self:
            found = {r: a for r, a in part.items() if _is_fractional(a, tolerance)}
            if found:
                return found
        return {}

    def most_fractional(self, tolerance: float) -> tuple[Resource, float] | None:
        """Returns the resource to branch on, and its amount; ties go to the earlier step."""
        choices = self.fractional(tolerance).items()
        return min(
            choices, key=lambda c: (round(abs(c[1] % 1 - 0.5), 3), c[0].t, repr(c[0])), default=None
        )


def _is_fractional(amount: float, tolerance: float = INTEGRAL) -> bool:
    return abs(amount - round(amount)) > tolerance
