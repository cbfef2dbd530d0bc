"""Numbers of spans that stand one after the other."""

import numpy as np

from cocap_opt.data import IntArray


def spans(first: IntArray, counts: IntArray) -> IntArray:
    """Returns the numbers first, first + 1, .. of spans of `counts` [n], one after the other."""
    ends = np.cumsum(counts)
    result: IntArray = np.arange(int(counts.sum())) + np.repeat(first + counts - ends, counts)
    return result
