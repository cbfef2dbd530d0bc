"""Land cover of recipes: areas of GeoJSON that pictures show on the ground."""

import json
import logging
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, reject
from hypothesis import strategies as st
from shapely import (
    GeometryCollection,
    LineString,
    MultiPolygon,
    Polygon,
    box,
    contains_xy,
)
from strategies import examples

from cocap_opt.data import ProblemError
from cocap_opt.player.player import Player
from cocap_opt.problem import LandCover, Problem
from cocap_opt.problem.land_cover import LANDS, in_cells
from cocap_opt.scenarios.earth import same_system, wkt_of_code
from cocap_opt.scenarios.maps.parts import parts_of, polygons_of
from cocap_opt.scenarios.recipe import read
from cocap_opt.world.workspace import HeightMap

RECIPE = """
steps = 2
[map]
size = [12, 9]
[[land_cover]]
file = "land.geojson"
{more}
[[walk]]
points = [[9.5, 4.5]]
heading = 180
[[drones]]
starts = [{{ x = 1.5, y = 4.5, height = 3 }}]
motion = {{ layers = [3] }}
"""
RING = [[1.0, 1.0], [8.0, 1.0], [8.0, 6.0], [1.0, 6.0], [1.0, 1.0]]
HOLE = [[3.0, 2.0], [3.0, 4.0], [6.0, 4.0], [6.0, 2.0], [3.0, 2.0]]


def feature(*rings: list[list[float]], **properties: str) -> dict[str, object]:
    """A polygon of GeoJSON."""
    geometry = {"type": "Polygon", "coordinates": list(rings)}
    return {"type": "Feature", "properties": properties, "geometry": geometry}


def scene(folder: Path, *features: dict[str, object], more: str = 'unit = "m"') -> Problem:
    """The scene of a recipe with these features as its land."""
    content = {"type": "FeatureCollection", "features": features}
    (folder / "land.geojson").write_text(json.dumps(content))
    path = folder / "scene.toml"
    path.write_text(RECIPE.format(more=more))
    return read(path)


@pytest.mark.parametrize("kind", [["water"], {"water": 1}, None, 7, True])
def test_a_kind_that_is_no_word_is_other(kind: object, tmp_path: Path) -> None:
    """Files of others hold anything there."""
    area = feature(RING)
    area["properties"] = {"kind": kind}
    assert [land.kind for land in scene(tmp_path, area).land_cover] == ["other"]


def test_areas_are_cut_to_the_map(tmp_path: Path) -> None:
    """An area has its kind, name and holes, and ends where the map does."""
    sea = [[-5.0, 7.0], [40.0, 7.0], [40.0, 40.0], [-5.0, 40.0], [-5.0, 7.0]]
    problem = scene(
        tmp_path, feature(RING, HOLE, kind="green", name="park"), feature(sea, kind="water")
    )
    park, water = problem.land_cover
    assert (park.kind, park.name, len(park.holes)) == ("green", "park", 1)
    assert water.name is None
    assert [corner.tolist() for corner in water.box] == [[0, 7], [12, 9]]
    assert park.holds(np.array([park.label])).all()


def test_words_of_the_file_become_kinds(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """The recipe says which property counts and what its words mean; others are told, as other."""
    features = [feature(RING, surface=word) for word in ("water", "grass", "lava", "lava")]
    more = 'unit = "m"\nproperty = "surface"\nkinds = { grass = "green" }'
    with caplog.at_level(logging.WARNING):
        problem = scene(tmp_path, *features, more=more)
    assert [area.kind for area in problem.land_cover] == ["water", "green", "other", "other"]
    assert "'lava' (2)" in caplog.text
    assert 'kinds = { WORD = "green" }' in caplog.text


@pytest.mark.parametrize(
    ("features", "more", "words"),
    [
        ([], 'unit = "m"', "land.geojson: must contain at least one polygon"),
        ([feature(RING)], "", "need [earth] in the recipe"),
        ([feature([[x + 90, y] for x, y in RING])], 'unit = "m"', "areas on the map, x 0..12"),
        ([feature(RING)], 'kinds = { a = "sea" }', "kinds"),
    ],
)
def test_refusals_name_the_table(
    tmp_path: Path, features: list[dict[str, object]], more: str, words: str
) -> None:
    """What cannot be drawn is refused in a line that names table, file and what is allowed."""
    with pytest.raises(ProblemError, match="land_cover") as caught:
        scene(tmp_path, *features, more=more)
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"kind": "sea", "outline": RING}, "kind: must be one of water, green"),
        ({"kind": "water", "outline": RING[:2]}, "outline: must hold three or more corners"),
        ({"kind": "water", "outline": [[1, 1]] * 3}, "outline: must have corners that do not"),
        ({"kind": "water", "outline": RING, "holes": [[[0, 0, 0]]]}, "holes[0]: must hold three"),
    ],
)
def test_an_area_is_checked(fields: dict[str, object], words: str) -> None:
    """An area that is made in Python names the field that is wrong."""
    with pytest.raises(ProblemError) as caught:
        LandCover(**{name: np.array(v) if name == "outline" else v for name, v in fields.items()})
    assert words in str(caught.value)


