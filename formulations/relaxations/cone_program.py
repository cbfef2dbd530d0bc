"""Computes upper bounds by cone programs: concave relaxations over the aggregated flow.

A relaxation maximises sum w u + rewards for moves over flows, where the root u of a view sum obeys

    concave        u <= sqrt(z), z = sum of pixels      (second-order cone)
    single view    and u <= sum of roots of pixels      (the root is subadditive)
    envelope       and u <= constant + sum phi(root)    (`certificates.envelope`; in rounds)

The number u of drones that see a person, as far as it counts, obeys u <= sum of counts and u <= k
in all relaxations: no smaller concave function is above it.

The relaxations are modelled in cvxpy and solved by Clarabel on one thread; the multipliers become a
certificate, and the result is the bound that the certificate proves. This method is for small
scenes: column generation solves the same relaxations over paths, for scenes of any size.
"""

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np

from cocap_opt.data import FloatArray, IntArray
from cocap_opt.formulations.certificates import CertificateFile
from cocap_opt.formulations.certificates.envelope import Cut
from cocap_opt.formulations.relaxations.collision_rows import ConflictRows
from cocap_opt.formulations.relaxations.duals import Duals, repaired_roots
from cocap_opt.formulations.relaxations.flow import Compile, Flow, Roots
from cocap_opt.formulations.relaxations.separation import Seen
from cocap_opt.formulations.result import CertifiedResult, Report, Snapshot, certify, silent
from cocap_opt.formulations.simple_bounds import early_bound
from cocap_opt.formulations.solvers import ending, solve_cones
from cocap_opt.model import Model, compiled
from cocap_opt.problem import Plan, Problem
from cocap_opt.result import Reason
from cocap_opt.stop import Clock, Limit, LimitReached, Stop, never
from cocap_opt.timing import timed

if TYPE_CHECKING:
    import cvxpy as cp

__all__ = ["concave", "envelope", "single_view"]

MOST_ROUNDS = 30  # rounds of separation
VIOLATION = 1e-5  # relative violation at which an envelope cut is added
PROGRESS = 1e-6  # relative; rounds end if one improves the bound by less
LEAST_MULTIPLIER = 1e-8  # relative to the largest weight; smaller ones are left out of certificates
NO_MORE = "the bound is that of method `alone`: no better one was found in time"


# Finds cuts that a solution violates, given robots in each node x [N] and roots u [z], in units of
# each view sum's best view.
_Separation = Callable[[Flow, Roots, FloatArray, FloatArray], list[Cut]]


def _no_cuts(flow: Flow, roots: Roots, x: FloatArray, u: FloatArray) -> list[Cut]:
    """Returns no cuts."""
    return []


def _violated_cuts(flow: Flow, roots: Roots, x: FloatArray, u: FloatArray) -> list[Cut]:
    """Returns envelope cuts that a solution violates, the tightest one for each view sum."""
    if flow.model.problem.objective.over_time:
        return []  # a robot sees a view sum more than once, so no cut for single views is valid
    found, sizes = [], flow.model.class_sizes
    for z, view_sum in enumerate(roots.used[: roots.returns.n_roots].tolist()):
        nodes, seen = roots.entries(z)
        amounts = x[nodes]
        used = amounts > 1e-7
        if used.sum() < 2:
            continue  # a single view: the single-view cut is tight
        mixture = Seen(flow.owner[nodes[used]], seen[used], amounts[used])
        if mixture.is_exact(sizes):
            continue
        height = float(u[z]) * float(roots.scale[z])
        largest = roots.largest[:, z]
        cut = mixture.best_cut(view_sum, largest, sizes, height, VIOLATION * height)
        if cut is not None:
            found.append(cut)
    return found


def _disaggregated(problem: Problem) -> Model:
    """Returns the model in which every robot forms its own class."""
    return compiled(problem).disaggregated()


