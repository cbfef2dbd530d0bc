"""Compiling by numba; only imported where numba is installed."""

from collections.abc import Callable
from typing import Any

import numba


def compiled(function: Callable[..., Any], forceinline: bool = False) -> Any:
    """Returns a compiled function, kept on disk where there is a folder for it.

    Parameters
    ----------
    forceinline : compile it into its callers
    """
    try:
        return numba.njit(cache=True, forceinline=forceinline)(function)
    except RuntimeError:
        return numba.njit(forceinline=forceinline)(function)
