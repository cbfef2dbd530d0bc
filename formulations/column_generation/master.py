"""The restricted master problem: the best mixture of the paths found so far.

Columns are single-robot paths. The master takes their arcs, so that paths of one class of
robots that meet in a state may be recombined there: an aggregated flow with one unit from
each start over the union of all paths. (Column generation for extended formulations: Sadykov
and Vanderbeck 2013. With long horizons it needs far fewer columns than mixtures of whole
paths.) It maximises sum w u, where the root u of a view sum (t, face) obeys

    u <= sqrt(z),  z = sum of pixels         (second-order cone)
    u <= sum of roots of pixels              (single-view cut: the root is subadditive)
    u <= constant + sum of phi(roots)        (envelope cuts, certificates.envelope)

and so many robots use a resource (collision rules, certificates.resources; decisions of a
branch-and-price tree). Any non-negative multipliers of these rows are a certificate.
"""

import math
from collections.abc import Collection, Sequence
from typing import Any, NamedTuple

import clarabel
import numpy as np
from scipy import sparse

from cocap_opt.data import BoolArray, FloatArray, IntArray
from cocap_opt.formulations.certificates.certificate import Decision
from cocap_opt.formulations.certificates.envelope import Cut
from cocap_opt.formulations.certificates.resources import (
    Flight,
    Resource,
    flight_of,
    footprint,
    uses,
)
from cocap_opt.formulations.relaxations.cone_solver import solve_cones
from cocap_opt.formulations.relaxations.duals import Duals, repaired
from cocap_opt.graph.move_rewards import bonuses_of
from cocap_opt.model import Model, Path
from cocap_opt.objective import most_views, robot_pixels, view_sum_weights
from cocap_opt.stop import Stop, never

BEST_ACCURACY = 1e-8
USED = 1e-7  # flow on an arc that counts as use


class Column(NamedTuple):
    """A path of one robot and what it sees."""

    robot: int
    flight: Flight
    view_sums: IntArray  # [k] view sums that it sees anything of, increasing
    pixels: FloatArray  # [k] px/m2

    @property
    def path(self) -> Path:
        """State numbers of the path."""
        return self.flight.path

    @property
    def key(self) -> tuple[int, Path]:
        """What tells columns apart."""
        return self.robot, self.flight.path


def make_column(model: Model, robot: int, path: Path) -> Column:
    """Column of a robot's path of state numbers."""
    pixels = robot_pixels(model, robot, path)
    view_sums = np.flatnonzero(pixels)
    return Column(robot, flight_of(model, robot, path), view_sums, pixels[view_sums])


class Solution(NamedTuple):
    """An optimal mixture and its multipliers."""

    value: float  # of the master
    columns: list[Column]  # paths that the flow splits into
    mixture: FloatArray  # [n] weight of each of them
    slack: float  # how much of conflict rows and decisions is broken, at the penalty's price
    duals: Duals
    solved: bool  # whether the solver says so, be it with reduced accuracy


class Arc(NamedTuple):
    """A step of the robots of one class."""

    class_number: int  # its number
    t: int
    tail: int  # state at t
    head: int  # state at t+1


