"""Items of waypoint missions, as MAVLink messages.

Source: https://mavlink.io/en/messages/common.html
"""

from enum import IntEnum
from typing import NamedTuple

_RELATIVE, _NO_PLACE = 3, 2  # MAV_FRAME_GLOBAL_RELATIVE_ALT, MAV_FRAME_MISSION
GROUND, CLIMB, DESCENT = 1, 2, 3  # SPEED_TYPE; each applies until the next of its kind
HORIZON = 4 | 8  # GIMBAL_MANAGER_FLAGS_ROLL_LOCK, GIMBAL_MANAGER_FLAGS_PITCH_LOCK
ITSELF, UNCHANGED = -2.0, -1.0  # codes for the controller of a gimbal

Place = tuple[float, ...]  # latitude, longitude (degrees), and m above the take-off


class Command(IntEnum):
    """The MAVLink commands (MAV_CMD) that missions use."""

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
    params : seven parameters; for items with a place, the last three are latitude, longitude
        (degrees) and altitude (m); None: not set
    """

    command: Command
    params: tuple[float | None, ...]

    @property
    def has_place(self) -> bool:
        """True if the item has a place to which the drone flies."""
        return self.command in (Command.WAYPOINT, Command.HOVER, Command.TAKEOFF)

    @property
    def frame(self) -> int:
        """The reference frame of its altitude (MAV_FRAME)."""
        return _RELATIVE if self.has_place else _NO_PLACE
