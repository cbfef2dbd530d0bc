"""Joint value iteration: the proved optimum for one or two robots.

Two robots move independently of each other, so the maximum over pairs of actions is taken one robot
after the other: a step takes S^2 * 2 |A| operations instead of S^2 |A|^2. Rules that apply between
steps couple the moves: for pairs of places that are close enough, the maximum is recomputed over
all pairs of allowed moves.

The required memory is known in advance: it is that of the arrays that `Pair` holds at the same
time, as tests/core/test_joint.py measures.
"""

from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np

from cocap_opt.coordination.best_response import best_response
from cocap_opt.coordination.low_level import PlannedTeam, SingleRobotPath
from cocap_opt.data import BoolArray, FloatArray, IntArray
from cocap_opt.graph.move_rewards import Bonuses
from cocap_opt.graph.timegraph import CLOSED
from cocap_opt.model import Model, Path, RobotClass, compiled
from cocap_opt.objective import objective
from cocap_opt.planners.results import result_of, result_without_conflicts
from cocap_opt.problem import Problem, may_end
from cocap_opt.result import Reason, Result, UnsupportedError
from cocap_opt.stop import Limit, LimitReached, Stop, never
from cocap_opt.timing import timed

_AT_ONCE = 200_000  # values of near pairs at once, which limits memory


@dataclass(frozen=True)
class _PairSide:
    """One robot's part of the pair: the places it can reach at each step, numbered step by step.

    Its states at step t are numbered orientation by orientation, place by place [O * n_t].
    """

    robot_class: RobotClass
    starts: IntArray  # [n] numbers of its possible start states
    places: list[IntArray]  # per step [n_t] place numbers, increasing

    @classmethod
    def of(cls, model: Model, robot: int) -> "_PairSide":
        """Returns the part of one robot."""
        graph, starts = model.class_of[robot].graph, model.starts(robot)
        reach = graph.reachable(starts, model.problem.horizon)
        reach = reach.reshape(len(reach), graph.n_orientations, graph.n_places)
        return cls(model.class_of[robot], starts, [np.flatnonzero(r.any(axis=0)) for r in reach])

    def sizes(self, t: int) -> tuple[int, int]:
        """Returns the numbers of orientations and of places at step t."""
        return self.robot_class.graph.n_orientations, len(self.places[t])

    def states(self, t: int) -> IntArray:
        """Returns the state numbers [O * n_t] of step t, orientation by orientation."""
        origins = np.arange(self.robot_class.graph.n_orientations) * self.robot_class.graph.n_places
        return (origins[:, None] + self.places[t]).ravel()

    def position(self, t: int, places: IntArray) -> IntArray:
        """Returns the positions of place numbers in the list of step t; n_t for others."""
        at = np.minimum(np.searchsorted(self.places[t], places), len(self.places[t]) - 1)
        return np.where(self.places[t][at] == places, at, len(self.places[t]))

    def positions_of_states(self, t: int, states: IntArray) -> IntArray:
        """Returns the positions of reachable state numbers among the states of step t."""
        orientation, place = np.divmod(states, self.robot_class.graph.n_places)
        return orientation * len(self.places[t]) + self.position(t, place)

    def targets(self, t: int) -> IntArray:
        """Returns the positions at t+1 to which each move leads from each place of t [K, n_t]."""
        return self.position(t + 1, self.robot_class.graph.heads_at(t, self.places[t]))


class _PairWays(NamedTuple):
    """The K ways in which a robot can continue from each of n places."""

    turns: bool  # False: the state is unchanged
    to: IntArray  # [K, n] positions at t+1; one past the last if the way is closed
    heads: FloatArray  # [K, n, 3] m, ends of the ways
    rewards: FloatArray  # [K]

    def of(self, way: int) -> "_PairWays":
        """Returns one of the ways, with K = 1."""
        only = slice(way, way + 1)
        return _PairWays(self.turns, self.to[only], self.heads[only], self.rewards[only])


