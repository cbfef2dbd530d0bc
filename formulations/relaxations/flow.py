"""Aggregated flow: all robots of a class as one commodity over the time-expanded graph.

Robots of one class differ only in their start, and J depends only on how many robots are in each
state. Any flow with one unit from each start can be split into one path per start, so one flow per
class has the same relaxation value and the same integer optimum as one flow per robot: the size of
the model does not grow with the number of robots.

Variables of a flow: x[n] robots in node n (a state at a step), y[e] robots along edge e. Pixels,
roots and collision rules between places are rows over nodes, which are far fewer than edges. Robots
that choose their start among several states come from a source: a node at step -1 with edges to
these states. Robots of a class with the same set of start states share a source.

Sources: Yu and LaValle 2013 (anonymous path finding as integer flow); Royset and Sato 2010
(search models whose size does not grow with the number of searchers).
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy import sparse

from cocap_opt.data import BoolArray, FloatArray, IntArray
from cocap_opt.formulations.certificates.envelope import Cut
from cocap_opt.formulations.relaxations.separation import phi_of
from cocap_opt.graph.move_rewards import Bonuses
from cocap_opt.graph.timegraph import CLOSED, TimeGraph
from cocap_opt.graph.value_iteration import backward_sweep
from cocap_opt.model import Model, Path, RobotClass
from cocap_opt.problem import Cell, Problem
from cocap_opt.result import UnsupportedError
from cocap_opt.returns import Returns
from cocap_opt.stop import Stop, never

MOST_EDGES = 400_000  # largest number of edges of the time-expanded graph
Compile = Callable[[Problem], Model]  # robots that are alike form one class, or each forms its own

# Robots in each node [N] and along each edge [E]; fractions if a solver splits them.
Amounts = tuple[FloatArray, FloatArray]

UNUSED = 1e-6  # smaller amounts are rounding errors


class _ClassPart(NamedTuple):
    """The part of a flow that belongs to one class, in the order of the flow's fields."""

    owner: IntArray
    steps: IntArray
    states: IntArray
    tails: IntArray
    heads: IntArray
    supply: FloatArray


