"""A second exporter: computes the facts of a scene that an instance must contain, from the scene's
JSON alone.

Places, moves, turns, closed places, starts, goals, weights, rewards and rules are recomputed with
networkx and plain loops. No code is shared with the exporter or with planners: the input is the
dictionary that `json` makes of a scene's file. Views are checked by `enclosures`.

Meshes, whether solid or no-fly zones, must be upright prisms: with a level top, a level bottom, and
vertical sides. Others are rejected.
"""

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from fractions import Fraction
from itertools import product
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    import networkx as nx

    Graph = nx.DiGraph[Any]

Place = tuple[int, int, int]  # cell x, y, and layer of the drone's kind
Turned = tuple[int, int]  # heading and tilt
Point = tuple[float, float, float]  # m

_FACES = {"cuboid": 5, "triangulated-cuboid": 10}
_TOUCH = Fraction(1, 10**6)  # share of a cell by which a solid must reach into it
_TOLERANCE = 1e-6  # m, by which drones may be closer than a minimum distance
_STRAIN = 1e-9  # relative to the stride: tolerance for the length of a move
_UNSURE = 1e-9  # m; a comparison of distances within this tolerance is left undecided


class UnknownError(ValueError):
    """The scene has a feature that the second exporter does not support."""


class Position(NamedTuple):
    """Position of a place: its layer among all flight heights, and its offset in m from the map's
    first cell.
    """

    layer: int
    x: float
    y: float
    z: float


@dataclass(frozen=True)
class Kind:
    """Drones that fly and see alike, with everything that any of them reaches until the last step.

    Attributes
    ----------
    drones : numbers of the drones
    places : position of each place
    moves : tail and head of each move, and True if the move is balanced
    turns : pairs of orientations, from the first to the second
    closed_places, closed_moves : (step, place) and (step, tail, head) that people close
    unsure : places and moves so close to the minimum distance that they are left undecided
    reached : for each step, the places that drones reach, by orientation
    """

    drones: tuple[int, ...]
    places: dict[Place, Position]
    moves: set[tuple[Place, Place, bool]]
    turns: set[tuple[Turned, Turned]]
    closed_places: set[tuple[int, Place]] = field(default_factory=set)
    closed_moves: set[tuple[int, Place, Place]] = field(default_factory=set)
    unsure: set[tuple[Any, ...]] = field(default_factory=set)
    reached: tuple[dict[Place, set[Turned]], ...] = ()


@dataclass(frozen=True)
class Facts:
    """The facts of a scene or of an instance.

    Attributes
    ----------
    single : facts that consist of one value, by name
    weights : weight and cap of drones that count (0: pixels), of each group with a weight
    kinds : drones that fly and see alike
    starts, goals : starts and goal of each drone; None: it may end anywhere
    """

    single: dict[str, Any]
    weights: dict[int, tuple[float, int]]
    kinds: tuple[Kind, ...]
    starts: dict[int, set[tuple[int, ...]]]
    goals: dict[int, set[Place] | None]


def facts_of_scene(problem: dict[str, Any]) -> Facts:
    """Returns the facts of a scene.

    Parameters
    ----------
    problem : the content of its JSON file

    Raises
    ------
    UnknownError
        If the scene has a feature that is not supported here; the message names it.
    """
    objective, rules, robots = problem["objective"], problem["rules"], problem["robots"]
    views = objective["views"]
    faces = [_faces(actor["shape"]) for actor in problem["actors"]]
    rows = 1 if objective["over_time"] else problem["horizon"] + 1
    single = {
        "horizon": problem["horizon"],
        "rows of groups": rows,
        "faces": sum(faces),
        "people who count": len(faces) if views is not None else 0,
        "rewards for moves": tuple(
            float(objective[name])
            for name in ("stationarity", "keep_cell", "keep_heading", "balanced")
        ),
        "rules": tuple(
            float(rules[name]) for name in ("vertex", "swap", "separation", "vertical")
        ),
    }  # fmt: skip
    ground = _Ground(problem)
    of_kind: dict[str, list[int]] = {}
    for i, robot in enumerate(robots):
        of_kind.setdefault(repr((robot["motion"], robot["camera"])), []).append(i)
    flights = {i: _Flights(problem, ground, numbers) for numbers in of_kind.values()
               for i in numbers[:1]}  # fmt: skip
    kinds = tuple(flight.kind() for flight in flights.values())
    starts, goals = dict[int, set[tuple[int, ...]]](), dict[int, set[Place] | None]()
    for flight, kind in zip(flights.values(), kinds, strict=True):
        for i in kind.drones:
            starts[i], goal = flight.starts[i], robots[i]["goal"]
            cells = goal["cells"] if isinstance(goal, dict) else [goal]
            ends = {(x, y) for x, y in cells} if goal is not None else set()
            goals[i] = None if goal is None else {at for at in kind.places if at[:2] in ends}
    return Facts(single, _weights(problem, faces, rows), kinds, starts, goals)


