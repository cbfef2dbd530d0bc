"""A conic program that is written block by block, and read by the blocks' names."""

from collections.abc import Mapping
from enum import Enum
from typing import Any, NamedTuple

import clarabel
import numpy as np
from scipy import sparse

from cocap_opt.data import FloatArray, IntArray
from cocap_opt.formulations.relaxations.cone_solver import solve_cones
from cocap_opt.stop import Stop

_SOLVED = ("Solved", "AlmostSolved")


class _Cone(Enum):
    """The cone in which b - A x lies for the rows of a block."""

    ZERO = "zero"  # the rows are equations
    NONNEGATIVE = "nonnegative"  # A x <= b
    SECOND_ORDER = "second order"  # each three rows (r, x, y): r >= |(x, y)|


class ConicSolution:
    """A solution, with its variables and multipliers by the names of their blocks."""

    def __init__(self, solution: Any, variables: Mapping[str, slice], rows: Mapping[str, slice]):
        self.value = float(solution.obj_val)
        self.is_solved = str(solution.status) in _SOLVED  # be it with reduced accuracy
        self._x: FloatArray = np.nan_to_num(np.array(solution.x))
        self._z: FloatArray = np.array(solution.z)
        self._variables, self._rows = variables, rows

    def values(self, name: str) -> FloatArray:
        """Returns the values of a block of variables."""
        return self._x[self._variables[name]]

    def multipliers(self, name: str) -> FloatArray:
        """Returns the multipliers of a block of rows, as they come from the solver."""
        return self._z[self._rows[name]]


class _Entries(NamedTuple):
    """Entries of the matrix."""

    rows: IntArray
    columns: IntArray
    values: FloatArray


class ConicProgram:
    """min cost x subject to A x + s = b with s in the cones of the blocks of rows.

    Parameters
    ----------
    variables : name and size of each block of variables
    """

    def __init__(self, variables: Mapping[str, int]) -> None:
        self._variables: dict[str, slice] = {}
        self._n = 0
        for name, size in variables.items():
            self._variables[name] = slice(self._n, self._n + size)
            self._n += size
        self._rows: dict[str, slice] = {}
        self._rhs: list[FloatArray] = []
        self._cones: list[tuple[_Cone, int]] = []
        self._entries: list[_Entries] = []

    def add_equations(self, name: str, rhs: FloatArray) -> None:
        """Begins a block of rows A x = b with the right sides b [m]; A is 0 at first."""
        self._add_rows(name, _Cone.ZERO, rhs)

    def add_inequalities(self, name: str, rhs: FloatArray) -> None:
        """Begins a block of rows A x <= b with the right sides b [m]; A is 0 at first."""
        self._add_rows(name, _Cone.NONNEGATIVE, rhs)

    def add_cones(self, name: str, rhs: FloatArray) -> None:
        """Begins a block of cones: each three rows (r, x, y) of b - A x have r >= |(x, y)|.

        Parameters
        ----------
        rhs : [3 m] right sides b; A is 0 at first
        """
        self._add_rows(name, _Cone.SECOND_ORDER, rhs)

    def _add_rows(self, name: str, cone: _Cone, rhs: FloatArray) -> None:
        first = sum(map(len, self._rhs))
        self._rows[name] = slice(first, first + len(rhs))
        self._rhs.append(rhs)
        # Neighbouring blocks in the same cone are one cone to the solver.
        before = self._cones.pop()[1] if self._cones and self._cones[-1][0] is cone else 0
        self._cones.append((cone, before + len(rhs)))

    def put(
        self, block: str, variable: str, rows: IntArray, columns: IntArray, values: FloatArray
    ) -> None:
        """Writes entries; rows and columns count from the first of their blocks."""
        first_row, first_column = self._rows[block].start, self._variables[variable].start
        self._entries.append(_Entries(rows + first_row, columns + first_column, values))

    def put_diagonal(self, block: str, variable: str, value: float, stride: int = 1) -> None:
        """Writes one value into rows 0, stride, 2 stride, .. for the variables 0, 1, 2, .."""
        span = self._variables[variable]
        each = np.arange(span.stop - span.start)
        self.put(block, variable, stride * each, each, np.full(len(each), value))

    def solve(self, cost: Mapping[str, FloatArray], stop: Stop, accuracy: float) -> ConicSolution:
        """Solves by Clarabel's interior-point method (one thread).

        Parameters
        ----------
        cost : of each block of variables; 0 where a block has none
        accuracy : relative, of the value
        """
        costs = np.zeros(self._n)
        for name, part in cost.items():
            costs[self._variables[name]] = part
        rows, columns, values = (np.concatenate(part) for part in zip(*self._entries, strict=True))
        rhs = np.concatenate(self._rhs)
        matrix = sparse.csc_matrix((values, (rows, columns)), shape=(len(rhs), self._n))
        # Multipliers are certified whatever they are: digits cost time, no more.
        solution = solve_cones(
            costs, matrix, rhs, self._clarabel_cones(), stop,
            tol_gap_rel=accuracy, tol_gap_abs=accuracy, tol_feas=accuracy,
            direct_solve_method="faer",
            iterative_refinement_reltol=1e-8, iterative_refinement_abstol=1e-8,
        )  # fmt: skip
        return ConicSolution(solution, self._variables, self._rows)

    def _clarabel_cones(self) -> list[object]:
        cones: list[object] = []
        for cone, size in self._cones:
            if cone is _Cone.SECOND_ORDER:
                cones += [clarabel.SecondOrderConeT(3) for _ in range(size // 3)]
            else:
                make = clarabel.ZeroConeT if cone is _Cone.ZERO else clarabel.NonnegativeConeT
                cones.append(make(size))
        return cones
