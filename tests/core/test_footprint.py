import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from strategies import examples

from cocap_opt.flight.footprint import REACH, Footprints
from cocap_opt.problem import Camera
from cocap_opt.world import HeightMap

CAMERA = Camera(width=400, height=300, focal=200.0)  # it sees 1 m aside and 0.75 m up, 1 m away


def footprint(height_map: HeightMap, *pose: float) -> Footprints:
    """The footprint of a camera at x, y, z (m) that looks to a yaw and a pitch (degrees)."""
    place, (yaw, pitch) = np.array([pose[:3]]), np.radians(pose[3:])
    return Footprints.of(height_map, CAMERA, place, np.array([yaw]), np.array([pitch]))


@pytest.mark.parametrize(
    ("yaw", "pitch", "corners", "cut"),
    [
        # Straight down from 10 m: 2 x 10 m aside, 1.5 x 10 m along, the lower edge behind.
        (0, -90, [(-7.5, 10), (-7.5, -10), (7.5, -10), (7.5, 10)], False),
        (90, -90, [(-10, -7.5), (10, -7.5), (10, 7.5), (-10, 7.5)], False),
        # Rows of the image are 45 degrees -+ atan(3/4) below the horizon: they meet the ground at
        # 10 / 7 and at 70 m, at depths of 100 / 7 / sqrt(2) and of 100 / sqrt(2) m, so much aside.
        (0, -45, [(10 / 7, 8.0812), (10 / 7, -8.0812), (70, -56.5685), (70, 56.5685)], False),
        # The upper edge looks up: on the way to it rays go as far aside as ahead, and the one that
        # is 10 m down after 10 times as much ends there.
        (0, 0, [(13.3333, 13.3333), (13.3333, -13.3333), (70.7107, -70.7107), (70.7107, 70.7107)],
         True),
    ],
)  # fmt: skip
def test_footprints_on_level_ground_are_those_of_a_drawing(
    yaw: float, pitch: float, corners: list[tuple[float, float]], cut: bool
) -> None:
    """From 10 m above level ground, the corners are where a ruler on paper puts them."""
    level = HeightMap(heights=np.full((8, 6), 30.0), origin=(1e5, 5e6))
    found = footprint(level, 1e5 + 3, 5e6 + 2, 40.0, yaw, pitch)
    np.testing.assert_allclose(found.corners[0, :, :2] - [1e5 + 3, 5e6 + 2], corners, atol=1e-3)
    np.testing.assert_allclose(found.corners[0, :, 2], 30.0)
    assert (found.cut[0], found.reach[0]) == (cut, REACH * 10)


def test_a_wall_of_the_ground_ends_a_footprint() -> None:
    """On a map that is all ground the rays end where they meet it first; obstacles are no ground.

    Without a datum, a map of few heights has obstacles on its lowest ground.
    """
    heights = np.zeros((20, 20))
    heights[12:] = 4.0
    terraces = HeightMap(heights=heights, datum=heights)
    # Above (2.5, 10), 5 m high, the upper row looks 8.1 degrees down: the wall is 9.5 m ahead.
    (corners,) = footprint(terraces, 2.5, 10.0, 5.0, 0, -45).corners
    assert corners[2:, 0] == pytest.approx(12.0)
    assert corners[2:, 2] == pytest.approx(5 - 9.5 / 7)
    (flat,) = footprint(HeightMap(heights=heights), 2.5, 10.0, 5.0, 0, -45).corners
    assert flat[2:, 0] == pytest.approx(2.5 + 35)


def test_a_camera_that_looks_up_has_no_footprint() -> None:
    """Nor has one whose lower corners see farther than the reach."""
    level = HeightMap(heights=np.zeros((4, 4)))
    for pitch in (40, 90, math.degrees(math.atan(0.75)) - 0.1):
        assert np.isnan(footprint(level, 2.0, 2.0, 3.0, 0, pitch).corners).all()


@examples(15)
@given(st.integers(0, 10**6))
def test_corners_are_in_the_image_and_on_the_ground(seed: int) -> None:
    """On any ground: at its altitude or on a wall, within the reach, on the image's corners."""
    rng = np.random.default_rng(seed)
    ground = rng.integers(0, 4, (7, 5)) * rng.choice([0.3, 2.0])
    height_map = HeightMap(heights=ground, datum=ground, resolution=2.0)
    place = rng.random((4, 3)) * [14, 10, 6] + [0, 0, 0.1]
    cells = (place[:, :2] // 2).astype(int)
    place[:, 2] += ground[cells[:, 0], cells[:, 1]]
    yaw, pitch = rng.random(4) * 7, -rng.random(4) * 1.5
    found = Footprints.of(height_map, CAMERA, place, yaw, pitch)
    for k in np.flatnonzero(~np.isnan(found.corners).any(axis=(1, 2))):
        ways = found.corners[k] - place[k]
        assert (np.hypot(ways[:, 0], ways[:, 1]) <= found.reach[k] + 1e-6).all()
        c, s, ct, sn = np.cos(yaw[k]), np.sin(yaw[k]), np.cos(pitch[k]), np.sin(pitch[k])
        depth = ways @ [c * ct, s * ct, sn]
        aside, above = ways @ [s, -c, 0] / depth, ways @ [-c * sn, -s * sn, ct] / depth
        np.testing.assert_allclose(aside, [-1, 1, 1, -1], atol=1e-6)
        np.testing.assert_allclose(above[:2], -0.75, atol=1e-6)
        assert found.cut[k] or above[2:] == pytest.approx(0.75, abs=1e-6)
        # The drone sees each corner: nothing of the ground is above the way to it.
        for way in ways:
            shares = np.linspace(0, 1 - 1e-6, 60)
            x, y, z = (place[k] + shares[:, None] * way).T
            i, j = (x // 2).astype(int), (y // 2).astype(int)
            inside = (i >= 0) & (i < 7) & (j >= 0) & (j < 5)
            below = np.where(inside, ground[i.clip(0, 6), j.clip(0, 4)], ground.min())
            assert (z >= below - 1e-6).all()
