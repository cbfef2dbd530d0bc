"""A figure of people and steps, coloured by the number of cameras, drawn by matplotlib.

It is imported only when something is drawn.
"""

from __future__ import annotations

from itertools import groupby
from typing import TYPE_CHECKING, overload

from cocap_opt.data import BoolArray, FloatArray, IntArray
from cocap_opt.text import printable, shortened

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from cocap_opt.problem.pictures import WholeAxes

# Fill, colour of hatching, pattern and name for no camera (which `_draw_legend` names), one, two,
# three or more. In grey prints, and for colour-blind readers, hatching and lightness distinguish
# them.
_KINDS = (
    ("#b0122b", "white", "////", ""),
    ("#f2a233", "black", "...", "one"),
    ("#a5d3ea", "white", "", "two"),
    ("#1c5c9e", "white", "", "three or more"),
)
_PALE = 0.25  # opacity of steps that do not count
_THICK = 0.8  # relative to the height of a row
_NAME = 24  # characters of a name
_WIDE, _ROW, _AROUND = 6.4, 0.24, 1.1  # inches
_SMALL = 8  # pt


@overload
def draw_strip(
    ax: None,
    people: tuple[str, ...],
    views: IntArray,
    counts: BoolArray,
    times: FloatArray | None,
    at_least: float,
) -> WholeAxes: ...


@overload
def draw_strip(
    ax: Axes | None,
    people: tuple[str, ...],
    views: IntArray,
    counts: BoolArray,
    times: FloatArray | None,
    at_least: float,
) -> Axes: ...


def draw_strip(
    ax: Axes | None,
    people: tuple[str, ...],
    views: IntArray,
    counts: BoolArray,
    times: FloatArray | None,
    at_least: float,
) -> Axes:
    """Draws a row for each person with a step that counts, and returns the axes.

    Parameters
    ----------
    ax : matplotlib axes (default: those of a new figure)
    people : [A] names
    views : [T+1, A] number of drones that see each person
    counts : [T+1, A] True for the person-steps that count; others are pale
    times : [T+1] s; None if the scene defines no step length
    at_least : smallest visible share of a person with which a camera counts, for the legend
    """
    shown = [j for j in range(len(people)) if counts[:, j].any()]
    ax = _new_axes(len(shown)) if ax is None else ax
    step = 1.0 if times is None else float(times[1] - times[0])
    for row, j in enumerate(shown):
        _draw_row(ax, row, views[:, j].tolist(), counts[:, j].tolist(), step)
    names = [shortened(printable(people[j]), _NAME) for j in shown]
    ax.set_yticks(range(len(shown)), names, fontsize=_SMALL, parse_math=False)
    ax.set_ylim(max(len(shown), 1) - 0.5, -0.5)
    ax.set_xlim(-step / 2, (len(views) - 0.5) * step)
    ax.set_xlabel("step" if times is None else "time (s)", fontsize=_SMALL)
    ax.tick_params(axis="x", labelsize=_SMALL)
    ax.tick_params(axis="y", length=0)
    for side in ax.spines.values():
        side.set_visible(False)
    _draw_legend(ax, at_least)
    return ax


def _draw_row(ax: Axes, row: int, views: list[int], counts: list[bool], step: float) -> None:
    """Draws the steps of a person, joining equal consecutive steps in one bar."""
    kinds = [(min(seen, 3), counted) for seen, counted in zip(views, counts, strict=True)]
    first = 0
    for (kind, counted), run in groupby(kinds):
        long = len(list(run))
        fill, ink, hatch, _ = _KINDS[kind]
        ax.broken_barh(
            [((first - 0.5) * step, long * step)], (row - _THICK / 2, _THICK), facecolor=fill,
            edgecolor=ink, hatch=hatch, linewidth=0, alpha=None if counted else _PALE,
        )  # fmt: skip
        first += long


def _draw_legend(ax: Axes, at_least: float) -> None:
    """Draws a legend of the four kinds above the axes."""
    from matplotlib.patches import Patch

    handles = [
        Patch(facecolor=fill, edgecolor=ink, hatch=hatch, linewidth=0, label=name)
        for fill, ink, hatch, name in _KINDS
    ]
    handles[0].set_label(f"no camera sees {100 * at_least:g} %")
    ax.legend(
        handles=handles, loc="lower left", bbox_to_anchor=(0, 1), ncols=len(handles),
        fontsize=_SMALL, frameon=False, borderaxespad=0.3, handlelength=1.5,
    )  # fmt: skip


def _new_axes(rows: int) -> Axes:
    """Returns the axes of a figure that has room for some rows."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(_WIDE, _AROUND + _ROW * max(rows, 1)), layout="constrained")
    return figure.add_subplot()
