"""Recipes, and the meshes, walls and warnings that come with them."""

import inspect
import json
import math
import os
import re
import tomllib
from pathlib import Path
from typing import Any, get_args

import msgspec
import numpy as np
import pytest
import rasterio
import trimesh
from hypothesis import given, reject
from hypothesis import strategies as st
from rasterio.transform import Affine
from shapely.geometry.base import BaseGeometry
from strategies import examples, standing

import cocap_opt as co
from cocap_opt.data import FloatArray, ProblemError
from cocap_opt.files.documents import problem_digest
from cocap_opt.flight.safety import Nearest
from cocap_opt.flight.trajectory import Trajectory
from cocap_opt.formulations import EXACT
from cocap_opt.formulations.column_generation.branch_and_price import branch_and_price
from cocap_opt.plausibility import narrow_way, warnings
from cocap_opt.problem import (
    NO_RULES,
    Actor,
    Airspace,
    Cuboid,
    Earth,
    Motion,
    Plan,
    Problem,
    State,
)
from cocap_opt.referee import check
from cocap_opt.scenarios import SCENES, load_scene
from cocap_opt.scenarios.earth.place import MapProjection
from cocap_opt.scenarios.maps.terrain import Ground
from cocap_opt.scenarios.maps.walls import WallsTable
from cocap_opt.scenarios.meshes import MeshTable
from cocap_opt.scenarios.recipe import EXAMPLE, read
from cocap_opt.scenarios.recipe.drones import DronesTable, Surroundings
from cocap_opt.scenarios.recipe.objective import ObjectiveTable, ViewsTable
from cocap_opt.scenarios.recipe.schema import Recipe
from cocap_opt.scenarios.tables import Table
from cocap_opt.stop import never
from cocap_opt.vision.default_weights import default_weights
from cocap_opt.world.workspace import HeightMap, Mesh, Workspace

EAST, NORTH = 500600.988, 4794197.109  # m, corner of the rasters below


def write_tif(path: Path, values: FloatArray, cell: float = 1.0) -> None:
    """A GeoTIFF of heights [X, Y] whose lower left corner is (EAST, NORTH)."""
    rows = values.T[::-1].astype(np.float32)
    transform = Affine(cell, 0, EAST, 0, -cell, NORTH + len(rows) * cell)
    with rasterio.open(
        path, "w", driver="GTiff", width=rows.shape[1], height=rows.shape[0], count=1,
        dtype="float32", transform=transform, crs="EPSG:25830",
    ) as file:  # fmt: skip
        file.write(rows, 1)


def read_mesh(path: Path, **fields: Any) -> Mesh:
    """The mesh that a recipe has from a file."""
    return MeshTable(file=path.name, **fields).mesh(path.parent)


def level(_area: BaseGeometry) -> Ground:
    """Flat ground at 0 m."""
    return Ground(0.0, 0.0)


def write(folder: Path, text: str) -> Path:
    """A recipe file."""
    path = folder / "scene.toml"
    path.write_text(text)
    return path


FLAT = """
steps = 4
[map]
size = [20, 12]
[[walk]]
points = [[5, 6], [15, 6]]
speed = 1.5
"""
DRONE = """
[[drones]]
starts = [{ x = 2.5, y = 6.5, heading = 0 }]
"""


@pytest.fixture
def parts(tmp_path: Path) -> Path:
    """A folder with every kind of file that the example names."""
    ground = np.add.outer(np.linspace(0, 3, 80), np.linspace(0, 2, 60))
    houses = np.zeros((80, 60))
    houses[20:30, 40:50] = 8.0
    write_tif(tmp_path / "terrain.tif", ground + 50)
    write_tif(tmp_path / "houses.tif", houses)
    trees = np.zeros((80, 60))
    trees[60:64, 20:24] = 9.0
    write_tif(tmp_path / "trees.tif", trees)
    trimesh.creation.box((4, 1, 20)).export(tmp_path / "bridge.glb")
    walls = {"bottleneck": {"walkable": [[0, 0], [5, 0], [5, 5], [0, 5]], "obstacles": []}}
    (tmp_path / "geometry.json").write_text(json.dumps(walls))
    ring = [[EAST + x, NORTH + y] for x, y in ((20, 20), (50, 20), (50, 40), (20, 20))]
    (tmp_path / "land.geojson").write_text(json.dumps({
        "type": "Feature", "properties": {"surface": "grass", "name": "park"},
        "crs": {"type": "name", "properties": {"name": "EPSG:25830"}},
        "geometry": {"type": "Polygon", "coordinates": [ring]},
    }))  # fmt: skip
    rows = [f"{i} {f} {100 * i + 5 * f} {60 * i} 175" for i in (12, 15, 16) for f in range(1000)]
    (tmp_path / "people.txt").write_text("\n".join(rows))
    return tmp_path


@pytest.mark.slow
def test_the_example_in_the_manual_is_read(parts: Path) -> None:
    """The example has every table, and all of them arrive in the problem."""
    text = EXAMPLE.replace("[10, 10, 70, 50]", str([EAST + 10, NORTH + 10, EAST + 70, NORTH + 50]))
    for old, new in (
        ("at = [35, 20, 0]", f"at = [{EAST + 35}, {NORTH + 20}, 50]"),
        ("at = [30, 10]", f"at = [{EAST + 30}, {NORTH + 10}]"),
        ("at = [40, 20]", f"at = [{EAST + 20}, {NORTH + 20}]"),
        ("[[20, 20], [60, 22]]", str([[EAST + 20, NORTH + 20], [EAST + 60, NORTH + 22]])),
        (
            "[[40, 10], [50, 10], [50, 20]]",
            str([[EAST + x, NORTH + y] for x, y in ((40, 10), (50, 10), (50, 20))]),
        ),
        ("[[8, 4], [10, 4], [12, 4]]", str([[EAST + x, NORTH + 14] for x in (18, 20, 22)])),
        ("[[14, 4]]", str([[EAST + 24, NORTH + 14]])),
        ("x = 30, y = 20,", f"x = {EAST + 45}, y = {NORTH + 40},"),
        ("starts = [", "motion = { layers = [4] }\nstarts = ["),
        ('flown = "smooth"', 'flown = "straight"'),  # cells as they are stated
    ):
        assert old in text
        text = text.replace(old, new)
    problem = read(write(parts, text), seed=3)
    assert problem.horizon == 20
    assert problem.height_map.shape == (60, 40)
    np.testing.assert_allclose(problem.height_map.origin, (EAST + 10, NORTH + 10), atol=1e-6)
    assert problem.height_map.datum is not None
    *crowns, bridge, walls = (len(mesh.triangles) for mesh in problem.meshes)
    assert (set(crowns), bridge, walls) == ({12}, 12, 32)
    assert [(area.kind, area.name) for area in problem.land_cover] == [("green", "park")]
    assert [actor.shape.height for actor in problem.actors] == [1.75, 1.75, 1.75, 1.8, 1.8]
    assert [(take.name, take.probability) for take in problem.takes] == [
        ("rehearsed", 0.75), ("late", 0.25),
    ]  # fmt: skip
    assert problem.take_of.tolist() == [0, 0, 0, 0, 1]
    assert len(problem.robots) == 4
    assert problem.robots[3].start.heading == 2
    assert problem.robots[0].camera.tilts == (math.radians(10), math.radians(40))
    assert problem.rules.separation == 2.0
    assert problem.step == 0.5
    limits = problem.robots[0].limits
    assert limits is not None
    assert (limits.speed, limits.yaw_rate, limits.endurance) == (8.0, math.radians(90), 1200.0)
    assert problem.robots[3].limits is None
    assert [robot.home for robot in problem.robots] == [(8, 4), (10, 4), (12, 4), (14, 4)]
    assert problem.earth is not None
    assert (problem.earth.heights, problem.earth.base) == ("sea", 20.0)
    views = problem.objective.views
    assert views is not None and (views.cameras, views.at_least) == (2, 0.3)
    by_default = default_weights(problem.actors, problem.robots)
    assert views.weight == tuple(
        w * f for w, f in zip(by_default, (0.5, 0.5, 0.5, 2, 2), strict=True)
    )


def test_the_example_has_every_field() -> None:
    """Whoever reads the example knows all that a recipe can say."""
    tables = Table.__subclasses__()
    assert len(tables) == 21
    for table in tables:
        for field in table.__struct_fields__:
            assert f"{field} =" in EXAMPLE or f"{field}]" in EXAMPLE, field
    motion = EXAMPLE.split("[drones.motion]")[1]
    assert all(f"\n{field} =" in motion for field in Motion.__struct_fields__)


def _struct(kind: Any) -> Any:
    """Returns the one struct that a type allows, alone or in a list."""
    if inspect.isclass(kind):
        return kind if issubclass(kind, msgspec.Struct) else None
    return next(filter(None, map(_struct, get_args(kind))), None)


def test_the_example_names_each_default_that_it_does_not_show() -> None:
    """Whoever leaves out a key can know what it is then."""
    for section in re.split(r"\n(?=\[)", EXAMPLE):
        head, *entries = re.split(r"\n(?=\S)", section)
        table: Any = Recipe
        if header := re.match(r"\[+([\w.]+)", head):
            for name in header[1].split("."):
                fields = {field.name: field for field in msgspec.structs.fields(table)}
                table = _struct(fields[name].type)
        fields = {field.name: field for field in msgspec.structs.fields(table)}
        for entry in ([] if header else [head]) + [text for text in entries if text[0] != "#"]:
            ((key, shown),) = tomllib.loads(entry).items()
            told = tuple(shown) if isinstance(shown, list) else shown
            is_shown = fields[key].required or told == fields[key].default
            assert is_shown or "default" in entry + head, entry


@pytest.mark.parametrize(
    ("table", "expected"),
    [
        ("", "separation 2 m"),
        ("[rules]\nvertical = 1.5", "separation 2 m, or 1.5 m in height"),
        ("[rules]\nseparation = 0", "vertex+swap"),
        ("[rules]\nvertex = false\nswap = false", "none"),
    ],
)
def test_drones_of_a_recipe_keep_two_metres_apart(
    tmp_path: Path, table: str, expected: str
) -> None:
    """Unless it says otherwise: its plans are to be flown."""
    assert str(read(write(tmp_path, FLAT + DRONE + table)).rules) == expected


AIRSPACE = """
[[no_fly]]
polygon = [[8.5, 0], [12, 0], [12, 12], [8.5, 12]]
top = 6.0
[airspace]
people = 2.5
"""


