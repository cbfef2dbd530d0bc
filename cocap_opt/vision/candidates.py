"""Finds the bodies that can hide an actor from an eye, by direction and slope.

Seen from above, a camera and the circle around an actor span a fan. A body can hide the actor only
if it meets the fan and is higher there than the lowest line of sight. Let D be the distance from
the actor's middle to the nearest point of the body, r the circle's radius, and h and z the heights
of the body and of the eye above the actor's foot. A line of sight that passes the body is at least
at the share (D - r) / (D_eye - r) of the way to the eye, so the body cannot hide the actor if

    h / (D - r) < z / (D_eye - r).

Directions around each actor are divided into sectors. Each sector has a list of the bodies that
reach into the fans of its eyes, steepest first.

If all eyes are known to be in some upright boxes, columns outside the bounding boxes of each of
these and the actor are not listed. One of their own sides separates them from all lines of sight,
so their shadows would miss the actor.

The skyline of the columns in front of an actor makes it possible to skip columns that hide nothing
on their own. Let r be the distance along the level way to the actor's middle, u = aside / r and s =
up / r, as in the image of a level camera. A column has no lower end, so a point behind it is hidden
if it is below the column's upper edge, a concave chain of lines over u. The actor's span of u is
divided into bins. In each bin, the skyline is the highest upper edge of the columns that span the
bin, each edge taken at its lowest point there. Everything below the skyline is hidden, and a column
that is nowhere above it hides nothing that others do not hide.

So columns can hide together what none of them hides alone, and only a few remain whose shadows must
be cut out. Only columns that are entirely closer than the actor are used.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cocap_opt.arithmetic import spans
from cocap_opt.data import BoolArray, FloatArray, IntArray
from cocap_opt.vision.bodies import Bodies

SECTORS = 128
ROUNDING = 1e-9  # tolerance for slopes and directions; much more than their rounding
_PAIRS = 50_000  # targets times bodies at once; fits into the processor's cache
_MOST_SECTORS = 2**16  # sectors at once: their numbers have 16 bits
_BESIDE = 1.0  # m; margin by which a column must be outside to be skipped
# resolution of keys, so that a slope's part does not depend on the sector's number
GRAIN = 2.0**-30


class Candidates:
    """The bodies that can hide each of several targets.

    Parameters
    ----------
    bodies : all of them
    middles, radii, feet : [G, 2], [G] and [G] m, of upright cylinders around the targets
    lowest_eye : lowest altitude of an eye, m
    within : [K, 4] m, smallest and largest x and y of upright boxes that contain all eyes (default:
        eyes may be anywhere)

    Attributes
    ----------
    bodies : all of them
    tops, middles, halves : [B], [B, 2] and [B, 2] m, tops of the bodies, and middles and half sizes
        along x and y
    around, radii, feet : [G, 2], [G] and [G] m, of the cylinders, as given
    keys, numbers, nearest : for each entry of a list, its sector and slope as one increasing
        number, its body, and the body's minimum distance (m)
    starts : [128 G + 1] first entry of each sector
    """

    def __init__(
        self, bodies: Bodies, middles: FloatArray, radii: FloatArray, feet: FloatArray,
        lowest_eye: float, within: FloatArray | None = None,
    ) -> None:  # fmt: skip
        self.bodies, self.tops = bodies, bodies.high[:, 2]
        targets = self.around, self.radii, self.feet = middles, radii, feet
        self.middles = (bodies.low + bodies.high[:, :2]) / 2
        self.halves = (bodies.high[:, :2] - bodies.low) / 2
        n, size = len(radii), _PAIRS // max(len(self.tops), 1)
        size = min(max(size, 1), _MOST_SECTORS // SECTORS)
        parts = [
            _entries(bodies, targets, np.arange(first, min(first + size, n)), lowest_eye, within)
            for first in range(0, n, size)
        ]
        keys, self.numbers, self.nearest = (
            np.concatenate([part[k] for part in parts]) if parts else np.zeros(0) for k in range(3)
        )
        self.keys = keys
        self.starts = np.searchsorted(keys, np.arange(n * SECTORS + 1))

    @property
    def nbytes(self) -> int:
        """Size of the lists in bytes."""
        lists = self.keys, self.numbers, self.nearest, self.starts
        return sum(part.nbytes for part in lists)

    def of(self, targets: IntArray, eyes: FloatArray) -> "Lists":
        """Returns lists of the bodies that may hide targets [n] from eyes [n, 3]."""
        way = eyes[:, :2] - self.around[targets]
        away = np.hypot(way[:, 0], way[:, 1])
        radius, foot = self.radii[targets], self.feet[targets]
        up = eyes[:, 2] - foot
        slope = np.where(up >= 0, np.inf, -np.inf)
        sloping = np.flatnonzero((up >= 0) & (away > radius))
        slope[sloping] = up[sloping] / (away - radius)[sloping]
        sector = targets * SECTORS + _sector(np.arctan2(way[:, 1], way[:, 0])) % SECTORS
        first = self.starts[sector]
        ends = np.searchsorted(self.keys, sector + _fall(slope) + 4 * GRAIN, side="right")
        low = np.minimum(eyes[:, 2], foot)
        # Bodies beyond the eye hide nothing, unless they surround the target.
        reach = np.maximum(away, np.nextafter(radius, np.inf))
        return Lists(self, targets, first, ends - first, way, away, reach, low)


class Lists(NamedTuple):
    """Lists of the bodies that may hide n targets, steepest first."""

    candidates: Candidates
    targets: IntArray  # [n]
    first: IntArray  # [n] first entry of each list
    counts: IntArray  # [n] number of entries
    way: FloatArray  # [n, 2] m, from the target's middle to the eye
    away: FloatArray  # [n] m, length of this vector
    reach: FloatArray  # [n] m; bodies that are no closer to the target are beyond the eye
    low: FloatArray  # [n] m; bodies that are no higher are below all lines of sight

    def part(self, rows: IntArray, done: int, size: int) -> tuple[IntArray, IntArray]:
        """Returns bodies of some lists, up to `size` of each, from entry `done` on.

        Returns
        -------
        rows, bodies : [m] each, number of the list, in the given order, and number of the body
        """
        take = np.minimum(self.counts[rows] - done, size)
        row = np.repeat(rows, take)
        entries = spans(self.first[rows] + done, take)
        found = self.candidates
        bodies = found.numbers[entries].astype(np.int64)
        between = (found.nearest[entries] < self.reach[row]) & (found.tops[bodies] > self.low[row])
        kept = np.flatnonzero(between)
        return row[kept], bodies[kept]

    def in_strip(self, rows: IntArray, bodies: IntArray) -> BoolArray:
        """Returns an array [m], True for bodies that meet the strip from target to eye."""
        found, targets, way = self.candidates, self.targets[rows], self.way[rows]
        with np.errstate(divide="ignore", invalid="ignore"):
            across = np.stack([-way[:, 1], way[:, 0]], axis=1) / self.away[rows][:, None]
        off = found.middles[bodies] - found.around[targets]
        aside = np.abs((across * off).sum(axis=1))
        reach = (np.abs(across) * found.halves[bodies]).sum(axis=1) + found.radii[targets]
        return np.asarray(~(aside > reach * (1 + ROUNDING)))


def _entries(
    bodies: Bodies, targets: tuple[FloatArray, ...], which: IntArray, lowest_eye: float,
    within: FloatArray | None,
) -> tuple[FloatArray, NDArray[np.int32], FloatArray]:  # fmt: skip
    """Returns keys, bodies and minimum distances (m) of all entries of some targets' sectors."""
    middles, radii, feet = (part[which] for part in targets)
    low, high, tops = bodies.low, bodies.high[:, :2], bodies.high[:, 2]
    listed = tops[None] > np.minimum(feet, lowest_eye)[:, None]
    if within is not None:
        listed &= _may_be_between(bodies, middles, radii, within)
    row, body = np.nonzero(listed)
    middle, radius = middles[row], radii[row]
    a, b = low[body] - middle, high[body] - middle
    off = np.maximum(np.maximum(a, -b), 0.0)
    nearest = np.hypot(off[:, 0], off[:, 1])
    around = nearest <= radius * (1 + ROUNDING)
    with np.errstate(divide="ignore", invalid="ignore"):
        slope = np.where(around, np.inf, (tops[body] - feet[row]) / (nearest - radius))
        widening = np.arcsin(np.minimum(radius / nearest, 1.0))
    slope[tops[body] <= feet[row]] = -np.inf
    centre = (a + b) / 2
    turns = [
        np.arctan2(
            centre[:, 0] * y[:, 1] - centre[:, 1] * x[:, 0],
            centre[:, 0] * x[:, 0] + centre[:, 1] * y[:, 1],
        )
        for x in (a, b)
        for y in (a, b)
    ]
    base = np.arctan2(centre[:, 1], centre[:, 0])
    first = _sector(base + np.minimum.reduce(turns) - widening - ROUNDING)
    last = _sector(base + np.maximum.reduce(turns) + widening + ROUNDING)
    counts = np.where(around, SECTORS, np.minimum(last - first + 1, SECTORS))
    fall = _fall(slope)
    steepest = np.argsort(fall, kind="stable")
    counts = counts[steepest]
    sector = row[steepest].repeat(counts) * SECTORS + spans(first[steepest], counts) % SECTORS
    # Sorting 16-bit numbers takes linear time.
    order = np.argsort(sector.astype(np.uint16), kind="stable")
    entry = steepest.repeat(counts)[order]
    # There may be millions of entries: 32-bit numbers take half of the time and memory.
    held = body.astype(np.int32)[entry]
    return which[0] * SECTORS + sector[order] + fall[entry], held, nearest[entry]


