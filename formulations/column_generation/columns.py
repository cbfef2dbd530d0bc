"""Columns: paths of single robots with what they see, the arcs along them, and their mixtures."""

from collections.abc import Iterable, Iterator
from operator import eq
from typing import NamedTuple

import numpy as np

from cocap_opt.coordination.constraints import avoid_paths
from cocap_opt.data import FloatArray, IntArray
from cocap_opt.formulations.certificates import Flight
from cocap_opt.formulations.relaxations.separation import Seen
from cocap_opt.graph.charges import Charges
from cocap_opt.model import Model, Path, RobotClass
from cocap_opt.problem import Problem

_LEAST_SEEN = 1e-7  # of a robot, from which on a column counts in what a mixture sees


class Arc(NamedTuple):
    """A step of a robot of one class."""

    class_number: int
    t: int
    tail: int  # state at t
    head: int  # state at t+1


class Column(NamedTuple):
    """A path of one robot and its view sums."""

    robot: int
    flight: Flight
    view_sums: IntArray  # [k] view sums of which it sees anything, increasing
    pixels: FloatArray  # [k] px/m2

    @classmethod
    def of(cls, model: Model, robot: int, path: Path) -> "Column":
        """Returns the column of a robot's path of state numbers."""
        pixels = model.robot_pixels(robot, path)
        view_sums = np.flatnonzero(pixels)
        return cls(robot, Flight.of(model, robot, path), view_sums, pixels[view_sums])

    @property
    def path(self) -> Path:
        """State numbers of the path."""
        return self.flight.path

    @property
    def key(self) -> tuple[int, Path]:
        """Robot and path, by which columns are told apart."""
        return self.robot, self.flight.path

    @property
    def arcs(self) -> list[Arc]:
        """Arcs of the path, step by step."""
        number, path = self.flight.class_number, self.flight.path
        return [Arc(number, t, path[t], path[t + 1]) for t in range(len(path) - 1)]

    def in_model(self, model: Model) -> "Column":
        """Returns the same column with the numbers of another model's classes."""
        return self._replace(flight=Flight.of(model, self.robot, self.path))

    def conflicts_with(self, other: "Column", problem: Problem) -> bool:
        """Returns True if the two paths break a collision rule."""
        if problem.rules.none:
            return False
        p, q = self.flight.cells, other.flight.cells
        if problem.rules.separation:
            if any(problem.too_close(c, d) for c, d in zip(p, q, strict=True)):
                return True
        elif any(map(eq, p, q)):
            return True
        return problem.rules.swap and any(
            p[t] == q[t + 1] and p[t + 1] == q[t] and p[t] != p[t + 1] for t in range(len(p) - 1)
        )


class Mixture(NamedTuple):
    """Columns with weights; the weights of each robot's columns add up to 1, or nearly so."""

    columns: list[Column]
    amounts: FloatArray  # [n] how much of a robot takes each column

    def used(self, least: float = 1e-9) -> Iterator[tuple[Column, float]]:
        """Yields the columns with larger amounts than `least`, and the amounts."""
        for n in np.flatnonzero(self.amounts > least).tolist():
            yield self.columns[n], float(self.amounts[n])

    def seen(self) -> list[tuple[int, Seen]]:
        """Returns the view sums that the mixture sees, each with the roots that it has there."""
        used = np.flatnonzero(self.amounts > _LEAST_SEEN).tolist()
        columns = [self.columns[n] for n in used]
        view_sums = [np.zeros(0, dtype=np.int64), *(column.view_sums for column in columns)]
        numbers = np.concatenate(view_sums)
        if not len(numbers):
            return []
        roots = np.sqrt(np.concatenate([column.pixels for column in columns]))
        counts = [len(column.view_sums) for column in columns]
        amounts = np.repeat(self.amounts[used], counts)
        classes = np.repeat([column.flight.class_number for column in columns], counts)
        order = np.argsort(numbers, kind="stable")
        distinct, first = np.unique(numbers[order], return_index=True)
        parts = np.split(order, first[1:])
        return [
            (view_sum, Seen(classes[p], roots[p], amounts[p]))
            for view_sum, p in zip(distinct.tolist(), parts, strict=True)
        ]


def avoid_columns(model: Model, robot_class: RobotClass, columns: Iterable[Column]) -> Charges:
    """Returns charges that keep robots of a class clear of the paths of columns."""
    graphs = [robot_class.graph for robot_class in model.class_of]
    paths = ((c.robot, [graphs[c.robot].state(state) for state in c.path]) for c in columns)
    return avoid_paths(model, robot_class, paths)
