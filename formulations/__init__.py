"""Bounds and exact optima. To add one: one file, and one line in a registry below."""

from formulations.branch_and_price import branch_and_price
from formulations.brute_force import brute_force
from formulations.cheap import alone, online
from formulations.column_generation import column_generation
from formulations.result import BoundMethod, CertifiedResult, ExactMethod

__all__ = ["BOUNDS", "EXACT", "BoundMethod", "CertifiedResult", "ExactMethod"]


BOUNDS: dict[str, BoundMethod] = {
    "alone": alone,
    "online": online,
    "column-generation": column_generation,
}

EXACT: dict[str, ExactMethod] = {
    "branch-and-price": branch_and_price,
    "brute-force": brute_force,
}
