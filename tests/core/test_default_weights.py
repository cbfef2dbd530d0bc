"""The weight by which a drone that sees a person counts, where nobody states it."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pool import problems
from strategies import examples
from trade_offs import crossroads

import cocap_opt as co
from cocap_opt.data import ProblemError
from cocap_opt.files.documents import problem_digest
from cocap_opt.model import Model
from cocap_opt.problem import (
    Actor,
    AnyCamera,
    Camera,
    Cone,
    Cuboid,
    Motion,
    Objective,
    Prism,
    Problem,
    Robot,
    Shape,
    State,
    TriangulatedCuboid,
)
from cocap_opt.run.front import VIEWS_ALONE, Front
from cocap_opt.vision.default_weights import default_weights
from cocap_opt.world.workspace import HeightMap

DIGITS = 1e-8  # relative; weights have nine digits

SIZES = st.floats(0.1, 2.5)
SHAPES: st.SearchStrategy[Shape] = st.one_of(
    st.builds(Cuboid, length=SIZES, width=SIZES, height=SIZES),
    st.builds(TriangulatedCuboid, length=SIZES, width=SIZES, height=SIZES),
    st.builds(Prism, sides=st.integers(3, 9), apothem=SIZES, height=SIZES),
)
PIXELS = st.integers(20, 5000)
CAMERAS = st.builds(Camera, width=PIXELS, height=PIXELS, focal=st.floats(50, 5000))


def weight(
    shape: Shape, *cameras: AnyCamera, weights: tuple[float, ...] | None = None, yaw: float = 0.0
) -> float:
    """Returns the default weight of a person in front of a team."""
    poses = np.array([[3.0, 4.0, 5.0, yaw]] * 2)
    robots = [Robot(start=State(0, 0), camera=camera) for camera in cameras]
    return default_weights([Actor(poses=poses, shape=shape, weights=weights)], robots)[0]


def test_a_face_by_hand() -> None:
    """The front of a thin, square board: seen straight, and from 45 degrees to either side."""
    camera = Camera(width=4000, height=3000, focal=2500.0)
    depth, edge = 1e-4, 1.5
    far = 3 * edge * 2500 / 3000  # 3.75 m

    def pixels(x: float, y: float) -> float:
        """Returns the area of the front's image, a trapezoid, over its own."""
        c, s = math.cos(math.atan2(y, x)), math.sin(math.atan2(y, x))
        sides = [far - depth / 2 * c - s * end for end in (-edge / 2, edge / 2)]
        ends = zip((-0.75, 0.75), sides, strict=True)
        at = [2500 * (c * end - s * depth / 2) / z for end, z in ends]
        heights = [2500 * edge / z for z in sides]
        return (at[1] - at[0]) * sum(heights) / 2 / edge**2

    roots = [math.sqrt(pixels(x, y)) for x, y in ((1, 0), (1, 1), (1, -1))]
    assert roots[0] == pytest.approx(2500 / (far - depth / 2))
    only_front = weight(
        Cuboid(length=depth, width=edge, height=edge), camera, weights=(1, 0, 0, 0, 0)
    )
    assert only_front == pytest.approx(sum(roots) / 8 / 2, rel=DIGITS)


@examples(20)
@given(SHAPES, CAMERAS)
def test_it_is_what_a_drone_gets(shape: Shape, camera: Camera) -> None:
    """Coverage of a person who turns on the spot before a hovering drone, as planners have it."""
    straight = 3 * shape.height * camera.focal / camera.height
    flat = HeightMap(heights=np.zeros((2, 1)), resolution=straight)
    turns = [[*flat.centre(1, 0), 0.0, k * math.pi / 4] for k in range(8)]
    person = Actor(poses=np.array(turns), shape=shape)
    motion = Motion(layers=(shape.height / 2,), clearance=0.0)
    robot = Robot(start=State(0, 0), motion=motion, camera=camera.replace(tilts=(0.0,)))
    problem = Problem(
        name="alone", height_map=flat, robots=(robot,), actors=(person,), horizon=7,
        objective=Objective(count_start=True),
    )  # fmt: skip
    model = Model(problem, use_cache=False)
    (of_robot,) = model.classes
    at = np.array([of_robot.graph.index(robot.start)])
    paid = [np.sqrt(model.coverage_at(of_robot, t, at)).sum() for t in range(8)]
    found = default_weights([person], [robot])[0]
    widest = math.hypot(getattr(shape, "length", 0), getattr(shape, "width", 0)) / 2
    if isinstance(shape, Prism):
        widest = shape.apothem / math.cos(math.pi / shape.sides)
    near = widest + shape.height * camera.focal / camera.height
    if straight >= max(near, widest / math.sin(camera.half_angle)):
        assert found == pytest.approx(np.mean(paid) / 2, rel=DIGITS)
    else:  # nearer, not all of the person would be in the image
        assert found > 0


