"""Separates envelope cuts: finds the cut that a fractional solution violates most.

The best cut at a fractional solution is the dual of a transport problem: find the mixture of
corners that has the solution's amounts as its marginals and the largest mean root. For two robots
this is the antitone coupling of the amounts, for which the envelope is exact. The cut is exact for
any number of robots if every robot forms its own class, and also for robots that may exchange their
amounts.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from cocap_opt.data import FloatArray, IntArray
from cocap_opt.formulations.certificates.envelope import Corners, Curve, Cut, Partial
from cocap_opt.formulations.certificates.format import MOST_WORK
from cocap_opt.formulations.certificates.state_cuts import AnyCut
from cocap_opt.formulations.solvers import ending, options
from cocap_opt.result import Reason
from cocap_opt.stop import Stop

# Rows of the transport problem, for all classes together. For robots that each form a class, more
# rows take sixteen times as long and cut off an eighth more (scene `large` of Greedy Perspectives).
MOST_BREAKPOINTS = 20
# Choices of the robots of all classes with several robots, whose corners then fit into one or two
# transport problems. Scene `field`, seed 1: the same bound as without, in a fifth of the time.
MOST_CHOICES = 1000
MOST_CORNERS = 1000  # partial corners that are kept while columns are generated
GENERATED = 200  # corners added to the transport problem at a time
MOST_ROUNDS = 50
TOLERANCE = 1e-5  # relative to the largest root
NEARLY = 0.05  # share of the possible reduction that a cut may miss
SCENARIOS = 64  # equally likely scenarios in which amounts are assigned to robots
SWEEPS = 2  # sweeps of the rearrangement
LEAST_MASS = 1e-6  # a little mass at every breakpoint keeps phi low where there is none


def phi_of(cut: AnyCut, classes: IntArray, states: IntArray, roots: FloatArray) -> FloatArray:
    """Returns a cut's phi for robots of the given classes [n] in states [n] with roots [n]."""
    values = np.empty(len(roots))
    for number in np.unique(classes).tolist():
        of_class = classes == number
        values[of_class] = cut.phi(number, states[of_class], roots[of_class])
    return values


class Seen:
    """The roots of one view sum in a mixture of paths.

    Attributes
    ----------
    classes : [n] number of the class of each entry
    roots : [n] root > 0 of a robot of that class, px^0.5/m
    amounts : [n] the fraction of a robot that has this root
    states : [n] state of that robot at the view sum's step, which only state cuts need; 0 if they
        are not known
    """

    def __init__(
        self,
        classes: IntArray,
        roots: FloatArray,
        amounts: FloatArray,
        states: IntArray | None = None,
    ) -> None:
        self.classes, self.roots, self.amounts = classes, roots, amounts
        self.states = np.zeros_like(classes) if states is None else states

    def height(self, cut: AnyCut) -> float:
        """Returns the right-hand side of a cut at the mixture."""
        values = phi_of(cut, self.classes, self.states, self.roots)
        return cut.constant + float(self.amounts @ values)

    def known_height(self, cuts: Iterable[AnyCut]) -> float:
        """Returns the lowest bound on the mean root: by the roots, the pixels, or known cuts."""
        together = float(np.sqrt(self.amounts @ self.roots**2))
        alone = float(self.amounts @ self.roots)
        return min(together, alone, *map(self.height, cuts))

    def is_exact(self, sizes: tuple[int, ...]) -> bool:
        """Returns True if nothing can be cut off: the views of one robot, or integral and equal
        views.

        Parameters
        ----------
        sizes : number of robots of each class
        """
        first = int(self.classes[0])
        if sizes[first] == 1 and (self.classes == first).all():
            return True
        alike = self.roots.max() - self.roots.min() < 1e-9 * self.roots.max()
        total = float(self.amounts.sum())
        return bool(alike) and abs(total - round(total)) < 1e-6

    def coupled(self, sizes: tuple[int, ...]) -> float:
        """Returns the mean root of one coupling of the amounts, which bounds all cuts at the
        mixture from below.

        The amounts of each class are laid out in SCENARIOS equal scenarios per robot, and the
        robots' scenarios are rearranged. Amounts in one scenario count with their mean root, which
        makes the norm no larger, since it is convex.
        """
        rows = []
        for number in np.unique(self.classes).tolist():
            entries = np.flatnonzero(self.classes == number)
            entries = entries[np.argsort(-self.roots[entries], kind="stable")]
            ends = np.append(0.0, np.cumsum(self.amounts[entries]) * SCENARIOS)
            roots = np.append(0.0, np.cumsum(np.diff(ends) * self.roots[entries]))
            robots = min(math.ceil(ends[-1] / SCENARIOS - 1e-6), sizes[number])
            dealt = np.interp(np.arange(robots * SCENARIOS + 1), ends, roots)
            rows.append(np.diff(dealt).reshape(robots, SCENARIOS) ** 2)
        pixels = np.concatenate(rows)
        together = np.take_along_axis(pixels, _rearranged(pixels), axis=1).sum(axis=0)
        return float(np.sqrt(together).mean())

    def best_cut(
        self,
        view_sum: int,
        largest: FloatArray,
        sizes: tuple[int, ...],
        known: float = math.inf,
        least: float = 0.0,
    ) -> Cut | None:
        """Returns the cut that is tightest, or nearly tightest, at the mixture.

        Parameters
        ----------
        view_sum : number of the view sum
        largest : [C] largest root that a robot of each class can have
        sizes : number of robots of each class
        known : height of the known cuts at the mixture; the returned cut misses at most the share
            NEARLY of the reduction by the tightest cut
        least : amount by which the cut must be below `known`; if there is no such cut, None is
            returned
        """
        marginals = _marginals(self, largest, sizes)
        if not marginals:  # the classes are too large for any breakpoints
            return None
        potentials = _potentials(marginals, sizes, known, least)
        if potentials is None:
            return None
        # The norm grows with each root, so phi never needs to be above its later values.
        curves = {
            number: Curve(curve.roots, np.minimum.accumulate(curve.values[::-1])[::-1])
            for number, curve in _curves(marginals, potentials).items()
        }
        cut = Cut.valid(view_sum, curves, sizes)
        return cut if known - self.height(cut) > least else None


