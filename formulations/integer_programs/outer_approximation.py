"""Optima by mixed-integer linear programs: integer aggregated flow, roots from above.

The optimum of such a program (`program`) is an upper bound of J's. Its plan's true J is
recomputed from the paths; where the two differ, tangents at the plan's own pixels make the
program exact there, and it is solved again, until J meets the solver's bound. Any solver of
such programs will do.

The bound that is certified is the root relaxation's; the solver's own is in `statistics`.

Source of outer approximation: Duran and Grossmann 1986.
"""

import math
import time
from collections.abc import Callable

import numpy as np
from cocap_opt.formulations.column_generation.column_generation import column_generation

from cocap_opt.data import FloatArray
from cocap_opt.formulations.certificates import CertificateFile, Multipliers
from cocap_opt.formulations.column_generation.root import Root
from cocap_opt.formulations.integer_programs.program import Call, Program, Solver
from cocap_opt.formulations.relaxations.collision_rows import conflict_rows
from cocap_opt.formulations.relaxations.flow import Compile, Flow, Roots, make_flow
from cocap_opt.formulations.result import (
    OPTIMALITY,
    CertifiedResult,
    Report,
    Snapshot,
    first_plan,
    no_bound,
)
from cocap_opt.model import Model, Path, compiled
from cocap_opt.objective import largest_roots, objective_of, view_sum_weights
from cocap_opt.problem.plan import Plan, conflicts
from cocap_opt.problem.problem import Problem
from cocap_opt.referee import check
from cocap_opt.result import Reason, relative_gap
from cocap_opt.stop import FirstOf, Limit, Stop, TimeLimit, seconds_left

REFUTED = 1e-6  # relative, by which a plan's J must exceed a bound to refute it
FIRST_TOLERANCE = 1e-2  # relative, of the first solve
LEAST_TOLERANCE = 1e-9  # of what can be seen; no solver's bound is more accurate
ROOT_SHARE = 0.5  # of the time that is left goes to the root relaxation at most
SECONDS_BETWEEN_REPORTS = 1.0
BY_THE_SOLVER = "by the solver's word"

Root = Callable[[Problem, Stop], CertifiedResult]


def certified_root(problem: Problem, stop: Stop) -> CertifiedResult:
    """Bound of the root relaxation, with the certificate that proves it.

    Its plan is left to it: a method that is to check another must find its own.
    """
    most = TimeLimit(ROOT_SHARE * seconds_left(stop))
    # Flows are by class, and so must the root's cuts be.
    return column_generation(problem, FirstOf(stop, most), solve_root=Root.solve_aggregated)


def no_root(problem: Problem, stop: Stop) -> CertifiedResult:
    """No bound and no cuts but the solver's own: the generic way, to compare with."""
    return no_bound(Limit.NONE, 0.0)


def outer_approximation(
    problem: Problem,
    stop: Stop,
    start: Plan | None,
    report: Report,
    gap: float,
    solver: Solver,
    root: Root = certified_root,
    compile_: Compile = compiled,
) -> CertifiedResult:
    """Best plan by solving programs until its true J meets the solver's bound.

    Parameters
    ----------
    solver : solves the programs
    root : gives the certificate, and cuts that the programs begin with
    compile_ : makes the model: one flow per class, or one per robot (the same optimum, in a
        larger program)

    Raises
    ------
    UnsupportedError
        If the scene is too large for a flow model (see `cocap_opt.formulations.relaxations.flow`).
    """
    search = _Rounds(problem, compile_(problem), stop, start, report, gap)
    return search.run(solver, root)


