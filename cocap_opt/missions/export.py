"""Flights as files for others, and what must be known to fly them."""

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import NamedTuple

from cocap_opt.data import FieldError
from cocap_opt.flight.flights import Flight


class Export(NamedTuple):
    """Files of one format, and what to know about them.

    Attributes
    ----------
    files : their contents, by what stands in their names between the name that was asked for and
        its ending: "" is that name itself, "drone0" makes `flight.drone0.plan` of `flight.plan`
    notes : sentences on what the files cannot say
    facts : numbers on them, which are printed with those of the flights
    warnings : those of the notes that people must know before all else
    details : those of the notes that say how to read the files, which nobody needs to fly them
    """

    files: dict[str, bytes]
    notes: tuple[str, ...] = ()
    facts: Mapping[str, float | str | None] = MappingProxyType({})
    warnings: tuple[str, ...] = ()
    details: tuple[str, ...] = ()


# Takes the flights and the seconds between rows or points, None for what is usual. It raises
# ProblemError, one line, where the format cannot hold these flights.
Writer = Callable[[Flight, float | None], Export]


def require_nothing_else(every: float | None, words: str) -> None:
    """Refuses seconds between points for formats that have points of their own."""
    if every is not None:
        raise FieldError("every", f"must be left out, for {words}")