class LooseViewSum(NamedTuple):
    """A view sum in which a cut can cut off a mixture."""

    most: float  # largest possible reduction, px^0.5/m
    least: float  # smallest reduction that is of use, px^0.5/m
    view_sum: int
    seen: Seen
    height: float  # height of the known cuts at the mixture


def loose_view_sums(
    seen: Iterable[tuple[int, Seen]],
    cuts: Sequence[AnyCut],
    weights: FloatArray,
    sizes: tuple[int, ...],
    least: float,
    stop: Stop,
) -> list[LooseViewSum]:
    """Returns the view sums with enough to cut off, largest first; raises LimitReached.

    Parameters
    ----------
    seen : view sums, each with the roots that a mixture has of it
    cuts : the known cuts
    weights : [Z] weights of the view sums in J
    sizes : number of robots of each class
    least : smallest amount that a cut must cut off, in units of J
    """
    known: dict[int, list[AnyCut]] = {}
    for cut in cuts:
        known.setdefault(cut.view_sum, []).append(cut)
    found = []
    for view_sum, mixture in seen:
        stop.check()
        if not weights[view_sum] or mixture.is_exact(sizes):
            continue
        height = mixture.known_height(known.get(view_sum, []))
        most, enough = height - mixture.coupled(sizes), least / float(weights[view_sum])
        if most >= enough:
            found.append(LooseViewSum(most, enough, view_sum, mixture, height))
    return sorted(found, key=lambda loose: (-loose.most * weights[loose.view_sum], loose.view_sum))


# Breakpoints of a class [K] in px^0.5/m, and the amount of a robot at each [K].
_Marginal = tuple[FloatArray, FloatArray]


def _marginals(seen: Seen, largest: FloatArray, sizes: tuple[int, ...]) -> dict[int, _Marginal]:
    """Returns the breakpoints of the classes that see the view sum, with their masses.

    The breakpoints are the largest root and the most used ones. If there are too many, the closest
    are merged; in the end, the classes that see least get none.
    """
    found: dict[int, _Marginal] = {}
    weight: dict[int, float] = {}
    for number in np.unique(seen.classes).tolist():
        of_class = seen.classes == number
        weight[number] = float(seen.amounts[of_class] @ seen.roots[of_class])
        found[number] = _distinct(
            seen.roots[of_class], seen.amounts[of_class], float(largest[number])
        )
    while _are_too_many(found, sizes):
        merges = {number: _cheapest_merge(marginal) for number, marginal in found.items()}
        number, (loss, at) = min(merges.items(), key=lambda item: item[1])
        if loss < math.inf:
            found[number] = _merged(found[number], at)
        else:
            del found[min(found, key=lambda k: weight[k])]
    for number, (points, _) in found.items():
        of_class = seen.classes == number
        mass = amounts_at(points, seen.roots[of_class], seen.amounts[of_class])
        found[number] = points, mass
    return found


