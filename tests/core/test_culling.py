"""What is seen past terrain and other actors, against an oracle that cuts every face slowly."""

import math
from typing import Any

import numpy as np
import pytest
from exact_views import exact_coverage, exact_faces
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.typing import NDArray
from pool import problems
from strategies import WALL, Calls, examples, shapes

from cocap_opt.data import IntArray
from cocap_opt.experiments.lab.studies.coverage.town import town
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
    State,
)
from cocap_opt.stop import LimitReached
from cocap_opt.vision import coverage, faces
from cocap_opt.vision.bodies import Bodies
from cocap_opt.vision.candidates import Skyline
from cocap_opt.vision.coverage import CoverageTable, GrowingTable
from cocap_opt.vision.faces import FaceGeometry, Reach
from cocap_opt.vision.seen import SeenColumns
from cocap_opt.vision.shadows import Shadows
from cocap_opt.vision.viewpoints import Viewpoints
from cocap_opt.vision.views import StateViews
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


def assert_exact(problem: Problem, states: IntArray, t: int = 1) -> None:
    """What is seen from states is what the oracle finds, face by face."""
    graph = graph_of(problem)
    views = StateViews.of(FaceGeometry(problem), problem, graph, problem.robots[0].camera)
    pixels, people = views.coverage(t, states), views.people(t * graph.n_states + states)
    angles = np.zeros((2, len(states), len(problem.actors)))
    angles[:, people.rows, people.people] = people.visible, people.unhidden
    for k, state in enumerate(states.tolist()):
        faces = exact_faces(problem, 0, t, graph.state(state))
        expected = np.array([face.pixels / face.area for face in faces])
        # The oracle subtracts hidden areas from areas, at most those of the image.
        atol = 1e-6 * max([1.0, *pixels[k]])
        np.testing.assert_allclose(pixels[k], expected, rtol=1e-6, atol=atol)
        exact = np.zeros((2, len(problem.actors)))
        for face in faces:
            exact[:, face.actor] += face.visible, face.unhidden
        exact[1, angles[0, k] == 0] = 0.0  # of those who are not seen nobody asks
        np.testing.assert_allclose(angles[:, k], exact, rtol=1e-6, atol=1e-8)


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


@examples(35)
@given(close_ups())
def test_nothing_that_is_in_an_image_is_lost(problem: Problem) -> None:
    """Actors behind, beside and astride the camera, at an edge or around it: as face by face."""
    start, graph = problem.robots[0].start, graph_of(problem)
    here = graph.index(start) % graph.n_places
    states = np.arange(graph.n_orientations) * graph.n_places + here
    assert_exact(problem, states)


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
    assert_exact(problem, state)
    assert any(exact_coverage(problem, 0, 1, State(2, 2))) == (off > 0)


def test_slivers_are_hidden_like_the_faces_that_they_are_cut_from() -> None:
    """From just above roofs, of a person as high as these: what one leaves over, others hide.

    Only a face that lies in a roof's plane as a whole is not hidden by it.
    """
    heights = np.zeros((5, 6))
    heights[0, 1:3], heights[2, 3:5], heights[3, 2], heights[4, 2] = 2.0, 2.0, 2.0, 2.0
    heights[0, 2] += 1e-12
    heights[2, 3] += 1e-12
    heights[4, 2] -= 1e-12
    camera = Camera(width=1600, height=900, focal=150.0, tilts=(0.04,))
    motion = Motion(headings=8, layers=(2.0000001,))
    box = Cuboid(length=1.0, width=1.0, height=2.0)
    problem = Problem(
        name="",
        height_map=HeightMap(heights=heights, resolution=2.5),
        robots=(Robot(start=State(3, 0), motion=motion, camera=camera),),
        actors=(Actor(poses=np.tile([10.6318, 6.8874, 0.0, 0.0], (2, 1)), shape=box),),
        horizon=1,
    )
    graph = graph_of(problem)
    views = StateViews.of(FaceGeometry(problem), problem, graph, camera)
    (seen,) = views.coverage(1, np.array([graph.index(State(3, 0))]))
    expected = exact_coverage(problem, 0, 1, State(3, 0))
    assert 0 < max(expected[:4]) < 1e-6 < expected[4]  # the top is seen from 1e-7 m above
    np.testing.assert_allclose(seen, expected, atol=1e-6)


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


@examples(15)
@given(rough_maps(), st.data())
def test_rough_maps_lose_nothing(problem: Problem, data: st.DataObject) -> None:
    """States anywhere, inside the ground as well, see the same as face by face."""
    states = data.draw(st.permutations(all_states(problem).tolist()))[:8]
    assert_exact(problem, np.array(states))