def _faces(shape: dict[str, Any]) -> int:
    """Returns the number of faces of a person."""
    if shape["type"] == "prism":
        return int(shape["sides"]) + 1
    if shape["type"] not in _FACES:
        raise UnknownError(f"people of the shape {shape['type']}")
    return _FACES[shape["type"]]


def _weights(problem: dict[str, Any], faces: list[int], rows: int) -> dict[int, tuple[float, int]]:
    """Returns the weight of each group, and the cap of drones that count for it."""
    objective, steps, people = problem["objective"], problem["horizon"] + 1, problem["actors"]
    chances = {take["name"]: take["probability"] for take in problem["takes"]}
    found: dict[int, tuple[float, int]] = {}
    total, first = sum(faces), 0 if objective["count_start"] else 1
    views = objective["views"]
    for j, actor in enumerate(people):
        weights = actor["weights"] or [1.0] * faces[j]
        at, chance = sum(faces[:j]), chances[actor["take"]] if chances else 1.0
        for t in range(steps):
            importance = 1.0 if actor["importance"] is None else actor["importance"][t]
            worth = importance * chance
            if t >= first if rows > 1 else t == 0:
                for f, weight in enumerate(weights):
                    group = t * total + at + f
                    found[group] = (worth * weight * objective["pixels"], 0)
            if views is not None and t >= first:
                weight = views["weight"]
                each = weight[j] if isinstance(weight, list) else weight
                group = rows * total + t * len(people) + j
                found[group] = (worth * each, views["cameras"])
    return {group: entry for group, entry in found.items() if entry[0]}


_Triangle = list[tuple[Fraction, Fraction]]


class Prism(NamedTuple):
    """A solid between two altitudes above the triangles of its ground plan."""

    low: float
    high: float
    triangles: list[_Triangle]

    @classmethod
    def of(cls, mesh: dict[str, Any], noun: str) -> "Prism":
        """Returns a mesh as a prism; raises UnknownError if it is not one."""
        corners = mesh["vertices"]
        used = {int(k) for triangle in mesh["triangles"] for k in triangle}
        levels = sorted({corners[k][2] for k in used})
        refusal = UnknownError(f"{noun} that are not upright prisms")
        if len(levels) != 2:
            raise refusal
        tops, bottoms = list[_Triangle](), list[_Triangle]()
        for triangle in mesh["triangles"]:
            points = [corners[int(k)] for k in triangle]
            plan = [(Fraction(x), Fraction(y)) for x, y, _ in points]
            heights = {z for *_, z in points}
            if len(heights) == 1:
                (tops if heights == {levels[1]} else bottoms).append(plan)
            elif _doubled_area(plan):
                raise refusal
        top, bottom = (sum(abs(_doubled_area(plan)) for plan in part) for part in (tops, bottoms))
        if not top or top != bottom:
            raise refusal
        return cls(levels[0], levels[1], tops)

    def cells(self, height_map: dict[str, Any]) -> Iterator[tuple[int, int]]:
        """Yields the cells of the map into which the prism reaches."""
        edge, origin = Fraction(height_map["resolution"]), [*map(Fraction, height_map["origin"])]
        sizes = len(height_map["heights"]), len(height_map["heights"][0])
        found = set[tuple[int, int]]()
        for triangle in self.triangles:
            plan = [
                ((x - origin[0]) / edge, (y - origin[1]) / edge) for x, y in triangle
            ]  # in cells
            spans = [
                range(
                    max(math.floor(min(p[k] for p in plan)), 0),
                    min(math.floor(max(p[k] for p in plan)) + 1, sizes[k]),
                )
                for k in (0, 1)
            ]
            found |= {(i, j) for i, j in product(*spans) if _overlaps(plan, (i, j))}
        yield from found


