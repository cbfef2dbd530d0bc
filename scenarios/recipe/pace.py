"""The speeds of the people who are filmed: a wrong unit, frame rate or step shows in them."""

from collections.abc import Sequence

import numpy as np

from cocap_opt.data import ProblemError
from cocap_opt.problem import Actor

FASTEST = 12.0  # m/s; nobody runs faster, and few ride
IMPOSSIBLE = 100.0  # m/s


def pace_warning(names: Sequence[str], actors: Sequence[Actor], step: float, causes: str) -> str:
    """Returns a warning about the first of some people who is too fast, or nothing if nobody is.

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
    warnings = []
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
            warnings.append(f"{name} {words}")
    if not warnings:
        return ""
    more = f"; {len(warnings)} of {len(actors)} people are so fast" if len(warnings) > 1 else ""
    return f"{warnings[0]}{more}: are {causes} right?"
