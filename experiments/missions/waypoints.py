"""Missions of waypoints: what an autopilot of MAVLink flies alone, item by item.

A drone takes off, goes to its start, waits there (MAV_CMD_NAV_DELAY), and then flies each leg of
its plan with the speed that the plan has there. Nothing holds it to the times of the plan.

- Altitudes are above the drone's take-off (MAV_FRAME_GLOBAL_RELATIVE_ALT): autopilots know that
  from the moment they are armed, whatever the map's heights are above.
- Yaw is in degrees from true north, clockwise.
- A speed over ground is that along the ground; climbs and descents have their own (SPEED_TYPE).
- A drone that stays where it is waits by MAV_CMD_NAV_DELAY; to turn there, it gets a waypoint.
- The camera's pitch is set by MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW, against the horizon and with
  the drone's own yaw. MAV_CMD_DO_MOUNT_CONTROL is deprecated since 2020, and its yaw turns the
  whole drone to the north on an ArduPilot whose gimbal has no yaw (ArduCopter,
  `ModeAuto::do_mount_control`).
- At the end the drone hovers (MAV_CMD_NAV_LOITER_UNLIM). Nobody has planned a way home, and
  drones that all return at once may meet.

PX4 and ArduPilot differ in two things. PX4 takes a waypoint's yaw, and lets a mission move the
gimbal only after MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE (`InputMavlinkGimbalV2`). ArduCopter ignores
a waypoint's yaw and wants MAV_CMD_CONDITION_YAW, and refuses the former. So there are two dialects.

Sources: https://mavlink.io/en/messages/common.html, "Mission Mode" of PX4's user guide, "Mission
Command List" of ArduCopter's.
"""

import math
from collections.abc import Callable, Iterator
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from cocap_opt.data import FieldError, FloatArray
from cocap_opt.experiments.missions.export import Export, require_nothing_else
from cocap_opt.experiments.results.flights import Flight
from cocap_opt.experiments.results.robustness import (
    people_and_delay,
    told_delay,
    tolerated_delay_of_people,
    written_delay,
)
from cocap_opt.flight.earth import Geodesy
from cocap_opt.problem import CollisionRules
from cocap_opt.scenarios.recipe.rules import SEPARATION

_RELATIVE, _NO_PLACE = 3, 2  # MAV_FRAME_GLOBAL_RELATIVE_ALT, MAV_FRAME_MISSION
_GROUND, _CLIMB, _DESCENT = 1, 2, 3  # SPEED_TYPE
_PART = "no-common-clock.drone"
_HORIZON = 4 | 8  # GIMBAL_MANAGER_FLAGS_ROLL_LOCK, GIMBAL_MANAGER_FLAGS_PITCH_LOCK
_ITSELF, _UNCHANGED = -2.0, -1.0  # who controls a gimbal
_RISE = 1.0  # m/s, at which drones are thought to take off
_SETTLE = 10.0  # s, that the last one has left then
_REACHED = 0.5  # m from a waypoint; a quarter of the shortest leg if that is less


class Command(IntEnum):
    """The commands of MAVLink (MAV_CMD) that missions have."""

    WAYPOINT = 16
    HOVER = 17
    TAKEOFF = 22
    DELAY = 93
    YAW = 115
    SPEED = 178
    GIMBAL = 1000
    GIMBAL_CONTROL = 1001


class Item(NamedTuple):
    """An item of a mission.

    Attributes
    ----------
    params : seven; of items that have a place the last are latitude, longitude (degrees) and
        altitude (m); None: not set
    """

    command: Command
    params: tuple[float | None, ...]

    @property
    def has_place(self) -> bool:
        """True if the drone goes there."""
        return self.command in (Command.WAYPOINT, Command.HOVER, Command.TAKEOFF)

    @property
    def frame(self) -> int:
        """The number of what its altitude is above (MAV_FRAME)."""
        return _RELATIVE if self.has_place else _NO_PLACE


class _Dialect(NamedTuple):
    """The wishes of an autopilot that others do not have.

    Attributes
    ----------
    autopilot : its number (MAV_AUTOPILOT)
    turns_by_command : True: a waypoint's yaw has no effect, MAV_CMD_CONDITION_YAW has
    note : what must be known to fly with it
    """

    autopilot: int
    turns_by_command: bool
    note: str