@st.composite
def hills(draw: st.DrawFn) -> Problem:
    """Maps on which every cell has a height of its own, and people stand on the ground."""
    width, depth = draw(st.integers(2, 12)), draw(st.integers(2, 12))
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    x, y = np.indices((width, depth)) / draw(st.sampled_from([1.0, 3.0]))
    height, rough = draw(st.sampled_from([(4.0, 0.3), (1.0, 1.0), (0.2, 0.01)]))
    ground = height * np.sin(x) * np.cos(y) + rough * rng.random((width, depth))
    resolution = draw(st.sampled_from([0.3, 1.0, 2.5]))
    actors = []
    for _ in range(draw(st.integers(1, 3))):
        place = rng.uniform(0, [width, depth])
        foot = ground[tuple(place.astype(int))]
        actors.append(Actor(poses=np.tile([*place * resolution, foot, 0.4], (2, 1))))
    layers = draw(st.sampled_from([(0.5,), (3.0, 9.0), (2.0, 40.0)]))
    camera = Camera(width=800, height=600, focal=300.0, tilts=(0.3,))
    return Problem(
        name="",
        height_map=HeightMap(heights=ground, resolution=resolution, datum=ground),
        robots=(Robot(start=State(0, 0), motion=Motion(headings=4, layers=layers), camera=camera),),
        actors=tuple(actors),
        horizon=1,
    )


@examples(25)
@given(hills(), st.data())
def test_hills_lose_nothing(problem: Problem, data: st.DataObject) -> None:
    """Where many columns hide somebody together, what is seen is the same as face by face."""
    states = data.draw(st.permutations(all_states(problem).tolist()))[:8]
    assert_exact(problem, np.array(states))


def test_columns_hide_together_what_none_of_them_hides() -> None:
    """Rows of columns that are narrower than somebody behind them leave nothing to cut out."""
    heights = np.zeros((30, 31))
    # Of different heights, so that they are not merged.
    heights[12:16] = 8.0 + 0.01 * np.arange(4 * 31).reshape(4, 31)
    problem = Problem(
        name="",
        height_map=HeightMap(heights=heights, resolution=0.2),
        robots=(Robot(start=State(0, 15), motion=Motion(headings=4, layers=(1.0,))),),
        actors=(Actor(poses=np.tile([4.5, 3.1, 0.0, 0.3], (2, 1))),),
        horizon=1,
    )
    eye = np.array([[0.1, 2.4, 1.0]])
    geometry = FaceGeometry(problem)
    faces = geometry.at(1)
    corners, eyes = faces.corners[0] - (eye - geometry.origin)[:, None], eye - geometry.origin
    skyline = Skyline(corners, eyes)
    counts, _ = skyline.sift(faces.candidates.of(np.array([0]), eyes), faces.candidates.bodies)
    assert skyline.hidden.all() and not counts.any()
    everything = np.arange(len(faces.candidates.bodies.offsets))
    same = np.zeros_like(everything)
    shadows = Shadows.of(faces.candidates.bodies, everything, eyes[same])
    _, holds_all = shadows.sides(shadows.excess(corners[same]))
    assert not holds_all.any()


@examples(15)
@given(problems(), st.data())
def test_random_problems_lose_nothing(problem: Problem, data: st.DataObject) -> None:
    """Small problems of all kinds, gimbals included: as face by face."""
    assume(not (isinstance(problem.robots[0].camera, Cone) or problem.meshes))
    states = data.draw(st.permutations(all_states(problem).tolist()))[:8]
    assert_exact(problem, np.array(states), t=problem.horizon)


@examples(30)
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
    graph, alone = graph_of(problem), problem.replace(actors=problem.actors[:1])
    here = np.array([graph.index(State(0, 20))])
    assert_exact(problem, here)
    both, one = (
        StateViews.of(FaceGeometry(p), p, graph, p.robots[0].camera).coverage(1, here)[0, :5].sum()
        for p in (problem, alone)
    )
    assert both < one


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
    views = StateViews.of(
        FaceGeometry(problem), problem, graph_of(problem), problem.robots[0].camera
    )
    assert_exact(problem, states)
    assert (views.coverage(1, states)[:, :5].sum(axis=1) > 0).all()


