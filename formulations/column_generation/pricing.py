"""Pricing: the bound that multipliers prove, and the paths that would improve the master.

One backward sweep prices all robots of a class at once: it finds the path of the largest reduced
cost of each. The value is the bound that the multipliers' certificate proves, but for rounding;
`certificates.Pricing` computes it again by other means before anything is called proved.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from cocap_opt.data import FloatArray, IntArray
from cocap_opt.formulations.certificates import Decision, Resource, charges_of
from cocap_opt.formulations.column_generation.columns import Column
from cocap_opt.formulations.relaxations.duals import Duals
from cocap_opt.graph.move_rewards import Bonuses
from cocap_opt.graph.timegraph import CLOSED
from cocap_opt.graph.value_iteration import backward_sweep, best_path
from cocap_opt.model import Model
from cocap_opt.stop import Stop, never
from cocap_opt.vision.coverage import CoverageTable


class Priced(NamedTuple):
    """A bound, the multipliers it belongs to, and each robot's best path for them."""

    bound: float
    duals: Duals
    columns: list[Column]


class Pricer:
    """Prices the multipliers of one model; raises LimitReached before its stop is exceeded."""

    def __init__(self, model: Model, stop: Stop = never) -> None:
        self.model, self._stop = model, stop
        self._weights = model.problem.view_sum_weights
        # Some classes share a table.
        tables = [model.coverage(robot_class) for robot_class in model.classes]
        distinct = {id(table): table for table in tables}
        self._shared = {
            at: _Entries.of(table, len(self._weights)) for at, table in distinct.items()
        }
        self._entries = [self._shared[id(table)] for table in tables]

    def __call__(self, duals: Duals, decisions: Sequence[Decision] = ()) -> Priced:
        """Returns the bound of multipliers for plans that obey the decisions, and new columns."""
        model, bonuses = self.model, Bonuses.of(self.model.problem.objective)
        bound, costs = self._constant(duals, decisions), _costs(duals, decisions)
        base = {at: entries.base(duals) for at, entries in self._shared.items()}
        columns = []
        for number, robot_class in enumerate(model.classes):
            own = base[id(model.coverage(robot_class))]
            reward = model.spread(robot_class, self._paid(number, duals, own))
            charges = charges_of(model, number, costs)
            value = backward_sweep(
                robot_class.graph, reward, bonuses, charges, robot_class.goal, self._stop
            )
            for robot, start in zip(robot_class.robots, robot_class.starts, strict=True):
                bound += float(value[0, start])
                if value[0, start] > CLOSED:
                    path = best_path(robot_class.graph, value, start, bonuses, charges)
                    assert path is not None
                    columns.append(Column.of(model, robot, tuple(path)))
        return Priced(bound, duals, columns)

    def _constant(self, duals: Duals, decisions: Sequence[Decision]) -> float:
        """Returns the part of the bound that no path decides."""
        rest = np.ones_like(duals.alpha)
        total = 0.0
        for cut, share in duals.cuts:
            rest[cut.view_sum] -= share
            total += float(self._weights[cut.view_sum]) * share * cut.constant
        left = np.maximum(rest - duals.alpha, 0.0)
        beta = np.where(duals.beta > 0, duals.beta, 1.0)
        total += float((self._weights * left**2 / (4 * beta)).sum())
        total += sum(mu for _, mu in duals.rows)
        for decision, nu in zip(decisions, duals.decisions.tolist(), strict=True):
            if not decision.closes:
                total += decision.sign * nu * decision.robots
        return total

    def _paid(self, number: int, duals: Duals, base: FloatArray) -> FloatArray:
        """Returns the payment of each node of a class's coverage table [n].

        Parameters
        ----------
        base : [nnz] payment for the entries to every class that shares the table
        """
        entries, paid = self._entries[number], base.copy()
        for cut, share in duals.cuts:
            if share > 0:
                own = entries.of_view_sum(cut.view_sum)
                paid[own] += share * cut.phi(number, entries.roots[own])
        return entries.table.row_sums(paid * self._weights[entries.table.view_sums])


def _costs(duals: Duals, decisions: Sequence[Decision]) -> list[tuple[Resource, float]]:
    """Returns the costs of resources by conflict rows and decisions."""
    costs = list(duals.rows)
    for decision, nu in zip(decisions, duals.decisions.tolist(), strict=True):
        costs.append((decision.resource, math.inf if decision.closes else decision.sign * nu))
    return costs


class _Entries(NamedTuple):
    """The entries of a coverage table, view sum by view sum."""

    table: CoverageTable
    roots: FloatArray  # [nnz] px^0.5/m
    order: IntArray  # [nnz] entries sorted by view sum
    bounds: IntArray  # [Z+1] where each view sum's begin in `order`

    @classmethod
    def of(cls, table: CoverageTable, n_view_sums: int) -> "_Entries":
        """Returns the entries of a table in order."""
        order = np.argsort(table.view_sums, kind="stable")
        bounds = np.searchsorted(table.view_sums[order], np.arange(n_view_sums + 1))
        return cls(table, np.sqrt(table.pixels), order, bounds)

    def base(self, duals: Duals) -> FloatArray:
        """Returns the payment of each entry by alpha and beta [nnz], before weights and cuts."""
        paid: FloatArray = duals.alpha[self.table.view_sums] * self.roots
        paid += duals.beta[self.table.view_sums] * self.table.pixels
        return paid

    def of_view_sum(self, view_sum: int) -> IntArray:
        """Returns the numbers of the entries of one view sum."""
        return self.order[self.bounds[view_sum] : self.bounds[view_sum + 1]]