@dataclass(frozen=True, eq=False)
class Flow:
    """The nodes and edges that lie on a path from some start to the end (or the goal)."""

    model: Model
    owner: IntArray  # [N] class of each node
    steps: IntArray  # [N] t, -1 for sources
    states: IntArray  # [N] state number in its class's graph; for a source, the number of its set
    tails: IntArray  # [E] node at which each edge begins
    heads: IntArray  # [E] node at which each edge ends
    supply: FloatArray  # [N] robots that enter the flow at a node

    @classmethod
    def of(cls, model: Model, stop: Stop = never) -> "Flow":
        """Builds the flow of a model.

        Raises
        ------
        LimitReached
            If the limit is reached before the flow is complete.
        UnsupportedError
            If the time-expanded graph has more than MOST_EDGES edges.
        """
        parts, n_nodes, n_edges = [], 0, 0
        for k, robot_class in enumerate(model.classes):
            useful = _useful(model, robot_class)
            part = _class_part(k, robot_class, useful, n_nodes, MOST_EDGES - n_edges, stop)
            n_nodes, n_edges = n_nodes + len(part.owner), n_edges + len(part.tails)
            parts.append(part)
        return cls(model, *(np.concatenate(arrays) for arrays in zip(*parts, strict=True)))

    @property
    def n_nodes(self) -> int:
        """Number of nodes, N."""
        return len(self.states)

    @property
    def n_edges(self) -> int:
        """Number of edges, E."""
        return len(self.tails)

    @cached_property
    def is_source(self) -> BoolArray:
        """True for sources, in which robots only choose their start [N]."""
        return self.steps < 0

    @cached_property
    def is_entered(self) -> BoolArray:
        """True for nodes that edges may enter [N]; all others have only their supply."""
        entered = self.steps > 0
        entered[self.heads] = True
        return entered

    @cached_property
    def serves_all(self) -> bool:
        """True if every robot has a path."""
        return round(float(self.supply.sum())) == len(self.model.problem.robots)

    @cached_property
    def entering(self) -> sparse.csr_array:
        """1 where an edge enters a node [N, E]."""
        return self._ends(self.heads)

    @cached_property
    def leaving(self) -> sparse.csr_array:
        """1 where an edge leaves a node [N, E]."""
        return self._ends(self.tails)

    def _ends(self, nodes: IntArray) -> sparse.csr_array:
        """Returns 1 where an edge has its given end, tail or head [E], in a node [N, E]."""
        at = (nodes, np.arange(self.n_edges))
        return sparse.csr_array((np.ones(self.n_edges), at), shape=(self.n_nodes, self.n_edges))

    @cached_property
    def bonus(self) -> FloatArray:
        """Rewards for the moves along edges [E]."""
        bonuses = Bonuses.of(self.model.problem.objective)
        rewards, owner = np.zeros(self.n_edges), self.owner[self.tails]
        tails, heads = self.states[self.tails], self.states[self.heads]
        for k, robot_class in enumerate(self.model.classes):
            of_class = (owner == k) & ~self.is_source[self.tails]
            rewards[of_class] = bonuses.of_edges(
                robot_class.graph.shape, tails[of_class], heads[of_class]
            )
        return rewards

    @property
    def largest_bonus(self) -> float:
        """The largest reward for the move along any edge."""
        return float(self.bonus.max(initial=0.0))

    @cached_property
    def capacity(self) -> FloatArray:
        """Number of robots that can be in a node [N], by the vertex rule and its class's size."""
        if not self.model.problem.rules.none:
            return np.where(self.is_source, self.supply, 1.0)
        return np.array(self.model.class_sizes, dtype=np.float64)[self.owner]

    @cached_property
    def places(self) -> IntArray:
        """Number of the cell of each node [N], the same for all classes; -1 for sources."""
        found = np.full(self.n_nodes, -1)
        for k, robot_class in enumerate(self.model.classes):
            of_class = (self.owner == k) & ~self.is_source
            graph = robot_class.graph
            layer, x, y = graph.coordinates(self.states[of_class] % graph.n_places)
            layers = np.array(
                [self.model.problem.layers.index(h) for h in robot_class.spec.motion.layers]
            )
            found[of_class] = np.ravel_multi_index((layers[layer], x, y), self._cells)
        return found

    @property
    def _cells(self) -> tuple[int, int, int]:
        problem = self.model.problem
        return (len(problem.layers), *problem.height_map.shape)

    def cell(self, place: int) -> Cell:
        """Returns the cell with this number."""
        layer, x, y = (int(i) for i in np.unravel_index(place, self._cells))
        return Cell(x, y, layer)

    def coverage(self) -> sparse.csr_array:
        """Returns the pixels [Z, N] that a robot in a node adds to each view sum."""
        n_view_sums = len(self.model.problem.view_sum_weights)
        rows, columns, pixels = [], [], []
        for k, robot_class in enumerate(self.model.classes):
            of_class = np.flatnonzero((self.owner == k) & ~self.is_source)
            table = self.model.coverage(robot_class)
            nodes = self.steps[of_class] * robot_class.graph.n_states + self.states[of_class]
            which, entries = table.entries(nodes)
            rows.append(table.view_sums[entries])
            columns.append(of_class[which])
            pixels.append(table.pixels[entries])
        at = (_joined(rows), _joined(columns))
        values = np.concatenate([np.zeros(0), *pixels])
        return sparse.csr_array((values, at), shape=(n_view_sums, self.n_nodes))

    # -- conversion between flows and paths -----------------------------------------------------

    def amounts(self, paths: Sequence[Path]) -> Amounts:
        """Counts the robots in each node and along each edge, for one path per robot."""
        x, y = np.zeros(self.n_nodes), np.zeros(self.n_edges)
        for k, robot_class in enumerate(self.model.classes):
            sources = self._source_of(k, robot_class)
            for robot in robot_class.robots:
                nodes = [self._node(k, t, state) for t, state in enumerate(paths[robot])]
                nodes = [*sources.get(robot, ()), *nodes]
                np.add.at(x, nodes, 1.0)
                for tail, head in pairwise(nodes):
                    low, high = np.searchsorted(self.tails, [tail, tail + 1])
                    y[low + int(np.flatnonzero(self.heads[low:high] == head)[0])] += 1.0
        return x, y

    def _node(self, number: int, t: int, state: int) -> int:
        first, end = np.searchsorted(self.owner, [number, number + 1])
        low, high = first + np.searchsorted(self.steps[first:end], [t, t + 1])
        return int(low + np.searchsorted(self.states[low:high], state))

    def _source_of(self, number: int, robot_class: RobotClass) -> dict[int, list[int]]:
        """Returns the source of each robot of a class that chooses its start."""
        return {
            robot: [self._node(number, -1, k)]
            for k, (starts, robots) in enumerate(robot_class.start_sets)
            if len(starts) > 1
            for robot in robots
        }

    def paths(self, y: FloatArray, x: FloatArray | None = None) -> tuple[Path, ...]:
        """Returns one path per robot, each from its own start, that together form a flow.

        Parameters
        ----------
        y : [E] robots along each edge; may be fractional if an integral x is given, since between
            two steps a mixture of assignments of robots to nodes contains an integral assignment
        x : [N] robots in each node; None: derived from y

        Raises
        ------
        ValueError
            If the flow cannot be split into paths.
        """
        counts = np.rint(self.supply + self.entering @ y if x is None else x).astype(np.int64)
        paths: dict[int, list[int]] = {}
        for k, robot_class in enumerate(self.model.classes):
            at = self._first_nodes(k, robot_class, counts, y)
            ways = [[node] for node in at]
            for _ in range(self.model.problem.horizon):
                at = self._step(at, counts, y)
                for way, node in zip(ways, at, strict=True):
                    way.append(node)
            for robot, way in zip(robot_class.robots, ways, strict=True):
                paths[robot] = self.states[way].tolist()
        return tuple(tuple(paths[robot]) for robot in range(len(paths)))

    def _first_nodes(
        self, number: int, robot_class: RobotClass, counts: IntArray, y: FloatArray
    ) -> list[int]:
        """Returns the nodes of step 0 in which the robots of a class start."""
        sources = self._source_of(number, robot_class)
        chosen: dict[int, int] = {}
        if sources:
            at = [source for (source,) in sources.values()]
            # robots that enter here; the others have no choice of a start
            left = counts - self.supply.astype(np.int64)
            chosen = dict(zip(sources, self._step(at, left, y), strict=True))
        return [
            chosen[robot] if robot in chosen else self._node(number, 0, int(starts[0]))
            for robot, starts in zip(robot_class.robots, robot_class.starts, strict=True)
        ]

    def _step(self, at: list[int], counts: IntArray, y: FloatArray) -> list[int]:
        """Returns the nodes to which robots move along used edges, as many to each as the flow has
        there.
        """
        ahead: list[dict[int, float]] = []
        for node in at:
            low, high = np.searchsorted(self.tails, [node, node + 1])
            used = low + np.flatnonzero(y[low:high] > UNUSED)
            ahead.append(dict(zip(self.heads[used].tolist(), self.bonus[used], strict=True)))
        nodes = sorted({head for gains in ahead for head in gains})
        slots = [head for head in nodes for _ in range(counts[head])]
        # A forbidden edge costs more than all rewards together.
        worst = -2.0 * len(at) * (self.largest_bonus or 1.0)
        chosen = assigned_heads(ahead, slots, worst)
        if chosen is None:
            raise ValueError("the flow is not integral")
        return chosen


