"""The sentences and tables of a sheet, except those on maps and cards."""

import math
from collections.abc import Iterator

from cocap_opt.flight.changes import (
    TIGHT,
    people_and_delay,
    tolerated_delay,
    tolerated_delay_of_people,
)
from cocap_opt.flight.earth import told_accuracy
from cocap_opt.flight.flights import Flight
from cocap_opt.flight.notes import Kind
from cocap_opt.flight.safety import Nearest
from cocap_opt.flight.touchdowns import Touchdowns
from cocap_opt.missions import FORMATS
from cocap_opt.missions.autopilots import AUTOPILOTS
from cocap_opt.missions.routes import routes, seconds_to_step_0
from cocap_opt.missions.sheet.clock import Clock
from cocap_opt.missions.sheet.ground import take_off
from cocap_opt.missions.sheet.heights import Heights
from cocap_opt.missions.sheet.pages import Block, Section, Table
from cocap_opt.missions.sheet.places import places, walks
from cocap_opt.missions.waypoints import ROUNDED, lateness
from cocap_opt.missions.zones import Zone, zones
from cocap_opt.output.heights import over_datum
from cocap_opt.problem import Problem
from cocap_opt.text import counted

_CHECKS = (
    "batteries are charged; radio links and satellite reception are good",
    "the map has all obstacles, such as cranes, cables and trees",
    "only people on this sheet are there; everybody knows their walk and their signal",
    "airspace and its rules are clear, and the owners of the ground agree",
    "pilots know what a drone does if its link is lost, and where it lands in an emergency",
)
_MOST_CORNERS = 8  # corners of a no-fly zone that are listed


def sections(
    flight: Flight, clock: Clock, grounds: Touchdowns, every: float | None
) -> list[Section]:
    """Returns the sections after maps and cards, except the list of things that were not checked.

    Parameters
    ----------
    every : time between rows of tables of places, s; None: no tables
    """
    return [
        Section("Places and heights", list(_places_and_heights(flight))),
        Section(
            "Distances and limits",
            [*_distances(flight, clock), *_limits(flight, clock)],
        ),
        Section("Late drones and people", list(_delays(flight))),
        *take_off(flight, clock, grounds),
        *_missions(flight, clock),
        *([] if every is None else [*places(flight, every), *walks(flight, every)]),
    ]


def running_order(flight: Flight, clock: Clock) -> Table:
    """Returns the table of events, by the clock."""
    return Table(("time", "who", "what"), list(_order(flight, clock)))


def to_check(flight: Flight, has_homes: bool) -> Iterator[str]:
    """Yields the items that somebody checks on site and ticks off."""
    problem = flight.flown.problem
    yield "wind and gusts are within the drones' limits"
    if has_homes:
        yield "the flights from and to home are clear of people"
    else:
        yield "take-off and landing spots, and the air above them, are clear"
    yield from _CHECKS
    if not problem.height_map.knows_ground:
        yield (
            "take-offs and landings are above free ground, not above roofs or obstacles: the map "
            "has no ground heights"
        )
    if not problem.land_cover:
        yield "take-offs and landings are above land, not water: the scene has no land cover"
    if problem.airspace.no_fly:
        yield "drones have the no-fly zones as a geofence"
    if (ceiling := problem.airspace.ceiling) is not None:
        yield f"drones have the ceiling, {ceiling:g} m {over_datum(problem)}, as a limit"


def unchecked(flight: Flight) -> Iterator[str]:
    """Yields what the program did not check or does not know."""
    yield "distances hold for drones and people that keep exactly to the plan"
    for note in flight.notes():
        if note.kind in {Kind.UNCHECKED, Kind.NO_RULE}:
            yield note.text
    if not flight.is_smooth:
        yield ROUNDED


