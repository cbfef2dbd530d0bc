"""The kept states of a robot and the edges between them, in arrays: finds the best path over them.

Compiled (`response_kernel`), a path takes a fraction of the time that it takes by NumPy.
"""

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from cocap_opt.arithmetic import spans
from cocap_opt.compiling import Kernel
from cocap_opt.data import FloatArray, IntArray
from cocap_opt.graph.charges import Charges
from cocap_opt.graph.timegraph import CLOSED
from cocap_opt.model import Model, Path, RobotClass
from cocap_opt.stop import Clock

KERNEL = Kernel("cocap_opt.coordination.response_kernel", "best responses", compiling=3.0)

_NONE = np.zeros(0, dtype=np.int64)


class Layer(NamedTuple):
    """The n states kept at one step, and the m edges to them from the states of the step before."""

    states: IntArray  # [n] increasing
    tails: IntArray  # [m] positions among the states of the step before, increasing
    heads: IntArray  # [m] positions among `states`; of equal edges from a tail, the first is taken
    rewards: FloatArray  # [m] of the edges themselves


class Charged(NamedTuple):
    """The costs of the N nodes of a kept graph, and of k of its edges."""

    nodes: FloatArray  # [N]
    edges: IntArray  # [k] edges, some more than once
    costs: FloatArray  # [k] costs of the edges, which add up


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


class KeptGraph:
    """The kept states of a robot class at all steps (N nodes), and the M edges between them.

    Parameters
    ----------
    layers : [T+1] the states and edges of each step; each state before the last step has a
        successor

    Attributes
    ----------
    starts : states of the first step, whose nodes come first
    """

    def __init__(self, model: Model, robot_class: RobotClass, layers: Sequence[Layer]) -> None:
        graph, sizes = robot_class.graph, [len(layer.states) for layer in layers]
        self.starts = layers[0].states
        t = np.repeat(np.arange(len(layers)), sizes)
        states = np.concatenate([layer.states for layer in layers])
        self._states = states.tolist()
        self._n_states, self._n_places = graph.n_states, graph.n_places
        self._connect(layers, np.cumsum([0, *sizes]))
        self._look(model, robot_class, t * graph.n_states + states)
        self._place = states % graph.n_places  # [N]
        self._places = _Keys(t * graph.n_places + self._place)
        self._nodes = _Keys(t * graph.n_states + states)
        self._charges = np.zeros(len(self._heads))  # [M] charges of moves; 0 between two responses

    def _connect(self, layers: Sequence[Layer], first: IntArray) -> None:
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
        self._last = slice(int(first[-2]), int(first[-1]))  # nodes of the last step
        # From the last step but one to the first: its nodes and edges; the position [m] of each
        # edge's head among the nodes of the next step; and [n] each node's first edge.
        self._steps: list[tuple[slice, slice, IntArray, IntArray]] = []
        for node, end in reversed([*pairwise(first[:-1].tolist())]):
            indptr = self._indptr[node : end + 1]
            edges = slice(int(indptr[0]), int(indptr[-1]))
            ends = self._heads[edges] - end, indptr[:-1] - indptr[0]
            self._steps.append((slice(node, end), edges, *ends))

    def _look(self, model: Model, robot_class: RobotClass, nodes: IntArray) -> None:
        """Stores the views of the nodes, entry by entry."""
        table = model.coverage(robot_class)
        self._seeing, entries = table.entries(nodes)  # the node of each entry, increasing
        self._entries = self._seeing.searchsorted(np.arange(len(nodes) + 1))  # first of each node
        self._view_sums, self._pixels = table.view_sums[entries], table.pixels[entries]
        self._returns = model.problem.returns
        self._numbers_of_view_sums = self._view_sums.astype(np.uint32)
        self._weights_of_all = model.problem.view_sum_weights
        self._weights = self._weights_of_all[self._view_sums]

    @property
    def n_nodes(self) -> int:
        """N, the number of nodes."""
        return len(self._states)

    @property
    def n_edges(self) -> int:
        """M, the number of edges."""
        return len(self._heads)

    def charged(self, charges: Charges) -> Charged:
        """Returns the costs of nodes and edges for places, moves and states."""
        return Charged(self._cost_of_nodes(charges), *self._cost_of_edges(charges))

    def best_path(self, pixels: FloatArray, charged: Charged) -> Path | None:
        """Returns the best path; None if the charges leave no path.

        Parameters
        ----------
        pixels : [Z] px/m2 that the other robots have of every view sum
        """
        np.add.at(self._charges, charged.edges, charged.costs)
        try:
            return self._found(pixels, charged.nodes, charged.edges)
        finally:
            self._charges[charged.edges] = 0.0

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
            cost, len(self.starts), self._last.start, value, path,
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
        node = int(value[: len(self.starts)].argmax())
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

    def _cost_of_edges(self, charges: Charges) -> tuple[IntArray, FloatArray]:
        """Returns the edges [k] that are charged for their moves, and their costs [k]."""
        _, (charged, costs), _ = charges.parts
        if not len(charged):
            return _NONE, costs
        t, tails, heads = charged.T
        which, at = self._places.found(t * self._n_places + tails)
        nodes, of_node = self._places.members(at)
        sizes = self._indptr[nodes + 1] - self._indptr[nodes]
        edges = spans(self._indptr[nodes], sizes)
        of_edge = which[np.repeat(of_node, sizes)]  # the charge's number for each charged edge
        same = self._place[self._heads[edges]] == heads[of_edge]
        return edges[same], costs[of_edge[same]]
