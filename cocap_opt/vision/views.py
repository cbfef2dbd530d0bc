"""Views: the coverage of every face from a camera, evaluated on demand.

A sight looks from any places in any directions; views belong to a drone's states. The value of a
view depends on the kind of camera; `StateViews.of` returns the views of a camera.
"""

from abc import ABC, abstractmethod

import numpy as np

from cocap_opt.data import FloatArray, IntArray
from cocap_opt.graph.motion import Window
from cocap_opt.graph.timegraph import TimeGraph
from cocap_opt.problem import AnyCamera, Camera, Cone, Problem, Robot
from cocap_opt.stop import Stop
from cocap_opt.vision.faces import FaceGeometry, Reach
from cocap_opt.vision.projection import Projection
from cocap_opt.vision.seen import Seen, SeenColumns, SeenFaces, SeenPeople
from cocap_opt.vision.sights import ConeSight, PinholeSight
from cocap_opt.vision.viewpoints import Viewpoints

_BATCH_FACES = 65_000  # states times faces at once, for a cone


class StateViews(ABC):
    """A source of coverage of single states, which several threads may use.

    Attributes
    ----------
    geometry, problem, graph : geometry of the faces, the scene, and the graph of the states
    n_states, n_faces, width : S, F, and W, the number of faces and counted people
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
        plain : True: use no compiled code
        reach : the places of most requests; other places take longer
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
        """Number of nodes (states at steps) that take a fraction of a second."""

    def expected(self, seconds: float) -> float:
        """Returns the expected time in s of views that would take the given time without compiled
        code.
        """
        return seconds

    @abstractmethod
    def prepare(self, views: int, stop: Stop | None = None) -> None:
        """Prepares for a number of views: loads stored compiled code or, if `stop` is given,
        compiles it.

        Raises
        ------
        LimitReached
            If a limit is reached before the code is compiled.
        """

    @abstractmethod
    def prepare_more(self, seconds: float, stop: Stop) -> None:
        """Prepares for views that would take the given time in s with the current code.

        Raises
        ------
        LimitReached
            If a limit is reached before the code is compiled.
        """

    @abstractmethod
    def make_ready(self, step: int) -> None:
        """Computes what all views of a step need, so that threads do not compute it several
        times.
        """

    @abstractmethod
    def room(self, steps: int, together: tuple[int, int], threads: int) -> float:
        """Returns the approximate bytes used in addition to a table while it is made.

        Parameters
        ----------
        steps : number of steps of the table
        together : first and last step of the largest group that is requested together
        """

    @abstractmethod
    def advise(self, seconds: float) -> None:
        """Tells the user how to speed up coverage that has taken this long, if that is possible."""

    @abstractmethod
    def _seen(self, nodes: IntArray, steps: tuple[int, int] | None, people: bool) -> Seen:
        """Returns the faces and, if requested, people that nodes [n] see; see `seen`."""

    def seen(self, nodes: IntArray, steps: tuple[int, int] | None = None) -> SeenColumns:
        """Returns the columns that nodes [n] see; the steps of the nodes must not decrease.

        Node t S + s is state s at step t.

        Parameters
        ----------
        steps : first and last step of all nodes that are requested in parts, so that what all parts
            need is computed once (default: the steps of these nodes)
        """
        return self._columns(self._seen(nodes, steps, people=self.at_least is not None))

    def people(self, nodes: IntArray, steps: tuple[int, int] | None = None) -> SeenPeople:
        """Returns the people that nodes [n], increasing, see; see `seen`.

        A camera without solid angles sees either the whole person, 1 of 1, or nothing.
        """
        return self._seen(nodes, steps, people=True).people

    def _columns(self, seen: Seen) -> SeenColumns:
        if self.at_least is None:
            return SeenColumns(*seen.faces)
        return SeenColumns.of(seen, self.n_faces, self.at_least)

    def look(self, at: Viewpoints) -> SeenColumns:
        """Returns the columns that views [n] see; the views are given place by place."""
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
        """Number of nodes (states at steps) that take a fraction of a second."""
        return self._pinhole.batch

    def expected(self, seconds: float) -> float:
        """Returns the expected time in s of views with compiled code."""
        return self._pinhole.expected(seconds)

    def prepare(self, views: int, stop: Stop | None = None) -> None:
        """Loads the compiled code for many views if that soon saves time; if `stop` is given, also
        compiles it.
        """
        self._pinhole.prepare(views, stop)

    def prepare_more(self, seconds: float, stop: Stop) -> None:
        """Compiles or loads the code for views, if that saves time."""
        self._pinhole.prepare_more(seconds, stop)

    def make_ready(self, step: int) -> None:
        """Computes the geometry of a step, so that threads do not compute it several times."""
        self.geometry.between(step, step, self._reach)

    def room(self, steps: int, together: tuple[int, int], threads: int) -> float:
        """Returns the approximate bytes for lists of bodies that may hide somebody."""
        return self.geometry.room(steps, together, threads, self._reach)

    def advise(self, seconds: float) -> None:
        """Tells the user, once, how much of this time compiled code would have saved."""
        self._pinhole.advise(seconds)

    def _seen(self, nodes: IntArray, steps: tuple[int, int] | None, people: bool) -> Seen:
        t, state = np.divmod(nodes, self.n_states)
        look, place = np.divmod(state, self.graph.n_places)
        viewpoints, which = np.unique(t * self.graph.n_places + place, return_inverse=True)
        t, place = np.divmod(viewpoints, self.graph.n_places)
        by_place = np.argsort(which, kind="stable")
        counts = np.bincount(which, minlength=len(viewpoints))
        found = self._pinhole.seen(t, self.eyes(place), counts, look[by_place], steps, people)
        return found.take(np.argsort(by_place))

    def look(self, at: Viewpoints) -> SeenColumns:
        """Returns the columns that views [n] see; the views are given place by place."""
        people = self.at_least is not None
        return self._columns(
            self._pinhole.seen(at.steps, self.eyes(at.places), at.counts, at.looks, people=people)
        )


class ConeViews(StateViews):
    """Coverage by a `Cone`: of all faces of the actors that it detects."""

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
        """Does nothing: what all views of a step need is computed quickly."""

    def room(self, steps: int, together: tuple[int, int], threads: int) -> float:
        """Returns 0, since no bodies are listed."""
        return 0.0

    @property
    def batch(self) -> int:
        """Number of nodes (states at steps) that take a fraction of a second."""
        return max(_BATCH_FACES // max(self.n_faces, 1), 1)

    def _seen(self, nodes: IntArray, steps: tuple[int, int] | None, people: bool) -> Seen:
        """Returns the faces of all people whom nodes [n], increasing, detect, and these people."""
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
        counts = np.count_nonzero(coverage, axis=1)
        seen = SeenFaces(counts, faces, coverage[rows, faces])
        if not people:
            return Seen.nothing(len(nodes))._replace(faces=seen)
        persons, counts = np.nonzero(detected)[1], np.count_nonzero(detected, axis=1)
        ones = np.ones(len(persons))
        return Seen(seen, SeenPeople(counts, persons, ones, ones))
