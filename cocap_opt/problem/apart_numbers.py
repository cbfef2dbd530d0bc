"""Numbers beside points of a map, placed so that none overlaps another."""

from collections.abc import Sequence

import numpy as np
from matplotlib.artist import Artist
from matplotlib.backend_bases import RendererBase
from matplotlib.lines import Line2D
from matplotlib.patheffects import withStroke
from matplotlib.text import Text
from matplotlib.transforms import IdentityTransform

from cocap_opt.data import FloatArray
from cocap_opt.problem.labels import placed

_MM = 25.4 / 72  # mm per point
_HALO = 2.0  # points
_DOT = 3.0  # points, diameter of a dot that no number may touch
_FAR = 3.0  # mm; from a number farther from its mark than this, a line leads to the mark
_PAD = 1.2  # mm; padding of a number's width and height


class ApartNumbers(Artist):
    """Numbers of points, each beside its point; points outside the axes have none.

    If a number had to be placed farther away, a line leads to its point.

    Parameters
    ----------
    points : [n, 2] in the units of the axes
    colours : colours of the numbers 0, 1, ..
    size : font size, points
    discs : [k, 2] middles of discs that must not be hidden, in the units of the axes
    disc : width of a disc, points
    marks : [n] widths of the marks of points, in the units of the axes (default: dots)
    """

    def __init__(
        self, points: FloatArray, colours: Sequence[str], size: float,
        discs: FloatArray, disc: float, marks: FloatArray | None = None,
    ) -> None:  # fmt: skip
        super().__init__()
        self._marks = np.zeros(len(points)) if marks is None else marks
        self._points, self._discs, self._disc = points, discs.reshape(-1, 2), disc
        self.texts = [
            Text(
                0, 0, str(number), color=colour, fontsize=size, weight="bold", ha="center",
                va="center_baseline", transform=IdentityTransform(),
                path_effects=[withStroke(linewidth=_HALO, foreground="white")],
            )
            for number, colour in enumerate(colours)
        ]  # fmt: skip
        self.set_in_layout(False)  # people may be far off the map

    def get_children(self) -> list[Artist]:
        """Returns the numbers, so that matplotlib finds them like other text."""
        return [*self.texts]

    def draw(self, renderer: RendererBase) -> None:
        """Draw the numbers where there is room; by now the limits of the axes are final."""
        figure = self.get_figure(root=True)
        if self.axes is None or figure is None or not self.get_visible():
            return
        px = float(np.asarray(renderer.points_to_pixels(1.0), dtype=float)) / _MM  # px per mm
        room = self.axes.get_window_extent(renderer)
        corner, size = np.array([room.x0, room.y0]), np.array([room.width, room.height]) / px
        points, discs = (
            (np.asarray(self.axes.transData.transform(places), dtype=float) - corner) / px
            for places in (self._points, self._discs)
        )
        inside = ((points >= 0) & (points <= size)).all(axis=1)
        shown = np.flatnonzero(inside).tolist()
        for text in self.texts:
            text.set_figure(figure)
        boxes = [self.texts[k].get_window_extent(renderer) for k in shown]
        sizes = np.array([[box.width, box.height] for box in boxes]).reshape(-1, 2) / px + _PAD
        scale = self.axes.transData.get_matrix()[0, 0] / px  # mm per unit of the axes
        wide = np.maximum(self._marks * scale, _DOT * _MM)[:, None]
        taken = np.concatenate([
            np.stack([discs, np.full_like(discs, self._disc * _MM)], axis=1),
            np.stack([points, np.broadcast_to(wide, points.shape)], axis=1)[shown],
        ])  # fmt: skip
        middles = placed(points[shown], sizes, tuple(size.tolist()), np.zeros((0, 2)), taken)
        for k, middle in zip(shown, middles, strict=True):
            self.texts[k].set_position(tuple((middle * px + corner).tolist()))
            if np.hypot(*(middle - points[k])) > _FAR + wide[k, 0] / 2:
                ends = np.stack([middle, points[k]]) * px + corner
                line = Line2D(*ends.T, lw=0.7, color=self.texts[k].get_color())
                line.set_figure(figure)
                line.draw(renderer)
        for k in shown:
            self.texts[k].draw(renderer)
