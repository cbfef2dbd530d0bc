"""Views: the coverage of every face from a camera, evaluated on demand.

A sight looks from any places and in any directions; views are those of a drone's states. The value
of a view depends on the kind of camera; `Views.of` returns the views of a camera.
"""

import math
from abc import ABC, abstractmethod
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from cocap_opt.arithmetic import spans
from cocap_opt.compiling import Kernel
from cocap_opt.data import BoolArray, FloatArray, IntArray
from cocap_opt.graph.timegraph import TimeGraph
from cocap_opt.problem import AnyCamera, Camera, Cone, Problem
from cocap_opt.vision.faces import FaceGeometry, Faces
from cocap_opt.vision.projection import Projection, dot
from cocap_opt.vision.viewpoints import Viewpoints
from cocap_opt.vision.visibility import Sightings, Visibility

if TYPE_CHECKING:
    from cocap_opt.vision.compiled_sight import CompiledSight

KERNEL = Kernel("cocap_opt.vision.compiled_sight", "what finds coverage", compiling=13.0)
_EACH = 5e-7  # s, of NumPy's way for a view of a person: measured
ON_THE_EDGE = 1e-9  # rad, by which an actor may be beyond the edge of a cone


class SeenFaces(NamedTuple):
    """The faces that some views see; the others see nothing."""

    rows: IntArray  # [n] number of the view, increasing
    faces: IntArray  # [n] increasing for each view
    pixels: FloatArray  # [n] px/m2, > 0


class PinholeSight:
    """Coverage by a pinhole camera from any places, which looks along any axes.

        coverage = area of the image of what is visible of the face, in px / area of the face

    What is visible depends on the camera's place only, not on its orientation (`visibility`): the
    whole face, nothing, or some convex pieces of it.

    Parameters
    ----------
    axes : [O, 3, 3] right, up and forward unit vectors of its orientations
    plain : without compiled code

    Attributes
    ----------
    may_be_compiled : the compiled kernel may find what is seen
    """

    def __init__(
        self,
        geometry: FaceGeometry,
        problem: Problem,
        camera: Camera,
        axes: FloatArray,
        plain: bool = False,
    ) -> None:
        self._geometry = geometry
        # Past meshes that are not convex only NumPy's way is there.
        self.may_be_compiled = not plain and geometry.mesh is None
        self._projection = Projection(camera)
        self._image = float(camera.width * camera.height)  # px
        self._slopes = camera.width / 2 / camera.focal, camera.height / 2 / camera.focal
        self._axes = axes
        self._owners, self._n_actors = problem.face_owner, len(problem.actors)
        self._visibility = Visibility(geometry, problem)

    @cached_property
    def _compiled(self) -> "CompiledSight":
        from cocap_opt.vision.compiled_sight import CompiledSight

        first = np.searchsorted(self._owners, np.arange(self._n_actors + 1))
        return CompiledSight(self._geometry.fixed, first, self._projection, self._axes)

    def seen(
        self,
        t: IntArray,
        eyes: FloatArray,
        which: IntArray,
        orientation: IntArray,
        steps: tuple[int, int] | None = None,
    ) -> SeenFaces:
        """Returns the faces that views [n] see, with their pixels.

        Parameters
        ----------
        t, eyes : steps [e], increasing, and places [e, 3] (m from the geometry's origin)
        which, orientation : [n] of each view, the number of its place and that of its axes
        steps : the first and last of those that views are asked for in parts, so that what all
            parts need is made once; if not given, the views are all
        """
        n_faces = len(self._owners)
        faces = self._geometry.between(*(steps or (int(t[0]), int(t[-1]))))
        if self.may_be_compiled:
            if KERNEL.is_loaded:
                found = self._compiled.seen(faces, t, eyes, which, orientation)
                if found is not None:
                    return SeenFaces(*found)
                if len(which) * self._n_actors > _BATCH_ACTORS and len(eyes) > 1:
                    return self._in_halves(t, eyes, which, orientation, faces)
            KERNEL.spend(_EACH * len(which) * self._n_actors)
        at = t - faces.first
        in_view = self._in_view(
            faces.middles[at[which]] - eyes[which, None], faces.reaches, orientation
        )
        wanted = np.zeros((len(eyes), in_view.shape[1]), dtype=bool)
        state, actor = np.nonzero(in_view)
        wanted[which[state], actor] = True
        sight = self._visibility.of(faces, at, eyes, wanted)
        # Only faces that are turned to the camera are seen.
        row, face = np.nonzero(sight.whole[which] & in_view[:, self._owners])
        eye = which[row]
        polygons = faces.polygons[at[eye], face] - eyes[eye, None]
        area = self._areas(polygons, orientation[row])
        parts = [(row, face, area)]
        if len(sight.eyes):
            parts.append(self._in_pieces(sight, which, orientation, in_view))
        row, face, area = (np.concatenate(columns) for columns in zip(*parts, strict=True))
        kept = np.flatnonzero(area > 0)
        kept = kept[np.argsort(row[kept] * n_faces + face[kept])]
        face = face[kept]
        return SeenFaces(row[kept], face, area[kept] / faces.areas[face])

    def _in_halves(
        self, t: IntArray, eyes: FloatArray, which: IntArray, orientation: IntArray, faces: Faces
    ) -> SeenFaces:
        """Does as `seen` does, for half of the places after the other half.

        The kernel had no room for one of the people; NumPy is to see to few places only.
        """
        steps, middle = (faces.first, faces.first + len(faces.polygons) - 1), len(eyes) // 2
        parts = []
        for half in (slice(0, middle), slice(middle, len(eyes))):
            ours = np.flatnonzero((which >= half.start) & (which < half.stop))
            seen = self.seen(
                t[half], eyes[half], which[ours] - half.start, orientation[ours], steps
            )
            parts.append((ours[seen.rows], seen.faces, seen.pixels))
        rows, found, pixels = (np.concatenate(columns) for columns in zip(*parts, strict=True))
        order = np.argsort(rows * len(self._owners) + found)
        return SeenFaces(rows[order], found[order], pixels[order])

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
        for slope, off in zip(self._slopes, (u, v), strict=True):
            in_view &= slope * depth - np.abs(off) >= -reaches * math.hypot(1.0, slope)
        return in_view


