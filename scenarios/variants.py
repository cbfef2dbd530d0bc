"""Variants of a scene: pixels that accumulate over time, and rewards for the number of views."""

from typing import Literal

from cocap_opt.problem import Problem
from cocap_opt.vision.default_weights import with_views


def over_time(problem: Problem) -> Problem:
    """Returns the scene with pixels that accumulate over time as well as over drones."""
    objective = problem.objective.replace(over_time=True)
    return problem.replace(name=f"{problem.name}-over-time", objective=objective)


def counting_views(
    problem: Problem,
    cameras: int,
    weight: float | Literal["first"] | None = None,
    share: float | None = None,
) -> Problem:
    """Returns the scene with counted views, as `with_views` does.

    Raises
    ------
    ProblemError
        If a number is out of range.
    """
    found = with_views(problem, cameras, weight, share=share)
    return found.replace(name=f"{problem.name}-views{cameras}")
