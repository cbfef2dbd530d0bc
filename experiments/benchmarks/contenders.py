"""The generic way: one model of the whole instance, given to a solver.

The programs are those of `formulations.outer_approximation`. Alone, a solver gets no bound and
no cuts but its own; with our root, it begins with the bound and the cuts of our column
generation, and is done once its plan meets that bound.
"""

from functools import partial

from cocap_opt.plan import Plan
from cocap_opt.problem import Problem
from cocap_opt.stop import Stop, never
from formulations import cp_sat as cp_sat_solver
from formulations.mathopt import solve
from formulations.outer_approximation import Root, certified_root, no_root, outer_approximation
from formulations.result import OPTIMALITY, BoundMethod, CertifiedResult, Report, silent


def _mathopt(
    problem: Problem,
    stop: Stop = never,
    start: Plan | None = None,
    report: Report = silent,
    *,
    solver: str,
    root: Root,
) -> CertifiedResult:
    return solve(solver, problem, stop, start, report, OPTIMALITY, root)


def _cp_sat(
    problem: Problem,
    stop: Stop = never,
    start: Plan | None = None,
    report: Report = silent,
    *,
    root: Root,
) -> CertifiedResult:
    return outer_approximation(
        problem, stop, start, report, OPTIMALITY, cp_sat_solver.solve, root
    )  # fmt: skip


def _all(root: Root) -> dict[str, BoundMethod]:
    return {
        "highs": partial(_mathopt, solver="HIGHS", root=root),
        "scip": partial(_mathopt, solver="GSCIP", root=root),
        "cp-sat": partial(_cp_sat, root=root),
    }


ALONE = _all(no_root)
WITH_OUR_ROOT = _all(certified_root)
