"""Where the faces of all actors are at every step, and what can hide them."""

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from cocap_opt.data import FloatArray, IntArray
from cocap_opt.problem import Problem
from cocap_opt.projection import dot
from cocap_opt.survey import Survey, ray_margin
from cocap_opt.visibility import (
    Occluders,
    Samples,
    fan_triangles,
    sample_points,
    terrain_triangles,
)


class Bodies(NamedTuple):
    """What the actors are inside of at one step."""

    centres: FloatArray  # [A, 3] m
    radii: FloatArray  # [A] m, of upright cylinders around them
    reaches: FloatArray  # [A] m, of spheres around them


class Faces(NamedTuple):
    """Geometry of all faces at one step."""

    polygons: FloatArray  # [F, V, 3] m, shorter polygons repeat their last vertex
    normals: FloatArray  # [F, 3] outward, unit length
    areas: FloatArray  # [F] m2
    centres: FloatArray  # [F, 3] m
    samples: Samples  # where rays are sent
    bodies: Bodies
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
    margin : m, by which these rays may be off their way
    """

    def __init__(self, problem: Problem) -> None:
        self._problem = problem
        width, depth = problem.height_map.shape
        # The local origin for the float32 rays: the middle of the map.
        x, y = problem.height_map.centre(width // 2, depth // 2)
        self.origin = np.array([x, y, float(np.median(problem.height_map.heights))])
        self.margin = ray_margin(problem, self.origin)
        solid = [terrain_triangles(problem.height_map), *(mesh.corners for mesh in problem.meshes)]
        self._terrain = Occluders(np.concatenate(solid), self.origin)
        self.at = lru_cache(maxsize=None)(self._at)
        self._surveys: dict[tuple[float, ...], Survey] = {}

    def survey(self, layers: tuple[float, ...]) -> Survey:
        """What is known without rays from these flight heights; one for all who ask."""
        if layers not in self._surveys:
            self._surveys[layers] = Survey(self._problem, layers, self.margin)
        return self._surveys[layers]

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
        padded = np.array(
            [np.pad(p, ((0, size - len(p)), (0, 0)), mode="edge") for p in polygons]
        ).reshape(-1, size, 3)
        return Faces(
            polygons=padded,
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
            bodies=_bodies(padded, self._problem),
            terrain=self._terrain,
            actors=Occluders(triangles, self.origin, owners),
            triangle_faces=triangle_faces,
        )


def _doubled_area(polygon: FloatArray) -> FloatArray:
    """Normal of a planar polygon [V, 3] with length twice its area (Newell)."""
    moved = polygon - polygon[0]
    result: FloatArray = np.cross(moved, np.roll(moved, -1, axis=0)).sum(axis=0)
    return result


def _bodies(polygons: FloatArray, problem: Problem) -> Bodies:
    """Cylinders and spheres around the faces [F, V, 3] of each actor."""
    actors = range(len(problem.actors))
    corners = [polygons[problem.face_owner == actor].reshape(-1, 3) for actor in actors]
    centres = np.array([(c.min(axis=0) + c.max(axis=0)) / 2 for c in corners]).reshape(-1, 3)
    ways = [np.abs(c - centre) for c, centre in zip(corners, centres, strict=True)]
    return Bodies(
        centres=centres,
        radii=np.array([np.hypot(way[:, 0], way[:, 1]).max() for way in ways]),
        reaches=np.array([np.sqrt(dot(way, way)).max() for way in ways]),
    )
