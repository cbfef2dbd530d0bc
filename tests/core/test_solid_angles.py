"""Solid angles of polygons, and of the people that views see."""

import math

import numpy as np
import pytest
from exact_views import excess
from hypothesis import given
from hypothesis import strategies as st
from pool import problems
from strategies import examples
from test_coverage import as_mesh, houses
from test_culling import all_states, graph_of

from cocap_opt.problem import Camera, Cone, Problem
from cocap_opt.scenarios import load_scene
from cocap_opt.vision.faces import FaceGeometry
from cocap_opt.vision.projection import Projection, solid_angles
from cocap_opt.vision.seen import SeenPeople
from cocap_opt.vision.views import StateViews


def of_first_robot(problem: Problem) -> StateViews:
    """The views of the first robot."""
    return StateViews.of(
        FaceGeometry(problem), problem, graph_of(problem), problem.robots[0].camera, plain=True
    )


def shares(problem: Problem, t: int = 1) -> tuple[SeenPeople, np.ndarray]:
    """All that states on the map see of people, and the shares [n, A] that are visible."""
    states = all_states(problem)
    found = of_first_robot(problem).people(t * graph_of(problem).n_states + states)
    share = np.zeros((len(states), len(problem.actors)))
    share[found.rows, found.people] = found.visible / found.unhidden
    return found, share


@pytest.mark.parametrize(
    ("polygon", "expected"),
    [
        ([[1, 0, 0], [0, 1, 0], [0, 0, 1]], math.pi / 2),  # an octant
        ([[1, -1, -1], [1, 1, -1], [1, 1, 1], [1, -1, 1]], 4 * math.pi / 6),  # a side of a cube
        ([[1e6, 0, 1e-9], [-1e6, 1e6, 1e-9], [-1e6, -1e6, 1e-9]], 2 * math.pi),  # half of all
        ([[0, 0, 5], [0, 1, 5], [0, 2, 5]], 0.0),
        ([[0, 0, 0], [0, 0, 0], [0, 0, 0]], 0.0),  # what is left of one that is outside
    ],
)
def test_solid_angles_of_well_known_polygons(polygon: list[list[float]], expected: float) -> None:
    """Those that everybody knows."""
    found = solid_angles(np.array([polygon], dtype=float))[0]
    assert found == pytest.approx(expected, abs=1e-12 + 2e-14 * 1e6 * (expected > 6))


@examples(100)
@given(st.integers(3, 12), st.floats(0.01, 30.0), st.floats(-1.2, 1.2), st.integers(0, 3))
def test_solid_angles_are_the_angles_on_the_sphere(
    n: int, radius: float, aside: float, repeated: int
) -> None:
    """Of regular polygons, by Girard's theorem; the last corner may be repeated."""
    turn = 2 * math.pi * np.arange(n) / n
    polygon = np.stack([np.cos(turn) + aside, np.sin(turn) - aside, np.full(n, 1 / radius)], -1)
    expected = excess([tuple(p) for p in polygon.tolist()])
    padded = np.concatenate([polygon, np.repeat(polygon[-1:], repeated, axis=0)])
    assert solid_angles(padded[None])[0] == pytest.approx(expected, abs=1e-9)
    assert solid_angles(padded[None])[0] == solid_angles(polygon[None])[0]
    assert solid_angles(7.0 * polygon[None])[0] == pytest.approx(expected, abs=1e-9)


def test_an_image_has_the_angle_of_its_pyramid() -> None:
    """A wall before the camera fills the image: 4 asin(sin a sin b) of the half angles."""
    camera = Camera(width=800, height=600, focal=400.0)
    wall = np.array([[[-90.0, -90, 3], [90, -90, 3], [90, 90, 3], [-90, 90, 3]]])
    _, angle = Projection(camera).images(wall, with_angles=True)
    half = math.asin(math.sin(math.atan(1.0)) * math.sin(math.atan(0.75)))
    assert angle[0] == pytest.approx(4 * half)


@examples(60)
@given(problems())
def test_no_more_is_visible_than_there_is(problem: Problem) -> None:
    """Shares are between 0 and 1, and a person is seen where a face is."""
    found, share = shares(problem)
    assert (found.visible > 0).all() and (share <= 1 + 1e-12).all()
    assert (np.diff(found.rows * len(problem.actors) + found.people) > 0).all()
    seen = of_first_robot(problem).seen(graph_of(problem).n_states + all_states(problem))
    pairs = set(zip(seen.rows.tolist(), problem.face_owner[seen.columns].tolist(), strict=True))
    if not any(isinstance(robot.camera, Cone) for robot in problem.robots):
        assert pairs == set(zip(found.rows.tolist(), found.people.tolist(), strict=True))


def test_in_the_open_all_of_a_person_is_visible() -> None:
    """Nothing hides anybody of three, but they each other; images have edges."""
    problem = load_scene("passage", 0)
    alone = problem.replace(actors=problem.actors[:1])
    flat = alone.replace(height_map=alone.height_map.replace(heights=0 * alone.height_map.heights))
    _, share = shares(flat)
    assert np.count_nonzero(share > 1 - 1e-12) > 100
    with_others = flat.replace(actors=problem.actors)
    assert (shares(with_others)[1][:, 0] <= share[:, 0] + 1e-12).all()


def test_angles_past_rough_meshes_are_near_what_is_exact() -> None:
    """Shares past houses given as one mesh, against the same houses given wing by wing."""
    problem = load_scene("field", 1)
    problem = problem.replace(actors=problem.actors[:3])
    wings = houses(np.random.default_rng(1), problem)
    sampled = shares(problem.replace(meshes=(as_mesh(wings),)))[1]
    exact = shares(problem.replace(meshes=tuple(as_mesh([wing]) for wing in wings)))[1]
    hidden = exact < shares(problem)[1] - 0.01
    assert hidden.sum() > 50
    assert np.abs(sampled - exact)[hidden].mean() < 0.03


def test_cones_see_all_of_a_person() -> None:
    """They know of no images."""
    problem = load_scene("corridor", 0)
    robots = tuple(robot.replace(camera=Cone()) for robot in problem.robots)
    found, share = shares(problem.replace(robots=robots))
    assert len(found.rows) and set(share.ravel().tolist()) == {0.0, 1.0}
