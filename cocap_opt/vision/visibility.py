"""The share of a face that a camera sees past terrain and other actors, by ray casting.

Embree casts the rays. It computes in float32, so everything is shifted to a local origin
first: at map coordinates of 5e5 m it would otherwise lose several per cent of the pixels.
"""

from collections.abc import Iterable
from functools import cache
from typing import NamedTuple

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore import EmbreeDevice
from embreex.rtcore_scene import EmbreeScene

from cocap_opt.data import BoolArray, FloatArray, IntArray
from cocap_opt.vision.projection import centroids, dot

RAYS = 100_000  # rays cast at once, to bound the memory
_NOTHING = 1e-9  # share of a face; a smaller hidden part is no part at all
_TOUCH = 1e-3  # m; a hit this near to the sample point is the sampled face itself


@cache
def _device() -> EmbreeDevice:
    """Returns the one device of the process; each takes one of 1024 thread-local keys."""
    return EmbreeDevice()


class Occluders:
    """Matter that blocks views: the terrain, or the actors of one step.

    Parameters
    ----------
    triangles : [n, 3, 3] m
    origin : [3] m, subtracted from all points
    owners : [n] actor of each triangle; -1 for terrain

    Attributes
    ----------
    triangles : [n, 3, 3] m
    """

    def __init__(
        self, triangles: FloatArray, origin: FloatArray, owners: IntArray | None = None
    ) -> None:
        self._origin = origin
        self._owners = np.full(len(triangles), -1) if owners is None else owners
        self.triangles = triangles
        self._scene: EmbreeScene | None = None
        if len(triangles):
            self._scene = EmbreeScene(_device(), robust=True)
            TriangleMesh(self._scene, (triangles - origin).astype(np.float32))
            # The first ray builds the scene; several threads must not do that at the same time.
            self.first_hit(origin[None], np.array([[0.0, 0.0, 1.0]]))

    def first_hit(self, eyes: FloatArray, ways: FloatArray) -> tuple[FloatArray, IntArray]:
        """Returns the distances (m) at which rays first meet a triangle, and the triangles.

        Parameters
        ----------
        eyes : [n, 3] m, starts of the rays
        ways : [n, 3] unit vectors

        Returns
        -------
        distances, triangles : [n] each; inf and -1 where there is nothing
        """
        if self._scene is None or not len(eyes):
            return np.full(len(eyes), np.inf), np.full(len(eyes), -1)
        hit = self._scene.run(
            (eyes - self._origin).astype(np.float32), ways.astype(np.float32), output=True
        )
        triangles = hit["primID"].astype(np.int64)
        return np.where(triangles >= 0, hit["tfar"].astype(np.float64), np.inf), triangles

    def free_share(
        self, eyes: FloatArray, targets: FloatArray, target_owners: IntArray | None = None
    ) -> FloatArray:
        """Returns the share [n] of the way from eyes to targets, both [n, 3], that rays get.

        It is 1 for a ray that arrives. A face that is turned to the camera cannot be hidden by
        its own (convex) actor, `target_owners` [n].
        """
        ways = targets - eyes
        length = np.maximum(np.sqrt(dot(ways, ways)), _TOUCH)  # a nearer one arrives
        distance, triangle = self.first_hit(eyes, ways / length[:, None])
        arrives = distance >= length - _TOUCH
        if target_owners is not None:
            hits = np.flatnonzero(triangle >= 0)
            arrives[hits] |= self._owners[triangle[hits]] == target_owners[hits]
        return np.where(arrives, 1.0, distance / length)


