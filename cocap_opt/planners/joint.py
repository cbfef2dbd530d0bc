"""Joint value iteration: the proved optimum for one or two robots.

Two robots move independently, so the maximum over pairs of actions is taken one robot after
the other: a step costs S^2 * 2 |A| instead of S^2 |A|^2. Only the swap rule couples the
moves; the pairs of cells that it touches are done again without the forbidden exchange.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cocap_opt.coordination.constraints import place_of, places_too_close
from cocap_opt.data import BoolArray, FloatArray, IntArray
from cocap_opt.graph.move_rewards import bonuses_of
from cocap_opt.graph.timegraph import CLOSED
from cocap_opt.model import Model, Path, RobotClass, compiled
from cocap_opt.objective import no_pixels, objective_of, view_sum_weights
from cocap_opt.planners.low_level import SingleRobotTask, value_iteration
from cocap_opt.planners.team import no_plan, no_plan_in_time, stopped
from cocap_opt.problem.problem import Cell, Problem
from cocap_opt.result import Reason, Result, UnsupportedError, timed
from cocap_opt.stop import Limit, LimitReached, Stop, never

INFEASIBLE = Reason.INFEASIBLE, "no plan obeys the rules: no pair of paths is left"
TEMPORARIES = 5  # arrays of a step's size that one step back needs at once
PROCESS = 100e6  # bytes, about: Python, the libraries, the problem, and what is freed but kept
MEMORY_LIMIT = 8e9  # bytes that the process may have
NOWHERE = -1  # number of no place


@timed
def joint(problem: Problem, stop: Stop = never) -> Result:
    """Best plan of one or two robots, proved by value iteration over pairs of states.

    Raises
    ------
    UnsupportedError
        For more than two robots.
    """
    model = compiled(problem)
    if len(problem.robots) > 2:
        raise UnsupportedError(f"joint planning takes one or two robots, not {len(problem.robots)}")
    if problem.objective.over_time:
        raise UnsupportedError("joint planning takes no pixels that add up over time")
    try:
        model.prepare_all(stop)
        stop.check()
        if len(problem.robots) == 1:
            path = value_iteration(SingleRobotTask(model, 0, no_pixels(problem), stop=stop)).path
            paths = None if path is None else (path,)
        else:
            paths = _Pair(model, stop).solve()
    except LimitReached as reached:
        if reached.limit is Limit.MEMORY:
            return no_plan_in_time(reached.limit)
        return stopped(model, reached.limit, {})
    if paths is None:
        return no_plan(*INFEASIBLE)
    value = objective_of(model, paths)
    return Result(model.plan(paths), value, Reason.OPTIMAL, bound=value)


@dataclass(frozen=True)
class _Side:
    """One robot's part of the pair: the places it can reach at each step, numbered per step."""

    robot_class: RobotClass
    start: int  # state number
    places: list[IntArray]  # per step [n_t] place numbers, increasing

    @classmethod
    def of(cls, model: Model, robot: int) -> "_Side":
        graph, start = model.class_of[robot].graph, model.start(robot)
        reach = graph.reachable([start], model.problem.horizon)
        reach = reach.reshape(len(reach), graph.n_orientations, graph.n_places)
        return cls(model.class_of[robot], start, [np.flatnonzero(r.any(axis=0)) for r in reach])

    def sizes(self, t: int) -> tuple[int, int]:
        return self.robot_class.graph.n_orientations, len(self.places[t])

    def states(self, t: int) -> IntArray:
        """State numbers [O * n_t], orientation by orientation."""
        origins = np.arange(self.robot_class.graph.n_orientations) * self.robot_class.graph.n_places
        return (origins[:, None] + self.places[t]).ravel()

    def position(self, t: int, places: IntArray) -> IntArray:
        """Positions of place numbers in the list of step t; n_t where a place is not in it."""
        at = np.minimum(np.searchsorted(self.places[t], places), len(self.places[t]) - 1)
        return np.where(self.places[t][at] == places, at, len(self.places[t]))

    def targets(self, t: int) -> IntArray:
        """Positions at t+1 that each move leads to from each place of t [K, n_t]."""
        return self.position(t + 1, self.robot_class.graph.neighbours[:, self.places[t]])

    def moves(self, t: int, at: IntArray, there: IntArray) -> IntArray:
        """Cell moves [n, 3] from positions at t to positions at t+1."""
        graph = self.robot_class.graph
        tails, heads = self.places[t][at], self.places[t + 1][there]
        return (graph.coordinates(heads) - graph.coordinates(tails)).T

    def cell(self, model: Model, place: int) -> Cell:
        layer, x, y = self.robot_class.graph.coordinates(np.array([place]))[:, 0].tolist()
        return Cell(x, y, model.problem.layers.index(self.robot_class.spec.motion.layers[layer]))


