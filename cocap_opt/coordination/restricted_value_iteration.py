"""Value iteration over few states of each robot, for search near a plan.

Nearly all states of a robot stay out of question whatever the others do. With those that are left
and the edges between them in arrays, a best response takes a seventh of the time of one over all
states on a small map, and no longer on a large one. It may miss the best path, which a best
response over all states then finds. States restricted to so many a step are a restricted decision
diagram (Bergman, Cire, van Hoeve and Hooker 2016).

The states are found step by step from the start, as in beam search: of those that the states kept
at one step lead to, those are kept through which the best paths lead. Half of them are the best if
all others keep their paths, half if the robot were alone: others will change theirs. What is ahead
of a state is known exactly, by value iteration with nobody in the way.
"""

from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from cocap_opt.coordination.low_level import PlannedTeam, SingleRobotPath, SingleRobotTask
from cocap_opt.data import BoolArray, FloatArray, IntArray
from cocap_opt.graph.charges import Charges
from cocap_opt.graph.move_rewards import Bonuses
from cocap_opt.graph.timegraph import CLOSED, TimeGraph
from cocap_opt.graph.value_iteration import backward_sweep
from cocap_opt.model import Model, Path, RobotClass
from cocap_opt.objective import marginal_reward
from cocap_opt.stop import Stop


class _Layer(NamedTuple):
    """The n states kept at one step, and the m edges to them from those of the step before."""

    states: IntArray  # [n] increasing
    before: FloatArray  # [2, n] best rewards of the steps before, beside the others and alone
    tails: IntArray  # [m] positions among the states of the step before, increasing
    heads: IntArray  # [m] positions among `states`; of one tail the calmest edge comes first
    rewards: FloatArray  # [m] of the edges themselves


_Worth = tuple[FloatArray, FloatArray]  # [T+1, S] each: rewards of states, and with what is ahead


def _worth(model: Model, robot_class: RobotClass, pixels: FloatArray, stop: Stop) -> _Worth:
    """Returns the worth of a class's states with nobody in the way; raises LimitReached.

    Parameters
    ----------
    pixels : [Z] px/m2 that others have in every view sum
    """
    reward, goal = marginal_reward(model, robot_class, pixels), robot_class.goal
    bonuses = Bonuses.of(model.problem.objective)
    return reward, backward_sweep(robot_class.graph, reward, bonuses, goal=goal, stop=stop)


