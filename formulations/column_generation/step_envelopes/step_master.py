"""The master problem of step envelopes: the payments that known joint states and arcs allow.

Over payments phi(t, s), constants K_t and potentials u(t, s) it minimises

    sum_t K_t + sum of u at the starts + rho / 2 |phi - centre|^2

such that K_t is at least the height of every known joint state of the step, and the potentials
rise along the known arcs by payments less charges. At steps with a ceiling, payments are at least
those of the centre at first, and states that have none of their own are paid more by as much as
K_t is below the ceiling (`staged.narrowing`). Fewer joint states and arcs than there are make
it too low, so that they are found by and by; the last term keeps payments near the best so far
(a proximal bundle method; Kiwiel 1990).
"""

from collections.abc import Iterable, Mapping
from typing import NamedTuple

import clarabel
import numpy as np
from scipy import sparse

from cocap_opt.data import FloatArray, IntArray
from cocap_opt.formulations.relaxations.cone_solver import solve_cones
from cocap_opt.stop import Stop

_ACCURACY = 1e-9  # relative, of the solver

Place = tuple[int, int, int]  # class number, step, state number


class KnownArc(NamedTuple):
    """A move of one robot, with what it gains beside payments: its reward less its charges."""

    tail: Place
    head: Place
    gain: float


class KnownHeight(NamedTuple):
    """A joint state of a step, and what it is worth."""

    t: int
    at: tuple[int, ...]  # positions of its states among all that are paid
    worth: float


class KnownPart(NamedTuple):
    """The arcs and the joint states that are known, and what robots get on the arcs else."""

    arcs: list[KnownArc]
    heights: list[KnownHeight]
    unpaid: Mapping[Place, float]  # rewards of the states on arcs that have no payment


class Centre(NamedTuple):
    """The best payments so far [n], and the weight > 0 of the distance to them."""

    payments: FloatArray
    weight: float


class StepSolution(NamedTuple):
    """Payments [n], constants, and the value, which is at most the best bound."""

    payments: FloatArray
    constants: Mapping[int, float]
    value: float
    flow: FloatArray  # [arcs] number of robots on each known arc in the best mixture of them


class StepMaster(NamedTuple):
    """The part that all master problems of a bundle share.

    Attributes
    ----------
    paid : position of every state with a payment
    starts : number of robots that start in each state
    ceilings : of steps at which unpaid states are paid more
    least : least payments at these steps, by position
    """

    paid: Mapping[Place, int]
    starts: Mapping[Place, int]
    ceilings: Mapping[int, float]
    least: Mapping[int, float]

    def solve(self, centre: Centre, known: KnownPart, stop: Stop) -> StepSolution:
        """Returns the solution of one master problem.

        Payments of states that are in no known joint state and on no known arc stay at the centre.

        Parameters
        ----------
        stop : for the solver, which ends early at a limit
        """
        columns = _Columns.of(known, self.paid)
        size = columns.size
        matrix, rhs = self._rows(known, columns).matrix(size)
        cost = np.zeros(size)
        cost[: columns.first] = 1.0
        for place, robots in self.starts.items():
            cost[columns.nodes[place]] += robots
        value_of = cost.copy()
        near, at = slice(columns.first, columns.first + len(columns.used)), list(columns.used)
        cost[near] = -centre.weight * centre.payments[at]
        weights = np.zeros(size)
        weights[near] = centre.weight
        solution = solve_cones(
            cost, matrix, rhs, [clarabel.NonnegativeConeT(len(rhs))], stop,
            quadratic=sparse.diags(weights).tocsc(), direct_solve_method="faer",
            tol_gap_rel=_ACCURACY, tol_feas=_ACCURACY,
        )  # fmt: skip
        found = np.nan_to_num(np.array(solution.x))
        payments = centre.payments.copy()
        payments[at] = found[near]
        constants = {t: float(found[k]) for t, k in columns.steps.items()}
        flow = np.nan_to_num(np.array(solution.z))[: len(known.arcs)]
        return StepSolution(payments, constants, float(value_of @ found), flow)

    def _rows(self, known: KnownPart, columns: "_Columns") -> "_Rows":
        """Returns the inequalities of one master problem."""
        rows, nodes = _Rows(), columns.nodes
        last = max(place[1] for place in nodes)
        for arc in known.arcs:
            payment = self._payment_of(arc.tail, known, columns)
            rows.add(nodes[arc.tail], nodes[arc.head], payment, arc.gain)
        for place, node in nodes.items():
            if place[1] == last:
                rows.add(node, None, self._payment_of(place, known, columns), 0.0)
        for height in known.heights:
            at = [columns.used[payment] for payment in height.at]
            rows.add_height(columns.steps[height.t], at, height.worth)
        for position, column in columns.used.items():
            if position in self.least:
                rows.add_bound(column, -1.0, -self.least[position])
        for t, ceiling in self.ceilings.items():
            rows.add_bound(columns.steps[t], 1.0, ceiling)
        return rows

    def _payment_of(self, place: Place, known: KnownPart, columns: "_Columns") -> "_Payment":
        if place in self.paid:
            return _Payment(columns.used[self.paid[place]], 1.0, 0.0)
        if place[1] in self.ceilings:
            more = known.unpaid[place] + self.ceilings[place[1]]
            return _Payment(columns.steps[place[1]], -1.0, more)
        return _Payment(None, 0.0, known.unpaid[place])


