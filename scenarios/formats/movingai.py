"""Reader of the MovingAI benchmark's grid maps and scenarios (`.map`, `.scen`).

Source of the format: Sturtevant, "Benchmarks for grid-based pathfinding", 2012, and Stern et
al., "Multi-agent pathfinding: definitions, variants, and benchmarks", 2019 (movingai.com).

A cell is (column, row), the first row at the top of the file. It becomes the cell x = column,
y = row of the height map, one metre wide: world y grows down the printed map, so the world is
its mirror image. Free terrain (`.` and `G` ground, `S` swamp) has height 0; everything else
(`@` and `O` out of bounds, `T` trees, `W` water) becomes a column.

Each row of a scenario is a trip from a start to a goal. The first rows become actors, who walk on a
shortest path that does not cut corners, as the benchmark's optimal lengths assume; actors ignore
each other. Robots start at the starts of other rows, beginning with those that are near an actor.
If too few starts are near an actor, the actors of the next rows replace the first ones. Without
such an order (`near` is None), the first rows become robots and the following ones actors.
"""

from __future__ import annotations  # networkx graphs take type arguments in stubs only

import logging
import math
import os
import random
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import islice, pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from cocap_opt.arithmetic import angles_of
from cocap_opt.data import BoolArray, FloatArray, ProblemError
from cocap_opt.graph.encounters import NEAR, Encounters
from cocap_opt.problem import Actor, Motion, Problem, Robot, State
from cocap_opt.scenarios.formats import NOTHING, Options
from cocap_opt.scenarios.text import integer, naming, number, read_text
from cocap_opt.scenarios.walking import GridCell, walking_graph
from cocap_opt.world.workspace import HeightMap, Workspace

FREE = ".GS"
BLOCKED = "@OTW"

if TYPE_CHECKING:
    from cocap_opt.scenarios.walking import Graph


log = logging.getLogger(__name__)


class _Trip(NamedTuple):
    """One row of a scenario: a start, a goal and the length of a shortest path."""

    start: GridCell
    goal: GridCell
    length: float  # 0 in all rows of some files, such as `tunnel.scen`

    def walk(self, graph: Graph) -> list[GridCell] | None:
        """Returns the cells of a shortest path, both ends included; None where there is none."""
        import networkx as nx

        try:
            path: list[GridCell] = nx.shortest_path(graph, self.start, self.goal, weight="weight")
        except (nx.NetworkXNoPath, nx.NodeNotFound):
            return None
        return path


class _Numbers(Mapping[str, Any]):
    """The allowed words of an option that is one number or several, separated by commas."""

    def __init__(self, default: str, kind: type, least: float, several: bool = False) -> None:
        self._default, self._kind, self._least, self._several = default, kind, least, several

    def __getitem__(self, word: str) -> Any:
        try:
            values = tuple(self._kind(part) for part in word.split(","))
        except ValueError:
            raise KeyError(word) from None
        if not all(self._least <= value < math.inf for value in values):
            raise KeyError(word)
        if len(values) > 1 and not self._several:
            raise KeyError(word)
        return values if self._several else values[0]

    def __iter__(self) -> Iterator[str]:
        kind = "whole numbers" if self._kind is int else "numbers"
        yield from (self._default, f"{kind} >= {self._least:g}")

    def __len__(self) -> int:
        return 2


OPTIONS = Options(
    {
        "drones": _Numbers("2", int, 1),
        "people": _Numbers("2", int, 0),
        "steps": _Numbers("10", int, 1),
        "layers": _Numbers("5", float, 0.1, several=True),
        "near": _Numbers(f"{NEAR:g}", float, 0),
    }
)
_SAME_LENGTH = 0.01  # cells; files round the lengths of paths
_ATTEMPTS = 10  # attempts to find people near whom drones can start
# parameters of `read` with another name than their option
_ARGUMENTS = {"drones": "robots", "people": "actors"}


