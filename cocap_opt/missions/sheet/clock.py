"""The phases of a flight, and the wall-clock times of events."""

import math
from collections.abc import Iterator, Sequence
from datetime import UTC, datetime, timedelta
from itertools import pairwise
from typing import NamedTuple

from cocap_opt.data import FieldError
from cocap_opt.flight.flights import Flight
from cocap_opt.flight.ways import Part, Way

OUT, TAKE, BACK = "out", "take", "back"
_STEPS = 16  # approximate steps of a phase; one more map is better than one that is too full
_MOST = 4  # phases of a take without pauses


class Clock(NamedTuple):
    """The clock of a crew.

    Attributes
    ----------
    start : the time of step 0; None if it is not known yet, and times are then relative to it
    parts : parts of the take between which batteries are changed; none without homes
    step : length of a step, s
    """

    start: datetime | None
    parts: tuple[Part, ...]
    step: float

    def at(self, t: float, part: int = 0) -> str:
        """Returns the time of a moment, to the second, or to tenths of a second if necessary.

        After a pause of unknown length, times count from the moment at which the take resumes.

        Parameters
        ----------
        t : s since step 0
        part : number of the part of the take that contains the moment
        """
        tenths = round(10 * t)
        if part or self.start is None:
            since = tenths - (round(10 * self.parts[part].first * self.step) if part else 0)
            sign, (minutes, rest) = "-" if since < 0 else "+", divmod(abs(since), 600)
            name = f"T{part + 1}" if part else "T"
            return f"{name}{sign}{minutes}:{rest // 10:02}" + (f".{rest % 10}" if rest % 10 else "")
        try:
            moment = self.start + timedelta(seconds=tenths / 10)
        except OverflowError as error:
            words = "must be such that the flight lies in the years 1 to 9999"
            raise FieldError("start", words) from error
        tenth = moment.microsecond // 100_000
        return f"{moment:%H:%M:%S}" + (f".{tenth}" if tenth else "")

    def time(self, t: float) -> str:
        """Returns the time of a moment (s since step 0), in whichever part of the take it is."""
        return self.at(t, self.part_of(t))

    def part_of(self, t: float) -> int:
        """Returns the number of the part that contains a moment (s); between two parts, the later
        one.
        """
        return sum(t >= part.first * self.step - 1e-9 for part in self.parts[1:])

    @property
    def date(self) -> str:
        """The date of step 0; empty if unknown."""
        return "" if self.start is None else f"{self.start:%A %Y-%m-%d}"

    @property
    def step_0(self) -> str:
        """The time of step 0, also in UTC, with the UTC date if it differs; empty if unknown."""
        if self.start is None:
            return ""
        utc = self.start.astimezone(UTC)
        day = "" if utc.date() == self.start.date() else f"{utc:%Y-%m-%d} "
        there = f"{day}{utc:%H:%M:%S} UTC"
        return f"{self.start:%H:%M:%S} ({there})" if self.start.utcoffset() else there


class Phase(NamedTuple):
    """A part of the time in the air with its own map.

    Attributes
    ----------
    kind : OUT, TAKE or BACK
    part : number of the part of the take
    first, last : steps; equal for flights from home and back
    ways : flights of the drones from home or back
    """

    kind: str
    part: int
    first: int
    last: int
    ways: tuple[Way, ...] = ()

    def title(self, clock: Clock) -> str:
        """Returns the title of its map."""
        begin, end = self.first * clock.step, self.last * clock.step
        if self.kind == OUT:
            begin -= max(way.waits + way.seconds for way in self.ways)
        elif self.kind == BACK:
            end += max(way.waits + way.seconds for way in self.ways)
        kind = {OUT: "From home to the first places", TAKE: "Take", BACK: "Back home"}[self.kind]
        steps = f", steps {self.first} to {self.last}" if self.kind == TAKE else ""
        return f"{kind}{steps}: {clock.at(begin, self.part)} to {clock.at(end, self.part)}"


def phases_of(flight: Flight, parts: Sequence[Part]) -> list[Phase]:
    """Returns the phases of a flight in order: flights from home, parts of the take, flights
    back.
    """
    if not parts:
        return list(_takes(0, 0, flight.flown.problem.horizon, _MOST))
    return [phase for number, part in enumerate(parts) for phase in _of(number, part, len(parts))]


def _of(number: int, part: Part, parts: int) -> Iterator[Phase]:
    out, back = (tuple(getattr(drone, name) for drone in part.drones) for name in (OUT, BACK))
    yield Phase(OUT, number, part.first, part.first, out)
    yield from _takes(number, part.first, part.last, max(_MOST // parts, 1))
    yield Phase(BACK, number, part.last, part.last, back)


def _takes(number: int, first: int, last: int, most: int) -> Iterator[Phase]:
    """Yields phases with about the same number of steps each."""
    count = min(math.ceil((last - first) / _STEPS), most)
    ends = [first + round(k * (last - first) / count) for k in range(count + 1)]
    for begin, end in pairwise(ends):
        yield Phase(TAKE, number, begin, end)
