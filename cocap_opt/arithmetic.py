"""Sums and trigonometric functions that are the same on every machine, and spans of numbers.

Python's own sum of floats changed in 3.12. NumPy's trigonometric functions differ in the last bit
between processors with and without AVX-512. With them, scenes and their digests would differ, too.
"""

import math
from collections.abc import Iterable

import numpy as np

from cocap_opt.data import FloatArray, IntArray


def exact_sum(values: Iterable[float]) -> float:
    """Returns the sum of numbers, correctly rounded; NaN or infinite if it is not finite."""
    values = list(values)
    try:
        return math.fsum(values)
    except (OverflowError, ValueError):  # an overflow, or infinities of both signs
        return math.inf if -math.inf not in values else math.nan


def angles_of(y: FloatArray, x: FloatArray) -> FloatArray:
    """Returns the angles [n] (radians, from -pi to pi) of vectors, as `numpy.arctan2` would."""
    pairs = zip(y.tolist(), x.tolist(), strict=True)
    return np.array([math.atan2(*pair) for pair in pairs], dtype=float)


def cosines(angles: FloatArray) -> FloatArray:
    """Returns the cosines [n] of angles (radians)."""
    return np.array([math.cos(angle) for angle in angles.tolist()], dtype=float)


def sines(angles: FloatArray) -> FloatArray:
    """Returns the sines [n] of angles (radians)."""
    return np.array([math.sin(angle) for angle in angles.tolist()], dtype=float)


def spans(first: IntArray, counts: IntArray) -> IntArray:
    """Returns the numbers first, first + 1, .. of spans of `counts` [n], one after the other."""
    ends = np.cumsum(counts)
    result: IntArray = np.arange(int(counts.sum())) + np.repeat(first + counts - ends, counts)
    return result


def entries_of(rows: IntArray, counts: IntArray) -> IntArray:
    """Returns the numbers of all entries of some rows; row k has `counts` [k] entries.

    Entries are numbered row by row, as in the compressed sparse row format.
    """
    return spans((np.cumsum(counts) - counts)[rows], counts[rows])
