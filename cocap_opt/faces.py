"""Where the faces of all actors are at every step, and what can hide them."""

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from cocap_opt.data import FloatArray, IntArray
from cocap_opt.problem import Problem
from cocap_opt.projection import dot
from cocap_opt.visibility import (
    Occluders,
    Samples,
    fan_triangles,
    sample_points,
    terrain_triangles,
)


class Faces(NamedTuple):
    """Geometry of all faces at one step."""

    polygons: FloatArray  # [F, V, 3] m, shorter polygons repeat their last vertex
    normals: FloatArray  # [F, 3] outward, unit length
    areas: FloatArray  # [F] m2
    centres: FloatArray  # [F, 3] m
    samples: Samples  # where rays are sent
    terrain: Occluders
    actors: Occluders
    triangle_faces: IntArray  # [n] face of each triangle of `actors`

    @property
    def occluders(self) -> list[Occluders]:
        """All that hides faces."""
        return [self.terrain, self.actors]


class FaceGeometry:
    """Faces of a problem's actors at every step, made when first asked for.

    Attributes
    ----------
    origin : [3] m, of the coordinates in which rays are cast
    """

    def __init__(self, problem: Problem) -> None:
        self._problem = problem
        width, depth = problem.height_map.shape
        # The local origin for the float32 rays: the middle of the map.
        x, y = problem.height_map.centre(width // 2, depth // 2)
        self.origin = np.array([x, y, float(np.median(problem.height_map.heights))])
        solid = [terrain_triangles(problem.height_map), *(mesh.corners for mesh in problem.meshes)]
        self._terrain = Occluders(np.concatenate(solid), self.origin)
        self.at = lru_cache(maxsize=None)(self._at)

    def _at(self, t: int) -> Faces:
        polygons = []
        for actor in self._problem.actors:
            x, y, z, yaw = actor.poses[t].tolist()
            c, s = np.cos(yaw), np.sin(yaw)
            for face in actor.shape.faces():
                turned = [face[:, 0] * c - face[:, 1] * s, face[:, 0] * s + face[:, 1] * c]
                polygons.append(np.column_stack([*turned, face[:, 2]]) + np.array([x, y, z]))
        size = max(map(len, polygons), default=3)
        doubled = [_doubled_area(polygon) for polygon in polygons]
        lengths = [float(np.sqrt(dot(vector, vector))) for vector in doubled]
        samples = [sample_points(polygon, self._problem.face_samples) for polygon in polygons]
        fans = [fan_triangles(polygon) for polygon in polygons]
        triangle_faces = np.repeat(np.arange(len(fans)), [len(fan) for fan in fans])
        owners = self._problem.face_owner[triangle_faces]
        triangles = np.concatenate([np.empty((0, 3, 3)), *fans])
        return Faces(
            polygons=np.array(
                [np.pad(p, ((0, size - len(p)), (0, 0)), mode="edge") for p in polygons]
            ).reshape(-1, size, 3),
            normals=np.array(
                [vector / length for vector, length in zip(doubled, lengths, strict=True)]
            ).reshape(-1, 3),
            areas=np.array(lengths) / 2,
            centres=np.array([shares @ points for points, shares in samples]).reshape(-1, 3),
            samples=Samples(
                points=np.concatenate([np.empty((0, 3)), *(points for points, _ in samples)]),
                shares=np.concatenate([np.empty(0), *(shares for _, shares in samples)]),
                counts=np.array([len(points) for points, _ in samples], dtype=np.int64),
            ),
            terrain=self._terrain,
            actors=Occluders(triangles, self.origin, owners),
            triangle_faces=triangle_faces,
        )


def _doubled_area(polygon: FloatArray) -> FloatArray:
    """Normal of a planar polygon [V, 3] with length twice its area (Newell)."""
    moved = polygon - polygon[0]
    result: FloatArray = np.cross(moved, np.roll(moved, -1, axis=0)).sum(axis=0)
    return result
