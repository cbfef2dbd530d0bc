"""Collision rules as rows of a flow: cliques of cells or moves, each used by at most one robot.

All moves that come closer to a point than half the separation, at the same moment of a step, form a
clique (`CollisionRules.near_point`).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np
from scipy import sparse
from scipy.spatial import cKDTree

from cocap_opt.data import BoolArray, FloatArray, IntArray
from cocap_opt.formulations.certificates.resources import MOST_MOVES, Cells, Moves, Resource, Swap
from cocap_opt.formulations.relaxations.flow import Flow
from cocap_opt.model import Model
from cocap_opt.problem import Cell, Problem
from cocap_opt.problem.rules import Meeting
from cocap_opt.result import UnsupportedError

_Move = tuple[Cell, Cell]


class CliquesOfMoves:
    """The cliques of moves of a problem with a separation."""

    def __init__(self, model: Model) -> None:
        self._model, self._rules = model, model.problem.rules

    def conflicts(self, moves: Sequence[_Move]) -> tuple[BoolArray, BoolArray]:
        """Returns two arrays [n, n], True for pairs of moves of a step that conflict.

        Returns
        -------
        Conflicts of any kind, and conflicts that occur only between the steps.
        """
        tails, heads = (self._model.problem.positions([m[k] for m in moves]) for k in (0, 1))
        pairs = (tails[:, None], heads[:, None]), (tails[None], heads[None])
        return self._rules.moves_conflict(*pairs), self._rules.conflict_between(*pairs)

    def around(self, first: _Move, second: _Move) -> tuple[_Move, ...]:
        """Returns a clique that contains two conflicting moves: all moves near the point where
        these two are closest.

        It contains moves of all classes; if there are too many, only those nearest to that point.
        """
        meeting, found = self._meeting(first, second), dict[_Move, float]()
        for number, robot_class in enumerate(self._model.classes):
            cells = self._model.places.cells[number]
            moves, far = self._model.places.moves_through(robot_class, meeting, first)
            between = ((cells[tail], cells[head]) for tail, head in moves.tolist())
            found |= dict(zip(between, far.tolist(), strict=True))
        nearest = sorted(found, key=lambda move: (found[move], move))[:MOST_MOVES]
        return tuple(sorted(nearest)) if {first, second} <= set(nearest) else (first, second)

    def among(self, first: _Move, second: _Move, tails: FloatArray, heads: FloatArray) -> IntArray:
        """Returns the positions of the moves [n] that form a clique with two given moves.

        Parameters
        ----------
        tails, heads : [n, 3] m, positions at which the moves begin and end
        """
        ways = self._meeting(first, second).ways(tails, heads)
        return np.flatnonzero(self._rules.near_point(ways))

    def _meeting(self, first: _Move, second: _Move) -> Meeting:
        ends = zip(first, second, strict=True)
        return self._rules.meeting(*(self._model.problem.positions(cells) for cells in ends))


MOST_ENTRIES = 500_000  # entries of the separation rows
TOO_MANY_ENTRIES = (
    f"a flow model takes at most {MOST_ENTRIES} entries of separation rows; this scene has more. "
    "Solve it by column-generation, which adds only the rows that matter; to export it, use an "
    ".instance, which has the rules and not their rows"
)
MOST_PASSING = 1_500  # moves of one step for which rows enforce the separation

# Sets of moves of which at most one robot makes any [W], and a matrix [W, E] with 1 where an edge
# is one of these moves.
_MoveRows = tuple[tuple[Swap | Moves, ...], sparse.csr_array]


@dataclass(frozen=True, eq=False)
class ConflictRows:
    """Rows "at most one robot"; rows that only one robot can reach are omitted."""

    flow: Flow
    slots: "_Slots"
    occupied: sparse.csr_array  # [K, N] 1 where a node lies in a slot
    cliques: sparse.csr_array  # [rows, K] at most one robot is in any of these slots
    moves: tuple[Swap | Moves, ...]  # [W] at most one robot makes any of these moves
    crossing: sparse.csr_array  # [W, E] 1 where an edge is one of these moves

    @classmethod
    def of(cls, flow: Flow) -> "ConflictRows":
        """Returns all rows of a problem's collision rules.

        Raises
        ------
        UnsupportedError
            If the separation needs more than MOST_ENTRIES entries.
        """
        problem = flow.model.problem
        # Fixed starts obey the rules, so rows begin at step 1.
        later = np.flatnonzero(flow.steps >= (0 if problem.has_free_starts else 1))
        if problem.rules.none or len(problem.robots) < 2:
            later = later[:0]
        slots = _Slots.of(flow, later)
        at = np.searchsorted(slots.numbers, slots.number_of(flow, later))
        reach = slots.reach(flow)
        cliques = sparse.csr_array(_cliques_of_cells(problem, slots))
        shared = np.asarray((cliques @ reach > 0).sum(axis=1)).ravel() > 1
        moves: _MoveRows = ((), sparse.csr_array((0, flow.n_edges)))
        if problem.rules.separation and len(slots):
            moves = _passing_moves(flow)
        elif problem.rules.swap and len(slots):
            moves = _swaps(flow, slots, reach)
        return cls(
            flow=flow,
            slots=slots,
            occupied=_incidence(at, later, (len(slots), flow.n_nodes)),
            cliques=cliques[shared],
            moves=moves[0],
            crossing=moves[1],
        )

    @property
    def at_nodes(self) -> sparse.csr_array:
        """Clique rows over nodes [rows, N]."""
        return sparse.csr_array(self.cliques @ self.occupied)

    def resource(self, row: int) -> Resource:
        """Returns the resource of a row; cliques of cells are numbered first, then moves."""
        if row >= self.cliques.shape[0]:
            return self.moves[row - self.cliques.shape[0]]
        members = self.cliques.indices[self.cliques.indptr[row] : self.cliques.indptr[row + 1]]
        cells = sorted(self.slots.cell(k) for k in members.tolist())
        return Cells(int(self.slots.t[members[0]]), tuple(cells))

    def multipliers(self, values: FloatArray, least: float) -> tuple[tuple[Resource, float], ...]:
        """Returns the rows whose multipliers are large enough to matter."""
        large = np.flatnonzero(values > least).tolist()
        return tuple((self.resource(row), float(values[row])) for row in large)


# -- cells at steps -----------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _Slots:
    """Cells at steps that robots can be in, each numbered t (number of cells) + cell."""

    numbers: IntArray  # [K] increasing
    sizes: tuple[int, int, int]  # layers, width and depth of the map

    @classmethod
    def of(cls, flow: Flow, nodes: IntArray) -> "_Slots":
        """Returns the slots of the given nodes."""
        problem = flow.model.problem
        sizes = (len(problem.layers), *problem.height_map.shape)
        return cls(np.unique(flow.steps[nodes] * math.prod(sizes) + flow.places[nodes]), sizes)

    def __len__(self) -> int:
        return len(self.numbers)

    @property
    def n_cells(self) -> int:
        """Number of cells of the map, in all layers."""
        return math.prod(self.sizes)

    @cached_property
    def t(self) -> IntArray:
        """Step of each slot [K]."""
        return self.numbers // self.n_cells

    @cached_property
    def at(self) -> IntArray:
        """Layer, x and y of each slot [3, K]."""
        return np.array(np.unravel_index(self.numbers % self.n_cells, self.sizes))

    def cell(self, k: int) -> Cell:
        """Returns the cell of slot k."""
        layer, x, y = self.at[:, k].tolist()
        return Cell(x, y, layer)

    def number_of(self, flow: Flow, nodes: IntArray) -> IntArray:
        """Returns the slot numbers [n] of the given nodes."""
        numbers: IntArray = flow.steps[nodes] * self.n_cells + flow.places[nodes]
        return numbers

    def find(self, t: IntArray, layer: int, x: IntArray, y: IntArray) -> tuple[IntArray, IntArray]:
        """Returns the positions of those cells [n] at steps t that are slots, and the slots."""
        _, width, depth = self.sizes
        inside = np.flatnonzero((x >= 0) & (x < width) & (y >= 0) & (y < depth))
        level = np.full(len(inside), layer)
        wanted = np.ravel_multi_index((level, x[inside], y[inside]), self.sizes)
        wanted += t[inside] * self.n_cells
        slots = np.minimum(np.searchsorted(self.numbers, wanted), len(self) - 1)
        found = self.numbers[slots] == wanted
        return inside[found], slots[found]

    def reach(self, flow: Flow) -> sparse.csr_array:
        """Returns 1 where a robot can be in a slot [K, R]."""
        problem = flow.model.problem
        rows, columns = [], []
        for k, robot_class in enumerate(flow.model.classes):
            of_class = np.flatnonzero((flow.owner == k) & ~flow.is_source)
            for robot, starts in zip(robot_class.robots, robot_class.starts, strict=True):
                reached = robot_class.graph.reachable(starts, problem.horizon)
                mine = of_class[reached[flow.steps[of_class], flow.states[of_class]]]
                at = np.flatnonzero(np.isin(self.numbers, self.number_of(flow, mine)))
                rows.append(at)
                columns.append(np.full(len(at), robot))
        shape = (len(self), len(problem.robots))
        return _incidence(np.concatenate(rows), np.concatenate(columns), shape)


def _incidence(rows: IntArray, columns: IntArray, shape: tuple[int, int]) -> sparse.csr_array:
    """Returns a matrix with ones at the given rows [n] and columns [n]."""
    return sparse.csr_array((np.ones(len(rows)), (rows, columns)), shape=shape)


# -- cliques of cells: at most one robot is in any of them at a step -------------------------


def _cliques_of_cells(problem: Problem, slots: _Slots) -> sparse.csr_array:
    """Returns sets of slots that contain all pairs that are too close, and no other pairs."""
    if not problem.rules.separation or not len(slots):
        return sparse.eye_array(len(slots), format="csr")
    if problem.height_map.is_uneven:
        return _pairs_too_close(problem, slots)
    blocks, entries = [], 0
    for shape in _shapes(problem):
        block = _laid(shape, slots)
        entries += block.nnz
        if entries > MOST_ENTRIES:
            raise UnsupportedError(TOO_MANY_ENTRIES)
        blocks.append(block)
    return _distinct(sparse.csr_array(sparse.vstack(blocks)))


def _laid(shape: "_Shape", slots: _Slots) -> sparse.csr_array:
    """Returns a shape in all positions in which at least one of its cells is a slot [rows, K]."""
    layer, x, y = slots.at
    laid = [np.column_stack([slots.t, x - i, y - j])[layer == k] for k, i, j in shape]
    origins = np.unique(np.concatenate(laid), axis=0)
    t, u, v = origins.T
    found = [slots.find(t, k, u + i, v + j) for k, i, j in shape]
    rows, columns = (np.concatenate(part) for part in zip(*found, strict=True))
    return _incidence(rows, columns, (len(origins), len(slots)))


def _pairs_too_close(problem: Problem, slots: _Slots) -> sparse.csr_array:
    """Returns the slots, and all pairs of slots of a step that are too close; works on any
    terrain.
    """
    layer, x, y = slots.at
    altitude = problem.height_map.altitudes(problem.layers)[layer, x, y]
    # Steps are placed so far apart that no two slots of different steps are close.
    apart = 2 * math.hypot(problem.rules.separation, problem.rules.vertical)
    size = problem.height_map.resolution
    at = np.column_stack([x * size, y * size, altitude])
    tree = cKDTree(np.column_stack([at, slots.t * apart]))
    reach = math.hypot(problem.rules.separation, problem.rules.vertical) * (1 + 1e-9)
    if tree.count_neighbors(tree, reach) > MOST_ENTRIES:
        raise UnsupportedError(TOO_MANY_ENTRIES)
    first, second = tree.query_pairs(reach, output_type="ndarray").T
    near = np.flatnonzero(problem.rules.too_near(at[second] - at[first]))
    first, second, number = first[near], second[near], np.arange(len(near))
    rows, columns = np.concatenate([number, number]), np.concatenate([first, second])
    alone = sparse.eye_array(len(slots), format="csr")
    return sparse.csr_array(
        sparse.vstack([alone, _incidence(rows, columns, (len(near), len(slots)))])
    )


_Shape = list[tuple[int, int, int]]  # (layer, cells along x, cells along y)


def _shapes(problem: Problem) -> list[_Shape]:
    """Returns cliques of cells that, shifted over the map, contain all pairs that are too close.

    The pairs that are farthest apart come first: a cell between them is too close to both and
    to most other cells.
    """
    layers, (width, depth) = range(len(problem.layers)), problem.height_map.shape
    size, up = problem.height_map.resolution, np.array(problem.layers)
    ways = np.zeros((len(layers), len(layers), width, depth, 3))
    ways[..., 0], ways[..., 1] = np.arange(width)[:, None] * size, np.arange(depth) * size
    ways[..., 2] = (up - up[:, None])[:, :, None, None]
    near = problem.rules.too_near(ways)
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
    first: tuple[int, int, int],
    second: tuple[int, int, int],
) -> IntArray:
    """Returns a clique of cells [n, 3] around two of them, grown outwards from their middle.

    Parameters
    ----------
    near : [layers, layers, width, depth] True if two cells with this offset are too close
    box : [m, 3] candidates: layer, cells along x and along y
    heights : heights of the layers, in cells
    """
    ends = np.array([first, second], dtype=np.int64)
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
    """Returns rows of 0 and 1 without duplicates, which are identified by sums of random
    numbers.
    """
    marks = np.random.default_rng(0).random((rows.shape[1], 2))
    _, first = np.unique(np.round(rows @ marks, 9), axis=0, return_index=True)
    return sparse.csr_array(rows[np.sort(first)])


# -- moves -------------------------------------------------------------------------------------


def _passing_moves(flow: Flow) -> _MoveRows:
    """Returns cliques of moves that contain all pairs that are too close only between the steps."""
    moving = np.flatnonzero(~flow.is_source[flow.tails])
    places = np.column_stack([flow.places[flow.tails], flow.places[flow.heads]])[moving]
    distinct, which = np.unique(places, axis=0, return_inverse=True)
    if len(distinct) > MOST_PASSING:
        raise UnsupportedError(TOO_MANY_ENTRIES)
    moves = [(flow.cell(tail), flow.cell(head)) for tail, head in distinct.tolist()]
    used = _incidence(which, moving, (len(moves), flow.n_edges))
    return _passing_at_steps(flow, moves, used, _passing_cliques(flow.model, moves))


def _passing_cliques(model: Model, moves: list[tuple[Cell, Cell]]) -> list[IntArray]:
    """Returns cliques of moves, by number, that contain all pairs that conflict between the
    steps.
    """
    cliques, problem = CliquesOfMoves(model), model.problem
    ends = [problem.positions([move[k] for move in moves]) for k in (0, 1)]
    left, found = np.triu(cliques.conflicts(moves)[1]), list[IntArray]()
    for first in range(len(moves)):
        for second in np.flatnonzero(left[first]).tolist():
            if left[first, second]:
                clique = cliques.among(moves[first], moves[second], *ends)
                if not np.isin([first, second], clique).all():
                    clique = np.array([first, second])
                found.append(clique)
                left[np.ix_(clique, clique)] = False
    return found


def _passing_at_steps(
    flow: Flow, moves: list[tuple[Cell, Cell]], used: sparse.csr_array, cliques: list[IntArray]
) -> _MoveRows:
    """Returns the rows of cliques, which are the same at all steps, for steps at which two of their
    moves are possible.

    Parameters
    ----------
    used : [moves, E] 1 where an edge is the move
    """
    members = [np.full(len(clique), k) for k, clique in enumerate(cliques)]
    rows, columns = (
        np.concatenate([np.zeros(0, dtype=np.int64), *part]) for part in (members, cliques)
    )
    member = _incidence(rows, columns, (len(cliques), len(moves)))
    resources, blocks, entries = list[Swap | Moves](), [sparse.csr_array((0, flow.n_edges))], 0
    steps = flow.steps[flow.tails]
    for t in np.unique(steps).tolist():
        at_step = sparse.dia_array(
            ((steps == t)[None].astype(float), [0]), shape=used.shape[1:] * 2
        )
        then = sparse.csr_array(used @ at_step)
        present = np.asarray(then.sum(axis=1)).ravel() > 0
        counts = member @ present
        kept = np.flatnonzero(counts > 1)
        blocks.append(sparse.csr_array((member[kept] @ then) > 0).astype(np.float64))
        entries += blocks[-1].nnz
        if entries > MOST_ENTRIES:
            raise UnsupportedError(TOO_MANY_ENTRIES)
        for k in kept.tolist():
            resources.append(Moves(t, tuple(moves[n] for n in cliques[k].tolist() if present[n])))
    return tuple(resources), sparse.csr_array(sparse.vstack(blocks))


def _swaps(flow: Flow, slots: _Slots, reach: sparse.csr_array) -> _MoveRows:
    """Returns the swaps, in either direction, that the edges of a flow allow."""
    first, second = flow.places[flow.tails], flow.places[flow.heads]
    moving = np.flatnonzero((first != second) & ~flow.is_source[flow.tails])
    first, second = first[moving], second[moving]
    keys = np.column_stack(
        [flow.steps[flow.tails[moving]], np.minimum(first, second), np.maximum(first, second)]
    )
    pairs, at = np.unique(keys, axis=0, return_inverse=True)
    both = np.zeros((len(pairs), 2), dtype=bool)
    both[at, (first < second).astype(np.int64)] = True
    crossing = _incidence(at, moving, (len(pairs), flow.n_edges))
    kept = np.flatnonzero(both.all(axis=1))
    t, *ends = pairs[kept].T
    first, second = (
        reach[np.searchsorted(slots.numbers, (t + 1) * slots.n_cells + end)] for end in ends
    )
    kept = kept[np.asarray((first + second > 0).sum(axis=1)).ravel() > 1]
    resources = [Swap(t, (flow.cell(a), flow.cell(b))) for t, a, b in pairs[kept].tolist()]
    return tuple(resources), sparse.csr_array(crossing[kept])