@dataclass(frozen=True)
class ConeRelaxation:
    """Computes the bound of a concave relaxation, in several rounds if there are cuts to find.

    Scenes that are too large for a flow raise UnsupportedError (see
    `cocap_opt.formulations.relaxations.flow`).

    Attributes
    ----------
    method : name of the method in certificates
    single_view : True: add single-view cuts, which make the bound exact for one drone. Without them
        it is weak if a drone can be split between views: two halves of a drone collect sqrt(c/2) +
        sqrt(c/2) > sqrt(c)
    separate : finds violated cuts
    compile_ : makes the model: one flow per class, or one per robot in a larger program. Without
        envelope cuts both have the same value; the envelope for drones with different starts is
        lower than that for drones that may exchange their views
    """

    method: str
    single_view: bool = True
    separate: _Separation = _no_cuts
    compile_: Compile = compiled

    def __call__(
        self,
        problem: Problem,
        stop: Stop = never,
        start: Plan | None = None,
        report: Report = silent,
    ) -> CertifiedResult:
        """Computes the bound of this relaxation for a problem."""

        @timed
        def bound(problem: Problem) -> CertifiedResult:
            return _CutRounds(self, problem).run(stop, report)

        return bound(problem)


concave = ConeRelaxation("concave", single_view=False)
single_view = ConeRelaxation("single-view")
envelope = ConeRelaxation("envelope", separate=_violated_cuts, compile_=_disaggregated)


class _CutRounds:
    """A relaxation of one problem, solved repeatedly until it violates no more cuts.

    Attributes
    ----------
    best : the best certificate so far
    """

    best: CertificateFile

    def __init__(self, relaxation: ConeRelaxation, problem: Problem) -> None:
        self.clock = Clock()
        self.relaxation, self.model = relaxation, relaxation.compile_(problem)
        self.statistics: dict[str, float] = {}

    def run(self, stop: Stop, report: Report) -> CertifiedResult:
        """Returns the best bound of all rounds before a limit is reached."""
        try:
            self.model.prepare_all(stop)
        except LimitReached as reached:
            return early_bound(self.model.problem, reached.limit)
        # The bound `alone`, in case a robot has no path or the solver fails.
        self.best = alone = self._certify(Duals.alone(self.model.problem))
        self._tell(report)
        try:
            flow = Flow.of(self.model, stop)
            if flow.serves_all:
                self._solve(flow, stop, report)
        except LimitReached as reached:
            result = self._result().stopped_by(reached.limit)
            return replace(result, message=NO_MORE) if self.best is alone else result
        return self._result()

    def _solve(self, flow: Flow, stop: Stop, report: Report) -> None:
        """Solves in rounds; raises LimitReached, also if the solver fails to reach its accuracy."""
        program = _ConeProgram(
            flow, Roots.of(flow), ConflictRows.of(flow), self.relaxation.single_view
        )
        cuts: list[Cut] = []
        self.statistics = {
            "nodes": flow.n_nodes, "edges": flow.n_edges, "rows": program.n_rows, "rounds": 0.0,
            "cuts": 0.0,
        }  # fmt: skip
        for _ in range(MOST_ROUNDS):
            duals, value, solved = program.solve(cuts, stop)
            before = self.best.proved
            self.best = min(self.best, self._certify(duals), key=lambda file: file.proved)
            self.statistics |= {"rounds": self.statistics["rounds"] + 1, "cuts": len(cuts)}
            if solved:
                self.statistics["solver_value"] = value
            self._tell(report)
            stop.check()
            if not solved:
                raise LimitReached(Limit.NUMERICS)
            if self.best.proved < 0 or (cuts and self.best.proved > before * (1 - PROGRESS)):
                return
            found = self.relaxation.separate(flow, program.roots, *program.point)
            if not found:
                return
            cuts += found

    def _certify(self, duals: Duals) -> CertificateFile:
        multipliers = duals.certificate(self.model)
        return certify(self.model.problem, self.model, self.relaxation.method, multipliers)

    def _tell(self, report: Report) -> None:
        report(Snapshot(-np.inf, self.best.proved, self.clock.seconds))

    def _result(self) -> CertifiedResult:
        return CertifiedResult.bounded(self.best, self.statistics)


