"""A card for each drone and each person: who, equipment, places and times."""

import math
from collections.abc import Iterator

import numpy as np

from cocap_opt.data import FloatArray
from cocap_opt.flight.flights import Flight
from cocap_opt.flight.touchdowns import Touchdowns
from cocap_opt.footage.quality import Quality
from cocap_opt.missions.routes import seconds_in_the_air
from cocap_opt.missions.sheet.clock import Clock
from cocap_opt.missions.sheet.filmed import filmed_by
from cocap_opt.missions.sheet.heights import Heights
from cocap_opt.missions.sheet.pages import Card, Table
from cocap_opt.missions.sheet.places import degree_heads, degrees
from cocap_opt.problem import Robot
from cocap_opt.problem.pictures import shared_digits
from cocap_opt.scenarios.hardware import airframe_name, camera_name

_ROWS = 12  # largest number of cues on a card
_LEAST_RESERVE = 0.2  # share of a battery; the crew is warned of a smaller reserve
_AUTOPILOTS = {"px4": "PX4"}  # autopilots whose defaults are among the limits of airframes
_STANDS = 0.05  # m/s; slower people stand still
_DIGITS = 6  # decimals of degrees: 0.1 m


def drone_cards(
    flight: Flight, clock: Clock, found: Quality | None, grounds: Touchdowns
) -> list[Card]:
    """Returns a card for each drone."""
    count, heights = len(flight.flown.problem.robots), Heights.of(flight)
    return [_drone_card(flight, clock, found, grounds, heights, drone) for drone in range(count)]


def people_cards(flight: Flight, clock: Clock) -> list[Card]:
    """Returns a card for each person."""
    count = len(flight.flown.problem.actors)
    return [_person_card(flight, clock, person) for person in range(count)]


def battery_warnings(flight: Flight, clock: Clock) -> Iterator[str]:
    """Yields warnings about drones whose battery does not last, or has less than a fifth in
    reserve.
    """
    for drone, robot in enumerate(flight.flown.problem.robots):
        lasts = _endurance(robot)
        if lasts is None:
            continue
        needed = _in_the_air(flight, clock, drone)
        reserve = 1 - needed / lasts
        if needed > lasts:
            yield (
                f"THE BATTERY OF DRONE {drone} DOES NOT LAST: it lasts {_minutes(lasts)}, and the "
                f"flight takes {_minutes(math.ceil(needed))}."
            )
        elif reserve < _LEAST_RESERVE:
            yield (
                f"Drone {drone} has a battery reserve of only {_percent(reserve)}: less than a "
                "fifth."
            )


def _endurance(robot: Robot) -> float | None:
    """Returns the endurance (s) of a drone's battery; None if unknown."""
    return robot.limits.endurance if robot.limits else None


def _in_the_air(flight: Flight, clock: Clock, drone: int) -> float:
    """Returns the longest time (s) for which a battery of a drone must last.

    The descent counts only if the drone has a home.
    """
    if clock.parts:
        return max(part.drones[drone].seconds for part in clock.parts)
    if flight.flown.problem.begins_in_the_air:
        return flight.flown.seconds
    return seconds_in_the_air(flight)


def _drone_card(
    flight: Flight, clock: Clock, found: Quality | None, grounds: Touchdowns, heights: Heights,
    drone: int,
) -> Card:  # fmt: skip
    problem = flight.flown.problem
    robot = problem.robots[drone]
    ends = flight.flown.at(np.array([0.0, flight.flown.seconds]))
    start, end = ends.place[ends.drone == drone].tolist()
    facts = [
        ("camera", camera_name(robot.camera) or ""),
        ("airframe", _airframe(robot)),
        ("battery", _battery(flight, clock, drone)),
    ]
    if robot.home is not None:
        facts.append(("home", _place(flight, *problem.height_map.centre(*robot.home))))
    facts += [
        ("first place", _end(flight, heights, drone, *start)),
        ("last place", _end(flight, heights, drone, *end)),
        *(("ATTENTION", words) for words in grounds.of_drone(drone)),
        ("films", filmed_by(found, drone, problem)),
    ]
    of_mission = "" if robot.number is None else f" (drone {robot.number} of the mission)"
    return Card(
        f"Drone {drone}{of_mission}",
        facts,
        _drone_cues(flight, clock, heights, drone),
        ("pilot", ""),
    )


def _airframe(robot: Robot) -> str:
    """Returns the airframe with the same limits as a drone; limits of autopilots do not count."""
    name = airframe_name(robot.limits) or ""
    return f"________; limits of {_AUTOPILOTS[name]}" if name in _AUTOPILOTS else name


def _battery(flight: Flight, clock: Clock, drone: int) -> str:
    """Returns the time that a battery lasts, the share that is needed, and the reserve."""
    robot, needed = flight.flown.problem.robots[drone], _in_the_air(flight, clock, drone)
    down = "" if clock.parts else " plus landing"
    air = f"in the air {_minutes(math.ceil(needed))}{down}"
    lasts = _endurance(robot)
    if lasts is None:
        return f"________ min; {air}"
    left = lasts - needed
    reserve = f"reserve {_minutes(left)} ({_percent(left / lasts)})" if left >= 0 else "TOO SHORT"
    return f"{_minutes(lasts)} (as stated); {air}; {reserve}"


