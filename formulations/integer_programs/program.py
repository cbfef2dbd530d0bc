"""Integer programs with roots bounded from above, and the interface to solvers.

The root u of a view sum is concave in its pixels z, so every tangent lies above it:

    u <= z / (2 sqrt(z0)) + sqrt(z0) / 2     for any z0 > 0 (tangent)
    u <= sum of roots of pixels              (single-view cut)
    u <= constant + sum of phi(roots)        (envelope cuts of the root's certificate)

The number u of drones that see a person, as far as it counts, needs only two rows, which are exact
for whole drones: u <= sum of counts, and u <= k.
"""

import math
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, wait
from typing import Any, NamedTuple, TypeVar

import numpy as np
from scipy import sparse

from cocap_opt.data import BoolArray, FloatArray, IntArray
from cocap_opt.formulations.certificates import Multipliers
from cocap_opt.formulations.certificates.envelope import Cut
from cocap_opt.formulations.relaxations.collision_rows import ConflictRows
from cocap_opt.formulations.relaxations.flow import Amounts, Flow, Roots
from cocap_opt.result import Reason
from cocap_opt.stop import Limit, Stop

TANGENTS = 5  # initial tangents per view sum, each at a quarter of the pixels of the one before
SLACK = 1e-9  # relative; allowed overestimate of a root at a plan
POLL = 0.05  # s between two checks whether a limit is reached

T = TypeVar("T")


class Answer(NamedTuple):
    """The answer of a solver to a program."""

    solution: Amounts | None
    bound: float  # bound on J; -inf if there is no solution
    # the limit that the solver reports, if it stopped before its tolerance
    limit: Limit | None = None
    nodes: int = 0
    message: str = ""

    @classmethod
    def failed(cls, message: str) -> "Answer":
        """Returns the answer of a solver that failed."""
        return cls(None, math.inf, Limit.NUMERICS, message=message)

    @classmethod
    def ended(
        cls,
        end: Reason | Limit,
        solution: Amounts | None,
        bound: float,
        nodes: int,
        message: str = "",
        late: bool = False,
    ) -> "Answer":
        """Returns the answer of a solver that ended for the given reason (see `solvers.ending`).

        Parameters
        ----------
        late : True if a limit had been reached. Then no claimed proof is trusted: if its time
            ends in the root node, HiGHS drops that node and calls its start optimal, or finds no
            plan
        """
        if isinstance(end, Limit):
            return cls(solution, bound, Limit.TIME if late else end, nodes, message)
        if late:
            return cls(solution, math.inf, Limit.TIME, nodes)
        return cls(solution, -math.inf if end is Reason.INFEASIBLE else bound, None, nodes)


class Call(NamedTuple):
    """The parameters of a solve, besides the program."""

    hint: Amounts | None  # the variables' values for a plan
    tolerance: float  # relative gap
    stop: Stop
    tick: Callable[[], None]  # must be called regularly
    found: Callable[[Amounts], None]  # must be called with each new solution

    def attend(self, work: Callable[[], T], interrupt: Callable[[], None]) -> T:
        """Runs work in another thread, while this thread checks limits and handles Ctrl-C.

        Parameters
        ----------
        interrupt : called repeatedly after a limit is reached, until the work ends

        Returns
        -------
        The outcome of the work, even if it was interrupted.
        """
        with ThreadPoolExecutor(1) as pool:
            future = pool.submit(work)
            try:
                while not wait([future], POLL).done:
                    self.tick()
                    if self.stop.reached():
                        interrupt()
            finally:
                while not wait([future], POLL).done:  # an exception is being raised
                    interrupt()
        return future.result()


Solver = Callable[["Program", Call], Answer]  # solves programs of one problem, one after another