def read(
    path: Path,
    seed: int = 0,
    options: Mapping[str, str] = NOTHING,
    *,
    robots: int = 2,
    actors: int = 2,
    steps: int = 10,
    wall: float = 10.0,
    layers: tuple[float, ...] = (5.0,),
    near: float | None = NEAR,
) -> Problem:
    """Reads a scenario; the map that it names must lie beside it.

    Robots first look toward the actor that is nearest to them. Actors walk one cell a step, look
    where they go, and stand still once they have arrived. For a robot, rows are skipped if their
    start is blocked or taken; for an actor, if no path joins their ends.

    Parameters
    ----------
    path
        The `.scen` file.
    seed
        0 takes the rows in the order of the file; any other seed gives a random order.
    options
        Words for drones, people, steps, layers and near, in place of the arguments below.
    robots, actors, steps
        Number of robots, of actors, and of moves (the horizon T).
    wall
        Height of blocked cells, m.
    layers
        Flight heights, m; robots start at the first.
    near
        Distance, m. Robots start where the fewest moves bring them within this distance of an actor
        that they see, if the steps suffice. None takes the rows in their order.

    Raises
    ------
    ProblemError
        If a file cannot be read, contains something that is not allowed, or has too few usable
        rows; the message is one line that names the file.
    """
    with naming(path):
        chosen = {_ARGUMENTS.get(k, k): value for k, value in OPTIONS.chosen(options).items()}
        cast = _Cast(robots, actors, steps, layers, near)._replace(**chosen)
        cast.require_possible()
        _require(seed >= 0, "seed", f"must be >= 0, not {seed}")
        _require(math.isfinite(wall) and wall > 0, "wall", f"must be > 0 m, not {wall}")
    free, trips = _read_trips(path)
    height_map = HeightMap(heights=np.where(free, 0.0, wall))
    with naming(path):
        starts, walks = cast.placed(_shuffled(trips, seed), free, height_map)
        _say_lengths(path, trips, walks)
        return Problem(
            name=path.stem,
            height_map=height_map,
            robots=tuple(_robot(start, walks, cast.motion) for start in starts),
            actors=cast.people(walks),
            horizon=cast.steps,
        )


class _Found(NamedTuple):
    """The robots' starts and the actors' walks that the rows give."""

    starts: list[GridCell]
    walks: list[list[GridCell]]
    others: int = 0  # free starts in rows that no actor uses, near an actor or not


class _Cast(NamedTuple):
    """The robots and actors that the caller asks for; the fields are the parameters of `read`."""

    robots: int
    actors: int
    steps: int
    layers: tuple[float, ...]
    near: float | None

    @property
    def motion(self) -> Motion:
        """The motion of all robots."""
        return Motion(layers=self.layers)

    def require_possible(self) -> None:
        """Raises a ProblemError if the number of robots or actors is too small."""
        least = {"robots": (self.robots, 1), "actors": (self.actors, 0), "steps": (self.steps, 1)}
        for name, (value, low) in least.items():
            _require(value >= low, name, f"must be >= {low}, not {value}")

    def people(self, walks: Iterable[list[GridCell]]) -> tuple[Actor, ...]:
        """Returns the actors that walk the given walks."""
        return tuple(Actor(poses=_poses(walk, self.steps)) for walk in walks)

    def placed(
        self, trips: list[_Trip], free: BoolArray, height_map: HeightMap
    ) -> tuple[list[GridCell], list[list[GridCell]]]:
        """Returns the robots' starts and the actors' walks, from rows in their order.

        Raises
        ------
        ProblemError
            If the rows have too few of either.
        """
        graph = walking_graph(free)
        if self.near is None:
            order = iter(trips)
            starts = list(islice(_distinct_starts(order, free), self.robots))
            walks = list(islice(_walks(order, graph), self.actors))
            found = _Found(starts, walks)
        else:
            found = self._people_first(trips, free, graph, height_map)
            for k in range(1, _ATTEMPTS if self.actors else 0):
                if self._is_enough(found) or len(found.walks) < self.actors:
                    break
                skipped = k * self.actors % len(trips)
                others = trips[skipped:] + trips[:skipped]
                other = self._people_first(others, free, graph, height_map)
                if self._is_enough(other):
                    found = other
        if not self._is_enough(found):
            raise ProblemError(f"rows: {self._too_few(found, trips, free, graph)}")
        return found.starts, found.walks

    def _is_enough(self, found: _Found) -> bool:
        """Returns True if there are as many starts and walks as the caller asks for."""
        return (len(found.starts), len(found.walks)) == (self.robots, self.actors)

    def _too_few(self, found: _Found, trips: list[_Trip], free: BoolArray, graph: Graph) -> str:
        """Explains whether starts or walks are too few, with the counts of the whole file."""
        starts = sum(1 for _ in _distinct_starts(trips, free))
        words = (
            f"must have a different free start for each of {self.robots} drones and, in other "
            f"rows, a path to the goal for each of {self.actors} people; its {len(trips)} rows "
            f"have {starts} such starts and {_paths(trips, graph)} such paths"
        )
        if self.near is None:
            return (
                f"{words}; as drones take the first rows, only {len(found.starts)} starts and "
                f"{len(found.walks)} paths remain"
            )
        if len(found.walks) < self.actors or found.others < self.robots:
            return words
        return (
            f"{words}; people leave {found.others} free starts, and from only {len(found.starts)} "
            f"of them a drone comes within near = {self.near:g} m of a person in sight in "
            f"{self.steps} steps; try fewer drones, another seed, more steps or a larger near"
        )

    def _people_first(
        self, trips: list[_Trip], free: BoolArray, graph: Graph, height_map: HeightMap
    ) -> _Found:
        """Returns the walks of the people of the first rows, and starts near them."""
        assert self.near is not None
        order = iter(trips)
        walks = list(islice(_walks(order, graph), self.actors))
        rows = list(_distinct_starts(order, free))
        workspace, people = Workspace(height_map), self.people(walks)
        starts = _nearest(rows, self.near, people, workspace, self.motion) if people else rows
        return _Found(starts[: self.robots], walks, len(rows))


