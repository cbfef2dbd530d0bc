"""Marks on disk: by them a process knows which functions are stored, without loading numba.

The name of a mark contains a digest of everything that numba considers: versions, settings,
sources and processor. A mark lists the files that numba has stored, with digests of those that
contain code: if one is missing or damaged, the functions do not count as stored. If numba
nevertheless rejects them, `functions.nothing_compiled` prevents it from compiling unasked.
"""

import hashlib
import os
import platform
import sys
from collections.abc import Iterator, Sequence
from contextlib import suppress
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import msgspec

from cocap_opt.compiling.functions import sources_of
from cocap_opt.files.atomic_write import write_atomically
from cocap_opt.files.users_folder import users_folder

_CPUINFO = Path("/proc/cpuinfo")
# The fields that identify the kind of processor, and do not change over time.
_KINDS = {
    "vendor_id", "cpu family", "model", "stepping", "flags",
    "CPU implementer", "CPU variant", "CPU part", "Features", "isa",
}  # fmt: skip


class _Mark(msgspec.Struct, forbid_unknown_fields=True):
    """The content of a mark.

    Attributes
    ----------
    sources : the files that were compiled, as `_stamps` writes them
    kept : numba's files, with the digests of those that hold code
    """

    sources: dict[str, tuple[int, int]]
    kept: dict[str, str]


def is_marked(module: str) -> bool:
    """Returns True if a module's compiled functions are stored in undamaged files.

    It is False if a source is missing, or the version of numba is unknown.
    """
    try:
        return any(_is_true(path) for path in _paths(module))
    except (OSError, PackageNotFoundError):
        return False


def is_damaged(module: str) -> bool:
    """Returns True if a file of code has changed since it was marked."""
    marks = [found for path in _paths(module) if (found := _read(path)) is not None]
    files = [(Path(file), digest) for found in marks for file, digest in found.kept.items()]
    try:
        return any(file.is_file() and _digest(file) != digest for file, digest in files)
    except OSError:
        return True


def mark(module: str, files: Sequence[Path]) -> None:
    """Marks a module's compiled functions as stored in these files; does nothing without files."""
    found = _Mark(_stamps(module), {str(file): _digest(file) for file in files})
    for path in _paths(module) if files else ():
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            write_atomically({path: msgspec.json.encode(found)})
        except OSError:
            continue
        _remove_older(path, module)
        return


def unmark(module: str) -> None:
    """Removes the marks of a module, for the present sources, settings and machine."""
    with suppress(PackageNotFoundError, FileNotFoundError):  # then there are no marks
        for path in _paths(module):
            with suppress(OSError):
                path.unlink(missing_ok=True)


def _paths(module: str) -> Iterator[Path]:
    """Yields the possible files of a mark; the first writable one is used."""
    name = f"{module.rpartition('.')[2]}-{_made_by(module)}.kept"
    folders = [
        Path(given) if (given := os.environ.get("NUMBA_CACHE_DIR")) else None,
        sources_of(module)[0].parent / "__pycache__",
        users_folder(),
    ]
    yield from (folder / name for folder in folders if folder is not None)


def _made_by(module: str) -> str:
    """Returns the digest of everything that compiled code depends on."""
    settings = sorted(item for item in os.environ.items() if item[0].startswith("NUMBA_"))
    parts = (
        sys.version, version("numba"), version("llvmlite"), settings, _processor(), _stamps(module)
    )  # fmt: skip
    return hashlib.sha256(repr(parts).encode()).hexdigest()[:16]


@cache
def _processor() -> str:
    """Returns a description of this processor that is quick to read."""
    try:
        first = _CPUINFO.read_text(encoding="utf-8", errors="replace").partition("\n\n")[0]
    except OSError:
        first = ""
    lines = [line.partition(":") for line in first.splitlines()]
    kept = [(name.strip(), value) for name, _, value in lines if name.strip() in _KINDS]
    if not kept:  # the kind is unknown, and another machine's may differ
        kept = [(platform.node(), os.environ.get("PROCESSOR_IDENTIFIER", ""))]
    return repr((platform.machine(), kept))


def _stamps(module: str) -> dict[str, tuple[int, int]]:
    """Returns the times of change (ns) and sizes (bytes) of a module's sources."""
    stats = {str(path): path.stat() for path in sources_of(module)}
    return {path: (stat.st_mtime_ns, stat.st_size) for path, stat in stats.items()}


def _digest(file: Path) -> str:
    """Returns the digest of a file of code; "" for an index, which other machines change, too."""
    return hashlib.sha256(file.read_bytes()).hexdigest() if file.suffix == ".nbc" else ""


def _read(path: Path) -> _Mark | None:
    try:
        return msgspec.json.decode(path.read_bytes(), type=_Mark)
    except (OSError, msgspec.MsgspecError):
        return None


def _is_true(path: Path) -> bool:
    found = _read(path)
    try:
        return found is not None and all(
            Path(file).is_file() and _digest(Path(file)) == digest
            for file, digest in found.kept.items()
        )
    except OSError:
        return False


def _remove_older(path: Path, module: str) -> None:
    """Removes marks beside this one that belong to earlier versions of the same sources."""
    now, source = _stamps(module), str(sources_of(module)[0])
    for other in path.parent.glob(f"{module.rpartition('.')[2]}-*.kept"):
        found = _read(other)
        # A file that cannot be read is a mark in an earlier format.
        if found is None or (source in found.sources and found.sources != now):
            with suppress(OSError):
                other.unlink(missing_ok=True)
