"""Aggregated flow: all robots of a class as one commodity over the time-expanded graph.

Robots of one class differ only in their start, and J depends only on how many robots stand in
each state. Any flow with one unit from each start splits into one path per start, so that one
flow per class has the same relaxation value and the same integer optimum as one flow per
robot: the model's size does not grow with the number of robots.

Numbers of a flow: x[n] robots in node n (a state at a step), y[e] robots along edge e. Pixels,
roots and collision rules between places are rows over nodes, which are far fewer than edges.

Sources: Yu and LaValle 2013 (anonymous path finding as integer flow); Royset and Sato 2010
(search models whose size does not grow with the number of searchers).
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise, product

import numpy as np
from scipy import sparse
from scipy.optimize import linear_sum_assignment
from scipy.spatial import cKDTree

from cocap_opt.bonuses import bonuses_of
from cocap_opt.data import BoolArray, FloatArray, IntArray
from cocap_opt.model import Model, Path, RobotClass
from cocap_opt.problem import Cell, Problem
from cocap_opt.result import UnsupportedError
from cocap_opt.reward import group_weights, largest_roots
from cocap_opt.stop import Limit, Stop, never
from cocap_opt.timegraph import CLOSED, TimeGraph
from formulations.envelope import Cut
from formulations.resources import Cells, Resource, Swap

MOST_EDGES = 400_000  # of the time-expanded graph
MOST_ENTRIES = 500_000  # of the separation rows
Compile = Callable[[Problem], Model]  # one class of robots for all that are alike, or each apart

UNUSED = 1e-6  # amounts below are rounding errors


@dataclass(frozen=True, eq=False)
class Flow:
    """Nodes and edges that lie on a path from some start to the end (or the goal)."""

    model: Model
    owner: IntArray  # [N] class of each node
    steps: IntArray  # [N] t
    states: IntArray  # [N] state number in its class's graph
    tails: IntArray  # [E] nodes
    heads: IntArray  # [E] nodes
    supply: FloatArray  # [N] robots that start there

    @property
    def n_nodes(self) -> int:
        """N."""
        return len(self.states)

    @property
    def n_edges(self) -> int:
        """E."""
        return len(self.tails)

    @cached_property
    def serves_all(self) -> bool:
        """Whether every robot has a path."""
        return round(float(self.supply.sum())) == len(self.model.problem.robots)

    @cached_property
    def entering(self) -> sparse.csr_array:
        """1 where an edge enters a node [N, E]."""
        return _incidence(self.heads, np.arange(self.n_edges), (self.n_nodes, self.n_edges))

    @cached_property
    def leaving(self) -> sparse.csr_array:
        """1 where an edge leaves a node [N, E]."""
        return _incidence(self.tails, np.arange(self.n_edges), (self.n_nodes, self.n_edges))

    @cached_property
    def bonus(self) -> FloatArray:
        """Rewards of the edges for the moves themselves [E]."""
        bonuses = bonuses_of(self.model.problem.objective)
        rewards, owner = np.zeros(self.n_edges), self.owner[self.tails]
        tails, heads = self.states[self.tails], self.states[self.heads]
        for k, group in enumerate(self.model.classes):
            own = owner == k
            rewards[own] = bonuses.of_edges(group.graph.shape, tails[own], heads[own])
        return rewards

    @property
    def largest_bonus(self) -> float:
        """Of all edges."""
        return float(self.bonus.max(initial=0.0))

    @cached_property
    def capacity(self) -> FloatArray:
        """Robots that can be in a node by the vertex rule and the size of its class [N]."""
        if not self.model.problem.rules.none:
            return np.ones(self.n_nodes)
        return np.array(self.model.class_sizes, dtype=np.float64)[self.owner]

    @cached_property
    def places(self) -> IntArray:
        """Number of the cell of each node [N], comparable between commodities."""
        found = np.zeros(self.n_nodes, dtype=np.int64)
        for k, group in enumerate(self.model.classes):
            own = self.owner == k
            graph = group.graph
            layer, x, y = graph.coordinates(self.states[own] % graph.n_places)
            layers = np.array(
                [self.model.problem.layers.index(h) for h in group.spec.motion.layers]
            )
            found[own] = np.ravel_multi_index((layers[layer], x, y), self._cells)
        return found

    @property
    def _cells(self) -> tuple[int, int, int]:
        problem = self.model.problem
        return (len(problem.layers), *problem.height_map.shape)

    def cell(self, place: int) -> Cell:
        """Cell with this number."""
        layer, x, y = (int(i) for i in np.unravel_index(place, self._cells))
        return Cell(x, y, layer)

    def coverage(self) -> sparse.csr_array:
        """Pixels [G, N] that a robot in a node has of each group."""
        n_groups = len(group_weights(self.model.problem))
        rows, columns, pixels = [], [], []
        for k, group in enumerate(self.model.classes):
            own = np.flatnonzero(self.owner == k)
            table = self.model.coverage(group)
            nodes = self.steps[own] * group.graph.n_states + self.states[own]
            which, entries = table.entries(nodes)
            rows.append(table.groups[entries])
            columns.append(own[which])
            pixels.append(table.pixels[entries])
        at = (_joined(rows), _joined(columns))
        values = np.concatenate([np.zeros(0), *pixels])
        return sparse.csr_array((values, at), shape=(n_groups, self.n_nodes))

    # -- back and forth between flows and paths --------------------------------------------

    def amounts(self, paths: Sequence[Path]) -> tuple[FloatArray, FloatArray]:
        """Robots in each node [N] and along each edge [E] for one path per robot."""
        x, y = np.zeros(self.n_nodes), np.zeros(self.n_edges)
        for k, group in enumerate(self.model.classes):
            for robot in group.robots:
                nodes = [self._node(k, t, state) for t, state in enumerate(paths[robot])]
                np.add.at(x, nodes, 1.0)
                for tail, head in pairwise(nodes):
                    low, high = np.searchsorted(self.tails, [tail, tail + 1])
                    y[low + int(np.flatnonzero(self.heads[low:high] == head)[0])] += 1.0
        return x, y

    def _node(self, number: int, t: int, state: int) -> int:
        first, end = np.searchsorted(self.owner, [number, number + 1])
        low, high = first + np.searchsorted(self.steps[first:end], [t, t + 1])
        return int(low + np.searchsorted(self.states[low:high], state))

    def paths(self, y: FloatArray, x: FloatArray | None = None) -> tuple[Path, ...]:
        """One path per robot, each from its own start, that together make a flow.

        Parameters
        ----------
        y : [E] robots along each edge; it may be fractional where x is whole and given: from
            step to step a mixture of assignments of robots to nodes holds one that is whole
        x : [N] robots in each node; None: what y says

        Raises
        ------
        ValueError
            If the flow splits into no paths.
        """
        whole = np.rint(self.supply + self.entering @ y if x is None else x).astype(np.int64)
        paths: dict[int, list[int]] = {}
        for k, group in enumerate(self.model.classes):
            at = [self._node(k, 0, start) for start in group.starts]
            ways = [[node] for node in at]
            for _ in range(self.model.problem.horizon):
                at = self._step(at, whole, y)
                for way, node in zip(ways, at, strict=True):
                    way.append(node)
            for robot, way in zip(group.robots, ways, strict=True):
                paths[robot] = self.states[way].tolist()
        return tuple(tuple(paths[robot]) for robot in range(len(paths)))

    def _step(self, at: list[int], whole: IntArray, y: FloatArray) -> list[int]:
        """Where robots at these nodes go, along used edges, as many to each node as are there."""
        ahead: list[dict[int, float]] = []
        for node in at:
            low, high = np.searchsorted(self.tails, [node, node + 1])
            used = low + np.flatnonzero(y[low:high] > UNUSED)
            ahead.append(dict(zip(self.heads[used].tolist(), self.bonus[used], strict=True)))
        heads = sorted({head for some in ahead for head in some})
        slots = [head for head in heads for _ in range(whole[head])]
        if len(slots) != len(at):
            raise ValueError("the flow is not whole")
        gain = np.array([[some.get(head, -np.inf) for head in slots] for some in ahead])
        # A forbidden edge costs more than all rewards together bring.
        worst = -2.0 * len(at) * (self.largest_bonus or 1.0)
        _, chosen = linear_sum_assignment(np.where(np.isinf(gain), worst, gain), maximize=True)
        if np.isinf(gain[np.arange(len(at)), chosen]).any():
            raise ValueError("the flow is not whole")
        return [slots[k] for k in chosen.tolist()]


def make_flow(model: Model, stop: Stop = never) -> tuple[Flow | None, Limit]:
    """Flow of a model; None and the limit that was reached before it was whole.

    Raises
    ------
    UnsupportedError
        If the time-expanded graph has more than MOST_EDGES edges.
    """
    owner, steps, states, supply, tails, heads = ([] for _ in range(6))
    n_nodes = n_edges = 0
    for k, group in enumerate(model.classes):
        useful = _useful(model, group)
        t, state = np.nonzero(useful)
        own = np.zeros(len(t))
        np.add.at(own, [np.searchsorted(state[t == 0], s) for s in group.starts if useful[0, s]], 1)
        for one, other in _edges(group.graph, useful):
            if (limit := stop()) is not Limit.NONE:
                return None, limit
            n_edges += len(one)
            if n_edges > MOST_EDGES:
                raise UnsupportedError(
                    f"a flow model takes at most {MOST_EDGES} edges of the time-expanded graph, "
                    "here there are more; column-generation takes any number"
                )
            tails.append(n_nodes + one)
            heads.append(n_nodes + other)
        owner.append(np.full(len(t), k))
        steps.append(t)
        states.append(state)
        supply.append(own)
        n_nodes += len(t)
    flow = Flow(
        model, _joined(owner), _joined(steps), _joined(states), _joined(tails),
        _joined(heads), np.concatenate(supply),
    )  # fmt: skip
    return flow, Limit.NONE


def _useful(model: Model, group: RobotClass) -> BoolArray:
    """States [T+1, S] on a path from one of the starts to the end (or the goal)."""
    graph, horizon = group.graph, model.problem.horizon
    to_go = graph.backward_sweep(graph.no_reward(horizon), goal=group.goal)
    found: BoolArray = graph.reachable(group.starts, horizon) & (to_go > CLOSED)
    return found


def _edges(graph: TimeGraph, useful: BoolArray) -> Iterator[tuple[IntArray, IntArray]]:
    """Tails and heads of the edges of each step, as numbers of useful nodes; by tail, head."""
    turns = _padded(graph.turns)
    first = 0
    for here, there in pairwise(useful):
        tails = np.flatnonzero(here)
        orientation, place = np.divmod(tails, graph.n_places)
        moved = graph.neighbours.T[place][:, None, :]  # [n, 1, K]
        turned = turns[orientation][:, :, None]  # [n, M, 1]
        heads = np.where((moved >= 0) & (turned >= 0), turned * graph.n_places + moved, -1)
        heads = heads.reshape(len(tails), turns.shape[1] * len(graph.neighbours))
        open_ = (heads >= 0) & there[heads]
        which, head = np.nonzero(open_)[0], heads[open_]
        order = np.lexsort((head, which))
        ahead = first + len(tails)
        number = np.cumsum(there) - 1
        yield first + which[order], ahead + number[head[order]]
        first = ahead


def _padded(turns: Sequence[Sequence[int]]) -> IntArray:
    """Orientations that each orientation can turn to [O, M]; -1 where there are fewer."""
    table = np.full((len(turns), max(map(len, turns))), -1, dtype=np.int64)
    for row, some in zip(table, turns, strict=True):
        row[: len(some)] = some
    return table


def _joined(parts: Sequence[IntArray]) -> IntArray:
    return np.concatenate([np.zeros(0, dtype=np.int64), *parts])


def _incidence(rows: IntArray, columns: IntArray, shape: tuple[int, int]) -> sparse.csr_array:
    return sparse.csr_array((np.ones(len(rows)), (rows, columns)), shape=shape)


# -- roots -------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Roots:
    """The groups that count and that somebody can see, in units of each one's best view."""

    used: IntArray  # [g] groups
    scale: FloatArray  # [g] px^0.5/m, root of the best single view
    largest: FloatArray  # [C, g] px^0.5/m, of each class, views that lead nowhere as well
    weights: FloatArray  # [g] of the root in these units
    pixels: sparse.csr_array  # [g, N] in units of scale^2
    seen: sparse.csr_array  # [g, N] roots of pixels

    @classmethod
    def of(cls, flow: Flow) -> "Roots":
        """Groups of a flow."""
        coverage = flow.coverage()
        weights = group_weights(flow.model.problem)
        best = np.asarray(coverage.max(axis=1).todense()).ravel()
        used = np.flatnonzero((best > 0) & (weights > 0))
        scale = np.sqrt(best[used])
        pixels = sparse.csr_array(sparse.diags_array(1 / scale**2) @ coverage[used])
        largest = largest_roots(flow.model)[:, used]
        return cls(used, scale, largest, weights[used] * scale, pixels, pixels.sqrt())

    def entries(self, g: int) -> tuple[IntArray, FloatArray]:
        """Nodes that see a group, and their roots px^0.5/m."""
        part = slice(self.seen.indptr[g], self.seen.indptr[g + 1])
        nodes: IntArray = self.seen.indices[part].astype(np.int64)
        return nodes, self.seen.data[part] * self.scale[g]


