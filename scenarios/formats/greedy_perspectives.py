"""Reader of the scenes (`seq.yaml`) and paths of Greedy Perspectives.

Source of the format and of its meaning: Suresh et al., "Greedy Perspectives", 2024 (arXiv
2310.10863), repository GreedyPerspectives/GreedyPerspectives, `res/experiments`, and the behaviour
of its planner. Differences of notation are translated:

========================  =====================================  ==============================
what                      there                                  here
========================  =====================================  ==============================
heading index 0           looks along +y                         looks along +x
camera tilt               angle from straight down               angle below the horizon
horizon                   H rows                                 T = H - 1 moves
actor                     box of 1 x 1 x 2.5 m, whatever the     the same
                          file says
========================  =====================================  ==============================

Both count headings counter-clockwise. Options choose between two interpretations of faces, start,
tilts, rules, corners and start set, see `Conventions`. Their planner's bonus for moves with dx + dy
= 0 is not part of the reward that they report; here it is part of the objective only with the
option `bonus`. `action_space`, `stepSize`, every `geometry` and `map.pose` are in the files, but
their planner never uses them, and they are not read here.
"""

import math
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import msgspec
import numpy as np
import yaml
from msgspec import Meta
from yamlcore import CoreLoader

from cocap_opt.data import FloatArray, ProblemError
from cocap_opt.files.messages import in_words
from cocap_opt.problem import (
    Actor,
    Camera,
    Cuboid,
    Motion,
    Objective,
    Problem,
    Robot,
    State,
    TriangulatedCuboid,
)
from cocap_opt.scenarios.formats import NOTHING
from cocap_opt.scenarios.formats.conventions import Conventions
from cocap_opt.scenarios.kinds import JSON, NUMPY, require
from cocap_opt.scenarios.text import integer, naming, number, read_table, read_text
from cocap_opt.world.workspace import HeightMap

_CANNOT = "cannot be read as"
_MOST_CELLS = 100_000_000  # cells of a map
BONUS = 100.0  # their planner adds this for each move with dx + dy = 0

# msgspec has no constraint "finite"; a million kilometres serves as the limit.
Coordinate = Annotated[float, Meta(ge=-1e9, le=1e9)]
Length = Annotated[float, Meta(ge=1e-3, le=1e9)]
Count = Annotated[int, Meta(ge=1, le=10**9)]


class _Pose(NamedTuple):
    """Start pose of a robot, as in the files: metres, and radians from +y, counter-clockwise."""

    x: Coordinate
    y: Coordinate
    z: Coordinate
    theta: Coordinate


class _Camera(msgspec.Struct):
    intrinsics: tuple[Length, Count, Count]  # focal length, width, height, px
    tilt: Annotated[float, Meta(ge=0, le=math.pi)]  # rad from straight down


class _Agent(msgspec.Struct):
    start: _Pose = msgspec.field(name="startPose")
    camera: _Camera


class _AgentItem(msgspec.Struct):
    agent: _Agent


class _Actor(msgspec.Struct):
    trajectory: list[tuple[Coordinate, Coordinate, Coordinate]]  # x, y (m), yaw (rad)


class _ActorItem(msgspec.Struct):
    actor: _Actor


class _Time(msgspec.Struct):
    horizon: Annotated[int, Meta(ge=2)]  # number of rows: one more than moves


class _Resolution(msgspec.Struct):
    # a multiple of 4, so that +x is one of the headings
    heading: Annotated[int, Meta(ge=4, le=360, multiple_of=4)]


class _Map(msgspec.Struct):
    file: str
    cell: Length = msgspec.field(name="gridSize")  # m


class _World(msgspec.Struct):
    time: _Time
    state_resolution: _Resolution
    map: _Map
    actors: list[_ActorItem]
    agents: Annotated[list[_AgentItem], Meta(min_length=1)]


class _Planner(msgspec.Struct):
    world: _World


