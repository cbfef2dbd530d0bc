"""The assignment of robots to next states, by which an integral flow becomes paths."""

from collections.abc import Mapping, Sequence

import numpy as np


def assigned_heads(
    gains: Sequence[Mapping[int, float]], heads: Sequence[int], forbidden: float
) -> list[int] | None:
    """Returns the head that each robot goes to, so that their gains together are largest.

    Parameters
    ----------
    gains : for each robot, the gain of every head that it can go to
    heads : each head as often as robots go there
    forbidden : the gain of a head that a robot cannot go to, so low that no other outweighs it

    Returns
    -------
    One head per robot; None where there are not as many heads as robots, or a robot would have
    to go where it cannot.
    """
    from scipy.optimize import linear_sum_assignment  # half of the time that imports take

    if len(heads) != len(gains):
        return None
    gain = np.array([[some.get(head, -np.inf) for head in heads] for some in gains])
    weights = np.where(np.isinf(gain), forbidden, gain)
    robots, chosen = linear_sum_assignment(weights, maximize=True)
    if np.isinf(gain[robots, chosen]).any():
        return None
    return [heads[k] for k in chosen.tolist()]