def assigned_heads(
    gains: Sequence[Mapping[int, float]], heads: Sequence[int], forbidden: float
) -> list[int] | None:
    """Returns the head to which each robot moves, maximising the sum of gains.

    Parameters
    ----------
    gains : for each robot, the gain of every head that it can reach
    heads : heads, each repeated once per robot that moves there
    forbidden : the gain of a head that a robot cannot reach: lower than all others together

    Returns
    -------
    One head per robot; None if there are not as many heads as robots, or if a robot would have
    to move to a forbidden head.
    """
    from scipy.optimize import linear_sum_assignment  # takes half of the time of all imports

    if len(heads) != len(gains):
        return None
    gain = np.array([[of_robot.get(head, -np.inf) for head in heads] for of_robot in gains])
    weights = np.where(np.isinf(gain), forbidden, gain)
    robots, chosen = linear_sum_assignment(weights, maximize=True)
    if np.isinf(gain[robots, chosen]).any():
        return None
    return [heads[k] for k in chosen.tolist()]


def _class_part(
    k: int, robot_class: RobotClass, useful: BoolArray, first: int, most_edges: int, stop: Stop
) -> _ClassPart:
    """Returns the part of class k in a flow; its nodes are numbered from `first`.

    Parameters
    ----------
    useful : [T+1, S] True for the nodes of the class
    most_edges : remaining number of edges of the flow
    """
    t, state = np.nonzero(useful)
    starting = np.flatnonzero(useful[0])
    sources, tails, heads = list[int](), list[IntArray](), list[IntArray]()
    n_sources = sum(len(starts) > 1 for starts, _ in robot_class.start_sets)
    supply = np.zeros(n_sources + len(t))
    for start_set, (starts, robots) in enumerate(robot_class.start_sets):
        reached = n_sources + np.searchsorted(starting, starts[useful[0, starts]])
        if len(starts) == 1:
            supply[reached] += len(robots)
            continue
        supply[len(sources)] = len(robots) if len(reached) else 0
        tails.append(np.full(len(reached), first + len(sources)))
        heads.append(first + reached)
        sources.append(start_set)
    t, state = np.append(np.full(n_sources, -1), t), np.append(sources, state).astype(np.int64)
    first += n_sources
    for here, there in _edges(robot_class.graph, useful):
        stop.check()
        most_edges -= len(here)
        if most_edges < 0:
            raise UnsupportedError(
                f"a flow model takes at most {MOST_EDGES:,} edges of the time-expanded graph; this "
                "scene has more. Use fewer steps, or column-generation, which takes any number"
            )
        tails.append(first + here)
        heads.append(first + there)
    return _ClassPart(np.full(len(t), k), t, state, _joined(tails), _joined(heads), supply)


