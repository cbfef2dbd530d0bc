"""Computes optima by mixed-integer linear programs: integer aggregated flow, with roots bounded
from above.

The optimum of such a program (`program`) is an upper bound on J. The true J of its plan is
recomputed from the paths; if the two differ, tangents at the plan's own pixels make the program
exact there, and it is solved again, until J meets the solver's bound. Any solver for such programs
can be used.

The certified bound is that of the root relaxation; the solver's own bound is in `statistics`.

Source of outer approximation: Duran and Grossmann 1986.
"""

import math
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace

import numpy as np

from cocap_opt.formulations.certificates import CertificateFile, Multipliers
from cocap_opt.formulations.column_generation.branch_and_price import column_generation
from cocap_opt.formulations.column_generation.tree.root import Root as RootSearch
from cocap_opt.formulations.integer_programs.program import Answer, Call, Program, Solver
from cocap_opt.formulations.relaxations.collision_rows import ConflictRows
from cocap_opt.formulations.relaxations.flow import Amounts, Compile, Flow, Roots
from cocap_opt.formulations.result import (
    OPTIMALITY,
    CertifiedResult,
    Report,
    Snapshot,
    checked_start,
    proved_by,
    silent,
)
from cocap_opt.formulations.simple_bounds import early_bound
from cocap_opt.model import Model, Path, compiled
from cocap_opt.objective import objective
from cocap_opt.problem import Plan, Problem
from cocap_opt.referee import check
from cocap_opt.result import Reason
from cocap_opt.stop import Clock, FirstOf, Limit, LimitReached, Stop, TimeLimit, never
from cocap_opt.timing import timed

__all__ = ["OuterApproximation", "Root", "certified_root"]

REFUTED = 1e-6  # relative excess of a plan's J over a bound that refutes the bound
FIRST_TOLERANCE = 1e-2  # relative tolerance of the first solve
LEAST_TOLERANCE = 1e-9  # relative to the largest possible J; no solver's bound is more accurate
ROOT_SHARE = 0.5  # largest share of the remaining time that the root relaxation gets
SECONDS_BETWEEN_REPORTS = 1.0
BY_THE_SOLVER = "according to the solver"

Root = Callable[[Problem, Stop], CertifiedResult]  # bounds a problem before it is solved


def certified_root(problem: Problem, stop: Stop) -> CertifiedResult:
    """Returns the bound of the root relaxation, with the certificate that proves it.

    The result has no plan: a method that checks another must find its own.
    """
    most = TimeLimit(ROOT_SHARE * stop.seconds_left)
    # Flows are by class, so the root's cuts must be, too.
    return column_generation(problem, FirstOf(stop, most), solve_root=RootSearch.solve_aggregated)


@dataclass(frozen=True)
class OuterApproximation:
    """Solves programs until the true J of a plan meets the solver's bound.

    The argument `root` gives the certificate, and cuts for the first program. None: there is no
    certified bound, and the only cuts are the solver's, as in a generic model; for comparisons.
    Scenes that are too large for a flow raise UnsupportedError (see
    `cocap_opt.formulations.relaxations.flow`), as does a solver that is not installed.

    Attributes
    ----------
    solver : opens a solver for the programs of one problem, and closes it
    compile_ : makes the model: one flow per class, or one per robot (same optimum, larger program)
    """

    solver: Callable[[], AbstractContextManager[Solver]]
    compile_: Compile = compiled

    def __call__(
        self,
        problem: Problem,
        stop: Stop = never,
        start: Plan | None = None,
        report: Report = silent,
        gap: float = OPTIMALITY,
        root: Root | None = certified_root,
    ) -> CertifiedResult:
        """Solves programs as the class describes."""

        @timed
        def solve(problem: Problem) -> CertifiedResult:
            rounds = _Rounds(problem, self.compile_(problem), stop, start, report, gap)
            try:
                return rounds.run(solver, root)
            except LimitReached as reached:
                return rounds.result(Reason.STOPPED, limit=reached.limit)

        with self.solver() as solver:
            return solve(problem)


