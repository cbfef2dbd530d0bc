"""The rules by which autopilots fly missions, and missions that take the plan's time under these
rules.

PX4
- It takes off at MPC_TKO_SPEED (multicopter_takeoff_params.c of mc_pos_control).
- DO_CHANGE_SPEED sets one cruise speed, whatever its type says (`Navigator::run`,
  navigator_main.cpp).
- The cruise speed is a speed over the ground, at most MPC_XY_VEL_MAX (`FlightTaskAuto::
  _evaluateTriplets`). Climbs and descents have the limits MPC_Z_V_AUTO_UP and MPC_Z_V_AUTO_DN, and
  no mission changes them (`FlightTaskAuto::_updateTrajConstraints`). A leg is flown straight with
  the largest velocity within both limits (`PositionSmoothing::_generateVelocitySetpoint`). So each
  leg over the ground has one speed, and before a leg straight up or down the drone waits, in order
  to arrive at the planned time.
- A waypoint counts as reached once the drone also has its yaw, to within MIS_YAW_ERR; it turns at
  MPC_YAWRAUTO_MAX. The hold time counts from the moment when the drone is at the waypoint's place
  (`MissionBlock::is_mission_item_reached_or_completed`), so a turn on the spot is a hold.
- NAV_DELAY counts from the beginning of the item (same function).
- A mission moves the gimbal only after MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE
  (`InputMavlinkGimbalV2`).

ArduPilot
- It takes off at WPNAV_SPEED_UP (`AC_WPNav::get_default_speed_up`, in takeoff.cpp).
- DO_CHANGE_SPEED sets the speed over ground, up or down, by its type (`ModeAuto::do_change_speed`,
  mode_auto.cpp); a speed over ground below WPNAV_WP_SPEED_MIN is ignored
  (`AC_WPNav::set_speed_xy`). Speeds apply until they are changed.
- A leg is flown at the largest speed along it that is within all of these (`AC_WPNav::
  update_track_with_speed_accel_limits`, `SCurve::set_speed_max`).
- A waypoint's yaw has no effect. CONDITION_YAW does not delay the flight, but it delays the
  commands between it and the next waypoint (`AP_Mission::update`); so it is the last of these.
- NAV_DELAY counts from its beginning (`ModeAuto::verify_nav_delay`); a waypoint's hold is in whole
  seconds, and is not used.

PX4 can store NUM_MISSIONS_SUPPORTED items (navigation.h), 2000 before 1.13; ArduPilot stores each
item in 15 bytes (`AP_Mission::num_commands_max`), and more items with BRD_SD_MISSION.

Defaults of PX4's parameters are those of mc_pos_control and navigator (version 1.15).
"""

import math
from collections.abc import Callable, Iterator
from typing import NamedTuple, Self

from cocap_opt.missions.items import (
    CLIMB,
    DESCENT,
    GROUND,
    HORIZON,
    ITSELF,
    UNCHANGED,
    Command,
    Item,
)
from cocap_opt.missions.routes import Leg, Route

XY_VEL_MAX = 12.0  # m/s, PX4's MPC_XY_VEL_MAX
Z_UP, Z_DOWN = 3.0, 1.5  # m/s, MPC_Z_V_AUTO_UP, MPC_Z_V_AUTO_DN
TURNS, LOOKS = 45.0, 12.0  # degrees/s and degrees, MPC_YAWRAUTO_MAX, MIS_YAW_ERR
SLOWEST = 0.2  # m/s, WPNAV_WP_SPEED_MIN: 0.2 until ArduPilot 4.5, less since then
_SAME_YAW, _SAME_PITCH = 5e-3, 1e-6  # degrees; grid north varies slightly from place to place
_ON_TIME = 1e-3  # s


class _Pace(NamedTuple):
    """The items with which an autopilot flies a leg in the planned time.

    Attributes
    ----------
    wait : time that the drone waits before it moves, s
    speeds : speeds by kind (SPEED_TYPE), m/s
    late : time by which the leg takes longer than planned, s
    why : the cause of the delay, in words
    """

    wait: float
    speeds: dict[int, float]
    late: float = 0.0
    why: str = ""


class Late(NamedTuple):
    """A leg that an autopilot cannot fly in its time."""

    drone: int
    step: int  # the step at its end
    seconds: float
    why: str

    def __str__(self) -> str:
        return f"drone {self.drone}, step {self.step - 1} to {self.step}: {self.why}"


