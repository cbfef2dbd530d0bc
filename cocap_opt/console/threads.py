"""One thread for the linear algebra underneath: runs are comparable, and leave cores to others."""

# For the environment of a process, before it loads NumPy.
ONE_THREAD = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}
