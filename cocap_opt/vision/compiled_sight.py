"""Views by the compiled kernel: passes it a scene's arrays, and returns its results."""

from functools import cached_property
from threading import local
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from cocap_opt.data import FloatArray, IntArray
from cocap_opt.problem import Actor, Camera, Robot, SceneData, State
from cocap_opt.vision import view_kernel as kernel
from cocap_opt.vision.bodies import Bodies
from cocap_opt.vision.faces import FaceGeometry, Faces
from cocap_opt.vision.projection import Projection
from cocap_opt.vision.seen import Seen, SeenFaces, SeenPeople
from cocap_opt.world.workspace import HeightMap


class _OfThread(local):
    """Memory that a thread keeps between calls, since new memory takes time."""

    memory: kernel.Memory | None = None
    found: kernel.Found | None = None


class CompiledSight:
    """Computes views with the kernel.

    Parameters
    ----------
    fixed : bodies that hide people, except other people
    first_face : [A + 1] first face of each person
    take_of : [A] take of each person; people of other takes are not present
    axes : [O, 3, 3] right, up and forward of the orientations
    """

    def __init__(
        self, fixed: Bodies, first_face: IntArray, take_of: IntArray, projection: Projection,
        axes: FloatArray,
    ) -> None:  # fmt: skip
        camera = projection.camera
        self._bodies, self._first_face = fixed, _plain(first_face, np.int64)
        self._take_of = _plain(take_of, np.int64)
        slopes = np.array([camera.width / 2 / camera.focal, camera.height / 2 / camera.focal])
        image = float(camera.width * camera.height)
        self._mine = _OfThread()
        self._lens = kernel.Lens(_plain(axes), slopes, float(camera.focal), image)

    @cached_property
    def _fixed(self) -> kernel.Solids:
        return _solids_of(self._bodies)

    def seen(
        self, faces: Faces, t: IntArray, eyes: FloatArray, counts: IntArray, looks: IntArray,
        people: bool,
    ) -> Seen | None:  # fmt: skip
        """Returns the faces and people that views see; None if NumPy must compute them.

        Parameters
        ----------
        t, eyes, counts : steps [e], not decreasing, places [e, 3] m, and number of views from each
            [e]
        looks : [n] numbers of the orientations, place by place
        people : True: solid angles are requested
        """
        ends, looks = np.cumsum(counts), _plain(looks, np.int64)
        first, parts, begin = np.concatenate([[0], ends]), list[Seen](), 0
        for end in [*(np.flatnonzero(np.diff(t)) + 1).tolist(), len(t)]:
            part = self.at_step(
                faces, int(t[begin]), eyes[begin:end],
                first[begin : end + 1] - first[begin], looks[first[begin] : first[end]], people,
            )  # fmt: skip
            if part is None:
                return None
            parts.append(part)
            begin = end
        return Seen.joined(parts)

    def at_step(
        self, faces: Faces, t: int, eyes: FloatArray, first: IntArray, looks: IntArray,
        people: bool = False,
    ) -> Seen | None:  # fmt: skip
        """Returns the result for views at one step; None if a person is cut into too many pieces.

        Parameters
        ----------
        eyes : [E, 3] m
        first : [E + 1] first view of each eye
        looks : [n] orientation of each view
        people : True: solid angles are requested
        """
        persons, before = self._people(faces, t - faces.first), self._before(faces, t - faces.first)
        most, eyes = int(np.diff(first).max(initial=0)), _plain(eyes)
        memory = self._memory(persons, before, most)
        found = self._room(
            len(looks), 16 * len(looks) + most * len(persons.areas),
            2 * len(looks) + most * len(persons.reaches) if people else 0,
        )  # fmt: skip
        done = kernel.Total(0, 0, 0)
        while True:
            done = kernel.Total(*kernel.cover(
                self._lens, persons, before, eyes, first, looks, memory, found, done
            ))  # fmt: skip
            if done.eyes < 0:
                self._mine.memory = None
                return None
            if done.eyes == len(eyes):
                return _filled(found, done, len(looks))
            found = self._mine.found = found.doubled()

    def _memory(self, persons: kernel.People, before: kernel.Before, most: int) -> kernel.Memory:
        """Returns this thread's working memory, for places with at most the given number of views.

        The shapes of people and bodies are those at any step of the sight.
        """
        found = self._mine.memory
        if found is None or len(found.views) < most:
            found = self._mine.memory = kernel.memory_for(persons, before, most)
        return found

    def _room(self, views: int, faces: int, people: int) -> kernel.Found:
        """Returns the arrays to which this thread writes entries, with at least the given room."""
        found = self._mine.found
        if found is None or not found.has_room(views, faces, people):
            found = self._mine.found = kernel.Found.empty(views, faces, people)
        return found if people else found._replace(n_people=found.n_people[:0])

    def _people(self, faces: Faces, step: int) -> kernel.People:
        n = len(faces.reaches)
        return kernel.People(
            _plain(faces.middles[step]), _plain(faces.reaches), _plain(faces.corners[step]),
            _plain(faces.n_corners, np.int64), self._first_face, _plain(faces.polygons[step]),
            _plain(faces.n_vertices, np.int64), _plain(faces.normals[step]), _plain(faces.areas),
            _solids_of(faces.bodies.taken(np.arange(step * n, (step + 1) * n))), self._take_of,
        )  # fmt: skip

    def _before(self, faces: Faces, step: int) -> kernel.Before:
        found = faces.candidates
        return kernel.Before(
            self._fixed, _plain(found.keys), _plain(found.numbers, np.int32),
            _plain(found.nearest), _plain(found.starts, np.int64), _plain(found.around),
            _plain(found.radii), _plain(found.feet), np.nextafter(found.radii, np.inf),
            _plain(found.middles), _plain(found.halves), step * len(faces.reaches),
        )  # fmt: skip


