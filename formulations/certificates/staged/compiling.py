"""Compiling by numba; only imported where numba is installed."""

from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numba


def compiled(function: Callable[..., Any], forceinline: bool = False) -> Any:
    """Returns a compiled function, kept on disk where there is a folder for it.

    Parameters
    ----------
    forceinline : compile it into its callers
    """
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