class _Sequence(msgspec.Struct):
    """A whole `seq.yaml`; the fields are the parts that their planner uses."""

    planner: _Planner


def read(path: Path, seed: int = 0, options: Mapping[str, str] = NOTHING) -> Problem:
    """Reads a scene; its map and `starts.csv`, if there is one, must be beside the file.

    Parameters
    ----------
    path
        The scene's `seq.yaml`.
    seed
        Number of the start set: rows seed * R .. seed * R + R - 1 of `starts.csv` for R robots. It
        has no effect if the file's own start poses are used.
    options
        Options that choose how the scene is interpreted, see `Conventions`; by default, it is
        interpreted as in their program.

    Raises
    ------
    ProblemError
        If a file cannot be read or contains something that is not allowed (the message is one line
        that names the file), or if an option is not allowed.
    """
    conventions = Conventions.of(options)
    with naming(path):
        world = _world(read_text(path, (JSON,)))
        shape = TriangulatedCuboid if conventions.triangles else Cuboid
        actors = _actors(world, shape(height=2.5))
        cameras = _cameras(world, conventions)
        headings = world.state_resolution.heading
        motion = Motion(headings=headings, corner_cutting=conventions.corner_cutting)
        map_file = _map_file(path, world.map.file)
    with naming(map_file):
        height_map = HeightMap(heights=_heights(map_file), resolution=world.map.cell)
    source, poses = _starts(path, world, seed, conventions)
    # Only start poses can still be wrong, so errors name the file that contains them.
    with naming(source):
        return Problem(
            name=path.resolve().parent.name,
            height_map=height_map,
            robots=tuple(
                _robot(pose, camera, motion, height_map)
                for pose, camera in zip(poses, cameras, strict=True)
            ),
            actors=actors,
            horizon=world.time.horizon - 1,
            rules=conventions.rules,
            objective=Objective(
                count_start=conventions.count_start, balanced=BONUS if conventions.bonus else 0.0
            ),
        )


def parts(path: Path) -> list[Path]:
    """Returns the table of start sets, without the map, whose suffix no output file has."""
    return [path.parent / "starts.csv"]


def read_plan(path: Path, problem: Problem) -> tuple[tuple[State, ...], ...]:
    """Reads the paths that Greedy Perspectives' planner found for a problem made by `read`.

    The file has columns robot, t, x_cell, y_cell, heading_idx, one row per robot and step, in any
    order. Returns one path of T+1 states per robot. The referee, not the reader, checks whether the
    paths can be flown.

    Raises
    ------
    ProblemError
        If a column, a robot or a step is missing, given twice or not part of the problem, or
        a value is not a whole number; one line, naming the file.
    """
    steps = range(problem.horizon + 1)
    states: dict[tuple[int, int], State] = {}
    columns = ("robot", "t", "x_cell", "y_cell", "heading_idx")
    with naming(path):
        for line, row in read_table(path, columns):
            robot, t, x, y, theirs = (integer(row[c], f"line {line}, {c}") for c in columns)
            _require_index(robot, len(problem.robots), f"line {line}, robot")
            _require_index(t, len(steps), f"line {line}, t")
            headings = problem.robots[robot].motion.headings
            _require_index(theirs, headings, f"line {line}, heading_idx")
            if (robot, t) in states:
                raise ProblemError(f"line {line}: robot {robot} must have step {t} only once")
            states[robot, t] = State(x, y, heading=our_heading(theirs, headings))
        for robot in range(len(problem.robots)):
            missing = [t for t in steps if (robot, t) not in states]
            if missing:
                raise ProblemError(
                    f"robot {robot}: must have a row for each step 0..{problem.horizon}, "
                    f"but has none for step {missing[0]}"
                )
    return tuple(tuple(states[i, t] for t in steps) for i in range(len(problem.robots)))


