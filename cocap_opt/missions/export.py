"""Flights as files for others, and what must be known to fly them."""

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import NamedTuple

from cocap_opt.data import FieldError
from cocap_opt.flight.flights import Flight
from cocap_opt.flight.notes import Note


class Export(NamedTuple):
    """Files of one format, and what to know about them.

    Attributes
    ----------
    files : their contents, by what stands in their names between the name that was asked for and
        its ending: "" is that name itself, "drone0" makes `flight.drone0.plan` of `flight.plan`
    notes : sentences on what the files cannot say, and on how to read them
    facts : numbers on them, which are printed with those of the flights
    """

    files: dict[str, bytes]
    notes: tuple[Note, ...] = ()
    facts: Mapping[str, float | str | None] = MappingProxyType({})


# Takes the flights and the seconds between rows or points, None for what is usual. It raises
# ProblemError, one line, where the format cannot hold these flights.
Writer = Callable[[Flight, float | None], Export]


def require_nothing_else(every: float | None, words: str) -> None:
    """Refuses seconds between points for formats that have points of their own."""
    if every is not None:
        raise FieldError("every", f"must be left out, for {words}")
