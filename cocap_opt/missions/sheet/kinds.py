"""Kinds of cells on a sheet's maps, with edges, tones and hatches that are distinct in grey
prints.
"""

from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.patches import Patch, PathPatch
from matplotlib.path import Path

from cocap_opt.data import BoolArray, FloatArray
from cocap_opt.problem.pictures import TopView

FREE = "#ffffff"


class Kind(NamedTuple):
    """A kind of cells of the map: its text in the legend, and its style.

    Attributes
    ----------
    width : width of the edge, points
    hatch : a hatch of matplotlib; empty for none
    """

    words: str
    fill: str
    edge: str
    width: float
    hatch: str = ""

    @property
    def patch(self) -> Patch:
        """Its mark in the legend."""
        return Patch(fc=self.fill, ec=self.edge, lw=self.width, hatch=self.hatch, label=self.words)


# By number in `TopView.kinds`.
KINDS = {
    1: Kind("obstacle above or below drones", "#ffffff", "#8c8c8c", 0.5, "////"),
    2: Kind("obstacle as high as drones fly", "#a6a6a6", "#000000", 1.2),
    3: Kind("lower obstacle", "#dcdcdc", "#6e6e6e", 0.5),
    4: Kind("drones would be above the ceiling", "#ffffff", "#505050", 0.5, "...."),
}


def draw_kinds(ax: Axes, ground: TopView, ends: FloatArray) -> None:
    """Draws the edges and hatches of all kinds of cells except free ground.

    Parameters
    ----------
    ends : [2, 2] limits of x and of y of the drawn part, m
    """
    corner, shape = np.array(ground.corner), np.array(ground.kinds.shape)
    cells = (ends - corner[:, None]) / ground.cell
    (x0, y0), (x1, y1) = np.clip(np.rint(cells.T).astype(int) + np.array([[-1], [1]]), 0, shape)
    shown, origin = ground.kinds[x0:x1, y0:y1], corner + ground.cell * np.array([x0, y0])
    for number, kind in KINDS.items():
        edges = _edges(shown == number)
        if not len(edges):
            continue
        lines = [*(origin + ground.cell * edges)]
        ax.add_collection(LineCollection(lines, colors=kind.edge, linewidths=kind.width,
                                         capstyle="round", zorder=0.8), autolim=False)  # fmt: skip
        if kind.hatch:
            squares = np.argwhere(shown == number)[:, None] + [[0, 0], [1, 0], [1, 1], [0, 1]]
            path = Path.make_compound_path(
                *(Path([*square, square[0]], closed=True)
                  for square in origin + ground.cell * squares)
            )  # fmt: skip
            ax.add_patch(PathPatch(path, fc="none", ec=kind.edge, lw=0, hatch=kind.hatch,
                                   zorder=0.7))  # fmt: skip


def _edges(inside: BoolArray) -> FloatArray:
    """Returns the edges [n, 2, 2] (cells) between cells inside [X, Y] and cells outside."""
    framed = np.pad(inside, 1)
    across = np.argwhere(framed[1:, 1:-1] != framed[:-1, 1:-1])
    along = np.argwhere(framed[1:-1, 1:] != framed[1:-1, :-1])
    found = (np.stack([at, at + way], axis=1) for at, way in ((across, [0, 1]), (along, [1, 0])))
    return np.concatenate([*found]).astype(float)
