"""Missions of waypoints as plans of QGroundControl (.plan), one per drone, for PX4.

Source: "Plan File Format", QGroundControl Developer Guide,
https://docs.qgroundcontrol.com/master/en/qgc-dev-guide/file_formats/plan.html
"""

import json
from typing import Any

from cocap_opt.experiments.missions.mission import Mission
from cocap_opt.experiments.missions.waypoints import PX4, Item, Route, items, waypoint_mission
from cocap_opt.experiments.results.flights import Flight

_QUADROTOR = 2  # MAV_TYPE
_ABOVE_TAKEOFF = 1  # QGroundControl's altitude mode


def plan(flight: Flight, every: float | None) -> Mission:
    """Returns a plan for each drone, of a straight flight in a scene with a place on the Earth."""
    return waypoint_mission(flight, every, PX4, _document)


def _document(route: Route) -> bytes:
    latitude, longitude, _ = route.places[0].tolist()
    fastest = route.fastest or 1.0  # a drone that stays has no speed
    document = {
        "fileType": "Plan",
        "version": 1,
        "groundStation": "QGroundControl",
        "geoFence": {"circles": [], "polygons": [], "version": 2},
        "rallyPoints": {"points": [], "version": 2},
        "mission": {
            "version": 2,
            "firmwareType": PX4.autopilot,
            "vehicleType": _QUADROTOR,
            "globalPlanAltitudeMode": _ABOVE_TAKEOFF,
            "cruiseSpeed": fastest,
            "hoverSpeed": fastest,
            "plannedHomePosition": [latitude, longitude, route.sea],
            "items": [_simple(item, k + 1) for k, item in enumerate(items(route, PX4))],
        },
    }
    return json.dumps(document, indent=1, allow_nan=False).encode()


def _simple(item: Item, number: int) -> dict[str, Any]:
    """Returns an item as a SimpleItem of the description."""
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
