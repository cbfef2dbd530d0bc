"""Field: people walk about between scattered blocks, with drones among them.

    . . . . . . . . .
    . # # . 0 . . R .
    . # # R   # # # .       blocks 10 m high on an eighth of a square field
    . . . . . # # # .
    . R 1 . . . . . .

The other scenes funnel a few people through one place; here everybody walks somewhere else, and no
drone is assigned to a single person. People cross, meet and part; a drone sees several of them from
most places, in passing or behind blocks, and several drones see the same people. A face that k
drones see equally well is worth sqrt(k), so a drone's worth depends on where all others are. The
numbers of drones, people, cells and steps are parameters, for measuring how methods scale.
"""

from __future__ import annotations  # networkx graphs take type arguments in stubs only

import math
from collections.abc import Callable
from functools import cache
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from cocap_opt.data import BoolArray, ProblemError
from cocap_opt.problem import Actor, Motion, Problem
from cocap_opt.scenarios.built_in import WALL, Point, drones, walker
from cocap_opt.scenarios.walking import GridCell, walking_graph
from cocap_opt.world.workspace import HeightMap

if TYPE_CHECKING:
    from cocap_opt.scenarios.walking import Graph

LEAST_CELLS, MOST_CELLS = 15, 256  # cells of 1 m along x and y
MOST_STEPS = 1000
GROUND_PER_ACTOR = 100  # m2 of field per person, so that separate walks exist
GROUND_PER_ROBOT = 8  # m2 of field per drone
LEAST_BLOCKED, MOST_BLOCKED = 0.10, 0.15  # share of the field that blocks cover
LEAST_SIDE, MOST_SIDE = 2, 6  # m, side of a block
LANE = 3  # m between blocks: people keep a metre off the walls
PACE = 1.0  # m per step
APART = 1.5  # m between people: boxes of 1 m x 1 m never touch
NEAR = 4  # m along x and y from a person to the farthest start of a drone
SIGHT = 10  # cells, longest straight piece of a walk
DRAWS = 1000  # random draws before a part is abandoned and restarted
TRIES = 20  # consecutive random goals that a person tries before being stuck


def field(seed: int, robots: int, actors: int, cells: int, steps: int, radius: int = 1) -> Problem:
    """Builds a square field with scattered blocks, people on random ways and drones near them.

    The seed chooses the blocks, the people's ways and pace, and the drones' cells and headings.
    People walk from one random place to the next on shortest ways, and stay apart.

    Parameters
    ----------
    seed : chooses one of the fields of this size, >= 0
    robots : number of drones
    actors : number of people
    cells : length of the field's edge, in cells of 1 m
    steps : horizon T
    radius : cells along each axis that a drone flies per step

    Raises
    ------
    ProblemError
        If a parameter is out of range; the message starts with its name.
    """
    _require_within("seed", seed, 0, math.inf)
    _require_within("cells", cells, LEAST_CELLS, MOST_CELLS)
    _require_within("robots", robots, 1, cells**2 // GROUND_PER_ROBOT)
    _require_within("actors", actors, 1, cells**2 // GROUND_PER_ACTOR)
    _require_within("steps", steps, 1, MOST_STEPS)
    motion = Motion(radius=radius)
    rng = np.random.default_rng(seed)
    free = _free_cells(cells, rng)
    people = _walkers(actors, walking_graph(_off_the_walls(free)), steps, rng)
    return Problem(
        name="field",
        height_map=HeightMap(heights=np.where(free, 0.0, WALL)),
        robots=drones(robots, _near(people, free, robots), list(range(8)), rng, motion),
        actors=tuple(people),
        horizon=steps,
    )


def _field_small(seed: int) -> Problem:
    """Six people walk about on a field with blocks, and six drones film them."""
    return field(seed, robots=6, actors=6, cells=30, steps=20)


def _field_long(seed: int) -> Problem:
    """Six people walk about on a field for 60 steps, and six drones twice as fast film them."""
    return field(seed, robots=6, actors=6, cells=30, steps=60, radius=2).replace(name="field-long")


def _field_large(seed: int) -> Problem:
    """32 people walk about on a field of 64 x 64 m, and 64 drones film them."""
    return field(seed, robots=64, actors=32, cells=64, steps=40).replace(name="field-large")


def _require_within(name: str, value: int, least: int, most: float) -> None:
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)):
        raise ProblemError(f"{name}: must be a whole number, not {value!r}")
    if not least <= value <= most:
        allowed = f"{least}..{most}" if most < math.inf else f">= {least}"
        raise ProblemError(f"{name}: must be {allowed}, not {value}")


# -- ground -------------------------------------------------------------------------------


