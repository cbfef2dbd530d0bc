"""A problem compiled for solvers: robot classes, their graphs and their coverage.

Robots with the same motion, camera and goal form a class: they differ only in their start,
share one graph and one coverage table, and one sweep prices them all.
"""

from collections.abc import Callable, Iterable, Sequence
from copy import copy
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from cocap_opt.data import BoolArray
from cocap_opt.graph.timegraph import TimeGraph, time_graph
from cocap_opt.problem.plan import Plan
from cocap_opt.problem.problem import AnyCamera, Cell, Motion, Problem, Robot
from cocap_opt.stop import Limit, Stop, never
from cocap_opt.vision.cache import cached_table, content_key
from cocap_opt.vision.coverage import CoverageTable, coverage_table
from cocap_opt.vision.faces import FaceGeometry
from cocap_opt.vision.views import Views, make_views

Path = tuple[int, ...]  # T+1 state numbers of one robot


@dataclass(frozen=True)
class RobotClass:
    """Robots that differ only in where they start."""

    spec: Robot  # any of them
    robots: tuple[int, ...]
    starts: tuple[int, ...]  # state number of each robot's start
    graph: TimeGraph

    @property
    def goal(self) -> tuple[int, int] | None:
        """Cell in which all of them must end."""
        return self.spec.goal


def nobody(done: int, total: int) -> None:
    """Tell nobody how far it is."""