def cut_rows(
    flow: Flow, roots: Roots, cuts: Sequence[Cut]
) -> tuple[sparse.csr_array, FloatArray, IntArray]:
    """Envelope cuts as rows, in units of the roots.

    Returns
    -------
    phi of the nodes [k, N], constants [k], and each cut's position among `roots.used` [k].
    """
    where = np.searchsorted(roots.used, [cut.group for cut in cuts]).astype(np.int64)
    entries = [roots.entries(g) for g in where.tolist()]
    scales = roots.scale[where]
    data = [
        cut.phi_of(flow.owner[nodes], seen) / scale
        for cut, (nodes, seen), scale in zip(cuts, entries, scales, strict=True)
    ]
    parts = (
        np.concatenate([np.zeros(0), *data]),
        np.concatenate([np.zeros(0, dtype=np.int64), *(nodes for nodes, _ in entries)]),
        np.cumsum([0, *(len(nodes) for nodes, _ in entries)]),
    )
    rows = sparse.csr_array(parts, shape=(len(cuts), flow.n_nodes))
    return rows, np.array([cut.constant for cut in cuts]) / scales, where


# -- collision rules ---------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class ConflictRows:
    """At most one robot in each row; rows that only one robot can reach are left out."""

    flow: Flow
    slots: IntArray  # [K] places at steps, t (number of places) + place
    occupied: sparse.csr_array  # [K, N] 1 where a node lies in a slot
    cliques: sparse.csr_array  # [rows, K] slots of which at most one robot is in any
    swaps: IntArray  # [W, 3] t and the two places
    crossing: sparse.csr_array  # [W, E] 1 where an edge moves between the two

    @property
    def at_nodes(self) -> sparse.csr_array:
        """Clique rows over nodes [rows, N]."""
        return sparse.csr_array(self.cliques @ self.occupied)

    def resource(self, row: int) -> Resource:
        """What a row is about; cliques are numbered first, then swaps."""
        if row >= self.cliques.shape[0]:
            t, one, other = self.swaps[row - self.cliques.shape[0]].tolist()
            return Swap(t, (self.flow.cell(one), self.flow.cell(other)))
        members = self.cliques.indices[self.cliques.indptr[row] : self.cliques.indptr[row + 1]]
        steps, places = np.divmod(self.slots[members], _n_places(self.flow))
        return Cells(int(steps[0]), tuple(sorted(map(self.flow.cell, places.tolist()))))

    def multipliers(self, values: FloatArray, least: float) -> tuple[tuple[Resource, float], ...]:
        """Rows with their multipliers, but for those that are too small to matter."""
        large = np.flatnonzero(values > least).tolist()
        return tuple((self.resource(row), float(values[row])) for row in large)


