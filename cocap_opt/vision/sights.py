"""Sights: coverage by cameras at any places, in any directions."""

import math
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from cocap_opt.arithmetic import entries_of, spans
from cocap_opt.compiling import Kernel
from cocap_opt.data import BoolArray, FloatArray, IntArray
from cocap_opt.problem import Camera, Cone, Problem
from cocap_opt.stop import Clock, Stop
from cocap_opt.vision.faces import FaceGeometry, Faces, Reach
from cocap_opt.vision.projection import Projection, dot, solid_angles
from cocap_opt.vision.seen import Seen, SeenFaces, SeenPeople
from cocap_opt.vision.visibility import IN_ITS_PLANE, Sightings, Visibility

if TYPE_CHECKING:
    from cocap_opt.vision.compiled_sight import CompiledSight

KERNEL = Kernel(
    "cocap_opt.vision.compiled_sight", "coverage", compiling=13.0,
    functions="cocap_opt.vision.view_kernel",
)  # fmt: skip
ON_THE_EDGE = 1e-9  # rad, by which an actor may be outside a cone
_EACH = 5e-7  # s, at least, for a person's view with NumPy: measured in streets
# Largest number of views at once, and of views times actors, so that limits are checked about every
# 0.3 s.
_BATCH, _BATCH_ACTORS = 8_192, 65_000
_FASTER = 16  # factor for the compiled kernel
_BATCH_RAYS = 400_000  # views times faces times the squared samples of a triangle


