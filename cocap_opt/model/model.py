"""A problem compiled for planners and formulations: robot classes, their graphs and coverage.

Robots with the same motion, camera and goal form a robot class: they differ only in where they
start, share one graph and one coverage table, and one sweep prices them all.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import pairwise

import numpy as np

from cocap_opt.data import BoolArray, FloatArray, IntArray
from cocap_opt.graph.timegraph import TimeGraph
from cocap_opt.model.coverage_estimate import CoverageEstimate
from cocap_opt.model.coverage_tables import (
    SWEEPING,
    CoverageTables,
    Path,
    Sight,
    graph_of,
    tell_nobody,
)
from cocap_opt.problem import Cell, Plan, Problem, Robot
from cocap_opt.problem.rules import Meeting
from cocap_opt.stop import Limit, LimitReached, Stop, never
from cocap_opt.vision.coverage import CoverageTable, Progress
from cocap_opt.vision.views import Views

_WAITING = 1.0  # s that Ctrl-C waits for a plan at least, with the coverage that is there
_KEPT = 20_000  # cells and moves for which the places and moves that conflict are kept
_KEPT_PATHS = 500  # for which cells, the places and moves that conflict are kept


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

    @property
    def sight(self) -> Sight:
        """Motion and camera, on which the coverage of the class depends besides its starts."""
        return self.spec.motion, self.spec.camera


class Model:
    """A compiled problem. Coverage is computed when it is first asked for, and then kept.

    Parameters
    ----------
    use_cache : take coverage from the disk cache, and write it there

    Attributes
    ----------
    classes : the robot classes
    class_of : [R] class of each robot
    is_disaggregated : every robot is a class of its own, though others may be like it
    cut_short_by : the limit that ended the coverage early; None where it is whole
    """

    cut_short_by: Limit | None = None
    _known_steps: int | None = None  # of a model that is cut short

    def __init__(self, problem: Problem, use_cache: bool = True) -> None:
        self._divide(problem, CoverageTables(problem, use_cache), is_disaggregated=False)

    def under_rules_of(self, problem: Problem) -> "Model":
        """Return the model of a problem that differs in its rules only; coverage is shared."""
        other = object.__new__(Model)
        other._divide(problem, self._coverage, self.is_disaggregated)
        return other

    def disaggregated(self) -> "Model":
        """Return a model in which every robot is a class of its own; coverage is shared."""
        other = object.__new__(Model)
        other._divide(self.problem, self._coverage, is_disaggregated=True)
        return other

    def _divide(self, problem: Problem, coverage: "CoverageTables", is_disaggregated: bool) -> None:
        """Put the robots into classes."""
        self.problem, self._coverage = problem, coverage
        self.is_disaggregated = is_disaggregated
        members: dict[tuple[object, ...], list[int]] = {}
        for i, robot in enumerate(problem.robots):
            own = (i,) if is_disaggregated else (robot.motion, robot.camera, robot.goal)
            members.setdefault(own, []).append(i)
        self.classes = tuple(self._make_class(robots) for robots in members.values())
        of = {i: robot_class for robot_class in self.classes for i in robot_class.robots}
        self.class_of = tuple(of[i] for i in range(len(problem.robots)))

    def _make_class(self, robots: list[int]) -> RobotClass:
        spec = self.problem.robots[robots[0]]
        graph = graph_of(self.problem, spec)
        starts = tuple(graph.index(self.problem.robots[i].start) for i in robots)
        return RobotClass(spec, tuple(robots), starts, graph)

    @property
    def n_faces(self) -> int:
        """F, over all actors."""
        return len(self.problem.face_weights)

    @property
    def class_sizes(self) -> tuple[int, ...]:
        """Number of robots of each class."""
        return tuple(len(robot_class.robots) for robot_class in self.classes)

    @cached_property
    def cells(self) -> tuple[tuple[Cell, ...], ...]:
        """Cell of every place of every class; those of the border have layer -1."""
        return tuple(_cells(self.problem, robot_class) for robot_class in self.classes)

    def place_of(self, robot_class: RobotClass, cell: Cell) -> int | None:
        """Returns the number of a cell among a class's places; None where it never flies."""
        layers, height = robot_class.spec.motion.layers, self.problem.layers[cell.layer]
        if height not in layers or not robot_class.graph.window.covers(cell.x, cell.y):
            return None
        place = robot_class.graph.place(layers.index(height), cell.x, cell.y)
        return place if robot_class.graph.free[place] else None

    def cells_along(self, robot: int, path: Path) -> tuple[Cell, ...]:
        """Returns the cells of a robot's path of state numbers, step by step."""
        return self._cells_along(robot, path)

    def path_too_close(
        self, robot_class: RobotClass, cells: tuple[Cell, ...]
    ) -> tuple[IntArray, IntArray]:
        """Returns what conflicts with a robot that is in these cells at the steps 0..T.

        Returns
        -------
        Places of the class as (t, place) [n, 2], and its moves as (t, tail, head) [m, 3].
        """
        return self._path_too_close(self.classes.index(robot_class), cells)

    def moves_through(
        self, robot_class: RobotClass, meeting: Meeting, move: tuple[Cell, Cell]
    ) -> tuple[IntArray, FloatArray]:
        """Returns the moves of a class that pass nearer to a point than half the separation.

        Parameters
        ----------
        move : one of the two that meet there

        Returns
        -------
        tails and heads [n, 2], and the distances [n] (m)
        """
        (x, y, _), (u, v, _) = move
        moves = robot_class.graph.moves_past((x, y), (u, v), self.problem.cells_apart)
        tails, heads = (self.where(robot_class, places) for places in moves)
        ways = meeting.ways(tails, heads)
        near = self.problem.rules.near_point(ways)
        return np.column_stack(moves)[near], np.linalg.norm(ways[near], axis=1)

    @cached_property
    def positions(self) -> tuple[FloatArray, ...]:
        """Where robots are in every place [P, 3] of every class, in m from the map's corner.

        The border's places are nan.
        """
        return tuple(_positions(self.problem, robot_class) for robot_class in self.classes)

    def where(self, robot_class: RobotClass, places: IntArray) -> FloatArray:
        """Returns where robots of a class are in places [..], as [.., 3] in m, like `positions`."""
        return self.positions[self.classes.index(robot_class)][places]

    @cached_property
    def _places_too_close(self) -> Callable[[int, Cell], IntArray]:
        """Finds the places [n] of a class that conflict with a robot in a cell at one step."""

        @lru_cache(_KEPT)
        def near(number: int, cell: Cell) -> IntArray:
            rules, graph = self.problem.rules, self.classes[number].graph
            places = graph.places_around(cell.x, cell.y, self.problem.cells_apart)
            ways = self.positions[number][places] - self.problem.positions([cell])
            return places[rules.too_near(ways)]

        return near

    @cached_property
    def _moves_too_close(self) -> Callable[[int, tuple[Cell, Cell]], IntArray]:
        """Finds the moves [n, 2] of a class, tails and heads, that conflict with a robot's move.

        They do so between two steps, at neither of which there is a conflict.
        """

        @lru_cache(_KEPT)
        def near(number: int, move: tuple[Cell, Cell]) -> IntArray:
            rules, graph = self.problem.rules, self.classes[number].graph
            (x, y, _), (u, v, _) = move
            tails, heads = (
                graph.moves_past((x, y), (u, v), self.problem.cells_apart)
                if rules.separation
                else graph.moves_between((u, v), (x, y))  # only these may swap places with it
            )
            here, there = self.problem.positions(move)
            own = self.positions[number][tails], self.positions[number][heads]
            between = rules.conflict_between((here, there), own)
            return np.column_stack([tails, heads])[between]

        return near

    @cached_property
    def _cells_along(self) -> Callable[[int, Path], tuple[Cell, ...]]:
        @lru_cache(_KEPT_PATHS)
        def cells(robot: int, path: Path) -> tuple[Cell, ...]:
            robot_class = self.class_of[robot]
            places = np.array(path, dtype=np.int64) % robot_class.graph.n_places
            layer, x, y = robot_class.graph.coordinates(places)
            layer = _layers(self.problem, robot_class)[layer]
            return tuple(map(Cell, x.tolist(), y.tolist(), layer.tolist()))

        return cells

    @cached_property
    def _path_too_close(self) -> Callable[[int, tuple[Cell, ...]], tuple[IntArray, IntArray]]:
        @lru_cache(_KEPT_PATHS)
        def near(number: int, cells: tuple[Cell, ...]) -> tuple[IntArray, IntArray]:
            places = [self._places_too_close(number, cell) for cell in cells]
            moves = [self._moves_too_close(number, move) for move in pairwise(cells)]
            return _at_steps([some[:, None] for some in places], 1), _at_steps(moves, 2)

        return near

    def conflict_matrix(
        self, classes: tuple[RobotClass, RobotClass], places: tuple[IntArray, IntArray]
    ) -> BoolArray:
        """Returns which places [n, m] of two robots' classes conflict at the same step.

        Parameters
        ----------
        places : [n] and [m] place numbers
        """
        one, other = map(self.where, classes, places)
        return self.problem.rules.too_near(other[None] - one[:, None])

    def start(self, robot: int) -> int:
        """State number of a robot's start."""
        return self.class_of[robot].graph.index(self.problem.robots[robot].start)

    def views(self, robot_class: RobotClass) -> Views:
        """Return a fresh source of coverage that evaluates only the states it is asked for."""
        return self._coverage.views(robot_class.spec)

    def reachable(self, robot_class: RobotClass) -> BoolArray:
        """States [T+1, S] that some robot with this class's motion and camera can reach."""
        return self._coverage.reachable(robot_class.spec)

    def require_memory(self, robot_class: RobotClass) -> None:
        """Refuse coverage and sweeps of a class that are larger than the memory."""
        self._coverage.require_memory(robot_class.spec)

    @property
    def reachable_views(self) -> int:
        """Number of states at steps that count that robots can reach: of all views there are."""
        return self._views_before(self.problem.horizon + 1)

    @property
    def covered_views(self) -> int:
        """Number of those whose coverage is there."""
        return self._views_before(self.covered_steps)

    def _views_before(self, step: int) -> int:
        steps = slice(self.problem.first_step, step)
        return sum(int(np.count_nonzero(self.reachable(c)[steps])) for c in self.classes)

    def coverage_estimate(self) -> CoverageEstimate:
        """Estimate what coverage that is neither in memory nor in the cache will cost.

        A sample of it is computed, which takes a second or less, and changes no number.

        Raises
        ------
        ProblemError
            If coverage and sweeps are certainly larger than the memory.
        """
        return self._coverage.estimate()

    @property
    def planning_seconds(self) -> float:
        """Seconds, about, in which every robot is planned once, when its coverage is there."""
        states = sum(len(c.robots) * c.graph.n_states for c in self.classes)
        return states * (self.problem.horizon + 1) * SWEEPING

    def coverage(self, robot_class: RobotClass) -> CoverageTable:
        """Coverage of every state that the class can reach (shared by classes that see alike)."""
        return self._coverage.table(robot_class.spec)

    def prepare(
        self, robot_class: RobotClass, stop: Stop = never, progress: Progress = tell_nobody
    ) -> None:
        """Compute the coverage of a class.

        Coverage that is there already, in memory or in the cache, is taken at any time. It ends
        early enough to bound in time what it leaves open (`coverage_so_far`, `vision.ceilings`).

        Raises
        ------
        LimitReached
            If a limit is reached before the coverage is whole. What is there is kept.
        """
        self._coverage.prepare(robot_class.spec, stop, progress, reserve=0.0)

    def prepare_all(self, stop: Stop = never, progress: Progress = tell_nobody) -> None:
        """Compute the coverage of all classes; raises LimitReached as `prepare` does."""
        for robot_class in self.classes:
            self.prepare(robot_class, stop, progress)

    def covered_by(self, stop: Stop, progress: Progress = tell_nobody) -> "Model":
        """Return this model with its coverage, or with as much of it as there is time for.

        Time is kept for planning every robot once, but no more than half of what there is; Ctrl-C
        waits as long, or a second. In a model that is cut short, robots see nothing at the steps
        whose coverage is missing, but along their own paths: plans are judged right, but made
        without looking that far.
        """
        limit, before, reserve = None, stop.reached(), self.planning_seconds
        try:
            for robot_class in self.classes:
                self._coverage.prepare(
                    robot_class.spec, stop, progress, min(reserve, stop.seconds_left / 2)
                )
        except LimitReached as reached:
            limit = reached.limit
        if before is None and Limit.INTERRUPT in (limit, stop.reached()):
            stop.put_off(max(reserve, _WAITING))
        if limit is None:
            return self
        part = object.__new__(Model)
        part._divide(self.problem, self._coverage.so_far(), self.is_disaggregated)
        part.cut_short_by, part._known_steps = limit, self.covered_steps
        return part

    @property
    def covered_steps(self) -> int:
        """Number of steps, from 0 on, at which the coverage of all classes is there."""
        if self._known_steps is not None:
            return self._known_steps
        return min(self._coverage.steps(c.spec) for c in self.classes)

    @property
    def coverage_seconds(self) -> float:
        """Wall-clock seconds that were spent on coverage since the problem was compiled."""
        return self._coverage.seconds

    @property
    def coverage_cost(self) -> float | None:
        """Seconds in which the coverage of all classes was computed; None where it is not whole.

        Coverage that comes from the disk cache costs what it took whoever computed it, so a cold
        cache and a warm one give the same number, but for what the clock does.
        """
        return self._coverage.cost

    def coverage_so_far(self, robot_class: RobotClass) -> tuple[CoverageTable, int]:
        """Returns the coverage that is there, and the number of steps that it is whole for."""
        spec = robot_class.spec
        return self._coverage.known(spec), self._coverage.steps(spec)

    def cells_with_a_view(self, t: int) -> set[Cell]:
        """Returns the cells from which some robot can see somebody at step t."""
        found: set[Cell] = set()
        for number, robot_class in enumerate(self.classes):
            n_states, n_places = robot_class.graph.n_states, robot_class.graph.n_places
            nodes = self.coverage(robot_class).nodes
            first, end = np.searchsorted(nodes, [t * n_states, (t + 1) * n_states])
            places = np.unique(nodes[first:end] % n_states % n_places)
            found |= {self.cells[number][place] for place in places.tolist()}
        return found

    def coverage_at(self, robot_class: RobotClass, t: int, states: IntArray) -> FloatArray:
        """Returns the coverage [n, F] of a class's states [n] at step t in px/m2."""
        table, coverage = self.coverage(robot_class), np.zeros((len(states), self.n_faces))
        which, entries = table.entries(t * robot_class.graph.n_states + states)
        coverage[which, table.view_sums[entries] - t * self.n_faces] = table.pixels[entries]
        return coverage

    def robot_pixels(self, robot: int, path: Path) -> FloatArray:
        """View sums [Z] that one robot has alone, along its path of state numbers."""
        if self.cut_short_by:
            return self.evaluated_pixels(robot, path)
        robot_class = self.class_of[robot]
        table, n_states = self.coverage(robot_class), robot_class.graph.n_states
        entries = table.entries(np.arange(len(path)) * n_states + np.array(path))[1]
        pixels = self.problem.no_pixels()
        np.add.at(pixels, table.view_sums[entries], table.pixels[entries])
        return pixels

    def evaluated_pixels(self, robot: int, path: Path) -> FloatArray:
        """View sums [Z] along a path, read-only; the last paths are kept."""
        return self._coverage.along(self.class_of[robot].spec, path)

    def spread(self, robot_class: RobotClass, values: FloatArray) -> FloatArray:
        """Make a reward array [T+1, S] of the values at the nodes of a class's coverage table."""
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