def _useful(model: Model, robot_class: RobotClass) -> BoolArray:
    """Returns True for states [T+1, S] on a path from one of the starts to the end (or the
    goal).
    """
    graph, horizon = robot_class.graph, model.problem.horizon
    to_go = backward_sweep(graph, graph.no_reward(horizon), goal=robot_class.goal)
    found: BoolArray = graph.reachable(robot_class.all_starts, horizon) & (to_go > CLOSED)
    return found


def _edges(graph: TimeGraph, useful: BoolArray) -> Iterator[tuple[IntArray, IntArray]]:
    """Yields the tails and heads of each step's edges, as numbers of useful nodes, in order."""
    turns = _padded(graph.turns)
    first = 0
    for t, (here, there) in enumerate(pairwise(useful)):
        tails = np.flatnonzero(here)
        orientation, place = np.divmod(tails, graph.n_places)
        moved = graph.heads_at(t, place).T[:, None, :]  # [n, 1, K]
        turned = turns[orientation][:, :, None]  # [n, M, 1]
        heads = np.where((moved >= 0) & (turned >= 0), turned * graph.n_places + moved, -1)
        heads = heads.reshape(len(tails), turns.shape[1] * len(graph.moves))
        open_ = (heads >= 0) & there[heads]
        which, head = np.nonzero(open_)[0], heads[open_]
        order = np.lexsort((head, which))
        ahead = first + len(tails)
        number = np.cumsum(there) - 1
        yield first + which[order], ahead + number[head[order]]
        first = ahead


