"""Local search for high joint states of one step: robot after robot, as high as can be.

It can be compiled (`ascent_kernel`), so that it begins at more joint states in less time.
"""

from collections.abc import Sequence

import numpy as np

from cocap_opt.data import BoolArray, FloatArray, IntArray
from cocap_opt.formulations.certificates.staged import JointStates

_GAIN = 1e-9  # relative, from which on a height counts as higher


def ascended(
    joint: JointStates, starts: Sequence[Sequence[int]], is_compiled: bool = False
) -> IntArray:
    """Returns joint states that count and that no robot can raise alone, without repetition.

    Parameters
    ----------
    starts : positions of the states to start with; the greedy joint state is one more start
    is_compiled : use the compiled search, which needs numba and may end elsewhere

    Returns
    -------
    [K, R] positions of the states.
    """
    if is_compiled:
        found = _compiled(joint, starts)
    else:
        every = [*starts, first] if (first := _greedy(joint)) else starts
        found = _teams(joint, [_ascended(joint, start) for start in every])
    found = np.unique(np.sort(found, axis=1), axis=0)
    return found[that_count(joint, found)]


def that_count(joint: JointStates, teams: IntArray) -> BoolArray:
    """Returns which of some joint states [K, R] count, that is, obey `JointStates.counts`."""
    low = joint.worths(teams) - joint.charge[teams].sum(axis=1)
    able: BoolArray = low >= joint.floor - joint.margin
    for k in range(teams.shape[1]):
        for other in range(k):
            able &= ~joint.conflict[teams[:, k], teams[:, other]]
    return able


def heights(joint: JointStates, teams: IntArray) -> FloatArray:
    """Returns the height of each of some joint states [K, R]."""
    height: FloatArray = joint.worths(teams) - joint.price[teams].sum(axis=1)
    return height


def _teams(joint: JointStates, found: Sequence[Sequence[int]]) -> IntArray:
    """Returns positions [K, R] of joint states as one array."""
    return np.array(found, dtype=np.int64).reshape(len(found), sum(joint.sizes))


def _compiled(joint: JointStates, starts: Sequence[Sequence[int]]) -> IntArray:
    """Returns what compiled local search makes of joint states and of the greedy one."""
    from cocap_opt.formulations.column_generation.step_envelopes.ascent_kernel import Views, ascend

    nowhere = [-1] * sum(joint.sizes)
    teams = _teams(joint, [*starts, nowhere])
    ends = np.searchsorted(joint.class_of, np.arange(len(joint.sizes) + 1))
    ranges = np.repeat(np.column_stack([ends[:-1], ends[1:]]), joint.sizes, axis=0)
    views = Views(*joint.sparse, joint.weights, joint.price, joint.charge, ranges, joint.conflict)
    ascend(views, joint.floor - joint.margin, teams)
    return teams[(teams >= 0).all(axis=1)]


def _greedy(joint: JointStates) -> tuple[int, ...]:
    """Returns the joint state in which each robot takes the best state that earlier ones leave.

    Returns
    -------
    Positions of the states; none where some robot finds no state.
    """
    chosen: list[int] = []
    for number, robots in enumerate(joint.sizes):
        for _ in range(robots):
            if (state := _best(joint, number, chosen)) is None:
                return ()
            chosen.append(state)
    return tuple(chosen)


def _ascended(joint: JointStates, start: Sequence[int]) -> tuple[int, ...]:
    """Returns a joint state that no robot can raise alone, from positions to start with.

    Where the start has conflicts, so may the result.
    """
    chosen, height = list(start), -np.inf
    while (now := joint.reduced_profit(chosen)) > height + _GAIN * abs(now):
        height = now
        for k in range(len(chosen)):
            others = [*chosen[:k], *chosen[k + 1 :]]
            best = _best(joint, int(joint.class_of[chosen[k]]), others)
            if best is not None:
                chosen[k] = best
    return tuple(sorted(chosen))


def _best(joint: JointStates, number: int, others: Sequence[int]) -> int | None:
    """Returns the best state of a class beside the states of others; None if all conflict."""
    first, end = np.searchsorted(joint.class_of, [number, number + 1])
    seen = joint.pixels[list(others)].sum(axis=0)
    gains = np.sqrt(seen + joint.pixels[first:end]) @ joint.weights - joint.price[first:end]
    gains[joint.conflict[list(others), first:end].any(axis=0)] = -np.inf
    if not len(gains) or gains.max() == -np.inf:
        return None
    return int(first + gains.argmax())
