"""Labels beside points of a map, placed so that none overlaps another."""

import math

import numpy as np

from cocap_opt.arithmetic import cosines, sines
from cocap_opt.data import FloatArray

_WAYS = 16  # directions to try
_FAR = 0.0, 1.5, 4.0, 7.0, 11.0, 16.0, 22.0  # mm; distances between a label and its point to try
_GAP = 0.4  # mm between two labels
# costs: per mm2 of another label, per point of a mark, per point of a line
_ON_LABEL, _ON_POINT, _ON_LINE = 100.0, 10.0, 1.0
_OF_MM = 0.3  # cost per mm of distance


def placed(
    points: FloatArray, sizes: FloatArray, room: tuple[float, float], lines: FloatArray,
    taken: FloatArray,
) -> FloatArray:  # fmt: skip
    """Returns the middles [n, 2] of labels, each near its point and within the map.

    Labels are placed in order, each where it hides least: above all no other label, then no other
    point, then few points of lines. If there is no free place, labels overlap.

    Parameters
    ----------
    points : [n, 2] mm, points to which the labels belong
    sizes : [n, 2] mm, width and height of labels
    room : mm, width and height of the map
    lines : [m, 2] mm, points of lines that should not be hidden
    taken : [k, 2, 2] mm, middles and sizes of items on the map that must not be hidden
    """
    angles = math.tau * np.arange(_WAYS) / _WAYS
    ways = np.column_stack([cosines(angles), sines(angles)])
    boxes = [*taken]
    for point, size in zip(points, sizes, strict=True):
        reach = size / 2
        # The distance is measured from the point to the label's edge, not to its middle.
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
    """Returns the number of points in each of several boxes of the same size [c]."""
    least, most = middles.min(axis=0) - reach, middles.max(axis=0) + reach
    near = points[((points > least) & (points < most)).all(axis=1)]
    within = (np.abs(middles[:, None] - near[None]) < reach).all(axis=2)
    return np.asarray(within.sum(axis=1), dtype=float)
