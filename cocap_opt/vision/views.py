"""Views: the coverage of every face from a camera, evaluated on demand.

A sight looks from any places and in any directions; views are those of a drone's states. The value
of a view depends on the kind of camera; `StateViews.of` returns the views of a camera.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from cocap_opt.arithmetic import spans
from cocap_opt.compiling import Kernel
from cocap_opt.data import BoolArray, FloatArray, IntArray
from cocap_opt.graph.motion import Window
from cocap_opt.graph.timegraph import TimeGraph
from cocap_opt.problem import AnyCamera, Camera, Cone, Problem, Robot
from cocap_opt.stop import Clock, Stop
from cocap_opt.vision.faces import FaceGeometry, Faces, Reach
from cocap_opt.vision.projection import Projection, dot, solid_angles
from cocap_opt.vision.viewpoints import Viewpoints
from cocap_opt.vision.visibility import IN_ITS_PLANE, Sightings, Visibility

if TYPE_CHECKING:
    from cocap_opt.vision.compiled_sight import CompiledSight

KERNEL = Kernel(
    "cocap_opt.vision.compiled_sight", "coverage", compiling=13.0,
    functions="cocap_opt.vision.view_kernel",
)  # fmt: skip
_EACH = 5e-7  # s, at least, of NumPy's way for a view of a person: measured in streets
ON_THE_EDGE = 1e-9  # rad, by which an actor may be beyond the edge of a cone


class SeenFaces(NamedTuple):
    """The faces that some views see; the others see nothing."""

    rows: IntArray  # [n] number of the view, increasing
    faces: IntArray  # [n] increasing for each view
    pixels: FloatArray  # [n] px/m2, > 0


class SeenPeople(NamedTuple):
    """The people that some views see, in whole or in part, by solid angles."""

    rows: IntArray  # [n] number of the view, increasing
    people: IntArray  # [n] increasing for each view
    visible: FloatArray  # [n] sr, > 0, of what is visible in the image
    unhidden: FloatArray  # [n] sr, with nothing in the way and no edge of the image

    @property
    def shares(self) -> FloatArray:
        """The shares [n] that are visible of what there is with nothing in the way, 0 to 1."""
        return np.minimum(self.visible / self.unhidden, 1.0)


def are_seen(shares: FloatArray, at_least: float) -> BoolArray:
    """Returns true where a share of a person is as large as one must be for the person to count."""
    return np.asarray(shares >= at_least - _SHARE_ROUNDING)


class Seen(NamedTuple):
    """The faces that some views see, and the people, if these are asked for."""

    faces: SeenFaces
    people: SeenPeople


class SeenColumns(NamedTuple):
    """The faces that some views see, and the people, where these count.

    Columns are numbered as those of `Problem.step_view_sums`: faces, then people.
    """

    rows: IntArray  # [n] number of the view, increasing
    columns: IntArray  # [n] increasing for each view
    amounts: FloatArray  # [n] px/m2 of a face, > 0; 1 for a person who is seen well enough

    @classmethod
    def of(cls, seen: Seen, n_faces: int, at_least: float) -> Self:
        """Returns faces, and people of whom at least a share is visible.

        Parameters
        ----------
        at_least : share of the solid angle that a person has with nothing in the way
        """
        people = seen.people
        counts = np.flatnonzero(are_seen(people.shares, at_least))
        return cls.merged(seen.faces, people.rows[counts], people.people[counts], n_faces)

    @classmethod
    def merged(cls, faces: SeenFaces, rows: IntArray, people: IntArray, n_faces: int) -> Self:
        """Returns the faces that views see, and after those of each view the people who count.

        Parameters
        ----------
        rows, people : [n] view, increasing, and person, increasing for each view
        """
        at_people = np.searchsorted(faces.rows, rows, side="right") + np.arange(len(rows))
        at_faces = np.searchsorted(rows, faces.rows, side="left") + np.arange(len(faces.rows))
        order = np.argsort(np.concatenate([at_faces, at_people]))
        return cls(
            np.concatenate([faces.rows, rows])[order],
            np.concatenate([faces.faces, people + n_faces])[order],
            np.concatenate([faces.pixels, np.ones(len(rows))])[order],
        )


_SHARE_ROUNDING = 1e-9  # by which a share may be too small: that of a whole person is 1


class PinholeSight:
    """Coverage by a pinhole camera from any places, which looks along any axes.

        coverage = area of the image of what is visible of the face, in px / area of the face

    The solid angles of people are sums over the same parts of their faces; with nothing in the way
    they are those of all faces that are turned to the camera.

    What is visible depends on the camera's place only, not on its orientation (`visibility`): the
    whole face, nothing, or some convex pieces of it.

    Parameters
    ----------
    axes : [O, 3, 3] right, up and forward unit vectors of its orientations
    plain : without compiled code
    reach : the places it is mostly asked for; elsewhere it takes longer

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
        reach: Reach | None = None,
    ) -> None:
        self._geometry, self._reach = geometry, reach
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
        people: bool = False,
    ) -> Seen:
        """Returns the faces that views [n] see, with their pixels.

        Parameters
        ----------
        t, eyes : steps [e], increasing, and places [e, 3] (m from the geometry's origin)
        which, orientation : [n] of each view, the number of its place and that of its axes
        steps : the first and last of those that views are asked for in parts, so that what all
            parts need is made once; if not given, the views are all
        people : the solid angles of people are asked for, too
        """
        faces = self._faces(*(steps or (int(t[0]), int(t[-1]))), eyes)
        if self.may_be_compiled and KERNEL.is_loaded:
            found = self._compiled.seen(faces, t, eyes, which, orientation, people)
            if found is not None:
                return Seen(SeenFaces(*found[:3]), SeenPeople(*found[3:]))
            if len(which) * self._n_actors > _BATCH_ACTORS and len(eyes) > 1:
                return self._in_halves(t, eyes, which, orientation, faces, people)
        clock = Clock()
        seen = self._seen_plainly(faces, t, eyes, which, orientation, people)
        if self.may_be_compiled:
            KERNEL.spend(clock.seconds)
        return seen

    def _seen_plainly(
        self, faces: Faces, t: IntArray, eyes: FloatArray, which: IntArray, orientation: IntArray,
        people: bool,
    ) -> Seen:  # fmt: skip
        """Finds what `seen` returns without the kernel."""
        at, n_faces = t - faces.first, len(self._owners)
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
        parts = [(row, face, self._images(polygons, orientation[row], people))]
        if len(sight.eyes):
            parts.append(self._in_pieces(sight, which, orientation, in_view, people))
        row, face, images = (
            np.concatenate(columns, axis=-1) for columns in zip(*parts, strict=True)
        )
        area = images[0]
        kept = np.flatnonzero(area > 0)
        kept = kept[np.argsort(row[kept] * n_faces + face[kept])]
        seen = SeenFaces(row[kept], face[kept], area[kept] / faces.areas[face[kept]])
        if not people:
            return Seen(seen, NO_PEOPLE)
        pairs = row * self._n_actors + self._owners[face]
        sums = np.bincount(pairs, images[1], minlength=len(which) * self._n_actors)
        visible: FloatArray = sums.reshape(len(which), self._n_actors).astype(np.float64)
        row, person = np.nonzero(visible)
        unhidden = self._unhidden(faces, at[which[row]], eyes[which[row]], person)
        return Seen(seen, SeenPeople(row, person, visible[row, person], unhidden))

    def _faces(self, first: int, last: int, eyes: FloatArray) -> Faces:
        """Returns the geometry at the steps first..last, for eyes [e, 3] among others."""
        reach = self._reach
        if reach is not None and not reach.has(last, eyes):
            reach = None
        return self._geometry.between(first, last, reach)

    def _unhidden(
        self, faces: Faces, steps: IntArray, eyes: FloatArray, people: IntArray
    ) -> FloatArray:
        """Returns the solid angles [n] of people [n] from eyes [n, 3], with nothing in the way."""
        n_faces = np.bincount(self._owners, minlength=self._n_actors)
        entry = np.repeat(np.arange(len(people)), n_faces[people])
        face = spans((np.cumsum(n_faces) - n_faces)[people], n_faces[people])
        polygons = faces.polygons[steps[entry], face] - eyes[entry, None]
        turned = -dot(polygons[:, 0], faces.normals[steps[entry], face]) > IN_ITS_PLANE
        angles = solid_angles(polygons[turned])
        return np.asarray(np.bincount(entry[turned], weights=angles, minlength=len(people)))

    def _in_halves(
        self, t: IntArray, eyes: FloatArray, which: IntArray, orientation: IntArray, faces: Faces,
        people: bool,
    ) -> Seen:  # fmt: skip
        """Finds what `seen` returns for one half of the places, then for the other half.

        It is called where the kernel had no room for the pieces of a person. Halving goes on until
        it has room, or so few places are left that NumPy's way takes a fraction of a second.
        """
        steps, middle = (faces.first, faces.first + len(faces.polygons) - 1), len(eyes) // 2
        parts, of_people = [], []
        for half in (slice(0, middle), slice(middle, len(eyes))):
            ours = np.flatnonzero((which >= half.start) & (which < half.stop))
            seen = self.seen(
                t[half], eyes[half], which[ours] - half.start, orientation[ours], steps, people
            )
            parts.append(seen.faces._replace(rows=ours[seen.faces.rows]))
            of_people.append(seen.people._replace(rows=ours[seen.people.rows]))
        return Seen(SeenFaces(*_sorted_by_view(parts)), SeenPeople(*_sorted_by_view(of_people)))

    def _in_pieces(
        self, sight: Sightings, which: IntArray, orientation: IntArray, in_view: BoolArray,
        people: bool,
    ) -> tuple[IntArray, IntArray, FloatArray]:  # fmt: skip
        """Returns states, faces and `_images` [m, n] of all faces seen in part."""
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
        images = self._images(sight.pieces[piece], looks, people)
        if sight.veil is not None:
            axes = self._axes[looks]
            wanted = images[0] > 0
            images = images * sight.veil.shares(piece, wanted, self._projection, axes, people)
        images = np.array([
            np.bincount(entry, weights=image, minlength=len(at)) for image in images
        ])  # fmt: skip
        images[0] = np.minimum(images[0], self._image)
        return row, sight.faces[at], images

    def _images(self, polygons: FloatArray, orientation: IntArray, people: bool) -> FloatArray:
        """Returns areas [n] in px of the images of polygons [n, V, 3], relative to the eye.

        Below them, if people are asked for, their solid angles in sr: [2, n] instead of [1, n].
        """
        # The area of a face that nearly touches the camera may be rounded beyond the image, or nan.
        with np.errstate(over="ignore", invalid="ignore"):
            images = self._projection.images(self._in_camera(polygons, orientation), people)
            images[0] = np.minimum(images[0], self._image)
        return images

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
        feet = np.array([actor.poses[t, :3] for actor in self._problem.actors]).reshape(-1, 3)
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
_NONE = np.zeros(0, dtype=np.int64)
NOTHING = SeenFaces(_NONE, _NONE, np.zeros(0))
NO_COLUMNS = SeenColumns(_NONE, _NONE, np.zeros(0))
NO_PEOPLE = SeenPeople(_NONE, _NONE, np.zeros(0), np.zeros(0))


