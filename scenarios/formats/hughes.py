"""Reader of the scenes (`scene.json`, `<name>_data.json`) and solutions of Hughes et al.

Source of the format and of its meaning: Hughes et al., "Multi-drone multi-actor filming",
2024, repository castacks/MultiDroneMultiActorFilming, `experiments`, and the behaviour of its
evaluation. Its reward is expressed in ours as follows:

================================  =========================================================
there                             here
================================  =========================================================
grid states x = 1..W, in metres   cells 0..W-1 of 1 m, whose middles are at x = 1..W
headings E, NE, N, ..             heading index 0, 1, 2, ..
actor: six sides and a top        `Prism`; all faces count as if they were on the ground
detection within 45 degrees of    `Cone`, with their law of distance and angle
the heading
weight x area x sqrt(sum)         weights are areas, and the actor's weight in each frame is
                                  its importance
rows t = 1.. of the evaluation    steps 0..T, `count_start`
no obstacles, no collision rule   `NO_RULES` on a flat map
================================  =========================================================

The robots come from a solution: `solution_*.json` beside the scene or, in the published data,
`<planner>/solution.json`. If a solution is named in place of the scene, its robots are used; its
scene must be beside it or in the folder above. The states of their formation planner lie between
the cells: such a solution can be evaluated but not flown. If there is no other solution, robots
start in the cells nearest to its starts.

`robot_fovs`, `sense_dist` and `num_robots` are in the file, but their planner does not use them and
they are not read here. Their planner adds 0.02 for keeping the heading and 0.01 for keeping the
position. These are no part of their evaluation; they are part of the objective only with the option
`bonus`.
"""

import logging
import math
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Literal, TypeVar

import msgspec
import numpy as np
from msgspec import Meta

from cocap_opt.data import LARGEST, MOST_WEIGHT, ProblemError
from cocap_opt.files.messages import in_words
from cocap_opt.files.strict_json import decode_json
from cocap_opt.problem import (
    NO_RULES,
    Actor,
    Cone,
    Motion,
    Objective,
    Prism,
    Problem,
    Robot,
    State,
)
from cocap_opt.scenarios.formats import NO_YES, NOTHING, Options
from cocap_opt.scenarios.kinds import JSON
from cocap_opt.scenarios.text import naming, read_text
from cocap_opt.text import printable
from cocap_opt.vision.faces import FaceGeometry
from cocap_opt.world.workspace import HeightMap

log = logging.getLogger(__name__)

FLIGHT_HEIGHT = 5.0  # m
BODY = Prism(sides=6, apothem=0.484, height=1.8)
MOTION = Motion(radius=2, headings=8, turn=1, layers=(FLIGHT_HEIGHT,), corner_cutting=True)
HEADINGS = ("E", "NE", "N", "NW", "W", "SW", "S", "SE")
MOST_CELLS = 10_000  # cells along an edge
_ON_THE_EDGE = 1e-9  # rad
EVALUATED = Objective(count_start=True)
PLANNED = EVALUATED.replace(keep_heading=0.02, keep_cell=0.01)

OPTIONS = Options({"bonus": NO_YES})

# Words that distinguish their files from other JSON files.
SCENE, SOLUTION = b'"actor_positions"', b'"elements"'
# patterns of solutions for a scene; the second one is that of the published data
BESIDE, BELOW = "solution_*.json", "*/solution.json"

Coordinate = Annotated[float, Meta(ge=-LARGEST, le=LARGEST)]


class _Scale(msgspec.Struct):
    x: Annotated[float, Meta(ge=1, le=MOST_CELLS)]
    y: Annotated[float, Meta(ge=1, le=MOST_CELLS)]


class _Area(msgspec.Struct):
    scale: _Scale


class _Person(msgspec.Struct):
    location: tuple[Coordinate, Coordinate, Coordinate]  # m; the height is ignored
    rotation: tuple[Coordinate, Coordinate, Coordinate]  # rad; only the last angle is used
    weight: Annotated[float, Meta(ge=0, le=MOST_WEIGHT)]


class _HughesScene(msgspec.Struct):
    scene: _Area
    actor_positions: Annotated[list[list[_Person]], Meta(min_length=2)]


