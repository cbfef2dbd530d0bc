"""Collision rules as rows of a flow: cliques of cells or moves, of which one robot uses one."""

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from cocap_opt.data import FloatArray
from cocap_opt.formulations.certificates.resources import Cells, Moves, Resource, Swap
from cocap_opt.formulations.relaxations.cell_cliques import cliques_of_cells
from cocap_opt.formulations.relaxations.flow import Flow
from cocap_opt.formulations.relaxations.move_rows import MoveRows, passing_moves, swaps
from cocap_opt.formulations.relaxations.slots import Slots, incidence


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
        moves = MoveRows((), sparse.csr_array((0, flow.n_edges)))
        if problem.rules.separation and len(slots):
            moves = passing_moves(flow)
        elif problem.rules.swap and len(slots):
            moves = swaps(flow, slots, reach)
        return cls(
            flow=flow,
            slots=slots,
            occupied=incidence(at, later, (len(slots), flow.n_nodes)),
            cliques=cliques[shared],
            moves=moves.resources,
            crossing=moves.crossing,
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