class Master:
    """Restricted master problem; rows that the mixture breaks are added later.

    Attributes
    ----------
    penalty : cost of a broken conflict row or decision, so that there is always a solution
    """

    def __init__(self, model: Model, penalty: float, decisions: tuple[Decision, ...] = ()) -> None:
        self.model = model
        self.penalty = penalty
        self.decisions = decisions
        self._columns: dict[tuple[int, Path], Column] = {}
        self._arcs: dict[Arc, int] = {}
        self._idle = np.zeros(0, dtype=np.int64)  # solves since each arc was used
        self._seen = _Views(model)
        self._rows: list[Resource] = []
        self._open = [d for d in decisions if not d.closes]
        self._closed = [d.resource for d in decisions if d.closes]
        self._cuts: list[Cut] = []
        self._weights = view_sum_weights(model.problem)

    @property
    def columns(self) -> list[Column]:
        """Paths whose arcs are all in the master."""
        return list(self._columns.values())

    @property
    def rows(self) -> tuple[Resource, ...]:
        """Resources of the conflict rows."""
        return tuple(self._rows)

    @property
    def cuts(self) -> tuple[Cut, ...]:
        """The envelope cuts."""
        return tuple(self._cuts)

    @property
    def arcs(self) -> Collection[Arc]:
        """The arcs of all paths."""
        return self._arcs.keys()

    def add(self, column: Column) -> bool:
        """Take a path in; False if it brings no new arc or a decision closes it."""
        if column.key in self._columns:
            return False
        if any(uses(self.model, resource, column.flight) for resource in self._closed):
            return False
        self._columns[column.key] = column
        before = len(self._arcs)
        for arc in arcs_of(column.flight):
            self._arcs.setdefault(arc, len(self._arcs))
        new = len(self._arcs) - before
        self._idle = np.append(self._idle, np.zeros(new, dtype=np.int64))
        return new > 0

    def add_row(self, resource: Resource) -> bool:
        """Take in a conflict row; False if it is there already."""
        if resource in self._rows:
            return False
        self._rows.append(resource)
        return True

    def add_cut(self, cut: Cut) -> None:
        """Take in an envelope cut."""
        self._cuts.append(cut)

    def drop_cuts(self, duals: Duals) -> None:
        """Drop the cuts that have no share in a solution."""
        self._cuts = [cut for cut, share in duals.cuts if share > 1e-6]

    def drop_idle(self, most_idle: int) -> None:
        """Drop the arcs that none of the last solves has used, and the paths over them."""
        keep = self._idle <= most_idle
        if keep.all():
            return
        idle = dict(zip(self._arcs, self._idle.tolist(), strict=True))
        arcs = self._leading_on([arc for arc, n in idle.items() if n <= most_idle])
        self._arcs = {arc: n for n, arc in enumerate(arcs)}
        self._idle = np.array([idle[arc] for arc in arcs], dtype=np.int64)
        self._columns = {
            key: column
            for key, column in self._columns.items()
            if all(arc in self._arcs for arc in arcs_of(column.flight))
        }

    def _leading_on(self, arcs: list[Arc]) -> list[Arc]:
        """Those of the arcs that lie on a path of such arcs from a start to the last step."""
        horizon = self.model.problem.horizon
        ends = {(arc.class_number, horizon, arc.head) for arc in arcs if arc.t == horizon - 1}
        for arc in sorted(arcs, key=lambda arc: -arc.t):
            if (arc.class_number, arc.t + 1, arc.head) in ends:
                ends.add((arc.class_number, arc.t, arc.tail))
        begun = {
            (number, 0, start)
            for number, robot_class in enumerate(self.model.classes)
            for start in robot_class.starts
        }
        for arc in sorted(arcs, key=lambda arc: arc.t):
            if (arc.class_number, arc.t, arc.tail) in begun:
                begun.add((arc.class_number, arc.t + 1, arc.head))
        on = begun & ends
        return [
            arc
            for arc in arcs
            if (arc.class_number, arc.t, arc.tail) in on
            and (arc.class_number, arc.t + 1, arc.head) in on
        ]

    def used_columns(self, most_idle: int) -> list[Column]:
        """Paths all of whose arcs one of the last solves has used."""
        fresh = self._idle <= most_idle
        return [
            column
            for column in self._columns.values()
            if all(fresh[self._arcs[arc]] for arc in arcs_of(column.flight))
        ]

    def solve(self, stop: Stop = never, accuracy: float = BEST_ACCURACY) -> Solution:
        """Solve by Clarabel's interior-point method (one thread).

        Parameters
        ----------
        accuracy : relative, of the value
        """
        arcs = list(self._arcs)
        seen = self._seen.of(arcs)
        bonus = _bonuses(self.model, arcs)
        weights = self._weights[seen.used] * seen.scale
        unit = max(float(weights.max(initial=0.0)), float(bonus.max())) or 1.0
        n_rows = len(self._rows) + len(self._open)
        cost = np.concatenate([-bonus, np.full(n_rows, self.penalty), -weights]) / unit
        cost = np.append(cost, np.zeros(len(weights)))
        blocks, rhs, cones, sizes = self._constraints(arcs, seen)
        # Multipliers are certified whatever they are: digits cost time, no more.
        solution = solve_cones(
            cost, blocks, rhs, cones, stop,
            tol_gap_rel=accuracy, tol_gap_abs=accuracy, tol_feas=accuracy,
            direct_solve_method="faer",
            iterative_refinement_reltol=1e-8, iterative_refinement_abstol=1e-8,
        )  # fmt: skip
        result = self._solution(solution, arcs, seen, sizes, unit)
        used = np.nan_to_num(np.array(solution.x)[: len(arcs)]) > USED
        self._idle = np.where(used, 0, self._idle + 1)
        return result

    def _constraints(
        self, arcs: list[Arc], seen: "_Seen"
    ) -> tuple[sparse.csc_matrix, FloatArray, list[object], list[int]]:
        """Rows in Clarabel's form A x + s = b over x = (flow, slack, u), and their sizes."""
        n, n_view_sums = len(arcs), len(seen.used)
        users = _users(self.model, [*self._rows, *(d.resource for d in self._open)], arcs)
        signs = np.array([1] * len(self._rows) + [d.sign for d in self._open])
        limits = np.array([1] * len(self._rows) + [d.sign * d.robots for d in self._open])
        n_rows = len(users)
        rows = _Rows()
        units = self._put_conservation(rows, arcs)
        rows.start(n_rows)
        row = np.repeat(np.arange(n_rows), [len(some) for some in users])
        arc = np.array([k for some in users for k in some], dtype=np.int64)
        rows.put(row, arc, signs[row].astype(np.float64) if n_rows else np.zeros(0))
        rows.put(np.arange(n_rows), n + np.arange(n_rows), -np.ones(n_rows))
        rows.start(n + n_rows)
        rows.put(np.arange(n + n_rows), np.arange(n + n_rows), -np.ones(n + n_rows))
        first = n + n_rows
        each = np.arange(n_view_sums)
        rows.start(n_view_sums)
        rows.put(seen.at, seen.of, -seen.roots)
        rows.put(each, first + each, np.ones(n_view_sums))
        constants = self._put_cuts(rows, arcs, seen, first)
        # z <= pixels; a variable of its own keeps the cones small.
        pixels = first + n_view_sums
        rows.start(n_view_sums)
        rows.put(seen.at, seen.of, -(seen.roots**2))
        rows.put(each, pixels + each, np.ones(n_view_sums))
        # Per view sum the cone (1 + z, 2 u, z - 1): u^2 <= z.
        rows.start(3 * n_view_sums)
        rows.put(3 * each, pixels + each, -np.ones(n_view_sums))
        rows.put(3 * each + 2, pixels + each, -np.ones(n_view_sums))
        rows.put(3 * each + 1, first + each, np.full(n_view_sums, -2.0))
        rhs = np.concatenate(
            [
                units, limits, np.zeros(n + n_rows + n_view_sums), constants, np.zeros(n_view_sums),
                np.tile([1.0, 0.0, -1.0], n_view_sums),
            ]
        )  # fmt: skip
        cones: list[object] = [
            clarabel.ZeroConeT(len(units)),
            clarabel.NonnegativeConeT(2 * n_rows + n + 2 * n_view_sums + len(constants)),
            *(clarabel.SecondOrderConeT(3) for _ in range(n_view_sums)),
        ]
        sizes = [len(units), len(self._rows), len(self._open), n + n_rows, n_view_sums]
        return (
            rows.matrix(first + 2 * n_view_sums),
            rhs,
            cones,
            [*sizes, len(constants), n_view_sums],
        )

    def _put_conservation(self, rows: "_Rows", arcs: list[Arc]) -> FloatArray:
        """One unit leaves each start, and what enters a state before step T leaves it."""
        nodes: dict[tuple[int, int, int], int] = {}
        leaving = [nodes.setdefault((a.class_number, a.t, a.tail), len(nodes)) for a in arcs]
        inner = [k for k, a in enumerate(arcs) if a.t + 1 < self.model.problem.horizon]
        entering = [nodes[arcs[k].class_number, arcs[k].t + 1, arcs[k].head] for k in inner]
        rows.start(len(nodes))
        rows.put(np.array(leaving), np.arange(len(arcs)), np.ones(len(arcs)))
        rows.put(np.array(entering, dtype=np.int64), np.array(inner, dtype=np.int64),
                 -np.ones(len(inner)))  # fmt: skip
        units = np.zeros(len(nodes))
        for number, robot_class in enumerate(self.model.classes):
            for start in robot_class.starts:
                units[nodes[number, 0, start]] += 1
        return units

    def _put_cuts(self, rows: "_Rows", arcs: list[Arc], seen: "_Seen", first: int) -> FloatArray:
        """Rows u <= constant + sum of phi(roots); returns the constants in units of the roots."""
        order = np.argsort(seen.at, kind="stable")
        bounds = np.searchsorted(seen.at[order], np.arange(len(seen.used) + 1))
        rows.start(len(self._cuts))
        constants = np.zeros(len(self._cuts))
        classes = np.array([arc.class_number for arc in arcs])
        where, present = self._cut_view_sums(seen)
        for k in np.flatnonzero(present).tolist():
            cut, g = self._cuts[k], int(where[k])
            scale = seen.scale[g]
            entries = order[bounds[g] : bounds[g + 1]]
            values = cut.phi_of(classes[seen.of[entries]], seen.roots[entries] * scale) / scale
            rows.put(np.full(len(entries), k), seen.of[entries], -values)
            rows.put(np.array([k]), np.array([first + g]), np.ones(1))
            constants[k] = cut.constant / scale
        return constants

    def _cut_view_sums(self, seen: "_Seen") -> tuple[IntArray, BoolArray]:
        """Position of each cut's robot_class among those used, and whether it is among them."""
        view_sums = np.array([cut.view_sum for cut in self._cuts], dtype=np.int64)
        where = np.searchsorted(seen.used, view_sums)
        present = where < len(seen.used)
        present[present] = seen.used[where[present]] == view_sums[present]
        return where, present

    def _solution(
        self, solution: Any, arcs: list[Arc], seen: "_Seen", sizes: list[int], unit: float
    ) -> Solution:
        n, n_view_sums, n_cuts = len(arcs), len(seen.used), len(self._cuts)
        x, y = np.nan_to_num(np.array(solution.x)), np.array(solution.z)
        parts = np.split(y, np.cumsum(sizes))
        rows, decisions, alpha_part, cut_part = parts[1], parts[2], parts[4], parts[5]
        beta_part = parts[6]
        weights = self._weights[seen.used] * seen.scale / unit
        alpha, beta = np.ones_like(self._weights), np.zeros_like(self._weights)
        where, present = self._cut_view_sums(seen)
        shares = np.zeros(n_cuts)
        shares[present] = np.clip(
            np.nan_to_num(cut_part[present]) / weights[where[present]], 0.0, 1.0
        )
        taken = np.bincount(where[present], shares[present], minlength=n_view_sums)
        shares[present] /= np.maximum(taken, 1.0)[where[present]]
        alpha[seen.used], beta[seen.used] = repaired(
            alpha_part / weights,
            beta_part / (weights * seen.scale),
            np.maximum(1 - taken, 0.0),
            math.sqrt(most_views(self.model.problem)) * seen.scale,  # no root can be larger
        )
        slack = x[n : n + len(rows) + len(decisions)]
        rows, decisions = (np.nan_to_num(np.maximum(p, 0.0)) * unit for p in (rows, decisions))
        columns, mixture = self._split(arcs, x[:n])
        return Solution(
            value=-float(solution.obj_val) * unit,
            columns=columns,
            mixture=mixture,
            slack=float(np.maximum(slack, 0.0).sum()),
            duals=Duals(
                alpha=alpha,
                beta=beta,
                rows=tuple(zip(self._rows, rows.tolist(), strict=True)),
                cuts=tuple(zip(self._cuts, shares.tolist(), strict=True)),
                decisions=self._all_decisions(decisions),
            ),
            solved=str(solution.status) in ("Solved", "AlmostSolved"),
        )

    def _all_decisions(self, multipliers: FloatArray) -> FloatArray:
        """Multipliers of all decisions; those that close a resource need none."""
        result = np.zeros(len(self.decisions))
        result[[not d.closes for d in self.decisions]] = multipliers
        return result

    def _split(self, arcs: list[Arc], flow: FloatArray) -> tuple[list[Column], FloatArray]:
        """Paths of the robots that the flow splits into, the widest first."""
        left = {arc: f for arc, f in zip(arcs, flow.tolist(), strict=True) if f > USED}
        leaving: dict[tuple[int, int, int], list[Arc]] = {}
        for arc in left:
            leaving.setdefault((arc.class_number, arc.t, arc.tail), []).append(arc)
        columns: list[Column] = []
        amounts: list[float] = []
        for robot in range(len(self.model.problem.robots)):
            robot_class = self.model.class_of[robot]
            number = self.model.classes.index(robot_class)
            rest = 1.0
            while rest > 1e-6:
                path = _widest(leaving, left, number, self.model.start(robot),
                               self.model.problem.horizon)  # fmt: skip
                if path is None:
                    break
                amount = min(rest, *(left[arc] for arc in path))
                for arc in path:
                    left[arc] -= amount
                rest -= amount
                states = (path[0].tail, *(arc.head for arc in path))
                column = self._columns.get((robot, states))
                columns.append(column or make_column(self.model, robot, states))
                amounts.append(amount)
        return columns, np.array(amounts)


