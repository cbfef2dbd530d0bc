"""The restricted master problem as a conic program over the flow on arcs.

It maximises rewards for moves + sum w u - penalty * slack, where the root u of a view sum obeys

    u <= sqrt(z),  z <= sum of pixels        (second-order cone)
    u <= sum of roots of pixels              (single-view row: the root is subadditive)
    u <= constant + sum of phi(roots)        (envelope cuts, `certificates.envelope`)
    u <= constant + sum of phi(states)       (state cuts, `certificates.state_cuts`)

the value u of a count, in which at most k drones count,

    u <= number of drones,  u <= k           (the first is its single-view row)

and a limited number of robots uses each resource (conflict rows, decisions). Roots are in units of
the largest root that any arc has of the view sum.
"""

from collections.abc import Mapping, Sequence
from itertools import groupby
from typing import NamedTuple

import clarabel
import numpy as np
from scipy import sparse

from cocap_opt.data import FloatArray, IntArray
from cocap_opt.formulations.certificates import Decision
from cocap_opt.formulations.certificates.resources import Resource
from cocap_opt.formulations.certificates.state_cuts import AnyCut
from cocap_opt.formulations.column_generation.master.arc_users import users_of
from cocap_opt.formulations.column_generation.master.flow_paths import StartChoice, mixture_of_flow
from cocap_opt.formulations.relaxations.duals import Duals, repaired_roots
from cocap_opt.formulations.relaxations.separation import phi_of
from cocap_opt.formulations.solvers import solve_cones
from cocap_opt.graph.move_rewards import Bonuses
from cocap_opt.mixtures.columns import Arc, Column
from cocap_opt.mixtures.mixture import Mixture
from cocap_opt.model import Model, Path
from cocap_opt.stop import Stop

_SOLVED = ("Solved", "AlmostSolved")

_Blocks = Mapping[str, FloatArray]  # values or multipliers, by the names of their blocks


