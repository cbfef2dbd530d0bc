"""Geometry of all actors' faces at every step, and of all matter that can hide them."""

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from cocap_opt.data import FloatArray, IntArray
from cocap_opt.problem import Problem, Shape
from cocap_opt.vision.projection import dot
from cocap_opt.vision.visibility import Occluders, Samples

_DECIMALS = 9  # of metres; points that agree in them are one
_DRAWN_IN = 0.01  # of the way to the middle, so that no ray grazes the ground
ROUNDING = 1e-6  # m, much more than that of coordinates


class _Bodies(NamedTuple):
    """The actors as wholes at one step.

    In most views an actor is wholly visible or wholly hidden, which a few rays to points all over
    it tell: `samples` are its corners and the middles of its faces, and more if it is large.
    """

    centres: FloatArray  # [A, 3] m
    reaches: FloatArray  # [A] m, of spheres around them, rounding included
    samples: Samples  # actor by actor


class Faces(NamedTuple):
    """Geometry of all faces at one step."""

    polygons: FloatArray  # [F, V, 3] m, shorter polygons repeat their last vertex
    normals: FloatArray  # [F, 3] outward, unit length
    areas: FloatArray  # [F] m2
    centres: FloatArray  # [F, 3] m
    samples: Samples  # targets of rays
    bodies: _Bodies
    terrain: Occluders
    actors: Occluders
    triangle_faces: IntArray  # [n] face of each triangle of `actors`

    @property
    def occluders(self) -> list[Occluders]:
        """Everything that hides faces."""
        return [self.terrain, self.actors]


class FaceGeometry:
    """The faces of a problem's actors at every step, computed when first asked for.

    Attributes
    ----------
    origin : [3] m, of the coordinates in which rays are cast
    """

    def __init__(self, problem: Problem) -> None:
        self._problem = problem
        shapes = [actor.shape for actor in problem.actors]
        self._points = list(map(_points_all_over, shapes, _parts(problem)))
        width, depth = problem.height_map.shape
        # The local origin for the float32 rays: the middle of the map.
        x, y = problem.height_map.centre(width // 2, depth // 2)
        self.origin = np.array([x, y, float(np.median(problem.height_map.heights))])
        solid = [problem.height_map.corners, *(mesh.corners for mesh in problem.meshes)]
        self._terrain = Occluders(np.concatenate(solid), self.origin)
        self.at = lru_cache(maxsize=None)(self._at)

    def _at(self, t: int) -> Faces:
        poses = [actor.poses[t] for actor in self._problem.actors]
        polygons = [
            _placed(face, pose)
            for actor, pose in zip(self._problem.actors, poses, strict=True)
            for face in actor.shape.faces()
        ]
        wholes = [_placed(points, pose) for points, pose in zip(self._points, poses, strict=True)]
        size = max(map(len, polygons), default=3)
        doubled = [_doubled_area(polygon) for polygon in polygons]
        lengths = [float(np.sqrt(dot(vector, vector))) for vector in doubled]
        samples = [Samples.of_polygon(polygon, self._problem.face_samples) for polygon in polygons]
        fans = [_fan(polygon) for polygon in polygons]
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
            centres=np.array([part.shares @ part.points for part in samples]).reshape(-1, 3),
            samples=Samples.joined(samples),
            bodies=_Bodies(*_spheres(padded, self._problem), _evenly(wholes)),
            terrain=self._terrain,
            actors=Occluders(triangles, self.origin, owners),
            triangle_faces=triangle_faces,
        )


def _doubled_area(polygon: FloatArray) -> FloatArray:
    """Returns the normal of a planar polygon [V, 3], twice its area long (Newell's method)."""
    moved = polygon - polygon[0]
    result: FloatArray = np.cross(moved, np.roll(moved, -1, axis=0)).sum(axis=0)
    return result


def _placed(points: FloatArray, pose: FloatArray) -> FloatArray:
    """Returns points [n, 3] of an actor, moved to a pose [4]."""
    x, y, z, yaw = pose.tolist()
    c, s = np.cos(yaw), np.sin(yaw)
    turned = [points[:, 0] * c - points[:, 1] * s, points[:, 0] * s + points[:, 1] * c]
    result: FloatArray = np.column_stack([*turned, points[:, 2]]) + np.array([x, y, z])
    return result


def _fan(polygon: FloatArray) -> FloatArray:
    """Returns the triangles [V-2, 3, 3] of a convex polygon [V, 3]."""
    return np.stack([polygon[[0, k, k + 1]] for k in range(1, len(polygon) - 1)])


def _evenly(parts: list[FloatArray]) -> Samples:
    """Returns samples of the points [n, 3] of several actors; those of one actor count equally."""
    counts = [len(points) for points in parts]
    return Samples.joined(
        Samples(points, np.full(count, 1 / count), np.array([count]))
        for points, count in zip(parts, counts, strict=True)
    )


def _spheres(polygons: FloatArray, problem: Problem) -> tuple[FloatArray, FloatArray]:
    """Returns the centres [A, 3] and radii [A] of spheres around each actor's faces [F, V, 3]."""
    actors = range(len(problem.actors))
    corners = [polygons[problem.face_owner == actor].reshape(-1, 3) for actor in actors]
    centres = np.array([(c.min(axis=0) + c.max(axis=0)) / 2 for c in corners]).reshape(-1, 3)
    ways = [c - centre for c, centre in zip(corners, centres, strict=True)]
    return centres, np.array([np.sqrt(dot(way, way)).max() for way in ways]) + ROUNDING


def _points_all_over(shape: Shape, parts: int) -> FloatArray:
    """Returns points [n, 3] of a shape: corners, middles of faces, and points between these.

    The lines between two corners and a middle are divided into `parts`. All points are drawn in
    toward the middle of the shape a little.
    """
    first, second = np.array([(i, j) for i in range(parts + 1) for j in range(parts + 1 - i)]).T
    points = []
    for face in shape.faces():
        middle = face.mean(axis=0)
        for a, b in zip(face - middle, np.roll(face, -1, axis=0) - middle, strict=True):
            points.append(middle + (first[:, None] * a + second[:, None] * b) / parts)
    different = np.unique(np.concatenate(points).round(_DECIMALS), axis=0)
    drawn_in: FloatArray = different + _DRAWN_IN * (different.mean(axis=0) - different)
    return drawn_in


def _parts(problem: Problem) -> list[int]:
    """Returns for each actor the number of parts into which half a horizontal edge is divided.

    If a part is no longer than a cell and than any other actor, no column and no actor fits in
    between two points. An edge is not divided into more parts than a face has samples along it.
    """
    faces = [actor.shape.faces() for actor in problem.actors]
    ends = [np.concatenate([np.diff(f, axis=0, append=f[:1]) for f in those]) for those in faces]
    longest = np.array([np.hypot(edge[:, 0], edge[:, 1]).max() for edge in ends])
    fits = min(problem.height_map.resolution, longest.min(initial=np.inf))
    return [min(math.ceil(edge / 2 / fits), problem.face_samples) for edge in longest.tolist()]
