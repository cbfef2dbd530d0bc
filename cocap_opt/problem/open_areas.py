"""The parts of a map between which a drone cannot move at a flight height, such as closed yards."""

import numpy as np

from cocap_opt.data import BoolArray

_BESIDE, _CORNERS = ((1, 0), (0, 1)), ((1, 1), (1, -1))  # neighbours of a cell, one way of each


def largest_area(free: BoolArray, corner_cutting: bool) -> BoolArray:
    """Returns the cells [X, Y] of the largest free area; of several that are as large, of all.

    Free cells side by side are in one area, and with corner cutting those that share a corner, too.

    Parameters
    ----------
    free : [X, Y] cells without solid matter and closed airspace, at one flight height
    corner_cutting : as `Motion` has it
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    number, (width, depth) = np.arange(free.size).reshape(free.shape), free.shape
    links = [np.empty((0, 2), dtype=np.int64)]
    for dx, dy in _BESIDE + (_CORNERS if corner_cutting else ()):
        y0, y1 = max(0, -dy), depth - max(0, dy)
        here = np.s_[: width - dx, y0:y1]
        there = np.s_[dx:, y0 + dy : y1 + dy]
        both = free[here] & free[there]
        links.append(np.column_stack([number[here][both], number[there][both]]))
    start, end = np.concatenate(links).T
    graph = coo_array((np.ones(len(start)), (start, end)), shape=(free.size, free.size))
    area = connected_components(graph, directed=False)[1].reshape(free.shape)
    sizes = np.bincount(area[free], minlength=1)
    largest: BoolArray = free & (sizes[np.minimum(area, len(sizes) - 1)] == sizes.max())
    return largest
