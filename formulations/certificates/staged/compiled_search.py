"""Compilation of searches by numba, where it is installed (extra `fast`) and time is left.

The compiled searches of joint states (`search_kernel`) do what the plain one does (`search`), about
twenty times as fast, and can be interrupted; the tests hold them to it. Without numba the plain one
runs.
"""

import sys
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from cocap_opt.stop import Stop

_KERNEL = "cocap_opt.formulations.certificates.staged.search_kernel"
_COMPILING = 5.0  # seconds that the first compiled search of a machine may take


@cache
def is_there() -> bool:
    """Returns True if numba is installed."""
    return find_spec("numba") is not None


def is_loaded() -> bool:
    """Returns True if the compiled search has been used, so that it is loaded."""
    return _KERNEL in sys.modules


def may_take_over(stop: Stop) -> bool:
    """Returns True if numba is installed, and a limit of time leaves enough to compile."""
    return is_there() and stop.seconds_left > _COMPILING


def compiled(function: Callable[..., Any], forceinline: bool = False) -> Any:
    """Returns a compiled function, kept on disk where there is a folder for it.

    Parameters
    ----------
    forceinline : compile it into its callers
    """
    import numba  # a second, where it is installed

    try:
        kept = numba.njit(cache=True, forceinline=forceinline)(function)
    except RuntimeError:
        return numba.njit(forceinline=forceinline)(function)
    # Where NUMBA_DISABLE_JIT is set, it is the function itself.
    folder = kept.stats.cache_path if hasattr(kept, "stats") else None
    if folder is not None:
        _forget_what_is_older(Path(folder), function)
    return kept


def _forget_what_is_older(folder: Path, function: Callable[..., Any]) -> None:
    """Removes what was kept of an earlier source, which may name what is no longer there.

    numba compares times as well, but only once it has read what was kept, which may fail.
    """
    with suppress(OSError):
        changed = Path(function.__code__.co_filename).stat().st_mtime
        stem = function.__module__.rpartition(".")[2]
        for file in folder.glob(f"{stem}.{function.__qualname__}-*.nb[ic]"):
            if file.stat().st_mtime < changed:
                file.unlink(missing_ok=True)