def _sorted_by_view(parts: Sequence[SeenFaces | SeenPeople]) -> Iterator[NDArray[Any]]:
    """Returns the columns of several parts, of views of their own each, in the views' order."""
    columns = [np.concatenate(column) for column in zip(*parts, strict=True)]
    order = np.argsort(columns[0], kind="stable")
    return (column[order] for column in columns)


class StateViews(ABC):
    """A source of coverage of single states, which several threads may use.

    Attributes
    ----------
    geometry, problem, graph : of the faces, the scene, and the states
    n_states, n_faces, width : S, F, and W, the faces and the people who count
    """

    def __init__(self, geometry: FaceGeometry, problem: Problem, graph: TimeGraph) -> None:
        self.geometry, self.problem, self.graph = geometry, problem, graph
        self.n_states, self.n_faces = graph.n_states, len(problem.face_owner)
        self.width, counted = problem.step_width, problem.objective.views
        self.at_least = None if counted is None else counted.at_least

    @staticmethod
    def of(
        geometry: FaceGeometry,
        problem: Problem,
        graph: TimeGraph,
        camera: AnyCamera,
        plain: bool = False,
        reach: Reach | None = None,
    ) -> "StateViews":
        """Returns the views of a camera.

        Parameters
        ----------
        plain : without compiled code
        reach : the places it is mostly asked for; elsewhere it takes longer
        """
        if isinstance(camera, Cone):
            return ConeViews(geometry, problem, graph, camera)
        return PinholeViews(geometry, problem, graph, camera, plain, reach)

    @classmethod
    def within(
        cls, window: Window, geometry: FaceGeometry, problem: Problem, robot: Robot
    ) -> "StateViews":
        """Returns the views of a robot's states in a window of the map."""
        pitches = len(robot.camera.tilts)
        graph = TimeGraph.of(problem.workspace, robot.motion, pitches, window)
        return cls.of(geometry, problem, graph, robot.camera)

    @property
    @abstractmethod
    def batch(self) -> int:
        """Number of nodes, states at steps, that take a fraction of a second."""

    def expected(self, seconds: float) -> float:
        """Returns the seconds that views are expected to take that take so many now."""
        return seconds

    @abstractmethod
    def prepare(self, views: int, stop: Stop | None = None) -> None:
        """Makes ready for so many views, by what compiled code is kept, or with a stop by more.

        Raises
        ------
        LimitReached
            If a limit is reached before code is compiled.
        """

    @abstractmethod
    def prepare_more(self, seconds: float, stop: Stop) -> None:
        """Makes ready for views that would take so many seconds more as they are found now.

        Raises
        ------
        LimitReached
            If a limit is reached before code is compiled.
        """

    @abstractmethod
    def make_ready(self, step: int) -> None:
        """Makes what all views of a step need, which several threads would make several times."""

    @abstractmethod
    def room(self, steps: int, together: tuple[int, int], threads: int) -> float:
        """Returns the bytes, about, that are taken beside a table while it is made.

        Parameters
        ----------
        steps : of the table
        together : the first and last of those steps that are the most to be asked for together
        """

    @abstractmethod
    def advise(self, seconds: float) -> None:
        """Says how coverage that has taken so long is found faster, if it can be."""

    @abstractmethod
    def _seen(self, nodes: IntArray, steps: tuple[int, int] | None, people: bool) -> Seen:
        """Returns the faces and, if asked for, people that nodes [n] see; see `seen`."""

    def seen(self, nodes: IntArray, steps: tuple[int, int] | None = None) -> SeenColumns:
        """Returns the columns that nodes [n], increasing, see; node t S + s is state s at step t.

        Parameters
        ----------
        steps : the first and last of those that nodes are asked for in parts, so that what all
            parts need is made once; if not given, the nodes are all
        """
        return self._columns(self._seen(nodes, steps, people=self.at_least is not None))

    def people(self, nodes: IntArray, steps: tuple[int, int] | None = None) -> SeenPeople:
        """Returns the people that nodes [n], increasing, see; see `seen`.

        A camera that knows no solid angles sees all of a person, 1 of 1, or nothing.
        """
        return self._seen(nodes, steps, people=True).people

    def _columns(self, seen: Seen) -> SeenColumns:
        if self.at_least is None:
            return SeenColumns(*seen.faces)
        return SeenColumns.of(seen, self.n_faces, self.at_least)

    def look(self, at: Viewpoints) -> SeenColumns:
        """Returns the columns that views [n] see, which are given place by place."""
        views = np.arange(len(at.looks))
        return self.seen(at.nodes(views, self.graph.n_places, self.n_states))

    def coverage(self, t: int, states: IntArray) -> FloatArray:
        """Returns the coverage [n, W] of states [n] at step t: px/m2 of faces, and people seen."""
        return self.dense(t * self.n_states + states)

    def along(self, first_step: int, states: IntArray) -> FloatArray:
        """Returns the coverage [n, W] of states [n], one at each step from `first_step` on."""
        return self.dense((first_step + np.arange(len(states))) * self.n_states + states)

    def eyes(self, places: IntArray) -> FloatArray:
        """Returns the positions [n, 3] m of places [n], from the geometry's origin."""
        eyes = self.graph.positions(self.problem.height_map, places)
        return np.asarray(eyes - self.geometry.origin)

    def dense(self, nodes: IntArray) -> FloatArray:
        """Returns the coverage [n, W] of nodes [n], increasing; see `seen`."""
        coverage, seen = np.zeros((len(nodes), self.width)), self.seen(nodes)
        coverage[seen.rows, seen.columns] = seen.amounts
        return coverage


