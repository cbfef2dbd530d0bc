"""Results of a comparison of teams: their table, sentences on it, and its figure."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from cocap_opt.experiments.tables.teams import (
    TeamRow,
    grouped,
    kind_words,
    records,
    sentences,
)
from cocap_opt.pictures.style import GREY, LABEL, SERIES, SMALL, TITLE, new_figure, set_frame
from cocap_opt.text import number_in_words

if TYPE_CHECKING:
    import pandas as pd

_DOT: dict[str, Any] = {"marker": "o", "ms": 4}
_CAP: dict[str, Any] = {"marker": "_", "ms": 11, "mew": 1.4}


@dataclass(frozen=True, repr=False)
class Teams:
    """Teams compared.

    Attributes
    ----------
    rows : one for each team
    share : requested share of person-steps
    """

    rows: tuple[TeamRow, ...]
    share: float

    @property
    def table(self) -> "pd.DataFrame":
        """The rows with the columns of teams.csv; missing values are None or nan."""
        from pandas import DataFrame

        return DataFrame(records(self.rows))

    @property
    def sentences(self) -> list[str]:
        """The smallest team found that reaches the share, and what is proved of fewer drones."""
        return list(sentences(self.rows, self.share))

    def plot(self) -> Figure:
        """Draw J and the share of person-steps that are seen, by the number of drones."""
        return teams_figure(self.rows, self.share)

    def __str__(self) -> str:
        return "\n".join(self.sentences)

    def __repr__(self) -> str:
        return str(self)


def teams_figure(rows: Sequence[TeamRow], share: float | None = None) -> Figure:
    """Draws J, and the share of person-steps that are seen, by the number of drones.

    Dots are plans, with a colour for each camera and height; caps are bounds that no plan exceeds.

    Parameters
    ----------
    rows : of teams
    share : requested share, drawn as a level
    """
    groups = grouped(rows)
    columns = min(3, len(groups) + 3)
    figure = new_figure(7.2, 3.0 + 0.2 * math.ceil((len(groups) + 3) / columns))
    left, right = figure.subplots(1, 2)
    for number, group in enumerate(groups):
        colour, shift = SERIES[number % len(SERIES)], 0.06 * (number - (len(groups) - 1) / 2)
        draw = partial(_draw, group=group, colour=colour, shift=shift)
        draw(left, "reward", "-")
        draw(left, "bound", None)
        draw(right, "seen_most", "-")
        draw(right, "seen", ":")
        draw(right, "seen_bound", None)
    seen_by = number_in_words(rows[0].cameras)
    left.set_title("J (px^0.5/m)", fontsize=TITLE, loc="left")
    right.set_title(f"% of person-steps seen by {seen_by}", fontsize=TITLE, loc="left")
    for ax in (left, right):
        set_frame(ax)
        ax.xaxis.set_major_locator(MaxNLocator(integer=True))
        ax.set_xlabel("drones", fontsize=LABEL)
        ax.set_ylim(bottom=0)
        ax.tick_params(labelsize=SMALL)
    right.set_ylim(0, 104)
    if share is not None:
        right.axhline(100 * share, color=GREY, lw=0.8, ls=":", zorder=1)
    figure.legend(
        handles=_legend(groups), loc="outside lower center", fontsize=SMALL, ncols=columns,
        frameon=False,
    )  # fmt: skip
    return figure


def _draw(
    ax: Axes, name: str, line: str | None, *, group: Sequence[TeamRow], colour: str, shift: float
) -> None:
    """Draws a column of the rows over the number of drones, as dots on a line or as caps.

    Parameters
    ----------
    line : style of the line; a dotted line has hollow dots; None for caps
    """
    known = [row for row in group if getattr(row, name) is not None]
    places = [row.drones + shift for row in known]
    scale = 1.0 if name in ("reward", "bound") else 100.0
    heights = [scale * getattr(row, name) for row in known]
    if line is None:
        ax.plot(places, heights, ls="none", color=colour, **_CAP)
    else:
        face = "white" if line == ":" else colour
        ax.plot(places, heights, ls=line, color=colour, mfc=face, lw=1.2, **_DOT)


def _legend(groups: Sequence[Sequence[TeamRow]]) -> list[Line2D]:
    """Returns the legend's entries: cameras and heights, if there are several, and the marks."""
    kinds = [
        Line2D(
            [], [], color=SERIES[k % len(SERIES)], lw=3, label=kind_words(group[0]) or "as given"
        )
        for k, group in enumerate(groups)
        if len(groups) > 1
    ]
    colour = GREY if len(groups) > 1 else SERIES[0]
    marks: list[tuple[str, str, dict[str, Any]]] = [
        ("best plan found for what is drawn", "-", _DOT),
        ("plan with the highest J", ":", _DOT | {"mfc": "white"}),
        ("no plan exceeds this", "none", _CAP),
    ]
    return [*kinds, *(Line2D([], [], color=colour, ls=ls, lw=1.2, label=label, **mark)
                      for label, ls, mark in marks)]  # fmt: skip