def places_seen(top: float, gap: float, height: float) -> list[float]:
    """Share of a long wall's neighbour that is seen from each cell of a row across the wall.

    The wall is at x = 15..17.5 m; somebody stands in its middle, a gap before it.
    """
    heights = np.zeros((12, 9))
    shape = Cuboid(length=0.1, width=0.1, height=height)
    open_field = Problem(
        name="",
        height_map=HeightMap(heights=heights, resolution=2.5),
        robots=(Robot(start=State(0, 4), motion=Motion(headings=4)),),  # at 5 m
        actors=(Actor(poses=np.tile([15.0 - gap, 11.25, 0.0, 0.0], (2, 1)), shape=shape),),
        horizon=1,
    )
    heights = heights.copy()
    heights[6] = top
    walled = open_field.replace(height_map=HeightMap(heights=heights, resolution=2.5))
    graph = graph_of(open_field)
    states = np.array([graph.index(State(x, 4, 0, 0 if x < 6 else 2)) for x in range(12)])
    seen = []
    for problem in (walled, open_field):
        views = StateViews.of(FaceGeometry(problem), problem, graph, problem.robots[0].camera)
        seen.append(views.coverage(1, states).sum(axis=1))
    assert_exact(walled, states)
    behind, whole = seen
    return [float(a / b) for a, b in zip(behind, whole, strict=True) if b]


@pytest.mark.parametrize("gap", [0.15, 0.5, 1.0])
def test_before_a_wall_nobody_is_hidden(gap: float) -> None:
    """Who stands close to a wall is hidden from behind it, and not from before it."""
    shares = places_seen(WALL, gap, height=1.0)
    assert set(shares[:3]) == {1.0} and set(shares[-3:]) == {0.0}


def test_who_looks_over_a_wall_is_partly_seen() -> None:
    """Somebody taller than a wall behind which he stands is neither hidden nor clear."""
    assert all(0 < share < 1 for share in places_seen(5.5, 1.0, height=7.0)[-3:])


def grows(threads: int, batch: int, patch: pytest.MonkeyPatch) -> tuple[GrowingTable, list[int]]:
    """A table of a small town in batches of so many views, and the numbers of places in each."""
    problem = town(0, robots=2, actors=3, cells=30, steps=3, resolution=2.5)
    model = Model(problem, plain=True)
    (robot_class,) = model.classes
    views, n_places = model.views(robot_class), robot_class.graph.n_places
    patch.setattr(type(views), "batch", batch)
    sizes, look = list[int](), views.look

    def counted(at: Viewpoints) -> SeenColumns:
        sizes.append(len(at.places))
        return look(at)

    patch.setattr(views, "look", counted)
    return GrowingTable(views, n_places, model.reachable(robot_class), 1, threads), sizes


def assert_equal(one: CoverageTable, other: CoverageTable) -> None:
    """They are equal to the last bit."""
    assert len(one.nodes)
    for mine, theirs in zip(one, other, strict=True):
        assert mine.tobytes() == theirs.tobytes()


@examples(30)
@given(st.one_of(hills(), rough_maps(), problems()), st.integers(0, 2**32 - 1))
def test_bodies_that_are_not_between_hide_nothing(problem: Problem, seed: int) -> None:
    """With few bodies listed, those that may be in the way, the same is seen to the last bit."""
    graph, rng = graph_of(problem), np.random.default_rng(seed)
    states = rng.permutation(all_states(problem))[:12]
    geometry, camera = FaceGeometry(problem), problem.robots[0].camera
    anywhere = StateViews.of(geometry, problem, graph, camera, plain=True)
    places = anywhere.eyes(states % graph.n_places)[:, :2]
    for starts, growth in ((places, 0.0), (places[:1], 1e3), (places[:1], 1.0)):
        reach = Reach.around(starts, growth)
        within = StateViews.of(geometry, problem, graph, camera, plain=True, reach=reach)
        for one, other in zip(anywhere.seen(states), within.seen(states), strict=True):
            assert one.tobytes() == other.tobytes()


def test_few_bodies_are_listed_where_eyes_are_near(monkeypatch: pytest.MonkeyPatch) -> None:
    """A step's lists have no column that is beside all ways; few steps are kept, and more made."""
    problem = town(0, robots=2, actors=3, cells=60, steps=8, resolution=2.5)
    heights = problem.height_map.heights
    rough = heights + np.random.default_rng(0).random(heights.shape)
    problem = problem.replace(height_map=problem.height_map.replace(heights=rough))
    geometry = FaceGeometry(problem)
    reach = Reach.around(np.zeros((1, 2)), 2.5)
    few = geometry.between(8, 8, reach).candidates.nbytes
    assert few < geometry.between(8, 8).candidates.nbytes / 2
    assert geometry.between(8, 8, reach) is geometry.between(8, 8, reach)
    assert geometry.room(8, (1, 3), 2, reach) >= 12 * few
    monkeypatch.setattr(faces, "_KEPT_BYTES", 0.0)
    first = geometry.between(0, 0)
    for step in range(4):
        assert geometry.between(0, 0) is first
        geometry.between(step + 1, step + 1)
    for step in range(4):
        geometry.between(step + 5, step + 5)
    assert geometry.between(0, 0) is not first


