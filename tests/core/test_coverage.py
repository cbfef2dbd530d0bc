"""Coverage: hand-computed views, invariances, clipping against other ways to compute it."""

import math
import os
import subprocess
import sys
from collections.abc import Sequence
from itertools import product
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import assume, given
from hypothesis import strategies as st
from pool import problems
from strategies import WALL, Calls, examples, shapes

from cocap_opt.data import FOCAL as FOCAL_RANGE
from cocap_opt.data import LARGEST, MOST_PIXELS, MOST_WEIGHT, SMALLEST, FloatArray
from cocap_opt.graph.timegraph import TimeGraph
from cocap_opt.model import Model
from cocap_opt.planners.joint import joint
from cocap_opt.planners.sequential import sequential
from cocap_opt.problem import (
    Actor,
    Camera,
    Cuboid,
    Motion,
    Objective,
    Plan,
    Prism,
    Problem,
    Robot,
    Shape,
    State,
    TriangulatedCuboid,
)
from cocap_opt.referee import check
from cocap_opt.scenarios import load_scene
from cocap_opt.vision.coverage import GrowingTable
from cocap_opt.vision.faces import FaceGeometry
from cocap_opt.vision.projection import Projection
from cocap_opt.vision.views import StateViews
from cocap_opt.world.workspace import HeightMap, Mesh

Corner = tuple[float, float, float]
FRONT, LEFT, BACK, RIGHT, TOP = range(5)  # faces of a cuboid; the front looks along its heading
FLYING = 5.0  # m
FOCAL, WIDTH, HEIGHT = 500.0, 800, 600  # px
LEVEL = Camera(width=WIDTH, height=HEIGHT, focal=FOCAL, tilts=(0.0,))
SLAB = Cuboid(length=0.2, width=1.0, height=1.0)  # m


def facing(x: float, y: float, z: float = FLYING - 0.5, yaw: float = math.pi) -> Actor:
    """A slab whose front looks along -x by default, toward cameras that look along +x."""
    return Actor(poses=np.tile([x, y, z, yaw], (2, 1)), shape=SLAB)


def make_scene(
    *actors: Actor,
    heights: FloatArray | None = None,
    camera: Camera = LEVEL,
    resolution: float = 1.0,
    origin: tuple[float, float] = (0.0, 0.0),
    samples: int = 3,
    headings: int = 8,
    layers: tuple[float, ...] = (FLYING,),
) -> Problem:
    """Scene on a 21 x 9 map whose robot stands in cell (0, 4): at x = 0.5 m, y = 4.5 m."""
    heights = np.zeros((21, 9)) if heights is None else heights
    motion = Motion(headings=headings, layers=layers)
    return Problem(
        name="",
        height_map=HeightMap(heights=heights, resolution=resolution, origin=origin),
        robots=(Robot(start=State(0, 4), motion=motion, camera=camera),),
        actors=actors,
        horizon=1,
        face_samples=samples,
    )


def seen_from(problem: Problem, *states: State, t: int = 1) -> FloatArray:
    """Coverage [n, F] of the first robot's states at step t."""
    robot = problem.robots[0]
    graph = TimeGraph.of(problem.workspace, robot.motion, len(robot.camera.tilts))
    views = StateViews.of(FaceGeometry(problem), problem, graph, robot.camera)
    return views.coverage(t, np.array([graph.index(state) for state in states], dtype=np.int64))


def seen(problem: Problem, state: State = State(0, 4)) -> list[float]:
    """Coverage [F] of one state, by default of the start."""
    coverage: list[float] = seen_from(problem, state)[0].tolist()
    return coverage


def at_range(distance: float, side: float = 0.0, up: float = 0.0) -> Actor:
    """Slab whose front lies `distance` ahead of the start camera, and so far aside and up."""
    return facing(0.5 + distance + SLAB.length / 2, 4.5 + side, FLYING - 0.5 + up)


# -- hand-computed views ------------------------------------------------------------------


@pytest.mark.parametrize("distance", [2.0, 5.0, 17.3, 400.0])
def test_face_on(distance: float) -> None:
    """A face seen face-on at range r covers f^2/r^2 px/m2; the other faces are not seen."""
    coverage = seen(make_scene(at_range(distance)))
    assert coverage[FRONT] == pytest.approx(FOCAL**2 / distance**2, rel=1e-9)
    assert coverage[LEFT:] == [0.0] * 4


@pytest.mark.parametrize(("side", "up"), [(1.5, 0.0), (0.0, -0.9), (-2.0, 1.0)])
def test_a_shift_parallel_to_the_image_changes_nothing(side: float, up: float) -> None:
    """A face parallel to the image plane covers f^2/r^2 px/m2 wherever in the image it is."""
    coverage = seen(make_scene(at_range(5.0, side, up)))
    assert coverage[FRONT] == pytest.approx((FOCAL / 5.0) ** 2, rel=1e-9)


@pytest.mark.parametrize("angle", [0.2, 0.7, 1.2, -0.5])
def test_oblique_faces_follow_the_cosine_law(angle: float) -> None:
    """A small far face turned by an angle covers cos(angle) f^2/r^2, in the limit exactly."""
    small = Cuboid(length=0.01, width=0.01, height=0.01)
    distance = 19.0
    pose = [0.5 + distance, 4.5, FLYING - 0.005, math.pi + angle]
    actor = Actor(poses=np.tile(pose, (2, 1)), shape=small)
    coverage = seen(make_scene(actor))
    whole = FOCAL**2 / distance**2
    assert coverage[FRONT] == pytest.approx(math.cos(angle) * whole, rel=2e-3)
    aside = LEFT if angle < 0 else RIGHT
    assert coverage[aside] == pytest.approx(abs(math.sin(angle)) * whole, rel=2e-3)