class _Pair:
    """Value iteration over pairs; arrays [Oa, na_t, Ob, nb_t] over both robots' states."""

    def __init__(self, model: Model, stop: Stop = never) -> None:
        self.model = model
        self.stop = stop
        self.a, self.b = _Side.of(model, 0), _Side.of(model, 1)
        self.horizon = model.problem.horizon
        self.bonuses = bonuses_of(model.problem.objective)

    @property
    def bytes_needed(self) -> float:
        """Peak of the process's memory: the values of later steps, and the work on one step."""
        peak = later = 0.0
        for t in range(self.horizon, -1, -1):
            (o_a, n_a), (o_b, n_b) = self.a.sizes(t), self.b.sizes(t)
            # Of each state: its coverage and the roots of it, and Python's views of its row.
            work = (2.0 * self.model.n_faces + 40.0) * (o_a * n_a + o_b * n_b)
            if t < self.horizon:
                ahead_a, ahead_b = len(self.a.places[t + 1]), len(self.b.places[t + 1])
                work += TEMPORARIES * float(o_a * (ahead_a + 1)) * float(o_b * (ahead_b + 1))
                # Of each move its targets, of each exchange its places and its pairs' values.
                work += 5.0 * len(self.a.robot_class.graph.moves) * n_a
                work += 5.0 * len(self.b.robot_class.graph.moves) * n_b
                if self.model.problem.rules.swap:
                    work += (3.0 * o_a * o_b + 8.0) * len(self._exchanges(t)[0])
            peak = max(peak, later + work)
            later += float(o_a * n_a) * float(o_b * n_b)
        return PROCESS + 8.0 * peak

    def solve(self) -> tuple[Path, ...] | None:
        """Best pair of paths, None if there is none; raises LimitReached."""
        if self.bytes_needed > MEMORY_LIMIT:
            raise LimitReached(Limit.MEMORY)
        return self.best_paths(self.sweep())

    def sweep(self) -> list[FloatArray]:
        """Best reward to go of all pairs at every step."""
        values = [self._close_goals(self._own(self.horizon))]
        for t in range(self.horizon - 1, -1, -1):
            values.append(self._step_back(t, values[-1]) + self._own(t))
        return values[::-1]

    def _own(self, t: int) -> FloatArray:
        """Reward of being in a pair of states at t; CLOSED where the two conflict."""
        shape = (*self.a.sizes(t), *self.b.sizes(t))
        coverage_a, coverage_b = self._coverage(self.a, t), self._coverage(self.b, t)
        n_faces = self.model.n_faces
        weights = view_sum_weights(self.model.problem)[t * n_faces : (t + 1) * n_faces]
        root_a, root_b = np.sqrt(coverage_a) @ weights, np.sqrt(coverage_b) @ weights
        own = root_a[:, None] + root_b[None, :]
        # Where both see a face, the roots do not add up.
        for face in np.flatnonzero(weights):
            self.stop.check()
            rows = np.flatnonzero(coverage_a[:, face])
            columns = np.flatnonzero(coverage_b[:, face])
            if len(rows) and len(columns):
                first, second = coverage_a[rows, face][:, None], coverage_b[columns, face]
                excess = np.sqrt(first + second) - np.sqrt(first) - np.sqrt(second)
                own[np.ix_(rows, columns)] += weights[face] * excess
        own = own.reshape(shape)
        for i, place in enumerate(self.a.places[t].tolist()):
            cell = self.a.cell(self.model, place)
            near = np.array(places_too_close(self.model, self.b.robot_class, cell), dtype=np.int64)
            if len(near):
                at = self.b.position(t, near)
                own[:, i, :, at[at < shape[3]]] = CLOSED
        return own

    def _coverage(self, side: _Side, t: int) -> FloatArray:
        """Coverage [O * n_t, F] of a robot's states at t."""
        table, n_states = self.model.coverage(side.robot_class), side.robot_class.graph.n_states
        rows = [table.row(t * n_states + int(state)) for state in side.states(t)]
        coverage = np.zeros((len(rows), self.model.n_faces))
        for row, (view_sums, pixels) in zip(coverage, rows, strict=True):
            row[view_sums - t * self.model.n_faces] = pixels
        return coverage

    def _close_goals(self, values: FloatArray) -> FloatArray:
        for side, axis in ((self.a, 1), (self.b, 3)):
            if side.robot_class.goal is not None:
                _, x, y = side.robot_class.graph.coordinates(side.places[self.horizon])
                elsewhere = np.flatnonzero(
                    (x != side.robot_class.goal[0]) | (y != side.robot_class.goal[1])
                )
                values[(slice(None),) * axis + (elsewhere,)] = CLOSED
        return values

    def _step_back(self, t: int, ahead: FloatArray) -> FloatArray:
        """Best of the pairs of actions at t, without the rewards of t."""
        half = self._best_move(t, ahead, self.b, axis=2)
        best = self._best_move(t, half, self.a, axis=0)
        if self.model.problem.rules.swap:
            self._without_swaps(t, ahead, half, best)
        return best

    def _turned(self, values: FloatArray, side: _Side, axis: int) -> FloatArray:
        """Maximum over the turns of one robot, whose orientations are on `axis`."""
        moved = np.moveaxis(values, axis, 0)
        result = np.empty_like(values)
        pitches = side.robot_class.graph.shape[1]
        for orientation, best in enumerate(np.moveaxis(result, axis, 0)):
            self.stop.check()
            turns = side.robot_class.graph.turns[orientation]
            kept = [turn for turn in turns if turn // pitches == orientation // pitches]
            np.copyto(best, moved[kept[0]])
            for turn in kept[1:]:
                np.maximum(best, moved[turn], out=best)
            if self.bonuses.keep_heading:
                np.add(best, self.bonuses.keep_heading, out=best)
            for turn in turns:
                if turn not in kept:
                    np.maximum(best, moved[turn], out=best)
        return result

    def _rates(self, side: _Side) -> list[float]:
        """Rewards of one robot's cell moves [K]."""
        rates: list[float] = self.bonuses.of_moves(np.array(side.robot_class.graph.moves)).tolist()
        return rates

    def _best_move(self, t: int, ahead: FloatArray, side: _Side, axis: int) -> FloatArray:
        """Maximum over one robot's actions; `axis` holds its orientations, the next its places."""
        turned = _with_closed_end(self._turned(ahead, side, axis), axis + 1)
        targets, rates = side.targets(t), self._rates(side)
        best: FloatArray = turned.take(targets[0], axis=axis + 1)
        best += rates[0]
        for target, rate in zip(targets[1:], rates[1:], strict=True):
            self.stop.check()
            moved = turned.take(target, axis=axis + 1)
            if rate:
                moved += rate
            np.maximum(best, moved, out=best)
        if self.bonuses.stationarity:
            stay = ahead.take(side.position(t + 1, side.places[t]), axis=axis + 1)
            np.maximum(best, stay + self.bonuses.stay, out=best)
        return best

    def _without_swaps(self, t: int, ahead: FloatArray, half: FloatArray, best: FloatArray) -> None:
        """Do the pairs of cells again that could be exchanged in this step.

        Either a does not go to b's cell and b does as it likes (`half` holds b's best), or a
        goes there and b does not go to a's.
        """
        at_a, at_b, there, here = self._exchanges(t)
        if not len(at_a):
            return
        turned_a = _with_closed_end(self._turned(half, self.a, 0), 1)
        redone = np.full((len(at_a), best.shape[0], best.shape[2]), CLOSED)
        for target, rate in zip(self.a.targets(t), self._rates(self.a), strict=True):
            self.stop.check()
            to = np.where(target[at_a] == there, half.shape[1], target[at_a])
            np.maximum(redone, turned_a[:, to, :, at_b] + rate, out=redone)
        # What a is rewarded for going to b's cell.
        gone = self.bonuses.of_moves(self.a.moves(t, at_a, there))[:, None, None]
        both = self._turned(self._turned(ahead, self.a, 0), self.b, 2)
        both = _with_closed_end(both, 3)
        for target, rate in zip(self.b.targets(t), self._rates(self.b), strict=True):
            self.stop.check()
            to = np.where(target[at_b] == here, ahead.shape[3], target[at_b])
            np.maximum(redone, both[:, there, :, to] + (gone + rate), out=redone)
        if self.bonuses.stationarity:
            stay = self.bonuses.stay
            stay_a = self.a.position(t + 1, self.a.places[t])[at_a]
            np.maximum(redone, half[:, stay_a, :, at_b] + stay, out=redone)
            stay_b = self.b.position(t + 1, self.b.places[t])[at_b]
            only_a = self._turned(ahead, self.a, 0)
            np.maximum(redone, only_a[:, there, :, stay_b] + (gone + stay), out=redone)
        best[:, at_a, :, at_b] = redone

    def _exchanges(self, t: int) -> tuple[IntArray, IntArray, IntArray, IntArray]:
        """Pairs of places at t whose robots can change places, as positions.

        Returns
        -------
        at_a, at_b : [n] where the robots stand, in the lists of step t
        there, here : [n] b's and a's cell, in the lists of a and b at step t+1
        """
        n_there = len(self.a.places[t + 1])
        place_here = self.twins[self.a.places[t]]
        here = self.b.position(t + 1, place_here)
        found = []
        for there in self.a.targets(t):
            self.stop.check()
            target = self.a.places[t + 1][np.minimum(there, n_there - 1)]
            place_there = np.where(there < n_there, self.twins[target], NOWHERE)
            at_b = self.b.position(t, place_there)
            both = (here < len(self.b.places[t + 1])) & (at_b < len(self.b.places[t]))
            at_a = np.flatnonzero(both & (place_there != place_here))
            back = self.b.robot_class.graph.adjacent(place_there[at_a], place_here[at_a])
            at_a = at_a[back]
            found.append(np.stack([at_a, at_b[at_a], there[at_a], here[at_a]]))
        at_a, at_b, there, here = np.concatenate(found, axis=1)
        return at_a, at_b, there, here

    @cached_property
    def twins(self) -> IntArray:
        """Place of b in the same cell as each place of a [P]; NOWHERE if b never flies there."""
        graph = self.a.robot_class.graph
        twins = np.full(graph.n_places, NOWHERE)
        for place in np.flatnonzero(graph.free).tolist():
            twin = place_of(self.model, self.b.robot_class, self.a.cell(self.model, place))
            twins[place] = NOWHERE if twin is None else twin
        return twins

    def best_paths(self, values: list[FloatArray]) -> tuple[Path, Path] | None:
        """Read the best pair of paths off the values; ties go to the first pair of states."""
        graph_a, graph_b = self.a.robot_class.graph, self.b.robot_class.graph
        path_a, path_b = [self.a.start], [self.b.start]
        if values[0][self._at(0, path_a[0], path_b[0])] == CLOSED:
            return None
        for t in range(self.horizon):
            heads_a, heads_b = graph_a.successors(path_a[-1]), graph_b.successors(path_b[-1])
            at_a = self._positions(self.a, t + 1, heads_a)
            at_b = self._positions(self.b, t + 1, heads_b)
            ahead = values[t + 1][at_a[0][:, None], at_a[1][:, None], at_b[0], at_b[1]]
            if not self.bonuses.none:
                gain_a = self.bonuses.of_edges(graph_a.shape, path_a[-1], heads_a)
                gain_b = self.bonuses.of_edges(graph_b.shape, path_b[-1], heads_b)
                ahead = ahead + gain_a[:, None] + gain_b[None, :]
            if self.model.problem.rules.swap:
                ahead = np.where(self._swapped(path_a[-1], path_b[-1], heads_a, heads_b),
                                 CLOSED, ahead)  # fmt: skip
            row, column = np.unravel_index(np.argmax(ahead), ahead.shape)
            path_a.append(int(heads_a[row]))
            path_b.append(int(heads_b[column]))
        return tuple(path_a), tuple(path_b)

    def _positions(self, side: _Side, t: int, states: IntArray) -> tuple[IntArray, IntArray]:
        orientation, place = np.divmod(states, side.robot_class.graph.n_places)
        return orientation, side.position(t, place)

    def _at(self, t: int, a: int, b: int) -> tuple[int, int, int, int]:
        first = self._positions(self.a, t, np.array([a]))
        second = self._positions(self.b, t, np.array([b]))
        return int(first[0][0]), int(first[1][0]), int(second[0][0]), int(second[1][0])

    def _swapped(self, a: int, b: int, heads_a: IntArray, heads_b: IntArray) -> BoolArray:
        """Which pairs of successors [na, nb] exchange the robots' cells."""
        n_a, n_b = self.a.robot_class.graph.n_places, self.b.robot_class.graph.n_places
        a_there = place_of(self.model, self.a.robot_class, self.b.cell(self.model, b % n_b))
        b_there = place_of(self.model, self.b.robot_class, self.a.cell(self.model, a % n_a))
        if a_there is None or b_there is None or a_there == a % n_a:
            return np.zeros((len(heads_a), len(heads_b)), dtype=np.bool_)
        swapped: BoolArray = (heads_a % n_a == a_there)[:, None] & (heads_b % n_b == b_there)
        return swapped


def _with_closed_end(values: FloatArray, axis: int) -> FloatArray:
    """One more entry along `axis`, CLOSED: the target of hidden moves."""
    pad = [(0, 0)] * values.ndim
    pad[axis] = (0, 1)
    return np.pad(values, pad, constant_values=CLOSED)