def test_zones_and_people_are_kept_clear_of(tmp_path: Path) -> None:
    """Drones stay out of every cell of the zone, go round the person, and the bound knows it."""
    problem = read(write(tmp_path, FLAT + DRONE + AIRSPACE))
    assert str(problem.airspace) == "1 no-fly zone, 2.5 m from people"
    problem = problem.replace(robots=[problem.robots[0].replace(motion=Motion(radius=2))])
    best = branch_and_price(problem)
    assert best.plan is not None and check(problem, best.plan).valid
    free = branch_and_price(problem.replace(airspace=Airspace()))
    assert best.value < free.bound
    assert all(state.x < 8 for state in best.plan.paths[0])
    # Straight ahead, after the person and into the zone.
    ahead = Plan(paths=(tuple(problem.robots[0].start._replace(x=x) for x in (2, 3, 4, 5, 6)),))
    assert check(problem, ahead).valid
    ahead = Plan(paths=(tuple(problem.robots[0].start._replace(x=x) for x in (2, 4, 6, 8, 10)),))
    words = " ".join(check(problem, ahead).violations)
    assert words == "paths[0]: steps 3-4 are in a no-fly zone"
    ahead = Plan(paths=(tuple(problem.robots[0].start._replace(x=x) for x in (2, 4, 6, 7, 7)),))
    assert "step 2 is 1.58 m from person 0" in " ".join(check(problem, ahead).violations)


def test_a_zone_below_the_ground_is_refused(tmp_path: Path) -> None:
    """Its altitudes were meant as heights above the ground, and would close nothing."""
    table = "[[no_fly]]\npolygon = [[0, 0], [9, 0], [9, 9]]\ntop = {}\n"
    (tmp_path / "map.asc").write_text(
        "ncols 20\nnrows 12\nxllcorner 0\nyllcorner 0\ncellsize 1\n" + ("500 " * 20 + "\n") * 12
    )
    text = 'steps = 2\n[map]\nfile = "map.asc"\nheights = "absolute"\nground = "surface"\n'
    text += "[[walk]]\npoints = [[5, 6], [6, 6]]\n" + DRONE
    with pytest.raises(ProblemError, match=r"no_fly.0..top: must be above the ground below th"):
        read(write(tmp_path, text + table.format(120)))
    assert read(write(tmp_path, text + table.format(501))).airspace.no_fly


def test_altitudes_count_from_the_zero_of_the_earths_height(tmp_path: Path) -> None:
    """Not from z = 0; and flight heights above the sea are none if z = 0 is elsewhere."""
    (tmp_path / "plan.json").write_text(
        '{"a": {"walkable": [[0, 0], [9, 0], [9, 9]], "obstacles": [[[4, 4], [5, 4], [5, 5]]]}}'
    )
    text = """steps = 2
[map]
size = [20, 20]
[earth]
crs = "EPSG:25830"
latitude = 43.3
longitude = -2.9
height = 100
heights = "above-sea"
[[walls]]
file = "plan.json"
height = 3
base = 102
[[no_fly]]
polygon = [[0, 0], [9, 0], [9, 9]]
bottom = 104
top = 115
[[drones]]
starts = [{ x = 15, y = 15 }]
"""
    problem = read(write(tmp_path, text))
    (zone,), (wall,) = problem.airspace.no_fly, problem.meshes
    assert (zone.vertices[:, 2].min(), zone.vertices[:, 2].max()) == (4, 15)
    assert (wall.vertices[:, 2].min(), wall.vertices[:, 2].max()) == (2, 5)
    with pytest.raises(ProblemError, match=r"earth\.height: must be 0 above the sea if"):
        read(write(tmp_path, 'flight = "above-sea"\n' + text))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[[no_fly]]\npolygon = [[0, 0], [1, 1]]", r"no_fly.0..polygon: must have at least 3"),
        (
            "[[no_fly]]\npolygon = [[0, 0], [2, 2], [2, 0], [0, 2]]",
            r"no_fly.0..polygon: must not cross itself, as it does at \(1, 1\) m",
        ),
        ("[[no_fly]]\npolygon = [[0, 0], [2, 0], [2, 2]]\ntop = 1\nbottom = 2", "top: must be ab"),
        ("[airspace]\nover_people = 3", "airspace: over_people: must be left out if people is"),
        ("[airspace]\nceiling = 1", r"drones.0..motion.layers: .*: the ceiling is at 1 m"),
        (
            "[airspace]\npeople = 4",
            r"drones.0..starts.0.: is 2.55 m from person 0 .*, must be 4 m",
        ),
        (
            "[[no_fly]]\npolygon = [[2.9, 6], [4, 6], [4, 7]]",
            r"drones.0..starts.0.: cell .2, 6. is in a no-fly zone",
        ),
    ],
)
def test_an_airspace_that_makes_no_sense_is_refused(tmp_path: Path, text: str, words: str) -> None:
    """One line says the field and what is allowed."""
    with pytest.raises(ProblemError, match=words):
        read(write(tmp_path, FLAT + DRONE + text))


def test_a_flat_scene_needs_no_files(tmp_path: Path) -> None:
    """Someone walks at the stated pace, looks ahead, and stands where the way ends."""
    problem = read(write(tmp_path, FLAT.replace("1.5", "4") + DRONE))
    poses = problem.actors[0].poses
    np.testing.assert_allclose(poses[:, 0], [5, 9, 13, 15, 15])
    assert (poses[:, 1:] == [6, 0, 0]).all()
    assert problem.robots[0].start == State(2, 6)
    assert problem.name == "scene"


def test_people_and_drones_stand_and_fly_on_the_terrain(tmp_path: Path) -> None:
    """Feet are on the ground, layers above it or above the sea, obstacles keep their height."""
    ground = np.add.outer(np.linspace(0, 8, 20), np.zeros(12)) + 100
    surface = ground.copy()
    surface[10, 5] += 7
    write_tif(tmp_path / "dtm.tif", ground)
    write_tif(tmp_path / "dsm.tif", surface)
    text = f"""
steps = 3
[map]
file = "dsm.tif"
heights = "absolute"
ground = "dtm.tif"
[[walk]]
points = [[{EAST + 5}, {NORTH + 3}], [{EAST + 15}, {NORTH + 3}]]
[[drones]]
starts = [{{ x = {EAST + 2.5}, y = {NORTH + 6.5} }}]
"""
    problem = read(write(tmp_path, text))
    heights = problem.height_map
    np.testing.assert_allclose(heights.heights, surface, atol=1e-4)
    np.testing.assert_allclose(heights.datum, ground, atol=1e-4)
    x, y, z, _ = problem.actors[0].poses[2].tolist()
    assert z == pytest.approx(heights.heights[heights.cell_of(x, y)])
    assert warnings(problem) == []
    write_tif(tmp_path / "dtm.tif", 20 * ground)
    write_tif(tmp_path / "dsm.tif", 20 * surface)
    in_feet = text.replace("[map]", '[map]\nunit = "ft"')
    assert read(write(tmp_path, in_feet)).height_map.heights.max() == pytest.approx(
        20 * surface.max() * 0.3048
    )
    assert warnings(read(write(tmp_path, text))) == [
        "the map rises by 8.42 m per metre or more at half of its cells: are its heights in "
        "centimetres? If so, set `unit` in the recipe's [map]"
    ]
    write_tif(tmp_path / "dtm.tif", ground)
    write_tif(tmp_path / "dsm.tif", surface)
    above_sea = text.replace("steps = 3", 'steps = 3\nflight = "above-sea"')
    words = r"layers: must be .*; at 5 m none is: the surface is at \S*\.\.\S* m"
    with pytest.raises(ProblemError, match=words):
        read(write(tmp_path, above_sea))
    above_sea = above_sea.replace("[[drones]]", "[[drones]]\nmotion = { layers = [120] }")
    assert read(write(tmp_path, above_sea)).height_map.datum is None


def test_a_coarse_slope_buries_nobody(tmp_path: Path) -> None:
    """Cells of 5 m on a steep slope: obstacles are the highest above the mean ground."""
    ground = np.add.outer(np.arange(40) * 0.8, np.zeros(20))
    write_tif(tmp_path / "dtm.tif", ground)
    walk = f"[[walk]]\npoints = [[{EAST + 3}, {NORTH + 3}], [{EAST + 30}, {NORTH + 17}]]\nspeed=9"
    text = 'steps = 3\n[map]\nfile = "dtm.tif"\nheights = "absolute"\nground = "surface"\n'
    drone = f"[[drones]]\nstarts = [{{ x = {EAST + 2.5}, y = {NORTH + 6.5} }}]\n"
    problem = read(write(tmp_path, f"{text}resolution = 5\n{walk}\n{drone}"))
    assert problem.height_map.shape == (8, 4)
    np.testing.assert_array_equal(problem.height_map.heights, problem.height_map.datum)
    assert warnings(problem) == []


