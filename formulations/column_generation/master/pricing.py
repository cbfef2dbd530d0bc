"""Pricing: computes the bound that multipliers prove, and the paths that would improve the master.

One backward sweep prices all robots of a class at once: it finds each robot's path of largest
reduced profit. The result is the bound that the multipliers' certificate proves, except for
rounding; `certificates.Pricing` recomputes it with other code before it is called proved.
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
from cocap_opt.formulations.relaxations.duals import Duals
from cocap_opt.mixtures.columns import Column
from cocap_opt.mixtures.prices import PricedViews, Prices
from cocap_opt.model import Model
from cocap_opt.stop import Stop, never


class Priced(NamedTuple):
    """A bound, its multipliers, and each robot's best path under them."""

    bound: float
    duals: Duals
    columns: list[Column]


class Pricer:
    """Prices the multipliers of one model; raises LimitReached before its stop is exceeded.

    Attributes
    ----------
    views : the views of all states of the model
    """

    def __init__(self, model: Model, stop: Stop = never) -> None:
        self.model, self.views = model, PricedViews(model, stop)
        self._weights = model.problem.view_sum_weights
        # roots by view sum, filled once there are cuts
        self._by_view_sum: dict[int, sparse.csc_array] = {}

    def __call__(self, duals: Duals, decisions: Sequence[Decision] = ()) -> Priced:
        """Returns the bound that multipliers prove for plans that obey the decisions, and new
        columns.
        """
        model, base = self.model, self.views.at(duals.alpha, duals.beta)
        constant, costs = self._constant(duals, decisions), _costs(duals, decisions)
        rewards = (
            model.spread(robot_class, self._prices(number, duals, base))
            for number, robot_class in enumerate(model.classes)
        )
        charges = (charges_of(model, number, costs) for number in range(len(model.classes)))
        bound, columns = self.views.with_best_paths(constant, rewards, charges)
        return Priced(bound, duals, columns)

    def of_prices(self, prices: Prices) -> Priced:
        """Returns the bound that prices alone prove, and new columns."""
        return self(Duals(*prices))

    def _constant(self, duals: Duals, decisions: Sequence[Decision]) -> float:
        """Returns the part of the bound that does not depend on paths."""
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
        base : for each table, the prices of its nodes by alpha and beta [n]
        """
        table = self.views.tables[number]
        prices, robot_class = base[table].copy(), self.model.classes[number]
        states = self.model.coverage(robot_class).nodes % robot_class.graph.n_states
        for cut, share in duals.cuts:
            if share > 0:
                if table not in self._by_view_sum:
                    self._by_view_sum[table] = self.views.roots[table].tocsc()
                seen = self._by_view_sum[table]
                part = slice(*seen.indptr[cut.view_sum : cut.view_sum + 2])
                nodes = seen.indices[part]
                phi = cut.phi(number, states[nodes], seen.data[part])
                prices[nodes] += share * self._weights[cut.view_sum] * phi
        return prices


def _costs(duals: Duals, decisions: Sequence[Decision]) -> list[tuple[Resource, float]]:
    """Returns the costs that conflict rows and decisions put on resources."""
    costs = list(duals.rows)
    for decision, nu in zip(decisions, duals.decisions.tolist(), strict=True):
        costs.append((decision.resource, math.inf if decision.closes else decision.sign * nu))
    return costs
