"""Plans of buildings as others export them: GeoJSON in degrees, what is no polygon, heights."""

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from shapely.geometry.base import BaseGeometry

from cocap_opt.data import ProblemError
from cocap_opt.planners.sequential import sequential
from cocap_opt.problem import Earth
from cocap_opt.scenarios.earth.place import MapProjection
from cocap_opt.scenarios.maps.building_heights import extent
from cocap_opt.scenarios.maps.ground_plans import sound
from cocap_opt.scenarios.maps.terrain import Ground, Terrain
from cocap_opt.scenarios.maps.walls import WallsTable, extruded
from cocap_opt.scenarios.recipe import read
from cocap_opt.world.workspace import HeightMap, Mesh

pyproj = pytest.importorskip("pyproj")

PLACE = (52.4010, 13.0590)  # latitude and longitude of x = 0, y = 0
HERE = MapProjection(Earth(crs="EPSG:32633", origin=PLACE))
FIJI = MapProjection(Earth(crs="EPSG:32701", origin=(-16.8, 180.0)))
EMPTY = {"type": "Polygon", "coordinates": []}


def ring(
    x: float, y: float, wide: float = 10.0, deep: float = 10.0, at: MapProjection = HERE
) -> list[list[float]]:
    """The corners of a rectangle (m) of the scene in longitudes and latitudes, from -180 to 180."""
    assert at.earth is not None and at.earth.origin is not None
    project = pyproj.Proj(at.earth.crs)
    east, north = project(*at.earth.origin[::-1])
    corners = [(x, y), (x + wide, y), (x + wide, y + deep), (x, y + deep), (x, y)]
    places = [project(east + a, north + b, inverse=True) for a, b in corners]
    return [[(longitude + 180) % 360 - 180, latitude] for longitude, latitude in places]


def feature(geometry: Any, **properties: Any) -> dict[str, Any]:
    """A feature of GeoJSON."""
    return {"type": "Feature", "geometry": geometry, "properties": properties}


def house(*corner: float, **properties: Any) -> dict[str, Any]:
    """A rectangle that begins at a corner (m), by default of 10 x 10 m."""
    return feature({"type": "Polygon", "coordinates": [ring(*corner)]}, **properties)


def collection(*features: Any, **members: Any) -> dict[str, Any]:
    """A whole file."""
    return {"type": "FeatureCollection", "features": list(features), **members}


def level(_area: BaseGeometry) -> Ground:
    """Flat ground at 0 m."""
    return Ground(0.0, 0.0)


def walls(
    folder: Path, content: Any, at: MapProjection = HERE, name: str = "plan", **fields: Any
) -> list[Mesh]:
    """Read a plan of obstacles, 8 m high where it does not say it."""
    (folder / name).write_text(content if isinstance(content, str) else json.dumps(content))
    table = WallsTable(file=name, **{"height": 8.0, "polygons": "obstacles"} | fields)
    meshes = table.meshes(folder, level, at)
    assert all(mesh.is_solid for mesh in meshes)
    return meshes


def boxes(meshes: list[Mesh]) -> list[list[float]]:
    """The lower and the upper corner of each, to a millimetre."""
    return [
        [*mesh.vertices.min(axis=0).round(3).tolist(), *mesh.vertices.max(axis=0).round(3).tolist()]
        for mesh in meshes
    ]


def volume(mesh: Mesh) -> float:
    """m3 within a solid."""
    a, b, c = np.moveaxis(mesh.corners, 1, 0)
    return float((a * np.cross(b, c)).sum() / 6)


ONE = [[10.0, 10.0, 0.0, 20.0, 20.0, 12.0]]  # what house(10, 10, height=12) is


@pytest.mark.parametrize(
    "other",
    [
        feature(None),
        {"type": "Feature", "properties": None, "geometry": None},
        {"type": "Feature", "properties": {"height": 3}},
        feature(EMPTY, height=3),
        feature({"type": "Polygon", "coordinates": [[]]}),
        feature({"type": "MultiPolygon", "coordinates": []}),
        feature({"type": "MultiPolygon", "coordinates": [[], [[]]]}),
        feature({"type": "Point", "coordinates": []}),
        feature({"type": "GeometryCollection", "geometries": []}),
        feature({"type": "GeometryCollection", "geometries": [EMPTY, None, {
            "type": "GeometryCollection", "geometries": [EMPTY]}]}),
    ],
)  # fmt: skip
def test_what_has_no_geometry_is_left_out(tmp_path: Path, other: Any) -> None:
    """A feature may have none, and any may be empty; heights stay with their own polygons."""
    low = house(30, 10, height=6)
    for features in (
        [house(10, 10, height=12), other, low],
        [other, house(10, 10, height=12), low],
    ):
        found = boxes(walls(tmp_path, collection(*features)))
        assert found == [*ONE, [30.0, 10.0, 0.0, 40.0, 20.0, 6.0]]
    with pytest.raises(ProblemError, match=r"must contain at least one polygon$"):
        walls(tmp_path, collection(other))