def _doubled_area(plan: _Triangle) -> Fraction:
    """Returns twice the signed area of a triangle, negative if it is clockwise."""
    (ax, ay), (bx, by), (cx, cy) = plan
    return (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)


def _overlaps(plan: _Triangle, cell: tuple[int, int]) -> bool:
    """Returns True if a triangle, in cells, reaches into a cell by more than the tolerance."""
    polygon = plan
    for axis, sign in product((0, 1), (1, -1)):
        wall = cell[axis] + _TOUCH if sign > 0 else cell[axis] + 1 - _TOUCH
        beyond = [sign * (point[axis] - wall) for point in polygon]
        kept = []
        for k, (point, depth) in enumerate(zip(polygon, beyond, strict=True)):
            before, past = polygon[k - 1], beyond[k - 1]
            if (depth > 0) != (past > 0):
                share = past / (past - depth)
                kept.append((
                    before[0] + share * (point[0] - before[0]),
                    before[1] + share * (point[1] - before[1]),
                ))  # fmt: skip
            if depth > 0:
                kept.append(point)
        polygon = kept
        if not polygon:
            return False
    return True


class _Ground:
    """The map, and the solids and closed zones above each of its cells.

    Attributes
    ----------
    sizes : numbers of cells along x and y
    """

    def __init__(self, problem: dict[str, Any]) -> None:
        self._map, self._airspace = problem["height_map"], problem["airspace"]
        heights = self._map["heights"]
        self.sizes = len(heights), len(heights[0])
        self.edge = self._map["resolution"]
        self._zero = [self._map[name] for name in ("datum", "lift")]
        self._matter = self._spans(problem["meshes"], "meshes")
        self._zones = self._spans(self._airspace["no_fly"], "no-fly zones")
        self.layers = sorted({h for robot in problem["robots"] for h in robot["motion"]["layers"]})

    def _spans(
        self, meshes: list[dict[str, Any]], noun: str
    ) -> dict[tuple[int, int], list[tuple[float, float]]]:
        found: dict[tuple[int, int], list[tuple[float, float]]] = {}
        for mesh in meshes:
            prism = Prism.of(mesh, noun)
            for cell in prism.cells(self._map):
                found.setdefault(cell, []).append((prism.low, prism.high))
        return found

    def altitude(self, cell: tuple[int, int], height: float) -> float:
        """Returns the altitude (m) of a flight height in a cell."""
        x, y = cell
        datum, lift = self._zero
        if datum is None and lift is None:
            return height
        if datum is None or lift is None:
            return height + float((datum or lift)[x][y])
        return height + float(datum[x][y] + lift[x][y])

    def position(self, cell: tuple[int, int], height: float) -> Point:
        """Returns the position (m) of a drone at a flight height above a cell."""
        (x, y), origin = cell, self._map["origin"]
        return (
            origin[0] + (x + 0.5) * self.edge, origin[1] + (y + 0.5) * self.edge,
            self.altitude(cell, height),
        )  # fmt: skip

    def is_empty(self, cell: tuple[int, int], low: float, high: float) -> bool:
        """Returns True if a cell has no solid matter that reaches into or touches altitudes
        low..high.
        """
        x, y = cell
        spans = self._matter.get(cell, ())
        return self._map["heights"][x][y] < low and not _meets(spans, low, high)

    def is_open(self, cell: tuple[int, int], low: float, high: float) -> bool:
        """Returns True if neither a no-fly zone nor the ceiling closes altitudes low..high."""
        ceiling, datum = self._airspace["ceiling"], self._zero[0]
        if ceiling is not None:
            top = ceiling + (0.0 if datum is None else datum[cell[0]][cell[1]])
            if high > top:
                return False
        return not _meets(self._zones.get(cell, ()), low, high)


