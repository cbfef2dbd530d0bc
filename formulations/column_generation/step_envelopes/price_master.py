"""The master problem of the bundle method over prices (`price_bundle`), as a quadratic program.

Over prices phi(t, s), constants K_t and potentials u(t, s), it minimises

    sum_t K_t + sum of u at the starts + rho / 2 |phi - centre|^2

such that K_t is at least the height of every known joint state of the step, and the potentials rise
along the known arcs by prices less charges. At steps with a ceiling, prices are at least the
initial ones, and states without a price of their own are priced higher by the difference
between the ceiling and K_t (`priced_states`).
"""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

import clarabel
import numpy as np
from scipy import sparse

from cocap_opt.data import BoolArray, FloatArray, IntArray
from cocap_opt.formulations.column_generation.step_envelopes.priced_states import PricedStates
from cocap_opt.formulations.solvers import solve_cones
from cocap_opt.model import Path

_ACCURACY = 1e-9  # relative accuracy of the solver

_Place = tuple[int, int, int]  # class number, step, state number
_StartSet = tuple[int, int]  # class and number of a set of starts from which robots choose
# of known moves: rewards less charges, without prices
Gains = Mapping[tuple[_Place, _Place], float]
_Entry = tuple[int, float]  # column and coefficient; entries of the same column add up
_MasterRow = tuple[Sequence[_Entry], float]  # entries, and the upper limit of their sum


class KnownJoint(NamedTuple):
    """A known joint state, or a known move with the joint states of both of its steps."""

    t: int  # the step, or the first of both
    positions: tuple[int, ...]  # of its states, among all prices
    worth: float


class _Columns(NamedTuple):
    """The columns of a master problem: constants first, then the prices in use, then potentials.

    The potentials of sets of starts come last.
    """

    constant_of: Mapping[int, int]  # column by step
    price_of: Mapping[int, int]  # column by position among all prices, increasing
    node_of: Mapping[_Place, int]  # column of the potential, by place
    set_of: Mapping[_StartSet, int]  # column of the potential, by set of starts

    @property
    def prices(self) -> slice:
        """The columns that contain prices."""
        first = len(self.constant_of)
        return slice(first, first + len(self.price_of))

    @property
    def size(self) -> int:
        """The number of columns."""
        potentials = len(self.node_of) + len(self.set_of)
        return len(self.constant_of) + len(self.price_of) + potentials


class PriceSolution(NamedTuple):
    """A solution of the master problem."""

    prices: FloatArray  # [n]
    constants: Mapping[int, float]  # constant by step
    value: float  # at most the best bound
    flow: FloatArray  # [m] number of robots on each known arc in the best mixture


