"""Checks that memory suffices, made before it is allocated."""

import math
from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path

import psutil

from cocap_opt.data import ProblemError

_USABLE = 0.9  # share of the free memory; the rest is for other programs
_GIGABYTE = 1e9
_GROUPS, _OURS = Path("/sys/fs/cgroup"), Path("/proc/self/cgroup")
# Files of a group of processes, for versions 2 and 1 of cgroups: its limit, its usage, and the line
# of its statistics that counts cached files, which the kernel drops if memory is needed.
_FILES = (
    (".", "memory.max", "memory.current", "inactive_file"),
    ("memory", "memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file"),
)


def free_bytes() -> float:
    """Returns the bytes that are free on this machine, or fewer if its process group has a limit.

    Containers and jobs on clusters are such groups.
    """
    return min([float(psutil.virtual_memory().available), *_left_in_groups()])


def _left_in_groups() -> Iterator[float]:
    """Yields the bytes that are left in each group of this process that has a limit."""
    for controller, limit, used, gives_way in _FILES:
        for group in {_GROUPS / controller, *_own_groups(_GROUPS / controller)}:
            # The file is missing or not readable, or contains "max", as there is no limit.
            with suppress(OSError, ValueError):
                most, now = (int((group / name).read_text()) for name in (limit, used))
                yield max(float(most - now + _giving_way(group, gives_way)), 0.0)


def _own_groups(root: Path) -> Iterator[Path]:
    """Yields the group of this process and its parent groups, below a root."""
    with suppress(OSError):
        for line in _OURS.read_text().splitlines():
            _, controllers, path = line.split(":", 2)
            if controllers in ("", "memory"):
                group = root / path.lstrip("/")
                yield from (part for part in (group, *group.parents) if root in part.parents)


def _giving_way(group: Path, name: str) -> int:
    """Returns the bytes of a group's cached files; 0 if unknown."""
    with suppress(OSError, ValueError):
        for line in (group / "memory.stat").read_text().splitlines():
            key, value = line.split()
            if key == name:
                return int(value)
    return 0


def fits(needed: float) -> bool:
    """Returns True if the needed bytes are free, with a reserve for other programs."""
    return needed <= _USABLE * free_bytes()


def require_memory(
    needed: float, what: str, cells: tuple[int, int], border: int, counts: Mapping[str, int]
) -> None:
    """Rejects a computation that needs more memory than is free.

    Parameters
    ----------
    needed : bytes
    what : the thing that needs them, with its size, for the message
    cells : number of cells along x and y of the map, or of the part of it that is used
    border : cells on each side of them that need as much memory
    counts : numbers of other things by their names; the memory is proportional to each

    Raises
    ------
    ProblemError
        If the memory does not suffice; one line with both numbers, and with sizes that would fit.
    """
    free = free_bytes()
    if needed > _USABLE * free:
        share = _USABLE * free / needed
        advice = ", or ".join([_on_fewer_cells(share, cells, border), *_with_fewer(share, counts)])
        raise ProblemError(
            f"{what} needs about {needed / _GIGABYTE:,.1f} GB of memory, of which "
            f"{free / _GIGABYTE:,.1f} GB are free; {advice}"
        )


def _on_fewer_cells(share: float, cells: tuple[int, int], border: int) -> str:
    """Returns advice on the part of a map, as square as possible, that needs this share."""
    x, y = (edge + 2 * border for edge in cells)
    short = min(x, y, math.sqrt(share * x * y))
    long = share * x * y / short
    ends = [math.floor(edge) - 2 * border for edge in ((short, long) if x <= y else (long, short))]
    if min(ends) < 1:
        return "use larger cells or a part of the map"
    return f"use larger cells or a part of the map, at most {ends[0]} x {ends[1]} of them"


def _with_fewer(share: float, counts: Mapping[str, int]) -> Iterator[str]:
    """Yields the number of each of the other things that needs this share of the memory."""
    for name, count in counts.items():
        if share * count >= 1:
            yield f"at most {math.floor(share * count)} {name}"
