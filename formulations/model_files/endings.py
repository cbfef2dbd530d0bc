"""Endings of the files, and what stands if nothing is asked for; no library is loaded for these."""

MPS, LP = ".mps", ".lp"
LINEAR = MPS, LP
CONES, NONLINEAR = ".cbf", ".nl"

ROOT_ERROR = 1e-6  # relative, of tangents if nobody asks for another
