"""Warnings that nobody who flies a flight may overlook, for all programs that print or draw it."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

from cocap_opt.flight.changes import tight_timing
from cocap_opt.flight.flights import Flight
from cocap_opt.flight.notes import Kind, Note
from cocap_opt.flight.touchdowns import Touchdowns
from cocap_opt.flight.ways import Part, pauses_of
from cocap_opt.plausibility import misplaced_people


def attention(flight: Flight, grounds: Touchdowns, parts: Sequence[Part]) -> Iterator[Note]:
    """Yields warnings that require attention.

    They concern plans that a limit cut short, drones too close to each other or to people,
    touchdowns, people out of place, tight timing, and pauses for new batteries.

    Parameters
    ----------
    grounds : touchdowns of the flight
    parts : parts of the take, between which batteries are changed; empty without homes
    """
    for note in _urgent(flight, grounds, parts):
        yield replace(note, text=f"ATTENTION: {note.text}", kind=Kind.URGENT)


def _urgent(flight: Flight, grounds: Touchdowns, parts: Sequence[Part]) -> Iterator[Note]:
    if flight.cut_short:
        yield Note(flight.cut_short)
    yield from flight.too_near()
    yield from flight.beyond_most_drones()
    words = (
        *grounds.warnings(), *misplaced_people(flight.flown.problem), *tight_timing(flight),
    )  # fmt: skip
    yield from map(Note, words)
    if pause := pauses_of(parts):
        yield Note(pause)
