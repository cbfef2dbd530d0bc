"""Joint value iteration: the proved optimum for one or two robots.

A step of two robots is the maximum over one robot's moves and then over the other's
(`coordination.pair_iteration`). Only the swap rule couples the moves; the pairs of cells that it
touches are done again without the forbidden exchange.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from cocap_opt.coordination.best_response import best_response
from cocap_opt.coordination.pair_iteration import PairIteration, Successors
from cocap_opt.data import BoolArray, FloatArray, IntArray
from cocap_opt.graph.move_rewards import Bonuses
from cocap_opt.graph.timegraph import CLOSED
from cocap_opt.model import Model, Path, RobotClass, compiled
from cocap_opt.objective import objective
from cocap_opt.planners.low_level import SingleRobotPath
from cocap_opt.planners.team import Team
from cocap_opt.problem import Problem
from cocap_opt.result import Reason, Result, UnsupportedError
from cocap_opt.stop import Limit, LimitReached, Stop, never
from cocap_opt.timing import timed

TEMPORARIES = 5  # arrays of a step's size that one step back needs at once
PROCESS = 100e6  # bytes, about: Python, the libraries, the problem, and what is freed but kept
MEMORY_LIMIT = 8e9  # bytes that the process may have
NOWHERE = -1  # number of no place


@timed
def joint(problem: Problem, stop: Stop = never) -> Result:
    """Returns the best plan of one or two robots, proved by value iteration over pairs of states.

    Raises
    ------
    UnsupportedError
        For more than two robots, and where pixels add up over time.
    """
    if len(problem.robots) > 2:
        raise UnsupportedError(f"joint planning takes one or two drones, not {len(problem.robots)}")
    if problem.objective.over_time:
        raise UnsupportedError("joint planning does not support pixels that add up over time")
    model = compiled(problem).covered_by(stop)
    try:
        paths = _best_paths(model, stop)
    except LimitReached as reached:
        if reached.limit is Limit.MEMORY:
            return Result.stopped_without_plan(reached.limit)
        return Team(model).without_conflicts(reached.limit, {})
    if paths is None:
        return Result.without_plan(
            Reason.INFEASIBLE, "no plan obeys the rules: no pair of paths is left"
        )
    if model.cut_short_by:
        found = (
            SingleRobotPath(path, model.robot_pixels(i, path), 0) for i, path in enumerate(paths)
        )
        return Team(model, tuple(found)).result(model.cut_short_by, {})
    value = objective(model, paths)
    return Result(model.plan(paths), value, Reason.OPTIMAL, bound=value)


def _best_paths(model: Model, stop: Stop) -> tuple[Path, ...] | None:
    """Returns the best paths of all robots; None where the rules leave none.

    Raises
    ------
    LimitReached
        Also for memory, before the values of all pairs would take too much of it.
    """
    stop.check()
    if len(model.problem.robots) == 1:
        path = best_response(model, 0, model.problem.no_pixels())
        return None if path is None else (path,)
    pair = _Pair(model, stop)
    if pair.bytes_needed > MEMORY_LIMIT:
        raise LimitReached(Limit.MEMORY)
    return pair.best_paths(pair.sweep(), pair.starts, pair.positions)


@dataclass(frozen=True)
class _Side:
    """One robot's part of the pair: the places it can reach at each step, numbered per step.

    Its states at step t are numbered orientation by orientation, place by place [O * n_t].
    """

    robot_class: RobotClass
    start: int  # state number
    places: list[IntArray]  # per step [n_t] place numbers, increasing

    @classmethod
    def of(cls, model: Model, robot: int) -> "_Side":
        """Returns the part of one robot."""
        graph, start = model.class_of[robot].graph, model.start(robot)
        reach = graph.reachable([start], model.problem.horizon)
        reach = reach.reshape(len(reach), graph.n_orientations, graph.n_places)
        return cls(model.class_of[robot], start, [np.flatnonzero(r.any(axis=0)) for r in reach])

    def sizes(self, t: int) -> tuple[int, int]:
        """Returns the numbers of orientations and of places at step t."""
        return self.robot_class.graph.n_orientations, len(self.places[t])

    def states(self, t: int) -> IntArray:
        """Returns the state numbers [O * n_t] of step t, orientation by orientation."""
        origins = np.arange(self.robot_class.graph.n_orientations) * self.robot_class.graph.n_places
        return (origins[:, None] + self.places[t]).ravel()

    def position(self, t: int, places: IntArray) -> IntArray:
        """Returns positions of place numbers in the list of step t; n_t for a place not in it."""
        at = np.minimum(np.searchsorted(self.places[t], places), len(self.places[t]) - 1)
        return np.where(self.places[t][at] == places, at, len(self.places[t]))

    def positions_of_states(self, t: int, states: IntArray) -> IntArray:
        """Returns positions of state numbers, which can be reached, among the states of step t."""
        orientation, place = np.divmod(states, self.robot_class.graph.n_places)
        return orientation * len(self.places[t]) + self.position(t, place)

    def targets(self, t: int) -> IntArray:
        """Returns the positions at t+1 that each move leads to from each place of t [K, n_t]."""
        return self.position(t + 1, self.robot_class.graph.neighbours[:, self.places[t]])

    def moves(self, t: int, at: IntArray, there: IntArray) -> IntArray:
        """Returns the cell moves [n, 3] from positions at t to positions at t+1."""
        graph = self.robot_class.graph
        tails, heads = self.places[t][at], self.places[t + 1][there]
        return (graph.coordinates(heads) - graph.coordinates(tails)).T


class _Exchanges(NamedTuple):
    """Pairs of places at step t whose robots can change places [n], by their positions."""

    at_a: IntArray  # place of a in its list of step t
    at_b: IntArray
    there: IntArray  # place of b in a's list of step t+1
    here: IntArray  # place of a in b's list of step t+1


class _Pair(PairIteration):
    """Value iteration over all pairs of states that robots 0 and 1 (a and b) can reach.

    Inside a step, values have the axes [Oa, na_t, Ob, nb_t]: orientations and places of both.
    """

    def __init__(self, model: Model, stop: Stop = never) -> None:
        self.model = model
        self.stop = stop
        self.a, self.b = _Side.of(model, 0), _Side.of(model, 1)
        self.starts = self.a.start, self.b.start
        self.horizon = model.problem.horizon
        self.bonuses = Bonuses.of(model.problem.objective)

    @property
    def positions(self) -> tuple[int, int]:
        """Positions of both robots' starts among their states of step 0."""
        sides = (self.a, self.b)
        a, b = (side.positions_of_states(0, np.array([side.start])) for side in sides)
        return int(a[0]), int(b[0])

    @property
    def bytes_needed(self) -> float:
        """Peak of the process's memory: the values of later steps, and the work on one step."""
        peak = later = 0.0
        for t in range(self.horizon, -1, -1):
            (o_a, n_a), (o_b, n_b) = self.a.sizes(t), self.b.sizes(t)
            # Of each state: its coverage and the roots of it, and some numbers to spare.
            work = (2.0 * self.model.n_faces + 40.0) * (o_a * n_a + o_b * n_b)
            if t < self.horizon:
                work += self._numbers_of_step_back(t)
            peak = max(peak, later + work)
            later += float(o_a * n_a) * float(o_b * n_b)
        return PROCESS + 8.0 * peak

    def _numbers_of_step_back(self, t: int) -> float:
        """Returns how many numbers of 8 bytes a step back from t+1 to t holds at most."""
        (o_a, n_a), (o_b, n_b) = self.a.sizes(t), self.b.sizes(t)
        ahead_a, ahead_b = len(self.a.places[t + 1]), len(self.b.places[t + 1])
        numbers = TEMPORARIES * float(o_a * (ahead_a + 1)) * float(o_b * (ahead_b + 1))
        # Of each move its targets, of each exchange its places and its pairs' values.
        numbers += 5.0 * len(self.a.robot_class.graph.moves) * n_a
        numbers += 5.0 * len(self.b.robot_class.graph.moves) * n_b
        if self.model.problem.rules.swap:
            numbers += (3.0 * o_a * o_b + 8.0) * len(self._exchanges(t).at_a)
        return numbers

    def reward(self, t: int) -> FloatArray:
        """Returns the reward of being in each pair of states at step t, with goals at the end."""
        own = self._view_rewards(t).reshape(*self.a.sizes(t), *self.b.sizes(t))
        classes = self.a.robot_class, self.b.robot_class
        conflicts = self.model.conflict_matrix(classes, (self.a.places[t], self.b.places[t]))
        own.transpose(0, 2, 1, 3)[:, :, conflicts] = CLOSED
        if t == self.horizon:
            own[:, self._off_goal(self.a)] = CLOSED
            own[..., self._off_goal(self.b)] = CLOSED
        return self._flat(t, own)

    def _view_rewards(self, t: int) -> FloatArray:
        """Returns the reward for views of each pair of states at step t."""
        coverage_a, coverage_b = (
            self.model.coverage_at(side.robot_class, t, side.states(t)) for side in (self.a, self.b)
        )
        n_faces = self.model.n_faces
        weights = self.model.problem.view_sum_weights[t * n_faces : (t + 1) * n_faces]
        root_a, root_b = np.sqrt(coverage_a) @ weights, np.sqrt(coverage_b) @ weights
        own: FloatArray = root_a[:, None] + root_b[None, :]
        # Where both see a face, the roots do not add up.
        for face in np.flatnonzero(weights):
            self.stop.check()
            rows = np.flatnonzero(coverage_a[:, face])
            columns = np.flatnonzero(coverage_b[:, face])
            if len(rows) and len(columns):
                first, second = coverage_a[rows, face][:, None], coverage_b[columns, face]
                excess = np.sqrt(first + second) - np.sqrt(first) - np.sqrt(second)
                own[np.ix_(rows, columns)] += weights[face] * excess
        return own

    def _off_goal(self, side: _Side) -> IntArray:
        """Returns the positions of places at the last step that are not the robot's goal."""
        goal, places = side.robot_class.goal, side.places[self.horizon]
        if goal is None:
            return places[:0]
        _, x, y = side.robot_class.graph.coordinates(places)
        return np.flatnonzero((x != goal[0]) | (y != goal[1]))

    def _flat(self, t: int, values: FloatArray) -> FloatArray:
        """Returns values [Oa, na_t, Ob, nb_t] with one axis per robot, without a copy."""
        (o_a, n_a), (o_b, n_b) = self.a.sizes(t), self.b.sizes(t)
        return values.reshape(o_a * n_a, o_b * n_b)

    def step_back(self, t: int, ahead: FloatArray) -> FloatArray:
        """Returns the best of the pairs of actions at t, without the rewards of t."""
        ahead = ahead.reshape(*self.a.sizes(t + 1), *self.b.sizes(t + 1))
        half = self._best_move(t, ahead, self.b, axis=2)
        best = self._best_move(t, half, self.a, axis=0)
        if self.model.problem.rules.swap:
            self._without_swaps(t, ahead, half, best)
        return self._flat(t, best)

    def _turned(self, values: FloatArray, side: _Side, axis: int) -> FloatArray:
        """Returns the maximum over the turns of one robot, whose orientations are on `axis`."""
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
        """Returns the rewards of one robot's cell moves [K]."""
        rates: list[float] = self.bonuses.of_moves(np.array(side.robot_class.graph.moves)).tolist()
        return rates

    def _best_move(self, t: int, ahead: FloatArray, side: _Side, axis: int) -> FloatArray:
        """Returns the maximum over one robot's actions.

        Parameters
        ----------
        axis : of the robot's orientations in `ahead`; the next one has its places
        """
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
        """Computes the pairs of cells again that could be exchanged in this step, in `best`.

        Either a does not go to b's cell and b moves freely (`half` holds b's best), or a goes
        there and b does not go to a's.
        """
        exchanges = self._exchanges(t)
        if not len(exchanges.at_a):
            return
        redone = np.full((len(exchanges.at_a), best.shape[0], best.shape[2]), CLOSED)
        self._raise_with_a_elsewhere(t, half, exchanges, redone)
        self._raise_with_b_elsewhere(t, ahead, exchanges, redone)
        best[:, exchanges.at_a, :, exchanges.at_b] = redone

    def _raise_with_a_elsewhere(
        self, t: int, half: FloatArray, exchanges: _Exchanges, redone: FloatArray
    ) -> None:
        """Raises values [n, Oa, Ob] of exchanges to the best in which a avoids b's cell."""
        at_a, at_b, there, _ = exchanges
        turned_a = _with_closed_end(self._turned(half, self.a, 0), 1)
        for target, rate in zip(self.a.targets(t), self._rates(self.a), strict=True):
            self.stop.check()
            to = np.where(target[at_a] == there, half.shape[1], target[at_a])
            np.maximum(redone, turned_a[:, to, :, at_b] + rate, out=redone)
        if self.bonuses.stationarity:
            stay_a = self.a.position(t + 1, self.a.places[t])[at_a]
            np.maximum(redone, half[:, stay_a, :, at_b] + self.bonuses.stay, out=redone)

    def _raise_with_b_elsewhere(
        self, t: int, ahead: FloatArray, exchanges: _Exchanges, redone: FloatArray
    ) -> None:
        """Raises values [n, Oa, Ob] of exchanges to the best in which a alone changes cells."""
        at_a, at_b, there, here = exchanges
        # The reward of a for going to b's cell.
        gone = self.bonuses.of_moves(self.a.moves(t, at_a, there))[:, None, None]
        both = self._turned(self._turned(ahead, self.a, 0), self.b, 2)
        both = _with_closed_end(both, 3)
        for target, rate in zip(self.b.targets(t), self._rates(self.b), strict=True):
            self.stop.check()
            to = np.where(target[at_b] == here, ahead.shape[3], target[at_b])
            np.maximum(redone, both[:, there, :, to] + (gone + rate), out=redone)
        if self.bonuses.stationarity:
            stay_b = self.b.position(t + 1, self.b.places[t])[at_b]
            only_a = self._turned(ahead, self.a, 0)
            stay = gone + self.bonuses.stay
            np.maximum(redone, only_a[:, there, :, stay_b] + stay, out=redone)

    def _exchanges(self, t: int) -> _Exchanges:
        """Returns the pairs of places at t whose robots can change places."""
        n_there = len(self.a.places[t + 1])
        place_here = self._twins[self.a.places[t]]
        here = self.b.position(t + 1, place_here)
        found = []
        for there in self.a.targets(t):
            self.stop.check()
            target = self.a.places[t + 1][np.minimum(there, n_there - 1)]
            place_there = np.where(there < n_there, self._twins[target], NOWHERE)
            at_b = self.b.position(t, place_there)
            both = (here < len(self.b.places[t + 1])) & (at_b < len(self.b.places[t]))
            at_a = np.flatnonzero(both & (place_there != place_here))
            back = self.b.robot_class.graph.adjacent(place_there[at_a], place_here[at_a])
            at_a = at_a[back]
            found.append(np.stack([at_a, at_b[at_a], there[at_a], here[at_a]]))
        return _Exchanges(*np.concatenate(found, axis=1))

    @cached_property
    def _twins(self) -> IntArray:
        """Place of b in the same cell as each place of a [P]; NOWHERE if b never flies there."""
        graph = self.a.robot_class.graph
        cells = self.model.cells[self.model.classes.index(self.a.robot_class)]
        twins = np.full(graph.n_places, NOWHERE)
        for place in np.flatnonzero(graph.free).tolist():
            twin = self.model.place_of(self.b.robot_class, cells[place])
            twins[place] = NOWHERE if twin is None else twin
        return twins

    def successors(self, which: int, t: int, state: int) -> Successors:
        """Returns the states that a (0) or b (1) can go to from its state at step t."""
        side = (self.a, self.b)[which]
        graph = side.robot_class.graph
        heads = graph.successors(state)
        rewards = self.bonuses.of_edges(graph.shape, state, heads)
        return Successors(heads, side.positions_of_states(t + 1, heads), rewards)

    def forbidden(
        self, tails: tuple[int, int], heads: tuple[IntArray, IntArray]
    ) -> BoolArray | bool:
        """Returns which pairs of moves [n, m] exchange the robots' cells."""
        if not self.model.problem.rules.swap:
            return False
        n_a, n_b = self.a.robot_class.graph.n_places, self.b.robot_class.graph.n_places
        place_a, place_b = tails[0] % n_a, tails[1] % n_b
        here = self._twins[place_a]  # of a, among b's places
        there = np.flatnonzero(self._twins == place_b)  # of b, among a's places
        if here in (NOWHERE, place_b) or not len(there):
            return False
        swapped: BoolArray = (heads[0] % n_a == there[0])[:, None] & (heads[1] % n_b == here)
        return swapped


def _with_closed_end(values: FloatArray, axis: int) -> FloatArray:
    """Returns values with one more entry along `axis`, CLOSED: the target of hidden moves."""
    pad = [(0, 0)] * values.ndim
    pad[axis] = (0, 1)
    return np.pad(values, pad, constant_values=CLOSED)
