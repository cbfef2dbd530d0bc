"""Counts the states and joint states that a narrowing leaves, which determine the choice of
stages.
"""

import math

import numpy as np

from cocap_opt.data import IntArray
from cocap_opt.formulations.certificates.staged import Narrowing


def states_left(narrowing: Narrowing) -> IntArray:
    """Returns the number of remaining states at each step [T+1]."""
    left: IntArray = np.sum([is_left.sum(axis=1) for is_left in narrowing.left], axis=0)
    return left


def joint_states_left(narrowing: Narrowing) -> int:
    """Returns the number of remaining joint states of all steps, including those with conflicts."""
    first, sizes = narrowing.model.problem.first_step, narrowing.model.class_sizes
    per_step = np.array([is_left.sum(axis=1) for is_left in narrowing.left]).T[first:].tolist()
    return sum(
        math.prod(math.comb(n + k - 1, k) for n, k in zip(left, sizes, strict=True))
        for left in per_step
    )
