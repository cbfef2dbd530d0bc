"""Upper bound by one cone program: concave relaxation over the aggregated flow.

Robots of one class differ only in their start, and any flow with one unit from each start
splits into one path per start: one aggregated flow per class gives the same bound as one
flow per robot. The roots are bounded by the cone u^2 <= z and by the single-view cut
u <= sum of sqrt(coverage). Modelled in cvxpy, solved by Clarabel; for small scenes.
"""

import math
import time
import warnings
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import cvxpy as cp
import numpy as np
from scipy import sparse

from cocap_opt.model import Model, RobotClass, compiled
from cocap_opt.plan import Plan
from cocap_opt.problem import Cell, FloatArray, IntArray, Problem
from cocap_opt.result import Reason, UnsupportedError
from cocap_opt.reward import group_weights, no_pixels
from cocap_opt.stop import Limit, Stop, never, seconds_left
from cocap_opt.timegraph import CLOSED
from formulations.bound import BoundResult, no_bound
from formulations.certificate import certify
from formulations.multipliers import certificate_of, repaired
from formulations.rows import Key

METHOD = "relaxation"
MOST_EDGES = 60_000


@dataclass(frozen=True)
class Flow:
    """Edges of one class's part of the time-expanded graph; a node is t S + s."""

    group: RobotClass
    tails: IntArray  # [E] nodes
    heads: IntArray  # [E] nodes

    @property
    def serves_all(self) -> bool:
        """Whether every robot of the class has a path."""
        return bool(np.isin(self.group.starts, self.tails).all())

    @property
    def stays(self) -> FloatArray:
        """1.0 where an edge keeps the state [E]."""
        n_states = self.group.graph.n_states
        return np.asarray(self.heads - self.tails == n_states, dtype=np.float64)


def flow_of(model: Model, group: RobotClass) -> Flow:
    """Edges between nodes that lie on a path from some start to the end (or the goal)."""
    graph, horizon = group.graph, model.problem.horizon
    to_go = graph.backward_sweep(graph.no_reward(horizon), goal=group.goal)
    useful = graph.reachable(group.starts, horizon) & (to_go > CLOSED)
    tails, heads = [], []
    for t in range(horizon):
        for state in np.flatnonzero(useful[t]).tolist():
            ahead = graph.successors(state)
            ahead = ahead[useful[t + 1][ahead]]
            heads.append((t + 1) * graph.n_states + ahead)
            tails.append(np.full(len(ahead), t * graph.n_states + state))
        if sum(map(len, heads)) > MOST_EDGES:
            raise UnsupportedError(
                f"the cone program takes at most {MOST_EDGES} edges of the time-expanded graph; "
                "use column-generation, which gives the same bound"
            )
    none = np.zeros(0, dtype=np.int64)
    return Flow(group, np.concatenate([none, *tails]), np.concatenate([none, *heads]))


def relaxation(problem: Problem, stop: Stop = never, plan: Plan | None = None) -> BoundResult:
    """Bound of the concave relaxation with single-view cuts and all conflict rows.

    Raises
    ------
    UnsupportedError
        If the time-expanded graph has more than MOST_EDGES edges.
    """
    begin = time.perf_counter()
    model = compiled(problem)
    limit = model.prepare_all(stop)
    if limit is not Limit.NONE:
        return no_bound(METHOD, limit, time.perf_counter() - begin)
    flows = [flow_of(model, group) for group in model.classes]
    n_groups = (problem.horizon + 1) * model.n_faces
    # The bound of robots alone, for where a robot has no path or the solver gives up.
    alpha, beta, rows = np.ones(n_groups), np.zeros(n_groups), dict[Key, float]()
    limit = stop()
    if limit is Limit.NONE and all(flow.serves_all for flow in flows):
        program = _ConeProgram(model, flows)
        if program.solve(seconds_left(stop)):
            alpha, beta, rows = program.multipliers()
        else:
            limit = stop()
            limit = limit if limit is not Limit.NONE else Limit.NUMERICS
    file = certify(problem, model, METHOD, certificate_of(problem, alpha, beta, rows))
    reason = Reason.FINISHED if limit is Limit.NONE else Reason.STOPPED
    if file.proved < 0:
        reason, limit = Reason.INFEASIBLE, Limit.NONE
    edges = sum(len(flow.tails) for flow in flows)
    statistics = {"edges": edges, "rows": len(rows)}
    return BoundResult(METHOD, file, reason, limit, time.perf_counter() - begin, statistics)


