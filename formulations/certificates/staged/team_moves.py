"""The moves of a whole team between the joint states of two steps, forwards and backwards.

From each joint state that is reached, a search finds the joint states of the next step, or of the
step before, that plans above the target may visit. These searches distinguish the robots, since
they also decide which robot goes where. A search uses the bounds of the search for the most
profitable joint state (`search`), and collects all joint states that count. Only the best way to
each joint state is continued, where robots of one class are exchangeable.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple, Self

import numpy as np

from cocap_opt.arithmetic import exact_sum
from cocap_opt.data import BoolArray, FloatArray, IntArray
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
from cocap_opt.stop import Stop

MOST_PLACED = 20_000_000  # states of all robots in the joint states of one step, 8 bytes each
MOST_CHOICES = 10_000  # states of one step over all robots: a table has a row and a column for each
_AT_ONCE = 50_000  # joint states whose pixels are added up at once
# Processing a move that was found takes as long as this many nodes, for a team of so many pairs:
# conflicts on the way are checked pair by pair.
NODES_OF_MOVE, PAIRS = 5, 15
_NODES_AT_ONCE = AT_ONCE  # nodes between two checks of the stopping criterion

# The states to which a robot can move from a state, increasing.
Neighbours = Callable[[int], IntArray]
# The most [n] that robots of a class can collect elsewhere, given their states [n].
Potential = Callable[[int, IntArray], FloatArray]

# Moves of the whole team: numbers [M] of the joint states at which they begin, and positions [M, R]
# of the robots' states at which they end.
Moved = tuple[IntArray, IntArray]


class Choices(NamedTuple):
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
    def of(cls, placed: IntArray, neighbours: Sequence[Neighbours]) -> Self:
        """Returns the choices of a step.

        Parameters
        ----------
        placed : [L, R] numbers of the robots' states in each joint state
        neighbours : for each robot, the states to which it may move from a state
        """
        numbers, heads_of = [], []
        for robot, states_from in enumerate(neighbours):
            tails, number = np.unique(placed[:, robot], return_inverse=True)
            numbers.append(number)
            heads_of.append([*map(states_from, tails.tolist())])
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

    @classmethod
    def of_classes(cls, joint: JointStates, robots: IntArray) -> Self:
        """Returns choices without a previous joint state: any states of the robots' classes.

        Parameters
        ----------
        robots : [R] numbers of the robots, class by class
        """
        every = np.arange(len(joint.states))
        lists = np.zeros((1, 1), dtype=np.int64)
        return cls(robots, [joint.states], np.array([0, len(every)]), every, lists)

    def of_tail(self, tail: int) -> IntArray:
        """Returns the positions of the states to which the robots can move from a joint state."""
        lists = self.lists[tail].tolist()
        return np.concatenate([self.positions[self.first[k] : self.first[k + 1]] for k in lists])


@dataclass
class Following:
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
        self, joint: JointStates, choices: Choices, floors: FloatArray, stop: Stop
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
        self, joint: JointStates, choices: Choices, floors: FloatArray, tail: int, stop: Stop
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


class Reached(NamedTuple):
    """The joint states that are reached at a step, and the best way to each of them."""

    values: FloatArray  # [L] worth of the steps so far
    placed: IntArray  # [L, R] number of each robot's state
    before: IntArray  # [L] number of the joint state of the previous step

    @classmethod
    def empty(cls, robots: int) -> Self:
        """Returns an empty set of joint states for a number of robots."""
        nothing = np.zeros((0, robots), dtype=np.int64)
        return cls(np.zeros(0), nothing, np.zeros(0, dtype=np.int64))


class _Direction(NamedTuple):
    """The direction in which a team moves, and the most that the steps ahead can be worth.

    Attributes
    ----------
    neighbours : for each class, the states to which a robot may move from a state
    potential : returns the most that robots of a class can collect at the steps that are not yet
        explored, for each of their states [n] at the explored step; in units of J
    rest : what the constants and rows of these steps, and best paths, add
    is_forward : False: moves lead to the step before
    """

    neighbours: list[Neighbours]
    potential: Potential
    rest: float
    is_forward: bool = True


class Team:
    """The robots, distinguished from each other, with their remaining states.

    Attributes
    ----------
    numbers : [R] class of each robot
    matters : J that a path has to exceed to be followed, including rounding
    """

    def __init__(self, narrowing: Narrowing) -> None:
        model = narrowing.model
        self._narrowing, self._model = narrowing, model
        class_of = {robot: n for n, robots in enumerate(model.classes) for robot in robots.robots}
        self.numbers = np.array([class_of[robot] for robot in range(len(class_of))])
        self.matters = narrowing.target - 2 * narrowing.rounding

    # -- from step to step --------------------------------------------------------------------

    def after(self, t: int, before: Reached, following: Following, stop: Stop) -> Reached:
        """Returns the joint states reached at a step from those of the step before, best first.

        Raises
        ------
        NotEndedError
            If too many joint states are reached, or the searches use too many nodes.
        LimitReached
            If a limit is reached.
        """
        reached, waiting = Reached.empty(len(self.numbers)), list[Reached]()
        for part in self.moves_after(t, before, following, stop):
            waiting.append(part)
            if n_placed(waiting) > MOST_PLACED:
                reached, waiting = self.best([reached, *waiting]), []
                if n_placed([reached]) > MOST_PLACED:
                    raise NotEndedError
        return self.best([reached, *waiting])

    def moves_after(
        self, t: int, before: Reached, following: Following, stop: Stop
    ) -> Iterator[Reached]:
        """Yields the moves from the joint states of the step before to those of a step, in blocks.

        A joint state is listed as often as a move leads to it. Errors are those of `after`.
        """
        graphs = [robot_class.graph for robot_class in self._model.classes]
        left = [np.flatnonzero(is_left[t]) for is_left in self._narrowing.left]

        def heads(number: int) -> Neighbours:
            return lambda tail: np.intersect1d(
                graphs[number].successors(t - 1, tail), left[number], assume_unique=True
            )

        classes = range(len(graphs))
        direction = _Direction(
            [heads(number) for number in classes], partial(self._future, t), self.rest(t)
        )
        return self._moves(t, before, direction, following, stop)

    def moves_before(
        self, t: int, later: Reached, following: Following, stop: Stop
    ) -> Iterator[Reached]:
        """Yields the moves from joint states of a step to given ones of the next step, in blocks.

        Here `before` holds the number of the joint state to which a move leads. Errors are those of
        `after`.
        """
        classes = range(len(self._model.classes))
        direction = _Direction(
            [self._tails(number, t) for number in classes], partial(self._past, t),
            self._before(t), is_forward=False,
        )  # fmt: skip
        return self._moves(t, later, direction, following, stop)

    def _moves(
        self, t: int, origin: Reached, direction: _Direction, following: Following, stop: Stop
    ) -> Iterator[Reached]:
        """Yields the moves to the joint states of a step from those of the step next to it."""
        if not len(origin.values):
            return
        numbers = self.numbers.tolist()
        choices = Choices.of(origin.placed, [direction.neighbours[number] for number in numbers])
        if sum(map(len, choices.states)) > MOST_CHOICES:
            raise NotEndedError
        numbers = self.numbers[choices.robots].tolist()
        joint = self._apart(numbers, t, choices.states, direction.potential)
        floors = self.matters - direction.rest - origin.values
        for rows, heads in following.found(joint, choices, floors, stop):
            placed = np.empty_like(heads)
            placed[:, choices.robots] = joint.states[heads]
            ends = [origin.placed[rows], placed]
            able = ~self._conflicts(*(ends if direction.is_forward else ends[::-1]))
            rows, heads, placed = rows[able], heads[able], placed[able]
            yield Reached(origin.values[rows] + worths(joint, heads), placed, rows)

    def _tails(self, number: int, t: int) -> Neighbours:
        """Returns the states of a step from which a robot of a class can move to a state of the
        next step.
        """
        graph, left = self._model.classes[number].graph, self._narrowing.left[number]
        tails: dict[int, list[int]] = {}
        for tail in np.flatnonzero(left[t]).tolist():
            for head in graph.successors(t, tail).tolist():
                tails.setdefault(head, []).append(tail)
        return lambda head: np.array(tails.get(head, []), dtype=np.int64)

    # -- the joint states of a step -----------------------------------------------------------

    def chosen(
        self, t: int, states: Sequence[IntArray], following: Following, stop: Stop
    ) -> list[Reached]:
        """Returns the joint states of a step that are worth enough, regardless of how they are
        reached; errors are those of `after`.

        Parameters
        ----------
        states : [R] the possible states of each robot
        """
        choices = Choices.of_lists(states)
        if sum(map(len, choices.states)) > MOST_CHOICES:
            raise NotEndedError
        numbers = self.numbers[choices.robots].tolist()
        joint = self.apart(numbers, t, choices.states)
        floors = np.array([self.matters - self.rest(t)])
        return self._collected(joint, choices, floors, following, stop)

    def counting(self, t: int, following: Following, stop: Stop) -> tuple[Reached, FloatArray]:
        """Returns the joint states of a step that count, and the worth of each.

        The value of each is the most that it, and any way to it, can be worth. Robots of one class
        are exchangeable, so each joint state is listed once. Errors are those of `after`.
        """
        joint = self._narrowing.counting(t)
        if len(joint.states) > MOST_CHOICES:
            raise NotEndedError
        robots = np.concatenate([robot_class.robots for robot_class in self._model.classes])
        choices = Choices.of_classes(joint, robots)
        found = self._collected(joint, choices, np.array([joint.floor]), following, stop)
        reached = Reached(*(np.concatenate(column) for column in zip(*found, strict=True)))
        worth = reached.values
        values = worth + self._before(t)
        for robot, number in enumerate(self.numbers.tolist()):
            values += self._past(t, number, reached.placed[:, robot])
        return reached._replace(values=values), worth

    def _collected(
        self, joint: JointStates, choices: Choices, floors: FloatArray, following: Following,
        stop: Stop,
    ) -> list[Reached]:  # fmt: skip
        """Returns the joint states that reach the floor, each with its worth."""
        found = [Reached.empty(len(self.numbers))]
        for rows, heads in following.found(joint, choices, floors, stop):
            placed = np.empty_like(heads)
            placed[:, choices.robots] = joint.states[heads]
            found.append(Reached(worths(joint, heads), placed, rows))
            if n_placed(found) > MOST_PLACED:
                raise NotEndedError
        return found

    def apart(self, numbers: Sequence[int], t: int, states: Sequence[IntArray]) -> JointStates:
        """Returns the joint states of distinguished robots; their charges are what the robots can
        collect later, negated.

        Thus the worth less the charges is the most that this step and the later prices can bring,
        and the current prices limit it.

        Parameters
        ----------
        numbers : class of each robot
        states : for each robot, some of its remaining states at the step
        """
        return self._apart(numbers, t, states, partial(self._future, t))

    def _apart(
        self, numbers: Sequence[int], t: int, states: Sequence[IntArray], potential: Potential
    ) -> JointStates:
        """Returns the joint states of distinguished robots, with potentials as negative charges."""
        charge = [-potential(number, at) for number, at in zip(numbers, states, strict=True)]
        raised = [
            charges - self._narrowing.rewards[number][t, at]
            for number, at, charges in zip(numbers, states, charge, strict=True)
        ]
        limit = self._narrowing.ceiling_of(self._narrowing.ceiling(t), np.concatenate(raised))
        return JointStates.of(
            self._model, t, states, charge, charge, -np.inf, limits=(limit,), apart=numbers
        )

    # -- what is known of other steps ---------------------------------------------------------

    def rest(self, t: int) -> float:
        """Returns the J that later constants and rows add to the worth so far and `_future`.

        A plan above the target that has collected F up to step t is worth at most the sum of F,
        this amount, and the most that all robots can collect from their states at t on.
        """
        # At the step itself, rows charge at most their multipliers, which this sum contains.
        return float(self._narrowing.constants[t + 1 :].sum()) + self._rows(t)

    def _before(self, t: int) -> float:
        """Returns the J that earlier constants and rows, and best paths, add to the worth of the
        steps from t on and `_past`.
        """
        narrowing = self._narrowing
        return narrowing.bound - float(narrowing.constants[t:].sum()) - self._rows(t)

    def _rows(self, t: int) -> float:
        """Returns the sum of the multipliers of the rows of a step and of later ones."""
        rows = self._narrowing.row_multipliers
        return exact_sum(multiplier for step, multiplier in rows if step >= t)

    def _future(self, t: int, number: int, states: IntArray) -> FloatArray:
        """Returns the most [n] that robots of a class can collect after a step, in units of J.

        Parameters
        ----------
        states : [n] their states at step t
        """
        to_go, rewards = self._narrowing.to_go[number], self._narrowing.rewards[number]
        future: FloatArray = to_go[t, states] - rewards[t, states]
        return future

    def _past(self, t: int, number: int, states: IntArray) -> FloatArray:
        """Returns the most [n] that robots of a class can collect before a step, less the value of
        a best path; parameters are those of `_future`.
        """
        # The best path through a state is worth its slack less than the best path.
        slack, to_go = self._narrowing.slack[number], self._narrowing.to_go[number]
        past: FloatArray = -slack[t, states] - to_go[t, states]
        return past

    # -- many moves together ---------------------------------------------------------------------

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
                for number in self.numbers.tolist()
            )
        ]
        for robot, moves in enumerate(ends):
            for other in ends[:robot]:
                found |= rules.conflict_between(moves, other)
        return found

    def best(self, parts: Iterable[Reached]) -> Reached:
        """Returns the best way to each joint state, best first."""
        return self.merged(parts)[0]

    def merged(self, parts: Iterable[Reached]) -> tuple[Reached, IntArray]:
        """Returns the best way to each joint state, best first, and its number for each of the
        given ways, in their order.
        """
        values, placed, before = (np.concatenate(column) for column in zip(*parts, strict=True))
        same = sorting_keys(self.in_order(placed))
        order = np.lexsort((*sorting_keys(placed), before, -values, *same))
        is_first = np.zeros(len(order), dtype=np.bool_)
        is_first[:1] = True
        for key in same:
            is_first[1:] |= np.diff(key[order]) != 0
        kept = order[is_first]
        best_first = np.argsort(-values[kept], kind="stable")
        number, rank = np.empty(len(order), dtype=np.int64), np.empty_like(best_first)
        rank[best_first] = np.arange(len(kept))
        number[order] = rank[np.cumsum(is_first) - 1]
        kept = kept[best_first]
        return Reached(values[kept], placed[kept], before[kept]), number

    def in_order(self, placed: IntArray) -> IntArray:
        """Returns joint states [L, R] with the states of exchangeable robots in order."""
        same = placed.copy()
        for number in range(len(self._model.classes)):
            alike = self.numbers == number
            same[:, alike] = np.sort(placed[:, alike], axis=1)
        return same


def sorting_keys(columns: IntArray) -> list[IntArray]:
    """Returns keys for `np.lexsort` that order rows [L, n] of numbers >= 0, the last column first.

    Several columns form one key, as far as 64 bits suffice: sorting then takes much less time.
    """
    keys, most = list[IntArray](), 1
    for column in columns.T[::-1]:
        base = int(column.max(initial=0)) + 1
        if keys and most * base < 2**63:
            keys[0] = keys[0] * base + column
            most *= base
        else:
            keys.insert(0, column)
            most = base
    return keys


def n_placed(parts: Iterable[Reached]) -> int:
    """Returns the number of states of all robots in some joint states."""
    return sum(part.placed.size for part in parts)


def worths(joint: JointStates, chosen: IntArray) -> FloatArray:
    """Returns the worths of joint states [K, R], computed in blocks."""
    parts = range(0, len(chosen), _AT_ONCE)
    return np.concatenate([*(joint.worths(chosen[k : k + _AT_ONCE]) for k in parts), []])
