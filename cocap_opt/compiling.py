"""Compiling by numba, where that is installed (extra `fast`), and when it pays.

To compile a kernel takes seconds, once on a machine; to load what is kept half a second, once in a
process. So a kernel is loaded once so much was done by NumPy, or is to be done, that loading is
soon repaid, and compiled if the work at hand repays that within the same run. `cocap-opt compile`
does so ahead.
"""

import hashlib
import logging
import os
import sys
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from importlib import import_module
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from threading import Lock
from typing import Any

_log = logging.getLogger(__name__)

_FIRST = "%s is compiled first, once on this machine: some %.0f s"
_LOADING = 1.0  # s of NumPy's way, from which on loading is worth it
_REPAID = 1.25  # times as long as compiling NumPy's way must take
_FASTER = 8.0  # times, at least


@cache
def is_there() -> bool:
    """Returns True if numba is installed."""
    return find_spec("numba") is not None


class CompilingError(RuntimeError):
    """numba is installed, and does not compile."""


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
        self._lock, self._has_failed, self._is_missing = Lock(), False, False
        self._spent = 0.0  # s, by NumPy's way

    def prepare(self, work: float, left: float) -> None:
        """Loads or compiles it if what is to be done soon repays that.

        Parameters
        ----------
        work : s that it would take by NumPy's way
        left : s that there are
        """
        self._load(work, self._repays(min(work, left)))

    def spend(self, seconds: float) -> None:
        """Notes what was done by NumPy's way; loads the kernel, if it is kept, once it is much."""
        self._spent += seconds
        self._load(self._spent, False)

    def expected(self, work: float) -> float:
        """Returns the seconds that work is expected to take, once it is begun.

        Parameters
        ----------
        work : s that it takes now
        """
        if self.is_loaded or not self._may_be_loaded or not self._repays(work):
            return work
        return self._compiling + work / _FASTER

    def _repays(self, work: float) -> bool:
        """Returns True for work (s, by NumPy's way) that compiling makes shorter."""
        return work > _REPAID * self._compiling

    @property
    def _may_be_loaded(self) -> bool:
        """numba is installed, and has not failed in this process."""
        return is_there() and not self._has_failed

    def load(self) -> None:
        """Loads it, and compiles it if it is not kept.

        Raises
        ------
        CompilingError
            If numba cannot be loaded, or compiles nothing. What it has kept is removed: it may be
            damaged.
        """
        try:
            module = import_module(self._module)
            module.call_once()
        except Exception as error:  # whatever goes wrong in a library
            with suppress(Exception):
                _forget(import_module(self._module).compiled_function())
            raise CompilingError(f"numba fails ({type(error).__name__}: {error})") from error
        _mark(module.compiled_function())
        self.is_loaded = True

    @property
    def is_kept(self) -> bool:
        """It is on disk, compiled by this numba for this machine."""
        mark = _mark_of(import_module(self._module).compiled_function())
        return mark is not None and mark.is_file()

    def _load(self, work: float, may_compile: bool) -> None:
        if self.is_loaded or work < _LOADING or not self._may_be_loaded:
            return
        if self._is_missing and not may_compile:  # known, and asked at every step of a sweep
            return
        with self._lock:
            if self.is_loaded or not self._may_be_loaded:
                return
            try:
                self._is_missing = not self.is_kept
                if self._is_missing:
                    if not may_compile:
                        return
                    _log.warning(_FIRST, self.name, self._compiling)
                self.load()
            except Exception as error:  # as soon as numba is imported, or once it compiles
                self._has_failed = True
                _log.warning("%s is not compiled, and takes longer: %s", self.name, error)


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
    if not _kept_files(function):
        _log.warning(_FIRST, name, seconds)


def _kept_files(function: Any) -> list[Path]:
    """Returns the files in which numba keeps a compiled function."""
    # Where NUMBA_DISABLE_JIT is set, it is the function itself, without `stats`.
    folder = getattr(getattr(function, "stats", None), "cache_path", None)
    return [] if folder is None else _files_of(Path(folder), function)


def _files_of(folder: Path, function: Callable[..., Any]) -> list[Path]:
    stem = function.__module__.rpartition(".")[2]
    return [*folder.glob(f"{stem}.{function.__qualname__}-*.nb[ci]")]


def _mark_of(function: Any) -> Path | None:
    """Returns the file that says that a function is kept for this processor by this numba."""
    files = _kept_files(function)
    if not files:
        return None
    processor = import_module("llvmlite.binding").get_host_cpu_name()  # comes with numba
    made_by = (
        sys.version, version("numba"), version("llvmlite"), os.environ.get("NUMBA_CPU_NAME", ""),
        processor, str(Path(function.__code__.co_filename).stat().st_mtime_ns),
    )  # fmt: skip
    digest = hashlib.sha256("\n".join(made_by).encode()).hexdigest()[:16]
    return files[0].with_name(f"{function.__name__}-{digest}.kept")


def _mark(function: Any) -> None:
    with suppress(OSError):
        if (mark := _mark_of(function)) is not None:
            mark.touch()


def _forget(function: Any) -> None:
    """Removes all that is kept of a function."""
    for file in _kept_files(function):
        file.unlink(missing_ok=True)


def _forget_what_is_older(folder: Path, function: Callable[..., Any]) -> None:
    """Removes what was kept of an earlier source, which may name what is no longer there.

    numba compares times as well, but only once it has read what was kept, which may fail.
    """
    with suppress(OSError):
        changed = Path(function.__code__.co_filename).stat().st_mtime
        for file in _files_of(folder, function):
            if file.stat().st_mtime < changed:
                file.unlink(missing_ok=True)
