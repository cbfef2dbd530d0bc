"""Counts of the states and joint states that a narrowing leaves, by which stages are chosen."""

import math

import numpy as np

from cocap_opt.data import IntArray
from cocap_opt.formulations.certificates.staged import Narrowing


def states_left(narrowing: Narrowing) -> IntArray:
    """Returns the number of states that are left at each step [T+1]."""
    left: IntArray = np.sum([is_left.sum(axis=1) for is_left in narrowing.left], axis=0)
    return left


def joint_states_left(narrowing: Narrowing) -> int:
    """Returns the number of joint states of all steps, conflicts included, however many."""
    first, sizes = narrowing.model.problem.first_step, narrowing.model.class_sizes
    per_step = np.array([is_left.sum(axis=1) for is_left in narrowing.left]).T[first:].tolist()
    return sum(
        math.prod(math.comb(n + k - 1, k) for n, k in zip(left, sizes, strict=True))
        for left in per_step
    )
