"""Limits of solvers and the reasons why they end, in one form for all libraries.

Each solver prints nothing and runs on one thread, with a fixed seed if it uses one, so that runs
are reproducible. A new solver needs one line in `_SOLVERS`.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from datetime import timedelta
from typing import Any, NamedTuple

from scipy import sparse

from cocap_opt.data import FloatArray
from cocap_opt.result import Reason
from cocap_opt.stop import Limit, Stop, never

THREADS, SEED = 1, 0


class _Solver(NamedTuple):
    """The options and statuses of a solver, by the names that its library uses."""

    options: Mapping[str, Any]  # fixed options, used for every program
    statuses: Mapping[str, Reason | Limit]  # statuses that are not listed mean `Limit.NUMERICS`
    seconds: str = ""  # name of the option for the time limit
    as_time: Callable[[float], Any] = float
    gap: str = ""  # name of the option for the relative gap


_MATHOPT: Mapping[str, Reason | Limit] = {
    "TERMINATION_REASON_OPTIMAL": Reason.OPTIMAL,
    # "Unbounded" means infeasible: the roots are bounded, so no program is unbounded.
    "TERMINATION_REASON_INFEASIBLE": Reason.INFEASIBLE,
    "TERMINATION_REASON_INFEASIBLE_OR_UNBOUNDED": Reason.INFEASIBLE,
    "LIMIT_TIME": Limit.TIME,
}
_SOLVERS = {
    # An option of HiGHS, since MathOpt's own parameter for threads is an error with HiGHS.
    "HIGHS": _Solver(
        {"absolute_gap_tolerance": 0.0, "highs": {"int_options": {"threads": THREADS}}},
        _MATHOPT, "time_limit", lambda s: timedelta(seconds=s), "relative_gap_tolerance",
    ),
    # SCIP's presolve can take minutes and all memory on flows that it solves in a second without.
    "GSCIP": _Solver(
        {"absolute_gap_tolerance": 0.0, "threads": THREADS, "presolve": "EMPHASIS_OFF"},
        _MATHOPT, "time_limit", lambda s: timedelta(seconds=s), "relative_gap_tolerance",
    ),
    "CP-SAT": _Solver(
        {
            "num_workers": THREADS, "random_seed": SEED,
            "catch_sigint_signal": False,  # its handler aborts the process
            # In the integer objective, roots are worth millions: a worker that searches for ever
            # better plans would improve by ones.
            # This worker lowers the bound instead, with all rows in its linear relaxation.
            "use_objective_lb_search": True, "linearization_level": 2,
            # With this option, presolve of 9.15 cuts off optima
            # (github.com/google/or-tools/issues/5293).
            "presolve_inclusion_work_limit": 0,
        },
        {
            "OPTIMAL": Reason.OPTIMAL, "INFEASIBLE": Reason.INFEASIBLE,
            "FEASIBLE": Limit.TIME, "UNKNOWN": Limit.TIME,
        },
        "max_time_in_seconds", float, "relative_gap_limit",
    ),
    # PySCIPOpt. SCIP's search for symmetries (dejavu) may never end, and ignores time limits.
    "SCIP": _Solver(
        {"misc/usesymmetry": 0},
        {
            "optimal": Reason.OPTIMAL, "gaplimit": Reason.OPTIMAL, "timelimit": Limit.TIME,
            "infeasible": Reason.INFEASIBLE, "inforunbd": Reason.INFEASIBLE,
        },
        "limits/time", float, "limits/gap",
    ),
    # highspy, for small linear programs to which columns are added one by one.
    "simplex": _Solver(
        {"output_flag": False, "threads": THREADS, "presolve": "off", "solver": "simplex"},
        {"kOptimal": Reason.OPTIMAL},
    ),
    "Clarabel": _Solver(
        {"verbose": False, "max_threads": THREADS},
        {"Solved": Reason.OPTIMAL, "AlmostSolved": Reason.OPTIMAL},
        "time_limit",
    ),
}  # fmt: skip


def options(name: str, stop: Stop = never, gap: float | None = None) -> dict[str, Any]:
    """Returns the fixed options and the limits of a solver, by the names that its library uses.

    Parameters
    ----------
    stop : stopping criterion, which gives the remaining time
    gap : relative gap at which the solver may end
    """
    solver, seconds = _SOLVERS[name], stop.seconds_left
    limits = {} if gap is None else {solver.gap: gap}
    if math.isfinite(seconds):
        limits[solver.seconds] = solver.as_time(seconds)
    return {**solver.options, **limits}


def ending(name: str, status: str) -> Reason | Limit:
    """Returns the reason why a solver ended, given the status of its library."""
    return _SOLVERS[name].statuses.get(status, Limit.NUMERICS)


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

    Clarabel is called directly, so that limits are checked at each iteration.

    Parameters
    ----------
    cost, rows, rhs : [n], [m, n] and [m]
    quadratic : [n, n] upper triangle of Q; x Q x / 2 is added to the cost
    settings : further settings of Clarabel
    """
    import clarabel

    chosen = clarabel.DefaultSettings()
    for name, value in {**options("Clarabel", stop), **settings}.items():
        setattr(chosen, name, value)
    none = sparse.csc_matrix((len(cost), len(cost)))
    solver = clarabel.DefaultSolver(
        none if quadratic is None else quadratic, cost, rows, rhs, cones, chosen
    )
    solver.set_termination_callback(lambda info: bool(stop.reached()))
    return solver.solve()
