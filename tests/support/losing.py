"""J of plans whose drones are lost on the way, by the evaluator of brute force."""

from collections.abc import Sequence

import numpy as np
from brute_force import bonus_of, pixels_of, views_of

from cocap_opt.problem import Plan, Problem


def value_with(problem: Problem, plan: Plan, step: int, lost: Sequence[int]) -> float:
    """J of a plan whose lost drones see nobody from a step on, and make no move then."""
    pixels, moves = 0.0, 0.0
    for i, path in enumerate(plan.paths):
        seen = pixels_of(problem, i, [path])[0]
        if i in lost:
            seen[step:] = 0.0
        pixels = pixels + seen
        moves += bonus_of(problem, path[: step + 1] if i in lost else path)
    return float(views_of(problem, np.asarray(pixels)[None])[0]) + moves
