"""Prices of what is seen, and the paths that are worth most at them.

Of a view sum with pixels p_i of robot i, the root of all is less than

    sum_i (alpha sqrt(p_i) + beta p_i) + (1 - alpha)^2 / (4 beta),

so that each robot has a credit of its own: alpha for each root, beta for each px/m2. Where many
robots see a face alpha is small, and a view of what others miss is worth more. Good prices are
those of a good mixture (`mixture_ascent`). At any prices one backward sweep finds the best paths of
a whole class.
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
    """Credits of a robot for what it sees of each view sum."""

    alpha: FloatArray  # [Z] of the root of its pixels
    beta: FloatArray  # [Z] m/px^0.5, of its pixels

    @classmethod
    def alone(cls, problem: Problem) -> Self:
        """Returns the prices that value every view as if nobody else saw the face."""
        zeros = problem.no_pixels()
        return cls(zeros + 1.0, zeros)


class BestPaths(NamedTuple):
    """The best paths at some prices."""

    bound: float  # J of which no mixture has more, but for rounding; proves nothing
    prices: Prices
    columns: list[Column]  # of each robot that has a path


class PricedViews:
    """The views of all states of a model, ready to be priced.

    Parameters
    ----------
    model : whose coverage is there
    stop : stopping criterion of sweeps

    Attributes
    ----------
    tables : of each class, the id of its coverage table
    roots : of each coverage table by its id, as a sparse matrix of nodes by view sums; some classes
        share a table
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
        """Returns the prices of the nodes [n] of each table at alpha and beta [Z]."""
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
        """Returns a bound's constant and the worth of all robots' best paths together, and these.

        The worth is `CLOSED`, and there is no column, where a robot has no path.

        Parameters
        ----------
        rewards : [T+1, S] of the states of each class
        charges : of each class

        Raises
        ------
        LimitReached
            At a limit.
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
        """Returns the best paths at some prices, without regard for rules.

        Raises
        ------
        LimitReached
            At a limit.
        """
        constant = float(self._weights @ self.model.problem.returns.kappas(*prices))
        nothing = [NO_CHARGES] * len(self.model.classes)
        bound, columns = self.with_best_paths(constant, self.rewards(prices), nothing)
        return BestPaths(bound, prices, columns)
