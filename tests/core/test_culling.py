"""What coverage leaves out because it is surely not seen, or surely seen: never too much."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from strategies import WALL, examples, problems, shapes

from cocap_opt.data import FloatArray, IntArray
from cocap_opt.experiments.studies.coverage.town import town
from cocap_opt.graph.timegraph import TimeGraph
from cocap_opt.model import Model
from cocap_opt.problem import (
    Actor,
    Camera,
    Cone,
    Cuboid,
    Motion,
    Problem,
    Robot,
    Shape,
    State,
)
from cocap_opt.vision.coverage import CoverageTable
from cocap_opt.vision.faces import FaceGeometry, Faces
from cocap_opt.vision.projection import Projection, dot
from cocap_opt.vision.views import make_views
from cocap_opt.vision.visibility import Occluders, Samples, rays_arrive
from cocap_opt.world.workspace import HeightMap


def graph_of(problem: Problem) -> TimeGraph:
    """Graph of the first robot."""
    robot = problem.robots[0]
    return TimeGraph.of(problem.workspace, robot.motion, len(robot.camera.tilts))


def all_states(problem: Problem) -> IntArray:
    """All states on the map, those inside the ground as well."""
    graph, (width, depth) = graph_of(problem), problem.height_map.shape
    layer, x, y = graph.coordinates(np.arange(graph.n_places))
    inside = (x >= 0) & (x < width) & (y >= 0) & (y < depth) & (layer >= 0)
    inside &= layer < len(graph.motion.layers)
    return np.flatnonzero(np.tile(inside, graph.n_orientations))


def slow_coverage(problem: Problem, t: int, states: IntArray) -> FloatArray:
    """Coverage [n, F]: one state and one face after the other, and nothing left out."""
    graph, geometry = graph_of(problem), FaceGeometry(problem)
    faces = range(len(problem.face_weights))
    views = [
        slow_view(problem, graph, geometry, t, state, face)
        for state in states.tolist()
        for face in faces
    ]
    return np.array(views).reshape(len(states), len(faces))


def slow_view(
    problem: Problem, graph: TimeGraph, geometry: FaceGeometry, t: int, state: int, face: int
) -> float:
    """Coverage of one face from one state, straight from its definition."""
    camera, faces = problem.robots[0].camera, geometry.at(t)
    assert isinstance(camera, Camera)
    projection = Projection(camera)
    owners, which = problem.face_owner, np.array([face])
    orientation, place = divmod(state, graph.n_places)
    eye = graph.positions(problem.height_map, np.array([place]))
    if dot(eye[0] - faces.polygons[face, 0], faces.normals[face]) <= 0:
        return 0.0
    axes = projection.axes(graph.motion.headings)[orientation]
    relative = faces.polygons[face] - eye[0]
    polygon = np.stack([dot(relative, axis) for axis in axes], axis=-1)[None]
    with np.errstate(over="ignore", invalid="ignore"):
        area = min(projection.area(polygon)[0], float(camera.width * camera.height))
    if not area > 0:
        return 0.0
    owner = owners[which]
    actors, points = np.arange(owner[0] + 1), faces.bodies.samples
    past_terrain = seen_of([faces.terrain], points, eye, owner, actors)
    if past_terrain == 0:
        return 0.0
    if past_terrain == 1 and seen_of([faces.actors], points, eye, owner, actors) == 1:
        return float(area / faces.areas[face])
    share = seen_of(faces.occluders, faces.samples, eye, which, owners)
    inside = (projection.frustum_distances(polygon) >= 0).all()
    if 0 < share < 1 and inside:
        share = seen_in_image(faces, eye, axes[2], which, owners)
    elif share < 1 and not inside:
        points, weights = projection.samples(polygon, problem.face_samples)
        share = 0.0
        for local, weight in zip(points[0], weights[0], strict=True):
            if weight:
                at = eye + local[0] * axes[0] + local[1] * axes[1] + local[2] * axes[2]
                arrives = rays_arrive(faces.occluders, eye, at, owner)[0]
                share += weight * float(arrives)
        share = min(share, 1.0)
    result: float = area * share / faces.areas[face]
    return result


def seen_of(
    occluders: list[Occluders], samples: Samples, eye: FloatArray, which: IntArray, owners: IntArray
) -> float:
    """Visible share of a face or of a body past some things, by its points."""
    seen = samples.seen(occluders, eye, which, owners)
    return float(samples.seen_share(which, seen)[0])


def seen_in_image(
    faces: Faces, eye: FloatArray, forward: FloatArray, which: IntArray, owners: IntArray
) -> float:
    """Visible share of the image of a face, by the points of the face."""
    _, points = faces.samples.of(which)
    seen = faces.samples.seen(faces.occluders, eye, which, owners)
    all_of_it = some_of_it = 0.0
    for point, arrives in zip(points, seen, strict=True):
        depth = dot(faces.samples.points[point] - eye[0], forward)
        weight = faces.samples.shares[point] / (depth * depth * depth)
        all_of_it += weight
        some_of_it += weight * float(arrives)
    return float(some_of_it / all_of_it)


def assert_nothing_is_lost(problem: Problem, states: IntArray, t: int = 1) -> None:
    """The batch is the slow way's result to the last bit."""
    expected = slow_coverage(problem, t, states).tobytes()
    views = make_views(FaceGeometry(problem), problem, graph_of(problem), problem.robots[0].camera)
    assert views.coverage(t, states).tobytes() == expected


