"""Which share of a face a camera sees past terrain and other actors, by ray casting.

Rays are cast by Embree. It computes in float32, so everything is shifted to a local origin
first: at map coordinates of 5e5 m it would otherwise lose several per cent of the pixels.
"""

from functools import cache
from typing import NamedTuple

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore import EmbreeDevice
from embreex.rtcore_scene import EmbreeScene

from cocap_opt.problem import FloatArray, HeightMap, IntArray
from cocap_opt.projection import dot

RAYS = 100_000  # rays cast at once, to bound the memory
TOUCH = 1e-3  # m; a hit this near to the sample point is the sampled face itself


def terrain_triangles(height_map: HeightMap) -> FloatArray:
    """Surface of the columns of a height map as triangles [n, 3, 3] in m.

    Every cell has a flat top; where two cells (or a cell and the outside) differ in height,
    a vertical wall joins them. The outside is as low as the lowest cell.
    """
    heights, resolution = height_map.heights, height_map.resolution
    ox, oy = height_map.origin
    width, depth = heights.shape
    x = ox + resolution * np.arange(width + 1)
    y = oy + resolution * np.arange(depth + 1)
    i, j = (index.ravel() for index in np.indices(heights.shape))
    quads = [_quads((x[i], y[j]), (x[i + 1], y[j]), (x[i + 1], y[j + 1]), (x[i], y[j + 1]),
                    heights.ravel(), heights.ravel())]  # fmt: skip
    outside = float(heights.min())
    framed = np.pad(heights, 1, constant_values=outside)
    step_x = framed[:-1, 1:-1], framed[1:, 1:-1]
    i, j = np.nonzero(step_x[0] != step_x[1])
    low, high = np.minimum(*step_x)[i, j], np.maximum(*step_x)[i, j]
    quads.append(_quads((x[i], y[j]), (x[i], y[j + 1]), (x[i], y[j + 1]), (x[i], y[j]), low, high))
    step_y = framed[1:-1, :-1], framed[1:-1, 1:]
    i, j = np.nonzero(step_y[0] != step_y[1])
    low, high = np.minimum(*step_y)[i, j], np.maximum(*step_y)[i, j]
    quads.append(_quads((x[i], y[j]), (x[i + 1], y[j]), (x[i + 1], y[j]), (x[i], y[j]), low, high))
    corners = np.concatenate(quads)
    return corners[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3, 3)


def _quads(
    a: tuple[FloatArray, FloatArray],
    b: tuple[FloatArray, FloatArray],
    c: tuple[FloatArray, FloatArray],
    d: tuple[FloatArray, FloatArray],
    first: FloatArray,
    second: FloatArray,
) -> FloatArray:
    """Quads [n, 4, 3] over four (x, y) corners; the last two corners at the second height."""
    corners = [
        np.column_stack([*corner, z])
        for corner, z in zip((a, b, c, d), (first, first, second, second), strict=True)
    ]
    return np.stack(corners, axis=1)


def fan_triangles(polygon: FloatArray) -> FloatArray:
    """Triangles [V-2, 3, 3] of a convex polygon [V, 3]."""
    return np.stack([polygon[[0, k, k + 1]] for k in range(1, len(polygon) - 1)])


def sample_points(polygon: FloatArray, samples: int) -> tuple[FloatArray, FloatArray]:
    """Points [n, 3] spread over a convex polygon [V, 3] and the share of area of each [n].

    Each triangle of the polygon's fan is cut into `samples` squared equal triangles; their
    centroids are the points.
    """
    rows = [
        (i + third, j + third)
        for third, size in ((1 / 3, samples), (2 / 3, samples - 1))
        for i in range(size)
        for j in range(size - i)
    ]
    a, b = (np.array(rows) / samples).T
    points, areas = [], []
    for triangle in fan_triangles(polygon):
        first, second = triangle[1] - triangle[0], triangle[2] - triangle[0]
        points.append(triangle[0] + a[:, None] * first + b[:, None] * second)
        areas.append(np.full(len(a), np.linalg.norm(np.cross(first, second)) / len(a)))
    share = np.concatenate(areas)
    return np.concatenate(points), share / share.sum()


