"""Upper bound by one cone program: concave relaxation over the aggregated flow.

Robots of one class differ only in their start, and any flow with one unit from each start
splits into one path per start: one aggregated flow per class gives the same bound as one
flow per robot. The roots are bounded by the cone u^2 <= z and by the single-view cut
u <= sum of sqrt(coverage). Modelled in cvxpy, solved by Clarabel; for small scenes.
"""

import time
from collections import defaultdict
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy import sparse

from cocap_opt.model import Model, RobotClass, compiled
from cocap_opt.plan import Plan
from cocap_opt.problem import Cell, FloatArray, IntArray, Problem
from cocap_opt.result import Limit, Reason, UnsupportedError
from cocap_opt.reward import group_weights
from cocap_opt.stop import Stop, never
from cocap_opt.timegraph import CLOSED
from formulations.bound import BoundResult
from formulations.certificate import certify
from formulations.multipliers import certificate_of, repaired
from formulations.rows import Key

MOST_EDGES = 60_000


@dataclass(frozen=True)
class Flow:
    """Edges of one class's part of the time-expanded graph; a node is t S + s."""

    group: RobotClass
    tails: IntArray  # [E] nodes
    heads: IntArray  # [E] nodes

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
    flows = [flow_of(model, group) for group in model.classes]
    n_groups = (problem.horizon + 1) * model.n_faces
    limit = stop()
    if limit is Limit.NONE and all(len(flow.tails) for flow in flows):
        alpha, beta, rows = _solve(model, flows, stop)
    else:
        alpha, beta, rows = np.ones(n_groups), np.zeros(n_groups), {}
    certificate = certificate_of(problem, alpha, beta, rows)
    file = certify(problem, model, "relaxation", certificate)
    reason = Reason.FINISHED if limit is Limit.NONE else Reason.STOPPED
    reason = Reason.INFEASIBLE if file.bound < 0 else reason
    edges = sum(len(flow.tails) for flow in flows)
    statistics = {"edges": edges, "rows": len(rows)}
    return BoundResult(file, reason, limit, time.perf_counter() - begin, statistics)


def _solve(
    model: Model, flows: list[Flow], stop: Stop
) -> tuple[FloatArray, FloatArray, dict[Key, float]]:
    """Multipliers of the optimal cone program."""
    import cvxpy as cp  # its import takes longer than most bounds do

    problem = model.problem
    weights = group_weights(problem)
    edges = [cp.Variable(len(flow.tails), nonneg=True) for flow in flows]
    coverage = [_coverage_of_edges(model, flow) for flow in flows]  # [G, E] each
    largest = np.sqrt(np.max([_row_max(part) for part in coverage], axis=0))
    used = np.flatnonzero((largest > 0) & (weights > 0))
    scale = largest[used]
    # Roots and pixels in units of each group's best single view, for the solver's sake.
    shares = [sparse.csr_array(part[used]) / scale[:, None] ** 2 for part in coverage]
    shares = [sparse.csr_array(part) for part in shares]
    root_weights = weights[used] * scale
    unit = float(root_weights.max()) if len(used) else 1.0
    roots = cp.Variable(len(used))
    pixels = sum(part @ flow for part, flow in zip(shares, edges, strict=True))
    views = sum(part.sqrt() @ flow for part, flow in zip(shares, edges, strict=True))
    cut = roots <= views
    bonus = problem.objective.stationarity
    stays = sum(bonus * flow.stays @ y for flow, y in zip(flows, edges, strict=True))
    conflicts = _conflict_rows(model, flows)
    # A violated row costs this much, so that a solution always exists.
    penalty = float(root_weights.sum()) * len(problem.robots) + bonus * problem.horizon + unit
    slack = cp.Variable(len(conflicts), nonneg=True)
    constraints = [cut, roots <= cp.sqrt(pixels)] if len(used) else []
    for flow, y in zip(flows, edges, strict=True):
        matrix, rhs = _conservation(model, flow)
        constraints.append(matrix @ y == rhs)
    if conflicts:
        usage = sum(
            sparse.csr_array(_usage(conflicts, n, len(flow.tails))) @ y
            for n, (flow, y) in enumerate(zip(flows, edges, strict=True))
        )
        capacity = usage <= 1 + slack
        constraints.append(capacity)
    profit = root_weights @ roots if len(used) else 0.0
    goal = cp.Maximize((profit + stays - penalty * cp.sum(slack)) / unit)
    cone_program = cp.Problem(goal, constraints)
    # Every option each time: Clarabel through cvxpy keeps those of the solve before.
    cone_program.solve(solver=cp.CLARABEL, warm_start=False, verbose=False, max_threads=1)
    alpha, beta = np.ones(len(weights)), np.zeros(len(weights))
    if len(used):
        alpha[used] = np.clip(np.asarray(cut.dual_value) * unit / root_weights, 0.0, 1.0)
        roots_seen = scale * np.sqrt(np.maximum(np.asarray(pixels.value), 1e-12))
        alpha[used], beta[used] = repaired(
            alpha[used], (1 - alpha[used]) / (2 * roots_seen), np.sqrt(len(problem.robots)) * scale
        )
    charges = np.zeros(0)
    if conflicts:
        charges = np.maximum(np.asarray(capacity.dual_value), 0.0) * unit
    return alpha, beta, dict(zip(conflicts, charges.tolist(), strict=True))


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
    """All conflict rows that at least two robots' flows could break."""
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
