"""Charts of results, drawn with Matplotlib: gaps, the progress of a search, conflicts.

Functions that return a figure are for other modules; the others draw into the axes of a figure.
"""

import math
from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.ticker import FixedLocator, LogLocator, MaxNLocator, NullFormatter

from cocap_opt.data import FloatArray
from cocap_opt.experiments.tables.rows import GapRow
from cocap_opt.experiments.tables.statistics import Mean
from cocap_opt.formulations.result import OPTIMALITY, Snapshot
from cocap_opt.output.trace import Trace
from cocap_opt.pictures.figures import robot_colour
from cocap_opt.pictures.style import (
    AMBER,
    BLUE,
    GREY,
    LINES,
    RED,
    SMALL,
    TITLE,
    WIDTH,
    add_legend,
    columns_for,
    draw_level,
    line_look,
    new_figure,
    set_frame,
)  # fmt: skip
from cocap_opt.problem import Conflict, Plan, Problem, VertexConflict
from cocap_opt.text import counted

_LOSSES = "Reds"
_WRITTEN_ROBOTS, _WRITTEN_STEPS = 12, 20  # larger plans have colours without numbers
_LEAST_WRITTEN = 0.005  # %, the smallest loss that is written as a number
_LINEAR = 1.0  # %; the axis of gaps is linear up to here, and logarithmic beyond
_GAP_TICKS = (0, 0.25, 0.5, 0.75, 1, 2, 5, 10, 20, 50, 100)
_WIDE, _LEGEND_LINE = 6.0, 0.21  # inches, of the figure of progress
_LEAST_GAP = 100 * OPTIMALITY  # %; plans with at most this gap are proved optimal


# -- gaps ---------------------------------------------------------------------------------


def gaps_figure(rows: Sequence[GapRow]) -> Figure:
    """Draws the gaps of all planners, with one panel per scene.

    Parameters
    ----------
    rows : of the gap table
    """
    scenes = GapRow.grouped(rows, "scene")
    heights = [1.1 + 0.42 * len(GapRow.grouped(runs, "planner")) for runs in scenes.values()]
    figure = new_figure(WIDTH, sum(heights))
    panels = figure.subplots(len(scenes), 1, height_ratios=heights, squeeze=False)[:, 0]
    for ax, ((scene,), runs) in zip(panels, scenes.items(), strict=True):
        _draw_gaps(ax, runs)
        ax.set_title(scene, fontsize=TITLE, loc="left")
    return figure


def _draw_gaps(ax: Axes, rows: Sequence[GapRow]) -> Axes:
    """Draws each planner's gap to the best certified bound: a stroke per seed, mean, 95 % interval.

    A faint stroke means that the bound is not proved to be the optimum, so the real gap may be
    smaller. Plans that break a rule have no gap; the planner's label has their number.

    Parameters
    ----------
    rows : of the gap table, all of one scene
    """
    planners = GapRow.grouped(rows, "planner")
    for y, runs in enumerate(planners.values()):
        _draw_planner(ax, y, runs)
    if not all(row.bound_is_proved for row in rows):
        words = "faint: the bound is not proved to be the optimum"
        ax.set_title(words, fontsize=SMALL, loc="right", color=GREY)
    labels = [_label(planner, runs) for (planner,), runs in planners.items()]
    ax.set_yticks(range(len(planners)), labels)
    ax.set_ylim(len(planners) - 0.5, -0.5)
    _gap_axis(ax, max(GapRow.percent(rows, "gap"), default=0.0))
    return set_frame(ax, "x")


def _draw_planner(ax: Axes, y: float, rows: Sequence[GapRow]) -> None:
    bounded = [row for row in rows if row.gap is not None]
    if not bounded:
        return
    gaps = np.array(GapRow.percent(bounded, "gap"))
    proved = np.array([row.bound_is_proved for row in bounded])
    for chosen, alpha in ((proved, 0.75), (~proved, 0.3)):
        ax.plot(
            gaps[chosen], np.full(chosen.sum(), y), "|", color=BLUE, ms=13, mew=1.3, alpha=alpha
        )
    found = Mean.of(gaps.tolist())
    if not math.isnan(found.low):
        ax.plot([found.low, found.high], [y, y], color=RED, lw=3, solid_capstyle="butt")
    ax.plot(found.value, y, "D", color=RED, ms=6, mec="white", mew=0.8)
    if best := int((gaps <= _LEAST_GAP).sum()):
        ax.annotate(f"{best} of {len(rows)} at 0", (0, y - 0.3), fontsize=SMALL, color=GREY,
                    va="center", ha="left", annotation_clip=False)  # fmt: skip


