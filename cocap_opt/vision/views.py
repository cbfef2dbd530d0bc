"""Views of single states: the coverage of every face, evaluated on demand.

The value of a view depends on the kind of camera; `make_views` returns the views of a camera.
"""

import math
from typing import Protocol

import numpy as np

from cocap_opt.data import BoolArray, FloatArray, IntArray
from cocap_opt.graph.timegraph import TimeGraph
from cocap_opt.problem import AnyCamera, Camera, Cone, Problem
from cocap_opt.vision.faces import FaceGeometry, Faces
from cocap_opt.vision.projection import Projection, dot
from cocap_opt.vision.visibility import Occluders, Samples, rays_arrive, spans

# Most states and rays at once, so that limits are checked every 0.3 s or more often.
_BATCH_STATES = 1024
_BATCH_RAYS = 1_600_000  # if all faces of all states were in view
_UNSURE = 0.5  # neither hidden nor in the open
_ON_THE_EDGE = 1e-9  # rad, by which an actor may be beyond the edge of a cone


class Views(Protocol):
    """A source of coverage of single states, which several threads may use."""

    def coverage(self, t: int, states: IntArray) -> FloatArray:
        """Returns the coverage [n, F] in px/m2 of every face from the states [n] at step t."""

    def batch(self, t: int) -> int:
        """Returns the number of states that a fraction of a second suffices for at step t."""


def make_views(
    geometry: FaceGeometry, problem: Problem, graph: TimeGraph, camera: AnyCamera
) -> Views:
    """Returns the views of a camera."""
    if isinstance(camera, Cone):
        return _ConeViews(geometry, problem, graph, camera)
    return _PinholeViews(geometry, problem, graph, camera)


