"""Upper bound by column generation: the concave relaxation with single-view cuts.

Columns are single-robot paths. The restricted master maximises sum w u over mixtures of the
columns found so far, one per robot, with

    u <= sqrt(z),  z = sum of coverage       (second-order cone)
    u <= sum of sqrt(coverage)               (single-view cut: the root is subadditive)

and conflict rows added when a mixture breaks them. Its multipliers are a certificate at every
iteration; pricing new columns with them is one backward sweep per class of robots.
"""

import time
from dataclasses import dataclass, field
from typing import Any

import clarabel
import numpy as np
from scipy import sparse

from cocap_opt.model import Model, Path, RobotClass, compiled
from cocap_opt.plan import Plan
from cocap_opt.problem import FloatArray, IntArray, Problem
from cocap_opt.result import Limit, Reason
from cocap_opt.reward import (
    group_weights,
    marginal_reward,
    no_pixels,
    robot_pixels,
    spread,
    unchanged,
)
from cocap_opt.stop import Stop, never
from cocap_opt.timegraph import CLOSED, NO_CHARGES, Charges
from formulations.bound import BoundResult
from formulations.certificate import certify
from formulations.multipliers import certificate_of, repaired
from formulations.rows import CellPath, Key, broken_rows, row_charges, uses

RELATIVE_TOLERANCE = 1e-7  # stop when bound and master agree to this
MOST_PENALTY_RAISES = 8


@dataclass(frozen=True)
class Column:
    """A path of one robot."""

    robot: int
    path: Path
    cells: CellPath
    pixels: FloatArray  # [G] px/m2
    bonus: float  # stationarity along the path


@dataclass
class Duals:
    """Multipliers of the master; any non-negative ones give a bound."""

    alpha: FloatArray  # [G]
    beta: FloatArray  # [G]
    rows: dict[Key, float]
    convexity: FloatArray  # [R] what a robot's columns are worth now
    value: float  # the master's objective
    mixture: FloatArray  # weight of each column
    slack: float  # total violation of conflict rows that was paid for


