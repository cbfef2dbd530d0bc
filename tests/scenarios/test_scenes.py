"""Built-in scenes, and loading scenes and plans by name or file."""

import math
import subprocess
import sys
from functools import cache
from importlib import import_module
from itertools import permutations
from pathlib import Path
from statistics import median
from typing import Any

import networkx as nx
import numpy as np
import pytest
from brute_force import optimum
from scene_files import SMALL_SEQUENCE

from cocap_opt.data import FloatArray, ProblemError
from cocap_opt.files.documents import FileError, SceneFile, problem_digest
from cocap_opt.formulations import BOUNDS
from cocap_opt.planners import PLANNERS
from cocap_opt.problem import NO_RULES, Actor, Camera, CollisionRules, Cuboid, Motion, Plan, Problem
from cocap_opt.referee import check
from cocap_opt.scenarios import FORMATS, SCENES, load_scene, read_foreign_plan, scene_of_plan
from cocap_opt.scenarios.built_in.field import field
from cocap_opt.scenarios.built_in.tiny import SCENES as TINY
from cocap_opt.scenarios.built_in.tiny import TINY_OPTIMA
from cocap_opt.stop import never

# Robots, actors, steps.
SIZES = {"corridor": (2, 2, 8), "bottleneck": (4, 4, 11), "passage": (8, 4, 12)}
LARGE = ["corridor", "corridor-tight", "bottleneck", "bottleneck-tight", "passage"]
# Robots, actors, cells, steps, radius.
FIELDS = {
    "field": (6, 6, 30, 20, 1),
    "field-long": (6, 6, 30, 60, 2),
    "field-large": (64, 32, 64, 40, 1),
}
SMALLEST_FIELD, FULL_FIELD, LARGEST_FIELD = (2, 1, 15, 8, 1), (28, 2, 15, 8, 0), (64, 32, 96, 80, 3)
# With seeds; those that take long to build with one only.
MADE_FIELDS = [
    *[
        (seed, sizes)
        for sizes in (SMALLEST_FIELD, FULL_FIELD, FIELDS["field"])
        for seed in range(3)
    ],
    (0, FIELDS["field-long"]),
    *[
        pytest.param(0, sizes, marks=pytest.mark.slow)
        for sizes in (FIELDS["field-large"], LARGEST_FIELD)
    ],
]
SEEDS = range(12)

SCENARIO = "version 1\n" + 4 * "0\ttiny.map\t2\t2\t{}\t0\t1\t1\t1\n"
MAP = "type octile\nheight 2\nwidth 2\nmap\n..\n..\n"


@cache
def scene(name: str, seed: int) -> Problem:
    """A scene made once: planners keep the compiled model with it."""
    return SCENES[name](seed)


def value(planner: str, problem: Problem) -> float:
    """J of a planner's plan."""
    return PLANNERS[planner](problem, never).value


def ground(actor: Actor, t: int) -> FloatArray:
    """Points [n, 2] spread over the ground that an actor's box covers, up to its rim."""
    x, y, _, yaw = actor.poses[t]
    assert isinstance(actor.shape, Cuboid)
    along, across = np.meshgrid(
        (0.5 - 1e-9) * actor.shape.length * np.linspace(-1, 1, 9),
        (0.5 - 1e-9) * actor.shape.width * np.linspace(-1, 1, 9),
    )
    c, s = np.cos(yaw), np.sin(yaw)
    points = np.stack([x + c * along - s * across, y + s * along + c * across], axis=-1)
    return points.reshape(-1, 2)


# --- corridor, bottleneck and passage: geometry ----------------------------------------------


@pytest.mark.parametrize("name", LARGE)
def test_size_camera_and_motion_are_those_of_the_paper(name: str) -> None:
    """30 x 30 cells of 1 m, 8 headings at 5 m, 2500/4000x3000 px tilted by 10 degrees."""
    problem = scene(name, 0)
    sizes = len(problem.robots), len(problem.actors), problem.horizon
    assert sizes == SIZES[name.removesuffix("-tight")]
    assert problem.name == name
    assert problem.height_map.shape == (30, 30)
    assert problem.height_map.resolution == 1.0
    assert problem.rules == CollisionRules()
    for robot in problem.robots:
        assert robot.motion == Motion(headings=8, layers=(5.0,))
        assert robot.camera == Camera(
            focal=2500, width=4000, height=3000, tilts=(math.radians(10),)
        )


