"""Collision rules as rows of a flow: cliques of cells or moves, of which one robot uses one."""

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from cocap_opt.data import FloatArray, IntArray
from cocap_opt.formulations.certificates.resources import Cells, Moves, Resource, Swap
from cocap_opt.formulations.relaxations.cell_cliques import (
    MOST_ENTRIES,
    TOO_MANY_ENTRIES,
    cliques_of_cells,
)
from cocap_opt.formulations.relaxations.flow import Flow
from cocap_opt.formulations.relaxations.move_cliques import CliquesOfMoves
from cocap_opt.formulations.relaxations.slots import Slots, incidence
from cocap_opt.model import Model
from cocap_opt.problem import Cell
from cocap_opt.result import UnsupportedError

MOST_PASSING = 1_500  # moves of one step, between which the separation is held by rows

# Moves of which at most one robot makes any [W], and 1 where an edge is one of these [W, E].
_MoveRows = tuple[tuple[Swap | Moves, ...], sparse.csr_array]


@dataclass(frozen=True, eq=False)
class ConflictRows:
    """Rows "at most one robot"; those that only one robot can reach are left out."""

    flow: Flow
    slots: Slots
    occupied: sparse.csr_array  # [K, N] 1 where a node lies in a slot
    cliques: sparse.csr_array  # [rows, K] slots of which at most one robot is in any
    moves: tuple[Swap | Moves, ...]  # [W] of which at most one robot makes any
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
        later = np.flatnonzero(flow.steps > 0)
        if problem.rules.none or len(problem.robots) < 2:
            later = later[:0]
        slots = Slots.of(flow, later)
        at = np.searchsorted(slots.numbers, slots.number_of(flow, later))
        reach = slots.reach(flow)
        cliques = sparse.csr_array(cliques_of_cells(problem, slots))
        shared = np.asarray((cliques @ reach > 0).sum(axis=1)).ravel() > 1
        moves: _MoveRows = ((), sparse.csr_array((0, flow.n_edges)))
        if problem.rules.separation and len(slots):
            moves = _passing_moves(flow)
        elif problem.rules.swap and len(slots):
            moves = _swaps(flow, slots, reach)
        return cls(
            flow=flow,
            slots=slots,
            occupied=incidence(at, later, (len(slots), flow.n_nodes)),
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
        """Returns the rows with multipliers that are large enough to matter."""
        large = np.flatnonzero(values > least).tolist()
        return tuple((self.resource(row), float(values[row])) for row in large)


# -- moves -------------------------------------------------------------------------------------


def _passing_moves(flow: Flow) -> _MoveRows:
    """Returns cliques of moves that hold all pairs that are too near between two steps only."""
    places = np.column_stack([flow.places[flow.tails], flow.places[flow.heads]])
    distinct, which = np.unique(places, axis=0, return_inverse=True)
    if len(distinct) > MOST_PASSING:
        raise UnsupportedError(TOO_MANY_ENTRIES)
    moves = [(flow.cell(tail), flow.cell(head)) for tail, head in distinct.tolist()]
    used = incidence(which, np.arange(flow.n_edges), (len(moves), flow.n_edges))
    return _passing_at_steps(flow, moves, used, _passing_cliques(flow.model, moves))


def _passing_cliques(model: Model, moves: list[tuple[Cell, Cell]]) -> list[IntArray]:
    """Returns cliques of moves, by their numbers, which hold all pairs that conflict on the way."""
    cliques, problem = CliquesOfMoves(model), model.problem
    ends = [problem.positions([move[k] for move in moves]) for k in (0, 1)]
    left, found = np.triu(cliques.conflicts(moves)[1]), list[IntArray]()
    for one in range(len(moves)):
        for other in np.flatnonzero(left[one]).tolist():
            if left[one, other]:
                clique = cliques.among(moves[one], moves[other], *ends)
                if not np.isin([one, other], clique).all():
                    clique = np.array([one, other])
                found.append(clique)
                left[np.ix_(clique, clique)] = False
    return found


def _passing_at_steps(
    flow: Flow, moves: list[tuple[Cell, Cell]], used: sparse.csr_array, cliques: list[IntArray]
) -> _MoveRows:
    """Returns the rows of cliques, which serve all steps, where two of their moves are possible.

    Parameters
    ----------
    used : [moves, E] 1 where an edge is a move
    """
    members = [np.full(len(clique), k) for k, clique in enumerate(cliques)]
    rows, columns = (
        np.concatenate([np.zeros(0, dtype=np.int64), *part]) for part in (members, cliques)
    )
    own = incidence(rows, columns, (len(cliques), len(moves)))
    resources, blocks, entries = list[Swap | Moves](), [sparse.csr_array((0, flow.n_edges))], 0
    steps = flow.steps[flow.tails]
    for t in np.unique(steps).tolist():
        at_step = sparse.dia_array(
            ((steps == t)[None].astype(float), [0]), shape=used.shape[1:] * 2
        )
        then = sparse.csr_array(used @ at_step)
        present = np.asarray(then.sum(axis=1)).ravel() > 0
        counts = own @ present
        kept = np.flatnonzero(counts > 1)
        blocks.append(sparse.csr_array((own[kept] @ then) > 0).astype(np.float64))
        entries += blocks[-1].nnz
        if entries > MOST_ENTRIES:
            raise UnsupportedError(TOO_MANY_ENTRIES)
        for k in kept.tolist():
            resources.append(Moves(t, tuple(moves[n] for n in cliques[k].tolist() if present[n])))
    return tuple(resources), sparse.csr_array(sparse.vstack(blocks))


def _swaps(flow: Flow, slots: Slots, reach: sparse.csr_array) -> _MoveRows:
    """Returns the swaps, either way, that the edges of a flow allow."""
    one, other = flow.places[flow.tails], flow.places[flow.heads]
    moving = np.flatnonzero(one != other)
    one, other = one[moving], other[moving]
    keys = np.column_stack(
        [flow.steps[flow.tails[moving]], np.minimum(one, other), np.maximum(one, other)]
    )
    pairs, at = np.unique(keys, axis=0, return_inverse=True)
    both = np.zeros((len(pairs), 2), dtype=bool)
    both[at, (one < other).astype(np.int64)] = True
    crossing = incidence(at, moving, (len(pairs), flow.n_edges))
    kept = np.flatnonzero(both.all(axis=1))
    t, *ends = pairs[kept].T
    one, other = (
        reach[np.searchsorted(slots.numbers, (t + 1) * slots.n_cells + end)] for end in ends
    )
    kept = kept[np.asarray((one + other > 0).sum(axis=1)).ravel() > 1]
    resources = [Swap(t, (flow.cell(a), flow.cell(b))) for t, a, b in pairs[kept].tolist()]
    return tuple(resources), sparse.csr_array(crossing[kept])
