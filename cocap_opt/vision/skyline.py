"""The skyline of columns before an actor.

Seen from an eye, let r be the distance along the level way to the actor's middle, u = aside / r and
s = up / r, as in the image of a level camera. A column has no lower end, so that a point beyond it
is hidden if it is below the column's upper edge, a concave chain of lines over u. The actor's span
of u is divided into bins. In each bin, the skyline is the highest of those columns' upper edges
that span the bin, each at its lowest there. All that is below the skyline is hidden, and a column
that is nowhere above it hides nothing that others do not hide.

So columns hide together what none of them hides alone, and few of many are left whose shadows must
be cut out. Only columns that are wholly nearer than the actor take part.
"""

from typing import NamedTuple

import numpy as np

from cocap_opt.data import BoolArray, FloatArray, IntArray
from cocap_opt.vision.bodies import Bodies
from cocap_opt.vision.candidates import Lists

_SHARES = np.linspace(0, 1, 9)  # of the span of u, where bins begin and end
_FIRST = 2  # columns of each actor that are looked at first, the steepest
_MARGIN = 1e-9  # of u and s, much more than that of computing them
_NEAREST = 1e-2  # m; nearer columns look too large to be compared


class Skyline:
    """The skylines before n actors, one for each.

    Parameters
    ----------
    corners : [n, C, 3] m, of the actors, relative to the eyes
    eyes : [n, 3] m

    Attributes
    ----------
    hidden : [n] true where all of an actor is below its skyline
    """

    def __init__(self, corners: FloatArray, eyes: FloatArray) -> None:
        self.hidden = np.zeros(len(eyes), dtype=bool)
        way = corners[..., :2].mean(axis=1)
        length = np.hypot(way[:, 0], way[:, 1])
        # From straight above, all is at distance 0: no column is nearer.
        self._ahead = way / np.where(length > 0, length, 1.0)[:, None]
        self._eyes = eyes
        x, y = self._ahead[:, 0, None], self._ahead[:, 1, None]
        distances = corners[..., 0] * x + corners[..., 1] * y
        self._nearest = distances.min(axis=1)
        distances = np.maximum(distances, _NEAREST)
        u = (corners[..., 1] * x - corners[..., 0] * y) / distances
        s = corners[..., 2] / distances
        left, right = u.min(axis=1), u.max(axis=1)
        self._bins = left[:, None] + (right - left)[:, None] * _SHARES
        self._low, self._high = s.min(axis=1), s.max(axis=1)
        self._heights = np.full((len(eyes), len(_SHARES) - 1), -np.inf)

    def sift(self, lists: Lists, bodies: Bodies) -> tuple[IntArray, IntArray]:
        """Raises the skylines, and returns the bodies that may hide something above them.

        Parameters
        ----------
        lists : the bodies that may hide each actor, best the highest first
        bodies : all bodies

        Returns
        -------
        counts : [n] number of bodies of each actor; 0 for those that are hidden
        which : their numbers, one actor's after the other's
        """
        done, size, found = 0, _FIRST, []
        # Ever more at once: the first bodies hide most of the actors that are hidden.
        while len(rest := np.flatnonzero(~self.hidden & (lists.counts > done))):
            actor, which = lists.part(rest, done, size)
            found.append(self._edges(bodies, actor, which))
            self._raise(found[-1])
            self.hidden[rest] = (self._heights[rest] > self._high[rest, None]).all(axis=1)
            done, size = done + size, 2 * size
        edges = _Edges.joined(found)
        edges = edges.taken(~self.hidden[edges.actor])
        edges = edges.taken(self._stands_out(edges))
        edges = edges.taken(lists.in_strip(edges.actor, edges.body))
        order = np.argsort(edges.actor, kind="stable")
        return np.bincount(edges.actor, minlength=len(self.hidden)), edges.body[order]

    def _edges(self, bodies: Bodies, actor: IntArray, which: IntArray) -> "_Edges":
        """Returns the upper edges of bodies [m] before actors [m]."""
        (x, y), eyes = self._ahead[actor].T, self._eyes[actor]
        low, high = bodies.low[which] - eyes[:, :2], bodies.high[which] - eyes
        corners = [(a, b) for a in (low[:, 0], high[:, 0]) for b in (low[:, 1], high[:, 1])]
        distances = np.stack([a * x + b * y for a, b in corners])
        nearer = bodies.endless[which] & (distances.min(axis=0) > _NEAREST)
        nearer &= distances.max(axis=0) < self._nearest[actor]
        distances[:, ~nearer] = np.nan
        u = np.stack([b * x - a * y for a, b in corners]) / distances
        s = high[:, 2] / distances
        # Of the four corners, the chain through these three is never above the upper edge.
        three = np.stack([u.argmin(axis=0), s.argmax(axis=0), u.argmax(axis=0)])
        left, middle, right = np.take_along_axis(u, three, axis=0)
        at_left, peak, at_right = np.take_along_axis(s, three, axis=0)
        return _Edges(
            actor, which, left, right, middle, peak,
            _slope(peak - at_left, middle - left), _slope(peak - at_right, right - middle),
        )  # fmt: skip

    def _raise(self, edges: "_Edges") -> None:
        """Raises the skylines to edges, those of one actor one after the other."""
        if not len(edges.actor):
            return
        bins = self._bins[edges.actor]
        off = bins - edges.middle[:, None]
        fall = np.where(off < 0, -edges.rise[:, None], edges.fall[:, None]) * off
        heights = edges.peak[:, None] - fall - _MARGIN
        heights = np.minimum(heights[:, :-1], heights[:, 1:])
        spanned = (edges.left[:, None] <= bins[:, :-1]) & (bins[:, 1:] <= edges.right[:, None])
        heights[~spanned] = -np.inf
        first = np.flatnonzero(np.diff(edges.actor, prepend=-1))
        actors = edges.actor[first]
        raised = np.maximum.reduceat(heights, first, axis=0)
        self._heights[actors] = np.maximum(self._heights[actors], raised)

    def _stands_out(self, edges: "_Edges") -> BoolArray:
        """Returns an array [m], true for bodies that may be above the skyline, or take no part."""
        bins = self._bins[edges.actor]
        met = edges.left[:, None] <= bins[:, 1:] + _MARGIN
        met &= edges.right[:, None] >= bins[:, :-1] - _MARGIN
        least = np.maximum(self._heights[edges.actor], self._low[edges.actor, None] - _MARGIN)
        above = np.asarray((met & (edges.peak[:, None] >= least)).any(axis=1))
        return above | np.isnan(edges.peak)