def _order(flight: Flight, clock: Clock) -> Iterator[tuple[str, str, str]]:
    problem, flown = flight.flown.problem, flight.flown
    parts = clock.parts or (None,)
    for number, part in enumerate(parts):
        first, last = (0, problem.horizon) if part is None else (part.first, part.last)
        begin, end = first * flown.step, last * flown.step
        if part is not None:
            out = sorted((drone.out for drone in part.drones), key=lambda way: -way.waits)
            for way in out:
                at = begin - way.waits - way.seconds
                yield (
                    clock.at(at, number),
                    f"drone {way.drone}",
                    "takes off, and flies to its place",
                )
        elif problem.begins_in_the_air:
            yield clock.at(0.0), "all drones", "hover at their first places until all begin"
        elif not flight.is_smooth:
            at = -seconds_to_step_0(flight)
            yield (clock.at(at), "all drones", "waypoint missions are started, all at once; "
                   "drones rise to their first places and wait there")  # fmt: skip
        else:
            yield "before", "all drones", "rise to their first places; all wait until all are there"
        what = "SIGNAL: start walking" if number == 0 else "SIGNAL: continue from where you stopped"
        step = f"step {first}" + (" of the plan" if first == 0 else "")
        if problem.actors:
            yield clock.at(begin, number), "all people", f"{what} ({step})"
        yield clock.at(begin, number), "all drones", f"the take begins ({step})"
        is_last = number == len(parts) - 1
        pause = "latest time to pause the take; people stop as well"
        what = "the take ends" if is_last else pause
        yield clock.at(end, number), "all", f"{what} (step {last})"
        if part is not None:
            back = sorted((drone.back for drone in part.drones), key=lambda way: way.waits)
            for way in back:
                goes, lands = end + way.waits, end + way.waits + way.seconds
                yield (clock.at(goes, number), f"drone {way.drone}",
                       f"flies home, on the ground at {clock.at(lands, number)}")  # fmt: skip
        else:
            if problem.actors:
                yield "after", "all people", "leave, before drones come down at their last places"
            yield "after", "all drones", "land at their last places, one after the other"
        if not is_last:
            yield "then", "crew", f"new batteries; T{number + 2} is when the take resumes"


def _places_and_heights(flight: Flight) -> Iterator[Block]:
    problem, flown = flight.flown.problem, flight.flown
    drones, people = len(problem.robots), len(problem.actors)
    yield (
        f"{counted(drones, 'drone')}, {counted(people, 'person')}; {flown.seconds:g} s, in "
        f"{counted(problem.horizon, 'step')} of {flown.step:g} s; "
        f"{'smooth' if flight.is_smooth else 'straight from step to step'}."
    )
    yield from _tracks(problem)
    if flight.is_smooth:
        yield (
            "This sheet is for a smooth flight: waypoint missions fly straight, and need a sheet "
            "of their own."
        )
    if flight.geodesy is None:
        yield "Places: x and y of the map (m); its location on the Earth is unknown or left out."
    else:
        known = told_accuracy(flight.geodesy.accuracy)
        yield f"Places: {flight.geodesy.axes}; latitudes and longitudes by {known}."
        yield from (f"{note}." for note in flight.axes())
    yield Heights.of(flight).sentence()
    yield _angles(flight)


def _tracks(problem: Problem) -> Iterator[str]:
    """Yields the times of people's tracks at step 0."""
    begins = dict[float, list[str]]()
    for j, actor in enumerate(problem.actors):
        if actor.begin is not None:
            begins.setdefault(actor.begin, []).append(problem.person(j))
    for begin, people in begins.items():
        everybody = 1 < len(people) == len(problem.actors)
        who = "all people" if everybody else ", ".join(people)
        yield f"Step 0 is at {begin:.6g} s of the tracks of {who}."


def _angles(flight: Flight) -> str:
    yaw = "yaw is 0 along x, counter-clockwise"
    if flight.geodesy is not None:
        yaw = "compass is clockwise from true north"
    return f"Degrees: {yaw}; pitch is the camera's, 0 is level, below is negative."


def _distances(flight: Flight, clock: Clock) -> Iterator[str]:
    """Yields the closest approaches of drones to each other and to people, and the rules for
    them.
    """
    problem = flight.flown.problem
    near = Nearest.of_drones(flight.flown)
    rules, heights = problem.rules, Heights.of(flight)
    required = f"required: {rules}" if rules.separation else "the scene requires no distance"
    if near is None:
        yield "Between drones: there is only one."
    else:
        x, y, z = near.place.tolist()
        yield (
            f"Minimum distance between drones: {near.distance:.2f} m (drones {near.first} and "
            f"{near.second}, at {clock.time(near.t)} near x {x:.1f}, y {y:.1f}, "
            f"{heights.told(z)}); {required}."
        )
    close = Nearest.of_people(flight.flown)
    if close is not None:
        x, y, z = close.place.tolist()
        yield (
            f"Minimum distance to people, seen from above: {close.distance:.2f} m (drone "
            f"{close.first} and {problem.person(close.second)}, at {clock.time(close.t)} near "
            f"x {x:.1f}, y {y:.1f}, {heights.told(z)}){problem.actors[close.second].told_swerve}."
        )
    yield f"Airspace: {str(problem.airspace) or 'no zones, no ceiling, no distance to people'}."
    if problem.airspace.ceiling is not None:
        yield f"The ceiling is {problem.airspace.ceiling:g} m {over_datum(problem)}."
    if flight.geodesy is not None:
        for zone in zones(flight, flight.geodesy):
            yield f"N{zone.name[1:]}{_corners(zone)}."
    if flight.asked is not None:
        yield f"The scene requires {flight.asked.told_people}; this flight may come closer."


