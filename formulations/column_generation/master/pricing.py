"""Pricing: the bound that multipliers prove, and the paths that would improve the master.

One backward sweep prices all robots of a class at once: it finds the path of the largest reduced
cost of each. The value is the bound that the multipliers' certificate proves, but for rounding;
`certificates.Pricing` computes it again by other means before anything is called proved.
"""

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from scipy import sparse

from cocap_opt.arithmetic import exact_sum
from cocap_opt.data import FloatArray
from cocap_opt.formulations.certificates import Decision
from cocap_opt.formulations.certificates.resources import Resource, charges_of
from cocap_opt.formulations.column_generation.master.columns import Column
from cocap_opt.formulations.relaxations.duals import Duals
from cocap_opt.graph.move_rewards import Bonuses
from cocap_opt.graph.timegraph import CLOSED
from cocap_opt.graph.value_iteration import backward_sweep, best_path
from cocap_opt.model import Model
from cocap_opt.stop import Stop, never


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
        # Coverage as sparse matrices, nodes by view sums. Some classes share a table.
        self._tables = [id(model.coverage(robot_class)) for robot_class in model.classes]
        self._pixels: dict[int, sparse.csr_array] = {}
        self._roots: dict[int, sparse.csr_array] = {}
        self._by_view_sum: dict[int, sparse.csc_array] = {}  # roots, once there are cuts
        for robot_class in model.classes:
            table = model.coverage(robot_class)
            if id(table) not in self._pixels:
                shape = len(table.nodes), len(self._weights)
                by_node = table.view_sums, table.indptr
                self._pixels[id(table)] = sparse.csr_array((table.pixels, *by_node), shape)
                self._roots[id(table)] = sparse.csr_array((np.sqrt(table.pixels), *by_node), shape)

    def __call__(self, duals: Duals, decisions: Sequence[Decision] = ()) -> Priced:
        """Returns the bound of multipliers for plans that obey the decisions, and new columns."""
        model, bonuses = self.model, Bonuses.of(self.model.problem.objective)
        bound, costs = self._constant(duals, decisions), _costs(duals, decisions)
        of_roots, of_pixels = self._weights * duals.alpha, self._weights * duals.beta
        base = {at: self._roots[at] @ of_roots + self._pixels[at] @ of_pixels for at in self._roots}
        columns = []
        for number, robot_class in enumerate(model.classes):
            reward = model.spread(robot_class, self._prices(number, duals, base))
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
        returns, left = self.model.problem.returns, np.maximum(rest - duals.alpha, 0.0)
        beta, n_roots = np.where(duals.beta > 0, duals.beta, 1.0), returns.n_roots
        total += float((self._weights * left**2 / (4 * beta))[:n_roots].sum())
        kappas = returns.kappas(duals.alpha, duals.beta, rest)[n_roots:]
        total += float((self._weights[n_roots:] * kappas).sum())
        total += exact_sum(mu for _, mu in duals.rows)
        for decision, nu in zip(decisions, duals.decisions.tolist(), strict=True):
            if not decision.closes:
                total += decision.sign * nu * decision.robots
        return total

    def _prices(self, number: int, duals: Duals, base: Mapping[int, FloatArray]) -> FloatArray:
        """Returns the prices of the nodes of a class's coverage table [n].

        Parameters
        ----------
        base : of each table, the prices of its nodes by alpha and beta [n]
        """
        table = self._tables[number]
        prices = base[table].copy()
        for cut, share in duals.cuts:
            if share > 0:
                if table not in self._by_view_sum:
                    self._by_view_sum[table] = self._roots[table].tocsc()
                seen = self._by_view_sum[table]
                part = slice(*seen.indptr[cut.view_sum : cut.view_sum + 2])
                phi = cut.phi(number, seen.data[part])
                prices[seen.indices[part]] += share * self._weights[cut.view_sum] * phi
        return prices


def _costs(duals: Duals, decisions: Sequence[Decision]) -> list[tuple[Resource, float]]:
    """Returns the costs of resources by conflict rows and decisions."""
    costs = list(duals.rows)
    for decision, nu in zip(decisions, duals.decisions.tolist(), strict=True):
        costs.append((decision.resource, math.inf if decision.closes else decision.sign * nu))
    return costs