def _widest(
    leaving: dict[tuple[int, int, int], list[Arc]],
    left: dict[Arc, float],
    number: int,
    start: int,
    horizon: int,
) -> list[Arc] | None:
    """A path along the largest flow that is left at each step; None where it has run dry."""
    path: list[Arc] = []
    state = start
    for t in range(horizon):
        arcs = leaving.get((number, t, state), [])
        best = max(arcs, key=lambda arc: left[arc], default=None)
        if best is None or left[best] <= USED / 10:
            return None
        path.append(best)
        state = best.head
    return path


def arcs_of(flight: Flight) -> list[Arc]:
    """Steps of a path."""
    path = flight.path
    return [Arc(flight.class_number, t, path[t], path[t + 1]) for t in range(len(path) - 1)]


def _bonuses(model: Model, arcs: Sequence[Arc]) -> FloatArray:
    """Rewards of the arcs for the moves themselves [n]."""
    bonuses = bonuses_of(model.problem.objective)
    classes, _, tails, heads = np.array(arcs, dtype=np.int64).reshape(-1, 4).T
    rewards = np.zeros(len(arcs))
    for number in np.unique(classes).tolist():
        own, shape = classes == number, model.classes[number].graph.shape
        rewards[own] = bonuses.of_edges(shape, tails[own], heads[own])
    return rewards