class Program:
    """An integer flow with roots bounded from above by linear functions of the pixels.

    Parameters
    ----------
    root : multipliers of the root's certificate, which give the initial cuts and slopes
    tangents : positions [k] and z0 [k] as in `tangents`; None: a few initial tangents per root

    Attributes
    ----------
    unit : the objective of a linear program is J / unit
    cuts : envelope cuts
    """

    def __init__(
        self,
        flow: Flow,
        roots: Roots,
        conflicts: ConflictRows,
        root: Multipliers | None = None,
        tangents: tuple[IntArray, FloatArray] | None = None,
    ) -> None:
        self.flow, self.roots, self.conflicts = flow, roots, conflicts
        self.unit = max(float(roots.weights.max(initial=0.0)), flow.largest_bonus) or 1.0
        self.n_robots = len(flow.model.problem.robots)
        self.n_views = flow.model.problem.most_views_of_a_face
        # Without rules between steps, it is enough that the numbers of robots in nodes are
        # integral: the moves from one step to the next are then a transport problem.
        self.integral_edges = conflicts.crossing.shape[0] > 0
        self.cuts: list[Cut] = []
        self._tangents: list[tuple[int, float]] = []
        if tangents is not None:
            self._add(*tangents)
        else:
            view_sums = np.arange(roots.returns.n_roots)
            for k in range(TANGENTS):
                self._add(view_sums, np.full(len(view_sums), self.n_views / 4.0**k))
        if root is not None:
            self._take(root)

    @property
    def tangents(self) -> tuple[IntArray, FloatArray]:
        """The tangents of the roots: positions of their view sums among `roots.used`, and z0 [k].

        The z0 are in units of the view sums' best views.
        """
        at, z0 = zip(*self._tangents, strict=True) if self._tangents else ((), ())
        return np.array(at, dtype=np.int64), np.array(z0, dtype=np.float64)

    @property
    def n_integral(self) -> int:
        """Number of variables that must be integral."""
        return self.flow.n_nodes + self.integral_edges * self.flow.n_edges

    def roots_at(self, x: FloatArray) -> FloatArray:
        """Returns the largest roots and counts [z] that the program allows, given robots in nodes
        [N].
        """
        pixels, seen = self.roots.pixels @ x, self.roots.seen @ x
        allowed: FloatArray = seen.copy()
        at, z0 = self.tangents
        np.minimum.at(allowed, at, pixels[at] / (2 * np.sqrt(z0)) + np.sqrt(z0) / 2)
        phi, constants, at = self.roots.cut_rows(self.cuts)
        np.minimum.at(allowed, at, constants + phi @ x)
        counts, caps = allowed[self.roots.returns.n_roots :], self.roots.returns.caps
        np.minimum(counts, caps, out=counts)
        return allowed

    def point(self, plan: Amounts) -> FloatArray:
        """Returns the values of all variables of a linear program (see `LinearProgram`)."""
        x, y = plan
        pixels, seen = self.roots.pixels @ x, self.roots.seen @ x
        return np.concatenate([x, y, pixels, seen, self.roots_at(x)])

    def refine(self, x: FloatArray) -> int:
        """Adds tangents where roots are overestimated at an integral x, and returns their
        number.
        """
        n = self.roots.returns.n_roots
        pixels, allowed = (self.roots.pixels @ x)[:n], self.roots_at(x)[:n]
        wrong = np.flatnonzero(
            (pixels > 0) & (allowed > np.sqrt(np.maximum(pixels, 0.0)) * (1 + SLACK))
        )
        self._add(wrong, pixels[wrong])
        return len(wrong)

    def _add(self, view_sums: IntArray, z0: FloatArray) -> None:
        self._tangents += zip(view_sums.tolist(), z0.tolist(), strict=True)

    def _take(self, root: Multipliers) -> None:
        """Adopts the cuts of the root's certificate, and tangents at its slopes."""
        model = self.flow.model
        used = self.roots.used[: self.roots.returns.n_roots]
        alpha, beta = (
            np.array(part, dtype=np.float64).reshape(-1)[used] for part in (root.alpha, root.beta)
        )
        rest = np.ones(len(alpha))
        for cut, share in root.usable_cuts(model):
            at = int(np.searchsorted(used, cut.view_sum))
            if at < len(used) and used[at] == cut.view_sum:
                self.cuts.append(cut)
                rest[at] -= share
        curved = np.flatnonzero((rest - alpha > 1e-6) & (beta > 0))
        slope = beta[curved] * self.roots.scale[curved] / (rest - alpha)[curved]
        self._add(curved, np.clip(1 / (4 * slope**2), 1e-6, self.n_views))


# -- as matrices, for solvers over real numbers ----------------------------------------------


