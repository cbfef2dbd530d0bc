"""Bounds and exact optima. To add one: one file, and one line in a registry below."""

from cocap_opt.problem import Problem
from cocap_opt.result import Result
from cocap_opt.stop import Stop
from formulations.bound import BoundMethod, BoundResult
from formulations.brute_force import brute_force
from formulations.cheap import alone, online
from formulations.column_generation import column_generation
from formulations.relaxation import relaxation

__all__ = ["BOUNDS", "EXACT", "BoundMethod", "BoundResult", "Problem", "Result", "Stop"]

BOUNDS: dict[str, BoundMethod] = {
    "alone": alone,
    "online": online,
    "relaxation": relaxation,
    "column-generation": column_generation,
}

EXACT = {"brute-force": brute_force}
