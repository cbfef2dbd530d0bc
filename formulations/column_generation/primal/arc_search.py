"""Large neighbourhood search over known arcs: better plans where robots are many.

Some robots whose views overlap are taken out of a plan, put back in a random order by best
responses over the arcs of all known columns (`arc_graph`), and answer one another's paths with
their neighbours until none gains. The new plan stays if it is no worse (Shaw 1998; ruin and
recreate: Schrimpf et al. 2000). A move takes some hundredths of a second.
"""

from collections.abc import Callable, Iterable

import numpy as np

from cocap_opt.data import FloatArray
from cocap_opt.formulations.column_generation.master.columns import Column
from cocap_opt.formulations.column_generation.parameters import LargeRootParameters
from cocap_opt.formulations.column_generation.primal.arc_graph import ArcGraph
from cocap_opt.formulations.column_generation.primal.incumbent import Incumbent
from cocap_opt.model import Model, Path
from cocap_opt.stop import Stop

_GAIN = 1e-9  # relative, from which on a path counts as better


class ArcSearch:
    """A plan that is changed over the arcs of some columns and its own.

    Parameters
    ----------
    columns : of any robots
    tell : called between two moves, to say that the search goes on

    Attributes
    ----------
    columns : those of the plan, robot by robot
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
        self._graphs = [ArcGraph(model, number, known) for number, known in enumerate(by_class)]
        self._seen = model.problem.no_pixels()
        self.columns = [*plan.columns]
        for column in plan.columns:
            self._put(column)

    def plan(self) -> Incumbent | None:
        """Returns the plan as it is now; None if it broke a rule."""
        return Incumbent.of(self._model, self.columns)

    def search(self, moves: int, rng: np.random.Generator) -> None:
        """Makes so many moves; raises LimitReached between two of them."""
        for _ in range(moves):
            self._tell()
            self._stop.check()
            self._move(rng)

    def _move(self, rng: np.random.Generator) -> None:
        """Makes one move, which is undone where it makes the plan worse."""
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
        """Plans robots anew, one after the other; returns False if one is left no way.

        Those that are not planned then keep their columns.
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
        """Takes best responses of these robots in turn until none gains."""
        quiet = turn = 0
        while quiet < len(robots) and turn < self._parameters.most_turns * len(robots):
            quiet = 0 if self._responds(robots[turn % len(robots)]) else quiet + 1
            turn += 1

    def _responds(self, robot: int) -> bool:
        """Takes a robot's best response; returns True if it gains."""
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
        """Returns a robot's best path over the arcs, beside all that are in sight."""
        graph = self._graphs[self.columns[robot].along.class_number]
        return graph.best_path(self._model.start(robot), self._seen)

    def _gain(self, column: Column) -> float:
        """Returns what a column gains beside what is seen."""
        seen = self._seen[column.view_sums]
        gains = np.sqrt(seen + column.pixels) - np.sqrt(seen)
        return float(gains @ self._weights[column.view_sums]) + column.bonus(self._model)

    def _value(self) -> float:
        """Returns J of the plan as it is now."""
        return float(self._weights @ np.sqrt(self._seen)) + sum(
            column.bonus(self._model) for column in self.columns
        )

    def _overlaps(self, robot: int) -> FloatArray:
        """Returns how much each robot's roots share with those of one robot [R]; 0 for itself."""
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
        """Brings a column into the others' sight and way."""
        self._seen[column.view_sums] += column.pixels
        for graph in self._graphs:
            graph.put(column, 1)

    def _take(self, column: Column) -> None:
        """Takes a column out of the others' sight and way."""
        at = column.view_sums
        self._seen[at] = np.maximum(self._seen[at] - column.pixels, 0.0)
        for graph in self._graphs:
            graph.put(column, -1)
