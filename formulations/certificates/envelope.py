"""Envelope cuts: the concave envelope of a view sum's root over which robots see how much.

For one view sum with pixels c_i of robot i and roots s_i = sqrt(c_i), the root of the sum is the
norm |s|, convex in s. Functions phi_k of one root, one for each class k of robots, that are
linear between breakpoints 0 = s_0 < s_1 < .. < s_K and have slope 1 from the last one on make

    |s| <= constant + sum_i phi_k(i)(s_i)

valid once it holds where every s_i is a breakpoint: on each box between breakpoints the left
side is convex and the right side linear, so their difference is largest at a corner; and
beyond the last ones the norm grows by no more than phi does. `constant_of` goes through these
corners; any phi have their constant. A class without breakpoints has phi(s) = s, and adds no
corners: a norm is subadditive.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from cocap_opt.data import FloatArray, IntArray

MOST_WORK = 256  # breakpoints of all classes, each counted once per robot of its class
MOST_CORNERS = 20_000  # partial ones that are kept apart where a cut's constant is found
STAGE_CHOICES = 10_000  # multisets of a class that are gone through at once
TANGENTS = 16  # of the root, in bounds of what completions can have


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
    """An envelope cut of a view sum.

    Attributes
    ----------
    curves : phi of robot classes by their numbers; that of the others is the identity
    """

    view_sum: int
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
    """Least constant that makes a cut valid, or little more; >= 0, since none may see the view sum.

    Parameters
    ----------
    sizes : robots of each class, by its number
    """
    return _highest(stages_of(curves, sizes))


def work_of(curves: Mapping[int, Curve], sizes: tuple[int, ...]) -> int:
    """What the time that a cut's constant takes grows with."""
    return sum(sizes[number] * len(curve.roots) for number, curve in curves.items())


class Stage(NamedTuple):
    """What some robots of a class may do."""

    pixels: FloatArray  # [M]
    values: FloatArray  # [M] sum of phi
    counts: IntArray  # [M, K] how many of them are at each breakpoint
    first: int  # position of the class's first breakpoint among those of all classes


def stages_of(curves: Mapping[int, Curve], sizes: tuple[int, ...]) -> list[Stage]:
    """Choices of the robots of each class: all at once while these are few, else one by one."""
    stages, first = list[Stage](), 0
    for number, curve in curves.items():
        points, robots = len(curve.roots), sizes[number]
        at_once = math.comb(robots + points, points) <= STAGE_CHOICES
        counts = multisets(points, robots if at_once else 1)
        stage = Stage(counts @ curve.roots**2, counts @ curve.values, counts, first)
        stages += [stage] * (1 if at_once else robots)
        first += points
    return stages


# Positions to keep, of pixels [n], values [n] and what completions can have at most [n], and
# the pixels and values that these are given.
Thin = Callable[[FloatArray, FloatArray, FloatArray], tuple[IntArray, FloatArray, FloatArray]]


class Corners:
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

    def __init__(self, stages: Sequence[Stage], least: float, thin: Thin) -> None:
        self.stages_of = stages
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
        points = max(stage.first + stage.counts.shape[1] for stage in self.stages_of)
        counts = np.zeros((len(which), points), dtype=np.int64)
        for stage, (parents, choices) in zip(
            reversed(self.stages_of), reversed(self._steps), strict=True
        ):
            counts[:, stage.first : stage.first + stage.counts.shape[1]] += stage.counts[
                choices[which]
            ]
            which = parents[which]
        return counts


def _highest(stages: Sequence[Stage]) -> float:
    """The largest |s| - sum phi of all corners, or little more."""
    top = sum(float(stage.pixels.max()) for stage in stages)
    known = _ascent(stages)
    corners = Corners(stages, known - 1e-12 * math.sqrt(top), _undominated)
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


def _ascent(stages: Sequence[Stage]) -> float:
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