class _ConeProgram:
    """max sum w u over flows, with u^2 <= z, single-view cuts and conflict rows.

    Roots and pixels are in units of each group's best single view, and the objective in
    units of its largest weight, for the solver's sake.
    """

    def __init__(self, model: Model, flows: list[Flow]) -> None:
        problem = model.problem
        self._robots = len(problem.robots)
        self._weights = group_weights(problem)
        self._at_start = _pixels_at_start(model)
        coverage = [_coverage_of_edges(model, flow) for flow in flows]  # [G, E] each
        largest = np.sqrt(np.max([_row_max(part) for part in coverage], axis=0))
        self._used = np.flatnonzero((largest > 0) & (self._weights > 0))
        self._scale = largest[self._used]
        self._root_weights = self._weights[self._used] * self._scale
        self._unit = float(self._root_weights.max(initial=0.0)) or 1.0
        self._edges = [cp.Variable(len(flow.tails), nonneg=True) for flow in flows]
        self._conflicts = _conflict_rows(model, flows)
        shares = [sparse.csr_array(part[self._used] / self._scale[:, None] ** 2)
                  for part in coverage]  # fmt: skip
        self._pixels = _sum_of_products(shares, self._edges)
        roots = cp.Variable(len(self._used))
        self._cut = roots <= _sum_of_products([part.sqrt() for part in shares], self._edges)
        # u^2 <= z as the cone (1 + z, 2 u, z - 1): its multipliers hold beta.
        constraints: list[Any] = []
        if len(self._used):
            sides = cp.vstack([2 * roots, self._pixels - 1])
            self._cone = cp.SOC(1 + self._pixels, sides, axis=0)
            constraints = [self._cut, self._cone]
        for flow, amount in zip(flows, self._edges, strict=True):
            matrix, rhs = _conservation(model, flow)
            constraints.append(matrix @ amount == rhs)
        slack = cp.Variable(len(self._conflicts), nonneg=True)
        if self._conflicts:
            usage = [_usage(self._conflicts, n, len(flow.tails)) for n, flow in enumerate(flows)]
            self._capacity = _sum_of_products(usage, self._edges) <= 1 + slack
            constraints.append(self._capacity)
        bonus = problem.objective.stationarity
        stays = _sum_of_products([bonus * flow.stays for flow in flows], self._edges)
        # A violated row costs more than all there is to gain, so that a solution exists.
        penalty = self._robots * (float(self._root_weights.sum()) + bonus * problem.horizon + 1)
        profit = self._root_weights @ roots if len(self._used) else 0.0
        goal = cp.Maximize((profit + stays - penalty * cp.sum(slack)) / self._unit)
        self._program = cp.Problem(goal, constraints)

    def solve(self, seconds: float) -> bool:
        """Solve; False where Clarabel gave up, which leaves no multipliers."""
        # Every option each time: Clarabel through cvxpy keeps those of the solve before.
        options = {"time_limit": seconds} if math.isfinite(seconds) else {"time_limit": 1e9}
        with warnings.catch_warnings():
            # An inaccurate solution is good enough: its multipliers are certified anyway.
            warnings.simplefilter("ignore", UserWarning)
            try:
                self._program.solve(
                    solver=cp.CLARABEL, warm_start=False, verbose=False, max_threads=1, **options
                )
            except cp.error.SolverError:
                return False
        return self._program.status in (cp.OPTIMAL, cp.OPTIMAL_INACCURATE)

    def multipliers(self) -> tuple[FloatArray, FloatArray, dict[Key, float]]:
        """Multipliers of groups (alpha, beta) [G] and of conflict rows."""
        alpha, beta = np.ones(len(self._weights)), np.zeros(len(self._weights))
        if len(self._used):
            top, sides = (np.asarray(part) for part in self._cone.dual_value)
            units = self._unit / self._root_weights
            alpha[self._used], beta[self._used] = repaired(
                np.asarray(self._cut.dual_value) * units,
                (top.ravel() + sides.reshape(2, -1)[1]) * units / self._scale,
                np.sqrt(self._robots) * self._scale,
            )
        # Step 0 is given, so its roots' tangents are exact; no edge enters it.
        known = np.flatnonzero(self._at_start > 0)
        alpha[known], beta[known] = 0.0, 0.5 / np.sqrt(self._at_start[known])
        charges = np.zeros(0)
        if self._conflicts:
            charges = np.maximum(np.asarray(self._capacity.dual_value), 0.0) * self._unit
        return alpha, beta, dict(zip(self._conflicts, charges.tolist(), strict=True))


def _sum_of_products(matrices: Sequence[Any], variables: Sequence[Any]) -> Any:
    return sum(matrix @ variable for matrix, variable in zip(matrices, variables, strict=True))


