"""Selects promising states: some at each step, as in beam search.

Nearly all states of a robot are irrelevant whatever the others do. Of the states that can be
reached from those kept at one step, the ones on the best paths are kept. The value-to-go of a state
is known exactly, by value iteration with nobody in the way. A graph with a limited number of states
per step is a restricted decision diagram (Bergman, Cire, van Hoeve and Hooker 2016).
"""

from collections.abc import Sequence

import numpy as np

from cocap_opt.coordination.kept_graph import Layer
from cocap_opt.coordination.low_level import PlannedTeam
from cocap_opt.data import BoolArray, FloatArray, IntArray
from cocap_opt.graph.move_rewards import Bonuses
from cocap_opt.graph.timegraph import CLOSED, TimeGraph
from cocap_opt.graph.value_iteration import backward_sweep
from cocap_opt.model import Model, RobotClass
from cocap_opt.stop import Stop

# [T+1, S] each: rewards of states, and rewards including the value-to-go
Worth = tuple[FloatArray, FloatArray]


def worth_of(model: Model, robot_class: RobotClass, reward: FloatArray, stop: Stop) -> Worth:
    """Returns the worth of a class's states if nobody is in the way; raises LimitReached.

    Parameters
    ----------
    reward : [T+1, S] rewards of the states
    """
    bonuses, goal = Bonuses.of(model.problem.objective), robot_class.goal
    return reward, backward_sweep(robot_class.graph, reward, bonuses, goal=goal, stop=stop)


def worths_of(model: Model, rewards: Sequence[FloatArray], stop: Stop) -> list[Worth]:
    """Returns the worth of the states of each class; raises LimitReached."""
    both = zip(model.classes, rewards, strict=True)
    return [worth_of(model, robot_class, reward, stop) for robot_class, reward in both]


class Beam:
    """Selects the states to keep, step by step.

    Parameters
    ----------
    width : largest number of states kept at a step, in addition to the one on the robot's path in
        `team`; an equal number by each kind of worth
    worth : k kinds of worth of the states of the robot's class
    known : [T+1, S] True for states that are always kept if they are reached
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
        # position of each state that `_numbered` has found
        self._position = np.empty(self._graph.n_states, dtype=np.int64)

    def layers(self) -> list[Layer]:
        """Returns the states kept at all steps [T+1], without dead ends.

        For each tail, the calmest edge is the first.
        """
        layer, before = self._first()
        layers = [layer]
        for t in range(len(self._path) - 1):
            layer, before = self._after(t, layer, before)
            layers.append(layer)
        return _without_dead_ends(layers)

    def _first(self) -> tuple[Layer, FloatArray]:
        """Returns the layer of step 0, the best starts and the start of the robot's path, and the
        best rewards of the steps before it, which are 0.
        """
        states, nothing = self._numbered(self._starts), np.zeros(0, dtype=np.int64)
        kept = states == self._path[0]
        if self._known is not None:
            kept |= self._known[0, states]
        for _, value in self._worth:
            kept |= self._kept(0, states, value[0, states])
        before = np.zeros((len(self._worth), np.count_nonzero(kept)))
        return Layer(states[kept], nothing, nothing, np.zeros(0)), before

    def _after(self, t: int, layer: Layer, so_far: FloatArray) -> tuple[Layer, FloatArray]:
        """Returns the layer that follows the layer of step t, and its states' best rewards before.

        Parameters
        ----------
        so_far : [k, n] best rewards of the steps before t, for each kind of worth
        """
        tails, heads = self._edges(t, layer.states)
        rewards = np.zeros(len(heads))
        if not self._bonuses.none:
            rewards = self._bonuses.of_edges(self._graph.shape, layer.states[tails], heads)
        states = self._numbered(heads)
        to, before = self._position[heads], np.full((len(self._worth), len(states)), CLOSED)
        kept = np.zeros(len(states), dtype=np.bool_)
        if self._known is not None:
            kept |= self._known[t + 1, states]
        for best, sooner, (reward, value) in zip(before, so_far, self._worth, strict=True):
            gained = sooner + reward[t, layer.states]
            np.maximum.at(best, to, gained[tails] + rewards)
            kept |= self._kept(t + 1, states, best + value[t + 1, states])
        edges, position = kept[to], np.cumsum(kept) - 1
        edges_kept = tails[edges], position[to[edges]], rewards[edges]
        return Layer(states[kept], *edges_kept), before[:, kept]

    def _edges(self, t: int, states: IntArray) -> tuple[IntArray, IntArray]:
        """Returns all edges from states at t: positions of their tails, and states at t+1."""
        orientation, place = np.divmod(states, self._graph.n_places)
        places = self._graph.heads_at(t, place)[self._moves].T[:, :, None]  # [n, K, 1]
        turned = self._turns[orientation][:, None, :]  # [n, 1, turns]
        there = (places >= 0) & (turned >= 0)
        return np.nonzero(there)[0], (turned * self._graph.n_places + places)[there]

    def _numbered(self, states: IntArray) -> IntArray:
        """Returns the distinct states, increasing, and stores their positions."""
        numbers = np.arange(len(states))
        self._position[states] = numbers
        found = np.sort(states[self._position[states] == numbers])
        self._position[found] = np.arange(len(found))
        return found

    def _kept(self, t: int, states: IntArray, through: FloatArray) -> BoolArray:
        """Returns the states kept at t by one kind of worth: those with the best paths through
        them.
        """
        kept = through > CLOSED
        if np.count_nonzero(kept) > self._width:
            kept[np.argsort(-through, kind="stable")[self._width :]] = False
            kept[self._position[self._path[t]]] = True
        return kept


def _turns(graph: TimeGraph) -> IntArray:
    """Returns the orientations to which one step can turn [O, n], smallest turn first, padded with
    -1.
    """
    headings, pitches = graph.shape[:2]
    turns = np.full((graph.n_orientations, max(map(len, graph.turns))), -1)
    for tail, heads in enumerate(graph.turns):
        (before, pitch), (after, pitched) = divmod(tail, pitches), np.divmod(heads, pitches)
        turn = np.minimum((after - before) % headings, (before - after) % headings)
        order = np.lexsort([np.abs(pitched - pitch), turn])
        turns[tail, : len(heads)] = np.array(heads)[order]
    return turns


def _without_dead_ends(layers: list[Layer]) -> list[Layer]:
    """Returns layers in which every state before the last step has a successor."""
    result = [layers[-1]]
    for layer in reversed(layers[:-1]):
        after, goes_on = result.pop(), np.zeros(len(layer.states), dtype=np.bool_)
        goes_on[after.tails] = True
        position, edges = np.cumsum(goes_on) - 1, goes_on[layer.heads]
        result.append(after._replace(tails=position[after.tails]))
        heads = position[layer.heads[edges]]
        result.append(Layer(layer.states[goes_on], layer.tails[edges], heads, layer.rewards[edges]))
    return result[::-1]