class _PinholeViews:
    """Coverage by a pinhole camera.

        coverage = projected area, clipped to the image / area of the face x visible share

    The visible share depends on the camera's place only, not on its orientation. A few points of
    the whole actor tell first if all or nothing of it is visible (`faces.Bodies`). If they
    differ, points spread over the face are used, or, if the image cuts the face, points spread
    over its image.
    """

    def __init__(self, geometry: FaceGeometry, problem: Problem, graph: TimeGraph, camera: Camera):
        self._geometry = geometry
        self._map = problem.height_map
        self._graph = graph
        self._camera = camera
        self._projection = Projection(camera)
        self._image = float(camera.width * camera.height)  # px
        self._axes = self._projection.axes(graph.motion.headings)
        self._n_faces = len(problem.face_weights)
        self._owners = problem.face_owner
        self._samples = problem.face_samples

    def coverage(self, t: int, states: IntArray) -> FloatArray:
        """Returns the coverage [n, F] in px/m2 of every face from the states [n] at step t."""
        result = np.zeros((len(states), self._n_faces))
        if not self._n_faces:
            return result
        faces = self._geometry.at(t)
        orientation, place = np.divmod(states, self._graph.n_places)
        places, which = np.unique(place, return_inverse=True)
        eyes = self._graph.positions(self._map, places)
        in_view = self._in_view(faces, eyes[which], orientation)
        open_to = self._share_of_actors(faces, eyes, which, in_view)
        in_view &= open_to[which] > 0
        if not in_view.any():
            return result
        # Only faces that are turned to the camera are seen.
        ahead = dot(eyes[:, None, :] - faces.polygons[None, :, 0], faces.normals[None]) > 0
        state, face = np.nonzero(ahead[which] & in_view[:, self._owners])
        relative = faces.polygons[face] - eyes[which[state]][:, None, :]
        in_camera = np.stack(self._in_camera(relative, orientation[state]), axis=-1)
        # The area of a face that nearly touches the camera may be rounded beyond the image, or nan.
        with np.errstate(over="ignore", invalid="ignore"):
            area = np.minimum(self._projection.area(in_camera), self._image)
        seen = np.flatnonzero(area > 0)
        state, face, area, in_camera = state[seen], face[seen], area[seen], in_camera[seen]
        eye, share = which[state], np.ones(len(seen))
        unsure = np.flatnonzero(open_to[eye, self._owners[face]] < 1)
        if len(unsure):
            looks = orientation[state[unsure]]
            share[unsure] = self._share_of_faces(
                faces, in_camera[unsure], eyes, eye[unsure], looks, face[unsure]
            )
        result[state, face] = area * share / faces.areas[face]
        return result

    def _in_view(self, faces: Faces, eyes: FloatArray, orientation: IntArray) -> BoolArray:
        """Returns an array [n, A], true if an actor may be in the image of a camera at an eye."""
        bodies = faces.bodies
        u, v, depth = self._in_camera(bodies.centres - eyes[:, None], orientation)
        in_view = np.ones(u.shape, dtype=bool)
        for size, off in ((self._camera.width, u), (self._camera.height, v)):
            slope = size / 2 / self._camera.focal
            in_view &= slope * depth - np.abs(off) >= -bodies.reaches * math.hypot(1.0, slope)
        return in_view

    def _share_of_actors(
        self, faces: Faces, eyes: FloatArray, which: IntArray, in_view: BoolArray
    ) -> FloatArray:
        """Returns an array [m, A]: 0 if an actor is hidden from an eye [m, 3], 1 if in the open.

        Between 0 and 1 neither is certain. Only terrain and meshes hide an actor for certain,
        since between other actors gaps are many.

        Parameters
        ----------
        eyes : [m, 3] m, places of cameras
        which : [n] number of each state's eye
        in_view : [n, A] of each state
        """
        bodies, share = faces.bodies, np.zeros((len(eyes), in_view.shape[1]))
        state, actor = np.nonzero(in_view)
        share[which[state], actor] = 1.0
        eye, target = np.nonzero(share)
        past_terrain = self._share_past(faces.terrain, bodies.samples, eyes[eye], target)
        clear = np.flatnonzero(past_terrain == 1)
        past_actors = self._share_past(
            faces.actors, bodies.samples, eyes[eye[clear]], target[clear]
        )  # fmt: skip
        past_terrain[clear] = np.maximum(past_actors, _UNSURE)
        share[eye, target] = past_terrain
        return share

    def _share_past(
        self, occluder: Occluders, samples: Samples, eyes: FloatArray, actors: IntArray
    ) -> FloatArray:
        """Returns the share [n] of actors' points that are seen past occluders from eyes [n, 3]."""
        seen = samples.seen([occluder], eyes, actors, np.arange(len(samples.counts)))
        return samples.seen_share(actors, seen)

    def _in_camera(self, points: FloatArray, orientation: IntArray) -> list[FloatArray]:
        """Returns the coordinates [n, k] right, up and forward of points [n, k, 3] from cameras."""
        axes = self._axes[orientation][:, None]
        return [dot(points, axes[:, :, k]) for k in range(3)]

    def _share_of_faces(
        self,
        faces: Faces,
        polygons: FloatArray,
        eyes: FloatArray,
        eye: IntArray,
        orientation: IntArray,
        face: IntArray,
    ) -> FloatArray:
        """Returns the visible shares [n] of the images of faces.

        Parameters
        ----------
        polygons : [n, V, 3] m, the faces in camera coordinates
        eyes : [m, 3] m, places of cameras
        eye, orientation, face : [n] number of each view's eye, orientation and face
        """
        # Views from one place share their rays.
        pair, which = np.unique(eye * self._n_faces + face, return_inverse=True)
        one, target = np.divmod(pair, self._n_faces)
        seen = faces.samples.seen(faces.occluders, eyes[one], target, self._owners)
        share = faces.samples.seen_share(target, seen)[which]
        inside = (self._projection.frustum_distances(polygons) >= 0).all(axis=(1, 2))
        axes = self._axes[orientation]
        some = np.flatnonzero((share > 0) & (share < 1) & inside)
        if len(some):
            at, point = faces.samples.of(face[some])
            ways = faces.samples.points[point] - eyes[eye[some]][at]
            # The image of a piece of a plane is proportional to the inverse cube of its depth.
            depth = dot(ways, axes[some][at, 2])
            weight = faces.samples.shares[point] / (depth * depth * depth)
            counts = faces.samples.counts[target]
            ray = spans((np.cumsum(counts) - counts)[which[some]], counts[which[some]])
            whole = np.bincount(at, weights=weight)
            share[some] = np.bincount(at, weights=weight * seen[ray]) / whole
        cut = np.flatnonzero((share < 1) & ~inside)
        if len(cut):
            share[cut] = self._share_in_image(
                faces, polygons[cut], eyes[eye[cut]], axes[cut], face[cut]
            )
        return share

    def _share_in_image(
        self, faces: Faces, polygons: FloatArray, eyes: FloatArray, axes: FloatArray, of: IntArray
    ) -> FloatArray:
        """Returns the visible shares [n] of the images of faces, by rays spread over the images.

        Parameters
        ----------
        polygons : [n, V, 3] m, the faces in camera coordinates
        eyes, axes : [n, 3] m and [n, 3, 3], of the camera
        of : [n] numbers of the faces
        """
        points, weights = self._projection.samples(polygons, self._samples)
        which, sample = np.nonzero(weights)
        local = points[which, sample]
        at = eyes[which]
        for k in range(3):
            at = at + local[:, k, None] * axes[which, k]
        seen = rays_arrive(faces.occluders, eyes[which], at, self._owners[of[which]])
        share = np.bincount(which, weights=weights[which, sample] * seen, minlength=len(of))
        return np.minimum(share, 1.0)

    def batch(self, t: int) -> int:
        """Returns the number of states that a fraction of a second suffices for at step t."""
        rays = int(self._geometry.at(t).samples.counts.sum())
        return min(max(_BATCH_RAYS // max(rays, 1), 1), _BATCH_STATES)


class _ConeViews:
    """Coverage by a `Cone`, of all faces of the actors that it detects."""

    def __init__(self, geometry: FaceGeometry, problem: Problem, graph: TimeGraph, cone: Cone):
        self._geometry = geometry
        self._problem = problem
        self._graph = graph
        self._cone = cone

    def coverage(self, t: int, states: IntArray) -> FloatArray:
        """Returns the coverage [n, F] in 1/m2 of every face from the states [n] at step t."""
        faces, owners = self._geometry.at(t), self._problem.face_owner
        if not len(owners):
            return np.zeros((len(states), 0))
        orientation, place = np.divmod(states, self._graph.n_places)
        eyes = self._graph.positions(self._problem.height_map, place)
        yaw = 2 * np.pi * orientation / self._graph.motion.headings
        feet = np.array([actor.poses[t, :3] for actor in self._problem.actors])
        ways = feet[None] - eyes[:, None]  # [n, A, 3]
        off = np.arctan2(ways[..., 1], ways[..., 0]) - yaw[:, None]
        off = np.abs((off + np.pi) % (2 * np.pi) - np.pi)
        detected = off <= self._cone.opening / 2 + _ON_THE_EDGE
        # All faces count as if they were on the ground.
        d = np.empty((len(states), len(owners), 3))
        d[..., :2] = faces.centres[None, :, :2] - eyes[:, None, :2]
        d[..., 2] = feet[owners, 2] - eyes[:, None, 2]
        ahead = np.abs(d[..., 0] * np.cos(yaw)[:, None] + d[..., 1] * np.sin(yaw)[:, None])
        square = dot(d, d)
        turned = np.maximum(-dot(d, faces.normals[None]), 0.0)
        result: FloatArray = detected[:, owners] * ahead * turned / square**2
        return result

    def batch(self, t: int) -> int:
        """Returns the number of states that a fraction of a second suffices for at step t."""
        return _BATCH_STATES