class Samples(NamedTuple):
    """Sample points of all faces, or of all actors, one after the other."""

    points: FloatArray  # [M, 3] m
    shares: FloatArray  # [M] share of its face's area that each point stands for
    counts: IntArray  # [F] number of points of each face

    @classmethod
    def of_polygon(cls, polygon: FloatArray, samples: int) -> "Samples":
        """Returns points spread over a convex polygon [V, 3].

        Each triangle between an edge and the middle is cut into `samples` squared equal triangles,
        whose centroids are the points, so that a mirrored polygon has mirrored points.
        """
        a, b = centroids(samples)
        points, areas = [], []
        for triangle in _around_middle(polygon):
            first, second = triangle[1] - triangle[0], triangle[2] - triangle[0]
            points.append(triangle[0] + a[:, None] * first + b[:, None] * second)
            areas.append(np.full(len(a), np.linalg.norm(np.cross(first, second)) / len(a)))
        share = np.concatenate(areas)
        return cls(np.concatenate(points), share / share.sum(), np.array([len(share)]))

    @classmethod
    def joined(cls, parts: Iterable["Samples"]) -> "Samples":
        """Returns the samples of several parts, one after the other."""
        return cls(*(np.concatenate(columns) for columns in zip(_NO_SAMPLES, *parts, strict=True)))

    def of(self, faces: IntArray) -> tuple[IntArray, IntArray]:
        """Returns for all points of faces [n] the position of the face, and the point's number."""
        counts, first = self.counts[faces], np.cumsum(self.counts) - self.counts
        return np.repeat(np.arange(len(faces)), counts), spans(first[faces], counts)

    def seen(
        self, occluders: list[Occluders], eyes: FloatArray, faces: IntArray, owners: IntArray
    ) -> BoolArray:
        """Returns an array that is true for each sample point of faces [n] that is seen.

        Points are one after the other, as `of` has them.

        Parameters
        ----------
        occluders : all matter that hides faces
        eyes : [n, 3] m, camera positions, one per pair of camera and face
        faces : [n] number of the face that is looked at
        owners : [F] actor of each face
        """
        parts = np.cumsum(self.counts[faces]) // RAYS
        cuts = np.flatnonzero(np.diff(parts)) + 1
        arrives = [np.zeros(0, dtype=bool)]
        for at in np.split(np.arange(len(faces)), cuts):
            pair, point = self.of(faces[at])
            eye, owner = eyes[at][pair], owners[faces[at]][pair]
            arrives.append(rays_arrive(occluders, eye, self.points[point], owner))
        return np.concatenate(arrives)

    def seen_share(self, faces: IntArray, seen: BoolArray) -> FloatArray:
        """Returns the share [n] of the area of faces that is seen, from the points that are."""
        pair, point = self.of(faces)
        # Shares are added in this order, so that the result does not depend on n.
        share = np.bincount(pair, weights=seen * self.shares[point], minlength=len(faces))
        return np.where(share < 1 - _NOTHING, share, 1.0)


_NO_SAMPLES = Samples(np.empty((0, 3)), np.empty(0), np.zeros(0, dtype=np.int64))


def _around_middle(polygon: FloatArray) -> list[FloatArray]:
    """Returns the triangles [3, 3] between the edges of a convex polygon [V, 3] and its middle."""
    middle = polygon.mean(axis=0)
    ends = zip(polygon, np.roll(polygon, -1, axis=0), strict=True)
    return [np.stack([middle, a, b]) for a, b in ends]


def spans(first: IntArray, counts: IntArray) -> IntArray:
    """Returns the numbers first, first + 1, .. of spans of `counts` [n], one after the other."""
    ends = np.cumsum(counts)
    result: IntArray = np.arange(int(counts.sum())) + np.repeat(first + counts - ends, counts)
    return result


def rays_arrive(
    occluders: list[Occluders], eyes: FloatArray, targets: FloatArray, owners: IntArray
) -> BoolArray:
    """Returns an array [n], true if a ray gets from its eye to its target on an actor's face.

    `owners` [n] are the actors.
    """
    arrives = np.ones(len(eyes), dtype=bool)
    for occluder in occluders:
        rest = np.flatnonzero(arrives)
        arrives[rest] = occluder.free_share(eyes[rest], targets[rest], owners[rest]) >= 1.0
    return arrives