class PriceMaster:
    """The master problem, whose rows are known joint states and arcs."""

    def __init__(self, priced: PricedStates) -> None:
        self._priced, self._ceilings = priced, priced.ceilings
        self._position: Mapping[_Place, int] = priced.positions
        self._has_ceiling: BoolArray = np.zeros(len(priced.initial), dtype=np.bool_)  # [n]
        for t in priced.ceilings:
            self._has_ceiling[priced.spans[t]] = True
        self._starts = Counter[_Place]()  # number of robots at each fixed start
        self._start_sets: dict[_StartSet, tuple[set[int], int]] = {}
        for number, robot_class in enumerate(priced.narrowing.model.classes):
            for k, (starts, robots) in enumerate(robot_class.start_sets):
                if len(starts) == 1:
                    self._starts[number, 0, int(starts[0])] += len(robots)
                else:
                    self._start_sets[number, k] = set(starts.tolist()), len(robots)

    def solved(
        self, arcs: Gains, known: Sequence[KnownJoint], centre: FloatArray, weight: float
    ) -> PriceSolution:
        """Returns the solution of a master problem.

        Prices of states that are in no known joint state and on no known arc do not change. At a
        limit, the solve ends early.

        Parameters
        ----------
        arcs : the known arcs
        known : known joint states, in the order of their steps
        centre : [n] prices near which the solution is sought
        weight : rho, the weight of the distance from them
        """
        columns = self._columns(arcs, known)
        matrix, rhs = _assembled([
            *self._arc_rows(arcs, columns),  # first, so that their multipliers are the flow
            *self._end_rows(columns),
            *self._start_rows(columns),
            *self._height_rows(known, columns),
            *self._ceiling_rows(columns),
        ], columns.size)  # fmt: skip
        bound = self._bound_of(columns)
        used, near = list(columns.price_of), columns.prices
        cost, weights = bound.copy(), np.zeros(columns.size)
        cost[near], weights[near] = -weight * centre[used], weight
        # Clarabel's "faer" uses supernodes above some size, and then takes up to three times as
        # long.
        solution = solve_cones(
            cost, matrix, rhs, [clarabel.NonnegativeConeT(len(rhs))], self._priced.stop,
            quadratic=sparse.diags(weights).tocsc(), direct_solve_method="qdldl",
            tol_gap_rel=_ACCURACY, tol_feas=_ACCURACY,
        )  # fmt: skip
        found = np.nan_to_num(np.array(solution.x))
        prices = centre.copy()
        prices[used] = found[near]
        floored = self._has_ceiling  # the solver may violate these bounds slightly
        prices[floored] = np.maximum(prices[floored], self._priced.initial[floored])
        constants = {t: float(found[k]) for t, k in columns.constant_of.items()}
        flow = np.nan_to_num(np.array(solution.z))[: len(arcs)]
        return PriceSolution(prices, constants, float(bound @ found), flow)

    def _columns(self, arcs: Gains, known: Sequence[KnownJoint]) -> _Columns:
        """Returns the columns that the known arcs and joint states need."""
        places = dict.fromkeys(place for ends in arcs for place in ends)
        used = {self._position[place] for place in places if place in self._position}
        used |= {position for joint in known for position in joint.positions}
        steps = sorted({joint.t for joint in known})
        first, end = len(steps), len(steps) + len(used)
        return _Columns(
            {t: k for k, t in enumerate(steps)},
            {position: first + k for k, position in enumerate(sorted(used))},
            {place: end + k for k, place in enumerate(places)},
            {key: end + len(places) + k for k, key in enumerate(self._start_sets)},
        )

    def _bound_of(self, columns: _Columns) -> FloatArray:
        """Returns the coefficients of the bound: of constants, and of potentials at the starts."""
        bound = np.zeros(columns.size)
        bound[: len(columns.constant_of)] = 1.0
        for place, robots in self._starts.items():
            bound[columns.node_of[place]] += robots
        for start_set, (_, robots) in self._start_sets.items():
            bound[columns.set_of[start_set]] += robots
        return bound

    def _price_at(self, place: _Place, columns: _Columns) -> tuple[list[_Entry], float]:
        """Returns the price of a place: its entry, if it has a column, and the constant part."""
        if place in self._position:
            return [(columns.price_of[self._position[place]], 1.0)], 0.0
        number, t, state = place
        unpriced = float(self._priced.unpriced[number][t, state])
        if t in self._ceilings:
            return [(columns.constant_of[t], -1.0)], unpriced + self._ceilings[t]
        return [], unpriced

    def _arc_rows(self, arcs: Gains, columns: _Columns) -> Iterator[_MasterRow]:
        """Yields a row per arc: the tail's potential is at least price, gain and head's potential
        together.
        """
        for (tail, head), gain in arcs.items():
            price, constant = self._price_at(tail, columns)
            ends = [(columns.node_of[tail], -1.0), (columns.node_of[head], 1.0)]
            yield [*ends, *price], -gain - constant

    def _end_rows(self, columns: _Columns) -> Iterator[_MasterRow]:
        """Yields a row for each place of the last step: its potential is at least its price."""
        last = max(t for _, t, _ in columns.node_of)
        for place, node in columns.node_of.items():
            if place[1] == last:
                price, constant = self._price_at(place, columns)
                yield [(node, -1.0), *price], -constant

    def _start_rows(self, columns: _Columns) -> Iterator[_MasterRow]:
        """Yields the rows of sets of starts: their potential is at least that of each start."""
        first = {place: node for place, node in columns.node_of.items() if place[1] == 0}
        for (number, k), column in columns.set_of.items():
            for (of_class, _, state), node in first.items():
                if of_class == number and state in self._start_sets[number, k][0]:
                    yield [(column, -1.0), (node, 1.0)], 0.0

    def _height_rows(self, known: Sequence[KnownJoint], columns: _Columns) -> Iterator[_MasterRow]:
        """Yields a row per joint state: its step's constant is at least its worth less its
        prices.
        """
        for t, positions, worth in known:
            prices = [(columns.price_of[position], -1.0) for position in positions]
            yield [(columns.constant_of[t], -1.0), *prices], -worth

    def _ceiling_rows(self, columns: _Columns) -> Iterator[_MasterRow]:
        """Yields the rows of steps with a ceiling, which limits the constant.

        Prices at these steps are at least the initial ones.
        """
        for position, column in columns.price_of.items():
            if self._has_ceiling[position]:
                yield [(column, -1.0)], -float(self._priced.initial[position])
        for t, ceiling in self._ceilings.items():
            yield [(columns.constant_of[t], 1.0)], ceiling


def gains_of(priced: PricedStates, paths: Iterable[tuple[int, Path]]) -> Gains:
    """Returns the arcs of some paths, given with their classes, that visit only remaining states,
    and the gain of each.
    """
    narrowing, bonuses = priced.narrowing, priced.bonuses
    found: dict[tuple[_Place, _Place], float] = {}
    for number, path in paths:
        left, graph = narrowing.left[number], narrowing.model.classes[number].graph
        if not all(left[t, state] for t, state in enumerate(path)):
            continue
        charges, n_places = narrowing.charges[number], graph.n_places
        for t in range(len(path) - 1):
            tail, head = path[t], path[t + 1]
            ends = (number, t, tail), (number, t + 1, head)
            if ends in found:
                continue
            gain = float(bonuses.of_edges(graph.shape, tail, np.array([head]))[0])
            gain -= charges.moves.get((t, tail % n_places, head % n_places), 0.0)
            gain -= charges.places.get((t + 1, head % n_places), 0.0)
            gain -= charges.states.get((t + 1, head), 0.0)
            if t == 0:
                gain -= charges.places.get((0, tail % n_places), 0.0)
                gain -= charges.states.get((0, tail), 0.0)
            found[ends] = gain
    return found


def _assembled(rows: Sequence[_MasterRow], n_columns: int) -> tuple[sparse.csc_matrix, FloatArray]:
    """Returns rows `matrix x <= rhs` as a matrix and right-hand sides."""
    entries = [(number, *entry) for number, (row, _) in enumerate(rows) for entry in row]
    numbers, columns, values = np.array(entries).T
    index: tuple[IntArray, IntArray] = (numbers.astype(np.int64), columns.astype(np.int64))
    matrix = sparse.csc_matrix((values, index), shape=(len(rows), n_columns))
    return matrix, np.array([most for _, most in rows])
