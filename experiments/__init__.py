"""Sweeps, tables, figures and the command line."""

import os

# One thread for the linear algebra underneath, before it loads: runs are comparable, and
# sweeps do not fight over the cores.
for _variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_variable, "1")
