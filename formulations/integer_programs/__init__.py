"""Integer programs over the aggregated flow, and the generic solvers that take them.

`program` says what is solved, in words and as matrices, `outer_approximation` how often. `mathopt`
(HiGHS, SCIP), `cp_sat` and `scip_nonlinear` translate it for a solver.
"""

__all__ = ["cp_sat", "mathopt", "outer_approximation", "program", "scip_nonlinear"]
