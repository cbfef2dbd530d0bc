"""The figure of performance profiles of J and of time, with a staircase for each planner."""

import math
from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cocap_opt.experiments.tables.comparison import SECONDS, J, Profile
from cocap_opt.pictures.style import (
    LABEL,
    add_legend,
    columns_for,
    line_look,
    new_figure,
    set_frame,
)

_LABELS = {J: "best J / J", SECONDS: "time / fastest planner's time (logarithmic)"}
_FARTHEST = {J: 2.0, SECONDS: 1000.0}  # the largest factors on the axis
_BEYOND = 1.05  # length of the axis relative to the last step, on a logarithmic scale


def profiles_figure(profiles: Sequence[Profile]) -> Figure:
    """Draws performance profiles: one panel for J and one for time, if there are any.

    Parameters
    ----------
    profiles : at least one
    """
    measures = [m for m in (J, SECONDS) if any(profile.measure == m for profile in profiles)]
    names = list(dict.fromkeys(profile.planner for profile in profiles))
    width = 3.7 * len(measures)
    columns = columns_for(names, width)
    figure = new_figure(width, 2.9 + 0.21 * math.ceil(len(names) / columns))
    panels = figure.subplots(1, len(measures), sharey=True, squeeze=False)[0]
    for ax, measure in zip(panels, measures, strict=True):
        shown = [profile for profile in profiles if profile.measure == measure]
        _draw(ax, measure, shown, names)
    panels[0].set_ylabel("share of scenes", fontsize=LABEL)
    add_legend(figure, panels[0], columns)
    return figure


def _draw(ax: Axes, measure: str, profiles: Sequence[Profile], names: Sequence[str]) -> Axes:
    """Draws the profiles of one measure; a planner's position in `names` decides its line style."""
    steps = [ratio for profile in profiles for ratio in profile.ratios]
    far = min(max(steps, default=1.0), _FARTHEST[measure])
    end = math.exp(math.log(max(far, 1.001)) * _BEYOND)
    for profile in profiles:
        ratios = [1.0, *profile.ratios, max(end, *profile.ratios, 1.0)]
        shares = [profile.share(ratio) for ratio in ratios]
        ax.plot(ratios, shares, drawstyle="steps-post", lw=1.6, label=profile.planner,
                **line_look(names.index(profile.planner)))  # fmt: skip
    if measure == SECONDS:
        ax.set_xscale("log")
        ax.xaxis.set_major_formatter("{x:g}")
    ax.set_xlim(1.0, end)
    ax.set_ylim(0.0, 1.03)
    ax.set_xlabel(_LABELS[measure], fontsize=LABEL)
    return set_frame(ax)
