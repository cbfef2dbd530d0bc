"""Solves programs with SCIP (through PySCIPOpt) and exact roots, u^2 <= z, as a cross-check.

SCIP satisfies u^2 <= z only to an absolute tolerance, so it overestimates a plan's value: J is
recomputed from the paths, and tangents at a plan's pixels are added if it was too high.
"""

import importlib.util
import math
from contextlib import nullcontext
from typing import Any

import numpy as np
from scipy import sparse

from cocap_opt.formulations.integer_programs.outer_approximation import OuterApproximation
from cocap_opt.formulations.integer_programs.program import (
    Answer,
    Call,
    LinearProgram,
    Program,
    Solver,
)
from cocap_opt.formulations.solvers import ending, options
from cocap_opt.result import UnsupportedError
from cocap_opt.stop import Limit

__all__ = ["scip_nonlinear"]

_INFINITY = 1e20  # SCIP's own value
MOST_VARIABLES = 20_000  # with more, SCIP may ignore a limit for minutes


def _solver() -> nullcontext[Solver]:
    """Provides the solver; raises UnsupportedError if PySCIPOpt is not installed."""
    if importlib.util.find_spec("pyscipopt") is None:
        raise UnsupportedError("scip-nonlinear needs PySCIPOpt: pip install 'cocap-opt[pyscipopt]'")
    return nullcontext(_solve)


scip_nonlinear = OuterApproximation(_solver)


def _solve(program: Program, call: Call) -> Answer:
    """Solves a program with the constraints u^2 <= z in addition to its rows."""
    linear = LinearProgram.of(program)
    if len(linear.gain) > MOST_VARIABLES:
        message = f"scip-nonlinear takes at most {MOST_VARIABLES} variables; this program has"
        return Answer(None, math.inf, Limit.MEMORY, message=f"{message} {len(linear.gain)}")
    model, variables = _translated(program, linear)
    model.setParams(options("SCIP", call.stop, call.tolerance))
    if call.hint is not None:
        solution = model.createSol()
        for variable, value in zip(variables, program.point(call.hint).tolist(), strict=True):
            model.setSolVal(solution, variable, value)
        model.addSol(solution)
    call.attend(model.optimizeNogil, model.interruptSolve)
    return _answer(program, model, variables)


def _translated(program: Program, linear: LinearProgram) -> tuple[Any, list[Any]]:
    """Returns a program as a PySCIPOpt model, and its variables."""
    from pyscipopt import SCIP_PARAMSETTING, Model, quicksum

    model: Any = Model()
    model.hideOutput()
    model.setPresolve(SCIP_PARAMSETTING.OFF)  # presolve takes longer than all the rest
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
    for k in range(program.roots.returns.n_roots):
        u, z = variables[roots + k], variables[pixels + k]
        model.addCons(u * u <= z)
    return model, variables


def _answer(program: Program, model: Any, variables: list[Any]) -> Answer:
    """Reads the outcome of a solve."""
    status = str(model.getStatus())
    bound = float(model.getDualbound()) * program.unit
    solution, message = None, status
    if model.getNSols():
        best, n, e = model.getBestSol(), program.flow.n_nodes, program.flow.n_edges
        found = np.array([best[variable] for variable in variables[: n + e]])
        solution, message = (found[:n], found[n:]), ""
    bound = bound if abs(bound) < _INFINITY else math.inf
    nodes = int(model.getNTotalNodes())
    return Answer.ended(ending("SCIP", status), solution, bound, nodes, message)