class _Rounds:
    """State of one run: the best plan, the bounds, and when they were reported.

    Attributes
    ----------
    known : largest J of any plan, including the root's; no valid bound is lower
    scale : J if one robot had the best view of everything
    """

    def __init__(
        self,
        problem: Problem,
        model: Model,
        stop: Stop,
        start: Plan | None,
        report: Report,
        gap: float,
    ) -> None:
        self.clock = Clock()
        self.problem, self.stop, self.report, self.gap = problem, stop, report, gap
        self.model = model
        self.plan, self.message = checked_start(problem, start)
        if self.plan is None:
            self.plan = Plan.hovering(problem)
        self.paths: tuple[Path, ...] | None = None
        self.value = self.known = -math.inf
        self.file: CertificateFile | None = None
        self.bound = self.solver_bound = math.inf
        self.scale = 0.0
        self.statistics: dict[str, float] = {"rounds": 0, "nodes": 0}
        self._reported = -math.inf

    def run(self, solver: Solver, make_root: Root | None) -> CertifiedResult:
        """Searches until the gap is closed.

        Raises
        ------
        LimitReached
            If a limit is reached; the plan and the bound so far are kept.
        """
        try:
            self.model.prepare_all(self.stop)
        except LimitReached as reached:
            if self.plan is not None:
                self.value = check(self.problem, self.plan).reward
            if make_root is not None:
                early = early_bound(self.problem, reached.limit)
                self.bound = early.bound
                if isinstance(early.certificate, CertificateFile):
                    self.file = early.certificate
            raise
        self.scale = float(self.problem.view_sum_weights @ self.model.largest_roots().max(axis=0))
        if self.plan is not None:
            self._keep(self.model.paths(self.plan))
        try:
            flow = Flow.of(self.model, self.stop)
        except LimitReached as reached:  # the root may still have a bound
            proved = self._take_root(make_root)
            return proved or self.result(Reason.STOPPED, limit=reached.limit)
        proved = self._take_root(make_root)
        if proved is not None:
            return proved
        self.stop.check()
        if not flow.serves_all:
            return self.result(Reason.INFEASIBLE, "a drone has no path")
        multipliers = None if self.file is None else self.file.certificate
        program = Program(
            flow, Roots.of(flow), ConflictRows.of(flow),
            multipliers if isinstance(multipliers, Multipliers) else None,
        )  # fmt: skip
        self.statistics |= {"edges": flow.n_edges, "whole": program.n_integral}
        return self._repeat(program, solver)

    def _take_root(self, make_root: Root | None) -> CertifiedResult | None:
        """Adopts the root's bound, and returns the result if it closes the gap."""
        if make_root is not None:
            root = make_root(self.problem, self.stop)
            if isinstance(root.certificate, CertificateFile):
                self.file, self.bound = root.certificate, root.bound
            self.known = max(self.known, root.value)
            if root.reason is Reason.INFEASIBLE:
                self._tell()
                return self.result(Reason.INFEASIBLE)
        self._tell()
        return self.result(Reason.FINISHED) if self._closed(self.bound) else None

    def _repeat(self, program: Program, solver: Solver) -> CertifiedResult:
        """Solves the program repeatedly, making it exact at each solution."""
        tolerance = FIRST_TOLERANCE
        least = max(self.gap / 4, LEAST_TOLERANCE)
        while True:
            if self.paths is not None:
                x, _ = program.flow.amounts(self.paths)
                program.refine(x)
            answer = solver(program, self._call(program.flow, tolerance))
            new = self._take(program, answer)
            if (ended := self._ended()) is not None:
                return ended
            self.stop.check()
            if answer.limit is not None:
                return self.result(Reason.STOPPED, answer.message, answer.limit)
            if not new and tolerance <= least:
                # The program is exact at its own solution, but the gap remains open.
                return self.result(Reason.STOPPED, answer.message, Limit.NUMERICS)
            tolerance = max(least, min(tolerance, self._open_gap()) / 4)

    def _take(self, program: Program, answer: Answer) -> int:
        """Adopts a solver's answer, and returns how many tangents its solution adds."""
        self.statistics["rounds"] += 1
        self.statistics["nodes"] += answer.nodes
        new = 0
        if answer.solution is not None:
            self._found(program.flow, answer.solution)
            x, _ = answer.solution
            new = program.refine(np.rint(x))
        self.solver_bound = min(self.solver_bound, answer.bound)
        self._tell()
        return new

    def _ended(self) -> CertifiedResult | None:
        """Returns the result if the bounds show that nothing remains to be done."""
        if self._closed(self.bound):
            return self.result(Reason.FINISHED)
        if self.known > self.solver_bound + REFUTED * abs(self.known):
            refuted = f"a plan has J = {self.known}, which exceeds the solver's bound"
            return self.result(Reason.STOPPED, refuted, Limit.NUMERICS)
        if self.solver_bound == -math.inf:
            return self.result(Reason.INFEASIBLE, f"no plan {BY_THE_SOLVER}")
        if self._closed(self.solver_bound):
            if not self._proves(self.solver_bound):
                return self.result(Reason.FINISHED)
            return self.result(Reason.OPTIMAL, f"optimal {BY_THE_SOLVER}")
        return None

    def _call(self, flow: Flow, tolerance: float) -> Call:
        hint = None if self.paths is None else flow.amounts(self.paths)
        return Call(hint, tolerance, self.stop, self._tick, lambda found: self._found(flow, found))

    def _found(self, flow: Flow, solution: Amounts) -> None:
        """Turns a solver's solution into a plan, unless the plan breaks a rule."""
        try:
            x, y = solution
            paths = flow.paths(y, x)
        except ValueError:
            return  # not integral, due to the solver's tolerance
        if next(self.model.plan(paths).conflicts(self.problem), None) is None:
            self._keep(paths)

    def _keep(self, paths: tuple[Path, ...]) -> None:
        """Keeps a plan if it is the best so far."""
        value = objective(self.model, paths)
        if value > self.value:
            self.paths, self.value, self.plan = paths, value, self.model.plan(paths)
            self.known = max(self.known, value)
            self._tell()

    def _open_gap(self) -> float:
        """Returns the relative gap to the solver's bound."""
        if not math.isfinite(self.value) or self.solver_bound <= 0:
            return math.inf
        return max(self.solver_bound - self.value, 0.0) / self.solver_bound

    def _closed(self, bound: float) -> bool:
        """Returns True if the gap to a bound is within the requested gap."""
        return self.value >= bound - max(self.gap * abs(bound), LEAST_TOLERANCE * self.scale)

    def _proves(self, bound: float) -> bool:
        """Returns True if a bound closes the gap."""
        least = LEAST_TOLERANCE * self.scale
        return proved_by(self.value, bound) is Reason.OPTIMAL or bound - self.value <= least

    def _tick(self) -> None:
        """Reports value and bound, at most once in `SECONDS_BETWEEN_REPORTS`."""
        if self.clock.seconds - self._reported > SECONDS_BETWEEN_REPORTS:
            self._tell()

    def _tell(self) -> None:
        self._reported = self.clock.seconds
        nodes = int(self.statistics["nodes"])
        self.report(Snapshot(self.value, self.bound, self._reported, nodes=nodes))

    def result(
        self, reason: Reason, message: str = "", limit: Limit | None = None
    ) -> CertifiedResult:
        """Returns the best plan and bound so far, which may prove the plan optimal."""
        if math.isfinite(self.solver_bound):
            self.statistics["solver_bound"] = self.solver_bound
        optimal = CertifiedResult(
            plan=self.plan, value=self.value, reason=Reason.OPTIMAL, bound=self.bound,
            message=self.message, statistics=self.statistics, certificate=self.file,
        )  # fmt: skip
        if self._proves(self.bound):
            return optimal
        words = "; ".join(part for part in (self.message, message) if part)
        return replace(optimal, reason=reason, limit=limit, message=words)