class LinearProgram(NamedTuple):
    """A program as matrices: max gain v with row_low <= rows v <= row_high and low <= v <= high.

    Variables are x [N] robots in each node, y [E] robots along each edge, and for each view sum
    that counts its pixels z, its sum of roots s and its root u, in this order: rows on pixels then
    have two entries each instead of one per node that sees the face. For counted people, the cap is
    the upper bound of u.
    """

    gain: FloatArray  # [n]
    low: FloatArray  # [n]
    high: FloatArray  # [n]
    integral: BoolArray  # [n]
    rows: sparse.csr_array  # [m, n]
    row_low: FloatArray  # [m]
    row_high: FloatArray  # [m]
    first_pixels: int  # number of the first of the z

    @classmethod
    def of(cls, program: Program) -> "LinearProgram":
        """Returns the matrices of a program; their objective is J / program.unit."""
        flow, roots = program.flow, program.roots
        n, e, n_sums = flow.n_nodes, flow.n_edges, len(roots.used)
        first = ~flow.is_entered
        rows, row_low, row_high = _rows(program)
        gain = [np.zeros(n), flow.bonus, np.zeros(2 * n_sums), roots.weights]
        high = [np.where(first, flow.supply, flow.capacity), flow.capacity[flow.tails]]
        high += [np.full(2 * n_sums + roots.returns.n_roots, math.inf), roots.returns.caps]
        return cls(
            gain=np.concatenate(gain) / program.unit,
            low=np.concatenate([np.where(first, flow.supply, 0.0), np.zeros(e + 3 * n_sums)]),
            high=np.concatenate(high),
            integral=np.repeat([True, program.integral_edges, False], [n, e, 3 * n_sums]),
            rows=rows,
            row_low=row_low,
            row_high=row_high,
            first_pixels=n + e,
        )


def _rows(program: Program) -> tuple[sparse.csr_array, FloatArray, FloatArray]:
    """Returns the rows low <= matrix v <= high over v = (x, y, z, s, u), equations first.

    Returns
    -------
    matrix [m, n], low [m], high [m]
    """
    flow, roots, conflicts = program.flow, program.roots, program.conflicts
    n_sums = len(roots.used)
    later = np.flatnonzero(flow.is_entered)
    before = np.flatnonzero(flow.steps < flow.model.problem.horizon)
    inside, each = (
        sparse.eye_array(flow.n_nodes, format="csr"),
        sparse.eye_array(n_sums, format="csr"),
    )
    at, z0 = program.tangents
    slopes = _at(at, 1 / (2 * np.sqrt(z0)), n_sums)
    phi, constants, cut_at = roots.cut_rows(program.cuts)
    widths = [flow.n_nodes, flow.n_edges, n_sums, n_sums, n_sums]
    blocks: list[list[Any]] = [
        [inside[later], -flow.entering[later], None, None, None],
        [inside[before], -flow.leaving[before], None, None, None],
        [-roots.pixels, None, each, None, None],
        [-roots.seen, None, None, each, None],
        [None, None, None, -each, each],
        [None, None, -slopes, None, _at(at, np.ones(len(at)), n_sums)],
        [-phi, None, None, None, _at(cut_at, np.ones(len(cut_at)), n_sums)],
        [conflicts.at_nodes, None, None, None, None],
        [None, conflicts.crossing, None, None, None],
        [sparse.csr_array((0, width)) for width in widths],  # determines the widths of the columns
    ]
    n_equal = len(later) + len(before)
    n_conflicts = conflicts.cliques.shape[0] + conflicts.crossing.shape[0]
    high = np.concatenate(
        [np.zeros(n_equal + 3 * n_sums), np.sqrt(z0) / 2, constants, np.ones(n_conflicts)]
    )
    high[: len(later)] = flow.supply[later]
    low = np.full(len(high), -math.inf)
    low[:n_equal] = high[:n_equal]
    return sparse.csr_array(sparse.block_array(blocks)), low, high


def _at(columns: IntArray, values: FloatArray, width: int) -> sparse.csr_array:
    """Returns a matrix with one entry per row, in the given columns."""
    index = (np.arange(len(columns)), columns)
    return sparse.csr_array((values, index), shape=(len(columns), width))