class _ConicProgram:
    """min cost x subject to A x + s = b with s in the cones of the blocks of rows.

    Parameters
    ----------
    variables : name and size of each block of variables
    """

    def __init__(self, variables: Mapping[str, int]) -> None:
        ends = np.cumsum([0, *variables.values()]).tolist()
        self._variables = {name: slice(*ends[k : k + 2]) for k, name in enumerate(variables)}
        self._n = ends[-1]
        self._rhs: dict[str, FloatArray] = {}
        self._rows: dict[str, slice] = {}
        self._cones: list[tuple[type, int]] = []
        self._entries: list[tuple[IntArray, IntArray, FloatArray]] = []

    def add_rows(self, name: str, rhs: FloatArray, cone: type = clarabel.NonnegativeConeT) -> None:
        """Adds a block of rows A x <= b with right-hand sides b [m]; A is initially 0.

        Parameters
        ----------
        cone : the cone that contains b - A x, by default for A x <= b: the zero cone gives
            equations, second-order cones mean r >= |(x, y)| for each three rows (r, x, y)
        """
        first = sum(size for _, size in self._cones)
        self._rows[name] = slice(first, first + len(rhs))
        self._rhs[name] = rhs
        self._cones.append((cone, len(rhs)))

    def put(
        self, block: str, variable: str, rows: IntArray, columns: IntArray, values: FloatArray
    ) -> None:
        """Sets entries; rows and columns are numbered within their blocks."""
        first_row, first_column = self._rows[block].start, self._variables[variable].start
        self._entries.append((rows + first_row, columns + first_column, values))

    def put_diagonal(self, block: str, variable: str, value: float) -> None:
        """Sets one value in each row of a block, for the variable with the same number."""
        each = np.arange(len(self._rhs[block]))
        self.put(block, variable, each, each, np.full(len(each), value))

    def solve(
        self, cost: _Blocks, stop: Stop, accuracy: float
    ) -> tuple[float, bool, _Blocks, _Blocks]:
        """Solves with Clarabel's interior-point method on one thread.

        Parameters
        ----------
        cost : costs of each block of variables; 0 for blocks that are not listed
        accuracy : relative accuracy of the value

        Returns
        -------
        The value, True if the solver reports success (possibly with reduced accuracy), the values
        of the variables, and the multipliers of the rows as the solver returns them
        """
        costs = np.zeros(self._n)
        for name, part in cost.items():
            costs[self._variables[name]] = part
        rows, columns, values = (np.concatenate(part) for part in zip(*self._entries, strict=True))
        rhs = np.concatenate([*self._rhs.values()])
        matrix = sparse.csc_matrix((values, (rows, columns)), shape=(len(rhs), self._n))
        # Multipliers of any accuracy can be certified: more digits only cost time.
        solution = solve_cones(
            costs, matrix, rhs, self._clarabel_cones(), stop,
            tol_gap_rel=accuracy, tol_gap_abs=accuracy, tol_feas=accuracy,
            direct_solve_method="faer",
            iterative_refinement_reltol=1e-8, iterative_refinement_abstol=1e-8,
        )  # fmt: skip
        x, z = np.nan_to_num(np.array(solution.x)), np.array(solution.z)
        return (
            float(solution.obj_val),
            str(solution.status) in _SOLVED,
            {name: x[part] for name, part in self._variables.items()},
            {name: z[part] for name, part in self._rows.items()},
        )

    def _clarabel_cones(self) -> list[object]:
        """Returns the cones, merging neighbouring blocks of the same kind."""
        cones: list[object] = []
        for cone, blocks in groupby(self._cones, key=lambda block: block[0]):
            size = sum(size for _, size in blocks)
            if cone is clarabel.SecondOrderConeT:
                cones += [cone(3) for _ in range(size // 3)]
            else:
                cones.append(cone(size))
        return cones


class Solution(NamedTuple):
    """An optimal mixture and its multipliers."""

    value: float  # value of the master
    mixture: Mixture  # mixture of the paths into which the flow splits
    slack: float  # robots in excess of conflict rows and decisions, at the penalty's price
    duals: Duals
    is_solved: bool  # True if the solver reports success, possibly with reduced accuracy


class MasterProgram:
    """A restricted master problem over a set of arcs.

    Parameters
    ----------
    rows : resources that at most one robot may use
    decisions : the decisions; those that close a resource have no row
    penalty : cost per unit of violation of a row or a decision
    """

    def __init__(
        self, model: Model, arcs: Sequence[Arc], rows: Sequence[Resource],
        decisions: Sequence[Decision], cuts: Sequence[AnyCut], penalty: float,
    ) -> None:  # fmt: skip
        self._model, self._arcs, self._rows = model, arcs, rows
        self._decisions = [decision for decision in decisions if not decision.closes]
        self._is_open = [not decision.closes for decision in decisions]
        self._cuts, self._penalty = cuts, penalty
        self._choices = StartChoice.of_arcs(model, arcs)
        self._read_views()
        self._bonus = self._move_rewards()
        self._weights = model.problem.view_sum_weights[self._view_sums] * self._scale
        # The solver's costs are in units of the largest cost.
        largest = max(float(self._weights.max(initial=0.0)), float(self._bonus.max()))
        self._unit = largest or 1.0
        numbers = np.array([cut.view_sum for cut in cuts], dtype=np.int64)
        # Position of each cut's view sum among those that arcs see, and True if it is among them.
        self._cut_at = np.searchsorted(self._view_sums, numbers)
        self._is_seen = np.isin(numbers, self._view_sums)

    def _read_views(self) -> None:
        """Reads the pixels that the arcs have of view sums, entry by entry.

        An arc sees what its head sees; at step 0 also what its tail sees.
        """
        of_classes = [self._entries_of_class(number) for number in range(len(self._model.classes))]
        arcs, states, view_sums, pixels = (
            np.concatenate(part) for part in zip(*of_classes, strict=True)
        )
        counted = self._model.problem.view_sum_weights[view_sums] > 0
        self._seeing, self._from = arcs[counted], states[counted]
        view_sums, pixels = view_sums[counted], pixels[counted]
        # View sums [z] that count and that any arc sees, and each entry's position among them.
        self._view_sums, self._at = np.unique(view_sums, return_inverse=True)
        best = np.zeros(len(self._view_sums))
        np.maximum.at(best, self._at, pixels)
        self._scale = np.sqrt(best)  # [z] largest root of each view sum, px^0.5/m
        self._roots = np.sqrt(pixels) / self._scale[self._at]
        self._returns = self._model.problem.returns.part(self._view_sums)

    def _entries_of_class(self, number: int) -> tuple[IntArray, IntArray, IntArray, FloatArray]:
        """Returns the arcs of a class with the states, view sums and pixels of their views, one per
        entry.
        """
        robot_class = self._model.classes[number]
        table, n_states = self._model.coverage(robot_class), robot_class.graph.n_states
        of_class = [(k, arc) for k, arc in enumerate(self._arcs) if arc.class_number == number]
        first = [(k, arc.tail) for k, arc in of_class if arc.t == 0]
        nodes = np.array(
            [
                *((arc.t + 1) * n_states + arc.head for _, arc in of_class),
                *(state for _, state in first),
            ],
            dtype=np.int64,
        )
        which, entries = table.entries(nodes)
        numbers = np.array([k for k, _ in (*of_class, *first)], dtype=np.int64)
        states = nodes[which] % n_states
        return numbers[which], states, table.view_sums[entries], table.pixels[entries]

    def _move_rewards(self) -> FloatArray:
        """Returns the rewards for the moves along arcs [n]."""
        bonuses = Bonuses.of(self._model.problem.objective)
        classes, _, tails, heads = np.array(self._arcs, dtype=np.int64).reshape(-1, 4).T
        rewards = np.zeros(len(self._arcs))
        for number in np.unique(classes).tolist():
            of_class, shape = classes == number, self._model.classes[number].graph.shape
            rewards[of_class] = bonuses.of_edges(shape, tails[of_class], heads[of_class])
        return rewards

    def solve(
        self, stop: Stop, accuracy: float, known: Mapping[tuple[int, Path], Column]
    ) -> tuple[Solution, FloatArray]:
        """Solves to a relative accuracy of the value, or as far as the stopping criterion allows.

        Parameters
        ----------
        known : existing columns by robot and path, which are reused

        Returns
        -------
        The solution, and the flow on each arc [n].
        """
        n_rows, n_roots = len(self._rows) + len(self._decisions), self._returns.n_roots
        sizes = {
            "flow": len(self._arcs), "slack": n_rows,
            "roots": len(self._weights), "pixels": n_roots, "choices": len(self._choices),
        }  # fmt: skip
        program = _ConicProgram(sizes)
        self._add_conservation(program)
        self._add_resources(program)
        for name in ("flow", "slack", *(["choices"] if self._choices else [])):
            program.add_rows(f"{name} >= 0", np.zeros(sizes[name]))
            program.put_diagonal(f"{name} >= 0", name, -1.0)
        self._add_roots(program)
        cost = {
            "flow": -self._bonus / self._unit,
            "slack": np.full(n_rows, self._penalty) / self._unit,
            "roots": -self._weights / self._unit,
        }
        value, is_solved, values, multipliers = program.solve(cost, stop, accuracy)
        flow = dict(zip(self._arcs, values["flow"].tolist(), strict=True))
        starting = dict(zip(self._choices, values["choices"].tolist(), strict=True))
        solution = Solution(
            value=-value * self._unit,
            mixture=mixture_of_flow(self._model, flow, known, starting),
            slack=float(np.maximum(values["slack"], 0.0).sum()),
            duals=self._duals(multipliers),
            is_solved=is_solved,
        )
        return solution, values["flow"]

    def _add_conservation(self, program: _ConicProgram) -> None:
        """Adds the rows of flow conservation: one unit leaves each start, and the flow into a state
        leaves it.
        """
        nodes: dict[tuple[int, int, int], int] = {}
        leaving = [nodes.setdefault((a.class_number, a.t, a.tail), len(nodes)) for a in self._arcs]
        inner = [k for k, arc in enumerate(self._arcs) if arc.t + 1 < self._model.problem.horizon]
        into = [
            (self._arcs[k].class_number, self._arcs[k].t + 1, self._arcs[k].head) for k in inner
        ]
        entering = np.array([nodes[node] for node in into], dtype=np.int64)
        units = np.zeros(len(nodes))
        for number, robot_class in enumerate(self._model.classes):
            for starts, robots in robot_class.start_sets:
                if len(starts) == 1:
                    units[nodes[number, 0, int(starts[0])]] += len(robots)
        name, each = "conservation", np.arange(len(self._arcs))
        program.add_rows(name, units, clarabel.ZeroConeT)
        program.put(name, "flow", np.array(leaving), each, np.ones(len(each)))
        arcs = np.array(inner, dtype=np.int64)
        program.put(name, "flow", entering, arcs, -np.ones(len(inner)))
        if self._choices:
            self._add_choices(program, nodes)

    def _add_choices(
        self, program: _ConicProgram, nodes: Mapping[tuple[int, int, int], int]
    ) -> None:
        """Adds the rows of robots that choose their start: one unit per robot leaves their set of
        starts.

        Parameters
        ----------
        nodes : row of each class, step and state in "conservation"
        """
        sizes = {
            (number, k): len(robots)
            for number, robot_class in enumerate(self._model.classes)
            for k, (starts, robots) in enumerate(robot_class.start_sets)
            if len(starts) > 1
        }
        row_of = {start_set: row for row, start_set in enumerate(sizes)}
        ends = [nodes[choice.class_number, 0, choice.state] for choice in self._choices]
        which = [row_of[choice[:2]] for choice in self._choices]
        each = np.arange(len(ends))
        program.put("conservation", "choices", np.array(ends), each, -np.ones(len(ends)))
        units = np.array([*sizes.values()], dtype=np.float64)
        program.add_rows("starts", units, clarabel.ZeroConeT)
        program.put("starts", "choices", np.array(which), each, np.ones(len(ends)))

    def _add_resources(self, program: _ConicProgram) -> None:
        """Adds rows sign * (flow on the arcs that use a resource) - slack <= limit."""
        decided = [decision.resource for decision in self._decisions]
        using = users_of(self._model, self._arcs, [*self._rows, *decided])
        signs = np.array([1.0] * len(self._rows) + [float(d.sign) for d in self._decisions])
        limits = np.array([float(d.sign * d.robots) for d in self._decisions])
        first = 0
        for name, limit in (("rows", np.ones(len(self._rows))), ("decisions", limits)):
            of_block, each = using[first : first + len(limit)], np.arange(len(limit))
            row = np.repeat(each, [len(arcs) for arcs in of_block])
            arcs = np.array([k for arcs_of in of_block for k in arcs_of], dtype=np.int64)
            program.add_rows(name, limit)
            program.put(name, "flow", row, arcs, signs[first + row])
            program.put(name, "slack", each, first + each, -np.ones(len(limit)))
            first += len(limit)

    def _add_roots(self, program: _ConicProgram) -> None:
        """Adds the rows that bound roots and counts; see the module's docstring."""
        n, of_root = self._returns.n_roots, self._at < self._returns.n_roots
        program.add_rows("single view", np.zeros(len(self._weights)))
        program.put("single view", "flow", self._at, self._seeing, -self._roots)
        program.put_diagonal("single view", "roots", 1.0)
        self._add_cuts(program)
        program.add_rows("caps", self._returns.caps / self._scale[n:])
        counts = np.arange(len(self._returns.caps))
        program.put("caps", "roots", counts, n + counts, np.ones(len(counts)))
        # z <= pixels; separate variables z keep the cones small.
        program.add_rows("pixels", np.zeros(n))
        pixels = -(self._roots[of_root] ** 2)
        program.put("pixels", "flow", self._at[of_root], self._seeing[of_root], pixels)
        program.put_diagonal("pixels", "pixels", 1.0)
        # For each view sum, the cone (1 + z, 2 u, z - 1): u^2 <= z.
        program.add_rows("cones", np.tile([1.0, 0.0, -1.0], n), clarabel.SecondOrderConeT)
        each = 3 * np.arange(n)
        program.put("cones", "pixels", each, each // 3, -np.ones(n))
        program.put("cones", "pixels", each + 2, each // 3, -np.ones(n))
        program.put("cones", "roots", each + 1, each // 3, np.full(n, -2.0))

    def _add_cuts(self, program: _ConicProgram) -> None:
        """Adds rows u <= constant + sum of phi(roots), or 0 <= 0 if no arc sees the view sum."""
        seen = np.flatnonzero(self._is_seen).tolist()
        constants = np.zeros(len(self._cuts))
        for k in seen:
            constants[k] = self._cuts[k].constant / self._scale[self._cut_at[k]]
        program.add_rows("cuts", constants)
        order = np.argsort(self._at, kind="stable")
        bounds = np.searchsorted(self._at[order], np.arange(len(self._weights) + 1))
        classes = np.array([arc.class_number for arc in self._arcs])
        for k in seen:
            z = int(self._cut_at[k])
            entries = order[bounds[z] : bounds[z + 1]]
            arcs, roots = self._seeing[entries], self._roots[entries] * self._scale[z]
            values = phi_of(self._cuts[k], classes[arcs], self._from[entries], roots)
            values /= self._scale[z]
            program.put("cuts", "flow", np.full(len(entries), k), arcs, -values)
            program.put("cuts", "roots", np.array([k]), np.array([z]), np.ones(1))

    def _duals(self, multipliers: _Blocks) -> Duals:
        """Returns the multipliers of the rows, repaired if they are out of range.

        Decisions that close a resource need no multipliers.
        """
        seen, shares = self._is_seen, np.zeros(len(self._cuts))
        alpha, beta, shares[seen] = repaired_roots(
            self._model.problem,
            view_sums=self._view_sums,
            scale=self._scale,
            weights=self._weights / self._unit,
            single_view=multipliers["single view"],
            pixels=multipliers["pixels"],
            cut_at=self._cut_at[seen],
            cuts=multipliers["cuts"][seen],
        )
        rows, open_ = (
            np.nan_to_num(np.maximum(multipliers[name], 0.0)) * self._unit
            for name in ("rows", "decisions")
        )
        decisions = np.zeros(len(self._is_open))
        decisions[self._is_open] = open_
        return Duals(
            alpha=alpha,
            beta=beta,
            rows=tuple(zip(self._rows, rows.tolist(), strict=True)),
            cuts=tuple(zip(self._cuts, shares.tolist(), strict=True)),
            decisions=decisions,
        )
