"""Upper bounds by cone programs: concave relaxations over the aggregated flow.

A relaxation maximises sum w u + rewards for moves over flows, where the root u of a view sum obeys

    concave        u <= sqrt(z), z = sum of pixels      (second-order cone)
    single view    and u <= sum of roots of pixels      (the root is subadditive)
    envelope       and u <= constant + sum phi(root)    (certificates.envelope; in rounds)

Modelled in cvxpy, solved by Clarabel on one thread; the multipliers become a certificate, and
the bound is what that proves. For small scenes: column generation solves the same relaxations
on paths and takes any size.
"""

import time
import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from cocap_opt.data import FloatArray, IntArray
from cocap_opt.formulations.certificates.certificate import CertificateFile, certify
from cocap_opt.formulations.certificates.envelope import Cut
from cocap_opt.formulations.relaxations import separation
from cocap_opt.formulations.relaxations.collision_rows import ConflictRows, conflict_rows
from cocap_opt.formulations.relaxations.cone_solver import solve_cones
from cocap_opt.formulations.relaxations.duals import Duals, alone_duals, repaired
from cocap_opt.formulations.relaxations.flow import Compile, Flow, Roots, cut_rows, make_flow
from cocap_opt.formulations.result import (
    CertifiedResult,
    Report,
    Snapshot,
    bounded,
    no_bound,
    silent,
)
from cocap_opt.model import compiled, compiled_apart
from cocap_opt.objective import most_views, view_sum_weights
from cocap_opt.problem.plan import Plan
from cocap_opt.problem.problem import Problem
from cocap_opt.stop import Limit, Stop, never

if TYPE_CHECKING:
    import cvxpy as cp

MOST_ROUNDS = 30  # of separation
VIOLATION = 1e-5  # relative, of an envelope cut
PROGRESS = 1e-6  # relative; rounds that bring less are the last
LEAST_MULTIPLIER = 1e-8  # of the largest weight; smaller ones are left out of certificates


def concave(
    problem: Problem, stop: Stop = never, start: Plan | None = None, report: Report = silent
) -> CertifiedResult:
    """Bound of the plain concave relaxation, u <= sqrt(z).

    It is weak where a robot can split itself between views: half a robot here and half there
    collects sqrt(c/2) + sqrt(c/2) > sqrt(c).

    Raises
    ------
    UnsupportedError
        If the scene is too large for a flow model (see `cocap_opt.formulations.relaxations.flow`).
    """
    return relax(problem, stop, report, "concave", no_cuts, single_view=False)


def single_view(
    problem: Problem, stop: Stop = never, start: Plan | None = None, report: Report = silent
) -> CertifiedResult:
    """Bound of the concave relaxation with single-view cuts; exact for one robot.

    Raises
    ------
    UnsupportedError
        If the scene is too large for a flow model (see `cocap_opt.formulations.relaxations.flow`).
    """
    return relax(problem, stop, report, "single-view", no_cuts)


def envelope(
    problem: Problem, stop: Stop = never, start: Plan | None = None, report: Report = silent
) -> CertifiedResult:
    """Bound of the relaxation with envelope cuts, added until none is violated.

    One flow per robot: the envelope of robots that start elsewhere is lower than that of
    robots that may exchange what they see.

    Raises
    ------
    UnsupportedError
        If the scene is too large for a flow model (see `cocap_opt.formulations.relaxations.flow`).
    """
    # Over time a robot sees a view sum more than once, and no cut for single views holds.
    cuts = no_cuts if problem.objective.over_time else violated_cuts
    return relax(problem, stop, report, "envelope", cuts, compile_=compiled_apart)


class Point(NamedTuple):
    """Solution of a relaxation."""

    x: FloatArray  # [N] robots in each node
    u: FloatArray  # [g] roots, in units of each view sum's best view
    duals: Duals
    value: float  # the solver's word
    solved: bool


Separation = Callable[[Flow, Roots, Point], list[Cut]]


def no_cuts(flow: Flow, roots: Roots, point: Point) -> list[Cut]:
    """Separate nothing."""
    return []


def violated_cuts(flow: Flow, roots: Roots, point: Point) -> list[Cut]:
    """Envelope cuts that a solution violates, the tightest one of each view sum."""
    found, sizes = [], flow.model.class_sizes
    for g, view_sum in enumerate(roots.used.tolist()):
        nodes, seen = roots.entries(g)
        amounts = point.x[nodes]
        used = amounts > 1e-7
        if used.sum() < 2:
            continue  # one view: the single-view cut is tight
        mixture = separation.Seen(flow.owner[nodes[used]], seen[used], amounts[used])
        if mixture.is_exact(sizes):
            continue
        height = float(point.u[g]) * float(roots.scale[g])
        best = separation.best_cut(
            view_sum, mixture, roots.largest[:, g], sizes, height, VIOLATION * height
        )
        if best is not None:
            found.append(best[0])
    return found