class PinholeSight:
    """Coverage by a pinhole camera from any places, along any axes.

        coverage = area of the image of the visible part of the face, in px / area of the face

    The solid angles of people are sums over the same parts of their faces; without obstructions
    they are sums over all faces that are turned to the camera.

    The visible part depends only on the camera's position, not on its orientation (`visibility`):
    it is the whole face, nothing, or some convex pieces of it.

    Parameters
    ----------
    axes : [O, 3, 3] right, up and forward unit vectors of its orientations
    plain : True: use no compiled code
    reach : the places of most requests; other places take longer

    Attributes
    ----------
    may_be_compiled : True if the compiled kernel may compute the views
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
        # For meshes that are not convex, only the NumPy version exists.
        self.may_be_compiled = not plain and geometry.mesh is None
        self._projection = Projection(camera)
        self._image = float(camera.width * camera.height)  # px
        self._slopes = camera.width / 2 / camera.focal, camera.height / 2 / camera.focal
        self._axes = axes
        self._owners, self._n_actors = problem.face_owner, len(problem.actors)
        self._take_of, self._samples = problem.take_of, problem.face_samples
        self._visibility = Visibility(geometry, problem)

    @cached_property
    def _compiled(self) -> "CompiledSight":
        from cocap_opt.vision.compiled_sight import CompiledSight

        first = np.searchsorted(self._owners, np.arange(self._n_actors + 1))
        return CompiledSight(
            self._geometry.fixed, first, self._take_of, self._projection, self._axes
        )

    @property
    def batch(self) -> int:
        """Number of views that take a fraction of a second."""
        most = min(_BATCH, _BATCH_ACTORS // max(self._n_actors, 1))
        if self.may_be_compiled and KERNEL.is_loaded:
            most *= _FASTER
        if self._geometry.mesh is not None:
            rays = len(self._owners) * self._samples**2
            most = min(most, _BATCH_RAYS // max(rays, 1))
        return max(most, 1)

    def expected(self, seconds: float) -> float:
        """Returns the expected time in s, with compiled code, of views that take the given time
        now.
        """
        return KERNEL.expected(seconds) if self.may_be_compiled else seconds

    def prepare(self, views: int, stop: Stop | None) -> None:
        """Loads the compiled code for many views if that soon saves time; if `stop` is given, also
        compiles it.
        """
        self.prepare_more(_EACH * views * self._n_actors, stop)

    def prepare_more(self, seconds: float, stop: Stop | None) -> None:
        """Loads the code for views or, if `stop` is given, compiles it, if that saves time.

        Parameters
        ----------
        seconds : time that the views would take with the current code
        """
        if self.may_be_compiled:
            KERNEL.prepare(seconds, stop)

    def advise(self, seconds: float) -> None:
        """Tells the user, once, how much of this time compiled code would have saved."""
        if self.may_be_compiled:
            KERNEL.advise("coverage", seconds)

    def seen(
        self,
        t: IntArray,
        eyes: FloatArray,
        counts: IntArray,
        looks: IntArray,
        steps: tuple[int, int] | None = None,
        people: bool = False,
    ) -> Seen:
        """Returns the faces and people that views [n] see; the views are given place by place.

        Parameters
        ----------
        t, eyes, counts : steps [e], not decreasing, places [e, 3] (m from the geometry's origin),
            and number of views from each [e]
        looks : [n] numbers of the axes
        steps : first and last step of all views that are requested in parts, so that what all parts
            need is computed once (default: the steps of these views)
        people : True: also return the solid angles of people
        """
        if not len(self._owners) or not len(looks):
            return Seen.nothing(len(looks))
        faces = self._faces(*(steps or (int(t[0]), int(t[-1]))), eyes)
        if self.may_be_compiled and KERNEL.is_loaded:
            found = self._compiled.seen(faces, t, eyes, counts, looks, people)
            if found is not None:
                return found
            if len(looks) * self._n_actors > _BATCH_ACTORS and len(eyes) > 1:
                return self._in_halves(t, eyes, counts, looks, faces, people)
        clock = Clock()
        which = np.repeat(np.arange(len(counts)), counts)
        seen = self._seen_plainly(faces, t, eyes, which, looks, people)
        if self.may_be_compiled:
            KERNEL.spend(clock.seconds)
        return seen

    def _seen_plainly(
        self, faces: Faces, t: IntArray, eyes: FloatArray, which: IntArray, orientation: IntArray,
        people: bool,
    ) -> Seen:  # fmt: skip
        """Computes the result of `seen` without the kernel.

        Parameters
        ----------
        which, orientation : [n] number of each view's place, and of its axes
        """
        at, n_faces = t - faces.first, len(self._owners)
        in_view = self._in_view(
            faces.middles[at[which]] - eyes[which, None], faces.reaches, orientation
        )
        wanted = np.zeros((len(eyes), in_view.shape[1]), dtype=bool)
        state, actor = np.nonzero(in_view)
        wanted[which[state], actor] = True
        sight = self._visibility.of(faces, at, eyes, wanted)
        # Only faces that are turned to the camera are visible.
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
        counts = np.bincount(row[kept], minlength=len(which))
        seen = SeenFaces(counts, face[kept], area[kept] / faces.areas[face[kept]])
        if not people:
            return Seen.nothing(len(which))._replace(faces=seen)
        pairs = row * self._n_actors + self._owners[face]
        sums = np.bincount(pairs, images[1], minlength=len(which) * self._n_actors)
        visible: FloatArray = sums.reshape(len(which), self._n_actors).astype(np.float64)
        row, person = np.nonzero(visible)
        unhidden = self._unhidden(faces, at[which[row]], eyes[which[row]], person)
        counts = np.count_nonzero(visible, axis=1)
        return Seen(seen, SeenPeople(counts, person, visible[row, person], unhidden))

    def _faces(self, first: int, last: int, eyes: FloatArray) -> Faces:
        """Returns the geometry at steps first..last, for eyes that include [e, 3]."""
        reach = self._reach
        if reach is not None and not reach.has(last, eyes):
            reach = None
        return self._geometry.between(first, last, reach)

    def _unhidden(
        self, faces: Faces, steps: IntArray, eyes: FloatArray, people: IntArray
    ) -> FloatArray:
        """Returns the unobstructed solid angles [n] of people [n] from eyes [n, 3]."""
        n_faces = np.bincount(self._owners, minlength=self._n_actors)
        entry = np.repeat(np.arange(len(people)), n_faces[people])
        face = entries_of(people, n_faces)
        polygons = faces.polygons[steps[entry], face] - eyes[entry, None]
        turned = -dot(polygons[:, 0], faces.normals[steps[entry], face]) > IN_ITS_PLANE
        angles = solid_angles(polygons[turned])
        return np.asarray(np.bincount(entry[turned], weights=angles, minlength=len(people)))

    def _in_halves(
        self, t: IntArray, eyes: FloatArray, counts: IntArray, looks: IntArray, faces: Faces,
        people: bool,
    ) -> Seen:  # fmt: skip
        """Computes the result of `seen` for one half of the places, then for the other half.

        It is called if the kernel had no room for the pieces of a person. Halving continues until
        it has room, or until so few places remain that the NumPy version takes a fraction of a
        second.
        """
        steps, middle = (faces.first, faces.first + len(faces.polygons) - 1), len(eyes) // 2
        views = int(counts[:middle].sum())
        return Seen.joined([
            self.seen(t[:middle], eyes[:middle], counts[:middle], looks[:views], steps, people),
            self.seen(t[middle:], eyes[middle:], counts[middle:], looks[views:], steps, people),
        ])  # fmt: skip

    def _in_pieces(
        self, sight: Sightings, which: IntArray, orientation: IntArray, in_view: BoolArray,
        people: bool,
    ) -> tuple[IntArray, IntArray, FloatArray]:  # fmt: skip
        """Returns the states, faces and `_images` [m, n] of all faces that are partly visible."""
        # Sightings are ordered by eye: those of one eye are contiguous.
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

        If people are requested, their solid angles in sr follow: [2, n] instead of [1, n].
        """
        # The area of a face that nearly touches the camera may, by rounding, exceed the image, or
        # be nan.
        with np.errstate(over="ignore", invalid="ignore"):
            images = self._projection.images(self._in_camera(polygons, orientation), people)
            images[0] = np.minimum(images[0], self._image)
        return images

    def _in_camera(self, points: FloatArray, orientation: IntArray) -> FloatArray:
        """Returns points [n, k, 3], given relative to cameras, in coordinates right, up and
        forward.
        """
        axes = self._axes[orientation][:, None]
        return np.stack([dot(points, axes[:, :, k]) for k in range(3)], axis=-1)

    def _in_view(
        self, middles: FloatArray, reaches: FloatArray, orientation: IntArray
    ) -> BoolArray:
        """Returns an array [n, A], True if spheres may be in the image of each camera.

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
    """Coverage by a `Cone` from any places: of all faces of the actors that it detects."""

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
        """Returns an array [n, A], True if an actor is in the cone in directions [n] or [1]
        (rad).
        """
        return np.asarray(self._off(t, eyes, yaw) <= self._cone.opening / 2 + edge)

    def _feet(self, t: int) -> FloatArray:
        """Returns the actors' foot points [A, 3] m."""
        feet = np.array([actor.poses[t, :3] for actor in self._problem.actors]).reshape(-1, 3)
        return np.asarray(feet - self._geometry.origin)

    def _off(self, t: int, eyes: FloatArray, yaw: FloatArray) -> FloatArray:
        """Returns the angles [n, A] (rad) between viewing directions [n] or [1] and the actors."""
        ways = self._feet(t)[None] - eyes[:, None]  # [n, A, 3]
        off = np.arctan2(ways[..., 1], ways[..., 0]) - yaw[:, None]
        result: FloatArray = np.abs((off + np.pi) % (2 * np.pi) - np.pi)
        return result

    def ways(self, t: int, eyes: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Returns the vectors [n, F, 3] m to the faces, and how much [n, F] the faces are turned to
        them.

        All faces count as if they were on the ground.
        """
        faces, ground = self._geometry.planes(t), self._feet(t)[self._problem.face_owner, 2]
        targets = np.column_stack([faces.centres[:, :2], ground])
        ways = targets[None] - eyes[:, None]
        return ways, np.maximum(-dot(ways, faces.normals), 0.0)

    @staticmethod
    def law(ahead: FloatArray, turned: FloatArray, ways: FloatArray) -> FloatArray:
        """Returns the coverage [..] of faces with vectors [.., 3], given how far ahead and how
        turned they are.
        """
        square = dot(ways, ways)
        square = np.where(square > 0, square, np.inf)  # at the eye itself, nothing is seen
        result: FloatArray = ahead * turned / square**2
        return result