class _ConeProgram:
    """The program max sum w u + rewards for moves, over flows, bounded roots and conflict rows.

    In u, counts of people follow the roots. Roots and pixels are in units of each view sum's best
    single view, and the objective is in units of its largest weight, which helps the solver.
    """

    def __init__(
        self, flow: Flow, roots: Roots, conflicts: ConflictRows, single_view: bool
    ) -> None:
        import cvxpy as cp  # takes a second, and not every method needs it

        self.flow, self.roots, self.conflicts = flow, roots, conflicts
        self._views = flow.model.problem.most_views_of_a_face
        self._unit = max(float(roots.weights.max(initial=0.0)), flow.largest_bonus) or 1.0
        self.x = cp.Variable(flow.n_nodes, nonneg=True)
        self.y = cp.Variable(flow.n_edges, nonneg=True)
        self.u = cp.Variable(len(roots.used))
        self._n_roots = roots.returns.n_roots
        self.z = cp.Variable(self._n_roots)
        self._pixels = self.z <= roots.pixels[: self._n_roots] @ self.x
        self._first_single = 0 if single_view else self._n_roots
        self._single = self.u[self._first_single :] <= roots.seen[self._first_single :] @ self.x
        usage = (conflicts.at_nodes, conflicts.crossing)
        self.n_rows = usage[0].shape[0] + usage[1].shape[0]
        self.slack = cp.Variable(self.n_rows, nonneg=True)
        self._capacity = cp.hstack([usage[0] @ self.x, usage[1] @ self.y]) <= 1 + self.slack
        self._constraints: list[Any] = [*self._conservation(), *self._root_bounds()]
        self._constraints += [self._capacity] if self.n_rows else []
        self._goal = cp.Maximize(self._profit() / self._unit)

    def _profit(self) -> Any:
        """Returns J, less a penalty for violated rows.

        A violated row costs more than any possible gain, so a solution always exists.
        """
        import cvxpy as cp

        roots, flow = self.roots, self.flow
        most = float(roots.weights.sum()) + flow.largest_bonus * flow.model.problem.horizon
        profit = flow.bonus @ self.y - self._views * (most + self._unit) * cp.sum(self.slack)
        return profit + roots.weights @ self.u if len(roots.used) else profit

    def _root_bounds(self) -> list[Any]:
        """Returns the rows that bound the roots: u^2 <= z as the cone (1 + z, 2 u, z - 1).

        They are followed by the rows that bound the counts.
        """
        import cvxpy as cp

        rows: list[Any] = []
        if self._n_roots:
            sides = cp.vstack([2 * self.u[: self._n_roots], self.z - 1])
            rows = [self._pixels, cp.SOC(1 + self.z, sides, axis=0)]
        if self._single.size:
            rows.append(self._single)
        if len(caps := self.roots.returns.caps):
            rows.append(self.u[self._n_roots :] <= caps)
        return rows

    def _conservation(self) -> list[Any]:
        """Returns the rows of flow conservation: robots that start in or enter a node leave it
        again.
        """
        flow = self.flow
        first, last = ~flow.is_entered, flow.steps == flow.model.problem.horizon
        return [
            self.x[np.flatnonzero(first)] == flow.supply[first],
            flow.entering[~first] @ self.y == self.x[np.flatnonzero(~first)] - flow.supply[~first],
            flow.leaving[~last] @ self.y == self.x[np.flatnonzero(~last)],
        ]

    def solve(self, cuts: Sequence[Cut], stop: Stop) -> tuple[Duals, float, bool]:
        """Solves the program with the given cuts.

        Returns
        -------
        The multipliers, the solver's value, and True if the solver reports success.

        Raises
        ------
        LimitReached
            If a limit or low accuracy leaves no multipliers.
        """
        import cvxpy as cp

        phi, constants, at = self.roots.cut_rows(cuts)
        cut = self.u[at] <= constants + phi @ self.x if cuts else None
        constraints = [*self._constraints, *([] if cut is None else [cut])]
        program = cp.Problem(self._goal, constraints)
        stop.check()
        solved = _clarabel(program, stop)
        multipliers = np.zeros(0) if cut is None else np.asarray(cut.dual_value)
        duals = self._duals(cuts, at, multipliers)
        return duals, float(program.value) * self._unit, solved

    @property
    def point(self) -> tuple[FloatArray, FloatArray]:
        """Robots in each node [N] and roots [z] of the last solution."""
        u = np.nan_to_num(self.u.value) if len(self.roots.used) else np.zeros(0)
        return np.maximum(np.nan_to_num(self.x.value), 0.0), u

    def _duals(self, cuts: Sequence[Cut], at: IntArray, multipliers: FloatArray) -> Duals:
        """Returns the multipliers in px and m, repaired if they are out of range."""
        problem, roots = self.flow.model.problem, self.roots
        single_view = np.zeros(len(roots.used))
        if self._single.size:
            single_view[self._first_single :] = self._single.dual_value
        alpha, beta, shares = repaired_roots(
            problem,
            view_sums=roots.used,
            scale=roots.scale,
            weights=roots.weights / self._unit,
            single_view=single_view,
            pixels=np.asarray(self._pixels.dual_value) if self._n_roots else np.zeros(0),
            cut_at=at,
            cuts=multipliers,
        )
        charges = np.zeros(0)
        if self.n_rows:
            charges = np.maximum(np.nan_to_num(self._capacity.dual_value), 0.0) * self._unit
        self._fix_start(alpha, beta)
        return Duals(
            alpha=alpha,
            beta=beta,
            rows=self.conflicts.multipliers(charges, LEAST_MULTIPLIER * self._unit),
            cuts=tuple(zip(cuts, shares.tolist(), strict=True)),
        )

    def _fix_start(self, alpha: FloatArray, beta: FloatArray) -> None:
        """Makes the tangents at step 0 exact, if that step counts and all its views are fixed."""
        roots = self.roots
        if self.flow.is_source.any():
            return
        pixels = roots.pixels @ (self.flow.supply * (self.flow.steps == 0))
        pixels = pixels * roots.scale**2
        if self.flow.model.problem.objective.over_time:  # later steps add to the same pixels
            pixels[: self._n_roots] = 0.0
        known = np.flatnonzero(pixels > 0)
        returns, view_sums = roots.returns.part(known), roots.used[known]
        slopes, n = returns.slopes(pixels[known]), returns.n_roots
        alpha[view_sums] = np.append(np.zeros(n), slopes[n:])
        beta[view_sums] = np.append(slopes[:n], np.zeros(len(known) - n))


