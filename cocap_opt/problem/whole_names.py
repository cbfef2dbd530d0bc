"""Names on a map that are drawn completely or not at all."""

from collections.abc import Iterator
from typing import Any

import numpy as np
from matplotlib.axes._base import _AxesBase
from matplotlib.backend_bases import RendererBase
from matplotlib.text import Text
from matplotlib.transforms import Bbox

from cocap_opt.problem.land_cover import LandCover

_MARGIN = 4  # px, between a name and the edges of its axes
_MOST_MOVED = 1 / 3  # of the width of a name


class WholeName(Text):
    """The name of an area in axes, inside the part of the area that the axes show.

    A name that an edge of the axes would cut is moved inwards, by up to a third of its width. It is
    left out if that is not enough, or if a disc, a cross or another text is there.
    """

    def __init__(self, area: LandCover, **looks: Any) -> None:
        super().__init__(text=area.name or "", ha="center", va="center", **looks)
        self._area = area
        self._drawn: Bbox | None = None  # px, of the last drawing; None: it was left out

    def draw(self, renderer: RendererBase) -> None:
        """Draw the text if there is room for it in the axes, whose limits are only now final."""
        self._drawn = None
        if self.axes is None:
            return
        view = self.axes.viewLim
        place = self._area.label_in(np.array(view.min), np.array(view.max))
        if place is None:
            return
        self.set_position(place)
        room = self.axes.get_window_extent(renderer).padded(-_MARGIN)
        name = self.get_window_extent(renderer)
        if name.width > room.width or name.height > room.height:
            return
        low, high = (np.subtract(*ends) for ends in ((room.min, name.min), (room.max, name.max)))
        moved = np.clip(0.0, low, high)
        if abs(moved[0]) > _MOST_MOVED * name.width:
            return
        to_px = self.axes.transData
        x, y = to_px.inverted().transform(to_px.transform(place) + moved).tolist()
        self.set_position((x, y))
        name = name.translated(*moved.tolist())
        if any(name.overlaps(other) for other in (*_marks(self.axes), *self._texts(renderer))):
            return
        self._drawn = name
        super().draw(renderer)

    def _texts(self, renderer: RendererBase) -> Iterator[Bbox]:
        """Yields rectangles (px) around the names that were drawn before, and all other texts."""
        assert self.axes is not None
        is_before = True
        for other in self.axes.texts:
            is_before &= other is not self
            if not isinstance(other, WholeName):
                yield other.get_window_extent(renderer)
            elif is_before and other._drawn is not None:
                yield other._drawn


def _marks(axes: _AxesBase) -> Iterator[Bbox]:
    """Yields squares (px) around the discs, rings and crosses in axes."""
    for line in axes.lines:
        if line.get_marker() in ("o", "x"):
            far = line.get_markersize() / 2 * axes.figure.dpi / 72
            places = axes.transData.transform(np.array(line.get_xydata(), dtype=np.float64))
            yield from (Bbox([[x - far, y - far], [x + far, y + far]]) for x, y in places.tolist())