class ConeSight:
    """Coverage by a `Cone` from any places, of all faces of the actors that it detects."""

    def __init__(self, geometry: FaceGeometry, problem: Problem, cone: Cone) -> None:
        self._geometry = geometry
        self._problem = problem
        self._cone = cone

    def coverage(self, t: int, eyes: FloatArray, yaw: FloatArray) -> FloatArray:
        """Returns the coverage [n, F] in 1/m2 of every face at step t.

        Parameters
        ----------
        eyes, yaw : places [n, 3] (m from the geometry's origin) and directions [n] (rad)
        """
        ways, turned = self.ways(t, eyes)
        ahead = np.abs(ways[..., 0] * np.cos(yaw)[:, None] + ways[..., 1] * np.sin(yaw)[:, None])
        detected = self.detected(t, eyes, yaw)[:, self._problem.face_owner]
        result: FloatArray = detected * self.law(ahead, turned, ways)
        return result

    def detected(
        self, t: int, eyes: FloatArray, yaw: FloatArray, edge: float = ON_THE_EDGE
    ) -> BoolArray:
        """Returns an array [n, A], true if an actor is in the cone towards [n] or [1] (rad)."""
        return np.asarray(self._off(t, eyes, yaw) <= self._cone.opening / 2 + edge)

    def _feet(self, t: int) -> FloatArray:
        """Returns the actors' foot points [A, 3] m."""
        feet = np.array([actor.poses[t, :3] for actor in self._problem.actors])
        return np.asarray(feet - self._geometry.origin)

    def _off(self, t: int, eyes: FloatArray, yaw: FloatArray) -> FloatArray:
        """Returns the angles [n, A] (rad) between look directions [n] or [1] and the actors."""
        ways = self._feet(t)[None] - eyes[:, None]  # [n, A, 3]
        off = np.arctan2(ways[..., 1], ways[..., 0]) - yaw[:, None]
        result: FloatArray = np.abs((off + np.pi) % (2 * np.pi) - np.pi)
        return result

    def ways(self, t: int, eyes: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Returns the ways [n, F, 3] m to the faces, and how far [n, F] these are turned to them.

        All faces count as if they were on the ground.
        """
        faces, ground = self._geometry.planes(t), self._feet(t)[self._problem.face_owner, 2]
        targets = np.column_stack([faces.centres[:, :2], ground])
        ways = targets[None] - eyes[:, None]
        return ways, np.maximum(-dot(ways, faces.normals), 0.0)

    @staticmethod
    def law(ahead: FloatArray, turned: FloatArray, ways: FloatArray) -> FloatArray:
        """Returns the coverage [..] of faces at ways [.., 3], so far ahead and turned to it."""
        square = dot(ways, ways)
        square = np.where(square > 0, square, np.inf)  # where the eye is, nothing is seen
        result: FloatArray = ahead * turned / square**2
        return result


# Most states at once, and states times actors, so that limits are checked every 0.3 s or so.
_BATCH, _BATCH_ACTORS = 8_192, 65_000
_FASTER = 8  # times as many by the compiled kernel
_BATCH_RAYS = 400_000  # states times faces times the squared samples of a triangle
NOTHING = SeenFaces(np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64), np.zeros(0))


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
        geometry: FaceGeometry,
        problem: Problem,
        graph: TimeGraph,
        camera: AnyCamera,
        plain: bool = False,
    ) -> "Views":
        """Returns the views of a camera.

        Parameters
        ----------
        plain : without compiled code
        """
        if isinstance(camera, Cone):
            return ConeViews(geometry, problem, graph, camera)
        return PinholeViews(geometry, problem, graph, camera, plain)

    @property
    @abstractmethod
    def batch(self) -> int:
        """Number of nodes, states at steps, that take a fraction of a second."""

    def expected(self, seconds: float) -> float:
        """Returns the seconds that views are expected to take that take so many now."""
        return seconds

    @abstractmethod
    def prepare(self, views: int, seconds: float) -> None:
        """Makes ready for so many views, for which there are so many seconds."""

    @abstractmethod
    def make_ready(self, step: int) -> None:
        """Makes what all views of a step need, which several threads would make several times."""

    @abstractmethod
    def seen(self, nodes: IntArray, steps: tuple[int, int] | None = None) -> SeenFaces:
        """Returns the faces that nodes [n], increasing, see; node t S + s is state s at step t.

        Parameters
        ----------
        steps : the first and last of those that nodes are asked for in parts, so that what all
            parts need is made once; if not given, the nodes are all
        """

    def look(self, at: Viewpoints) -> SeenFaces:
        """Returns the faces that views [n] see, which are given place by place."""
        views = np.arange(len(at.looks))
        return self.seen(at.nodes(views, self.graph.n_places, self.n_states))

    def coverage(self, t: int, states: IntArray) -> FloatArray:
        """Returns the coverage [n, F] in px/m2 of every face from the states [n] at step t."""
        return self.dense(t * self.n_states + states)

    def along(self, first_step: int, states: IntArray) -> FloatArray:
        """Returns the coverage [n, F] of states [n], one at each step from `first_step` on."""
        return self.dense((first_step + np.arange(len(states))) * self.n_states + states)

    def eyes(self, places: IntArray) -> FloatArray:
        """Returns the positions [n, 3] m of places [n], from the geometry's origin."""
        eyes = self.graph.positions(self.problem.height_map, places)
        return np.asarray(eyes - self.geometry.origin)

    def dense(self, nodes: IntArray) -> FloatArray:
        """Returns the coverage [n, F] in px/m2 of nodes [n], increasing; see `seen`."""
        coverage, seen = np.zeros((len(nodes), self.n_faces)), self.seen(nodes)
        coverage[seen.rows, seen.faces] = seen.pixels
        return coverage


class PinholeViews(Views):
    """Coverage of states by a pinhole camera, see `PinholeSight`.

    Attributes
    ----------
    axes : [O, 3, 3] right, up and forward of each orientation
    """

    def __init__(
        self, geometry: FaceGeometry, problem: Problem, graph: TimeGraph, camera: Camera,
        plain: bool = False,
    ) -> None:  # fmt: skip
        super().__init__(geometry, problem, graph)
        self.camera, self.axes = camera, Projection(camera).axes(graph.motion.headings)
        self._pinhole = PinholeSight(geometry, problem, camera, self.axes, plain)

    @property
    def batch(self) -> int:
        """Number of nodes, states at steps, that take a fraction of a second."""
        owners = self.problem.face_owner
        actors = int(owners[-1]) + 1 if len(owners) else 1
        most = min(_BATCH, _BATCH_ACTORS // actors)
        if KERNEL.is_loaded and self._pinhole.may_be_compiled:
            most *= _FASTER
        if self.geometry.mesh is not None:
            most = min(most, _BATCH_RAYS // max(self.n_faces * self.problem.face_samples**2, 1))
        return max(most, 1)

    def expected(self, seconds: float) -> float:
        """Returns the seconds that views take once what finds them is compiled."""
        return KERNEL.expected(seconds) if self._pinhole.may_be_compiled else seconds

    def prepare(self, views: int, seconds: float) -> None:
        """Loads what finds many views, if that is soon repaid."""
        if self._pinhole.may_be_compiled:
            KERNEL.prepare(_EACH * views * len(self.problem.actors), seconds)

    def make_ready(self, step: int) -> None:
        """Makes the geometry of a step, which several threads would make several times."""
        self.geometry.at(step)

    def seen(self, nodes: IntArray, steps: tuple[int, int] | None = None) -> SeenFaces:
        """Returns the faces that nodes [n] see; node t S + s is state s at step t."""
        if not self.n_faces or not len(nodes):
            return NOTHING
        n_places = self.graph.n_places
        t, state = np.divmod(nodes, self.n_states)
        orientation, place = np.divmod(state, n_places)
        viewpoints, which = np.unique(t * n_places + place, return_inverse=True)
        t, place = np.divmod(viewpoints, n_places)
        return self._pinhole.seen(t, self.eyes(place), which, orientation, steps)

    def look(self, at: Viewpoints) -> SeenFaces:
        """Returns the faces that views [n] see, which are given place by place."""
        if not self.n_faces or not len(at.looks):
            return NOTHING
        return self._pinhole.seen(at.steps, self.eyes(at.places), at.which, at.looks)


class ConeViews(Views):
    """Coverage by a `Cone`, of all faces of the actors that it detects."""

    def __init__(self, geometry: FaceGeometry, problem: Problem, graph: TimeGraph, cone: Cone):
        super().__init__(geometry, problem, graph)
        self.sight = ConeSight(geometry, problem, cone)

    def prepare(self, views: int, seconds: float) -> None:
        """Does nothing: no view takes long."""

    def make_ready(self, step: int) -> None:
        """Does nothing: what all views of a step need is made at once."""

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

    def seen(self, nodes: IntArray, steps: tuple[int, int] | None = None) -> SeenFaces:
        """Returns the faces that nodes [n], increasing, see; node t S + s is state s at step t."""
        t, states = np.divmod(nodes, self.n_states)
        parts = [self.coverage(int(step), states[t == step]) for step in np.unique(t)]
        coverage = np.concatenate([np.zeros((0, self.n_faces)), *parts])
        rows, faces = np.nonzero(coverage)
        return SeenFaces(rows, faces, coverage[rows, faces])