class PinholeViews(StateViews):
    """Coverage of states by a pinhole camera, see `PinholeSight`.

    Attributes
    ----------
    axes : [O, 3, 3] right, up and forward of each orientation
    """

    def __init__(
        self, geometry: FaceGeometry, problem: Problem, graph: TimeGraph, camera: Camera,
        plain: bool = False, reach: Reach | None = None,
    ) -> None:  # fmt: skip
        super().__init__(geometry, problem, graph)
        self.camera, self.axes = camera, Projection(camera).axes(graph.motion.headings)
        self._reach = reach
        self._pinhole = PinholeSight(geometry, problem, camera, self.axes, plain, reach)

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

    def prepare(self, views: int, stop: Stop | None = None) -> None:
        """Loads what finds many views, if that is soon repaid; with a stop compiles it, too."""
        if self._pinhole.may_be_compiled:
            KERNEL.prepare(_EACH * views * len(self.problem.actors), stop)

    def prepare_more(self, seconds: float, stop: Stop) -> None:
        """Compiles what finds views, or loads it, if that is repaid."""
        if self._pinhole.may_be_compiled:
            KERNEL.prepare(seconds, stop)

    def make_ready(self, step: int) -> None:
        """Makes the geometry of a step, which several threads would make several times."""
        self.geometry.between(step, step, self._reach)

    def room(self, steps: int, together: tuple[int, int], threads: int) -> float:
        """Returns the bytes, about, of lists of bodies that may hide somebody."""
        return self.geometry.room(steps, together, threads, self._reach)

    def advise(self, seconds: float) -> None:
        """Says, once, what compiled code would have saved of so many seconds."""
        if self._pinhole.may_be_compiled:
            KERNEL.advise("coverage", seconds)

    def _seen(self, nodes: IntArray, steps: tuple[int, int] | None, people: bool) -> Seen:
        if not self.n_faces or not len(nodes):
            return Seen(NOTHING, NO_PEOPLE)
        n_places = self.graph.n_places
        t, state = np.divmod(nodes, self.n_states)
        orientation, place = np.divmod(state, n_places)
        viewpoints, which = np.unique(t * n_places + place, return_inverse=True)
        t, place = np.divmod(viewpoints, n_places)
        return self._pinhole.seen(t, self.eyes(place), which, orientation, steps, people)

    def look(self, at: Viewpoints) -> SeenColumns:
        """Returns the columns that views [n] see, which are given place by place."""
        if not self.n_faces or not len(at.looks):
            return NO_COLUMNS
        eyes, people = self.eyes(at.places), self.at_least is not None
        return self._columns(self._pinhole.seen(at.steps, eyes, at.which, at.looks, people=people))