class _State(msgspec.Struct):
    x: Coordinate
    y: Coordinate
    heading: Literal["E", "NE", "N", "NW", "W", "SW", "S", "SE"]

    @property
    def is_cell(self) -> bool:
        """True if the state is at the centre of a cell."""
        return float(self.x).is_integer() and float(self.y).is_integer()

    def nearest(self, size: tuple[int, int]) -> State:
        """Returns the nearest state at the centre of a cell, on a map of the given size."""
        x, y = (
            min(max(round(at) - 1, 0), cells - 1)
            for at, cells in zip((self.x, self.y), size, strict=True)
        )
        return State(x, y, heading=HEADINGS.index(self.heading))


class _Entry(msgspec.Struct):
    state: _State


class _Solution(msgspec.Struct):
    elements: Annotated[
        list[tuple[int, Annotated[list[_Entry], Meta(min_length=1)]]], Meta(min_length=1)
    ]

    def __post_init__(self) -> None:
        robots = [robot for robot, _ in self.elements]
        if sorted(robots) != list(range(1, len(robots) + 1)):
            raise ProblemError(
                f"elements: must be the robots 1..{len(robots)}, each once, not "
                f"{', '.join(map(str, robots[:8]))}"
            )
        self.elements.sort(key=lambda element: element[0])  # solutions may list them in any order

    @property
    def is_on_grid(self) -> bool:
        """True if all states are cells."""
        return all(entry.state.is_cell for _, entries in self.elements for entry in entries)


T = TypeVar("T")


def read(path: Path, seed: int = 0, options: Mapping[str, str] = NOTHING) -> Problem:
    """Reads a scene; a solution beside it gives the start states of its robots.

    Parameters
    ----------
    path
        The scene, or one of its solutions.
    seed
        Without effect: nothing in the scene is random.
    options
        With {"bonus": "yes"} the objective is their planner's; otherwise their evaluation's.

    Raises
    ------
    ProblemError
        If a file cannot be read or contains something that is not allowed (the message is one line
        that names the file), or if an option is not allowed.
    """
    bonus = OPTIONS.chosen(options).get("bonus", False)
    path, solutions = _scene_and_solutions(path)
    with naming(path):
        scene = _decode(path, _HughesScene)
        frames = scene.actor_positions
        count = len(frames[0])
        for t, frame in enumerate(frames):
            if len(frame) != count:
                raise ProblemError(
                    f"actor_positions[{t}]: must contain {count} actors, as the first frame does, "
                    f"not {len(frame)}"
                )
        actors = tuple(_actor([frame[k] for frame in frames]) for k in range(count))
        size = math.floor(scene.scene.scale.x), math.floor(scene.scene.scale.y)
    given, solution = _first_on_grid(solutions)
    with naming(given):
        return Problem(
            name=path.resolve().parent.name,
            # The centres of the cells are at 1, 2, ..
            height_map=HeightMap(heights=np.zeros(size), origin=(0.5, 0.5)),
            robots=tuple(
                Robot(start=start, motion=MOTION, camera=Cone())
                for start in _starts(given, solution, size)
            ),
            actors=actors,
            horizon=len(frames) - 1,
            rules=NO_RULES,
            objective=PLANNED if bonus else EVALUATED,
        )


def parts(path: Path) -> list[Path]:
    """Returns the scene and its solutions, given the path of the scene or of a solution."""
    scene, solutions = _scene_and_solutions(path)
    return [scene, *solutions]


def read_plan(path: Path, problem: Problem) -> tuple[tuple[State, ...], ...]:
    """Reads the paths of a solution, one per robot; the referee checks if they can be flown.

    Raises
    ------
    ProblemError
        If something is missing or not allowed; one line, naming the file.
    """
    with naming(path):
        return _paths(_decode(path, _Solution))


def rewards_between_cells(path: Path, problem: Problem) -> tuple[float, ...] | None:
    """Evaluates a solution whose states lie between the cells, frame by frame.

    Returns
    -------
    [T+1] view rewards by the law in the documentation of `Cone`; None for a solution on the grid

    Raises
    ------
    ProblemError
        If something is missing or not allowed; one line, naming the file.
    """
    with naming(path):
        solution = _decode(path, _Solution)
        if solution.is_on_grid:
            return None
        frames, robots = problem.horizon + 1, len(problem.robots)
        if len(solution.elements) != robots:
            raise ProblemError(f"elements: must be {robots} robots, not {len(solution.elements)}")
        for robot, (_, entries) in enumerate(solution.elements):
            if len(entries) != frames:
                raise ProblemError(
                    f"elements[{robot}]: must contain {frames} states, one per frame"
                )
    paths = [[entry.state for entry in entries] for _, entries in solution.elements]
    geometry = FaceGeometry(problem)
    return tuple(
        _reward(problem, geometry, t, [path_[t] for path_ in paths]) for t in range(frames)
    )


