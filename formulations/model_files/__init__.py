"""Scenes as integer programs in files that other solvers read, and their solutions as plans.

`model` is the program with the names of its variables and rows, `tangents` bounds its roots from
above by lines, as closely as is asked for. `linear` writes MPS and LP, `conic` the Conic Benchmark
Format with the roots as they are, `nonlinear` AMPL's NL through Pyomo; `solutions` reads what a
solver has found.
"""

__all__ = ["conic", "endings", "linear", "model", "nonlinear", "solutions"]