class _Payment(NamedTuple):
    """The payment for a state: a column, if it has one, so many times, and a constant."""

    column: int | None
    times: float
    constant: float


class _Columns(NamedTuple):
    """The columns of the constants, by step, of the payments in use, and of the potentials."""

    steps: Mapping[int, int]
    used: Mapping[int, int]
    nodes: Mapping[Place, int]

    @classmethod
    def of(cls, known: KnownPart, paid: Mapping[Place, int]) -> "_Columns":
        """Returns the columns of a master problem."""
        steps = sorted({height.t for height in known.heights})
        places = dict.fromkeys(place for arc in known.arcs for place in (arc.tail, arc.head))
        used = {paid[place] for place in places if place in paid}
        used.update(payment for height in known.heights for payment in height.at)
        first, potentials = len(steps), len(steps) + len(used)
        return cls(
            {t: k for k, t in enumerate(steps)},
            {payment: first + k for k, payment in enumerate(sorted(used))},
            {place: potentials + k for k, place in enumerate(places)},
        )

    @property
    def first(self) -> int:
        """The first column of a payment."""
        return len(self.steps)

    @property
    def size(self) -> int:
        """The number of columns."""
        return len(self.steps) + len(self.used) + len(self.nodes)


class _Rows:
    """Inequalities `matrix x <= rhs`, put together entry by entry."""

    def __init__(self) -> None:
        self._entries: list[tuple[int, int, float]] = []
        self._rhs: list[float] = []

    def add(self, tail: int, head: int | None, payment: _Payment, gain: float) -> None:
        """Adds: the tail's potential is at least its payment, a gain, and the head's potential."""
        row = len(self._rhs)
        self._entries.append((row, tail, -1.0))
        if head is not None:
            self._entries.append((row, head, 1.0))
        if payment.column is not None:
            self._entries.append((row, payment.column, payment.times))
        self._rhs.append(-gain - payment.constant)

    def add_height(self, step: int, payments: Iterable[int], worth: float) -> None:
        """Adds: the step's constant is at least the worth less the payments."""
        row = len(self._rhs)
        self._entries.append((row, step, -1.0))
        self._entries += [(row, payment, -1.0) for payment in payments]
        self._rhs.append(-worth)

    def add_bound(self, column: int, sign: float, bound: float) -> None:
        """Adds: a column times a sign is at most a bound."""
        self._entries.append((len(self._rhs), column, sign))
        self._rhs.append(bound)

    def matrix(self, columns: int) -> tuple[sparse.csc_matrix, FloatArray]:
        """Returns matrix and right side; entries of one place add up."""
        rows, at, values = np.array(self._entries).T
        index: tuple[IntArray, IntArray] = (rows.astype(np.int64), at.astype(np.int64))
        rhs = np.array(self._rhs)
        return sparse.csc_matrix((values, index), shape=(len(rhs), columns)), rhs
