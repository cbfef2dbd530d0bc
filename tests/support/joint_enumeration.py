"""All joint states of a step by enumeration: the oracle of the searches for the best of them."""

from collections.abc import Sequence
from itertools import combinations_with_replacement, product

import numpy as np

from cocap_opt.formulations.certificates.staged import JointStates


def does_count(joint: JointStates, chosen: Sequence[int]) -> bool:
    """True for a joint state that some plan above the target may visit."""
    at = list(chosen)
    apart = not np.triu(joint.conflicts.between(*np.ix_(at, at)), 1).any()
    return apart and joint.worth(at) - float(joint.charge[at].sum()) >= joint.floor - joint.margin


def joint_by_enumeration(joint: JointStates) -> list[tuple[int, ...]]:
    """All joint states that count, as sorted positions."""
    parts = [
        combinations_with_replacement(np.flatnonzero(joint.class_of == c).tolist(), size)
        for c, size in enumerate(joint.sizes)
    ]
    return sorted(
        chosen
        for some in product(*parts)
        if does_count(joint, chosen := tuple(sorted(k for part in some for k in part)))
    )