corners = st.tuples(st.floats(-3, 15), st.floats(-3, 12))


@examples(60)
@given(st.lists(corners, min_size=3, max_size=7, unique=True))
def test_cells_have_the_land_of_their_middles(outline: list[tuple[float, float]]) -> None:
    """A cell is covered if its middle is inside the rim, as another library has it."""
    polygon = Polygon(outline)
    if not polygon.is_valid or polygon.area < 1e-3:
        reject()
    height_map = HeightMap(heights=np.zeros((12, 9)))
    found = in_cells([LandCover(kind="yard", outline=np.array(outline))], height_map)
    x, y = np.meshgrid(np.arange(12) + 0.5, np.arange(9) + 0.5, indexing="ij")
    near = polygon.boundary.buffer(1e-6)
    sure = ~contains_xy(near, x, y)
    assert ((found == LANDS.index("yard")) == contains_xy(polygon, x, y))[sure].all()


def test_the_player_gets_the_land(tmp_path: Path) -> None:
    """Cells of the page have the colours of what covers them, and names stand in it."""
    problem = scene(tmp_path, feature(RING, kind="water", name="<pond>"))
    land = Player(problem).data()["terrain"]["land"]
    assert land["cells"].count(str(LANDS.index("water"))) == 35
    assert land["cells"].count("-") == 12 * 9 - 35
    assert [named["name"] for named in land["names"]] == ["<pond>"]
    assert Player(problem.replace(land_cover=())).data()["terrain"]["land"] is None


def test_a_system_is_known_by_the_code_it_ends_with(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without rasterio, WKT and code are one system if the WKT ends with that code."""
    wkt = wkt_of_code(28992)
    assert wkt is not None
    monkeypatch.setitem(sys.modules, "rasterio", None)
    assert same_system(wkt, "EPSG:28992")
    assert not same_system(wkt, "EPSG:4289")  # that of the geographic system in it


CROSSING = [[[1, 1], [5, 5], [5, 1], [1, 5], [1, 1]]]  # two triangles
OUTSIDE = [[[1, 1], [3, 1], [3, 3], [1, 3], [1, 1]], [[4, 1], [5, 1], [5, 2], [4, 2], [4, 1]]]
TOUCHING = [[[0, 0], [4, 0], [2, 2], [4, 4], [0, 4], [2, 2], [0, 0]]]  # two triangles at a point


@pytest.mark.parametrize(
    ("rings", "message"), [(CROSSING, "must not cross itself"), (OUTSIDE, "Hole lies outside")]
)
def test_an_area_that_nobody_can_read_is_refused(
    rings: list[list[list[int]]], message: str, tmp_path: Path
) -> None:
    """A hole outside its outline would be land, and an area that crosses itself less than is drawn.

    Landings are judged by land, too.
    """
    area = feature(*rings, kind="green")
    with pytest.raises(ProblemError, match=rf"features\[0\]\.geometry: .*{message}"):
        scene(tmp_path, area)


def test_an_area_that_touches_itself_keeps_its_parts(tmp_path: Path) -> None:
    """Mending it may leave polygons in a collection."""
    areas = scene(tmp_path, feature(TOUCHING[0], kind="green")).land_cover
    assert sum(Polygon(area.outline).area for area in areas) == pytest.approx(8.0)


def test_parts_of_an_area_are_found_however_deep_they_lie() -> None:
    """Without points, lines, and polygons that are empty or flat."""
    square, flat = box(0, 0, 1, 1), Polygon([(0, 0), (1, 1), (2, 2)])
    line = LineString([(0, 0), (1, 1)])
    nested = GeometryCollection(
        [line, GeometryCollection([MultiPolygon([square]), flat, Polygon()])]
    )
    assert list(polygons_of(nested)) == [square]
    assert [part.geom_type for part in parts_of(nested)] == ["LineString", "Polygon", "Polygon"]


def test_land_of_very_many_corners_is_read_in_a_moment() -> None:
    """Its sides are in an index: every point was held against each of them before."""
    angles = np.linspace(0.0, 2 * np.pi, 50_000, endpoint=False)
    radii = 20 + np.cos(9 * angles)
    rim = 25 + np.stack([radii * np.cos(angles), radii * np.sin(angles)], axis=1)
    area, tried = LandCover(kind="water", outline=rim), [[25.0, 25.0], [25.0, 45.9], [46.5, 25.0]]
    assert area.holds(np.array(tried)).tolist() == [True, False, False]
    assert np.hypot(*(np.array(area.label) - 25)) < 1.0