def _meets(spans: Iterable[tuple[float, float]], low: float, high: float) -> bool:
    return any(bottom <= high and top >= low for bottom, top in spans)


class _Near:
    """The places and moves that are too close to people.

    A drone is too close if, at some moment, its horizontal distance from the middle of a person is
    below one limit, and its vertical distance from the person below another.
    """

    def __init__(self, problem: dict[str, Any]) -> None:
        airspace = problem["airspace"]
        self._aside, self._above = airspace["people_aside"], airspace["people_above"]
        self._stray, self._people = airspace["people_stray"], problem["actors"]

    def __bool__(self) -> bool:
        return bool(self._aside)

    def of(self, t: int, tail: Point, head: Point | None = None) -> bool | None:
        """Returns True if a place at a step, or a move from that step on, is too close to a person.

        None: undecided, as the distance is almost equal to the minimum.
        """
        found = [self._to(actor, t, tail, head) for actor in self._people]
        return True if True in found else None if None in found else False

    def _to(self, actor: dict[str, Any], t: int, tail: Point, head: Point | None) -> bool | None:
        half = actor["shape"]["height"] / 2
        after = t if head is None else t + 1
        ends = [
            (place[0] - x, place[1] - y, place[2] - z - half)
            for place, (x, y, z, _) in (
                (tail, actor["poses"][t]), (head or tail, actor["poses"][after])
            )
        ]  # fmt: skip
        aside, above = self._aside + actor["swerve"] - _TOLERANCE, math.inf
        if self._above is not None:
            above = self._above + half - _TOLERANCE
        if head is not None and self._stray:
            aside += self._stray * math.hypot(head[0] - tail[0], head[1] - tail[1])
            above += self._stray * abs(head[2] - tail[2])
        if min(math.hypot(*end[:2]) for end in ends) > aside + math.dist(*ends) + 1:
            return False
        answers = {
            _passes(ends[0], ends[1], aside + more, above + more) for more in (-_UNSURE, _UNSURE)
        }
        return answers.pop() if len(answers) == 1 else None


def _passes(before: Point, after: Point, aside: float, above: float) -> bool:
    """Returns True if at some moment of a straight move both distances are below their limits."""
    (x, y, z), (dx, dy, dz) = before, (b - a for a, b in zip(before, after, strict=True))
    first, last = 0.0, 1.0
    square, slope = dx * dx + dy * dy, x * dx + y * dy
    rest = x * x + y * y - aside * aside
    if square == 0:
        if rest >= 0:
            return False
    else:
        inner = slope * slope - square * rest
        if inner <= 0:
            return False
        root = math.sqrt(inner)
        first, last = max(first, (-slope - root) / square), min(last, (-slope + root) / square)
    if dz == 0:
        if abs(z) >= above:
            return False
    elif math.isfinite(above):
        low, high = sorted(((-above - z) / dz, (above - z) / dz))
        first, last = max(first, low), min(last, high)
    return first < last or (square == 0 and dz == 0)