@pytest.mark.parametrize("name", LARGE)
@pytest.mark.parametrize("seed", SEEDS)
def test_robots_start_apart_and_outside_the_passage(name: str, seed: int) -> None:
    """No two drones start in one cell, and none in the passage or in a wall."""
    problem = scene(name, seed)
    cells = [(robot.start.x, robot.start.y) for robot in problem.robots]
    assert len(set(cells)) == len(cells)
    mouth = {"corridor": 9, "bottleneck": 18, "passage": 9}[name.removesuffix("-tight")]
    assert all(x < mouth and problem.height_map.heights[x, y] == 0 for x, y in cells)


@pytest.mark.parametrize("name", LARGE)
@pytest.mark.parametrize("seed", SEEDS)
def test_actors_walk_on_free_ground(name: str, seed: int) -> None:
    """Boxes touch no wall and no other box; people walk up to 1.4 m a step, looking ahead."""
    problem = scene(name, seed)
    for actor in problem.actors:
        assert actor.shape == Cuboid()
        x, y, z, yaw = actor.poses.T
        steps = np.hypot(np.diff(x), np.diff(y))
        assert not z.any()
        assert (steps > 0.5).all()
        assert (steps <= 1.4).all()
        # Half of a step may lie on either side of a bend.
        ahead = np.arctan2(np.diff(y), np.diff(x))
        between = np.minimum(yaw[:-1], yaw[1:]), np.maximum(yaw[:-1], yaw[1:])
        assert ((between[0] - 1e-9 <= ahead) & (ahead <= between[1] + 1e-9)).all()
    for t in range(problem.horizon + 1):
        for actor, other in permutations(problem.actors, 2):
            points = ground(actor, t)
            cells = [problem.height_map.cell_of(x, y) for x, y in points.tolist()]
            assert all(problem.height_map.heights[cell] == 0 for cell in cells)
            c, s = np.cos(other.poses[t, 3]), np.sin(other.poses[t, 3])
            relative = points - other.poses[t, :2]
            turned = relative @ np.array([[c, -s], [s, c]])
            assert (np.abs(turned) > 0.5 - 1e-6).any(axis=1).all()


def test_corridor_actors_walk_through_in_the_same_direction() -> None:
    """At step 0 the last actor is before the passage, at the end the first is beyond it."""
    for name in ("corridor", "corridor-tight", "passage"):
        problem = scene(name, 0)
        along = np.array([actor.poses[:, 0] for actor in problem.actors])
        assert along[:, 0].min() < 9
        assert along[:, -1].max() > 16
        assert all((actor.poses[:, 3] == 0).all() for actor in problem.actors)


@pytest.mark.parametrize("name", ["bottleneck", "bottleneck-tight"])
def test_bottleneck_actors_come_from_three_sides_and_cross(name: str) -> None:
    """One walks south and one north, each to the other's side of the exit, two walk east."""
    west, north, south, behind = (actor.poses for actor in scene(name, 0).actors)
    assert north[0, 1] > 16 > 15 > south[0, 1]
    assert north[0, 3] < 0 < south[0, 3]
    assert behind[0, 0] < 11 < west[0, 0]
    assert not west[:, 3].any()
    assert not behind[:, 3].any()


@pytest.mark.parametrize("name", LARGE)
def test_seeds_make_different_scenes(name: str) -> None:
    """Each seed gives a scene of its own, always the same."""
    digests = {problem_digest(SCENES[name](seed)) for seed in SEEDS}
    assert len(digests) == len(SEEDS)
    assert problem_digest(SCENES[name](0)) in digests


