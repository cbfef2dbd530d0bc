"""The figure of the study: predicted and measured errors, and quality compared with J."""

import math
from collections.abc import Mapping, Sequence
from itertools import cycle

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator

from cocap_opt.experiments.lab.studies.quality.plans import is_good
from cocap_opt.experiments.lab.studies.quality.rows import PersonStep, PlanRow
from cocap_opt.pictures.style import (
    GREY,
    LABEL,
    MARKS,
    SERIES,
    WIDTH,
    add_legend,
    new_figure,
    set_frame,
    set_plain_log,
)  # fmt: skip

_MOST_MM = 1e4  # larger predicted errors are not drawn; such points cannot be triangulated
_COARSE = "tiny-"


def quality_figure(steps: Sequence[PersonStep], plans: Sequence[PlanRow]) -> Figure:
    """Draws measured against predicted errors, and quality against J, of all and of good plans."""
    figure = new_figure(WIDTH, 6.4)
    (errors, every), (median, good) = figure.subplots(2, 2)
    fine = [plan for plan in plans if not plan.scene.startswith(_COARSE)]
    scenes = dict.fromkeys(plan.scene for plan in fine)
    styles = dict(zip(scenes, zip(cycle(SERIES), cycle(MARKS), strict=False), strict=False))
    _draw_errors(errors, steps, styles)
    most = {
        (plan.scene, plan.seed): max(
            (other for other in fine if (other.scene, other.seed) == (plan.scene, plan.seed)),
            key=lambda other: other.reward,
        )
        for plan in fine
    }
    for plan in fine:
        first, (colour, mark) = most[plan.scene, plan.seed], styles[plan.scene]
        look = {"mfc": colour if is_good(plan.planner) else "none", "color": colour,
                "marker": mark, "ms": 4.5, "mew": 0.8, "alpha": 0.8}  # fmt: skip
        share, lost = 100 * plan.reward / first.reward, 100 * (1 - plan.reward / first.reward)
        every.plot(share, 100 * plan.by_two, **look)
        if math.isfinite(plan.median):
            median.plot(share, plan.median, **look)
        if is_good(plan.planner):
            more = 100 * (plan.by_two - first.by_two)
            good.plot(lost, more, **look)
    _name(every, "seen by two\n(hollow: not planned for J)", "% of the highest J known",
          "% of person-steps")  # fmt: skip
    _name(
        median,
        "median error of a point\n(hollow: not planned for J)",
        "% of the highest J known",
        "mm",
    )
    set_plain_log(median, "y")
    median.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    _name(good, "plans for J, and\nthe one of highest J", "J below the best plan's (%)",
          "seen by two, difference (points)")  # fmt: skip
    good.axhline(0, color=GREY, lw=0.8, ls=":")
    for ax in (errors, every, median, good):
        set_frame(ax)
    add_legend(figure, errors, columns=3)
    return figure


def _draw_errors(
    ax: Axes, steps: Sequence[PersonStep], styles: Mapping[str, tuple[str, str]]
) -> None:
    """Draws measured against predicted errors, for scenes with fine cameras."""
    for scene, (colour, mark) in styles.items():
        of_scene = [step for step in steps if step.scene == scene and step.predicted < _MOST_MM]
        ax.plot([step.predicted for step in of_scene], [step.measured for step in of_scene], ".",
                ms=3, alpha=0.6, color=colour)  # fmt: skip
        ax.plot([], [], mark, ls="", color=colour, label=scene)
    for axis in ("x", "y"):
        set_plain_log(ax, axis)
    ax.axline((10, 10), (100, 100), color=GREY, lw=0.8, ls=":")
    _name(ax, "errors of joints, RMS", "predicted (mm)", "measured (mm)")


def _name(ax: Axes, title: str, x: str, y: str) -> None:
    ax.set_title(title, fontsize=LABEL)
    ax.set_xlabel(x)
    ax.set_ylabel(y)
