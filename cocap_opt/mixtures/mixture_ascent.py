"""Mixture ascent: finds good prices and paths without a linear program.

A mixture of columns is improved in alternation with pricing, which adds one column per robot: fully
corrective Frank-Wolfe. The root of a view sum is a smooth minimum of two of its bounds,

    u = (R^-k + S^-k)^(-1/k),  R = sum of roots,  S = sqrt(sum of pixels)    (both of the mixture)

which is concave, homogeneous, and below the smaller bound by a factor of at most 2^(-1/k). If
drones that see a person are counted, S is the number above which further drones add nothing: u is
concave in R alone, and beta is 0. The derivatives of u by R and S give alpha and beta. Each amount
is multiplied by a power of its column's gradient, which increases such functions on simplices
(Cover 1984). A step takes a few products of sparse matrices. Rules between robots are ignored.
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
    """The best paths at some prices, and a bound on the J of mixtures."""

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
    """Yields ever better mixtures without end, each with its value and its pricing.

    The value ignores conflicts and cuts.

    Parameters
    ----------
    price : finds the best paths at some prices
    first : a mixture with at least one column per robot

    Raises
    ------
    LimitReached
        If pricing raises it, or between two steps of the ascent.
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
    """Returns True if the gap is still more than a given share of its value some steps ago.

    Parameters
    ----------
    gaps : gap between bound and mixture after each step
    patience : number of steps to look back
    """
    return len(gaps) > patience and gaps[-1] > share * gaps[-1 - patience]


class MixtureProgram:
    """The amounts of some columns, and the view sums of their mixtures."""

    def __init__(self, model: Model, columns: list[Column]) -> None:
        self.weights, self.returns = model.problem.view_sum_weights, model.problem.returns
        pixels = np.concatenate([column.pixels for column in columns])
        view_sums = np.concatenate([column.view_sums for column in columns])
        ends = np.cumsum([0, *(len(column.pixels) for column in columns)])
        shape = len(columns), len(self.weights)
        self.pixels = sparse.csr_array((pixels, view_sums, ends), shape)
        self.roots = sparse.csr_array((np.sqrt(pixels), view_sums, ends), shape)
        # Transposed once, since hundreds of steps each need both products.
        self._seen_by = sparse.hstack((self.pixels, self.roots), format="csr").T
        self.robots = np.array([column.robot for column in columns])
        self.bonus = np.array([column.bonus(model) for column in columns])

    def judged(self, amounts: FloatArray) -> tuple[float, Prices]:
        """Returns the value of a mixture and its prices."""
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
        """Returns the price of each column's pixels plus its rewards for moves [n]."""
        price = self.roots @ (self.weights * alpha)
        return np.asarray(price + self.pixels @ (self.weights * beta) + self.bonus)


def together_of(returns: Returns, pixels: FloatArray) -> FloatArray:
    """Returns S of each view sum [Z]: the root of its pixels, or the cap of a count."""
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
    """Returns amounts with a larger value, at most `enough` below the maximum; raises LimitReached.

    Parameters
    ----------
    gradient_at : returns the gradient of the value [n] at given amounts
    robots : [n] robot of each column
    least_factor : smallest factor of an amount in a step, before the power
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
        # Charges may exceed the credit of a column.
        above, mean = gradient - lowest[robots], (mean - lowest)[robots]
        factors = np.divide(above, mean, out=np.ones_like(mean), where=mean > parameters.least_mean)
        amounts = amounts * np.maximum(factors, least_factor) ** parameters.power
        amounts = amounts / by_robot(amounts)[robots]
    return amounts
