"""The figure of simulated flights: errors, distances and J by wind, scene and kind of flight."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from statistics import fmean

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cocap_opt.experiments.lab.studies.flight.runs import SMOOTH, STRAIGHT, FlightRun
from cocap_opt.pictures.style import (
    BLUE,
    GREY,
    LABEL,
    RED,
    TITLE,
    WIDTH,
    draw_level,
    new_figure,
    set_frame,
)  # fmt: skip
from cocap_opt.problem import SEPARATION

_STYLES = {SMOOTH: (BLUE, "o", 9), STRAIGHT: (RED, "s", 5)}  # colour, mark and its size


def flight_figure(runs: Sequence[FlightRun]) -> Figure:
    """Draws errors, smallest distances and the filmed share of J over the wind, by scene."""
    scenes = list(dict.fromkeys(run.scene for run in runs))
    figure = new_figure(WIDTH, 7.4)
    panels = figure.subplots(3, len(scenes), sharex=True, sharey="row", squeeze=False)
    for (error, apart, kept), scene in zip(panels.T, scenes, strict=True):
        of_scene = [run for run in runs if run.scene == scene]
        for flight, style in _STYLES.items():
            winds = _by_wind(run for run in of_scene if run.flight == flight)
            name = f"{flight} flights"
            _draw(error, winds, lambda run: run.error_mean, fmean, style, name)
            _draw(error, winds, lambda run: run.error_most, max, style)
            _draw(apart, winds, lambda run: run.apart_flown, min, style)
            _draw(kept, winds, lambda run: 100 * run.kept_between, fmean, style)
        winds = _by_wind(of_scene)
        _draw(apart, winds, lambda run: run.apart_planned, min, (GREY, "_", 8), "planned")
        draw_level(apart, SEPARATION, f"rule: {SEPARATION:g} m")
        error.set_title(scene, fontsize=TITLE)
        kept.set_xlabel("wind (m/s)")
        kept.set_xticks(list(winds))
        apart.set_ylim(bottom=0)
        kept.set_ylim(0, 105)
        for ax in (error, apart, kept):
            set_frame(ax)
    for ax, words in zip(panels[:, 0], (
        "off the flight (m):\nmean; largest, dashed", "minimum distance\nof two drones (m)",
        "J filmed, also between\nsteps (% of the flight's)",
    ), strict=True):  # fmt: skip
        ax.set_ylabel(words)
    handles = {label: handle for ax in panels[:2, 0] for handle, label in
               zip(*ax.get_legend_handles_labels(), strict=True)}  # fmt: skip
    figure.legend(handles.values(), handles, loc="outside lower center", fontsize=LABEL,
                  ncols=len(handles), frameon=False)  # fmt: skip
    return figure


def _by_wind(runs: Iterable[FlightRun]) -> dict[float, list[FlightRun]]:
    """Returns runs by the wind (m/s) in which they were flown, weakest wind first."""
    found: dict[float, list[FlightRun]] = {}
    for run in sorted(runs, key=lambda run: run.wind):
        found.setdefault(run.wind, []).append(run)
    return found


def _draw(
    ax: Axes,
    winds: Mapping[float, Sequence[FlightRun]],
    value: Callable[[FlightRun], float],
    over: Callable[[Iterable[float]], float],
    style: tuple[str, str, float],
    label: str | None = None,
) -> None:
    """Draws a number of the runs over the wind, for all seeds; largest numbers are dashed."""
    colour, mark, size = style
    heights = [_finite(over(map(value, runs))) for runs in winds.values()]
    ax.plot(list(winds), heights, color=colour, marker=mark, ms=size, mew=1.4, lw=1.6, label=label,
            ls="--" if over is max else "-", mfc="white" if over is max else colour)  # fmt: skip


def _finite(value: float) -> float:
    """Returns a number; nan if it is infinite, like the distance of a single drone to others."""
    return value if math.isfinite(value) else math.nan
