"""The states that are worth a look: some at each step, found as in beam search.

Nearly all states of a robot stay out of question whatever the others do. Of those that the states
kept at one step lead to, those are kept through which the best paths lead. What is ahead of a state
is known exactly, by value iteration with nobody in the way. States restricted to so many a step are
a restricted decision diagram (Bergman, Cire, van Hoeve and Hooker 2016).
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from cocap_opt.coordination.low_level import PlannedTeam
from cocap_opt.data import BoolArray, FloatArray, IntArray
from cocap_opt.graph.move_rewards import Bonuses
from cocap_opt.graph.timegraph import CLOSED, TimeGraph
from cocap_opt.graph.value_iteration import backward_sweep
from cocap_opt.model import Model, RobotClass
from cocap_opt.stop import Stop


class Layer(NamedTuple):
    """The n states kept at one step, and the m edges to them from those of the step before."""

    states: IntArray  # [n] increasing
    before: FloatArray  # [k, n] best rewards of the steps before, of each kind of worth
    tails: IntArray  # [m] positions among the states of the step before, increasing
    heads: IntArray  # [m] positions among `states`; of one tail the calmest edge comes first
    rewards: FloatArray  # [m] of the edges themselves


Worth = tuple[FloatArray, FloatArray]  # [T+1, S] each: rewards of states, and with what is ahead


def worth_of(model: Model, robot_class: RobotClass, reward: FloatArray, stop: Stop) -> Worth:
    """Returns the worth of a class's states with nobody in the way; raises LimitReached.

    Parameters
    ----------
    reward : [T+1, S] of the states
    """
    bonuses, goal = Bonuses.of(model.problem.objective), robot_class.goal
    return reward, backward_sweep(robot_class.graph, reward, bonuses, goal=goal, stop=stop)


def worths_of(model: Model, rewards: Sequence[FloatArray], stop: Stop) -> list[Worth]:
    """Returns the worth of the states of each class; raises LimitReached."""
    both = zip(model.classes, rewards, strict=True)
    return [worth_of(model, robot_class, reward, stop) for robot_class, reward in both]


class Beam:
    """Finds the states that are kept, step by step.

    Parameters
    ----------
    width : states that are kept at a step at most, beside the one on the robot's path in `team`,
        as many by each kind of worth
    worth : of the states of its class, k kinds of it
    known : [T+1, S] states that are kept wherever they are reached
    """

    def __init__(
        self,
        team: PlannedTeam,
        robot: int,
        width: int,
        worth: Sequence[Worth],
        known: BoolArray | None = None,
    ) -> None:
        self._graph, self._width = team.model.class_of[robot].graph, width // len(worth)
        self._worth, self._known, self._path = worth, known, team.path(robot)
        self._starts = team.model.starts(robot)
        self._bonuses = Bonuses.of(team.model.problem.objective)
        lengths = (np.array(self._graph.moves) ** 2).sum(axis=1)
        self._moves, self._turns = np.argsort(lengths, kind="stable"), _turns(self._graph)
        self._position = np.empty(self._graph.n_states, dtype=np.int64)  # of `_numbered` states

    def layers(self) -> Iterator[Layer]:
        """Yields the layers of all steps."""
        layer = self._first()
        yield layer
        for t in range(len(self._path) - 1):
            layer = self._after(t, layer)
            yield layer

    def _first(self) -> Layer:
        """Returns the layer of step 0: the best starts, and that of the robot's path."""
        states, nothing = self._numbered(self._starts), np.zeros(0, dtype=np.int64)
        kept = states == self._path[0]
        if self._known is not None:
            kept |= self._known[0, states]
        for _, value in self._worth:
            kept |= self._kept(0, states, value[0, states])
        before = np.zeros((len(self._worth), np.count_nonzero(kept)))
        return Layer(states[kept], before, nothing, nothing, np.zeros(0))

    def _after(self, t: int, layer: Layer) -> Layer:
        """Returns the layer after that of step t."""
        tails, heads = self._edges(t, layer.states)
        rewards = np.zeros(len(heads))
        if not self._bonuses.none:
            rewards = self._bonuses.of_edges(self._graph.shape, layer.states[tails], heads)
        states = self._numbered(heads)
        to, before = self._position[heads], np.full((len(self._worth), len(states)), CLOSED)
        kept = np.zeros(len(states), dtype=np.bool_)
        if self._known is not None:
            kept |= self._known[t + 1, states]
        for best, so_far, (reward, value) in zip(before, layer.before, self._worth, strict=True):
            gained = so_far + reward[t, layer.states]
            np.maximum.at(best, to, gained[tails] + rewards)
            kept |= self._kept(t + 1, states, best + value[t + 1, states])
        edges, position = kept[to], np.cumsum(kept) - 1
        return Layer(
            states[kept], before[:, kept], tails[edges], position[to[edges]], rewards[edges]
        )

    def _edges(self, t: int, states: IntArray) -> tuple[IntArray, IntArray]:
        """Returns all edges from states at t: positions of the tails, and states at t+1."""
        orientation, place = np.divmod(states, self._graph.n_places)
        places = self._graph.heads_at(t, place)[self._moves].T[:, :, None]  # [n, K, 1]
        turned = self._turns[orientation][:, None, :]  # [n, 1, turns]
        there = (places >= 0) & (turned >= 0)
        return np.nonzero(there)[0], (turned * self._graph.n_places + places)[there]

    def _numbered(self, states: IntArray) -> IntArray:
        """Returns which states there are, increasing, and takes down their positions."""
        numbers = np.arange(len(states))
        self._position[states] = numbers
        found = np.sort(states[self._position[states] == numbers])
        self._position[found] = np.arange(len(found))
        return found

    def _kept(self, t: int, states: IntArray, through: FloatArray) -> BoolArray:
        """Returns those of one kind that are kept at t, by the best path's value through each."""
        kept = through > CLOSED
        if np.count_nonzero(kept) > self._width:
            kept[np.argsort(-through, kind="stable")[self._width :]] = False
            kept[self._position[self._path[t]]] = True
        return kept


def _turns(graph: TimeGraph) -> IntArray:
    """Returns the orientations that one step can turn to [O, n], smallest turn first, then -1."""
    headings, pitches = graph.shape[:2]
    turns = np.full((graph.n_orientations, max(map(len, graph.turns))), -1)
    for tail, heads in enumerate(graph.turns):
        (before, pitch), (after, pitched) = divmod(tail, pitches), np.divmod(heads, pitches)
        turn = np.minimum((after - before) % headings, (before - after) % headings)
        order = np.lexsort([np.abs(pitched - pitch), turn])
        turns[tail, : len(heads)] = np.array(heads)[order]
    return turns


def without_dead_ends(layers: list[Layer]) -> list[Layer]:
    """Returns layers in which all states but the last ones have a way on."""
    result = [layers[-1]]
    for layer in reversed(layers[:-1]):
        after, goes_on = result.pop(), np.zeros(len(layer.states), dtype=np.bool_)
        goes_on[after.tails] = True
        position, edges = np.cumsum(goes_on) - 1, goes_on[layer.heads]
        result.append(after._replace(tails=position[after.tails]))
        states, before = layer.states[goes_on], layer.before[:, goes_on]
        heads = position[layer.heads[edges]]
        result.append(Layer(states, before, layer.tails[edges], heads, layer.rewards[edges]))
    return result[::-1]