@examples(60)
@given(SHAPES, CAMERAS, st.floats(0.01, 100), st.integers(0, 7))
def test_how_it_scales(shape: Shape, camera: Camera, times: float, turns: int) -> None:
    """With faces' weights and pixels, against sizes, and not with tilts or where a person looks."""
    plain, faces = weight(shape, camera), len(shape.faces())
    assert weight(shape, camera, weights=(times,) * faces) == pytest.approx(
        times * plain, rel=DIGITS
    )
    finer = Camera(width=3 * camera.width, height=3 * camera.height, focal=3 * camera.focal)
    assert weight(shape, finer) == pytest.approx(3 * plain, rel=DIGITS)
    fields = {name: 2 * getattr(shape, name) for name in ("length", "width", "apothem", "height")
              if hasattr(shape, name)}  # fmt: skip
    assert weight(shape.replace(**fields), camera) == pytest.approx(plain / 2, rel=DIGITS)
    assert weight(shape, camera.replace(tilts=(0.3, 1.2)), yaw=turns * 0.7) == plain
    ends = [weight(shape, camera, weights=tuple(float(k == f) for k in range(faces)))
            for f in range(faces)]  # fmt: skip
    assert sum(ends) == pytest.approx(plain, rel=DIGITS)
    assert ends[-1] == 0  # the top, from a camera that is level with the middle


def test_the_numbers_of_the_page() -> None:
    """A box of the built-in scenes: one side from 4 m, or two sides, whose edge is nearest."""
    problem = co.load("bottleneck")
    (first, *_), (found, *others) = (
        problem.robots,
        default_weights(problem.actors, problem.robots),
    )
    assert isinstance(first.camera, Camera) and problem.actors[0].shape == Cuboid()
    focal, far, half = first.camera.focal, 4.5, 0.5
    # The image of a side over the corner: a trapezoid between depths of its two edges.
    near, rear = far - math.sqrt(half), far
    width = focal * math.sqrt(half) / rear
    heights = focal * 1.8 / near + focal * 1.8 / rear
    two = 2 * math.sqrt(width * heights / 2 / 1.8)
    assert focal / (far - half) == 625
    assert round(two) == 977
    assert found == pytest.approx((625 + two) / 4, rel=DIGITS)
    assert (round((625 + two) / 2), round(found)) == (801, 400)
    assert set(others) == {found}


def test_symmetric_faces_count_alike() -> None:
    """Each side of a cube has the same part, and turning faces' weights around changes nothing."""
    camera = Camera()
    sides = [weight(Cuboid(), camera, weights=tuple(float(k == f) for k in range(5)))
             for f in range(4)]  # fmt: skip
    assert sides == pytest.approx([sides[0]] * 4, rel=DIGITS)
    assert weight(Prism(sides=8), camera, weights=(1.0, *[0.0] * 8)) == pytest.approx(
        weight(Prism(sides=8), camera, weights=(*[0.0] * 3, 1.0, *[0.0] * 5)), rel=DIGITS
    )


def test_a_team_counts_each_robot_once() -> None:
    """The mean over the team's cameras; more drones of a kind change nothing."""
    first, second = Camera(), Camera(width=640, height=480, focal=400.0)
    one, other = weight(Cuboid(), first), weight(Cuboid(), second)
    assert weight(Cuboid(), first, first, first) == one
    assert weight(Cuboid(), first, second, second) == pytest.approx(
        (one + 2 * other) / 3, rel=DIGITS
    )
    assert weight(Cuboid(), Cone(), first) == one
    with pytest.raises(ProblemError, match=r"^weight: must be given if no drone has a pinhole"):
        weight(Cuboid(), Cone(), Cone())


