"""No-fly zones, take-off and landing points are in the files that can hold them."""

import json
from dataclasses import replace
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
import shapely
from mission_rows import read_plan
from test_missions import SYSTEMS, said, scene

import cocap_opt as co
from cocap_opt.data import LARGEST
from cocap_opt.flight.flights import Flight
from cocap_opt.missions import FORMATS
from cocap_opt.missions.zones import zones
from cocap_opt.output.heights import over_datum
from cocap_opt.problem import Airspace

pyproj = pytest.importorskip("pyproj")

KML = "{http://www.opengis.net/kml/2.2}"
BOXES = ((0.0, 0.0, 0.0), (2.0, 2.0, 30.0)), ((9.0, 7.0, -LARGEST), (11.0, 9.0, LARGEST))
OVER = (3.0, 2.0, 12.0), (6.0, 3.0, 20.0)  # above the way of the first drone


def flight_with(*boxes: Any, crs: str = "EPSG:25830", **more: Any) -> Flight:
    """The flight of the scene with no-fly zones."""
    solids = tuple(co.Mesh.box(*box) for box in boxes)
    problem, plan = scene(crs, airspace=Airspace(no_fly=solids, **more))
    return Flight.of(problem, plan, False)


def on_map(corners: Any, crs: str) -> shapely.Polygon:
    """The polygon (m) of longitudes and latitudes, by pyproj alone."""
    grid = pyproj.Transformer.from_crs("EPSG:4326", crs, always_xy=True)
    corner = np.array(grid.transform(*SYSTEMS[crs][::-1]))
    points = np.array([grid.transform(*point[:2]) for point in corners]) - corner
    return shapely.Polygon(points)


def require_boxes(polygons: list[Any], crs: str) -> None:
    """Compares polygons with the boxes, seen from above."""
    assert len(polygons) == len(BOXES)
    for corners, (low, high) in zip(polygons, BOXES, strict=True):
        found, wanted = on_map(corners, crs), shapely.box(*low[:2], *high[:2])
        assert found.symmetric_difference(wanted).area < 0.05
        assert found.exterior.is_ccw


@pytest.mark.slow
@pytest.mark.parametrize("crs", ["EPSG:25830", "EPSG:3034"])
@pytest.mark.parametrize("name", ["px4", "ardupilot"])
def test_zones_are_the_geofence_of_plans(name: str, crs: str) -> None:
    """Each drone's file has them all as polygons to stay out of."""
    mission = FORMATS[".plan"].writer(name)(flight_with(*BOXES, crs=crs), None)
    assert len(mission.files) == 3
    for content in mission.files.values():
        read_plan(content, 12 if name == "px4" else 3)
        fence = json.loads(content)["geoFence"]["polygons"]
        require_boxes([[point[::-1] for point in one["polygon"]] for one in fence], crs)
    assert "upload the geofence with the mission: it contains the no-fly zones" in said(mission)


def test_a_zone_that_a_drone_passes_below_is_no_fence() -> None:
    """An autopilot would refuse the mission, for its fences have no heights; the note says it."""
    mission = FORMATS[".plan"].writer()(flight_with(*BOXES, OVER), None)
    for content in mission.files.values():
        fence = json.loads(content)["geoFence"]["polygons"]
        require_boxes([[point[::-1] for point in one["polygon"]] for one in fence], "EPSG:25830")
    assert "no-fly zone 2, from 52 to 60 m above the sea, is not in the geofence" in said(mission)


def test_a_zone_across_longitude_180_is_no_fence() -> None:
    """In degrees its corners would enclose what is outside; the note says it."""
    across = (3.0, 5.0, 0.0), (8.0, 6.0, 30.0)
    mission = FORMATS[".plan"].writer()(flight_with(*BOXES, across, crs="EPSG:32760"), None)
    for content in mission.files.values():
        fence = json.loads(content)["geoFence"]["polygons"]
        require_boxes([[point[::-1] for point in one["polygon"]] for one in fence], "EPSG:32760")
    assert "is not in the geofence, as longitude 180 cuts it" in said(mission)
    assert said(mission).count("not in the geofence") == 1


