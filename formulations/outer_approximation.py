"""Optima by mixed-integer linear programs: integer aggregated flow, roots from above.

The root of a group is concave in its pixels z, so every tangent lies above it:

    u <= z / (2 sqrt(z0)) + sqrt(z0) / 2     for any z0 > 0 (tangent)
    u <= sum of roots of pixels              (single-view cut)
    u <= constant + sum of phi(roots)        (envelope cuts of the root's certificate)

The program's optimum is an upper bound of J's. Its plan's true J is recomputed from the paths;
where the two differ, tangents at the plan's own pixels make the program exact there, and it is
solved again, until J meets the solver's bound. Any solver of such programs will do.

The bound that is certified is the root relaxation's; the solver's own is in `statistics`.

Source of outer approximation: Duran and Grossmann 1986.
"""

import math
import time
from collections.abc import Callable
from typing import NamedTuple, Protocol

import numpy as np
from scipy import sparse

from cocap_opt.check import check
from cocap_opt.model import Model, Path, compiled
from cocap_opt.plan import Plan, conflicts
from cocap_opt.problem import FloatArray, IntArray, Problem
from cocap_opt.result import Reason, relative_gap
from cocap_opt.reward import group_weights, largest_roots, most_views, objective_of
from cocap_opt.stop import FirstOf, Limit, Stop, TimeLimit, seconds_left
from formulations.certificate import CertificateFile, Multipliers, usable_cuts
from formulations.column_generation import column_generation
from formulations.envelope import Cut
from formulations.flow import (
    Compile,
    ConflictRows,
    Flow,
    Roots,
    conflict_rows,
    cut_rows,
    make_flow,
)
from formulations.result import (
    OPTIMALITY,
    CertifiedResult,
    Report,
    Snapshot,
    first_plan,
    no_bound,
)
from formulations.root import aggregated_root

TANGENTS = 5  # per group at the beginning, each at a quarter of the pixels of the one before
SLACK = 1e-9  # relative, by which a root may be overestimated at a plan
REFUTED = 1e-6  # relative, by which a plan's J must exceed a bound to refute it
FIRST_TOLERANCE = 1e-2  # relative, of the first solve
LEAST_TOLERANCE = 1e-9  # of what can be seen; no solver's bound is more accurate
ROOT_SHARE = 0.5  # of the time that is left goes to the root relaxation at most
SECONDS_BETWEEN_REPORTS = 1.0
BY_THE_SOLVER = "by the solver's word"


class Answer(NamedTuple):
    """What a solver says of a program."""

    x: FloatArray | None  # [N] robots in each node; None without a solution
    y: FloatArray | None  # [E]
    bound: float  # on J; -inf where there is no solution
    limit: Limit = Limit.NONE  # why it stopped before its tolerance
    nodes: int = 0
    message: str = ""


class Call(NamedTuple):
    """What a solver is asked for."""

    hint: tuple[FloatArray, FloatArray] | None  # x, y of a plan
    tolerance: float  # relative gap
    stop: Stop
    tick: Callable[[], None]  # to be called every now and then
    found: Callable[[FloatArray, FloatArray], None]  # to be called with each new x, y


class Solver(Protocol):
    """Solves programs of one problem, one after the other."""

    def __call__(self, program: "Program", call: Call) -> Answer:
        """Solve a program."""


