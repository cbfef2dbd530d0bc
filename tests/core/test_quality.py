import io
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.figure import Figure
from pool import problems
from strategies import examples

from cocap_opt.data import BoolArray, FloatArray, ProblemError
from cocap_opt.footage.intruders import drones_in_pictures
from cocap_opt.footage.moments import NARROW, NO_CAMERA, ONE_CAMERA, Moment, worst_moments
from cocap_opt.footage.poses import Poses
from cocap_opt.footage.quality import Assumptions, Quality, person_steps
from cocap_opt.footage.shares import visible_shares
from cocap_opt.graph import TimeGraph
from cocap_opt.problem import (
    NO_RULES,
    Actor,
    Camera,
    Cone,
    Motion,
    Objective,
    Plan,
    Problem,
    Robot,
    State,
)
from cocap_opt.vision.faces import FaceGeometry
from cocap_opt.vision.views import StateViews
from cocap_opt.world.workspace import HeightMap, Mesh

SIZE = 41  # cells of 1 m; the person stands in the middle, at (20.5, 20.5)
LEVEL = Camera(tilts=(0.0,))
HALF = 0.9  # m, half of a person's height, at which all drones fly
WEST, SOUTH, EAST = State(10, 20), State(20, 10, heading=2), State(30, 20, heading=4)


def person(*ways: tuple[float, float], **fields: Any) -> Actor:
    """A person in the middle of the map, who is so far from there at each step (m)."""
    return Actor(poses=np.array([[20.5 + x, 20.5 + y, 0.0, 0.0] for x, y in ways]), **fields)


def scene(*paths: tuple[State, ...], actors: tuple[Actor, ...] = (), **fields: Any) -> tuple[
    Problem, Plan
]:  # fmt: skip
    """A flat scene with drones that look level, and their plan."""
    horizon = len(paths[0]) - 1
    people = actors or (person(*[(0.0, 0.0)] * (horizon + 1)),)
    motion = Motion(layers=(HALF,), radius=10, turn=4)
    robots = [Robot(start=path[0], motion=motion, camera=LEVEL) for path in paths]
    known: dict[str, Any] = {
        "name": "circle", "height_map": HeightMap(heights=np.zeros((SIZE, SIZE))),
        "robots": tuple(robots), "actors": people, "horizon": horizon, "rules": NO_RULES,
    }  # fmt: skip
    return Problem(**(known | fields)), Plan(paths=paths)


def all_visible(problem: Problem) -> FloatArray:
    """Shares of people who are seen whole by everybody."""
    return np.ones((problem.horizon + 1, len(problem.robots), len(problem.actors)))


def seen_by(problem: Problem, *drones: list[int]) -> FloatArray:
    """Shares of people who are seen at each step by these drones only, and whole."""
    shares = 0.0 * all_visible(problem)
    for t, which in enumerate(drones):
        shares[t, which] = 1.0
    return shares


def test_two_drones_at_a_right_angle() -> None:
    """Both are 10 m away and look straight at the person: see the accuracy's own tests."""
    problem, plan = scene((WEST, WEST), (SOUTH, SOUTH))
    found = Quality.of(problem, plan, all_visible(problem))
    assert found.views.tolist() == [[2], [2]]
    np.testing.assert_allclose(found.angles, 90)
    np.testing.assert_allclose(found.errors, 20 * math.sqrt(2.5))
    assert (found.times, found.blur, found.worst_blur) == (None, None, None)
    assert found.counts.tolist() == [[False], [True]]
    assert found.summary._replace(median=0, most_of_them=0) == (1, 1, 0, 1, 0, 0, 0, 0, 0)
    assert found.summary.median == found.summary.most_of_them == pytest.approx(31.6228)
    assert found.worst == []


