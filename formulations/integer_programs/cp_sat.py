"""Solves the outer approximation with CP-SAT, OR-tools' solver over integers.

Roots become integers V, in a unit so small that rounding up all coefficients changes J by less than
ROUNDING: with V <= sum ceil(a) x + ceil(b) instead of w u <= sum a x + b, no plan's J is cut off,
and the program's optimum remains an upper bound.
"""

import math
from contextlib import nullcontext
from typing import Any

import numpy as np
from scipy import sparse

from cocap_opt.data import BoolArray, FloatArray, IntArray
from cocap_opt.formulations.integer_programs.outer_approximation import OuterApproximation
from cocap_opt.formulations.integer_programs.program import Answer, Call, Program, Solver
from cocap_opt.formulations.relaxations.flow import Amounts
from cocap_opt.formulations.solvers import ending, options

__all__ = ["cp_sat"]

ROUNDING = 1e-8  # relative to the largest J, for all roundings together
MOST = 2.0**52  # largest J in the integer unit


def _solve(program: Program, call: Call) -> Answer:
    """Solves a program."""
    from ortools.sat.python import cp_model

    translated = _Translated(program)
    if call.hint is not None:
        translated.hint(call.hint)
    solver = cp_model.CpSolver()
    for name, value in options("CP-SAT", call.stop, call.tolerance).items():
        setattr(solver.parameters, name, value)
    solutions: list[Amounts] = []

    class Collect(cp_model.CpSolverSolutionCallback):
        def on_solution_callback(self) -> None:
            solutions.append(translated.solution(self.response_proto.solution))

    def tick() -> None:
        while solutions:
            call.found(solutions.pop(0))
        call.tick()

    collect = Collect()
    call._replace(tick=tick).attend(
        lambda: solver.solve(translated.model, collect), solver.stop_search
    )
    return _answer(solver, translated)


def _answer(solver: Any, translated: "_Translated") -> Answer:
    """Reads the outcome of a solve."""
    status = solver.status_name(solver.response_proto.status)
    if status == "MODEL_INVALID":
        return Answer.failed(f"CP-SAT rejects the model: {translated.model.validate()}")
    # The bound is valid for every status (unlike the objective's value), once there is one: before
    # the search begins it is 0.
    bound = solver.best_objective_bound / translated.scale
    if status == "UNKNOWN" and bound == 0.0:
        bound = math.inf
    solution = None
    if status in ("OPTIMAL", "FEASIBLE"):
        solution = translated.solution(solver.response_proto.solution)
    return Answer.ended(ending("CP-SAT", status), solution, bound, int(solver.num_branches))


def _solver() -> nullcontext[Solver]:
    """Provides the solver, which needs no closing."""
    return nullcontext(_solve)


cp_sat = OuterApproximation(_solver)