class _Rounds:
    """State of one run: the best plan, the bounds, and when they were reported."""

    def __init__(
        self,
        problem: Problem,
        model: Model,
        stop: Stop,
        start: Plan | None,
        report: Report,
        gap: float,
    ) -> None:
        self.begin = time.perf_counter()
        self.problem, self.stop, self.report, self.gap = problem, stop, report, gap
        self.model = model
        self.plan, self.message = first_plan(problem, start)
        self.paths: tuple[Path, ...] | None = None
        self.value = -math.inf
        self.known = -math.inf  # J of any plan, be it the root's: no true bound is below
        self.file: CertificateFile | None = None
        self.bound = self.solver_bound = math.inf
        self.scale = 0.0  # J if one robot saw all at its best
        self.statistics: dict[str, float] = {"rounds": 0, "nodes": 0}
        self._reported = -math.inf

    def run(self, solver: Solver, make_root: Root) -> CertifiedResult:
        """Search until the gap is closed or a limit is reached."""
        limit = self.model.prepare_all(self.stop)
        if limit is not Limit.NONE:
            if self.plan is not None:
                self.value = check(self.problem, self.plan).reward
            return self._result(Reason.STOPPED, limit)
        largest = largest_roots(self.model).max(axis=0)
        self.scale = float(view_sum_weights(self.problem) @ largest)
        if self.plan is not None:
            self._keep(self.model.paths(self.plan))
        flow, limit = make_flow(self.model, self.stop)
        root = make_root(self.problem, self.stop)
        if isinstance(root.certificate, CertificateFile):
            self.file, self.bound = root.certificate, root.bound
        self.known = max(self.known, root.value)
        self._tell()
        if root.reason is Reason.INFEASIBLE:
            return self._result(Reason.INFEASIBLE, Limit.NONE)
        if self._closed(self.bound):
            return self._result(Reason.FINISHED, Limit.NONE)
        if flow is None or (limit := self.stop()) is not Limit.NONE:
            return self._result(Reason.STOPPED, limit)
        if not flow.serves_all:
            return self._result(Reason.INFEASIBLE, Limit.NONE, "a robot has no path")
        multipliers = None if self.file is None else self.file.certificate
        program = Program(
            flow, Roots.of(flow), conflict_rows(flow),
            multipliers if isinstance(multipliers, Multipliers) else None,
        )  # fmt: skip
        self.statistics |= {"edges": flow.n_edges, "whole": program.n_whole}
        return self._repeat(program, solver)

    def _repeat(self, program: Program, solver: Solver) -> CertifiedResult:
        tolerance = FIRST_TOLERANCE
        while True:
            if self.paths is not None:
                program.refine(program.flow.amounts(self.paths)[0])
            answer = solver(program, self._call(program.flow, tolerance))
            self.statistics["rounds"] += 1
            self.statistics["nodes"] += answer.nodes
            new = 0
            if answer.x is not None and answer.y is not None:
                self._found(program.flow, answer.x, answer.y)
                new = program.refine(np.rint(answer.x))
            self.solver_bound = min(self.solver_bound, answer.bound)
            self._tell()
            if self._closed(self.bound):
                return self._result(Reason.FINISHED, Limit.NONE)
            if self.known > self.solver_bound + REFUTED * abs(self.known):
                refuted = f"a plan has J = {self.known}, more than the solver's bound"
                return self._result(Reason.STOPPED, Limit.NUMERICS, refuted)
            if self.solver_bound == -math.inf:
                return self._result(Reason.INFEASIBLE, Limit.NONE, f"no plan {BY_THE_SOLVER}")
            if self._closed(self.solver_bound):
                if not self._proves(self.solver_bound):
                    return self._result(Reason.FINISHED, Limit.NONE)
                return self._result(Reason.OPTIMAL, Limit.NONE, f"optimal {BY_THE_SOLVER}")
            if (limit := self.stop()) is not Limit.NONE:
                return self._result(Reason.STOPPED, limit)
            if answer.limit is not Limit.NONE:
                return self._result(Reason.STOPPED, answer.limit, answer.message)
            least = max(self.gap / 4, LEAST_TOLERANCE)
            if not new and tolerance <= least:
                # The program is exact at its own solution, and yet the gap stays open.
                return self._result(Reason.STOPPED, Limit.NUMERICS, answer.message)
            tolerance = max(least, min(tolerance, self._open_gap()) / 4)

    def _call(self, flow: Flow, tolerance: float) -> Call:
        hint = None if self.paths is None else flow.amounts(self.paths)
        return Call(hint, tolerance, self.stop, self._tick, lambda x, y: self._found(flow, x, y))

    def _found(self, flow: Flow, x: FloatArray, y: FloatArray) -> None:
        """Turn a solver's solution into a plan; one that breaks a rule is dropped."""
        try:
            paths = flow.paths(y, x)
        except ValueError:
            return  # not whole: a solver's tolerance
        if next(conflicts(self.problem, self.model.plan(paths)), None) is None:
            self._keep(paths)

    def _keep(self, paths: tuple[Path, ...]) -> None:
        value = objective_of(self.model, paths)
        if value > self.value:
            self.paths, self.value, self.plan = paths, value, self.model.plan(paths)
            self.known = max(self.known, value)
            self._tell()

    def _open_gap(self) -> float:
        """Relative gap to the solver's bound."""
        if not math.isfinite(self.value) or self.solver_bound <= 0:
            return math.inf
        return max(self.solver_bound - self.value, 0.0) / self.solver_bound

    def _closed(self, bound: float) -> bool:
        return self.value >= bound - max(self.gap * abs(bound), LEAST_TOLERANCE * self.scale)

    def _proves(self, bound: float) -> bool:
        """Whether a bound leaves nothing open."""
        least = LEAST_TOLERANCE * self.scale
        return relative_gap(self.value, bound) <= OPTIMALITY or bound - self.value <= least

    def _tick(self) -> None:
        if time.perf_counter() - self._reported > SECONDS_BETWEEN_REPORTS:
            self._tell()

    def _tell(self) -> None:
        self._reported = time.perf_counter()
        self.report(
            Snapshot(
                self.value, self.bound, self._reported - self.begin,
                nodes=int(self.statistics["nodes"]),
            )
        )  # fmt: skip

    def _result(self, reason: Reason, limit: Limit, message: str = "") -> CertifiedResult:
        if math.isfinite(self.solver_bound):
            self.statistics["solver_bound"] = self.solver_bound
        if self._proves(self.bound):
            reason, limit, message = Reason.OPTIMAL, Limit.NONE, ""
        return CertifiedResult(
            plan=self.plan, value=self.value, reason=reason, limit=limit, bound=self.bound,
            seconds=time.perf_counter() - self.begin,
            message="; ".join(part for part in (self.message, message) if part),
            statistics=self.statistics, certificate=self.file,
        )  # fmt: skip
