"""The bundle method over prices of states; each set of prices makes a step envelope.

Local search evaluates prices: the joint states that it finds above the constants, and the best
paths, enter the master problem at the next iteration. Over prices phi(t, s), constants K_t and
potentials u(t, s), the master minimises

    sum_t K_t + sum of u at the starts + rho / 2 |phi - centre|^2

such that K_t is at least the height of every known joint state of the step, and the potentials rise
along the known arcs by prices less charges. At steps with a ceiling, prices are at least the
initial ones, and states without a price of their own are priced higher by the difference
between the ceiling and K_t (`staged.narrowing`). As the master knows only some joint states and
arcs, its value is too low, and the missing ones are found iteration by iteration; the last term
keeps prices near the best so far (a proximal bundle method; Kiwiel 1990).
"""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import clarabel
import numpy as np
from scipy import sparse

from cocap_opt.arithmetic import exact_sum
from cocap_opt.data import BoolArray, FloatArray, IntArray
from cocap_opt.formulations.certificates.format import StepPrices
from cocap_opt.formulations.certificates.staged import JointStates, Narrowing
from cocap_opt.formulations.column_generation.parameters import BundleParameters
from cocap_opt.formulations.column_generation.step_envelopes.known_states import Known
from cocap_opt.formulations.solvers import solve_cones
from cocap_opt.graph.move_rewards import Bonuses
from cocap_opt.graph.value_iteration import backward_sweep, best_path
from cocap_opt.mixtures.columns import Arc
from cocap_opt.model import Path
from cocap_opt.stop import Stop

CLEARLY = 1e-9  # relative to the bound: a height this much above a constant exceeds it
_ACCURACY = 1e-9  # relative accuracy of the solver

_Place = tuple[int, int, int]  # class number, step, state number
_StartSet = tuple[int, int]  # class and number of a set of starts from which robots choose
# of known moves: rewards less charges, without prices
_Gains = Mapping[tuple[_Place, _Place], float]
_Height = tuple[int, tuple[int, ...], float]  # step, positions among all prices, and worth
_Entry = tuple[int, float]  # column and coefficient; entries of the same column add up
_MasterRow = tuple[Sequence[_Entry], float]  # entries, and the upper limit of their sum


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


class _StepSolution(NamedTuple):
    """A solution of the master problem."""

    prices: FloatArray  # [n]
    constants: Mapping[int, float]  # constant by step
    value: float  # at most the best bound
    flow: FloatArray  # [m] number of robots on each known arc in the best mixture