def _may_be_between(
    bodies: Bodies, middles: FloatArray, radii: FloatArray, within: FloatArray
) -> BoolArray:
    """Returns an array [n, B], False for columns that are outside all ways from boxes to
    targets.
    """
    found = np.tile(~bodies.endless, (len(radii), 1))
    reach = radii[:, None] + _BESIDE
    for box in within:
        low = np.minimum(box[:2] - _BESIDE, middles - reach)
        high = np.maximum(box[2:] + _BESIDE, middles + reach)
        meets = np.ones_like(found)
        for k in range(2):
            meets &= bodies.low[:, k] <= high[:, k, None]
            meets &= bodies.high[:, k] >= low[:, k, None]
        found |= meets
    return found


def _sector(angle: FloatArray) -> IntArray:
    """Returns the numbers of the sectors that contain angles (rad), not reduced to one turn."""
    result: IntArray = np.floor(angle * (SECTORS / math.tau)).astype(np.int64)
    return result


def _fall(slope: FloatArray) -> FloatArray:
    """Returns numbers from 0 to 0.8 that increase as the slope decreases.

    Added to a sector's number they form keys that stay below those of the next sector.
    """
    result: FloatArray = np.rint((0.4 - 0.8 / math.pi * np.arctan(slope)) / GRAIN) * GRAIN
    return result