# -- what is in the image -----------------------------------------------------------------


@st.composite
def close_ups(draw: st.DrawFn) -> Problem:
    """One camera and actors of all sizes around it: ahead, behind, aside, astride, inside."""
    number = st.one_of(st.floats(-6.0, 6.0), st.sampled_from([0.0, -0.5, 0.5, 1.0, -1.0]))
    size = st.sampled_from([0.1, 1.0, 4.0, 12.0])
    camera = Camera(
        width=draw(st.sampled_from([100, 800])),
        height=draw(st.sampled_from([100, 600])),
        focal=draw(st.sampled_from([50.0, 400.0, 3000.0])),
        tilts=draw(st.sampled_from([(0.0,), (0.4,), (-0.8, 1.1), (math.pi / 2,)])),
    )
    actors = [
        Actor(
            poses=np.tile(
                [2.5 + draw(number), 2.5 + draw(number), 5 + draw(number), draw(number)], (2, 1)
            ),
            shape=draw(
                st.one_of(shapes(), st.builds(Cuboid, length=size, width=size, height=size))
            ),
        )
        for _ in range(draw(st.integers(1, 3)))
    ]
    motion = Motion(headings=draw(st.sampled_from([1, 4, 8])))
    return Problem(
        name="",
        height_map=HeightMap(heights=np.zeros((5, 5))),
        robots=(Robot(start=State(2, 2), motion=motion, camera=camera),),
        actors=tuple(actors),
        horizon=1,
        face_samples=draw(st.integers(1, 2)),
    )


@examples(60)
@given(close_ups())
def test_nothing_that_is_in_an_image_is_lost(problem: Problem) -> None:
    """Actors behind, beside and astride the camera, at an edge or around it: as face by face."""
    start, graph = problem.robots[0].start, graph_of(problem)
    here = graph.index(start) % graph.n_places
    states = np.arange(graph.n_orientations) * graph.n_places + here
    assert_nothing_is_lost(problem, states)


