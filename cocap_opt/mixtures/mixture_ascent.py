"""Mixture ascent: good prices and paths, without a linear program.

A mixture of columns is raised in turn with pricing, which brings each robot one more column:
fully corrective Frank-Wolfe. The root of a view sum is a smooth minimum of two of its bounds,

    u = (R^-k + S^-k)^(-1/k),  R = sum of roots,  S = sqrt(sum of pixels)    (both of the mixture)

which is concave, homogeneous, and less than the smaller one by a factor of at most 2^(-1/k).
Where drones that see a person are counted, S is the number above which more add nothing: u is
concave in R alone, and beta is 0.
How it depends on R and S gives alpha and beta. Each amount is multiplied by a power of its
column's gradient, which raises such functions on simplices (Cover 1984). All of it is a few
products of sparse matrices. Rules between robots are left out.
"""

from collections.abc import Callable, Iterator, Sequence
from typing import Protocol, TypeVar

import numpy as np
from scipy import sparse

from cocap_opt.data import FloatArray, IntArray
from cocap_opt.mixtures.columns import Column
from cocap_opt.mixtures.mixture import Mixture
from cocap_opt.mixtures.parameters import AscentParameters
from cocap_opt.mixtures.prices import Prices
from cocap_opt.model import Model
from cocap_opt.returns import Returns
from cocap_opt.stop import Stop

SHARPNESS = 64  # k
_NOTHING = 1e-12  # px/m2


class _Priced(Protocol):
    """The best paths at some prices, and the J that no mixture exceeds."""

    @property
    def bound(self) -> float: ...
    @property
    def columns(self) -> list[Column]: ...


P = TypeVar("P", bound=_Priced)


def mixture_ascent(
    model: Model,
    price: Callable[[Prices], P],
    first: P,
    stop: Stop,
    parameters: AscentParameters,
) -> Iterator[tuple[Mixture, float, P]]:
    """Yields better and better mixtures, without end, each with its value and its pricing.

    The value is that without regard for conflicts and cuts.

    Parameters
    ----------
    price : finds the best paths at some prices
    first : has a column for each robot

    Raises
    ------
    LimitReached
        Where pricing does, and between the steps in which a mixture is raised.
    """
    mixture, priced, open_ = Mixture([], np.zeros(0)), first, np.inf
    best = first.bound
    while True:
        mixture = mixture.joined(priced.columns)
        program = MixtureProgram(model, mixture.columns)
        enough = parameters.rough * open_
        amounts = raised(
            program.gradient, program.robots, mixture.amounts, enough, stop, parameters
        )
        value, prices = program.judged(amounts)
        priced = price(prices)
        best = min(best, priced.bound)
        open_ = best - value
        mixture = mixture.raised(amounts, parameters.least_amount)
        yield mixture, value, priced


def is_slow(gaps: Sequence[float], patience: int, share: float) -> bool:
    """Returns True if the gap is still more than a share of what it was some steps ago.

    Parameters
    ----------
    gaps : between bound and mixture, after each step
    patience : so many steps ago
    """
    return len(gaps) > patience and gaps[-1] > share * gaps[-1 - patience]


class MixtureProgram:
    """The amounts of some columns, and what mixtures of them see."""

    def __init__(self, model: Model, columns: list[Column]) -> None:
        self.weights, self.returns = model.problem.view_sum_weights, model.problem.returns
        pixels = np.concatenate([column.pixels for column in columns])
        view_sums = np.concatenate([column.view_sums for column in columns])
        ends = np.cumsum([0, *(len(column.pixels) for column in columns)])
        shape = len(columns), len(self.weights)
        self.pixels = sparse.csr_array((pixels, view_sums, ends), shape)
        self.roots = sparse.csr_array((np.sqrt(pixels), view_sums, ends), shape)
        # Transposed once: hundreds of steps each ask for both products.
        self._seen_by = sparse.hstack((self.pixels, self.roots), format="csr").T
        self.robots = np.array([column.robot for column in columns])
        self.bonus = np.array([column.bonus(model) for column in columns])

    def judged(self, amounts: FloatArray) -> tuple[float, Prices]:
        """Returns the value of a mixture, and its prices."""
        pixels, alone = np.split(self._seen_by @ amounts, 2)
        together, seen = together_of(self.returns, pixels), pixels > _NOTHING
        ratio = np.divide(alone, together, out=np.zeros_like(alone), where=seen)
        alpha = 1 / (1 + ratio ** (SHARPNESS + 1))
        beta = np.divide(1 - alpha, 2 * together, out=np.zeros_like(alpha), where=seen)
        beta = np.maximum(beta, (1 - alpha) * _NOTHING)
        beta[self.returns.n_roots :] = 0.0
        value = self.weights @ np.minimum(alone, together) + amounts @ self.bonus
        return float(value), Prices(alpha, beta)

    def gradient(self, amounts: FloatArray) -> FloatArray:
        """Returns the credit of each column at the prices of a mixture [n]."""
        return self.priced(*self.judged(amounts)[1])

    def priced(self, alpha: FloatArray, beta: FloatArray) -> FloatArray:
        """Returns the price of the pixels of each column, with its rewards for moves [n]."""
        price = self.roots @ (self.weights * alpha)
        return np.asarray(price + self.pixels @ (self.weights * beta) + self.bonus)


def together_of(returns: Returns, pixels: FloatArray) -> FloatArray:
    """Returns S of each view sum [Z]: the root of its pixels; what a count is at most."""
    together: FloatArray = np.sqrt(pixels)
    together[returns.n_roots :] = returns.caps
    return together


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
        # Charges may outweigh the credit of a column.
        above, mean = gradient - lowest[robots], (mean - lowest)[robots]
        factors = np.divide(above, mean, out=np.ones_like(mean), where=mean > parameters.least_mean)
        amounts = amounts * np.maximum(factors, least_factor) ** parameters.power
        amounts = amounts / by_robot(amounts)[robots]
    return amounts