class Pair:
    """Value iteration over all pairs of states that robots 0 and 1 (a and b) can reach.

    Values are arrays [n, m] over the states of both robots at a step, CLOSED if the two conflict or
    one of them cannot continue. Within a step they have the axes [Oa, na_t, Ob, nb_t]: orientations
    and places of both.
    """

    def __init__(self, model: Model, stop: Stop = never) -> None:
        self.model = model
        self.stop = stop
        self.a, self.b = _PairSide.of(model, 0), _PairSide.of(model, 1)
        self.horizon = model.problem.horizon
        self.bonuses = Bonuses.of(model.problem.objective)

    def best_starts(self, value: FloatArray) -> tuple[int, int] | None:
        """Returns the best start states of both robots; None if there is no pair of paths.

        Parameters
        ----------
        value : [n, m] best reward-to-go of all pairs at step 0
        """
        sides = (self.a, self.b)
        open_ = value[np.ix_(*(side.positions_of_states(0, side.starts) for side in sides))]
        row, column = np.unravel_index(np.argmax(open_), open_.shape)
        if open_[row, column] == CLOSED:
            return None
        return int(self.a.starts[row]), int(self.b.starts[column])

    def sweep(self) -> list[FloatArray]:
        """Returns the best reward-to-go of all pairs at every step."""
        values = [self.reward(self.horizon)]
        for t in range(self.horizon - 1, -1, -1):
            values.append(self.step_back(t, values[-1]) + self.reward(t))
        return values[::-1]

    def best_paths(self, values: list[FloatArray]) -> tuple[Path, Path] | None:
        """Reads the best pair of paths off the values; in a tie, the first pair of states.

        Parameters
        ----------
        values : as `sweep` returns them

        Returns
        -------
        State numbers of both paths; None if there is no pair of paths.
        """
        starts = self.best_starts(values[0])
        if starts is None:
            return None
        path_a, path_b = ([start] for start in starts)
        for t, following in enumerate(values[1:]):
            states_a, at_a, rewards_a = self._successors(self.a, t, path_a[-1])
            states_b, at_b, rewards_b = self._successors(self.b, t, path_b[-1])
            ahead = following[np.ix_(at_a, at_b)]
            ahead = ahead + rewards_a[:, None] + rewards_b[None, :]
            forbidden = self._forbidden((path_a[-1], path_b[-1]), (states_a, states_b))
            ahead = np.where(forbidden, CLOSED, ahead)
            row, column = np.unravel_index(np.argmax(ahead), ahead.shape)
            path_a.append(int(states_a[row]))
            path_b.append(int(states_b[column]))
        return tuple(path_a), tuple(path_b)

    def reward(self, t: int) -> FloatArray:
        """Returns the reward of each pair of states at step t; at the end, pairs that miss a goal
        are closed.
        """
        reward = self._view_rewards(t).reshape(*self.a.sizes(t), *self.b.sizes(t))
        classes = self.a.robot_class, self.b.robot_class
        conflicts = self.model.places.conflict_matrix(classes, (self.a.places[t], self.b.places[t]))
        reward.transpose(0, 2, 1, 3)[:, :, conflicts] = CLOSED
        if t == self.horizon:
            reward[:, self._off_goal(self.a)] = CLOSED
            reward[..., self._off_goal(self.b)] = CLOSED
        return self._flat(t, reward)

    def _view_rewards(self, t: int) -> FloatArray:
        """Returns the reward for views of each pair of states at step t."""
        coverage_a, coverage_b = (
            self.model.coverage_at(side.robot_class, t, side.states(t)) for side in (self.a, self.b)
        )
        problem, view_sums = self.model.problem, self.model.problem.step_view_sums[t]
        weights, values_at = problem.view_sum_weights[view_sums], problem.returns.values_at
        value_a, value_b = (
            values_at(view_sums, coverage) @ weights for coverage in (coverage_a, coverage_b)
        )
        values: FloatArray = value_a[:, None] + value_b[None, :]
        # If both see a face or a person, the values do not add up.
        for k in np.flatnonzero(weights):
            self.stop.check()
            rows, columns = np.flatnonzero(coverage_a[:, k]), np.flatnonzero(coverage_b[:, k])
            if len(rows) and len(columns):
                value = partial(problem.returns.value_of, int(view_sums[k]))
                first, second = coverage_a[rows, k][:, None], coverage_b[columns, k]
                excess = value(first + second) - value(first) - value(second)
                values[np.ix_(rows, columns)] += weights[k] * excess
        return values

    def _off_goal(self, side: _PairSide) -> IntArray:
        """Returns the positions of places at the last step that are not the robot's goal."""
        robot_class, places = side.robot_class, side.places[self.horizon]
        _, x, y = robot_class.graph.coordinates(places)
        return np.flatnonzero(~may_end(robot_class.goal, x, y))

    def _flat(self, t: int, values: FloatArray) -> FloatArray:
        """Returns values [Oa, na_t, Ob, nb_t] reshaped to one axis per robot, without a copy."""
        (o_a, n_a), (o_b, n_b) = self.a.sizes(t), self.b.sizes(t)
        return values.reshape(o_a * n_a, o_b * n_b)

    def step_back(self, t: int, ahead: FloatArray) -> FloatArray:
        """Returns the values of the best pairs of actions at t, without the rewards of t."""
        ahead = ahead.reshape(*self.a.sizes(t + 1), *self.b.sizes(t + 1))
        half = self._best_move(t, ahead, self.b, axis=2)
        best = self._best_move(t, half, self.a, axis=0)
        if self.model.problem.rules.hold_between_steps:
            self._redo_near_pairs(t, ahead, half, best)
        return self._flat(t, best)

    def _turned(self, values: FloatArray, side: _PairSide, axis: int) -> FloatArray:
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

    def _best_move(self, t: int, ahead: FloatArray, side: _PairSide, axis: int) -> FloatArray:
        """Returns the maximum over one robot's actions.

        Parameters
        ----------
        axis : axis of the robot's orientations in `ahead`; its places are on the next axis
        """
        turned = _with_closed_end(self._turned(ahead, side, axis), axis + 1)
        moves = np.array(side.robot_class.graph.moves)
        targets, rates = side.targets(t), self.bonuses.of_moves(moves).tolist()
        best: FloatArray = turned.take(targets[0], axis=axis + 1)
        best += rates[0]
        for target, rate in zip(targets[1:], rates[1:], strict=True):
            self.stop.check()
            moved = turned.take(target, axis=axis + 1)
            if rate:
                moved += rate
            np.maximum(best, moved, out=best)
        if self.bonuses.stationarity:
            stay = _with_closed_end(ahead, axis + 1).take(targets[0], axis=axis + 1)
            np.maximum(best, stay + self.bonuses.stay, out=best)
        return best

    def _redo_near_pairs(
        self, t: int, ahead: FloatArray, half: FloatArray, best: FloatArray
    ) -> None:
        """Recomputes, in `best`, pairs of places whose moves may conflict, move by move.

        If none of b's moves can conflict with a's move, `half` holds b's best value.
        """
        at_a, at_b = self._near_pairs(t)
        if not len(at_a):
            return
        stays = (False, True) if self.bonuses.stationarity else (True,)
        halves = {
            turns: _with_closed_end(self._turned(half, self.a, 0) if turns else half, 1)
            for turns in stays
        }
        ahead = _with_closed_end(_with_closed_end(ahead, 1), 3)
        values = {}
        for a_turns in stays:
            turned = self._turned(ahead, self.a, 0) if a_turns else ahead
            for b_turns in stays:
                values[a_turns, b_turns] = self._turned(turned, self.b, 2) if b_turns else turned
        size = self.pairs_at_once()
        for first in range(0, len(at_a), size):
            pairs = at_a[first : first + size], at_b[first : first + size]
            best[:, pairs[0], :, pairs[1]] = self._best_of_pairs(t, pairs, halves, values)

    def pairs_at_once(self) -> int:
        """Returns the number of pairs of places whose moves are considered together."""
        ways = len(self.b.robot_class.graph.moves)
        orientations = self.a.robot_class.graph.n_orientations
        orientations *= self.b.robot_class.graph.n_orientations
        return max(1, _AT_ONCE // (ways * (orientations + 10)))

    def _near_pairs(self, t: int) -> tuple[IntArray, IntArray]:
        """Returns the pairs of places at t, by position, from which some moves may conflict."""
        problem = self.model.problem
        radii = self.a.robot_class.graph.motion.radius + self.b.robot_class.graph.motion.radius
        reach = radii * problem.height_map.resolution + problem.rules.separation
        first, second = (
            self.model.places.where(self.a.robot_class, self.a.places[t]),
            self.model.places.where(self.b.robot_class, self.b.places[t]),
        )
        ways = np.abs(first[:, None, :2] - second[None, :, :2])
        # Slightly farther, to allow for rounding.
        at_a, at_b = np.nonzero((ways <= reach * (1 + 1e-9)).all(axis=-1))
        return at_a, at_b

    def _best_of_pairs(
        self,
        t: int,
        at: tuple[IntArray, IntArray],
        halves: dict[bool, FloatArray],
        values: dict[tuple[bool, bool], FloatArray],
    ) -> FloatArray:
        """Returns the best [n, Oa, Ob] over both robots' moves from pairs of places [n] at t.

        Parameters
        ----------
        halves : values for places of a at t+1 and of b at t, one array for each value of "a may
            turn"
        values : values of the pairs at t+1, one array for each value of "a may turn" and "b may
            turn"; all with closed ends
        """
        rules, (at_a, at_b) = self.model.problem.rules, at
        tails_a, tails_b = (
            self.model.places.where(side.robot_class, side.places[t][places])
            for side, places in ((self.a, at_a), (self.b, at_b))
        )
        ways_b = self._ways(t, self.b, at_b)
        lengths = [np.linalg.norm(ways.heads - tails_b, axis=-1).ravel() for ways in ways_b]
        reach = float(np.nanmax([0.0, *np.concatenate(lengths)]))
        closed = halves[True].shape[1] - 1
        best = np.full((len(at_a), halves[True].shape[0], halves[True].shape[2]), CLOSED)
        for a in (ways.of(k) for ways in self._ways(t, self.a, at_a) for k in range(len(ways.to))):
            self.stop.check()
            (to,), (heads,), (reward,) = a.to, a.heads, a.rewards
            may = rules.may_conflict((tails_a, heads), tails_b, reach)
            free, near = np.flatnonzero(~may), np.flatnonzero(may)
            gained = halves[a.turns][:, to[free], :, at_b[free]] + reward
            best[free] = np.maximum(best[free], gained)
            for b in ways_b if len(near) else ():
                broken = rules.moves_conflict(
                    (tails_a[near], heads[near]), (tails_b[near], b.heads[:, near])
                )
                both = np.where(broken, closed, to[near]), b.to[:, near]
                gained = values[a.turns, b.turns][:, both[0], :, both[1]]
                gained += (reward + b.rewards)[:, None, None, None]
                best[near] = np.maximum(best[near], gained.max(axis=0))
        return best

    def _ways(self, t: int, side: _PairSide, at: IntArray) -> list[_PairWays]:
        """Returns the ways to continue from positions [n] at t."""
        heads = side.robot_class.graph.heads_at(t, side.places[t][at])
        turning = _PairWays(
            True,
            side.position(t + 1, heads),
            self.model.places.where(side.robot_class, heads),
            self.bonuses.of_moves(np.array(side.robot_class.graph.moves)),
        )
        if not self.bonuses.stationarity:
            return [turning]
        staying = turning.of(0)
        return [turning, staying._replace(turns=False, rewards=np.array([self.bonuses.stay]))]

    def _successors(
        self, side: _PairSide, t: int, state: int
    ) -> tuple[IntArray, IntArray, FloatArray]:
        """Returns the states to which a robot can go from its state at step t.

        Returns
        -------
        State numbers [n], their positions among the robot's states of step t+1, and the rewards
        for the moves themselves.
        """
        graph = side.robot_class.graph
        heads = graph.successors(t, state)
        rewards = self.bonuses.of_edges(graph.shape, state, heads)
        return heads, side.positions_of_states(t + 1, heads), rewards

    def _forbidden(
        self, tails: tuple[int, int], heads: tuple[IntArray, IntArray]
    ) -> BoolArray | bool:
        """Returns an array [n, m], True for pairs of moves (tails to heads) that break a rule."""
        if not self.model.problem.rules.hold_between_steps:
            return False
        sides = self.a, self.b
        sizes = [side.robot_class.graph.n_places for side in sides]
        here = [
            self.model.places.where(side.robot_class, np.array([tail % n]))
            for side, tail, n in zip(sides, tails, sizes, strict=True)
        ]
        first, second = (
            self.model.places.where(side.robot_class, states % n)
            for side, states, n in zip(sides, heads, sizes, strict=True)
        )
        return self.model.problem.rules.moves_conflict((here[0], first[:, None]), (here[1], second))


def _with_closed_end(values: FloatArray, axis: int) -> FloatArray:
    """Returns values with one more entry along `axis`, CLOSED: the target of closed moves."""
    pad = [(0, 0)] * values.ndim
    pad[axis] = (0, 1)
    return np.pad(values, pad, constant_values=CLOSED)


MEMORY_LIMIT = 8e9  # bytes that the process may use


@timed
def joint(problem: Problem, stop: Stop = never) -> Result:
    """Returns the best plan of one or two robots, proved by value iteration over pairs of states.

    Raises
    ------
    UnsupportedError
        If there are more than two robots, or if pixels add up over time.
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
        return result_without_conflicts(PlannedTeam.nobody(model), reached.limit, {})
    if paths is None:
        return Result.without_plan(
            Reason.INFEASIBLE, "no plan obeys the rules: every pair of paths breaks one"
        )
    if model.cut_short_by:
        found = (SingleRobotPath.of(model, i, path) for i, path in enumerate(paths))
        return result_of(PlannedTeam(model, tuple(found)), model.cut_short_by, {})
    value = objective(model, paths)
    return Result(model.plan(paths), value, Reason.OPTIMAL, bound=value)


def _best_paths(model: Model, stop: Stop) -> tuple[Path, ...] | None:
    """Returns the best paths of all robots; None if no paths obey the rules.

    Raises
    ------
    LimitReached
        If a limit is reached, or if the values of all pairs would take too much memory.
    """
    stop.check()
    if len(model.problem.robots) == 1:
        path = best_response(model, 0, model.problem.no_pixels(), stop=stop)
        return None if path is None else (path,)
    pair = Pair(model, stop)
    if not all(len(places) for side in (pair.a, pair.b) for places in side.places):
        return None  # people leave a robot no path
    if bytes_needed(pair) > MEMORY_LIMIT:
        raise LimitReached(Limit.MEMORY)
    return pair.best_paths(pair.sweep())


# bytes, approximately: Python, the libraries, the problem, and freed memory that is kept
PROCESS = 100e6
_BYTES = 8.0  # bytes per number
_TEMPORARIES = 5  # number of arrays of a step's size that one step back needs at the same time
_PER_FACE = 2.0  # numbers per state and face: the coverage and its root
_PER_STATE = 40.0  # further numbers per state, as a reserve
_PER_MOVE = 5.0  # numbers per move from each place, while its end is found
_PER_PAIR = 6.0  # numbers per pair of places, while it is checked for nearness
# numbers per way of b from a near pair and per pair of orientations: values, and the best
_PER_VALUE = 2.0
_PER_WAY = 20.0  # numbers per way of b from a near pair: its end, and whether it conflicts


def bytes_needed(pair: Pair) -> float:
    """Returns the peak memory in bytes: values of later steps, and arrays for the current one."""
    peak = later = 0.0
    for t in range(pair.horizon, -1, -1):
        (o_a, n_a), (o_b, n_b) = pair.a.sizes(t), pair.b.sizes(t)
        work = (_PER_FACE * pair.model.problem.step_width + _PER_STATE) * (o_a * n_a + o_b * n_b)
        if t < pair.horizon:
            work += _numbers_of_step_back(pair, t)
        peak = max(peak, later + work)
        later += float(o_a * n_a) * float(o_b * n_b)
    return PROCESS + _BYTES * peak


def _numbers_of_step_back(pair: Pair, t: int) -> float:
    """Returns the largest amount of numbers that a step back from t+1 to t holds in memory."""
    (o_a, n_a), (o_b, n_b) = pair.a.sizes(t), pair.b.sizes(t)
    ahead_a, ahead_b = len(pair.a.places[t + 1]), len(pair.b.places[t + 1])
    whole = float(o_a * (ahead_a + 1)) * float(o_b * (ahead_b + 1))
    ways_a, ways_b = len(pair.a.robot_class.graph.moves), len(pair.b.robot_class.graph.moves)
    numbers = _TEMPORARIES * whole
    numbers += _PER_MOVE * ways_a * n_a
    numbers += _PER_MOVE * ways_b * n_b
    if pair.model.problem.rules.hold_between_steps:
        kept = 2 if pair.bonuses.stationarity else 1
        numbers += kept * kept * whole + kept * float(o_a * (ahead_a + 1)) * float(o_b * n_b)
        pairs = n_a * n_b
        numbers += _PER_PAIR * pairs
        per_way = _PER_VALUE * o_a * o_b + _PER_WAY
        numbers += min(pairs, pair.pairs_at_once()) * ways_b * per_way
    return numbers