def relax(
    problem: Problem,
    stop: Stop,
    report: Report,
    name: str,
    separate: Separation,
    single_view: bool = True,
    compile_: Compile = compiled,
) -> CertifiedResult:
    """Solve a relaxation, again and again as long as there are cuts that it violates.

    Parameters
    ----------
    name : of the method, for the certificate
    separate : finds the cuts
    compile_ : makes the model: one flow per class, or one per robot (without envelope cuts
        the same value, in a larger program)
    """
    begin = time.perf_counter()
    model = compile_(problem)
    limit = model.prepare_all(stop)
    if limit is not Limit.NONE:
        return no_bound(limit, time.perf_counter() - begin)
    # The bound of robots alone, for where a robot has no path or the solver gives up.
    best = alone = certify(problem, model, name, alone_duals(problem).certificate(model))
    report(Snapshot(-np.inf, best.proved, time.perf_counter() - begin))
    flow, limit = make_flow(model, stop)
    statistics: dict[str, float] = {}
    if flow is not None and flow.serves_all:
        best, limit, statistics = _rounds(flow, best, stop, report, separate, single_view, begin)
    result = bounded(best, limit, begin, statistics)
    if limit is not Limit.NONE and best is alone:
        result = replace(result, message="the bound is that of `alone`: nothing better in time")
    return result


def _rounds(
    flow: Flow,
    best: CertificateFile,
    stop: Stop,
    report: Report,
    separate: Separation,
    single_view: bool,
    begin: float,
) -> tuple[CertificateFile, Limit, dict[str, float]]:
    """Best certificate of all rounds, and the limit that stopped them."""
    model, problem = flow.model, flow.model.problem
    program = _ConeProgram(flow, Roots.of(flow), conflict_rows(flow), single_view)
    cuts: list[Cut] = []
    statistics = {
        "nodes": flow.n_nodes, "edges": flow.n_edges, "rows": program.n_rows, "rounds": 0.0,
        "cuts": 0.0,
    }  # fmt: skip
    for _ in range(MOST_ROUNDS):
        point = program.solve(cuts, stop)
        if point is None:
            limit = stop()
            return best, Limit.NUMERICS if limit is Limit.NONE else limit, statistics
        file = certify(problem, model, best.method, point.duals.certificate(model))
        before = best.proved
        best = min(best, file, key=lambda some: some.proved)
        statistics |= {"rounds": statistics["rounds"] + 1, "cuts": len(cuts)}
        if point.solved:
            statistics["solver_value"] = point.value
        report(Snapshot(-np.inf, best.proved, time.perf_counter() - begin))
        if (limit := stop()) is not Limit.NONE or not point.solved:
            return best, limit if limit is not Limit.NONE else Limit.NUMERICS, statistics
        if best.proved < 0 or (cuts and best.proved > before * (1 - PROGRESS)):
            break
        found = separate(flow, program.roots, point)
        if not found:
            break
        cuts += found
    return best, Limit.NONE, statistics


