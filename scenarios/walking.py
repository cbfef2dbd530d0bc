"""Walks of people on a grid of free and blocked cells."""

from __future__ import annotations  # networkx graphs take type arguments in stubs only

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from cocap_opt.data import BoolArray

if TYPE_CHECKING:
    import networkx as nx

    Graph = nx.Graph[Any]

GridCell = tuple[int, int]  # column, row


def walking_graph(free: BoolArray) -> Graph:
    """Returns the graph on which people walk: free cells [columns, rows] and their neighbours.

    Each cell is joined to its eight neighbours; diagonal moves do not cut corners. Weights are in
    cells.
    """
    import networkx as nx  # importing takes a fifth of a second, and few commands need it

    graph: Graph = nx.Graph()
    graph.add_nodes_from((int(x), int(y)) for x, y in np.argwhere(free))
    for x, y in graph:
        for dx, dy in ((1, 0), (0, 1), (1, 1), (1, -1)):
            # The target, and for a diagonal move the two cells beside it, must be free.
            if all(cell in graph for cell in ((x + dx, y + dy), (x + dx, y), (x, y + dy))):
                graph.add_edge((x, y), (x + dx, y + dy), weight=math.hypot(dx, dy))
    return graph
