"""Waypoint missions, which a MAVLink autopilot flies on its own, item by item.

A drone takes off, flies to its start, waits there (MAV_CMD_NAV_DELAY), and then flies each leg of
its plan in the planned time, by the rules of its autopilot (`autopilots`). It is not synchronised
with the plan's times.

- Altitudes are above the drone's take-off (MAV_FRAME_GLOBAL_RELATIVE_ALT): autopilots know this
  height from the moment they are armed, whatever the map's vertical datum.
- Yaw is in degrees from true north, clockwise.
- Each move has a waypoint and its own speed; turns and tilts are commanded when they change.
- The camera's pitch is set by MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW, against the horizon and with
  the drone's own yaw. MAV_CMD_DO_MOUNT_CONTROL is deprecated since 2020, and its yaw turns the
  whole drone to the north on an ArduPilot whose gimbal has no yaw (ArduCopter,
  `ModeAuto::do_mount_control`).
- At the end the drone hovers (MAV_CMD_NAV_LOITER_UNLIM). The flights home are not planned, and
  drones that all return at once may collide.

Sources: https://mavlink.io/en/messages/common.html, "Mission Mode" of PX4's user guide, "Mission
Command List" of ArduCopter's.
"""

import math
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from cocap_opt.data import FieldError, FloatArray, ProblemError
from cocap_opt.flight.changes import (
    people_and_delay,
    tolerated_delay,
    tolerated_delay_of_people,
    written_delay,
)
from cocap_opt.flight.flights import Flight
from cocap_opt.flight.notes import Kind, Note
from cocap_opt.flight.ways import has_homes
from cocap_opt.missions.autopilots import AUTOPILOTS, Autopilot
from cocap_opt.missions.export import Export, require_nothing_else
from cocap_opt.missions.items import Item
from cocap_opt.missions.routes import (
    Route,
    routes,
    seconds_in_the_air,
    seconds_to_step_0,
)
from cocap_opt.missions.zones import Zone, crossed, zones
from cocap_opt.output.heights import over_datum
from cocap_opt.problem import SEPARATION, CollisionRules
from cocap_opt.problem.rules import TOLERANCE

_PART = "no-common-clock.drone"
ROUNDED = (
    "autopilots round corners and speeds; clearance was checked only on the straight legs, not "
    "during the ascent"
)
_LITTLE = 0.1  # s; smaller delays are not reported
# corners of a geofence: DM_KEY_FENCE_POINTS_MAX of PX4, which newer versions have doubled
_CORNERS = 64
_FEW = 3  # legs that are reported individually


def waypoint_mission(
    flight: Flight,
    every: float | None,
    autopilot: Autopilot,
    write: Callable[[Route, list[Item], list[Zone]], bytes],
    has_fence: bool,
) -> Export:
    """Returns a mission of waypoints for each drone.

    Parameters
    ----------
    write : returns the file of a drone, given its route, its items, and the no-fly zones that
        drones avoid
    has_fence : True if the files can contain no-fly zones

    Raises
    ------
    ProblemError
        If the scene's position on the Earth is unknown, the flight is smooth, an autopilot cannot
        hold all items, or a battery does not last from take-off to the last step.
    """
    if flight.geodesy is None:
        raise FieldError(
            "earth",
            "must say where the scene is, since waypoints have latitudes and longitudes: add "
            "[earth] to the recipe, with crs and, unless x and y are its coordinates, latitude "
            "and longitude of x = y = 0",
        )
    if flight.is_smooth:
        raise FieldError("smooth", "must be left out, as waypoints have straight legs between")
    require_nothing_else(every, "the waypoints are the steps of the plan")
    found = routes(flight, flight.geodesy)
    items = [autopilot.items(route) for route in found]
    _require_few(items, autopilot)
    _require_batteries(flight)
    known = zones(flight, flight.geodesy)
    fence = [z for z in known if has_fence and not (z.is_cut or crossed(flight, z))]
    contents = [write(*drone, fence) for drone in zip(found, items, strict=True)]
    delay = tolerated_delay(flight, _asked(flight)) if len(found) > 1 else None
    to_people = tolerated_delay_of_people(flight)
    late = lateness(autopilot, found)
    behind = max(map(autopilot.behind, found))
    urgent = *late, *_too_late(behind, delay, to_people)
    for_crew = (
        *_ends(flight, autopilot), *_fences(flight, autopilot, found, has_fence, known, fence),
        autopilot.note, *_waits(behind, autopilot), *_clock(flight, delay),
    )  # fmt: skip
    notes = (
        *(Note(words, Kind.URGENT) for words in urgent), *map(Note, for_crew),
        *people_and_delay(flight, to_people),
        *(Note(words, Kind.READING) for words in _axes(found)),
    )  # fmt: skip
    return Export(
        {f"{autopilot.name}.{_PART}{i}": content for i, content in enumerate(contents)},
        notes,
        {
            "autopilot": autopilot.title,
            "items": max(map(len, items)),
            "late": max(map(autopilot.late_by, found)),
            "delay_tolerance": written_delay(delay),
            "delay_tolerance_to_people": written_delay(to_people),
        },
    )


