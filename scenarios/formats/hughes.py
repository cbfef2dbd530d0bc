"""Reader of the scenes (`scene.json`) and solutions of Hughes et al.

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

The robots are those of the solutions beside the scene; `robot_fovs`, `sense_dist` and
`num_robots` are in the file but were not used, and are not read. Their planner adds 0.02 for
keeping the heading and 0.01 for keeping the position. These are no part of their evaluation; they
are part of the objective only with the option `bonus`.
"""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Literal, TypeVar

import msgspec
import numpy as np
from msgspec import Meta

from cocap_opt.data import LARGEST, MOST_WEIGHT, ProblemError
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
from cocap_opt.scenarios.formats.options import NO_YES, NOTHING, Options
from cocap_opt.scenarios.text import naming, one_line, read_text
from cocap_opt.world.workspace import HeightMap

FLIGHT_HEIGHT = 5.0  # m
BODY = Prism(sides=6, apothem=0.484, height=1.8)
MOTION = Motion(radius=2, headings=8, turn=1, layers=(FLIGHT_HEIGHT,), corner_cutting=True)
HEADINGS = ("E", "NE", "N", "NW", "W", "SW", "S", "SE")
MOST_CELLS = 10_000  # along an edge
EVALUATED = Objective(count_start=True)
PLANNED = EVALUATED.replace(keep_heading=0.02, keep_cell=0.01)

OPTIONS = Options({"bonus": NO_YES})

# Words that tell their files from other JSON.
SCENE, SOLUTION = b'"actor_positions"', b'"elements"'

Coordinate = Annotated[float, Meta(ge=-LARGEST, le=LARGEST)]


class _Scale(msgspec.Struct):
    x: Annotated[float, Meta(ge=1, le=MOST_CELLS)]
    y: Annotated[float, Meta(ge=1, le=MOST_CELLS)]


class _World(msgspec.Struct):
    scale: _Scale


class _Actor(msgspec.Struct):
    location: tuple[Coordinate, Coordinate, Coordinate]  # m; the height does not count
    rotation: tuple[Coordinate, Coordinate, Coordinate]  # rad; the last one counts
    weight: Annotated[float, Meta(ge=0, le=MOST_WEIGHT)]


class _Scene(msgspec.Struct):
    scene: _World
    actor_positions: Annotated[list[list[_Actor]], Meta(min_length=2)]


class _State(msgspec.Struct):
    x: int
    y: int
    heading: Literal["E", "NE", "N", "NW", "W", "SW", "S", "SE"]


class _Entry(msgspec.Struct):
    state: _State


class _Solution(msgspec.Struct):
    elements: Annotated[list[tuple[int, list[_Entry]]], Meta(min_length=1)]


T = TypeVar("T")


def read(path: Path, seed: int = 0, options: Mapping[str, str] = NOTHING) -> Problem:
    """Reads a scene; a `solution_*.json` beside it says where its robots start.

    Parameters
    ----------
    path
        The `scene.json`.
    seed
        Without effect: nothing in the scene is random.
    options
        With {"bonus": "yes"} the objective is the one that their planner maximises, else it is
        their evaluation.

    Raises
    ------
    ProblemError
        If a file cannot be read or holds something not allowed, one line, naming the file; or
        if an option is not allowed.
    """
    bonus = OPTIONS.chosen(options).get("bonus", False)
    with naming(path):
        scene = _decode(path, _Scene)
        frames = scene.actor_positions
        count = len(frames[0])
        for t, frame in enumerate(frames):
            if len(frame) != count:
                raise ProblemError(
                    f"actor_positions[{t}]: must hold {count} actors like the first frame, "
                    f"not {len(frame)}"
                )
        actors = tuple(_actor([frame[k] for frame in frames]) for k in range(count))
        size = math.floor(scene.scene.scale.x), math.floor(scene.scene.scale.y)
    solutions = sorted(path.parent.glob("solution_*.json"))
    if not solutions:
        raise ProblemError(
            f"{path}: a solution_*.json must be beside it, to say where the drones start"
        )
    with naming(solutions[0]):
        starts = [path_[0] for path_ in _paths(_decode(solutions[0], _Solution))]
        return Problem(
            name=path.resolve().parent.name,
            # The middles of the cells are at 1, 2, ..
            height_map=HeightMap(heights=np.zeros(size), origin=(0.5, 0.5)),
            robots=tuple(Robot(start=start, motion=MOTION, camera=Cone()) for start in starts),
            actors=actors,
            horizon=len(frames) - 1,
            rules=NO_RULES,
            objective=PLANNED if bonus else EVALUATED,
        )


def read_plan(path: Path, problem: Problem) -> tuple[tuple[State, ...], ...]:
    """Reads the paths of a solution, one per robot; the referee says if they can be flown.

    Raises
    ------
    ProblemError
        If something is missing or not allowed; one line, naming the file.
    """
    with naming(path):
        return _paths(_decode(path, _Solution))


def _decode(path: Path, kind: type[T]) -> T:
    try:
        return msgspec.json.decode(read_text(path), type=kind)
    except (msgspec.MsgspecError, RecursionError) as error:
        raise ProblemError(one_line(error)) from error


def _actor(frames: list[_Actor]) -> Actor:
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
    return tuple(
        tuple(
            State(entry.state.x - 1, entry.state.y - 1, heading=HEADINGS.index(entry.state.heading))
            for entry in entries
        )
        for _, entries in solution.elements
    )