class Autopilot(NamedTuple):
    """The rules and requirements of an autopilot.

    Attributes
    ----------
    name : name in file names and options
    title : name for people
    number : MAV_AUTOPILOT
    turns_by_command : True: a waypoint's yaw has no effect, but MAV_CMD_CONDITION_YAW has
    rise : speed at take-off, m/s
    rises_by : the parameter that defines it
    pace : returns the pace of a leg
    extra : items in addition to those of a mission: ArduPilot stores the home position as an item
    most : default number of items that it can hold
    holds : explanation of that number
    ceiling : the parameter for its greatest height above take-off
    note : a note for flying with it
    """

    name: str
    title: str
    number: int
    turns_by_command: bool
    rise: float
    rises_by: str
    pace: Callable[[Leg], _Pace]
    extra: int
    most: int
    holds: str
    ceiling: str
    note: str

    def holding(self, most: int) -> Self:
        """Returns the autopilot on a board that can hold the given number of items."""
        return self if most == self.most else self._replace(most=most, holds="as set by --items")

    def items(self, route: Route) -> list[Item]:
        """Returns the items of a drone's mission."""
        return _Mission(self, route).items

    def late_by(self, route: Route) -> float:
        """Returns the delay (s) of a drone at the end of its plan."""
        return math.fsum(leg.seconds for leg in self.late(route))

    def behind(self, route: Route) -> float:
        """Returns the largest lag (s) of a drone behind its plan, on legs before which it waits."""
        waits = (self.pace(leg).wait for leg in route.legs() if leg.is_way)
        return max(waits, default=0.0)

    def late(self, route: Route) -> Iterator[Late]:
        """Yields the legs that take longer than planned."""
        rest = 0.0  # degrees by which the drone has not turned yet
        for leg in route.legs():
            rest += leg.turn
            pace = self.pace(leg._replace(turn=rest))
            if pace.late > _ON_TIME:
                yield Late(route.drone, leg.step, pace.late, pace.why)
            turned = min(abs(rest), TURNS * (leg.seconds + pace.late))
            rest -= math.copysign(turned, rest)


def _px4_pace(leg: Leg) -> _Pace:
    """Returns PX4's pace, with its default parameters."""
    fastest, limit = (Z_UP, "MPC_Z_V_AUTO_UP") if leg.rise > 0 else (Z_DOWN, "MPC_Z_V_AUTO_DN")
    climbs = abs(leg.rise) / fastest
    goes, turns = leg.along / XY_VEL_MAX, max(abs(leg.turn) - LOOKS, 0.0) / TURNS
    wait = max(leg.seconds - climbs, 0.0) if not leg.along else 0.0
    speeds = {GROUND: leg.along / leg.seconds if leg.along else fastest} if leg.is_way else {}
    later = climbs if wait else 0.0  # it waits and turns in its place, and then climbs
    also = f" and then {later:.2f} s for its height" if later else ""
    least = {
        f"it goes {leg.along:.3g} m, which takes PX4 {goes:.2f} s by MPC_XY_VEL_MAX "
        f"{XY_VEL_MAX:g} m/s": goes,
        f"its height changes by {abs(leg.rise):.3g} m, which takes PX4 {climbs:.2f} s by {limit} "
        f"{fastest:g} m/s": climbs,
        f"it turns by {abs(leg.turn):.0f} degrees, which takes PX4 {turns:.2f} s by "
        f"MPC_YAWRAUTO_MAX {TURNS:g} degrees/s{also}": turns + later,
    }  # fmt: skip
    why = max(least, key=lambda words: least[words])
    late = least[why] - leg.seconds
    return _Pace(wait, speeds, max(late, 0.0), f"{why}, not {leg.seconds:.2f} s")


def _ardupilot_pace(leg: Leg) -> _Pace:
    """Returns ArduPilot's pace; for ArduPilot, no leg takes too long."""
    seconds, wait = leg.seconds, 0.0
    speeds = {}
    if leg.along / seconds >= SLOWEST:
        speeds[GROUND] = leg.along / seconds
    elif leg.along > abs(leg.rise):  # it cannot fly so slowly
        seconds = leg.along / SLOWEST
        speeds[GROUND], wait = SLOWEST, leg.seconds - seconds
    elif not leg.is_way:
        wait = seconds
    if leg.rise:
        speeds[CLIMB if leg.rise > 0 else DESCENT] = abs(leg.rise) / seconds
    return _Pace(wait, speeds)