def test_drones_on_both_sides_measure_no_distance() -> None:
    """Their rays are one line; a third one from elsewhere makes all the difference."""
    problem, plan = scene((WEST, WEST), (EAST, EAST), (SOUTH, SOUTH))
    found = Quality.of(problem, plan, seen_by(problem, [0, 1], [0, 1, 2]))
    assert found.views.tolist() == [[2], [3]]
    np.testing.assert_allclose(found.angles, [[0], [90]], atol=1e-9)
    assert found.errors[0, 0] == math.inf
    # Informations are 1 along the line, 2 across it and 3 upwards, in those of 20 mm.
    assert found.errors[1, 0] == pytest.approx(20 * math.sqrt(1 + 1 / 2 + 1 / 3))
    started = replace(found, counts=np.ones((2, 1), dtype=bool), first_step=0)
    assert started.worst == ["person 0: cameras at most 0 degrees apart at step 0"]
    # Half of two person-steps is the better one; nine tenths of them are both.
    assert started.summary.median < started.summary.most_of_them == math.inf
    assert started.summary.infinite == 0.5
    assert "half within 27 mm, infinite at 50 %" in str(started)


def test_a_drone_sees_who_is_visible_enough() -> None:
    """At least 30 %, but for rounding, and as much as is asked for."""
    problem, plan = scene((WEST, WEST), (SOUTH, SOUTH))
    shares = all_visible(problem)
    shares[1, :, 0] = 0.3 - 1e-12, 0.29
    assert Quality.of(problem, plan, shares).views[1, 0] == 1
    assert Quality.of(problem, plan, shares, Assumptions(at_least=0.25)).views[1, 0] == 2
    assert Quality.of(problem, plan, shares, Assumptions(at_least=0.5)).views[1, 0] == 0
    for wrong in (shares[1:], shares + 0.5, shares - 0.5, shares * math.nan):
        with pytest.raises(ValueError, match="shares: must"):
            Quality.of(problem, plan, wrong)
    with pytest.raises(ValueError, match="plan: must have 2 paths of 2 states"):
        Quality.of(problem, Plan(paths=plan.paths[1:]), shares)