def _require_few(items: list[list[Item]], autopilot: Autopilot) -> None:
    """Rejects missions with more items than an autopilot can hold."""
    drone = max(range(len(items)), key=lambda i: len(items[i]))
    count = len(items[drone]) + autopilot.extra
    if count > autopilot.most:
        others = ", ".join(f"{usual.title} {usual.most}" for usual in AUTOPILOTS.values())
        raise ProblemError(
            f"the mission of drone {drone} has {count} items, more than the {autopilot.most} that "
            f"{autopilot.title} takes, {autopilot.holds} (usual: {others}); plan fewer or longer "
            "steps, or parts of the scene one after the other, each as a separate mission, or "
            "use --items to state how many items the board takes"
        )


def _require_batteries(flight: Flight) -> None:
    """Rejects missions longer than a battery lasts, including the rise and the wait at the
    start.
    """
    seconds = seconds_in_the_air(flight)
    rise = seconds - flight.flown.seconds
    for i, robot in enumerate(flight.flown.problem.robots):
        if robot.limits is not None and robot.limits.outlasted_by(seconds):
            raise ProblemError(
                f"drone {i} cannot fly this mission: from the take-off to the last step "
                f"it is {seconds:.4g} s in the air, {rise:.3g} s of them on the way up and waiting "
                f"for the others, but its battery lasts {robot.limits.endurance:.4g} s; plan fewer "
                "steps"
            )


def lateness(autopilot: Autopilot, found: list[Route]) -> list[str]:
    """Returns messages on legs that take longer than planned, with a remedy; empty if there are
    none.
    """
    late = sorted(
        (leg for route in found for leg in autopilot.late(route)), key=lambda leg: -leg.seconds
    )
    if not late:
        return []
    shown, rest = late[:_FEW], len(late[_FEW:])
    more = f", and {rest} more such legs" if rest else ""
    return [
        f"NOT IN TIME: {'; '.join(map(str, shown))}{more}; a drone is up to "
        f"{max(map(autopilot.late_by, found)):.2f} s late at the end. Plan with longer steps, or "
        "with [drones.limits] that keep to this"
    ]


def _waits(behind: float, autopilot: Autopilot) -> Iterator[str]:
    """Yields how late (s) drones are relative to their plans if they wait before a leg."""
    if behind >= _LITTLE:
        yield (
            f"{autopilot.title} cannot fly some legs as slowly as planned (straight up or down, "
            "or very slow): drones wait before them, and then arrive in time; in between they "
            f"are up to {behind:.2f} s behind the plan"
        )


def _too_late(behind: float, delay: float | None, to_people: float | None) -> Iterator[str]:
    """Yields a warning if such drones are later than their distances tolerate."""
    tolerated = min(value for value in (delay, to_people, math.inf) if value is not None)
    if behind >= max(tolerated, _LITTLE):
        yield (
            f"TOO LATE: where drones wait before a leg, they are up to {behind:.2f} s behind the "
            f"plan, more than the delay tolerance, {tolerated:.2f} s; plan with larger distances, "
            "or let drones climb on their way"
        )


def _fences(
    flight: Flight,
    autopilot: Autopilot,
    found: list[Route],
    has_fence: bool,
    known: list[Zone],
    fence: list[Zone],
) -> Iterator[str]:
    """Yields which limits of the airspace the files contain, and which they do not."""
    if known and not has_fence:
        yield (
            "no-fly zones are not in these files, which hold no fence: QGroundControl and Mission "
            "Planner load it from a .plan file of the same flight, with --autopilot ardupilot"
        )
    if fence:
        yield (
            "upload the geofence with the mission: it contains the no-fly zones, from the "
            "ground up, regardless of their heights"
        )
    corners = sum(len(zone.corners) for zone in fence)
    if corners > _CORNERS:
        yield (
            f"the geofence has {corners} corners, and some autopilots hold no more than "
            f"{_CORNERS}: check that yours has loaded all of them"
        )
    for zone in known if has_fence else ():
        if zone.is_cut:
            yield f"{zone.name}, is not in the geofence, as longitude 180 cuts it"
        elif zone not in fence:
            yield (
                f"{zone.name}, is not in the geofence, as a drone flies above or below it and a "
                "geofence has no heights"
            )
    yield from _ceiling(flight, autopilot, found)