@pytest.mark.long
def test_scenes_are_the_same_in_every_process() -> None:
    """Nothing depends on the process, and listing scenes loads no reader of files."""
    code = (
        "import sys\n"
        "from cocap_opt.files.documents import problem_digest\n"
        "from cocap_opt.scenarios import FORMATS, SCENES\n"
        "assert any(kind.options.allowed for kind in FORMATS.values())\n"
        "assert not {'yaml', 'rasterio', 'shapely'} & set(sys.modules)\n"
        "assert 'cocap_opt.scenarios.meshes' not in sys.modules\n"
        "print(*(problem_digest(build(3)) for build in SCENES.values()))"
    )
    run = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert run.stdout.split() == [problem_digest(build(3)) for build in SCENES.values()]


# --- corridor, bottleneck and passage: how hard they are -------------------------------------


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "least"),
    [
        ("corridor", 1 / 3),
        ("corridor-tight", 0.7),
        ("bottleneck", 1 / 3),
        ("bottleneck-tight", 0.7),
    ],
)
def test_unconstrained_plans_collide(name: str, least: float) -> None:
    """The greedy plan collides in a third of the seeds, in the tight variants in most of them.

    What collides is worth seeing: all the time at least one face is in view.
    """
    collisions = 0
    for seed in SEEDS:
        problem = scene(name, seed)
        plan = PLANNERS["greedy"](problem, never).plan
        assert plan is not None
        collisions += next(plan.conflicts(problem), None) is not None
        if seed < 5:
            late = check(problem, plan).reward_per_step[problem.horizon // 2 :]
            assert min(late) > 0
    assert collisions / len(SEEDS) >= least


@pytest.mark.slow
@pytest.mark.parametrize("seed", [9, 18])
def test_collision_rules_cost_the_optimum_of_two_robots(seed: int) -> None:
    """In the tight corridor the proved optimum is more than 1 % below the one without rules."""
    problem = scene("corridor-tight", seed)
    free = problem.replace(rules=NO_RULES)
    assert value("joint", problem) < 0.99 * value("joint", free)


@pytest.mark.slow
def test_collision_rules_cost_the_optimum_of_four_robots() -> None:
    """In the tight bottleneck some plan that ignores the rules is above the bound with them."""
    problem = scene("bottleneck-tight", 8).replace(horizon=5)
    bound = BOUNDS["column-generation"](problem).bound
    assert bound < 0.998 * value("greedy-rounds", problem.replace(rules=NO_RULES))


@pytest.mark.slow
def test_sequential_planning_loses_to_cocap_and_cocap_to_the_optimum() -> None:
    """Neither planner is always as good as the next better one."""
    problem = scene("corridor", 9)
    assert value("sequential", problem) < 0.99 * value("cocap", problem)
    problem = scene("corridor", 4)
    assert value("cocap", problem) < 0.99 * value("joint", problem)


@pytest.mark.slow
def test_cocap_needs_few_nodes_in_the_bottleneck() -> None:
    """In the median CoCap plans single robots less than three times as often as sequential."""
    generated = [
        PLANNERS["cocap"](scene("bottleneck", seed), never).statistics["generated"]
        for seed in range(10)
    ]
    robots = 4
    assert robots + median(generated) - 1 < 3 * robots
    assert max(generated) > 1


@pytest.mark.slow
def test_planning_one_by_one_loses_in_the_passage() -> None:
    """Greedy collides more than once per robot, and sequential is a tenth below CoCap.

    CoCap does not finish soon with all seeds.
    """
    problem = scene("passage", 8)
    greedy = PLANNERS["greedy"](problem, never).plan
    assert greedy is not None
    assert len(list(greedy.conflicts(problem))) > len(problem.robots)
    assert value("sequential", problem) < 0.9 * value("cocap", problem)


# --- field ----------------------------------------------------------------------------------


Sizes = tuple[int, int, int, int, int]


@cache
def made_field(seed: int, sizes: Sizes) -> Problem:
    """A field made once."""
    return field(seed, *sizes)


@pytest.mark.parametrize(("seed", "sizes"), MADE_FIELDS)
def test_field_is_as_large_as_asked_and_an_eighth_of_it_blocked(seed: int, sizes: Sizes) -> None:
    """Numbers are those of the parameters; cells are of 1 m, blocks twice the flight height."""
    problem = made_field(seed, sizes)
    robots, actors, cells, steps, radius = sizes
    assert (len(problem.robots), len(problem.actors), problem.horizon) == (robots, actors, steps)
    assert problem.height_map.shape == (cells, cells)
    assert problem.height_map.resolution == 1.0
    assert problem.rules == CollisionRules()
    assert {robot.motion for robot in problem.robots} == {Motion(radius=radius)}
    assert {robot.camera for robot in problem.robots} == {Camera()}
    assert set(problem.height_map.heights.ravel().tolist()) == {0.0, 10.0}
    assert 0.1 <= (problem.height_map.heights > 0).mean() <= 0.15


@pytest.mark.slow
@pytest.mark.parametrize("name", FIELDS)
def test_named_fields_have_their_sizes(name: str) -> None:
    """They are fields like any other, but for the name."""
    problem = scene(name, 0)
    assert problem.name == name
    assert problem_digest(problem) == problem_digest(made_field(0, FIELDS[name]))


@pytest.mark.parametrize(("seed", "sizes"), MADE_FIELDS)
def test_field_is_connected(seed: int, sizes: Sizes) -> None:
    """From each free cell straight moves over free cells lead to every other one."""
    heights = made_field(seed, sizes).height_map.heights
    free = nx.grid_2d_graph(*heights.shape)
    free.remove_nodes_from(map(tuple, np.argwhere(heights > 0).tolist()))
    assert nx.is_connected(free)


@pytest.mark.parametrize(("seed", "sizes"), MADE_FIELDS)
def test_field_robots_start_apart_and_near_the_actors(seed: int, sizes: Sizes) -> None:
    """No two in one cell, none in a wall, none more than 4 m along x or y from all people."""
    problem = made_field(seed, sizes)
    cells = [(robot.start.x, robot.start.y) for robot in problem.robots]
    assert len(set(cells)) == len(cells)
    assert all(problem.height_map.heights[cell] == 0 for cell in cells)
    people = np.array([actor.poses[0, :2] for actor in problem.actors])
    offsets = np.abs(np.array(cells)[:, None] + 0.5 - people)
    assert offsets.max(axis=2).min(axis=1).max() <= 4


def test_field_robots_start_farther_off_where_there_are_many() -> None:
    """112 drones find no room within 4 m of one person, but within a few more."""
    problem = field(0, robots=112, actors=1, cells=30, steps=1)
    x, y = problem.actors[0].poses[0, :2]
    offsets = [
        max(abs(robot.start.x + 0.5 - x), abs(robot.start.y + 0.5 - y)) for robot in problem.robots
    ]
    assert 4 < max(offsets) < 12


@pytest.mark.parametrize(("seed", "sizes"), MADE_FIELDS)
def test_field_actors_walk_on_free_ground_and_stay_apart(seed: int, sizes: Sizes) -> None:
    """Boxes touch no wall and no other box; people walk on at about 1 m a step."""
    problem = made_field(seed, sizes)
    for actor in problem.actors:
        covered = np.concatenate([ground(actor, t) for t in range(problem.horizon + 1)])
        x, y = np.floor(covered).astype(int).T
        assert min(x.min(), y.min()) >= 0
        assert not problem.height_map.heights[x, y].any()
        assert not actor.poses[:, 2].any()
        steps = np.hypot(*np.diff(actor.poses[:, :2], axis=0).T)
        assert steps.max() <= 1.1 + 1e-9
        assert steps.mean() > 0.8  # less than the pace where the way bends between two steps
    places = np.array([actor.poses[:, :2] for actor in problem.actors])
    for place, others in ((places[j], places[:j]) for j in range(1, len(places))):
        apart = np.hypot(*np.moveaxis(others - place, -1, 0))
        assert apart.min() > math.sqrt(2)  # half the diagonals of two boxes


@pytest.mark.slow
def test_field_seeds_make_different_fields_always_the_same() -> None:
    """Each seed gives blocks, ways and starts of its own."""
    sizes = SMALLEST_FIELD
    problems = [made_field(seed, sizes) for seed in range(10)]
    digests = [problem_digest(problem) for problem in problems]
    assert len(set(digests)) == len(digests)
    assert len({problem.height_map.heights.tobytes() for problem in problems}) == len(problems)
    assert [problem_digest(field(seed, *sizes)) for seed in range(10)] == digests


@pytest.mark.parametrize("seed", range(2))
def test_field_drones_compete_for_the_same_people(seed: int) -> None:
    """A team sees far less than its drones alone would see together, but people all the time."""
    problem = field(seed, robots=3, actors=2, cells=16, steps=6)
    plan = PLANNERS["sequential"](problem, never).plan
    assert plan is not None
    verdict = check(problem, plan)
    alone = [value("sequential", problem.replace(robots=(robot,))) for robot in problem.robots]
    assert verdict.reward < 0.8 * sum(alone)
    assert min(verdict.reward_per_step[1:]) > 0


@pytest.mark.parametrize(
    ("name", "wrong"),
    [
        *[("seed", -1), ("seed", 0.5), ("robots", 0), ("robots", 113), ("robots", 2.0)],
        *[("actors", 0), ("actors", 10), ("actors", True), ("cells", 14), ("cells", 257)],
        *[("steps", 0), ("steps", 1001), ("steps", "8"), ("radius", -1), ("radius", 17)],
        *[("radius", 1.5)],
    ],
)
def test_field_refuses_what_is_out_of_range(name: str, wrong: object) -> None:
    """The message starts with the parameter's name, on one line."""
    sizes: dict[str, Any] = {"seed": 0, "robots": 6, "actors": 6, "cells": 30, "steps": 20}
    with pytest.raises(ProblemError, match=f"^{name}: must be ") as caught:
        field(**sizes | {name: wrong})
    assert "\n" not in str(caught.value)


# --- tiny scenes ----------------------------------------------------------------------------


@pytest.mark.parametrize("name", TINY)
def test_tiny_optimum_worked_out_by_hand(name: str) -> None:
    """Enumeration, joint value iteration and the referee agree with the value found by hand."""
    problem, expected = SCENES[name](0), pytest.approx(TINY_OPTIMA[name], rel=1e-12, abs=1e-12)
    assert problem.name == name
    assert optimum(problem).value == expected
    result = PLANNERS["joint"](problem, never)
    assert result.value == expected
    assert result.bound == expected or result.plan is None
    if result.plan is not None:
        verdict = check(problem, result.plan)
        assert verdict.valid
        assert verdict.reward == expected


def test_every_tiny_scene_has_its_optimum() -> None:
    """The table of optima names the tiny scenes and no others."""
    assert list(TINY_OPTIMA) == list(TINY) == [name for name in SCENES if name.startswith("tiny")]


@pytest.mark.parametrize(
    ("name", "planner", "expected"),
    [
        ("tiny-trap", "greedy", 15 * math.sqrt(2)),
        ("tiny-queue", "greedy", 3 * math.sqrt(41) + 15 * math.sqrt(2)),
        ("tiny-doorway", "greedy", 12 + 3 * math.sqrt(41) + 15 * math.sqrt(2)),
        ("tiny-doorway", "cocap", 12 + 6 * math.sqrt(41)),
        ("tiny-give-way", "greedy", 4.0),
        ("tiny-give-way", "sequential", -math.inf),
    ],
)
def test_tiny_values_of_simple_planners(name: str, planner: str, expected: float) -> None:
    """Plans made one by one, or without rules, have the values that the docstrings state."""
    assert value(planner, SCENES[name](0)) == pytest.approx(expected)


# --- loading --------------------------------------------------------------------------------


@pytest.fixture
def files(tmp_path: Path) -> Path:
    """A folder with a scene in each format."""
    np.save(tmp_path / "map.npy", np.zeros((4, 4)))
    (tmp_path / "seq.yaml").write_text(SMALL_SEQUENCE)
    (tmp_path / "tiny.map").write_text(MAP)
    (tmp_path / "tiny.scen").write_text(SCENARIO.format(0, 1, 0, 1))
    SceneFile(problem=SCENES["tiny-share"](0)).save(tmp_path / "own.json")
    return tmp_path


def test_a_scene_is_loaded_by_name() -> None:
    """The name of a built-in scene and a seed give that scene."""
    assert problem_digest(load_scene("corridor", 4)) == problem_digest(scene("corridor", 4))


def test_a_scene_is_loaded_from_each_format(files: Path) -> None:
    """The suffix says the format; a folder stands for the seq.yaml in it."""
    assert load_scene(str(files / "own.json")).name == "tiny-share"
    assert load_scene(str(files / "tiny.scen"), 1).name == "tiny"
    assert load_scene(str(files / "seq.yaml")).name == files.name
    assert load_scene(str(files)).name == files.name


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("corridoor", ["corridoor", "no such scene", "bottleneck-tight"]),
        ("gone.json", ["gone.json: no such file"]),
        ("x" * 5000, ["no such scene"]),
        ("map.npy", ["map.npy", "is not a scene, but a NumPy array"]),
        ("empty", ["empty", "seq.yaml"]),
        ("bad.json", ["bad.json"]),
        ("bad.yaml", ["bad.yaml"]),
        ("bad.scen", ["bad.scen", "version 1"]),
        ("far.yaml", ["far.yaml", "robots[0].start"]),
    ],
)
def test_what_cannot_be_loaded_is_said_in_one_line(
    files: Path, monkeypatch: pytest.MonkeyPatch, name: str, words: list[str]
) -> None:
    """One line names the file, and its fault or the allowed ones."""
    (files / "empty").mkdir()
    for suffix in ("json", "yaml", "scen"):
        (files / f"bad.{suffix}").write_text("{ [\n")
    (files / "far.yaml").write_text(SMALL_SEQUENCE.replace("[1.5, 0, 5, 0]", "[9.5, 0, 5, 0]"))
    monkeypatch.chdir(files)
    with pytest.raises(FileError) as caught:
        load_scene(name)
    assert "\n" not in str(caught.value)
    assert all(word in str(caught.value) for word in words), caught.value


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("plan.json", '{"type": "FeatureCollection", "features": []}', "is GeoJSON, .* [[walls]]"),
        ("plan.geojson", '{"type": "Point"}', "is not a scene; it may be walls, for [[walls]]"),
        (
            "plan.json",
            "POLYGON ((0 0, 1 0, 1 1, 0 0))",
            "is WKT, which is not a scene: .* [[wa",
        ),
        ("plan.wkt", "POLYGON ((0 0, 1 0, 1 1, 0 0))", "is not a scene; it may be walls"),
        ("city.json", '{"type": "CityJSON", "version": "2.0"}', "is CityJSON, .* to .obj"),
        ("geometry.json", '{"a": {"walkable": []}}', "is a ground plan in JSON, .* [[walls]]"),
        ("empty.json", " \n", "is empty"),
        ("empty.toml", "", "is empty"),
        ("other.json", "[1]", "is JSON, but not a scene: .* `cocap-opt export`"),
        ("other.json", '{"x": 1}', "is JSON, but not a scene"),
        (
            "people.sqlite",
            "SQLite format 3\0",
            "is not a scene, but an SQLite database; .* peop",
        ),
        ("people.json", "SQLite format 3\0", r"is an SQLite database; .* people, under"),
        ("scene.json", '{"format": "cocap-opt scene", "x": NaN}', "finite numbers only, not NaN"),
        ("scene.json", '{"format": -Infinity}', "must hold finite numbers only, not -Infinity"),
        ("scene.json", '{"format": "cocap-opt sc', "ends before its JSON is complete"),
    ],
)
def test_parts_and_ruins_of_scenes_are_named(
    tmp_path: Path, name: str, content: str, words: str
) -> None:
    """One line says what the file is, and where it belongs."""
    (tmp_path / name).write_text(content)
    pattern = words.replace("[", r"\[").replace("]", r"\]")
    with pytest.raises(FileError, match=rf"^{tmp_path / name}: .*{pattern}") as error:
        load_scene(str(tmp_path / name))
    assert "\n" not in str(error.value)


