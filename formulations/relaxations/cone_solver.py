"""Clarabel, called directly: on one thread, and asking for limits at each iteration."""

from collections.abc import Sequence
from typing import Any

import clarabel
from scipy import sparse

from cocap_opt.data import FloatArray
from cocap_opt.stop import Stop

NO_TIME_LIMIT = 1e9  # s, Clarabel takes no infinity


def solve_cones(
    cost: FloatArray,
    rows: sparse.csc_matrix,
    rhs: FloatArray,
    cones: Sequence[object],
    stop: Stop,
    quadratic: sparse.csc_matrix | None = None,
    **settings: Any,
) -> Any:
    """Solves min cost x subject to rows x + s = rhs, s in the cones; returns Clarabel's solution.

    Parameters
    ----------
    cost, rows, rhs : [n], [m, n] and [m]
    quadratic : [n, n] upper triangle of Q, of which x Q x / 2 is added to the cost
    settings : of Clarabel, besides its threads and limits
    """
    chosen = clarabel.DefaultSettings()
    chosen.verbose = False
    chosen.max_threads = 1
    chosen.time_limit = min(stop.seconds_left, NO_TIME_LIMIT)
    for name, value in settings.items():
        setattr(chosen, name, value)
    none = sparse.csc_matrix((len(cost), len(cost)))
    solver = clarabel.DefaultSolver(
        none if quadratic is None else quadratic, cost, rows, rhs, cones, chosen
    )
    solver.set_termination_callback(lambda info: bool(stop.reached()))
    return solver.solve()
