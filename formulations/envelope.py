"""Envelope cuts: the concave envelope of a group's root over which robots see how much.

For one group with pixels c_i of robot i and roots s_i = sqrt(c_i), the root of the sum is the
norm |s|, convex in s. A function phi of one root that is linear between breakpoints
0 = s_0 < s_1 < .. < s_K makes

    |s| <= constant + sum_i phi(s_i)

valid for all roots up to s_K once it holds where every s_i is a breakpoint: on each box
between breakpoints the left side is convex and the right side linear, so their difference is
largest at a corner. `constant_of` goes through these multisets; any phi has its constant.

The best cut at a fractional solution is the dual of a transport problem: which multisets of
breakpoints, mixed with which weights, have the solution's amounts as their marginals and the
largest mean root? For two robots this is the antitone coupling of the amounts (the envelope
is exact there); for more it is exact for robots that may exchange their amounts.
"""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from cocap_opt.problem import FloatArray, IntArray

MOST_POINTS = 64  # breakpoints of a cut
MOST_MULTISETS = 50_000  # that a cut's constant is taken over
SEPARATION_MULTISETS = 20_000  # that the separation looks at
GENERATED = 60  # multisets taken into its linear program at a time
MOST_ROUNDS = 4
TOLERANCE = 1e-5  # of the largest root
SCENARIOS = 64
LEAST_MASS = 1e-6  # a little mass everywhere keeps phi low where there is none

if TYPE_CHECKING:
    import highspy


@dataclass(frozen=True, eq=False)
class Cut:
    """An envelope cut of a group."""

    group: int
    roots: FloatArray  # [K] breakpoints, px^0.5/m
    values: FloatArray  # [K] phi
    constant: float

    def __post_init__(self) -> None:
        """Put the breakpoint 0 in front, once."""
        object.__setattr__(self, "_points", np.append(0.0, self.roots))
        object.__setattr__(self, "_heights", np.append(0.0, self.values))

    def phi(self, roots: FloatArray) -> FloatArray:
        """phi at any roots up to the last breakpoint."""
        result: FloatArray = np.interp(roots, self._points, self._heights)  # type: ignore[attr-defined]
        return result


@lru_cache(maxsize=64)
def multisets(points: int, size: int) -> IntArray:
    """Counts [M, points] of all multisets with at most `size` elements."""
    counts = np.zeros((1, 0), dtype=np.int64)
    for _ in range(points):
        left = size - counts.sum(axis=1)
        rows = np.repeat(np.arange(len(counts)), left + 1)
        ends = np.cumsum(left + 1)
        more = np.arange(len(rows)) - np.repeat(ends - left - 1, left + 1)
        counts = np.column_stack([counts[rows], more])
    counts.setflags(write=False)
    return counts


def number_of_multisets(points: int, size: int) -> int:
    """How many multisets there are."""
    total = 1
    for k in range(1, points + 1):
        total = total * (size + k) // k
    return total


def most_points(size: int, limit: int) -> int:
    """Largest number of breakpoints whose multisets stay within a limit; 0 where none does."""
    points = 0
    while points < MOST_POINTS and number_of_multisets(points + 1, size) <= limit:
        points += 1
    return points


def constant_of(roots: FloatArray, values: FloatArray, robots: int) -> float:
    """Least constant that makes a cut valid for so many robots; >= 0, since none may see it.

    Parameters
    ----------
    roots : [K] breakpoints s_1 < .. < s_K, px^0.5/m
    values : [K] phi at them; phi(0) = 0
    """
    counts = multisets(len(roots), robots)
    return float((np.sqrt(counts @ roots**2) - counts @ values).max())


def phi(roots: FloatArray, values: FloatArray, at: FloatArray) -> FloatArray:
    """phi at any roots up to the last breakpoint."""
    result: FloatArray = np.interp(at, np.append(0.0, roots), np.append(0.0, values))
    return result


def coupled(roots: FloatArray, amounts: FloatArray) -> float:
    """Mean root that one way of giving the amounts to robots has: an estimate of the best cut.

    Amounts are dealt to SCENARIOS equal scenarios, large roots first, each to those that have
    least so far; that a scenario has no more elements than there are robots is not looked at.
    """
    sums = np.zeros(SCENARIOS)
    for k in np.argsort(-roots, kind="stable").tolist():
        everywhere, some = divmod(float(amounts[k]) * SCENARIOS, SCENARIOS)
        pixels = roots[k] ** 2
        sums += everywhere * pixels
        least = np.argsort(sums, kind="stable")
        whole = int(some)
        sums[least[:whole]] += pixels
        sums[least[whole]] += pixels * (some - whole)
    return float(np.sqrt(sums).mean())