class _Flights:
    """All flights of drones of a kind."""

    def __init__(self, problem: dict[str, Any], ground: _Ground, drones: list[int]) -> None:
        self._problem, self._ground, self._drones = problem, ground, drones
        robot = problem["robots"][drones[0]]
        self._motion, self._tilts = robot["motion"], len(robot["camera"].get("tilts", [0.0]))
        self._near, self._answers = _Near(problem), dict[tuple[Any, ...], bool | None]()
        self.starts = {i: self._starts_of(problem["robots"][i]["start"]) for i in drones}

    def kind(self) -> Kind:
        """Returns the kind, with everything that its drones reach until the last step."""
        turns = self._turns()
        starts = {start for i in self._drones for start in self.starts[i]}
        space = self._grown({(x, y, layer) for x, y, layer, *_ in starts})
        reached = [_by_place(starts)]
        for t in range(self._problem["horizon"]):
            ahead: dict[Place, set[Turned]] = {}
            following: dict[frozenset[Turned], set[Turned]] = {}
            for tail, orientations in reached[-1].items():
                known = frozenset(orientations)
                if known not in following:
                    following[known] = {end for at in known for end in turns.successors(at)}
                for head in space.successors(tail):
                    if not self._near or not (
                        self._near_at(t + 1, head) or self._near_at(t, tail, head)
                    ):
                        ahead.setdefault(head, set()).update(following[known])
            reached.append(ahead)
        places = {place for step in reached for place in step}
        moves = {(a, b, bool(at["balanced"])) for a, b, at in space.edges(data=True)
                 if a in places and b in places}  # fmt: skip
        closed_places, closed_moves = self._closed(places, moves)
        unsure = {key for key, near in self._answers.items() if near is None}
        return Kind(
            tuple(self._drones),
            {place: self._position(place) for place in places},
            moves, set(turns.edges), closed_places, closed_moves, unsure, tuple(reached),
        )  # fmt: skip

    def _position(self, place: Place) -> Position:
        height = self._motion["layers"][place[2]]
        return Position(
            self._ground.layers.index(height),
            place[0] * self._ground.edge, place[1] * self._ground.edge,
            self._ground.altitude(place[:2], height),
        )  # fmt: skip

    def _point(self, place: Place) -> Point:
        return self._ground.position(place[:2], self._motion["layers"][place[2]])

    def _near_at(self, t: int, tail: Place, head: Place | None = None) -> bool:
        """Returns True if people close a place at a step, or a move from that step on."""
        key = (t, tail) if head is None else (t, tail, head)
        if key not in self._answers:
            end = None if head is None else self._point(head)
            self._answers[key] = self._near.of(t, self._point(tail), end)
        return bool(self._answers[key])

    def _closed(
        self, places: set[Place], moves: set[tuple[Place, Place, bool]]
    ) -> tuple[set[tuple[int, Place]], set[tuple[int, Place, Place]]]:
        """Returns the places and moves that people close, for all drones."""
        steps = range(self._problem["horizon"] + 1) if self._near else ()
        at_places = {(t, q) for t, q in product(steps, places) if self._near_at(t, q)}
        of_moves = {
            (t, tail, head) for t in steps[:-1] for tail, head, _ in moves
            if self._near_at(t, tail, head)
        }  # fmt: skip
        return at_places, of_moves

    def _is_free(self, place: Place) -> bool:
        """Returns True if a drone may be in a place, regardless of people."""
        x, y, _ = place
        if not (0 <= x < self._ground.sizes[0] and 0 <= y < self._ground.sizes[1]):
            return False
        at, gap = self._point(place)[2], self._motion["clearance"]
        ground, cell = self._ground, (x, y)
        return ground.is_empty(cell, at - gap, at + gap) and ground.is_open(cell, at, at)

    def _starts_of(self, start: Any) -> set[tuple[int, ...]]:
        """Returns the possible start states x, y, layer, heading, tilt of a drone."""
        if isinstance(start, list):
            return {tuple(start)}
        if start["type"] == "states":
            return {tuple(state) for state in start["states"]}
        if start["type"] != "area":
            raise UnknownError(f"starts of the type {start['type']}")
        sizes, motion = self._ground.sizes, self._motion
        cells = product(*map(range, sizes)) if start["cells"] is None else start["cells"]
        everything = (
            cells,
            range(len(motion["layers"])) if start["layers"] is None else start["layers"],
            range(motion["headings"]) if start["headings"] is None else start["headings"],
            range(self._tilts) if start["pitches"] is None else start["pitches"],
        )
        able: dict[Place, bool] = {}
        found = set[tuple[int, ...]]()
        for (x, y), layer, heading, tilt in product(*everything):
            place = x, y, layer
            if place not in able:
                near = self._near and self._is_free(place) and self._near.of(0, self._point(place))
                if near is None:
                    raise UnknownError("start areas at almost exactly the minimum distance from "
                                       "a person")  # fmt: skip
                able[place] = self._is_free(place) and not near
            if able[place]:
                found.add((x, y, layer, heading, tilt))
        return found

    def _grown(self, starts: set[Place]) -> "Graph":
        """Returns the graph of the places that drones could reach without any people."""
        import networkx as nx

        graph: Graph = nx.DiGraph()
        new = {place for place in starts if self._is_free(place)}
        known = set(new)
        for _ in range(self._problem["horizon"]):
            heads = set()
            for tail in new:
                for head, balanced in self._moves_from(tail):
                    graph.add_edge(tail, head, balanced=balanced)
                    heads.add(head)
            new = heads - known
            known |= new
        for tail in new:  # reached only at the last step: moves to unknown places are left out
            for head, balanced in self._moves_from(tail):
                if head in known:
                    graph.add_edge(tail, head, balanced=balanced)
        return graph

    def _moves_from(self, tail: Place) -> Iterator[tuple[Place, bool]]:
        """Yields the places that one step leads to from a place, each with True if the move is
        balanced.
        """
        motion = self._motion
        most = motion["radius"] - motion["radius"] % motion["spacing"]
        reach = range(-most, most + 1, motion["spacing"])
        for climb, dx, dy in product(range(-motion["climb"], motion["climb"] + 1), reach, reach):
            head = tail[0] + dx, tail[1] + dy, tail[2] + climb
            if 0 <= head[2] < len(motion["layers"]) and self._is_free(head) \
                    and self._may_pass(tail, head):  # fmt: skip
                yield head, dx + dy == 0

    def _may_pass(self, tail: Place, head: Place) -> bool:
        """Returns True if a drone may fly straight from one free place to another."""
        (x, y, _), ground, gap = tail, self._ground, self._motion["clearance"]
        altitudes = self._point(tail)[2], self._point(head)[2]
        low, high = min(altitudes), max(altitudes)
        dx, dy = head[0] - x, head[1] - y
        if not self._is_within_stride(ground.edge * math.hypot(dx, dy), high - low):
            return False
        passed = [(x + i, y + j) for i, j in _touched(dx, dy)]
        cut = self._motion["corner_cutting"]
        return all(
            ground.is_open(cell, low, high)
            and (cut or ground.is_empty(cell, low - gap, high + gap))
            for cell in passed
        )

    def _is_within_stride(self, aside: float, rise: float) -> bool:
        stride = self._motion["stride"] or {}
        lengths = {"aside": aside, "upright": rise, "space": math.hypot(aside, rise)}
        return all(
            stride.get(name) is None or length <= stride[name] * (1 + _STRAIN)
            for name, length in lengths.items()
        )

    def _turns(self) -> "Graph":
        """Returns the graph of orientations; its edges are the turns of one step."""
        import networkx as nx

        motion, tilts = self._motion, self._tilts
        graph: Graph = nx.DiGraph()
        turn, pitch = motion["turn"], motion["pitch_turn"]
        ways = [*product(range(-turn, turn + 1), range(-pitch, pitch + 1))]
        for heading, tilt in product(range(motion["headings"]), range(tilts)):
            for left, down in ways:
                if 0 <= tilt + down < tilts:
                    after = ((heading + left) % motion["headings"], tilt + down)
                    graph.add_edge((heading, tilt), after)
        return graph