class Program:
    """Integer flow with roots bounded from above by linear functions of the pixels.

    Attributes
    ----------
    unit : the objective of a linear program is J / unit
    cuts : envelope cuts
    """

    def __init__(
        self, flow: Flow, roots: Roots, conflicts: ConflictRows, root: Multipliers | None
    ) -> None:
        self.flow, self.roots, self.conflicts = flow, roots, conflicts
        self.bonus = flow.model.problem.objective.stationarity
        self.unit = max(float(roots.weights.max(initial=0.0)), self.bonus) or 1.0
        self.n_robots = len(flow.model.problem.robots)
        self.n_views = most_views(flow.model.problem)
        # Without swaps, whole numbers of robots in the nodes are enough: between two steps
        # the rest is a transport problem.
        self.whole_edges = conflicts.crossing.shape[0] > 0
        self.cuts: list[Cut] = []
        self._tangents: list[tuple[int, float]] = []
        groups = np.arange(len(roots.used))
        for k in range(TANGENTS):
            self._add(groups, np.full(len(groups), self.n_views / 4.0**k))
        if root is not None:
            self._take(root)

    @property
    def tangents(self) -> tuple[IntArray, FloatArray]:
        """Groups [k] (numbers among `roots.used`) and z0 [k] in units of their best views."""
        groups, z0 = zip(*self._tangents, strict=True) if self._tangents else ((), ())
        return np.array(groups, dtype=np.int64), np.array(z0, dtype=np.float64)

    @property
    def n_whole(self) -> int:
        """Number of variables that must be whole."""
        return self.flow.n_nodes + self.whole_edges * self.flow.n_edges

    def roots_at(self, x: FloatArray) -> FloatArray:
        """Roots [g] that the program allows at robots in nodes."""
        pixels, seen = self.roots.pixels @ x, self.roots.seen @ x
        allowed: FloatArray = seen.copy()
        of, z0 = self.tangents
        np.minimum.at(allowed, of, pixels[of] / (2 * np.sqrt(z0)) + np.sqrt(z0) / 2)
        rows, constants, groups = self.cut_rows()
        np.minimum.at(allowed, groups, constants + rows @ x)
        return allowed

    def point(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Values of all variables of a linear program (see `linear_program`) for a plan."""
        pixels, seen = self.roots.pixels @ x, self.roots.seen @ x
        return np.concatenate([x, y, pixels, seen, self.roots_at(x)])

    def refine(self, x: FloatArray) -> int:
        """Add tangents at whole x where roots are overestimated; how many."""
        pixels = self.roots.pixels @ x
        wrong = np.flatnonzero(
            (pixels > 0) & (self.roots_at(x) > np.sqrt(np.maximum(pixels, 0.0)) * (1 + SLACK))
        )
        self._add(wrong, pixels[wrong])
        return len(wrong)

    def cut_rows(self) -> tuple[sparse.csr_array, FloatArray, IntArray]:
        """The envelope cuts as rows (`flow.cut_rows`)."""
        return cut_rows(self.flow, self.roots, self.cuts)

    def _add(self, groups: IntArray, z0: FloatArray) -> None:
        self._tangents += zip(groups.tolist(), z0.tolist(), strict=True)

    def _take(self, root: Multipliers) -> None:
        """Take over what makes the root's certificate: its cuts, and tangents of its slopes."""
        model = self.flow.model
        alpha, beta = (
            np.array(part, dtype=np.float64).reshape(-1)[self.roots.used]
            for part in (root.alpha, root.beta)
        )
        rest = np.ones(len(alpha))
        for cut, share in usable_cuts(model, root.cuts):
            at = int(np.searchsorted(self.roots.used, cut.group))
            if at < len(self.roots.used) and self.roots.used[at] == cut.group:
                self.cuts.append(cut)
                rest[at] -= share
        curved = np.flatnonzero((rest - alpha > 1e-6) & (beta > 0))
        slope = beta[curved] * self.roots.scale[curved] / (rest - alpha)[curved]
        self._add(curved, np.clip(1 / (4 * slope**2), 1e-6, self.n_views))


Root = Callable[[Problem, Stop], CertifiedResult]


def certified_root(problem: Problem, stop: Stop) -> CertifiedResult:
    """Bound of the root relaxation, with the certificate that proves it.

    Its plan is left to it: a method that is to check another must find its own.
    """
    most = TimeLimit(ROOT_SHARE * seconds_left(stop))
    # Flows are by class, and so must the root's cuts be.
    return column_generation(problem, FirstOf(stop, most), make_root=aggregated_root)


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
        If the scene is too large for a flow model (see `formulations.flow`).
    """
    search = _Search(problem, compile_(problem), stop, start, report, gap)
    return search.run(solver, root)


class _Search:
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
        self.scale = float(group_weights(self.problem) @ largest)
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
        return self._rounds(program, solver)

    def _rounds(self, program: Program, solver: Solver) -> CertifiedResult:
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
