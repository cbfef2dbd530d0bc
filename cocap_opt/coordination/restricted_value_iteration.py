"""Value iteration over few states of each robot, for searching near a plan.

With only the promising states (`kept_states`) and the edges between them in arrays, a best response
takes a seventh of the time of one over all states on a small map, and does not slow down on a large
map; compiled (`response_kernel`), it takes a fraction of that. It may miss the best path, which a
best response over all states then finds. Half of the states are the best if all others keep their
paths, half are the best if the robot were alone, since others will change their paths.
Alternatively, all of them are the best at given prices, which account for the other robots' views.
"""

from collections.abc import Sequence
from itertools import pairwise
from typing import Self

import numpy as np

from cocap_opt.arithmetic import spans
from cocap_opt.compiling import Kernel
from cocap_opt.coordination.kept_states import (
    Beam,
    Layer,
    without_dead_ends,
    worth_of,
    worths_of,
)
from cocap_opt.coordination.low_level import PlannedTeam, SingleRobotPath, SingleRobotTask
from cocap_opt.data import BoolArray, FloatArray, IntArray
from cocap_opt.graph.charges import Charges
from cocap_opt.graph.timegraph import CLOSED
from cocap_opt.model import Model, Path
from cocap_opt.objective import marginal_reward
from cocap_opt.stop import Clock, Stop

KERNEL = Kernel("cocap_opt.coordination.response_kernel", "best responses", compiling=3.0)

# Number of states of a robot that are kept at a step. Measured on scenes `passage` and
# `bottleneck-tight`, seeds 0 to 9: J is 0.14 and 0.09 % below the optimum with 80, 0.11 and 0.05 %
# with 120, and 0.12 and 0.07 % with 160 states and 42 responses per robot, which take as long.
_WIDTH = 120


class RestrictedValueIteration:
    """A low level that finds a robot's best path over its most promising states.

    Parameters
    ----------
    graphs : the kept states of each robot
    """

    def __init__(self, graphs: Sequence["_Graph"]) -> None:
        self._graphs = graphs

    @classmethod
    def beside(cls, team: PlannedTeam, stop: Stop, width: int = _WIDTH) -> Self:
        """Returns a low level over the states that are best given the other robots' paths, and best
        alone.

        Parameters
        ----------
        team : a whole team
        width : largest number of states kept at each step, in addition to those of the path in
            `team`

        Raises
        ------
        LimitReached
            If a limit is reached before the states are found.
        """
        model, nothing, graphs = team.model, team.model.problem.no_pixels(), []
        rewards = [marginal_reward(model, robot_class, nothing) for robot_class in model.classes]
        alone = worths_of(model, rewards, stop)
        for robot, robot_class in enumerate(model.class_of):
            stop.check()
            reward = marginal_reward(model, robot_class, team.pixels(without=robot))
            worth = (
                worth_of(model, robot_class, reward, stop),
                alone[model.classes.index(robot_class)],
            )
            graphs.append(_Graph.of(Beam(team, robot, width, worth), model, robot))
        return cls(graphs)

    @classmethod
    def at_rewards(
        cls,
        team: PlannedTeam,
        rewards: Sequence[FloatArray],
        known: Sequence[BoolArray],
        stop: Stop,
        width: int,
    ) -> Self:
        """Returns a low level over the states that are best by given rewards.

        Parameters
        ----------
        team : a whole team
        rewards : rewards [T+1, S] of the states of each class
        known : [T+1, S] for each class, True for states that are always kept if they are reached
        width : largest number of other states kept at each step

        Raises
        ------
        LimitReached
            If a limit is reached before the states are found.
        """
        model, graphs = team.model, []
        worths = worths_of(model, rewards, stop)
        for robot, robot_class in enumerate(model.class_of):
            stop.check()
            number = model.classes.index(robot_class)
            beam = Beam(team, robot, width, [worths[number]], known[number])
            graphs.append(_Graph.of(beam, model, robot))
        return cls(graphs)

    def __call__(self, task: SingleRobotTask) -> SingleRobotPath:
        """Plans a task.

        Raises
        ------
        LimitReached
            If a limit is reached.
        """
        task.stop.check()
        path = self._graphs[task.robot].best_path(task.pixels, task.charges)
        return SingleRobotPath.of(task.model, task.robot, path)


