import math
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from strategies import examples

from cocap_opt.data import FloatArray
from cocap_opt.footage.accuracy import (
    information,
    jacobians,
    pixel_covariances,
    rms_errors,
    turning_jacobians,
)
from cocap_opt.footage.blur import blur
from cocap_opt.footage.rays import between_lines, widest_angle
from cocap_opt.vision.projection import Projection

FOCAL, PIXEL = 2500.0, 5.0  # px
SEEDS = st.integers(0, 10**6)


class Rig(NamedTuple):
    """Cameras around a point."""

    places: FloatArray  # [n, 3] m
    axes: FloatArray  # [n, 3, 3]
    focal: FloatArray  # [n] px
    point: FloatArray  # [3] m

    @classmethod
    def drawn(cls, seed: int, count: int) -> "Rig":
        """Cameras at 5 to 30 m all around, which look at most 35 degrees aside of the point."""
        rng = np.random.default_rng(seed)
        yaw, tilt = rng.uniform(0, math.tau, count), rng.uniform(-0.4, 1.2, count)
        ahead = Projection.axes_towards(yaw, tilt)[:, 2]
        point = rng.uniform(-5, 5, 3)
        off = rng.uniform(-0.43, 0.43, (2, count))
        axes = Projection.axes_towards(yaw + off[0], tilt + off[1])
        distances = rng.uniform(5, 30, count)
        return cls(point - distances[:, None] * ahead, axes, rng.uniform(800, 4000, count), point)

    @classmethod
    def around(cls, angles: list[float], distance: float = 10.0) -> "Rig":
        """Cameras in a level circle, which look straight at the point in its middle."""
        yaw = np.array(angles)
        axes = Projection.axes_towards(yaw, np.zeros(len(yaw)))
        return cls(-distance * axes[:, 2], axes, np.full(len(yaw), FOCAL), np.zeros(3))

    @property
    def seen(self) -> FloatArray:
        """The point as each camera has it [n, 3]."""
        return np.einsum("nkx,nx->nk", self.axes, self.point - self.places)

    def error(self, *pose_errors: float, pixels: float = PIXEL) -> float:
        """The predicted error in m."""
        by_point = jacobians(self.seen, self.focal)
        covariances = pixel_covariances(self.seen, by_point, pixels, *pose_errors)
        return float(rms_errors(information(self.axes, by_point, covariances).sum(axis=0)))


def projected(points: FloatArray, focal: FloatArray) -> FloatArray:
    """Images [.., 2] (px) of points [.., 3] in camera coordinates."""
    return focal[..., None] * points[..., :2] / points[..., 2:]


def turned(vectors: FloatArray, by: FloatArray) -> FloatArray:
    """Vectors [.., 3] as a frame has them that is turned by rotation vectors [.., 3]."""
    angle = np.linalg.norm(by, axis=-1, keepdims=True)
    axis = -by / np.maximum(angle, 1e-300)
    along = (axis * vectors).sum(axis=-1, keepdims=True) * axis
    across = vectors - along
    return along + np.cos(angle) * across + np.sin(angle) * np.cross(axis, vectors)


def test_two_cameras_at_a_right_angle() -> None:
    """5 px at 10 m with 2500 px are 20 mm: across both rays once, and across one of them twice.

    Informations add up to 1, 1 and 2 of that of a camera, so that the error is 20 mm sqrt(2.5).
    """
    assert Rig.around([0, math.pi / 2]).error() == pytest.approx(0.02 * math.sqrt(2.5))
    # Four all around have 2, 2 and 4.
    angles = [0, math.pi / 2, math.pi, -math.pi / 2]
    assert Rig.around(angles).error() == pytest.approx(0.02 * math.sqrt(1.25))


@examples(40)
@given(SEEDS)
def test_derivatives_are_those_of_the_projection(seed: int) -> None:
    """A small change of the point, or a small turn of the camera, changes the image by as much."""
    rig, tiny = Rig.drawn(seed, 3), 1e-6
    by_point = jacobians(rig.seen, rig.focal)
    by_turn = turning_jacobians(rig.seen, by_point)
    for axis in range(3):
        way = tiny * np.eye(3)[axis]
        both = [projected(rig.seen + sign * way, rig.focal) for sign in (1, -1)]
        np.testing.assert_allclose(by_point[..., axis], (both[0] - both[1]) / (2 * tiny), rtol=1e-5,
                                   atol=1e-4)  # fmt: skip
        both = [projected(turned(rig.seen, sign * way), rig.focal) for sign in (1, -1)]
        np.testing.assert_allclose(by_turn[..., axis], (both[0] - both[1]) / (2 * tiny), rtol=1e-5,
                                   atol=1e-2)  # fmt: skip


def test_off_the_axis_a_camera_tells_more_than_focal_by_distance() -> None:
    """At 35 degrees off the axis an angle takes 1 / cos to 1 / cos^2 of the pixels it takes there.

    With f / d for all directions the error would be 1.22 to 1.49 times what it is.
    """
    angle, off = math.radians(35), math.pi / 2
    middle = Rig.around([0, off])
    aside = middle._replace(axes=Rig.around([angle, off + angle]).axes)
    ratio = middle.error() / aside.error()
    assert 1 / math.cos(angle) < ratio < 1 / math.cos(angle) ** 2


