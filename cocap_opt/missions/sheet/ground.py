"""The flights of drones to their first places, and from their last places back to the ground."""

from collections.abc import Iterator, Sequence

from cocap_opt.flight.flights import Flight
from cocap_opt.flight.touchdowns import Touchdowns
from cocap_opt.flight.ways import CRUISE, NOTE, RISE, Part, Way
from cocap_opt.missions.sheet.clock import Clock
from cocap_opt.missions.sheet.heights import Heights
from cocap_opt.missions.sheet.pages import Block, Section, Table
from cocap_opt.missions.sheet.places import degree_heads, degrees
from cocap_opt.problem import Problem


def take_off(flight: Flight, clock: Clock, grounds: Touchdowns) -> Iterator[Section]:
    """Yields sections on how drones reach their first places and return to the ground."""
    problem = flight.flown.problem
    if problem.begins_in_the_air:
        yield Section("Drones in the air", list(_already_up(problem)))
        yield Section("Landing (a suggestion)", list(_legs(flight, grounds)))
        return
    if not clock.parts:
        yield Section("Take-off and landing (a suggestion)", list(_legs(flight, grounds)))
        return
    heights = Heights.of(flight)
    yield Section("From home and back", list(_homeward(clock.parts)))
    for part in clock.parts:
        steps = f" of steps {part.words}" if len(clock.parts) > 1 else ""
        rows = [
            row
            for drone in part.drones
            for words, way in (("out", drone.out), ("back", drone.back))
            for row in _points(drone.drone, words, way, heights)
        ]
        heads = ("drone", "way", "x (m)", "y (m)", heights.head)
        yield Section(f"Ways{steps}", [Table(heads, rows, frozenset({0, 2, 3, 4}))])


def _already_up(problem: Problem) -> Iterator[str]:
    """Yields the number of each drone in the mission, and how they begin its rest."""
    yield "The rest of a mission: all drones hover at their first places until all begin."
    for i, robot in enumerate(problem.robots):
        yield f"Drone {i} of this sheet is drone {robot.number} of the mission."
    yield "Battery times are those left after the steps flown so far."


def _homeward(parts: Sequence[Part]) -> Iterator[Block]:
    """Yields the times that drones are in the air."""
    yield f"{NOTE[0].upper()}{NOTE[1:]}."
    yield (
        f"Straight up and down at home, at {RISE:g} m/s or faster; in level flight at "
        f"{CRUISE:g} m/s if limits are known and allow it, otherwise as fast as in the take."
    )
    rows = []
    for part in parts:
        for each in part.drones:
            seconds = (each.out.seconds, each.out.waits, each.filming, each.back.waits,
                       each.back.seconds, each.seconds)  # fmt: skip
            lasts = "" if each.endurance is None else f"{each.endurance:.0f}"
            rows.append((part.words, str(each.drone), *(f"{s:.1f}" for s in seconds), lasts))
    heads = ("steps", "drone", "out (s)", "waits (s)", "take (s)", "waits (s)", "back (s)",
             "in the air (s)", "battery (s)")  # fmt: skip
    yield Table(heads, rows, frozenset(range(1, len(heads))))


def _points(drone: int, words: str, way: Way, heights: Heights) -> Iterator[tuple[str, ...]]:
    """Yields the turning points of a way."""
    for k, (x, y, z) in enumerate(way.points.tolist()):
        names = (str(drone), words) if k == 0 else ("", "")
        yield (*names, *(f"{metres:.1f}" for metres in (x, y, heights.above_datum(z))))


def _legs(flight: Flight, grounds: Touchdowns) -> Iterator[Block]:
    """Yields the vertical legs up to the first places and down from the last."""
    if not flight.flown.problem.begins_in_the_air:
        yield "Straight up from the surface below the first place."
    yield "Straight down at the last place, one drone after the other."
    heights = Heights.of(flight)
    heads = ("drone", "leg", "x (m)", "y (m)", f"surface,\n{heights.head.replace(chr(10), ' ')}",
             f"place,\n{heights.head.replace(chr(10), ' ')}", "leg (m)", *degree_heads(flight),
             "surface")  # fmt: skip
    rows = [
        (
            str(each.drone), each.kind, f"{each.x:.1f}", f"{each.y:.1f}",
            f"{heights.above_datum(each.surface):.2f}", f"{heights.above_datum(each.z):.2f}",
            f"{each.z - each.surface:.2f}", *degrees(flight, each.x, each.y), each.ground,
        )
        for each in grounds.found
    ]  # fmt: skip
    yield Table(heads, rows, frozenset(range(len(heads) - 1)) - {1})
