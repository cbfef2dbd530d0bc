"""The restricted master problem as a conic program over the flow on arcs.

It maximises rewards for moves + sum w u - penalty * slack, where the root u of a view sum obeys

    u <= sqrt(z),  z <= sum of pixels        (second-order cone)
    u <= sum of roots of pixels              (single-view row: the root is subadditive)
    u <= constant + sum of phi(roots)        (envelope cuts, `certificates.envelope`)

and so many robots use a resource (conflict rows, decisions). Roots are in units of the largest
that an arc has of the view sum.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from cocap_opt.data import BoolArray, FloatArray, IntArray
from cocap_opt.formulations.certificates import Decision
from cocap_opt.formulations.certificates.envelope import Cut
from cocap_opt.formulations.certificates.resources import Resource
from cocap_opt.formulations.column_generation.master.coefficients import Coefficients
from cocap_opt.formulations.column_generation.master.columns import Arc
from cocap_opt.formulations.column_generation.master.conic_program import (
    ConicProgram,
    ConicSolution,
)
from cocap_opt.formulations.relaxations.duals import Duals, repaired_roots
from cocap_opt.model import Model
from cocap_opt.stop import Stop


class _ProgramSolution(NamedTuple):
    """A solution of a restricted master problem."""

    value: float
    flow: FloatArray  # [n] on each arc
    slack: float  # robots by which conflict rows and decisions are broken, over all of them
    duals: Duals  # with the multipliers of the decisions that have rows
    is_solved: bool  # the solver says so, be it with reduced accuracy


@dataclass
class MasterProgram:
    """One restricted master problem over a set of arcs.

    Attributes
    ----------
    rows : resources that at most one robot may use
    decisions : decisions that need a row; those that close a resource need none
    penalty : cost of each unit by which a row or a decision is broken
    """

    model: Model
    arcs: Sequence[Arc]
    rows: Sequence[Resource]
    decisions: Sequence[Decision]
    cuts: Sequence[Cut]
    penalty: float

    def __post_init__(self) -> None:
        """Computes the coefficients of the arcs."""
        self._coefficients = Coefficients(self.model, self.arcs)
        self._views = views = self._coefficients.views()
        self._bonus = self._coefficients.move_rewards()
        weights = self.model.problem.view_sum_weights[views.view_sums] * views.scale
        # The solver's costs are in units of the largest one.
        largest = max(float(weights.max(initial=0.0)), float(self._bonus.max()))
        self._unit = largest or 1.0
        self._weights = weights

    def solve(self, stop: Stop, accuracy: float) -> _ProgramSolution:
        """Solves to a relative accuracy of the value, or to what a stop leaves time for."""
        sizes = {
            "flow": len(self.arcs),
            "slack": len(self.rows) + len(self.decisions),
            "roots": len(self._weights),
            "pixels": len(self._weights),
        }
        program = ConicProgram(sizes)
        self._add_conservation(program)
        self._add_resources(program)
        self._add_bounds(program, sizes["flow"], sizes["slack"])
        self._add_roots(program)
        cost = {
            "flow": -self._bonus / self._unit,
            "slack": np.full(sizes["slack"], self.penalty) / self._unit,
            "roots": -self._weights / self._unit,
        }
        return self._read(program.solve(cost, stop, accuracy))

    # -- the rows, block by block --------------------------------------------------------

    def _add_conservation(self, program: ConicProgram) -> None:
        """Adds the rows by which one unit leaves each start, and what enters a state leaves it."""
        nodes: dict[tuple[int, int, int], int] = {}
        leaving = [nodes.setdefault((a.class_number, a.t, a.tail), len(nodes)) for a in self.arcs]
        inner = [k for k, a in enumerate(self.arcs) if a.t + 1 < self.model.problem.horizon]
        into = [(self.arcs[k].class_number, self.arcs[k].t + 1, self.arcs[k].head) for k in inner]
        entering = np.array([nodes[node] for node in into], dtype=np.int64)
        units = np.zeros(len(nodes))
        for number, robot_class in enumerate(self.model.classes):
            for start in robot_class.starts:
                units[nodes[number, 0, start]] += 1
        name, each = "conservation", np.arange(len(self.arcs))
        program.add_equations(name, units)
        program.put(name, "flow", np.array(leaving), each, np.ones(len(each)))
        arcs = np.array(inner, dtype=np.int64)
        program.put(name, "flow", entering, arcs, -np.ones(len(inner)))

    def _add_resources(self, program: ConicProgram) -> None:
        """Adds the rows by which at most one robot, or as many as decided, use a resource."""
        decided = [decision.resource for decision in self.decisions]
        users = self._coefficients.users([*self.rows, *decided])
        of_rows, of_decisions = users[: len(self.rows)], users[len(self.rows) :]
        ones = np.ones(len(self.rows))
        signs = np.array([float(decision.sign) for decision in self.decisions])
        limits = np.array([float(d.sign * d.robots) for d in self.decisions])
        self._add_users(program, "rows", of_rows, ones, ones, 0)
        self._add_users(program, "decisions", of_decisions, signs, limits, len(self.rows))

    def _add_users(
        self, program: ConicProgram, name: str, users: list[list[int]],
        signs: FloatArray, limits: FloatArray, first_slack: int,
    ) -> None:  # fmt: skip
        """Adds rows sign * (flow on the users' arcs) - slack <= limit."""
        program.add_inequalities(name, limits)
        row = np.repeat(np.arange(len(users)), [len(arcs) for arcs in users])
        arcs = np.array([k for arcs_of in users for k in arcs_of], dtype=np.int64)
        program.put(name, "flow", row, arcs, signs[row] if len(users) else np.zeros(0))
        each = np.arange(len(users))
        program.put(name, "slack", each, first_slack + each, -np.ones(len(users)))

    def _add_bounds(self, program: ConicProgram, n_flow: int, n_slack: int) -> None:
        """Adds the rows by which neither flow nor slack is negative."""
        for name, size in (("flow", n_flow), ("slack", n_slack)):
            program.add_inequalities(f"{name} >= 0", np.zeros(size))
            program.put_diagonal(f"{name} >= 0", name, -1.0)

    def _add_roots(self, program: ConicProgram) -> None:
        """Adds the rows that bound the roots; see the module's docstring."""
        views, n = self._views, len(self._weights)
        program.add_inequalities("single view", np.zeros(n))
        program.put("single view", "flow", views.at, views.arcs, -views.roots)
        program.put_diagonal("single view", "roots", 1.0)
        self._add_cuts(program)
        # z <= pixels; a variable of its own keeps the cones small.
        program.add_inequalities("pixels", np.zeros(n))
        program.put("pixels", "flow", views.at, views.arcs, -(views.roots**2))
        program.put_diagonal("pixels", "pixels", 1.0)
        # Per view sum the cone (1 + z, 2 u, z - 1): u^2 <= z.
        program.add_cones("cones", np.tile([1.0, 0.0, -1.0], n))
        each = 3 * np.arange(n)
        program.put("cones", "pixels", each, each // 3, -np.ones(n))
        program.put("cones", "pixels", each + 2, each // 3, -np.ones(n))
        program.put("cones", "roots", each + 1, each // 3, np.full(n, -2.0))

    def _add_cuts(self, program: ConicProgram) -> None:
        """Adds rows u <= constant + sum of phi(roots); 0 <= 0 where no arc sees the view sum."""
        views = self._views
        constants = np.zeros(len(self.cuts))
        for k in np.flatnonzero(self._is_seen).tolist():
            constants[k] = self.cuts[k].constant / views.scale[self._cut_at[k]]
        program.add_inequalities("cuts", constants)
        order = np.argsort(views.at, kind="stable")
        bounds = np.searchsorted(views.at[order], np.arange(len(self._weights) + 1))
        classes = np.array([arc.class_number for arc in self.arcs])
        for k in np.flatnonzero(self._is_seen).tolist():
            z = int(self._cut_at[k])
            entries = order[bounds[z] : bounds[z + 1]]
            of, roots = views.arcs[entries], views.roots[entries] * views.scale[z]
            values = self.cuts[k].phi_of(classes[of], roots) / views.scale[z]
            program.put("cuts", "flow", np.full(len(entries), k), of, -values)
            program.put("cuts", "roots", np.array([k]), np.array([z]), np.ones(1))

    @cached_property
    def _cut_at(self) -> IntArray:
        """Position [k] of each cut's view sum among those that arcs see, where it is among them."""
        numbers = np.array([cut.view_sum for cut in self.cuts], dtype=np.int64)
        return np.searchsorted(self._views.view_sums, numbers)

    @cached_property
    def _is_seen(self) -> BoolArray:
        """True [k] for cuts whose view sum some arc sees."""
        seen, at = self._views.view_sums, self._cut_at
        numbers = np.array([cut.view_sum for cut in self.cuts], dtype=np.int64)
        present = at < len(seen)
        present[present] = seen[at[present]] == numbers[present]
        return present

    # -- the solution --------------------------------------------------------------------

    def _read(self, solution: ConicSolution) -> _ProgramSolution:
        """Returns a solution in the units of J."""
        return _ProgramSolution(
            value=-solution.value * self._unit,
            flow=solution.values("flow"),
            slack=float(np.maximum(solution.values("slack"), 0.0).sum()),
            duals=self._duals(solution),
            is_solved=solution.is_solved,
        )

    def _duals(self, solution: ConicSolution) -> Duals:
        """Returns the multipliers of the rows, repaired where they are out of range."""
        seen, shares = self._is_seen, np.zeros(len(self.cuts))
        alpha, beta, shares[seen] = repaired_roots(
            self.model.problem,
            view_sums=self._views.view_sums,
            scale=self._views.scale,
            weights=self._weights / self._unit,
            single_view=solution.multipliers("single view"),
            pixels=solution.multipliers("pixels"),
            cut_at=self._cut_at[seen],
            cuts=solution.multipliers("cuts")[seen],
        )
        rows = self._prices(solution, "rows")
        return Duals(
            alpha=alpha,
            beta=beta,
            rows=tuple(zip(self.rows, rows.tolist(), strict=True)),
            cuts=tuple(zip(self.cuts, shares.tolist(), strict=True)),
            decisions=self._prices(solution, "decisions"),
        )

    def _prices(self, solution: ConicSolution, block: str) -> FloatArray:
        """Returns the multipliers of a block of rows in the units of J, none negative."""
        multipliers = np.maximum(solution.multipliers(block), 0.0)
        return np.nan_to_num(multipliers) * self._unit