@pytest.mark.parametrize("edge", [-1, 1])
@pytest.mark.parametrize("off", [-1e-9, 0.0, 1e-9, 0.01])
def test_the_edge_of_the_image(edge: int, off: float) -> None:
    """An actor that just reaches into the image, or just does not, is as face by face."""
    camera = Camera(width=800, height=600, focal=400.0, tilts=(0.0,))  # 45 degrees to each side
    box = Cuboid(length=1.0, width=1.0, height=2.0)
    # Its corner at depth 4 m (with the box's far side ahead) lies `off` within the image's edge.
    y = 2.5 + edge * (4.0 + 0.5 - off)
    problem = Problem(
        name="",
        height_map=HeightMap(heights=np.zeros((5, 5))),
        robots=(Robot(start=State(2, 2), motion=Motion(headings=4), camera=camera),),
        actors=(Actor(poses=np.tile([2.5 + 3.5, y, 4.0, 0.0], (2, 1)), shape=box),),
        horizon=1,
    )
    state = np.array([graph_of(problem).index(State(2, 2))])
    assert_nothing_is_lost(problem, state)
    assert slow_coverage(problem, 1, state).any() == (off > 0)


# -- what is hidden, what is clear --------------------------------------------------------


@st.composite
def rough_maps(draw: st.DrawFn) -> Problem:
    """Maps of walls, roofs and steps, flown over at several heights; actors anywhere."""
    width, depth = draw(st.integers(1, 12)), draw(st.integers(1, 12))
    kinds = draw(st.sampled_from([[0.0] * 6 + [WALL], [0.0, 0.0, 0.0, 2.0, 4.0, 5.0, WALL]]))
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    heights = rng.choice(kinds, size=(width, depth))
    resolution = draw(st.sampled_from([1.0, 2.5]))
    motion = Motion(headings=4, layers=draw(st.sampled_from([(5.0,), (3.0, 9.0), (4.0, 30.0)])))
    free = np.argwhere(heights < motion.layers[-1])
    ends = np.array([width, depth]) * resolution
    actors = []
    for _ in range(draw(st.integers(1, 4))):
        at = rng.uniform(-0.1, 1.1, 2) * ends
        if rng.random() < 0.4:  # in line with cells, where rays go through corners
            at = (np.floor(at / resolution) + 0.5) * resolution
        elif actors and rng.random() < 0.5:  # almost behind another one
            at = actors[-1].poses[0, :2] + rng.uniform(-1.5, 1.5, 2)
        pose = [*at, rng.choice([0.0, 0.0, 0.4, -1.0]), rng.choice([0.0, 0.7])]
        shape = draw(st.one_of(shapes(), st.just(Cuboid(length=0.2, width=0.2, height=7.0))))
        actors.append(Actor(poses=np.tile(pose, (2, 1)), shape=shape))
    x, y = free[0].tolist() if len(free) else (0, 0)
    heights[x, y] = min(heights[x, y], 0.0)
    camera = Camera(width=800, height=600, focal=300.0, tilts=(0.3,))
    return Problem(
        name="",
        height_map=HeightMap(heights=heights, resolution=resolution),
        robots=(Robot(start=State(x, y), motion=motion, camera=camera),),
        actors=tuple(actors),
        horizon=1,
        face_samples=draw(st.integers(1, 3)),
    )


@examples(25)
@given(rough_maps(), st.data())
def test_rough_maps_lose_nothing(problem: Problem, data: st.DataObject) -> None:
    """States anywhere, inside the ground as well, see the same as face by face."""
    states = data.draw(st.permutations(all_states(problem).tolist()))[:8]
    assert_nothing_is_lost(problem, np.array(states))


@examples(15)
@given(problems(), st.data())
def test_random_problems_lose_nothing(problem: Problem, data: st.DataObject) -> None:
    """Small problems of all kinds, gimbals included: as face by face."""
    if not isinstance(problem.robots[0].camera, Cone):
        states = data.draw(st.permutations(all_states(problem).tolist()))[:8]
        assert_nothing_is_lost(problem, np.array(states), t=problem.horizon)


