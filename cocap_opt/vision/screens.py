"""Columns of the map that hide all of an actor, found in little time from nearly all places.

The axis leads from the middle of an actor to the eye. All lines of sight pass the upright plane
across the axis at a point p that is farther than the actor's radius r from its middle; there they
are less than r beside p, and no higher than the line to the actor's top at its far side. If all of
that is inside of one column, this column hides all of the actor.
"""

import math
from typing import NamedTuple, Self

import numpy as np

from cocap_opt.data import BoolArray, FloatArray, IntArray
from cocap_opt.vision.bodies import Bodies

_DEPTH = 1e-3  # m, by which lines of sight are inside of a column at least
_PARTS = 4  # of a cell along x and y, at most
_MOST = 4_000_000  # squares, of maps with fewer cells, to bound the memory
_STEP = 3  # cells from one point of an axis to the next
_FEW = 0.8  # share of the axes that must be left for all to be kept


class Screens(NamedTuple):
    """Squares of the map, parts of its cells, that are well inside of a column."""

    tops: FloatArray  # [X, Y] m of the columns; -inf in squares that are not well inside of one
    corner: FloatArray  # [2] m, of the first square
    size: float  # m, edge of a square
    step: float  # m, from one point of an axis to the next

    @classmethod
    def of(cls, columns: Bodies, resolution: float, radius: float) -> Self:
        """Returns the squares that are farther from the sides of their column than a radius (m).

        Parameters
        ----------
        columns : upright boxes without bottom; the first is all of the map, as low as it gets
        resolution : m, edge of a cell
        """
        corner, inwards = columns.low[0], radius + _DEPTH
        cells = float(np.prod((columns.high[0, :2] - corner) / resolution))
        size = resolution / max(min(_PARTS, math.isqrt(int(_MOST / cells))), 1)
        first = np.ceil((columns.low - corner + inwards) / size).astype(np.int64)
        ends = np.floor((columns.high[:, :2] - corner - inwards) / size).astype(np.int64)
        tops = np.full(np.rint((columns.high[0, :2] - corner) / size).astype(np.int64), -np.inf)
        for k in np.flatnonzero((first < ends).all(axis=1))[1:].tolist():
            (x0, y0), (x1, y1) = first[k].tolist(), ends[k].tolist()
            tops[x0:x1, y0:y1] = columns.high[k, 2]
        return cls(tops, corner, size, _STEP * resolution)

    def hide(
        self, middles: FloatArray, radii: FloatArray, tops: FloatArray, eyes: FloatArray
    ) -> BoolArray:
        """Returns an array [n, A], true for actors that a column is known to hide from eyes [n, 3].

        Parameters
        ----------
        middles, radii, tops : [A, 2], [A] and [A] m, of upright cylinders around the actors
        """
        hidden = np.zeros((len(eyes), len(radii)), dtype=bool)
        if np.isneginf(self.tops).all():
            return hidden
        numbers, at, left, steps = self._axes(middles, radii, tops, eyes)
        while len(numbers):
            x, y, top = at
            squares = x.astype(np.int64)
            squares *= self.tops.shape[1]
            squares += y.astype(np.int64)
            hides = top <= self.tops.take(squares, mode="clip")
            hides &= left > 0
            hidden.reshape(-1)[numbers[hides]] = True
            for values, step in zip(at, steps, strict=True):
                np.add(values, step, out=values)
            np.subtract(left, 1.0, out=left)
            kept = ~hides & (left > 0)
            if np.count_nonzero(kept) <= _FEW * len(kept):
                rows = np.flatnonzero(kept)
                numbers, left = numbers[rows], left[rows]
                at, steps = ([part[rows] for part in parts] for parts in (at, steps))
        return hidden

    def _axes(
        self, middles: FloatArray, radii: FloatArray, tops: FloatArray, eyes: FloatArray
    ) -> tuple[IntArray, list[FloatArray], FloatArray, list[FloatArray]]:
        """Returns the first point of each axis, as near to the actor as may be.

        Returns
        -------
        numbers : [n] of eye and actor
        points : x and y [n] in squares from the corner, and an altitude [n] (m) above all lines
            of sight there
        left : [n] > 0 steps to the eye; points beyond it have no more
        steps : x, y and altitude [n] from each point to the next
        """
        at = (middles - self.corner) / self.size
        inside = ((at > 0) & (at < self.tops.shape)).all(axis=1)
        way = eyes[:, None, :2] - middles
        away = np.sqrt(way[..., 0] ** 2 + way[..., 1] ** 2)
        first = radii.max(initial=0.0) + _DEPTH
        eye, actor = np.nonzero((away > first) & inside)
        way, away = way[eye, actor], away[eye, actor]
        step = self.step / away  # of the way
        x, y = (way.T / self.size) * step
        height, top = eyes[eye, 2], tops[actor]
        rise = np.maximum(height - top, 0.0) / (away + radii[actor])  # m, for each metre
        begin = first / self.step  # steps
        points = [
            at[actor, 0] + begin * x,
            at[actor, 1] + begin * y,
            np.maximum(height, top) + _DEPTH - rise * (away - first),
        ]
        steps = [x, y, rise * away * step]
        return eye * len(radii) + actor, points, 1 / step - begin, steps
