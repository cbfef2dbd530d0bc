"""Renders images by ray casting, pixel by pixel: the reference against which coverage is tested.

One ray goes through the middle of every pixel, which shows the first surface that the ray meets.
Rendering shares only the geometry of the faces with coverage.
"""

import math
from collections.abc import Iterator, Sequence
from functools import lru_cache

import numpy as np

from cocap_opt.data import FloatArray, IntArray
from cocap_opt.problem import Camera, Problem, Robot, State
from cocap_opt.result import UnsupportedError
from cocap_opt.vision.faces import FaceGeometry
from cocap_opt.vision.surfaces import Surface

SKY, TERRAIN = -2, -1  # in place of a face
RAYS = 500_000  # rays cast at once, which limits memory
_BORDER = 2.0  # px of margin around the box that contains an actor


class Renderer:
    """Renders views of a problem's robots.

    Parameters
    ----------
    problem : the problem
    step : one ray is cast for each block of step x step pixels, through its middle, and represents
        all its pixels; 1 is exact

    Raises
    ------
    UnsupportedError
        If a robot has a sensor that makes no images.
    """

    def __init__(self, problem: Problem, step: int = 1) -> None:
        for robot in problem.robots:
            self.camera_of(robot)
        self._problem, self._step = problem, step
        self._geometry = FaceGeometry(problem)
        solid = [problem.height_map.corners, *(mesh.corners for mesh in problem.meshes)]
        self._terrain = Surface(np.concatenate(solid) - self._geometry.origin)
        self._bodies = lru_cache(maxsize=256)(self._all)
        self._alone = lru_cache(maxsize=256)(self._only)

    @staticmethod
    def camera_of(robot: Robot) -> Camera:
        """Returns a robot's camera, which must make images.

        Raises
        ------
        UnsupportedError
            If it makes no images.
        """
        if not isinstance(robot.camera, Camera):
            raise UnsupportedError("only pinhole cameras make images")
        return robot.camera

    def areas(self, t: int) -> FloatArray:
        """Returns the areas of all faces [F] at step t, in m2."""
        return self._geometry.at(t).areas

    def pixels(self, robot: Robot, t: int, state: State) -> FloatArray:
        """Returns the pixels [F] of every face in a robot's image at step t."""
        counts = np.zeros(len(self._problem.face_weights))
        for actor, box in self._boxes(t, robot, state):
            actors, triangle_faces = self._bodies(t, int(self._problem.take_of[actor]))
            for _, ways, surface, triangle in self._cast(
                robot, state, box, (actors, self._terrain)
            ):
                of_actors = np.flatnonzero(surface == 0)
                triangle, ways = triangle[of_actors], ways[of_actors]
                # A face that is seen from behind, from inside a body, does not count.
                outside = (_normals(actors.triangles[triangle]) * ways).sum(axis=1) < 0
                seen = triangle_faces[triangle[outside]]
                its_faces = seen[self._problem.face_owner[seen] == actor]
                counts += np.bincount(its_faces, minlength=len(counts))
        return counts * self._step**2

    def unhidden(self, robot: Robot, t: int, state: State) -> FloatArray:
        """Returns the pixels [F] that every face would have if its actor were alone."""
        counts = np.zeros(len(self._problem.face_weights))
        for actor, box in self._boxes(t, robot, state):
            alone, its_faces = self._alone(t, actor)
            for _, _, surface, triangle in self._cast(robot, state, box, (alone,)):
                seen = its_faces[triangle[surface == 0]]
                counts += np.bincount(seen, minlength=len(counts))
        return counts * self._step**2

    def coverage(self, robot: Robot, t: int, state: State) -> FloatArray:
        """Returns the rendered coverage [F] in px/m2 of every face in a robot's image at step t."""
        result: FloatArray = self.pixels(robot, t, state) / self.areas(t)
        return result

    def picture(
        self, robot: Robot, t: int, state: State, take: int = 0
    ) -> tuple[IntArray, FloatArray]:
        """Returns the whole image, one pixel for each block.

        Parameters
        ----------
        take : number of the take whose people are present

        Returns
        -------
        faces : [height, width] number of the face that each pixel shows, or TERRAIN or SKY
        shade : [height, width] cosine between ray and surface normal; 0 for the sky
        """
        actors, triangle_faces = self._bodies(t, take)
        surfaces = (actors, self._terrain)
        camera = self.camera_of(robot)
        width, height = (-(-size // self._step) for size in (camera.width, camera.height))
        shown, shade = np.full(width * height, SKY), np.zeros(width * height)
        box = (0, 0, camera.width, camera.height)
        for at, ways, hit_surface, hit_triangle in self._cast(robot, state, box, surfaces):
            for k, surface in enumerate(surfaces):
                hit = np.flatnonzero(hit_surface == k)
                triangle = hit_triangle[hit]
                shown[at[hit]] = TERRAIN if k else triangle_faces[triangle]
                shade[at[hit]] = np.abs((_normals(surface.triangles[triangle]) * ways[hit]).sum(1))
        return shown.reshape(height, width), shade.reshape(height, width)

    def _all(self, t: int, take: int) -> tuple[Surface, IntArray]:
        """Returns all actors of a take at step t as one surface, and the face of each triangle."""
        polygons = self._geometry.at(t).polygons[0]
        fans = np.stack(
            [polygons[:, [0, k, k + 1]] for k in range(1, polygons.shape[1] - 1)], axis=1
        )
        # Shorter polygons repeat their last vertex.
        there = self._problem.take_of[self._problem.face_owner] == take
        face, k = np.nonzero((fans[:, :, 1] != fans[:, :, 2]).any(axis=-1) & there[:, None])
        return Surface(fans[face, k]), face

    def _only(self, t: int, actor: int) -> tuple[Surface, IntArray]:
        """Returns one actor alone, and the face of each of its triangles."""
        actors, triangle_faces = self._bodies(t, int(self._problem.take_of[actor]))
        its_triangles = np.flatnonzero(self._problem.face_owner[triangle_faces] == actor)
        return Surface(actors.triangles[its_triangles]), triangle_faces[its_triangles]

    def _eye(self, robot: Robot, state: State) -> FloatArray:
        """Returns the position of a robot's camera [3] in a state, in m from the origin."""
        x, y, terrain = state.x, state.y, self._problem.height_map
        altitude = terrain.altitude(x, y, robot.motion.layers[state.layer])
        place: FloatArray = np.array([*terrain.centre(x, y), altitude]) - self._geometry.origin
        return place

    def _boxes(
        self, t: int, robot: Robot, state: State
    ) -> Iterator[tuple[int, tuple[int, int, int, int]]]:
        """Yields actors, each with the box (left, top, right, bottom) in px that may contain it."""
        camera, axes = self.camera_of(robot), _axes(robot, state)
        polygons = self._geometry.at(t).polygons[0]
        for actor in range(len(self._problem.actors)):
            corners = polygons[self._problem.face_owner == actor].reshape(-1, 3)
            right, up, depth = axes @ (corners - self._eye(robot, state)).T
            wide, high = (size / 2 / camera.focal * depth for size in (camera.width, camera.height))
            sides = np.stack([wide - right, wide + right, high - up, high + up])
            if (sides < 0).all(axis=1).any():  # completely outside one side of the image
                continue
            whole = (0, 0, camera.width, camera.height)
            if depth.min() <= 0:  # partly behind the camera: may appear anywhere
                yield actor, whole
                continue
            u = camera.width / 2 + camera.focal * right / depth
            v = camera.height / 2 - camera.focal * up / depth
            first = np.floor(np.maximum([u.min() - _BORDER, v.min() - _BORDER], 0.0))
            last = np.ceil(np.minimum([u.max() + _BORDER, v.max() + _BORDER], whole[2:]))
            left, top, end, bottom = (int(x) for x in (*first, *last))
            if left < end and top < bottom:
                yield actor, (left, top, end, bottom)

    def _cast(
        self,
        robot: Robot,
        state: State,
        box: tuple[int, int, int, int],
        surfaces: Sequence[Surface],
    ) -> Iterator[tuple[IntArray, FloatArray, IntArray, IntArray]]:
        """Yields the rays of a box of pixels, many at a time.

        Each ray comes with its pixel, its direction [n, 3], and the surface and triangle that it
        meets first.
        """
        camera, step, axes = self.camera_of(robot), self._step, _axes(robot, state)
        columns = np.arange(box[0] // step, -(-box[2] // step))
        width = -(-camera.width // step)
        rows_at_once = max(RAYS // max(len(columns), 1), 1)
        for first in range(box[1] // step, -(-box[3] // step), rows_at_once):
            rows = np.arange(first, min(first + rows_at_once, -(-box[3] // step)))
            row, column = (part.ravel() for part in np.meshgrid(rows, columns, indexing="ij"))
            local = np.column_stack(
                [
                    (column + 0.5) * step - camera.width / 2,
                    camera.height / 2 - (row + 0.5) * step,
                    np.full(len(row), camera.focal),
                ]
            )
            ways = local @ axes
            ways /= np.linalg.norm(ways, axis=1)[:, None]
            eyes = np.tile(self._eye(robot, state), (len(ways), 1))
            yield (row * width + column, ways, *_nearest(surfaces, eyes, ways))


def _axes(robot: Robot, state: State) -> FloatArray:
    """Returns the right, up and forward unit vectors of the camera [3, 3]."""
    yaw = 2 * math.pi * state.heading / robot.motion.headings
    tilt = robot.camera.tilts[state.pitch]
    flat = np.array([math.cos(yaw), math.sin(yaw), 0.0])
    right, above = np.array([math.sin(yaw), -math.cos(yaw), 0.0]), np.array([0.0, 0.0, 1.0])
    forward = math.cos(tilt) * flat - math.sin(tilt) * above
    return np.stack([right, np.cross(right, forward), forward])


def _nearest(
    surfaces: Sequence[Surface], eyes: FloatArray, ways: FloatArray
) -> tuple[IntArray, IntArray]:
    """Returns, for each ray [n], the number of the surface that it meets first, and the triangle.

    Both are -1 if it meets none.
    """
    distance = np.full(len(ways), np.inf)
    met, triangle_met = np.full(len(ways), -1), np.full(len(ways), -1)
    for k, surface in enumerate(surfaces):
        far, triangle = surface.first_hit(eyes, ways)
        nearer = far < distance
        distance[nearer] = far[nearer]
        met[nearer], triangle_met[nearer] = k, triangle[nearer]
    return met, triangle_met


def _normals(triangles: FloatArray) -> FloatArray:
    """Returns the unit normals [n, 3] of triangles [n, 3, 3]."""
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    result: FloatArray = normals / np.linalg.norm(normals, axis=1)[:, None]
    return result
