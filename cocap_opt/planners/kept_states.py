"""The states of one robot that are worth most at each step, for search near a plan.

They are found step by step from the start, as in beam search: of the states that those kept at
one step lead to, those are kept through which the best paths lead. Half of them are the best if
all others keep their paths, half if the robot were alone: others will change theirs. What is ahead
of a state is known exactly, by value iteration with nobody in the way.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from cocap_opt.data import BoolArray, FloatArray, IntArray
from cocap_opt.graph.move_rewards import Bonuses
from cocap_opt.graph.timegraph import CLOSED, TimeGraph
from cocap_opt.graph.value_iteration import backward_sweep
from cocap_opt.model import Model, RobotClass
from cocap_opt.objective import marginal_reward
from cocap_opt.planners.low_level import PlannedTeam
from cocap_opt.stop import Stop


class Layer(NamedTuple):
    """The n states kept at one step, and the m edges to them from those of the step before."""

    states: IntArray  # [n] increasing
    before: FloatArray  # [2, n] best rewards of the steps before, beside the others and alone
    tails: IntArray  # [m] positions among the states of the step before, increasing
    heads: IntArray  # [m] positions among `states`; of one tail the calmest edge comes first
    rewards: FloatArray  # [m] of the edges themselves


class Worth(NamedTuple):
    """Rewards and values of all states of a robot, given what others see."""

    reward: FloatArray  # [T+1, S] of being there
    value: FloatArray  # [T+1, S] and of the best way on, with nobody in it

    @classmethod
    def of(cls, model: Model, robot_class: RobotClass, pixels: FloatArray, stop: Stop) -> "Worth":
        """Returns what the states of a class are worth.

        Parameters
        ----------
        pixels : [Z] px/m2 that others have in every view sum

        Raises
        ------
        LimitReached
            If a limit is reached before.
        """
        bonuses = Bonuses.of(model.problem.objective)
        reward = marginal_reward(model, robot_class, pixels)
        goal = robot_class.goal
        value = backward_sweep(robot_class.graph, reward, bonuses, goal=goal, stop=stop)
        return cls(reward, value)


def kept_layers(team: PlannedTeam, robot: int, width: int, alone: Worth, stop: Stop) -> list[Layer]:
    """Returns the states that are kept at the steps 0..T; all but the last ones have a way on.

    Parameters
    ----------
    team : whole; what the others see in it is what states are worth by
    width : states that are kept at a step at most, beside the one on the robot's own path
    alone : what the states of its class are worth if nobody sees anything

    Raises
    ------
    LimitReached
        If a limit is reached before the states are there.
    """
    robot_class = team.model.class_of[robot]
    beside = Worth.of(team.model, robot_class, team.pixels(without=robot), stop)
    return _without_dead_ends(list(_Beam(team, robot, width, (beside, alone)).layers()))


class _Beam:
    """Finds the states that are kept, step by step."""

    def __init__(
        self, team: PlannedTeam, robot: int, width: int, worth: tuple[Worth, Worth]
    ) -> None:
        self._graph, self._width, self._worth = team.model.class_of[robot].graph, width, worth
        self._own = team.path(robot)
        self._bonuses = Bonuses.of(team.model.problem.objective)
        lengths = (np.array(self._graph.moves) ** 2).sum(axis=1)
        self._moves, self._turns = np.argsort(lengths, kind="stable"), _turns(self._graph)
        self._position = np.empty(self._graph.n_states, dtype=np.int64)  # of `_numbered` states

    def layers(self) -> Iterator[Layer]:
        """Yields the layers of all steps."""
        nothing = np.zeros(0, dtype=np.int64)
        layer = Layer(np.array(self._own[:1]), np.zeros((2, 1)), nothing, nothing, np.zeros(0))
        yield layer
        for t in range(len(self._own) - 1):
            layer = self._after(t, layer)
            yield layer

    def _after(self, t: int, layer: Layer) -> Layer:
        """Returns the layer after that of step t."""
        tails, heads = self._edges(t, layer.states)
        rewards = np.zeros(len(heads))
        if not self._bonuses.none:
            rewards = self._bonuses.of_edges(self._graph.shape, layer.states[tails], heads)
        states = self._numbered(heads)
        to, before = self._position[heads], np.full((2, len(states)), CLOSED)
        kept = np.zeros(len(states), dtype=np.bool_)
        for best, so_far, worth in zip(before, layer.before, self._worth, strict=True):
            gained = so_far + worth.reward[t, layer.states]
            np.maximum.at(best, to, gained[tails] + rewards)
            kept |= self._kept(t + 1, states, best + worth.value[t + 1, states])
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
        """Returns half of those that are kept at t, by the value of the best path through each."""
        kept = through > CLOSED
        if np.count_nonzero(kept) > self._width // 2:
            kept[np.argsort(-through, kind="stable")[self._width // 2 :]] = False
            kept[self._position[self._own[t]]] = True
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


def _without_dead_ends(layers: list[Layer]) -> list[Layer]:
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