def _users(model: Model, resources: Sequence[Resource], arcs: list[Arc]) -> list[list[int]]:
    """Arcs that use each resource; a state is used by the arcs into it, a start by those out."""
    into: dict[tuple[int, int, int], list[int]] = {}
    along: dict[tuple[int, int, int, int], list[int]] = {}
    for k, arc in enumerate(arcs):
        graph = model.classes[arc.class_number].graph
        tail, head = arc.tail % graph.n_places, arc.head % graph.n_places
        into.setdefault((arc.class_number, arc.t + 1, head), []).append(k)
        if arc.t == 0:
            into.setdefault((arc.class_number, 0, tail), []).append(k)
        if tail != head:
            along.setdefault((arc.class_number, arc.t, tail, head), []).append(k)
    users = []
    for resource in resources:
        t, found = resource.t, list[int]()
        for number, robot_class in enumerate(model.classes):
            used = footprint(model, number, resource)
            for place in used.places:
                found += into.get((number, t, place), [])
            for one, other in used.moves:
                found += along.get((number, t, one, other), [])
            for state in used.states:
                near = into.get((number, t, state % robot_class.graph.n_places), [])
                found += [k for k in near if (arcs[k].head if t else arcs[k].tail) == state]
        users.append(found)
    return users


class _Seen(NamedTuple):
    """What the arcs see, entry by entry."""

    of: IntArray  # [k] arc
    at: IntArray  # [k] position of the view sum among those used
    roots: FloatArray  # [k] root of the pixels, in units of the view sum's best
    used: IntArray  # [g] view sums that any arc sees and that count
    scale: FloatArray  # [g] best root of each, px^0.5/m


