"""Paths with the cells that they pass."""

from typing import NamedTuple

from cocap_opt.model.coverage_tables import Path
from cocap_opt.model.model import Model
from cocap_opt.problem import Cell


class PathCells(NamedTuple):
    """A path of one robot with the cells that it passes; rules depend only on these."""

    class_number: int  # number of the robot's class
    states: Path  # T+1 state numbers
    cells: tuple[Cell, ...]  # T+1

    @classmethod
    def of(cls, model: Model, robot: int, path: Path) -> "PathCells":
        """Returns the path of a robot, given as state numbers, with its cells."""
        robot_class = model.class_of[robot]
        number = robot_class.number
        cells, n_places = model.places.cells[number], robot_class.graph.n_places
        return cls(number, path, tuple([cells[state % n_places] for state in path]))
