"""The bodies that can hide an actor from an eye, found by direction and slope.

Seen from above, a camera and the circle around an actor span a fan. A body can hide the actor
only if it meets the fan and is higher there than the lowest line of sight. Let D be the way from
the actor's middle to the nearest point of the body, r the circle's radius, and h and z the heights
of the body and of the eye above the actor's foot. A line of sight that passes the body is at a
share of at least (D - r) / (D_eye - r) of the way to the eye, so that the body is out of the way if

    h / (D - r) < z / (D_eye - r).

Directions around each actor are divided into sectors. Each sector has the list of the bodies that
reach into the fans of its eyes, the steepest first.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cocap_opt.arithmetic import spans
from cocap_opt.data import BoolArray, FloatArray, IntArray
from cocap_opt.vision.bodies import Bodies

_SECTORS = 128
_ROUNDING = 1e-9  # of slopes and directions, much more than that of computing them
_PAIRS = 50_000  # of targets and bodies at once, so that they stay in the processor's cache
_MOST_SECTORS = 2**16  # at once: their numbers have 16 bits
_GRAIN = 2.0**-30  # of keys, so that a slope's part does not depend on the sector's number


class Candidates:
    """The bodies that can hide each of several targets.

    Parameters
    ----------
    bodies : all of them
    middles, radii, feet : [G, 2], [G] and [G] m, of upright cylinders around the targets
    lowest_eye : m, no eye is lower

    Attributes
    ----------
    bodies : all of them
    tops, middles, halves : [B] m, [B, 2] m and [B, 2] m, of the bodies along z, and x and y
    around, radii : [G, 2] m and [G] m, the given middles and radii of the cylinders
    numbers, nearest : of each entry of a list, its body, and that one's least distance (m)
    """

    def __init__(
        self, bodies: Bodies, middles: FloatArray, radii: FloatArray, feet: FloatArray,
        lowest_eye: float,
    ) -> None:  # fmt: skip
        self.bodies, self.tops = bodies, bodies.high[:, 2]
        targets = self.around, self.radii, self._feet = middles, radii, feet
        self.middles = (bodies.low + bodies.high[:, :2]) / 2
        self.halves = (bodies.high[:, :2] - bodies.low) / 2
        n, size = len(radii), _PAIRS // max(len(self.tops), 1)
        size = min(max(size, 1), _MOST_SECTORS // _SECTORS)
        parts = [
            _entries(bodies, targets, np.arange(first, min(first + size, n)), lowest_eye)
            for first in range(0, n, size)
        ]
        keys, self.numbers, self.nearest = (
            np.concatenate([part[k] for part in parts]) if parts else np.zeros(0) for k in range(3)
        )
        self._keys = keys
        self._starts = np.searchsorted(keys, np.arange(n * _SECTORS))

    def of(self, targets: IntArray, eyes: FloatArray) -> "Lists":
        """Returns lists of the bodies that may hide targets [n] from eyes [n, 3]."""
        way = eyes[:, :2] - self.around[targets]
        away = np.hypot(way[:, 0], way[:, 1])
        radius, foot = self.radii[targets], self._feet[targets]
        up = eyes[:, 2] - foot
        slope = np.where(up >= 0, np.inf, -np.inf)
        sloping = np.flatnonzero((up >= 0) & (away > radius))
        slope[sloping] = up[sloping] / (away - radius)[sloping]
        sector = targets * _SECTORS + _sector(np.arctan2(way[:, 1], way[:, 0])) % _SECTORS
        first = self._starts[sector]
        ends = np.searchsorted(self._keys, sector + _fall(slope) + 4 * _GRAIN, side="right")
        low = np.minimum(eyes[:, 2], foot)
        # What reaches beyond the eye is out of the way, unless it is around the target.
        reach = np.maximum(away, np.nextafter(radius, np.inf))
        return Lists(self, targets, first, ends - first, way, away, reach, low)


class Lists(NamedTuple):
    """Lists of the bodies that may hide n targets, the steepest first."""

    candidates: Candidates
    targets: IntArray  # [n]
    first: IntArray  # [n] entry that each list begins with
    counts: IntArray  # [n] number of entries
    way: FloatArray  # [n, 2] m, from the target's middle to the eye
    away: FloatArray  # [n] m, its length
    reach: FloatArray  # [n] m; bodies that are no nearer to the target are beyond the eye
    low: FloatArray  # [n] m; bodies that are no higher are below all lines of sight

    def part(self, rows: IntArray, done: int, size: int) -> tuple[IntArray, IntArray]:
        """Returns bodies of some lists, from entry `done` on up to `size` of each.

        Returns
        -------
        rows, bodies : [m] each, the number of the list, in the order given, and that of the body
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
        """Returns an array [m], true for bodies that meet the strip around target and eye."""
        found, targets, way = self.candidates, self.targets[rows], self.way[rows]
        with np.errstate(divide="ignore", invalid="ignore"):
            across = np.stack([-way[:, 1], way[:, 0]], axis=1) / self.away[rows][:, None]
        off = found.middles[bodies] - found.around[targets]
        aside = np.abs((across * off).sum(axis=1))
        reach = (np.abs(across) * found.halves[bodies]).sum(axis=1) + found.radii[targets]
        return np.asarray(~(aside > reach * (1 + _ROUNDING)))


def _entries(
    bodies: Bodies, targets: tuple[FloatArray, ...], which: IntArray, lowest_eye: float
) -> tuple[FloatArray, NDArray[np.int32], FloatArray]:
    """Returns the keys, bodies and least distances (m) of all entries of some targets' sectors."""
    middles, radii, feet = (part[which] for part in targets)
    low, high, tops = bodies.low, bodies.high[:, :2], bodies.high[:, 2]
    row, body = np.nonzero(tops[None] > np.minimum(feet, lowest_eye)[:, None])
    middle, radius = middles[row], radii[row]
    a, b = low[body] - middle, high[body] - middle
    off = np.maximum(np.maximum(a, -b), 0.0)
    nearest = np.hypot(off[:, 0], off[:, 1])
    around = nearest <= radius * (1 + _ROUNDING)
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
    first = _sector(base + np.minimum.reduce(turns) - widening - _ROUNDING)
    last = _sector(base + np.maximum.reduce(turns) + widening + _ROUNDING)
    counts = np.where(around, _SECTORS, np.minimum(last - first + 1, _SECTORS))
    fall = _fall(slope)
    steepest = np.argsort(fall, kind="stable")
    counts = counts[steepest]
    sector = row[steepest].repeat(counts) * _SECTORS + spans(first[steepest], counts) % _SECTORS
    # Numbers of 16 bits are sorted in a time that grows with their number only.
    order = np.argsort(sector.astype(np.uint16), kind="stable")
    entry = steepest.repeat(counts)[order]
    # There may be millions of entries: numbers of 32 bits take half of the time and memory.
    held = body.astype(np.int32)[entry]
    return which[0] * _SECTORS + sector[order] + fall[entry], held, nearest[entry]


def _sector(angle: FloatArray) -> IntArray:
    """Returns the numbers of the sectors that hold angles (rad), not brought into one turn."""
    result: IntArray = np.floor(angle * (_SECTORS / math.tau)).astype(np.int64)
    return result


def _fall(slope: FloatArray) -> FloatArray:
    """Returns numbers from 0 to 0.8 that increase with the slope's fall.

    With a sector's number they make keys, and stay below those of the next sector.
    """
    result: FloatArray = np.rint((0.4 - 0.8 / math.pi * np.arctan(slope)) / _GRAIN) * _GRAIN
    return result
