"""Mixture ascent: good multipliers and columns before any master is solved.

A mixture of columns is raised in turn with pricing, which brings each robot one more column:
fully corrective Frank-Wolfe. The root of a view sum is a smooth minimum of two of its bounds,

    u = (R^-k + S^-k)^(-1/k),  R = sum of roots,  S = sqrt(sum of pixels)    (both of the mixture)

which is concave, homogeneous, and less than the smaller one by a factor of at most 2^(-1/k).
Where drones that see a person are counted, S is the number from which on more add nothing: u is
concave in R alone, and beta is 0.
How it depends on R and S gives alpha and beta. Each amount is multiplied by a power of its
column's gradient, which raises such functions on simplices (Cover 1984). All of it is a few
products of sparse matrices, where a master takes seconds for dozens of robots.

Conflict rows and envelope cuts are left to the masters, or where these would take too long, to
`RuledProgram`. There the smooth minimum is also of the heights H of a view sum's envelope cuts;
each bound has a share of the root's multiplier, in proportion to its value to the power -(k+1). A
conflict row has a multiplier that rises with its excess over one use, as in an augmented
Lagrangian: mu <- max(0, mu + rho (uses - 1)). Whatever the multipliers, pricing gives a bound.
"""

from collections.abc import Callable, Iterator, Sequence

import numpy as np
from scipy import sparse

from cocap_opt.data import FloatArray, IntArray
from cocap_opt.formulations.certificates.envelope import Cut
from cocap_opt.formulations.column_generation.master.columns import Column
from cocap_opt.formulations.column_generation.master.mixture import Mixture
from cocap_opt.formulations.column_generation.master.pricing import Priced, Pricer
from cocap_opt.formulations.column_generation.parameters import AscentParameters
from cocap_opt.formulations.relaxations.duals import Duals
from cocap_opt.formulations.relaxations.separation import phi_of
from cocap_opt.model import Model
from cocap_opt.returns import Returns
from cocap_opt.stop import Stop

_SHARPNESS = 64  # k
_NOTHING = 1e-12  # px/m2
_DARK = 1e-6  # px^0.5/m: a root below it is none, so that nothing is divided by it


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
        mixture = mixture.joined(priced.columns)
        program = MixtureProgram(model, mixture.columns)
        enough = parameters.rough * open_
        amounts = raised(
            program.gradient, program.robots, mixture.amounts, enough, stop, parameters
        )
        value, duals = program.judged(amounts)
        priced = pricer(duals)
        best = min(best, priced.bound)
        open_ = best - value
        mixture = mixture.raised(amounts, parameters.least_amount)
        yield mixture, value, priced


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
        self.robots = np.array([column.robot for column in columns])
        self.bonus = np.array([column.bonus(model) for column in columns])

    def judged(self, amounts: FloatArray) -> tuple[float, Duals]:
        """Returns the value of a mixture, and the multipliers of its view sums."""
        pixels, alone = amounts @ self.pixels, amounts @ self.roots
        together, seen = _together(self.returns, pixels), pixels > _NOTHING
        ratio = np.divide(alone, together, out=np.zeros_like(alone), where=seen)
        alpha = 1 / (1 + ratio ** (_SHARPNESS + 1))
        beta = np.divide(1 - alpha, 2 * together, out=np.zeros_like(alpha), where=seen)
        beta = np.maximum(beta, (1 - alpha) * _NOTHING)
        beta[self.returns.n_roots :] = 0.0
        value = self.weights @ np.minimum(alone, together) + amounts @ self.bonus
        return float(value), Duals(alpha, beta)

    def gradient(self, amounts: FloatArray) -> FloatArray:
        """Returns the payment for each column by the multipliers of a mixture [n]."""
        duals = self.judged(amounts)[1]
        return self.priced(duals.alpha, duals.beta)

    def priced(self, alpha: FloatArray, beta: FloatArray) -> FloatArray:
        """Returns the price of the pixels of each column, with its rewards for moves [n]."""
        price = self.roots @ (self.weights * alpha)
        return np.asarray(price + self.pixels @ (self.weights * beta) + self.bonus)


def _together(returns: Returns, pixels: FloatArray) -> FloatArray:
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
        # Charges may outweigh what a column is paid.
        above, mean = gradient - lowest[robots], (mean - lowest)[robots]
        factors = np.divide(above, mean, out=np.ones_like(mean), where=mean > parameters.least_mean)
        amounts = amounts * np.maximum(factors, least_factor) ** parameters.power
        amounts = amounts / by_robot(amounts)[robots]
    return amounts


