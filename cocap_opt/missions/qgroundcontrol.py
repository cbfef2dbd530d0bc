"""Waypoint missions as plans of QGroundControl (.plan), one per drone, with their geofence.

Source: "Plan File Format", QGroundControl Developer Guide,
https://docs.qgroundcontrol.com/master/en/qgc-dev-guide/file_formats/plan.html
"""

import json
from functools import partial
from typing import Any

from cocap_opt.flight.flights import Flight
from cocap_opt.missions.autopilots import Autopilot
from cocap_opt.missions.export import Export
from cocap_opt.missions.items import Item
from cocap_opt.missions.routes import Route
from cocap_opt.missions.waypoints import waypoint_mission
from cocap_opt.missions.zones import Zone

_QUADROTOR = 2  # MAV_TYPE
_ABOVE_TAKEOFF = 1  # QGroundControl's altitude mode


def write(flight: Flight, every: float | None, autopilot: Autopilot) -> Export:
    """Returns a plan for each drone, of a straight flight in a scene with a place on the Earth."""
    return waypoint_mission(
        flight, every, autopilot, partial(_document, autopilot=autopilot), has_fence=True
    )


def _document(route: Route, items: list[Item], zones: list[Zone], autopilot: Autopilot) -> bytes:
    latitude, longitude, _ = route.place(0)
    fastest = route.fastest or 1.0  # a drone that stays has no speed
    fence = {"circles": [], "polygons": [_outside(zone) for zone in zones], "version": 2}
    document = {
        "fileType": "Plan",
        "version": 1,
        "groundStation": "QGroundControl",
        "geoFence": fence,
        "rallyPoints": {"points": [], "version": 2},
        "mission": {
            "version": 2,
            "firmwareType": autopilot.number,
            "vehicleType": _QUADROTOR,
            "globalPlanAltitudeMode": _ABOVE_TAKEOFF,
            "cruiseSpeed": fastest,
            "hoverSpeed": fastest,
            "plannedHomePosition": [latitude, longitude, route.sea],
            "items": [_simple(item, k + 1) for k, item in enumerate(items)],
        },
    }
    return json.dumps(document, indent=1, allow_nan=False).encode()


def _outside(zone: Zone) -> dict[str, Any]:
    """Returns a polygon that drones must not enter."""
    return {"inclusion": False, "polygon": zone.corners[:, ::-1].tolist(), "version": 1}


def _simple(item: Item, number: int) -> dict[str, Any]:
    """Returns an item as a SimpleItem of the file format."""
    found: dict[str, Any] = {
        "type": "SimpleItem",
        "doJumpId": number,
        "autoContinue": True,
        "command": int(item.command),
        "frame": item.frame,
        "params": list(item.params),
    }
    if item.has_place:
        found |= {
            "AMSLAltAboveTerrain": None, "Altitude": item.params[-1],
            "AltitudeMode": _ABOVE_TAKEOFF,
        }  # fmt: skip
    return found