def _filled(found: kernel.Found, done: kernel.Total, views: int) -> Seen:
    """Returns copies of the entries that the kernel has written."""
    counts, n, m = found.counts[:views].copy(), done.faces, done.people
    n_people = found.n_people[:views].copy() if len(found.n_people) else np.zeros_like(counts)
    return Seen(
        SeenFaces(counts, found.faces[:n].copy(), found.pixels[:n].copy()),
        SeenPeople(
            n_people, found.people[:m].copy(), found.visible[:m].copy(), found.unhidden[:m].copy()
        ),
    )


def call_once() -> None:
    """Calls the kernel without eyes, so that it is loaded, or compiled and stored."""
    robot, actor = Robot(start=State(0, 0)), Actor(poses=np.zeros((1, 4)))
    flat = HeightMap(heights=np.zeros((1, 1)), resolution=1.0)
    scene = SceneData(name="flat", height_map=flat, robots=(robot,), actors=(actor,), horizon=0)
    geometry, camera = FaceGeometry(scene), Camera()
    first_face = np.array([0, len(geometry.at(0).areas)])
    sight = CompiledSight(
        geometry.fixed, first_face, scene.take_of, Projection(camera), np.zeros((1, 3, 3))
    )
    nothing = np.zeros(0, np.int64)
    sight.at_step(geometry.at(0), 0, np.zeros((0, 3)), np.zeros(1, np.int64), nothing)


def _solids_of(bodies: Bodies) -> kernel.Solids:
    """Returns bodies with their numbers of existing planes and edges."""
    planes = (bodies.normals != 0).any(axis=2).sum(axis=1)
    pairs = (bodies.neighbours[..., 0] != bodies.neighbours[..., 1]).sum(axis=1)
    return kernel.Solids(
        _plain(bodies.normals), _plain(bodies.offsets), _plain(bodies.neighbours, np.int64),
        _plain(planes, np.int64), _plain(pairs, np.int64), _plain(bodies.low), _plain(bodies.high),
        _plain(bodies.endless, np.bool_),
    )  # fmt: skip


def _plain(values: NDArray[Any], kind: DTypeLike = np.float64) -> NDArray[Any]:
    """Returns an array with a fixed type and layout, for which the kernel is compiled once."""
    return np.require(values, kind, ["C", "W"])