def start_sets(path: Path) -> int:
    """Returns the number of start sets beside a scene's `seq.yaml`; 0 without `starts.csv`.

    Raises
    ------
    ProblemError
        If one of the two files cannot be read, or the rows do not form complete sets; the message
        is one line that names the file.
    """
    with naming(path):
        robots = len(_world(read_text(path, (JSON,))).agents)
    file = path.with_name("starts.csv")
    if not os.path.lexists(file):
        return 0
    with naming(file):
        return len(_start_rows(file, robots)) // robots


def _their_heading(theta: float, headings: int) -> int:
    """Returns their heading index for an angle (rad): truncated toward zero, wrapped to +-pi."""
    return int(math.remainder(theta, math.tau) / (math.tau / headings)) % headings


def our_heading(theirs: int, headings: int) -> int:
    """Returns our heading index, counted from +x, for theirs, which is counted from +y."""
    return (theirs + headings // 4) % headings


def _require_index(value: int, size: int, field: str) -> None:
    if not 0 <= value < size:
        raise ProblemError(f"{field}: must be 0..{size - 1}, not {value}")


class _Loader(CoreLoader):  # type: ignore[misc]  # yamlcore has no annotations
    """A safe loader of YAML 1.2's core schema that raises only one type of error.

    In that schema 1e-05 is a number, 012 is twelve, and yes, 1_000, 1:30 and dates are text; PyYAML
    and msgspec.yaml follow YAML 1.1 and read these differently. The loader in C, which msgspec.yaml
    uses, crashes on text that is nested too deeply.
    """

    def construct_object(self, node: yaml.Node, deep: bool = False) -> Any:
        try:
            return super().construct_object(node, deep)
        except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
            kind = node.tag.rpartition(":")[2]
            problem = f"{_CANNOT} {kind}: {str(node.value)[:40]!r}"
            raise yaml.constructor.ConstructorError(
                problem=problem, problem_mark=node.start_mark
            ) from error

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        pairs = node.value if isinstance(node, yaml.MappingNode) else []
        keys = [key.value for key, _ in pairs if isinstance(key, yaml.ScalarNode)]
        if len(set(keys)) < len(keys):
            twice = next(key for k, key in enumerate(keys) if key in keys[:k])
            raise ProblemError(f"{twice[:40]}: must be given once in a mapping, not twice")
        if "<<" in keys:  # YAML 1.1 merges the mapping that follows, which must not be lost
            line = node.start_mark.line + 1
            raise ProblemError(f"line {line}: must not have a merge key <<; write out its fields")
        mapping: dict[Any, Any] = super().construct_mapping(node, deep)
        return mapping


def _world(text: str) -> _World:
    value = None
    try:
        value = yaml.load(text, _Loader)
        return msgspec.convert(value, _Sequence).planner.world
    except yaml.YAMLError as error:
        raise ProblemError(_yaml_in_words(error) if text.strip() else "is empty") from error
    except (ValueError, RecursionError) as error:
        raise ProblemError(in_words(error, text, _Sequence, value)) from error


def _yaml_in_words(error: yaml.YAMLError) -> str:
    """Describes where a text is not valid YAML."""
    if not isinstance(error, yaml.MarkedYAMLError) or error.problem_mark is None:
        return "must be YAML, without control characters"
    place = f"line {error.problem_mark.line + 1}, column {error.problem_mark.column + 1}"
    if (error.problem or "").startswith(_CANNOT):
        return f"{place}: {error.problem}"
    if isinstance(error, yaml.constructor.ConstructorError):
        return f"{place}: must be a plain value, without a tag"
    return f"{place}: must be YAML; a bracket, a quotation mark or the indent may be wrong"


def _starts(
    path: Path, world: _World, seed: int, conventions: Conventions
) -> tuple[Path, list[_Pose]]:
    """Returns the file that contains the start poses, and the pose of each robot."""
    start_sets = path.with_name("starts.csv")
    # A broken link counts as a file: it is rejected instead of being ignored.
    if conventions.start_set == "seed" and os.path.lexists(start_sets):
        with naming(start_sets):
            return start_sets, _start_set(start_sets, seed, len(world.agents))
    return path, [item.agent.start for item in world.agents]


def _cameras(world: _World, conventions: Conventions) -> list[Camera]:
    cameras = [_camera(item.agent.camera) for item in world.agents]
    if conventions.tilt == "first":
        return [camera.replace(tilts=cameras[0].tilts) for camera in cameras]
    return cameras


def _camera(camera: _Camera) -> Camera:
    focal, width, height = camera.intrinsics
    tilt = math.pi / 2 - camera.tilt
    return Camera(focal=focal, width=width, height=height, tilts=(tilt,))


def _actors(world: _World, shape: Cuboid | TriangulatedCuboid) -> tuple[Actor, ...]:
    rows = world.time.horizon
    actors = []
    for j, item in enumerate(world.actors):
        trajectory = item.actor.trajectory[:rows]
        if len(trajectory) < rows:
            raise ProblemError(
                f"planner.world.actors[{j}].actor.trajectory: must have a row for each of the "
                f"{rows} steps of time.horizon, not {len(trajectory)}"
            )
        poses = [(x, y, 0.0, yaw) for x, y, yaw in trajectory]
        actors.append(Actor(poses=np.array(poses), shape=shape))
    return tuple(actors)


def _robot(pose: _Pose, camera: Camera, motion: Motion, height_map: HeightMap) -> Robot:
    x, y = height_map.cell_of(pose.x, pose.y)
    heading = our_heading(_their_heading(pose.theta, motion.headings), motion.headings)
    return Robot(
        start=State(x, y, heading=heading), motion=motion.replace(layers=(pose.z,)), camera=camera
    )


def _map_file(path: Path, stated: str) -> Path:
    """Returns the file of the map, whose path in scenes is relative to a folder further up."""
    for candidate in (path.parent / Path(stated).name, path.parent / stated):
        if os.path.isfile(candidate):  # unlike Path.is_file, also false for an impossible name
            return candidate
    raise ProblemError(f"planner.world.map.file: no file {stated!r} beside the scene")


def _heights(path: Path) -> FloatArray:
    require(path, (NUMPY,))
    try:
        with path.open("rb") as file:
            version = np.lib.format.read_magic(file)
            reader = np.lib.format.read_array_header_1_0
            shape = (reader if version == (1, 0) else np.lib.format.read_array_header_2_0)(file)[0]
            if math.prod(shape) > _MOST_CELLS:
                raise ProblemError(f"must have at most {_MOST_CELLS:,} cells, not {shape}")
            file.seek(0)
            heights = np.lib.format.read_array(file, allow_pickle=False)
    except ProblemError:
        raise
    except Exception as error:  # NumPy does not document which errors a damaged file raises
        raise ProblemError(
            "must be a .npy array of numbers, as numpy.save writes it; it is damaged or truncated"
        ) from error
    if heights.dtype.kind not in "iuf":
        raise ProblemError(f"must be a .npy array of numbers, not of {heights.dtype}")
    return heights.astype(np.float64)


def _start_rows(path: Path, robots: int) -> list[tuple[int, dict[str, str]]]:
    """Returns the rows of all start sets, each with its line number."""
    rows = read_table(path, _Pose._fields)
    if len(rows) % robots or not rows:
        raise ProblemError(
            f"must contain sets of {robots} rows, a row per robot of the scene, not {len(rows)} "
            "rows; --option start-set=yaml takes the start poses of the scene's own file"
        )
    return rows


def _start_set(path: Path, seed: int, robots: int) -> list[_Pose]:
    rows = _start_rows(path, robots)
    sets = len(rows) // robots
    if not 0 <= seed < sets:
        raise ProblemError(f"seed: must be 0..{sets - 1} ({sets} start sets), not {seed}")
    return [
        _Pose(*(number(row[field], f"line {line}, {field}") for field in _Pose._fields))
        for line, row in rows[seed * robots : (seed + 1) * robots]
    ]