def conflict_rows(flow: Flow) -> ConflictRows:
    """All rows of a problem's collision rules.

    Raises
    ------
    UnsupportedError
        If the separation needs more than MOST_ENTRIES entries.
    """
    problem = flow.model.problem
    n_places, n_robots = _n_places(flow), len(problem.robots)
    later = np.flatnonzero(flow.steps > 0)
    if problem.rules.none or n_robots < 2:
        later = later[:0]
    slots, at = np.unique(flow.steps[later] * n_places + flow.places[later], return_inverse=True)
    occupied = _incidence(at, later, (len(slots), flow.n_nodes))
    reach = _reach(flow, slots)
    cliques = sparse.csr_array(_cliques(problem, slots, n_places))
    shared = np.asarray((cliques @ reach > 0).sum(axis=1)).ravel() > 1
    swaps, crossing = np.zeros((0, 3), dtype=np.int64), sparse.csr_array((0, flow.n_edges))
    if problem.rules.swap and len(slots):
        swaps, crossing = _swaps(flow, slots, reach)
    return ConflictRows(flow, slots, occupied, cliques[shared], swaps, crossing)


def _n_places(flow: Flow) -> int:
    problem = flow.model.problem
    width, depth = problem.height_map.shape
    return len(problem.layers) * width * depth


