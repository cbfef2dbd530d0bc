"""Compilation with numba, if it is installed (extra `fast`), and when it saves time.

Compiling a kernel takes seconds, once per machine; loading the stored code takes half a second,
once per process. So a kernel is loaded when NumPy has done, or would have to do, so much work that
loading soon saves time, and compiled if that saves time within the same run. `cocap-opt compile`
compiles ahead of time.

`kernel` decides when a process loads or compiles a kernel; `functions` has the compiled functions,
and the files in which numba stores them; `marks` tells a process that they are stored, without
loading numba; `apart` compiles in a separate process, which Ctrl-C ends.
"""

from cocap_opt.compiling.functions import CompilingError, compiled, is_there
from cocap_opt.compiling.kernel import ALL_SECONDS, Kernel, tally

__all__ = ["ALL_SECONDS", "CompilingError", "Kernel", "compiled", "is_there", "tally"]
