"""A pool of columns: finds plans that use one of its columns for each robot.

In local search, finding new paths takes most of the time; plans of known paths are cheap. So a
mixture is rounded at random many times. Each rounding is improved by coordinate ascent: each robot
in turn takes its best column given the columns of all others. The result is a local optimum of the
restricted integer master. There are many different ones, and some lead to much better plans than
the best of them does.
"""

from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from cocap_opt.data import FloatArray, IntArray
from cocap_opt.mixtures.columns import Column
from cocap_opt.model import Model, Path
from cocap_opt.objective import marginal_gain
from cocap_opt.problem import Problem

LEAST_AMOUNT = 1e-3  # smallest amount of a robot, so that every column is drawn from time to time
_GAIN = 1e-9  # relative; smaller gains do not count

PlanKey = tuple[Path, ...]  # the paths, which identify a plan
# J, and the columns robot by robot, of a plan that no robot can improve alone by changing to
# another column.
LocalOptimum = tuple[float, tuple[Column, ...]]
# The views of the parts of columns, one per entry: the number of the part, the view sum, its pixels
# (px/m2) and its weight.
_Entries = tuple[IntArray, IntArray, FloatArray, FloatArray]


class _Choice(NamedTuple):
    """The columns of one robot, prepared for quick comparison.

    The columns have most of their states in common, so gains are computed state by state, once for
    all columns. If pixels add up over time, each column consists of a single part.
    """

    problem: Problem
    columns: list[Column]
    number_of: dict[Path, int]
    amounts: FloatArray  # [n] amount of the robot on each column, at least LEAST_AMOUNT
    bonus: FloatArray  # [n] rewards for moves
    parts: IntArray  # [n, k] numbers of the parts of each column
    entries: _Entries

    @classmethod
    def of(cls, model: Model, columns: dict[Path, Column], amounts: dict[Path, float]) -> "_Choice":
        """Returns the columns of one robot, given by their paths, with their amounts."""
        choices = [*columns.values()]
        shares = np.maximum([amounts[path] for path in columns], LEAST_AMOUNT)
        bonus = np.array([column.bonus(model) for column in choices])
        numbers = {path: k for k, path in enumerate(columns)}
        over_time = model.problem.objective.over_time
        parts, entries = (_whole if over_time else _states)(model, choices)
        return cls(model.problem, choices, numbers, shares, bonus, parts, entries)

    def worth(self, seen: FloatArray) -> FloatArray:
        """Returns the gain of each column [n], given the pixels [Z] of the other robots."""
        of, view_sums, pixels, weights = self.entries
        gains = weights * marginal_gain(self.problem, view_sums, seen[view_sums], pixels)
        by_part = np.bincount(of, gains, minlength=int(self.parts.max()) + 1)
        worth: FloatArray = by_part[self.parts].sum(axis=1) + self.bonus
        return worth

    def shuffled(self, rng: np.random.Generator) -> Iterator[Column]:
        """Yields the columns in random order, drawing each next one in proportion to its amount."""
        for k in np.argsort(rng.exponential(size=len(self.columns)) / self.amounts).tolist():
            yield self.columns[k]


def _states(model: Model, columns: Sequence[Column]) -> tuple[IntArray, _Entries]:
    """Returns the numbers [n, T+1] of the states on each column, and the views of the states."""
    robot_class = model.class_of[columns[0].robot]
    table, n_states = model.coverage(robot_class), robot_class.graph.n_states
    paths = np.array([column.path for column in columns])
    nodes, numbers = np.unique(paths + np.arange(paths.shape[1]) * n_states, return_inverse=True)
    of, at = table.entries(nodes)
    view_sums = table.view_sums[at]
    weights = model.problem.view_sum_weights[view_sums]
    return numbers.reshape(paths.shape), (of, view_sums, table.pixels[at], weights)


def _whole(model: Model, columns: Sequence[Column]) -> tuple[IntArray, _Entries]:
    """Returns the numbers [n, 1] of the columns, and their views."""
    numbers = np.arange(len(columns))
    view_sums = np.concatenate([column.view_sums for column in columns])
    of = np.repeat(numbers, [len(column.view_sums) for column in columns])
    pixels = np.concatenate([column.pixels for column in columns])
    weights = model.problem.view_sum_weights[view_sums]
    return numbers[:, None], (of, view_sums, pixels, weights)