def _reach(flow: Flow, slots: IntArray) -> sparse.csr_array:
    """1 where a robot can be in a slot [K, R]."""
    problem, n_places = flow.model.problem, _n_places(flow)
    rows, columns = [], []
    for k, group in enumerate(flow.model.classes):
        own = np.flatnonzero(flow.owner == k)
        for robot, start in zip(group.robots, group.starts, strict=True):
            seen = group.graph.reachable([start], problem.horizon)
            mine = own[seen[flow.steps[own], flow.states[own]]]
            found = np.unique(flow.steps[mine] * n_places + flow.places[mine])
            at = np.flatnonzero(np.isin(slots, found))
            rows.append(at)
            columns.append(np.full(len(at), robot))
    shape = (len(slots), len(problem.robots))
    return _incidence(_joined(rows), _joined(columns), shape)


def _cliques(problem: Problem, slots: IntArray, n_places: int) -> sparse.csr_array:
    """Sets of slots, any two too close, that hold all pairs of slots that are too close."""
    if not problem.rules.separation or not len(slots):
        return sparse.eye_array(len(slots), format="csr")
    if problem.height_map.datum is not None:
        return _pairs_too_close(problem, slots, n_places)
    sizes = (len(problem.layers), *problem.height_map.shape)
    t, place = np.divmod(slots, n_places)
    layer, x, y = np.unravel_index(place, sizes)
    blocks, entries = [], 0
    for shape in _shapes(problem):
        # A shape is laid wherever one of its cells falls into a slot.
        laid = [np.column_stack([t, x - i, y - j])[layer == k] for k, i, j in shape]
        origins = np.unique(np.concatenate(laid), axis=0)
        rows, columns = [], []
        for k, i, j in shape:
            u, v = origins[:, 1] + i, origins[:, 2] + j
            inside = np.flatnonzero((u >= 0) & (u < sizes[1]) & (v >= 0) & (v < sizes[2]))
            level = np.full(len(inside), k)
            wanted = np.ravel_multi_index((level, u[inside], v[inside]), sizes)
            wanted += origins[inside, 0] * n_places
            at = np.minimum(np.searchsorted(slots, wanted), len(slots) - 1)
            found = slots[at] == wanted
            rows.append(inside[found])
            columns.append(at[found])
        entries += sum(map(len, rows))
        if entries > MOST_ENTRIES:
            raise UnsupportedError(
                f"a flow model takes at most {MOST_ENTRIES} entries of separation rows, here "
                "there are more; column-generation adds the few that matter"
            )
        blocks.append(_incidence(_joined(rows), _joined(columns), (len(origins), len(slots))))
    return _distinct(sparse.csr_array(sparse.vstack(blocks)))