def test_words_that_are_not_known_are_told_with_those_that_are(tmp_path: Path) -> None:
    """A scene file's words, such as the kind of a shape, are listed."""
    path = tmp_path / "scene.json"
    SceneFile(problem=load_scene("tiny-approach")).save(path)
    text = path.read_text()
    kind = next(kind for kind in ("cuboid", "prism") if f'"type": "{kind}"' in text)
    path.write_text(text.replace(f'"type": "{kind}"', '"type": "ball"'))
    words = r"problem\.actors\[0\]\.shape\.type: must be one of cuboid, prism, triangulated-cuboid"
    with pytest.raises(FileError, match=words):
        load_scene(str(path))


def test_a_seed_is_not_negative() -> None:
    """The message names the field, for built-in scenes as for files."""
    with pytest.raises(FileError, match=r"^seed: must be >= 0, not -1$"):
        load_scene("corridor", -1)


def test_a_plan_is_read_in_the_format_of_its_scene(files: Path) -> None:
    """A CSV file holds paths of Greedy Perspectives; other names are not foreign plans."""
    problem = load_scene(str(files))
    header = "robot,t,x_cell,y_cell,heading_idx\n"
    (files / "peer_paths.csv").write_text(f"{header}0,0,1,0,0\n0,1,2,1,0\n")
    plan = read_foreign_plan(files / "peer_paths.csv", problem)
    assert isinstance(plan, Plan)
    assert check(problem, plan).valid
    assert read_foreign_plan(files / "plan.json", problem) is None
    (files / "peer_paths.csv").write_text(header)
    with pytest.raises(FileError, match=r"peer_paths\.csv: robot 0: must have a row") as caught:
        read_foreign_plan(files / "peer_paths.csv", problem)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", FORMATS)