def _label(planner: str, rows: Sequence[GapRow]) -> str:
    breaking = sum(not row.valid for row in rows)
    verb = "breaks" if breaking == 1 else "break"
    words = f"\n({breaking} of {len(rows)} {verb} rules)" if breaking else ""
    return planner + words


def _gap_axis(ax: Axes, most: float) -> None:
    """Makes the axis of gaps long enough for the largest gap."""
    ax.set_xscale("symlog", linthresh=_LINEAR, linscale=1.0)
    high = 1.15 * max(most, _LINEAR)
    ticks = [tick for tick in _GAP_TICKS if tick <= high]
    ax.set_xlim(-0.04, high)
    ax.xaxis.set_major_locator(FixedLocator(ticks))
    ax.xaxis.set_major_formatter("{x:g}")
    ax.xaxis.set_minor_locator(FixedLocator([]))
    ax.set_xlabel("gap to the best certified bound\n(%, logarithmic above 1)")


# -- progress -----------------------------------------------------------------------------


def progress_figure(traces: Mapping[str, Trace]) -> Figure:
    """Draws gaps over time; for a single run, also its value and bound.

    A legend names the runs. If there are too many to distinguish, all are grey and there is none.
    """
    rows = 2 if len(traces) == 1 else 1
    columns = columns_for(traces, _WIDE)
    named = 1 < len(traces) <= LINES
    lines = math.ceil(len(traces) / columns) if named else 0
    figure = new_figure(_WIDE, 2.0 + 2.1 * rows + _LEGEND_LINE * lines)
    panels = np.ravel(figure.subplots(rows, 1, sharex=True))
    if rows == 2:
        _draw_bounds(panels[0], *traces.values())
        panels[0].set_xlabel("")
    _draw_progress(panels[-1], traces)
    if named:
        add_legend(figure, panels[-1], columns)
    return figure


def _draw_progress(ax: Axes, traces: Mapping[str, Trace]) -> Axes:
    """Draws gaps over time on logarithmic axes; a ring marks a proved optimum.

    Parameters
    ----------
    traces : by the names of the runs; runs that never had both a plan and a bound are left out
    """
    shown = {name: _with_gap(trace) for name, trace in traces.items()}
    shown = {name: snapshots for name, snapshots in shown.items() if snapshots}
    for k, (name, snapshots) in enumerate(shown.items()):
        seconds = [s.seconds for s in snapshots]
        gaps = [max(100 * s.gap, _LEAST_GAP) for s in snapshots]
        look = line_look(k) if len(traces) <= LINES else {"color": GREY, "alpha": 0.4}
        colour = look["color"]
        ax.plot(seconds, gaps, drawstyle="steps-post", lw=1.5, label=name, **look)
        proved = gaps[-1] <= _LEAST_GAP
        ax.plot(seconds[-1], gaps[-1], "o", color=colour, ms=7 if proved else 3.5,
                mfc="white" if proved else colour, mew=1.6, clip_on=False, zorder=3)  # fmt: skip
    most = max((100 * s.gap for curve in shown.values() for s in curve), default=0.0)
    # Before the scale is set: gaps that are all equal would leave no range for a logarithmic axis.
    ax.set_ylim(_LEAST_GAP / 2, 2 * max(most, 10 * _LEAST_GAP))
    if len(traces) > LINES:
        ax.set_title(f"{len(traces)} runs", fontsize=SMALL, loc="right", color=GREY)
    ax.set_xscale("log")
    ax.set_yscale("log")
    draw_level(ax, _LEAST_GAP, "ring: proved optimal")
    ax.set_ylabel("gap (%)")
    ax.yaxis.set_major_formatter("{x:g}")
    _time_axis(ax)
    return set_frame(ax)


def _draw_bounds(ax: Axes, trace: Trace) -> Axes:
    """Draws the value and the bound of a run over time."""
    for key, colour in (("bound", AMBER), ("value", BLUE)):
        known = [s for s in trace.snapshots if math.isfinite(getattr(s, key)) and s.seconds > 0]
        ax.plot([s.seconds for s in known], [getattr(s, key) for s in known],
                drawstyle="steps-post", color=colour, lw=1.6, label=key)  # fmt: skip
    ax.set_xscale("log")
    _time_axis(ax)
    ax.set_ylabel("J")
    ax.yaxis.set_major_formatter("{x:,.8g}")
    ax.legend(fontsize=SMALL, loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, frameon=False)
    return set_frame(ax)


def _time_axis(ax: Axes) -> None:
    """Makes a logarithmic axis of seconds, with numbers at 1, 2 and 5 times each power of ten."""
    ax.set_xlabel("time (s)")
    ax.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0), numticks=9))
    ax.xaxis.set_major_formatter("{x:g}")
    ax.xaxis.set_minor_formatter(NullFormatter())


def _with_gap(trace: Trace) -> list[Snapshot]:
    return [s for s in trace.snapshots if math.isfinite(s.gap) and s.seconds > 0]


