"""Pricing: the bound that multipliers prove, and the paths that would improve the master.

One backward sweep prices all robots of a class at once: it finds the path of the largest reduced
cost of each. The value is the bound that the multipliers' certificate proves, but for rounding;
`certificates.Pricing` computes it again by other means before anything is called proved.
"""

import math
from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy import sparse

from cocap_opt.arithmetic import exact_sum
from cocap_opt.data import FloatArray, IntArray
from cocap_opt.formulations.certificates import Decision
from cocap_opt.formulations.certificates.resources import Resource, charges_of
from cocap_opt.formulations.column_generation.master.columns import Column
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
        self._shared = {at: _Views(table, len(self._weights)) for at, table in distinct.items()}
        self._views = [self._shared[id(table)] for table in tables]

    def __call__(self, duals: Duals, decisions: Sequence[Decision] = ()) -> Priced:
        """Returns the bound of multipliers for plans that obey the decisions, and new columns."""
        model, bonuses = self.model, Bonuses.of(self.model.problem.objective)
        bound, costs = self._constant(duals, decisions), _costs(duals, decisions)
        base = {at: views.base(duals, self._weights) for at, views in self._shared.items()}
        columns = []
        for number, robot_class in enumerate(model.classes):
            prices = base[id(model.coverage(robot_class))]
            reward = model.spread(robot_class, self._prices(number, duals, prices))
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
        total += exact_sum(mu for _, mu in duals.rows)
        for decision, nu in zip(decisions, duals.decisions.tolist(), strict=True):
            if not decision.closes:
                total += decision.sign * nu * decision.robots
        return total

    def _prices(self, number: int, duals: Duals, base: FloatArray) -> FloatArray:
        """Returns the prices of the nodes of a class's coverage table [n].

        Parameters
        ----------
        base : [n] prices of the nodes for every class that shares the table
        """
        views, prices = self._views[number], base.copy()
        for cut, share in duals.cuts:
            if share > 0:
                nodes, roots = views.of_view_sum(cut.view_sum)
                prices[nodes] += share * self._weights[cut.view_sum] * cut.phi(number, roots)
        return prices


def _costs(duals: Duals, decisions: Sequence[Decision]) -> list[tuple[Resource, float]]:
    """Returns the costs of resources by conflict rows and decisions."""
    costs = list(duals.rows)
    for decision, nu in zip(decisions, duals.decisions.tolist(), strict=True):
        costs.append((decision.resource, math.inf if decision.closes else decision.sign * nu))
    return costs


class _Views:
    """A coverage table as sparse matrices, nodes by view sums."""

    def __init__(self, table: CoverageTable, n_view_sums: int) -> None:
        shape = len(table.nodes), n_view_sums
        by_node = (table.view_sums, table.indptr)
        self._pixels = sparse.csr_array((table.pixels, *by_node), shape)
        self._roots = sparse.csr_array((np.sqrt(table.pixels), *by_node), shape)

    def base(self, duals: Duals, weights: FloatArray) -> FloatArray:
        """Returns the prices of the nodes by alpha and beta [n]."""
        prices: FloatArray = np.asarray(self._roots @ (weights * duals.alpha))
        prices += np.asarray(self._pixels @ (weights * duals.beta))
        return prices

    def of_view_sum(self, view_sum: int) -> tuple[IntArray, FloatArray]:
        """Returns the nodes that see a view sum, and the roots of the pixels that they see."""
        part = slice(*self._by_view_sum.indptr[view_sum : view_sum + 2])
        nodes: IntArray = self._by_view_sum.indices[part].astype(np.int64)
        return nodes, self._by_view_sum.data[part]

    @cached_property
    def _by_view_sum(self) -> sparse.csc_array:
        return self._roots.tocsc()
