"""The figure of simulated flights: errors, distances and J by scene, kind of flight and wind."""

import math
from collections.abc import Callable, Sequence
from statistics import fmean

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cocap_opt.experiments.lab.studies.flight.runs import SMOOTH, STRAIGHT, FlightRun
from cocap_opt.pictures.style import (
    BLUE,
    RED,
    SMALL,
    TITLE,
    add_legend,
    draw_level,
    new_figure,
    set_frame,
)  # fmt: skip
from cocap_opt.problem import SEPARATION

_COLOURS = {SMOOTH: BLUE, STRAIGHT: RED}
_ASIDE = {SMOOTH: -0.17, STRAIGHT: 0.17}


def flight_figure(runs: Sequence[FlightRun]) -> Figure:
    """Draws the mean and the largest error, the least distances, and the share of J filmed."""
    figure = new_figure(8, 9)
    error, apart, kept = figure.subplots(3, 1)
    _draw(error, runs, lambda run: run.error_mean, lambda run: run.error_most)
    error.set_title("off the flight, mean (bar) and largest (dot)", fontsize=TITLE)
    error.set_ylabel("m")
    _draw(apart, runs, lambda run: run.apart_flown, None, lambda run: run.apart_planned)
    draw_level(apart, SEPARATION, f"{SEPARATION:g} m")
    apart.set_title("least distance of two drones, flown (bar) and planned (line)", fontsize=TITLE)
    apart.set_ylabel("m")
    _draw(kept, runs, lambda run: 100 * run.kept_between)
    kept.set_title("J of what is filmed, between the steps, too", fontsize=TITLE)
    kept.set_ylabel("% of the flight's")
    add_legend(figure, error)
    return figure


def _draw(
    ax: Axes,
    runs: Sequence[FlightRun],
    bar: Callable[[FlightRun], float],
    dot: Callable[[FlightRun], float] | None = None,
    line: Callable[[FlightRun], float] | None = None,
) -> Axes:
    """Draws a group of bars for each scene and wind.

    Bars are means over seeds, dots are the largest and lines the least; bars that have a line are
    the least as well.
    """
    groups = list(dict.fromkeys((run.scene, run.wind) for run in runs))
    for flight, colour in _COLOURS.items():
        grouped = [
            [run for run in runs if (run.scene, run.wind, run.flight) == (*group, flight)]
            for group in groups
        ]
        places = [k + _ASIDE[flight] for k in range(len(groups))]
        height = fmean if line is None else min
        heights = [_finite(height([bar(run) for run in group])) for group in grouped]
        ax.bar(places, heights, width=0.3, color=colour, label=f"{flight} flights")
        if dot is not None:
            ax.plot(places, [max(dot(run) for run in group) for group in grouped], "o", ms=5,
                    color=colour)  # fmt: skip
        if line is not None:
            ends = [_finite(min(line(run) for run in group)) for group in grouped]
            ax.hlines(ends, [x - 0.15 for x in places], [x + 0.15 for x in places],
                      color="black", lw=1.5)  # fmt: skip
    ax.set_xticks(range(len(groups)), [f"{scene}\n{wind:g} m/s" for scene, wind in groups],
                  fontsize=SMALL)  # fmt: skip
    return set_frame(ax, "y")


def _finite(value: float) -> float:
    """Returns a number, nan if it is infinite, as distances of one drone to others are."""
    return value if math.isfinite(value) else math.nan
