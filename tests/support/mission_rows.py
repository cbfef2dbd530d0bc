"""Waypoint missions as their readers tell them, and what autopilots make of them."""

import json
import math
from pathlib import Path
from typing import Any, NamedTuple

import pyproj
import pytest

_GEOD = pyproj.Geod(ellps="GRS80")


class Row(NamedTuple):
    """An item of a mission, as its reader tells it."""

    command: int
    frame: int
    params: list[Any]


class Moment(NamedTuple):
    """Where a drone is in a mission that is flown by an autopilot's rules.

    Attributes
    ----------
    t : s since the end of the wait at its start; nan before
    arrives : true if a waypoint is reached; false at the end of a wait
    """

    t: float
    place: tuple[float, ...]
    compass: float
    pitch: float
    arrives: bool


def read_plan(content: bytes, firmware: int = 12) -> list[Row]:
    """The items of a .plan file that is as its description says."""
    document = json.loads(content)
    assert set(document) == {
        "fileType", "version", "groundStation", "geoFence", "rallyPoints", "mission",
    }  # fmt: skip
    assert (document["fileType"], document["version"]) == ("Plan", 1)
    assert document["groundStation"] == "QGroundControl"
    fence = document["geoFence"]
    assert set(fence) == {"circles", "polygons", "version"}
    assert (fence["circles"], fence["version"]) == ([], 2)
    for polygon in fence["polygons"]:
        assert set(polygon) == {"inclusion", "polygon", "version"}
        assert (polygon["inclusion"], polygon["version"]) == (False, 1)
        assert len(polygon["polygon"]) >= 3
    assert document["rallyPoints"] == {"points": [], "version": 2}
    mission = document["mission"]
    assert set(mission) == {
        "version", "firmwareType", "vehicleType", "globalPlanAltitudeMode", "cruiseSpeed",
        "hoverSpeed", "plannedHomePosition", "items",
    }  # fmt: skip
    kind = mission["version"], mission["firmwareType"], mission["vehicleType"]
    assert kind == (2, firmware, 2)
    assert mission["cruiseSpeed"] > 0 and mission["hoverSpeed"] > 0
    home = mission["plannedHomePosition"]
    assert len(home) == 3 and all(isinstance(v, float) for v in home[:2])
    for k, item in enumerate(mission["items"], 1):
        assert (item["type"], item["doJumpId"], item["autoContinue"]) == ("SimpleItem", k, True)
        assert len(item["params"]) == 7
        assert all(v is None or isinstance(v, float) for v in item["params"])
        assert item["frame"] == (3 if item["command"] in (16, 17, 22) else 2)
        if item["frame"] == 3:
            assert item["Altitude"] == item["params"][6]
            assert item["AltitudeMode"] == 1 and item["AMSLAltAboveTerrain"] is None
    return [Row(item["command"], item["frame"], item["params"]) for item in mission["items"]]


def read_waypoints(content: bytes, folder: Path) -> list[Row]:
    """The items of a .waypoints file after the home position, as pymavlink reads them."""
    mavwp = pytest.importorskip("pymavlink.mavwp")
    path = folder / "mission.waypoints"
    path.write_bytes(content)
    loader = mavwp.MAVWPLoader()
    count = loader.load(str(path))
    points = [loader.wp(k) for k in range(count)]
    assert [point.seq for point in points] == list(range(count))
    assert [point.current for point in points] == [1] + [0] * (count - 1)
    assert all(point.autocontinue == 1 for point in points)
    home = points[0]
    assert (home.command, home.frame) == (16, 0)
    assert (home.x, home.y) == (points[1].x, points[1].y)
    return [
        Row(p.command, p.frame, [p.param1, p.param2, p.param3, p.param4, p.x, p.y, p.z])
        for p in points[1:]
    ]


def ground_metres(one: tuple[float, ...], other: tuple[float, ...]) -> float:
    """Metres along the ground between two latitudes and longitudes."""
    return float(_GEOD.inv(one[1], one[0], other[1], other[0])[2])


def angle_between(one: float, other: float) -> float:
    """Degrees from one direction to another, the short way round."""
    return math.remainder(other - one, 360.0)
