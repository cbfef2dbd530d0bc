"""Endings of the files and default values, which need no library."""

MPS, LP = ".mps", ".lp"
LINEAR = MPS, LP
CONES, NONLINEAR = ".cbf", ".nl"

ROOT_ERROR = 1e-6  # relative error of tangents, by default
