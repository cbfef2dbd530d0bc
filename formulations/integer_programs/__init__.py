"""Integer programs over the aggregated flow, and the generic solvers that solve them.

`program` defines the programs, in words and as matrices; `outer_approximation` solves them
repeatedly. `mathopt` (HiGHS, SCIP), `cp_sat` and `scip_nonlinear` translate them for a solver.
"""

__all__ = ["cp_sat", "mathopt", "outer_approximation", "program", "scip_nonlinear"]