def test_seeds_place_drones_and_nothing_else(tmp_path: Path) -> None:
    """Drones with a count start in free cells near someone, apart, and look there."""
    text = FLAT + "[[drones]]\ncount = 5\nnear = 4\n[rules]\nseparation = 1.5\n"
    one, other = read(write(tmp_path, text), 0), read(write(tmp_path, text), 1)
    assert one.robots != other.robots
    assert (one.actors[0].poses == other.actors[0].poses).all()
    assert read(write(tmp_path, text), 1).robots == other.robots
    for robot in one.robots:
        x, y = one.height_map.centre(robot.start.x, robot.start.y)
        assert math.hypot(x - 5, y - 6) <= 4
        towards = math.atan2(6 - y, 5 - x) - robot.start.heading * math.pi / 4
        assert abs(math.remainder(towards, math.tau)) <= math.pi / 8 + 1e-9


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("steps = 4", "steps = 0"), "steps: must be a whole number from 1 to 10,000, not 0"),
        (("steps = 4", "steps = '4'"), "number from 1 to 10,000, not the text '4'"),
        (("steps = 4", "steps = 4.5"), "steps: must be a whole number from 1 to 10,000, not 4.5"),
        (("steps = 4", ""), "scene.toml: must have the field `steps`"),
        (("speed = 1.5", "shape = { type = 'prism', sides = 2 }"),
         r"walk\[0\].shape: sides: must be 3..64, not 2"),
        (("[20, 12]", "[20, 12, 3]"), "map.size: must be a list of length 2, not 3"),
        (("steps = 4", "steps = 4\nmoves = 2"), "unknown field `moves`"),
        (("steps = 4", "steps = 4\nflight = 'x'"), "flight: must be one of above-ground, above-s"),
        (("[20, 12]", "[20, 12]\nheights = 'x'"), "map.heights: must be one of above-ground, abs"),
        (("speed = 1.5", "shape = { type = 'ball' }"),
         r"walk\[0\].shape.type: must be one of cuboid, prism, triangulated-cuboid, not 'ball'"),
        (("[[walk]]", "[[mesh]]\nfile = 'a.obj'\nup = 'x'\n[[walk]]"),
         r"mesh\[0\].up: must be one of y, z, not 'x'"),
        (("[[walk]]", "[[tracks]]\nfile = 'a.txt'\nunit = 'yd'\n[[walk]]"),
         r"tracks\[0\].unit: must be one of cm, ft, m, mm, us-ft, not 'yd'"),
        (("[20, 12]", "[20, 12]\nfill = 1"), "map.fill: must be left out, as the map has a s"),
        (("[20, 12]", "[1e6, 1e6]"), "map.size: must have at most 1000000 cells, not 1000000"),
        (("starts", "tilts = [100]\nstarts"), r"drones.0..tilts: must be within .-90 degrees"),
        (("starts = [{ x = 2.5, y = 6.5, heading = 0 }]", "count = 9\nnear = 0.8"),
         r"drones.0..count: must be at most 1 here; .*: 240 of 240.* 0.8 m at step 0; rules: sep"),
        (("size = [20, 12]", "size = [20, 12]\nfile = 'a.tif'"), "map: must have either"),
        (("size = [20, 12]", "file = 'a.tif'"), r"map: .*a\.tif: no such file"),
        (("size = [20, 12]", "file = 'a.tif'\norigin = [1, 2]"), "map.origin: must be left out"),
        (("size = [20, 12]", "size = [20, 12]\nheights = 'absolute'"),
         "map.heights: must be left out, as the map has a size and no file"),
        (("size = [20, 12]", "size = [20, 12]\nlowest = 1"), "map.lowest: must be left out"),
        (("size = [20, 12]", "file = 'a.tif'\nheights = 'absolute'"), "map.ground: must be given"),
        (("x = 2.5", "x = 25"),
         r"drones.0..starts.0.: must lie on the map, x 0..20 and y 0..12 m, not at .25, 6.5."),
        (("heading = 0", "heading = 1e9"), r"starts.0..heading: must be a number from -360 to 360"),
        (("steps = 4", "steps = 4\nstep = 1e-9"),
         r"drones\[0\].motion.radius: must allow at most 100 m/s, but 1 cells of 1 m in a"),
        (("speed = 1.5", "speed = 500"), r"walk\[0\].speed: must be at most 100 m/s, not 500"),
        (("heading = 0", "height = 3"), r"drones.0..starts.0..height: .* the layers 5 m, not 3 m"),
        (("heading = 0", "heading = 33"), r"starts\[0\].heading: must be .* as 0 and 45, not 33"),
        (("heading = 0", "heading = -10"), r"starts\[0\].heading: .*, such as 0 and 315, not -10"),
        (("speed = 1.5", "headin = 9"), "unknown field `headin`; did you mean heading.; known are"),
        (("starts", "camera = 'skydio2'\nstarts"), "not 'skydio2'; did you mean skydio-2"),
        (("starts", "camera = 'gopro'\nstarts"), r"drones\[0\].camera: must be one of dji-mav"),
        (("starts", "count = 1\nstarts"), r"drones\[0\]: must have either starts or a count"),
        (("[[walk]]", "[[mesh]]\nfile = 'no.obj'\n[[walk]]"), r"mesh\[0\]: .*no\.obj: no such"),
        (("[[walk]]", "[[mesh]]\nfile = 'a.txt'\n[[walk]]"), r"mesh\[0\]: .*must be named \.obj"),
        (("[[walk]]", "[[tracks]]\nfile = 'no.csv'\nids = [1]\n[[walk]]"), r"tracks\[0\]: .*no"),
        (("points", "points = ["), "scene.toml: "),
        (("speed = 1.5", "first = 11"), r"walk\[0\].first: must be at most 10 m, the length of"),
        (("[15, 6]]\nspeed = 1.5", "[900, 6]]\nspeed = 150"),
         r"walk\[0\].speed: must be at most 100 m/s, not 150"),
        (("steps = 4", "steps = 4\nobjective = { balanced = -1 }"),
         "scene.toml: objective.balanced: must be 0..1,000,000,000,000, not -1.0"),
        (("steps = 4", "steps = 4\nobjective = { pixel = 0 }"),
         "objective: must have no unknown field `pixel`; did you mean pixels.; known are pix"),
        (("steps = 4", "steps = 4\nobjective = { pixels = true }"),
         "objective.pixels: must be a number, not true"),
        (("steps = 4", "steps = 4\nobjective.views = 2"),
         "objective.views: must be .first. or an object with fields .cameras, weight, at_least, s"),
        (("steps = 4", "steps = 4\nobjective.views = { camera = 2 }"),
         "objective.views: .* `camera`; did you mean cameras.; known are cameras, w"),
        (("steps = 4", "steps = 4\nobjective.views = { cameras = 0 }"),
         "scene.toml: objective.views.cameras: must be 1..64, not 0"),
        (("steps = 4", "steps = 4\nobjective.views = { cameras = 1.5 }"),
         "objective.views.cameras: must be a whole number, not 1.5"),
        (("steps = 4", "steps = 4\nobjective.views = { weight = 'much' }"),
         "objective.views.weight: must be a number or a list or first, not 'much'"),
        (("steps = 4", "steps = 4\nobjective.views = 'firts'"),
         "objective.views: must be an object with fields or first, not 'firts'; did you mean fir"),
        (("steps = 4", "steps = 4\nobjective.views = { share = 95 }"),
         "objective.views.share: must be 0..1, not 95"),
        (("steps = 4", "steps = 4\nobjective.views = { weight = -1 }"),
         "objective.views.weight: must be 0..1,000,000,000,000, not -1.0"),
        (("steps = 4", "steps = 4\nobjective.views = { weight = [1, 2] }"),
         "objective.views.weight: must be one number, or one for each of the 1 people, not 2"),
        (("steps = 4", "steps = 4\nobjective.views = { at_least = 0 }"),
         "objective.views.at_least: must be > 0, not 0.0; with 0, all drones"),
        (("speed = 1.5", "views_weight = 2"),
         r"walk\[0\].views_weight: must be left out if \[objective\] has no views"),
        (("speed = 1.5", "views_weight = -2\n[objective.views]"),
         r"walk\[0\].views_weight: must be a number >= 0, not -2"),
    ],
)  # fmt: skip
def test_mistakes_are_named(tmp_path: Path, change: tuple[str, str], message: str) -> None:
    """One line names the file, the field and the allowed values."""
    text = FLAT + DRONE
    assert change[0] in text
    with pytest.raises(ProblemError, match=message) as error:
        read(write(tmp_path, text.replace(*change)))
    assert "\n" not in str(error.value)


def test_the_objective_of_a_recipe_is_that_of_problems(tmp_path: Path) -> None:
    """Each of its fields arrives, and one that is left out is as in Python."""
    names = co.Objective.__struct_fields__
    assert set(ObjectiveTable.__struct_fields__) == set(names)
    assert set(ViewsTable.__struct_fields__) == set(co.Views.__struct_fields__)
    assert read(write(tmp_path, FLAT + DRONE)).objective == co.Objective()
    fields = {
        name: True if name in ("count_start", "over_time") else k + 2.5
        for k, name in enumerate(names)
        if name != "views"
    }
    text = "".join(f"{name} = {json.dumps(value)}\n" for name, value in fields.items())
    assert read(write(tmp_path, FLAT + DRONE + "[objective]\n" + text)).objective == co.Objective(
        **fields
    )


def test_views_of_a_recipe_are_numbers(tmp_path: Path) -> None:
    """A weight that is left out is the default; people may have a factor of it."""
    walks = "[[walk]]\npoints = [[5, 2]]\nviews_weight = 3.0\nshape = { type = 'prism' }\n"
    plain = FLAT + "[[walk]]\npoints = [[9, 2]]\nviews_weight = 0\n" + walks + DRONE

    def views_of(fields: str) -> co.Views:
        """Returns the views of a recipe that has such a table."""
        views = read(
            write(tmp_path, f"{plain}[objective]\nviews = {{ {fields} }}\n")
        ).objective.views
        assert views is not None
        return views

    usual = views_of("")
    person, nobody, prism = usual.weights(3)
    assert (usual.cameras, usual.at_least, nobody) == (2, 0.3, 0.0)
    problem = read(write(tmp_path, f"{plain}[objective.views]"))
    assert (person, prism / 3) == pytest.approx(
        tuple(default_weights(problem.actors, problem.robots)[k] for k in (0, 2))
    )
    assert views_of("cameras = 3, weight = 7, at_least = 1") == co.Views(
        cameras=3, weight=(7.0, 0.0, 21.0), at_least=1.0
    )
    assert views_of("weight = [1, 2, 3.5]").weight == (1.0, 0.0, 10.5)


def test_views_of_a_recipe_survive_a_file(tmp_path: Path) -> None:
    """The scene's file holds numbers, and the same digest; without views it is what it was."""
    plain = read(write(tmp_path, FLAT + DRONE))
    asked = read(write(tmp_path, FLAT + DRONE + "[objective]\npixels = 0\nviews = {}\n"))
    assert co.with_views(plain).objective == asked.objective.replace(pixels=1.0)
    assert problem_digest(asked.replace(objective=co.Objective())) == problem_digest(plain)
    co.save(tmp_path / "scene.json", asked)
    again = co.read(tmp_path / "scene.json", Problem)
    assert again.objective == asked.objective
    assert problem_digest(again) == problem_digest(asked) != problem_digest(plain)
    written = json.loads((tmp_path / "scene.json").read_text())["problem"]["objective"]
    assert written["pixels"] == 0.0 and isinstance(written["views"]["weight"][0], float)


def test_people_off_the_map_are_the_cause(tmp_path: Path) -> None:
    """Drones that find no place near them are not to blame."""
    text = FLAT.replace("[[5, 6], [15, 6]]", "[[105, 6], [115, 6]]") + "[[drones]]\ncount = 1\n"
    words = "all people are off the map, at x 105..111 and y 6..6 m, so no drone can start near"
    with pytest.raises(ProblemError, match=words) as error:
        read(write(tmp_path, text))
    assert "the map is x 0..20 and y 0..12 m" in str(error.value)


@pytest.mark.parametrize(
    ("walk", "refused"),
    [
        ("[[1015, 6], [1025, 6]]", True), ("[[1021, 6]]", True), ("[[5, -995]]", True),
        ("[[100, 6]]", False), ("[[15, 6], [1000, 6]]", False), ("[[1000, 6], [15, 6]]", False),
    ],
)  # fmt: skip
def test_who_is_far_off_the_map_all_the_time_is_refused(
    walk: str, refused: bool, tmp_path: Path
) -> None:
    """Nobody films them; who walks into the map or out of it may, and so may who is near it."""
    text = FLAT.replace("[[5, 6], [15, 6]]", walk).replace("speed = 1.5", "speed = 99")
    text = f"step = 10.0\n{text}[[drones]]\nstarts = [{{ x = 5, y = 5 }}]\n"
    if not refused:
        assert read(write(tmp_path, text)).actors
        return
    words = r"walk.0..points: must come within 100 m of the map, x 0..20 and y 0..12 m, but \("
    with pytest.raises(ProblemError, match=words):
        read(write(tmp_path, text))


