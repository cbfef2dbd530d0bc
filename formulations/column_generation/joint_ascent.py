"""Local search for high joint states of one step: robot after robot, as high as can be."""

from collections.abc import Sequence

import numpy as np

from cocap_opt.formulations.certificates import JointStates

_GAIN = 1e-9  # relative, from which on a height counts as higher


def greedy(joint: JointStates) -> tuple[int, ...]:
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


def ascended(joint: JointStates, start: Sequence[int]) -> tuple[int, ...]:
    """Returns a joint state that no robot can raise alone, from positions to start with.

    Where the start has conflicts, so may the result.
    """
    chosen, height = list(start), -np.inf
    while (now := joint.height(chosen)) > height + _GAIN * abs(now):
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
    gains = np.sqrt(seen + joint.pixels[first:end]) @ joint.weights - joint.payment[first:end]
    gains[joint.conflict[list(others), first:end].any(axis=0)] = -np.inf
    if not len(gains) or gains.max() == -np.inf:
        return None
    return int(first + gains.argmax())
