"""Envelope cuts: the concave envelope of a group's root over which robots see how much.

For one group with pixels c_i of robot i and roots s_i = sqrt(c_i), the root of the sum is the
norm |s|, convex in s. Functions phi_k of one root, one for each class k of robots, that are
linear between breakpoints 0 = s_0 < s_1 < .. < s_K and have slope 1 from the last one on make

    |s| <= constant + sum_i phi_k(i)(s_i)

valid once it holds where every s_i is a breakpoint: on each box between breakpoints the left
side is convex and the right side linear, so their difference is largest at a corner; and
beyond the last ones the norm grows by no more than phi does. `constant_of` goes through these
corners; any phi have their constant. A class without breakpoints has phi(s) = s, and adds no
corners: a norm is subadditive.

The best cut at a fractional solution is the dual of a transport problem: which corners, mixed
with which weights, have the solution's amounts as their marginals and the largest mean root?
For two robots this is the antitone coupling of the amounts (the envelope is exact there). It
is exact for any number where every robot is a class of its own, and for robots that may
exchange their amounts.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from cocap_opt.data import FloatArray, IntArray

MOST_WORK = 256  # breakpoints of all classes, each counted once per robot of its class
SEPARATION_WORK = 96  # likewise, in the cuts that are looked for
MOST_CORNERS = 20_000  # partial ones that are kept apart where a cut's constant is found
STAGE_CHOICES = 10_000  # multisets of a class that are gone through at once
TANGENTS = 16  # of the root, in bounds of what completions can have
SOME_CORNERS = 1000  # partial ones that are kept where columns are looked for
GENERATED = 200  # corners taken into its linear program at a time
MOST_ROUNDS = 50
TOLERANCE = 1e-5  # of the largest root
NEARLY = 0.05  # of what a cut can cut off, that may be left
SCENARIOS = 64  # equally likely ones in which amounts are dealt to robots
SWEEPS = 2  # of the rearrangement
LEAST_MASS = 1e-6  # a little mass everywhere keeps phi low where there is none
SOLVER_OPTIONS = {"output_flag": False, "threads": 1, "presolve": "off", "solver": "simplex"}


@dataclass(frozen=True, eq=False)
class Curve:
    """A function phi of the root of one robot, with phi(0) = 0.

    Attributes
    ----------
    roots : [K] breakpoints > 0, increasing, px^0.5/m
    values : [K] phi at them
    """

    roots: FloatArray
    values: FloatArray

    def __post_init__(self) -> None:
        """Put the breakpoint 0 in front, once."""
        object.__setattr__(self, "_at", np.append(0.0, self.roots))
        object.__setattr__(self, "_heights", np.append(0.0, self.values))

    def __call__(self, roots: FloatArray) -> FloatArray:
        """phi at any roots >= 0."""
        at: FloatArray = self._at  # type: ignore[attr-defined]
        result: FloatArray = np.interp(roots, at, self._heights)  # type: ignore[attr-defined]
        result += np.maximum(roots - at[-1], 0.0)
        return result


IDENTITY = Curve(np.zeros(0), np.zeros(0))


@dataclass(frozen=True, eq=False)
class Cut:
    """An envelope cut of a group.

    Attributes
    ----------
    curves : phi of robot classes by their numbers; that of the others is the identity
    """

    group: int
    curves: Mapping[int, Curve]
    constant: float

    def phi(self, number: int, roots: FloatArray) -> FloatArray:
        """phi of the robots of class `number` at any roots."""
        return self.curves.get(number, IDENTITY)(roots)

    def phi_of(self, classes: IntArray, roots: FloatArray) -> FloatArray:
        """phi of robots of these classes [n] at their roots [n]."""
        values = np.empty(len(roots))
        for number in np.unique(classes).tolist():
            own = classes == number
            values[own] = self.phi(number, roots[own])
        return values


class Seen:
    """What a mixture sees of one group.

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


@lru_cache(maxsize=256)
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


def constant_of(curves: Mapping[int, Curve], sizes: tuple[int, ...]) -> float:
    """Least constant that makes a cut valid, or little more; >= 0, since none may see the group.

    Parameters
    ----------
    sizes : robots of each class, by its number
    """
    return _highest(_stages(curves, sizes))


def work_of(curves: Mapping[int, Curve], sizes: tuple[int, ...]) -> int:
    """What the time that a cut's constant takes grows with."""
    return sum(sizes[number] * len(curve.roots) for number, curve in curves.items())


class _Stage(NamedTuple):
    """What some robots of a class may do."""

    pixels: FloatArray  # [M]
    values: FloatArray  # [M] sum of phi
    counts: IntArray  # [M, K] how many of them are at each breakpoint
    first: int  # position of the class's first breakpoint among those of all classes


def _stages(curves: Mapping[int, Curve], sizes: tuple[int, ...]) -> list[_Stage]:
    """Choices of the robots of each class: all at once while these are few, else one by one."""
    stages, first = list[_Stage](), 0
    for number, curve in curves.items():
        points, robots = len(curve.roots), sizes[number]
        at_once = math.comb(robots + points, points) <= STAGE_CHOICES
        counts = multisets(points, robots if at_once else 1)
        stage = _Stage(counts @ curve.roots**2, counts @ curve.values, counts, first)
        stages += [stage] * (1 if at_once else robots)
        first += points
    return stages


