"""Compiling by numba, where that is installed (extra `fast`), and keeping what is compiled."""

from collections.abc import Callable
from contextlib import suppress
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any


@cache
def is_there() -> bool:
    """Returns True if numba is installed."""
    return find_spec("numba") is not None


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
