"""Finds choke points: few cells through which all ways of the drones to somebody lead.

If more drones need to pass than there are cells, they must queue, and the cost of collision rules
is determined there. Choke points are minimum vertex cuts of the graph of cells.
"""

from __future__ import annotations  # networkx graphs take type arguments in stubs only

from collections.abc import Collection, Iterable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from cocap_opt.graph.motion import Window
from cocap_opt.graph.networks import place_graph
from cocap_opt.problem import Cell, Motion, SceneData

if TYPE_CHECKING:
    from cocap_opt.graph.networks import Graph

MOST_CELLS = 700  # cells in reach of the drones, for which cuts take a tenth of a second
_MARGIN = 4  # largest window around the reachable cells, relative to their extent
# smallest share of the target cells that a choke point must separate from the drones
_LEAST_SHARE = 0.1
_MOST_CUTS = 4  # cuts that are examined
_STARTS = "starts"  # an auxiliary node from which all drones start


class ChokePoint(NamedTuple):
    """A few cells, and the number of cells behind them."""

    cells: tuple[Cell, ...]
    drones: int  # number of drones that can reach cells behind the choke point by the last step
    # number of target cells that drones can reach by the last step only through these cells
    behind: int
    wanted: int  # number of target cells that drones can reach at all

    @classmethod
    def of(
        cls, problem: SceneData, wanted: Collection[Cell], most: int = MOST_CELLS
    ) -> ChokePoint | None:
        """Returns the cells, fewer than the drones that need to pass, behind which most target
        cells lie.

        From most starts somebody is already in sight, so no few cells separate all starts from all
        target cells. Therefore cuts are taken to one target cell at a time, first to the one that
        takes the most steps; among the smallest cuts, the one nearest to the starts is used. Cells
        are behind a cut if they cannot be reached in time without it; the cut itself also separates
        longer ways. Cells closed by people are ignored.

        Parameters
        ----------
        wanted : target cells, e.g. those from which somebody is seen at the last step
        most : number of cells in reach above which the search is skipped

        Returns
        -------
        ChokePoint or None
            None if no choke point has a tenth of the target cells behind it, or if too many cells
            are in reach.
        """
        ways = _Routes.of(problem, most) if len(problem.robots) > 1 and wanted else None
        if ways is None:
            return None
        steps = ways.steps()
        reached = {cell for cell in wanted if cell in steps}
        left = reached - ways.starts
        best = cls((), 0, 0, len(reached))
        for _ in range(_MOST_CUTS):
            if not left or 2 * best.behind > len(reached):
                break
            farthest = max(left, key=lambda cell: (steps[cell], cell))
            found = ways.choke_point_before(farthest, reached)
            if len(found.cells) < found.drones and found.behind > best.behind:
                best = found
            left -= {farthest, *ways.graph[farthest]} | ways.behind(found.cells, reached)
        return best if best.behind >= _LEAST_SHARE * len(reached) > 0 else None

    def __str__(self) -> str:
        return f"cell{'s' if len(self.cells) > 1 else ''} {', '.join(self._names)}"

    @property
    def _names(self) -> list[str]:
        """The cells in words; layers are left out if all cells are in the lowest."""
        flat = not any(cell.layer for cell in self.cells)
        return [str(tuple(cell[:2] if flat else cell)) for cell in self.cells]

    def told(self, team: int, wanted: str) -> str:
        """Describes the choke point and the drones that must pass it.

        Parameters
        ----------
        team : number of all drones
        wanted : the target cells in words, e.g. "cells near people at the last step"
        """
        share = "most" if 2 * self.behind > self.wanted else "some"
        of = f"{self.drones} of {team}"
        who = of if self.drones < team else "both" if team == 2 else f"all {team}"
        *others, last = self._names
        either = f"{', '.join(others)} or {last}" if others else last
        return f"choke point: {who} drones must pass cell {either} to reach {share} of the {wanted}"