def shares(problem: Problem, t: int = 1) -> tuple[FloatArray, FloatArray]:
    """Visible share of bodies [P, A] and of faces [P, F] from all places; nan if turned away."""
    geometry, graph = FaceGeometry(problem), graph_of(problem)
    faces, places = geometry.at(t), np.unique(all_states(problem) % graph.n_places)
    eyes, result = graph.positions(problem.height_map, places), []
    actors = np.arange(len(problem.actors))
    for samples, owners in ((faces.bodies.samples, actors), (faces.samples, problem.face_owner)):
        eye, which = (part.ravel() for part in np.indices((len(places), len(owners))))
        seen = samples.seen(faces.occluders, eyes[eye], which, owners)
        result.append(samples.seen_share(which, seen).reshape(len(places), -1))
    turned = dot(eyes[:, None] - faces.polygons[None, :, 0], faces.normals[None]) <= 0
    return result[0], np.where(turned, np.nan, result[1])


@pytest.mark.parametrize("height", [5.0, 25.0])
def test_a_few_points_of_somebody_tell_what_all_points_do(height: float) -> None:
    """Who seems wholly hidden or wholly in the open is so, but for slivers; most people are."""
    scene = town(0, robots=1, actors=6, cells=50, steps=1, resolution=1.0)
    (robot,) = scene.robots
    motion = robot.motion.replace(layers=(height,))
    body, face = shares(scene.replace(robots=(robot.replace(motion=motion),)))
    hidden, clear = body == 0, body == 1
    assert (hidden | clear).mean() > 0.8
    owners = scene.face_owner
    wrong = np.where(hidden[:, owners], face, np.where(clear[:, owners], 1 - face, 0.0))
    assert np.nanmean(wrong > 0) < 2e-3
    assert np.nanmean(wrong) < 2e-4


@examples(50)
@given(
    size=st.floats(0.2, 1.8),
    wide=st.floats(0.05, 1.0),
    turn=st.floats(0, 2 * math.pi),
    along=st.floats(0.05, 0.95),
    other=st.floats(0.3, 2.0),
)
def test_nobody_stands_unseen_before_somebody(
    size: float, wide: float, turn: float, along: float, other: float
) -> None:
    """Whoever stands wholly before an actor up to six times as wide is noticed."""
    behind = Cuboid(length=size, width=size * wide, height=1.8)
    before = Cuboid(length=other, width=other, height=2.5)
    reach = math.hypot(size, size * wide) / 2
    # Looked at along +x; the other one is within the width that the large one seems to have.
    wide_as_seen = (abs(math.sin(turn)) + wide * abs(math.cos(turn))) * size
    y = 20.5 + (along - 0.5) * wide_as_seen
    problem = Problem(
        name="",
        height_map=HeightMap(heights=np.zeros((60, 41))),
        robots=(Robot(start=State(0, 20), motion=Motion(headings=4, layers=(1.0,))),),
        actors=(
            Actor(poses=np.tile([50.0, 20.5, 0.0, turn], (2, 1)), shape=behind),
            Actor(poses=np.tile([50 - reach - other, y, 0.0, 0.0], (2, 1)), shape=before),
        ),
        horizon=1,
    )
    faces, graph = FaceGeometry(problem).at(1), graph_of(problem)
    here = np.array([graph.index(State(0, 20)) % graph.n_places])
    eye, one = graph.positions(problem.height_map, here), np.zeros(1, dtype=np.int64)
    assert seen_of([faces.actors], faces.bodies.samples, eye, one, np.arange(2)) < 1


@examples(50)
@given(
    shapes(), st.sampled_from([0.3, 0.5, 1.0, 2.5]), st.floats(0.2, 3.0), st.floats(0, 2 * math.pi)
)
def test_no_gap_between_points_is_wider_than_what_hides(
    shape: Shape, cell: float, other: float, turn: float
) -> None:
    """From any side, an upright strip as wide as a cell or as another actor covers some point."""
    beside = Cuboid(length=other, width=other, height=1.0)
    pose = np.tile([1.0, 1.0, 0.0, turn], (2, 1))
    problem = Problem(
        name="",
        height_map=HeightMap(heights=np.zeros((9, 9)), resolution=cell),
        robots=(Robot(start=State(0, 0)),),
        actors=(Actor(poses=pose, shape=shape), Actor(poses=pose, shape=beside)),
        horizon=1,
        face_samples=12,  # no actor is so large that its points are too few
    )
    samples = FaceGeometry(problem).at(1).bodies.samples
    across = np.sort(samples.points[: samples.counts[0], 1])
    assert np.diff(across).max() <= min(cell, other) + 1e-6


