"""The joint states to which robots can move in one step: a search from each of many before.

Robots are apart here: which of them goes where is part of what is searched. A search has the
bounds of that for the highest joint state (`joint_states`), and takes all that count.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from cocap_opt.data import FloatArray, IntArray
from cocap_opt.formulations.certificates.staged import compiled_search
from cocap_opt.formulations.certificates.staged.joint_states import (
    AT_ONCE,
    MOST_FOUND,
    PLAIN_NODES,
    JointStates,
    NotEndedError,
)
from cocap_opt.graph.timegraph import TimeGraph
from cocap_opt.stop import Stop

# As many nodes take as long as what is done with a move that is found, of a team of so many pairs:
# conflicts on the way are looked for pair by pair.
NODES_OF_MOVE, PAIRS = 5, 15
_NODES_AT_ONCE = AT_ONCE  # between two looks at the stop, likewise


class Found(NamedTuple):
    """Moves of the whole team."""

    tails: IntArray  # [M] numbers of the joint states where they begin
    heads: IntArray  # [M, R] positions of the robots' states where they end


class Choices(NamedTuple):
    """The states to which each robot can move from each joint state.

    Attributes
    ----------
    robots : [R] in the order in which they are searched, first those with the fewest choices, which
        takes half of the nodes (field, seed 1). All that follows is in this order
    states : of each robot, the numbers of all states to which it can move, increasing
    first : [K+1] first entry in `positions` of each list of states
    positions : of the states of all lists, among those of all robots
    lists : [L, R] number of each robot's list
    """

    robots: IntArray
    states: list[IntArray]
    first: IntArray
    positions: IntArray
    lists: IntArray

    @classmethod
    def of(
        cls, graphs: Sequence[TimeGraph], t: int, placed: IntArray, left: Sequence[IntArray]
    ) -> "Choices":
        """Returns the choices of a step.

        Parameters
        ----------
        graphs : of each robot
        placed : [L, R] numbers of the robots' states at step t
        left : of each robot, the numbers of the states to which it may move, increasing
        """
        numbers, heads_of = [], []
        for robot, (graph, allowed) in enumerate(zip(graphs, left, strict=True)):
            tails, number = np.unique(placed[:, robot], return_inverse=True)
            numbers.append(number)
            heads_of.append([
                np.intersect1d(graph.successors(t, tail), allowed, assume_unique=True)
                for tail in tails.tolist()
            ])  # fmt: skip
        sizes = [np.array([len(some) for some in heads]) for heads in heads_of]
        means = [own[number].mean() for own, number in zip(sizes, numbers, strict=True)]
        robots = np.argsort(means, kind="stable")
        states, positions, n_lists, n_states = [], [], 0, 0
        lists = np.empty(placed.shape, dtype=np.int64)
        for k, robot in enumerate(robots.tolist()):
            heads = heads_of[robot]
            every = np.unique(np.concatenate(heads))
            positions += [n_states + np.searchsorted(every, some) for some in heads]
            states.append(every)
            lists[:, k] = n_lists + numbers[robot]
            n_lists, n_states = n_lists + len(heads), n_states + len(every)
        first = np.cumsum(np.concatenate([[0], *(sizes[robot] for robot in robots.tolist())]))
        return cls(robots, states, first, np.concatenate(positions), lists)

    def of_tail(self, tail: int) -> IntArray:
        """Returns the positions of the states to which robots can move from a joint state."""
        lists = self.lists[tail].tolist()
        return np.concatenate([self.positions[self.first[k] : self.first[k + 1]] for k in lists])


@dataclass
class Following:
    """Searches for moves of the whole team.

    A search from one joint state is plain; once they have been long, all are compiled where they
    can be. Both find all moves to joint states that reach their floor, and in doubt by rounding
    some more (`JointStates.margin`).

    Attributes
    ----------
    nodes_left : that the searches may still take; a move that is found counts as some
    """

    nodes_left: int
    _times: int = 1  # times PAIRS, how many pairs of robots there are; at least 1
    _plain_nodes: int = 0  # that plain searches took

    def found(
        self, joint: JointStates, choices: Choices, floors: FloatArray, stop: Stop
    ) -> Iterator[Found]:
        """Yields the moves of all joint states of a step, some at a time.

        Parameters
        ----------
        joint : the states of the next step, robot by robot as in the choices
        floors : [L] of each joint state before: least worth, less charges, of one that follows

        Raises
        ------
        NotEndedError
            If the searches take more nodes than are left, or one finds too much.
        LimitReached
            At a limit.
        """
        self._times = max(math.comb(len(choices.robots), 2) // PAIRS, 1)
        tail = 0
        while tail < len(floors) and not compiled_search.is_loaded():
            at = choices.of_tail(tail)
            collected = self._plain(joint.part(at, float(floors[tail])), stop)
            if collected is None:
                break
            if collected:
                yield Found(np.full(len(collected), tail), at[np.array(collected)])
            tail += 1
        if tail < len(floors):
            yield from self._compiled(joint, choices, floors, tail, stop)

    def _plain(self, joint: JointStates, stop: Stop) -> list[tuple[int, ...]] | None:
        """Returns what a plain search collects; None if it is to be compiled."""
        stop.check()
        may_compile = compiled_search.may_take_over(stop)
        most = max(PLAIN_NODES - self._plain_nodes, 0) if may_compile else self.nodes_left
        try:
            collected = joint.all_that_count(min(most, self.nodes_left), stop)
        except NotEndedError:
            if may_compile:
                return None
            raise
        self._spend(collected.nodes, len(collected.found))
        self._plain_nodes += collected.nodes
        return collected.found

    def _spend(self, nodes: int, moves: int) -> None:
        """Takes down what a search took; raises NotEndedError if that was too much."""
        self.nodes_left -= nodes + NODES_OF_MOVE * self._times * moves
        if self.nodes_left < 0:
            raise NotEndedError

    def _compiled(
        self, joint: JointStates, choices: Choices, floors: FloatArray, tail: int, stop: Stop
    ) -> Iterator[Found]:
        """Yields what compiled searches find, from one of the joint states on."""
        running = joint.running(-np.inf, _NODES_AT_ONCE)
        lists = (choices.first, choices.positions, choices.lists)
        least = floors - joint.margin
        n_found = 0  # from the joint state whose search was interrupted
        while tail < len(floors):
            stop.check()
            begun = tail
            # One more: whether a node is the last one may only be seen after it.
            nodes = min(self.nodes_left + 1, max(_NODES_AT_ONCE // self._times, 1))
            tail, tails, heads = running.follow(lists, least, (begun, len(floors)), nodes)
            n_found += int(np.count_nonzero(tails == begun))
            if n_found > MOST_FOUND:
                raise NotEndedError
            self._spend(running.nodes, len(tails))
            if tail > begun:
                n_found = int(np.count_nonzero(tails == tail))
            if len(tails):
                yield Found(tails, heads)
