"""Compiling by numba, where that is installed (extra `fast`), and when it saves time.

To compile a kernel takes seconds, once on a machine; to load what is kept half a second, once in a
process. So a kernel is loaded once so much was done by NumPy, or is to be done, that loading is
soon repaid, and compiled if the work at hand repays that within the same run. `cocap-opt compile`
does so ahead.

`kernel` (when a process loads or compiles one), `functions` (compiled functions, and the files in
which numba keeps them), `marks` (by which a process knows that they are kept, without numba),
`apart` (compiling in a process of its own, which ends with Ctrl-C).
"""

from cocap_opt.compiling.functions import CompilingError, compiled, is_there
from cocap_opt.compiling.kernel import ALL_SECONDS, Kernel, tally

__all__ = ["ALL_SECONDS", "CompilingError", "Kernel", "compiled", "is_there", "tally"]
