"""Sums that are the same with every Python, whose own changed in 3.12, and numbers of spans."""

import math
from collections.abc import Iterable

import numpy as np

from cocap_opt.data import IntArray


def exact_sum(values: Iterable[float]) -> float:
    """Returns the sum of numbers, correctly rounded; NaN or infinite where it is not finite."""
    values = list(values)
    try:
        return math.fsum(values)
    except (OverflowError, ValueError):  # too large on the way, or of both infinities
        return math.inf if -math.inf not in values else math.nan


def spans(first: IntArray, counts: IntArray) -> IntArray:
    """Returns the numbers first, first + 1, .. of spans of `counts` [n], one after the other."""
    ends = np.cumsum(counts)
    result: IntArray = np.arange(int(counts.sum())) + np.repeat(first + counts - ends, counts)
    return result


def entries_of(rows: IntArray, counts: IntArray) -> IntArray:
    """Returns the numbers of all entries of some rows, of which row k has `counts` [k].

    Entries are numbered row by row, as in compressed sparse rows.
    """
    return spans((np.cumsum(counts) - counts)[rows], counts[rows])
