"""Functions that numba compiles, and the files in which it stores them."""

from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

_kept: defaultdict[str, list[Any]] = defaultdict(list)  # compiled functions by module


class CompilingError(RuntimeError):
    """numba is installed, but cannot compile."""


class NotKeptError(Exception):
    """A function has no stored code that numba accepts, and compilation is not allowed."""


@cache
def is_there() -> bool:
    """Returns True if numba is installed."""
    return find_spec("numba") is not None


def compiled(function: Callable[..., Any], kept: bool = True, **options: Any) -> Any:
    """Returns a compiled function, which is stored on disk if there is a folder for it.

    Parameters
    ----------
    kept : False: the function is compiled into its callers, and stored with them
    options : options of `numba.njit`, such as forceinline, which compiles it into its callers
    """
    import numba  # takes a second

    if not kept:
        return numba.njit(**options)(function)
    try:
        found = numba.njit(cache=True, **options)(function)
    except RuntimeError:  # no folder is writable
        found = numba.njit(**options)(function)
    if (folder := _folder_of(found)) is not None:
        _forget_what_is_older(folder, function, sources_of(function.__module__))
    _kept[function.__module__].append(found)
    return found


def kept_functions(module: str) -> list[Any]:
    """Returns the functions of a module that are stored on disk, if there is a folder for them."""
    import_module(module)
    return _kept[module]


def can_be_kept(functions: Sequence[Any]) -> bool:
    """Returns True if there are folders in which numba can store these functions."""
    return all(_folder_of(function) is not None for function in functions)


def kept_files(functions: Sequence[Any]) -> list[Path]:
    """Returns the files in which numba stores functions; empty if one of them is not stored."""
    files = [_files_of(_folder_of(function), function) for function in functions]
    return [file for part in files for file in part] if all(files) else []


def forget(functions: Sequence[Any]) -> None:
    """Removes all stored code of some functions."""
    for function in functions:
        for file in _files_of(_folder_of(function), function):
            with suppress(OSError):
                file.unlink(missing_ok=True)


@contextmanager
def nothing_compiled(functions: Sequence[Any]) -> Iterator[None]:
    """Forbids compiling these functions within the block; loading them is allowed.

    Raises
    ------
    NotKeptError
        If one has to be compiled, because its stored code is for another processor or source.
    """
    event = import_module("numba.core.event")

    class Refusal(event.Listener):  # type: ignore[name-defined,misc]
        """Ends a compilation when it begins."""

        def on_start(self, event: Any) -> None:
            if any(event.data["dispatcher"] is function for function in functions):
                raise NotKeptError

        def on_end(self, event: Any) -> None:
            pass

    with event.install_listener("numba:compile", Refusal()):
        yield


@cache
def sources_of(module: str) -> tuple[Path, ...]:
    """Returns the files of a module and of all project modules from which it imports names.

    The constants of these modules become part of the compiled code.
    """
    from cocap_opt.files.code import files_with_imports  # not needed if nothing is compiled

    return files_with_imports(module)


def _folder_of(function: Any) -> Path | None:
    # With NUMBA_DISABLE_JIT, numba returns the function itself, which has no `stats`.
    path = getattr(getattr(function, "stats", None), "cache_path", None)
    return None if path is None else Path(path)


def _files_of(folder: Path | None, function: Callable[..., Any]) -> list[Path]:
    if folder is None:
        return []
    stem = function.__module__.rpartition(".")[2]
    return sorted(folder.glob(f"{stem}.{function.__qualname__}-*.nb[ci]"))


def _forget_what_is_older(
    folder: Path, function: Callable[..., Any], sources: Sequence[Path]
) -> None:
    """Removes code stored for earlier sources, which may refer to names that no longer exist.

    numba compares times, too, but only of the function's own file, not of the files whose constants
    are compiled in, and only after reading the stored code, which may fail.
    """
    with suppress(OSError):
        changed = max(source.stat().st_mtime for source in sources)
        for file in _files_of(folder, function):
            if file.stat().st_mtime < changed:
                file.unlink(missing_ok=True)
