"""Compiling by numba, where that is installed (extra `fast`), and when it pays.

To compile a kernel takes seconds, once on a machine; to load what is kept half a second, once in a
process. So a kernel is loaded once so much was done by NumPy, or is to be done, that loading is
soon repaid, and compiled if the work at hand repays that within the same run. `cocap-opt compile`
does so ahead.
"""

import logging
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from threading import Lock
from typing import Any

_log = logging.getLogger(__name__)

_LOADING = 1.0  # s of NumPy's way, from which on loading is worth it
_REPAID = 2.0  # times as long as compiling NumPy's way must take


@cache
def is_there() -> bool:
    """Returns True if numba is installed."""
    return find_spec("numba") is not None


class Kernel:
    """Compiled code that does what NumPy does as well, and when this process uses it.

    Parameters
    ----------
    module : full name of the one that has `compiled_function()` and `call_once()`, by which it is
        loaded, or compiled and kept
    name : what it finds, in words
    compiling : s that compiling takes

    Attributes
    ----------
    is_loaded : it is loaded, so that it is used
    """

    def __init__(self, module: str, name: str, compiling: float) -> None:
        self.name, self.is_loaded = name, False
        self._module, self._compiling = module, compiling
        self._lock = Lock()
        self._spent = 0.0  # s, by NumPy's way

    def prepare(self, work: float, left: float) -> None:
        """Loads or compiles it if what is to be done soon repays that.

        Parameters
        ----------
        work : s that it would take by NumPy's way
        left : s that there are
        """
        self._load(work, min(work, left) > _REPAID * self._compiling)

    def spend(self, seconds: float) -> None:
        """Notes what was done by NumPy's way; loads the kernel, if it is kept, once it is much."""
        self._spent += seconds
        self._load(self._spent, False)

    def load(self) -> None:
        """Loads it, and compiles it if it is not kept."""
        import_module(self._module).call_once()
        self.is_loaded = True

    def _load(self, work: float, may_compile: bool) -> None:
        if self.is_loaded or work < _LOADING or not is_there():
            return
        with self._lock:
            if self.is_loaded:
                return
            function = import_module(self._module).compiled_function()
            if not may_compile and not is_kept(function):
                return
            tell_of_compiling(self.name, function, self._compiling)
            self.load()


def compiled(function: Callable[..., Any], kept: bool = True, **options: Any) -> Any:
    """Returns a compiled function, kept on disk where there is a folder for it.

    Parameters
    ----------
    kept : False for one that is compiled into its callers, and kept with them
    options : of `numba.njit`, such as forceinline, which compiles it into its callers
    """
    import numba  # a second, where it is installed

    if not kept:
        return numba.njit(**options)(function)
    try:
        found = numba.njit(cache=True, **options)(function)
    except RuntimeError:
        return numba.njit(**options)(function)
    # Where NUMBA_DISABLE_JIT is set, it is the function itself.
    folder = found.stats.cache_path if hasattr(found, "stats") else None
    if folder is not None:
        _forget_what_is_older(Path(folder), function)
    return found


def tell_of_compiling(name: str, function: Any, seconds: float) -> None:
    """Says that a compiled function is compiled now, if it is not kept, and for how long.

    Parameters
    ----------
    name : what it finds, in words
    """
    if not is_kept(function):
        _log.warning("%s is compiled first, once on this machine: some %.0f s", name, seconds)


def is_kept(function: Any) -> bool:
    """Returns True if what was compiled of a compiled function is on disk."""
    folder = getattr(getattr(function, "stats", None), "cache_path", None)
    if folder is None:
        return False
    stem = function.__module__.rpartition(".")[2]
    return any(Path(folder).glob(f"{stem}.{function.__qualname__}-*.nbc"))


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