def test_members_that_are_not_known_do_not_matter(tmp_path: Path) -> None:
    """Boxes, ids, altitudes, a name of the file: all may be there."""
    shape = {"type": "Polygon", "bbox": [0, 0, 1, 1], "coordinates": [
        [[*place, 35.0] for place in ring(10, 10)]]}  # fmt: skip
    one = feature(shape, height=12) | {"id": "way/1", "bbox": [0, 0, 1, 1]}
    found = walls(tmp_path, collection(one, name="houses", bbox=[0, 0, 1, 1]))
    assert boxes(found) == ONE


def test_points_and_lines_are_left_out_with_a_word(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """Exports of OpenStreetMap have trees and roads among the houses."""
    tree = feature({"type": "Point", "coordinates": list(PLACE[::-1])})
    road = {"type": "LineString", "coordinates": ring(0, 0)[:2]}
    both = feature({"type": "GeometryCollection", "geometries": [road, road]})
    assert boxes(walls(tmp_path, collection(tree, house(10, 10, height=12), both))) == ONE
    assert "plan: only polygons count; left out: 1 Point, 2 LineString" in caplog.text
    with pytest.raises(ProblemError, match="at least one polygon, but has 1 Point"):
        walls(tmp_path, collection(tree))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('{"type": "FeatureCollection"}', "must have the field `features`"),
        ('{"type": "FeatureCollection", "features": [null]}', r"features\[0\]: must be an object"),
        ('{"type": "Polygon", "coordinates": [[1, 2], [3, 4]]}', r"coordinates\[0\]\[0\]: must be"),
        (
            '{"type": "Polygon", "coordinates": [[["1", 2], [3, 4]]]}',
            "must be a number, not the text '1'",
        ),
        ('{"type": "Polygon", "coordinates": [[[1, null], [3, 4]]]}', "must be a number, not null"),
        ('{"type": "Polygon", "coordinates": [[[NaN, 2], [3, 4]]]}', "is no|finite numbers only"),
        ('{"type": "Polygon", "coordinates": [[[1, 2], [3, 4], [5, 7]]]}', "must end at the"),
        ('{"type": "Polygon", "coordinates": [[[1, 2], [3, 4], [1, 2]]]}', "at least four points"),
        ('{"type": "Polygon", "coordinates": 7}', "coordinates: must be a list"),
        ('{"type": "Polygon"}', "must have the field `coordinates`"),
        ('{"type": "Feature", "geometry": {"type": "Circle"}}', r"type: must be one of Point, "),
        ('{"type": "Feature", "geometry": {}}', "geometry: must have the field `type`"),
        ('{"type": "Feature", "geometry": null, "properties": []}', "properties: must be an obj"),
        ('{"type": "FeatureCollection", "features": []}', "must contain at least one polygon"),
        ('{"type": "GeometryCollection", "geometries": [3]}', "must be an object"),
    ],
)
def test_malformed_geojson_is_told_by_its_field(tmp_path: Path, text: str, words: str) -> None:
    """One line, whatever is wrong."""
    with pytest.raises(ProblemError, match=words) as error:
        walls(tmp_path, text)
    assert "\n" not in str(error.value)


