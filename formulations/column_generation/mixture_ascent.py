"""Mixture ascent: good multipliers and columns before any master is solved.

A mixture of columns is raised in turn with pricing, which brings each robot one more column:
fully corrective Frank-Wolfe. The root of a view sum is a smooth minimum of two of its bounds,

    u = (R^-k + S^-k)^(-1/k),  R = sum of roots,  S = sqrt(sum of pixels)    (both of the mixture)

which is concave, homogeneous, and less than the smaller one by a factor of at most 2^(-1/k).
How it depends on R and S gives alpha and beta. Each amount is multiplied by a power of its
column's gradient, which raises such functions on simplices (Cover 1984). All of it is a few
products of sparse matrices, where a master takes seconds for dozens of robots.

Conflict rows and envelope cuts are left to the masters. Whatever the mixture, pricing gives a
bound.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from scipy import sparse

from cocap_opt.data import FloatArray
from cocap_opt.formulations.column_generation.columns import Column
from cocap_opt.formulations.column_generation.mixture import Mixture
from cocap_opt.formulations.column_generation.pricing import Priced, Pricer
from cocap_opt.formulations.relaxations.duals import Duals
from cocap_opt.model import Model
from cocap_opt.stop import Stop, never

SHARPNESS = 64  # k
POWER = 2.0  # of the gradient; 1 is safe and slow
MOST_STEPS = 60  # in which a mixture is raised between two pricings
ROUGH = 0.02  # of bound - value: what these steps may leave to gain
LEAST_AMOUNT = 1e-4  # of a robot, below which a column is dropped
_NOTHING = 1e-12  # px/m2


class _Raised(NamedTuple):
    """A mixture, what it is worth, and the pricing of its multipliers."""

    mixture: Mixture
    value: float  # without regard for conflicts and cuts
    priced: Priced


def mixture_ascent(
    model: Model, pricer: Pricer, first: Priced, stop: Stop = never
) -> Iterator[_Raised]:
    """Yields better and better mixtures, without end.

    Parameters
    ----------
    first : has a column for each robot

    Raises
    ------
    LimitReached
        Where the pricer does, and between the steps in which a mixture is raised.
    """
    mixture, priced, open_ = Mixture([], np.zeros(0)), first, np.inf
    best = first.bound
    while True:
        mixture = joined(mixture, priced.columns)
        program = MixtureProgram(model, mixture.columns)
        amounts = program.raised(mixture.amounts, ROUGH * open_, stop)
        value, duals = program.judged(amounts)
        priced = pricer(duals)
        best = min(best, priced.bound)
        open_ = best - value
        kept = np.flatnonzero(amounts > LEAST_AMOUNT)
        mixture = Mixture([mixture.columns[n] for n in kept.tolist()], amounts[kept])
        yield _Raised(mixture, value, priced)


def joined(mixture: Mixture, columns: list[Column]) -> Mixture:
    """Returns a mixture with new columns, of which each gets as much as one of its robot's."""
    known = {column.key for column in mixture.columns}
    new = [column for column in columns if column.key not in known]
    all_columns = [*mixture.columns, *new]
    robots = np.array([column.robot for column in all_columns])
    amounts = np.append(mixture.amounts, (1 / np.bincount(robots)[robots])[len(known) :])
    return Mixture(all_columns, amounts / np.bincount(robots, amounts)[robots])


class MixtureProgram:
    """The amounts of some columns, and what mixtures of them see."""

    def __init__(self, model: Model, columns: list[Column]) -> None:
        self.weights = model.problem.view_sum_weights
        pixels = np.concatenate([column.pixels for column in columns])
        view_sums = np.concatenate([column.view_sums for column in columns])
        ends = np.cumsum([0, *(len(column.pixels) for column in columns)])
        shape = len(columns), len(self.weights)
        self.pixels = sparse.csr_array((pixels, view_sums, ends), shape)
        self.roots = sparse.csr_array((np.sqrt(pixels), view_sums, ends), shape)
        self.robots = np.array([column.robot for column in columns])
        self.bonus = np.array([column.bonus(model) for column in columns])

    def raised(self, amounts: FloatArray, enough: float, stop: Stop = never) -> FloatArray:
        """Returns amounts of a larger value, at best by all but `enough`; raises LimitReached."""
        for _ in range(MOST_STEPS):
            stop.check()
            gradient = self._gradient(self.judged(amounts)[1])
            mean = self.by_robot(amounts * gradient)
            largest = np.zeros_like(mean)
            np.maximum.at(largest, self.robots, gradient)
            if (largest - mean).sum() <= enough:
                break
            mean = mean[self.robots]
            factors = np.divide(gradient, mean, out=np.ones_like(mean), where=mean > 0)
            amounts = amounts * factors**POWER
            amounts = amounts / self.by_robot(amounts)[self.robots]
        return amounts

    def judged(self, amounts: FloatArray) -> tuple[float, Duals]:
        """Returns the value of a mixture, and the multipliers of its view sums."""
        pixels, alone = amounts @ self.pixels, amounts @ self.roots
        together, seen = np.sqrt(pixels), pixels > _NOTHING
        ratio = np.divide(alone, together, out=np.zeros_like(alone), where=seen)
        alpha = 1 / (1 + ratio ** (SHARPNESS + 1))
        beta = np.divide(1 - alpha, 2 * together, out=np.zeros_like(alpha), where=seen)
        value = self.weights @ np.minimum(alone, together) + amounts @ self.bonus
        return float(value), Duals(alpha, np.maximum(beta, (1 - alpha) * _NOTHING))

    def _gradient(self, duals: Duals) -> FloatArray:
        """Returns what multipliers pay for each column [n]."""
        paid = self.roots @ (self.weights * duals.alpha)
        return np.asarray(paid + self.pixels @ (self.weights * duals.beta) + self.bonus)

    def by_robot(self, values: FloatArray) -> FloatArray:
        """Returns the sums of values [n] of columns by robot [R]."""
        sums: FloatArray = np.bincount(self.robots, values).astype(np.float64)
        return sums
