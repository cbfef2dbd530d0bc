"""Separates envelope cuts for view sums that many robots of one class share.

Robots of one class may exchange their amounts, so a corner of a cut (`certificates.envelope`) is a
multiset of breakpoints: the number of robots at each. Only small multisets matter. Add the robots
of the highest multiset one by one: each raises the root by at least its phi, since gains diminish.
So the highest multiset is among those that grow by gains alone, in the order of the breakpoints,
and these are few, however many robots there are. Therefore the transport problem of a cut
(`relaxations.separation`) has a small program of its own, to which the highest multisets are added
until none is above the cut.
"""

import math

import numpy as np

from cocap_opt.data import FloatArray, IntArray
from cocap_opt.formulations.certificates.envelope import Curve, Cut, multisets
from cocap_opt.formulations.certificates.format import MOST_WORK
from cocap_opt.formulations.column_generation.parameters import AlikeCutParameters
from cocap_opt.formulations.relaxations.separation import Seen, Transport, amounts_at

_ROUNDING = 1e-12  # relative to the largest root


def alike_cut(
    view_sum: int,
    seen: Seen,
    largest: float,
    robots: int,
    known: float,
    least: float,
    parameters: AlikeCutParameters,
) -> Cut | None:
    """Returns the cut of one class that is tightest, or nearly tightest, at a mixture.

    Parameters
    ----------
    seen : roots of robots of one class only
    largest : largest root that a robot can have, px^0.5/m
    robots : number of robots of the class
    known, least : height of the known cuts at the mixture, and the amount by which the new cut must
        be lower; otherwise None is returned
    """
    most = min(parameters.breakpoints, MOST_WORK // robots)
    if most == 0:
        return None
    points = _breakpoints(seen, largest, most)
    mass = np.maximum(amounts_at(points, seen.roots, seen.amounts), parameters.least_mass)
    unit = float(points[-1])
    pixels = (points / unit) ** 2
    values = _values(pixels, mass, robots, known / unit, parameters)
    if values is None:
        return None
    # The root grows with each robot's root, so phi never needs to be above its later values.
    values = np.minimum.accumulate(values[::-1])[::-1]
    grown = _grown_multisets(pixels, values, robots, parameters.most_growing)
    if grown is None:
        return None
    curve = Curve(points, values * unit)
    constant = float(grown[1].max() + _ROUNDING) * unit
    cut = Cut(view_sum, {int(seen.classes[0]): curve}, constant)
    return cut if known - seen.height(cut) > least else None


def _grown_multisets(
    pixels: FloatArray, values: FloatArray, robots: int, most: int
) -> tuple[IntArray, FloatArray] | None:
    """Returns the multisets that grow by gains alone, which include the highest one.

    The result is the number of robots at each breakpoint [n, K], and the excess of their roots over
    the sums of phi [n]; None if there are too many multisets.

    Parameters
    ----------
    pixels, values : [K] pixels of a robot at each breakpoint, and phi there
    robots : largest number of robots in a multiset
    most : largest number of multisets of one size to examine
    """
    size = len(pixels)
    each, numbers = np.eye(size, dtype=np.int64), np.arange(size)
    counts, last = np.zeros((1, size), dtype=np.int64), np.zeros(1, dtype=np.int64)
    sums, prices = np.zeros(1), np.zeros(1)
    sizes, heights = [counts], [np.zeros(1)]
    for _ in range(robots):
        gains = np.sqrt(sums[:, None] + pixels) - np.sqrt(sums)[:, None] - values
        which, at = np.nonzero((gains >= -_ROUNDING) & (numbers >= last[:, None]))
        if not len(which):
            break
        if len(which) > most:
            return None
        counts, last = counts[which] + each[at], at
        sums, prices = sums[which] + pixels[at], prices[which] + values[at]
        sizes.append(counts)
        heights.append(np.sqrt(sums) - prices)
    return np.concatenate(sizes), np.concatenate(heights)


def _values(
    pixels: FloatArray, mass: FloatArray, robots: int, known: float, parameters: AlikeCutParameters
) -> FloatArray | None:
    """Returns phi at the breakpoints [K]; None if the cut is not lower than the known cuts."""
    size = min(math.ceil(float(mass.sum())) + 1, robots)
    while size > 1 and math.comb(len(pixels) + size, size) > parameters.first_multisets:
        size -= 1
    counts, program = multisets(len(pixels), size), Transport(mass)
    for _ in range(parameters.most_rounds):
        found = program.solve(counts, np.sqrt(counts @ pixels))
        if found is None:  # not expected
            return None
        values, total = found
        height = total + float(mass @ values)
        grown = _grown_multisets(pixels, values, robots, parameters.most_growing)
        if height > known or grown is None:
            return None
        above = total + parameters.nearly * (known - height)
        grown_counts, heights = grown
        order = np.argsort(-heights, kind="stable")[: parameters.most_added]
        if heights[order[0]] <= above:
            break
        counts = grown_counts[order[heights[order] > total]]
    return values


def _breakpoints(seen: Seen, largest: float, most: int) -> FloatArray:
    """Returns at most a given number of roots: the largest, and others between which roots lose
    little.
    """
    top = largest * (1 + 1e-9)
    points, which = np.unique(np.round(seen.roots / largest, 4) * largest, return_inverse=True)
    mass = np.bincount(which, seen.amounts)
    inner = (points > 1e-3 * top) & (points < top * (1 - 1e-3))
    points, mass = points[inner], mass[inner]
    if most == 1:
        return np.array([top])
    while len(points) >= most:
        both = mass[1:] + mass[:-1]
        at = int(np.argmin(np.diff(points) * mass[1:] * mass[:-1] / both))
        points[at] = (points[at : at + 2] @ mass[at : at + 2]) / both[at]
        mass[at] = both[at]
        points, mass = np.delete(points, at + 1), np.delete(mass, at + 1)
    return np.append(points, top)
