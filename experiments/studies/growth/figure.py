"""The figure of growth: for each axis a panel of seconds above a panel of the certified gap."""

import math
from collections.abc import Sequence
from statistics import median
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter, NullLocator

from cocap_opt.experiments.report.figures import draw_frame
from cocap_opt.experiments.studies.growth.points import (
    BASES,
    GAP,
    MEASURES,
    SIZES,
    Measure,
    Point,
)

_TO_END, _TO_GAP, _GAP_COLOUR = "#30638e", "#edae49", "#d1495b"
_LABELS = {
    "robots": "drones",
    "steps": "steps",
    "cells": "cells along each side of the field",
}


def growth_figure(points: Sequence[Point], limit: float) -> Figure:
    """Draws seconds and gap against drones, steps and cells, on logarithmic axes.

    Parameters
    ----------
    limit : s, of each run
    """
    figure = Figure(figsize=(12, 6.2), layout="constrained", dpi=130)
    grid = figure.subplots(2, 3, sharex="col", sharey="row", height_ratios=[1.25, 1])
    for column, axis in enumerate(SIZES):
        some = [point for point in points if point.axis == axis]
        top, bottom = grid[0, column], grid[1, column]
        _draw_seconds(top, some, limit)
        _draw_gaps(bottom, some)
        others = [f"{n} {what}" for what, n in BASES[axis]._asdict().items() if what != axis]
        top.set_title(f"{axis}  ({', '.join(others)})", fontsize=10)
        bottom.set_xlabel(_LABELS[axis])
        _sizes_as_ticks(bottom, some)
    grid[0, 0].set_ylabel("time (s)")
    grid[1, 0].set_ylabel("certified gap (%)")
    figure.suptitle("Growth of column generation (fields; medians, a dot per seed)", fontsize=12)
    return figure


def _draw_seconds(ax: Axes, points: Sequence[Point], limit: float) -> Axes:
    """Draws the time to the end and to a small gap; the limit as a line."""
    ax.axhline(limit, color="grey", lw=0.8, ls=":")
    ax.annotate(f"limit {limit:g} s", (0.01, limit), xycoords=("axes fraction", "data"),
                fontsize=8, color="grey", va="bottom")  # fmt: skip
    _draw_measure(ax, points, MEASURES["seconds"], "to the end", _TO_END, "o")
    name = f"to a gap of {100 * GAP:g} %"
    _draw_measure(ax, points, MEASURES["seconds_to_gap"], name, _TO_GAP, "s")
    return _finish(ax, any(not point.finished for point in points))


def _draw_gaps(ax: Axes, points: Sequence[Point]) -> Axes:
    """Draws the certified gap at the end or at the limit."""
    name = "gap at the end or the limit"
    _draw_measure(ax, points, MEASURES["gap_percent"], name, _GAP_COLOUR, "o")
    return _finish(ax, spoilt=False)


def _draw_measure(
    ax: Axes,
    points: Sequence[Point],
    measure: Measure,
    name: str,
    colour: str,
    marker: str,
) -> Axes:
    """Draws medians against sizes, hollow where the limit stopped a run, and the fit dashed."""
    shown = [(p, median(measure.of(p))) for p in points]
    shown = [(p, value) for p, value in shown if math.isfinite(value)]
    line = measure.fit(points)
    _draw_pairs(ax, [(p.size, v) for p, v in shown], color=colour, lw=1, alpha=0.35)
    dots = [(p.size, v) for p, _ in shown if len(p.runs) > 1 for v in measure.of(p)]
    _draw_pairs(ax, dots, color=colour, ls="none", marker=".", ms=4, alpha=0.4)
    whole = [(p.size, v) for p, v in shown if measure.whole(p)]
    spoilt = [(p.size, v) for p, v in shown if not measure.whole(p)]
    label = name if line is None else f"{name}, ~ n^{line[0]:.1f}"
    style = {"ls": "none", "marker": marker, "ms": 7, "mec": colour, "zorder": 4}
    _draw_pairs(ax, whole, label=label, mfc=colour, **style)
    _draw_pairs(ax, spoilt, mfc="white", **style)
    if line is not None:
        n = np.array([whole[0][0], whole[-1][0]])
        ax.plot(n, np.exp(line[1]) * n ** line[0], color=colour, lw=1.2, ls="--", zorder=3)
    return ax


def _draw_pairs(ax: Axes, pairs: Sequence[tuple[float, float]], **style: Any) -> None:
    x, y = [x for x, _ in pairs], [y if math.isfinite(y) else math.nan for _, y in pairs]
    ax.plot(x, y, **style)


def _sizes_as_ticks(ax: Axes, points: Sequence[Point]) -> None:
    ticks = sorted({point.size for point in points})
    if ticks:
        ax.set_xticks(ticks, [str(size) for size in ticks])
    ax.xaxis.set_minor_locator(NullLocator())


def _finish(ax: Axes, spoilt: bool) -> Axes:
    ax.set_xscale("log")
    ax.set_yscale("log")
    ax.yaxis.set_major_formatter("{x:g}")
    ax.yaxis.set_minor_formatter(NullFormatter())
    ax.grid(True, which="major", lw=0.4, alpha=0.5)
    draw_frame(ax)
    if spoilt:
        ax.plot([], [], ls="none", marker="o", mfc="white", mec="grey", ms=7,
                label="hollow: a seed was stopped by the limit")  # fmt: skip
    if ax.get_legend_handles_labels()[0]:
        ax.legend(fontsize=8, frameon=True, framealpha=0.85, edgecolor="none")
    return ax