def _pairs_too_close(problem: Problem, slots: IntArray, n_places: int) -> sparse.csr_array:
    """The slots, and all two of one step that are too close: what fits any terrain."""
    sizes = (len(problem.layers), *problem.height_map.shape)
    t, place = np.divmod(slots, n_places)
    layer, x, y = np.unravel_index(place, sizes)
    cells = [Cell(*at) for at in zip(x.tolist(), y.tolist(), layer.tolist(), strict=True)]
    altitude = problem.height_map.altitudes(problem.layers)[layer, x, y]
    # Steps are put so far apart that no two of different steps are near.
    apart = 2 * problem.rules.separation
    size = problem.height_map.resolution
    points = np.column_stack([x * size, y * size, altitude, t * apart])
    reach = problem.rules.separation * (1 + 1e-9)
    tree = cKDTree(points)
    if tree.count_neighbors(tree, reach) > MOST_ENTRIES:
        raise UnsupportedError(
            f"a flow model takes at most {MOST_ENTRIES} entries of separation rows, here "
            "there are more; column-generation adds the few that matter"
        )
    near = tree.query_pairs(reach, output_type="ndarray").tolist()
    pairs = [(a, b) for a, b in near if problem.too_close(cells[a], cells[b])]
    one, other = np.array(pairs, dtype=np.int64).reshape(-1, 2).T
    number = np.arange(len(pairs))
    rows, columns = np.concatenate([number, number]), np.concatenate([one, other])
    alone = sparse.eye_array(len(slots), format="csr")
    return sparse.csr_array(
        sparse.vstack([alone, _incidence(rows, columns, (len(pairs), len(slots)))])
    )


Shape = list[tuple[int, int, int]]  # (layer, cells along x, cells along y)


