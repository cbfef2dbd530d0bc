"""The speeds of the people who are filmed: a wrong unit, frame rate or step shows in them."""

from collections.abc import Sequence

import numpy as np

from cocap_opt.data import ProblemError
from cocap_opt.problem import Actor

FASTEST = 12.0  # m/s; nobody runs faster, and few ride
IMPOSSIBLE = 100.0  # m/s


def pace_doubt(names: Sequence[str], actors: Sequence[Actor], step: float, causes: str) -> str:
    """Returns a doubt about the first of some people who is too fast, or nothing if nobody is.

    Parameters
    ----------
    names : of the people, as messages have them
    step : seconds between steps
    causes : what may be wrong, in words

    Raises
    ------
    ProblemError
        If nobody on the ground could be so fast.
    """
    doubts = []
    for name, actor in zip(names, actors, strict=True):
        ways = np.hypot(*np.diff(actor.poses[:, :2], axis=0).T)
        t = int(np.argmax(ways))
        speed = ways[t] / step
        words = f"moves by {ways[t]:.4g} m from step {t} to {t + 1}, {speed:.4g} m/s"
        if speed > IMPOSSIBLE:
            raise ProblemError(
                f"{name} must be slower than {IMPOSSIBLE:g} m/s, but {words}: are {causes} right?"
            )
        if speed > FASTEST:
            doubts.append(f"{name} {words}")
    if not doubts:
        return ""
    more = f"; {len(doubts)} of {len(actors)} people are so fast" if len(doubts) > 1 else ""
    return f"{doubts[0]}{more}: are {causes} right?"