class _Views:
    """What arcs see: the state that they enter, and at step 0 also the start."""

    def __init__(self, model: Model) -> None:
        self._model = model
        self._weights = view_sum_weights(model.problem)

    def of(self, arcs: list[Arc]) -> _Seen:
        """Entries of arcs, by numbers of rows in the coverage tables."""
        parts: list[tuple[IntArray, IntArray, FloatArray]] = []
        for number, robot_class in enumerate(self._model.classes):
            table = self._model.coverage(robot_class)
            own = [(k, a) for k, a in enumerate(arcs) if a.class_number == number]
            first = [(k, a.tail) for k, a in own if a.t == 0]
            n_states = robot_class.graph.n_states
            nodes = [(a.t + 1) * n_states + a.head for _, a in own] + [s for _, s in first]
            which, entries = table.entries(np.array(nodes, dtype=np.int64))
            arc = np.array([k for k, _ in (*own, *first)], dtype=np.int64)
            parts.append((arc[which], table.view_sums[entries], table.pixels[entries]))
        of, view_sums, pixels = (np.concatenate(part) for part in zip(*parts, strict=True))
        counted = self._weights[view_sums] > 0
        of, view_sums, pixels = of[counted], view_sums[counted], pixels[counted]
        used, at = np.unique(view_sums, return_inverse=True)
        best = np.zeros(len(used))
        np.maximum.at(best, at, pixels)
        scale = np.sqrt(best)  # brings the roots of each view sum to 0..1
        return _Seen(of, at, np.sqrt(pixels) / scale[at], used, scale)


class _Rows:
    """A sparse matrix that is written block of rows by block of rows."""

    def __init__(self) -> None:
        self._parts: list[tuple[IntArray, IntArray, FloatArray]] = []
        self._first = self._end = 0

    def start(self, size: int) -> None:
        """Begin a block of so many rows."""
        self._first, self._end = self._end, self._end + size

    def put(self, rows: IntArray, columns: IntArray, values: FloatArray) -> None:
        """Write entries; rows count from the block's first."""
        self._parts.append((rows + self._first, columns, values))

    def matrix(self, n_columns: int) -> sparse.csc_matrix:
        """All that has been written."""
        rows, columns, values = (np.concatenate(part) for part in zip(*self._parts, strict=True))
        return sparse.csc_matrix((values, (rows, columns)), shape=(self._end, n_columns))