class _Routes:
    """The cells in reach of the drones, and the moves between them.

    Attributes
    ----------
    graph : the graph of the moves; its nodes are cells
    starts : cells of the drones at step 0
    """

    def __init__(self, graph: Graph, starts: Collection[Cell], horizon: int) -> None:
        from networkx.algorithms.connectivity import build_auxiliary_node_connectivity
        from networkx.algorithms.flow import build_residual_network

        self.graph, self.starts, self._horizon = graph, set(starts), horizon
        # Among the smallest cuts, networkx finds the one nearest to its sink.
        self._back = graph.reverse()
        self._back.add_edges_from((start, _STARTS) for start in self.starts)
        self._auxiliary = build_auxiliary_node_connectivity(self._back)
        self._residual = build_residual_network(self._auxiliary, "capacity")

    @classmethod
    def of(cls, problem: SceneData, most: int) -> _Routes | None:
        """Returns the ways of all drones; None if more than `most` cells are in reach."""
        import networkx as nx  # takes a fifth of a second, and few commands need it

        graph: Graph = nx.DiGraph()
        for motion in dict.fromkeys(robot.motion for robot in problem.robots):
            window = _window(problem, motion)
            width, depth = window.shape
            if width * depth * len(motion.layers) > _MARGIN * most:
                return None
            layers = [problem.layers.index(height) for height in motion.layers]
            graph.add_edges_from(
                (Cell(x, y, layers[k]), Cell(u, v, layers[m]))
                for (k, x, y), (m, u, v) in place_graph(problem.workspace, motion, window).edges
                if (k, x, y) != (m, u, v)
            )
        starts = {
            problem.cell(i, state)
            for i, states in enumerate(problem.starts)
            for state in states.in_different_cells()
        }
        graph.add_nodes_from(starts)
        near = _steps(graph, starts, problem.horizon)
        if len(near) > most:
            return None
        return cls(graph.subgraph(near).copy(), starts, problem.horizon)

    def steps(self, without: Collection[Cell] = ()) -> dict[Cell, int]:
        """Returns the fewest steps to each cell that can be reached without some cells."""
        left = self.graph.subgraph(self.graph.nodes - set(without)) if without else self.graph
        return _steps(left, self.starts - set(without), self._horizon)

    def behind(self, cells: Collection[Cell], wanted: set[Cell]) -> set[Cell]:
        """Returns the target cells that can be reached by the last step only through the given
        cells.
        """
        return wanted - set(cells) - self.steps(cells).keys()

    def choke_point_before(self, cell: Cell, wanted: set[Cell]) -> ChokePoint:
        """Returns the fewest cells that separate the starts from a cell, and the number of cells
        behind them.
        """
        from networkx.algorithms.connectivity import minimum_st_node_cut

        cut = minimum_st_node_cut(
            self._back, cell, _STARTS, auxiliary=self._auxiliary, residual=self._residual
        )
        behind = self.behind(cut, wanted)
        drones = self.starts & _steps(self._back, behind, self._horizon).keys()
        return ChokePoint(tuple(sorted(cut)), len(drones), len(behind), len(wanted))


def _window(problem: SceneData, motion: Motion) -> Window:
    """Returns the cells that drones with the same motion can reach."""
    both = zip(problem.robots, problem.starts, strict=True)
    starts = [states.columns for robot, states in both if robot.motion == motion]
    reach = motion.radius * problem.horizon
    return Window.around(np.concatenate(starts), reach, problem.workspace)


def _steps(graph: Graph, starts: Iterable[Cell], horizon: int) -> dict[Cell, int]:
    """Returns the fewest steps from a start to each cell that is reached in time."""
    steps = dict.fromkeys(starts, 0)
    new = list(steps)
    for t in range(1, horizon + 1):
        heads = dict.fromkeys(head for cell in new for head in graph[cell])
        new = [head for head in heads if head not in steps]
        steps |= dict.fromkeys(new, t)
    return steps
