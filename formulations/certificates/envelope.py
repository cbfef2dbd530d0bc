"""Envelope cuts: concave bounds on the root of a view sum over which robots see how much.

For one view sum with pixels c_i of robot i and roots s_i = sqrt(c_i), the root of the sum is the
norm |s|, convex in s. Functions phi_k of one root, one for each class k of robots, that are
linear between breakpoints 0 = s_0 < s_1 < .. < s_K and have slope 1 from the last one on make

    |s| <= constant + sum_i phi_k(i)(s_i)

valid once it holds where every s_i is a breakpoint: on each box between breakpoints the left
side is convex and the right side linear, so that their difference is largest at a corner; and
beyond the last ones the norm grows by no more than phi does. `Cut.valid` goes through these
corners; any phi have their constant. A class without breakpoints has phi(s) = s, and adds no
corners: a norm is subadditive.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np

from cocap_opt.data import FloatArray, IntArray

MOST_CORNERS = 20_000  # partial corners that are kept apart where a cut's constant is found
STAGE_CHOICES = 10_000  # multisets of breakpoints of a class that are gone through at once
# Pixels, as shares of the most, at which tangents of the root bound completions.
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
        """The breakpoints [K+1] and phi at them, the breakpoint 0 in front."""
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
    curves : phi of robot classes by their numbers; that of the others is the identity
    """

    view_sum: int
    curves: Mapping[int, Curve]
    constant: float

    @classmethod
    def valid(cls, view_sum: int, curves: Mapping[int, Curve], sizes: tuple[int, ...]) -> "Cut":
        """Returns the cut with the least constant that makes it valid, or little more.

        The constant is >= 0, since no robot may see the view sum.

        Parameters
        ----------
        sizes : number of robots of each class
        """
        return cls(view_sum, curves, Corners(curves, sizes).highest())

    def phi(self, number: int, roots: FloatArray) -> FloatArray:
        """Returns phi of the robots of class `number` at any roots."""
        return self.curves.get(number, _IDENTITY)(roots)

    def phi_of(self, classes: IntArray, roots: FloatArray) -> FloatArray:
        """Returns phi of robots of these classes [n] at their roots [n]."""
        values = np.empty(len(roots))
        for number in np.unique(classes).tolist():
            own = classes == number
            values[own] = self.phi(number, roots[own])
        return values


# Which partial corners to keep, of pixels [n], values [n] and the most that completions can
# reach [n]: their positions, and the pixels and values that they get.
Thin = Callable[[FloatArray, FloatArray, FloatArray], tuple[IntArray, FloatArray, FloatArray]]


class _Stage(NamedTuple):
    """The choices of some robots of one class: how many of them are at each breakpoint."""

    pixels: FloatArray  # [M]
    values: FloatArray  # [M] sum of phi
    counts: IntArray  # [M, K] robots at each breakpoint
    first: int  # position of the class's first breakpoint among those of all classes


class Corners:
    """All corners of a cut: every robot at a breakpoint of its class, or at 0.

    Parameters
    ----------
    curves : phi by number of the class
    sizes : number of robots of each class
    """

    def __init__(self, curves: Mapping[int, Curve], sizes: tuple[int, ...]) -> None:
        self._stages: list[_Stage] = []
        first = 0
        for number, curve in curves.items():
            # All robots of a class at once while their choices are few, else one by one.
            points, robots = len(curve.roots), sizes[number]
            at_once = math.comb(robots + points, points) <= STAGE_CHOICES
            counts = multisets(points, robots if at_once else 1)
            stage = _Stage(counts @ curve.roots**2, counts @ curve.values, counts, first)
            self._stages += [stage] * (1 if at_once else robots)
            first += points

    def highest(self) -> float:
        """Returns the largest |s| - sum phi of all corners, or little more."""
        known = self._ascent()
        least = known - 1e-12 * math.sqrt(self._most_pixels)
        heights = self.above(least, _undominated).heights
        return float(heights.max(initial=max(known, 0.0)))

    def above(self, least: float, thin: Thin) -> "_HighCorners":
        """Returns the corners at which |s| - sum phi is at least `least`, by dynamic programming.

        A partial sum of pixels z and value v = -sum phi is dropped where no completion can
        reach `least`: sqrt(z) is at most any tangent theta z + 1 / (4 theta), for which the
        best completion is found stage by stage.

        Parameters
        ----------
        thin : drops more of the partial corners after each stage
        """
        thetas = 0.5 / np.sqrt(max(self._most_pixels, 1e-300) * _TANGENTS)
        gains = [(s.pixels * thetas[:, None] - s.values).max(axis=1) for s in self._stages]
        rest = np.cumsum([np.zeros(len(thetas)), *gains[::-1]], axis=0)[::-1] + 0.25 / thetas
        pixels, values = np.zeros(1), np.zeros(1)
        steps: list[tuple[IntArray, IntArray]] = []
        for k, stage in enumerate(self._stages):
            z = (pixels[:, None] + stage.pixels).ravel()
            v = (values[:, None] - stage.values).ravel()
            most = np.full(len(z), np.inf)
            for theta, left in zip(thetas, rest[k + 1], strict=True):
                np.minimum(most, theta * z + v + left, out=most)
            able = np.flatnonzero(most >= least)
            which, pixels, values = thin(z[able], v[able], most[able])
            kept = able[which]
            steps.append((kept // len(stage.pixels), kept % len(stage.pixels)))
        return _HighCorners(np.sqrt(pixels) + values, self._stages, steps)

    @property
    def _most_pixels(self) -> float:
        """Pixels where every robot is at its last breakpoint."""
        return sum(float(stage.pixels.max()) for stage in self._stages)

    def _ascent(self) -> float:
        """Returns |s| - sum phi of a corner that no stage can better alone."""
        chosen = [0] * len(self._stages)
        pixels, value, best = 0.0, 0.0, -math.inf
        height = 0.0
        while height > best:
            best = height
            for k, stage in enumerate(self._stages):
                pixels -= float(stage.pixels[chosen[k]])
                value += float(stage.values[chosen[k]])
                heights = np.sqrt(np.maximum(pixels, 0.0) + stage.pixels) - stage.values
                chosen[k] = int(np.argmax(heights))
                pixels += float(stage.pixels[chosen[k]])
                value -= float(stage.values[chosen[k]])
            height = math.sqrt(max(pixels, 0.0)) + value
        return best


class _HighCorners(NamedTuple):
    """The corners that `Corners.above` found."""

    heights: FloatArray  # [n] |s| - sum phi, or more where `thin` merged some
    stages: list[_Stage]
    steps: list[tuple[IntArray, IntArray]]  # parents and choices, stage by stage

    def counts(self, which: IntArray) -> IntArray:
        """Returns how many robots are at each breakpoint in these corners [n, sum of K]."""
        points = max(stage.first + stage.counts.shape[1] for stage in self.stages)
        counts = np.zeros((len(which), points), dtype=np.int64)
        for stage, (parents, choices) in zip(
            reversed(self.stages), reversed(self.steps), strict=True
        ):
            counts[:, stage.first : stage.first + stage.counts.shape[1]] += stage.counts[
                choices[which]
            ]
            which = parents[which]
        return counts


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


def _undominated(
    pixels: FloatArray, values: FloatArray, most: FloatArray
) -> tuple[IntArray, FloatArray, FloatArray]:
    """Keeps the undominated corners: no other has at least as many pixels and as much value.

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