def _drone_cues(flight: Flight, clock: Clock, heights: Heights, drone: int) -> Table:
    """Returns a drone's places and viewing directions, by the clock."""
    samples = flight.flown.at(_moments(flight))
    is_its = samples.drone == drone
    times, place = samples.t[is_its], samples.place[is_its]
    yaw, pitch = samples.yaw[is_its], np.degrees(samples.pitch[is_its])
    looks = np.degrees(yaw) % 360
    if flight.geodesy is not None:
        looks = flight.geodesy.compass(place[:, 0], place[:, 1], yaw)
    west, south = _shared(flight)
    rows = [
        (clock.time(t),
         *(f"{metres:.1f}" for metres in (x - west, y - south, *heights.columns(z, drone))),
         f"{round(look) % 360}", f"{down:.0f}")
        for t, x, y, z, look, down in np.column_stack([times, place, looks, pitch]).tolist()
    ]  # fmt: skip
    heads = ("time", *_heads(flight), *heights.heads(), _direction(flight), "pitch")
    return Table(heads, rows, frozenset(range(1, len(heads))))


def _person_card(flight: Flight, clock: Clock, person: int) -> Card:
    problem = flight.flown.problem
    actor = problem.actors[person]
    steps = np.arange(problem.horizon + 1) * flight.flown.step
    walk = actor.poses[: len(steps), :2]
    times = _moments(flight)
    x, y = (np.interp(times, steps, axis) for axis in walk.T)
    facts = [] if flight.geodesy else [("stands by at", f"x {x[0]:.1f}, y {y[0]:.1f}")]
    cues, signal = _person_cues(flight, clock, times, x, y), ("signal", clock.time(0.0))
    title = problem.person(person)
    if actor.name is None:
        title = f"{title[0].upper()}{title[1:]}"
    return Card(title, facts, cues, signal)


def _person_cues(
    flight: Flight, clock: Clock, times: FloatArray, x: FloatArray, y: FloatArray
) -> Table:
    """Returns a person's places by the clock, and the pace to the next one.

    Places are given as latitude and longitude if these are known, as people have no instrument for
    x and y. For a person who slows down to a stop, the distance is given instead of a speed.
    """
    along, up = np.diff(x), np.diff(y)
    far = np.hypot(along, up)
    speeds = far / np.diff(times)
    ways = np.degrees(np.arctan2(up, along)) % 360
    if flight.geodesy is not None:
        ways = flight.geodesy.compass(x[:-1], y[:-1], np.radians(ways))
    rows, (west, south) = [], _shared(flight)
    for k, t in enumerate(times.tolist()):
        goes = ("end", "") if k == len(speeds) else ("stands", "")
        if k < len(speeds) and speeds[k] > _STANDS:
            before, after = speeds[k - 1] if k else np.inf, speeds[k + 1 : k + 2]
            stops = (after <= _STANDS).any() and speeds[k] < before - _STANDS
            pace = f"{far[k]:.2f} m, stops" if stops else f"{speeds[k]:.2f} m/s"
            goes = pace, f"{round(float(ways[k])) % 360}"
        where = degrees(flight, float(x[k]), float(y[k]), _DIGITS)
        where = where or (f"{x[k] - west:.1f}", f"{y[k] - south:.1f}")
        rows.append((clock.time(t), *where, *goes))
    places = degree_heads(flight) or _heads(flight)
    heads = ("time", *places, "then walks", _direction(flight))
    return Table(heads, rows, frozenset(range(1, len(heads))))


def _shared(flight: Flight) -> tuple[float, float]:
    """Returns the offset that is subtracted from x and y (m) in tables, as on maps."""
    x, y = flight.flown.problem.height_map.origin
    return shared_digits(x), shared_digits(y)


def _heads(flight: Flight) -> tuple[str, ...]:
    """Returns the heads of the columns x and y."""
    return tuple(
        f"{name} (m)\n-\N{NO-BREAK SPACE}{less / 1000:,.0f}\N{NO-BREAK SPACE}km"
        if less
        else f"{name} (m)"
        for name, less in zip("xy", _shared(flight), strict=True)
    )


def _moments(flight: Flight) -> FloatArray:
    """Returns the moments (s) of cues, including the end."""
    steps = flight.flown.problem.horizon
    every = math.ceil(steps / (_ROWS - 1))
    found = [*range(0, steps, every), steps]
    return np.array(found) * flight.flown.step


def _direction(flight: Flight) -> str:
    """Returns the head of a column of directions in degrees."""
    return "yaw" if flight.geodesy is None else "compass"


def _end(flight: Flight, heights: Heights, drone: int, x: float, y: float, z: float) -> str:
    """Returns a place in the form used in cues: position on the Earth, and height."""
    where = ", ".join(degrees(flight, x, y, _DIGITS)) or f"x {x:.1f}, y {y:.1f}"
    return f"{where}; {heights.told(z, drone)}"


def _place(flight: Flight, x: float, y: float) -> str:
    on_earth = ", ".join(degrees(flight, x, y, _DIGITS))
    return f"x {x:.1f}, y {y:.1f}" + (f"; {on_earth}" if on_earth else "")


def _minutes(seconds: float) -> str:
    """Returns a time in minutes and whole seconds, rounded down."""
    return f"{int(seconds) // 60}:{int(seconds) % 60:02} min"


def _percent(share: float) -> str:
    """Returns a reserve in whole per cent, rounded down."""
    return f"{math.floor(100 * share)} %"
