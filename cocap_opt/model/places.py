"""Robot classes, the places of their robots, and the conflicts among places.

Robots with the same motion, camera and goal form a robot class: they differ only in their starts,
share one graph and one coverage table, and one sweep prices them all.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from itertools import pairwise

import numpy as np

from cocap_opt.data import BoolArray, FloatArray, IntArray
from cocap_opt.graph.timegraph import TimeGraph
from cocap_opt.model.coverage_tables import Path, Sight, graph_of
from cocap_opt.problem import AnyGoal, Cell, Problem, Robot, StartSet
from cocap_opt.problem.rules import Meeting

_KEPT = 20_000  # cells and moves for which conflicting places and moves are cached
_KEPT_PATHS = 500  # paths, as cells, for which conflicting places and moves are cached


@dataclass(frozen=True)
class RobotClass:
    """Robots that differ only in their starts."""

    number: int  # position among the classes of the model
    spec: Robot  # any of these robots
    robots: tuple[int, ...]
    # Numbers of each robot's possible start states, increasing.
    starts: tuple[IntArray, ...] = field(compare=False)
    graph: TimeGraph

    @property
    def goal(self) -> AnyGoal | None:
        """Cell in which all of these robots must end, or several cells, one of which each must
        reach.
        """
        return self.spec.goal

    @property
    def sight(self) -> Sight:
        """Motion and camera, which together with the starts determine the coverage of the class."""
        return self.spec.motion, self.spec.camera

    @cached_property
    def start_sets(self) -> list[tuple[IntArray, list[int]]]:
        """The distinct sets of starts, each with the robots that have it.

        Robots of one class with different starts are not interchangeable at the start: if a bound
        let them exchange their starts, it would be too high.
        """
        found: dict[bytes, tuple[IntArray, list[int]]] = {}
        for robot, starts in zip(self.robots, self.starts, strict=True):
            found.setdefault(starts.tobytes(), (starts, []))[1].append(robot)
        return list(found.values())

    @cached_property
    def all_starts(self) -> IntArray:
        """Numbers of the states in which some robot may start, increasing."""
        return np.unique(np.concatenate(self.starts))

    @classmethod
    def of_all(cls, problem: Problem, is_disaggregated: bool) -> "tuple[RobotClass, ...]":
        """Returns the classes of all robots of a problem.

        Parameters
        ----------
        is_disaggregated : True: every robot forms its own class, even if others are alike
        """
        members: dict[tuple[object, ...], list[int]] = {}
        for i, robot in enumerate(problem.robots):
            alike = (i,) if is_disaggregated else (robot.motion, robot.camera, robot.goal)
            members.setdefault(alike, []).append(i)
        classes = []
        for number, robots in enumerate(members.values()):
            spec = problem.robots[robots[0]]
            graph = graph_of(problem, spec)
            starts = tuple(_numbers(graph, problem.starts[i]) for i in robots)
            classes.append(cls(number, spec, tuple(robots), starts, graph))
        return tuple(classes)


class Places:
    """The places of each robot class, and the conflicts among them under the problem's rules.

    Tables are computed on first use and then cached.
    """

    def __init__(
        self, problem: Problem, classes: Sequence[RobotClass], class_of: Sequence[RobotClass]
    ) -> None:
        self._problem, self._classes, self._class_of = problem, tuple(classes), class_of
        self.cells_along = lru_cache(_KEPT_PATHS)(self._cells_along)
        self._near_path = lru_cache(_KEPT_PATHS)(self._path_too_close)
        self._near_cell = lru_cache(_KEPT)(self._places_too_close)
        self._near_move = lru_cache(_KEPT)(self._moves_too_close)

    @cached_property
    def cells(self) -> tuple[tuple[Cell, ...], ...]:
        """Cell of every place of every class; places on the border have layer -1."""
        return tuple(_cells(self._problem, robot_class) for robot_class in self._classes)

    def place_of(self, robot_class: RobotClass, cell: Cell) -> int | None:
        """Returns the number of a cell among a class's places; None if the class never flies
        there.
        """
        layers, height = robot_class.spec.motion.layers, self._problem.layers[cell.layer]
        if height not in layers or not robot_class.graph.window.covers(cell.x, cell.y):
            return None
        place = robot_class.graph.place(layers.index(height), cell.x, cell.y)
        return place if robot_class.graph.free[place] else None

    def _cells_along(self, robot: int, path: Path) -> tuple[Cell, ...]:
        """Returns the cells of a robot's path of state numbers, step by step."""
        robot_class = self._class_of[robot]
        places = np.array(path, dtype=np.int64) % robot_class.graph.n_places
        layer, x, y = robot_class.graph.coordinates(places)
        layer = _layers(self._problem, robot_class)[layer]
        return tuple(map(Cell, x.tolist(), y.tolist(), layer.tolist()))

    def path_too_close(
        self, robot_class: RobotClass, cells: tuple[Cell, ...]
    ) -> tuple[IntArray, IntArray]:
        """Returns the places and moves that conflict with a robot in these cells at steps 0..T.

        Returns
        -------
        Places of the class as (t, place) [n, 2], and its moves as (t, tail, head) [m, 3].
        """
        return self._near_path(robot_class.number, cells)

    def _path_too_close(self, number: int, cells: tuple[Cell, ...]) -> tuple[IntArray, IntArray]:
        places = [self._near_cell(number, cell)[:, None] for cell in cells]
        moves = [self._near_move(number, move) for move in pairwise(cells)]
        return _at_steps(places, 1), _at_steps(moves, 2)

    def moves_through(
        self, robot_class: RobotClass, meeting: Meeting, move: tuple[Cell, Cell]
    ) -> tuple[IntArray, FloatArray]:
        """Returns the moves of a class that pass closer to a point than half the separation.

        Parameters
        ----------
        move : one of the two moves that meet there

        Returns
        -------
        tails and heads [n, 2], and the distances [n] (m)
        """
        (x, y, _), (u, v, _) = move
        moves = robot_class.graph.moves_past((x, y), (u, v), self._problem.cells_apart)
        tails, heads = (self.where(robot_class, places) for places in moves)
        ways = meeting.ways(tails, heads)
        near = self._problem.rules.near_point(ways)
        return np.column_stack(moves)[near], np.linalg.norm(ways[near], axis=1)

    @cached_property
    def positions(self) -> tuple[FloatArray, ...]:
        """The positions [P, 3] of every class's places, in m from the map's corner.

        The border's places are nan.
        """
        return tuple(_positions(self._problem, robot_class) for robot_class in self._classes)

    def where(self, robot_class: RobotClass, places: IntArray) -> FloatArray:
        """Returns the positions of robots of a class in places [..], as [.., 3] in m, like
        `positions`.
        """
        return self.positions[robot_class.number][places]

    def _places_too_close(self, number: int, cell: Cell) -> IntArray:
        """Returns the places [n] of a class that conflict with a robot in a cell at one step."""
        rules, graph = self._problem.rules, self._classes[number].graph
        places = graph.places_around(cell.x, cell.y, self._problem.cells_apart)
        ways = self.positions[number][places] - self._problem.positions([cell])
        return places[rules.too_near(ways)]

    def _moves_too_close(self, number: int, move: tuple[Cell, Cell]) -> IntArray:
        """Returns the moves [n, 2] of a class, tails and heads, that conflict with a robot's move.

        The conflict occurs between two steps, and at neither of them.
        """
        rules, graph = self._problem.rules, self._classes[number].graph
        (x, y, _), (u, v, _) = move
        tails, heads = (
            graph.moves_past((x, y), (u, v), self._problem.cells_apart)
            if rules.separation
            else graph.moves_between((u, v), (x, y))  # only these moves may swap places with it
        )
        here, there = self._problem.positions(move)
        theirs = self.positions[number][tails], self.positions[number][heads]
        return np.column_stack([tails, heads])[rules.conflict_between((here, there), theirs)]

    def conflict_matrix(
        self, classes: tuple[RobotClass, RobotClass], places: tuple[IntArray, IntArray]
    ) -> BoolArray:
        """Returns True for places [n, m] of two robots' classes that conflict at the same step.

        Parameters
        ----------
        places : [n] and [m] place numbers
        """
        first, second = map(self.where, classes, places)
        return self._problem.rules.too_near(second[None] - first[:, None])


def _numbers(graph: TimeGraph, states: StartSet) -> IntArray:
    """Returns the numbers of states, increasing."""
    return np.sort(graph.indices(states.array))


def _at_steps(what: list[IntArray], width: int) -> IntArray:
    """Returns rows [n_t, width] of steps t = 0.. as one array [n, 1 + width], with t before each
    row.
    """
    steps = np.repeat(np.arange(len(what)), list(map(len, what)))
    return np.column_stack([steps, np.concatenate([np.empty((0, width), np.int64), *what])])


def _layers(problem: Problem, robot_class: RobotClass) -> IntArray:
    """Returns the number among all layers of the problem of each layer of a class."""
    return np.array([problem.layers.index(height) for height in robot_class.spec.motion.layers])


def _cells(problem: Problem, robot_class: RobotClass) -> tuple[Cell, ...]:
    graph = robot_class.graph
    layer, x, y = graph.coordinates(np.arange(graph.n_places))
    numbers = _layers(problem, robot_class)
    layers, inside = np.full(graph.n_places, -1), _inside(graph)
    layers[inside] = numbers[layer[inside]]
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
    """Return the places [n] of a graph that are not on its border."""
    return graph.without_border(np.arange(graph.n_places)).ravel()
