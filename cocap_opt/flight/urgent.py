"""Warnings that nobody who flies a flight must overlook, for all who print or draw it."""

from collections.abc import Iterator, Sequence

from cocap_opt.flight.changes import tight_timing
from cocap_opt.flight.flights import Flight
from cocap_opt.flight.notes import Kind, Note
from cocap_opt.flight.touchdowns import Touchdowns
from cocap_opt.flight.ways import Part, pauses_of
from cocap_opt.plausibility import misplaced_people


def attention(flight: Flight, grounds: Touchdowns, parts: Sequence[Part]) -> Iterator[Note]:
    """Yields warnings, each of which asks for attention.

    They are of plans that a limit cut short, drones too near to each other or to people,
    touchdowns, people out of place, tight timing, and pauses for new batteries.

    Parameters
    ----------
    grounds : touchdowns of the flight
    parts : of the take between which batteries are changed; none without homes
    """
    for words in _urgent(flight, grounds, parts):
        yield Note(f"ATTENTION: {words}", Kind.URGENT)


def _urgent(flight: Flight, grounds: Touchdowns, parts: Sequence[Part]) -> Iterator[str]:
    if flight.cut_short:
        yield flight.cut_short
    yield from flight.too_near()
    yield from grounds.warnings()
    yield from misplaced_people(flight.flown.problem)
    yield from tight_timing(flight)
    if pause := pauses_of(parts):
        yield pause
