"""Waypoint missions as plain text (.waypoints, "QGC WPL 110"), one per drone, for ArduPilot.

The first row is the home position, as ArduPilot and its ground stations require; ArduPilot replaces
it by the place where it is armed.

Source: "Mission Plain-Text File Format", https://mavlink.io/en/file_formats/
"""

from cocap_opt.flight.flights import Flight
from cocap_opt.missions.autopilots import Autopilot
from cocap_opt.missions.export import Export
from cocap_opt.missions.items import Command, Item
from cocap_opt.missions.routes import Route
from cocap_opt.missions.waypoints import waypoint_mission
from cocap_opt.missions.zones import Zone

_HEADER = "QGC WPL 110"
_ABSOLUTE = 0  # MAV_FRAME_GLOBAL


def write(flight: Flight, every: float | None, autopilot: Autopilot) -> Export:
    """Returns a list for each drone, of a straight flight in a scene with a place on the Earth."""
    return waypoint_mission(flight, every, autopilot, _text, has_fence=False)


def _text(route: Route, items: list[Item], _: list[Zone]) -> bytes:
    latitude, longitude = route.place(0)[:2]
    # The text format cannot represent an unknown height.
    place = (latitude, longitude, route.sea or 0.0)
    home = Item(Command.WAYPOINT, (0.0, 0.0, 0.0, 0.0, *place))
    rows = [_HEADER, _row(0, _ABSOLUTE, home)]
    rows += (_row(k + 1, item.frame, item) for k, item in enumerate(items))
    return "".join(f"{row}\n" for row in rows).encode()


def _row(number: int, frame: int, item: Item) -> str:
    """Returns an item's line; values that are not set are 0."""
    is_home = int(number == 0)
    params = (f"{value or 0.0:.9f}" for value in item.params)
    return "\t".join([f"{number}", f"{is_home}", f"{frame}", f"{item.command:d}", *params, "1"])