# -- gaps explained -----------------------------------------------------------------------


def losses_figure(losses: Mapping[str, FloatArray]) -> Figure:
    """Draws the loss of each drone by its move after each step, with one panel per plan.

    Parameters
    ----------
    losses : [R, T] in % of the bound, by the plans' names
    """
    rows = max(len(lost) for lost in losses.values())
    height = 0.8 + 0.22 * min(max(rows, 3), 24)
    figure = new_figure(6.4, 0.3 + height * len(losses))
    panels = figure.subplots(len(losses), 1, sharex=True, squeeze=False)[:, 0]
    most = max(float(lost.max(initial=0.0)) for lost in losses.values())
    for ax, (name, lost) in zip(panels, losses.items(), strict=True):
        drawn = _draw_losses(ax, lost, most)
        ax.set_title(f"{name}: {lost.sum():.3f} %", fontsize=9, loc="left")
        ax.label_outer()
    figure.colorbar(drawn, ax=panels.tolist(), label="% of the bound")
    return figure


def _draw_losses(ax: Axes, losses: FloatArray, most: float) -> AxesImage:
    """Draws losses [R, T] as coloured cells, with numbers in them if the plan is small enough."""
    drawn = ax.imshow(losses, cmap=_LOSSES, vmin=0.0, vmax=most or 1.0, aspect="auto")
    robots, steps = losses.shape
    if robots <= _WRITTEN_ROBOTS and steps <= _WRITTEN_STEPS:
        for robot, t in np.argwhere(losses >= _LEAST_WRITTEN).tolist():
            loss = losses[robot, t]
            ax.text(t, robot, f"{loss:.2f}", ha="center", va="center", fontsize=6,
                    color="white" if loss > 0.6 * most else "black")  # fmt: skip
    every = max(1, math.ceil(robots / 16))
    ax.set_yticks(range(0, robots, every))
    ax.xaxis.set_major_locator(MaxNLocator(integer=True))
    ax.set_xlabel("step at which the move begins")
    ax.set_ylabel("drone")
    return drawn


# -- conflicts ----------------------------------------------------------------------------


def conflicts_figure(problem: Problem, plans: Mapping[str, Plan]) -> Figure:
    """Draws the conflicts of plans, one panel each, over the same steps."""
    height = 0.9 + 0.16 * max(len(problem.robots), 4)
    figure = new_figure(6.4, 0.4 + height * len(plans))
    panels = figure.subplots(len(plans), 1, sharex=True, squeeze=False)[:, 0]
    for ax, (name, plan) in zip(panels, plans.items(), strict=True):
        _draw_conflicts(ax, problem, plan)
        count = sum(1 for _ in plan.conflicts(problem))
        ax.set_title(f"{name}: {counted(count, 'conflict')}", fontsize=9, loc="left")
        ax.label_outer()
    return figure


def _draw_conflicts(ax: Axes, problem: Problem, plan: Plan) -> Axes:
    """Draws a line per drone, and a bar between two drones at the step where they collide.

    A dashed bar between two steps joins drones that collide between them.
    """
    for robot in range(len(problem.robots)):
        ax.axhline(robot, color=robot_colour(robot), lw=1.2, alpha=0.45, zorder=1)
    for x, conflict in _placed(plan.conflicts(problem)):
        style = "-" if isinstance(conflict, VertexConflict) else "--"
        ax.plot([x, x], conflict.robots, color=RED, lw=1.6, ls=style, zorder=2)
        for robot in conflict.robots:
            ax.plot(x, robot, "o", color=robot_colour(robot), mec=RED, mew=1.2, ms=6, zorder=3)
    every = max(1, math.ceil(len(problem.robots) / 16))
    ax.set_yticks(range(0, len(problem.robots), every))
    ax.set_ylim(len(problem.robots) - 0.4, -0.6)
    ax.set_xlim(-0.3, problem.horizon + 0.3)
    ax.xaxis.set_major_locator(MaxNLocator(integer=True))
    ax.set_xlabel("step")
    ax.set_ylabel("drone")
    return set_frame(ax, None)


def _placed(found: Iterable[Conflict]) -> list[tuple[float, Conflict]]:
    """Returns conflicts with x positions; conflicts at the same time are drawn side by side."""
    times: dict[float, list[Conflict]] = {}
    for conflict in found:
        at_step = isinstance(conflict, VertexConflict)
        times.setdefault(conflict.t if at_step else conflict.t + 0.5, []).append(conflict)
    apart = min(0.12, 0.4 / max(map(len, times.values()), default=1))
    return [
        (time + apart * (k - (len(together) - 1) / 2), conflict)
        for time, together in times.items()
        for k, conflict in enumerate(together)
    ]
