"""Envelope cuts: concave bounds on the root of a view sum, given the pixels that each robot sees.

For one view sum with pixels c_i of robot i and roots s_i = sqrt(c_i), the root of the sum is the
norm |s|, convex in s. Take a function phi_k of one root for each class k of robots, linear between
breakpoints 0 = s_0 < s_1 < .. < s_K and of slope 1 beyond the last one. Then

    |s| <= constant + sum_i phi_k(i)(s_i)

is valid if it holds wherever every s_i is a breakpoint: on each box between breakpoints the left
side is convex and the right side linear, so that their difference is largest at a corner; and
beyond the last breakpoints the norm grows by no more than phi does. `Cut.valid` enumerates these
corners and finds a constant for any phi. A class without breakpoints has phi(s) = s, and adds no
corners, since a norm is subadditive.
"""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from cocap_opt.data import FloatArray, IntArray
from cocap_opt.stop import Stop, never

MOST_CORNERS = 20_000  # partial corners that are kept separately while a cut's constant is computed
STAGE_CHOICES = 1000  # multisets of breakpoints, of all classes, that are enumerated at once
_BLOCK = 4096  # partial corners whose completions are bounded at once
# Pixels, as shares of the largest number, at which tangents of the root bound completions.
_TANGENTS = np.geomspace(1e-4, 1.0, 16)


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

    @cached_property
    def _with_zero(self) -> tuple[FloatArray, FloatArray]:
        """The breakpoints [K+1] and phi at them, preceded by the breakpoint 0."""
        return np.append(0.0, self.roots), np.append(0.0, self.values)

    def __call__(self, roots: FloatArray) -> FloatArray:
        """Returns phi at any roots >= 0."""
        at, heights = self._with_zero
        result: FloatArray = np.interp(roots, at, heights)
        result += np.maximum(roots - at[-1], 0.0)
        return result


_IDENTITY = Curve(np.zeros(0), np.zeros(0))


@dataclass(frozen=True, eq=False)
class Cut:
    """An envelope cut of a view sum.

    Attributes
    ----------
    curves : phi by number of the robot class; phi of all other classes is the identity
    """

    view_sum: int
    curves: Mapping[int, Curve]
    constant: float

    @classmethod
    def valid(cls, view_sum: int, curves: Mapping[int, Curve], sizes: tuple[int, ...]) -> "Cut":
        """Returns the cut with the smallest constant that makes it valid, or slightly more.

        The constant is >= 0, since possibly no robot sees the view sum.

        Parameters
        ----------
        sizes : number of robots of each class
        """
        return cls(view_sum, curves, Corners(curves, sizes).highest())

    def phi(self, number: int, states: IntArray, roots: FloatArray) -> FloatArray:
        """Returns phi of robots of class `number` at any roots [n]; their states [n] do not
        matter.
        """
        return self.curves.get(number, _IDENTITY)(roots)


class Partial(NamedTuple):
    """Partial corners, with the robots of some stages at breakpoints and all others at 0."""

    pixels: FloatArray  # [n]
    values: FloatArray  # [n] -sum of phi
    placed: IntArray  # [n] number of placed robots of the class whose stages are in progress
    most: FloatArray  # [n] largest |s| - sum phi that completions can reach

    def take(self, which: IntArray) -> "Partial":
        """Returns the partial corners at given positions."""
        return Partial(self.pixels[which], self.values[which], self.placed[which], self.most[which])


# Chooses the partial corners to keep: returns their positions, and the corners that replace them.
Thin = Callable[[Partial], tuple[IntArray, Partial]]

_Steps = list[tuple[IntArray, IntArray]]  # parents and choices, stage by stage


class _Stage(NamedTuple):
    """The choices for the robots of one class: the number of robots at some of its breakpoints."""

    number: int  # number of the class
    robots: int  # robots of the class; its stages together place at most this many
    begins: bool  # True for the first stage of the class; `ends` is True for its last stage
    ends: bool
    first: int  # position of the first of these breakpoints among those of all classes
    counts: IntArray  # [M, K] robots at each of them
    placed: IntArray  # [M] total number of robots at these breakpoints
    pixels: FloatArray  # [M]
    values: FloatArray  # [M] sum of phi


