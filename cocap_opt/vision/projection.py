"""Pinhole projection of polygons: exact area in pixels, clipped to the image.

Only elementwise arithmetic is used (no BLAS), so a view's value does not depend, to the last bit,
on how many views are computed together.
"""

import math
from typing import NamedTuple

import numpy as np

from cocap_opt.data import FloatArray
from cocap_opt.problem import Camera
from cocap_opt.world.triangles import clip


class Projection(NamedTuple):
    """The pinhole projection of a camera.

    All points are in camera coordinates (right, up, forward; m).
    """

    camera: Camera

    def axes(self, headings: int) -> FloatArray:
        """Returns right, up and forward unit vectors [n, 3, 3] of the n orientations.

        These are all headings with all pitches, which run fastest. Heading k looks at yaw
        2 pi k / headings from +x, counter-clockwise; the tilt is the angle below the horizon.
        """
        yaw = np.repeat(2 * math.pi * np.arange(headings) / headings, len(self.camera.tilts))
        return self.axes_towards(yaw, np.tile(self.camera.tilts, headings))

    @staticmethod
    def axes_towards(yaw: FloatArray, tilt: FloatArray) -> FloatArray:
        """Returns right, up and forward unit vectors [n, 3, 3] of directions [n] (rad)."""
        found = []
        for heading, pitch in zip(yaw.tolist(), tilt.tolist(), strict=True):
            (c, s), (ct, st) = _cos_sin(heading), _cos_sin(pitch)
            found.append([[s, -c, 0.0], [c * st, s * st, ct], [c * ct, s * ct, -st]])
        return np.array(found)

    def frustum_distances(self, points: FloatArray) -> FloatArray:
        """Returns signed distances, up to scale, from the four sides of the view frustum [..., 4].

        They are positive inside. A point [..., 3] behind the camera lies outside at least one side,
        so no near plane is needed.
        """
        return np.stack([self._side_distance(points, side) for side in range(4)], axis=-1)

    def area(self, polygons: FloatArray) -> FloatArray:
        """Returns the areas [n] in px of the images of convex polygons [n, V, 3].

        They are clipped to the image before the division by depth, so a polygon that reaches behind
        the camera is cut, not mirrored.
        """
        area: FloatArray = self.images(polygons, with_angles=False)[0]
        return area

    def images(self, polygons: FloatArray, with_angles: bool) -> FloatArray:
        """Returns areas like `area` [1, n], optionally followed by the solid angles (sr) of images
        [2, n].
        """
        measures = (self._projected_area, solid_angles)[: 1 + with_angles]
        found = np.zeros((len(measures), len(polygons)))
        distances = self.frustum_distances(polygons)
        seen = np.flatnonzero((distances > 0).any(axis=1).all(axis=-1))
        whole = (distances[seen] >= 0).all(axis=(1, 2))
        for k, measure in enumerate(measures):
            found[k, seen[whole]] = measure(polygons[seen[whole]])
        cut = seen[~whole]  # usually few
        if len(cut):
            clipped = self._clipped(polygons[cut])
            for k, measure in enumerate(measures):
                found[k, cut] = measure(clipped)
        return found

    def _side_distance(self, points: FloatArray, side: int) -> FloatArray:
        """Returns the distances from one side: 0 right, 1 left, 2 upper, 3 lower."""
        size, off = (self.camera.width, self.camera.height)[side // 2], points[..., side // 2]
        half = size / 2 / self.camera.focal * points[..., 2]
        result: FloatArray = half + off if side % 2 else half - off
        return result

    def _clipped(self, polygons: FloatArray) -> FloatArray:
        """Returns the parts of polygons [n, V, 3] that are in the image [n, V+4, 3]."""
        for side in range(4):
            polygons = clip(polygons, self._side_distance(polygons, side))
        return polygons

    def _projected_area(self, polygons: FloatArray) -> FloatArray:
        """Returns the areas [n] in px of the images of polygons [n, V, 3] inside the frustum."""
        depth = polygons[..., 2]
        # Depth is 0 only if nothing remains of a polygon: all its vertices are the origin.
        scale = self.camera.focal / np.where(depth > 0, depth, 1.0)
        u, v = polygons[..., 0] * scale, polygons[..., 1] * scale
        # The shoelace formula relative to the first vertex keeps the terms small.
        u, v = u - u[:, :1], v - v[:, :1]
        area = np.zeros(len(polygons))
        for k in range(1, polygons.shape[1] - 1):
            area = area + (u[:, k] * v[:, k + 1] - u[:, k + 1] * v[:, k])
        return np.abs(area) / 2


def dot(a: FloatArray, b: FloatArray) -> FloatArray:
    """Returns the inner product over the last axis, of length three, in a fixed order."""
    result: FloatArray = a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1] + a[..., 2] * b[..., 2]
    return result


def solid_angles(polygons: FloatArray) -> FloatArray:
    """Returns the solid angles [n] in sr of convex polygons [n, V, 3], seen from the origin.

    The half of a triangle's solid angle is the argument of D + i N, where N is the determinant of
    its corners a, b, c and D = |a||b||c| + a.b |c| + b.c |a| + c.a |b| (Van Oosterom and Strackee,
    "The Solid Angle of a Plane Triangle", IEEE Trans. Biomed. Eng. 30(2), 1983). The product of
    these numbers over a polygon's triangles has the sum of the arguments, which is less than pi.
    """
    first, real, imaginary = polygons[:, 0], np.ones(len(polygons)), np.zeros(len(polygons))
    off = polygons - polygons[:, :1]
    lengths = np.sqrt(dot(polygons, polygons))  # [n, V]
    a, to_first = lengths[:, 0], dot(polygons, first[:, None])
    for k in range(2, polygons.shape[1]):
        b, c = lengths[:, k - 1], lengths[:, k]
        (p, q, r), (u, v, w) = off[:, k - 1].T, off[:, k].T
        x, y, z = first.T
        det = x * (q * w - r * v) + y * (r * u - p * w) + z * (p * v - q * u)
        over = a * b * c + to_first[:, k - 1] * c
        over = over + dot(polygons[:, k - 1], polygons[:, k]) * a + to_first[:, k] * b
        size = np.abs(det) + np.abs(over)
        at_eye = size == 0  # a corner at the eye: nothing remains of the polygon
        det, over = (
            np.where(at_eye, x, y / np.where(at_eye, 1.0, size))
            for x, y in ((0.0, det), (1.0, over))
        )
        real, imaginary = real * over - imaginary * det, real * det + imaginary * over
    result: FloatArray = 2 * np.abs(np.arctan2(imaginary, real))
    return result


def _cos_sin(angle: float) -> tuple[float, float]:
    """Returns cosine and sine, without rounding noise at multiples of a right angle."""
    c, s = math.cos(angle), math.sin(angle)
    return (0.0 if abs(c) < 1e-15 else c), (0.0 if abs(s) < 1e-15 else s)