class _Keys:
    """Keys of the N nodes; several nodes may share a key."""

    def __init__(self, keys: IntArray) -> None:
        # [U] distinct keys, [N] each node's position among them
        self._keys, self.of = np.unique(keys, return_inverse=True)
        self._by_key = np.argsort(self.of, kind="stable")
        self._first = self.of[self._by_key].searchsorted(np.arange(len(self._keys) + 1))

    def __len__(self) -> int:
        return len(self._keys)

    def found(self, keys: IntArray) -> tuple[IntArray, IntArray]:
        """Returns which of some keys occur among those of the nodes, and their positions."""
        at = self._keys.searchsorted(keys)
        at[at == len(self._keys)] = 0
        which = np.flatnonzero(self._keys[at] == keys)
        return which, at[which]

    def members(self, at: IntArray) -> tuple[IntArray, IntArray]:
        """Returns the nodes [m] with some keys, given by position, and the number [m] of each
        node's key.
        """
        sizes = self._first[at + 1] - self._first[at]
        return self._by_key[spans(self._first[at], sizes)], np.repeat(np.arange(len(at)), sizes)


class _Graph:
    """The kept states of a robot at all steps (N nodes), and the M edges between them."""

    @classmethod
    def of(cls, beam: Beam, model: Model, robot: int) -> Self:
        """Returns the states of a robot that a beam keeps, without dead ends."""
        return cls(model, robot, without_dead_ends(list(beam.layers())))

    def __init__(self, model: Model, robot: int, layers: list[Layer]) -> None:
        graph, sizes = model.class_of[robot].graph, [len(layer.states) for layer in layers]
        t = np.repeat(np.arange(len(layers)), sizes)
        states = np.concatenate([layer.states for layer in layers])
        self._states = states.tolist()
        self._n_states, self._n_places = graph.n_states, graph.n_places
        self._connect(layers, np.cumsum([0, *sizes]))
        self._look(model, robot, t * graph.n_states + states)
        self._place = states % graph.n_places  # [N]
        self._places = _Keys(t * graph.n_places + self._place)
        self._nodes = _Keys(t * graph.n_states + states)
        self._charges = np.zeros(len(self._heads))  # [M] charges of moves; 0 between two responses

    def _connect(self, layers: list[Layer], first: IntArray) -> None:
        """Numbers the edges.

        Parameters
        ----------
        first : first node of each step, followed by N
        """
        into = [
            (layer, *ends) for layer, *ends in zip(layers[1:], first[:-2], first[1:-1], strict=True)
        ]
        tails = np.concatenate([layer.tails + tail for layer, tail, _ in into])
        self._heads = np.concatenate([layer.heads + head for layer, _, head in into])
        rewards = np.concatenate([layer.rewards for layer, *_ in into])
        self._rewards = rewards if rewards.any() else rewards[:0]
        # smaller numbers, which take less time to read
        self._numbers_of_heads = self._heads.astype(np.uint32)
        self._indptr = tails.searchsorted(np.arange(first[-1] + 1))
        self._starts = int(first[1])  # nodes of the first step
        self._last = slice(int(first[-2]), int(first[-1]))  # nodes of the last step
        # From the last step but one to the first: its nodes and edges; the position [m] of each
        # edge's head among the nodes of the next step; and [n] each node's first edge.
        self._steps: list[tuple[slice, slice, IntArray, IntArray]] = []
        for node, end in reversed([*pairwise(first[:-1].tolist())]):
            indptr = self._indptr[node : end + 1]
            edges = slice(int(indptr[0]), int(indptr[-1]))
            ends = self._heads[edges] - end, indptr[:-1] - indptr[0]
            self._steps.append((slice(node, end), edges, *ends))

    def _look(self, model: Model, robot: int, nodes: IntArray) -> None:
        """Stores the views of the nodes, entry by entry."""
        table = model.coverage(model.class_of[robot])
        self._seeing, entries = table.entries(nodes)  # the node of each entry, increasing
        self._entries = self._seeing.searchsorted(np.arange(len(nodes) + 1))  # first of each node
        self._view_sums, self._pixels = table.view_sums[entries], table.pixels[entries]
        self._returns = model.problem.returns
        self._numbers_of_view_sums = self._view_sums.astype(np.uint32)
        self._weights_of_all = model.problem.view_sum_weights
        self._weights = self._weights_of_all[self._view_sums]

    def best_path(self, pixels: FloatArray, charges: Charges) -> Path | None:
        """Returns the best path; None if the charges leave no path.

        Parameters
        ----------
        pixels : [Z] px/m2 that the other robots have of every view sum
        """
        cost, charged = self._cost_of_nodes(charges), self._charge_edges(charges)
        try:
            return self._found(pixels, cost, charged)
        finally:
            self._charges[charged] = 0.0

    def _found(self, pixels: FloatArray, cost: FloatArray, charged: IntArray) -> Path | None:
        if KERNEL.is_loaded:
            return self._by_kernel(pixels, cost, charged)
        clock = Clock()
        path = self._by_numpy(pixels, cost, charged)
        KERNEL.spend(clock.seconds)
        return path

    def _by_kernel(self, pixels: FloatArray, cost: FloatArray, charged: IntArray) -> Path | None:
        from cocap_opt.coordination.response_kernel import best_nodes

        value, path = np.empty(len(cost)), np.empty(len(self._steps) + 1, dtype=np.int64)
        is_charged = np.zeros(len(cost), dtype=np.bool_)
        is_charged[self._indptr.searchsorted(charged, side="right") - 1] = True
        returns = self._returns
        best_nodes(
            self._entries, self._numbers_of_view_sums, self._pixels, pixels,
            returns.values(pixels), self._weights_of_all, returns.n_roots, returns.caps,
            self._indptr, self._numbers_of_heads, self._rewards, self._charges, is_charged,
            cost, self._starts, self._last.start, value, path,
        )  # fmt: skip
        if value[path[0]] == CLOSED:
            return None
        return tuple(self._states[node] for node in path.tolist())

    def _by_numpy(self, pixels: FloatArray, cost: FloatArray, charged: IntArray) -> Path | None:
        gain = self._returns.gains(pixels, self._view_sums, self._pixels)
        gain *= self._weights
        value = np.bincount(self._seeing, gain, len(cost)) - cost
        along = np.empty(len(self._heads))  # value of each edge
        after, is_rewarded = self._last, len(self._rewards) > 0
        for nodes, edges, heads, tails in self._steps:
            values = along[edges]
            # mode "clip" avoids a copy, unlike "raise"
            value[after].take(heads, out=values, mode="clip")
            if is_rewarded or ((edges.start <= charged) & (charged < edges.stop)).any():
                rewards = self._rewards[edges] if is_rewarded else 0.0
                values += rewards - self._charges[edges]
            value[nodes] += np.maximum.reduceat(values, tails)
            after = nodes
        node = int(value[: self._starts].argmax())
        if value[node] == CLOSED:
            return None
        path = [self._states[node]]
        for _ in self._steps:
            first, end = self._indptr[node : node + 2]
            node = self._heads[first + along[first:end].argmax()]
            path.append(self._states[node])
        return tuple(path)

    def _cost_of_nodes(self, charges: Charges) -> FloatArray:
        """Returns the costs [N] of places and states."""
        cost = np.zeros(len(self._states))
        places, _, states = charges.parts
        for keys, n, (charged, costs) in (
            (self._places, self._n_places, places),
            (self._nodes, self._n_states, states),
        ):
            if len(charged):
                which, at = keys.found(charged[:, 0] * n + charged[:, 1])
                cost += np.bincount(at, costs[which], len(keys))[keys.of]
        return cost

    def _charge_edges(self, charges: Charges) -> IntArray:
        """Charges the edges for their moves; returns the charged edges."""
        _, (charged, costs), _ = charges.parts
        if not len(charged):
            return _NONE
        t, tails, heads = charged.T
        which, at = self._places.found(t * self._n_places + tails)
        nodes, of_node = self._places.members(at)
        sizes = self._indptr[nodes + 1] - self._indptr[nodes]
        edges = spans(self._indptr[nodes], sizes)
        of_edge = which[np.repeat(of_node, sizes)]  # the charge's number for each charged edge
        same = self._place[self._heads[edges]] == heads[of_edge]
        found: IntArray = edges[same]
        np.add.at(self._charges, found, costs[of_edge[same]])
        return found


_NONE = np.zeros(0, dtype=np.int64)