def _at_steps(what: list[IntArray], width: int) -> IntArray:
    """Returns rows [n_t, width] of the steps t = 0.. as one array [n, 1 + width], t before each."""
    steps = np.repeat(np.arange(len(what)), [len(some) for some in what])
    return np.column_stack([steps, np.concatenate([np.empty((0, width), np.int64), *what])])


def _layers(problem: Problem, robot_class: RobotClass) -> IntArray:
    """Returns the number among all layers of the problem of each layer of a class."""
    return np.array([problem.layers.index(height) for height in robot_class.spec.motion.layers])


def _cells(problem: Problem, robot_class: RobotClass) -> tuple[Cell, ...]:
    graph = robot_class.graph
    layer, x, y = graph.coordinates(np.arange(graph.n_places))
    own = _layers(problem, robot_class)
    layers, inside = np.full(graph.n_places, -1), _inside(graph)
    layers[inside] = own[layer[inside]]
    return tuple(map(Cell, x.tolist(), y.tolist(), layers.tolist()))


def _positions(problem: Problem, robot_class: RobotClass) -> FloatArray:
    graph, height_map = robot_class.graph, problem.height_map
    layer, x, y = graph.coordinates(np.arange(graph.n_places))
    altitudes, inside = height_map.altitudes(robot_class.spec.motion.layers), _inside(graph)
    found = np.full((graph.n_places, 3), np.nan)
    layer, x, y = layer[inside], x[inside], y[inside]
    size = height_map.resolution
    found[inside] = np.column_stack([x * size, y * size, altitudes[layer, x, y]])
    return found


def _inside(graph: TimeGraph) -> IntArray:
    """Return the places [n] of a graph that are not of its border."""
    return graph.without_border(np.arange(graph.n_places)).ravel()


@lru_cache(maxsize=8)
def compiled(problem: Problem) -> Model:
    """Return the model of a problem, made once per process and shared by all that ask for it.

    A model changes only by keeping the coverage that it has computed, so sharing shows nowhere
    but in the time it takes. A problem shares its coverage with the same one without rules.
    """
    free = problem.without_rules()
    return Model(problem) if free is problem else compiled(free).under_rules_of(problem)


def compiled_anew(problem: Problem) -> Model:
    """Return the model of a problem as if nobody had used it yet; only its coverage stays known.

    From now on `compiled` returns it. A method that begins with it owes nothing to those that ran
    before: no view that they evaluated, no place or move whose conflicts they looked up.
    """
    used = compiled(problem)
    compiled.cache_clear()
    model = compiled(problem)
    model._coverage.take(used._coverage)
    return model