@examples(12)
@given(problems(), st.integers(1, 3))
def test_the_face_asks_for_views(problem: Problem, cameras: int) -> None:
    """A number for each person, the same for parts of the team, other starts and fewer steps."""
    if all(isinstance(robot.camera, Cone) for robot in problem.robots):
        with pytest.raises(ProblemError, match="weight"):
            co.with_views(problem)
        assert co.with_views(problem, weight=3).objective.views == co.Views(weight=3.0)
        return
    asked = co.with_views(problem, cameras, at_least=0.5)
    views = asked.objective.views
    assert views is not None and isinstance(views.weight, tuple)
    assert (views.cameras, views.at_least) == (cameras, 0.5)
    assert views.weight == default_weights(problem.actors, problem.robots)
    assert asked.objective.replace(views=None) == problem.objective
    shorter = co.with_views(problem.replace(horizon=1)).objective.views
    assert shorter is not None and shorter.weight == views.weight
    again = co.with_views(asked, cameras, at_least=0.5)
    assert problem_digest(again) == problem_digest(asked) != problem_digest(problem)


def test_what_is_no_number_of_cameras_is_said() -> None:
    """Another kind is a TypeError, a number out of range names its field."""
    problem = co.load("tiny-share")
    for error, words, fields in (
        (TypeError, "cameras: must be a whole number", {"cameras": 2.0}),
        (ProblemError, "cameras: must be 1..64, not 0", {"cameras": 0}),
        (TypeError, "at_least: must be a number", {"at_least": "all"}),
        (ProblemError, "at_least: must be 0..1, not 2", {"at_least": 2}),
        (TypeError, "weight: must be a number", {"weight": {}}),
        (ProblemError, "weight: must be 0..1,000,000,000,000, not -1", {"weight": -1}),
        (ProblemError, "weight: must be one number, or one for each", {"weight": [1, 2, 3, 4]}),
    ):
        with pytest.raises(error, match=words):
            co.with_views(problem, **fields)


@examples(40)
@given(problems())
def test_people_come_before_all_pixels(problem: Problem) -> None:
    """One drone more that sees a person outweighs any pixels, so the best plan sees the most."""
    if any(not isinstance(robot.camera, Camera) for robot in problem.robots):
        with pytest.raises(ProblemError, match="weight: must be a number if a drone has no"):
            co.with_views(problem, weight="first")
        return
    first = co.with_views(problem, weight="first")
    assert first.objective.views is not None
    weight = first.objective.views.weight
    assert isinstance(weight, float)
    without = first.replace(objective=first.objective.replace(views=None))
    least = min((x for x in problem.importance.ravel() if x > 0), default=1.0)
    most = co.bound(without, "alone").bound
    assert weight * min(least, 1.0) > most


def test_the_best_plan_by_people_first_sees_most() -> None:
    """Brute force with people first has the V of brute force with people alone."""
    problem = co.load("tiny-share")
    first = co.with_views(problem, weight="first")
    best = co.solve(first, "brute-force")
    alone = co.solve(
        problem.replace(objective=Objective(pixels=0.0, views=co.Views())), "brute-force"
    )
    assert best.plan is not None
    point = Front.of(problem).point(best.plan)
    assert point is not None and point.views == alone.value


def test_only_a_number_or_first_is_a_weight() -> None:
    """No other word is one."""
    with pytest.raises(ProblemError, match='weight: must be a number or "first"'):
        co.with_views(co.load("tiny-share"), weight="last")  # type: ignore[arg-type]


def test_views_may_differ_by_less_than_the_least_importance() -> None:
    """Then pixels may decide, as is said; with one importance the most views come first."""
    problem = crossroads()
    unlike = tuple(
        actor.replace(importance=(share,) * 3)
        for actor, share in zip(problem.actors, (1.0, 0.505, 0.505), strict=True)
    )
    for actors, decided in ((problem.actors, True), (unlike, False)):
        scene = problem.replace(actors=actors)
        best = co.solve(co.with_views(scene, cameras=1, weight="first"), "brute-force")
        front = Front.of(scene, cameras=1)
        alone = co.solve(front.scene(VIEWS_ALONE), "brute-force").value
        assert best.plan is not None
        point = front.point(best.plan)
        assert point is not None
        assert (point.views == pytest.approx(alone)) == decided
        assert alone - point.views < 0.505