def _nearest(
    starts: Iterable[GridCell],
    near: float,
    people: tuple[Actor, ...],
    workspace: Workspace,
    motion: Motion,
) -> list[GridCell]:
    """Returns the starts, ordered by the number of moves to a place near a visible actor."""
    encounters = Encounters(workspace, motion, people, len(people[0].poses) - 1, near)
    meets = encounters.graph.without_border(encounters.can_meet())[0]
    moves = encounters.graph.without_border(encounters.moves_to_meet())[0]
    return sorted((start for start in starts if meets[start]), key=lambda start: moves[start])


def _read_trips(path: Path) -> tuple[BoolArray, list[_Trip]]:
    """Returns the free cells [columns, rows] of a scenario's map, and its trips in file order.

    Raises
    ------
    ProblemError
        If the version line, a row or the map does not match the format; the message is one line
        that names the file.
    """
    with naming(path):
        lines = list(enumerate(read_text(path).splitlines(), start=1))
        version = lines[0][1].split() if lines else []
        _require(version in (["version", "1"], ["version", "1.0"]), "line 1", "must be 'version 1'")
        rows = [(line, _fields(text, line)) for line, text in lines[1:] if text.strip()]
        _require(len(rows) > 0, "rows", "must be at least one")
        names = {fields[1] for _, fields in rows}
        _require(len(names) == 1, "map", f"must be the same in all rows, not {len(names)} maps")
    # Some scenarios name the map by its path in the benchmark's own folders, or on Windows.
    map_file = path.parent / names.pop().replace("\\", "/").rpartition("/")[2]
    if not os.path.lexists(map_file):
        raise ProblemError(f"{map_file}: no such file; the map must be beside {path.name}")
    free = _read_map(map_file)
    with naming(path):
        return free, [_trip(fields, f"line {line}", free.shape) for line, fields in rows]


def _read_map(path: Path) -> BoolArray:
    """Returns an array [columns, rows] that is true where a cell of a `.map` file is free.

    Raises
    ------
    ProblemError
        If the header is not "type octile", "height H", "width W", "map", the rows do not have
        that shape, or a character is unknown; one line, naming the file.
    """
    with naming(path):
        lines = read_text(path).rstrip().splitlines()
        _require(len(lines) > 4, "header", "must be 'type octile', 'height', 'width', 'map', rows")
        kind, *sizes, end = (line.split() for line in lines[:4])
        # other programs write "tile"; which moves are allowed matters only to their own planners
        _require(kind in (["type", "octile"], ["type", "tile"]), "line 1", "must be 'type octile'")
        keys = ["width", "height"] if sizes[0][:1] == ["width"] else ["height", "width"]
        size = {
            key: _size(fields, f"line {line}", key)
            for line, (fields, key) in enumerate(zip(sizes, keys, strict=True), start=2)
        }
        rows, columns = size["height"], size["width"]
        _require(end == ["map"], "line 4", "must be 'map'")
        grid = lines[4:]
        _require(len(grid) == rows, "height", f"must be the number of rows {len(grid)}, not {rows}")
        for line, row in enumerate(grid, start=5):
            _require(len(row) == columns, f"line {line}", f"must have {columns} characters")
            known = set(row) <= set(FREE + BLOCKED)
            _require(
                known,
                f"line {line}",
                f"must contain only the characters {FREE} (free) and {BLOCKED} (blocked), not "
                f"{''.join(sorted(set(row) - set(FREE + BLOCKED)))[:10]!r}; replace these by . or "
                "@",
            )
        return np.array([[terrain in FREE for terrain in row] for row in grid]).T


def _require(condition: bool, field: str, allowed: str) -> None:
    if not condition:
        raise ProblemError(f"{field}: {allowed}")


