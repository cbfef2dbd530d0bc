"""Cells at steps that robots of a flow can be in."""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import sparse

from cocap_opt.data import IntArray
from cocap_opt.formulations.relaxations.flow import Flow
from cocap_opt.problem import Cell


@dataclass(frozen=True, eq=False)
class Slots:
    """Cells at steps that robots can be in, each numbered t (number of cells) + cell."""

    numbers: IntArray  # [K] increasing
    sizes: tuple[int, int, int]  # layers, width and depth of the map

    @classmethod
    def of(cls, flow: Flow, nodes: IntArray) -> "Slots":
        """Returns the slots of some nodes."""
        problem = flow.model.problem
        sizes = (len(problem.layers), *problem.height_map.shape)
        return cls(np.unique(flow.steps[nodes] * math.prod(sizes) + flow.places[nodes]), sizes)

    def __len__(self) -> int:
        return len(self.numbers)

    @property
    def n_cells(self) -> int:
        """Number of cells of the map, in all layers."""
        return math.prod(self.sizes)

    @cached_property
    def t(self) -> IntArray:
        """Step of each slot [K]."""
        return self.numbers // self.n_cells

    @cached_property
    def at(self) -> IntArray:
        """Layer, x and y of each slot [3, K]."""
        return np.array(np.unravel_index(self.numbers % self.n_cells, self.sizes))

    def cell(self, k: int) -> Cell:
        """Returns the cell of slot k."""
        layer, x, y = self.at[:, k].tolist()
        return Cell(x, y, layer)

    def number_of(self, flow: Flow, nodes: IntArray) -> IntArray:
        """Returns the numbers that the slots of some nodes have [n]."""
        numbers: IntArray = flow.steps[nodes] * self.n_cells + flow.places[nodes]
        return numbers

    def find(self, t: IntArray, layer: int, x: IntArray, y: IntArray) -> tuple[IntArray, IntArray]:
        """Returns which of these cells [n] at steps t are slots, by position, and their slots."""
        _, width, depth = self.sizes
        inside = np.flatnonzero((x >= 0) & (x < width) & (y >= 0) & (y < depth))
        level = np.full(len(inside), layer)
        wanted = np.ravel_multi_index((level, x[inside], y[inside]), self.sizes)
        wanted += t[inside] * self.n_cells
        slots = np.minimum(np.searchsorted(self.numbers, wanted), len(self) - 1)
        found = self.numbers[slots] == wanted
        return inside[found], slots[found]

    def reach(self, flow: Flow) -> sparse.csr_array:
        """Returns 1 where a robot can be in a slot [K, R]."""
        problem = flow.model.problem
        rows, columns = [], []
        for k, robot_class in enumerate(flow.model.classes):
            own = np.flatnonzero(flow.owner == k)
            for robot, start in zip(robot_class.robots, robot_class.starts, strict=True):
                reached = robot_class.graph.reachable([start], problem.horizon)
                mine = own[reached[flow.steps[own], flow.states[own]]]
                at = np.flatnonzero(np.isin(self.numbers, self.number_of(flow, mine)))
                rows.append(at)
                columns.append(np.full(len(at), robot))
        shape = (len(self), len(problem.robots))
        return incidence(np.concatenate(rows), np.concatenate(columns), shape)


def incidence(rows: IntArray, columns: IntArray, shape: tuple[int, int]) -> sparse.csr_array:
    """Returns a matrix with ones at these rows [n] and columns [n]."""
    return sparse.csr_array((np.ones(len(rows)), (rows, columns)), shape=shape)