class RuledProgram:
    """The amounts of some columns, under conflict rows and envelope cuts.

    Parameters
    ----------
    base : the same without them
    classes : [n] class number of each column
    uses : [n, rows] of resources by columns
    charges : [rows] multipliers at a use of 1
    steepness : by how much they rise with each robot too many
    least_share : of a root's multiplier, from which on pixels have one of their own
    """

    def __init__(
        self, base: MixtureProgram, classes: IntArray, cuts: Sequence[Cut], uses: sparse.csr_array,
        charges: FloatArray, steepness: float, least_share: float,
    ) -> None:  # fmt: skip
        self._base, self._uses = base, uses
        self._heights = _cut_heights(base, classes, cuts)
        self._charges, self._steepness, self._least_share = charges, steepness, least_share
        self._at = np.array([cut.view_sum for cut in cuts], dtype=np.int64)
        self._constants = np.array([cut.constant for cut in cuts])

    def _bounds(self, amounts: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Returns the bounds on the roots of view sums: R, S and H, and the least of them."""
        alone = amounts @ self._base.roots
        together = _together(self._base.returns, amounts @ self._base.pixels)
        heights = self._constants + amounts @ self._heights
        least = np.minimum(alone, together)
        np.minimum.at(least, self._at, heights)
        return alone, together, heights, least

    def value(self, amounts: FloatArray) -> float:
        """Returns the value of a mixture, without regard for conflicts."""
        least = self._bounds(amounts)[-1]
        seen = np.where(least > _DARK, least, 0.0)
        return float(self._base.weights @ seen + amounts @ self._base.bonus)

    def multipliers(
        self, amounts: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Returns alpha [Z], beta [Z], the shares [cuts] and the charges [rows] of a mixture."""
        at, (alone, together, heights, least) = self._at, self._bounds(amounts)
        seen = least > _DARK
        least = np.where(seen, least, 1.0)
        of_alone, of_together, of_cuts = (
            np.minimum(bounds / np.maximum(values, _DARK), 1.0) ** (_SHARPNESS + 1)
            for bounds, values in ((least, alone), (least, together), (least[at], heights))
        )
        total = of_alone + of_together + np.bincount(at, of_cuts, minlength=len(least))
        total = np.where(seen, total, 1.0)
        share = of_together / total
        # The rounding of what alpha leaves would outweigh so small a beta: it has none, and alpha
        # a little more than is left.
        nearly = share < self._least_share
        alpha = np.where(seen, of_alone / total + np.where(nearly, share + 1e-12, 0.0), 1.0)
        beta = np.where(seen & ~nearly, share / (2 * np.maximum(together, _DARK)), 0.0)
        beta[self._base.returns.n_roots :] = 0.0
        charges = self._charges + self._steepness * (amounts @ self._uses - 1)
        shares = np.where(seen[at], of_cuts / total[at], 0.0)
        return alpha, beta, shares, np.maximum(charges, 0.0)

    def gradient(self, amounts: FloatArray) -> FloatArray:
        """Returns the payment for each column by the multipliers, less its charges [n]."""
        alpha, beta, shares, charges = self.multipliers(amounts)
        prices = self._base.priced(alpha, beta)
        prices += self._heights @ (self._base.weights[self._at] * shares)
        prices -= self._uses @ charges
        return prices


def _cut_heights(base: MixtureProgram, classes: IntArray, cuts: Sequence[Cut]) -> sparse.csr_array:
    """Returns by how much each column raises the heights of cuts [n, cuts]."""
    by_view_sum = base.roots.tocsc()
    values, at, ends = [np.zeros(0)], [np.zeros(0, dtype=np.int64)], [0]
    for cut in cuts:
        part = slice(*by_view_sum.indptr[cut.view_sum : cut.view_sum + 2])
        at.append(by_view_sum.indices[part].astype(np.int64))
        values.append(phi_of(cut, classes[at[-1]], by_view_sum.data[part]))
        ends.append(ends[-1] + len(at[-1]))
    shape = len(classes), len(cuts)
    return sparse.csc_array((np.concatenate(values), np.concatenate(at), ends), shape).tocsr()
