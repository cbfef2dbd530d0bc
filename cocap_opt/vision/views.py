"""Views of single states: the coverage of every face, evaluated on demand.

The value of a view depends on the kind of camera; `Views.of` returns the views of a camera.
"""

import math
from abc import ABC, abstractmethod
from typing import NamedTuple

import numpy as np

from cocap_opt.data import BoolArray, FloatArray, IntArray
from cocap_opt.graph.timegraph import TimeGraph
from cocap_opt.problem import AnyCamera, Camera, Cone, Problem
from cocap_opt.vision.faces import FaceGeometry
from cocap_opt.vision.projection import Projection, dot
from cocap_opt.vision.spans import spans
from cocap_opt.vision.visibility import Sightings, Visibility

# Most states at once, and states times actors, so that limits are checked every 0.3 s or so.
_BATCH, _BATCH_ACTORS = 8_192, 65_000
_BATCH_RAYS = 400_000  # states times faces times the squared samples of a triangle
_ON_THE_EDGE = 1e-9  # rad, by which an actor may be beyond the edge of a cone


class _Seen(NamedTuple):
    """The faces that some states see; the others see nothing."""

    rows: IntArray  # [n] position of the state, increasing
    faces: IntArray  # [n] increasing for each state
    pixels: FloatArray  # [n] px/m2, > 0


class Views(ABC):
    """A source of coverage of single states, which several threads may use.

    Attributes
    ----------
    n_states, n_faces : S and F
    """

    def __init__(self, n_states: int, n_faces: int) -> None:
        self.n_states, self.n_faces = n_states, n_faces

    @staticmethod
    def of(
        geometry: FaceGeometry, problem: Problem, graph: TimeGraph, camera: AnyCamera
    ) -> "Views":
        """Returns the views of a camera."""
        if isinstance(camera, Cone):
            return _ConeViews(geometry, problem, graph, camera)
        return _PinholeViews(geometry, problem, graph, camera)

    @property
    @abstractmethod
    def batch(self) -> int:
        """Number of nodes that a fraction of a second suffices for."""

    @abstractmethod
    def seen(self, nodes: IntArray) -> _Seen:
        """Returns what nodes [n] see, increasing; node t S + s is state s at step t."""

    def coverage(self, t: int, states: IntArray) -> FloatArray:
        """Returns the coverage [n, F] in px/m2 of every face from the states [n] at step t."""
        return self._dense(t * self.n_states + states)

    def along(self, first_step: int, states: IntArray) -> FloatArray:
        """Returns the coverage [n, F] of states [n], one at each step from `first_step` on."""
        return self._dense((first_step + np.arange(len(states))) * self.n_states + states)

    def _dense(self, nodes: IntArray) -> FloatArray:
        coverage, seen = np.zeros((len(nodes), self.n_faces)), self.seen(nodes)
        coverage[seen.rows, seen.faces] = seen.pixels
        return coverage