def _ceiling(flight: Flight, autopilot: Autopilot, found: list[Route]) -> Iterator[str]:
    """Yields the ceiling relative to the take-offs, which mission files do not contain."""
    problem, ceiling = flight.flown.problem, flight.flown.problem.airspace.ceiling
    if ceiling is None:
        return
    way = flight.flown.at(np.linspace(0, flight.flown.seconds, 4 * problem.horizon + 1)).place
    altitudes = problem.height_map.ceilings(ceiling)[problem.height_map.cells_below(way)]
    lowest = altitudes.reshape(len(found), -1).min(axis=1)
    allowed = lowest - flight.flown.start_surfaces  # above each drone's take-off
    reached = np.array([route.places[:, 2].max() for route in found])
    high = reached > allowed + TOLERANCE
    words = f"the ceiling, {ceiling:g} m {over_datum(problem)}, is not in these files"
    fence = f"{autopilot.ceiling} of {autopilot.title}, which is above the take-off"
    if not high.all():
        low = np.flatnonzero(~high).tolist()
        yield f"{words}: set {fence}, to {_by_drone(allowed[low], low, len(allowed))} or less"
    if high.any():
        drones = np.flatnonzero(high).tolist()
        told = f"{_by_drone(reached[drones], drones, len(allowed))} above the take-off"
        yield (
            f"{words}, and {fence}, cannot keep it, as the ground rises or falls along the way: a "
            f"mission climbs to {told}, so a lower fence would stop it"
        )


def _by_drone(heights: FloatArray, drones: Sequence[int], count: int) -> str:
    """Returns heights (m) of some of all drones in words; one height if all drones have it."""
    told = [f"{height:.4g} m" for height in heights.tolist()]
    if len(set(told)) == 1 and len(told) == count:
        return told[0]
    return ", ".join(f"{words} (drone {i})" for i, words in zip(drones, told, strict=True))


def _asked(flight: Flight) -> CollisionRules:
    """Returns the separation to check: the scene's, or the default of recipes."""
    rules = flight.flown.problem.rules
    return rules if rules.separation else CollisionRules(separation=SEPARATION)


def _clock(flight: Flight, delay: float | None) -> Iterator[str]:
    """Yields the consequences of drones without a common clock; nothing for a single drone."""
    if delay is None:
        return
    owner = "the scene's" if flight.flown.problem.rules.separation else "a"
    asked = f"{owner} {_asked(flight)}"
    yield (
        "waypoint missions are not synchronised after take-off: nothing holds drones to their "
        "times; offboard control along a .csv file, or Skybrush (.skyc), keeps drones together"
    )
    if math.isinf(delay):
        yield f"between drones, {asked} holds for any delay of any drone"
    elif delay == 0:
        yield f"delay tolerance 0: {asked} tolerates no difference in time; plan with a larger one"
    else:
        held = (
            f"{asked} holds while no drone is {delay:.2f} s or more later in its plan than another"
        )
        yield f"delay tolerance: {held}"


def _ends(flight: Flight, autopilot: Autopilot) -> Iterator[str]:
    """Yields notes on what happens before and after the plan, and at its corners."""
    at = f"{seconds_to_step_0(flight):.3g} s"
    yield (
        f"start all missions at once: each drone rises at {autopilot.rise:g} m/s "
        f"({autopilot.rises_by}), waits at its first place until {at} after the start, and "
        "hovers at its last place; the missions contain no flights home"
    )
    if has_homes(flight.flown.problem):
        yield (
            "put drones below their first places, not at home: these missions rise straight up, "
            "and their altitudes are above the surface there"
        )
    if flight.flown.problem.actors:
        yield f"give people their signal {at} after starting the missions: that is step 0"
    yield ROUNDED


def _axes(found: list[Route]) -> Iterator[str]:
    """Yields notes on the meaning of angles and altitudes in the files."""
    yield (
        "angles in the files are in degrees: yaw is clockwise from true north; pitch is that of "
        "the camera, 0 where it is level and negative where it looks down"
    )
    yield "altitudes in the files are relative to the take-off"
    if any(route.sea is None for route in found):
        yield "the home's height above the sea is unknown"