class Model:
    """What planners and formulations share of one problem. Coverage is made when asked for.

    Attributes
    ----------
    classes : the robot classes
    class_of : [R] class of each robot
    is_apart : whether every robot is a class of its own, though others may be like it
    progress : told how many steps' coverage is there, and of how many
    """

    def __init__(self, problem: Problem, use_cache: bool = True) -> None:
        self.problem = problem
        self._use_cache = use_cache
        self._geometry = FaceGeometry(problem)
        self._tables: dict[tuple[Motion, AnyCamera], CoverageTable] = {}
        self.progress: Callable[[int, int], None] = nobody
        self.is_apart = False
        members: dict[tuple[object, ...], list[int]] = {}
        for i, robot in enumerate(problem.robots):
            members.setdefault((robot.motion, robot.camera, robot.goal), []).append(i)
        self._divide(members.values())

    def apart(self) -> "Model":
        """The same model with every robot as a class of its own; coverage is shared."""
        other = copy(self)
        other.__dict__.pop("cells", None)
        other.is_apart = True
        other._divide([i] for i in range(len(self.problem.robots)))
        return other

    def _divide(self, classes: Iterable[list[int]]) -> None:
        """Put the robots into classes."""
        self.classes = tuple(self._make_class(robots) for robots in classes)
        of = {i: robot_class for robot_class in self.classes for i in robot_class.robots}
        self.class_of = tuple(of[i] for i in range(len(self.problem.robots)))

    def _make_class(self, robots: list[int]) -> RobotClass:
        spec = self.problem.robots[robots[0]]
        graph = time_graph(self.problem.workspace, spec.motion, len(spec.camera.tilts))
        starts = tuple(graph.index(self.problem.robots[i].start) for i in robots)
        return RobotClass(spec, tuple(robots), starts, graph)

    @property
    def n_faces(self) -> int:
        """F, over all actors."""
        return len(self.problem.face_weights)

    @property
    def class_sizes(self) -> tuple[int, ...]:
        """How many robots each class has."""
        return tuple(len(robot_class.robots) for robot_class in self.classes)

    @cached_property
    def cells(self) -> tuple[tuple[Cell, ...], ...]:
        """Cell of every place of every class; border places lie outside the map."""
        return tuple(_cells(self.problem, robot_class) for robot_class in self.classes)

    def start(self, robot: int) -> int:
        """State number of a robot's start."""
        return self.class_of[robot].graph.index(self.problem.robots[robot].start)

    def views(self, robot_class: RobotClass) -> Views:
        """A fresh source of coverage that evaluates only what it is asked for."""
        return make_views(self._geometry, self.problem, robot_class.graph, robot_class.spec.camera)

    def reachable(self, robot_class: RobotClass) -> BoolArray:
        """States [T+1, S] that some robot with this class's motion and camera can reach."""
        alike = self._alike(robot_class)
        starts = [start for other in alike for start in other.starts]
        return robot_class.graph.reachable(starts, self.problem.horizon)

    def _alike(self, robot_class: RobotClass) -> list[RobotClass]:
        return [other for other in self.classes if _sight(other) == _sight(robot_class)]

    def coverage(self, robot_class: RobotClass) -> CoverageTable:
        """Coverage of every state that the class can reach (shared by classes that see alike)."""
        self.prepare(robot_class, never)
        return self._tables[_sight(robot_class)]

    def prepare(self, robot_class: RobotClass, stop: Stop) -> Limit:
        """Compute the coverage of a class, unless a limit is reached before it is whole.

        Coverage that is there already, in memory or in the cache, is taken at any time.
        """
        problem, sight, limit = self.problem, _sight(robot_class), Limit.NONE
        if sight in self._tables:
            return limit

        def make() -> CoverageTable | None:
            nonlocal limit
            table, limit = coverage_table(
                self.views(robot_class),
                robot_class.graph.n_places,
                self.reachable(robot_class),
                problem.first_step,
                stop,
                self.progress,
            )
            return table

        if self._use_cache:
            starts = sorted(start for other in self._alike(robot_class) for start in other.starts)
            poses = [actor.poses[: problem.horizon + 1] for actor in problem.actors]
            shapes = [actor.shape for actor in problem.actors]
            key = content_key(
                problem.workspace, *sight, starts, problem.horizon, problem.face_samples,
                problem.first_step, poses, shapes,
            )  # fmt: skip
            table = cached_table(key, make)
        else:
            table = make()
        if table is not None and problem.objective.over_time:
            table = table._replace(view_sums=table.view_sums % max(self.n_faces, 1))
        if table is not None:
            self._tables[sight] = table
        return limit

    def prepare_all(self, stop: Stop) -> Limit:
        """Compute the coverage of all classes, unless a limit is reached."""
        limits = (self.prepare(robot_class, stop) for robot_class in self.classes)
        return next((limit for limit in limits if limit is not Limit.NONE), Limit.NONE)

    def plan(self, paths: Sequence[Path]) -> Plan:
        """Plan made of one path of state numbers per robot."""
        graphs = (robot_class.graph for robot_class in self.class_of)
        return Plan(
            paths=tuple(
                tuple(graph.state(s) for s in path)
                for graph, path in zip(graphs, paths, strict=True)
            )
        )

    def paths(self, plan: Plan) -> tuple[Path, ...]:
        """State numbers of a plan's paths."""
        graphs = (robot_class.graph for robot_class in self.class_of)
        return tuple(
            tuple(graph.index(state) for state in path)
            for graph, path in zip(graphs, plan.paths, strict=True)
        )


def _cells(problem: Problem, robot_class: RobotClass) -> tuple[Cell, ...]:
    layer, x, y = robot_class.graph.coordinates(np.arange(robot_class.graph.n_places)).tolist()
    own = [problem.layers.index(height) for height in robot_class.spec.motion.layers]
    inside = [own[k] if 0 <= k < len(own) else -1 for k in layer]
    return tuple(Cell(*at) for at in zip(x, y, inside, strict=True))


def _sight(robot_class: RobotClass) -> tuple[Motion, AnyCamera]:
    """What the coverage of a class depends on, besides its starts."""
    return robot_class.spec.motion, robot_class.spec.camera


@lru_cache(maxsize=8)
def compiled(problem: Problem) -> Model:
    """The model of a problem, made once per process."""
    return Model(problem)


@lru_cache(maxsize=8)
def compiled_apart(problem: Problem) -> Model:
    """The same, with every robot as a class of its own."""
    return compiled(problem).apart()
