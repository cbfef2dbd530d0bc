"""Finds the best plan among the remaining joint states: value iteration over joint states.

From each joint state that is reached, a search finds the joint states s at the next step t that
plans above the target may visit. The J of a plan is at most

    value before + F(s) + sum_i future_i(s_i) + rest(t),

where `future` is the most that robots can collect later at the prices; s is explored only if this
sum is above the target. The bound less this sum is the total loss of all steps up to t, so the
number of joint states falls quickly, whereas (*) of `narrowing` considers the loss of each step
alone. Only the best way to each joint state is continued, where robots of one class are
exchangeable. If no joint state remains, no plan is above the target.

These searches distinguish the robots, since they also decide which robot goes where. A search uses
the bounds of the search for the most profitable joint state (`search`), and collects all joint
states that count.
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np

from cocap_opt.arithmetic import exact_sum
from cocap_opt.data import BoolArray, FloatArray, IntArray
from cocap_opt.formulations.certificates.pricing import Pricing
from cocap_opt.formulations.certificates.staged import compiled_search
from cocap_opt.formulations.certificates.staged.joint_states import JointStates
from cocap_opt.formulations.certificates.staged.narrowing import Narrowing
from cocap_opt.formulations.certificates.staged.search import (
    AT_ONCE,
    MOST_FOUND,
    PLAIN_NODES,
    NotEndedError,
    all_that_count,
)
from cocap_opt.graph.timegraph import TimeGraph
from cocap_opt.model import Model, Path
from cocap_opt.stop import Stop, never

MOST_REACHED = 1_000_000  # joint states of one step, of some hundred bytes each
MOST_CHOICES = 10_000  # states of one step over all robots: a table has a row and a column for each
_STARTS_AT_ONCE = 1_000  # joint states between two checks of the stopping criterion
_AT_ONCE = 50_000  # joint states whose pixels are added up at once
# Processing a move that was found takes as long as this many nodes, for a team of so many pairs:
# conflicts on the way are checked pair by pair.
NODES_OF_MOVE, PAIRS = 5, 15
_NODES_AT_ONCE = AT_ONCE  # nodes between two checks of the stopping criterion

# Moves of the whole team: numbers [M] of the joint states at which they begin, and positions [M, R]
# of the robots' states at which they end.
Moved = tuple[IntArray, IntArray]


class _Choices(NamedTuple):
    """The states to which each robot can move from each joint state.

    Attributes
    ----------
    robots : [R] in the order of the search, fewest choices first, which halves the number of nodes
        (scene `field`, seed 1). All other fields have the same order
    states : for each robot, the numbers of all states to which it can move, increasing
    first : [K+1] first entry in `positions` of each list of states
    positions : positions of the states of all lists among the states of all robots
    lists : [L, R] number of each robot's list, for each joint state
    """

    robots: IntArray
    states: list[IntArray]
    first: IntArray
    positions: IntArray
    lists: IntArray

    @classmethod
    def of(
        cls, graphs: Sequence[TimeGraph], t: int, placed: IntArray, left: Sequence[IntArray]
    ) -> "_Choices":
        """Returns the choices of a step.

        Parameters
        ----------
        graphs : the graph of each robot
        placed : [L, R] numbers of the robots' states at step t
        left : for each robot, the numbers of the states to which it may move, increasing
        """
        numbers, heads_of = [], []
        for robot, (graph, allowed) in enumerate(zip(graphs, left, strict=True)):
            tails, number = np.unique(placed[:, robot], return_inverse=True)
            numbers.append(number)
            heads_of.append([
                np.intersect1d(graph.successors(t, tail), allowed, assume_unique=True)
                for tail in tails.tolist()
            ])  # fmt: skip
        sizes = [np.array([*map(len, heads)]) for heads in heads_of]
        means = [size[number].mean() for size, number in zip(sizes, numbers, strict=True)]
        robots = np.argsort(means, kind="stable")
        states, positions, n_lists, n_states = [], [], 0, 0
        lists = np.empty(placed.shape, dtype=np.int64)
        for k, robot in enumerate(robots.tolist()):
            heads = heads_of[robot]
            every = np.unique(np.concatenate(heads))
            positions += [n_states + np.searchsorted(every, allowed) for allowed in heads]
            states.append(every)
            lists[:, k] = n_lists + numbers[robot]
            n_lists, n_states = n_lists + len(heads), n_states + len(every)
        first = np.cumsum(np.concatenate([[0], *(sizes[robot] for robot in robots.tolist())]))
        return cls(robots, states, first, np.concatenate(positions), lists)

    @classmethod
    def of_lists(cls, states: Sequence[IntArray]) -> Self:
        """Returns choices without a previous joint state: each robot may take any of its states."""
        robots = np.argsort([*map(len, states)], kind="stable")
        ordered = [states[robot] for robot in robots.tolist()]
        first = np.cumsum([0, *map(len, ordered)])
        return cls(robots, ordered, first, np.arange(first[-1]), np.arange(len(states))[None])

    def of_tail(self, tail: int) -> IntArray:
        """Returns the positions of the states to which the robots can move from a joint state."""
        lists = self.lists[tail].tolist()
        return np.concatenate([self.positions[self.first[k] : self.first[k + 1]] for k in lists])


@dataclass
class _Following:
    """Searches for the moves of the whole team.

    The first searches are plain; once they have taken `PLAIN_NODES` nodes together, all further
    ones are compiled, if that is possible and allowed. Both kinds find all moves to joint states
    that reach their floor, and some more if rounding leaves a doubt (`JointStates.margin`).

    Attributes
    ----------
    nodes_left : remaining number of nodes; a move that is found counts as several nodes
    plain : True: use the plain search only
    """

    nodes_left: int
    plain: bool = False
    _times: int = 1  # number of pairs of robots in multiples of PAIRS; at least 1
    _plain_nodes: int = 0  # number of nodes of plain searches

    def found(
        self, joint: JointStates, choices: _Choices, floors: FloatArray, stop: Stop
    ) -> Iterator[Moved]:
        """Yields the moves from all joint states of a step, in blocks.

        Parameters
        ----------
        joint : the states of the next step, with the robots in the order of the choices
        floors : [L] for each joint state of the step: least worth less charges of a successor

        Raises
        ------
        NotEndedError
            If the searches use more than the remaining nodes, or one finds too many moves.
        LimitReached
            If a limit is reached.
        """
        self._times = max(math.comb(len(choices.robots), 2) // PAIRS, 1)
        tail = 0
        while tail < len(floors) and (self.plain or not compiled_search.is_loaded()):
            at = choices.of_tail(tail)
            collected = self._plain(joint.part(at, float(floors[tail])), stop)
            if collected is None:
                break
            if collected:
                yield np.full(len(collected), tail), at[np.array(collected)]
            tail += 1
        if tail < len(floors):
            yield from self._compiled(joint, choices, floors, tail, stop)

    def _plain(self, joint: JointStates, stop: Stop) -> list[tuple[int, ...]] | None:
        """Returns the joint states that a plain search finds; None if the search should be
        compiled.
        """
        stop.check()
        may_compile = not self.plain and compiled_search.may_take_over(stop)
        most = max(PLAIN_NODES - self._plain_nodes, 0) if may_compile else self.nodes_left
        try:
            collected, nodes = all_that_count(joint, min(most, self.nodes_left), stop)
        except NotEndedError:
            if not may_compile:
                raise
            return None if compiled_search.takes_over(stop) else self._plain(joint, stop)
        self._spend(nodes, len(collected))
        self._plain_nodes += nodes
        return collected

    def _spend(self, nodes: int, moves: int) -> None:
        """Subtracts the nodes and moves of a search; raises NotEndedError if they exceed the
        limit.
        """
        self.spend(nodes + NODES_OF_MOVE * self._times * moves)

    def spend(self, nodes: int) -> None:
        """Subtracts used nodes; raises NotEndedError if they exceed the limit."""
        self.nodes_left -= nodes
        if self.nodes_left < 0:
            raise NotEndedError

    def _compiled(
        self, joint: JointStates, choices: _Choices, floors: FloatArray, tail: int, stop: Stop
    ) -> Iterator[Moved]:
        """Yields the moves that compiled searches find, starting with a given joint state."""
        from cocap_opt.formulations.certificates.staged.search_kernel import CompiledSearch

        running = CompiledSearch.of(joint, -np.inf, _NODES_AT_ONCE)
        lists = (choices.first, choices.positions, choices.lists)
        least = floors - joint.margin
        n_found = 0  # moves found from the joint state whose search was interrupted
        while tail < len(floors):
            stop.check()
            begun = tail
            # One more node, since the search may notice only then that the last one is done.
            nodes = min(self.nodes_left + 1, max(_NODES_AT_ONCE // self._times, 1))
            tail, tails, heads = running.follow(lists, least, (begun, len(floors)), nodes)
            n_found += int(np.count_nonzero(tails == begun))
            if n_found > MOST_FOUND:
                raise NotEndedError
            self._spend(running.nodes, len(tails))
            if tail > begun:
                n_found = int(np.count_nonzero(tails == tail))
            if len(tails):
                yield tails, heads


class BestPlan(NamedTuple):
    """The best plan among the joint states that a narrowing leaves."""

    narrowing: Narrowing
    value: float  # J; -inf if there is no plan
    paths: tuple[Path, ...] = ()  # state numbers, robot by robot
    nodes: int = 0  # number of nodes that the searches took
    # number of joint states at each step, up to the first step without any
    reached: tuple[int, ...] = ()

    @property
    def pricing(self) -> Pricing:
        """The bound on all plans, given that all plans above the target have been explored."""
        return self.narrowing.pricing_of(self.value)


class _Reached(NamedTuple):
    """The joint states that are reached at a step, and the best way to each of them."""

    values: FloatArray  # [L] worth of the steps so far
    placed: IntArray  # [L, R] number of each robot's state
    before: IntArray  # [L] number of the joint state of the previous step

    @classmethod
    def empty(cls, robots: int) -> Self:
        """Returns an empty set of joint states for a number of robots."""
        nothing = np.zeros((0, robots), dtype=np.int64)
        return cls(np.zeros(0), nothing, np.zeros(0, dtype=np.int64))


def best_plan(
    narrowing: Narrowing, most_nodes: int, stop: Stop = never, plain: bool = False
) -> BestPlan:
    """Returns the best plan above the target among the remaining joint states.

    Parameters
    ----------
    most_nodes : largest number of nodes of all searches together
    plain : True: use the plain search only

    Raises
    ------
    NotEndedError
        If there are too many joint states.
    LimitReached
        If a limit is reached.
    ValueError
        If moves are rewarded, or views do not count at step 1.
    """
    if not may_be_used(narrowing.model):
        raise ValueError(
            "joint paths: not possible if moves are rewarded or views do not count at step 1"
        )
    team = _Team(narrowing)
    following = _Following(most_nodes, plain)
    reached = team.begun(following, stop)
    for t in range(len(reached), narrowing.model.problem.horizon + 1):
        if not len(reached[-1].values):
            break
        reached.append(team.after(t, reached[-1], following, stop))
    nodes = most_nodes - following.nodes_left
    numbers = tuple(len(step.values) for step in reached)
    # Rows may charge nobody, so a path that is followed to its end may be worth less than the
    # target.
    if not (reached[-1].values > team.matters).any():
        return BestPlan(narrowing, -np.inf, nodes=nodes, reached=numbers)
    return BestPlan(narrowing, float(reached[-1].values[0]), _paths(reached), nodes, numbers)


def may_be_used(model: Model) -> bool:
    """Returns True if joint states determine J: no move is rewarded, and views count from step
    1.
    """
    objective = model.problem.objective
    rewarded = objective.stationarity or objective.keep_cell or objective.keep_heading
    return not (rewarded or objective.balanced) and model.problem.first_step <= 1


class _Team:
    """The robots, distinguished from each other, with their remaining states."""

    def __init__(self, narrowing: Narrowing) -> None:
        model = narrowing.model
        self._narrowing, self._model = narrowing, model
        class_of = {robot: n for n, robots in enumerate(model.classes) for robot in robots.robots}
        self._numbers = np.array([class_of[robot] for robot in range(len(class_of))])
        # A path whose total worth would not exceed the target need not be followed.
        self.matters = narrowing.target - 2 * narrowing.rounding

    def begun(self, following: _Following, stop: Stop) -> "list[_Reached]":
        """Returns the joint states reached at step 0 and, if starts are free, at step 1.

        Free starts have too many joint states, unless views count there. Therefore the joint states
        of step 1 are found first, and then starts that lead to each of them.

        Raises
        ------
        NotEndedError, LimitReached
            As in `after`.
        """
        problem, numbers = self._model.problem, self._numbers.tolist()
        starts = [
            states[self._narrowing.left[number][0, states]]
            for number, states in zip(numbers, self._starts, strict=True)
        ]
        if not all(map(len, starts)):
            return [_Reached.empty(len(numbers))]
        if not problem.has_free_starts:
            return [self._fixed(starts)]
        if problem.first_step == 0:
            return [self._best(self._chosen(0, starts, following, stop))]
        if sum(map(len, starts)) > MOST_CHOICES:
            raise NotEndedError
        ways = _StartWays(self._model, self._numbers, starts)
        heads = [
            np.flatnonzero(self._narrowing.left[number][1] & ways.reached(robot))
            for robot, number in enumerate(numbers)
        ]
        if not all(map(len, heads)):
            return [_Reached.empty(len(numbers))]
        chosen = self._chosen(1, heads, following, stop)
        found = [ways.with_starts(part, following, stop) for part in chosen]
        placed = np.concatenate([tails for tails, _ in found])
        number = np.cumsum([0, *(len(tails) for tails, _ in found)])[:-1]
        after = self._best(
            part._replace(before=first + np.arange(len(part.values)))
            for first, (_, part) in zip(number.tolist(), found, strict=True)
        )
        nothing = np.zeros(len(placed), dtype=np.int64)
        return [_Reached(np.zeros(len(placed)), placed, nothing), after]

    @property
    def _starts(self) -> list[IntArray]:
        """The possible start states of each robot, whether closed or not [R]."""
        return [self._model.starts(robot) for robot in range(len(self._numbers))]

    def _fixed(self, starts: Sequence[IntArray]) -> "_Reached":
        """Returns the joint state of fixed starts."""
        values = np.zeros(1)
        if self._model.problem.first_step == 0:
            joint = self._apart(self._numbers.tolist(), 0, starts)
            values[0] = joint.worth(range(len(self._numbers)))
        return _Reached(values, np.column_stack(starts), np.zeros(1, dtype=np.int64))

    def _chosen(
        self, t: int, states: Sequence[IntArray], following: _Following, stop: Stop
    ) -> "list[_Reached]":
        """Returns the joint states of a step that are worth enough, regardless of how they are
        reached.

        Parameters
        ----------
        states : [R] the possible states of each robot
        """
        choices = _Choices.of_lists(states)
        if sum(map(len, choices.states)) > MOST_CHOICES:
            raise NotEndedError
        numbers = self._numbers[choices.robots].tolist()
        joint = self._apart(numbers, t, choices.states)
        floors = np.array([self.matters - self._rest(t)])
        found = [_Reached.empty(len(numbers))]
        for tails, heads in following.found(joint, choices, floors, stop):
            placed = np.empty_like(heads)
            placed[:, choices.robots] = joint.states[heads]
            found.append(_Reached(_worths(joint, heads), placed, tails))
            if sum(len(part.values) for part in found) > MOST_REACHED:
                raise NotEndedError
        return found

    def after(self, t: int, before: _Reached, following: _Following, stop: Stop) -> _Reached:
        """Returns the joint states reached at a step from those of the step before, best first.

        Raises
        ------
        NotEndedError
            If too many joint states are reached, or the searches use too many nodes.
        LimitReached
            If a limit is reached.
        """
        left = [np.flatnonzero(is_left[t]) for is_left in self._narrowing.left]
        choices = _Choices.of(
            [self._model.classes[number].graph for number in self._numbers.tolist()],
            t - 1, before.placed, [left[number] for number in self._numbers.tolist()],
        )  # fmt: skip
        if sum(map(len, choices.states)) > MOST_CHOICES:
            raise NotEndedError
        numbers = self._numbers[choices.robots].tolist()
        joint = self._apart(numbers, t, choices.states)
        floors = self.matters - self._rest(t) - before.values
        reached, waiting = _Reached.empty(len(self._numbers)), []
        for tails, heads in following.found(joint, choices, floors, stop):
            waiting.append(self._reached(joint, choices.robots, before, tails, heads))
            if sum(len(part.values) for part in waiting) > MOST_REACHED:
                reached, waiting = self._best([reached, *waiting]), []
                if len(reached.values) > MOST_REACHED:
                    raise NotEndedError
        return self._best([reached, *waiting])

    def _rest(self, t: int) -> float:
        """Returns the J that later constants and rows add to the worth so far and `_future`.

        A plan above the target that has collected F up to step t is worth at most the sum of F,
        this amount, and the most that all robots can collect from their states at t on.
        """
        later = float(self._narrowing.constants[t + 1 :].sum())
        # At the step itself, rows charge at most their multipliers, which this sum contains.
        rows = self._narrowing.row_multipliers
        return later + exact_sum(multiplier for step, multiplier in rows if step >= t)

    def _future(self, number: int, t: int, states: IntArray) -> FloatArray:
        """Returns the most [n] that robots of a class can collect at later steps, in units of J.

        Parameters
        ----------
        states : [n] their states at step t
        """
        to_go, rewards = self._narrowing.to_go[number], self._narrowing.rewards[number]
        future: FloatArray = to_go[t, states] - rewards[t, states]
        return future

    def _apart(self, numbers: Sequence[int], t: int, states: Sequence[IntArray]) -> JointStates:
        """Returns the joint states of distinguished robots; their charges are `_future`, negated.

        Thus the worth less the charges is the most that this step and the later prices can bring,
        and the current prices limit it.

        Parameters
        ----------
        numbers : class of each robot
        states : for each robot, some of its remaining states at the step
        """
        charge = [-self._future(number, t, at) for number, at in zip(numbers, states, strict=True)]
        raised = [
            future - self._narrowing.rewards[number][t, at]
            for number, at, future in zip(numbers, states, charge, strict=True)
        ]
        limit = self._narrowing.ceiling_of(self._narrowing.ceiling(t), np.concatenate(raised))
        return JointStates.of(
            self._model, t, states, charge, charge, -np.inf, limits=(limit,), apart=numbers
        )

    def _reached(
        self, joint: JointStates, robots: IntArray, before: _Reached, tails: IntArray,
        heads: IntArray,
    ) -> _Reached:  # fmt: skip
        """Returns the ends of moves that have no conflict, each with its value."""
        placed = np.empty_like(heads)
        placed[:, robots] = joint.states[heads]
        able = ~self._conflicts(before.placed[tails], placed)
        tails, heads, placed = tails[able], heads[able], placed[able]
        return _Reached(before.values[tails] + _worths(joint, heads), placed, tails)

    def _conflicts(self, tails: IntArray, heads: IntArray) -> BoolArray:
        """Returns an array [M], True for moves of the team that have a conflict between the
        steps.
        """
        rules, model = self._model.problem.rules, self._model
        found = np.zeros(len(tails), dtype=np.bool_)
        if not rules.hold_between_steps:
            return found
        ends = [
            (places[tails[:, robot] % n], places[heads[:, robot] % n])
            for robot, (places, n) in enumerate(
                (model.places.positions[number], model.classes[number].graph.n_places)
                for number in self._numbers.tolist()
            )
        ]
        for robot, moves in enumerate(ends):
            for other in ends[:robot]:
                found |= rules.conflict_between(moves, other)
        return found

    def _best(self, parts: Iterable[_Reached]) -> _Reached:
        """Returns the best way to each joint state, best first."""
        values, placed, before = (np.concatenate(column) for column in zip(*parts, strict=True))
        same = placed.copy()  # sorted below, as exchangeable robots may be permuted
        for number in range(len(self._model.classes)):
            alike = self._numbers == number
            same[:, alike] = np.sort(placed[:, alike], axis=1)
        order = np.lexsort((*placed.T, before, -values, *same.T))
        same = same[order]
        is_first = np.ones(len(order), dtype=np.bool_)
        is_first[1:] = (same[1:] != same[:-1]).any(axis=1)
        kept = order[is_first]
        kept = kept[np.argsort(-values[kept], kind="stable")]
        return _Reached(values[kept], placed[kept], before[kept])


def _worths(joint: JointStates, chosen: IntArray) -> FloatArray:
    """Returns the worths of joint states [K, R], computed in blocks."""
    parts = range(0, len(chosen), _AT_ONCE)
    return np.concatenate([*(joint.worths(chosen[k : k + _AT_ONCE]) for k in parts), []])


class _StartWays:
    """The ways, from step 0 to step 1, of robots that choose their start.

    Parameters
    ----------
    starts : [R] for each robot, its remaining states at step 0
    """

    def __init__(self, model: Model, numbers: IntArray, starts: Sequence[IntArray]) -> None:
        self._rules = model.problem.rules
        classes = [model.classes[number] for number in numbers.tolist()]
        self._graphs = [robot_class.graph for robot_class in classes]
        self._where = [model.places.positions[number] for number in numbers.tolist()]
        # for each robot: its starts by the state at step 1
        self._tails: list[dict[int, list[int]]] = []
        self._able: dict[tuple[int, ...], BoolArray] = {}
        known: dict[tuple[int, bytes], dict[int, list[int]]] = {}
        for number, graph, states in zip(numbers.tolist(), self._graphs, starts, strict=True):
            key = number, states.tobytes()
            if key not in known:
                known[key] = _tails_of(graph, states)
            self._tails.append(known[key])

    def reached(self, robot: int) -> BoolArray:
        """Returns the states [S] of step 1 that a robot can reach."""
        found = np.zeros(self._graphs[robot].n_states, dtype=np.bool_)
        found[list(self._tails[robot])] = True
        return found

    def with_starts(
        self, reached: _Reached, following: _Following, stop: Stop
    ) -> tuple[IntArray, _Reached]:
        """Returns starts for the joint states of step 1 that have any, together with these joint
        states.

        Raises
        ------
        NotEndedError
            If the searches for starts use more than the remaining nodes.
        LimitReached
            If a limit is reached.
        """
        tails = []
        for row, heads in enumerate(reached.placed.tolist()):
            if row % _STARTS_AT_ONCE == 0:
                stop.check()
            tails.append(self._starts_of(heads, following))
        kept = [row for row, found in enumerate(tails) if found]
        placed = np.array([tails[row] for row in kept], dtype=np.int64)
        able = _Reached(reached.values[kept], reached.placed[kept], reached.before[kept])
        return placed.reshape(len(kept), len(self._tails)), able

    def _starts_of(
        self, heads: list[int], following: _Following, chosen: tuple[int, ...] = ()
    ) -> list[int]:
        """Returns starts of all robots that lead to given states at step 1; empty if there are
        none.

        Parameters
        ----------
        chosen : for the first robots, the number of the chosen start among those that lead to the
            state
        """
        following.spend(1)
        robot = len(chosen)
        if robot == len(heads):
            both = zip(self._tails, heads, chosen, strict=True)
            return [tails[head][which] for tails, head, which in both]
        for which in range(len(self._tails[robot][heads[robot]])):
            pairs = enumerate(chosen)
            if all(self._may_start(k, heads[k], robot, heads[robot])[at, which] for k, at in pairs):
                found = self._starts_of(heads, following, (*chosen, which))
                if found:
                    return found
        return []

    def _may_start(self, first: int, head: int, second: int, other_head: int) -> BoolArray:
        """Returns an array [n, m], True if the ways of two robots from their starts keep the
        rules.
        """
        # Robots with the same class and the same choices share a table of tails.
        key = id(self._tails[first]), head, id(self._tails[second]), other_head
        if key not in self._able:
            ways = []
            for robot, end, axis in ((first, head, 1), (second, other_head, 0)):
                n_places, where = self._graphs[robot].n_places, self._where[robot]
                tails = np.array(self._tails[robot][end]) % n_places
                ways.append((np.expand_dims(where[tails], axis), where[end % n_places]))
            self._able[key] = ~self._rules.moves_conflict(*ways)
        return self._able[key]


def _tails_of(graph: TimeGraph, starts: IntArray) -> dict[int, list[int]]:
    """Returns the starts that lead to each state of step 1, one per place."""
    found: dict[int, dict[int, int]] = {}
    for start in starts.tolist():
        for head in graph.successors(0, start).tolist():
            found.setdefault(head, {}).setdefault(start % graph.n_places, start)
    return {head: [*by_place.values()] for head, by_place in found.items()}


def _paths(reached: list[_Reached]) -> tuple[Path, ...]:
    """Returns the paths of all robots along the best way to the best joint state at the end."""
    along, number = [], 0
    for step in reached[::-1]:
        along.append(step.placed[number].tolist())
        number = int(step.before[number])
    return tuple(tuple(path) for path in zip(*along[::-1], strict=True))