def test_quality_does_not_depend_on_where_the_map_is() -> None:
    """In the coordinates of a projection, in which numbers have millions of metres, too."""
    walk = person((0.0, 0.0), (1.0, 1.0), (2.0, 1.5))
    north = WEST._replace(heading=1)
    problem, plan = scene((WEST, north, WEST), (SOUTH,) * 3, (EAST,) * 3, actors=(walk,), step=1.0)
    here = Quality.of(problem, plan, all_visible(problem))
    shift = np.array([5e5, 4e6, 100.0, 0.0])
    ground = HeightMap(
        heights=problem.height_map.heights + 100,
        origin=(5e5, 4e6),
        datum=np.full((SIZE, SIZE), 100.0),
    )
    moved = problem.replace(height_map=ground, actors=(walk.replace(poses=walk.poses + shift),))
    there = Quality.of(moved, plan, all_visible(moved))
    for name in ("angles", "errors", "blur", "drones_seen"):
        np.testing.assert_allclose(getattr(there, name), getattr(here, name), rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize(
    ("field", "value"),
    [("at_least", 0.0), ("at_least", 1.1), ("pixel_error", 0.0), ("position_error", -1.0),
     ("attitude_error", 4.0), ("exposure", -1.0), ("exposure", math.nan)],
)  # fmt: skip
def test_assumptions_are_checked(field: str, value: float) -> None:
    """The message names the field, and what is allowed."""
    with pytest.raises(ProblemError, match=rf"^{field}: must be "):
        Assumptions(**{field: value})


def test_what_is_visible_is_computed() -> None:
    """In the open people are seen whole; behind a wall, or behind the drone, not at all."""
    problem, plan = scene((WEST, WEST), (SOUTH, SOUTH), (EAST, EAST._replace(heading=0)))
    np.testing.assert_allclose(visible_shares(problem, plan)[..., 0], [[1, 1, 1], [1, 1, 0]])
    assert Quality.of(problem, plan).views.tolist() == [[3], [2]]
    heights = np.zeros((SIZE, SIZE))
    heights[15, 20] = 5.0
    heights[:, 15] = HALF  # as high as the drone: what is above shows
    walls = problem.replace(height_map=HeightMap(heights=heights))
    np.testing.assert_allclose(visible_shares(walls, plan)[1, :, 0], [0, 0.5, 0], atol=1e-9)
    assert Quality.of(walls, plan).views.tolist() == [[2], [1]]
    cones = problem.replace(robots=tuple(r.replace(camera=Cone()) for r in problem.robots))
    assert visible_shares(cones, plan)[1, :, 0].tolist() == [1, 1, 0]
    with pytest.raises(ValueError, match="plan: must have 3 paths of 2 states"):
        visible_shares(problem, Plan(paths=plan.paths[1:]))


def test_poses_that_are_not_quite_known_make_errors_larger() -> None:
    """Half a degree at 10 m is 87 mm across, which outweighs the 20 mm of 5 px."""
    problem, plan = scene((WEST, WEST), (SOUTH, SOUTH))
    assumed = Assumptions(position_error=0.03, attitude_error=math.radians(0.5))
    found = Quality.of(problem, plan, all_visible(problem), assumed)
    across = math.hypot(20, 30, 10_000 * math.radians(0.5))
    np.testing.assert_allclose(found.errors, across * math.sqrt(2.5))
    assert "poses known to 30 mm and 0.5 degrees" in " ".join(str(found).split())


def test_blur_needs_seconds() -> None:
    """A walk of 1 m/s aside is 0.5 px, a turn by 45 degrees the short way 3.9 px more."""
    walk = person((0.0, 0.0), (0.0, 1.0))
    turn = (WEST, WEST._replace(heading=7))
    problem, plan = scene((WEST, WEST), turn, (SOUTH, SOUTH), actors=(walk,), step=1.0)
    found = Quality.of(problem, plan, seen_by(problem, [0, 1, 2], [0, 1]))
    assert found.blur is not None and found.worst_blur is not None and found.times is not None
    np.testing.assert_allclose(found.blur[0, :, 0], [0.5, 0.5 + 3.92699, 0], rtol=1e-5)
    assert math.isnan(found.blur[1, 2, 0])
    np.testing.assert_allclose(found.worst_blur[:, 0], found.blur[:, 1, 0])
    assert found.times.tolist() == [0, 1]
    slow = Quality.of(problem.replace(step=2.0), plan, all_visible(problem))
    assert slow.blur is not None
    np.testing.assert_allclose(slow.blur[0], found.blur[0] / 2)
    assert list(found.table) == [
        "person", "actor", "step", "time", "counts", "views", "angle", "error", "blur"
    ]  # fmt: skip


def test_who_counts() -> None:
    """People with a weight, at steps at which they matter; the start if the scene says so."""
    still = [(0.0, 0.0)] * 3
    people = (
        person(*still),
        person(*still, weights=(0.0,) * 5),
        person(*still, weights=(0.0, 0.0, 0.0, 0.0, 1.0), importance=(1.0, 0.0, 2.0)),
    )
    problem, _ = scene((WEST,) * 3, actors=people)
    assert person_steps(problem).T.tolist() == [[0, 1, 1], [0, 0, 0], [0, 0, 1]]
    # Also where the plan is made for views alone.
    views_alone = problem.replace(objective=problem.objective.replace(pixels=0.0))
    assert person_steps(views_alone).tolist() == person_steps(problem).tolist()
    started = problem.replace(objective=Objective(count_start=True))
    assert person_steps(started).T.tolist() == [[1, 1, 1], [0, 0, 0], [1, 0, 1]]


def test_a_scene_without_people_has_a_quality() -> None:
    """Nothing is counted, and words say so."""
    problem, plan = scene((WEST, WEST), (SOUTH, SOUTH))
    robots = (problem.robots[0], problem.robots[1].replace(camera=Cone()))
    problem = problem.replace(actors=(), robots=robots)
    found = Quality.of(problem, plan)
    assert found.summary.person_steps == len(found.table) == 0
    assert math.isnan(found.summary.by_two) and math.isnan(found.summary.median)
    assert "no person has a weight" in str(found)


def test_a_cone_with_nobody_to_see() -> None:
    """It sees no face and no person, from any state."""
    problem, _ = scene((WEST, WEST))
    robot = problem.robots[0].replace(camera=Cone())
    problem = problem.replace(actors=(), robots=(robot,))
    graph = TimeGraph.of(problem.workspace, robot.motion, 1)
    views = StateViews.of(FaceGeometry(problem), problem, graph, robot.camera)
    states = np.arange(5)
    assert len(views.people(states).people) == len(views.seen(states).columns) == 0


def test_drones_in_each_others_pictures() -> None:
    """Who looks at the other sees it, walls, bridges and the edges of the picture permitting."""
    problem, plan = scene((WEST, WEST), (EAST, EAST), (SOUTH, SOUTH))

    def found(problem: Problem, size: float = 0.4) -> list[list[int]]:
        poses = Poses.of(problem, plan)
        return np.argwhere(drones_in_pictures(problem, poses, size, 20.0)[0]).tolist()

    # The third one looks north; it is 45 degrees off the others' axes, pictures end at 38.7.
    assert found(problem) == [[0, 1], [1, 0]]
    # 20 m away 0.16 m cover 20 px.
    assert found(problem, 0.16) == [[0, 1], [1, 0]] and found(problem, 0.159) == []
    asked = Assumptions(drone_pixels=50)
    near = Quality.of(problem, plan, all_visible(problem), asked)
    assert near.intruders.tolist() == [2, 2]
    assert near.summary.disturbed == 2 / 3
    assert "2, in 67 % of all images" in str(near)
    assert Quality.of(problem, plan, all_visible(problem)).intruders.tolist() == [0, 0]
    wide = Camera(tilts=(0.0,), focal=1900.0)
    robots = tuple(robot.replace(camera=wide) for robot in problem.robots)
    assert found(problem.replace(robots=robots)) == [
        [i, k] for i in range(3) for k in range(3) if i != k
    ]
    cones = tuple(robot.replace(camera=Cone()) for robot in problem.robots[:1])
    assert found(problem.replace(robots=(*cones, *problem.robots[1:]))) == [[1, 0]]
    heights = np.zeros((SIZE, SIZE))
    heights[25, 20] = 0.8
    assert len(found(problem.replace(height_map=HeightMap(heights=heights)))) == 2
    heights[25, 20] = 1.0
    assert found(problem.replace(height_map=HeightMap(heights=heights))) == []
    # Far from zero, too, where single precision has no centimetres.
    far = HeightMap(heights=heights, origin=(5e5, 4e6))
    moved = problem.actors[0].replace(poses=problem.actors[0].poses + np.array([5e5, 4e6, 0, 0]))
    assert found(problem.replace(height_map=far, actors=(moved,))) == []
    beam = Mesh.box((24.0, 10.0, 0.85), (24.5, 30.0, 0.95))
    assert found(problem.replace(meshes=(beam,))) == []
    assert len(found(problem.replace(meshes=(Mesh.box((24, 10, 2), (25, 30, 3)),)))) == 2
    # Who is at the same place is in front of nobody.
    problem, plan = scene((WEST, WEST), (WEST, WEST))
    assert found(problem) == []


def test_sensors_without_pictures_have_views_only() -> None:
    """Cones see people; how accurately is unknown where it takes them, and is said."""
    problem, plan = scene((WEST, WEST), (EAST, EAST), (SOUTH, SOUTH), step=1.0)
    first = problem.robots[0].replace(camera=Cone())
    mixed = problem.replace(robots=(first, *problem.robots[1:]))
    both = Quality.of(mixed, plan, all_visible(mixed))
    np.testing.assert_allclose(both.errors, 20 * math.sqrt(2.5))
    assert both.views.tolist() == [[3], [3]]
    assert both.blur is not None and np.isnan(both.blur[:, 0]).all() and not both.blur[:, 1:].any()
    one_each = Quality.of(mixed, plan, seen_by(mixed, [0, 1], [1]))
    assert math.isnan(one_each.errors[0, 0]) and one_each.errors[1, 0] == math.inf
    cones = problem.replace(robots=tuple(r.replace(camera=Cone()) for r in problem.robots))
    none = Quality.of(cones, plan, all_visible(cones))
    assert np.isnan(none.errors).all() and math.isnan(none.summary.median)
    np.testing.assert_allclose(none.angles, 90)
    assert none.worst_blur is not None and np.isnan(none.worst_blur).all()
    assert "3 of 3 drones have no images" in " ".join(str(none).split())
    assert "unknown: no images" in str(none)


def test_the_worst_moments_come_first_in_words() -> None:
    """No camera before one, the longer before the shorter; consecutive steps are one moment."""
    still = [(0.0, 0.0)] * 8
    people = (person(*still, name="Ada"), person(*still, name="Bo"), person(*still, name="Bo"))
    problem, plan = scene((WEST,) * 8, (SOUTH,) * 8, (EAST,) * 8, actors=people, step=0.25)
    shares = all_visible(problem)
    shares[0, :, 0] = 0  # the start does not count
    shares[4:8, 1:, 0] = 0
    shares[4, :, 1] = 0
    shares[1:4, 2:, 1], shares[1:4, 0, 1] = 0, 0
    shares[7, 1, 2] = 0
    found = Quality.of(problem, plan, shares)
    assert found.worst == [
        "Bo (1): no camera at 1 s",
        "Ada: one camera from 1 to 1.75 s",
        "Bo (1): one camera from 0.25 to 0.75 s",
        "Bo (2): cameras at most 0 degrees apart at 1.75 s",
    ]
    untimed = Quality.of(problem.replace(step=None), plan, shares)
    assert untimed.worst[:3] == [
        "Bo (1): no camera at step 4",
        "Ada: one camera at steps 4 to 7",
        "Bo (1): one camera at steps 1 to 3",
    ]


def test_a_long_list_of_moments_is_cut() -> None:
    """Five are named; those of the worst kind first."""
    views, angles = np.array([[2, 0], [1, 2], [2, 1]]), np.full((3, 2), 40.0)
    angles[0, 0] = 20.0
    found = worst_moments(views, angles, np.ones((3, 2), dtype=bool))
    assert [moment[:4] for moment in found] == [
        (1, 0, 0, NO_CAMERA), (0, 1, 1, ONE_CAMERA), (1, 2, 2, ONE_CAMERA), (0, 0, 0, NARROW)
    ]  # fmt: skip
    assert worst_moments(views, angles, np.zeros((3, 2), dtype=bool)) == []
    words = Moment(0, 1, 2, NARROW, 12.4).words(None)
    assert words == "cameras at most 12 degrees apart at steps 1 to 2"
    people = tuple(person((0.0, 0.0), (0.0, 0.0), name=name) for name in "ABCDEFG")
    problem, plan = scene((WEST, WEST), actors=people)
    assert len(Quality.of(problem, plan, all_visible(problem)).worst) == 5


def test_words_fit_a_terminal() -> None:
    """Eighty columns hold it, also with long names; notebooks get the same, escaped."""
    still = [(0.0, 0.0)] * 3
    people = (person(*still, name="Ada <" + 50 * "x"), person(*still, name="Bo"))
    problem, plan = scene((WEST,) * 3, (SOUTH,) * 3, actors=people, step=0.5)
    shares = all_visible(problem)
    shares[1:, 0, 0] = 0
    found = Quality.of(problem, plan, shares)
    text = str(found)
    assert max(map(len, text.splitlines())) <= 80
    assert "seen by two or more" in text and "50 %" in text
    assert "one camera from 0.5 to 1 s" in " ".join(text.split())
    assert "&lt;xxx" in found._repr_html_() and "<xxx" not in found._repr_html_()


def test_a_figure_has_a_row_for_everybody_who_counts() -> None:
    """Runs of the same number of cameras are bars; names stay names; axes of others are taken."""
    still = [(0.0, 0.0)] * 4
    people = (
        person(*still, name="$x^2"), person(*still, weights=(0.0,) * 5), person(*still, name="Bo"),
    )  # fmt: skip
    problem, plan = scene((WEST,) * 4, (SOUTH,) * 4, (EAST,) * 4, actors=people)
    shares = all_visible(problem)
    shares[2:, :2, 0] = 0
    found = Quality.of(problem, plan, shares)
    ax = found.plot()
    assert [label.get_text() for label in ax.get_yticklabels()] == ["$x^2", "Bo"]
    ends = [
        (bar.get_paths()[0].get_extents().xmin, bar.get_paths()[0].get_extents().xmax)
        for bar in ax.collections
    ]
    # The start does not count and is a bar of its own.
    assert ends == [(-0.5, 0.5), (0.5, 1.5), (1.5, 3.5), (-0.5, 0.5), (0.5, 3.5)]
    assert ax.get_xlabel() == "step"
    ax.figure.savefig(io.BytesIO(), format="svg")
    given = Figure().add_subplot()
    timed = Quality.of(problem.replace(step=0.5), plan, shares)
    assert timed.plot(given) is given and given.get_xlabel() == "time (s)"
    assert given.get_xlim() == (-0.25, 1.75)
    nobody = problem.replace(actors=people[1:2])
    assert not Quality.of(nobody, plan, all_visible(nobody)).plot().collections


def random_plan(problem: Problem, rng: np.random.Generator) -> Plan:
    """States anywhere in the map: quality asks for no rules."""
    width, depth = problem.height_map.shape
    paths = []
    for robot in problem.robots:
        sizes = (width, depth, *robot.orientation_sizes)
        rows = rng.integers(0, sizes, (problem.horizon + 1, len(sizes))).tolist()
        paths.append(tuple(State(*row) for row in rows))
    return Plan(paths=tuple(paths))


def slow_error(problem: Problem, plan: Plan, t: int, j: int, seen: BoolArray) -> float:
    """The error (m) of a point by differences of a projection that is spelt out."""
    total, actor = np.zeros((3, 3)), problem.actors[j]
    point = actor.poses[t, :3] + [0, 0, actor.shape.height / 2]
    for robot, path, visible in zip(problem.robots, plan.paths, seen, strict=True):
        state, camera = path[t], robot.camera
        (place,) = problem.where(robot, [state])
        if not visible or not isinstance(camera, Camera):
            continue
        yaw = 2 * math.pi * state.heading / robot.motion.headings
        tilt = camera.tilts[state.pitch]
        level = np.array([math.cos(yaw), math.sin(yaw), 0])
        ahead = math.cos(tilt) * level - [0, 0, math.sin(tilt)]
        aside = np.cross(level, [0, 0, 1])
        above = np.cross(aside, ahead)
        if (point - place) @ ahead <= 1e-9:
            continue

        def image(at: FloatArray, place=place, focal=camera.focal, axes=(aside, above, ahead)):  # type: ignore[no-untyped-def]
            right, up, depth = (axis @ (at - place) for axis in axes)
            return focal * np.array([right, up]) / depth

        steps = 1e-6 * np.eye(3)
        J = np.column_stack([(image(point + d) - image(point - d)) / 2e-6 for d in steps])
        total += J.T @ J / 25
    values = np.linalg.eigvalsh(total)
    if values[0] <= 1e-12 * values[2]:
        return math.inf
    return float(math.sqrt(np.trace(np.linalg.inv(total))))


@pytest.mark.slow
@examples(40)
@given(problems(), st.integers(0, 10**6))
def test_quality_is_what_slow_loops_say(problem: Problem, seed: int) -> None:
    """All kinds of scenes, cameras and plans: views, angles and errors, one by one."""
    rng = np.random.default_rng(seed)
    plan = random_plan(problem, rng)
    shares = rng.random((problem.horizon + 1, len(problem.robots), len(problem.actors)))
    found = Quality.of(problem, plan, shares)
    has_camera = [isinstance(robot.camera, Camera) for robot in problem.robots]
    for t, j in np.ndindex(found.views.shape):
        seen = shares[t, :, j] >= 0.3
        assert found.views[t, j] == seen.sum()
        assert math.isnan(found.angles[t, j]) == (seen.sum() < 2)
        if not math.isnan(found.errors[t, j]):
            expected = 1000 * slow_error(problem, plan, t, j, seen)
            assert found.errors[t, j] == pytest.approx(expected, rel=1e-3)
        else:
            assert not all(has_camera)
    records = found.table.to_dict("records")
    assert [row["views"] for row in records] == found.views.T.ravel().tolist()
    assert found.summary.person_steps == sum(row["counts"] for row in records)
    assert "nan %" not in str(found)
    computed = Quality.of(problem, plan)
    assert (computed.seen <= (visible_shares(problem, plan) > 0)).all()