@pytest.mark.parametrize("threads", [1, 2, 5])
def test_a_table_does_not_depend_on_threads_and_batches(
    threads: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Entry by entry the same, to the last bit."""
    few, small = grows(1, 10**9, monkeypatch)
    few.grow()
    many, sizes = grows(threads, 60, monkeypatch)
    many.grow()
    assert len(small) == 1 and len(sizes) > 10
    assert_equal(few.table(), many.table())


@pytest.mark.parametrize("column", range(4))
@pytest.mark.parametrize("is_given", [False, True])
def test_a_column_that_cannot_grow_doubles_no_row(
    column: int, is_given: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where memory ends while a step is taken up, the table is as before, and can grow later."""
    whole, _ = grows(1, 60, monkeypatch)
    whole.grow()
    broken, _ = grows(1, 60, monkeypatch)
    append, calls = broken._columns[column].append, list[int]()

    def fails_once(part: NDArray[Any], numbers: IntArray, ahead: float) -> None:
        calls.append(len(numbers))
        append(part, numbers, ahead)
        if len(calls) == 2:
            raise MemoryError

    monkeypatch.setattr(broken._columns[column], "append", fails_once)
    with pytest.raises(MemoryError):
        broken.grow()
    steps = broken.steps
    if is_given:
        assert len(broken.table().nodes) < len(whole.table().nodes)
    assert 1 < steps < whole.steps
    broken.grow()
    assert broken.steps == whole.steps
    assert_equal(broken.table(), whole.table())


@pytest.mark.parametrize(
    ("sizes", "groups"),
    [
        ([3, 3, 3, 3], [[0, 1, 2], [3]]), ([8, 3, 12, 3, 7], [[0], [1], [2], [3, 4]]),
        ([0, 0, 4, 0, 4], [[2], [4]]), ([25], [[0]]), ([0], []), ([10, 10], [[0], [1]]),
    ],
)  # fmt: skip
def test_no_step_is_split_over_two_groups(sizes: list[int], groups: list[list[int]]) -> None:
    """Several steps are one batch; a step that is larger than a batch is alone."""
    assert list(coverage._groups(np.array(sizes), 10)) == groups
    expected = sum(-(-sum(sizes[t] for t in group) // 10) for group in groups)
    assert coverage.batches_of(np.array(sizes), 10) == expected


def test_a_table_that_was_given_stays_as_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    """One that a limit has ended is used, and grows on; progress is told in places at steps."""
    problem = town(0, robots=2, actors=3, cells=30, steps=3, resolution=2.5)
    model = Model(problem, plain=True)
    (robot_class,) = model.classes
    views, n_places = model.views(robot_class), robot_class.graph.n_places
    monkeypatch.setattr(type(views), "batch", 100)
    reachable, told = model.reachable(robot_class), list[tuple[int, int]]()
    growing = GrowingTable(views, n_places, reachable, 1, threads=1)
    with pytest.raises(LimitReached):
        growing.grow(Calls(3), lambda *numbers: told.append(numbers))
    assert 1 < growing.steps < len(reachable)
    early = growing.table()
    before = [column.copy() for column in early]
    growing.grow(progress=lambda *numbers: told.append(numbers))
    whole = growing.table()
    for column, copy, later in zip(early, before, whole, strict=True):
        np.testing.assert_array_equal(column, copy)
        np.testing.assert_array_equal(later[: len(copy)], copy)
    assert len(whole.nodes) > len(early.nodes)
    by_place = reachable[1:].reshape(len(reachable) - 1, -1, n_places)
    positions = int(by_place.any(axis=1).sum())
    assert told[0] == (0, positions) and told[-1] == (positions, positions)


@examples(30)
@given(seed=st.integers(0, 2**32 - 1), levels=st.integers(1, 50))
def test_columns_are_the_map(seed: int, levels: int) -> None:
    """They are as high as the cells below them, and no cell that is not lowest is below two."""
    rng = np.random.default_rng(seed)
    heights = rng.integers(0, levels, rng.integers(1, 9, 2)).astype(float)
    columns = Bodies.of_columns(HeightMap(heights=heights, resolution=1.0), np.zeros(3))
    painted, count = np.full(heights.shape, -1.0), np.zeros(heights.shape)
    for (x0, y0), (x1, y1, top) in zip(
        columns.low.astype(int).tolist(), columns.high.astype(int).tolist(), strict=True
    ):
        painted[x0:x1, y0:y1] = top
        count[x0:x1, y0:y1] += 1
    assert np.array_equal(painted, heights)
    assert np.array_equal(count, 1 + (heights > heights.min()))