def test_every_format_has_a_reader(name: str, tmp_path: Path) -> None:
    """A reader is a module with `read`, and `read_plan` where plans are read; errors are one line.

    Options that choose the file's own starts are options of the format.
    """
    kind = FORMATS[name]
    reader = import_module(f"cocap_opt.scenarios.{kind.reader}")
    assert callable(reader.read)
    assert bool(kind.plans.suffixes) == hasattr(reader, "read_plan")
    for option, word in (kind.own_starts or {}).items():
        assert word in kind.options.allowed[option]
    damaged = tmp_path / f"scene{kind.scenes.suffixes[0]}"
    damaged.write_bytes(b"{[\0" + b"".join(kind.scenes.words))
    with pytest.raises((ProblemError, FileError), match=r"^.*scene\.\w+: ") as caught:
        kind.read(damaged, 0)
    assert "\n" not in str(caught.value)


def test_formats_are_told_apart_by_suffix() -> None:
    """No file name belongs to two formats."""
    for suffix in ("json", "yaml", "yml", "scen", "YAML"):
        assert sum(kind.scenes.has(Path(f"scene.{suffix}")) for kind in FORMATS.values()) == 1


def test_a_foreign_plan_finds_the_starts_it_was_made_for(tmp_path: Path) -> None:
    """Plans of others name no start set: it is the seed's, or the one in the scene's own file."""
    (tmp_path / "seq.yaml").write_text(SMALL_SEQUENCE)
    np.save(tmp_path / "map.npy", np.zeros((4, 4)))
    (tmp_path / "starts.csv").write_text("x,y,z,theta\n3,3,5,0\n")
    (tmp_path / "paths.csv").write_text("robot,t,x_cell,y_cell,heading_idx\n0,0,1,0,0\n0,1,1,1,0\n")
    name = str(tmp_path / "seq.yaml")
    problem = load_scene(name, 0)
    assert problem.robots[0].start[:2] == (3, 3)
    plan = read_foreign_plan(tmp_path / "paths.csv", problem)
    assert plan is not None
    found = scene_of_plan(name, problem, plan)
    assert found.robots[0].start == plan.paths[0][0]
    assert check(found, plan).valid
    elsewhere = Plan(paths=((plan.paths[0][1],) * 2,))
    assert scene_of_plan(name, problem, elsewhere) is problem