def test_tracks_far_off_the_map_are_refused_by_file_and_person(tmp_path: Path) -> None:
    """As where a file is in other coordinates than the map."""
    (tmp_path / "people.csv").write_text(
        "id,frame,x,y\n"
        + "".join(f"{i},{t},{1000 * i + 5},6\n" for i in (0, 1) for t in (0, 1, 2, 3, 4))
    )
    text = """
steps = 2
[map]
size = [20, 12]
[[tracks]]
file = "people.csv"
unit = "m"
fps = 1
ids = [0, 1]
[[drones]]
starts = [{ x = 5, y = 5 }]
"""
    words = (
        r"tracks.0..file: people.csv: id 1 must come within 100 m .* \(1005, 6\) m .* 985 m away"
    )
    with pytest.raises(ProblemError, match=words):
        read(write(tmp_path, text))
    assert len(read(write(tmp_path, text.replace("[0, 1]", "[0]"))).actors) == 1


def test_holes_are_refused_or_filled(tmp_path: Path) -> None:
    """A map with cells without data is used only if the recipe gives them a height."""
    values = np.zeros((20, 12))
    values[3, 4] = np.nan
    write_tif(tmp_path / "map.tif", values)
    text = f"""
steps = 2
[map]
file = "map.tif"
[[drones]]
starts = [{{ x = {EAST + 9.5}, y = {NORTH + 6.5} }}]
"""
    with pytest.raises(ProblemError, match=r"map.file: .*1 of 240 cells have no data.*fill"):
        read(write(tmp_path, text))
    filled = text.replace('"map.tif"', '"map.tif"\nfill = 30')
    assert read(write(tmp_path, filled)).height_map.heights[3, 4] == 30


def test_people_who_outrun_all_drones_are_named(tmp_path: Path) -> None:
    """Such a film is taken from afar; the message says which fields matter."""
    walk = '[[walk]]\nname = "Ada"\npoints = [[2, 2], [18, 10]]\nspeed = 3\n'
    for step, said in ((0.5, False), (1.5, True)):
        problem = read(write(tmp_path, f"step = {step}" + FLAT + walk + DRONE))
        found = [words for words in warnings(problem) if "Ada" in words]
        assert [("so drones fall behind" in words) for words in found] == [True] * said


def test_people_who_are_inside_one_another_are_named(tmp_path: Path) -> None:
    """For half of the steps or more, as of a person who was recorded twice; not if they meet."""

    def found(points: str, takes: str = "", first: str = "", second: str = "") -> list[str]:
        ada = f'[[walk]]\nname = "Ada"\npoints = [[2, 2], [8, 2]]\n{first}\n'
        other = f"[[walk]]\npoints = {points}\n{second}\n"
        problem = read(write(tmp_path, FLAT + takes + ada + other + DRONE))
        return [words for words in warnings(problem) if "inside one another" in words]

    (words,) = found("[[2, 2.1], [8, 2.1]]")
    assert words.startswith("Ada (1) and person 2 are inside one another at ")
    assert not found("[[2, 4], [8, 4]]") and not found("[[2, 2], [2, 8]]")
    takes = "".join(f'[[take]]\nname = "{name}"\nprobability = 0.5\n' for name in ("usual", "late"))
    assert not found("[[2, 2.1], [8, 2.1]]", takes, 'take = "usual"', 'take = "late"')