def _corners(zone: Zone) -> str:
    """Returns the position of a zone, by its corners if they are few; KML and GeoJSON contain all
    others.
    """
    corners = list(zone.outline.exterior.coords)[:-1]
    if len(corners) > _MOST_CORNERS:
        west, south, east, north = zone.outline.bounds
        return f", between x {west:.1f} and {east:.1f}, y {south:.1f} and {north:.1f}"
    return f", with corners {', '.join(f'x {x:.1f} y {y:.1f}' for x, y in corners)}"


def _delays(flight: Flight) -> Iterator[str]:
    """Yields the delays of drones or people that distances tolerate."""
    rules, delay = flight.flown.problem.rules, tolerated_delay(flight)
    if delay is not None and math.isinf(delay):
        yield f"Between drones: {rules} holds for any delay of any drone."
    elif delay is not None:
        yield f"Between drones: {rules} holds while none is {delay:.2f} s or more behind another."
    to_people = tolerated_delay_of_people(flight)
    for note in people_and_delay(flight, to_people):
        yield f"{note.text[0].upper()}{note.text[1:]}."
    if delay is not None or to_people is not None:
        yield (
            f"The first page warns if less than {TIGHT:g} s is left: clocks show whole seconds, so "
            "nobody would notice such a delay in time."
        )


def _limits(flight: Flight, clock: Clock) -> Iterator[Block]:
    """Yields the most demanding moment of each drone."""
    found = flight.rows()
    if all(row["limit"] is None for row in found):
        yield "The tightest moment of each drone (limits unknown):"
        speeds = [
            (str(row["drone"]), row["tightest"], clock.time(row["at (s)"]),
             f"{row['value']:.2f} {row['unit']}")
            for row in found
        ]  # fmt: skip
        yield Table(("drone", "tightest", "time", "value"), speeds, frozenset({0, 2, 3}))
        return
    yield "The tightest moment of each drone:"
    rows = [
        (
            str(row["drone"]), row["tightest"], clock.time(row["at (s)"]),
            f"{row['value']:.2f} {row['unit']}",
            "not known" if row["limit"] is None else f"{row['limit']:.2f} {row['unit']}",
            row["of the limit"] or "-",
        )
        for row in found
    ]  # fmt: skip
    heads = ("drone", "tightest", "time", "value", "limit", "of the limit")
    yield Table(heads, rows, frozenset({0, 2, 3, 4, 5}))


def _instead_of_homes(flight: Flight, clock: Clock) -> Iterator[str]:
    """Yields how missions begin and end if the running order has flights from and to home."""
    if clock.parts:
        begin = clock.at(-seconds_to_step_0(flight))
        yield (
            "Missions contain no flights from or to home, and no pause, so the running order does "
            "not hold for them. Put each drone below its first place, and start all missions at "
            f"once at {begin}, in time for step 0; at the end drones hover until pilots land them."
        )


def _missions(flight: Flight, clock: Clock) -> Iterator[Section]:
    """Yields what the crew must know about the missions of this flight for each autopilot."""
    if flight.is_smooth or flight.geodesy is None or flight.flown.problem.begins_in_the_air:
        return
    rows = list[tuple[str, ...]]()
    found = routes(flight, flight.geodesy)
    for autopilot in AUTOPILOTS.values():
        known = {ending: kind.autopilots for ending, kind in FORMATS.items()}
        endings = [ending for ending, pilots in known.items() if autopilot.name in pilots]
        # default autopilots first
        endings.sort(key=lambda ending: known[ending].index(autopilot.name))
        names = "\n".join(f"*.{autopilot.name}.*{ending}" for ending in endings)
        late = "".join(f" {words}." for words in lateness(autopilot, found))
        rows.append((names, autopilot.title, f"{autopilot.note}.{late}"))
    yield Section(
        "Waypoint missions",
        [
            "A mission flies only on the autopilot that its file names. Altitudes in its file "
            "are relative to the take-off: the surface below the drone's first place.",
            *_instead_of_homes(flight, clock),
            Table(("files", "autopilot", "note"), rows),
        ],
    )
