"""Hypothesis strategies for small problems, and the one tiny instance used everywhere."""

import math
import os
from functools import lru_cache

import networkx as nx
import numpy as np
from hypothesis import assume, settings
from hypothesis import strategies as st

from cocap_opt.data import ProblemError
from cocap_opt.graph.networks import time_expanded_graph
from cocap_opt.problem import (
    NO_RULES,
    VERTEX_ONLY,
    Actor,
    Airspace,
    AnyCamera,
    AnyStart,
    Camera,
    CollisionRules,
    Cone,
    Cuboid,
    Motion,
    Objective,
    Prism,
    Problem,
    Robot,
    Shape,
    StartArea,
    StartStates,
    State,
    TriangulatedCuboid,
)
from cocap_opt.problem.motion import Stride
from cocap_opt.stop import Limit, Stop
from cocap_opt.world.workspace import HeightMap, Mesh, Workspace

WALL = 20.0  # m, higher than anything flies
MOST_PLANS = 20_000  # combinations of paths that brute force goes through

# The share of all examples that property tests go through: 1 in the second suite, more in a hunt.
SHARE = float(os.environ.get("COCAP_OPT_EXAMPLES", "0.25"))


class Calls(Stop):
    """A limit that is reached when it has been asked so many times."""

    def __init__(self, most: float = math.inf) -> None:
        self.asked, self._most = 0, most

    def reached(self) -> Limit | None:
        """Count the question, and say whether the limit is reached."""
        self.asked += 1
        return Limit.TIME if self.asked > self._most else None


def examples(count: int) -> settings:
    """Settings for a property test: so many examples, times COCAP_OPT_EXAMPLES, but for a few."""
    return settings(max_examples=max(round(count * SHARE), min(count, 3)))


def tiny() -> Problem:
    """Two robots on both sides of a wall and one actor that walks past it; two steps."""
    heights = np.zeros((4, 3))
    heights[1, 1] = WALL
    motion = Motion(headings=4)
    camera = Camera(width=400, height=300, focal=200.0, tilts=(0.6,))
    poses = [[9.0, 4.0 + t, 0.0, 0.3 * t] for t in range(3)]
    return Problem(
        name="tiny",
        height_map=HeightMap(heights=heights, resolution=4.0),
        robots=(
            Robot(start=State(0, 0), motion=motion, camera=camera),
            Robot(start=State(3, 2, heading=2), motion=motion, camera=camera),
        ),
        actors=(Actor(poses=np.array(poses)),),
        horizon=2,
        face_samples=2,
    )


def standing(*pose: float, steps: int = 3) -> Actor:
    """Actor that does not move: x, y, z, yaw."""
    return Actor(poses=np.tile(np.array(pose), (steps + 1, 1)))


