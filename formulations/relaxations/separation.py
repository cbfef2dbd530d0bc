"""Separation of envelope cuts: the cut that a fractional solution violates most.

The best cut at a fractional solution is the dual of a transport problem: which corners, mixed
with which weights, have the solution's amounts as their marginals and the largest mean root?
For two robots this is the antitone coupling of the amounts (the envelope is exact there). It
is exact for any number where every robot is a class of its own, and for robots that may
exchange their amounts.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from cocap_opt.data import FloatArray, IntArray
from cocap_opt.formulations.certificates.envelope import Corners, Curve, Cut, constant_of, stages_of

SEPARATION_WORK = 96  # likewise, in the cuts that are looked for
SOME_CORNERS = 1000  # partial ones that are kept where columns are looked for
GENERATED = 200  # corners taken into its linear program at a time
MOST_ROUNDS = 50
TOLERANCE = 1e-5  # of the largest root
NEARLY = 0.05  # of what a cut can cut off, that may be left
SCENARIOS = 64  # equally likely ones in which amounts are dealt to robots
SWEEPS = 2  # of the rearrangement
LEAST_MASS = 1e-6  # a little mass everywhere keeps phi low where there is none
SOLVER_OPTIONS = {"output_flag": False, "threads": 1, "presolve": "off", "solver": "simplex"}


class Seen:
    """What a mixture sees of one view sum.

    Attributes
    ----------
    classes : [n] number of the class, of each entry
    roots : [n] root > 0 that a robot of it has, px^0.5/m
    amounts : [n] how much of a robot has it
    """

    def __init__(self, classes: IntArray, roots: FloatArray, amounts: FloatArray) -> None:
        self.classes, self.roots, self.amounts = classes, roots, amounts

    def height(self, cut: Cut) -> float:
        """Right side of a cut at the mixture."""
        return cut.constant + float(self.amounts @ cut.phi_of(self.classes, self.roots))

    def is_exact(self, sizes: tuple[int, ...]) -> bool:
        """Whether there is nothing to cut: one robot's views, or whole ones, all equally good.

        Parameters
        ----------
        sizes : robots of each class
        """
        first = int(self.classes[0])
        if sizes[first] == 1 and (self.classes == first).all():
            return True
        alike = self.roots.max() - self.roots.min() < 1e-9 * self.roots.max()
        total = float(self.amounts.sum())
        return bool(alike) and abs(total - round(total)) < 1e-6


def _most_promising(
    pixels: FloatArray, values: FloatArray, most: FloatArray
) -> tuple[IntArray, FloatArray, FloatArray]:
    """Some of those whose completions can have most."""
    kept = _smallest(-most, SOME_CORNERS)
    return kept, pixels[kept], values[kept]


def coupled(seen: Seen, sizes: tuple[int, ...]) -> float:
    """Mean root of one way of giving the amounts to robots: no cut is lower at the mixture.

    The amounts of each class are laid out in SCENARIOS equal scenarios per robot, and the
    robots' scenarios are rearranged. What falls into one scenario counts with its mean root,
    which makes the norm no larger, since it is convex.
    """
    rows = []
    for number in np.unique(seen.classes).tolist():
        own = np.flatnonzero(seen.classes == number)
        own = own[np.argsort(-seen.roots[own], kind="stable")]
        ends = np.append(0.0, np.cumsum(seen.amounts[own]) * SCENARIOS)
        roots = np.append(0.0, np.cumsum(np.diff(ends) * seen.roots[own]))
        robots = min(math.ceil(ends[-1] / SCENARIOS - 1e-6), sizes[number])
        dealt = np.interp(np.arange(robots * SCENARIOS + 1), ends, roots)
        rows.append(np.diff(dealt).reshape(robots, SCENARIOS) ** 2)
    pixels = np.concatenate(rows)
    together = np.take_along_axis(pixels, _rearranged(pixels), axis=1).sum(axis=0)
    return float(np.sqrt(together).mean())


def _rearranged(pixels: FloatArray) -> IntArray:
    """Order of each robot's scenarios [R, SCENARIOS] for which the mean root is large.

    Each robot in turn has its largest pixels where the others have least: the rearrangement
    algorithm (Puccetti and Rueschendorf 2012).

    Parameters
    ----------
    pixels : [R, SCENARIOS] in falling order
    """
    orders = np.tile(np.arange(pixels.shape[1]), (len(pixels), 1))
    total = np.zeros(pixels.shape[1])
    placed = np.zeros_like(pixels)
    for _ in range(SWEEPS):
        for order, own, at in zip(orders, pixels, placed, strict=True):
            total -= at
            rising = np.argsort(total, kind="stable")
            order[rising] = np.arange(len(order))
            at[rising] = own
            total += at
    return orders


def best_cut(
    view_sum: int,
    seen: Seen,
    largest: FloatArray,
    sizes: tuple[int, ...],
    known: float = math.inf,
    least: float = 0.0,
) -> tuple[Cut, float] | None:
    """The cut that is tightest at a mixture, or nearly so, and its height there.

    Parameters
    ----------
    largest : [C] largest root that a robot of each class can have
    sizes : robots of each class
    known : height at the mixture of what is known already; the cut is within NEARLY of the
        way from there to the tightest one
    least : by how much the cut must be below that; None is returned where none is
    """
    shares = _shares(seen, largest, sizes)
    values = _potentials(shares, sizes, known, least)
    if values is None:
        return None
    curves = {
        number: Curve(curve.roots, np.minimum.accumulate(curve.values[::-1])[::-1])
        for number, curve in _curves(shares, values).items()
    }
    cut = Cut(view_sum, curves, constant_of(curves, sizes))
    height = seen.height(cut)
    return (cut, height) if known - height > least else None


@dataclass(frozen=True)
class _Share:
    """Breakpoints of a class and how much of a robot is at each."""

    points: FloatArray
    mass: FloatArray


def _shares(seen: Seen, largest: FloatArray, sizes: tuple[int, ...]) -> dict[int, _Share]:
    """Breakpoints of the classes that see the view sum: the largest root and the most used ones.

    Where these are too many, the closest are merged; at last the classes that see least get
    none.
    """
    found: dict[int, _Share] = {}
    weight: dict[int, float] = {}
    for number in np.unique(seen.classes).tolist():
        own = seen.classes == number
        weight[number] = float(seen.amounts[own] @ seen.roots[own])
        found[number] = _points(seen.roots[own], seen.amounts[own], float(largest[number]))
    while sum(sizes[k] * len(share.points) for k, share in found.items()) > SEPARATION_WORK:
        losses = {number: _least_loss(share) for number, share in found.items()}
        number, (loss, at) = min(losses.items(), key=lambda item: item[1])
        if loss < math.inf:
            found[number] = _merged(found[number], at)
        else:
            del found[min(found, key=lambda k: weight[k])]
    return {
        number: _Share(share.points, _spread(share.points, seen, number))
        for number, share in found.items()
    }


def _points(roots: FloatArray, amounts: FloatArray, largest: float) -> _Share:
    """Distinct roots, and the largest possible, with what is used of each."""
    # Roots that differ by less than a millionth of the largest are one breakpoint.
    rounded = np.minimum(np.round(roots / largest, 6), 1.0)
    points, which = np.unique(rounded * largest, return_inverse=True)
    mass = np.bincount(which, amounts)
    top = largest * (1 + 1e-9)
    keep = (points < top * (1 - 1e-3)) & (points > 1e-3 * top)
    rest = float(mass[points >= top * (1 - 1e-3)].sum())
    return _Share(np.append(points[keep], top), np.append(mass[keep], rest))


def _least_loss(share: _Share) -> tuple[float, int]:
    """What merging the two closest breakpoints loses, and the first of them; never the last."""
    if len(share.points) < 3:
        return math.inf, -1
    losses = np.diff(share.points[:-1]) * np.minimum(share.mass[1:-1], share.mass[:-2])
    at = int(np.argmin(losses))
    return float(losses[at]), at


def _merged(share: _Share, at: int) -> _Share:
    """Two breakpoints as one, at their mean."""
    points, mass = share.points.copy(), share.mass.copy()
    both = mass[at] + mass[at + 1]
    points[at] = (points[at] * mass[at] + points[at + 1] * mass[at + 1]) / both
    mass[at] = both
    return _Share(np.delete(points, at + 1), np.delete(mass, at + 1))


def _spread(points: FloatArray, seen: Seen, number: int) -> FloatArray:
    """Amounts of a class at breakpoints; those between two are shared, as phi is linear."""
    own = seen.classes == number
    roots, amounts = np.minimum(seen.roots[own], points[-1]), seen.amounts[own]
    share = np.searchsorted(points, roots)
    low = np.where(share > 0, points[share - 1], 0.0)
    upper = (roots - low) / (points[share] - low)
    mass: FloatArray = np.bincount(share, amounts * upper, minlength=len(points)).astype(float)
    inner = share > 0
    mass += np.bincount(share[inner] - 1, (amounts * (1 - upper))[inner], minlength=len(points))
    return mass


def _potentials(
    shares: Mapping[int, _Share], sizes: tuple[int, ...], known: float, least: float
) -> FloatArray | None:
    """Dual of the transport problem, by generating its corners; None if it gets too high.

    Wherever it is stopped, `constant_of` makes a valid cut of what it returns.
    """
    points = np.concatenate([share.points for share in shares.values()])
    mass = np.maximum(np.concatenate([share.mass for share in shares.values()]), LEAST_MASS)
    unit = float(points.max())
    counts = np.unique(_first_corners(shares, sizes), axis=0)
    values = np.zeros(len(points))
    program = _Transport(mass)
    for _ in range(MOST_ROUNDS):
        solution = program.solve(counts, np.sqrt(counts @ points**2) / unit)
        if solution is None:  # not to be expected; any phi is valid
            break
        values, total = solution[0] * unit, solution[1] * unit
        height = total + float(mass @ values)
        if known - height < least:
            return None
        enough = NEARLY * (known - height) if known < math.inf else 0.0
        above = total + max(enough, TOLERANCE * unit)
        better = Corners(stages_of(_curves(shares, values), sizes), above, _most_promising)
        found = np.flatnonzero(better.heights > above)
        if not len(found):
            break
        counts = better.counts(found[_smallest(-better.heights[found], GENERATED)])
    return values


def _curves(shares: Mapping[int, _Share], values: FloatArray) -> dict[int, Curve]:
    """Curves with these values at the breakpoints of all classes."""
    ends = np.cumsum([len(share.points) for share in shares.values()])[:-1]
    return {
        number: Curve(share.points, own)
        for (number, share), own in zip(shares.items(), np.split(values, ends), strict=True)
    }


def _first_corners(shares: Mapping[int, _Share], sizes: tuple[int, ...]) -> IntArray:
    """Corners [n, K] that a good mixture is likely to be made of, and that of none."""
    rows, first = [], 0
    for number, share in shares.items():
        ends = np.rint(np.cumsum(share.mass[::-1]) * SCENARIOS).astype(np.int64)
        robots = min(math.ceil(ends[-1] / SCENARIOS), sizes[number])
        which = np.searchsorted(ends, np.arange(robots * SCENARIOS), side="right")
        last = first + len(share.points)
        rows.append(np.where(which < len(ends), last - 1 - which, -1).reshape(-1, SCENARIOS))
        first = last
    entries = np.concatenate(rows)
    points = np.append(np.concatenate([share.points for share in shares.values()]), 0.0)
    dealt = np.take_along_axis(entries, _rearranged(points[entries] ** 2), axis=1)
    counts = np.zeros((SCENARIOS + 1, len(points)), dtype=np.int64)  # the last has none
    np.add.at(counts, (np.arange(SCENARIOS)[None, :], dealt), 1)
    return counts[:, :-1]


def _smallest(values: FloatArray, count: int) -> IntArray:
    """Positions of the smallest values, in order."""
    some = np.arange(len(values))
    if len(values) > count:
        some = np.argpartition(values, count)[:count]
    return np.sort(some)


class _Transport:
    """max norms x, counts.T x <= mass, sum x = 1, x >= 0, whose columns come one after the other.

    Less than the mass may be used, which is no loss since the norm grows: then phi >= 0.
    """

    def __init__(self, mass: FloatArray) -> None:
        import highspy  # a quarter of a second, which not every bound needs

        self._solver, self._optimal = highspy.Highs(), highspy.HighsModelStatus.kOptimal
        for option, value in SOLVER_OPTIONS.items():
            self._solver.setOptionValue(option, value)
        none, rows = np.zeros(0, dtype=np.int32), len(mass) + 1
        lower = np.append(np.full(len(mass), -highspy.kHighsInf), 1.0)
        self._solver.addRows(
            rows, lower, np.append(mass, 1.0), 0, np.zeros(rows, dtype=np.int32), none, np.zeros(0)
        )

    def solve(self, counts: IntArray, norms: FloatArray) -> tuple[FloatArray, float] | None:
        """Multipliers of the mass and of the sum, with more columns."""
        columns, rows = counts.shape[0], counts.shape[1] + 1
        self._solver.addCols(
            columns, -norms, np.zeros(columns), np.full(columns, np.inf), columns * rows,
            np.arange(0, rows * columns, rows, dtype=np.int32),
            np.tile(np.arange(rows, dtype=np.int32), columns),
            np.column_stack([counts, np.ones(columns)]).ravel(),
        )  # fmt: skip
        self._solver.run()
        if self._solver.getModelStatus() != self._optimal:
            return None
        multipliers = -np.array(self._solver.getSolution().row_dual)
        return np.maximum(multipliers[:-1], 0.0), float(multipliers[-1])
