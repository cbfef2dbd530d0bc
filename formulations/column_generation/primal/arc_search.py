"""Large neighbourhood search over known arcs: improves plans of many robots.

Each move removes some robots with overlapping views from the plan, reinserts them in random order
by best responses over the arcs of all known columns, and lets them and their neighbours respond to
each other until none gains. The new plan is accepted if it is no worse (Shaw 1998; ruin and
recreate: Schrimpf et al. 2000). A move takes some hundredths of a second: the arcs of the columns
found by pricing are some thousands of the millions that a class has (`coordination.kept_graph`).
"""

from collections.abc import Callable, Iterable, Sequence
from itertools import pairwise

import numpy as np

from cocap_opt.coordination.kept_graph import Charged, KeptGraph, Layer
from cocap_opt.data import FloatArray, IntArray
from cocap_opt.formulations.column_generation.parameters import LargeRootParameters
from cocap_opt.formulations.column_generation.primal.incumbent import Incumbent
from cocap_opt.graph.move_rewards import Bonuses
from cocap_opt.mixtures.columns import Column
from cocap_opt.model import Model, Path, RobotClass
from cocap_opt.objective import marginal_gain
from cocap_opt.stop import Stop

_GAIN = 1e-9  # relative; smaller gains do not count


class ArcSearch:
    """A plan that is improved over the arcs of some columns and its own columns.

    Parameters
    ----------
    columns : columns of any robots, whose arcs may be used
    tell : called between two moves to report that the search continues

    Attributes
    ----------
    columns : columns of the plan, robot by robot
    """

    def __init__(
        self,
        model: Model,
        plan: Incumbent,
        columns: Iterable[Column],
        stop: Stop,
        tell: Callable[[], None],
        parameters: LargeRootParameters,
    ) -> None:
        self._parameters = parameters
        self._model, self._stop, self._tell = model, stop, tell
        self._weights = model.problem.view_sum_weights
        by_class: list[list[Column]] = [[] for _ in model.classes]
        for column in (*columns, *plan.columns):
            by_class[column.along.class_number].append(column)
        self._graphs = [
            _ArcGraph(model, robot_class, known)
            for robot_class, known in zip(model.classes, by_class, strict=True)
        ]
        self._seen = model.problem.no_pixels()
        self.columns = [*plan.columns]
        for column in plan.columns:
            self._put(column)

    def plan(self) -> Incumbent | None:
        """Returns the current plan; None if it breaks a rule."""
        return Incumbent.of(self._model, self.columns)

    def search(self, moves: int, rng: np.random.Generator) -> None:
        """Makes a number of moves; raises LimitReached between two of them."""
        for _ in range(moves):
            self._tell()
            self._stop.check()
            self._move(rng)

    def _move(self, rng: np.random.Generator) -> None:
        """Makes one move, and undoes it if it makes the plan worse."""
        robots = len(self.columns)
        if robots < 2:
            return
        first = int(rng.integers(robots))
        overlaps = self._overlaps(first)
        chances = overlaps + 1e-9 * (np.arange(robots) != first)
        count = min(int(rng.integers(1, self._parameters.most_others + 1)), robots - 1)
        others = rng.choice(robots, count, replace=False, p=chances / chances.sum()).tolist()
        near = np.argsort(-overlaps, kind="stable")[: self._parameters.neighbours].tolist()
        before, value = [*self.columns], self._value()
        if self._put_back(rng.permutation([first, *others]).tolist()):
            self._answer(list(dict.fromkeys([first, *others, *near])))
            if self._value() >= value:
                return
        for robot, column in enumerate(before):
            if self.columns[robot] is not column:
                self._replace(robot, column)

    def _put_back(self, robots: list[int]) -> bool:
        """Replans robots one after the other; returns False if one of them has no path left.

        Robots that are not replanned then keep their columns.
        """
        for robot in robots:
            self._take(self.columns[robot])
        for done, robot in enumerate(robots):
            path = self._best_path(robot)
            if path is None:
                for rest in robots[done:]:
                    self._put(self.columns[rest])
                return False
            self.columns[robot] = Column.of(self._model, robot, path)
            self._put(self.columns[robot])
        return True

    def _answer(self, robots: list[int]) -> None:
        """Lets the given robots make best responses in turn until none gains."""
        quiet = turn = 0
        while quiet < len(robots) and turn < self._parameters.most_turns * len(robots):
            quiet = 0 if self._responds(robots[turn % len(robots)]) else quiet + 1
            turn += 1

    def _responds(self, robot: int) -> bool:
        """Replaces a robot's path by its best response; returns True if it gains."""
        before = self.columns[robot]
        self._take(before)
        path = self._best_path(robot)
        best = before if path in (None, before.path) else Column.of(self._model, robot, path)
        if self._gain(best) <= self._gain(before) * (1 + _GAIN):
            best = before
        self.columns[robot] = best
        self._put(best)
        return best is not before

    def _best_path(self, robot: int) -> Path | None:
        """Returns a robot's best path over the arcs, given the columns of all other robots."""
        graph = self._graphs[self.columns[robot].along.class_number]
        return graph.best_path(self._model.starts(robot), self._seen)

    def _gain(self, column: Column) -> float:
        """Returns the gain of a column, given the pixels that the others see."""
        seen, problem = self._seen[column.view_sums], self._model.problem
        gains = marginal_gain(problem, column.view_sums, seen, column.pixels)
        return float(gains @ self._weights[column.view_sums]) + column.bonus(self._model)

    def _value(self) -> float:
        """Returns J of the current plan."""
        values = self._model.problem.returns.values(self._seen)
        return float(self._weights @ values) + sum(
            column.bonus(self._model) for column in self.columns
        )

    def _overlaps(self, robot: int) -> FloatArray:
        """Returns the weighted overlap [R] of all robots' roots with those of one; 0 for itself."""
        roots = self._model.problem.no_pixels()
        column = self.columns[robot]
        roots[column.view_sums] = np.sqrt(column.pixels)
        shared = np.array(
            [
                np.minimum(roots[c.view_sums], np.sqrt(c.pixels)) @ self._weights[c.view_sums]
                for c in self.columns
            ]
        )
        shared[robot] = 0.0
        return shared

    def _replace(self, robot: int, column: Column) -> None:
        """Gives a robot another column."""
        self._take(self.columns[robot])
        self.columns[robot] = column
        self._put(column)

    def _put(self, column: Column) -> None:
        """Adds a column's pixels and closures to those that the other robots face."""
        column.add_to(self._seen)
        for graph in self._graphs:
            graph.put(column, 1)

    def _take(self, column: Column) -> None:
        """Removes a column's pixels and closures from those that the other robots face."""
        at = column.view_sums
        self._seen[at] = np.maximum(self._seen[at] - column.pixels, 0.0)
        for graph in self._graphs:
            graph.put(column, -1)