def _padded(turns: Sequence[Sequence[int]]) -> IntArray:
    """Returns the orientations to which each orientation can turn [O, M], padded with -1."""
    table = np.full((len(turns), max(map(len, turns))), -1, dtype=np.int64)
    for row, following in zip(table, turns, strict=True):
        row[: len(following)] = following
    return table


def _joined(parts: Sequence[IntArray]) -> IntArray:
    """Concatenates arrays of numbers; there may be none."""
    return np.concatenate([np.zeros(0, dtype=np.int64), *parts])


# -- roots -------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Roots:
    """The view sums that count and that some drone can see, in units of their best view.

    View sums with roots come first, then counted people, whose best view is 1: for them both the
    root and the number of pixels are counts.
    """

    owner: IntArray  # [N] class of each node
    used: IntArray  # [z] view sums
    returns: Returns  # returns of these view sums
    scale: FloatArray  # [z] px^0.5/m, root of the best single view
    largest: FloatArray  # [C, z] px^0.5/m, for each class, including views that lead nowhere
    weights: FloatArray  # [z] weight of the root or the count in these units
    pixels: sparse.csr_array  # [z, N] in units of scale^2
    seen: sparse.csr_array  # [z, N] roots of pixels

    @classmethod
    def of(cls, flow: Flow) -> "Roots":
        """Returns the roots of a flow."""
        coverage = flow.coverage()
        weights = flow.model.problem.view_sum_weights
        best = np.asarray(coverage.max(axis=1).todense()).ravel()
        used = np.flatnonzero((best > 0) & (weights > 0))
        scale = np.sqrt(best[used])
        pixels = sparse.csr_array(sparse.diags_array(1 / scale**2) @ coverage[used])
        largest = flow.model.largest_roots()[:, used]
        return cls(
            owner=flow.owner, used=used, returns=flow.model.problem.returns.part(used),
            scale=scale, largest=largest, weights=weights[used] * scale,
            pixels=pixels, seen=pixels.sqrt(),
        )  # fmt: skip

    def entries(self, z: int) -> tuple[IntArray, FloatArray]:
        """Returns the nodes that see the view sum at position z, and their roots in px^0.5/m."""
        part = slice(self.seen.indptr[z], self.seen.indptr[z + 1])
        nodes: IntArray = self.seen.indices[part].astype(np.int64)
        return nodes, self.seen.data[part] * self.scale[z]

    def cut_rows(self, cuts: Sequence[Cut]) -> tuple[sparse.csr_array, FloatArray, IntArray]:
        """Returns envelope cuts as rows u <= constants + phi x, in units of the roots.

        Returns
        -------
        phi [k, N] for a robot in each node, constants [k], and the position [k] of each cut's view
        sum among `used`.
        """
        at = np.searchsorted(self.used, [cut.view_sum for cut in cuts]).astype(np.int64)
        entries = [self.entries(z) for z in at.tolist()]
        scales = self.scale[at]
        data = [
            phi_of(cut, self.owner[nodes], np.zeros_like(nodes), seen) / scale
            for cut, (nodes, seen), scale in zip(cuts, entries, scales, strict=True)
        ]
        parts = (
            np.concatenate([np.zeros(0), *data]),
            np.concatenate([np.zeros(0, dtype=np.int64), *(nodes for nodes, _ in entries)]),
            np.cumsum([0, *(len(nodes) for nodes, _ in entries)]),
        )
        phi = sparse.csr_array(parts, shape=(len(cuts), len(self.owner)))
        return phi, np.array([cut.constant for cut in cuts]) / scales, at
