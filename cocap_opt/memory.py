"""Memory that is needed, known before it is taken."""

import psutil

from cocap_opt.data import ProblemError

_USABLE = 0.9  # of the memory that is free: other programs need some, too
_GIGABYTE = 1e9


def require_memory(needed: float, what: str, advice: str) -> None:
    """Refuses what needs more bytes than there are.

    Parameters
    ----------
    what : that needs it, with its size
    advice : a change by which it needs less

    Raises
    ------
    ProblemError
        If it does not fit; one line with both numbers.
    """
    free = psutil.virtual_memory().available
    if needed > _USABLE * free:
        raise ProblemError(
            f"{what} needs about {needed / _GIGABYTE:,.1f} GB of memory, of which "
            f"{free / _GIGABYTE:,.1f} GB are free; {advice}"
        )