@dataclass
class Master:
    """Restricted master problem over the columns found so far."""

    model: Model
    columns: list[Column] = field(default_factory=list)
    rows: list[Key] = field(default_factory=list)
    known: set[tuple[int, Path]] = field(default_factory=set)
    penalty: float = 1.0  # cost of a violated conflict row, so that there is a solution

    def add(self, column: Column) -> bool:
        """Take a column in; False if it was there already."""
        if (column.robot, column.path) in self.known:
            return False
        self.known.add((column.robot, column.path))
        self.columns.append(column)
        return True

    def solve(self) -> Duals:
        """Solve by Clarabel's interior-point method (one thread)."""
        problem = self.model.problem
        weights = group_weights(problem)
        pixels = np.stack([column.pixels for column in self.columns])  # [N, G]
        used = np.flatnonzero((pixels.max(axis=0) > 0) & (weights > 0))
        scale = np.sqrt(pixels[:, used].max(axis=0))  # brings the roots of each group to 0..1
        scaled = sparse.csr_array(pixels[:, used].T / scale[:, None] ** 2)  # [g, N]
        unit = float((weights[used] * scale).max()) if len(used) else 1.0
        cost = _objective(self, weights[used] * scale, unit)
        blocks, rhs, cones = self._constraints(scaled)
        settings = clarabel.DefaultSettings()
        settings.verbose = False
        settings.max_threads = 1
        solution = clarabel.DefaultSolver(
            sparse.csc_matrix((len(cost), len(cost))), cost, sparse.csc_matrix(blocks), rhs,
            cones, settings,
        ).solve()  # fmt: skip
        return self._duals(solution, used, scale, weights[used], unit)

    def _constraints(
        self, scaled: sparse.csr_array
    ) -> tuple[sparse.csr_array, FloatArray, list[object]]:
        """Rows in Clarabel's form A x + s = b over x = (mixture, slack, u)."""
        n_groups, n = scaled.shape
        n_rows, n_robots = len(self.rows), len(self.model.problem.robots)
        robots = [column.robot for column in self.columns]
        one_each = sparse.csr_array((np.ones(n), (robots, np.arange(n))), shape=(n_robots, n))
        in_row = [
            (r, c)
            for r, key in enumerate(self.rows)
            for c, column in enumerate(self.columns)
            if uses(key, column.cells)
        ]
        at = np.array(in_row, dtype=np.int64).reshape(-1, 2).T
        conflicts = sparse.csr_array((np.ones(at.shape[1]), (at[0], at[1])), shape=(n_rows, n))
        eye = sparse.eye_array
        # Per group the cone (1 + z, 2 u, z - 1): u^2 <= z.
        first = 3 * np.arange(n_groups)
        lift, lift_u, lift_z = (
            sparse.csr_array(
                (np.ones(n_groups), (first + k, np.arange(n_groups))),
                shape=(3 * n_groups, n_groups),
            )
            for k in range(3)
        )
        blocks: list[list[Any]] = [
            [one_each, sparse.csr_array((n_robots, n_rows)), None],
            [conflicts, -eye(n_rows), sparse.csr_array((n_rows, n_groups))],
            [-eye(n), None, None],
            [None, -eye(n_rows), None],
            [-scaled.sqrt(), None, eye(n_groups)],
            [-(lift + lift_z) @ scaled, None, -2 * lift_u],
        ]
        cone_rhs = np.tile([1.0, 0.0, -1.0], n_groups)
        rhs = np.concatenate(
            [np.ones(n_robots + n_rows), np.zeros(n + n_rows + n_groups), cone_rhs]
        )
        cones: list[object] = [
            clarabel.ZeroConeT(n_robots),
            clarabel.NonnegativeConeT(2 * n_rows + n + n_groups),
            *(clarabel.SecondOrderConeT(3) for _ in range(n_groups)),
        ]
        return sparse.block_array(blocks), rhs, cones

    def _duals(
        self,
        solution: "clarabel.DefaultSolution",
        used: IntArray,
        scale: FloatArray,
        weights: FloatArray,
        unit: float,
    ) -> Duals:
        n, n_rows = len(self.columns), len(self.rows)
        n_robots, n_groups = len(self.model.problem.robots), len(used)
        x, y = np.array(solution.x), np.array(solution.z) * unit
        parts = np.split(y, np.cumsum([n_robots, n_rows, n, n_rows, n_groups]))
        cones = parts[5].reshape(n_groups, 3)
        alpha = np.ones_like(no_pixels(self.model.problem))
        alpha[used] = parts[4] / (weights * scale)
        beta = np.zeros_like(alpha)
        beta[used] = (cones[:, 0] + cones[:, 2]) / (weights * scale**2)
        largest = np.sqrt(n_robots) * scale  # no group's root can be larger
        alpha[used], beta[used] = repaired(alpha[used], beta[used], largest)
        return Duals(
            alpha=alpha,
            beta=beta,
            rows=dict(zip(self.rows, np.maximum(parts[1], 0.0).tolist(), strict=True)),
            convexity=parts[0],
            value=-float(solution.obj_val) * unit,
            mixture=np.maximum(x[:n], 0.0),
            slack=float(np.maximum(x[n : n + n_rows], 0.0).sum()),
        )


def _objective(master: Master, root_weights: FloatArray, unit: float) -> FloatArray:
    bonus = np.array([column.bonus for column in master.columns])
    slack = np.full(len(master.rows), master.penalty)
    return np.concatenate([-bonus, slack, -root_weights]) / unit


def price_paths(
    model: Model, group: RobotClass, alpha: FloatArray, beta: FloatArray, charges: Charges
) -> FloatArray:
    """Value to go [T+1, S] of paths under the master's multipliers: one backward sweep."""
    table = model.coverage(group)
    paid = alpha[table.groups] * np.sqrt(table.pixels) + beta[table.groups] * table.pixels
    paid *= group_weights(model.problem)[table.groups]
    reward = spread(model, group, table.row_sums(paid))
    bonus = model.problem.objective.stationarity
    return group.graph.backward_sweep(reward, bonus, charges, group.goal)


def make_column(model: Model, robot: int, path: Path) -> Column:
    """Column of a robot's path of state numbers."""
    group, problem = model.class_of[robot], model.problem
    return Column(
        robot=robot,
        path=path,
        cells=tuple(problem.cell(robot, group.graph.state(s)) for s in path),
        pixels=robot_pixels(model, robot, path),
        bonus=problem.objective.stationarity * unchanged([path]),
    )


def first_columns(model: Model) -> list[Column] | None:
    """One path per robot, each best given the earlier ones; None where a robot has none."""
    seen, columns = no_pixels(model.problem), []
    bonus = model.problem.objective.stationarity
    for robot in range(len(model.problem.robots)):
        group = model.class_of[robot]
        reward = marginal_reward(model, group, seen)
        value = group.graph.backward_sweep(reward, bonus, NO_CHARGES, group.goal)
        path = group.graph.best_path(value, model.start(robot), bonus)
        if path is None:
            return None
        columns.append(make_column(model, robot, tuple(path)))
        seen = seen + columns[-1].pixels
    return columns