def test_files_that_hold_no_fence_or_ceiling_say_so() -> None:
    """The crew reads what it must set itself, and above what."""
    listed = FORMATS[".waypoints"].writer()(flight_with(*BOXES, ceiling=9.5), None)
    assert "no-fly zones are not in these files, which hold no fence" in said(listed)
    assert "the ceiling, 9.5 m above z = 0 of the map, is not in these files" in said(listed)
    words = "FENCE_ALT_MAX of ArduPilot, which is above the take-off, to "
    by_drone = "9.5 m (drone 0), 7 m (drone 1), 9.5 m (drone 2) or less"
    assert words + by_drone in said(listed)  # drone 1 takes off from a roof
    planned = FORMATS[".plan"].writer()(flight_with(ceiling=9.5), None)
    assert "GF_MAX_VER_DIST of PX4" in said(planned) and "no-fly" not in said(planned)
    for ending in (".plan", ".waypoints"):
        free = said(FORMATS[ending].writer()(flight_with(), None))
        assert "fence" not in free and "ceiling" not in free


def test_a_ceiling_that_no_fence_can_keep_is_told() -> None:
    """On a slope a mission may rise above its take-off by more than the ceiling."""
    slope = np.add.outer(3.0 * np.arange(12), np.zeros(10))
    problem, plan = scene(
        height_map=co.HeightMap(heights=slope, datum=slope), airspace=Airspace(ceiling=11.5),
        rules=co.NO_RULES,
    )  # fmt: skip
    listed = said(FORMATS[".waypoints"].writer()(Flight.of(problem, plan, False), None))
    assert "is above the take-off, to 11.5 m (drone 1), 11.5 m (drone 2) or less" in listed
    words = "cannot keep it, as the ground rises or falls along the way: a mission climbs to "
    assert words + "14 m (drone 0)" in listed
    slope = slope[::-1]  # 33 m where it rose to, and the drones' altitudes as before
    down = problem.replace(height_map=co.HeightMap(heights=slope, datum=slope))
    listed = said(FORMATS[".waypoints"].writer()(Flight.of(down, plan, False), None))
    assert f"{words}5 m (drone 0)" in listed


def test_heights_of_layers_are_said_to_be_above_something() -> None:
    """The ground where layers follow it, the sea or the ellipsoid where z is that, else z = 0."""
    problem, _ = scene()
    flat, hilly = problem.height_map, problem.height_map.replace(datum=np.zeros((12, 10)))
    for height_map, heights, base, words in (
        (hilly, "sea", 0.0, "above the ground"), (flat, "sea", 0.0, "above the sea"),
        (flat, "ellipsoid", 0.0, "above the ellipsoid"),
        (flat, "sea", 4.0, "above z = 0 of the map"), (flat, None, 0.0, "above z = 0 of the map"),
    ):  # fmt: skip
        earth = co.Earth(crs="EPSG:25830", heights=heights, base=base)
        assert over_datum(problem.replace(height_map=height_map, earth=earth)) == words
    assert over_datum(problem.replace(earth=None)) == "above z = 0 of the map"


def test_tracks_say_what_the_ceiling_is_above() -> None:
    """GeoJSON and KML have it in their notes."""
    for ending in (".geojson", ".kml"):
        assert "the ceiling is 9.5 m above z = 0" in said(
            FORMATS[ending].writer()(flight_with(ceiling=9.5), None)
        )


