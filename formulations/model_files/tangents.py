"""Tangents that bound the roots of a flow from above, to a requested accuracy.

A tangent to the root at z0 overestimates the root of z by the factor (sqrt(z / z0) + sqrt(z0 / z))
/ 2. So its relative error is at most e from z0 / r to z0 r, where sqrt(r) = 1 + e + sqrt((1 + e)^2
- 1).

A single view needs no tangent: the row u <= sum of roots is exact for it. With two or more views,
whole drones can have only a few sums of pixels, each of which must be near a tangent. If there are
too many sums, or if pixels add up over time, tangents cover all numbers between the smallest and
the largest sum.
"""

import math
from typing import NamedTuple

import numpy as np

from cocap_opt.data import FloatArray, IntArray
from cocap_opt.formulations.relaxations.flow import Flow, Roots
from cocap_opt.result import UnsupportedError

MOST_SUMS = 50_000  # sums of a view sum that are distinguished
MOST_TANGENTS = 500_000  # tangents of a program
_MOST_PAIRS = 2_000_000  # pairs of sums and views that are added up at once
_ROUNDING = 1e-13  # relative difference within which two sums are the same


class Tangents(NamedTuple):
    """Tangents to the roots of a flow, in units of each view sum's best view.

    Attributes
    ----------
    at : [k] position of each tangent's view sum among `Roots.used`
    z0 : [k] points of contact
    error : the largest relative error of a root at any sum of pixels that drones can have; the
        program's objective exceeds the referee's J of a plan by at most this share
    """

    at: IntArray
    z0: FloatArray
    error: float

    @classmethod
    def of(cls, flow: Flow, roots: Roots, error: float) -> "Tangents":
        """Returns the tangents for a relative error; 0: exact at all sums that can occur.

        Raises
        ------
        UnsupportedError
            If more than MOST_TANGENTS are needed, or an error of 0 requires more sums than
            MOST_SUMS.
        """
        at, z0, worst, total = list[IntArray](), list[FloatArray](), 0.0, 0
        for z in range(roots.returns.n_roots):
            sums = _sums(flow, roots, z)
            if sums is not None:
                touching = _near(sums, error)
                worst = max(worst, _error(sums, touching))
            elif error == 0:
                raise UnsupportedError(
                    f"a root can have more than {MOST_SUMS:,} sums of pixels; allow an error "
                    "above 0"
                )
            else:
                touching = _between(*_ends(flow, roots, z), error)
                worst = error
            total += len(touching)
            if total > MOST_TANGENTS:
                raise UnsupportedError(
                    f"a file takes at most {MOST_TANGENTS:,} tangents; this scene needs more. "
                    "Allow a larger error of the roots"
                )
            at.append(np.full(len(touching), z))
            z0.append(touching)
        return cls(np.concatenate([_NO_NUMBERS, *at]), np.concatenate([_NOTHING, *z0]), worst)


_NOTHING, _NO_NUMBERS = np.zeros(0), np.zeros(0, dtype=np.int64)


def _sums(flow: Flow, roots: Roots, z: int) -> FloatArray | None:
    """Returns the sums of two or more views that drones can have, increasing.

    Returns None if there are too many, or if a drone may see the view sum more than once.
    """
    if flow.model.problem.objective.over_time:
        return None
    single, more = _NOTHING, _NOTHING
    for number, size in enumerate(flow.model.class_sizes):
        views = _distinct(_views(roots, z, number))
        for _ in range(size if len(views) else 0):
            if (len(single) + len(more)) * len(views) > _MOST_PAIRS:
                return None
            added = _all_sums(np.concatenate([single, more]), views)
            more = _distinct(np.concatenate([more, added]))
            single = _distinct(np.concatenate([single, views]))
            if len(more) > MOST_SUMS:
                return None
    return more


def _views(roots: Roots, z: int, number: int) -> FloatArray:
    """Returns the pixels of each view that drones of a class can have of a view sum."""
    part = slice(roots.pixels.indptr[z], roots.pixels.indptr[z + 1])
    nodes = roots.pixels.indices[part]
    pixels: FloatArray = roots.pixels.data[part][roots.owner[nodes] == number]
    return pixels


def _all_sums(first: FloatArray, second: FloatArray) -> FloatArray:
    sums: FloatArray = np.add.outer(first, second).ravel()
    return sums


def _distinct(values: FloatArray) -> FloatArray:
    """Returns the positive values in increasing order, merging values that differ only by
    rounding.
    """
    ordered: FloatArray = np.unique(values[values > 0])
    if len(ordered) < 2:
        return ordered
    apart = np.diff(ordered) > _ROUNDING * ordered[1:]
    found: FloatArray = ordered[np.concatenate([[True], apart])]
    return found


def _ends(flow: Flow, roots: Roots, z: int) -> tuple[float, float]:
    """Returns the smallest and the largest possible sum of several views."""
    numbers = range(len(flow.model.class_sizes))
    views = [_views(roots, z, number) for number in numbers]
    often = flow.model.problem.horizon + 1 if flow.model.problem.objective.over_time else 1
    most = sum(
        often * size * float(pixels.max(initial=0.0))
        for pixels, size in zip(views, flow.model.class_sizes, strict=True)
    )
    return 2 * float(np.concatenate(views).min()), most


def _reach(error: float) -> float:
    """Returns r: a tangent at z0 keeps the error from z0 / r to z0 r."""
    return (1 + error + math.sqrt(error * (2 + error))) ** 2


def _near(sums: FloatArray, error: float) -> FloatArray:
    """Returns the fewest points of contact whose tangents keep the error at each of some sums
    [n].
    """
    width, first, found = _reach(error) ** 2, 0, list[float]()
    while first < len(sums):
        last = int(np.searchsorted(sums, sums[first] * width, side="right")) - 1
        last = max(first, last)
        # A single sum is touched exactly, without rounding.
        alone = last == first
        found.append(float(sums[first] if alone else math.sqrt(sums[first] * sums[last])))
        first = last + 1
    return np.array(found)


def _between(low: float, high: float, error: float) -> FloatArray:
    """Returns points of contact whose tangents keep the error at all numbers between two."""
    if high <= low:
        return np.array([low])
    reach = _reach(error)
    count = math.ceil(math.log(high / low) / (2 * math.log(reach)))
    step = (high / low) ** (1 / count)
    found: FloatArray = low * step ** (np.arange(count) + 0.5)
    return found


def _error(sums: FloatArray, touching: FloatArray) -> float:
    """Returns the largest relative error of tangents [k] to the root at some sums [n]."""
    if not len(sums):
        return 0.0
    # The nearest tangents below and above, by ratio.
    at = np.clip(np.searchsorted(touching, sums), 1, max(len(touching) - 1, 1))
    near = np.stack([touching[at - 1], touching[np.minimum(at, len(touching) - 1)]])
    ratio = np.sqrt(sums / near)
    # (r + 1 / r) / 2 - 1 without cancellation.
    return float(((ratio - 1) ** 2 / (2 * ratio)).min(axis=0).max())
