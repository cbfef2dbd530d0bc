"""What coverage leaves out because it is surely not seen, or surely seen: never too much."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from strategies import WALL, examples, problems, shapes

from cocap_opt.data import FloatArray, IntArray
from cocap_opt.faces import FaceGeometry
from cocap_opt.model import Model
from cocap_opt.problem import Actor, Camera, Cone, Cuboid, Motion, Problem, Robot, State
from cocap_opt.projection import camera_axes, dot, frustum_distances, image_area, image_samples
from cocap_opt.sightlines import Known
from cocap_opt.survey import Survey
from cocap_opt.timegraph import TimeGraph, time_graph
from cocap_opt.views import BATCH_STATES, PinholeViews, eyes_at, make_views
from cocap_opt.visibility import rays_arrive, visible_share
from cocap_opt.workspace import HeightMap
from experiments.benchmarks.town import town

EVER = 10**15  # views, more than any survey waits for


def graph_of(problem: Problem) -> TimeGraph:
    """Graph of the first robot."""
    robot = problem.robots[0]
    return time_graph(problem.workspace, robot.motion, len(robot.camera.tilts))


def all_states(problem: Problem) -> IntArray:
    """All states on the map, those inside the ground as well."""
    graph, (width, depth) = graph_of(problem), problem.height_map.shape
    layer, x, y = graph.coordinates(np.arange(graph.n_places))
    inside = (x >= 0) & (x < width) & (y >= 0) & (y < depth) & (layer >= 0)
    inside &= layer < len(graph.motion.layers)
    return np.flatnonzero(np.tile(inside, graph.n_orientations))


def surveyed(problem: Problem) -> tuple[FaceGeometry, Survey]:
    """Geometry with all that is known without rays."""
    geometry = FaceGeometry(problem)
    survey = geometry.survey(problem.robots[0].motion.layers)
    for _ in range(1000):
        survey.ask(EVER)
    return geometry, survey


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
    owners, which = problem.face_owner, np.array([face])
    orientation, place = divmod(state, graph.n_places)
    eye = eyes_at(problem.height_map, graph, np.array([place]))
    if dot(eye[0] - faces.polygons[face, 0], faces.normals[face]) <= 0:
        return 0.0
    axes = camera_axes(graph.motion.headings, camera)[orientation]
    relative = faces.polygons[face] - eye[0]
    polygon = np.stack([dot(relative, axis) for axis in axes], axis=-1)[None]
    with np.errstate(over="ignore", invalid="ignore"):
        area = min(image_area(polygon, camera)[0], float(camera.width * camera.height))
    if not area > 0:
        return 0.0
    share = visible_share(faces.occluders, eye, faces.samples, which, owners)[0]
    inside = (frustum_distances(polygon, camera) >= 0).all()
    if share < 1 and (share > 0 or not inside):
        points, weights = image_samples(polygon, camera, problem.face_samples)
        share = 0.0
        for local, weight in zip(points[0], weights[0], strict=True):
            if weight:
                at = eye + local[0] * axes[0] + local[1] * axes[1] + local[2] * axes[2]
                arrives = rays_arrive(faces.occluders, eye, at, owners[which])[0]
                share += weight * float(arrives)
        share = min(share, 1.0)
    result: float = area * share / faces.areas[face]
    return result


def assert_nothing_is_lost(problem: Problem, states: IntArray, t: int = 1) -> None:
    """The batch, with and without a survey, is the slow way's result to the last bit."""
    expected = slow_coverage(problem, t, states).tobytes()
    for geometry in (FaceGeometry(problem), surveyed(problem)[0]):
        views = make_views(geometry, problem, graph_of(problem), problem.robots[0].camera)
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


