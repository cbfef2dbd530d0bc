"""The figure of growth: for each axis a panel of seconds above a panel of the certified gap."""

import math
from collections.abc import Sequence
from statistics import median

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator

from cocap_opt.experiments.lab.studies.growth.points import (
    BASES,
    GAP,
    MEASURES,
    SIZES,
    GrowthPoint,
    Measure,
)
from cocap_opt.pictures.style import (
    AMBER,
    BLUE,
    FADED,
    RED,
    SMALL,
    TITLE,
    add_legend,
    draw_level,
    new_figure,
    set_frame,
    set_plain_log,
)  # fmt: skip

_LABELS = {
    "robots": "drones",
    "steps": "steps",
    "cells": "cells along each side of the field",
}
_STYLES = {  # of each measure: its name, colour and mark
    "seconds": ("time to the end", BLUE, "o"),
    "seconds_to_gap": (f"time to a certified gap of {100 * GAP:g} %", AMBER, "s"),
    "gap_percent": ("certified gap at the end or the limit", RED, "D"),
    "gap_of_cuts_percent": ("certified gap without step envelopes", FADED, "v"),
}
_NOUNS = {"robots": "drones", "actors": "people"}
_SECONDS = ("seconds", "seconds_to_gap")
_GAPS = ("gap_of_cuts_percent", "gap_percent")


def growth_figure(points: Sequence[GrowthPoint], limit: float) -> Figure:
    """Draws seconds and gap against drones, steps and cells, on logarithmic axes.

    Parameters
    ----------
    limit : s, of each run
    """
    figure = new_figure(9.5, 6.8)
    panels = figure.subplots(2, 3, sharex="col", sharey="row", height_ratios=[1.25, 1])
    for (top, bottom), axis in zip(panels.T, SIZES, strict=True):
        of_axis = [point for point in points if point.axis == axis]
        draw_level(top, limit, f"limit {limit:g} s")
        for ax, names in ((top, _SECONDS), (bottom, _GAPS)):
            for name in names:
                _draw_measure(ax, of_axis, name)
            set_plain_log(ax, "x")
            set_plain_log(ax, "y")
            set_frame(ax)
        fixed = BASES[axis]._asdict().items()
        others = [f"{n} {_NOUNS.get(what, what)}" for what, n in fixed if what != axis]
        top.set_title(", ".join(others), fontsize=TITLE)
        bottom.set_xlabel(_LABELS[axis])
        _set_sizes(bottom, of_axis)
    panels[0, 0].set_ylabel("time (s)")
    panels[1, 0].set_ylabel("certified gap (%)")
    names = panels[0, 1]
    for name in _STYLES:
        label, colour, mark = _STYLES[name]
        names.plot([], [], mark, color=colour, ms=6, ls="-", lw=1, label=label)
    names.plot([], [], "o", mfc="white", mec="grey", ms=6, ls="none",
               label="hollow: the limit stopped a seed")  # fmt: skip
    add_legend(figure, names, columns=3)
    return figure


def _draw_measure(ax: Axes, points: Sequence[GrowthPoint], name: str) -> None:
    """Draws medians against sizes, a dot per seed, and dashed the power law if there is one.

    A mark is hollow where the limit stopped a run.
    """
    measure, (_, colour, mark) = MEASURES[name], _STYLES[name]
    known = [(p, median(measure.of(p))) for p in points]
    known = [(p, value) for p, value in known if math.isfinite(value)]
    ax.plot([p.size for p, _ in known], [value for _, value in known], color=colour, lw=1)
    for point, value in known:
        seeds = [v for v in measure.of(point) if math.isfinite(v)] if len(point.samples) > 1 else []
        ax.plot([point.size] * len(seeds), seeds, ".", color=colour, ms=4, alpha=0.5)
        filling = colour if measure.whole(point) else "white"
        ax.plot(point.size, value, mark, mfc=filling, mec=colour, ms=6, zorder=4)
    _draw_law(ax, measure, points, colour)


def _draw_law(ax: Axes, measure: Measure, points: Sequence[GrowthPoint], colour: str) -> None:
    law = measure.fit(points)
    if law is None:
        return
    slope, offset = law
    ends = np.array([min(p.size for p in points), max(p.size for p in points)])
    heights = np.exp(offset) * ends**slope
    ax.plot(ends, heights, color=colour, lw=1, ls="--", zorder=3)
    ax.annotate(f"~ n^{slope:.1f}", (ends[1], heights[1]), xytext=(-6, -12), color=colour,
                textcoords="offset points", ha="right", fontsize=SMALL)  # fmt: skip


def _set_sizes(ax: Axes, points: Sequence[GrowthPoint]) -> None:
    """Writes the sizes that were measured on the axis, and no others."""
    ticks = sorted({point.size for point in points})
    if ticks:
        ax.set_xticks(ticks, [str(size) for size in ticks])
    ax.xaxis.set_minor_locator(NullLocator())
