"""A problem compiled for planners and formulations: robot classes, their graphs and coverage."""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from cocap_opt.data import BoolArray, FloatArray, IntArray
from cocap_opt.model.coverage_tables import SWEEPING, CoverageTables, Path, tell_nobody
from cocap_opt.model.places import Places, RobotClass
from cocap_opt.problem import Cell, Plan, Problem
from cocap_opt.stop import Limit, LimitReached, Stop, never
from cocap_opt.vision.coverage import CoverageTable, Progress
from cocap_opt.vision.views import StateViews

# s for which Ctrl-C waits at least for a plan, made with the coverage computed so far
_WAITING = 1.0


class Model:
    """A compiled problem. Coverage is computed on first use and then cached.

    Parameters
    ----------
    use_cache : True: read coverage from the disk cache, and write it there
    plain : True: compute coverage without compiled code, which then need not be trusted, and
        without the cache
    tables : coverage tables of the same problem, under any rules, to share; None: make new ones
    cut_short : the limit that ended the coverage of `tables`, and the number of covered steps

    Attributes
    ----------
    classes : the robot classes
    class_of : [R] class of each robot
    places : the places of each class's robots, and the conflicts among them
    tables : coverage for each motion and camera
    is_disaggregated : True if every robot forms its own class, even if others are alike
    cut_short_by : the limit that ended coverage early; None if coverage is complete
    """

    def __init__(
        self,
        problem: Problem,
        use_cache: bool = True,
        *,
        plain: bool = False,
        tables: CoverageTables | None = None,
        is_disaggregated: bool = False,
        cut_short: tuple[Limit, int] | None = None,
    ) -> None:
        self.problem, self.is_disaggregated = problem, is_disaggregated
        self.tables = CoverageTables(problem, use_cache, plain) if tables is None else tables
        self.classes = RobotClass.of_all(problem, is_disaggregated)
        of = {i: robot_class for robot_class in self.classes for i in robot_class.robots}
        self.class_of = tuple(of[i] for i in range(len(problem.robots)))
        self.places = Places(problem, self.classes, self.class_of)
        self.cut_short_by = cut_short and cut_short[0]
        self._known_steps = cut_short and cut_short[1]

    def under_rules_of(self, problem: Problem) -> "Model":
        """Return the model of a problem that differs only in its rules; coverage is shared."""
        return Model(problem, tables=self.tables, is_disaggregated=self.is_disaggregated)

    def disaggregated(self) -> "Model":
        """Return a model in which every robot forms its own class; coverage is shared."""
        return Model(self.problem, tables=self.tables, is_disaggregated=True)

    @property
    def n_faces(self) -> int:
        """F, over all actors."""
        return len(self.problem.face_weights)

    @property
    def class_sizes(self) -> tuple[int, ...]:
        """Number of robots of each class."""
        return tuple(len(robot_class.robots) for robot_class in self.classes)

    def starts(self, robot: int) -> IntArray:
        """Numbers of a robot's possible start states, increasing."""
        robot_class = self.class_of[robot]
        return robot_class.starts[robot_class.robots.index(robot)]

    def first_start(self, robot: int) -> int:
        """Number of a start state that obeys the rules together with the first starts of all other
        robots.
        """
        return self.class_of[robot].graph.index(self.problem.first_starts[robot])

    def views(self, robot_class: RobotClass) -> StateViews:
        """Return a new source of coverage that evaluates only the requested states."""
        return self.tables.views(robot_class.spec)

    def reachable(self, robot_class: RobotClass) -> BoolArray:
        """States [T+1, S] that some robot with this class's motion and camera can reach."""
        return self.tables.reachable(robot_class.spec)

    @property
    def reachable_views(self) -> int:
        """Number of states that robots can reach at steps that count, i.e. of all views."""
        return self._views_before(self.problem.horizon + 1)

    @property
    def covered_views(self) -> int:
        """Number of those views whose coverage is known."""
        return self._views_before(self.covered_steps)

    def _views_before(self, step: int) -> int:
        steps = slice(self.problem.first_step, step)
        return sum(int(np.count_nonzero(self.reachable(c)[steps])) for c in self.classes)

    @property
    def planning_seconds(self) -> float:
        """Approximate time in s to plan every robot once, after coverage has been computed."""
        states = sum(len(c.robots) * c.graph.n_states for c in self.classes)
        return states * (self.problem.horizon + 1) * SWEEPING

    def coverage(self, robot_class: RobotClass) -> CoverageTable:
        """Coverage of every state that the class can reach (shared by classes with the same cameras
        and motion).
        """
        return self.tables.table(robot_class.spec)

    def prepare(
        self, robot_class: RobotClass, stop: Stop = never, progress: Progress = tell_nobody
    ) -> None:
        """Compute the coverage of a class.

        Coverage that is known already, in memory or in the cache, is used even after a limit. The
        computation ends early enough to bound the missing coverage in time (`coverage_so_far`,
        `vision.ceilings`).

        Raises
        ------
        LimitReached
            If a limit is reached before coverage is complete. The coverage computed so far is kept.
        """
        self.tables.prepare(robot_class.spec, stop, progress, reserve=0.0)

    def prepare_all(self, stop: Stop = never, progress: Progress = tell_nobody) -> None:
        """Compute the coverage of all classes; raises LimitReached as `prepare` does."""
        for robot_class in self.classes:
            self.prepare(robot_class, stop, progress)

    def covered_by(self, stop: Stop, progress: Progress = tell_nobody) -> "Model":
        """Return this model with its coverage, or with as much of it as the time allows.

        It reserves time to plan every robot once, but at most half of the available time; after
        Ctrl-C, it takes as much time, or a second. In a model that is cut short, robots see nothing
        at the steps with missing coverage, except along their own paths: plans are evaluated
        correctly, but made without looking that far.
        """
        limit, before, reserve = None, stop.reached(), self.planning_seconds
        try:
            for robot_class in self.classes:
                self.tables.prepare(
                    robot_class.spec, stop, progress, min(reserve, stop.seconds_left / 2)
                )
        except LimitReached as reached:
            limit = reached.limit
        if before is None and Limit.INTERRUPT in (limit, stop.reached()):
            stop.put_off(max(reserve, _WAITING))
        if limit is None:
            return self
        known = limit, self.covered_steps
        return Model(
            self.problem, tables=self.tables.so_far(), is_disaggregated=self.is_disaggregated,
            cut_short=known,
        )  # fmt: skip

    @property
    def covered_steps(self) -> int:
        """Number of steps, from 0 on, for which the coverage of all classes is known."""
        if self._known_steps is not None:
            return self._known_steps
        return min(self.tables.steps(c.spec) for c in self.classes)

    def coverage_so_far(self, robot_class: RobotClass) -> tuple[CoverageTable, int]:
        """Returns the known coverage, and the number of steps for which it is complete."""
        spec = robot_class.spec
        return self.tables.known(spec), self.tables.steps(spec)

    def cells_with_a_view(self, t: int) -> set[Cell]:
        """Returns the cells from which some robot can see somebody at step t."""
        found: set[Cell] = set()
        for number, robot_class in enumerate(self.classes):
            n_states, n_places = robot_class.graph.n_states, robot_class.graph.n_places
            nodes = self.coverage(robot_class).nodes
            first, end = np.searchsorted(nodes, [t * n_states, (t + 1) * n_states])
            places = np.unique(nodes[first:end] % n_states % n_places)
            found |= {self.places.cells[number][place] for place in places.tolist()}
        return found

    def coverage_at(self, robot_class: RobotClass, t: int, states: IntArray) -> FloatArray:
        """Returns the coverage [n, W] of a class's states [n] at step t, like `StateViews`."""
        problem, table = self.problem, self.coverage(robot_class)
        which, entries = table.entries(t * robot_class.graph.n_states + states)
        columns = table.view_sums[entries] - (
            0 if problem.objective.over_time else t * self.n_faces
        )
        if len(problem.returns.caps):
            at = np.flatnonzero(table.view_sums[entries] >= problem.returns.n_roots)
            first = int(problem.step_view_sums[t, self.n_faces])
            columns[at] = table.view_sums[entries[at]] - first + self.n_faces
        coverage = np.zeros((len(states), problem.step_width))
        coverage[which, columns] = table.pixels[entries]
        return coverage

    def robot_pixels(self, robot: int, path: Path) -> FloatArray:
        """Returns the view sums [Z] of one robot alone, along its path of state numbers."""
        if self.cut_short_by:
            return self.evaluated_pixels(robot, path)
        robot_class = self.class_of[robot]
        table, n_states = self.coverage(robot_class), robot_class.graph.n_states
        entries = table.entries(np.arange(len(path)) * n_states + np.array(path))[1]
        pixels = self.problem.no_pixels()
        np.add.at(pixels, table.view_sums[entries], table.pixels[entries])
        return pixels

    def evaluated_pixels(self, robot: int, path: Path) -> FloatArray:
        """View sums [Z] along a path, read-only; results for the most recent paths are cached."""
        return self.tables.along(self.class_of[robot].spec, path)

    def spread(self, robot_class: RobotClass, values: FloatArray) -> FloatArray:
        """Make a reward array [T+1, S] from values at the nodes of a class's coverage table."""
        reward = robot_class.graph.no_reward(self.problem.horizon)
        reward.reshape(-1)[self.coverage(robot_class).nodes] = values
        return reward

    def largest_roots(self) -> FloatArray:
        """Largest root of one robot's pixels, by class and view sum [C, Z], px^0.5/m."""
        largest = np.zeros((len(self.classes), len(self.problem.view_sum_weights)))
        for row, robot_class in zip(largest, self.classes, strict=True):
            table = self.coverage(robot_class)
            np.maximum.at(row, table.view_sums, table.pixels)
        return np.sqrt(largest)

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