def test_geojson_is_in_degrees_whatever_its_extent(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """A large polygon beside the houses, or far houses, do not make metres of them."""
    corners = [[12.5, 52.0], [13.9, 52.0], [13.9, 52.8], [12.5, 52.8], [12.5, 52.0]]
    district = feature({"type": "Polygon", "coordinates": [corners]}, height=1)
    found = walls(tmp_path, collection(house(10, 10, height=12), district))
    assert boxes(found[:1]) == ONE
    x0, y0, _, x1, y1, top = boxes(found[1:])[0]
    assert max(x0, y0) < -30_000 and min(x1, y1) > 40_000 and top == 1
    paris = feature({"type": "Polygon", "coordinates": [
        [[2.35, 48.85], [2.36, 48.85], [2.36, 48.86], [2.35, 48.85]]]}, height=20)  # fmt: skip
    assert boxes(walls(tmp_path, collection(paris, house(10, 10, height=12)))) == ONE
    assert "plan: 1 of 2 polygons are more than 50 km from the map, and are left out" in caplog.text
    with pytest.raises(
        ProblemError, match=r'must be near the map, .* set unit = "m" in \[\[walls\]\]'
    ):
        walls(tmp_path, collection(paris))


def test_long_edges_are_straight_in_degrees(tmp_path: Path) -> None:
    """An edge along a parallel bends on the map, by 40 m in the middle of 40 km."""
    latitude, longitude = PLACE
    box = [[longitude - 0.3, latitude], [longitude + 0.3, latitude],
           [longitude + 0.3, latitude + 0.1], [longitude - 0.3, latitude]]  # fmt: skip
    (mesh,) = walls(tmp_path, {"type": "Polygon", "coordinates": [box]})
    project = pyproj.Proj("EPSG:32633")
    (east, north), (x, y) = project(*PLACE[::-1]), mesh.vertices[:, :2].T
    on_edge = np.abs(project(x + east, y + north, inverse=True)[1] - latitude) < 1e-7
    order = np.argsort(x[on_edge])
    assert abs(np.interp(0, x[on_edge][order], y[on_edge][order])) < 0.1


def test_lengths_in_geojson_have_to_be_said(tmp_path: Path) -> None:
    """By the recipe or by `crs`, as GeoJSON 2008 had it; else a way out is named."""
    square = [[10.0, 10.0], [20, 10], [20, 20], [10, 20], [10, 10]]
    plan: dict[str, Any] = {"type": "Polygon", "coordinates": [square]}
    nowhere = MapProjection()
    assert boxes(walls(tmp_path, plan, nowhere, unit="m"))[0][3] == 20
    assert boxes(walls(tmp_path, plan, nowhere, unit="cm"))[0][3] == 0.2
    assert boxes(walls(tmp_path, plan, nowhere, unit="us-ft"))[0][3] == 6.096
    for at, words in ((nowhere, r"need \[earth\]"), (HERE, "must be near the map")):
        with pytest.raises(
            ProblemError, match=rf'{words}.*; if the coordinates are metres, set unit = "m"'
        ):
            walls(tmp_path, plan, at)
    large = {"type": "Polygon", "coordinates": [[[x + 400_000, y] for x, y in square]]}
    words = r"longitudes and latitudes, .* \(400010, 10\); .* set unit = "
    with pytest.raises(ProblemError, match=words):
        walls(tmp_path, large, HERE)
    named = {"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::32633"}}
    assert boxes(walls(tmp_path, plan | {"crs": named}, nowhere))[0][3] == 20
    assert boxes(walls(tmp_path, collection(feature(plan | {"crs": named})), nowhere))[0][3] == 20
    with pytest.raises(ProblemError, match="crs: must be the same throughout the file"):
        walls(tmp_path, collection(feature(plan | {"crs": named}), crs="EPSG:4326"), nowhere)
    with pytest.raises(ProblemError, match=r'crs: is null, .* set unit = "m" in'):
        walls(tmp_path, plan | {"crs": None}, nowhere)
    for degrees in ("urn:ogc:def:crs:OGC:1.3:CRS84", "EPSG:4326"):
        system = {"type": "name", "properties": {"name": degrees}}
        assert boxes(walls(tmp_path, collection(house(10, 10, height=12), crs=system))) == ONE
        with pytest.raises(ProblemError, match="unit: must be left out, as the coordinates are d"):
            walls(tmp_path, collection(house(10, 10, height=12), crs=system), unit="m")


@pytest.mark.parametrize("name", ["ESRI:104326", "ESRI:103857", "EPSG:14326", "EPSG::43260"])
def test_a_code_is_told_by_all_its_digits(
    tmp_path: Path, name: str, capfd: pytest.CaptureFixture[str]
) -> None:
    """A code with 4326 or 3857 in it is another system, and the message is all that is printed."""
    system = {"type": "name", "properties": {"name": name}}
    with pytest.raises(ProblemError, match="crs: ") as error:
        walls(tmp_path, collection(house(10, 10, height=12), crs=system))
    assert "Mercator" not in str(error.value)
    assert capfd.readouterr() == ("", "")