class _PinholeViews(Views):
    """Coverage by a pinhole camera.

        coverage = area of the image of what is visible of the face, in px / area of the face

    What is visible depends on the camera's place only, not on its orientation (`visibility`): the
    whole face, nothing, or some convex pieces of it.
    """

    def __init__(self, geometry: FaceGeometry, problem: Problem, graph: TimeGraph, camera: Camera):
        super().__init__(graph.n_states, len(problem.face_weights))
        self._geometry = geometry
        self._map = problem.height_map
        self._graph = graph
        self._camera = camera
        self._projection = Projection(camera)
        self._image = float(camera.width * camera.height)  # px
        self._axes = self._projection.axes(graph.motion.headings)
        self._owners = problem.face_owner
        self._samples = problem.face_samples
        self._visibility = Visibility(geometry, problem)

    @property
    def batch(self) -> int:
        """Number of nodes that a fraction of a second suffices for."""
        actors = int(self._owners[-1]) + 1 if len(self._owners) else 1
        most = min(_BATCH, _BATCH_ACTORS // actors)
        if self._geometry.mesh is not None:
            most = min(most, _BATCH_RAYS // max(self.n_faces * self._samples**2, 1))
        return max(most, 1)

    def seen(self, nodes: IntArray) -> _Seen:
        """Returns what nodes [n] see; node t S + s is state s at step t."""
        if not self.n_faces or not len(nodes):
            return _NOTHING
        t, state = np.divmod(nodes, self._graph.n_states)
        orientation, place = np.divmod(state, self._graph.n_places)
        viewpoints, which = np.unique(t * self._graph.n_places + place, return_inverse=True)
        t, place = np.divmod(viewpoints, self._graph.n_places)
        faces = self._geometry.between(int(t[0]), int(t[-1]))
        steps = t - faces.first
        eyes = self._graph.positions(self._map, place) - self._geometry.origin
        in_view = self._in_view(
            faces.middles[steps[which]] - eyes[which, None], faces.reaches, orientation
        )
        wanted = np.zeros((len(eyes), in_view.shape[1]), dtype=bool)
        state, actor = np.nonzero(in_view)
        wanted[which[state], actor] = True
        sight = self._visibility.of(faces, steps, eyes, wanted)
        # Only faces that are turned to the camera are seen.
        row, face = np.nonzero(sight.whole[which] & in_view[:, self._owners])
        eye = which[row]
        polygons = faces.polygons[steps[eye], face] - eyes[eye, None]
        area = self._areas(polygons, orientation[row])
        parts = [(row, face, area)]
        if len(sight.eyes):
            parts.append(self._in_pieces(sight, which, orientation, in_view))
        row, face, area = (np.concatenate(columns) for columns in zip(*parts, strict=True))
        kept = np.flatnonzero(area > 0)
        kept = kept[np.argsort(row[kept] * self.n_faces + face[kept])]
        face = face[kept]
        return _Seen(row[kept], face, area[kept] / faces.areas[face])

    def _in_pieces(
        self, sight: Sightings, which: IntArray, orientation: IntArray, in_view: BoolArray
    ) -> tuple[IntArray, IntArray, FloatArray]:
        """Returns states, faces and areas (px) of the images of all faces seen in part."""
        # Sightings are in the order of their eyes: those of one eye are one span.
        first = np.searchsorted(sight.eyes, np.arange(len(sight.whole)))
        counts = np.bincount(sight.eyes, minlength=len(first))
        row = np.repeat(np.arange(len(which)), counts[which])
        at = spans(first[which], counts[which])
        ours = in_view[row, self._owners[sight.faces[at]]]
        row, at = row[ours], at[ours]
        entry = np.repeat(np.arange(len(at)), sight.counts[at])
        piece = spans(sight.first[at], sight.counts[at])
        looks = orientation[row[entry]]
        areas = self._areas(sight.pieces[piece], looks)
        if sight.veil is not None:
            axes = self._axes[looks]
            areas = areas * sight.veil.share_of_images(piece, areas > 0, self._projection, axes)
        area = np.bincount(entry, weights=areas, minlength=len(at))
        return row, sight.faces[at], np.minimum(area, self._image)

    def _areas(self, polygons: FloatArray, orientation: IntArray) -> FloatArray:
        """Returns the areas [n] in px of the images of polygons [n, V, 3], relative to the eye."""
        # The area of a face that nearly touches the camera may be rounded beyond the image, or nan.
        with np.errstate(over="ignore", invalid="ignore"):
            area = self._projection.area(self._in_camera(polygons, orientation))
            result: FloatArray = np.minimum(area, self._image)
        return result

    def _in_camera(self, points: FloatArray, orientation: IntArray) -> FloatArray:
        """Returns points [n, k, 3], relative to cameras, right, up and forward of them."""
        axes = self._axes[orientation][:, None]
        return np.stack([dot(points, axes[:, :, k]) for k in range(3)], axis=-1)

    def _in_view(
        self, middles: FloatArray, reaches: FloatArray, orientation: IntArray
    ) -> BoolArray:
        """Returns an array [n, A], true if spheres may be in the image of each camera.

        Parameters
        ----------
        middles : [n, A, 3] m, relative to the cameras
        reaches : [A] m
        """
        u, v, depth = np.moveaxis(self._in_camera(middles, orientation), -1, 0)
        in_view = np.ones(u.shape, dtype=bool)
        for size, off in ((self._camera.width, u), (self._camera.height, v)):
            slope = size / 2 / self._camera.focal
            in_view &= slope * depth - np.abs(off) >= -reaches * math.hypot(1.0, slope)
        return in_view


_NOTHING = _Seen(np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64), np.zeros(0))


class _ConeViews(Views):
    """Coverage by a `Cone`, of all faces of the actors that it detects."""

    def __init__(self, geometry: FaceGeometry, problem: Problem, graph: TimeGraph, cone: Cone):
        super().__init__(graph.n_states, len(problem.face_owner))
        self._geometry = geometry
        self._problem = problem
        self._graph = graph
        self._cone = cone

    def coverage(self, t: int, states: IntArray) -> FloatArray:
        """Returns the coverage [n, F] in 1/m2 of every face from the states [n] at step t."""
        faces, owners = self._geometry.at(t), self._problem.face_owner
        origin = self._geometry.origin
        if not len(owners):
            return np.zeros((len(states), 0))
        orientation, place = np.divmod(states, self._graph.n_places)
        eyes = self._graph.positions(self._problem.height_map, place) - origin
        yaw = 2 * np.pi * orientation / self._graph.motion.headings
        feet = np.array([actor.poses[t, :3] for actor in self._problem.actors]) - origin
        ways = feet[None] - eyes[:, None]  # [n, A, 3]
        off = np.arctan2(ways[..., 1], ways[..., 0]) - yaw[:, None]
        off = np.abs((off + np.pi) % (2 * np.pi) - np.pi)
        detected = off <= self._cone.opening / 2 + _ON_THE_EDGE
        # All faces count as if they were on the ground.
        d = np.empty((len(states), len(owners), 3))
        d[..., :2] = faces.centres[:, :, :2] - eyes[:, None, :2]
        d[..., 2] = feet[owners, 2] - eyes[:, None, 2]
        ahead = np.abs(d[..., 0] * np.cos(yaw)[:, None] + d[..., 1] * np.sin(yaw)[:, None])
        square = dot(d, d)
        turned = np.maximum(-dot(d, faces.normals), 0.0)
        result: FloatArray = detected[:, owners] * ahead * turned / square**2
        return result

    @property
    def batch(self) -> int:
        """Number of nodes that a fraction of a second suffices for."""
        return max(_BATCH_ACTORS // max(self.n_faces, 1), 1)

    def seen(self, nodes: IntArray) -> _Seen:
        """Returns what nodes [n] see, increasing; node t S + s is state s at step t."""
        t, states = np.divmod(nodes, self._graph.n_states)
        parts = [self.coverage(int(step), states[t == step]) for step in np.unique(t)]
        coverage = np.concatenate([np.zeros((0, self.n_faces)), *parts])
        rows, faces = np.nonzero(coverage)
        return _Seen(rows, faces, coverage[rows, faces])