def _are_too_many(marginals: Mapping[int, _Marginal], sizes: tuple[int, ...]) -> bool:
    """Returns True if breakpoints must be merged."""
    points = {number: len(at) for number, (at, _) in marginals.items()}
    choices = math.prod(math.comb(sizes[k] + n, n) for k, n in points.items() if sizes[k] > 1)
    work = sum(sizes[k] * n for k, n in points.items())
    return choices > MOST_CHOICES or sum(points.values()) > MOST_BREAKPOINTS or work > MOST_WORK


def _distinct(roots: FloatArray, amounts: FloatArray, largest: float) -> _Marginal:
    """Returns the distinct roots, with the largest possible one, and the amount of each."""
    # Roots that differ by less than a millionth of the largest are one breakpoint.
    rounded = np.minimum(np.round(roots / largest, 6), 1.0)
    points, which = np.unique(rounded * largest, return_inverse=True)
    mass = np.bincount(which, amounts)
    top = largest * (1 + 1e-9)
    keep = (points < top * (1 - 1e-3)) & (points > 1e-3 * top)
    rest = float(mass[points >= top * (1 - 1e-3)].sum())
    return np.append(points[keep], top), np.append(mass[keep], rest)


def _cheapest_merge(marginal: _Marginal) -> tuple[float, int]:
    """Returns the smallest loss by merging a breakpoint with the next one, and its position.

    The last breakpoint is never merged.
    """
    points, mass = marginal
    if len(points) < 3:
        return math.inf, -1
    losses = np.diff(points[:-1]) * np.minimum(mass[1:-1], mass[:-2])
    at = int(np.argmin(losses))
    return float(losses[at]), at


def _merged(marginal: _Marginal, at: int) -> _Marginal:
    """Returns a marginal with two breakpoints merged into one at their mean."""
    points, mass = (part.copy() for part in marginal)
    both = mass[at] + mass[at + 1]
    points[at] = (points[at] * mass[at] + points[at + 1] * mass[at + 1]) / both
    mass[at] = both
    return np.delete(points, at + 1), np.delete(mass, at + 1)


def amounts_at(points: FloatArray, roots: FloatArray, amounts: FloatArray) -> FloatArray:
    """Returns the amounts of robots at breakpoints [K].

    An amount between two breakpoints, of which 0 is one, too, is shared between them, as phi is
    linear there.

    Parameters
    ----------
    points : [K] breakpoints > 0, increasing
    roots, amounts : [n] roots, and the amount of each; those above the last breakpoint count as it
    """
    roots, ends = np.minimum(roots, points[-1]), np.append(0.0, points)
    after = np.searchsorted(points, roots)
    upper = (roots - ends[after]) / (ends[after + 1] - ends[after])
    mass = np.zeros(len(ends))
    mass += np.bincount(after + 1, amounts * upper, minlength=len(ends))
    mass += np.bincount(after, amounts * (1 - upper), minlength=len(ends))
    return mass[1:]


def _potentials(
    marginals: Mapping[int, _Marginal], sizes: tuple[int, ...], known: float, least: float
) -> FloatArray | None:
    """Solves the dual of the transport problem, generating corners as they are needed.

    Returns phi at the breakpoints of all classes, or None if the cut is too high. If the search
    stops early, `Cut.valid` still makes a valid cut from its result.
    """
    points, mass = (np.concatenate(part) for part in zip(*marginals.values(), strict=True))
    mass = np.maximum(mass, LEAST_MASS)
    unit = float(points.max())
    counts = np.unique(_first_corners(marginals, sizes), axis=0)
    values = np.zeros(len(points))
    program = Transport(mass)
    for _ in range(MOST_ROUNDS):
        prices = program.solve(counts, np.sqrt(counts @ points**2) / unit)
        if prices is None:  # not expected; any phi is valid
            break
        values, total = prices[0] * unit, prices[1] * unit
        height = total + float(mass @ values)
        if known - height < least:
            return None
        enough = NEARLY * (known - height) if known < math.inf else 0.0
        above = total + max(enough, TOLERANCE * unit)
        corners = Corners(_curves(marginals, values), sizes)
        heights, steps = corners.above(above, _most_promising)
        found = np.flatnonzero(heights > above)
        if not len(found):
            break
        counts = corners.counts(steps, found[_smallest(-heights[found], GENERATED)])
    return values