def _size(fields: list[str], line: str, key: str) -> int:
    _require(len(fields) == 2 and fields[0] == key, line, f"must be '{key}' and a number")
    size = integer(fields[1], f"{line}, {key}")
    _require(size >= 1, f"{line}, {key}", f"must be >= 1, not {size}")
    return size


def _fields(text: str, line: int) -> list[str]:
    """Splits a row into bucket, map, width, height, start x, start y, goal x, goal y, length."""
    fields = text.split("\t") if "\t" in text else text.split()
    _require(len(fields) == 9, f"line {line}", f"must have 9 fields, not {len(fields)}")
    return fields


def _trip(fields: list[str], line: str, shape: tuple[int, ...]) -> _Trip:
    width, height, *ends = (integer(text, line) for text in fields[2:8])
    _require(
        (width, height) in (shape, (0, 0)),  # 0 0, as in `tunnel.scen`: not stated
        line,
        f"width and height must be those of the map, {shape[0]} {shape[1]}, not {width} {height}",
    )
    start, goal = (ends[0], ends[1]), (ends[2], ends[3])
    for x, y in (start, goal):
        inside = 0 <= x < shape[0] and 0 <= y < shape[1]
        _require(inside, line, f"start and goal must lie inside the map, not at ({x}, {y})")
    return _Trip(start, goal, number(fields[8], line))


def _shuffled(trips: list[_Trip], seed: int) -> list[_Trip]:
    if seed == 0:
        return trips
    # Of Python's random functions, only random() is guaranteed to give the same numbers later.
    rng = random.Random(seed)
    return sorted(trips, key=lambda _: rng.random())


def _distinct_starts(trips: Iterable[_Trip], free: BoolArray) -> Iterator[GridCell]:
    taken: set[GridCell] = set()
    for trip in trips:
        if free[trip.start] and trip.start not in taken:
            taken.add(trip.start)
            yield trip.start


def _walks(trips: Iterable[_Trip], graph: Graph) -> Iterator[list[GridCell]]:
    return (walk for trip in trips if (walk := trip.walk(graph)) is not None)


def _say_lengths(path: Path, trips: Iterable[_Trip], walks: Sequence[list[GridCell]]) -> None:
    """Logs a warning if rows of people state other lengths of shortest paths than the map has.

    A map of another version, or with its axes the other way round, would not be noticed otherwise.
    """
    stated = {(trip.start, trip.goal): trip.length for trip in trips}
    lengths = [
        (sum(math.dist(*ends) for ends in pairwise(walk)), stated[walk[0], walk[-1]])
        for walk in walks
    ]
    wrong = [(found, told) for found, told in lengths if told and abs(found - told) > _SAME_LENGTH]
    if wrong:
        log.warning(
            "%s: %d of %d rows of people state a shortest path of another length than on the map, "
            "such as %.6g instead of %.6g: is it the map for which they were made?",
            path, len(wrong), len(walks), wrong[0][1], wrong[0][0],
        )  # fmt: skip


def _paths(trips: Iterable[_Trip], graph: Graph) -> int:
    """Returns the number of trips whose ends are joined by a path."""
    import networkx as nx

    parts = enumerate(nx.connected_components(graph))
    part_of = {cell: k for k, cells in parts for cell in cells}
    return sum(part_of.get(trip.start, -1) == part_of.get(trip.goal, -2) for trip in trips)


def _robot(start: GridCell, walks: Sequence[Sequence[GridCell]], motion: Motion) -> Robot:
    """Returns a robot at `start` with the heading nearest to the direction of the nearest person.

    If several headings are equally near, the first is taken.
    """
    target = min((walk[0] for walk in walks), key=lambda at: math.dist(at, start), default=start)
    angle = math.atan2(target[1] - start[1], target[0] - start[0])
    heading = round(angle / (math.tau / motion.headings)) % motion.headings
    return Robot(start=State(*start, heading=heading), motion=motion)


def _poses(walk: list[GridCell], steps: int) -> FloatArray:
    """Returns the poses [T+1, 4] of an actor on its walk, in the middles of cells of 1 m."""
    poses = np.zeros((steps + 1, 4))
    cells = np.array(walk)
    moves = np.diff(cells, axis=0)
    times = np.arange(steps + 1)
    poses[:, :2] = cells[np.minimum(times, len(cells) - 1)] + 0.5
    if len(moves):  # after arrival, it keeps its last heading
        dx, dy = moves[np.minimum(times, len(moves) - 1)].T
        poses[:, 3] = angles_of(dy, dx)
    return poses