class _Mission:
    """Makes the items of a drone's mission, one after another.

    Attributes
    ----------
    items : the items so far
    """

    def __init__(self, autopilot: Autopilot, route: Route) -> None:
        self.items: list[Item] = []
        self._autopilot, self._route = autopilot, route
        self._yaw, self._pitch = float(route.yaw[0]), float(route.pitch[0])
        self._due = 0.0  # s of waiting to be added
        self._begin()
        for leg in route.legs():
            self._fly(leg)
        self._wait()
        self._add(Command.HOVER, 0.0, 0.0, 0.0, self._yaw, *route.place(-1))

    def _add(self, command: Command, *params: float | None) -> None:
        self.items.append(Item(command, params))

    def _begin(self) -> None:
        """Adds the flight to the start, and the wait there."""
        self._add(Command.TAKEOFF, 0.0, 0.0, 0.0, self._yaw, *self._route.place(0))
        if not self._autopilot.turns_by_command:
            who = ITSELF, ITSELF, UNCHANGED, UNCHANGED
            self._add(Command.GIMBAL_CONTROL, *who, None, None, 0.0)
        self._tilt(self._pitch)
        self._turn(self._yaw)
        self._go_to(0)
        self._due = self._route.until - self._route.place(0)[2] / self._autopilot.rise
        self._wait()

    def _fly(self, leg: Leg) -> None:
        pace = self._autopilot.pace(leg)
        yaw, pitch = float(self._route.yaw[leg.step]), float(self._route.pitch[leg.step])
        turns = abs((yaw - self._yaw + 180.0) % 360.0 - 180.0) > _SAME_YAW
        if abs(pitch - self._pitch) > _SAME_PITCH:
            self._wait()
            self._tilt(pitch)
        if leg.is_way or (turns and pace.wait):
            self._wait()
        if turns and pace.wait:
            self._turn_and_wait(leg.step - 1, yaw, pace.wait)
        else:
            self._due += pace.wait
        if leg.is_way:
            self._wait()
            # Each leg has its own speed, since pausing a mission loses earlier commands.
            for kind, value in pace.speeds.items():
                self._add(Command.SPEED, float(kind), value, -1.0, 0.0, 0.0, 0.0, 0.0)
            if turns and self._yaw != yaw:  # it has not turned while waiting
                self._turn(yaw)
            self._go_to(leg.step)

    def _turn_and_wait(self, step: int, yaw: float, seconds: float) -> None:
        """Adds a turn in the drone's place at a step, within the given time."""
        self._turn(yaw)
        if self._autopilot.turns_by_command:
            self._due = seconds
        else:
            self._go_to(step, seconds)

    def _turn(self, yaw: float) -> None:
        """Adds a turn, if turns are commands: at the autopilot's rate, by at most half a turn."""
        self._yaw = yaw
        if self._autopilot.turns_by_command:
            self._add(Command.YAW, yaw, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)

    def _tilt(self, pitch: float) -> None:
        """Adds a pitch of the camera, relative to the horizon."""
        self._pitch = pitch
        self._add(Command.GIMBAL, pitch, 0.0, None, None, float(HORIZON), 0.0, 0.0)

    def _go_to(self, step: int, hold: float = 0.0) -> None:
        """Adds a flight to the place at a step, and a wait there until the next item."""
        place, reached = self._route.place(step), self._route.reached
        self._add(Command.WAYPOINT, hold, reached, 0.0, self._yaw, *place)

    def _wait(self) -> None:
        """Adds the pending wait."""
        if self._due > 0:
            self._add(Command.DELAY, self._due, -1.0, -1.0, -1.0, 0.0, 0.0, 0.0)
        self._due = 0.0


PX4 = Autopilot(
    "px4", "PX4", 12, False, 1.5, "MPC_TKO_SPEED",
    _px4_pace, 0, 500, "since 1.13 and on most boards", "GF_MAX_VER_DIST",
    "for PX4 with its defaults MPC_Z_V_AUTO_UP 3, MPC_Z_V_AUTO_DN 1.5 and MPC_YAWRAUTO_MAX 45; use "
    ".waypoints for ArduPilot, which rejects these gimbal commands and would climb at other speeds",
)  # fmt: skip
ARDUPILOT = Autopilot(
    "ardupilot", "ArduPilot", 3, True, 2.5, "WPNAV_SPEED_UP",
    _ardupilot_pace, 1, 718, "on boards with 16 kB of storage", "FENCE_ALT_MAX",
    "for ArduPilot (a PX4 would take each speed for the one over ground): set WP_YAW_BEHAVIOR "
    "to 0, so that it looks where the plan does, and WPNAV_RADIUS to the distance by which "
    "corners may be cut; pitch is in whole degrees",
)  # fmt: skip
AUTOPILOTS = {autopilot.name: autopilot for autopilot in (PX4, ARDUPILOT)}