# Positions to keep, of pixels [n], values [n] and what completions can have at most [n], and
# the pixels and values that these are given.
_Thin = Callable[[FloatArray, FloatArray, FloatArray], tuple[IntArray, FloatArray, FloatArray]]


class _Corners:
    """Corners at which |s| - sum phi is large, stage by stage of a dynamic program.

    A partial sum of pixels z and value v = -sum phi is dropped where no completion can exceed
    what is asked for: sqrt(z) is at most any tangent theta z + 1 / (4 theta), for which the
    best completion is found stage by stage. `thin` drops more of them.

    Parameters
    ----------
    least : heights that are asked for
    thin : which to keep after each stage

    Attributes
    ----------
    heights : [n] |s| - sum phi of the corners, or more where `thin` merged some
    """

    def __init__(self, stages: Sequence[_Stage], least: float, thin: _Thin) -> None:
        self._stages = stages
        self._steps: list[tuple[IntArray, IntArray]] = []  # parent and choice of each
        top = sum(float(stage.pixels.max()) for stage in stages)
        thetas = 0.5 / np.sqrt(max(top, 1e-300) * np.geomspace(1e-4, 1.0, TANGENTS))
        gains = [(stage.pixels * thetas[:, None] - stage.values).max(axis=1) for stage in stages]
        rest = np.cumsum([np.zeros(TANGENTS), *gains[::-1]], axis=0)[::-1] + 0.25 / thetas
        pixels, values = np.zeros(1), np.zeros(1)
        for k, stage in enumerate(stages):
            z = (pixels[:, None] + stage.pixels).ravel()
            v = (values[:, None] - stage.values).ravel()
            most = np.full(len(z), np.inf)
            for theta, left in zip(thetas, rest[k + 1], strict=True):
                np.minimum(most, theta * z + v + left, out=most)
            able = np.flatnonzero(most >= least)
            which, pixels, values = thin(z[able], v[able], most[able])
            kept = able[which]
            self._steps.append((kept // len(stage.pixels), kept % len(stage.pixels)))
        self.heights = np.sqrt(pixels) + values

    def counts(self, which: IntArray) -> IntArray:
        """Counts [n, sum of K] of the robots at each breakpoint, in some of the corners."""
        points = max(stage.first + stage.counts.shape[1] for stage in self._stages)
        counts = np.zeros((len(which), points), dtype=np.int64)
        for stage, (parents, choices) in zip(
            reversed(self._stages), reversed(self._steps), strict=True
        ):
            counts[:, stage.first : stage.first + stage.counts.shape[1]] += stage.counts[
                choices[which]
            ]
            which = parents[which]
        return counts


def _highest(stages: Sequence[_Stage]) -> float:
    """The largest |s| - sum phi of all corners, or little more."""
    top = sum(float(stage.pixels.max()) for stage in stages)
    known = _ascent(stages)
    corners = _Corners(stages, known - 1e-12 * math.sqrt(top), _undominated)
    return float(corners.heights.max(initial=max(known, 0.0)))


def _undominated(
    pixels: FloatArray, values: FloatArray, most: FloatArray
) -> tuple[IntArray, FloatArray, FloatArray]:
    """Those than which no other has no less of both.

    Of very many, neighbours are merged, their pixels rounded up: heights are never too small.
    """
    # With the most pixels first, those with more value than all before.
    kept = np.lexsort((-values, -pixels))
    highest = np.maximum.accumulate(values[kept])
    kept = kept[np.append(True, highest[1:] > highest[:-1])] if len(kept) else kept
    if len(kept) <= MOST_CORNERS:
        return kept, pixels[kept], values[kept]
    # Pixels fall and values rise along these: of neighbours, both maxima.
    first = np.arange(0, len(kept), -(-len(kept) // MOST_CORNERS))
    last = np.append(first[1:], len(kept)) - 1
    return kept[last], pixels[kept[first]], values[kept[last]]


def _most_promising(
    pixels: FloatArray, values: FloatArray, most: FloatArray
) -> tuple[IntArray, FloatArray, FloatArray]:
    """Some of those whose completions can have most."""
    kept = _smallest(-most, SOME_CORNERS)
    return kept, pixels[kept], values[kept]


def _ascent(stages: Sequence[_Stage]) -> float:
    """|s| - sum phi of a corner that no stage can better alone."""
    chosen = [0] * len(stages)
    pixels, value, best = 0.0, 0.0, -math.inf
    height = 0.0
    while height > best:
        best = height
        for k, stage in enumerate(stages):
            pixels -= float(stage.pixels[chosen[k]])
            value += float(stage.values[chosen[k]])
            heights = np.sqrt(np.maximum(pixels, 0.0) + stage.pixels) - stage.values
            chosen[k] = int(np.argmax(heights))
            pixels += float(stage.pixels[chosen[k]])
            value -= float(stage.values[chosen[k]])
        height = math.sqrt(max(pixels, 0.0)) + value
    return best


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
    group: int,
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
    cut = Cut(group, curves, constant_of(curves, sizes))
    height = seen.height(cut)
    return (cut, height) if known - height > least else None


@dataclass(frozen=True)
class _Share:
    """Breakpoints of a class and how much of a robot is at each."""

    points: FloatArray
    mass: FloatArray


def _shares(seen: Seen, largest: FloatArray, sizes: tuple[int, ...]) -> dict[int, _Share]:
    """Breakpoints of the classes that see the group: the largest root and the most used ones.

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
        better = _Corners(_stages(_curves(shares, values), sizes), above, _most_promising)
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
