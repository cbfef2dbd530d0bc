"""A problem whose people walk differently in takes that are drawn at random."""

from collections.abc import Sequence

import numpy as np

from cocap_opt.data import ProblemError, require
from cocap_opt.problem import Actor, Problem, State, Take
from cocap_opt.scenarios.spread import Spread, drawn_takes


def with_drawn_takes(
    problem: Problem,
    count: int,
    spread: Spread,
    seed: int = 0,
    probabilities: Sequence[float] | None = None,
    people: Sequence[int] | None = None,
) -> Problem:
    """Returns the problem with takes drawn around the walks of its people.

    Parameters
    ----------
    count : number of takes; in the first, people walk as given
    spread : standard deviations of delays, shifts and speeds
    seed : seed of the random draws
    probabilities : probabilities of the takes; None: all equal
    people : numbers of the people who may walk differently; None: all

    Raises
    ------
    ProblemError
        If the problem has takes, or a number is out of range; the message names the field.
    """
    require(not problem.takes, "problem", "must have no takes yet")
    require(len(problem.actors) > 0, "problem", "must have people, who can walk differently")
    drawn = drawn_takes(
        problem.actors, problem.workspace, problem.horizon, problem.step, spread, count,
        np.random.default_rng(seed), people, lambda actor: _at_a_start(problem, actor),
    )  # fmt: skip
    return problem.replace(
        name=f"{problem.name}, {count} takes",
        takes=_with_chances(drawn.takes, probabilities),
        actors=drawn.actors,
        objective=drawn.objective(problem.objective),
    )


def _with_chances(
    takes: tuple[Take, ...], probabilities: Sequence[float] | None
) -> tuple[Take, ...]:
    """Returns takes with other probabilities; None: unchanged."""
    if probabilities is None:
        return takes
    if len(probabilities) != len(takes):
        raise ProblemError(
            f"probabilities: must be one for each of {len(takes)} takes, not {len(probabilities)}"
        )
    return tuple(take.replace(probability=p) for take, p in zip(takes, probabilities, strict=True))


def _at_a_start(problem: Problem, actor: Actor) -> bool:
    """Returns True if a person is too close at step 0 to a drone that has no other start."""
    return any(
        bool(problem.airspace.near_person(actor, 0, problem.where(robot, [robot.start])).any())
        for robot in problem.robots
        if isinstance(robot.start, State)
    )
