"""Writes scenes as integer programs for other solvers, and reads their solutions as plans.

`model` is the program with the names of its variables and rows; `tangents` bounds its roots from
above by lines, to a requested accuracy. `linear` writes MPS and LP, `conic` the Conic Benchmark
Format with exact roots, `nonlinear` AMPL's NL through Pyomo; `solutions` reads the solutions of
solvers.
"""

__all__ = ["conic", "endings", "linear", "model", "nonlinear", "solutions"]
