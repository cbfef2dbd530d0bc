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
from cocap_opt.result import Reason
from cocap_opt.reward import (
    group_weights,
    marginal_reward,
    no_pixels,
    robot_pixels,
    spread,
    unchanged,
)
from cocap_opt.stop import Limit, Stop, never, seconds_left
from cocap_opt.timegraph import CLOSED, NO_CHARGES, Charges
from formulations.bound import BoundResult, no_bound
from formulations.certificate import certify
from formulations.multipliers import certificate_of, repaired
from formulations.rows import CellPath, Key, broken_rows, row_charges, uses

METHOD = "column-generation"
RELATIVE_TOLERANCE = 1e-7  # stop when bound and master agree to this
ACCURACY = 1e-5  # if pricing finds nothing new, they must agree to this to be called converged
MOST_PENALTY_RAISES = 8
NO_TIME_LIMIT = 1e9  # s, Clarabel takes no infinity


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
    value: float  # the master's objective
    mixture: FloatArray  # weight of each column
    slack: float  # total violation of conflict rows that was paid for
    solved: bool  # whether the solver says so, be it with reduced accuracy


@dataclass
class Master:
    """Restricted master problem over the columns found so far."""

    model: Model
    penalty: float  # cost of a violated conflict row, so that there is a solution
    columns: list[Column] = field(default_factory=list)
    users: dict[Key, list[int]] = field(default_factory=dict)  # columns that use each row
    known: set[tuple[int, Path]] = field(default_factory=set)

    def add(self, column: Column) -> bool:
        """Take a column in; False if it was there already."""
        if (column.robot, column.path) in self.known:
            return False
        self.known.add((column.robot, column.path))
        for key, users in self.users.items():
            if uses(key, column.cells):
                users.append(len(self.columns))
        self.columns.append(column)
        return True

    def add_broken_rows(self, mixture: FloatArray) -> bool:
        """Take in the rows that a mixture of the columns breaks; False if there is no new one."""
        cells = [column.cells for column in self.columns]
        broken = broken_rows(self.model.problem, cells, mixture.tolist())
        new = [key for key in broken if key not in self.users]
        for key in new:
            self.users[key] = [n for n, path in enumerate(cells) if uses(key, path)]
        return bool(new)

    def solve(self, seconds: float) -> Duals:
        """Solve by Clarabel's interior-point method (one thread)."""
        problem = self.model.problem
        weights = group_weights(problem)
        pixels = np.stack([column.pixels for column in self.columns])  # [N, G]
        used = np.flatnonzero((pixels.max(axis=0) > 0) & (weights > 0))
        scale = np.sqrt(pixels[:, used].max(axis=0))  # brings the roots of each group to 0..1
        scaled = sparse.csr_array(pixels[:, used].T / scale[:, None] ** 2)  # [g, N]
        bonus = max(column.bonus for column in self.columns)
        unit = max(float((weights[used] * scale).max(initial=0.0)), bonus) or 1.0
        cost = _objective(self, weights[used] * scale, unit)
        blocks, rhs, cones = self._constraints(scaled)
        settings = clarabel.DefaultSettings()
        settings.verbose = False
        settings.max_threads = 1
        settings.time_limit = min(seconds, NO_TIME_LIMIT)
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
        n_rows, n_robots = len(self.users), len(self.model.problem.robots)
        robots = [column.robot for column in self.columns]
        one_each = sparse.csr_array((np.ones(n), (robots, np.arange(n))), shape=(n_robots, n))
        in_row = [(r, n) for r, users in enumerate(self.users.values()) for n in users]
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
        n, n_rows = len(self.columns), len(self.users)
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
            rows=dict(zip(self.users, np.maximum(parts[1], 0.0).tolist(), strict=True)),
            value=-float(solution.obj_val) * unit,
            mixture=np.maximum(x[:n], 0.0),
            slack=float(np.maximum(x[n : n + n_rows], 0.0).sum()),
            solved=str(solution.status) in ("Solved", "AlmostSolved"),
        )


def _objective(master: Master, root_weights: FloatArray, unit: float) -> FloatArray:
    bonus = np.array([column.bonus for column in master.columns])
    slack = np.full(len(master.users), master.penalty)
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
    limit = model.prepare_all(stop)
    if limit is not Limit.NONE:
        return no_bound(METHOD, limit, time.perf_counter() - begin)
    best = price_columns(model, _alone(model))
    columns = first_columns(model)
    statistics: dict[str, float] = dict.fromkeys(("iterations", "columns", "rows"), 0)
    if columns is not None and best.bound > 0:
        # Twice what all robots can see is more than a violated row can ever bring.
        master = Master(model, penalty=2 * best.bound)
        if plan is not None:
            columns += [make_column(model, i, path) for i, path in enumerate(model.paths(plan))]
        for column in columns:
            master.add(column)
        best, limit = _iterate(master, best, stop, statistics)
        statistics |= {"columns": len(master.columns), "rows": len(master.users)}
    duals = best.duals
    certificate = certificate_of(problem, duals.alpha, duals.beta, duals.rows)
    file = certify(problem, model, METHOD, certificate)
    reason = Reason.FINISHED if limit is Limit.NONE else Reason.STOPPED
    if file.proved < 0:
        reason, limit = Reason.INFEASIBLE, Limit.NONE
    return BoundResult(METHOD, file, reason, limit, time.perf_counter() - begin, statistics)


def _alone(model: Model) -> Duals:
    """The multipliers of the bound in which every robot is alone."""
    zeros = no_pixels(model.problem)
    return Duals(zeros + 1.0, zeros, {}, np.inf, np.zeros(0), slack=0.0, solved=True)


def _iterate(
    master: Master, best: Iteration, stop: Stop, statistics: dict[str, float]
) -> tuple[Iteration, Limit]:
    """Solve and price in turn until bound and master agree, or a limit is reached."""
    raises = 0
    while (limit := stop()) is Limit.NONE:
        statistics["iterations"] += 1
        duals = master.solve(seconds_left(stop))
        if not (np.isfinite(duals.alpha).all() and np.isfinite(duals.beta).all()):
            return best, Limit.NUMERICS
        iteration = price_columns(master.model, duals)
        if iteration.bound < best.bound:
            best = iteration
        elif not duals.solved:
            break
        if best.bound <= 0:
            return best, Limit.NONE
        new_rows = master.add_broken_rows(duals.mixture)
        new_columns = [master.add(column) for column in iteration.new_columns]
        open_gap = best.bound - duals.value
        if new_rows or (any(new_columns) and open_gap > RELATIVE_TOLERANCE * abs(best.bound)):
            continue
        if duals.slack < 1e-6:
            converged = open_gap <= ACCURACY * abs(best.bound)
            return best, Limit.NONE if converged else Limit.NUMERICS
        # Rows are still paid for: either there is no plan or the penalty is too low.
        if raises == MOST_PENALTY_RAISES:
            break
        master.penalty *= 10
        raises += 1
    limit = limit if limit is not Limit.NONE else stop()
    return best, limit if limit is not Limit.NONE else Limit.NUMERICS
