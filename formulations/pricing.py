"""Pricing: what multipliers are worth, and the paths that would improve the master.

One backward sweep prices all robots of a class at once. The value is the bound that the
multipliers' certificate proves, but for rounding; `certificate.price` computes it again by
other means before anything is called proved.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from cocap_opt.bonuses import bonuses_of
from cocap_opt.coverage import CoverageTable
from cocap_opt.data import FloatArray, IntArray
from cocap_opt.model import Model
from cocap_opt.reward import group_weights, spread
from cocap_opt.timegraph import CLOSED
from formulations.certificate import Decision
from formulations.duals import Duals
from formulations.master import Column, make_column
from formulations.resources import Resource, charges_of


class Priced(NamedTuple):
    """A bound, the multipliers it belongs to, and each robot's best path for them."""

    bound: float
    duals: Duals
    columns: list[Column]


class Pricer:
    """Prices multipliers of one model."""

    def __init__(self, model: Model) -> None:
        self.model = model
        self._weights = group_weights(model.problem)
        tables = [model.coverage(group) for group in model.classes]  # some classes share one
        distinct = {id(table): table for table in tables}
        self._shared = {
            at: _Entries.of(table, len(self._weights)) for at, table in distinct.items()
        }
        self._entries = [self._shared[id(table)] for table in tables]

    def __call__(self, duals: Duals, decisions: Sequence[Decision] = ()) -> Priced:
        """Bound of these multipliers for plans that obey the decisions, and new columns."""
        model, bonuses = self.model, bonuses_of(self.model.problem.objective)
        bound, costs = self._constant(duals, decisions)
        base = {at: entries.base(duals) for at, entries in self._shared.items()}
        columns = []
        for number, group in enumerate(model.classes):
            own = base[id(model.coverage(group))]
            reward = spread(model, group, self._paid(number, duals, own))
            charges = charges_of(model, number, costs)
            value = group.graph.backward_sweep(reward, bonuses, charges, group.goal)
            for robot, start in zip(group.robots, group.starts, strict=True):
                bound += float(value[0, start])
                if value[0, start] > CLOSED:
                    path = group.graph.best_path(value, start, bonuses, charges)
                    assert path is not None
                    columns.append(make_column(model, robot, tuple(path)))
        return Priced(bound, duals, columns)

    def _constant(
        self, duals: Duals, decisions: Sequence[Decision]
    ) -> tuple[float, list[tuple[Resource, float]]]:
        """Constants of the bound, and the costs of resources."""
        rest = np.ones_like(duals.alpha)
        total = 0.0
        for cut, share in duals.cuts:
            rest[cut.group] -= share
            total += float(self._weights[cut.group]) * share * cut.constant
        left = np.maximum(rest - duals.alpha, 0.0)
        beta = np.where(duals.beta > 0, duals.beta, 1.0)
        total += float((self._weights * left**2 / (4 * beta)).sum())
        costs = list(duals.rows)
        total += sum(mu for _, mu in duals.rows)
        for decision, nu in zip(decisions, duals.decisions.tolist(), strict=True):
            if decision.closes:
                costs.append((decision.resource, math.inf))
            else:
                total += decision.sign * nu * decision.robots
                costs.append((decision.resource, decision.sign * nu))
        return total, costs

    def _paid(self, number: int, duals: Duals, base: FloatArray) -> FloatArray:
        """What the nodes of a class's coverage table are paid [n].

        Parameters
        ----------
        base : [nnz] what every class that shares the table is paid for its entries
        """
        entries, paid = self._entries[number], base.copy()
        for cut, share in duals.cuts:
            if share > 0:
                own = entries.of_group(cut.group)
                paid[own] += share * cut.phi(number, entries.roots[own])
        return entries.table.row_sums(paid * self._weights[entries.table.groups])


class _Entries(NamedTuple):
    """The entries of a coverage table, group by group."""

    table: CoverageTable
    roots: FloatArray  # [nnz] px^0.5/m
    order: IntArray  # [nnz] entries sorted by group
    bounds: IntArray  # [G+1] where each group's begin in `order`

    @classmethod
    def of(cls, table: CoverageTable, n_groups: int) -> "_Entries":
        order = np.argsort(table.groups, kind="stable")
        bounds = np.searchsorted(table.groups[order], np.arange(n_groups + 1))
        return cls(table, np.sqrt(table.pixels), order, bounds)

    def base(self, duals: Duals) -> FloatArray:
        """What each entry is paid by alpha and beta [nnz], before weights and cuts."""
        paid: FloatArray = duals.alpha[self.table.groups] * self.roots
        paid += duals.beta[self.table.groups] * self.table.pixels
        return paid

    def of_group(self, group: int) -> IntArray:
        return self.order[self.bounds[group] : self.bounds[group + 1]]
