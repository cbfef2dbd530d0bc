"""The figure of growth: for each axis, a panel of seconds and a panel of the certified gap."""

import math
from collections.abc import Sequence
from statistics import median

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.ticker import NullLocator

from cocap_opt.experiments.lab.studies.growth.points import (
    BASES,
    GAP,
    MEASURES,
    PROVED,
    SIZES,
    GrowthPoint,
    Measure,
)
from cocap_opt.pictures.style import (
    AMBER,
    BLUE,
    FADED,
    GREY,
    LABEL,
    RED,
    TITLE,
    WIDTH,
    draw_level,
    new_figure,
    set_frame,
    set_plain_log,
)  # fmt: skip

_Law = tuple[str, str]  # a power law in words, and the colour of its line

_MORE = {"robots": "drones", "steps": "steps", "cells": "cells"}
_LABELS = {**_MORE, "cells": "cells along a side"}
_STYLES = {  # name, colour and mark of each measure
    "seconds": ("time to the end", BLUE, "o"),
    "seconds_to_gap": (f"time to a gap of {100 * GAP:g} %", AMBER, "s"),
    "gap_percent": ("gap at the end or the limit", RED, "D"),
    "gap_of_cuts_percent": ("gap without step envelopes", FADED, "v"),
}
_RAISED = str.maketrans("0123456789-.", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻·")
_APART = 1.3  # smallest ratio of two sizes that are both written on an axis
_NOUNS = {"robots": "drones", "actors": "people"}
_SECONDS = ("seconds", "seconds_to_gap")
_GAPS = ("gap_of_cuts_percent", "gap_percent")


def growth_figure(points: Sequence[GrowthPoint], limit: float) -> Figure:
    """Draws seconds and gap against drones, steps and cells, on logarithmic axes.

    Parameters
    ----------
    limit : s, of each run
    """
    figure = new_figure(WIDTH, 9.6)
    heights = [*[1.0] * len(SIZES), 0.3]
    *rows, names = figure.subfigures(len(heights), 1, height_ratios=heights, squeeze=False)[:, 0]
    times, gaps = [], []
    for row, axis in zip(rows, SIZES, strict=True):
        of_axis = [point for point in points if point.axis == axis]
        time, gap = row.subplots(1, 2)
        times.append(time)
        gaps.append(gap)
        draw_level(time, limit, f"limit {limit:g} s")
        for ax, measures in ((time, _SECONDS), (gap, _GAPS)):
            laws = [_draw_measure(ax, of_axis, name) for name in measures]
            _write_laws(ax, [law for law in laws if law])
            set_plain_log(ax, "x")
            set_plain_log(ax, "y")
            set_frame(ax)
            ax.set_xlabel(_LABELS[axis])
            _set_sizes(ax, of_axis)
        time.set_ylabel("time (s)")
        gap.set_ylabel("certified gap (%)")
        fixed = BASES[axis]._asdict().items()
        others = [f"{n} {_NOUNS.get(what, what)}" for what, n in fixed if what != axis]
        row.suptitle(f"more {_MORE[axis]}: {', '.join(others)}", fontsize=TITLE)
    for of_measure in (times, gaps):
        ends = [end for ax in of_measure for end in ax.get_ylim()]
        for ax in of_measure:
            ax.set_ylim(min(ends), max(ends))
    for ax in gaps:
        ax.yaxis.set_major_formatter(_told_gap)
    _name_styles(names)
    return figure


def _told_gap(percent: float, _: int | None = None) -> str:
    """Returns the label of a gap on an axis; the lowest gap stands for proofs."""
    if percent > 1.5 * PROVED:
        return f"{percent:g}"
    return "proved" if percent > PROVED / 1.5 else ""


def _name_styles(figure: SubFigure) -> None:
    """Names marks and lines, below all panels."""
    ax = figure.subplots()
    ax.set_axis_off()
    for label, colour, mark in _STYLES.values():
        ax.plot([], [], mark, color=colour, ms=6, ls="-", lw=1, label=label)
    ax.plot([], [], "o", mfc="white", mec="grey", ms=6, ls="none",
            label="hollow: the limit stopped a seed")  # fmt: skip
    ax.plot([], [], color="grey", lw=1, ls="--", label="the power of n that fits best")
    ax.legend(loc="center", fontsize=LABEL, frameon=False, ncols=2, columnspacing=1)


def _draw_measure(ax: Axes, points: Sequence[GrowthPoint], name: str) -> _Law | None:
    """Draws medians against sizes, a dot per seed, and a dashed power law if there is one.

    A hollow mark means that the limit stopped a run. Returns the law.
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
    return _draw_law(ax, measure, points, colour)


def _draw_law(
    ax: Axes, measure: Measure, points: Sequence[GrowthPoint], colour: str
) -> _Law | None:
    law = measure.fit(points)
    if law is None:
        return None
    slope, offset = law
    sizes = [point.size for point in measure.fitted(points)]
    ends = np.array([min(sizes), max(sizes)])
    ax.plot(ends, np.exp(offset) * ends**slope, color=colour, lw=1, ls="--", zorder=3)
    power = f"{abs(slope) if abs(slope) < 0.05 else slope:.1f}"
    return f"~ n{power.translate(_RAISED)}", colour


def _write_laws(ax: Axes, laws: Sequence[_Law]) -> None:
    """Writes power laws above an axes, each with a dash in the colour of its line.

    The words are grey, as amber ones are too pale to read on white.
    """
    for k, (words, colour) in enumerate(laws):
        right = 1 - 0.42 * k
        ax.annotate(words, (right, 1.02), xycoords="axes fraction", color=GREY, ha="right",
                    va="bottom", fontsize=LABEL)  # fmt: skip
        ax.plot([right - 0.35, right - 0.26], [1.065] * 2, color=colour, lw=1, ls="--",
                transform=ax.transAxes, clip_on=False)  # fmt: skip


def _set_sizes(ax: Axes, points: Sequence[GrowthPoint]) -> None:
    """Labels the axis only with the measured sizes, omitting some that are close together."""
    sizes = sorted({point.size for point in points}, reverse=True)
    shown: list[int] = []
    for size in sizes:
        if not shown or _APART * size <= shown[-1]:
            shown.append(size)
    ax.set_xticks(sizes, [str(size) if size in shown else "" for size in sizes])
    ax.xaxis.set_minor_locator(NullLocator())