def _shapes(problem: Problem) -> list[Shape]:
    """Cliques of cells that, laid anywhere, hold every two cells that are too close.

    The pairs that are farthest apart come first: what lies between them is too close to
    both and to most of the rest.
    """
    layers, (width, depth) = range(len(problem.layers)), problem.height_map.shape
    near = np.array(
        [
            problem.too_close(Cell(0, 0, a), Cell(i, j, b))
            for a, b, i, j in product(layers, layers, range(width), range(depth))
        ]
    ).reshape(len(layers), len(layers), width, depth)
    reach = (np.arange(1 - width, width), np.arange(1 - depth, depth))
    box = np.array(list(product(layers, *reach)), dtype=np.int64)  # [n, 3]
    heights = np.array(problem.layers) / problem.height_map.resolution
    covered = np.zeros((len(layers), len(layers), 2 * width - 1, 2 * depth - 1), dtype=bool)
    pairs = [
        (-float(np.hypot(np.hypot(i, j), heights[b] - heights[a])), a, b, int(i), int(j))
        for a, (b, i, j) in product(layers, box.tolist())
        if (a, 0, 0) <= (b, i, j) and near[a, b, abs(i), abs(j)]
    ]
    shapes = []
    for _, a, b, i, j in sorted(pairs):
        if covered[a, b, i + width - 1, j + depth - 1]:
            continue
        shape = _clique(near, box, heights, (a, 0, 0), (b, i, j))
        shapes.append([(int(k), int(u), int(v)) for k, u, v in shape])
        for k, u, v in shape:
            away = shape - (0, u, v)
            inside = (np.abs(away[:, 1]) < width) & (np.abs(away[:, 2]) < depth)
            level, du, dv = away[inside].T
            covered[k, level, du + width - 1, dv + depth - 1] = True
    return shapes


def _clique(
    near: BoolArray,
    box: IntArray,
    heights: FloatArray,
    one: tuple[int, int, int],
    other: tuple[int, int, int],
) -> IntArray:
    """Cells [n, 3], any two too close, with two given ones: from their middle outwards."""
    ends = np.array([one, other], dtype=np.int64)
    middle = ends[:, 1:].mean(axis=0)
    away = np.column_stack([box[:, 1:] - middle, heights[box[:, 0]] - heights[ends[:, 0]].mean()])
    candidates = box[np.argsort(np.linalg.norm(away, axis=1), kind="stable")]

    def close_to(cell: IntArray) -> BoolArray:
        gap = np.abs(candidates - cell)
        inside = (gap[:, 1] < near.shape[2]) & (gap[:, 2] < near.shape[3])
        found: BoolArray = (
            inside & near[cell[0], candidates[:, 0], gap[:, 1] * inside, gap[:, 2] * inside]
        )
        return found

    chosen = list(np.unique(ends, axis=0))
    open_ = np.logical_and.reduce([close_to(end) for end in chosen])
    open_ &= ~(candidates[:, None] == ends[None]).all(axis=2).any(axis=1)
    while open_.any():
        cell = candidates[np.argmax(open_)]
        chosen.append(cell)
        open_ &= close_to(cell) & (candidates != cell).any(axis=1)
    return np.array(chosen)


def _distinct(rows: sparse.csr_array) -> sparse.csr_array:
    """Rows of 0 and 1 without repetitions; sets are told apart by a sum of random numbers."""
    marks = np.random.default_rng(0).random((rows.shape[1], 2))
    _, first = np.unique(np.round(rows @ marks, 9), axis=0, return_index=True)
    return sparse.csr_array(rows[np.sort(first)])


def _swaps(
    flow: Flow, slots: IntArray, reach: sparse.csr_array
) -> tuple[IntArray, sparse.csr_array]:
    """Moves [W, 3] between two cells, either way, in which two robots can meet."""
    one, other = flow.places[flow.tails], flow.places[flow.heads]
    moving = np.flatnonzero(one != other)
    one, other = one[moving], other[moving]
    keys = np.column_stack(
        [flow.steps[flow.tails[moving]], np.minimum(one, other), np.maximum(one, other)]
    )
    pairs, at = np.unique(keys, axis=0, return_inverse=True)
    both = np.zeros((len(pairs), 2), dtype=bool)
    both[at, (one < other).astype(np.int64)] = True
    crossing = _incidence(at, moving, (len(pairs), flow.n_edges))
    kept = np.flatnonzero(both.all(axis=1))
    t, *ends = pairs[kept].T
    one, other = (reach[np.searchsorted(slots, (t + 1) * _n_places(flow) + end)] for end in ends)
    kept = kept[np.asarray((one + other > 0).sum(axis=1)).ravel() > 1]
    return pairs[kept], sparse.csr_array(crossing[kept])
