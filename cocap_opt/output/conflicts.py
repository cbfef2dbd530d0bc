"""Conflicts of a plan in words."""

import math
import re
from collections.abc import Iterator, Sequence

from cocap_opt.data import FloatArray
from cocap_opt.problem import CollisionRules, Conflict, PassConflict, Problem, SwapConflict

_LINE = re.compile(r"step (\d+)(?: to (\d+))?: (drones \d+ and \d+) (.*)")


def told_conflict(problem: Problem, conflict: Conflict) -> str:
    """Returns the movement of two drones that the rules forbid, without the step."""
    first, second = conflict.robots
    return f"drones {first} and {second} {_deed(problem, conflict)}"


def _deed(problem: Problem, conflict: Conflict) -> str:
    rules = problem.rules
    if isinstance(conflict, SwapConflict):
        return "swap cells"
    if isinstance(conflict, PassConflict):
        tails, heads = map(problem.positions, zip(*conflict.moves, strict=True))
        first, second = rules.meeting(tails, heads).ways(tails, heads)
        return f"pass {_apart(rules, second - first)}"
    first, second = problem.positions(conflict.cells)
    if (first == second).all():
        return "are in one cell"
    return f"are {_apart(rules, second - first)}"


def _apart(rules: CollisionRules, way: FloatArray) -> str:
    x, y, z = way.tolist()
    if rules.vertical:
        return (
            f"{math.hypot(x, y):.3g} m apart and {abs(z):.3g} m in height, less than "
            f"{rules.separation:g} m and {rules.vertical:g} m"
        )
    return f"{math.hypot(x, y, z):.3g} m apart, less than {rules.separation:g} m"


def are_conflicts(lines: Sequence[str]) -> bool:
    """Returns True if all of the referee's lines are conflicts of two drones."""
    return all(_LINE.fullmatch(line) for line in lines)


def grouped_conflicts(lines: Sequence[str]) -> list[str]:
    """Returns a line for each pair of drones, with all its steps, from a line for each conflict.

    If a pair breaks a rule in several ways, e.g. at several distances, the first is given.

    Parameters
    ----------
    lines : lines in the referee's words
    """
    found: dict[str, tuple[list[tuple[int, int]], list[str]]] = {}
    others = []
    for line in lines:
        if not (match := _LINE.fullmatch(line)):
            others.append(line)
            continue
        first, last, pair, deed = match.groups()
        times, deeds = found.setdefault(pair, ([], []))
        times.append((int(first), int(last or first)))
        deeds.append(deed)
    return others + [
        f"{pair} {deeds[0]}{' at first' if len(set(deeds)) > 1 else ''}: {_steps(times)}"
        for pair, (times, deeds) in found.items()
    ]


def _steps(times: Sequence[tuple[int, int]]) -> str:
    """Returns steps in words, with consecutive steps as ranges."""
    words = [f"{a}" if a == b else f"{a} to {b}" for a, b in _merged(times)]
    noun = "step" if words == [f"{times[0][0]}"] else "steps"
    return f"{noun} {', '.join(words[:-1])}{' and ' if words[1:] else ''}{words[-1]}"


def _merged(times: Sequence[tuple[int, int]]) -> Iterator[tuple[int, int]]:
    """Yields the first and the last step of each run of steps without a gap."""
    begin, end = times[0]
    for first, last in times[1:]:
        if first > end + 1:
            yield begin, end
            begin = first
        end = max(end, last)
    yield begin, end