def _by_place(states: Iterable[tuple[int, ...]]) -> dict[Place, set[Turned]]:
    found: dict[Place, set[Turned]] = {}
    for x, y, layer, heading, tilt in states:
        found.setdefault((x, y, layer), set()).add((heading, tilt))
    return found


def _touched(dx: int, dy: int) -> list[tuple[int, int]]:
    """Returns the closed unit squares that a segment from (0, 0) to (dx, dy) touches."""
    if (dx, dy) not in _TOUCHED:
        _TOUCHED[dx, dy] = [*_squares_on(dx, dy)]
    return _TOUCHED[dx, dy]


_TOUCHED: dict[tuple[int, int], list[tuple[int, int]]] = {}


def _squares_on(dx: int, dy: int) -> Iterator[tuple[int, int]]:
    for i, j in product(range(-abs(dx), abs(dx) + 1), range(-abs(dy), abs(dy) + 1)):
        # parameters of the part of the segment in the square
        first, last = Fraction(0), Fraction(1)
        for way, centre in ((dx, i), (dy, j)):
            ends = [Fraction(2 * centre + side, 2) for side in (-1, 1)]
            if way:
                low, high = sorted(end / way for end in ends)
                first, last = max(first, low), min(last, high)
            elif not ends[0] <= 0 <= ends[1]:
                last = Fraction(-1)
        if first <= last:
            yield i, j