@dataclass(frozen=True)
class Iteration:
    """Outcome of pricing once: a bound, its multipliers and what to do next."""

    bound: float
    duals: Duals
    new_columns: list[Column]


def price_columns(model: Model, duals: Duals) -> Iteration:
    """Bound of these multipliers, and each robot's best path as a new column."""
    problem = model.problem
    weights = group_weights(problem)
    safe_beta = np.where(duals.beta > 0, duals.beta, 1.0)
    kappa = np.where(duals.alpha < 1, (1 - duals.alpha) ** 2 / (4 * safe_beta), 0.0)
    bound = float((weights * kappa).sum()) + sum(duals.rows.values())
    columns = []
    for group in model.classes:
        charges = row_charges(model, group, duals.rows.items())
        value = price_paths(model, group, duals.alpha, duals.beta, charges)
        for robot, start in zip(group.robots, group.starts, strict=True):
            bound += float(value[0, start])
            if value[0, start] > CLOSED:
                path = group.graph.best_path(value, start, problem.objective.stationarity, charges)
                assert path is not None
                columns.append(make_column(model, robot, tuple(path)))
    return Iteration(bound, duals, columns)


def column_generation(
    problem: Problem, stop: Stop = never, plan: Plan | None = None
) -> BoundResult:
    """Bound of the relaxation with single-view cuts and conflict rows, at the root.

    Parameters
    ----------
    plan : its paths are taken as columns to begin with

    Returns
    -------
    BoundResult
        The best certificate found, also where a limit stopped it. A negative bound proves
        that there is no plan, since J >= 0.
    """
    begin = time.perf_counter()
    model = compiled(problem)
    best = Iteration(np.inf, _alone(model), [])
    columns = first_columns(model)
    statistics: dict[str, float] = dict.fromkeys(("iterations", "columns", "rows"), 0)
    limit = Limit.NONE
    if columns is not None:
        master = Master(model)
        if plan is not None:
            columns += [make_column(model, i, path) for i, path in enumerate(model.paths(plan))]
        for column in columns:
            master.add(column)
        best, limit = _iterate(master, best, stop, statistics)
        statistics |= {"columns": len(master.columns), "rows": len(master.rows)}
    duals = best.duals
    certificate = certificate_of(problem, duals.alpha, duals.beta, duals.rows)
    file = certify(problem, model, "column-generation", certificate)
    reason = Reason.FINISHED if limit is Limit.NONE else Reason.STOPPED
    if file.bound < 0:
        reason, limit = Reason.INFEASIBLE, Limit.NONE
    return BoundResult(file, reason, limit, time.perf_counter() - begin, statistics)


def _alone(model: Model) -> Duals:
    """The multipliers of the bound in which every robot is alone."""
    zeros = no_pixels(model.problem)
    robots = np.zeros(len(model.problem.robots))
    return Duals(zeros + 1.0, zeros, {}, robots, np.inf, np.zeros(0), 0.0)


def _iterate(
    master: Master, best: Iteration, stop: Stop, statistics: dict[str, float]
) -> tuple[Iteration, Limit]:
    """Solve and price in turn until bound and master agree, or a limit is reached."""
    model, raises = master.model, 0
    master.penalty = 2 * price_columns(model, best.duals).bound + 1.0
    while True:
        limit = stop()
        if limit is not Limit.NONE:
            return best, limit
        statistics["iterations"] += 1
        duals = master.solve()
        iteration = price_columns(model, duals)
        if iteration.bound < best.bound:
            best = iteration
        if best.bound < 0:
            return best, Limit.NONE
        cells = [column.cells for column in master.columns]
        rows = [key for key in broken_rows(model.problem, cells, duals.mixture.tolist())
                if key not in set(master.rows)]  # fmt: skip
        master.rows += rows
        worth = {column.robot: column for column in iteration.new_columns}
        added = [master.add(column) for column in worth.values()]
        converged = best.bound - duals.value <= RELATIVE_TOLERANCE * abs(best.bound)
        if rows or (any(added) and not converged):
            continue
        if duals.slack < 1e-6 or raises == MOST_PENALTY_RAISES:
            return best, Limit.NONE
        # Rows are still paid for: either there is no plan or the penalty is too low.
        master.penalty *= 10
        raises += 1
