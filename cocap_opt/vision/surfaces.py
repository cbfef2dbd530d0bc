"""Surfaces of triangles that rays meet: for images, and for meshes that hide actors.

Embree casts the rays. It computes in float32, so all coordinates are relative to a nearby point: at
map coordinates of 5e5 m it would otherwise lose several per cent of the pixels.
"""

from functools import cache

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore import EmbreeDevice
from embreex.rtcore_scene import EmbreeScene

from cocap_opt.data import BoolArray, FloatArray, IntArray
from cocap_opt.vision.projection import dot

RAYS = 100_000  # rays cast at once, which limits memory
_TOUCH = 1e-3  # m; a hit this close to the target is the target itself


@cache
def _device() -> EmbreeDevice:
    """Returns the process's only device, as each device takes one of 1024 thread-local keys."""
    return EmbreeDevice()


class Surface:
    """A surface of triangles.

    Parameters
    ----------
    triangles : [n, 3, 3] m

    Attributes
    ----------
    triangles : [n, 3, 3] m
    """

    def __init__(self, triangles: FloatArray) -> None:
        self.triangles = triangles
        self._scene: EmbreeScene | None = None
        if len(triangles):
            self._scene = EmbreeScene(_device(), robust=True)
            TriangleMesh(self._scene, triangles.astype(np.float32))
            # The first ray builds the scene, which several threads must not do at the same time.
            self.first_hit(np.zeros((1, 3)), np.array([[0.0, 0.0, 1.0]]))

    def first_hit(self, eyes: FloatArray, ways: FloatArray) -> tuple[FloatArray, IntArray]:
        """Returns the distances (m) at which rays first meet a triangle, and the triangles.

        Parameters
        ----------
        eyes : [n, 3] m, starts of the rays
        ways : [n, 3] unit vectors

        Returns
        -------
        distances, triangles : [n] each; inf and -1 if the ray meets nothing
        """
        if self._scene is None or not len(eyes):
            return np.full(len(eyes), np.inf), np.full(len(eyes), -1)
        hit = self._scene.run(eyes.astype(np.float32), ways.astype(np.float32), output=True)
        triangles = hit["primID"].astype(np.int64)
        return np.where(triangles >= 0, hit["tfar"].astype(np.float64), np.inf), triangles

    def lets_pass(self, eyes: FloatArray, targets: FloatArray) -> BoolArray:
        """Returns an array [n], True if a ray reaches its target from its eye, both [n, 3]."""
        passes = np.ones(len(eyes), dtype=bool)
        for first in range(0, len(eyes), RAYS):
            batch = slice(first, first + RAYS)
            ways = targets[batch] - eyes[batch]
            # the ray always reaches a nearer target
            length = np.maximum(np.sqrt(dot(ways, ways)), _TOUCH)
            distance, _ = self.first_hit(eyes[batch], ways / length[:, None])
            passes[batch] = distance >= length - _TOUCH
        return passes