def test_who_is_behind_several_people_is_looked_at_face_by_face() -> None:
    """Others hide all points of somebody, and not all of them: the gap between them is seen."""
    shape = Cuboid(length=1.0, width=1.0, height=2.0)
    thin = Cuboid(length=0.1, width=0.34, height=6.0)
    # Three posts before the corners and the middle; a third of the person is between them.
    posts = [(9.0, 5.0 + y) for y in (-0.5, 0.0, 0.5)]
    actors = [Actor(poses=np.tile([11.0, 5.0, 0.0, 0.0], (2, 1)), shape=shape)]
    actors += [Actor(poses=np.tile([x, y, 0.0, 0.0], (2, 1)), shape=thin) for x, y in posts]
    problem = Problem(
        name="",
        height_map=HeightMap(heights=np.zeros((12, 10))),
        robots=(Robot(start=State(0, 4), motion=Motion(headings=4)),),
        actors=tuple(actors),
        horizon=1,
        face_samples=6,
    )
    states = np.array([graph_of(problem).index(State(0, y)) for y in (4, 5)])
    views = make_views(FaceGeometry(problem), problem, graph_of(problem), problem.robots[0].camera)
    assert_nothing_is_lost(problem, states)
    assert (views.coverage(1, states)[:, :5].sum(axis=1) > 0).all()


def walled(top: float, gap: float, height: float) -> Problem:
    """A long wall across x = 15..17.5 m, and somebody in its middle, a gap before it."""
    heights = np.zeros((12, 9))
    heights[6] = top
    shape = Cuboid(length=0.1, width=0.1, height=height)
    return Problem(
        name="",
        height_map=HeightMap(heights=heights, resolution=2.5),
        robots=(Robot(start=State(0, 4), motion=Motion(headings=4)),),  # at 5 m
        actors=(Actor(poses=np.tile([15.0 - gap, 11.25, 0.0, 0.0], (2, 1)), shape=shape),),
        horizon=1,
    )


@pytest.mark.parametrize("gap", [0.15, 0.5, 1.0])
def test_before_a_wall_nobody_is_hidden(gap: float) -> None:
    """Who stands close to a wall is hidden from behind it, and not from before it."""
    body, _ = shares(walled(WALL, gap, height=1.0))
    body = body.reshape(12, 9)
    assert (body[:6] == 1).all()
    assert (body[7:] == 0).all()


def test_who_looks_over_a_wall_is_partly_seen() -> None:
    """Somebody taller than a wall behind which he stands is neither hidden nor clear."""
    body, _ = shares(walled(5.5, 1.0, height=7.0))
    behind = body.reshape(12, 9)[7:]
    assert ((behind > 0) & (behind < 1)).all()


@pytest.mark.parametrize("threads", [1, 2, 5])
def test_a_table_does_not_depend_on_the_number_of_threads(threads: int) -> None:
    """Entry by entry the same, to the last bit."""
    problem = town(0, robots=2, actors=3, cells=30, steps=3, resolution=2.5)
    model = Model(problem, use_cache=False)
    (robot_class,) = model.classes
    tables = [
        CoverageTable.of_views(
            model.views(robot_class),
            robot_class.graph.n_places,
            model.reachable(robot_class),
            1,
            threads=n,
        )[0]
        for n in (1, threads)
    ]
    assert tables[0] is not None and tables[1] is not None
    for one, other in zip(*tables, strict=True):
        assert one.tobytes() == other.tobytes()
