"""Pricing: what multipliers are worth, and the paths that would improve the master.

One backward sweep prices all robots of a class at once. The value is the bound that the
multipliers' certificate proves, but for rounding; `certificate.price` computes it again by
other means before anything is called proved.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from cocap_opt.model import Model, RobotClass
from cocap_opt.problem import FloatArray, IntArray
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
        self._entries = [_Entries.of(model, group) for group in model.classes]

    def __call__(self, duals: Duals, decisions: Sequence[Decision] = ()) -> Priced:
        """Bound of these multipliers for plans that obey the decisions, and new columns."""
        model, bonus = self.model, self.model.problem.objective.stationarity
        bound, costs = self._constant(duals, decisions)
        columns, self._base = [], dict[int, FloatArray]()
        for number, group in enumerate(model.classes):
            reward = spread(model, group, self._paid(number, duals))
            charges = charges_of(model, number, costs)
            value = group.graph.backward_sweep(reward, bonus, charges, group.goal)
            for robot, start in zip(group.robots, group.starts, strict=True):
                bound += float(value[0, start])
                if value[0, start] > CLOSED:
                    path = group.graph.best_path(value, start, bonus, charges)
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

    def _paid(self, number: int, duals: Duals) -> FloatArray:
        """What the nodes of a class's coverage table are paid [n]."""
        entries = self._entries[number]
        table = self.model.coverage(self.model.classes[number])
        base = self._base.get(id(table))  # classes that see alike share it
        if base is None:
            base = duals.alpha[table.groups] * entries.roots
            base += duals.beta[table.groups] * table.pixels
            self._base[id(table)] = base
        paid = base.copy()
        for cut, share in duals.cuts:
            if share > 0:
                own = entries.of_group(cut.group)
                paid[own] += share * cut.phi(number, entries.roots[own])
        return table.row_sums(paid * self._weights[table.groups])


class _Entries(NamedTuple):
    """The entries of a coverage table, group by group."""

    roots: FloatArray  # [nnz] px^0.5/m
    order: IntArray  # [nnz] entries sorted by group
    bounds: IntArray  # [G+1] where each group's begin in `order`

    @classmethod
    def of(cls, model: Model, group: RobotClass) -> "_Entries":
        table = model.coverage(group)
        order = np.argsort(table.groups, kind="stable")
        n_groups = len(group_weights(model.problem))
        bounds = np.searchsorted(table.groups[order], np.arange(n_groups + 1))
        return cls(np.sqrt(table.pixels), order, bounds)

    def of_group(self, group: int) -> IntArray:
        return self.order[self.bounds[group] : self.bounds[group + 1]]