class ConeViews(StateViews):
    """Coverage by a `Cone`, of all faces of the actors that it detects."""

    def __init__(self, geometry: FaceGeometry, problem: Problem, graph: TimeGraph, cone: Cone):
        super().__init__(geometry, problem, graph)
        self.sight = ConeSight(geometry, problem, cone)

    def prepare(self, views: int, stop: Stop | None = None) -> None:
        """Does nothing: no view takes long."""

    def prepare_more(self, seconds: float, stop: Stop) -> None:
        """Does nothing: no view takes long."""

    def advise(self, seconds: float) -> None:
        """Says nothing: no view is compiled."""

    def make_ready(self, step: int) -> None:
        """Does nothing: what all views of a step need is made at once."""

    def room(self, steps: int, together: tuple[int, int], threads: int) -> float:
        """Returns 0: nothing is listed."""
        return 0.0

    @property
    def batch(self) -> int:
        """Number of nodes, states at steps, that take a fraction of a second."""
        return max(_BATCH_ACTORS // max(self.n_faces, 1), 1)

    def _seen(self, nodes: IntArray, steps: tuple[int, int] | None, people: bool) -> Seen:
        """Returns the faces of all people whom nodes [n], increasing, detect, and the people."""
        t, states = np.divmod(nodes, self.n_states)
        orientation, place = np.divmod(states, self.graph.n_places)
        yaw = 2 * np.pi * orientation / self.graph.motion.headings
        coverage = np.zeros((len(nodes), self.n_faces))
        detected = np.zeros((len(nodes), len(self.problem.actors)), dtype=bool)
        for step in np.unique(t).tolist() if self.n_faces else ():
            at = np.flatnonzero(t == step)
            eyes = self.eyes(place[at])
            coverage[at] = self.sight.coverage(step, eyes, yaw[at])
            detected[at] = self.sight.detected(step, eyes, yaw[at])
        rows, faces = np.nonzero(coverage)
        seen = SeenFaces(rows, faces, coverage[rows, faces])
        if not people:
            return Seen(seen, NO_PEOPLE)
        rows, persons = np.nonzero(detected)
        return Seen(seen, SeenPeople(rows, persons, np.ones(len(rows)), np.ones(len(rows))))