def test_zones_and_ends_are_in_geojson() -> None:
    """Polygons with their heights, and points for take-offs and landings."""
    flight = flight_with(*BOXES)
    features = json.loads(FORMATS[".geojson"].writer()(flight, None).files[""])["features"]
    of_kind = {
        kind: [f for f in features if f["properties"]["kind"] == kind]
        for kind in ("no-fly zone", "take-off", "landing", "step")
    }
    found = of_kind["no-fly zone"]
    require_boxes([f["geometry"]["coordinates"][0] for f in found], "EPSG:25830")
    first, second = (f["properties"] for f in found)
    assert first["name"] == "no-fly zone 0, from 40 to 70 m above the sea"
    assert (first["lowest_z"], first["highest_z"]) == (0, 30)
    assert (first["lowest_above_sea"], first["highest_above_sea"]) == (40, 70)
    assert second["name"] == "no-fly zone 1, at all heights"
    assert second["lowest_z"] is second["highest_z"] is None
    last = flight.flown.problem.horizon
    for kind, step in (("take-off", 0), ("landing", last)):
        for drone, end in enumerate(of_kind[kind]):
            (at,) = [
                f["geometry"]["coordinates"]
                for f in of_kind["step"]
                if (f["properties"]["drone"], f["properties"]["step"]) == (drone, step)
            ]
            assert end["geometry"] == {"type": "Point", "coordinates": at}
            assert end["properties"]["name"] == f"{kind} of drone {drone}"


def test_zones_and_ends_are_in_kml() -> None:
    """Zones with a top above the sea stand on the ground up to it; others lie on the ground."""
    root = ElementTree.fromstring(FORMATS[".kml"].writer()(flight_with(*BOXES), None).files[""])
    folders = {f.findtext(f"{KML}name"): f for f in root.iter(f"{KML}Folder")}
    places = list(folders["no-fly zones"].iter(f"{KML}Placemark"))
    assert [place.findtext(f"{KML}name") for place in places] == [
        "no-fly zone 0, from 40 to 70 m above the sea", "no-fly zone 1, at all heights",
    ]  # fmt: skip
    rings = []
    for place, mode, top in zip(places, ("absolute", "clampToGround"), ([70.0], []), strict=True):
        (polygon,) = place.iter(f"{KML}Polygon")
        assert polygon.findtext(f"{KML}altitudeMode") == mode
        (text,) = [one.text or "" for one in polygon.iter(f"{KML}coordinates")]
        points = [[float(value) for value in point.split(",")] for point in text.split()]
        assert all(point[2:] == top for point in points)
        rings.append(points)
    require_boxes(rings, "EPSG:25830")
    ends = [
        p.findtext(f"{KML}name") for p in folders["take-off and landing"].iter(f"{KML}Placemark")
    ]
    assert ends == [f"{kind} of drone {i}" for i in range(3) for kind in ("take-off", "landing")]


def test_a_zone_in_parts_or_with_a_hole_is_outlined_whole() -> None:
    """Each part is a polygon, and nothing of a zone is outside of its outlines."""
    parts = [co.Mesh.box((x, y, 0.0), (x + 1, y + 1, 9.0)) for x, y in ((0, 0), (1, 0), (9, 8))]
    ring = [
        co.Mesh.box(low, high)
        for low, high in (
            ((0.0, 4.0, 0.0), (3.0, 5.0, 9.0)), ((0.0, 6.0, 0.0), (3.0, 7.0, 9.0)),
            ((0.0, 5.0, 0.0), (1.0, 6.0, 9.0)), ((2.0, 5.0, 0.0), (3.0, 6.0, 9.0)),
        )
    ]  # fmt: skip
    problem, plan = scene(airspace=Airspace())
    flight = Flight.of(problem, plan, False)
    assert flight.geodesy is not None
    flown = flight.flown
    no_fly = (co.Mesh.joined(parts), co.Mesh.joined(ring))
    zoned = flight._replace(
        flown=replace(flown, problem=problem.replace(airspace=Airspace(no_fly=(no_fly[0],))))
    )
    found = zones(zoned, flight.geodesy)
    assert sorted(zone.outline.area for zone in found) == pytest.approx([1, 2])
    hollow = Airspace(no_fly=(no_fly[1],))
    ringed = flight._replace(flown=replace(flown, problem=_unchecked(problem, hollow)))
    (whole,) = zones(ringed, flight.geodesy)
    assert whole.outline.area == pytest.approx(9)


def _unchecked(problem: Any, airspace: Airspace) -> Any:
    """The problem with an airspace in which nobody has a start."""
    return problem.replace(airspace=airspace, robots=problem.robots[:1])