def best_cut(
    roots: FloatArray, amounts: FloatArray, largest: float, robots: int
) -> tuple[FloatArray, FloatArray, float] | None:
    """Breakpoints and values of the cut that is tightest at a mixture, and the cut's height.

    Parameters
    ----------
    roots : [n] roots > 0 that robots have in the mixture
    amounts : [n] how much of a robot has each; together at most `robots`
    largest : largest root that any robot can have

    Returns
    -------
    breakpoints, values and constant + sum of amounts phi(roots); None for too many robots.
    """
    size = most_points(robots, SEPARATION_MULTISETS)
    if size < 2:
        return None
    points = _breakpoints(roots, amounts, largest, size)
    # Amounts between two breakpoints are shared between them, as phi is.
    share = np.searchsorted(points, roots)
    low = np.where(share > 0, points[share - 1], 0.0)
    upper = (roots - low) / (points[share] - low)
    mass: FloatArray = np.bincount(share, amounts * upper, minlength=len(points)).astype(float)
    inner = share > 0
    mass += np.bincount(share[inner] - 1, (amounts * (1 - upper))[inner], minlength=len(points))
    values = _potentials(points / largest, mass, robots) * largest
    constant = constant_of(points, values, robots)
    return points, values, constant + float(amounts @ phi(points, values, roots))


def _potentials(points: FloatArray, mass: FloatArray, robots: int) -> FloatArray:
    """Dual of the transport problem, by generating its multisets.

    Wherever it is stopped, `constant_of` makes a valid cut of what it returns.
    """
    counts = multisets(len(points), robots)
    pixels = counts @ points**2
    norms = np.sqrt(pixels)
    # Means concentrate: first those whose pixels are near what the mass has on the whole.
    mean = max(float(mass @ points**2), 1e-12)
    far = (pixels + mean) / (2 * math.sqrt(mean)) - norms
    chosen = np.union1d(0, _smallest(far, GENERATED))  # with none, which is always within mass
    for _ in range(MOST_ROUNDS):
        solution = _transport(counts[chosen], norms[chosen], np.maximum(mass, LEAST_MASS))
        if solution is None:  # not to be expected; phi = 0 is valid and cuts nothing off
            return np.zeros(len(points))
        values, total = solution
        gain = norms - counts @ values - total
        better = np.flatnonzero(gain > TOLERANCE)
        if not len(better):
            break
        chosen = np.union1d(chosen, better[_smallest(-gain[better], GENERATED)])
    return np.minimum.accumulate(values[::-1])[::-1]


def _smallest(values: FloatArray, count: int) -> IntArray:
    """Positions of the smallest values, in order."""
    some = np.arange(len(values))
    if len(values) > count:
        some = np.argpartition(values, count)[:count]
    return np.sort(some)


def _transport(
    counts: IntArray, norms: FloatArray, mass: FloatArray
) -> tuple[FloatArray, float] | None:
    """Multipliers of max norms x, counts.T x <= mass, sum x = 1, x >= 0: of mass and of the sum.

    Less than the mass may be used, which is no loss since the norm grows: then phi >= 0.
    """
    import highspy  # a quarter of a second, which not every bound needs

    columns, points = counts.shape
    lp = highspy.HighsLp()
    lp.num_col_, lp.num_row_ = columns, points + 1
    lp.col_cost_ = -norms
    lp.col_lower_ = np.zeros(columns)
    lp.col_upper_ = np.full(columns, highspy.kHighsInf)
    lp.row_lower_ = np.append(np.full(points, -highspy.kHighsInf), 1.0)
    lp.row_upper_ = np.append(mass, 1.0)
    lp.a_matrix_.format_ = highspy.MatrixFormat.kColwise
    lp.a_matrix_.start_ = np.arange(0, (points + 1) * columns + 1, points + 1)
    lp.a_matrix_.index_ = np.tile(np.arange(points + 1), columns)
    lp.a_matrix_.value_ = np.column_stack([counts, np.ones(columns)]).ravel()
    solver = _solver()
    solver.passModel(lp)
    solver.run()
    if solver.getModelStatus() != highspy.HighsModelStatus.kOptimal:
        return None
    multipliers = -np.array(solver.getSolution().row_dual)
    return np.maximum(multipliers[:-1], 0.0), float(multipliers[-1])


@lru_cache(maxsize=1)
def _solver() -> "highspy.Highs":
    import highspy

    solver = highspy.Highs()
    for option, value in (
        ("output_flag", False), ("threads", 1), ("presolve", "off"), ("solver", "simplex"),
    ):  # fmt: skip
        solver.setOptionValue(option, value)
    return solver


def _breakpoints(roots: FloatArray, amounts: FloatArray, largest: float, size: int) -> FloatArray:
    """At most `size` breakpoints: the largest root and the most used ones."""
    # Roots that differ by less than a millionth of the largest are one breakpoint.
    shares = np.minimum(np.round(roots / largest, 6), 1.0)
    points, which = np.unique(shares * largest, return_inverse=True)
    mass = np.bincount(which, amounts)
    top = largest * (1 + 1e-9)
    keep = points < top * (1 - 1e-3)
    points, mass = points[keep], mass[keep]
    while len(points) > size - 1:
        # The two closest become their mean.
        k = int(np.argmin(np.diff(points) * np.minimum(mass[1:], mass[:-1])))
        both = mass[k] + mass[k + 1]
        points[k] = (points[k] * mass[k] + points[k + 1] * mass[k + 1]) / both
        mass[k] = both
        points, mass = np.delete(points, k + 1), np.delete(mass, k + 1)
    return np.append(points[points > 1e-3 * top], top)