BINS = 8
# relative positions, in the span of u, at which bins begin and end
SHARES = np.linspace(0, 1, BINS + 1)
_FIRST = 2  # columns of each actor that are examined first, steepest first
MARGIN = 1e-9  # tolerance for u and s; much more than their rounding
NEAREST = 1e-2  # m; nearer columns appear too large to be compared


class Skyline:
    """The skylines in front of n actors, one for each.

    Parameters
    ----------
    corners : [n, C, 3] m, corners of the actors, relative to the eyes
    eyes : [n, 3] m

    Attributes
    ----------
    hidden : [n] True if the whole actor is below its skyline
    """

    def __init__(self, corners: FloatArray, eyes: FloatArray) -> None:
        self.hidden = np.zeros(len(eyes), dtype=bool)
        way = corners[..., :2].mean(axis=1)
        length = np.hypot(way[:, 0], way[:, 1])
        # From directly above, everything is at distance 0: no column is nearer.
        self._ahead = way / np.where(length > 0, length, 1.0)[:, None]
        self._eyes = eyes
        x, y = self._ahead[:, 0, None], self._ahead[:, 1, None]
        distances = corners[..., 0] * x + corners[..., 1] * y
        self._nearest = distances.min(axis=1)
        distances = np.maximum(distances, NEAREST)
        u = (corners[..., 1] * x - corners[..., 0] * y) / distances
        s = corners[..., 2] / distances
        left, right = u.min(axis=1), u.max(axis=1)
        self._bins = left[:, None] + (right - left)[:, None] * SHARES
        self._low, self._high = s.min(axis=1), s.max(axis=1)
        self._heights = np.full((len(eyes), BINS), -np.inf)

    def sift(self, lists: Lists, bodies: Bodies) -> tuple[IntArray, IntArray]:
        """Raises the skylines, and returns the bodies that may hide something above them.

        Parameters
        ----------
        lists : the bodies that may hide each actor, preferably highest first
        bodies : all bodies

        Returns
        -------
        counts : [n] number of bodies of each actor; 0 for those that are hidden
        which : their numbers, actor by actor
        """
        done, size, found = 0, _FIRST, []
        # More and more at once: the first bodies hide most of the hidden actors.
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
        """Returns the upper edges of bodies [m] in front of actors [m]."""
        (x, y), eyes = self._ahead[actor].T, self._eyes[actor]
        low, high = bodies.low[which] - eyes[:, :2], bodies.high[which] - eyes
        corners = [(a, b) for a in (low[:, 0], high[:, 0]) for b in (low[:, 1], high[:, 1])]
        distances = np.stack([a * x + b * y for a, b in corners])
        nearer = bodies.endless[which] & (distances.min(axis=0) > NEAREST)
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
        """Raises the skylines to edges; edges of the same actor are applied one after the other."""
        if not len(edges.actor):
            return
        bins = self._bins[edges.actor]
        off = bins - edges.middle[:, None]
        fall = np.where(off < 0, -edges.rise[:, None], edges.fall[:, None]) * off
        heights = edges.peak[:, None] - fall - MARGIN
        heights = np.minimum(heights[:, :-1], heights[:, 1:])
        spanned = (edges.left[:, None] <= bins[:, :-1]) & (bins[:, 1:] <= edges.right[:, None])
        heights[~spanned] = -np.inf
        first = np.flatnonzero(np.diff(edges.actor, prepend=-1))
        actors = edges.actor[first]
        raised = np.maximum.reduceat(heights, first, axis=0)
        self._heights[actors] = np.maximum(self._heights[actors], raised)

    def _stands_out(self, edges: "_Edges") -> BoolArray:
        """Returns an array [m], True for bodies that may exceed the skyline, or that it does not
        consider.
        """
        bins = self._bins[edges.actor]
        met = edges.left[:, None] <= bins[:, 1:] + MARGIN
        met &= edges.right[:, None] >= bins[:, :-1] - MARGIN
        least = np.maximum(self._heights[edges.actor], self._low[edges.actor, None] - MARGIN)
        above = np.asarray((met & (edges.peak[:, None] >= least)).any(axis=1))
        return above | np.isnan(edges.peak)


class _Edges(NamedTuple):
    """Lower bounds on the upper edges of m bodies, as lines; nan for bodies that are not used."""

    actor: IntArray  # [m]
    body: IntArray  # [m]
    left: FloatArray  # [m] smallest u
    right: FloatArray  # [m] greatest u
    middle: FloatArray  # [m] u of the highest corner
    peak: FloatArray  # [m] s of that corner
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
        """Returns the edges for which an array [m] is True."""
        which = np.flatnonzero(kept)
        return _Edges._make(column[which] for column in self)


def _slope(rise: FloatArray, run: FloatArray) -> FloatArray:
    """Returns rise / run; 0 if run is 0, as the line then has no length."""
    slope: FloatArray = np.where(run > 0, rise, 0.0) / np.where(run > 0, run, 1.0)
    return slope
