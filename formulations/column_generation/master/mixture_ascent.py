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

from collections.abc import Callable, Iterator

import numpy as np
from scipy import sparse

from cocap_opt.data import FloatArray, IntArray
from cocap_opt.formulations.column_generation.master.columns import Column
from cocap_opt.formulations.column_generation.master.mixture import Mixture
from cocap_opt.formulations.column_generation.master.pricing import Priced, Pricer
from cocap_opt.formulations.column_generation.parameters import AscentParameters
from cocap_opt.formulations.relaxations.duals import Duals
from cocap_opt.model import Model
from cocap_opt.stop import Stop

SHARPNESS = 64  # k
_NOTHING = 1e-12  # px/m2


def mixture_ascent(
    model: Model, pricer: Pricer, first: Priced, stop: Stop, parameters: AscentParameters
) -> Iterator[tuple[Mixture, float, Priced]]:
    """Yields better and better mixtures, without end, each with its value and its pricing.

    The value is that without regard for conflicts and cuts.

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
        enough = parameters.rough * open_
        amounts = raised(
            program.gradient, program.robots, mixture.amounts, enough, stop, parameters
        )
        value, duals = program.judged(amounts)
        priced = pricer(duals)
        best = min(best, priced.bound)
        open_ = best - value
        kept = np.flatnonzero(amounts > parameters.least_amount)
        mixture = Mixture([mixture.columns[n] for n in kept.tolist()], amounts[kept])
        yield mixture, value, priced


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

    def judged(self, amounts: FloatArray) -> tuple[float, Duals]:
        """Returns the value of a mixture, and the multipliers of its view sums."""
        pixels, alone = amounts @ self.pixels, amounts @ self.roots
        together, seen = np.sqrt(pixels), pixels > _NOTHING
        ratio = np.divide(alone, together, out=np.zeros_like(alone), where=seen)
        alpha = 1 / (1 + ratio ** (SHARPNESS + 1))
        beta = np.divide(1 - alpha, 2 * together, out=np.zeros_like(alpha), where=seen)
        value = self.weights @ np.minimum(alone, together) + amounts @ self.bonus
        return float(value), Duals(alpha, np.maximum(beta, (1 - alpha) * _NOTHING))

    def gradient(self, amounts: FloatArray) -> FloatArray:
        """Returns what the multipliers of a mixture pay for each column [n]."""
        duals = self.judged(amounts)[1]
        return self.priced(duals.alpha, duals.beta)

    def priced(self, alpha: FloatArray, beta: FloatArray) -> FloatArray:
        """Returns what is paid for the pixels of each column, and its rewards for moves [n]."""
        price = self.roots @ (self.weights * alpha)
        return np.asarray(price + self.pixels @ (self.weights * beta) + self.bonus)


def raised(
    gradient_at: Callable[[FloatArray], FloatArray],
    robots: IntArray,
    amounts: FloatArray,
    enough: float,
    stop: Stop,
    parameters: AscentParameters,
    least_factor: float = 0.0,
) -> FloatArray:
    """Returns amounts of a larger value, at best by all but `enough`; raises LimitReached.

    Parameters
    ----------
    gradient_at : of the value, by the amounts [n]
    robots : [n] of the columns
    least_factor : of an amount in a step, before the power
    """

    def by_robot(values: FloatArray) -> FloatArray:
        return np.bincount(robots, values).astype(np.float64)

    for _ in range(parameters.most_steps):
        stop.check()
        gradient = gradient_at(amounts)
        mean = by_robot(amounts * gradient)
        lowest, largest = np.zeros_like(mean), np.full_like(mean, -np.inf)
        np.minimum.at(lowest, robots, gradient)
        np.maximum.at(largest, robots, gradient)
        if (largest - mean).sum() <= enough:
            break
        # Charges may outweigh what a column is paid.
        above, mean = gradient - lowest[robots], (mean - lowest)[robots]
        factors = np.divide(above, mean, out=np.ones_like(mean), where=mean > parameters.least_mean)
        amounts = amounts * np.maximum(factors, least_factor) ** parameters.power
        amounts = amounts / by_robot(amounts)[robots]
    return amounts