PX4 = _Dialect(
    12, False, "for PX4 (ArduPilot refuses to command its gimbal so: .waypoints is for it)"
)
ARDUPILOT = _Dialect(
    3, True,
    "for ArduPilot (.plan is for PX4): set WP_YAW_BEHAVIOR to 0, so that it looks where the plan "
    "does, and WPNAV_RADIUS to what corners may be cut by; it takes whole degrees of pitch",
)  # fmt: skip


class Route(NamedTuple):
    """The waypoints of a drone at the steps 0..T.

    Attributes
    ----------
    places : [T+1, 3] latitude, longitude (degrees) and m above the take-off
    yaw : [T+1] degrees from true north, clockwise
    pitch : [T+1] degrees, of the camera, 0 is level and below the horizon is negative
    lengths : [T] m along the ground
    step : s
    sea : m above the sea at the take-off; None: nobody knows
    wait : s at the start
    """

    places: FloatArray
    yaw: FloatArray
    pitch: FloatArray
    lengths: FloatArray
    step: float
    sea: float | None
    wait: float

    @property
    def fastest(self) -> float:
        """Largest speed over ground, m/s."""
        return float(self.lengths.max() / self.step)

    @property
    def reached(self) -> float:
        """Distance (m) from which on a waypoint counts as reached."""
        legs = np.hypot(self.lengths, np.diff(self.places[:, 2]))
        return min(_REACHED, float(legs[legs > 0].min(initial=np.inf)) / 4)


def waypoint_mission(
    flight: Flight, every: float | None, dialect: _Dialect, write: Callable[[Route], bytes]
) -> Export:
    """Returns a mission of waypoints for each drone.

    Raises
    ------
    ProblemError
        If nobody knows where on the Earth the scene is, or the flight is smooth.
    """
    if flight.geodesy is None:
        raise FieldError(
            "earth",
            "must say where the scene is, for waypoints have latitudes and longitudes: in "
            "[earth] of a recipe crs alone where x and y are its coordinates, else also latitude "
            "and longitude of x = y = 0",
        )
    if flight.is_smooth:
        raise FieldError("smooth", "must be left out, for waypoints have straight legs between")
    require_nothing_else(every, "the waypoints are the steps of the plan")
    routes = list(_routes(flight, flight.geodesy))
    delay = told_delay(flight, _asked(flight)) if len(routes) > 1 else None
    to_people = tolerated_delay_of_people(flight)
    words = *_clock(flight, delay), *people_and_delay(flight, to_people), *_ends(flight, routes)
    return Export(
        {f"{_PART}{i}": write(route) for i, route in enumerate(routes)},
        (*words, dialect.note),
        {
            "delay_tolerance": written_delay(delay),
            "delay_tolerance_to_people": written_delay(to_people),
        },
    )


def seconds_to_step_0(flight: Flight) -> float:
    """Returns the seconds from the start of all missions of waypoints to step 0 of the plan.

    Drones are thought to rise at 1 m/s; the one that rises highest has 10 s left then.
    """
    columns = flight.columns(flight.flown.seconds)
    return _SETTLE + float(columns["above_takeoff"][columns["t"] == 0].max()) / _RISE


def items(route: Route, dialect: _Dialect) -> Iterator[Item]:
    """Yields the items of a drone's mission."""
    last = len(route.places) - 1
    yield _going(Command.TAKEOFF, route, 0)
    if not dialect.turns_by_command:
        control = (_ITSELF, _ITSELF, _UNCHANGED, _UNCHANGED, None, None, 0.0)
        yield Item(Command.GIMBAL_CONTROL, control)
    yield _pitch(route, 0)
    yield from _arriving(route, 0, dialect)
    yield _waiting(route.wait)
    stayed = 0.0
    for k in range(1, last + 1):
        stays = (route.places[k] == route.places[k - 1]).all()
        looks = (route.yaw[k], route.pitch[k]) == (route.yaw[k - 1], route.pitch[k - 1])
        if stayed and not (stays and looks):
            yield _waiting(stayed)
            stayed = 0.0
        if not stays:
            yield from _speeds(route, k)
        if route.pitch[k] != route.pitch[k - 1]:
            yield _pitch(route, k)
        if not stays or route.yaw[k] != route.yaw[k - 1]:
            yield from _arriving(route, k, dialect)
        stayed += route.step * stays
    if stayed:
        yield _waiting(stayed)
    yield _going(Command.HOVER, route, last)


