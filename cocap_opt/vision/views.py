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
from cocap_opt.vision.sights import ON_THE_EDGE, ConeSight, PinholeSight, Seen
from cocap_opt.vision.unhidden import Unhidden

# Most states at once, and states times actors, so that limits are checked every 0.3 s or so.
_BATCH, _BATCH_ACTORS = 8_192, 65_000
_BATCH_RAYS = 400_000  # states times faces times the squared samples of a triangle
_CEILING = 200_000  # orientations times places times actors at once, for the processor's cache
_SLACK = 1e-7  # m, much more than the rounding of coordinates


class _Ceiling(NamedTuple):
    """An upper bound on what the states at some places see at one step, if nothing hides anybody.

    The sums are over all faces, each with a weight w of its own.
    """

    roots: FloatArray  # [O, n] of w sqrt(px/m2), by orientation and place
    pixels: FloatArray  # [O, n] of w px/m2
    visible: BoolArray  # [F] true where one of the states may see the face

    @classmethod
    def joined(cls, parts: "list[_Ceiling]") -> "_Ceiling":
        """Returns the ceiling of all places from those of some each."""
        if len(parts) == 1:
            return parts[0]
        return cls(
            np.concatenate([part.roots for part in parts], axis=1),
            np.concatenate([part.pixels for part in parts], axis=1),
            np.any([part.visible for part in parts], axis=0),
        )

    @classmethod
    def nothing(cls, n_orientations: int, n_places: int, n_faces: int) -> "_Ceiling":
        """Returns the ceiling of places from which nothing is seen."""
        none = np.zeros((n_orientations, n_places))
        return cls(none, none, np.zeros(n_faces, dtype=bool))


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
        """Number of nodes, states at steps, that take a fraction of a second."""

    @abstractmethod
    def seen(self, nodes: IntArray, steps: tuple[int, int] | None = None) -> Seen:
        """Returns what nodes [n] see, increasing; node t S + s is state s at step t.

        Parameters
        ----------
        steps : the first and last of those that nodes are asked for in parts, so that what all
            parts need is made once; if not given, the nodes are all
        """

    @abstractmethod
    def ceiling(self, t: int, places: IntArray, weights: FloatArray) -> _Ceiling:
        """Returns an upper bound on what all states at places [n] see at step t.

        It costs much less than coverage, since nothing is clipped.

        Parameters
        ----------
        weights : [F] of the faces
        """

    @abstractmethod
    def unhidden(self, t: int, reachable: BoolArray) -> Unhidden:
        """Returns what the reachable states [S] would see at step t if hardly anything hid anybody.

        It is an upper bound on the coverage of each face.
        """

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
    """Coverage of states by a pinhole camera, see `PinholeSight`."""

    def __init__(self, geometry: FaceGeometry, problem: Problem, graph: TimeGraph, camera: Camera):
        super().__init__(graph.n_states, len(problem.face_weights))
        self._geometry = geometry
        self._map = problem.height_map
        self._graph = graph
        self._camera = camera
        self._image = float(camera.width * camera.height)  # px
        self._slopes = camera.width / 2 / camera.focal, camera.height / 2 / camera.focal
        self._cosine_at_corner = 1 / math.hypot(1.0, *self._slopes)
        self._axes = Projection(camera).axes(graph.motion.headings)
        self._owners = problem.face_owner
        self._first_faces = np.searchsorted(self._owners, np.arange(len(problem.actors)))
        self._samples = problem.face_samples
        self._pinhole = PinholeSight(geometry, problem, camera, self._axes)

    @property
    def batch(self) -> int:
        """Number of nodes, states at steps, that take a fraction of a second."""
        actors = int(self._owners[-1]) + 1 if len(self._owners) else 1
        most = min(_BATCH, _BATCH_ACTORS // actors)
        if self._geometry.mesh is not None:
            most = min(most, _BATCH_RAYS // max(self.n_faces * self._samples**2, 1))
        return max(most, 1)

    def seen(self, nodes: IntArray, steps: tuple[int, int] | None = None) -> Seen:
        """Returns what nodes [n] see; node t S + s is state s at step t."""
        if not self.n_faces or not len(nodes):
            return _NOTHING
        t, state = np.divmod(nodes, self._graph.n_states)
        orientation, place = np.divmod(state, self._graph.n_places)
        viewpoints, which = np.unique(t * self._graph.n_places + place, return_inverse=True)
        t, place = np.divmod(viewpoints, self._graph.n_places)
        eyes = self._graph.positions(self._map, place) - self._geometry.origin
        return self._pinhole.seen(t, eyes, which, orientation, steps)

    def ceiling(self, t: int, places: IntArray, weights: FloatArray) -> _Ceiling:
        """Returns an upper bound on what all states at places [n] see at step t.

        The image of a face of area A, whose plane the eye is h before, has

            (1 / A) integral over the face of focal^2 h / depth^3 <= focal^2 h / (least depth)^3

        pixels per square metre. What of an actor is in the image is no nearer than the middle of
        its sphere less its reach, in depth and, by the angle of the image's corners, in distance.
        """
        if not self.n_faces or not len(places):
            return _Ceiling.nothing(len(self._axes), len(places), self.n_faces)
        planes, slopes = self._geometry.planes(t), self._slopes
        right, up, forward = np.moveaxis(self._axes, 1, 0)  # [O, 3] each
        # What an upright cylinder reaches towards the camera, beyond its middle [O, 1, A] m.
        level, steep = np.hypot(forward[:, 0], forward[:, 1]), np.abs(forward[:, 2])
        reach = np.outer(level, planes.radii) + np.outer(steep, planes.halves) + _SLACK
        margins = [(planes.reaches + _SLACK) * math.hypot(1.0, slope) for slope in slopes]
        most = self._by_actor(self._image / planes.areas * weights)
        of_actors = self._by_actor(weights)
        parts = []
        for some in _chunks(places, len(self._axes) * len(planes.reaches)):
            eyes = self._graph.positions(self._map, some) - self._geometry.origin
            ahead = eyes @ planes.normals.T - dot(planes.normals, planes.centres)  # m, [n, F]
            turned = ahead > -_SLACK
            ahead = np.maximum(ahead + _SLACK, 0)
            u, v, depth = (
                (axis @ planes.middles.T)[:, None] - (axis @ eyes.T)[..., None]  # [O, n, A] m
                for axis in (right, up, forward)
            )
            in_view = slopes[0] * depth - np.abs(u) >= -margins[0]
            in_view &= slopes[1] * depth - np.abs(v) >= -margins[1]
            orientation, place, actor = np.nonzero(in_view)
            ways = planes.middles - eyes[:, None]
            nearest = (np.sqrt(dot(ways, ways)) - planes.reaches) * self._cosine_at_corner
            nearest = np.maximum(depth[in_view] - reach[orientation, actor], nearest[place, actor])
            inverse = self._camera.focal**2 / np.maximum(nearest, _SLACK) ** 3
            pixels = np.minimum(
                inverse * self._by_actor(ahead * weights)[place, actor], most[actor]
            )
            # By the inequality of Cauchy and Schwarz, of the faces of an actor.
            roots = np.sqrt(pixels * of_actors[actor])
            at, size = orientation * len(some) + place, (len(self._axes), len(some))
            visible = in_view.any(axis=0)[:, self._owners] & turned
            parts.append(_Ceiling(
                np.bincount(at, roots, math.prod(size)).reshape(size).astype(np.float64),
                np.bincount(at, pixels, math.prod(size)).reshape(size).astype(np.float64),
                visible.any(axis=0),
            ))  # fmt: skip
        return _Ceiling.joined(parts)

    def unhidden(self, t: int, reachable: BoolArray) -> Unhidden:
        """Returns what reachable states [S] would see at step t past all but single columns."""
        wanted = reachable.reshape(len(self._axes), -1)
        places = np.flatnonzero(wanted.any(axis=0))
        if not self.n_faces or not len(places):
            return Unhidden.nothing()
        eyes, planes = (
            self._graph.positions(self._map, places) - self._geometry.origin,
            self._geometry.planes(t),
        )
        hidden = self._geometry.screens.hide(
            planes.middles[:, :2], planes.radii, planes.middles[:, 2] + planes.halves, eyes
        )
        found = Unhidden.of(
            self._camera, self._axes, planes, self._owners, eyes, wanted[:, places], hidden
        )
        states = np.arange(len(self._axes))[:, None] * self._graph.n_places + places
        return found._replace(states=states.take(found.states))

    def _by_actor(self, values: FloatArray) -> FloatArray:
        """Returns the sums [.., A] of values [.., F] over each actor's faces."""
        sums: FloatArray = np.add.reduceat(values, self._first_faces, axis=-1)
        return sums


_NOTHING = Seen(np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64), np.zeros(0))


class _ConeViews(Views):
    """Coverage by a `Cone`, of all faces of the actors that it detects."""

    def __init__(self, geometry: FaceGeometry, problem: Problem, graph: TimeGraph, cone: Cone):
        super().__init__(graph.n_states, len(problem.face_owner))
        self._geometry = geometry
        self._problem = problem
        self._graph = graph
        self._sight = ConeSight(geometry, problem, cone)

    def coverage(self, t: int, states: IntArray) -> FloatArray:
        """Returns the coverage [n, F] in 1/m2 of every face from the states [n] at step t."""
        owners = self._problem.face_owner
        if not len(owners):
            return np.zeros((len(states), 0))
        orientation, place = np.divmod(states, self._graph.n_places)
        yaw = 2 * np.pi * orientation / self._graph.motion.headings
        return self._sight.coverage(t, self._eyes(place), yaw)

    def ceiling(self, t: int, places: IntArray, weights: FloatArray) -> _Ceiling:
        """Returns an upper bound on what all states at places [n] see at step t.

        All of the level way to a face counts as ahead.
        """
        headings, owners = self._graph.motion.headings, self._problem.face_owner
        if not len(owners) or not len(places):
            return _Ceiling.nothing(headings, len(places), self.n_faces)
        first = np.searchsorted(owners, np.arange(len(self._problem.actors)))
        parts = []
        for some in _chunks(places, headings * len(first)):
            eyes = self._eyes(some)
            yaw = 2 * np.pi * np.arange(headings)[:, None] / headings
            detected = np.stack(  # [O, n, A]
                [self._sight.detected(t, eyes, one, 2 * ON_THE_EDGE) for one in yaw]
            )
            seen = self._sight.ceiling(t, eyes)
            roots, pixels = (
                (detected * np.add.reduceat(values, first, axis=1)).sum(axis=-1)
                for values in (np.sqrt(seen) * weights, seen * weights)
            )
            noticed = np.asarray(detected.any(axis=0))
            visible = np.any(noticed[:, owners] & (seen > 0), axis=0)
            parts.append(_Ceiling(roots, pixels, visible))
        return _Ceiling.joined(parts)

    def _eyes(self, places: IntArray) -> FloatArray:
        """Returns the positions [n, 3] m of places."""
        eyes = self._graph.positions(self._problem.height_map, places)
        return np.asarray(eyes - self._geometry.origin)

    def unhidden(self, t: int, reachable: BoolArray) -> Unhidden:
        """Returns what the reachable states [S] see at step t: this camera sees past obstacles."""
        states = np.flatnonzero(reachable)
        seen = self.seen(t * self.n_states + states)
        return Unhidden(states[seen.rows], seen.faces, seen.pixels)

    @property
    def batch(self) -> int:
        """Number of nodes, states at steps, that take a fraction of a second."""
        return max(_BATCH_ACTORS // max(self.n_faces, 1), 1)

    def seen(self, nodes: IntArray, steps: tuple[int, int] | None = None) -> Seen:
        """Returns what nodes [n] see, increasing; node t S + s is state s at step t."""
        t, states = np.divmod(nodes, self._graph.n_states)
        parts = [self.coverage(int(step), states[t == step]) for step in np.unique(t)]
        coverage = np.concatenate([np.zeros((0, self.n_faces)), *parts])
        rows, faces = np.nonzero(coverage)
        return Seen(rows, faces, coverage[rows, faces])


def _chunks(places: IntArray, size: int) -> list[IntArray]:
    """Returns places [n] in parts that are small enough.

    Parameters
    ----------
    size : orientations times actors
    """
    return np.array_split(places, -(-len(places) * size // _CEILING))