class _Translated:
    """A program in integers, as a CP-SAT model.

    Attributes
    ----------
    scale : units of the integer objective per unit of J
    """

    def __init__(self, program: Program) -> None:
        from ortools.sat.python import cp_model

        self.program = program
        flow, roots = program.flow, program.roots
        horizon = flow.model.problem.horizon
        n_terms = len(roots.used) * (program.n_robots + 2) + program.n_robots * horizon + 1
        n, caps = roots.returns.n_roots, np.minimum(roots.returns.caps, program.n_robots)
        # Roots, in units of their best view, and counts.
        largest = np.append(np.full(n, math.sqrt(program.n_views)), caps)
        most = float(roots.weights[:n].sum()) * math.sqrt(program.n_views)
        most += float(roots.weights[n:] @ caps)
        most += flow.largest_bonus * program.n_robots * horizon
        self.scale = min(n_terms / ROUNDING, MOST) / most if most > 0 else 1.0
        self.model = cp_model.CpModel()
        first = ~flow.is_entered
        low = np.where(first, flow.supply, 0.0)
        high = np.where(first, flow.supply, flow.capacity)
        self.x = self._variables(low, high)
        self.y = self._variables(np.zeros(flow.n_edges), flow.capacity[flow.tails])
        self.worth = self.scale * roots.weights  # worth of roots and counts in the program's units
        self.v = self._variables(np.zeros(len(roots.used)), _up(self.worth * largest))
        self._flow_rows()
        self._root_rows()
        bonus = _up(self.scale * flow.bonus)
        paid = [int(bonus[e]) * self.y[e] for e in np.flatnonzero(bonus).tolist()]
        self.model.maximize(sum(self.v) + sum(paid))

    def _variables(self, low: FloatArray | IntArray, high: FloatArray | IntArray) -> list[Any]:
        bounds = zip(*(part.astype(np.int64).tolist() for part in (low, high)), strict=True)
        return [self.model.new_int_var(a, b, "") for a, b in bounds]

    def _flow_rows(self) -> None:
        flow, conflicts = self.program.flow, self.program.conflicts
        later = flow.is_entered
        before = flow.steps < flow.model.problem.horizon
        for n, edges in _members(flow.entering, later):
            self.model.add(sum(self.y[e] for e in edges) + int(flow.supply[n]) == self.x[n])
        for n, edges in _members(flow.leaving, before):
            self.model.add(sum(self.y[e] for e in edges) == self.x[n])
        for _, nodes in _members(conflicts.at_nodes):
            self.model.add(sum(self.x[n] for n in nodes) <= 1)
        for _, edges in _members(conflicts.crossing):
            self.model.add(sum(self.y[e] for e in edges) <= 1)

    def _root_rows(self) -> None:
        program, roots = self.program, self.program.roots
        for z in range(len(roots.used)):
            self._bound_root(z, roots.seen, z, self.worth[z], 0.0)
        for z, z0 in zip(*(part.tolist() for part in program.tangents), strict=True):
            slope = self.worth[z] / (2 * math.sqrt(z0))
            constant = self.worth[z] * math.sqrt(z0) / 2
            self._bound_root(z, roots.pixels, z, slope, constant)
        phi, constants, at = roots.cut_rows(program.cuts)
        for k, (z, constant) in enumerate(zip(at.tolist(), constants.tolist(), strict=True)):
            self._bound_root(z, phi, k, self.worth[z], self.worth[z] * constant)

    def _bound_root(
        self, z: int, matrix: sparse.csr_array, row: int, factor: float, constant: float
    ) -> None:
        """Adds V <= sum ceil(factor * row) x + ceil(constant)."""
        from ortools.sat.python import cp_model

        part = slice(matrix.indptr[row], matrix.indptr[row + 1])
        coefficients = _up(factor * matrix.data[part])
        nodes = [self.x[n] for n in matrix.indices[part].tolist()]
        paid = cp_model.LinearExpr.weighted_sum(nodes, coefficients.tolist())
        self.model.add(self.v[z] <= paid + int(_up(np.array([constant]))[0]))

    def hint(self, plan: Amounts) -> None:
        """Starts the search from a plan."""
        x, y = plan
        roots = np.floor(self.worth * self.program.roots_at(x)).astype(np.int64)
        for variables, values in ((self.x, np.rint(x)), (self.y, np.rint(y)), (self.v, roots)):
            for variable, value in zip(variables, values.astype(np.int64).tolist(), strict=True):
                self.model.add_hint(variable, value)

    def solution(self, values: Any) -> Amounts:
        """Returns a solution from the variables' values, in order."""
        n, e = len(self.x), len(self.y)
        found = np.fromiter(values, dtype=np.float64, count=n + e)
        return found[:n], found[n:]


def _up(values: FloatArray) -> IntArray:
    """Returns integers that are not below the values, allowing for rounding errors."""
    return np.ceil(values * (1 + 1e-12)).astype(np.int64)


def _members(
    matrix: sparse.csr_array, which: BoolArray | None = None
) -> list[tuple[int, list[int]]]:
    """Returns each row with the columns of its entries."""
    rows = range(matrix.shape[0]) if which is None else np.flatnonzero(which).tolist()
    at, columns = matrix.indptr.tolist(), matrix.indices.tolist()
    return [(row, columns[at[row] : at[row + 1]]) for row in rows]