@cache
def _device() -> EmbreeDevice:
    """The one device of the process: each takes one of its 1024 thread-local keys."""
    return EmbreeDevice()


class Occluders:
    """Things that block views: the terrain, or the actors of one step.

    Parameters
    ----------
    triangles : [n, 3, 3] m
    origin : [3] m, subtracted from all points
    owners : [n] actor of each triangle; -1 for terrain
    """

    def __init__(
        self, triangles: FloatArray, origin: FloatArray, owners: IntArray | None = None
    ) -> None:
        self._origin = origin
        self._owners = np.full(len(triangles), -1) if owners is None else owners
        self._scene: EmbreeScene | None = None
        if len(triangles):
            self._scene = EmbreeScene(_device(), robust=True)
            TriangleMesh(self._scene, (triangles - origin).astype(np.float32))

    def free_share(
        self, eyes: FloatArray, targets: FloatArray, target_owners: IntArray | None = None
    ) -> FloatArray:
        """How far a ray from each eye [n, 3] gets toward its target [n, 3]: 1 where it arrives.

        Below 1 it is the share of the distance at which the ray is stopped. A face that is
        turned to the camera cannot be hidden by its own (convex) actor, `target_owners` [n].
        """
        if self._scene is None or not len(eyes):
            return np.ones(len(eyes))
        ways = targets - eyes
        length = np.maximum(np.sqrt(dot(ways, ways)), TOUCH)  # a nearer one arrives
        hit = self._scene.run(
            (eyes - self._origin).astype(np.float32),
            (ways / length[:, None]).astype(np.float32),
            output=True,
        )
        distance = hit["tfar"].astype(np.float64)
        arrives = distance >= length - TOUCH
        if target_owners is not None:
            arrives |= self._owners[hit["primID"]] == target_owners
        return np.where(arrives, 1.0, distance / length)


class Samples(NamedTuple):
    """Sample points of all faces, face by face."""

    points: FloatArray  # [M, 3] m
    shares: FloatArray  # [M] share of its face's area that each point stands for
    counts: IntArray  # [F] number of points of each face


def visible_share(
    occluders: list[Occluders],
    eyes: FloatArray,
    samples: Samples,
    faces: IntArray,
    owners: IntArray,
) -> FloatArray:
    """Share of each face's area that is seen from each eye [n].

    Parameters
    ----------
    eyes : [n, 3] camera positions, one per pair of camera and face
    faces : [n] which face is looked at
    owners : [F] actor of each face
    """
    parts = np.cumsum(samples.counts[faces]) // RAYS
    cuts = np.flatnonzero(np.diff(parts)) + 1
    seen = [
        _visible_share(occluders, eyes[at], samples, faces[at], owners)
        for at in np.split(np.arange(len(faces)), cuts)
    ]
    return np.concatenate(seen)


def _visible_share(
    occluders: list[Occluders],
    eyes: FloatArray,
    samples: Samples,
    faces: IntArray,
    owners: IntArray,
) -> FloatArray:
    # One ray for each sample point of each pair, pair by pair.
    counts, first = samples.counts[faces], np.cumsum(samples.counts) - samples.counts
    pair = np.repeat(np.arange(len(faces)), counts)
    point = np.arange(len(pair)) + (first[faces] - (np.cumsum(counts) - counts))[pair]
    arrives = np.ones(len(pair), dtype=bool)
    for occluder in occluders:
        rest = np.flatnonzero(arrives)
        ray, target = pair[rest], point[rest]
        free = occluder.free_share(eyes[ray], samples.points[target], owners[faces[ray]])
        arrives[rest] = free >= 1.0
    # It adds up in this order, so that the result does not depend on n.
    seen = np.bincount(pair, weights=arrives * samples.shares[point], minlength=len(faces))
    return np.minimum(seen, 1.0)