def _going(command: Command, route: Route, k: int) -> Item:
    """Returns an item that sends a drone to a waypoint."""
    place = tuple(route.places[k].tolist())
    reached = route.reached if command == Command.WAYPOINT else 0.0
    return Item(command, (0.0, reached, 0.0, float(route.yaw[k]), *place))


def _arriving(route: Route, k: int, dialect: _Dialect) -> Iterator[Item]:
    """Yields what lets a drone fly to a waypoint and look as it is meant to."""
    if dialect.turns_by_command:
        yield Item(Command.YAW, (float(route.yaw[k]), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    yield _going(Command.WAYPOINT, route, k)


def _speeds(route: Route, k: int) -> Iterator[Item]:
    """Yields the speeds of the leg that ends at a waypoint, along the ground and in height."""
    rise = float(route.places[k, 2] - route.places[k - 1, 2]) / route.step
    kinds = {
        _GROUND: float(route.lengths[k - 1]) / route.step,
        _CLIMB: rise,
        _DESCENT: -rise,
    }
    for kind, speed in kinds.items():
        if speed > 0:
            yield Item(Command.SPEED, (float(kind), speed, -1.0, 0.0, 0.0, 0.0, 0.0))


def _pitch(route: Route, k: int) -> Item:
    pitch = float(route.pitch[k])
    return Item(Command.GIMBAL, (pitch, 0.0, None, None, float(_HORIZON), 0.0, 0.0))


def _waiting(seconds: float) -> Item:
    return Item(Command.DELAY, (seconds, -1.0, -1.0, -1.0, 0.0, 0.0, 0.0))


def _routes(flight: Flight, geodesy: Geodesy) -> Iterator[Route]:
    """Yields the waypoints of each drone."""
    problem, columns = flight.flown.problem, flight.columns()
    rows = {name: column.reshape(len(problem.robots), -1) for name, column in columns.items()}
    height, earth = rows["above_takeoff"], problem.earth
    wait = seconds_to_step_0(flight) - height[:, 0] / _RISE
    for i in range(len(problem.robots)):
        x, y, ground = rows["x"][i], rows["y"][i], float(rows["z"][i, 0] - height[i, 0])
        above_sea = earth is not None and earth.heights == "sea"
        yield Route(
            np.column_stack([rows["latitude"][i], rows["longitude"][i], height[i]]),
            geodesy.compass(x, y, np.radians(rows["yaw"][i])),
            rows["pitch"][i],
            geodesy.lengths(x, y),
            flight.flown.step,
            ground + earth.base if earth is not None and above_sea else None,
            float(wait[i]),
        )


def _asked(flight: Flight) -> CollisionRules:
    """Returns the separation that is asked about: the scene's, or the one that recipes have."""
    rules = flight.flown.problem.rules
    return rules if rules.separation else CollisionRules(separation=SEPARATION)


def _clock(flight: Flight, delay: float | None) -> Iterator[str]:
    """Yields what it means that drones keep no common clock; nothing of one drone alone."""
    if delay is None:
        return
    owner = "the scene's" if flight.flown.problem.rules.separation else "a"
    asked = f"{owner} {_asked(flight)}"
    yield "waypoint missions keep no common clock after their start: nothing holds drones to times"
    if math.isinf(delay):
        yield f"between drones, {asked} holds however late any of them is"
    elif delay == 0:
        yield f"delay tolerance 0: {asked} holds for no difference in time; plan with a larger one"
    else:
        held = f"{asked} holds while no drone is {delay:.2f} s or more behind another in its plan"
        yield f"delay tolerance: {held}"
    yield "offboard control along a .csv file, or Skybrush (.skyc), keeps drones together"


def _ends(flight: Flight, routes: list[Route]) -> Iterator[str]:
    """Yields what happens before and after the plan, and at its corners."""
    at = f"{seconds_to_step_0(flight):.3g} s"
    yield (
        f"start all missions at once: each waits at its start until {at}, if it rises at "
        f"{_RISE:g} m/s; at the end it hovers, and the way home is not in it"
    )
    if flight.flown.problem.actors:
        yield f"give people their signal {at} after starting the missions: that is step 0"
    yield (
        "autopilots round corners and speeds; clearance was checked on the straight legs, and not "
        "on the way up"
    )
    yield "in these files yaw is clockwise from true north, and altitudes are above the take-off"
    if any(route.sea is None for route in routes):
        yield "the home's height above the sea is not known"