def _coverage_of_edges(model: Model, flow: Flow) -> sparse.csr_array:
    """Coverage [G, E] of the node that each edge enters."""
    table = model.coverage(flow.group)
    n_groups = (model.problem.horizon + 1) * model.n_faces
    at = np.searchsorted(table.nodes, flow.heads)
    at = np.minimum(at, max(len(table.nodes) - 1, 0))
    edges = np.flatnonzero(table.nodes[at] == flow.heads) if len(table.nodes) else at[:0]
    by_node = sparse.csr_array(
        (table.pixels, table.groups, table.indptr), shape=(len(table.nodes), n_groups)
    )
    rows = by_node[at[edges]]
    spread = sparse.csr_array(
        (np.ones(len(edges)), (edges, np.arange(len(edges)))),
        shape=(len(flow.heads), len(edges)),
    )
    return sparse.csr_array((spread @ rows).T)


def _pixels_at_start(model: Model) -> FloatArray:
    """Pixels [G] that all robots together have at step 0; 0 where it does not count."""
    pixels = no_pixels(model.problem)
    for group in model.classes:
        for start in group.starts:
            groups, coverage = model.coverage(group).row(start)
            pixels[groups] += coverage
    return pixels


def _row_max(matrix: sparse.csr_array) -> FloatArray:
    return np.asarray(matrix.max(axis=1).todense()).ravel()


def _conservation(model: Model, flow: Flow) -> tuple[sparse.csr_array, FloatArray]:
    """One unit leaves each start, and what enters a node before step T leaves it."""
    n_states, horizon = flow.group.graph.n_states, model.problem.horizon
    nodes, at = np.unique(flow.tails, return_inverse=True)
    inner = np.flatnonzero(flow.heads < horizon * n_states)
    entered = np.searchsorted(nodes, flow.heads[inner])
    size = (len(nodes), len(flow.tails))
    leaves = sparse.csr_array((np.ones(size[1]), (at, np.arange(size[1]))), shape=size)
    enters = sparse.csr_array((np.ones(len(inner)), (entered, inner)), shape=size)
    rhs = np.zeros(len(nodes))
    for start in flow.group.starts:
        rhs[np.searchsorted(nodes, start)] += 1
    return sparse.csr_array(leaves - enters), rhs


Usage = dict[Key, list[tuple[int, int]]]  # row -> (class, edge) that use it


def _conflict_rows(model: Model, flows: list[Flow]) -> Usage:
    """All conflict rows; those that no two robots can break do no harm."""
    problem = model.problem
    if problem.rules.none:
        return {}
    rows: defaultdict[Key, list[tuple[int, int]]] = defaultdict(list)
    occupied: defaultdict[tuple[int, Cell], list[tuple[int, int]]] = defaultdict(list)
    for n, flow in enumerate(flows):
        graph = flow.group.graph
        cells = _cells(model, flow.group)
        steps, heads = np.divmod(flow.heads, graph.n_states)
        tails = (flow.tails % graph.n_states % graph.n_places).tolist()
        heads = (heads % graph.n_places).tolist()
        for edge, (t, tail, head) in enumerate(zip(steps.tolist(), tails, heads, strict=True)):
            occupied[t, cells[head]].append((n, edge))
            if problem.rules.swap and tail != head:
                rows[t - 1, frozenset((cells[tail], cells[head])), True].append((n, edge))
    for (t, cell), edges in occupied.items():
        rows[t, frozenset((cell,)), False] = edges
    if problem.rules.separation:
        for (t, a), (step, b) in combinations(occupied, 2):
            if t == step and problem.too_close(a, b):
                rows[t, frozenset((a, b)), False] = occupied[t, a] + occupied[t, b]
    return dict(rows)


def _cells(model: Model, group: RobotClass) -> list[Cell]:
    """Cell of every place of a class; border places lie outside the map."""
    layer, x, y = group.graph.coordinates(np.arange(group.graph.n_places))
    number = [model.problem.layers.index(height) for height in group.spec.motion.layers]
    return [
        Cell(i, j, number[k] if 0 <= k < len(number) else -1)
        for i, j, k in zip(x.tolist(), y.tolist(), layer.tolist(), strict=True)
    ]


def _usage(rows: Usage, group: int, n_edges: int) -> sparse.csr_array:
    at = [(r, edge) for r, used in enumerate(rows.values()) for n, edge in used if n == group]
    index = np.array(at, dtype=np.int64).reshape(-1, 2).T
    shape = (len(rows), n_edges)
    return sparse.csr_array((np.ones(index.shape[1]), (index[0], index[1])), shape=shape)
