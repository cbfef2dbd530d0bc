"""A third party's SCIP (PySCIPOpt), with the roots as they are: u^2 <= z. A cross-check.

SCIP keeps u^2 <= z to an absolute tolerance only, and so over-reports a plan's value: J is
recomputed from the paths, and tangents at a plan's pixels are added where it was too high.
"""

import importlib.util
import math
from typing import Any

import numpy as np
from scipy import sparse

from cocap_opt.data import FloatArray
from cocap_opt.formulations.integer_programs.linear_program import LinearProgram
from cocap_opt.formulations.integer_programs.outer_approximation import (
    Root,
    certified_root,
    outer_approximation,
)
from cocap_opt.formulations.integer_programs.program import Answer, Call, Program
from cocap_opt.formulations.relaxations.flow import Amounts
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
    translated = _Translated(program, linear)
    model = translated.model
    model.setParam("limits/gap", call.tolerance)
    model.setParam("limits/time", min(call.stop.seconds_left, NO_TIME_LIMIT))
    if call.hint is not None:
        translated.hint(program.point(call.hint))
    call.attend(model.optimizeNogil, model.interruptSolve)
    return translated.answer()


class _Translated:
    """A program as PySCIPOpt has it."""

    def __init__(self, program: Program, linear: LinearProgram) -> None:
        from pyscipopt import SCIP_PARAMSETTING, Model

        self.program = program
        self.model: Any = Model()
        self.model.hideOutput()
        self.model.setPresolve(SCIP_PARAMSETTING.OFF)  # takes longer than all the rest
        # Its search for symmetries (dejavu) may never end, and hears of no limit.
        self.model.setParam("misc/usesymmetry", 0)
        kinds = np.where(linear.integral, "I", "C").tolist()
        self.variables = [
            self.model.addVar(lb=low, ub=None if math.isinf(high) else high, vtype=kind, obj=gain)
            for low, high, kind, gain in zip(
                linear.low.tolist(), linear.high.tolist(), kinds, linear.gain.tolist(), strict=True
            )
        ]
        self.model.setMaximize()
        self._add_rows(linear)
        n_view_sums = len(program.roots.used)
        pixels, roots = linear.first_pixels, len(self.variables) - n_view_sums
        for k in range(n_view_sums):
            u, z = self.variables[roots + k], self.variables[pixels + k]
            self.model.addCons(u * u <= z)

    def _add_rows(self, linear: LinearProgram) -> None:
        from pyscipopt import quicksum

        rows = sparse.csr_array(linear.rows)
        at, columns, values = (part.tolist() for part in (rows.indptr, rows.indices, rows.data))
        for k, (low, high) in enumerate(
            zip(linear.row_low.tolist(), linear.row_high.tolist(), strict=True)
        ):
            entries = range(at[k], at[k + 1])
            if not entries:
                continue
            paid = quicksum(values[i] * self.variables[columns[i]] for i in entries)
            self.model.addCons(paid == high if low == high else paid <= high)

    def hint(self, point: FloatArray) -> None:
        """Begins with a plan, given by the values of all variables."""
        solution = self.model.createSol()
        for variable, value in zip(self.variables, point.tolist(), strict=True):
            self.model.setSolVal(solution, variable, value)
        self.model.addSol(solution)

    def answer(self) -> Answer:
        """Reads how the solve ended."""
        model = self.model
        status, nodes = str(model.getStatus()), int(model.getNTotalNodes())
        if status in ("infeasible", "inforunbd"):  # the roots are bounded
            return Answer(None, -math.inf, nodes=nodes)
        bound = float(model.getDualbound()) * self.program.unit
        bound = bound if abs(bound) < NO_TIME_LIMIT else math.inf
        if status in ("optimal", "gaplimit"):
            return Answer(self._solution(), bound, nodes=nodes)
        limit = Limit.TIME if status == "timelimit" else Limit.NUMERICS
        message = "" if model.getNSols() else status
        return Answer(self._solution(), bound, limit, nodes, message)

    def _solution(self) -> Amounts | None:
        """Returns the best solution."""
        if not self.model.getNSols():
            return None
        n, e = self.program.flow.n_nodes, self.program.flow.n_edges
        solution = self.model.getBestSol()
        found = np.array([solution[variable] for variable in self.variables[: n + e]])
        return found[:n], found[n:]
