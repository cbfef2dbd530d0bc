"""Conflicts of a plan in words."""

import math

from cocap_opt.data import FloatArray
from cocap_opt.problem import CollisionRules, Conflict, PassConflict, Problem, SwapConflict


def told_conflict(problem: Problem, conflict: Conflict) -> str:
    """Says what two drones do that the rules forbid, without the step."""
    first, second = conflict.robots
    return f"drones {first} and {second} {_deed(problem, conflict)}"


def _deed(problem: Problem, conflict: Conflict) -> str:
    rules = problem.rules
    if isinstance(conflict, SwapConflict):
        return "swap cells"
    if isinstance(conflict, PassConflict):
        tails, heads = map(problem.positions, zip(*conflict.moves, strict=True))
        one, other = rules.meeting(tails, heads).ways(tails, heads)
        return f"pass {_apart(rules, other - one)}"
    one, other = problem.positions(conflict.cells)
    return f"are {_apart(rules, other - one)}" if (one != other).any() else "are in one cell"


def _apart(rules: CollisionRules, way: FloatArray) -> str:
    x, y, z = way.tolist()
    if rules.vertical:
        return (
            f"{math.hypot(x, y):.3g} m apart and {abs(z):.3g} m in height, less than "
            f"{rules.separation:g} m and {rules.vertical:g} m"
        )
    return f"{math.hypot(x, y, z):.3g} m apart, less than {rules.separation:g} m"