class _Edges(NamedTuple):
    """Lines that the upper edges of m bodies are not below; nan for bodies that take no part."""

    actor: IntArray  # [m]
    body: IntArray  # [m]
    left: FloatArray  # [m] least u
    right: FloatArray  # [m] greatest u
    middle: FloatArray  # [m] u of the highest corner
    peak: FloatArray  # [m] its s
    rise: FloatArray  # [m] slope on its left
    fall: FloatArray  # [m] slope downward on its right

    @classmethod
    def joined(cls, parts: list["_Edges"]) -> "_Edges":
        """Returns the edges of several parts, one after the other."""
        none = np.zeros(0, dtype=np.int64)
        nothing = cls(none, none, *np.zeros((6, 0)))
        columns = zip(nothing, *parts, strict=True)
        return cls._make(np.concatenate(column) for column in columns)

    def taken(self, kept: BoolArray) -> "_Edges":
        """Returns the edges that are true in an array [m]."""
        which = np.flatnonzero(kept)
        return _Edges._make(column[which] for column in self)


def _slope(rise: FloatArray, run: FloatArray) -> FloatArray:
    """Returns rise / run; 0 where there is no run, for the line has no length there."""
    slope: FloatArray = np.where(run > 0, rise, 0.0) / np.where(run > 0, run, 1.0)
    return slope