@st.composite
def height_maps(draw: st.DrawFn, most_cells: int = 6, walls: bool = True) -> HeightMap:
    """Small maps in a plane, with some blocked and some half-high cells."""
    width = draw(st.integers(1, 4))
    depth = draw(st.integers(1, max(1, most_cells // width)))
    kinds = st.sampled_from([0.0, 0.0, 0.0, 0.0, 4.0, WALL] if walls else [0.0])
    heights = draw(st.lists(kinds, min_size=width * depth, max_size=width * depth))
    hills = st.lists(st.sampled_from([0.0, 0.5, 3.0]), min_size=depth, max_size=depth)
    datum = draw(st.sampled_from([None, None, None, draw(hills)])) if walls else None
    return HeightMap(
        heights=np.reshape(heights, (width, depth)),
        resolution=4.0,
        datum=None if datum is None else np.tile(datum, (width, 1)),
    )


def plate(low: tuple[float, float], high: tuple[float, float], z: float) -> Mesh:
    """A level rectangle without thickness (m)."""
    (x0, y0), (x1, y1) = low, high
    vertices = np.array([[x0, y0, z], [x1, y0, z], [x1, y1, z], [x0, y1, z]])
    return Mesh(vertices=vertices, triangles=np.array([[0, 1, 2], [0, 2, 3]]))


@st.composite
def meshes(draw: st.DrawFn, height_map: HeightMap) -> tuple[Mesh, ...]:
    """Often none; otherwise a beam or a plate somewhere above the map, seldom both."""
    width, depth = (n * height_map.resolution for n in height_map.shape)
    made = []
    for kind in draw(st.sampled_from(["", "", "", "", "b", "p", "bp"])):
        x, y = (draw(st.integers(-1, 15)) / 16 * size + 0.071 for size in (width, depth))
        long, wide = draw(st.sampled_from([(1.0, 3.0), (0.2, depth), (5.0, 2.0)]))
        z = draw(st.sampled_from([1.0, 4.0, 7.0, 2.5]))
        if kind == "b":
            made.append(
                Mesh.box((x, y, z), (x + long, y + wide, z + draw(st.sampled_from([0.3, 4.0]))))
            )
        else:
            made.append(plate((x, y), (x + long, y + wide), z))
    return tuple(made)


@st.composite
def motions(draw: st.DrawFn, most_headings: int = 4, most_radius: int = 1) -> Motion:
    """Motions of few states; 4 m columns block the layer at 3 m only.

    Those with larger radii may have a spacing and a stride: in cells of 4 m, along the axes only or
    without a climb.
    """
    leap, stride = 1, None
    if most_radius > 1:
        leap = draw(st.sampled_from([1, 1, 1, 2]))
        stride = draw(st.sampled_from([None, None, Stride(aside=leap * 4.5), Stride(upright=1.0)]))
    return Motion(
        radius=leap * draw(st.integers(0, most_radius)) if most_radius > 1 else draw(st.just(1)),
        headings=draw(st.sampled_from([1, *range(1, most_headings + 1)])),
        turn=draw(st.integers(0, 2)),
        layers=draw(st.sampled_from([(5.0,), (5.0,), (3.0, 5.0), (3.0,), (3.0, 5.0, 9.0)])),
        climb=draw(st.integers(0, 2)),
        pitch_turn=draw(st.integers(0, 1)),
        clearance=draw(st.sampled_from([0.0, 0.0, 1.0])),
        corner_cutting=draw(st.booleans()),
        spacing=leap,
        stride=stride,
    )


@st.composite
def cameras(draw: st.DrawFn) -> Camera:
    """Wide cameras that look down enough to see something in a small map; some with a gimbal."""
    return Camera(
        width=draw(st.sampled_from([400, 800])),
        height=300,
        focal=draw(st.sampled_from([100.0, 200.0])),
        tilts=draw(st.sampled_from([(0.5,), (0.9,), (0.2, 1.0), (math.pi / 2,)])),
    )


def sensors() -> st.SearchStrategy[AnyCamera]:
    """Cameras, and now and then a cone."""
    cones = st.sampled_from([Cone(), Cone(opening=2.0)])
    return st.one_of(cameras(), cameras(), cameras(), cones)


def shapes() -> st.SearchStrategy[Shape]:
    """Actors of all shapes."""
    return st.sampled_from(
        [Cuboid(), Cuboid(length=2.0), Prism(), Prism(sides=3), TriangulatedCuboid()]
    )


@st.composite
def actors(draw: st.DrawFn, height_map: HeightMap, horizon: int) -> Actor:
    """Actor that walks straight through the map, at a place on no line of symmetry."""
    width, depth = (n * height_map.resolution for n in height_map.shape)
    inside = st.integers(0, 16)
    x, y = width * draw(inside) / 16 + 0.137, depth * draw(inside) / 16 - 0.211
    step = draw(st.sampled_from([(0.0, 0.0), (1.1, 0.3), (-0.7, 1.3)]))
    yaw, turn = draw(st.integers(-20, 20)) / 6.0, draw(st.sampled_from([0.0, 0.9]))
    shape = draw(shapes())
    weights = draw(st.sampled_from([None, None, 0.0, 2.5]))
    changing = tuple(draw(st.sampled_from([0.0, 1.0, 3.0])) for _ in range(horizon + 1))
    importance = draw(st.sampled_from([None, None, (2.0,) * (horizon + 1), changing]))
    rows = [[x + t * step[0], y + t * step[1], 0.0, yaw + t * turn] for t in range(horizon + 1)]
    return Actor(
        poses=np.array(rows),
        shape=shape,
        weights=None if weights is None else (weights, 0.5, *[1.0] * (len(shape.faces()) - 2)),
        importance=importance,
        swerve=draw(st.sampled_from([0.0, 0.0, 0.0, 0.4, 3.0])),
    )


def rules(resolution: float = 4.0) -> st.SearchStrategy[CollisionRules]:
    """Collision rules of all kinds."""
    return st.sampled_from(
        [
            NO_RULES,
            VERTEX_ONLY,
            CollisionRules(),
            CollisionRules(),
            CollisionRules(separation=1.2 * resolution),
            CollisionRules(swap=False, separation=1.6 * resolution),
            CollisionRules(separation=1.3 * resolution, vertical=3.0),
        ]
    )


@st.composite
def airspaces(draw: st.DrawFn, height_map: HeightMap) -> Airspace:
    """Mostly none; no-fly boxes of a cell or so, ceilings, and distances to people."""
    if draw(st.sampled_from([True, True, False])):
        return Airspace()
    width, depth = (n * height_map.resolution for n in height_map.shape)
    x, y = draw(st.floats(0, width)), draw(st.floats(0, depth))
    box = Mesh.box((x, y, draw(st.sampled_from([0.0, 4.0]))), (x + 3.0, y + 3.0, 7.0))
    aside = draw(st.sampled_from([0.0, 1.5, 4.5]))
    return Airspace(
        no_fly=draw(st.sampled_from([(), (box,)])),
        ceiling=draw(st.sampled_from([None, None, 5.0, 8.0])),
        people_aside=aside,
        people_above=draw(st.sampled_from([None, 1.0, 2.5])) if aside else None,
        people_stray=draw(st.sampled_from([0.0, 0.15, 0.5])) if aside else 0.0,
    )


@st.composite
def objectives(draw: st.DrawFn, over_time: bool = False) -> Objective:
    """Objectives of all kinds: rewards for moves are often 0, small, or all that matters."""
    kept = draw(st.sampled_from([(), (), ("keep_cell",), ("keep_heading",), ("balanced",),
                                 ("keep_cell", "keep_heading", "balanced")]))  # fmt: skip
    return Objective(
        stationarity=draw(st.sampled_from([0.0, 0.0, 0.5, 40.0])),
        count_start=draw(st.booleans()),
        over_time=over_time and draw(st.booleans()),
        **{name: draw(st.sampled_from([0.3, 7.0, 40.0])) for name in kept},
    )


@st.composite
def drawn_problems(
    draw: st.DrawFn,
    robots: st.SearchStrategy[int] = st.sampled_from([2, 2, 3, 1]),
    most_plans: int = MOST_PLANS,
    goals: bool = True,
    over_time: bool = False,
) -> Problem:
    """Problems small enough to go through all plans: several classes, rules, goals, layers.

    With `over_time` some of them add pixels up over time.
    """
    height_map = draw(height_maps())
    kinds = [
        (draw(motions(most_radius=draw(st.sampled_from([1, 1, 1, 2])))), draw(sensors()))
        for _ in range(draw(st.sampled_from([1, 1, 2])))
    ]  # [(motion, camera)]
    horizon = draw(st.integers(1, 3))
    seen = [draw(actors(height_map, horizon)) for _ in range(draw(st.sampled_from([0, 1, 1, 2])))]
    objective = draw(objectives(over_time))
    solid = draw(meshes(height_map))
    workspace = Workspace(height_map, solid)
    try:
        problem = Problem(
            name="random",
            height_map=height_map,
            meshes=solid,
            robots=draw(teams(workspace, kinds, draw(robots), goals)),
            actors=tuple(seen),
            horizon=horizon,
            rules=draw(rules()),
            airspace=draw(airspaces(height_map)),
            objective=objective,
            face_samples=draw(st.integers(1, 2)),
        )
    except ProblemError:
        assume(False)
    while problem.horizon > 1 and number_of_plans(problem) > most_plans:
        problem = problem.replace(horizon=problem.horizon - 1)
    assume(number_of_plans(problem) <= most_plans)
    return problem


@st.composite
def teams(
    draw: st.DrawFn,
    workspace: Workspace,
    kinds: list[tuple[Motion, AnyCamera]],
    size: int,
    goals: bool,
) -> tuple[Robot, ...]:
    """Robots of the given kinds in free places, often with a goal at another one's start."""
    flown = [draw(st.sampled_from(kinds)) for _ in range(size)]
    starts = []
    for motion, camera in flown:
        free = np.argwhere(motion.free_places(workspace)).tolist()
        taken = [(s.x, s.y) for s in starts]
        rest = [place for place in free if (place[1], place[2]) not in taken] or free
        assume(rest)
        layer, x, y = draw(st.sampled_from(rest))
        heading = draw(st.integers(0, motion.headings - 1))
        starts.append(State(x, y, layer, heading, draw(st.integers(0, len(camera.tilts) - 1))))
    ends = [None, None, None, *((s.x, s.y) for s in starts)] if goals else [None]
    fixed = tuple(
        Robot(start=start, motion=motion, camera=camera, goal=draw(st.sampled_from(ends)))
        for (motion, camera), start in zip(flown, starts, strict=True)
    )
    return fixed if draw(st.sampled_from([True, True, False])) else draw(with_choices(fixed))


@st.composite
def with_choices(draw: st.DrawFn, robots: tuple[Robot, ...]) -> tuple[Robot, ...]:
    """Some of the robots choose their start: all that may be as one of them, or each its own."""
    chosen: list[Robot] = []
    for robot in robots:
        alike = [other.start for other in chosen if other.motion == robot.motion]
        alike = [start for start in alike if other_fits(start, robot)]
        kind = draw(st.sampled_from(["fixed", "states", "area", *(["alike"] if alike else [])]))
        state, start = robot.start, robot.start
        assert isinstance(state, State)
        others = [other.start for other in robots if isinstance(other.start, State)]
        places = [(other.x, other.y) for other in others]
        if kind == "alike":
            start = draw(st.sampled_from(alike))
        elif kind == "states":
            turns = [state._replace(heading=k) for k in range(robot.motion.headings)]
            near = [state._replace(x=x, y=y) for x, y in places]
            few = draw(st.lists(st.sampled_from([*turns, *near]), max_size=2))
            start = StartStates(states=tuple(dict.fromkeys([state, *few])))
        elif kind == "area":
            cells = draw(st.sampled_from([None, tuple(dict.fromkeys(places))]))
            start = StartArea(
                cells=cells,
                layers=draw(st.sampled_from([None, (state.layer,)])),
                headings=draw(st.sampled_from([(state.heading,), (state.heading,), None])),
                pitches=draw(st.sampled_from([(state.pitch,), None])),
            )
        chosen.append(robot.replace(start=start))
    return tuple(chosen)


def other_fits(start: AnyStart, robot: Robot) -> bool:
    """True if what another robot starts in can be the choice of this one, too."""
    if isinstance(start, StartArea):
        return all(k < len(robot.camera.tilts) for k in start.pitches or ())
    states = [start] if isinstance(start, State) else start.states
    return len(states) > 1 and all(state.pitch < len(robot.camera.tilts) for state in states)


@st.composite
def drawn_meetings(draw: st.DrawFn, team: int = 2) -> Problem:
    """Robots in one another's way that see the same faces: conflicts, swaps, shared pixels.

    They fly over very few cells, look straight down with a wide view, and often have to
    change places.
    """
    shape = draw(st.sampled_from([(2, 1), (3, 1), (2, 2), (3, 2), (4, 1)]))
    heights = np.zeros(shape)
    if draw(st.booleans()):
        heights[draw(st.integers(0, shape[0] - 1)), -1] = WALL
    height_map = HeightMap(heights=heights, resolution=draw(st.sampled_from([2.0, 4.0])))
    motion = Motion(headings=1, layers=draw(st.sampled_from([(5.0,), (5.0,), (3.0, 5.0)])))
    down = Camera(width=500, height=400, focal=draw(st.sampled_from([60.0, 100.0])), tilts=(1.5,))
    kinds = draw(st.sampled_from([[(motion, down)], [(motion, down), (motion, Camera())]]))
    free = [(x, y) for x, y in np.ndindex(*shape) if heights[x, y] == 0.0]
    assume(len(free) >= team)
    cells = draw(st.permutations(free))[:team]
    ends = draw(st.sampled_from([[None] * team, [None] * team, cells[::-1], [*cells[1:], None]]))
    robots = []
    for (x, y), end in zip(cells, ends, strict=True):
        flown, camera = draw(st.sampled_from(kinds))
        layer = draw(st.integers(0, len(flown.layers) - 1))
        robots.append(Robot(start=State(x, y, layer), motion=flown, camera=camera, goal=end))
    if not draw(st.sampled_from([True, True, False])):
        robots = [*draw(with_choices(tuple(robots)))]
    horizon = draw(st.sampled_from([2, 3]))
    seen = [draw(actors(height_map, horizon)) for _ in range(draw(st.sampled_from([1, 1, 2, 0])))]
    objective = Objective(
        stationarity=draw(st.sampled_from([0.0, 0.0, 1.0, 10.0, 40.0])),
        keep_cell=draw(st.sampled_from([0.0, 0.0, 0.0, 3.0, 40.0])),
        balanced=draw(st.sampled_from([0.0, 0.0, 0.0, 2.0, 40.0])),
    )
    try:
        problem = Problem(
            name="meeting",
            height_map=height_map,
            robots=tuple(robots),
            actors=tuple(seen),
            horizon=horizon,
            rules=draw(rules(height_map.resolution)),
            objective=objective,
            face_samples=1,
        )
    except ProblemError:
        assume(False)
    while problem.horizon > 1 and number_of_plans(problem) > MOST_PLANS:
        problem = problem.replace(horizon=problem.horizon - 1)
    assume(number_of_plans(problem) <= MOST_PLANS)
    return problem


@lru_cache(maxsize=8)
def graph_of(problem: Problem, robot: int) -> "nx.DiGraph[tuple[State, int]]":
    """The time-expanded graph of a robot, for counting its paths and for going through them."""
    return time_expanded_graph(problem, robot)


@lru_cache(maxsize=1024)
def number_of_plans(problem: Problem) -> int:
    """Number of combinations of paths, one per robot, that reach their goals."""
    return math.prod(
        _number_of_paths(graph_of(problem, robot), problem.horizon)
        for robot in range(len(problem.robots))
    )


def _number_of_paths(graph: "nx.DiGraph[tuple[State, int]]", horizon: int) -> int:
    ahead = {node: 1 for node in graph if node[1] == horizon}
    for node in reversed(list(graph)):  # they are in the order of their steps
        if node[1] < horizon:
            ahead[node] = sum(ahead[head] for head in graph[node])
    return sum(count for node, count in ahead.items() if node[1] == 0)
