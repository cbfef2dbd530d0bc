"""The cells that a robot can reach from its starts, step by step.

In t steps a robot moves at most t times the radius of a move along each axis. On a wide map that is
a small part of all states, and a sweep over these takes a small part of the time.
"""

from typing import Self

import numpy as np

from cocap_opt.data import FloatArray, IntArray
from cocap_opt.graph.timegraph import Irregular, TimeGraph


class Frame:
    """All states of a graph in a rectangle of cells, numbered as in a smaller graph.

    Parameters
    ----------
    x, y : the cells, counted as in the numbering of the graph, including the border
    irregular : the graph's `irregular`, in numbers of the frame

    Attributes
    ----------
    shape : (headings, pitches, layers, X, Y) of the numbering
    strides : differences between the numbers of neighbours along layers, x and y
    n_places, n_states : number of places and of states
    """

    def __init__(self, graph: TimeGraph, x: slice, y: slice, irregular: Irregular) -> None:
        self.graph, self.irregular, self._x, self._y = graph, irregular, x, y
        headings, pitches, layers = graph.shape[:3]
        width, depth = x.stop - x.start, y.stop - y.start
        self.shape = headings, pitches, layers, width, depth
        self.strides = width * depth, depth, 1
        self.n_places = layers * width * depth
        self.n_states = graph.n_orientations * self.n_places

    @classmethod
    def whole(cls, graph: TimeGraph) -> Self:
        """Returns the frame of all states."""
        width, depth = graph.shape[3:]
        return cls(graph, slice(0, width), slice(0, depth), graph.irregular)

    @classmethod
    def all_from(cls, graph: TimeGraph, starts: IntArray, horizon: int) -> list[Self]:
        """Returns, for each step before the horizon, the frame of all states to which moves may
        lead.

        A frame contains everything that may be reached at its step, and the ends of all moves from
        there. Irregular places outside it are left out.

        Parameters
        ----------
        starts : [n] states at step 0, which the frames enclose in a rectangle of cells
        """
        around = _cells(graph, starts % graph.n_places)[1:]
        (x0, y0), (x1, y1) = around.min(axis=1).tolist(), around.max(axis=1).tolist()
        places, heads, hidden = graph.irregular
        cells, ends = _cells(graph, places), _cells(graph, heads)
        beside = [cells[1] - x1, x0 - cells[1], cells[2] - y1, y0 - cells[2]]
        away = np.maximum.reduce([*beside, np.zeros_like(cells[1])])
        order = np.argsort(away, kind="stable")
        cells, ends, hidden = cells[:, order], ends[:, :, order], hidden[:, order]
        reach = graph.motion.radius * np.arange(horizon)
        counts = np.searchsorted(away[order], reach, side="right")
        frames = []
        for far, n in zip((reach + graph.motion.radius).tolist(), counts.tolist(), strict=True):
            rows = _within(x0 - far, x1 + far + 1, graph.shape[3])
            columns = _within(y0 - far, y1 + far + 1, graph.shape[4])
            near, to = (_numbers(rows, columns, part) for part in (cells[:, :n], ends[..., :n]))
            frames.append(cls(graph, rows, columns, (near, to, hidden[:, :n])))
        return frames

    def of(self, values: FloatArray) -> FloatArray:
        """Returns the frame's part of values [S] of the graph, as [heading, pitch, layer, x, y]."""
        return values.reshape(self.graph.shape)[..., self._x, self._y]

    def places(self, places: IntArray) -> IntArray:
        """Returns the numbers of places [..] in the frame, which are meaningless outside it."""
        return _numbers(self._x, self._y, _cells(self.graph, places))

    def holds(self, places: IntArray) -> IntArray:
        """Returns True for the places [n] that are in the frame."""
        _, x, y = _cells(self.graph, places)
        along_x = (self._x.start <= x) & (x < self._x.stop)
        return np.flatnonzero(along_x & (self._y.start <= y) & (y < self._y.stop))


def _within(first: int, end: int, size: int) -> slice:
    return slice(max(first, 0), min(end, size))


def _numbers(x: slice, y: slice, cells: IntArray) -> IntArray:
    """Returns the numbers [..] of cells [3, ..] (layer, x, y) among the places of a rectangle."""
    (layer, row, column), depth = cells, y.stop - y.start
    numbers: IntArray = (layer * (x.stop - x.start) + row - x.start) * depth + column - y.start
    return numbers


def _cells(graph: TimeGraph, places: IntArray) -> IntArray:
    """Returns layer, x and y [3, ..] of numbered places [..], counted from the border's corner."""
    return np.array(np.unravel_index(places, graph.shape[2:]))