class _Beam:
    """Finds the states that are kept, step by step.

    Parameters
    ----------
    width : states that are kept at a step at most, beside the one on the robot's path in `team`
    worth : what the states of its class are worth beside the others, and alone
    """

    def __init__(
        self, team: PlannedTeam, robot: int, width: int, worth: tuple[_Worth, _Worth]
    ) -> None:
        self._graph, self._width, self._worth = team.model.class_of[robot].graph, width, worth
        self._path = team.path(robot)
        self._bonuses = Bonuses.of(team.model.problem.objective)
        lengths = (np.array(self._graph.moves) ** 2).sum(axis=1)
        self._moves, self._turns = np.argsort(lengths, kind="stable"), _turns(self._graph)
        self._position = np.empty(self._graph.n_states, dtype=np.int64)  # of `_numbered` states

    def layers(self) -> Iterator[_Layer]:
        """Yields the layers of all steps."""
        nothing = np.zeros(0, dtype=np.int64)
        layer = _Layer(np.array(self._path[:1]), np.zeros((2, 1)), nothing, nothing, np.zeros(0))
        yield layer
        for t in range(len(self._path) - 1):
            layer = self._after(t, layer)
            yield layer

    def _after(self, t: int, layer: _Layer) -> _Layer:
        """Returns the layer after that of step t."""
        tails, heads = self._edges(t, layer.states)
        rewards = np.zeros(len(heads))
        if not self._bonuses.none:
            rewards = self._bonuses.of_edges(self._graph.shape, layer.states[tails], heads)
        states = self._numbered(heads)
        to, before = self._position[heads], np.full((2, len(states)), CLOSED)
        kept = np.zeros(len(states), dtype=np.bool_)
        for best, so_far, (reward, value) in zip(before, layer.before, self._worth, strict=True):
            gained = so_far + reward[t, layer.states]
            np.maximum.at(best, to, gained[tails] + rewards)
            kept |= self._kept(t + 1, states, best + value[t + 1, states])
        edges, position = kept[to], np.cumsum(kept) - 1
        return _Layer(
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


def _without_dead_ends(layers: list[_Layer]) -> list[_Layer]:
    """Returns layers in which all states but the last ones have a way on."""
    result = [layers[-1]]
    for layer in reversed(layers[:-1]):
        after, goes_on = result.pop(), np.zeros(len(layer.states), dtype=np.bool_)
        goes_on[after.tails] = True
        position, edges = np.cumsum(goes_on) - 1, goes_on[layer.heads]
        result.append(after._replace(tails=position[after.tails]))
        states, before = layer.states[goes_on], layer.before[:, goes_on]
        heads = position[layer.heads[edges]]
        result.append(_Layer(states, before, layer.tails[edges], heads, layer.rewards[edges]))
    return result[::-1]


# States of a robot that are kept at a step. Measured on passage and bottleneck-tight, seeds 0 to 9:
# J is 0.14 and 0.09 % below the optimum with 80, 0.11 and 0.05 % with 120, and 0.12 and 0.07 % with
# 160 and 42 responses for each robot, which take as long.
_WIDTH = 120


class RestrictedValueIteration:
    """A low level that finds the best path over the states that are worth most to a robot.

    Parameters
    ----------
    team : whole; what states are worth is what they add to what the others see in it
    width : states that are kept at each step at most, beside those of the robot's path in `team`

    Raises
    ------
    LimitReached
        If a limit is reached before the states are there.
    """

    def __init__(self, team: PlannedTeam, stop: Stop, width: int = _WIDTH) -> None:
        model, nothing = team.model, team.model.problem.no_pixels()
        alone = [_worth(model, robot_class, nothing, stop) for robot_class in model.classes]
        self._graphs = []
        for robot, robot_class in enumerate(model.class_of):
            beside = _worth(model, robot_class, team.pixels(without=robot), stop)
            worth = beside, alone[model.classes.index(robot_class)]
            layers = _without_dead_ends(list(_Beam(team, robot, width, worth).layers()))
            self._graphs.append(_Graph(model, robot, layers))

    def __call__(self, task: SingleRobotTask) -> SingleRobotPath:
        """Plan a task.

        Raises
        ------
        LimitReached
            If a limit is reached.
        """
        task.stop.check()
        path = self._graphs[task.robot].best_path(task.pixels, task.charges)
        if path is None:
            return SingleRobotPath(None, task.model.problem.no_pixels(), 0)
        return SingleRobotPath(path, task.model.robot_pixels(task.robot, path), 0)


class _Keys:
    """Keys of the N nodes, several of which may share one."""

    def __init__(self, keys: IntArray) -> None:
        self._keys, self.of = np.unique(keys, return_inverse=True)  # [U], [N] positions among them

    def __len__(self) -> int:
        return len(self._keys)

    def found(self, keys: IntArray) -> tuple[IntArray, IntArray]:
        """Returns which of some keys are among those of nodes, and at which positions."""
        at = self._keys.searchsorted(keys)
        at[at == len(self._keys)] = 0
        which = np.flatnonzero(self._keys[at] == keys)
        return which, at[which]


class _Graph:
    """The kept states of a robot at all steps, the N nodes, and the M edges between them."""

    def __init__(self, model: Model, robot: int, layers: list[_Layer]) -> None:
        graph, sizes = model.class_of[robot].graph, [len(layer.states) for layer in layers]
        t = np.repeat(np.arange(len(layers)), sizes)
        states = np.concatenate([layer.states for layer in layers])
        self._states = states.tolist()
        self._n_states, self._n_places = graph.n_states, graph.n_places
        self._connect(layers, np.cumsum([0, *sizes]))
        self._look(model, robot, t * graph.n_states + states)
        places = states % graph.n_places
        self._places = _Keys(t * graph.n_places + places)
        self._nodes = _Keys(t * graph.n_states + states)
        self._shifts = np.sort(graph.shifts)
        shift = self._shifts.searchsorted(places[self._heads] - places[self._tails])
        self._moves = self._places.of[self._tails] * len(self._shifts) + shift  # [M]

    def _connect(self, layers: list[_Layer], first: IntArray) -> None:
        """Numbers the edges.

        Parameters
        ----------
        first : first node of each step, and N
        """
        into = [
            (layer, *ends) for layer, *ends in zip(layers[1:], first[:-2], first[1:-1], strict=True)
        ]
        self._tails = np.concatenate([layer.tails + tail for layer, tail, _ in into])
        self._heads = np.concatenate([layer.heads + head for layer, _, head in into])
        rewards = np.concatenate([layer.rewards for layer, *_ in into])
        self._rewards = rewards if rewards.any() else None
        self._indptr = self._tails.searchsorted(np.arange(first[-1] + 1))
        self._last = slice(int(first[-2]), int(first[-1]))  # nodes of the last step
        # From the last step but one to the first, its nodes and edges; the position [m] of each
        # edge's head among the nodes of the next step, and [n] of each node's first edge.
        self._steps: list[tuple[slice, slice, IntArray, IntArray]] = []
        for node, end in reversed([*pairwise(first[:-1].tolist())]):
            indptr = self._indptr[node : end + 1]
            edges = slice(int(indptr[0]), int(indptr[-1]))
            ends = self._heads[edges] - end, indptr[:-1] - indptr[0]
            self._steps.append((slice(node, end), edges, *ends))

    def _look(self, model: Model, robot: int, nodes: IntArray) -> None:
        """Takes down what nodes see, entry by entry."""
        table = model.coverage(model.class_of[robot])
        which, entries = table.entries(nodes)
        self._seeing, self._rows = np.unique(which, return_index=True)  # nodes, their first entries
        self._view_sums, self._pixels = table.view_sums[entries], table.pixels[entries]
        self._returns = model.problem.returns
        self._weights = model.problem.view_sum_weights[self._view_sums]

    def best_path(self, pixels: FloatArray, charges: Charges) -> Path | None:
        """Returns the best path; None where the charges leave none.

        Parameters
        ----------
        pixels : [Z] px/m2 that the other robots have in every view sum
        """
        value = self._rewards_of_nodes(pixels, charges)
        edge_rewards = self._rewards_of_edges(charges)
        ahead = np.empty(len(self._heads))  # value of taking each edge
        after = self._last
        for nodes, edges, heads, tails in self._steps:
            values = ahead[edges]
            value[after].take(heads, out=values, mode="clip")  # without a copy, unlike "raise"
            if edge_rewards is not None:
                values += edge_rewards[edges]
            value[nodes] += np.maximum.reduceat(values, tails)
            after = nodes
        if value[0] == CLOSED:
            return None
        node, path = 0, [self._states[0]]
        for _ in self._steps:
            first, end = self._indptr[node : node + 2]
            node = self._heads[first + ahead[first:end].argmax()]
            path.append(self._states[node])
        return tuple(path)

    def _rewards_of_nodes(self, pixels: FloatArray, charges: Charges) -> FloatArray:
        """Returns the marginal rewards [N] less what is charged for places and states."""
        gain = self._returns.gains(pixels, self._view_sums, self._pixels)
        gain *= self._weights
        value = np.zeros(len(self._states))
        if len(gain):
            value[self._seeing] = np.add.reduceat(gain, self._rows)
        places, _, states = charges.parts
        for keys, n, (charged, costs) in (
            (self._places, self._n_places, places),
            (self._nodes, self._n_states, states),
        ):
            if len(charged):
                which, at = keys.found(charged[:, 0] * n + charged[:, 1])
                value -= np.bincount(at, costs[which], len(keys))[keys.of]
        return value

    def _rewards_of_edges(self, charges: Charges) -> FloatArray | None:
        """Returns the rewards [M] of edges less what is charged for moves; None if all are 0."""
        _, (charged, costs), _ = charges.parts
        if not len(charged):
            return self._rewards
        t, tails, heads = charged.T
        which, at = self._places.found(t * self._n_places + tails)
        shift = self._shifts.searchsorted((heads - tails)[which])
        at, size = at * len(self._shifts) + shift, len(self._places) * len(self._shifts)
        cost: FloatArray = np.bincount(at, costs[which], size)[self._moves]
        return -cost if self._rewards is None else self._rewards - cost
