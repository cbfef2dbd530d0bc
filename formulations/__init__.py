"""Bounds and exact optima. To add one: one file, and one line in a registry below."""

from functools import partial
from importlib import import_module
from typing import Any

from formulations.result import BoundMethod, CertifiedResult, ExactMethod

__all__ = ["BOUNDS", "EXACT", "BoundMethod", "CertifiedResult", "ExactMethod"]


def _call(module: str, function: str, *arguments: Any, **options: Any) -> CertifiedResult:
    result: CertifiedResult = getattr(import_module(module), function)(*arguments, **options)
    return result


def _lazy(module: str, function: str) -> Any:
    """A method whose module is imported when it is first called: some solvers take seconds."""
    return partial(_call, module, function)


BOUNDS: dict[str, BoundMethod] = {
    "alone": _lazy("formulations.cheap", "alone"),
    "online": _lazy("formulations.cheap", "online"),
    "concave": _lazy("formulations.cone_program", "concave"),
    "single-view": _lazy("formulations.cone_program", "single_view"),
    "envelope": _lazy("formulations.cone_program", "envelope"),
    "column-generation": _lazy("formulations.column_generation", "column_generation"),
}

EXACT: dict[str, ExactMethod] = {
    "brute-force": _lazy("formulations.brute_force", "brute_force"),
    "branch-and-price": _lazy("formulations.branch_and_price", "branch_and_price"),
    "highs": _lazy("formulations.mathopt", "highs"),
    "scip": _lazy("formulations.mathopt", "scip"),
    "cp-sat": _lazy("formulations.cp_sat", "cp_sat"),
    "scip-nonlinear": _lazy("formulations.scip_nonlinear", "scip_nonlinear"),  # needs PySCIPOpt
}
