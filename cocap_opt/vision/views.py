"""Views of single states: the coverage of every face, evaluated on demand.

The value of a view depends on the kind of camera; `Views.of` returns the views of a camera.
"""

from abc import ABC, abstractmethod

import numpy as np

from cocap_opt.data import FloatArray, IntArray
from cocap_opt.graph.timegraph import TimeGraph
from cocap_opt.problem import AnyCamera, Camera, Cone, Problem
from cocap_opt.vision.faces import FaceGeometry
from cocap_opt.vision.projection import Projection
from cocap_opt.vision.sights import ConeSight, PinholeSight, Seen

# Most states at once, and states times actors, so that limits are checked every 0.3 s or so.
_BATCH, _BATCH_ACTORS = 8_192, 65_000
_BATCH_RAYS = 400_000  # states times faces times the squared samples of a triangle
NOTHING = Seen(np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64), np.zeros(0))


class Views(ABC):
    """A source of coverage of single states, which several threads may use.

    Attributes
    ----------
    geometry, problem, graph : of the faces, the scene, and the states
    n_states, n_faces : S and F
    """

    def __init__(self, geometry: FaceGeometry, problem: Problem, graph: TimeGraph) -> None:
        self.geometry, self.problem, self.graph = geometry, problem, graph
        self.n_states, self.n_faces = graph.n_states, len(problem.face_owner)

    @staticmethod
    def of(
        geometry: FaceGeometry, problem: Problem, graph: TimeGraph, camera: AnyCamera
    ) -> "Views":
        """Returns the views of a camera."""
        if isinstance(camera, Cone):
            return ConeViews(geometry, problem, graph, camera)
        return PinholeViews(geometry, problem, graph, camera)

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

    def coverage(self, t: int, states: IntArray) -> FloatArray:
        """Returns the coverage [n, F] in px/m2 of every face from the states [n] at step t."""
        return self._dense(t * self.n_states + states)

    def along(self, first_step: int, states: IntArray) -> FloatArray:
        """Returns the coverage [n, F] of states [n], one at each step from `first_step` on."""
        return self._dense((first_step + np.arange(len(states))) * self.n_states + states)

    def eyes(self, places: IntArray) -> FloatArray:
        """Returns the positions [n, 3] m of places [n], from the geometry's origin."""
        eyes = self.graph.positions(self.problem.height_map, places)
        return np.asarray(eyes - self.geometry.origin)

    def _dense(self, nodes: IntArray) -> FloatArray:
        coverage, seen = np.zeros((len(nodes), self.n_faces)), self.seen(nodes)
        coverage[seen.rows, seen.faces] = seen.pixels
        return coverage


class PinholeViews(Views):
    """Coverage of states by a pinhole camera, see `PinholeSight`.

    Attributes
    ----------
    axes : [O, 3, 3] right, up and forward of each orientation
    """

    def __init__(self, geometry: FaceGeometry, problem: Problem, graph: TimeGraph, camera: Camera):
        super().__init__(geometry, problem, graph)
        self.camera, self.axes = camera, Projection(camera).axes(graph.motion.headings)
        self._pinhole = PinholeSight(geometry, problem, camera, self.axes)

    @property
    def batch(self) -> int:
        """Number of nodes, states at steps, that take a fraction of a second."""
        owners = self.problem.face_owner
        actors = int(owners[-1]) + 1 if len(owners) else 1
        most = min(_BATCH, _BATCH_ACTORS // actors)
        if self.geometry.mesh is not None:
            most = min(most, _BATCH_RAYS // max(self.n_faces * self.problem.face_samples**2, 1))
        return max(most, 1)

    def seen(self, nodes: IntArray, steps: tuple[int, int] | None = None) -> Seen:
        """Returns what nodes [n] see; node t S + s is state s at step t."""
        if not self.n_faces or not len(nodes):
            return NOTHING
        n_places = self.graph.n_places
        t, state = np.divmod(nodes, self.n_states)
        orientation, place = np.divmod(state, n_places)
        viewpoints, which = np.unique(t * n_places + place, return_inverse=True)
        t, place = np.divmod(viewpoints, n_places)
        return self._pinhole.seen(t, self.eyes(place), which, orientation, steps)


class ConeViews(Views):
    """Coverage by a `Cone`, of all faces of the actors that it detects."""

    def __init__(self, geometry: FaceGeometry, problem: Problem, graph: TimeGraph, cone: Cone):
        super().__init__(geometry, problem, graph)
        self.sight = ConeSight(geometry, problem, cone)

    def coverage(self, t: int, states: IntArray) -> FloatArray:
        """Returns the coverage [n, F] in 1/m2 of every face from the states [n] at step t."""
        if not self.n_faces:
            return np.zeros((len(states), 0))
        orientation, place = np.divmod(states, self.graph.n_places)
        yaw = 2 * np.pi * orientation / self.graph.motion.headings
        return self.sight.coverage(t, self.eyes(place), yaw)

    @property
    def batch(self) -> int:
        """Number of nodes, states at steps, that take a fraction of a second."""
        return max(_BATCH_ACTORS // max(self.n_faces, 1), 1)

    def seen(self, nodes: IntArray, steps: tuple[int, int] | None = None) -> Seen:
        """Returns what nodes [n] see, increasing; node t S + s is state s at step t."""
        t, states = np.divmod(nodes, self.n_states)
        parts = [self.coverage(int(step), states[t == step]) for step in np.unique(t)]
        coverage = np.concatenate([np.zeros((0, self.n_faces)), *parts])
        rows, faces = np.nonzero(coverage)
        return Seen(rows, faces, coverage[rows, faces])