@lru_cache(maxsize=8)
def compiled(problem: Problem) -> Model:
    """Return the model of a problem, made once per process and shared by all callers.

    A model changes only by caching the coverage that it has computed, so sharing affects nothing
    but the time. A problem shares its coverage with the same problem without rules.
    """
    free = problem.without_rules()
    return Model(problem) if free is problem else compiled(free).under_rules_of(problem)


def compiled_anew(problem: Problem) -> Model:
    """Return a new model of a problem, as if none had been used before; only known coverage is
    kept.

    From now on `compiled` returns it. A method that starts with it does not benefit from earlier
    methods: neither from views that they evaluated, nor from conflicts of places or moves that they
    looked up.
    """
    used = compiled(problem)
    compiled.cache_clear()
    model = compiled(problem)
    model.tables.take(used.tables)
    return model


def share_coverage(problem: Problem, other: Problem) -> None:
    """Gives a problem the coverage of another one that differs from it only in the weights of J.

    Weights do not affect whom drones see. Coverage that either problem computes from then on is
    known to both. Nothing is shared if pixels add up over time in only one of them, or if they do
    not count the same views, as their view sums are numbered differently.
    """
    first, second = (
        (objective.over_time, objective.views and objective.views.at_least)
        for objective in (problem.objective, other.objective)
    )
    if first != second:
        return
    tables = compiled(other.without_rules()).tables
    compiled(problem.without_rules()).tables.take(tables)
