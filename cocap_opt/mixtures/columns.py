"""Columns: paths of single robots with their views, and the arcs along them."""

from collections.abc import Collection, Iterable
from typing import NamedTuple

import numpy as np

from cocap_opt.coordination.best_response import avoid_paths
from cocap_opt.data import FloatArray, IntArray
from cocap_opt.graph.charges import Charges
from cocap_opt.graph.move_rewards import Bonuses
from cocap_opt.model import Model, Path, PathCells, RobotClass
from cocap_opt.problem import Problem

ClassState = tuple[int, int]  # class number, state number


class Arc(NamedTuple):
    """A step of a robot of one class."""

    class_number: int
    t: int
    tail: int  # state at t
    head: int  # state at t+1

    @property
    def leaves(self) -> ClassState:
        """Class and state at the tail."""
        return self.class_number, self.tail

    @property
    def enters(self) -> ClassState:
        """Class and state at the head."""
        return self.class_number, self.head

    @staticmethod
    def on_paths(
        arcs: "Iterable[Arc]", starts: Collection[ClassState], horizon: int
    ) -> "list[list[Arc]]":
        """Returns the arcs of each step [T] that are on a path from a start to step T."""
        by_step: list[list[Arc]] = [[] for _ in range(horizon)]
        for arc in arcs:
            by_step[arc.t].append(arc)
        reached = set(starts)
        for t, arcs_then in enumerate(by_step):
            by_step[t] = [arc for arc in arcs_then if arc.leaves in reached]
            reached = {arc.enters for arc in by_step[t]}
        for t, arcs_then in reversed([*enumerate(by_step)]):
            by_step[t] = [arc for arc in arcs_then if arc.enters in reached]
            reached = {arc.leaves for arc in by_step[t]}
        return by_step


class Column(NamedTuple):
    """A path of one robot, with its view sums."""

    robot: int
    along: PathCells
    view_sums: IntArray  # [k] view sums that the path sees, increasing
    pixels: FloatArray  # [k] px/m2

    @classmethod
    def of(cls, model: Model, robot: int, path: Path) -> "Column":
        """Returns the column of a robot's path of state numbers."""
        pixels = model.robot_pixels(robot, path)
        view_sums = np.flatnonzero(pixels)
        return cls(robot, PathCells.of(model, robot, path), view_sums, pixels[view_sums])

    def add_to(self, pixels: FloatArray) -> None:
        """Adds the view sums along this path to view sums [Z]."""
        pixels[self.view_sums] += self.pixels

    @property
    def path(self) -> Path:
        """State numbers of the path."""
        return self.along.states

    @property
    def key(self) -> tuple[int, Path]:
        """Robot and path, which identify a column."""
        return self.robot, self.along.states

    @property
    def arcs(self) -> list[Arc]:
        """Arcs of the path, step by step."""
        number, path = self.along.class_number, self.along.states
        return [Arc(number, t, path[t], path[t + 1]) for t in range(len(path) - 1)]

    def bonus(self, model: Model) -> float:
        """Returns the rewards for the moves of the path."""
        bonuses = Bonuses.of(model.problem.objective)
        return bonuses.of_path(model.class_of[self.robot].graph.shape, self.path)

    def in_model(self, model: Model) -> "Column":
        """Returns the same column with the class numbers of another model."""
        return self._replace(along=PathCells.of(model, self.robot, self.path))

    def conflicts_with(self, other: "Column", problem: Problem) -> bool:
        """Returns True if the two paths break a collision rule."""
        return problem.paths_conflict(self.along.cells, other.along.cells)

    @staticmethod
    def avoid(model: Model, robot_class: RobotClass, columns: "Iterable[Column]") -> Charges:
        """Returns charges that keep robots of a class clear of the paths of columns."""
        return avoid_paths(model, robot_class, (column.along.cells for column in columns))