def _clarabel(program: "cp.Problem", stop: Stop) -> bool:
    """Solves with Clarabel directly, checking `stop` at each iteration, and unpacks the result.

    Returns True if the solver reports success. Whatever accuracy it reports, its multipliers can be
    used for a certificate.

    Raises
    ------
    LimitReached
        If a limit or low accuracy leaves no multipliers.
    """
    import clarabel
    import cvxpy as cp

    try:
        data, chain, inverse = program.get_problem_data(cp.CLARABEL, solver_opts={})
    except (ValueError, cp.error.SolverError, cp.error.DCPError) as error:
        stop.check()
        raise LimitReached(Limit.NUMERICS) from error
    stop.check()
    dims = data["dims"]
    cones = [
        *([clarabel.ZeroConeT(dims.zero)] if dims.zero else []),
        *([clarabel.NonnegativeConeT(dims.nonneg)] if dims.nonneg else []),
        *(clarabel.SecondOrderConeT(n) for n in dims.soc),
    ]
    solution = solve_cones(data["c"], data["A"], data["b"], cones, stop)
    # The last iterate; cvxpy unpacks it only if the solver reports success.
    as_solved = SimpleNamespace(
        status="AlmostSolved", x=np.nan_to_num(solution.x), z=np.nan_to_num(solution.z),
        obj_val=float(np.nan_to_num(solution.obj_val)), solve_time=solution.solve_time,
        iterations=solution.iterations,
    )  # fmt: skip
    with warnings.catch_warnings():
        # the warning that the solution may be inaccurate
        warnings.simplefilter("ignore", UserWarning)
        try:
            program.unpack_results(as_solved, chain, inverse)
        except (ValueError, cp.error.SolverError) as error:
            stop.check()
            raise LimitReached(Limit.NUMERICS) from error
    return ending("Clarabel", str(solution.status)) is Reason.OPTIMAL