def test_the_top_seen_from_above() -> None:
    """Looking straight down from height h, a flat top covers f^2/h^2 px/m2, and only it."""
    camera = LEVEL.replace(tilts=(math.pi / 2,))
    actor = facing(0.5, 4.5, z=0.0)
    for heading in range(8):
        coverage = seen(make_scene(actor, camera=camera), State(0, 4, heading=heading))
        assert coverage[TOP] == pytest.approx(FOCAL**2 / (FLYING - 1.0) ** 2, rel=1e-9)
        assert coverage[:TOP] == [0.0] * 4


def test_tilt_looks_down() -> None:
    """A positive tilt moves the view below the horizon, a negative one above."""
    below = facing(0.5 + 5.0, 4.5, z=-0.5)  # its middle 5 m below the camera: 45 degrees
    tilts = (-math.pi / 4, 0.0, math.pi / 4)
    deep = np.full((21, 9), -9.0)
    scene = make_scene(below, heights=deep, camera=LEVEL.replace(tilts=tilts))
    up, level, down = (seen(scene, State(0, 4, pitch=pitch))[FRONT] for pitch in range(3))
    assert up == level == 0.0
    expected = FOCAL**2 / 50.0 / math.sqrt(2)
    assert down == pytest.approx(expected, rel=0.05)


