"""Arrows where the edge of a top view cuts a no-fly zone, which show that the zone continues."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from cocap_opt.data import FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes

CUT = "no-fly zone continues"  # in legends
_APART = 1 / 16  # minimum distance between two arrows, relative to the longer side of the picture
_SIZE = 7.0  # points


class Cut(NamedTuple):
    """An arrow: its middle x, y (m) on an edge, and matplotlib's mark that points outwards."""

    x: float
    y: float
    mark: str


def cuts(zones: Sequence[FloatArray], low: FloatArray, high: FloatArray) -> list[Cut]:
    """Returns arrows along the edges that cut a zone, some distance apart, at least one per cut.

    Parameters
    ----------
    zones : triangles [n, 3, 2 or 3] (m) of each zone
    low, high : [2] m, the corners of the picture
    """
    triangles = np.concatenate([np.zeros((0, 3, 2)), *(zone[..., :2] for zone in zones)])
    apart = _APART * float((high - low).max())
    found = []
    for axis, marks in ((0, "<>"), (1, "v^")):
        for at, mark in zip((float(low[axis]), float(high[axis])), marks, strict=True):
            for begin, end in _crossed(triangles, axis, at):
                begin, end = max(begin, float(low[1 - axis])), min(end, float(high[1 - axis]))
                count = max(round((end - begin) / apart), 1) if begin < end else 0
                for k in range(count):
                    along = begin + (k + 0.5) * (end - begin) / count
                    found.append(Cut(at, along, mark) if axis == 0 else Cut(along, at, mark))
    return found


def draw_cuts(ax: Axes, zones: Sequence[FloatArray], colour: str) -> None:
    """Draws the arrows of zones in axes whose limits are final."""
    (left, right), (low, high) = ax.get_xlim(), ax.get_ylim()
    for x, y, mark in cuts(zones, np.array([left, low]), np.array([right, high])):
        ax.plot(x, y, marker=mark, color=colour, mec="white", mew=0.7, ms=_SIZE, ls="none",
                clip_on=False, zorder=10)  # fmt: skip


def _crossed(triangles: FloatArray, axis: int, at: float) -> Iterator[tuple[float, float]]:
    """Yields the merged parts, within triangles, of the line on which one coordinate is `at`."""
    across, along = triangles[..., axis], triangles[..., 1 - axis]
    passed = (across.min(axis=1) < at) & (across.max(axis=1) > at)
    across, along = across[passed], along[passed]
    a, b = across, np.roll(across, -1, axis=1)
    meets = (a < at) != (b < at)  # sides that the line crosses: two of each triangle it meets
    share = (at - a) / np.where(meets, b - a, 1.0)
    met = along + share * (np.roll(along, -1, axis=1) - along)
    begins = np.where(meets, met, np.inf).min(axis=1)
    ends = np.where(meets, met, -np.inf).max(axis=1)
    begin, end = np.inf, -np.inf
    for first, last in sorted(zip(begins.tolist(), ends.tolist(), strict=True)):
        if first > end and begin < end:
            yield begin, end
        begin, end = (first, last) if first > end else (begin, max(end, last))
    if begin < end:
        yield begin, end