class _ConeProgram:
    """max sum w u + rewards for moves over flows, roots under their bounds, and conflict rows.

    Roots and pixels are in units of each view sum's best single view, and the objective in
    units of its largest weight, for the solver's sake.
    """

    def __init__(
        self, flow: Flow, roots: Roots, conflicts: ConflictRows, single_view: bool
    ) -> None:
        import cvxpy as cp  # a second, which not every method needs

        self.flow, self.roots, self.conflicts = flow, roots, conflicts
        self._views = most_views(flow.model.problem)
        self._unit = max(float(roots.weights.max(initial=0.0)), flow.largest_bonus) or 1.0
        self.x = cp.Variable(flow.n_nodes, nonneg=True)
        self.y = cp.Variable(flow.n_edges, nonneg=True)
        self.u = cp.Variable(len(roots.used))
        self.z = cp.Variable(len(roots.used))
        constraints = self._conservation()
        self._pixels = self.z <= roots.pixels @ self.x
        self._single = self.u <= roots.seen @ self.x
        if len(roots.used):
            # u^2 <= z as the cone (1 + z, 2 u, z - 1).
            sides = cp.vstack([2 * self.u, self.z - 1])
            constraints += [self._pixels, cp.SOC(1 + self.z, sides, axis=0)]
            constraints += [self._single] if single_view else []
        self._single_view = single_view and len(roots.used) > 0
        usage = (conflicts.at_nodes, conflicts.crossing)
        self.n_rows = usage[0].shape[0] + usage[1].shape[0]
        slack = cp.Variable(self.n_rows, nonneg=True)
        self._capacity = cp.hstack([usage[0] @ self.x, usage[1] @ self.y]) <= 1 + slack
        constraints += [self._capacity] if self.n_rows else []
        # A broken row costs more than all there is to gain, so that a solution exists.
        most = float(roots.weights.sum()) + flow.largest_bonus * flow.model.problem.horizon
        profit = flow.bonus @ self.y - self._views * (most + self._unit) * cp.sum(slack)
        if len(roots.used):
            profit = profit + roots.weights @ self.u
        self._goal = cp.Maximize(profit / self._unit)
        self._constraints: list[Any] = constraints

    def _conservation(self) -> list[Any]:
        """What enters a node is in it, and leaves it before step T; starts are given."""
        flow = self.flow
        first, last = flow.steps == 0, flow.steps == flow.model.problem.horizon
        return [
            self.x[np.flatnonzero(first)] == flow.supply[first],
            flow.entering[~first] @ self.y == self.x[np.flatnonzero(~first)],
            flow.leaving[~last] @ self.y == self.x[np.flatnonzero(~last)],
        ]

    def solve(self, cuts: Sequence[Cut], stop: Stop) -> Point | None:
        """Solve with these cuts; None where a limit or the solver leaves no multipliers."""
        import cvxpy as cp

        rows, constants, where = cut_rows(self.flow, self.roots, cuts)
        cut = self.u[where] <= constants + rows @ self.x if cuts else None
        constraints = [*self._constraints, *([] if cut is None else [cut])]
        program = cp.Problem(self._goal, constraints)
        if stop() is not Limit.NONE:
            return None
        answer = _clarabel(program, stop)
        if answer is None:
            return None
        shares = np.zeros(0) if cut is None else np.asarray(cut.dual_value)
        duals = self._duals(cuts, where, shares)
        x = np.maximum(np.nan_to_num(self.x.value), 0.0)
        u = np.nan_to_num(self.u.value) if len(self.roots.used) else np.zeros(0)
        return Point(x, u, duals, answer.value * self._unit, answer.solved)

    def _duals(self, cuts: Sequence[Cut], where: IntArray, multipliers: FloatArray) -> Duals:
        """Multipliers in px and metres, repaired where the solver left them out of range."""
        roots, weights = self.roots, self.roots.weights / self._unit
        alpha = np.ones(len(view_sum_weights(self.flow.model.problem)))
        beta = np.zeros_like(alpha)
        shares = np.clip(np.nan_to_num(multipliers) / weights[where], 0.0, 1.0)
        taken = np.bincount(where, shares, minlength=len(weights)) if len(cuts) else 0 * weights
        shares = shares / np.maximum(taken, 1.0)[where] if len(cuts) else shares
        if len(weights):
            single = self._single.dual_value if self._single_view else np.zeros_like(weights)
            alpha[roots.used], beta[roots.used] = repaired(
                np.asarray(single) / weights,
                np.asarray(self._pixels.dual_value) / (weights * roots.scale),
                np.maximum(1 - taken, 0.0),
                np.sqrt(self._views) * roots.scale,  # no view sum's root can be larger
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
        """Where step 0 counts, it is given: the tangents of its roots are exact."""
        if self.flow.model.problem.objective.over_time:  # later steps add to the same view sums
            return
        pixels = self.roots.pixels @ (self.flow.supply * (self.flow.steps == 0))
        pixels = pixels * self.roots.scale**2
        known = np.flatnonzero(pixels > 0)
        alpha[self.roots.used[known]] = 0.0
        beta[self.roots.used[known]] = 0.5 / np.sqrt(pixels[known])


class _Answer(NamedTuple):
    value: float
    solved: bool


def _clarabel(program: "cp.Problem", stop: Stop) -> _Answer | None:
    """Solve by Clarabel itself, which asks `stop` at each iteration, and unpack the result.

    Whatever the solver says of its accuracy, its multipliers are good for a certificate.
    """
    import clarabel
    import cvxpy as cp

    try:
        data, chain, inverse = program.get_problem_data(cp.CLARABEL, solver_opts={})
    except (ValueError, cp.error.SolverError, cp.error.DCPError):
        return None
    if stop() is not Limit.NONE:
        return None
    dims = data["dims"]
    cones = [
        *([clarabel.ZeroConeT(dims.zero)] if dims.zero else []),
        *([clarabel.NonnegativeConeT(dims.nonneg)] if dims.nonneg else []),
        *(clarabel.SecondOrderConeT(n) for n in dims.soc),
    ]
    solution = solve_cones(data["c"], data["A"], data["b"], cones, stop)
    solved = str(solution.status) in ("Solved", "AlmostSolved")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # that it may be inaccurate
        try:
            program.unpack_results(_AsSolved(solution), chain, inverse)
        except (ValueError, cp.error.SolverError):
            return None
    return _Answer(float(program.value), solved)


class _AsSolved:
    """Clarabel's last iterate, which cvxpy unpacks only where the solver says it is solved."""

    status = "AlmostSolved"

    def __init__(self, solution: Any) -> None:
        self.x, self.z = np.nan_to_num(solution.x), np.nan_to_num(solution.z)
        self.obj_val = float(np.nan_to_num(solution.obj_val))
        self.solve_time, self.iterations = solution.solve_time, solution.iterations