class ColumnPool:
    """Columns of all robots, each with the amount of its robot."""

    def __init__(self, model: Model) -> None:
        self.model = model
        self._columns: list[dict[Path, Column]] = [{} for _ in model.problem.robots]
        self._amounts: list[dict[Path, float]] = [{} for _ in model.problem.robots]
        self._conflicts: dict[tuple[int, Path, int, Path], bool] = {}

    def add(self, column: Column, amount: float) -> None:
        """Adds a column, or increases the amount of a known column."""
        self._columns[column.robot][column.path] = column
        amounts = self._amounts[column.robot]
        amounts[column.path] = amounts.get(column.path, 0.0) + amount

    def ascended(self, columns: Sequence[Column]) -> LocalOptimum:
        """Returns the local optimum reached from columns without conflicts, which are added to the
        pool.
        """
        for column in columns:
            self.add(column, 0.0)
        return self._ascended([*columns], self._choices(), range(len(columns)))

    def drawn(self, rng: np.random.Generator, draws: int) -> Iterator[LocalOptimum]:
        """Yields the local optima reached from random roundings; fewer if some end in conflicts."""
        choices = self._choices()
        for _ in range(draws):
            order = rng.permutation(len(choices)).tolist()
            if columns := self._rounded(choices, order, rng):
                yield self._ascended(columns, choices, order)

    def _choices(self) -> list[_Choice]:
        """Returns the choices of each robot; each robot must have a column."""
        both = zip(self._columns, self._amounts, strict=True)
        return [_Choice.of(self.model, columns, amounts) for columns, amounts in both]

    def _rounded(
        self, choices: list[_Choice], order: Sequence[int], rng: np.random.Generator
    ) -> list[Column]:
        """Returns a random column for each robot, without conflicts; empty if a robot has none
        left.

        Robots choose in turn among the columns that do not conflict with earlier choices, in
        proportion to amounts.
        """
        chosen: dict[int, Column] = {}
        for robot in order:
            columns = choices[robot].shuffled(rng)
            free = (c for c in columns if not self._is_in_conflict(c, chosen.values()))
            if (column := next(free, None)) is None:
                return []
            chosen[robot] = column
        return [chosen[robot] for robot in sorted(chosen)]

    def _ascended(
        self, columns: list[Column], choices: list[_Choice], order: Sequence[int]
    ) -> LocalOptimum:
        """Returns the plan after coordinate ascent, robot after robot, until none gains."""
        problem = self.model.problem
        seen, weights = problem.no_pixels(), problem.view_sum_weights
        for column in columns:
            column.add_to(seen)
        quiet, n = 0, 0  # number of consecutive robots that could not gain; number of turns
        while quiet < len(columns):
            robot = order[n % len(columns)]
            before = columns[robot]
            seen[before.view_sums] = np.maximum(seen[before.view_sums] - before.pixels, 0.0)
            best = self._best_column(choices[robot], columns, seen, before)
            quiet, n = (quiet + 1, n + 1) if best is before else (0, n + 1)
            seen[best.view_sums] += best.pixels
            columns[robot] = best
        bonus = sum(column.bonus(self.model) for column in columns)
        return float(weights @ problem.returns.values(seen)) + bonus, tuple(columns)

    def _best_column(
        self, choice: _Choice, columns: Sequence[Column], seen: FloatArray, before: Column
    ) -> Column:
        """Returns a robot's best column given those of all others; its current one unless another
        is better.
        """
        worth = choice.worth(seen)
        others = [column for column in columns if column is not before]
        least = worth[choice.number_of[before.path]]
        least += _GAIN * abs(least)
        for k in np.argsort(-worth, kind="stable").tolist():
            if worth[k] <= least:
                break
            column: Column = choice.columns[k]
            if not self._is_in_conflict(column, others):
                return column
        return before

    def _is_in_conflict(self, column: Column, others: Iterable[Column]) -> bool:
        """Returns True if a column breaks a rule with one of the others; results for pairs are
        cached.
        """
        for other in others:
            in_order = column.robot <= other.robot
            first, second = (column, other) if in_order else (other, column)
            key = *first.key, *second.key
            if key not in self._conflicts:
                self._conflicts[key] = first.conflicts_with(second, self.model.problem)
            if self._conflicts[key]:
                return True
        return False