@examples(40)
@given(st.floats(1, 100), st.floats(0, 1), st.floats(0, 0.1))
def test_on_the_axis_errors_of_poses_add_up_in_squares(d: float, place: float, turn: float) -> None:
    """A camera's error across is the root of (s d / f)^2 + s_pos^2 + (d s_att)^2."""
    point = np.array([0.0, 0.0, d])
    by_point = jacobians(point, np.array(FOCAL))
    found = pixel_covariances(point, by_point, PIXEL, place, turn) * (d / FOCAL) ** 2
    expected = (PIXEL * d / FOCAL) ** 2 + place**2 + (d * turn) ** 2
    np.testing.assert_allclose(found, expected * np.eye(2), rtol=1e-9, atol=1e-9)


def measured(rig: Rig, rng: np.random.Generator, poses: tuple[float, float]) -> FloatArray:
    """Pixels [N, n, 2] measured in pictures by cameras that are not quite where they should be."""
    shape = (2000, len(rig.places), 3)
    off = rig.point - rig.places - poses[0] * rng.normal(size=shape)
    seen = np.einsum("nkx,snx->snk", rig.axes, off)
    pixels = projected(turned(seen, poses[1] * rng.normal(size=shape)), rig.focal)
    return pixels + PIXEL * rng.normal(size=pixels.shape)


def refined(rig: Rig, pixels: FloatArray, poses: tuple[float, float]) -> FloatArray:
    """Points [N, 3] by weighted least squares (Gauss-Newton) from the true one on."""
    by_point = jacobians(rig.seen, rig.focal)
    weights = np.linalg.inv(pixel_covariances(rig.seen, by_point, PIXEL, *poses))
    points = np.broadcast_to(rig.point, (len(pixels), 3))
    for _ in range(6):
        seen = np.einsum("nkx,snx->snk", rig.axes, points[:, None] - rig.places)
        J = jacobians(seen, np.broadcast_to(rig.focal, seen.shape[:2])) @ rig.axes
        JW = J.swapaxes(-1, -2) @ weights
        residuals = (pixels - projected(seen, rig.focal))[..., None]
        step = np.linalg.solve((JW @ J).sum(axis=1), (JW @ residuals).sum(axis=1))
        points = points + step[..., 0]
    return points


@pytest.mark.slow
@pytest.mark.parametrize("poses", [(0.0, 0.0), (0.05, 0.005)])
def test_predictions_are_what_least_squares_reach(poses: tuple[float, float]) -> None:
    """Pictures with noise are triangulated: the error's RMS is as predicted, in the median."""
    rng, ratios = np.random.default_rng(5), []
    for seed in range(7):
        rig = Rig.drawn(seed, 2 + seed % 3)
        points = refined(rig, measured(rig, rng, poses), poses)
        reached = math.sqrt(((points - rig.point) ** 2).sum(axis=-1).mean())
        ratios.append(reached / rig.error(*poses))
    assert np.median(ratios) == pytest.approx(1, abs=0.1)
    assert min(ratios) > 0.9


@pytest.mark.parametrize("angle", [1.0, 1e-2, 1e-4, 1e-5, 3e-6])
def test_small_angles_are_computed_to_a_thousandth(angle: float) -> None:
    """1 - cos, 1 + cos and 2 are the informations of two rays, in those of one."""
    for opposite in (0.0, math.pi):
        half = math.sin(angle / 2)
        expected = 0.02 * math.sqrt(1 / (2 * half**2) + 1 / (2 - 2 * half**2) + 0.5)
        found = Rig.around([0.3, 0.3 + opposite + angle]).error()
        assert found == pytest.approx(expected, rel=1e-3)


@examples(40)
@given(st.floats(0, math.tau), st.floats(1, 1000), st.sampled_from([0.0, math.pi]))
def test_collinear_rays_leave_the_error_infinite(yaw: float, d: float, opposite: float) -> None:
    """Nobody knows how far away the point is, however often it is seen from there."""
    assert Rig.around([yaw], d).error() == math.inf
    assert Rig.around([yaw] * 5, d).error() == math.inf
    assert Rig.around([yaw, yaw + opposite], d).error() == math.inf
    assert Rig.around([yaw, yaw + opposite + 1e-6], d).error() == math.inf
    assert Rig.around([yaw, yaw + opposite, yaw], d).error(0.1, 0.01) == math.inf


def test_without_any_camera_the_error_is_infinite() -> None:
    """No information is no division by zero."""
    assert rms_errors(np.zeros((2, 3, 3))).tolist() == [math.inf, math.inf]


