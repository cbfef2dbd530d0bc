"""Limits linear algebra to one thread: runs are comparable, and other cores stay free."""

# Environment variables to set before a process loads NumPy.
ONE_THREAD = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}
