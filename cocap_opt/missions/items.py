"""Items of missions of waypoints, by the messages of MAVLink.

Source: https://mavlink.io/en/messages/common.html
"""

from enum import IntEnum
from typing import NamedTuple

_RELATIVE, _NO_PLACE = 3, 2  # MAV_FRAME_GLOBAL_RELATIVE_ALT, MAV_FRAME_MISSION
GROUND, CLIMB, DESCENT = 1, 2, 3  # SPEED_TYPE
_HORIZON = 4 | 8  # GIMBAL_MANAGER_FLAGS_ROLL_LOCK, GIMBAL_MANAGER_FLAGS_PITCH_LOCK
_ITSELF, _UNCHANGED = -2.0, -1.0  # who controls a gimbal

Place = tuple[float, ...]  # latitude, longitude (degrees), and m above the take-off


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


def take_off(place: Place, yaw: float) -> Item:
    """Returns the way up to a place."""
    return Item(Command.TAKEOFF, (0.0, 0.0, 0.0, yaw, *place))


def hover(place: Place, yaw: float) -> Item:
    """Returns a stay for as long as nobody says otherwise."""
    return Item(Command.HOVER, (0.0, 0.0, 0.0, yaw, *place))


def waypoint(place: Place, yaw: float, reached: float, hold: float = 0.0) -> Item:
    """Returns a way to a place.

    Parameters
    ----------
    reached : m, from which on the place counts as reached
    hold : s from then on until the next item
    """
    return Item(Command.WAYPOINT, (hold, reached, 0.0, yaw, *place))


def delay(seconds: float) -> Item:
    """Returns a stay of so many seconds."""
    return Item(Command.DELAY, (seconds, -1.0, -1.0, -1.0, 0.0, 0.0, 0.0))


def turn(yaw: float) -> Item:
    """Returns a turn to a direction, at the autopilot's own rate and the short way round."""
    return Item(Command.YAW, (yaw, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0))


def speed(kind: int, metres_per_second: float) -> Item:
    """Returns a speed of a kind (SPEED_TYPE), which holds until the next of its kind."""
    return Item(Command.SPEED, (float(kind), metres_per_second, -1.0, 0.0, 0.0, 0.0, 0.0))


def tilt(pitch: float) -> Item:
    """Returns a pitch of the camera, against the horizon."""
    return Item(Command.GIMBAL, (pitch, 0.0, None, None, float(_HORIZON), 0.0, 0.0))


def control_of_gimbal() -> Item:
    """Returns what lets a mission move the gimbal."""
    return Item(Command.GIMBAL_CONTROL, (_ITSELF, _ITSELF, _UNCHANGED, _UNCHANGED, None, None, 0.0))