def test_systems_of_plans_in_feet_are_not_taken_for_metres(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A code of such a system needs the unit in the recipe; without pyproj and rasterio each."""
    text = "POLYGON ((2000000 500000, 2000010 500000, 2000010 500010, 2000000 500000))"
    feet, metres = f"SRID=2238;{text}", f"SRID=25833;{text}"
    for unit in (None, "m", "cm"):
        with pytest.raises(
            ProblemError, match=r"SRID: must be .* not 2238, which is in US survey foot"
        ):
            walls(tmp_path, feet, MapProjection(), unit=unit)
    high = boxes(walls(tmp_path, feet, MapProjection(), unit="us-ft"))[0][3]
    assert high == pytest.approx(2000010 * 1200 / 3937, abs=1e-3)
    assert boxes(walls(tmp_path, metres, MapProjection()))[0][3] == 2000010
    monkeypatch.setitem(sys.modules, "pyproj", None)
    assert boxes(walls(tmp_path, metres, MapProjection()))[0][3] == 2000010  # rasterio knows it
    monkeypatch.setitem(sys.modules, "rasterio", None)
    with pytest.raises(ProblemError, match=r"SRID: EPSG:25833: .* pip install 'cocap-opt\[earth"):
        walls(tmp_path, metres, MapProjection())
    assert boxes(walls(tmp_path, metres, MapProjection(), unit="m"))[0][3] == 2000010


def test_wkt_that_may_be_degrees_is_asked_about(tmp_path: Path) -> None:
    """It is in metres where it says nothing and cannot be degrees of houses, or of the scene."""

    def text(points: list[list[float]]) -> str:
        return f"(({', '.join(f'{x!r} {y!r}' for x, y in points)}))"

    plan = "((10 10, 20 10, 20 20, 10 10))"
    own = text(ring(10, 10))
    assert boxes(walls(tmp_path, f"POLYGON {plan}"))[0][3] == 20
    question = 'are they degrees or metres. If degrees, write "SRID=4326;" .* set unit = "m" in'
    for odd in (f"POLYGON {own}", f"MULTIPOLYGON ({plan}, {own})",
                "POLYGON ((12 52, 14 52, 14 53, 12 52))"):  # fmt: skip
        with pytest.raises(ProblemError, match=question):
            walls(tmp_path, odd)
    assert boxes(walls(tmp_path, f"SRID=4326;POLYGON {own}", height=12.0)) == ONE
    assert walls(tmp_path, f"MULTIPOLYGON ({plan}, {own})", unit="m")
    assert boxes(walls(tmp_path, "GEOMETRYCOLLECTION (POINT (1 2), POLYGON EMPTY, MULTIPOLYGON (EM"
                       f"PTY, {plan}))"))[0][3] == 20  # fmt: skip


def test_plans_across_180_degrees_are_read(tmp_path: Path) -> None:
    """Whole, cut in two parts as the standard wants it, or counted on beyond 180."""
    whole = ring(-5, 10, at=FIJI)
    assert {place[0] > 0 for place in whole} == {True, False}
    counted = [[place[0] % 360, place[1]] for place in whole]
    box = [-5.0, 10.0, 0.0, 5.0, 20.0, 8.0]
    for corners in (whole, counted, [[x - 360, y] for x, y in counted]):
        (found,) = walls(tmp_path, {"type": "Polygon", "coordinates": [corners]}, FIJI)
        np.testing.assert_allclose(boxes([found])[0], box, atol=2e-3)
    (west, south), (east, _), _, (_, north), _ = whole
    halves = [
        [[x, y] for x, y in zip((a, b, b, a, a), (south, south, north, north, south), strict=True)]
        for a, b in ((west, 180.0), (-180.0, east))
    ]
    content = {"type": "MultiPolygon", "coordinates": [[half] for half in halves]}
    both = np.concatenate([part.vertices for part in walls(tmp_path, content, FIJI)])
    np.testing.assert_allclose([*both.min(axis=0), *both.max(axis=0)], box, atol=0.2)
    with pytest.raises(ProblemError, match=r"need \[earth\] .* longitude = 17\d\.") as error:
        walls(tmp_path, {"type": "Polygon", "coordinates": [whole]}, MapProjection())
    assert "EPSG:32760" in str(error.value)
    pole = [[0, -80], [90, -80], [180, -80], [-90, -80], [0, -80]]
    with pytest.raises(ProblemError, match="must not go around a pole"):
        walls(tmp_path, {"type": "Polygon", "coordinates": [pole]}, FIJI)


@pytest.mark.parametrize("altitudes", [(), (35.0,), (35.0, 36.0)])
def test_repeated_points_make_no_solid_hollow(tmp_path: Path, altitudes: tuple[float, ...]) -> None:
    """Points that are the same, or differ in altitude only; in holes as well, and in all kinds."""
    outer, hole = ring(10, 10), ring(13, 13, 2, 2)

    def twice(points: list[list[float]]) -> list[list[float]]:
        return [[*place, *altitudes[:1]] for place in points for _ in range(2)]

    plan = {"type": "Polygon", "coordinates": [twice(outer), twice(hole)]}
    (mesh,) = walls(tmp_path, plan)
    assert mesh.is_solid and volume(mesh) == pytest.approx((100 - 4) * 8, rel=1e-6)
    text = "POLYGON ((10 10, 20 10, 20 10, 20 20, 10 20, 10 20, 10 20, 10 10))"
    assert volume(walls(tmp_path, text)[0]) == pytest.approx(800)
    room = [[10, 10], [10, 10], [20, 10], [20, 20], [20, 20], [10, 20], [10, 10], [10, 10]]
    (tmp_path / "room").write_text(json.dumps({"a": {"walkable": room, "obstacles": [room]}}))
    (mesh,) = WallsTable(file="room", height=8.0).meshes(tmp_path, level)
    assert mesh.is_solid and volume(mesh) == pytest.approx(800)


def test_zones_of_repeated_points_are_solid() -> None:
    """All that is extruded is: also a no-fly zone with a point twice."""
    from shapely import Polygon

    area = sound(Polygon([(0, 0), (4, 0), (4, 0), (4, 4), (0, 4), (0, 0)]), "polygon")
    assert extruded(area, 5.0, 1.0).is_solid


def test_polygons_without_area_are_left_out_with_a_word(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """They hold nothing; if all are such, the file has no walls."""
    flat = feature({"type": "Polygon", "coordinates": [[ring(5, 5)[0]] * 4]})
    line = feature({"type": "Polygon", "coordinates": [[*ring(5, 5)[:2], *ring(5, 5)[1::-1]]]})
    assert boxes(walls(tmp_path, collection(flat, line, house(10, 10, height=12)))) == ONE
    assert "2 of 3 polygons have no area, and are left out" in caplog.text
    with pytest.raises(ProblemError, match="at least one polygon with an area; 1 of 1 polygons"):
        walls(tmp_path, collection(flat))


@pytest.mark.parametrize(
    ("properties", "answer"),
    [
        ({}, (0, None)),
        ({"height": None, "min_height": ""}, (0, None)),
        ({"height": 40, "min_height": 30}, (30, 40)),
        ({"height": "40", "min_height": "30", "building:part": "yes"}, (30, 40)),
        ({"HEIGHT": 12.5}, (0, 12.5)),
        ({"Height": "12 m"}, (0, 12)),
        ({"building:height": "12,5"}, (0, 12.5)),
        ({"height": "12.5m", "minHeight": "2.5 metres"}, (2.5, 12.5)),
        ({"height": "40 ft"}, (0, 40 * 0.3048)),
        ({"height": "40 ft above ground"}, (0, 40 * 0.3048)),
        ({"height": "12 m AGL"}, (0, 12)),
        ({"height": "40'"}, (0, 40 * 0.3048)),
        ({"height": "7'4\""}, (0, 7 * 0.3048 + 4 * 0.0254)),
        ({"height": "40 feet", "min_height": "10ft"}, (3.048, 40 * 0.3048)),
        ({"tags": {"height": "9"}}, (0, 9)),
        ({"tags": {"height": "9", "min_height": 3}, "height": 9.0}, (3, 9.0)),
        ({"other_tags": '"height"=>"9","name"=>"inn"'}, (0, 9)),
        ({"tags": '{"height": "9", "name": "inn"}'}, (0, 9)),
        ({"tags": [{"k": "height", "v": "9"}, {"k": "min_height", "v": 3}]}, (3, 9)),
        ({"tags": [{"key": "height", "value": 9}, "brick"]}, (0, 9)),
        ({"tags": " "}, (0, None)),
        ({"building:levels": "4"}, (0, 12)),
        ({"building:levels": 4, "roof:levels": 1}, (0, 15)),
        ({"building:levels": 4, "roof:height": "2.5"}, (0, 14.5)),
        ({"building:levels": 4, "building:min_level": 2}, (6, 12)),
        ({"building:levels": 4, "height": 20, "building:min_level": 1}, (3, 20)),
        ({"levels": 2, "minLevel": 0}, (0, 6)),
        ({"min_height": 3}, (3, None)),
        ({"height": 9, "height:unit": "metres"}, (0, 9)),
        ({"height": 9, "units": 12}, (0, 9)),  # dwellings
        ({"height": 9, "est_height": 8, "building:height": "9 m"}, (0, 9)),
        ({"height": 9, "base_height": 0, "HEIGHT_FT": None, "hgt_min": -1}, (0, 9)),
        ({"height": 9, "height:source": 2019, "heightAccuracy": 0.3, "maxheight": "2.1"}, (0, 9)),
        ({"height": 9, "eaveHeight": 6, "ground_height": 31, "BASE_ELEV": "30 m"}, (0, 9)),
        ({"height": 9, "basement": 1, "BASEMENT": 1, "database": 7, "base": "rock"}, (0, 9)),
    ],
)  # fmt: skip
def test_properties_say_from_where_to_where_a_building_reaches(
    properties: dict[str, Any], answer: tuple[float, float | None]
) -> None:
    """By the tags of OpenStreetMap in any spelling, lengths before storeys."""
    found = extent(properties, "properties")
    assert found.bottom == pytest.approx(answer[0])
    assert found.top == (answer[1] and pytest.approx(answer[1]))


@pytest.mark.parametrize(
    ("properties", "words"),
    [
        *(({"height": odd}, "p.height: must be a number of metres above 0") for odd in (
            0, -3, "tall", "12 paces", "10-12", "12;15", "1,234", "~12", True, [3], {"m": 3}, "nan",
            "inf", "12 m 3", " ", "112 m above sea level", "112 m NHN", "12 m_asl",
        )),
        *(({"height": tall}, "p.height: must be at most 1000 m, not") for tall in (
            1001, "1250", "1e400", "4000 ft", 1e9,
        )),
        ({"building:levels": 400}, "p.building:levels: must be a number of storeys from 0 to 333"),
        ({"height": 9, "height:unit": "ft"}, "p.height:unit: must be m, as plain heights are in"),
        ({"height": 9, "HEIGHT_UNIT": "storeys"}, "p.HEIGHT_UNIT: must be m, as plain heights"),
        ({"height": 9, "tags": {"units": "feet"}}, "p.units: must be m, as plain heights are in"),
        ({"min_height": -1}, "p.min_height: must be a number of metres >= 0"),
        ({"building:levels": "many"}, "p.building:levels: must be a number of storeys"),
        ({"building:levels": True}, "p.building:levels: must be a number of storeys"),
        ({"building:levels": -1}, "p.building:levels: must be a number of storeys"),
        ({"tags": "height 9"}, "p.tags: must be an object, or text such as"),
        ({"tags": [{"height": 9}]}, 'p.tags: must be an object such as {"height": "12"}'),
        ({"height": 3, "min_height": 3}, "p: the top, 3 m, must be above the bottom, 3 m"),
        ({"building:levels": 0}, "p: the top, 0 m, must be above"),
        ({"height": 3, "HEIGHT": 4}, "p: height and HEIGHT must agree, but are 3 and 4"),
        ({"height": 12, "building:height": "40"}, "p: height and building:height must agree, but"),
        ({"height": 12, "min_height": 3, "building:min_height": 4}, "p: min_height and building:"),
        ({"levels": 3, "num_floors": 4}, "p: levels and num_floors must agree, but are 3 and 4"),
        *(({"height": 40, name: value}, f"p.{name}: must be called height or min_height, with")
          for name, value in {
              "base_height": 30, "minHeightM": 30, "min_height_ft": "30", "render_min_height": 30,
              "HEIGHT_FT": 131, "render_height": 60, "max_height": 41, "BLDGHGT": 49.5, "base": 30,
              "buildingBase": 30, "roof_hgt": 53,
          }.items()),
        *(({name: 3}, f"p.{name}: must be called height or min_height, with")
          for name in ("render_height", "max_height", "BLDGHGT", "roof_hgt", "base", "HEIGHT_FT")),
        ({"tags": {"base_height": "30"}}, "p.base_height: must be called height or min_height"),
        ({"height": 3, "tags": {"height": "4"}}, "p: height and height must agree, but are 3 and"),
    ],
)  # fmt: skip
def test_heights_that_are_none_are_refused(properties: dict[str, Any], words: str) -> None:
    """The message names the property, and what is allowed."""
    with pytest.raises(ProblemError, match=words) as error:
        extent(properties, "p")
    assert "\n" not in str(error.value)


def test_storeys_are_counted_with_a_word(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """What is taken for granted is said."""
    plan = collection(house(10, 10, **{"building:levels": "4"}), house(30, 10, height=3))
    assert [box[5] for box in boxes(walls(tmp_path, plan))] == [12, 3]
    assert "plan: 1 of 2 heights are computed from storeys of 3 m" in caplog.text


@pytest.mark.parametrize("tags", [{}, {"tags": {"location": "underground"}}])
def test_what_is_underground_is_left_out_with_a_word(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, tags: dict[str, Any]
) -> None:
    """A garage below a square is no block on it."""
    garage = house(10, 10, height=3, **(tags or {"location": "underground"}))
    plan = collection(garage, house(30, 10, height=3, location="rooftop"))
    assert len(walls(tmp_path, plan)) == 1
    assert "plan: 1 of 2 polygons are underground, and are left out" in caplog.text


@pytest.mark.parametrize(
    ("tags", "is_told"),
    [
        ({"building": "garage", "layer": "-1"}, True),
        ({"tags": {"building": "yes", "layer": -2}}, True),
        ({"building": "yes", "layer": "1"}, False),
        ({"building": "yes", "layer": "-"}, False),
        ({"layer": -1}, False),
    ],
)
def test_buildings_with_a_negative_layer_are_told(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, tags: dict[str, Any], is_told: bool
) -> None:
    """They may be underground, which only the author of the map can know; they stay obstacles."""
    plan = collection(house(10, 10, height=3, **tags), house(30, 10, height=3))
    assert len(walls(tmp_path, plan)) == 2
    words = "plan: 1 of 2 polygons are buildings with a negative layer"
    assert (words in caplog.text) == is_told


def test_a_block_with_a_bottom_begins_there(tmp_path: Path) -> None:
    """Above the foot of the walls; the height of the table must be above it, too."""
    skyway = house(10, 10, height=40, min_height=30)
    assert boxes(walls(tmp_path, collection(skyway), base=100.0)) == [
        [10.0, 10.0, 130.0, 20.0, 20.0, 140.0]
    ]
    shelter = house(10, 10, min_height=3)
    assert boxes(walls(tmp_path, collection(shelter)))[0][2::3] == [3, 8]
    with pytest.raises(ProblemError, match="height: must be above 3 m, the bottom of polygon 1,"):
        walls(tmp_path, collection(shelter), height=2.0)


def test_rings_in_degrees_are_judged_as_they_are(tmp_path: Path) -> None:
    """One that crosses itself is refused, not cut in half; a hole of one point is none."""
    a, b, c, d, _ = ring(10, 10)
    bow = {"type": "Polygon", "coordinates": [[a, c, b, d, a]]}
    with pytest.raises(ProblemError, match="polygon 1: must not cross itself, as it does at"):
        walls(tmp_path, bow)
    long = {"type": "Polygon", "coordinates": [ring(-9000, 10, 18000, 10)]}
    x0, y0, _, x1, y1, _ = boxes(walls(tmp_path, long))[0]
    assert (x0, x1) == (-9000, 9000) and -10 < y0 < 10 and 20 <= y1 < 30
    hole = {"type": "Polygon", "coordinates": [ring(10, 10), [ring(13, 13)[0]] * 4]}
    assert boxes(walls(tmp_path, hole, height=12.0)) == ONE


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            '{"type": "Topology", "arcs": [], "objects": {}}',
            "is TopoJSON; convert it with `ogr2ogr",
        ),
        (
            '{"geometryType": "esriGeometryPolygon", "features": []}',
            "is Esri JSON; convert it with `ogr2ogr",
        ),
        ('{"version": 0.6, "elements": []}', "is Overpass JSON; convert it with osmtogeojson"),
        (
            '{"type": "Feature", "geometry": null, "place": {"type": "Polygon"}}',
            "place: must not be given without a geometry, as in JSON-FG; convert it with `ogr2ogr",
        ),
        ("TRIANGLE ((0 0, 9 0, 9 9, 0 0))", "at least one polygon|cannot be read as WKT"),
    ],
)
def test_other_files_of_polygons_are_named(tmp_path: Path, text: str, words: str) -> None:
    """With what writes them as GeoJSON."""
    with pytest.raises(ProblemError, match=words):
        walls(tmp_path, text)


@pytest.mark.parametrize(
    ("properties", "told"),
    [
        ({"HAUTEUR": 25, "NB_ETAGES": 8}, "get the 8 m of the table; properties of polygon 1: HAU"),
        ({"height": 540}, "polygon 1 is 540 m tall: are heights above the ground"),
        ({"height": 9, "min_level": 1, "max_level": 4}, ""),
        ({}, ""),
    ],
)
def test_doubtful_heights_are_told(
    tmp_path: Path, properties: dict[str, Any], told: str, caplog: pytest.LogCaptureFixture
) -> None:
    """A height under another name gives way to that of the table; levels of floor plans lift no
    building.
    """
    plan = house(10, 10, **properties)
    ((*_, low, _, _, top),) = boxes(walls(tmp_path, collection(plan)))
    assert (low, top) == (0.0, properties.get("height", 8.0))
    assert told in caplog.text and len(caplog.messages) == bool(told)


def test_what_is_no_building_is_left_out(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """By its tag."""
    plans = collection(house(10, 10, height=12), house(30, 10, building="no"))
    assert boxes(walls(tmp_path, plans)) == ONE
    assert "1 of 2 polygons have building = no: left out" in caplog.text


def test_parts_count_instead_of_the_outline_of_their_building(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """As in OpenStreetMap: below a part that begins higher up, drones fly and people walk; what no
    part covers stays.
    """
    whole = house(10, 10, building="yes", height=20)
    (west, east), tag = (
        [{"type": "Polygon", "coordinates": [ring(x, 10, wide=5)]} for x in (10, 15)],
        {"building:part": "yes"},
    )
    arch = feature(west, height=20, min_height=6, **tag)
    wing = feature(east, height=12, **tag)
    found = boxes(walls(tmp_path, collection(whole, arch, wing)))
    assert [box[2::3] for box in found] == [[6.0, 20.0], [0.0, 12.0]]
    assert "1 of 3 polygons are outlines of buildings whose parts (building:part)" in caplog.text
    found = boxes(walls(tmp_path, collection(whole, arch)))
    assert [(*box[0::3], *box[2::3]) for box in found] == [
        (15.0, 20.0, 0.0, 20.0),
        (10.0, 15.0, 6.0, 20.0),
    ]


def test_a_roof_without_an_underside_is_told(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """It is solid from the ground, unless the file says where it begins."""
    walls(tmp_path, collection(house(10, 10, building="roof", height=5)))
    assert "1 of 1 polygons are roofs (building = roof)" in caplog.text
    caplog.clear()
    walls(tmp_path, collection(house(10, 10, building="roof", height=5, min_height=4)))
    assert not caplog.text


def test_buildings_stand_on_the_ground_below_them(tmp_path: Path) -> None:
    """Not on the lowest of the map, nor on that of a ditch beside them; their feet reach both."""
    heights = np.add.outer(100 + 0.5 * np.arange(60), np.zeros(60))
    heights[20, :] = 90.0  # a ditch of one cell
    terrain = Terrain(HeightMap(heights=heights, resolution=1.0), heights)
    plan = {"type": "Polygon", "coordinates": [ring(10, 10, wide=10.2)]}
    (tmp_path / "plan").write_text(json.dumps(collection(feature(plan, height=12))))
    table = WallsTable(file="plan", polygons="obstacles")
    assert boxes(table.meshes(tmp_path, terrain.below, HERE)) == [
        [10.0, 10.0, 90.0, 20.2, 20.0, 117.0]
    ]
    raised = feature(plan, height=12, min_height=3)
    (tmp_path / "plan").write_text(json.dumps(collection(raised)))
    assert boxes(table.meshes(tmp_path, terrain.below, HERE))[0][2::3] == [108.0, 117.0]
    based = WallsTable(file="plan", polygons="obstacles", base=50.0)
    assert boxes(based.meshes(tmp_path, terrain.below, HERE))[0][2::3] == [53.0, 62.0]
    assert terrain.below(shapely.box(100, 5, 110, 9)) == Ground(129.5, 129.5)  # off the map


SCENE = """
steps = 3
map = {{ size = [60, 60] }}
walls = [{{ file = "plan", polygons = "obstacles" }}]
walk = [{{ points = [[30, 30], [31, 30]] }}]
[[drones]]
starts = [{{ x = {x}, y = 30.5, height = {height}, heading = {heading} }}]
camera = "dji-mavic-pro"
tilts = [{tilt}]
motion = {{ layers = [{height}] }}
[earth]
crs = "EPSG:32633"
latitude = 52.4010
longitude = 13.0590
"""


@pytest.mark.slow
def test_drones_pass_below_a_block_in_the_air_and_people_are_hidden_by_it(tmp_path: Path) -> None:
    """It is no block from the ground upwards, for neither of them."""

    def seen(bottom: float, **start: float) -> float:
        """What the best of simple plans sees of the person under the block."""
        skyway = house(20, 20, 20, 20, height=40, min_height=bottom)
        (tmp_path / "plan").write_text(json.dumps(collection(skyway)))
        (tmp_path / "scene.toml").write_text(SCENE.format(**start))
        return sequential(read(tmp_path / "scene.toml")).value

    assert seen(30, x=24.5, height=5, heading=0, tilt=40) > 0
    assert seen(30, x=24.5, height=45, heading=0, tilt=80) == 0
    assert seen(39, x=24.5, height=35, heading=0, tilt=80) > 0
    with pytest.raises(ProblemError, match=r"is blocked: .* from 30 to 40 m"):
        seen(30, x=24.5, height=35, heading=0, tilt=80)
    with pytest.raises(ProblemError, match=r"is blocked: .* from 0 to 40 m"):
        seen(0, x=24.5, height=5, heading=0, tilt=40)
