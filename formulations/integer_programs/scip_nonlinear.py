"""A third party's SCIP (PySCIPOpt), with the roots as they are: u^2 <= z. A cross-check.

SCIP keeps u^2 <= z to an absolute tolerance only, and so over-reports a plan's value: J is
recomputed from the paths, and tangents at a plan's pixels are added where it was too high.
"""

import importlib.util
import math
from typing import Any

import numpy as np
from scipy import sparse

from cocap_opt.formulations.integer_programs.outer_approximation import (
    Root,
    certified_root,
    outer_approximation,
)
from cocap_opt.formulations.integer_programs.program import Answer, Call, LinearProgram, Program
from cocap_opt.formulations.result import OPTIMALITY, CertifiedResult, Report, silent
from cocap_opt.problem import Plan, Problem
from cocap_opt.result import UnsupportedError
from cocap_opt.stop import Limit, Stop, never

__all__ = ["scip_nonlinear"]

NO_TIME_LIMIT = 1e20  # s, SCIP's own infinity
MOST_VARIABLES = 20_000  # beyond, SCIP may not hear of a limit for minutes


def scip_nonlinear(
    problem: Problem,
    stop: Stop = never,
    start: Plan | None = None,
    report: Report = silent,
    gap: float = OPTIMALITY,
    root: Root | None = certified_root,
) -> CertifiedResult:
    """Computes the optimum by SCIP's own branch and bound over the nonlinear program.

    Parameters
    ----------
    root : gives the certificate and the first cuts, or None (see `outer_approximation`)

    Raises
    ------
    UnsupportedError
        If PySCIPOpt is not installed, or the scene is too large for a flow model.
    """
    if importlib.util.find_spec("pyscipopt") is None:
        raise UnsupportedError("scip-nonlinear needs PySCIPOpt: pip install 'cocap-opt[pyscipopt]'")
    return outer_approximation(problem, stop, start, report, gap, _solve, root)


def _solve(program: Program, call: Call) -> Answer:
    """Solves a program with u^2 <= z besides its rows."""
    linear = LinearProgram.of(program)
    if len(linear.gain) > MOST_VARIABLES:
        message = f"scip-nonlinear takes at most {MOST_VARIABLES} variables, here are "
        return Answer(None, math.inf, Limit.MEMORY, message=f"{message}{len(linear.gain)}")
    model, variables = _translated(program, linear)
    model.setParam("limits/gap", call.tolerance)
    model.setParam("limits/time", min(call.stop.seconds_left, NO_TIME_LIMIT))
    if call.hint is not None:
        solution = model.createSol()
        for variable, value in zip(variables, program.point(call.hint).tolist(), strict=True):
            model.setSolVal(solution, variable, value)
        model.addSol(solution)
    call.attend(model.optimizeNogil, model.interruptSolve)
    return _answer(program, model, variables)


def _translated(program: Program, linear: LinearProgram) -> tuple[Any, list[Any]]:
    """Returns a program as PySCIPOpt has it, and its variables."""
    from pyscipopt import SCIP_PARAMSETTING, Model, quicksum

    model: Any = Model()
    model.hideOutput()
    model.setPresolve(SCIP_PARAMSETTING.OFF)  # takes longer than all the rest
    # Its search for symmetries (dejavu) may never end, and hears of no limit.
    model.setParam("misc/usesymmetry", 0)
    kinds = np.where(linear.integral, "I", "C").tolist()
    variables = [
        model.addVar(lb=low, ub=None if math.isinf(high) else high, vtype=kind, obj=gain)
        for low, high, kind, gain in zip(
            linear.low.tolist(), linear.high.tolist(), kinds, linear.gain.tolist(), strict=True
        )
    ]
    model.setMaximize()
    rows = sparse.csr_array(linear.rows)
    at, columns, values = (part.tolist() for part in (rows.indptr, rows.indices, rows.data))
    for k, (low, high) in enumerate(
        zip(linear.row_low.tolist(), linear.row_high.tolist(), strict=True)
    ):
        entries = range(at[k], at[k + 1])
        if not entries:
            continue
        paid = quicksum(values[i] * variables[columns[i]] for i in entries)
        model.addCons(paid == high if low == high else paid <= high)
    n_view_sums = len(program.roots.used)
    pixels, roots = linear.first_pixels, len(variables) - n_view_sums
    for k in range(n_view_sums):
        u, z = variables[roots + k], variables[pixels + k]
        model.addCons(u * u <= z)
    return model, variables


def _answer(program: Program, model: Any, variables: list[Any]) -> Answer:
    """Reads how a solve ended."""
    status, nodes = str(model.getStatus()), int(model.getNTotalNodes())
    if status in ("infeasible", "inforunbd"):  # the roots are bounded
        return Answer(None, -math.inf, nodes=nodes)
    bound = float(model.getDualbound()) * program.unit
    bound = bound if abs(bound) < NO_TIME_LIMIT else math.inf
    solution, message = None, status
    if model.getNSols():
        best, n, e = model.getBestSol(), program.flow.n_nodes, program.flow.n_edges
        found = np.array([best[variable] for variable in variables[: n + e]])
        solution, message = (found[:n], found[n:]), ""
    if status in ("optimal", "gaplimit"):
        return Answer(solution, bound, nodes=nodes)
    limit = Limit.TIME if status == "timelimit" else Limit.NUMERICS
    return Answer(solution, bound, limit, nodes, message)
