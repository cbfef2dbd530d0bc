"""Bounds and exact optima. To add one: one file, and one line in a registry below."""

from collections.abc import Callable

from cocap_opt.plan import Plan
from cocap_opt.problem import Problem
from cocap_opt.result import Result
from cocap_opt.stop import Stop
from formulations.bound import BoundMethod, BoundResult
from formulations.brute_force import brute_force
from formulations.cheap import alone, online
from formulations.column_generation import column_generation

__all__ = ["BOUNDS", "EXACT", "BoundMethod", "BoundResult"]


def _cone_program(problem: Problem, stop: Stop, plan: Plan | None = None) -> BoundResult:
    from formulations.cone_program import relaxation  # importing cvxpy takes a second or two

    return relaxation(problem, stop, plan)


BOUNDS: dict[str, BoundMethod] = {
    "alone": alone,
    "online": online,
    "relaxation": _cone_program,
    "column-generation": column_generation,
}

EXACT: dict[str, Callable[[Problem, Stop], Result]] = {
    "brute-force": brute_force,
}