def test_filmed_people_who_race_are_doubted(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """Their speed is in m/s, whatever the step; who could not be so fast is refused."""
    rows = [f"{k} {frame} {5 + 0.05 * frame + 9 * k * (frame > 30)} {k}\n"
            for k in (1, 99) for frame in range(100)]  # fmt: skip
    (tmp_path / "people.txt").write_text("id frame x y\n" + "".join(rows))
    table = '[[tracks]]\nfile = "people.txt"\nunit = "m"\nfps = 25\nids = [1]\n'
    read(write(tmp_path, "step = 0.5" + FLAT + table + DRONE))
    assert caplog.messages[1] == (
        "people.txt: id 1 moves by 9.625 m from step 2 to 3, 19.25 m/s: are unit, fps, step and "
        "all its rows right?"
    )
    caplog.clear()
    read(write(tmp_path, "step = 0.8" + FLAT + table + DRONE))
    assert "12.5 m/s" in caplog.text
    with pytest.raises(
        ProblemError, match=r"tracks.0.: id 99 must be slower than 100 m/s, but mov"
    ):
        read(write(tmp_path, "step = 0.5" + FLAT + table.replace("[1]", "[99]") + DRONE))


def test_people_who_leave_the_straight_walk_between_steps_are_named(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """The scene has people at the steps only, and drones keep their distance to that walk."""
    table = '[[tracks]]\nfile = "people.csv"\nunit = "m"\nbegin = 2\n'
    aside = {"Ann": (0, 0.4), "Ben": (1.5, 0), "Cas": (0, -0.6)}  # m, at 2.5 and 3.5 s
    rows = [
        f"{who},{k / 2},{4 + k / 2},{5 + y[k // 2 - 2] if k in (5, 7) else 5}\n"
        for who, y in aside.items() for k in range(13)
    ]  # fmt: skip
    (tmp_path / "people.csv").write_text("id,time,x,y\n" + "".join(rows))
    for ids, told in (
        ('["Ann"]', []),
        ('["Cas"]', ["Cas is up to 0.6 m off the straight walk between steps, 1.5 s after step 0"]),
        ('["Ann", "Ben", "Cas"]', ["0.5 s after step 0 (and 1 other by more than 0.5 m); drones"]),
    ):
        caplog.clear()
        read(write(tmp_path, FLAT + table + f"turn = 5\nids = {ids}\n" + DRONE))
        notes = [note for note in caplog.messages if "straight walk" in note]
        assert len(notes) == len(told)
        assert all(words in note for words, note in zip(told, notes, strict=True))
    caplog.clear()
    read(write(tmp_path, "step = 0.5" + FLAT + table + "count = 3\n" + DRONE))
    assert "straight walk" not in caplog.text


@examples(20)
@given(seed=st.integers(0, 10**6), people=st.sampled_from([1.5, 3.0]))
def test_distances_to_people_hold_along_rows_and_legs(
    tmp_path_factory: pytest.TempPathFactory, seed: int, people: float
) -> None:
    """People who turn between the steps are as far from drones as the airspace requires."""
    folder, rng = tmp_path_factory.mktemp("rows"), np.random.default_rng(seed)
    times = np.arange(0.0, 8.01, 0.5)
    rows = np.array([17.0, 15.0]) + rng.normal(0, 0.5, (len(times), 2)).cumsum(axis=0)
    table = "".join(f"Ann,{t},{x},{y}\n" for t, (x, y) in zip(times, rows.tolist(), strict=True))
    (folder / "people.csv").write_text("id,time,x,y\n" + table)
    legs = rng.uniform([10, 9], [26, 12], (4, 2)).round(2)
    text = (
        f"step = 2\nsteps = 4\n[map]\nsize = [30, 30]\n[airspace]\npeople = {people}\n"
        '[[tracks]]\nfile = "people.csv"\nunit = "m"\nids = ["Ann"]\n'
        f"[[walk]]\npoints = {legs.tolist()}\nspeed = 1.3\n"
        "[[drones]]\nstarts = [{ x = 12.5, y = 14.5 }, { x = 18.5, y = 18.5 }]\n"
    )
    try:
        problem = read(write(folder, text))
    except ProblemError:  # a drone begins too close to somebody
        reject()
    plan = co.plan(problem, planner="cocap").plan
    assert plan is not None
    flown = Trajectory.straight(problem, plan)
    dense = np.linspace(0, problem.horizon * 2.0, 801)
    at = flown.at(dense).place[:, :2].reshape(2, -1, 2)
    way = np.append(0.0, np.hypot(*np.diff(legs, axis=0).T).cumsum())
    walks = [
        [np.interp(dense, times, axis) for axis in rows.T],
        [np.interp(1.3 * dense, way, axis) for axis in legs.T],
    ]
    least = min(float(np.hypot(*(at - np.transpose(walk)).T).min()) for walk in walks)
    nearest = Nearest.of_people(flown)
    assert nearest is not None
    assert people - 1e-6 <= nearest.distance <= least + 1e-6


def test_dates_that_cannot_be_compared_are_told(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """Of two tables, one with an offset from UTC and one without."""
    for name, zone in (("a.csv", ""), ("b.csv", "Z")):
        rows = [f"{name[0]},2026-05-16T10:00:{s:02d}{zone},{4 + s},5\n" for s in range(6)]
        (tmp_path / name).write_text("id,time,x,y\n" + "".join(rows))
    table = '[[tracks]]\nfile = "{}"\nunit = "m"\ncount = 1\n'
    read(write(tmp_path, FLAT + table.format("a.csv") + table.format("b.csv") + DRONE))
    assert "with and without an offset from UTC cannot be compared" in caplog.text


def test_people_who_are_not_there_are_named(parts: Path) -> None:
    """Ids that a file lacks and times at which too few are there."""
    table = '[[tracks]]\nfile = "people.txt"\nunit = "cm"\nfps = 16\n'
    for more, message in (
        ("ids = [12, 99]", r"tracks\[0\].ids: 99 is not in the file, which has 12, 15, 16"),
        ("count = 4", "begin: must be the start of .* in which 4 people .* at any time only 3 are"),
        ("count = 3\nbegin = 70", "from 70 s on only 0 are"),
        (
            "",
            r"who is filmed: write ids = \[12, 15, 16\] or count = 3 in .*; all are present for 4",
        ),
        ("begin = 70", r"who is filmed: write .*; nobody is present for 4 s from 70 s on"),
    ):
        with pytest.raises(ProblemError, match=message):
            read(write(parts, FLAT + table + more + DRONE))


@pytest.mark.parametrize(("people", "shown"), [(8, 8), (9, 2)])
def test_an_example_of_whom_to_film_has_all_who_are_present(
    tmp_path: Path, people: int, shown: int
) -> None:
    """Copied into a recipe, it forgets nobody; only of many people it has two. Who leaves early
    cannot be filmed, and any name can be in it.
    """
    names = ["early", "Jo's", *(f"p{k}" for k in range(2, people + 1))]
    rows = [f"{who},{t},{5 + t},{k}\n" for k, who in enumerate(names)
            for t in range(5 if k else 3)]  # fmt: skip
    (tmp_path / "people.csv").write_text("id,time,x,y\n" + "".join(rows))
    table = '[[tracks]]\nfile = "people.csv"\nunit = "m"\n'
    with pytest.raises(ProblemError, match="who is filmed") as refused:
        read(write(tmp_path, FLAT + table + DRONE))
    ids, count = re.findall(r"write (ids = .*) or (count = \d+) in", str(refused.value))[0]
    assert ids.startswith('ids = ["Jo\'s", ') and "early" not in ids
    for wanted in (ids, count):
        problem = read(write(tmp_path, FLAT + table + f"{wanted}\n" + DRONE))
        assert len(problem.actors) == 1 + shown  # one walks


def test_why_nobody_is_there_is_said(tmp_path: Path) -> None:
    """Rows that are too far apart for the frame rate, and gaps, are causes that have names."""
    table = '[[tracks]]\nfile = "people.txt"\nunit = "m"\n'
    path = tmp_path / "people.txt"
    rows = [(i, frame, 5 + 0.02 * frame, 3 * i) for i in (1, 2) for frame in range(0, 200, 10)]
    path.write_text("id frame x y\n1 0 5 5\n2 0 6 5\n")
    with pytest.raises(
        ProblemError,
        match=r"for 4 steps of 1 s, 4 s, but no 2 people are present together for more than 0 s"
        r".*walk.*; id 1 is present",
    ):
        read(write(tmp_path, FLAT + table + "fps = 25\ncount = 2\n" + DRONE))
    path.write_text("id frame x y\n" + "".join(f"{i} {f} {x} {y}\n" for i, f, x, y in rows))
    for more in ("count = 2", "ids = [1, 2]"):
        with pytest.raises(
            ProblemError, match=r"fps: .* by 10 per row; at 2.5 frames.s rows of a person are 4 s"
        ):
            read(write(tmp_path, FLAT + table + f"fps = 2.5\n{more}\n" + DRONE))
    read(write(tmp_path, FLAT + table + "fps = 25\ncount = 2\n" + DRONE))
    with pytest.raises(ProblemError, match=r"more than 7.6 s; set steps = 7"):
        read(write(tmp_path, FLAT.replace("4", "60") + table + "fps = 25\ncount = 2\n" + DRONE))
    rows = [(i, frame, 5 + 0.02 * frame, 3 * i) for i in (1, 2, 3) for frame in range(40)]
    kept = [row for row in rows if row[0] != 2 or not 10 < row[1] < 25]
    path.write_text("id frame x y\n" + "".join(f"{i} {f} {x} {y}\n" for i, f, x, y in kept))
    with pytest.raises(
        ProblemError, match=r"only 0 are; id 2 is present from 0 to 1 s and from 2.5 "
    ):
        read(write(tmp_path, FLAT + table + "fps = 10\ncount = 3\nbegin = -1\n" + DRONE))
    with pytest.raises(
        ProblemError, match=r"3 people .*; 2 \(1, 3\) are present for 3.6 s from 0 s "
    ):
        read(write(tmp_path, "step = 0.9" + FLAT + table + "fps = 10\n" + DRONE))


def test_starts_that_are_too_near_have_the_recipe_s_names(tmp_path: Path) -> None:
    """The second start of a table is told how far it is from the first, or what it is in."""
    two = DRONE.replace("starts = [", "starts = [{ x = 2.5, y = 5.5 }, ")
    with pytest.raises(
        ProblemError,
        match=r"drones.0..starts.1.: is 1.00 m from drones.0..starts.0., must obey the rules sep",
    ):
        read(write(tmp_path, FLAT + two))
    ring = "POLYGON ((2 6, 4 6, 4 8, 2 8, 2 6))"
    (tmp_path / "house.wkt").write_text(ring)
    house = '[[walls]]\nfile = "house.wkt"\npolygons = "obstacles"\nheight = 8\n'
    with pytest.raises(
        ProblemError,
        match=r"drones.0..starts.0.: cell .2, 6. is blocked: ground at 0 m, and walls or",
    ):
        read(write(tmp_path, FLAT + house + DRONE))


def test_a_person_looks_where_a_walk_says(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """Somebody who stands has a heading, too; a walk that ends soon is doubted, standing is not."""
    stands = FLAT.replace(", [15, 6]]\nspeed = 1.5", "]\nheading = 90")
    for text, yaw, doubted in (
        (stands, math.pi / 2, False),
        (FLAT.replace("speed = 1.5", "speed = 2\nheading = -90"), -math.pi / 2, False),
        (FLAT.replace("[15, 6]", "[5, 7]"), math.pi / 2, True),
        (FLAT, 0.0, False),
    ):
        caplog.clear()
        (actor,) = read(write(tmp_path, text + DRONE)).actors
        assert actor.poses[:, 3] == pytest.approx([yaw] * 5)
        assert ("from (5, 6) m ends after 0.6667 of 4 s" in caplog.text) == doubted


# -- meshes -------------------------------------------------------------------------------


@pytest.mark.parametrize("suffix", ["obj", "stl", "glb", "ply", "off"])
def test_meshes_of_all_formats_are_the_same(tmp_path: Path, suffix: str) -> None:
    """A box is the same solid from every format; glTF has y upwards."""
    box = trimesh.creation.box((2, 3, 4))
    box.apply_translation((1, 1.5, 2))
    if suffix == "glb":
        box.apply_transform([[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])
    path = tmp_path / f"box.{suffix}"
    box.export(path)
    mesh = read_mesh(path, at=(10.0, 0.0, 1.0))
    assert mesh.is_solid
    assert len(mesh.vertices) == 8
    np.testing.assert_allclose(mesh.vertices.min(axis=0), (10, 0, 1), atol=1e-6)
    np.testing.assert_allclose(mesh.vertices.max(axis=0), (12, 3, 5), atol=1e-6)
    turned = read_mesh(path, turn=90.0)
    np.testing.assert_allclose(turned.vertices.min(axis=0), (-3, 0, 0), atol=1e-6)


def test_units_of_meshes(tmp_path: Path) -> None:
    """Millimetres and feet come out as metres."""
    trimesh.creation.box((1000, 1000, 1000)).export(tmp_path / "box.stl")
    assert np.ptp(read_mesh(tmp_path / "box.stl", unit="mm").vertices) == pytest.approx(1)
    assert np.ptp(read_mesh(tmp_path / "box.stl", unit="ft").vertices) == pytest.approx(304.8)


def test_people_inside_a_mesh_are_named_where_no_drone_can_start(tmp_path: Path) -> None:
    """Nobody comes near people inside a solid building: the refusal says where they are."""
    trimesh.creation.box((14, 6, 20)).export(tmp_path / "house.stl")
    mesh = '[[mesh]]\nfile = "house.stl"\nat = [10, 6, 10]\n[[drones]]\ncount = 1\n'
    words = r"from 0 of them .* person 0 is inside an obstacle at 5 of 5 steps; at step 0 their"
    with pytest.raises(ProblemError, match=words):
        read(write(tmp_path, FLAT + mesh))


def test_an_open_mesh_is_doubted(tmp_path: Path) -> None:
    """A surface with a hole is used as a surface, and that is said."""
    box = trimesh.creation.box((1, 1, 1))
    box.update_faces(np.arange(12) > 0)
    box.export(tmp_path / "open.obj")
    mesh = read_mesh(tmp_path / "open.obj")
    assert not mesh.is_solid
    problem = load_scene("bridge", 0)
    problem = problem.replace(meshes=(*problem.meshes, mesh))
    assert warnings(problem) == ["meshes[1] is not closed, so only its surface is solid"]


def test_cameras_that_look_up_are_asked_about(tmp_path: Path) -> None:
    """The outputs have pitches below 0, so somebody may write tilts so."""
    problem = read(write(tmp_path, FLAT + DRONE + "tilts = [-20, -45]\n"))
    assert any(words.startswith("drones[0] look up at all") for words in warnings(problem))


def test_heights_above_the_ceiling_are_named(tmp_path: Path) -> None:
    """So that nobody looks for walls."""
    drones = '[[drones]]\ncount = 1\nstarts = { area = "anywhere" }\nmotion = { layers = [40] }\n'
    low = "[airspace]\nceiling = 30\n"
    with pytest.raises(ProblemError, match=r"at 40 m none is: the ceiling is at 30 m"):
        read(write(tmp_path, FLAT + low + drones))
    problem = read(write(tmp_path, FLAT + low.replace("30", "50") + drones))
    with pytest.raises(ProblemError, match=r"all its heights, 40 m and more, are above the ceil"):
        problem.replace(airspace=problem.airspace.replace(ceiling=30.0))
    heights = drones.replace("layers", "heights")
    with pytest.raises(ProblemError, match=r"unknown field `heights`; did you mean layers\?"):
        read(write(tmp_path, FLAT + heights))


@pytest.mark.parametrize(("tilts", "said"), [((0.35,), True), ((0.0, 1.2), True), ((20.0,), False),
                                             ((0.0,), False), ((-15.0, 1.0), False)])  # fmt: skip
def test_tilts_that_may_be_radians_are_asked_about(tilts: tuple[float, ...], said: bool) -> None:
    """Nobody builds a gimbal that looks down by a third of a degree; level cameras are many."""
    problem = load_scene("corridor", 0)
    robots = [
        robot.replace(camera=co.Camera(tilts=tuple(map(math.radians, tilts))))
        for robot in problem.robots
    ]
    found = warnings(problem.replace(robots=tuple(robots)))
    assert len(found) == said
    assert all("are their tilts in degrees?" in words for words in found)


@pytest.mark.parametrize("content", [b"", b"junk", b"solid x\nfacet", bytes(range(256)) * 3])
@pytest.mark.parametrize("suffix", ["obj", "stl", "glb", "ply", "off", "gltf"])
def test_damaged_meshes_are_refused_in_a_line(tmp_path: Path, content: bytes, suffix: str) -> None:
    """Whatever is in the file: a line that names it."""
    path = tmp_path / f"bad.{suffix}"
    path.write_bytes(content)
    with pytest.raises(ProblemError, match="bad") as error:
        read_mesh(path)
    assert "\n" not in str(error.value)


def test_corners_that_are_no_numbers_are_named(tmp_path: Path) -> None:
    """A mesh is not read without them, as if they were not there."""
    solid = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 nan\nf 1 2 3\nf 1 2 4\n"
    (tmp_path / "nan.obj").write_text(solid)
    with pytest.raises(ProblemError, match=r"vertices: must be finite numbers x, y, z, not NaN"):
        read_mesh(tmp_path / "nan.obj")


@pytest.mark.parametrize(
    "text",
    ["v 0 0\nv 1 0\nv 0 1\nf 1 2 3", "v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3",
     "v 1e308 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 77"],
)  # fmt: skip
def test_odd_numbers_in_meshes_are_refused(tmp_path: Path, text: str) -> None:
    """Two coordinates, no number, a huge one, and corners that are not there."""
    (tmp_path / "odd.obj").write_text(text)
    with pytest.raises(ProblemError, match=r"odd\.obj"):
        read_mesh(tmp_path / "odd.obj")


def test_text_of_any_alphabet_is_read(tmp_path: Path) -> None:
    """Comments of older programs are not UTF-8."""
    (tmp_path / "old.obj").write_bytes(b"# caf\xe9\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    assert len(read_mesh(tmp_path / "old.obj").triangles) == 1


def test_a_mesh_reads_no_pipes(tmp_path: Path) -> None:
    """Materials are not looked at, and other files only if they are files beside the mesh."""
    os.mkfifo(tmp_path / "pipe.mtl")
    cube = trimesh.creation.box((1, 1, 1)).export(file_type="obj")
    (tmp_path / "box.obj").write_text(f"mtllib pipe.mtl\n{cube}")
    assert read_mesh(tmp_path / "box.obj").is_solid
    os.mkfifo(tmp_path / "pipe.obj")
    with pytest.raises(ProblemError, match="regular file"):
        read_mesh(tmp_path / "pipe.obj")
    gltf = trimesh.Scene([trimesh.creation.box((1, 1, 1))]).export(file_type="gltf")
    for name, content in gltf.items():
        (tmp_path / name).write_bytes(content)
    assert read_mesh(tmp_path / "model.gltf").is_solid


@pytest.mark.parametrize(
    ("faces", "message"),
    [
        ("3 0 1 2\n3 0 1 -1\n", r"a\.ply: faces: must name vertices 0\.\.3, not -1"),
        ("3 0 1 2\n3 0 1 4\n", r"a\.ply: "),
        ("3 0 1 2\n", r"a\.ply: must have 6 rows, as its header says, but ends after 5"),
    ],
)
def test_faces_of_ply_name_vertices_and_are_all_there(
    tmp_path: Path, faces: str, message: str
) -> None:
    """An index below 0 is not counted from the end, and a file that was cut is not read."""
    head = "ply\nformat ascii 1.0\nelement vertex 4\n"
    head += "".join(f"property float {axis}\n" for axis in "xyz")
    head += "element face 2\nproperty list uchar int vertex_indices\nend_header\n"
    (tmp_path / "a.ply").write_text(head + "0 0 0\n1 0 0\n0 1 0\n0 0 1\n" + faces)
    with pytest.raises(ProblemError, match=message):
        read_mesh(tmp_path / "a.ply")


def test_a_mesh_elsewhere_is_refused(tmp_path: Path) -> None:
    """A mesh that lies wholly off the map is in other coordinates."""
    trimesh.creation.box((1, 1, 1)).export(tmp_path / "box.stl")
    text = FLAT + '[[mesh]]\nfile = "box.stl"\nat = [500, 0, 0]\n' + DRONE
    with pytest.raises(ProblemError, match=r"mesh\[0\]: must lie on the map, x 0\.\.20 "):
        read(write(tmp_path, text))


def test_walls_in_coordinates_of_a_zone_ask_for_the_origin_of_the_map(tmp_path: Path) -> None:
    """`at` would take walls, tracks and drones from their place on the Earth."""
    (tmp_path / "walls.wkt").write_text(
        "POLYGON ((367958 5807421, 367970 5807421, 367970 5807431, 367958 5807421))"
    )
    wall = '[[walls]]\nfile = "walls.wkt"\npolygons = "obstacles"\nheight = 2\n'
    with pytest.raises(ProblemError, match=r"; origin = \[367955, 5807420\] in \[map\] makes the"):
        read(write(tmp_path, FLAT + wall + DRONE))


def test_a_zone_elsewhere_is_refused(tmp_path: Path) -> None:
    """A zone that lies wholly off the map closes nothing, and must be in other coordinates."""
    zone = "[[no_fly]]\npolygon = [[500, 5], [510, 5], [510, 9]]\n"
    with pytest.raises(ProblemError, match=r"no_fly\[0\].polygon: must lie on the map, x 0\.\.20 "):
        read(write(tmp_path, FLAT + DRONE + zone))


@pytest.mark.parametrize(
    "table",
    [
        '[[tracks]]\nfile = "a\\u0000b"\nids = [1]\n',
        '[[walls]]\nfile = "a\\u0000b"\nheight = 2\n',
        '[[mesh]]\nfile = "a\\u0000b.obj"\n',
    ],
)
def test_names_hold_no_nul(tmp_path: Path, table: str) -> None:
    """No file can have such a name, and Python raises an error of its own."""
    with pytest.raises(ProblemError, match="must be the name of a file, in which no character is"):
        read(write(tmp_path, FLAT + DRONE + table))


def test_numbers_of_too_many_digits_are_refused(tmp_path: Path) -> None:
    """Python does not read them, which is no error of msgspec's."""
    text = (FLAT + DRONE).replace("steps = 4", "steps = 4" + 4300 * "0")
    with pytest.raises(ProblemError, match="toml: must contain whole numbers of at most 4300"):
        read(write(tmp_path, text))


@pytest.mark.parametrize(
    ("code", "size", "message"),
    [
        (4326, 40, r"latitude, longitude: need \[earth\] in the recipe"),
        (
            4674,
            40,
            "SRID: must be a projection in metres, or 4326, not 4674, which is in degrees; .*`ogr2",
        ),
        (
            6318,
            40,
            "SRID: must be a projection in metres, or 4326, not 6318, which is in degrees; .*`ogr2",
        ),
        (3857, 4e5, "SRID: must be a projection in metres, or 4326, not 3857, web Mercator"),
        (4647, 4e5, None),  # UTM, with the zone before the easting
        (25830, 40, None),
    ],
)
def test_systems_of_wkt_are_in_metres(
    tmp_path: Path, code: int, size: float, message: str | None
) -> None:
    """What PostGIS writes before WKT says whether coordinates are degrees."""
    ring = f"0 0, {size} 0, {size} {size}, 0 0"
    (tmp_path / "walls.wkt").write_text(f"SRID={code};POLYGON (({ring}))")
    table = WallsTable(file="walls.wkt", height=2.0, polygons="obstacles")
    if message is None:
        assert table.meshes(tmp_path, level)[0].vertices.max() == size
        return
    with pytest.raises(ProblemError, match=message):
        table.meshes(tmp_path, level)


@pytest.mark.parametrize("system", ["urn:ogc:def:crs:EPSG::7844", "EPSG:7844",
                                    "http://www.opengis.net/def/crs/EPSG/0/7844"])  # fmt: skip
def test_systems_of_geojson_are_in_metres(tmp_path: Path, system: str) -> None:
    """Any system of longitude and latitude is refused, whatever its number."""
    ring = [[0, 0], [40, 0], [40, 40], [0, 0]]
    crs = {"type": "name", "properties": {"name": system}}
    plan = {"type": "Polygon", "crs": crs, "coordinates": [ring]}
    (tmp_path / "walls.geojson").write_text(json.dumps(plan))
    table = WallsTable(file="walls.geojson", height=2.0, polygons="obstacles")
    with pytest.raises(ProblemError, match=r"crs: must be a projection in metres, .* not 7844"):
        table.meshes(tmp_path, level)


@pytest.mark.parametrize(
    ("own", "scene", "words"),
    [
        ("EPSG::25833", "EPSG:25832", "crs: must be .* of the scene, EPSG:25832, not EPSG:25833"),
        ("elsewhere", None, "crs: must name an EPSG code, or be left out"),
        ("EPSG::25832", "epsg:25832+5783", ""),
        ("EPSG::25833", None, ""),
    ],
)
def test_walls_are_in_the_system_of_the_scene(
    tmp_path: Path, own: str, scene: str | None, words: str
) -> None:
    """Another one would put them at another place."""
    ring = [[0, 0], [40, 0], [40, 40], [0, 0]]
    crs = {"type": "name", "properties": {"name": own}}
    plan = {"type": "Polygon", "crs": crs, "coordinates": [ring]}
    (tmp_path / "walls.geojson").write_text(json.dumps(plan))
    table = WallsTable(file="walls.geojson", height=2.0, polygons="obstacles")
    projection = MapProjection(None if scene is None else Earth(crs=scene))
    if not words:
        assert len(table.meshes(tmp_path, level, projection)) == 1
        return
    with pytest.raises(ProblemError, match=words):
        table.meshes(tmp_path, level, projection)


def test_what_is_no_number_in_wkt_is_said_once(
    tmp_path: Path, recwarn: pytest.WarningsRecorder
) -> None:
    """The error alone says it; no library warns besides."""
    (tmp_path / "walls.wkt").write_text("POLYGON ((0 0, nan 5, 5 5, 0 0))")
    table = WallsTable(file="walls.wkt", height=2.0, polygons="obstacles")
    with pytest.raises(ProblemError, match="coordinates: must be finite numbers"):
        table.meshes(tmp_path, level)
    assert not recwarn.list


def test_walls_are_in_the_unit_that_their_file_states(tmp_path: Path) -> None:
    """Else in that of the recipe, else in m; what contradicts itself or is no unit is refused."""
    pillar = [[200, 100], [300, 100], [300, 200]]

    def top(stated: str | None, **fields: Any) -> float:
        plan = {"walkable": pillar, "obstacles": [pillar]} | ({"unit": stated} if stated else {})
        (tmp_path / "plan.json").write_text(json.dumps({"one": plan}))
        (mesh,) = WallsTable(file="plan.json", height=2.0, **fields).meshes(tmp_path, level)
        return float(mesh.vertices[:, 0].max())

    assert top("cm") == top(None, unit="cm") == 3.0
    assert top("m") == top(None) == top("cm in file; polygon in m") == 300.0
    assert top("ft") == pytest.approx(300 * 0.3048)
    with pytest.raises(ProblemError, match="unit: must be m, cm, mm, ft, us-ft, not 'px'"):
        top("px")
    with pytest.raises(ProblemError, match="unit: must be 'cm', as in the file, not 'm'"):
        top("cm", unit="m")


SQUARE = "(1 1, 3 1, 3 3, 1 3, 1 1), (1.5 1.5, 2 1.5, 2 2, 1.5 2, 1.5 1.5)"
RINGS = [
    [[float(number) for number in point.split()] for point in ring.strip("() ").split(", ")]
    for ring in SQUARE.split("), (")
]
FEATURE = {"type": "Feature", "properties": {},
           "geometry": {"type": "Polygon", "coordinates": RINGS}}  # fmt: skip


@pytest.mark.parametrize(
    "text",
    [
        json.dumps({"type": "FeatureCollection", "features": [FEATURE]}),
        json.dumps(FEATURE["geometry"]),
        f"POLYGON ({SQUARE})",
        f"SRID=25830;MULTIPOLYGON Z (({SQUARE.replace(',', ' 0,').replace(')', ' 0)')}))".replace(
            ") 0,", "),"
        ),
        f"GEOMETRYCOLLECTION (POLYGON ({SQUARE}))",
    ],
)
def test_walls_of_geojson_and_wkt(tmp_path: Path, text: str) -> None:
    """Their polygons are obstacles, or walkable with holes that are: the recipe must say it."""
    (tmp_path / "plan").write_text(text)

    def volume(unit: Any = "m", **fields: Any) -> float:
        table = WallsTable(file="plan", height=2.0, unit=unit, **fields)
        walls = table.meshes(tmp_path, level)
        assert all(wall.is_solid for wall in walls)
        corners = [np.moveaxis(wall.corners, 1, 0) for wall in walls]
        return sum(float((a * np.cross(b, c)).sum() / 6) for a, b, c in corners)

    assert volume(polygons="obstacles") == pytest.approx((4 - 0.25) * 2)
    assert volume(polygons="walkable") == pytest.approx(0.25 * 2)
    assert volume(polygons="walkable", border=1.0) == pytest.approx((0.25 + 16 - 4) * 2)
    assert volume(polygons="obstacles", unit="cm") == pytest.approx((4 - 0.25) * 2e-4)
    words = 'polygons: must be given for [GW].*: write polygons = "obstacles" .houses.'
    with pytest.raises(ProblemError, match=words):
        volume()
    with pytest.raises(ProblemError, match="name: must be left out"):
        volume(name="one", polygons="obstacles")
    with pytest.raises(ProblemError, match="border: must be left out"):
        volume(polygons="obstacles", border=1.0)


def test_walls_are_as_high_as_geojson_says(tmp_path: Path) -> None:
    """A polygon's property `height` counts, in metres; the recipe's is for those without."""

    def house(x: float, height: object) -> dict[str, Any]:
        ring = [[x, 0], [x + 2, 0], [x + 2, 2], [x, 2], [x, 0]]
        shape = {"type": "Polygon", "coordinates": [ring]}
        return {"type": "Feature", "properties": {"height": height}, "geometry": shape}

    def tops(*features: dict[str, Any]) -> list[float]:
        content = {"type": "FeatureCollection", "features": features}
        (tmp_path / "houses.geojson").write_text(json.dumps(content))
        table = WallsTable(
            file="houses.geojson", height=8.0, base=1.0, polygons="obstacles", unit="m"
        )
        return [float(wall.vertices[:, 2].max()) for wall in table.meshes(tmp_path, level)]

    two = house(9, 5)
    square = two["geometry"]["coordinates"]
    two["geometry"] = {
        "type": "MultiPolygon",
        "coordinates": [square, [[[20, 0], [21, 0], [21, 1], [20, 0]]]],
    }
    assert tops(house(0, 3), house(3, None), house(6, "33.5 m"), two) == [4, 9, 34.5, 6, 6]
    for odd in (0, -3, "8 paces", True, [3]):
        with pytest.raises(
            ProblemError, match=r"features\[1\].properties.height: must be a number"
        ):
            tops(house(0, 3), house(3, odd))


def test_walls_without_any_height_are_told_what_their_file_has(tmp_path: Path) -> None:
    """The recipe needs none where all polygons have one, else the message says what they have."""
    ring = [[0, 0], [2, 0], [2, 2], [0, 0]]
    shape = {"type": "Polygon", "coordinates": [ring]}
    houses = [
        {"type": "Feature", "properties": own, "geometry": shape}
        for own in ({"height": 3}, {"name": "inn", "storeys": 2})
    ]
    table = WallsTable(file="houses.geojson", polygons="obstacles", unit="m")
    for count in (1, 2):
        content = {"type": "FeatureCollection", "features": houses[:count]}
        (tmp_path / "houses.geojson").write_text(json.dumps(content))
        if count == 1:
            assert table.meshes(tmp_path, level)[0].vertices[:, 2].max() == 3
    words = "height: must be given .* polygon 2 has no property `height` .*: .*'inn', storeys = 2$"
    with pytest.raises(ProblemError, match=words):
        table.meshes(tmp_path, level)
    (tmp_path / "houses.geojson").write_text("POLYGON ((0 0, 2 0, 2 2, 0 0))")
    with pytest.raises(ProblemError, match=r"height: must be given .* the file states none"):
        table.meshes(tmp_path, level)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("POLYGON ((1 1, 3 3, 3 1, 1 3, 1 1))", r"polygon 1: must not cross itself, .* \(2, 2\) m"),
        ("POLYGON ((2.1 48.1, 2.2 48.1, 2.2 48.2, 2.1 48.1))", "If degrees, write .SRID=4326;. "),
        ("SRID=4326;POLYGON ((2.1 48.1, 2.2 48.1, 2.2 48.2, 2.1 48.1))", "latitude = 48.1000 and"),
        ('{"type": "Polygon", "crs": "EPSG:4326", "coordinates": []}', "at least one polygon"),
        ('{"type": "Polygon", "coordinates": [], "type": "Polygon"}', "type: must be given once"),
        ('{"a": {"walkable": [[0, 0], [2, 0], [2, 2]]}, "a": {"walkable": []}}', "must"),
        ('{"a": {"unit": "m", "walkable": [[0, 0], [2, 0], [2, 2]], "unit": "cm"}}',
         "unit: must be given once"),
        ("LINESTRING (0 0, 5 5)", "must contain at least one polygon, but has 1 LineString"),
        ("POLYGON ((0 0, 5 5)", "WKT: rings must end at the point where they begin"),
        ("POINT (1 1)", "must contain at least one polygon, but has 1 Point"),
        ("CURVEPOLYGON ((0 0, 1 1, 2 2, 0 0))", "cannot be read as WKT"),
        ("POLYGON ((0 0, 9 0, 9 9, 0 0), (20 0, 21 0, 21 1, 20 0))", "be a valid polygon: Hole"),
        ("POLYGON ((0 0, 1e400 0, 5 5, 0 0))", "must be finite numbers within"),
        ("POLYGON EMPTY", "must contain at least one polygon"),
        ("POLYGON ((0 0, 5 inf, 5 5, 0 0))", "finite numbers|cannot be read"),
        ('{"type": "CityJSON", "version": "2.0"}', r"is CityJSON: .* \.obj"),
        ('{"a": {"walkable": [[0, 0], [NaN, 1], [1, 1]]}}', "must hold finite numbers only, not N"),
        ("", "is empty"),
        ("[]", r'ground plans are {"name": {"walkable"'),
        ('{"a": {"walkable": [[0, 0], [9, 0], [9, 9]], '
         '"obstacles": [[[1, 1], [3, 3], [3, 1], [1, 3]]]}}',
         r"obstacles.0.: must not cross itself, as it does at \(2, 2\) m"),
        ("SQLite format 3\0...", "plan: is an SQLite database"),
    ],
)  # fmt: skip
def test_plans_that_cannot_be_meant_are_refused(tmp_path: Path, text: str, words: str) -> None:
    """Crossing rings, degrees, other geometries and other files: in one line."""
    (tmp_path / "plan").write_text(text)
    states_it = text.startswith('{"a"')
    table = WallsTable(file="plan", height=2.0, polygons=None if states_it else "obstacles")
    with pytest.raises(ProblemError, match=words) as error:
        table.meshes(tmp_path, level)
    assert "\n" not in str(error.value)


def test_a_rounding_does_not_refuse_a_wall(tmp_path: Path) -> None:
    """A ring that passes a point twice, or crosses itself by a millimetre, is meant."""
    ring = [[0, 0], [4, 0], [4, 4], [2, 4], [2, 0], [2, 4], [0, 4]]
    (tmp_path / "plan").write_text(json.dumps({"a": {"walkable": ring, "obstacles": [ring]}}))
    (mesh,) = WallsTable(file="plan", height=2.0).meshes(tmp_path, level)
    assert mesh.vertices[:, :2].max() == 4


def test_walls_of_a_ground_plan(tmp_path: Path) -> None:
    """Obstacles and the border of the walkable area become closed walls of that height."""
    room = [[0, 0], [5, 0], [5, 4], [0, 4]]
    pillar = [[2, 1], [3, 1], [3, 2], [2, 2], [2, 1]]
    plans = {"room": {"unit": "m", "walkable": room, "obstacles": [pillar]},
             "bare": {"walkable": room}}  # fmt: skip
    path = tmp_path / "plan.json"
    path.write_text(json.dumps(plans))

    def walls_of(**fields: Any) -> list[Mesh]:
        return WallsTable(file=path.name, **fields).meshes(tmp_path, level)

    walls = walls_of(name="room", height=2.0, border=0.5)
    assert all(wall.is_solid for wall in walls)
    grid = HeightMap(heights=np.zeros((12, 10)), resolution=0.5, origin=(-0.5, -0.5))
    columns = Workspace(grid, tuple(walls)).columns
    solid = columns.solid(np.full((1, 12, 10), 1.0), np.full((1, 12, 10), 1.0))[0]
    expected = np.ones((12, 10), dtype=bool)
    expected[1:11, 1:9] = False
    expected[5:7, 3:5] = True
    np.testing.assert_array_equal(solid, expected)
    with pytest.raises(ProblemError, match="name: must be given, one of room, bare"):
        walls_of(height=2.0)
    with pytest.raises(ProblemError, match="border: must be given, as the file has no obs"):
        walls_of(name="bare", height=2.0)
    with pytest.raises(ProblemError, match="height: must be above 0 m"):
        walls_of(name="room", height=0.0)


def test_a_wall_around_a_hole_is_solid(tmp_path: Path) -> None:
    """The volume of the walls around a room is their area times their height, the room left out."""
    plan = {"room": {"walkable": [[1, 1], [5, 1], [5, 4], [1, 4]]}}
    (tmp_path / "plan.json").write_text(json.dumps(plan))
    table = WallsTable(file="plan.json", height=3.0, border=1.0, base=2.0)
    (mesh,) = table.meshes(tmp_path, level)
    assert mesh.is_solid
    assert (mesh.vertices[:, 2].min(), mesh.vertices[:, 2].max()) == (2.0, 5.0)
    a, b, c = np.moveaxis(mesh.corners, 1, 0)
    volume = float((a * np.cross(b, c)).sum() / 6)
    assert volume == pytest.approx((6 * 5 - 4 * 3) * 3)


# -- warnings -------------------------------------------------------------------------------


def with_actor(poses: list[tuple[float, float, float]], **changes: object) -> Problem:
    """The first two steps of a scene with a wall and a deck, with this actor alone."""
    problem = load_scene("bridge", 0)
    rows = np.array([(*pose, 0.0) for pose in poses])
    return problem.replace(horizon=1, actors=(Actor(poses=rows, **changes),))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("actor", "words"),
    [
        (with_actor([(5, 15, 0), (6, 15, 0)]), None),
        (with_actor([(15, 15, 0), (16, 15, 0)]), None),  # below the deck
        (with_actor([(15, 15, 7), (16, 15, 7)]), None),  # on it
        (with_actor([(5, 15, 0), (15, 5, 0)]), "is inside an obstacle at 1 of 2 steps; at step 1 "
         "their feet are 7 m below the top"),
        (with_actor([(15, 15, 5.5), (15, 15, 5.5)]), "is inside an obstacle at 2 of 2 steps"),
        (with_actor([(500, 1500, 0), (600, 1500, 0)]), "is off the map at 2 of 2 steps; at step 0 "
         r"at \(500, 1500\) m"),
        (with_actor([(5, 15, 0), (400, 15, 0)]), "moves by 395 m in one step: is the unit right"),
        (with_actor([(5, 15, 4), (6, 15, 4)]), "floats at 2 of 2 steps; at step 0 their feet are"),
        (with_actor([(5, 15, 0), (6, 15, 0)], shape=Cuboid(height=175.0)), "is 175 m high"),
    ],
)  # fmt: skip
def test_what_is_hardly_meant_is_said(actor: Problem, words: str | None) -> None:
    """People in walls, off the map, in the air, of a wrong size: in words; others not."""
    found = warnings(actor)
    if words is None:
        assert found == []
    else:
        assert len(found) >= 1
        import re

        assert any(re.match(rf"person 0 {words}", warning) for warning in found)


@pytest.mark.parametrize(
    ("size", "at", "words"),
    [
        ((2, 2, 2), (0, 0, 690), "is 682 m above the top of the map: is its altitude right?"),
        ((2, 2, 2000), (0, 0, 1000), "is 2000 m high: is its unit or height right?"),
        ((0.02, 0.02, 0.02), (0, 0, 1), "is no more than 0.02 m in size: is its unit right?"),
        ((20, 2, 60), (0, 0, 90), None),
    ],
)
def test_meshes_of_odd_sizes_are_doubted(
    size: tuple[float, float, float], at: tuple[float, float, float], words: str | None
) -> None:
    """Nothing built is so high, hangs so far above the map, or is so small."""
    problem = load_scene("bridge", 0)
    box = trimesh.creation.box(size)
    box.apply_translation((15, 15, 0))
    box.apply_translation(at)
    mesh = Mesh(vertices=np.array(box.vertices), triangles=np.array(box.faces))
    found = warnings(problem.replace(meshes=(*problem.meshes, mesh)))
    expected = [] if words is None else [f"meshes[1] {words}"]
    assert [warning for warning in found if warning.startswith("meshes[1]")] == expected


def test_vertices_that_no_triangle_has_are_no_part_of_a_mesh() -> None:
    """Files list vertices that they do not use; heights in warnings are those of triangles."""
    corners = np.array([[5, 5, 0], [6, 5, 0], [6, 6, 0], [5, 5, 5000]])
    mesh = Mesh(vertices=corners, triangles=np.array([[0, 1, 2]]))
    problem = load_scene("bridge", 0)
    found = warnings(problem.replace(meshes=(*problem.meshes, mesh)))
    below = (
        "meshes[1] is entirely below the ground: its top is at 0 m; is another axis up in its file?"
    )
    assert below in found
    assert not any("high: is its unit" in warning for warning in found)


@pytest.mark.parametrize("corners", [[0, 0, 1], [0, 1, 2]])
def test_a_mesh_of_lines_is_doubted(corners: list[int]) -> None:
    """Lines and points are no matter: nothing is there, and no drone or view minds."""
    line = np.array([[5, 5, 0], [6, 5, 0], [7, 5, 0]])
    bridge = load_scene("bridge", 0)
    lines = Mesh(vertices=line, triangles=np.array([corners]))
    problem = bridge.replace(meshes=(*bridge.meshes, lines))
    words = "meshes[1] has no triangle with an area, so it has no effect"
    assert [found for found in warnings(problem) if found.startswith("meshes[1]")] == [words]
    assert (problem.workspace.columns.high == bridge.workspace.columns.high).all()


def test_a_mesh_file_of_lines_is_refused(tmp_path: Path) -> None:
    """Corners that are in a line are as little as corners that are one."""
    (tmp_path / "line.obj").write_text("v 1 1 0\nv 2 1 0\nv 3 1 0\nf 1 2 3\n")
    scene = tmp_path / "scene.toml"
    scene.write_text('steps = 1\n[map]\nsize = [9, 9]\n[[mesh]]\nfile = "line.obj"\n')
    with pytest.raises(co.FileError, match=r"line\.obj: must contain at least one triangle with"):
        load_scene(str(scene), 0)


def test_a_scene_without_people_is_doubted() -> None:
    """A scene without people has J = 0, which raises a warning."""
    assert "no people" in warnings(load_scene("corridor", 0).replace(actors=()))[0]


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in SCENES if not name.startswith("tiny")])
def test_built_in_scenes_leave_no_warning(name: str) -> None:
    """Nobody is in a wall, off the map or of a wrong size; narrow ways are meant."""
    narrow = {
        "passage": "(8, 15)",
        "bottleneck": "(17, 14) or (17, 15)",
        "bottleneck-tight": "(16, 15)",
        "corridor-tight": "(8, 15)",
    }
    problem = load_scene(name, 1)
    assert warnings(problem) == []
    found = narrow_way(problem)
    assert bool(found) == (name in narrow)
    if found:
        assert f"drones must pass cell {narrow[name]} to reach " in found
        assert narrow_way(problem.without_rules()) == ""


# -- the bridge ---------------------------------------------------------------------------


@pytest.mark.long
def test_the_bridge_changes_the_plan() -> None:
    """With the deck as a column the best plan sees a third; as a mesh drones fly below it."""
    problem = load_scene("bridge", 0).replace(horizon=8)
    column = HeightMap(heights=problem.workspace.columns.high.max(axis=0))
    solid = problem.replace(meshes=(), height_map=column)
    best, filled = (EXACT["branch-and-price"](p, never) for p in (problem, solid))
    assert best.plan is not None
    below = [s for path in best.plan.paths for s in path if 12 <= s.x < 19 and s.layer == 0]
    assert below
    assert filled.bound < 0.7 * best.value


def test_a_mesh_survives_a_file(tmp_path: Path) -> None:
    """Scene files keep meshes and datum, bit for bit."""
    from cocap_opt.files.documents import SceneFile, problem_digest

    problem = load_scene("bridge", 2)
    heights = problem.height_map
    problem = problem.replace(height_map=heights.replace(datum=heights.heights / 3))
    SceneFile(problem=problem).save(tmp_path / "scene.json")
    again = SceneFile.read(tmp_path / "scene.json").problem
    assert problem_digest(again) == problem_digest(problem)
    assert isinstance(again.meshes[0], Mesh)
    np.testing.assert_array_equal(again.meshes[0].vertices, problem.meshes[0].vertices)
    np.testing.assert_array_equal(again.height_map.datum, problem.height_map.datum)
    moved = problem.meshes[0].replace(vertices=problem.meshes[0].vertices + 1e-9)
    assert problem_digest(problem.replace(meshes=(moved,))) != problem_digest(problem)


@examples(8)
@given(
    near=st.floats(0.0, 12.0),
    at=st.tuples(st.floats(-2, 27), st.floats(-2, 27)),
    walls=st.lists(st.tuples(st.integers(0, 24), st.integers(0, 24)), max_size=60),
)
def test_drones_near_people_may_start_where_all_others_may(
    near: float, at: tuple[float, float], walls: list[tuple[int, int]]
) -> None:
    """Those cells of all from which somebody can be met that are near, courtyards or not."""
    heights = np.zeros((25, 25))
    heights[7:13, 7:13], heights[8:12, 8:12] = 20.0, 0.0
    heights[tuple(np.array(walls, dtype=int).reshape(-1, 2).T)] = 20.0
    workspace = Workspace(HeightMap(heights=heights))
    actors = (standing(*at, 0.0, 0.0, steps=3),)
    around = Surroundings(workspace, actors, 3, NO_RULES, Airspace())
    some, every = DronesTable(count=1, near=near), DronesTable(count=1)
    starts = [
        {(s.x, s.y) for s in table._candidates(around, np.random.default_rng(0))}
        for table in (some, every)
    ]
    middles = {(x, y): np.hypot(x + 0.5 - at[0], y + 0.5 - at[1]) for x, y in starts[1]}
    assert starts[0] == {cell for cell, far in middles.items() if far <= near}


@pytest.mark.slow
def test_random_drones_start_where_they_can_meet_somebody(tmp_path: Path) -> None:
    """None starts in a courtyard that walls shut in, whatever the seed."""
    rows = [["0"] * 20 for _ in range(20)]
    for x in range(7, 13):
        for y in range(7, 13):
            rows[y][x] = "0" if 8 <= x < 12 and 8 <= y < 12 else "20"
    (tmp_path / "map.asc").write_text(
        "ncols 20\nnrows 20\nxllcorner 0\nyllcorner 0\ncellsize 1\n"
        + "\n".join(" ".join(row) for row in rows)
    )
    (tmp_path / "yard.toml").write_text(
        'steps = 8\nstep = 1.0\n[map]\nfile = "map.asc"\nheights = "above-ground"\n'
        "[[walk]]\npoints = [[10, 4], [11, 4]]\nspeed = 0.1\n[[drones]]\ncount = 6\n"
    )
    for seed in range(12):
        problem = load_scene(str(tmp_path / "yard.toml"), seed)
        inside = [r for r in problem.robots if 8 <= r.start.x < 12 and 8 <= r.start.y < 12]
        assert inside == []


def test_views_come_first_where_a_recipe_says_so(tmp_path: Path) -> None:
    """The word stands for a number, by which one drone that sees a person outweighs all pixels."""
    short, table = (
        read(write(tmp_path, f"objective.views = {words}\n{FLAT}{DRONE}"))
        for words in ("'first'", "{ cameras = 2, weight = 'first', share = 0.9 }")
    )
    views = table.objective.views
    assert views is not None and views.share == 0.9
    assert short.objective.views == views.replace(share=None)
    assert problem_digest(short) == problem_digest(table)
    expected = co.with_views(short, weight="first").objective.views
    assert expected is not None and views.weights(1) == (expected.weight,)
    less = DRONE.replace("speed = 1.5", "speed = 1.5\nviews_weight = 0.01")
    less = FLAT.replace("speed = 1.5", "speed = 1.5\nviews_weight = 0.01") + less
    found = read(write(tmp_path, f"objective.views = 'first'\n{less}")).objective.views
    assert found is not None and found.weights(1) == views.weights(1)  # none outweighs others less