@pytest.mark.parametrize("heading", range(8))
def test_headings_go_counter_clockwise(heading: int) -> None:
    """Heading k looks at 2 pi k / 8 counter-clockwise from +x: it sees what stands there."""
    yaw = 2 * math.pi * heading / 8
    x, y = 10.5 + 3 * math.cos(yaw), 4.5 + 3 * math.sin(yaw)
    narrow = LEVEL.replace(width=WIDTH // 2)
    scene = make_scene(facing(x, y, yaw=yaw + math.pi), camera=narrow)
    front = [seen(scene, State(10, 4, heading=k))[FRONT] for k in range(8)]
    expected = (FOCAL / (3 - SLAB.length / 2)) ** 2
    assert front[heading] == pytest.approx(expected, rel=1e-9)
    assert sum(value > 0 for value in front) == 1


@pytest.mark.parametrize(
    ("side", "up", "share"),
    [
        (5.0 * WIDTH / 2 / FOCAL, 0.0, 0.5),
        (-5.0 * WIDTH / 2 / FOCAL, 0.0, 0.5),
        (0.0, 5.0 * HEIGHT / 2 / FOCAL, 0.5),
        (5.0 * WIDTH / 2 / FOCAL, -5.0 * HEIGHT / 2 / FOCAL, 0.25),
        (5.0 * WIDTH / 2 / FOCAL + 0.25, 0.0, 0.25),
        (5.0 * WIDTH / 2 / FOCAL + 0.6, 0.0, 0.0),
        (0.0, 9.0, 0.0),
    ],
)
def test_faces_are_cut_at_the_edge_of_the_image(side: float, up: float, share: float) -> None:
    """Of a face that reaches out of the image only the share inside counts."""
    coverage = seen(make_scene(at_range(5.0, side, up)))
    assert coverage[FRONT] == pytest.approx(share * (FOCAL / 5.0) ** 2, rel=1e-9, abs=1e-9)


def test_behind_the_camera_nothing_is_seen() -> None:
    """What lies behind the camera is not mirrored into the image."""
    scene = make_scene(facing(15.5, 4.5))
    assert seen(scene, State(10, 4))[FRONT] > 0
    behind = make_scene(facing(5.5, 4.5, yaw=0.0), facing(5.5, 4.5, z=9.0, yaw=math.pi))
    assert seen(behind, State(10, 4)) == [0.0] * 10


def test_beside_and_behind_the_camera_a_face_is_cut() -> None:
    """Of a long face that reaches from behind the camera into its view only the front counts."""
    # A wall-like actor along the camera's right side, from 6 m behind it to 6 m ahead.
    shape = Cuboid(length=12.0, width=1.0, height=1.0)
    actor = Actor(poses=np.tile([10.5, 2.5, FLYING - 0.5, 0.0], (2, 1)), shape=shape)
    coverage = seen(make_scene(actor), State(10, 4))
    # The left face is 1.5 m aside. It enters the image at depth 1.5 f / (width / 2) = 1.875 m and
    # ends at depth 6; its height at depth x is f / x, its image point at u = 1.5 f / x.
    # Area = integral of (f / x) du = 1.5 f^2 / 2 (1 / 1.875^2 - 1 / 6^2).
    near, far = 1.5 * FOCAL / (WIDTH / 2), 6.0
    pixels = 1.5 * FOCAL**2 / 2 * (1 / near**2 - 1 / far**2)
    assert coverage[LEFT] == pytest.approx(pixels / 12.0, rel=1e-9)


def test_back_faces_are_not_seen() -> None:
    """A face turned away from the camera covers nothing, a face seen edge-on neither."""
    coverage = seen(make_scene(facing(10.0, 4.5, yaw=0.0)))
    assert coverage[FRONT] == coverage[LEFT] == coverage[RIGHT] == coverage[TOP] == 0.0
    assert coverage[BACK] > 0


def test_inside_an_actor_nothing_is_seen() -> None:
    """A camera inside an actor sees none of its faces: they all look away."""
    assert seen(make_scene(facing(0.5, 4.5))) == [0.0] * 5


# -- occlusion ----------------------------------------------------------------------------


def walled(low: int, high: int, top: float = WALL) -> FloatArray:
    """Map with a wall across at x = 5..6 m, over the cells y = low..high."""
    heights = np.zeros((21, 9))
    heights[5, low : high + 1] = top
    return heights


def test_behind_a_wall_nothing_is_seen() -> None:
    """A wall higher than the line of sight hides the whole face; a lower one hides nothing."""
    free = seen(make_scene(at_range(10.0)))[FRONT]
    assert seen(make_scene(at_range(10.0), heights=walled(0, 8)))[FRONT] == 0.0
    assert seen(make_scene(at_range(10.0), heights=walled(0, 8, top=4.0)))[FRONT] == free
    assert seen(make_scene(at_range(4.0), heights=walled(0, 8)))[FRONT] > 0  # before the wall


def test_half_behind_a_wall() -> None:
    """A wall that hides one half of a face, left or lower, leaves half of its pixels."""
    free = seen(make_scene(at_range(10.0)))[FRONT]
    # The wall ends at y = 4 m, half a metre right of the camera; its far side, 5.5 m ahead,
    # limits the view. On a face at 10 m that line is 0.5 * 10 / 5.5 m to the right.
    scene = make_scene(at_range(10.0, -0.5 * 10.0 / 5.5), heights=walled(0, 3))
    assert seen(scene)[FRONT] == pytest.approx(free / 2, rel=1e-9)
    # A wall as high as the camera hides the lower half of a face at the camera's height.
    scene = make_scene(at_range(10.0), heights=walled(0, 8, top=FLYING))
    assert seen(scene)[FRONT] == pytest.approx(free / 2, rel=1e-9)


def test_behind_another_actor() -> None:
    """An actor hides what is behind it, wholly or in part, and is itself seen whole."""
    shape = Cuboid(length=0.2, width=3.0, height=3.0)
    screen = Actor(poses=np.tile([6.0, 4.5, FLYING - 1.5, 0.0], (2, 1)), shape=shape)
    both = seen(make_scene(at_range(10.0), screen))
    assert both[FRONT] == 0.0
    assert both[5 + BACK] == seen(make_scene(screen))[BACK] > 0
    # Only the left half of the line of sight is blocked, or only the lower one.
    free = seen(make_scene(at_range(10.0)))[FRONT]
    aside = screen.replace(poses=screen.poses + np.array([0.0, 1.5, 0.0, 0.0]))
    below = screen.replace(poses=screen.poses - np.array([0.0, 0.0, 1.5, 0.0]))
    for part in (aside, below):
        part_seen = seen(make_scene(at_range(10.0), part))[FRONT]
        assert part_seen == pytest.approx(free / 2, rel=1e-9)


def test_a_robot_never_blocks_a_view() -> None:
    """Another robot in the line of sight changes nothing."""
    alone = make_scene(at_range(10.0))
    other = alone.robots[0].replace(start=State(5, 4))
    crowded = alone.replace(robots=(*alone.robots, other))
    assert seen(crowded) == seen(alone)


def test_actors_hide_at_their_own_step_only() -> None:
    """Occlusion uses the poses of the step that is looked at."""
    shape = Cuboid(length=0.2, width=3.0, height=3.0)
    poses = np.array([[6.0, 4.5, 3.5, 0.0], [6.0, 40.0, 3.5, 0.0]])
    scene = make_scene(at_range(10.0), Actor(poses=poses, shape=shape))
    assert seen_from(scene, State(0, 4), t=0)[0, FRONT] == 0.0
    assert seen_from(scene, State(0, 4), t=1)[0, FRONT] > 0.0


def partly_hidden(true_mesh: bool, samples: int = 3) -> tuple[float, float]:
    """The share of a face that is seen past a screen, and the share that should be.

    Parameters
    ----------
    true_mesh : the screen is a mesh that is not convex, which rays meet; else another actor
    """
    if true_mesh:  # the screen, and a plate far aside
        low, high = (5.4, 4.33, FLYING - 1.5), (5.6, 5.33, FLYING + 1.5)
        box, plate = Mesh.box(low, high), Mesh.box((5.4, 8.0, 0.0), (5.6, 8.5, 9.0))
        mesh = Mesh(
            vertices=np.concatenate([box.vertices, plate.vertices]),
            triangles=np.concatenate([box.triangles, plate.triangles + 8]),
        )
        scene = make_scene(at_range(10.0), samples=samples).replace(meshes=(mesh,))
    else:
        shape = Cuboid(length=0.2, width=1.0, height=3.0)
        screen = Actor(poses=np.tile([5.5, 4.83, FLYING - 1.5, 0.0], (2, 1)), shape=shape)
        scene = make_scene(at_range(10.0), screen)
    free = (FOCAL / 10.0) ** 2
    # The screen's near side, at 4.9 m, covers y > -0.17 there: y > -0.17 / 4.9 * 10 at 10 m.
    return seen(scene)[FRONT] / free, 0.5 - 0.17 * 10.0 / 4.9


def test_what_a_screen_leaves_is_exact() -> None:
    """The part of a face beside another actor is cut, not sampled."""
    share, true = partly_hidden(true_mesh=False)
    assert share == pytest.approx(true, rel=1e-9)


def test_past_meshes_views_converge() -> None:
    """More sight rays come closer to the true share of a face that a mesh partly hides."""
    errors = []
    for samples in (2, 8, 32):
        share, true = partly_hidden(true_mesh=True, samples=samples)
        errors.append(abs(share - true))
    assert errors[-1] < 0.02
    assert errors[-1] < errors[0]


def test_a_convex_mesh_is_exact() -> None:
    """A box among the meshes is cut like a column, whatever its triangles."""
    low, high = (5.4, 4.33, FLYING - 1.5), (5.6, 5.33, FLYING + 1.5)
    scene = make_scene(at_range(10.0)).replace(meshes=(Mesh.box(low, high),))
    true = 0.5 - 0.17 * 10.0 / 4.9
    assert seen(scene)[FRONT] == pytest.approx(true * (FOCAL / 10.0) ** 2, rel=1e-9)


# -- extremes -----------------------------------------------------------------------------


def touching(shape: Shape, point: Sequence[float], yaw: float, offset: float) -> Actor:
    """Actor whose own point `point` (m, from its foot) is where the start camera is."""
    x, y, z = point
    c, s = math.cos(yaw), math.sin(yaw)
    foot = [-(x * c - y * s), -(x * s + y * c), offset - z]
    return Actor(poses=np.tile([*foot, yaw], (2, 1)), shape=shape)


@pytest.mark.parametrize("tilt", [0.0, 0.5, -math.pi / 2, math.pi / 2])
@pytest.mark.parametrize(
    "shape",
    [
        Cuboid(),
        pytest.param(Prism(sides=8, apothem=2.0), marks=pytest.mark.slow),
        pytest.param(TriangulatedCuboid(), marks=pytest.mark.slow),
    ],
)
def test_a_face_at_the_camera_fills_the_image_at_most(shape: Shape, tilt: float) -> None:
    """A camera on a face, in its middle or at its corner, sees a part of its image, no more.

    Rounding decides there on which side of the face the camera is; there is no warning.
    """
    camera = Camera(width=80, height=60, focal=50.0, tilts=(tilt,))
    ways = ((0.0, -1e-310), (0.7, 0.0), (1e9, -1e-310))
    for face, (yaw, offset) in product(shape.faces()[::4], ways):
        for point in (face[0], face.mean(axis=0), face[:3].mean(axis=0)):
            actor = touching(shape, point.tolist(), yaw, offset)
            # Cell (0, 4) has its middle at (0, 0, 0).
            scene = make_scene(
                actor, camera=camera, origin=(-0.5, -4.5), heights=np.full((21, 9), -5.0),
                layers=(0.0,), samples=1,
            )  # fmt: skip
            faces = FaceGeometry(scene).at(1)
            views = seen_from(scene, *(State(0, 4, 0, heading) for heading in range(8)))
            assert (views * faces.areas <= 80 * 60 * (1 + 1e-12)).all()


FAR = st.one_of(
    st.sampled_from([0.0, 1e-310, 1e-9, 5e5 + 0.1, 1e8, -LARGEST, LARGEST]), st.floats(-9, 9)
)  # m
SIZE = st.one_of(st.sampled_from([SMALLEST, 1.0, LARGEST]), st.floats(SMALLEST, 9))  # m


@st.composite
def extreme_scenes(draw: st.DrawFn) -> Problem:
    """Scenes with the smallest and largest numbers that a problem may hold."""
    motion = Motion(headings=draw(st.sampled_from([1, 8])), layers=(draw(FAR.filter(_flies)),))
    shape = draw(
        st.one_of(
            st.builds(Cuboid, length=SIZE, width=SIZE, height=SIZE),
            st.builds(Prism, sides=st.sampled_from([3, 64]), apothem=SIZE, height=SIZE),
            st.builds(TriangulatedCuboid, length=SIZE, width=SIZE, height=SIZE),
        )
    )
    resolution, origin = draw(SIZE), (draw(FAR), draw(FAR))
    beside = draw(st.booleans())  # where there is something to be seen
    foot = [*origin, motion.layers[0]] if beside else [draw(FAR) for _ in range(3)]
    camera = Camera(
        width=draw(st.sampled_from([1, MOST_PIXELS])),
        height=MOST_PIXELS,
        focal=draw(st.sampled_from([*FOCAL_RANGE, 500.0])),
        tilts=(draw(st.sampled_from([0.0, 0.5, math.pi / 2])),),
    )
    poses = np.tile([*foot, draw(st.sampled_from([0.0, 0.7, LARGEST]))], (2, 1))
    heights = np.array([[-LARGEST, draw(FAR)], [LARGEST, -LARGEST]])
    return Problem(
        name="",
        height_map=HeightMap(heights=heights, resolution=resolution, origin=origin),
        robots=tuple(Robot(start=State(x, x), motion=motion, camera=camera) for x in range(2)),
        actors=(Actor(poses=poses, shape=shape, weights=(MOST_WEIGHT,) * len(shape.faces())),),
        horizon=1,
        objective=Objective(stationarity=MOST_WEIGHT, count_start=True),
        face_samples=draw(st.integers(1, 2)),
    )


def _flies(height: float) -> bool:
    return height > -LARGEST


@examples(20)
@given(extreme_scenes())
def test_extreme_numbers_have_a_finite_reward(problem: Problem) -> None:
    """Whatever numbers a problem may hold, each J is a number, and nothing warns on the way."""
    plan = Plan(paths=tuple((robot.start,) * 2 for robot in problem.robots))
    reward = check(problem, plan).reward
    assert 2 * MOST_WEIGHT <= reward < math.inf
    assert (FaceGeometry(problem).at(1).areas > 0).all()
    result = joint(problem)
    assert reward * (1 - 1e-9) <= result.value < math.inf


# -- invariances --------------------------------------------------------------------------


@st.composite
def scenes(draw: st.DrawFn, occluded: bool = True) -> Problem:
    """Scenes with two actors and some walls on a square map, one motion of 8 headings."""
    size = 5
    kinds = st.sampled_from([0.0, 0.0, 0.0, 2.0, WALL] if occluded else [0.0])
    heights = np.reshape(draw(st.lists(kinds, min_size=size**2, max_size=size**2)), (size, size))
    heights[:: size - 1, :: size - 1] = 0.0  # the corners, where robots start
    number = st.floats(0.3, 4 * size - 0.3).map(lambda x: round(x, 3) + 0.0137)
    shape = draw(shapes())
    actors = [
        Actor(
            poses=np.tile(
                [draw(number), draw(number), draw(st.sampled_from([0.0, 0.4])), draw(number)],
                (2, 1),
            ),
            shape=shape,
        )
        for _ in range(2 if occluded else 1)
    ]
    robot = Robot(
        start=State(0, 0),
        motion=Motion(layers=(3.0, 5.0)),
        camera=Camera(width=800, height=600, focal=300.0, tilts=(0.4, 1.1)),
    )
    return Problem(
        name="",
        height_map=HeightMap(heights=heights, resolution=4.0),
        robots=(robot,),
        actors=tuple(actors),
        horizon=1,
    )


def all_views(problem: Problem) -> FloatArray:
    """Coverage from every state [X, Y, layer, heading, pitch, F] of the first robot."""
    robot, (width, depth) = problem.robots[0], problem.height_map.shape
    sizes = (width, depth, len(robot.motion.layers), robot.motion.headings,
             len(robot.camera.tilts))  # fmt: skip
    states = [State(*map(int, index)) for index in np.ndindex(*sizes)]
    return seen_from(problem, *states).reshape(*sizes, -1)


def moved(problem: Problem, poses: list[FloatArray], heights: FloatArray) -> Problem:
    """The problem with its actors elsewhere and another map."""
    return problem.replace(
        height_map=problem.height_map.replace(heights=heights),
        actors=tuple(a.replace(poses=p) for a, p in zip(problem.actors, poses, strict=True)),
    )


@examples(12)
@given(scenes())
def test_rotated_scenes_look_the_same(problem: Problem) -> None:
    """Turning map, actors and headings by 90 degrees changes no view."""
    size = problem.height_map.shape[1] * problem.height_map.resolution
    poses = [
        np.column_stack([size - a.poses[:, 1], a.poses[:, 0], a.poses[:, 2],
                         a.poses[:, 3] + math.pi / 2])
        for a in problem.actors
    ]  # fmt: skip
    turned = moved(problem, poses, problem.height_map.heights[:, ::-1].T)
    # What was at cell (x, y) is now at (Y - 1 - y, x), and looks two headings further on.
    expected = np.roll(all_views(problem)[:, ::-1].swapaxes(0, 1), 2, axis=3)
    np.testing.assert_allclose(all_views(turned), expected, rtol=1e-6, atol=1e-6)


@examples(15)
@given(scenes(occluded=False))
def test_mirrored_scenes_look_mirrored(problem: Problem) -> None:
    """Mirroring actor, headings and positions mirrors the views, left and right faces swapped."""
    size = problem.height_map.shape[1] * problem.height_map.resolution
    poses = [
        np.column_stack([a.poses[:, 0], size - a.poses[:, 1], a.poses[:, 2], -a.poses[:, 3]])
        for a in problem.actors
    ]
    mirrored = all_views(moved(problem, poses, problem.height_map.heights[:, ::-1]))
    shape = problem.actors[0].shape
    order: Sequence[int]
    if isinstance(shape, Prism):
        order = [-k % shape.sides for k in range(shape.sides)] + [shape.sides]
    else:
        order = [FRONT, RIGHT, BACK, LEFT, TOP]
    headings = [-k % 8 for k in range(8)]
    here = all_views(problem)
    if isinstance(shape, TriangulatedCuboid):  # a cut mirrored is the other cut: add the halves
        mirrored, here = (v.reshape(*v.shape[:-1], 5, 2).sum(axis=-1) for v in (mirrored, here))
    expected = here[:, ::-1][:, :, :, headings][..., order]
    np.testing.assert_allclose(mirrored, expected, rtol=1e-9, atol=1e-6)


@pytest.mark.parametrize("far", [(3.0, -7.0, 0.0), (5e5, -4.5e5, 0.0), (4.4e6, 5e5, 3000.0)])
@examples(5)
@given(problem=scenes())
def test_shifted_scenes_look_the_same(far: tuple[float, ...], problem: Problem) -> None:
    """Where on earth a scene lies changes no view, also at coordinates of 5e5 m and more."""
    x, y, z = far
    shift, heights = np.array([*far, 0.0]), problem.height_map.heights
    robot = problem.robots[0]
    layers = tuple(height + z for height in robot.motion.layers)
    shifted = problem.replace(
        height_map=problem.height_map.replace(origin=(x, y), heights=heights + z),
        robots=(robot.replace(motion=robot.motion.replace(layers=layers)),),
        actors=tuple(a.replace(poses=a.poses + shift) for a in problem.actors),
    )
    np.testing.assert_allclose(all_views(shifted), all_views(problem), rtol=1e-6, atol=1e-6)


@examples(15)
@given(problems(), st.data())
def test_values_do_not_depend_on_the_batch(problem: Problem, data: st.DataObject) -> None:
    """A view has the same value, to the last bit, alone, in any batch, and in the table."""
    model = Model(problem, use_cache=False)
    for robot_class in model.classes:
        table, reachable = model.coverage(robot_class), model.reachable(robot_class)
        for t in range(problem.first_step, problem.horizon + 1):
            states = np.flatnonzero(reachable[t])
            batch = data.draw(st.permutations(states.tolist()))[:5]
            together = model.views(robot_class).coverage(t, np.array(batch, dtype=np.int64))
            for state, row in zip(batch, together, strict=True):
                alone = model.views(robot_class).coverage(t, np.array([state]))[0]
                assert alone.tobytes() == row.tobytes()
                stored = np.zeros(model.n_faces)
                view_sums, pixels = table.row(t * robot_class.graph.n_states + state)
                stored[view_sums - t * model.n_faces] = pixels
                assert stored.tobytes() == alone.tobytes()


@examples(12)
@given(problems())
def test_table_holds_what_is_seen_and_nothing_else(problem: Problem) -> None:
    """Rows are in order and never empty, and every stored number of pixels is positive."""
    model = Model(problem, use_cache=False)
    for robot_class in model.classes:
        table = model.coverage(robot_class)
        assert (np.diff(table.nodes) > 0).all()
        assert (np.diff(table.indptr) > 0).all()
        assert (table.pixels > 0).all()
        assert table.indptr[-1] == len(table.pixels) == len(table.view_sums)
        sums = table.row_sums(table.pixels)
        for node, total in zip(table.nodes.tolist(), sums.tolist(), strict=True):
            assert table.row(node)[1].sum() == pytest.approx(total)
        steps = table.nodes // robot_class.graph.n_states
        assert (np.repeat(steps, np.diff(table.indptr)) * model.n_faces <= table.view_sums).all()


# -- clipping -----------------------------------------------------------------------------

Point = tuple[float, float, float]


def scalar_area(polygon: list[Point], camera: Camera) -> float:
    """Image area of a polygon: one point at a time, one side after the other."""
    a, b = camera.width / 2 / camera.focal, camera.height / 2 / camera.focal
    for normal in ((-1.0, 0.0, a), (1.0, 0.0, a), (0.0, -1.0, b), (0.0, 1.0, b)):
        kept: list[Point] = []
        for p, q in zip(polygon, polygon[1:] + polygon[:1], strict=True):
            d, e = (sum(n * c for n, c in zip(normal, r, strict=True)) for r in (p, q))
            if d >= 0:
                kept.append(p)
            if (d < 0) != (e < 0):
                s = d / (d - e)
                x, y, z = (i + s * (k - i) for i, k in zip(p, q, strict=True))
                kept.append((x, y, z))
        polygon = kept
    if len(polygon) < 3:
        return 0.0
    image = [(camera.focal * x / z, camera.focal * y / z) for x, y, z in polygon if z > 0]
    following = image[1:] + image[:1]
    doubled = math.fsum(u * w - x * v for (u, v), (x, w) in zip(image, following, strict=True))
    return abs(doubled) / 2


@st.composite
def polygons(draw: st.DrawFn, fewest: int = 3, most: int = 8) -> list[Point]:
    """Convex polygons anywhere around the camera, by default of 3 to 8 corners."""
    number = st.floats(-6.0, 6.0)
    middle, first, second = (np.array([draw(number) for _ in range(3)]) for _ in range(3))
    middle[2] += draw(st.sampled_from([0.0, 6.0]))
    corners = draw(st.integers(fewest, most))
    angles = 2 * math.pi * np.arange(corners) / corners + draw(st.floats(0.0, 1.0))
    points = middle + np.cos(angles)[:, None] * first + np.sin(angles)[:, None] * second
    return [tuple(point) for point in points.tolist()]


@examples(165)
@given(polygons(), st.sampled_from([LEVEL, Camera(width=300, height=900, focal=77.0)]))
def test_clipping_agrees_with_a_scalar_algorithm(polygon: list[Point], camera: Camera) -> None:
    """The area of any polygon, also one around or behind the camera, is that of plain clipping."""
    points = np.array(polygon)
    normal = np.cross(points[1] - points[0], points[2] - points[0])
    # Of a line, or edge-on through the camera itself, the area is a quotient of two zeros.
    assume(np.linalg.norm(normal) > 1e-6)
    assume(abs(normal @ points[0]) > 1e-6 * np.linalg.norm(normal))
    expected = scalar_area(polygon, camera)
    area = Projection(camera).area(np.array([polygon]))[0]
    assert area == pytest.approx(expected, rel=1e-6, abs=1e-6)
    assert 0.0 <= area <= camera.width * camera.height * (1 + 1e-9)


@examples(30)
@given(st.lists(polygons(4, 4), min_size=1, max_size=6))
def test_clipping_is_independent_of_the_batch(batch: list[list[Point]]) -> None:
    """Each polygon of a batch has the area it has alone, to the last bit."""
    together = Projection(LEVEL).area(np.array(batch))
    alone = [Projection(LEVEL).area(np.array([polygon]))[0] for polygon in batch]
    assert together.tolist() == alone


def counted_pixels(polygon: FloatArray, camera: Camera) -> int:
    """Number of pixels whose ray through the middle hits a convex polygon."""
    u = np.arange(camera.width) + 0.5 - camera.width / 2
    v = np.arange(camera.height) + 0.5 - camera.height / 2
    rays = np.stack(np.broadcast_arrays(u[:, None], v[None, :], camera.focal), axis=-1)
    normal = np.cross(polygon[1] - polygon[0], polygon[2] - polygon[0])
    along = rays @ normal
    distance = (polygon[0] @ normal) / np.where(along == 0, np.nan, along)
    hits = rays * distance[..., None]
    inside = distance > 0
    for a, b in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        inside &= np.cross(b - a, hits - a) @ normal > 0
    return int(inside.sum())


@pytest.mark.parametrize("seed", range(12))
def test_area_is_the_number_of_pixels(seed: int) -> None:
    """The exact area is what counting pixels by casting one ray through each gives."""
    rng = np.random.default_rng(seed)
    camera = Camera(width=320, height=240, focal=150.0)
    first, second = rng.normal(size=(2, 3)) * 2
    middle = np.array([*rng.uniform(-2, 2, 2), rng.uniform(0.5, 6)])
    polygon = middle + np.array([-first - second, first - second, first + second, second - first])
    area = Projection(camera).area(polygon[None])[0]
    border = 2 * (camera.width + camera.height)
    assert counted_pixels(polygon, camera) == pytest.approx(area, rel=0.01, abs=border / 4)


def test_axes_are_right_handed_and_exact_at_right_angles() -> None:
    """Camera axes are orthonormal; right, up, forward of multiples of 90 degrees are exact."""
    axes = Projection(LEVEL.replace(tilts=(0.0, 0.3, math.pi / 2))).axes(8)
    assert axes.shape == (24, 3, 3)
    for right, up, forward in axes:
        np.testing.assert_allclose(np.cross(up, forward), -right, atol=1e-15)
        np.testing.assert_allclose([right @ up, up @ up, forward @ forward], [0, 1, 1], atol=1e-15)
    assert axes[0].tolist() == [[0, -1, 0], [0, 0, 1], [1, 0, 0]]
    assert axes[6].tolist() == [[1, 0, 0], [0, 0, 1], [0, 1, 0]]


# -- sight rays ---------------------------------------------------------------------------


def test_a_whole_face_in_the_open_is_wholly_visible() -> None:
    """A face's own edges and neighbours never hide part of it, from any side."""
    for shape in (Cuboid(), Prism(sides=12), TriangulatedCuboid()):
        actor = Actor(poses=np.tile([10.13, 4.41, 0.0, 0.77], (2, 1)), shape=shape)
        camera = Camera(width=10**5, height=10**5, focal=50.0, tilts=(0.3,))
        scene = make_scene(actor, camera=camera, layers=(0.5, 2.0, FLYING))
        bare = make_scene(actor, camera=camera, layers=(0.5, 2.0, FLYING), samples=1)
        np.testing.assert_allclose(all_views(scene), all_views(bare), rtol=1e-12)


@pytest.mark.parametrize("distance", [100.0, 1000.0, 4000.0])
def test_far_views_lose_nothing(distance: float) -> None:
    """The ray casting's single precision hides nothing of a face kilometres away."""
    heights = np.zeros((3, 3))
    actor = facing(distance, 15.0)
    problem = Problem(
        name="",
        height_map=HeightMap(heights=heights, resolution=10.0),
        robots=(Robot(start=State(0, 1), motion=Motion(), camera=LEVEL),),
        actors=(actor,),
        horizon=1,
    )
    expected = FOCAL**2 / (distance - SLAB.length / 2 - 5.0) ** 2
    assert seen(problem, State(0, 1))[FRONT] == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("altitude", [0.0, 100.0, 1500.1, 3000.0])
def test_altitude_hides_nothing(altitude: float) -> None:
    """Seen from 150 m away and 5 m above its foot, a top is whole at any height above the sea."""
    pose = [155.0, 15.0, altitude, 0.3]
    problem = Problem(
        name="",
        height_map=HeightMap(heights=np.full((17, 3), altitude), resolution=10.0),
        robots=(Robot(start=State(0, 1), motion=Motion(layers=(altitude + 5.0,)), camera=LEVEL),),
        actors=(Actor(poses=np.tile(pose, (2, 1))),),
        horizon=1,
    )
    # At depth d, h above: f^2 h / d^3 px/m2, in the limit of a small face.
    assert seen(problem, State(0, 1))[TOP] == pytest.approx(FOCAL**2 * 3.2 / 150**3, rel=1e-3)


@pytest.mark.parametrize(
    ("actors", "most"), [(0, 8192), (4, 8192), pytest.param(300, 256, marks=pytest.mark.slow)]
)
def test_limits_are_asked_for_often(actors: int, most: int) -> None:
    """The more actors there are, the fewer states are evaluated between two looks at a limit.

    300 actors once took half a minute of a time limit of two seconds.
    """
    scene = make_scene(*[facing(x / 10, 4.5) for x in range(10, 10 + actors)])
    model = Model(scene, plain=True)
    reachable = model.reachable(model.classes[0])
    states, most_at_once = int(reachable[1].sum()), model.views(model.classes[0]).batch
    stop = Calls()
    views, graph = model.views(model.classes[0]), model.classes[0].graph
    GrowingTable(views, graph.n_places, reachable, 1).grow(stop)
    assert most_at_once <= most
    assert stop.asked >= states / most_at_once


@pytest.mark.slow
@pytest.mark.parametrize("rays", [1, 7, 100])
def test_values_do_not_depend_on_the_rays_cast_at_once(
    rays: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """However many rays are cast at once, a view has the same value to the last bit."""
    actors = facing(6.0, 4.0), facing(7.0, 4.4, yaw=0.5), facing(4.0, 5.0, z=3.0)
    scene = make_scene(*actors, heights=walled(3, 5, 4.7), layers=(3.0, FLYING))
    plates = Mesh.box((3.0, 3.0, 0.0), (3.1, 3.5, 9.0)), Mesh.box((2.0, 4.0, 2.0), (2.1, 5.0, 4.0))
    rough = Mesh(
        vertices=np.concatenate([plate.vertices for plate in plates]),
        triangles=np.concatenate([plates[0].triangles, plates[1].triangles + 8]),
    )
    scene = scene.replace(meshes=(rough,))
    expected = all_views(scene)
    monkeypatch.setattr("cocap_opt.vision.surfaces.RAYS", rays)
    assert all_views(scene).tobytes() == expected.tobytes()


MANY_STEPS = """
import numpy as np
from cocap_opt.vision.surfaces import Surface
triangle = np.array([[[1.0, -9.0, -9.0], [1.0, 9.0, -9.0], [1.0, 0.0, 9.0]]])
steps = [Surface(triangle) for _ in range(1500)]
eye, way = np.zeros((1, 3)), np.array([[1.0, 0.0, 0.0]])
print({float(step.first_hit(eye, way)[0][0]) for step in steps})
"""


def test_a_scene_of_many_steps_fits_into_one_process() -> None:
    """Each step has its own ray casting scene; there may be thousands of them at once.

    An Embree device takes one of the 1024 keys that a process has for thread-local data, and
    one too many is a crash: scenes must share a device.
    """
    environment = os.environ | {"PYTHONPATH": str(Path(__file__).parents[2])}
    done = subprocess.run(
        [sys.executable, "-c", MANY_STEPS], env=environment, capture_output=True, text=True,
        check=False, timeout=60,
    )  # fmt: skip
    assert (done.returncode, done.stdout) == (0, "{1.0}\n")


@pytest.mark.parametrize("size", [1e-3, 1e-2, 1.0, 50.0])
def test_faces_of_any_size(size: float) -> None:
    """Coverage is per square metre: a face's size alone does not change it, face-on."""
    shape = Cuboid(length=size / 10, width=size, height=size)
    distance = 100.0
    pose = [0.5 + distance + size / 20, 4.5, FLYING - size / 2, math.pi]
    scene = make_scene(Actor(poses=np.tile(pose, (2, 1)), shape=shape))
    if size > FLYING:  # it would stand in the ground
        heights = np.full((21, 9), -100.0)
        scene = make_scene(*scene.actors, heights=heights)
    assert seen(scene)[FRONT] == pytest.approx(FOCAL**2 / distance**2, rel=1e-6)


def houses(rng: np.random.Generator, problem: Problem) -> list[tuple[Corner, Corner]]:
    """Wings of houses in the shape of an L, on a field, away from people and drones."""
    ends = np.array(problem.height_map.shape) * problem.height_map.resolution - 8.0
    starts = [problem.height_map.centre(r.start.x, r.start.y) for r in problem.robots]
    taken = np.array([*starts, *(xy for a in problem.actors for xy in a.poses[:, :2].tolist())])
    wings: list[tuple[Corner, Corner]] = []
    for _ in range(200):
        (x, y), (width, depth), height = (
            rng.uniform(0, ends),
            rng.uniform(2, 5, 2),
            rng.uniform(2, 7),
        )
        within = (taken > [x - 1, y - 1]) & (taken < [x + width + 1, y + depth + 2])
        if len(wings) < 8 and not within.all(axis=1).any():
            wings.append(((x, y, 0.0), (x + width, y + 1, height)))
            wings.append(((x, y + 1, 0.0), (x + 1, y + 1 + depth, height)))
    return wings


def as_mesh(boxes: list[tuple[Corner, Corner]]) -> Mesh:
    """Boxes as one mesh."""
    mesh = trimesh.util.concatenate([trimesh.creation.box(bounds=box) for box in boxes])
    return Mesh(vertices=np.array(mesh.vertices), triangles=np.array(mesh.faces))


@pytest.mark.long
def test_rays_past_meshes_are_near_what_is_exact() -> None:
    """J of plans among houses given as one mesh, against the same houses given wing by wing."""
    problem = load_scene("field", 1)
    wings = houses(np.random.default_rng(1), problem)
    sampled = problem.replace(meshes=(as_mesh(wings),))
    exact = problem.replace(meshes=tuple(as_mesh([wing]) for wing in wings))
    assert FaceGeometry.is_sampled(sampled) and not FaceGeometry.is_sampled(exact)
    plan, open_field = (sequential(p) for p in (sampled, problem))
    assert plan.plan is not None
    true = check(exact, plan.plan).reward
    assert open_field.value > 1.005 * true  # the houses hide something
    assert abs(plan.value / true - 1) < 0.0005
