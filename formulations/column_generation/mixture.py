"""Mixtures of columns: what they see, and the collision rules that they break."""

from collections import defaultdict
from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np

from cocap_opt.data import FloatArray
from cocap_opt.formulations.certificates import Cells, Swap
from cocap_opt.formulations.column_generation.columns import Column
from cocap_opt.formulations.relaxations.separation import Seen
from cocap_opt.model import Model
from cocap_opt.problem import Cell, Problem

_LEAST_SEEN = 1e-7  # of a robot, from which on a column counts in what a mixture sees


class Mixture(NamedTuple):
    """Columns with weights; the weights of each robot's columns add up to 1, or nearly so."""

    columns: list[Column]
    amounts: FloatArray  # [n] how much of a robot takes each column

    def used(self, least: float = 1e-9) -> Iterator[tuple[Column, float]]:
        """Yields the columns with larger amounts than `least`, and the amounts."""
        for n in np.flatnonzero(self.amounts > least).tolist():
            yield self.columns[n], float(self.amounts[n])

    def seen(self) -> list[tuple[int, Seen]]:
        """Returns the view sums that the mixture sees, each with the roots that it has there."""
        used = np.flatnonzero(self.amounts > _LEAST_SEEN).tolist()
        columns = [self.columns[n] for n in used]
        view_sums = [np.zeros(0, dtype=np.int64), *(column.view_sums for column in columns)]
        numbers = np.concatenate(view_sums)
        if not len(numbers):
            return []
        roots = np.sqrt(np.concatenate([column.pixels for column in columns]))
        counts = [len(column.view_sums) for column in columns]
        amounts = np.repeat(self.amounts[used], counts)
        classes = np.repeat([column.flight.class_number for column in columns], counts)
        order = np.argsort(numbers, kind="stable")
        distinct, first = np.unique(numbers[order], return_index=True)
        parts = np.split(order, first[1:])
        return [
            (view_sum, Seen(classes[p], roots[p], amounts[p]))
            for view_sum, p in zip(distinct.tolist(), parts, strict=True)
        ]

    def violated_rows(self, model: Model, tolerance: float) -> list[Cells | Swap]:
        """Returns the resources that the mixture uses more than once, though one robot may.

        Parameters
        ----------
        tolerance : uses in excess of 1 that are left alone
        """
        problem = model.problem
        if problem.rules.none:
            return []
        occupied: defaultdict[tuple[int, Cell], float] = defaultdict(float)
        crossed: defaultdict[tuple[int, Cell, Cell], float] = defaultdict(float)
        for column, amount in self.used():
            cells = column.flight.cells
            for t, cell in enumerate(cells):
                occupied[t, cell] += amount
                if t and cells[t - 1] != cell:
                    pair = sorted((cells[t - 1], cell))
                    crossed[t - 1, pair[0], pair[1]] += amount
        found: list[Cells | Swap] = []
        for t, cell in list(occupied):
            cells = _clique(problem, t, cell, occupied) if problem.rules.separation else (cell,)
            if sum(occupied[t, c] for c in cells) > 1 + tolerance:
                found.append(Cells(t, cells))
        if problem.rules.swap:
            found += [
                Swap(t, (a, b)) for (t, a, b), used in crossed.items() if used > 1 + tolerance
            ]
        return list(dict.fromkeys(found))


def _clique(
    problem: Problem, t: int, cell: Cell, occupied: Mapping[tuple[int, Cell], float]
) -> tuple[Cell, ...]:
    """Returns a sorted clique of cells with `cell`: any two conflict.

    It grows by the most used cells first.
    """
    near = [c for (step, c) in occupied if step == t and c != cell and problem.too_close(c, cell)]
    clique = [cell]
    for candidate in sorted(near, key=lambda c: (-occupied[t, c], c)):
        if all(problem.too_close(candidate, member) for member in clique):
            clique.append(candidate)
    return tuple(sorted(clique))
