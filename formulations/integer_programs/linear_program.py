"""The integer programs (`program`) as matrices, for solvers that take real numbers.

Variables are x [N] robots in each node, y [E] robots along each edge, and for each view sum that
counts its pixels z, its sum of roots s and its root u, in this order: rows on pixels then have two
entries each instead of one per node that sees the face.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from scipy import sparse

from cocap_opt.data import BoolArray, FloatArray, IntArray
from cocap_opt.formulations.integer_programs.program import Program


class LinearProgram(NamedTuple):
    """A program: max gain v subject to row_low <= rows v <= row_high and low <= v <= high."""

    gain: FloatArray  # [n]
    low: FloatArray  # [n]
    high: FloatArray  # [n]
    integral: BoolArray  # [n]
    rows: sparse.csr_array  # [m, n]
    row_low: FloatArray  # [m]
    row_high: FloatArray  # [m]
    first_pixels: int  # number of the first of the z

    @classmethod
    def of(cls, program: Program) -> "LinearProgram":
        """Returns the matrices of a program; their objective is J / program.unit."""
        flow, roots = program.flow, program.roots
        n, e, n_sums = flow.n_nodes, flow.n_edges, len(roots.used)
        first = flow.steps == 0
        rows, row_low, row_high = _rows(program)
        gain = [np.zeros(n), flow.bonus, np.zeros(2 * n_sums), roots.weights]
        high = [np.where(first, flow.supply, flow.capacity), flow.capacity[flow.tails]]
        return cls(
            gain=np.concatenate(gain) / program.unit,
            low=np.concatenate([np.where(first, flow.supply, 0.0), np.zeros(e + 3 * n_sums)]),
            high=np.concatenate([*high, np.full(3 * n_sums, math.inf)]),
            integral=np.repeat([True, program.integral_edges, False], [n, e, 3 * n_sums]),
            rows=rows,
            row_low=row_low,
            row_high=row_high,
            first_pixels=n + e,
        )


def _rows(program: Program) -> tuple[sparse.csr_array, FloatArray, FloatArray]:
    """Returns the rows low <= matrix v <= high over v = (x, y, z, s, u), the equations first.

    Returns
    -------
    matrix [m, n], low [m], high [m]
    """
    flow, roots, conflicts = program.flow, program.roots, program.conflicts
    n_sums = len(roots.used)
    later = np.flatnonzero(flow.steps > 0)
    before = np.flatnonzero(flow.steps < flow.model.problem.horizon)
    inside, one = (
        sparse.eye_array(flow.n_nodes, format="csr"),
        sparse.eye_array(n_sums, format="csr"),
    )
    at, z0 = program.tangents
    slopes = _at(at, 1 / (2 * np.sqrt(z0)), n_sums)
    phi, constants, cut_at = roots.cut_rows(program.cuts)
    widths = [flow.n_nodes, flow.n_edges, n_sums, n_sums, n_sums]
    blocks: list[list[Any]] = [
        [inside[later], -flow.entering[later], None, None, None],
        [inside[before], -flow.leaving[before], None, None, None],
        [-roots.pixels, None, one, None, None],
        [-roots.seen, None, None, one, None],
        [None, None, None, -one, one],
        [None, None, -slopes, None, _at(at, np.ones(len(at)), n_sums)],
        [-phi, None, None, None, _at(cut_at, np.ones(len(cut_at)), n_sums)],
        [conflicts.at_nodes, None, None, None, None],
        [None, conflicts.crossing, None, None, None],
        [sparse.csr_array((0, width)) for width in widths],  # says how wide the columns are
    ]
    n_equal = len(later) + len(before)
    n_conflicts = conflicts.cliques.shape[0] + conflicts.crossing.shape[0]
    high = np.concatenate(
        [np.zeros(n_equal + 3 * n_sums), np.sqrt(z0) / 2, constants, np.ones(n_conflicts)]
    )
    low = np.full(len(high), -math.inf)
    low[:n_equal] = 0.0
    return sparse.csr_array(sparse.block_array(blocks)), low, high


def _at(columns: IntArray, values: FloatArray, width: int) -> sparse.csr_array:
    """Returns a matrix with one entry per row, in these columns."""
    index = (np.arange(len(columns)), columns)
    return sparse.csr_array((values, index), shape=(len(columns), width))
