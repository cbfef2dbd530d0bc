"""Names on a map that are drawn completely or not at all."""

from matplotlib.backend_bases import RendererBase
from matplotlib.text import Text


class WholeName(Text):
    """Text in axes, left out if an edge of the axes would cut it."""

    def draw(self, renderer: RendererBase) -> None:
        """Draw the text if it fits into the axes, whose limits are final only at this point."""
        if self.axes is None:
            return
        room, name = self.axes.get_window_extent(renderer), self.get_window_extent(renderer)
        if room.x0 <= name.x0 and name.x1 <= room.x1 and room.y0 <= name.y0 and name.y1 <= room.y1:
            super().draw(renderer)
