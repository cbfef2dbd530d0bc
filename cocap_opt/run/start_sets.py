"""Variants of a scene with other starts: free, random, or chosen greedily.

Drones that have a choice of starts keep it; random and greedy starts are taken from it. Drones with
a fixed start may start in any free state.
"""

from contextlib import suppress

import numpy as np

from cocap_opt.data import ProblemError
from cocap_opt.planners.sequential import sequential
from cocap_opt.problem import Problem, StartArea, StartSet, State
from cocap_opt.problem.placement import UndecidedError
from cocap_opt.stop import Stop, never

FREE, RANDOM, GREEDY = "free", "random", "greedy"
KINDS = (FREE, RANDOM, GREEDY)


def with_free_starts(problem: Problem) -> Problem:
    """Returns the scene with drones that may start anywhere, unless they already have a choice."""
    robots = (
        robot.replace(start=StartArea()) if isinstance(robot.start, State) else robot
        for robot in problem.robots
    )
    return problem.replace(name=f"{problem.name}, free starts", robots=tuple(robots))


def with_random_starts(problem: Problem, seed: int) -> Problem:
    """Returns the scene with random starts that obey the rules.

    Raises
    ------
    ProblemError
        If none are found.
    """
    free, rng = with_free_starts(problem), np.random.default_rng([seed, 0])
    shuffled = [StartSet(states.array[rng.permutation(len(states))]) for states in free.starts]
    with suppress(UndecidedError):
        chosen = free.starts_apart(shuffled)
        if chosen is not None:
            return _fixed(problem, chosen, RANDOM)
    raise ProblemError("robots: no random starts that obey the rules were found")


def with_greedy_starts(problem: Problem, stop: Stop = never) -> Problem:
    """Returns the scene with starts that drones choose one after the other.

    Each drone takes the best path from any of its starts, given what the drones before it see, as
    in `sequential`.

    Raises
    ------
    ProblemError
        If a drone has no path.
    LimitReached
        If a limit is reached.
    """
    result = sequential(with_free_starts(problem), stop)
    if result.plan is None:
        raise ProblemError(f"robots: no greedy starts found: {result.message}")
    return _fixed(problem, [path[0] for path in result.plan.paths], GREEDY)


def _fixed(problem: Problem, starts: list[State] | tuple[State, ...], kind: str) -> Problem:
    robots = (
        robot.replace(start=start) for robot, start in zip(problem.robots, starts, strict=True)
    )
    return problem.replace(name=f"{problem.name}, {kind} starts", robots=tuple(robots))