def _stages(curves: Mapping[int, Curve], sizes: tuple[int, ...]) -> Iterator[_Stage]:
    """Yields the stages of each class: one stage if there are few choices, otherwise one per
    breakpoint.

    The largest breakpoint comes first, since the number of robots there matters most.
    """
    first, choices = 0, 1
    for number, curve in curves.items():
        points, robots = len(curve.roots), sizes[number]
        choices *= math.comb(robots + points, points) if robots > 1 else 1
        if choices <= STAGE_CHOICES:
            parts = [(slice(0, points), multisets(points, robots))]
        else:
            placed = np.arange(robots + 1)[:, None]
            parts = [(slice(k, k + 1), placed) for k in reversed(range(points))]
        for k, (at, counts) in enumerate(parts):
            yield _Stage(
                number, robots, k == 0, k == len(parts) - 1, first + at.start, counts,
                counts.sum(axis=1), counts @ curve.roots[at] ** 2, counts @ curve.values[at],
            )  # fmt: skip
        first += points


class Corners:
    """All corners of a cut: every robot at a breakpoint of its class, or at 0.

    Robots of a class are exchangeable, so only the number of robots at each breakpoint matters.

    Parameters
    ----------
    curves : phi of each class, by its number
    sizes : number of robots of each class
    slope : of a line that touches the root, m/px^0.5; left of where they touch, the line takes the
        place of the root |s|; infinity: nowhere
    stop : checked between two stages; raises LimitReached
    """

    def __init__(
        self,
        curves: Mapping[int, Curve],
        sizes: tuple[int, ...],
        slope: float = math.inf,
        stop: Stop = never,
    ) -> None:
        self._stages = [*_stages(curves, sizes)]
        self._slope, self._stop = slope, stop

    def highest(self) -> float:
        """Returns the largest |s| - sum phi over all corners, or slightly more."""
        known = self._ascent()
        least = known - 1e-12 * math.sqrt(self._most_pixels)
        heights, _ = self.above(least, _undominated)
        return float(heights.max(initial=max(known, 0.0)))

    def above(self, least: float, thin: Thin) -> tuple[FloatArray, _Steps]:
        """Returns the corners at which |s| - sum phi is at least `least`, by dynamic programming.

        A partial sum of pixels z and value v = -sum phi is dropped if no completion can reach
        `least`: sqrt(z) is at most any tangent theta z + 1 / (4 theta), for which the best
        completion is found stage by stage.

        Parameters
        ----------
        thin : drops more of the partial corners after each stage

        Returns
        -------
        |s| - sum phi of each corner [n], or a larger value if `thin` merged corners, and the way to
        each.
        """
        thetas = 0.5 / np.sqrt(max(self._most_pixels, 1e-300) * _TANGENTS)
        thetas = np.minimum(thetas, self._slope)
        ahead, rest = self._completions(thetas)
        kept = Partial(np.zeros(1), np.zeros(1), np.zeros(1, dtype=np.int64), np.zeros(1))
        steps: _Steps = []
        for k, stage in enumerate(self._stages):
            self._stop.check()
            z = (kept.pixels[:, None] + stage.pixels).ravel()
            v = (kept.values[:, None] - stage.values).ravel()
            placed = (kept.placed[:, None] + stage.placed).ravel()
            left, most = stage.robots - placed, np.empty(len(z))
            for part in (slice(a, a + _BLOCK) for a in range(0, len(z), _BLOCK)):
                reach = thetas[:, None] * z[part] + v[part] + rest[k + 1][:, None]
                if not stage.ends:
                    reach += left[part] * ahead[k][:, None]
                reach.min(axis=0, out=most[part])
            able = np.flatnonzero((most >= least) & (left >= 0))
            if stage.ends:  # the next robots belong to another class
                placed = np.zeros_like(placed)
            which, kept = thin(Partial(z, v, placed, most).take(able))
            chosen = able[which]
            steps.append((chosen // len(stage.pixels), chosen % len(stage.pixels)))
        return self._roots(kept.pixels) + kept.values, steps

    def _roots(self, pixels: FloatArray) -> FloatArray:
        """Returns the roots of pixels [n], or what takes their place."""
        roots: FloatArray = np.sqrt(pixels)
        if self._slope == math.inf:
            return roots
        line = self._slope * pixels + 0.25 / self._slope
        return np.where(pixels < 0.25 / self._slope**2, line, roots)

    def counts(self, steps: _Steps, which: IntArray) -> IntArray:
        """Returns the number of robots at each breakpoint, in chosen corners [n, sum of K].

        Parameters
        ----------
        steps : the ways to the corners, as returned by `above`
        """
        points = max(stage.first + stage.counts.shape[1] for stage in self._stages)
        counts = np.zeros((len(which), points), dtype=np.int64)
        for stage, (parents, choices) in zip(self._stages[::-1], steps[::-1], strict=True):
            at = slice(stage.first, stage.first + stage.counts.shape[1])
            counts[:, at] += stage.counts[choices[which]]
            which = parents[which]
        return counts

    def _completions(self, thetas: FloatArray) -> tuple[list[FloatArray], FloatArray]:
        """Returns the most that stages can add to tangents of slopes theta [thetas].

        First, for each stage, the largest amount that each unplaced robot of its class can add at
        later stages; then the largest total that all later classes can add after each stage
        [stages+1, thetas].
        """
        ahead: list[FloatArray] = []
        nothing = np.zeros(len(thetas))
        most, rest = nothing, [nothing]  # for the stages of one class, and of all classes
        for stage in reversed(self._stages):
            ahead.append(most / stage.robots)
            most = np.maximum(most, (stage.pixels * thetas[:, None] - stage.values).max(axis=1))
            rest.append(rest[-1] + most if stage.begins else rest[-1])
            most = nothing if stage.begins else most
        return ahead[::-1], np.array(rest[::-1]) + 0.25 / thetas

    @property
    def _most_pixels(self) -> float:
        """Number of pixels if every robot is at its last breakpoint."""
        return sum(float(stage.pixels.max()) for stage in self._stages if stage.begins)

    def _ascent(self) -> float:
        """Returns |s| - sum phi of a corner that cannot be improved by changing a single stage."""
        chosen = [0] * len(self._stages)
        left = {stage.number: stage.robots for stage in self._stages}
        pixels, value, best = 0.0, 0.0, -math.inf
        height = 0.0
        while height > best:
            best = height
            self._stop.check()
            for k, stage in enumerate(self._stages):
                pixels -= float(stage.pixels[chosen[k]])
                value += float(stage.values[chosen[k]])
                left[stage.number] += int(stage.placed[chosen[k]])
                heights = self._roots(np.maximum(pixels, 0.0) + stage.pixels) - stage.values
                heights[stage.placed > left[stage.number]] = -math.inf
                chosen[k] = int(np.argmax(heights))
                pixels += float(stage.pixels[chosen[k]])
                value -= float(stage.values[chosen[k]])
                left[stage.number] -= int(stage.placed[chosen[k]])
            height = float(self._roots(np.array([max(pixels, 0.0)]))[0]) + value
        return best


@lru_cache(maxsize=256)
def multisets(points: int, size: int) -> IntArray:
    """Returns the counts [M, points] of all multisets with at most `size` elements."""
    counts = np.zeros((1, 0), dtype=np.int64)
    for _ in range(points):
        left = size - counts.sum(axis=1)
        rows = np.repeat(np.arange(len(counts)), left + 1)
        ends = np.cumsum(left + 1)
        more = np.arange(len(rows)) - np.repeat(ends - left - 1, left + 1)
        counts = np.column_stack([counts[rows], more])
    counts.setflags(write=False)
    return counts


def _undominated(partial: Partial) -> tuple[IntArray, Partial]:
    """Keeps the undominated corners, for which no other has at least as many pixels and as much
    value.

    Only corners that place the same number of robots of the class are compared. If there are very
    many, neighbours are merged and their pixels rounded up, so that heights are never too small.
    """
    # With corners in descending order of pixels: keep those with more value than all before.
    order = np.lexsort((-partial.values, -partial.pixels, partial.placed))
    groups = np.split(order, np.flatnonzero(np.diff(partial.placed[order])) + 1)
    for k, group in enumerate(groups if len(order) else ()):
        highest = np.maximum.accumulate(partial.values[group])
        groups[k] = group[np.append(True, highest[1:] > highest[:-1])]
    kept = np.concatenate(groups)
    undominated = partial.take(kept)
    if len(kept) <= MOST_CORNERS:
        return kept, undominated
    each = max(MOST_CORNERS // len(groups), 1)
    ends = np.cumsum([0, *map(len, groups)])
    first = np.concatenate([np.arange(a, b, -(-(b - a) // each)) for a, b in pairwise(ends)])
    pixels, values, most = (
        np.maximum.reduceat(part, first)
        for part in (undominated.pixels, undominated.values, undominated.most)
    )
    return kept[first], Partial(pixels, values, undominated.placed[first], most)