def known_and_rays(problem: Problem, t: int = 1) -> tuple[Known, FloatArray]:
    """What is known [P, A] from all places, and the visible share [P, F] of all faces by rays."""
    geometry, survey = surveyed(problem)
    assert survey.whole
    graph, faces = graph_of(problem), geometry.at(t)
    places = np.unique(all_states(problem) % graph.n_places)
    eyes = eyes_at(problem.height_map, graph, places)
    ways = faces.bodies.centres - eyes[:, None]
    known = survey.known(graph.coordinates(places), ways[..., :2], faces.bodies.radii)
    eye, face = (part.ravel() for part in np.indices((len(places), len(faces.areas))))
    share = visible_share(faces.occluders, eyes[eye], faces.samples, face, problem.face_owner)
    turned = dot(eyes[eye] - faces.polygons[face, 0], faces.normals[face]) <= 0
    # A face turned away is hidden by its own actor, and nobody asks.
    return known, np.where(turned, np.nan, share).reshape(len(places), -1)


@examples(60)
@given(rough_maps())
def test_what_is_known_is_what_rays_find(problem: Problem) -> None:
    """No ray arrives at an actor that is said to be hidden; all do at one said to be clear."""
    known, share = known_and_rays(problem)
    owners = problem.face_owner
    assert not (known.hidden & known.clear).any()
    assert not (known.hidden[:, owners] & (share > 0)).any()
    assert not (known.clear[:, owners] & (share < 1)).any()


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
    known, _ = known_and_rays(walled(WALL, gap, height=1.0))
    hidden = known.hidden.reshape(12, 9)
    assert not hidden[:7].any()
    assert hidden[8:].mean() > 0.9


@pytest.mark.parametrize(("top", "height"), [(5.5, 7.0), (4.9, 1.0)])
def test_over_a_low_wall_nobody_is_surely_hidden(top: float, height: float) -> None:
    """A wall hides who is lower than it, from eyes that are; and nobody is clear behind it."""
    known, _ = known_and_rays(walled(top, 1.0, height))
    assert not known.hidden.any()
    assert not known.clear.reshape(12, 9)[7:].any()


@examples(25)
@given(rough_maps(), st.data())
def test_a_survey_changes_no_view(problem: Problem, data: st.DataObject) -> None:
    """States anywhere, inside the ground as well, see the same with and without a survey."""
    states = data.draw(st.permutations(all_states(problem).tolist()))[:8]
    assert_nothing_is_lost(problem, np.array(states))


@examples(15)
@given(problems(), st.data())
def test_random_problems_lose_nothing(problem: Problem, data: st.DataObject) -> None:
    """Small problems of all kinds, gimbals included: as face by face."""
    if not isinstance(problem.robots[0].camera, Cone):
        states = data.draw(st.permutations(all_states(problem).tolist()))[:8]
        assert_nothing_is_lost(problem, np.array(states), t=problem.horizon)


def test_much_is_known_in_a_town() -> None:
    """In streets nearly everybody is surely hidden or surely in the open: few rays are left."""
    known, share = known_and_rays(town(0, robots=1, actors=4, cells=50, steps=1, resolution=2.5))
    in_the_air = ~np.isnan(share).all(axis=1)
    assert known.hidden[in_the_air].mean() > 0.5
    assert known.clear[in_the_air].sum() > 50
    assert (known.hidden | known.clear)[in_the_air].mean() > 0.5


def test_who_looks_at_few_states_does_not_pay_for_a_survey() -> None:
    """A survey is begun only for many views, and goes on bit by bit; all who ask share it."""
    problem = town(0, robots=2, actors=3, cells=30, steps=2, resolution=2.5)
    model = Model(problem, use_cache=False)
    (group,) = model.classes
    geometry = FaceGeometry(problem)
    survey = geometry.survey(group.spec.motion.layers)
    states = all_states(problem)

    def ask(count: int) -> None:
        views = make_views(geometry, problem, group.graph, group.spec.camera)
        assert isinstance(views, PinholeViews)
        for _ in range(count):
            views.coverage(1, states[:BATCH_STATES])

    ask(1)
    assert not survey.started
    ask(20)
    assert survey.started and not survey.whole
    ask(40)
    assert survey.whole
