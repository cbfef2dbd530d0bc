"""Compiles searches with numba, if it is installed (extra `fast`) and enough time remains.

The compiled searches of joint states (`search_kernel`) give the same results as the plain one
(`search`), about twenty times as fast, and can be interrupted; tests compare the two. Without numba
the plain search is used.
"""

from cocap_opt.compiling import Kernel, is_there
from cocap_opt.stop import Stop

KERNEL = Kernel(
    "cocap_opt.formulations.certificates.staged.search_kernel", "the search of joint states",
    compiling=5.0,
)  # fmt: skip


def is_loaded() -> bool:
    """Returns True if the compiled search has been used in this process, and is therefore
    loaded.
    """
    return KERNEL.is_loaded


def may_take_over(stop: Stop) -> bool:
    """Returns True if numba is installed, and has compiled the search before or has enough time."""
    return is_there() and not KERNEL.has_failed and KERNEL.is_ready_within(stop.seconds_left)


def takes_over(stop: Stop) -> bool:
    """Returns True once the compiled search is loaded, or False if numba fails.

    Raises
    ------
    LimitReached
        If a limit is reached during compilation.
    """
    return KERNEL.takes_over(stop)
