"""Local search for joint states: improves one of a step, robot after robot, as far as possible.

If it is compiled (`ascent_kernel`), it can start from more joint states in less time.
"""

from collections.abc import Sequence

import numpy as np

from cocap_opt.compiling import Kernel
from cocap_opt.data import BoolArray, FloatArray, IntArray
from cocap_opt.formulations.certificates.staged import JointStates
from cocap_opt.formulations.column_generation.parameters import BundleParameters

KERNEL = Kernel(
    "cocap_opt.formulations.column_generation.step_envelopes.ascent_kernel", "local search",
    compiling=3.0,
)  # fmt: skip
_GAIN = 1e-9  # relative; smaller increases do not count


def local_optima(
    joint: JointStates,
    starts: Sequence[Sequence[int]],
    parameters: BundleParameters | None = None,
) -> IntArray:
    """Returns the distinct joint states that count and in which local search ends.

    Parameters
    ----------
    starts : positions of the states to start with; the greedy joint state is one more start
    parameters : parameters of the compiled search, which needs numba, does not try all states, and
        may end in other joint states; None: do not use the compiled search

    Returns
    -------
    [K, R] positions of the states.
    """
    if parameters is not None:
        found = _compiled(joint, starts, parameters)
    else:
        every = [*starts, first] if (first := _greedy(joint)) else starts
        found = _teams(joint, [_ascended(joint, start) for start in every])
    found = np.unique(np.sort(found, axis=1), axis=0)
    return found[that_count(joint, found)]


def that_count(joint: JointStates, teams: IntArray) -> BoolArray:
    """Returns True for the joint states [K, R] that some plan above the target may visit."""
    low = joint.worths(teams) - joint.charge[teams].sum(axis=1)
    able: BoolArray = low >= joint.floor - joint.margin
    for k in range(teams.shape[1]):
        for other in range(k):
            able &= ~joint.conflicts.between(teams[:, k], teams[:, other])
    return able


def heights_of(joint: JointStates, teams: IntArray) -> FloatArray:
    """Returns the heights of joint states [K, R]."""
    height: FloatArray = joint.worths(teams) - joint.price[teams].sum(axis=1)
    return height


def _teams(joint: JointStates, found: Sequence[Sequence[int]]) -> IntArray:
    """Returns the positions [K, R] of joint states as one array."""
    return np.array(found, dtype=np.int64).reshape(len(found), sum(joint.sizes))


def _compiled(
    joint: JointStates, starts: Sequence[Sequence[int]], parameters: BundleParameters
) -> IntArray:
    """Returns the joint states in which compiled search ends, from the given and the greedy joint
    states.
    """
    from cocap_opt.formulations.column_generation.step_envelopes.ascent_kernel import (
        AscentViews,
        ascend,
    )

    nowhere = [-1] * sum(joint.sizes)
    teams = _teams(joint, [*starts, nowhere])
    ends = np.searchsorted(joint.class_of, np.arange(len(joint.sizes) + 1))
    ranges = np.repeat(np.column_stack([ends[:-1], ends[1:]]), joint.sizes, axis=0)
    views = AscentViews(
        *joint.sparse, joint.weights, *joint.returns, joint.price, joint.charge, ranges,
        joint.conflicts.place_of.astype(np.uint32), joint.conflicts.too_near,
    )  # fmt: skip
    full, high = (
        (parameters.full_starts, parameters.high_states)
        if teams.shape[1] <= parameters.few_robots
        else (parameters.many_full_starts, parameters.many_high_states)
    )
    ascend(views, joint.floor - joint.margin, teams, full, high)
    return teams[(teams >= 0).all(axis=1)]


def _greedy(joint: JointStates) -> tuple[int, ...]:
    """Returns the joint state in which each robot takes the best state that earlier robots leave
    free.

    Returns
    -------
    Positions of the states; empty if some robot finds no state.
    """
    chosen: list[int] = []
    for number, robots in enumerate(joint.sizes):
        for _ in range(robots):
            if (state := _best(joint, number, chosen)) is None:
                return ()
            chosen.append(state)
    return tuple(chosen)


def _ascended(joint: JointStates, start: Sequence[int]) -> tuple[int, ...]:
    """Returns a joint state in which no robot can raise the height alone, starting from given
    positions.

    If the start has conflicts, the result may have some, too.
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
    """Returns the best state of a class given the states of other robots; None if all conflict."""
    first, end = np.searchsorted(joint.class_of, [number, number + 1])
    seen = joint.pixels[list(others)].sum(axis=0)
    values = joint.returns.values(seen + joint.pixels[first:end])
    gains = values @ joint.weights - joint.price[first:end]
    conflicts = joint.conflicts.between(np.array(others, dtype=int)[:, None], np.arange(first, end))
    gains[conflicts.any(axis=0)] = -np.inf
    if not len(gains) or gains.max() == -np.inf:
        return None
    return int(first + gains.argmax())
