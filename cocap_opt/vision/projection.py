"""Pinhole projection of polygons: exact area in pixels, clipped to the image.

Only elementwise arithmetic is used (no BLAS), so that a view's value does not depend on how
many views are computed together, to the last bit.
"""

import math

import numpy as np

from cocap_opt.data import FloatArray
from cocap_opt.problem import Camera
from cocap_opt.world.polygons import clip

_SMALLEST_DEPTH = 1e-9  # m


def camera_axes(headings: int, camera: Camera) -> FloatArray:
    """Returns right, up and forward unit vectors of all orientations [headings * pitches, 3, 3].

    Heading k looks at yaw 2 pi k / headings from +x, counter-clockwise; the tilt is the angle
    below the horizon.
    """
    axes = []
    for heading in range(headings):
        c, s = _cos_sin(2 * math.pi * heading / headings)
        for tilt in camera.tilts:
            ct, st = _cos_sin(tilt)
            axes.append([[s, -c, 0.0], [c * st, s * st, ct], [c * ct, s * ct, -st]])
    return np.array(axes)


def _cos_sin(angle: float) -> tuple[float, float]:
    """Returns cosine and sine, without rounding noise at multiples of a right angle."""
    c, s = math.cos(angle), math.sin(angle)
    return (0.0 if abs(c) < 1e-15 else c), (0.0 if abs(s) < 1e-15 else s)


def dot(a: FloatArray, b: FloatArray) -> FloatArray:
    """Returns the inner product over the last axis, of length three, in a fixed order."""
    result: FloatArray = a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1] + a[..., 2] * b[..., 2]
    return result


def frustum_distances(points: FloatArray, camera: Camera) -> FloatArray:
    """Returns signed distances, up to scale, from the four sides of the view frustum [..., 4].

    They are positive inside. `points` [..., 3] are right, up, forward coordinates. A point behind
    the camera lies outside at least one side, so that no near plane is needed.
    """
    return np.stack([_side_distance(points, camera, side) for side in range(4)], axis=-1)


def _side_distance(points: FloatArray, camera: Camera, side: int) -> FloatArray:
    """Returns the distances from one side: 0 right, 1 left, 2 upper, 3 lower."""
    size, off = (camera.width, camera.height)[side // 2], points[..., side // 2]
    half = size / 2 / camera.focal * points[..., 2]
    result: FloatArray = half + off if side % 2 else half - off
    return result


def image_area(polygons: FloatArray, camera: Camera) -> FloatArray:
    """Returns the areas [n] in px of the images of convex polygons [n, V, 3].

    Points are in camera coordinates (right, up, forward; m). Polygons are clipped to the image
    before the division by depth, so that a polygon that reaches behind the camera is cut, not
    mirrored.
    """
    area = np.zeros(len(polygons))
    distances = frustum_distances(polygons, camera)
    seen = np.flatnonzero((distances > 0).any(axis=1).all(axis=-1))
    whole = (distances[seen] >= 0).all(axis=(1, 2))
    area[seen[whole]] = _projected_area(polygons[seen[whole]], camera)
    cut = seen[~whole]  # few, mostly
    if len(cut):
        area[cut] = _projected_area(_clipped(polygons[cut], camera), camera)
    return area


def image_samples(
    polygons: FloatArray, camera: Camera, samples: int
) -> tuple[FloatArray, FloatArray]:
    """Returns points spread evenly over the images of convex polygons [n, V, 3], clipped.

    Each triangle between an edge of an image and its centroid is cut into `samples` squared
    equal triangles; a point is the one of the polygon whose image is the centroid of a triangle.

    Returns
    -------
    points : [n, M, 3] m, in camera coordinates
    weights : [n, M] share of the image that each stands for; 0 if its triangle has no area
    """
    cut = _clipped(polygons, camera)
    inverse = 1 / np.maximum(cut[..., 2:], _SMALLEST_DEPTH)
    image = np.concatenate([cut[..., :2] * inverse, inverse], axis=-1)  # linear in the image
    a, b = (weight[:, None] for weight in centroids(samples))
    middle = _centroids(image)[:, None]
    first = (image - middle)[:, :, None]
    second = np.roll(first, -1, axis=1)
    at = (middle[:, None] + a * first + b * second).reshape(len(cut), image.shape[1] * len(a), 3)
    area = np.abs(first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0])
    weights = np.repeat(area[..., 0], len(a), axis=1)
    total = weights.sum(axis=1, keepdims=True)
    points = np.concatenate([at[..., :2], np.ones_like(at[..., :1])], axis=-1) / at[..., 2:]
    return points, weights / np.where(total > 0, total, 1.0)


def _centroids(image: FloatArray) -> FloatArray:
    """Returns the centroids [n, 3] of convex polygons [n, V, 3], by area in the first two axes."""
    off = image - image[:, :1]
    first, second = off[:, 1:-1], off[:, 2:]
    area = np.abs(first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0])[..., None]
    total = area.sum(axis=1)
    middle = ((first + second) * area).sum(axis=1) / (3 * np.where(total > 0, total, 1.0))
    result: FloatArray = image[:, 0] + middle
    return result


def centroids(samples: int) -> tuple[FloatArray, FloatArray]:
    """Returns barycentric coordinates [n] of the centroids of equal parts of a triangle.

    There are n = `samples` squared parts.
    """
    rows = [
        (i + third, j + third)
        for third, size in ((1 / 3, samples), (2 / 3, samples - 1))
        for i in range(size)
        for j in range(size - i)
    ]
    a, b = (np.array(rows) / samples).T
    return a, b


def _clipped(polygons: FloatArray, camera: Camera) -> FloatArray:
    """Returns the parts of polygons [n, V, 3] that are in the image [n, V+4, 3]."""
    for side in range(4):
        polygons = clip(polygons, _side_distance(polygons, camera, side))
    return polygons


def _projected_area(polygons: FloatArray, camera: Camera) -> FloatArray:
    """Returns the areas [n] in px of the images of polygons [n, V, 3] inside the frustum."""
    depth = polygons[..., 2]
    # Depth is 0 only if nothing is left of a polygon: all its vertices are the origin.
    scale = camera.focal / np.where(depth > 0, depth, 1.0)
    u, v = polygons[..., 0] * scale, polygons[..., 1] * scale
    # The shoelace formula relative to the first vertex keeps the terms small.
    u, v = u - u[:, :1], v - v[:, :1]
    area = np.zeros(len(polygons))
    for k in range(1, polygons.shape[1] - 1):
        area = area + (u[:, k] * v[:, k + 1] - u[:, k + 1] * v[:, k])
    return np.abs(area) / 2