def _reward(problem: Problem, geometry: FaceGeometry, t: int, states: list[_State]) -> float:
    """Returns the view reward of a frame; the robots' states are in metres, on or off the grid."""
    coverage, opening = np.zeros(len(problem.face_weights)), Cone().opening
    planes, origin = geometry.planes(t), geometry.origin
    faces = zip(problem.face_owner.tolist(), planes.centres + origin, planes.normals, strict=True)
    for face, (owner, centre, normal) in enumerate(faces):
        x, y, *_ = problem.actors[owner].poses[t]
        for state in states:
            yaw = HEADINGS.index(state.heading) * math.tau / len(HEADINGS)
            off = math.atan2(y - state.y, x - state.x) - yaw
            if abs(math.remainder(off, math.tau)) > opening / 2 + _ON_THE_EDGE:
                continue
            way = np.array([centre[0] - state.x, centre[1] - state.y, -FLIGHT_HEIGHT])
            ahead = abs(way[0] * math.cos(yaw) + way[1] * math.sin(yaw))
            square = float(way @ way) or math.inf  # a camera exactly at the face sees nothing
            coverage[face] += ahead * max(0.0, -float(way @ normal)) / square**2
    return float(problem.step_weights[t] @ np.sqrt(coverage))


def _scene_and_solutions(path: Path) -> tuple[Path, list[Path]]:
    """Returns the files of the scene and of its solutions, given the path of either."""
    if os.path.isfile(path) and SOLUTION in path.read_bytes():
        for folder in (path.parent, path.parent.parent):
            files = [file for file in sorted(folder.glob("*.json")) if file.is_file()]
            scenes = [file for file in files if SCENE in file.read_bytes()]
            if len(scenes) == 1:
                return scenes[0], [path]
        raise ProblemError(
            f'{path}: its scene, one .json file with "actor_positions", must be beside it or in '
            "the folder above; copy it there"
        )
    folder = path.parent
    solutions = [*sorted(folder.glob(BESIDE)), *sorted(folder.glob(BELOW))]
    if not solutions:
        raise ProblemError(
            f"{path}: a solution_*.json or <planner>/solution.json must be beside it, as it states "
            "where the drones start; or name a solution instead of the scene"
        )
    return path, solutions


def _first_on_grid(solutions: list[Path]) -> tuple[Path, _Solution]:
    """Returns the first solution whose states are cells or, if there is none, the first
    solution.
    """
    found = []
    for given in solutions:
        with naming(given):
            found.append((given, _decode(given, _Solution)))
        if found[-1][1].is_on_grid:
            return found[-1]
    return found[0]


def _starts(path: Path, solution: _Solution, size: tuple[int, int]) -> list[State]:
    """Returns the start states of a solution's robots, in order, on a map of the given size."""
    if solution.is_on_grid:
        return [states[0] for states in _paths(solution)]
    log.warning(
        "%s: its states lie between cells; plans start in the cells nearest to its starts",
        printable(str(path)),
    )
    return [entries[0].state.nearest(size) for _, entries in solution.elements]


def _decode(path: Path, kind: type[T]) -> T:
    text = read_text(path, (JSON,))
    try:
        return decode_json(text, kind)
    except (msgspec.MsgspecError, RecursionError) as error:
        raise ProblemError(in_words(error, text, kind)) from error


def _actor(frames: list[_Person]) -> Actor:
    poses = [(f.location[0], f.location[1], 0.0, f.rotation[2]) for f in frames]
    return Actor(
        poses=np.array(poses),
        shape=BODY,
        weights=tuple(_areas()),
        importance=tuple(f.weight for f in frames),
    )


def _areas() -> list[float]:
    """Returns the areas of the faces of an actor, in m2."""
    side = 2 * BODY.apothem * math.tan(math.pi / BODY.sides)
    top = BODY.sides * side * BODY.apothem / 2
    return [side * BODY.height] * BODY.sides + [top]


def _paths(solution: _Solution) -> tuple[tuple[State, ...], ...]:
    if not solution.is_on_grid:
        raise ProblemError(
            "elements: must be states in the middles of cells; states between cells cannot be "
            "flown, but `cocap-opt verify` evaluates them"
        )
    return tuple(
        tuple(
            State(
                int(entry.state.x) - 1,
                int(entry.state.y) - 1,
                heading=HEADINGS.index(entry.state.heading),
            )
            for entry in entries
        )
        for _, entries in solution.elements
    )
