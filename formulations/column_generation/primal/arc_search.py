"""Large neighbourhood search over known arcs: improves plans of many robots.

Each move removes some robots with overlapping views from the plan, reinserts them in random order
by best responses over the arcs of all known columns, and lets them and their neighbours respond to
each other until none gains. The new plan is accepted if it is no worse (Shaw 1998; ruin and
recreate: Schrimpf et al. 2000). A move takes some hundredths of a second: the arcs of the columns
found by pricing are some thousands of the millions that a class has, and a best response over them
takes a thirtieth of the time of one over all arcs.
"""

from collections.abc import Callable, Iterable, Sequence
from itertools import pairwise

import numpy as np

from cocap_opt.data import FloatArray, IntArray
from cocap_opt.formulations.column_generation.parameters import LargeRootParameters
from cocap_opt.formulations.column_generation.primal.incumbent import Incumbent
from cocap_opt.graph.move_rewards import Bonuses
from cocap_opt.graph.timegraph import CLOSED
from cocap_opt.mixtures.columns import Column
from cocap_opt.model import Model, Path
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
        self._graphs = [_ArcGraph(model, number, known) for number, known in enumerate(by_class)]
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
        """Returns the overlap [R] of each robot's roots with those of one robot; 0 for itself."""
        roots = self._model.problem.no_pixels()
        column = self.columns[robot]
        roots[column.view_sums] = np.sqrt(column.pixels)
        shared = np.array(
            [np.minimum(roots[c.view_sums], np.sqrt(c.pixels)).sum() for c in self.columns]
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
        self._seen[column.view_sums] += column.pixels
        for graph in self._graphs:
            graph.put(column, 1)

    def _take(self, column: Column) -> None:
        """Removes a column's pixels and closures from those that the other robots face."""
        at = column.view_sums
        self._seen[at] = np.maximum(self._seen[at] - column.pixels, 0.0)
        for graph in self._graphs:
            graph.put(column, -1)


class _ArcGraph:
    """The arcs of columns of one class, and the arcs that other robots' columns close.

    Parameters
    ----------
    number : number of the class
    columns : columns of robots of the class
    """

    def __init__(self, model: Model, number: int, columns: Sequence[Column]) -> None:
        self._model, self._class = model, model.classes[number]
        paths = np.array([column.path for column in columns], dtype=np.int64)
        self._horizon = horizon = model.problem.horizon
        # Nodes are the states on paths, step by step; arcs are in the order of their tails.
        sorted_states = [np.unique(paths[:, t], return_inverse=True) for t in range(horizon + 1)]
        self._states = [states for states, _ in sorted_states]
        self._first_node = np.cumsum([0, *map(len, self._states)])
        self._tails, self._heads, self._first_out = [], [], []
        for (_, tails), (states, heads) in pairwise(sorted_states):
            tails, heads = np.divmod(np.unique(tails * len(states) + heads), len(states))
            self._tails.append(tails)
            self._heads.append(heads)
            self._first_out.append(np.flatnonzero(np.diff(tails, prepend=-1)))
        self._first_arc = np.cumsum([0, *map(len, self._tails)])
        self._read_views()
        self._read_moves()
        self._closed_nodes = np.zeros(self._first_node[-1], dtype=np.int64)
        self._closed_arcs = np.zeros(self._first_arc[-1], dtype=np.int64)
        self._closes: dict[tuple[int, Path], tuple[IntArray, IntArray]] = {}

    def _read_views(self) -> None:
        """Reads the views and the places of the nodes."""
        graph, table = self._class.graph, self._model.coverage(self._class)
        steps = np.repeat(np.arange(self._horizon + 1), np.diff(self._first_node))
        states = np.concatenate(self._states)
        self._seeing, entries = table.entries(steps * graph.n_states + states)
        self._view_sums, self._pixels = table.view_sums[entries], table.pixels[entries]
        self._weights = self._model.problem.view_sum_weights[self._view_sums]
        self._at: dict[tuple[int, int], list[int]] = {}  # nodes by step and place
        both = zip(steps.tolist(), (states % graph.n_places).tolist(), strict=True)
        for node, key in enumerate(both):
            self._at.setdefault(key, []).append(node)

    def _read_moves(self) -> None:
        """Reads the rewards of arcs and the places that they join."""
        graph, bonuses = self._class.graph, Bonuses.of(self._model.problem.objective)
        self._along: dict[tuple[int, int, int], list[int]] = {}  # arcs by step and places
        self._bonus = np.zeros(self._first_arc[-1])
        for t in range(self._horizon):
            tails, heads = self._states[t][self._tails[t]], self._states[t + 1][self._heads[t]]
            part = slice(self._first_arc[t], self._first_arc[t + 1])
            self._bonus[part] = bonuses.of_edges(graph.shape, tails, heads)
            ends = (tails % graph.n_places).tolist(), (heads % graph.n_places).tolist()
            for arc, (tail, head) in enumerate(zip(*ends, strict=True), start=part.start):
                self._along.setdefault((t, tail, head), []).append(arc)

    def put(self, column: Column, times: int) -> None:
        """Closes the nodes and arcs that another robot's column blocks (1), or opens them again
        (-1).
        """
        if column.key not in self._closes:
            charges = Column.avoid(self._model, self._class, [column])
            nodes = [node for t, at in charges.places for node in self._at.get((t, at), ())]
            moves = ((t, tail, head) for t, tail, head in charges.moves)
            arcs = [arc for move in moves for arc in self._along.get(move, ())]
            both = np.array(nodes, dtype=np.int64), np.array(arcs, dtype=np.int64)
            self._closes[column.key] = both
        nodes_of, arcs_of = self._closes[column.key]
        np.add.at(self._closed_nodes, nodes_of, times)
        np.add.at(self._closed_arcs, arcs_of, times)

    def best_path(self, starts: IntArray, pixels: FloatArray) -> Path | None:
        """Returns the path of the largest marginal gain from any start; None if no path is open.

        Parameters
        ----------
        pixels : [Z] px/m2 that the other robots have of every view sum
        """
        values = self._values(pixels)
        open_ = np.flatnonzero(np.isin(self._states[0], starts))
        at = int(open_[np.argmax(values[0][1][open_])])
        if values[0][1][at] == CLOSED:
            return None
        path = [int(self._states[0][at])]
        for t in range(self._horizon):
            first, end = np.searchsorted(self._tails[t], [at, at + 1])
            at = int(self._heads[t][first + np.argmax(values[t][0][first:end])])
            path.append(int(self._states[t + 1][at]))
        return tuple(path)

    def _values(self, pixels: FloatArray) -> list[tuple[FloatArray, FloatArray]]:
        """Returns the values of the arcs and of the nodes of each step, by value iteration."""
        gains = self._model.problem.returns.gains(pixels, self._view_sums, self._pixels)
        n_nodes = int(self._first_node[-1])
        rewards = np.zeros(n_nodes)
        rewards += np.bincount(self._seeing, gains * self._weights, minlength=n_nodes)
        rewards[self._closed_nodes > 0] = CLOSED
        bonus = np.where(self._closed_arcs > 0, CLOSED, self._bonus)
        by_step = np.split(rewards, self._first_node[1:-1])
        of_arcs = np.split(bonus, self._first_arc[1:-1])
        ahead = by_step[-1]
        values = [(np.zeros(0), ahead)]
        for t in range(self._horizon - 1, -1, -1):
            along = ahead[self._heads[t]] + of_arcs[t]
            ahead = by_step[t] + np.maximum.reduceat(along, self._first_out[t])
            values.append((along, ahead))
        return values[::-1]