class _ArcGraph:
    """The arcs of columns of one class, and those that other robots' columns close.

    Parameters
    ----------
    columns : columns of robots of the class
    """

    def __init__(self, model: Model, robot_class: RobotClass, columns: Sequence[Column]) -> None:
        self._model, self._class = model, robot_class
        paths = np.array([column.path for column in columns], dtype=np.int64)
        self._graph = KeptGraph(model, robot_class, _layers(model, robot_class, paths))
        # number of columns that close each node and each edge
        self._nodes = np.zeros(self._graph.n_nodes, dtype=np.int64)
        self._edges = np.zeros(self._graph.n_edges, dtype=np.int64)
        self._closes: dict[tuple[int, Path], tuple[IntArray, IntArray]] = {}

    def put(self, column: Column, times: int) -> None:
        """Closes the nodes and arcs that another robot's column blocks (1), or opens them again
        (-1).
        """
        if column.key not in self._closes:
            charges = Column.avoid(self._model, self._class, [column])
            charged = self._graph.charged(charges)
            self._closes[column.key] = np.flatnonzero(charged.nodes), charged.edges
        nodes, edges = self._closes[column.key]
        self._nodes[nodes] += times
        np.add.at(self._edges, edges, times)

    def best_path(self, starts: IntArray, pixels: FloatArray) -> Path | None:
        """Returns the path of the largest marginal gain from any start; None if no path is open.

        Parameters
        ----------
        pixels : [Z] px/m2 that the other robots have of every view sum
        """
        nodes, edges = np.where(self._nodes > 0, np.inf, 0.0), np.flatnonzero(self._edges)
        nodes[: len(self._graph.starts)][~np.isin(self._graph.starts, starts)] = np.inf
        return self._graph.best_path(pixels, Charged(nodes, edges, np.full(len(edges), np.inf)))


def _layers(model: Model, robot_class: RobotClass, paths: IntArray) -> list[Layer]:
    """Returns the states on paths [n, T+1] of a class, and the arcs that the paths take."""
    shape, bonuses = robot_class.graph.shape, Bonuses.of(model.problem.objective)
    by_step = [np.unique(states, return_inverse=True) for states in paths.T]
    nothing = np.zeros(0, dtype=np.int64)
    layers = [Layer(by_step[0][0], nothing, nothing, np.zeros(0))]
    for (before, tails), (states, heads) in pairwise(by_step):
        tails, heads = np.divmod(np.unique(tails * len(states) + heads), len(states))
        rewards = bonuses.of_edges(shape, before[tails], states[heads])
        layers.append(Layer(states, tails, heads, rewards))
    return layers
