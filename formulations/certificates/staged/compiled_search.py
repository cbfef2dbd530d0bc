"""Compilation of searches by numba, where it is installed (extra `fast`) and time is left.

The compiled searches of joint states (`search_kernel`) do what the plain one does (`search`), about
twenty times as fast, and can be interrupted; the tests hold them to it. Without numba the plain one
runs.
"""

import sys

from cocap_opt.compiling import is_there
from cocap_opt.stop import Stop

_KERNEL = "cocap_opt.formulations.certificates.staged.search_kernel"
_COMPILING = 5.0  # seconds that the first compiled search of a machine may take


def is_loaded() -> bool:
    """Returns True if the compiled search has been used, so that it is loaded."""
    return _KERNEL in sys.modules


def may_take_over(stop: Stop) -> bool:
    """Returns True if numba is installed, and a limit of time leaves enough to compile."""
    return is_there() and stop.seconds_left > _COMPILING
