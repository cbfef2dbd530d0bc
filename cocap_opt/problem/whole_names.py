"""Names on a map that are drawn completely or not at all."""

from collections.abc import Iterator

import numpy as np
from matplotlib.axes._base import _AxesBase
from matplotlib.backend_bases import RendererBase
from matplotlib.text import Text


class WholeName(Text):
    """Text in axes that is left out if an edge of the axes would cut it or a disc would hide part
    of it.
    """

    def draw(self, renderer: RendererBase) -> None:
        """Draw the text if it fits into the axes, whose limits are only now final."""
        if self.axes is None:
            return
        room, name = self.axes.get_window_extent(renderer), self.get_window_extent(renderer)
        fits = room.x0 <= name.x0 and name.x1 <= room.x1 and room.y0 <= name.y0 < name.y1 <= room.y1
        if fits and not any(
            name.x0 < x + far and x - far < name.x1 and name.y0 < y + far and y - far < name.y1
            for x, y, far in _discs(self.axes)
        ):
            super().draw(renderer)


def _discs(axes: _AxesBase) -> Iterator[tuple[float, float, float]]:
    """Yields the middles and radii (px) of the discs and rings in axes."""
    for line in axes.lines:
        if line.get_marker() == "o":
            far = line.get_markersize() / 2 * axes.figure.dpi / 72
            places = axes.transData.transform(np.array(line.get_xydata(), dtype=np.float64))
            yield from ((float(x), float(y), far) for x, y in places)
