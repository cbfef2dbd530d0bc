"""The face's variants of problems: what else is to be planned for."""

from collections.abc import Sequence
from typing import Literal

import numpy as np

from cocap_opt.api.arguments import require, require_number, require_problem
from cocap_opt.problem import Problem
from cocap_opt.vision import default_weights


def with_views(
    problem: Problem,
    cameras: int = 2,
    weight: float | Sequence[float] | Literal["first"] | None = None,
    at_least: float = 0.3,
    share: float | None = None,
) -> Problem:
    """Ask for several drones that see each person, besides pixels.

    J then has a part more: for each person and step the number of drones that see the person, of
    which at most `cameras` count, times `weight` and the person's importance. `Views` says when a
    drone sees a person.

    Parameters
    ----------
    problem : the problem; what it counted before is replaced
    cameras : from so many drones on, more add nothing
    weight : of one drone that sees a person at one step, in px^0.5/m; one number for all people or
        one for each. None: half of what one unhidden view of the person pays from where the person
        fills a third of the image's height, the mean over eight directions around the person and
        over the drones' cameras. "first": more than all that pixels and moves can pay, so that a
        plan of more views comes before others, whatever their pixels, where all importances are 0
        or one number; where they differ, pixels may decide between views that differ by less than
        the least importance
    at_least : share of the solid angle that the person has from a drone, with nothing in the way,
        that is to be visible in its image
    share : of all possible views, which plans are asked to keep; `front` finds the best that do

    Returns
    -------
    Problem
        The problem with `objective.views`, in which weights are numbers.

    Raises
    ------
    ProblemError
        If a number is out of range, or no drone has a camera with an image, by which a weight could
        be found; one line names the field.

    Examples
    --------
    >>> twice = co.with_views(problem, cameras=2)
    >>> co.plan(twice, "cocap", time_limit=10).value
    """
    require_problem(problem)
    require(cameras, "cameras", "a whole number", int, np.integer)
    require_number(at_least, "at_least")
    if share is not None:
        require_number(share, "share")
    given = weight if isinstance(weight, str) else _numbers(weight)
    return default_weights.with_views(problem, cameras, given, at_least, share)


def _numbers(weight: float | Sequence[float] | None) -> float | tuple[float, ...] | None:
    """Returns a number, or one for each person, that is checked elsewhere."""
    if isinstance(weight, Sequence | np.ndarray):
        return tuple(weight)
    if weight is not None:
        require_number(weight, "weight")
    return weight
