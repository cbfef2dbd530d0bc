"""The master problem of step envelopes: the payments that known joint states and arcs allow.

Over payments phi(t, s), constants K_t and potentials u(t, s) it minimises

    sum_t K_t + sum of u at the starts + rho / 2 |phi - centre|^2

such that K_t is at least the height of every known joint state of the step, and the potentials
rise along the known arcs by payments less charges. At steps with a ceiling, payments are at least
those of the centre at first, and states that have none of their own are paid more by as much as
K_t is below the ceiling (`certificates.narrowing`). Fewer joint states and arcs than there are make
it too low, so that they are found by and by; the last term keeps payments near the best so far
(a proximal bundle method; Kiwiel 1990).
"""

from collections.abc import Mapping
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


class StepMaster(NamedTuple):
    """A solution: payments, constants, and the value, which is at most the best bound."""

    payments: FloatArray
    constants: Mapping[int, float]
    value: float

    @classmethod
    def solve(
        cls,
        centre: FloatArray,
        rho: float,
        paid: Mapping[Place, int],
        unpaid: Mapping[Place, float],
        starts: Mapping[Place, int],
        arcs: list[KnownArc],
        heights: list[KnownHeight],
        ceilings: Mapping[int, float],
        least: Mapping[int, float],
        stop: Stop,
    ) -> "StepMaster":
        """Returns the solution of one master problem.

        Parameters
        ----------
        centre : [n] the best payments so far
        rho : > 0, weight of the distance to them
        paid : position of every state with a payment
        unpaid : reward of the states without one
        starts : number of robots that start in each state
        ceilings : of steps at which unpaid states are paid more
        least : least payments at these steps, by position
        stop : for the solver, which ends early at a limit
        """
        steps = sorted({height.t for height in heights})
        column = {t: k for k, t in enumerate(steps)}
        first = len(steps)
        nodes: dict[Place, int] = {}
        for arc in arcs:
            nodes.setdefault(arc.tail, len(nodes))
            nodes.setdefault(arc.head, len(nodes))
        last = max(place[1] for place in nodes)
        rows = _Rows(first, first + len(centre))

        def payment_of(place: Place) -> tuple[int | None, float, float]:
            if place in paid:
                return first + paid[place], 1.0, 0.0
            if place[1] in ceilings:
                return column[place[1]], -1.0, unpaid[place] + ceilings[place[1]]
            return None, 0.0, unpaid[place]

        for arc in arcs:
            rows.add(nodes[arc.tail], nodes[arc.head], payment_of(arc.tail), arc.gain)
        for place, node in nodes.items():
            if place[1] == last:
                rows.add(node, None, payment_of(place), 0.0)
        for height in heights:
            rows.add_height(column[height.t], height.at, height.worth)
        for payment, amount in least.items():
            rows.add_bound(first + payment, -1.0, -amount)
        for t, ceiling in ceilings.items():
            rows.add_bound(column[t], 1.0, ceiling)
        size = first + len(centre) + len(nodes)
        cost = np.zeros(size)
        cost[:first] = 1.0
        for place, robots in starts.items():
            cost[first + len(centre) + nodes[place]] += robots
        value_of = cost.copy()
        cost[first : first + len(centre)] = -rho * centre
        weights = np.zeros(size)
        weights[first : first + len(centre)] = rho
        matrix, rhs = rows.matrix(size)
        solution = solve_cones(
            cost, matrix, rhs, [clarabel.NonnegativeConeT(len(rhs))], stop,
            quadratic=sparse.diags(weights).tocsc(), direct_solve_method="faer",
            tol_gap_rel=_ACCURACY, tol_feas=_ACCURACY,
        )  # fmt: skip
        found = np.nan_to_num(np.array(solution.x))
        return cls(
            found[first : first + len(centre)],
            {t: float(found[k]) for t, k in column.items()},
            float(value_of @ found),
        )


class _Rows:
    """Inequalities `matrix x <= rhs`, put together entry by entry."""

    def __init__(self, first_payment: int, first_potential: int) -> None:
        self._payments, self._potentials = first_payment, first_potential
        self._entries: list[tuple[int, int, float]] = []
        self._rhs: list[float] = []

    def add(
        self, tail: int, head: int | None, payment: tuple[int | None, float, float], gain: float
    ) -> None:
        """Adds: the tail's potential is at least its payment, a gain, and the head's potential.

        Parameters
        ----------
        payment : a column, if it has one, that counts so many times, and a constant
        """
        at, times, constant = payment
        row = len(self._rhs)
        self._entries.append((row, self._potentials + tail, -1.0))
        if head is not None:
            self._entries.append((row, self._potentials + head, 1.0))
        if at is not None:
            self._entries.append((row, at, times))
        self._rhs.append(-gain - constant)

    def add_height(self, step: int, payments: tuple[int, ...], worth: float) -> None:
        """Adds: the step's constant is at least the worth less the payments."""
        row = len(self._rhs)
        self._entries.append((row, step, -1.0))
        self._entries += [(row, self._payments + payment, -1.0) for payment in payments]
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