@examples(40)
@given(SEEDS)
def test_errors_do_not_depend_on_where_the_scene_is(seed: int) -> None:
    """Turned, mirrored and shifted, a team measures as well."""
    rig = Rig.drawn(seed, 3)
    rng = np.random.default_rng(seed)
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    shift = rng.uniform(-100, 100, 3)
    moved = Rig(rig.places @ turn.T + shift, rig.axes @ turn.T, rig.focal, turn @ rig.point + shift)
    for poses in ((), (0.1, 0.01)):
        assert moved.error(*poses) == pytest.approx(rig.error(*poses), rel=1e-9)


@examples(40)
@given(SEEDS, st.integers(3, 5))
def test_more_drones_never_measure_worse(seed: int, count: int) -> None:
    """Information adds up."""
    rig = Rig.drawn(seed, count)
    fewer = Rig(rig.places[:-1], rig.axes[:-1], rig.focal[:-1], rig.point)
    assert rig.error() <= fewer.error() * (1 + 1e-9)
    assert rig.error(0.1, 0.01) <= fewer.error(0.1, 0.01) * (1 + 1e-9)


@examples(40)
@given(SEEDS, st.floats(0, 1), st.floats(0, 0.1))
def test_pose_errors_only_make_it_worse(seed: int, place: float, turn: float) -> None:
    """So do larger pixel errors, which the error is in proportion to."""
    rig = Rig.drawn(seed, 3)
    exact = rig.error() * (1 - 1e-9)
    assert exact <= rig.error(place) <= rig.error(place, turn) * (1 + 1e-9)
    assert exact <= rig.error(0.0, turn) <= rig.error(place, turn) * (1 + 1e-9)
    assert rig.error(pixels=2 * PIXEL) == pytest.approx(2 * rig.error())


def test_angles_between_lines() -> None:
    """Opposite rays are one line; small angles keep their digits."""
    first = np.array([1.0, 0.0, 0.0])
    for degrees, expected in ((0, 0), (30, 30), (90, 90), (150, 30), (180, 0), (1e-7, 1e-7)):
        a = math.radians(degrees)
        found = between_lines(first, 7 * np.array([math.cos(a), math.sin(a), 0.0]))
        assert float(found) == pytest.approx(expected, rel=1e-9, abs=1e-13)


@examples(40)
@given(SEEDS, st.integers(1, 5))
def test_the_widest_angle_is_that_of_a_pair_that_sees(seed: int, robots: int) -> None:
    """All pairs, one by one; turned, or drawn out along the rays, it stays the same."""
    rng = np.random.default_rng(seed)
    rays, seen = rng.normal(size=(2, robots, 3, 3)), rng.random((2, robots, 3)) < 0.6
    found = widest_angle(rays, seen)
    for t, j in np.ndindex(2, 3):
        units = [
            rays[t, i, j] / np.linalg.norm(rays[t, i, j]) for i in np.flatnonzero(seen[t, :, j])
        ]
        pairs = [abs(float(a @ b)) for k, a in enumerate(units) for b in units[:k]]
        expected = math.degrees(math.acos(min(pairs))) if pairs else math.nan
        assert float(found[t, j]) == pytest.approx(expected, nan_ok=True, abs=1e-5)
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    longer = rays @ turn.T * rng.uniform(-9, 9, (2, robots, 3, 1))
    np.testing.assert_allclose(widest_angle(longer, seen), found, atol=1e-6)


def test_turning_blurs_more_than_flying() -> None:
    """45 degrees a second at 1/500 s are 3.9 px, where 1 m/s aside at 10 m are 0.5 px."""
    rays = np.tile(np.array([10.0, 0.0, 0.0]), (2, 1, 1, 1))
    still, turn = np.zeros((2, 1, 2)), np.array([[[0.0, 0.0]], [[math.pi / 4, 0.0]]])
    focal, step, exposure = np.array([FOCAL]), 1.0, 1 / 500
    assert float(blur(rays, still, focal, step, exposure).max()) == 0
    np.testing.assert_allclose(blur(rays, turn, focal, step, exposure), 3.927, rtol=1e-3)
    aside = rays.copy()
    aside[1, ..., 1] = 1.0
    found = blur(aside, still, focal, step, exposure)[:, 0, 0]
    # At the end the ray is longer, and not quite across the way any more.
    np.testing.assert_allclose(found, [0.5, 0.5 / 1.01], rtol=1e-9)
    both = blur(aside, turn, focal, step, exposure)[:, 0, 0]
    np.testing.assert_allclose(both, found + 3.92699, rtol=1e-5)
    away = rays.copy()
    away[1, ..., 0] = 12.0
    assert float(blur(away, still, focal, step, exposure).max()) == 0


def test_at_a_step_the_greater_of_two_moves_counts() -> None:
    """Before a turn the picture is blurred as after it; tilts turn the camera, too."""
    rays = np.tile(np.array([10.0, 0.0, 0.0]), (4, 1, 1, 1))
    angles = np.array([[0.0, 0.0], [0.0, 0.0], [0.3, 0.4], [0.3, 0.4]])[:, None]
    found = blur(rays, angles, np.array([100.0]), 2.0, 0.1)[:, 0, 0]
    np.testing.assert_allclose(found, [0.0, 2.5, 2.5, 0.0], atol=1e-12)
