"""The answer of `fly` for people: what requires attention, what was written, what to do."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from cocap_opt.flight.earth import told_accuracy
from cocap_opt.flight.filming import parts_of
from cocap_opt.flight.flights import Flight
from cocap_opt.flight.notes import Kind, Note, notes_of
from cocap_opt.flight.ways import Part
from cocap_opt.output.answer import print_pairs, print_result
from cocap_opt.output.nearness import no_rule
from cocap_opt.output.printing import (
    Listing,
    Record,
    path_text,
    print_line,
    print_list,
    print_texts,
    rounded,
)
from cocap_opt.text import counted

_MANY, _FEW = 12, 6  # drones above which a table is cut, and rows that it keeps


class FlightAnswer(NamedTuple):
    """The answer of `fly`.

    Attributes
    ----------
    flight : the flight that is written
    parts : parts of the take, between which batteries are changed; empty without homes
    files : files that contain the flight
    whole : the complete answer, with all numbers
    notes : notes on the flight and the files, in order
    """

    flight: Flight
    parts: Sequence[Part]
    files: Sequence[Path]
    whole: Record
    notes: Sequence[Note]

    def print(self) -> None:
        """Prints warnings, the answer in a few lines, and notes for the crew."""
        self._print_urgent()
        print_pairs(self._in_short())
        if notes := notes_of(self.notes, Kind.CREW, Kind.UNCHECKED):
            print_texts([], ["", "Before you fly:"])
            print_list(notes)
        print_line(" (--verbose: all numbers, each drone, how to read the file)")

    def print_all(self) -> None:
        """Prints warnings, all numbers, tables of drones, and all notes."""
        self._print_urgent()
        print_result({**self.whole, "file": [*self.files]}, json=False)
        if self.parts:
            _in_the_air(self.parts).print()
        _tightest(self.flight.rows()).print()
        notes = notes_of(self.notes, Kind.CREW, Kind.UNCHECKED, Kind.NO_RULE)
        print_texts([], ["Before you fly:"] if notes else [])
        print_list(notes)
        details = notes_of(self.notes, Kind.READING)
        print_texts([], ["", "How to read the file:"] if details else [])
        print_list(details)

    def _print_urgent(self) -> None:
        if urgent := notes_of(self.notes, Kind.URGENT):
            print_texts([], [*(f"{words}." for words in urgent), ""])

    def _in_short(self) -> Iterator[tuple[str, str]]:
        """Yields labels and values."""
        flown, found = self.flight.flown, self.flight.record()
        rules, asked = flown.problem.rules, self.flight.asked or flown.problem.airspace
        yield "file", "\n".join(map(path_text, self.files))
        way = "smooth" if self.flight.is_smooth else "straight"
        steps = f"{counted(flown.problem.horizon, 'step')} of {flown.step:g} s"
        yield "flight", f"{way}, {flown.seconds:g} s: {steps}"
        mean, parts = rounded(found[f"reward_{way}"]), parts_of(flown.problem)
        at_steps = f"{rounded(found['reward'])} at the steps"
        yield "J", f"{at_steps}; {mean} as the mean over {parts} moments a step"
        if found["least_distance"] is not None:
            rule = _rule(rules.separation, rules.vertical, "in height", "between the steps")
            yield "between drones", f"{found['least_distance']:.2f} m at least; {rule}"
        if found["people_distance"] is not None:
            rule = _rule(asked.people_aside, asked.people_above, "above", "on people")
            wide = max(actor.swerve for actor in flown.problem.actors)
            off = f", with people up to {wide:.3g} m off their straight walks" if wide else ""
            yield "to people", f"{found['people_distance']:.2f} m at least, from above{off}; {rule}"
        tightest = max(self.flight.rows(), key=_tightness)
        if tightest["limit"] is not None:
            yield "nearest to a limit", _told_demand(tightest)
        if self.parts:
            yield "in the air", _told_air(self.parts)
        if "crs" in found:
            yield "on the Earth", f"{found['crs']}, {told_accuracy(found['accuracy'])}"


def _rule(least: float, over: float | None, way: str, none: str) -> str:
    """Returns words for a rule on distances: horizontally (m), or else vertically (m)."""
    if not least:
        return no_rule(none)
    return f"the scene's rule is {least:g} m" + (f", or {over:g} m {way}" if over else "")


def _told_demand(row: Record) -> str:
    """Returns words for the most demanding moment of a drone."""
    asked = f"drone {row['drone']}, {row['tightest']} {row['value']:.2f} {row['unit']}"
    return f"{asked}, {row['of the limit']} of its limit"


def _told_air(parts: Sequence[Part]) -> str:
    """Returns words for the longest time in the air, and for the battery with the smallest
    reserve.
    """
    drones = [drone for part in parts for drone in part.drones]
    longest = max(drones, key=lambda each: each.seconds)
    words = f"{longest.seconds:.0f} s at most (drone {longest.drone})"
    known = [(each.endurance - each.seconds, each) for each in drones if each.endurance is not None]
    if known:
        left, drone = min(known, key=lambda pair: pair[0])
        words += f"; {left:.0f} s of battery left at least (drone {drone.drone})"
    unknown = sorted({each.drone for each in drones if each.endurance is None})
    if unknown:
        which = f" of drone{'s' if unknown[1:] else ''} {', '.join(map(str, unknown))}"
        words += f"; endurance{which if known else ''} unknown"
    return words


def _in_the_air(parts: Sequence[Part]) -> Listing:
    """Returns the table of each drone's time in the air in each part, and of its battery."""
    rows = [
        {
            **({"steps": part.words} if len(parts) > 1 else {}),
            "drone": drone.drone, "out (s)": drone.out.seconds, "take (s)": drone.filming,
            "back (s)": drone.back.seconds, "waits (s)": drone.out.waits + drone.back.waits,
            "in the air (s)": drone.seconds, "battery (s)": drone.endurance,
        }
        for part in parts
        for drone in part.drones
    ]  # fmt: skip
    return Listing("from take-off to landing", rows)


def _tightest(rows: Sequence[Record]) -> Listing:
    """Returns the table of the drones' most demanding moments; for many drones, only a few rows."""
    table = Listing("tightest moment of each drone", rows)
    if len(rows) <= _MANY:
        return table
    ranked = sorted(rows, key=_tightness, reverse=True)
    return table._replace(rows=ranked).first(_FEW, "the drones nearest to a limit, or the fastest")


def _tightness(row: Record) -> tuple[float, float]:
    return (row["value"] / row["limit"] if row["limit"] else 0.0, row["value"])