def _curves(marginals: Mapping[int, _Marginal], values: FloatArray) -> dict[int, Curve]:
    """Returns the curves with the given values at the breakpoints of all classes."""
    ends = np.cumsum([len(points) for points, _ in marginals.values()])[:-1]
    parts = zip(marginals.items(), np.split(values, ends), strict=True)
    return {number: Curve(points, heights) for (number, (points, _)), heights in parts}


def _first_corners(marginals: Mapping[int, _Marginal], sizes: tuple[int, ...]) -> IntArray:
    """Returns corners [n, K] that a good mixture is likely to contain, including the empty one."""
    rows, first = [], 0
    for number, (at, mass) in marginals.items():
        ends = np.rint(np.cumsum(mass[::-1]) * SCENARIOS).astype(np.int64)
        robots = min(math.ceil(ends[-1] / SCENARIOS), sizes[number])
        which = np.searchsorted(ends, np.arange(robots * SCENARIOS), side="right")
        last = first + len(at)
        rows.append(np.where(which < len(ends), last - 1 - which, -1).reshape(-1, SCENARIOS))
        first = last
    entries = np.concatenate(rows)
    points = np.append(np.concatenate([at for at, _ in marginals.values()]), 0.0)
    dealt = np.take_along_axis(entries, _rearranged(points[entries] ** 2), axis=1)
    counts = np.zeros((SCENARIOS + 1, len(points)), dtype=np.int64)  # the last one stays empty
    np.add.at(counts, (np.arange(SCENARIOS)[None, :], dealt), 1)
    return counts[:, :-1]


def _rearranged(pixels: FloatArray) -> IntArray:
    """Returns an order of each robot's scenarios [R, SCENARIOS] for which the mean root is large.

    Each robot in turn gets its largest pixels where the others have the fewest: the rearrangement
    algorithm (Puccetti and Rueschendorf 2012).

    Parameters
    ----------
    pixels : [R, SCENARIOS] in descending order
    """
    orders = np.tile(np.arange(pixels.shape[1]), (len(pixels), 1))
    total = np.zeros(pixels.shape[1])
    placed = np.zeros_like(pixels)
    for _ in range(SWEEPS):
        for order, falling, at in zip(orders, pixels, placed, strict=True):
            total -= at
            rising = np.argsort(total, kind="stable")
            order[rising] = np.arange(len(order))
            at[rising] = falling
            total += at
    return orders


def _most_promising(partial: Partial) -> tuple[IntArray, Partial]:
    """Keeps the partial corners whose completions can be highest."""
    kept = _smallest(-partial.most, MOST_CORNERS)
    return kept, partial.take(kept)


def _smallest(values: FloatArray, count: int) -> IntArray:
    """Returns the positions of the smallest values, in ascending order."""
    positions = np.arange(len(values))
    if len(values) > count:
        positions = np.argpartition(values, count)[:count]
    return np.sort(positions)


class Transport:
    """Solves max norms x, counts.T x <= mass, sum x = 1, x >= 0, with columns added one by one.

    Less than the mass may be used, which makes no difference since the norm grows: then phi >= 0.
    """

    def __init__(self, mass: FloatArray) -> None:
        import highspy  # takes a quarter of a second, and not every bound needs it

        self._solver = highspy.Highs()
        for option, value in options("simplex").items():
            self._solver.setOptionValue(option, value)
        none, rows = np.zeros(0, dtype=np.int32), len(mass) + 1
        lower = np.append(np.full(len(mass), -highspy.kHighsInf), 1.0)
        self._solver.addRows(
            rows, lower, np.append(mass, 1.0), 0, np.zeros(rows, dtype=np.int32), none, np.zeros(0)
        )

    def solve(self, counts: IntArray, norms: FloatArray) -> tuple[FloatArray, float] | None:
        """Solves with more columns; returns None if the solver fails.

        Returns
        -------
        The multipliers of the mass [K] >= 0, and the multiplier of the total.
        """
        columns, rows = counts.shape[0], counts.shape[1] + 1
        self._solver.addCols(
            columns, -norms, np.zeros(columns), np.full(columns, np.inf), columns * rows,
            np.arange(0, rows * columns, rows, dtype=np.int32),
            np.tile(np.arange(rows, dtype=np.int32), columns),
            np.column_stack([counts, np.ones(columns)]).ravel(),
        )  # fmt: skip
        self._solver.run()
        if ending("simplex", self._solver.getModelStatus().name) is not Reason.OPTIMAL:
            return None
        multipliers = -np.array(self._solver.getSolution().row_dual)
        return np.maximum(multipliers[:-1], 0.0), float(multipliers[-1])
