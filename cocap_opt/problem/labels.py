"""Labels beside points of a map, placed so that none lies on another."""

import math

import numpy as np

from cocap_opt.arithmetic import cosines, sines
from cocap_opt.data import FloatArray

_WAYS = 16  # directions that are tried
_FAR = 0.0, 1.5, 4.0, 7.0, 11.0, 16.0, 22.0  # mm between a label and its point that are tried
_GAP = 0.4  # mm between two labels
_ON_LABEL, _ON_POINT, _ON_LINE = 100.0, 10.0, 1.0  # costs: per mm2, per point of a mark, of a line
_OF_MM = 0.3  # of a distance


def placed(
    points: FloatArray, sizes: FloatArray, room: tuple[float, float], lines: FloatArray,
    taken: FloatArray,
) -> FloatArray:  # fmt: skip
    """Returns the middles [n, 2] of labels, each near its point and within the room.

    Labels come in their order, each where it hides least: first of all no other label, then no
    point of another, then few points of lines. If there is no such place, labels overlap.

    Parameters
    ----------
    points : [n, 2] mm, what labels belong to
    sizes : [n, 2] mm, width and height of labels
    room : mm, width and height of the map
    lines : [m, 2] mm, points of lines that are better not hidden
    taken : [k, 2, 2] mm, middle and size of what is on the map already and must not be hidden
    """
    angles = math.tau * np.arange(_WAYS) / _WAYS
    ways = np.column_stack([cosines(angles), sines(angles)])
    boxes = [*taken]
    for point, size in zip(points, sizes, strict=True):
        reach = size / 2
        # Along each way the label's edge, not its middle, is so far from the point.
        edge = 1 / np.maximum(np.abs(ways) / reach, 1e-9).max(axis=1)
        far = np.array(_FAR)[:, None] + edge[None, :] + 1.0
        middles = point + (far[..., None] * ways[None]).reshape(-1, 2)
        middles = np.clip(middles, reach, np.maximum(np.array(room) - reach, reach))
        others = np.array(boxes).reshape(-1, 2, 2)
        apart = np.abs(middles[:, None] - others[:, 0]) - (reach + others[:, 1] / 2 + _GAP)
        overlap = np.clip(-apart, 0.0, None).prod(axis=2).sum(axis=1)
        cost = _ON_LABEL * overlap + _OF_MM * np.linalg.norm(middles - point, axis=1)
        cost += _ON_POINT * _inside(middles, reach + 0.5, points)
        cost += _ON_LINE * _inside(middles, reach, lines)
        boxes.append(np.array([middles[int(np.argmin(cost))], size]))
    return np.array([middle for middle, _ in boxes[len(taken) :]]).reshape(-1, 2)


def _inside(middles: FloatArray, reach: FloatArray, points: FloatArray) -> FloatArray:
    """Returns the number of points [c] in each of some boxes of one size."""
    within = (np.abs(middles[:, None] - points[None]) < reach).all(axis=2)
    return np.asarray(within.sum(axis=1), dtype=float)
