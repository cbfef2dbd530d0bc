"""Flights as files for other programs, and notes for flying them."""

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import NamedTuple

from cocap_opt.data import FieldError
from cocap_opt.flight.flights import Flight
from cocap_opt.flight.notes import Note


class Export(NamedTuple):
    """Files of one format, and notes on them.

    Attributes
    ----------
    files : their contents, by the part inserted before the ending of the requested name: "" is that
        name itself, "drone0" gives `flight.drone0.plan` for `flight.plan`
    notes : notes on what the files do not contain, and on how to read them
    facts : numbers that are printed with those of the flights
    """

    files: dict[str, bytes]
    notes: tuple[Note, ...] = ()
    facts: Mapping[str, float | str | None] = MappingProxyType({})


# Takes the flights and the seconds between rows or points, None for the default. It raises
# ProblemError, with a one-line message, if the format cannot represent these flights.
Writer = Callable[[Flight, float | None], Export]


def require_nothing_else(every: float | None, words: str) -> None:
    """Rejects a time between points for formats with their own points."""
    if every is not None:
        raise FieldError("every", f"must be left out, as {words}")
