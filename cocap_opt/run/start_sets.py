"""Variants of a scene by where its drones start: anywhere, at random, or chosen greedily.

Drones that have a choice of starts keep it, and random and greedy starts are out of it. Those whose
start is fixed may start in any free state.
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
    """Returns the scene whose drones may start anywhere, unless they have a choice already."""
    robots = (
        robot.replace(start=StartArea()) if isinstance(robot.start, State) else robot
        for robot in problem.robots
    )
    return problem.replace(name=f"{problem.name}, free starts", robots=tuple(robots))


def with_random_starts(problem: Problem, seed: int) -> Problem:
    """Returns the scene with random starts that keep the rules.

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
    raise ProblemError("robots: no random starts were found that keep the rules")


def with_greedy_starts(problem: Problem, stop: Stop = never) -> Problem:
    """Returns the scene with the starts that drones choose one after the other.

    Each takes the best path from all of its starts for what the drones before it see, as
    `sequential` plans it.

    Raises
    ------
    ProblemError
        If a drone finds no path.
    LimitReached
        At a limit.
    """
    result = sequential(with_free_starts(problem), stop)
    if result.plan is None:
        raise ProblemError(f"robots: no greedy starts: {result.message}")
    return _fixed(problem, [path[0] for path in result.plan.paths], GREEDY)


def _fixed(problem: Problem, starts: list[State] | tuple[State, ...], kind: str) -> Problem:
    robots = (
        robot.replace(start=start) for robot, start in zip(problem.robots, starts, strict=True)
    )
    return problem.replace(name=f"{problem.name}, {kind} starts", robots=tuple(robots))
