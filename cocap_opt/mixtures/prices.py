"""Prices of views, and the best paths at given prices.

Of a view sum with pixels p_i of robot i, the root of all is less than

    sum_i (alpha sqrt(p_i) + beta p_i) + (1 - alpha)^2 / (4 beta),

so each robot gets its own credit: alpha for each root, beta for each px/m2. If many robots see a
face, alpha is small, so views of other faces are worth more. Good prices are those of a good
mixture (`mixture_ascent`). At any prices, one backward sweep finds the best paths of a whole class.
"""

from collections.abc import Iterable
from typing import NamedTuple, Self

import numpy as np
from scipy import sparse

from cocap_opt.data import FloatArray
from cocap_opt.graph.charges import NO_CHARGES, Charges
from cocap_opt.graph.move_rewards import Bonuses
from cocap_opt.graph.value_iteration import backward_sweep, best_path
from cocap_opt.mixtures.columns import Column
from cocap_opt.model import Model
from cocap_opt.problem import Problem
from cocap_opt.stop import Stop, never


class Prices(NamedTuple):
    """Credits of a robot for its view of each view sum."""

    alpha: FloatArray  # [Z] for the root of its pixels
    beta: FloatArray  # [Z] m/px^0.5, for its pixels

    @classmethod
    def alone(cls, problem: Problem) -> Self:
        """Returns the prices that credit every view as if nobody else saw the face."""
        zeros = problem.no_pixels()
        return cls(zeros + 1.0, zeros)


class BestPaths(NamedTuple):
    """The best paths at given prices."""

    bound: float  # J that no mixture exceeds, except for rounding; not a proof
    prices: Prices
    columns: list[Column]  # the best column of each robot that has a path


class PricedViews:
    """The views of all states of a model, prepared for pricing.

    Parameters
    ----------
    model : a model with complete coverage
    stop : stopping criterion of sweeps

    Attributes
    ----------
    tables : for each class, the id of its coverage table
    roots : for each coverage table, by id, a sparse matrix of roots by node and view sum; some
        classes share a table
    """

    def __init__(self, model: Model, stop: Stop = never) -> None:
        self.model, self._stop = model, stop
        self._weights = model.problem.view_sum_weights
        self._pixels: dict[int, sparse.csr_array] = {}
        self.roots: dict[int, sparse.csr_array] = {}
        self.tables = [id(model.coverage(robot_class)) for robot_class in model.classes]
        for robot_class in model.classes:
            table = model.coverage(robot_class)
            if id(table) not in self._pixels:
                shape = len(table.nodes), len(self._weights)
                by_node = table.view_sums, table.indptr
                self._pixels[id(table)] = sparse.csr_array((table.pixels, *by_node), shape)
                self.roots[id(table)] = sparse.csr_array((np.sqrt(table.pixels), *by_node), shape)

    def at(self, alpha: FloatArray, beta: FloatArray) -> dict[int, FloatArray]:
        """Returns the prices of the nodes [n] of each table, given alpha and beta [Z]."""
        of_roots, of_pixels = self._weights * alpha, self._weights * beta
        return {
            at: roots @ of_roots + self._pixels[at] @ of_pixels for at, roots in self.roots.items()
        }

    def rewards(self, prices: Prices) -> list[FloatArray]:
        """Returns the credits of the states [T+1, S] of each class."""
        of_nodes = self.at(*prices)
        both = zip(self.model.classes, self.tables, strict=True)
        return [self.model.spread(robot_class, of_nodes[table]) for robot_class, table in both]

    def with_best_paths(
        self, bound: float, rewards: Iterable[FloatArray], charges: Iterable[Charges]
    ) -> tuple[float, list[Column]]:
        """Returns a constant plus the total worth of all robots' best paths, and these paths.

        If a robot has no path, the worth is `CLOSED`, and there are no columns.

        Parameters
        ----------
        rewards : rewards [T+1, S] of the states of each class
        charges : charges of each class

        Raises
        ------
        LimitReached
            If a limit is reached.
        """
        bonuses, columns = Bonuses.of(self.model.problem.objective), []
        for robot_class, reward, charge in zip(self.model.classes, rewards, charges, strict=True):
            graph, goal = robot_class.graph, robot_class.goal
            value = backward_sweep(graph, reward, bonuses, charge, goal, self._stop)
            for robot, starts in zip(robot_class.robots, robot_class.starts, strict=True):
                bound += float(value[0, starts].max())
                path = best_path(graph, value, starts, bonuses, charge)
                if path is not None:
                    columns.append(Column.of(self.model, robot, tuple(path)))
        return bound, columns

    def priced(self, prices: Prices) -> BestPaths:
        """Returns the best paths at given prices, ignoring rules.

        Raises
        ------
        LimitReached
            If a limit is reached.
        """
        constant = float(self._weights @ self.model.problem.returns.kappas(*prices))
        nothing = [NO_CHARGES] * len(self.model.classes)
        bound, columns = self.with_best_paths(constant, self.rewards(prices), nothing)
        return BestPaths(bound, prices, columns)
