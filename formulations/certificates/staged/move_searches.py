"""Searches for the moves of a whole team from the joint states of a step.

These searches distinguish the robots, since they also decide which robot goes where. They use the
bounds of the search for the most profitable joint state (`search`), but collect all joint states
that count.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np

from cocap_opt.data import FloatArray, IntArray
from cocap_opt.formulations.certificates.staged.compiled_search import KERNEL
from cocap_opt.formulations.certificates.staged.joint_states import JointStates
from cocap_opt.formulations.certificates.staged.search import (
    AT_ONCE,
    MOST_FOUND,
    PLAIN_NODES,
    NotEndedError,
    all_that_count,
)
from cocap_opt.stop import Stop

# Processing a move that was found takes as long as this many nodes, for a team of so many pairs:
# conflicts on the way are checked pair by pair.
NODES_OF_MOVE, PAIRS = 5, 15
_NODES_AT_ONCE = AT_ONCE  # nodes between two checks of the stopping criterion

# The states to which a robot can move from a state, increasing.
Neighbours = Callable[[int], IntArray]

# Moves of the whole team: numbers [M] of the joint states at which they begin, and positions [M, R]
# of the robots' states at which they end.
TeamMoves = tuple[IntArray, IntArray]


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
        joint : the states of all classes, class by class
        robots : [R] numbers of the robots, class by class
        """
        every = np.arange(len(joint.states))
        lists = np.zeros((1, 1), dtype=np.int64)
        return cls(robots, [joint.states], np.array([0, len(every)]), every, lists)

    def of_tail(self, tail: int) -> IntArray:
        """Returns the positions of the states to which the robots can move from a joint state."""
        lists = self.lists[tail].tolist()
        return np.concatenate([self.positions[self.first[k] : self.first[k + 1]] for k in lists])


def nodes_of_move(n_robots: int) -> int:
    """Returns the number of nodes that a move of a team counts as once it is found."""
    return NODES_OF_MOVE * max(math.comb(n_robots, 2) // PAIRS, 1)


@dataclass
class MoveSearches:
    """Searches for the moves of the whole team.

    The first searches are plain; once they have taken `PLAIN_NODES` nodes together, all further
    ones are compiled, if that is possible and allowed. Both kinds find all moves to joint states
    that exceed their floor, and some more if rounding leaves a doubt (`JointStates.margin`).

    Attributes
    ----------
    nodes_left : remaining number of nodes; a move that is found counts as several nodes
    plain : True: use the plain search only
    """

    nodes_left: int
    plain: bool = False
    _move_nodes: int = NODES_OF_MOVE
    _plain_nodes: int = 0  # number of nodes of plain searches

    def found(
        self, joint: JointStates, choices: Choices, floors: FloatArray, stop: Stop
    ) -> Iterator[TeamMoves]:
        """Yields the moves from all joint states of a step, in blocks.

        Parameters
        ----------
        joint : the states to which robots move, with the robots in the order of the choices; their
            prices are their charges, and there are no ceilings
        floors : [L] for each joint state from which they move: least worth less charges of one to
            which they move; they may be raised between two blocks

        Raises
        ------
        NotEndedError
            If the searches use more than the remaining nodes, or one finds too many moves.
        LimitReached
            If a limit is reached.
        """
        self._move_nodes = nodes_of_move(len(choices.robots))
        tail = 0
        while tail < len(floors) and (self.plain or not KERNEL.is_loaded):
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
        may_compile = not self.plain and KERNEL.may_take_over(stop)
        most = max(PLAIN_NODES - self._plain_nodes, 0) if may_compile else self.nodes_left
        try:
            collected, nodes = all_that_count(joint, min(most, self.nodes_left), stop)
        except NotEndedError:
            if not may_compile:
                raise
            return None if KERNEL.takes_over(stop) else self._plain(joint, stop)
        self._spend_on_search(nodes, len(collected))
        self._plain_nodes += nodes
        return collected

    def _spend_on_search(self, nodes: int, moves: int) -> None:
        """Subtracts the nodes and moves of a search; raises NotEndedError if they exceed the
        limit.
        """
        self.spend(nodes + self._move_nodes * moves)

    def spend(self, nodes: int) -> None:
        """Subtracts used nodes; raises NotEndedError if they exceed the limit."""
        self.nodes_left -= nodes
        if self.nodes_left < 0:
            raise NotEndedError

    def _compiled(
        self, joint: JointStates, choices: Choices, floors: FloatArray, tail: int, stop: Stop
    ) -> Iterator[TeamMoves]:
        """Yields the moves that compiled searches find, starting with a given joint state."""
        from cocap_opt.formulations.certificates.staged.search_kernel import CompiledSearch

        running = CompiledSearch.of(joint, -np.inf, _NODES_AT_ONCE)
        lists = (choices.first, choices.positions, choices.lists)
        n_found = 0  # moves found from the joint state whose search was interrupted
        while tail < len(floors):
            stop.check()
            begin = tail
            # One more node, since the search may notice only then that the last one is done.
            nodes = min(
                self.nodes_left + 1, max(_NODES_AT_ONCE * NODES_OF_MOVE // self._move_nodes, 1)
            )
            least = floors - joint.margin
            tail, tails, heads = running.follow(lists, least, (begin, len(floors)), nodes)
            n_found += int(np.count_nonzero(tails == begin))
            if n_found > MOST_FOUND:
                raise NotEndedError
            self._spend_on_search(running.nodes, len(tails))
            if tail > begin:
                n_found = int(np.count_nonzero(tails == tail))
            if len(tails):
                yield tails, heads