class PriceBundle:
    """The bundle method over the prices of the remaining states, or of the best of them.

    Parameters
    ----------
    ceilings : for steps at which only some of the states are in `joints`, a value that no joint
        state's height currently exceeds

    Attributes
    ----------
    joints : the joint states of each step
    centre : [n] the initial prices of all their states, step by step
    rest : the part of the bound besides the steps' constants and the paths
    best : the bound that the best prices prove, as far as local search can tell
    constants : the constants intended for the best prices, by step; with short lists, lower
        constants prove less, since they raise the prices of unlisted states
    """

    def __init__(
        self,
        narrowing: Narrowing,
        known: Known,
        joints: dict[int, JointStates],
        ceilings: Mapping[int, float],
        stop: Stop,
        parameters: BundleParameters,
    ) -> None:
        self._parameters = parameters
        self._narrowing, self._known, self.joints = narrowing, known, joints
        self._ceilings = ceilings
        self._model, self._stop = narrowing.model, stop
        ends = np.cumsum([0, *(len(joint.states) for joint in joints.values())]).tolist()
        self._spans = {t: slice(a, b) for t, a, b in zip(joints, ends[:-1], ends[1:], strict=True)}
        self.centre = np.concatenate([joint.price for joint in joints.values()])
        self._priced: dict[_Place, int] = {
            (int(c), t, int(s)): self._spans[t].start + k
            for t, joint in joints.items()
            for k, (c, s) in enumerate(zip(joint.class_of, joint.states, strict=True))
        }
        self._has_ceiling: BoolArray = np.zeros(len(self.centre), dtype=np.bool_)  # [n]
        for t in ceilings:
            self._has_ceiling[self._spans[t]] = True
        self._worths: dict[int, dict[tuple[int, ...], float]] = {t: {} for t in joints}
        self._bonuses = Bonuses.of(self._model.problem.objective)
        self._unpriced = [
            np.where(left, rewards, -np.inf)
            for left, rewards in zip(narrowing.left, narrowing.rewards, strict=True)
        ]
        constants = {t: float(narrowing.constants[t]) for t in joints}
        paths = self.best_paths(self.centre, {})[0]
        self.rest = narrowing.bound - exact_sum(constants.values()) - paths
        self._starts = Counter[_Place]()  # number of robots at each fixed start
        self._start_sets: dict[_StartSet, tuple[set[int], int]] = {}
        for number, robot_class in enumerate(self._model.classes):
            for k, (starts, robots) in enumerate(robot_class.start_sets):
                if len(starts) == 1:
                    self._starts[number, 0, int(starts[0])] += len(robots)
                else:
                    self._start_sets[number, k] = set(starts.tolist()), len(robots)
        self.best, self._prices = np.inf, self.centre
        self.constants: Mapping[int, float] = {}
        self.flow: dict[Arc, float] = {}
        self._weight = self._parameters.first_weight / max(float(np.abs(self.centre).mean()), 1e-9)
        for t, joint in joints.items():
            for positions in known.at(joint) or known.ascended(joint):
                self.remember(t, positions)

    def span(self, t: int) -> slice:
        """Returns the positions of a step's prices."""
        return self._spans[t]

    @property
    def has_lists(self) -> bool:
        """True if only some of the states have their own prices."""
        return bool(self._ceilings)

    def run(self, cutoff: Callable[[], float], report: Callable[[], None]) -> FloatArray | None:
        """Returns prices that are clearly better according to local search; None if there are none.

        Parameters
        ----------
        cutoff : bound at which the root is closed
        report : called at every iteration

        Raises
        ------
        LimitReached
            If a limit is reached.
        """
        least_gain = self._parameters.converged * (self._narrowing.bound - cutoff())
        latest = self._prices
        for iteration in range(
            self._parameters.most_listed_iterations
            if self.has_lists
            else self._parameters.most_iterations
        ):
            self._stop.check()
            arcs, heights = self._arcs(), self._heights(self._prices, latest)
            if {t for t, _, _ in heights} != set(self.joints):
                return None  # at some step, no joint state that counts is known
            solved = self._solved_master(arcs, heights)
            latest = solved.prices
            self.flow = {
                Arc(*tail, head[2]): amount
                for (tail, head), amount in zip(arcs, solved.flow.tolist(), strict=True)
            }
            value, constants, new = self._judged(solved)
            promised = self.best - solved.value - self.rest
            gained = self.best - value
            if gained > CLEARLY * abs(value) and (
                promised == np.inf or gained >= self._parameters.serious * promised
            ):
                self._weight /= (
                    3 if promised < np.inf and gained > self._parameters.good * promised else 1
                )
                self.best, self._prices = value, solved.prices
                self.constants = constants
            elif gained < -promised or iteration % 4 == 3:
                self._weight *= 1.5
            if not new or self.best - cutoff() < least_gain:
                break
            if self.best - solved.value - self.rest < least_gain:
                break
            report()
        return self._prices if self.best < self._narrowing.bound - least_gain else None

    def _solved_master(self, arcs: _Gains, heights: Sequence[_Height]) -> _StepSolution:
        """Returns the solution of a master problem centred at the best prices so far.

        Prices of states that are in no known joint state and on no known arc do not change. At a
        limit, the solve ends early.

        Parameters
        ----------
        heights : heights of known joint states, in the order of their steps
        """
        columns = self._columns(arcs, heights)
        matrix, rhs = _assembled([
            *self._arc_rows(arcs, columns),  # first, so that their multipliers are the flow
            *self._end_rows(columns),
            *self._start_rows(columns),
            *self._height_rows(heights, columns),
            *self._ceiling_rows(columns),
        ], columns.size)  # fmt: skip
        bound = self._bound_of(columns)
        used, near = list(columns.price_of), columns.prices
        cost, weights = bound.copy(), np.zeros(columns.size)
        cost[near], weights[near] = -self._weight * self._prices[used], self._weight
        # Clarabel's "faer" uses supernodes above some size, and then takes up to three times as
        # long.
        solution = solve_cones(
            cost, matrix, rhs, [clarabel.NonnegativeConeT(len(rhs))], self._stop,
            quadratic=sparse.diags(weights).tocsc(), direct_solve_method="qdldl",
            tol_gap_rel=_ACCURACY, tol_feas=_ACCURACY,
        )  # fmt: skip
        found = np.nan_to_num(np.array(solution.x))
        prices = self._prices.copy()
        prices[used] = found[near]
        floored = self._has_ceiling  # the solver may violate these bounds slightly
        prices[floored] = np.maximum(prices[floored], self.centre[floored])
        constants = {t: float(found[k]) for t, k in columns.constant_of.items()}
        flow = np.nan_to_num(np.array(solution.z))[: len(arcs)]
        return _StepSolution(prices, constants, float(bound @ found), flow)

    def _columns(self, arcs: _Gains, heights: Sequence[_Height]) -> _Columns:
        """Returns the columns that the known arcs and joint states need."""
        places = dict.fromkeys(place for ends in arcs for place in ends)
        used = {self._priced[place] for place in places if place in self._priced}
        used |= {position for _, positions, _ in heights for position in positions}
        steps = sorted({t for t, _, _ in heights})
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
        if place in self._priced:
            return [(columns.price_of[self._priced[place]], 1.0)], 0.0
        number, t, state = place
        unpriced = float(self._unpriced[number][t, state])
        if t in self._ceilings:
            return [(columns.constant_of[t], -1.0)], unpriced + self._ceilings[t]
        return [], unpriced

    def _arc_rows(self, arcs: _Gains, columns: _Columns) -> Iterator[_MasterRow]:
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

    def _height_rows(self, heights: Sequence[_Height], columns: _Columns) -> Iterator[_MasterRow]:
        """Yields a row per joint state: its step's constant is at least its worth less its
        prices.
        """
        for t, positions, worth in heights:
            prices = [(columns.price_of[position], -1.0) for position in positions]
            yield [(columns.constant_of[t], -1.0), *prices], -worth

    def _ceiling_rows(self, columns: _Columns) -> Iterator[_MasterRow]:
        """Yields the rows of steps with a ceiling, which limits the constant.

        Prices at these steps are at least the initial ones.
        """
        for position, column in columns.price_of.items():
            if self._has_ceiling[position]:
                yield [(column, -1.0)], -float(self.centre[position])
        for t, ceiling in self._ceilings.items():
            yield [(columns.constant_of[t], 1.0)], ceiling

    def correct(self, value: float) -> None:
        """Records the bound that the latest prices prove, if the estimate by local search was
        lower.
        """
        self.best = max(value, self.best)

    def _judged(self, solved: _StepSolution) -> tuple[float, dict[int, float], int]:
        """Returns the bound that prices prove according to local search, and its findings.

        Returns
        -------
        The bound, constants by step, and the number of new joint states and paths
        """
        known = self._known
        new, constants = 0, dict(solved.constants)
        for t, joint in self.joints.items():
            paid = replace(joint, price=solved.prices[self._spans[t]])
            clearly = solved.constants[t] + CLEARLY * abs(self._narrowing.bound)
            for found in known.ascended(paid):
                if (height := paid.reduced_profit(found)) > clearly:
                    new += self.remember(t, found)
                    constants[t] = max(constants[t], height)
        total, paths = self.best_paths(solved.prices, constants)
        new += sum(known.add_path(number, path) for number, path in paths)
        bound = total + exact_sum(constants.values()) + self.rest
        return bound, constants, new

    def others(self, constants: Mapping[int, float]) -> dict[int, float]:
        """Returns the price increase of states without a price, by step, for lower constants.

        The increase is clearly larger than needed, so that rounding cannot make it too small.
        """
        return {
            t: max(ceiling - constants[t], 0.0) + CLEARLY * abs(ceiling)
            for t, ceiling in self._ceilings.items()
            if t in constants
        }

    def best_paths(
        self, prices: FloatArray, constants: Mapping[int, float]
    ) -> tuple[float, list[tuple[int, Path]]]:
        """Returns the total worth of the best paths, and the paths with their classes.

        Parameters
        ----------
        constants : constants of steps at which the prices of states without their own price rise
        """
        others = self.others(constants)
        total, paths = 0.0, []
        for number, robot_class in enumerate(self._model.classes):
            reward = self._unpriced[number].copy()
            for t, joint in self.joints.items():
                reward[t] += others.get(t, 0.0)
                of_class = joint.class_of == number
                reward[t, joint.states[of_class]] = prices[self._spans[t]][of_class]
            charges = self._narrowing.charges[number]
            value = backward_sweep(
                robot_class.graph, reward, self._bonuses, charges, robot_class.goal, self._stop
            )
            for starts in robot_class.starts:
                total += float(value[0, starts].max())
                path = best_path(robot_class.graph, value, starts, self._bonuses, charges)
                if path is not None:
                    paths.append((number, tuple(path)))
        return total, paths

    def _arcs(self) -> _Gains:
        """Returns the arcs of the known paths that visit only remaining states."""
        found: dict[tuple[_Place, _Place], float] = {}
        for number, path in self._known.paths:
            left, graph = self._narrowing.left[number], self._model.classes[number].graph
            if not all(left[t, state] for t, state in enumerate(path)):
                continue
            charges, n_places = self._narrowing.charges[number], graph.n_places
            for t in range(len(path) - 1):
                tail, head = path[t], path[t + 1]
                ends = (number, t, tail), (number, t + 1, head)
                if ends in found:
                    continue
                gain = float(self._bonuses.of_edges(graph.shape, tail, np.array([head]))[0])
                gain -= charges.moves.get((t, tail % n_places, head % n_places), 0.0)
                gain -= charges.places.get((t + 1, head % n_places), 0.0)
                gain -= charges.states.get((t + 1, head), 0.0)
                if t == 0:
                    gain -= charges.places.get((0, tail % n_places), 0.0)
                    gain -= charges.states.get((0, tail), 0.0)
                found[ends] = gain
        return found

    def remember(self, t: int, positions: Sequence[int]) -> bool:
        """Stores a joint state that counts; returns True if it is new."""
        joint, first = self.joints[t], self._spans[t].start
        is_new = self._known.add(joint, positions)
        at = tuple(sorted(first + k for k in positions))
        if at not in self._worths[t]:
            self._worths[t][at] = joint.worth(positions)
        return is_new

    def _heights(self, *prices: FloatArray) -> list[_Height]:
        """Returns the known joint states that are among the highest for some prices."""
        chosen: list[_Height] = []
        for t, worths in self._worths.items():
            every = list(worths.items())
            at = np.array([positions for positions, _ in every], dtype=np.int64)
            worth = np.array([value for _, value in every])
            highest: set[int] = set()
            for paid in prices if every else ():
                heights = worth - paid[at].sum(axis=1)
                highest.update(
                    np.argsort(-heights, kind="stable")[: self._parameters.most_heights].tolist()
                )
            chosen += [(t, *every[k]) for k in sorted(highest)]
        return chosen

    def written(self, t: int, prices: FloatArray, constant: float) -> list[StepPrices]:
        """Returns the prices of a step in the form of a certificate, class by class."""
        joint = self.joints[t]
        others = self.others({t: constant}).get(t, 0.0)
        parts = []
        for number, robot_class in enumerate(self._model.classes):
            of_class, graph = joint.class_of == number, robot_class.graph
            states = tuple(graph.state(int(state)) for state in joint.states[of_class])
            parts.append(StepPrices(t, number, states, tuple(prices[of_class].tolist()), others))
        return parts


def _assembled(rows: Sequence[_MasterRow], n_columns: int) -> tuple[sparse.csc_matrix, FloatArray]:
    """Returns rows `matrix x <= rhs` as a matrix and right-hand sides."""
    entries = [(number, *entry) for number, (row, _) in enumerate(rows) for entry in row]
    numbers, columns, values = np.array(entries).T
    index: tuple[IntArray, IntArray] = (numbers.astype(np.int64), columns.astype(np.int64))
    matrix = sparse.csc_matrix((values, index), shape=(len(rows), n_columns))
    return matrix, np.array([most for _, most in rows])