def _free_cells(cells: int, rng: np.random.Generator) -> BoolArray:
    """Draws the blocks; returns an array [cells, cells], True where there is no block.

    A lane runs between blocks, and between them and the field's edge, so that the ground a metre
    off the walls is connected, too.
    """
    enough = (LEAST_BLOCKED + MOST_BLOCKED) / 2 * cells**2
    while True:
        free = np.ones((cells, cells), dtype=bool)
        for _ in range(DRAWS):
            width, depth = rng.integers(LEAST_SIDE, MOST_SIDE, size=2, endpoint=True).tolist()
            x = int(rng.integers(LANE, cells - LANE - width, endpoint=True))
            y = int(rng.integers(LANE, cells - LANE - depth, endpoint=True))
            around = free[x - LANE : x + width + LANE, y - LANE : y + depth + LANE]
            blocked = cells**2 - int(free.sum()) + width * depth
            if around.all() and blocked <= MOST_BLOCKED * cells**2:
                free[x : x + width, y : y + depth] = False
                if blocked >= enough:
                    break
        if 1 - free.mean() >= LEAST_BLOCKED:
            return free


def _off_the_walls(free: BoolArray) -> BoolArray:
    """Returns the cells whose neighbours are all free, so a box there may turn freely."""
    padded = np.pad(free, 1)
    moves = np.ndindex(3, 3)
    width, depth = free.shape
    result: BoolArray = np.all(
        [padded[dx : dx + width, dy : dy + depth] for dx, dy in moves], axis=0
    )
    return result


def _near(people: list[Actor], free: BoolArray, count: int) -> list[GridCell]:
    """Returns at least `count` free cells, as close as possible to where people start."""
    cells = np.argwhere(free)
    starts = np.array([actor.poses[0, :2] for actor in people])
    # The larger of the distances along x and y from each cell's middle to the nearest person.
    offsets = np.abs(cells[:, None, :] + 0.5 - starts[None, :, :])
    distance = offsets.max(axis=2).min(axis=1)
    radius = max(NEAR, float(np.sort(distance)[count - 1]))
    return [(x, y) for x, y in cells[distance <= radius].tolist()]


# -- people -------------------------------------------------------------------------------


def _walkers(count: int, graph: Graph, steps: int, rng: np.random.Generator) -> list[Actor]:
    """Draws people who walk on the graph's cells, each clear of all people drawn before."""
    places = list(graph)
    people: list[Actor] = []
    for _ in range(DRAWS):
        person = _stroller(graph, places, people, steps, rng)
        if person is not None:
            people.append(person)
        if len(people) == count:
            return people
    raise ProblemError(
        f"actors: must be fewer than {count}, for whom {DRAWS} random draws found no separate walks"
    )


def _stroller(
    graph: Graph,
    places: list[GridCell],
    others: list[Actor],
    steps: int,
    rng: np.random.Generator,
) -> Actor | None:
    """Draws a person who walks from one random place to the next; None if the person gets stuck.

    Places that cannot be reached without running into others are skipped.
    """
    import networkx as nx  # takes a fifth of a second, and few commands need it

    pace = PACE + rng.uniform(-0.1, 0.1)
    way = [places[rng.integers(len(places))]]
    tries = TRIES
    while tries:
        tries -= 1
        goal = places[rng.integers(len(places))]
        path: list[GridCell] = nx.astar_path(graph, way[-1], goal, math.dist, "weight")
        longer = way + _corners(path, graph)[1:]
        length = sum(math.dist(a, b) for a, b in pairwise(longer))
        walked = min(steps, math.ceil(length / pace) - 1)
        if walked < 1:
            continue
        points: list[Point] = [(x + 0.5, y + 0.5) for x, y in longer]
        person = walker(points, 0.0, pace, walked)
        if all(_apart(person, other) for other in others):
            if walked == steps:
                return person
            way, tries = longer, TRIES
    return None


def _corners(path: list[GridCell], graph: Graph) -> list[GridCell]:
    """Returns the cells of a path at which a walk along straight lines must turn.

    A path on a grid has eight directions only; from each corner the next is the farthest cell
    within SIGHT such that the straight line to it stays on the graph's cells.
    """
    corners = [0]
    while corners[-1] < len(path) - 1:
        here = corners[-1]
        ahead = range(min(here + SIGHT, len(path) - 1), here, -1)
        corners.append(next(i for i in ahead if _straight(path[here], path[i], graph)))
    return [path[i] for i in corners]


def _straight(a: GridCell, b: GridCell, graph: Graph) -> bool:
    """Returns True if the line between the middles of two cells touches only the graph's cells."""
    return all((a[0] + i, a[1] + j) in graph for i, j in _swept(b[0] - a[0], b[1] - a[1]))


_swept = cache(Motion.swept_cells)


def _apart(person: Actor, other: Actor) -> bool:
    """Returns True if the boxes do not meet at any step of `person`, whose walk may be shorter."""
    offsets = person.poses[:, :2] - other.poses[: len(person.poses), :2]
    return bool((np.hypot(*offsets.T) >= APART).all())


SCENES: dict[str, Callable[[int], Problem]] = {
    "field": _field_small,
    "field-long": _field_long,
    "field-large": _field_large,
}
