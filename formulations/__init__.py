"""Bounds and exact optima. To add one: one file, and one line in a registry below."""

from functools import partial
from importlib import import_module
from typing import Any

from cocap_opt.formulations.result import BoundMethod, CertifiedResult, ExactMethod

__all__ = ["BOUNDS", "EXACT", "BoundMethod", "CertifiedResult", "ExactMethod"]


def _call(module: str, function: str, *arguments: Any, **options: Any) -> CertifiedResult:
    result: CertifiedResult = getattr(import_module(module), function)(*arguments, **options)
    return result


def _lazy(module: str, function: str) -> Any:
    """A method whose module is imported when it is first called: some solvers take seconds."""
    return partial(_call, module, function)


BOUNDS: dict[str, BoundMethod] = {
    "alone": _lazy("cocap_opt.formulations.simple_bounds", "alone"),
    "online": _lazy("cocap_opt.formulations.simple_bounds", "online"),
    "concave": _lazy("cocap_opt.formulations.relaxations.cone_program", "concave"),
    "single-view": _lazy("cocap_opt.formulations.relaxations.cone_program", "single_view"),
    "envelope": _lazy("cocap_opt.formulations.relaxations.cone_program", "envelope"),
    "column-generation": _lazy(
        "cocap_opt.formulations.column_generation.root_bound", "column_generation"
    ),
}

EXACT: dict[str, ExactMethod] = {
    "brute-force": _lazy("cocap_opt.formulations.brute_force", "brute_force"),
    "branch-and-price": _lazy(
        "cocap_opt.formulations.column_generation.branch_and_price", "branch_and_price"
    ),
    "highs": _lazy("cocap_opt.formulations.integer_programs.mathopt", "highs"),
    "scip": _lazy("cocap_opt.formulations.integer_programs.mathopt", "scip"),
    "cp-sat": _lazy("cocap_opt.formulations.integer_programs.cp_sat", "cp_sat"),
    "scip-nonlinear": _lazy(
        "cocap_opt.formulations.integer_programs.scip_nonlinear", "scip_nonlinear"
    ),  # needs PySCIPOpt
}
