"""Memory that is needed, known before it is taken."""

import math
from collections.abc import Iterator, Mapping

import psutil

from cocap_opt.data import ProblemError

_USABLE = 0.9  # of the memory that is free: other programs need some, too
_GIGABYTE = 1e9


def fits(needed: float) -> bool:
    """Returns True if so many bytes are free, and some for other programs."""
    return needed <= _USABLE * psutil.virtual_memory().available


def require_memory(
    needed: float, what: str, cells: tuple[int, int], border: int, counts: Mapping[str, int]
) -> None:
    """Refuses what needs more bytes than there are.

    Parameters
    ----------
    what : that needs it, with its size
    cells : along x and y of the map, or of its part that counts
    border : cells on each side of them that need as much as they do
    counts : numbers of other things by their names, in proportion to each of which it is

    Raises
    ------
    ProblemError
        If it does not fit; one line with both numbers, and with what would fit.
    """
    free = psutil.virtual_memory().available
    if needed > _USABLE * free:
        share = _USABLE * free / needed
        advice = ", or ".join([_on_fewer_cells(share, cells, border), *_with_fewer(share, counts)])
        raise ProblemError(
            f"{what} needs about {needed / _GIGABYTE:,.1f} GB of memory, of which "
            f"{free / _GIGABYTE:,.1f} GB are free; {advice}"
        )


def _on_fewer_cells(share: float, cells: tuple[int, int], border: int) -> str:
    """Returns advice on the part of a map, as near to a square as may be, that needs a share."""
    x, y = (edge + 2 * border for edge in cells)
    short = min(x, y, math.sqrt(share * x * y))
    long = share * x * y / short
    ends = [math.floor(edge) - 2 * border for edge in ((short, long) if x <= y else (long, short))]
    if min(ends) < 1:
        return "use larger cells or a part of the map"
    return f"use larger cells or a part of the map, at most {ends[0]} x {ends[1]} of them"


def _with_fewer(share: float, counts: Mapping[str, int]) -> Iterator[str]:
    """Yields how many of each of other things need a share of what all of them do."""
    for name, count in counts.items():
        if share * count >= 1:
            yield f"at most {math.floor(share * count)} {name}"
