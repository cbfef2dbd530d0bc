"""Compiles searches with numba, if it is installed (extra `fast`) and enough time remains.

The compiled searches of joint states (`search_kernel`) give the same results as the plain one
(`search`), about twenty times as fast, and can be interrupted; tests compare the two. Without numba
the plain search is used.
"""

from cocap_opt.compiling import Kernel

KERNEL = Kernel(
    "cocap_opt.formulations.certificates.staged.search_kernel", "the search of joint states",
    compiling=5.0,
)  # fmt: skip
