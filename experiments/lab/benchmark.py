"""The benchmark of exact methods: time and bound against the number of steps, and its figure.

`cocap-opt study steps` measures it. Generic solvers get the whole problem as one integer program,
without help of column generation, so that their bounds are their own word.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum
from itertools import cycle
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, NamedTuple, Self

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, MaxNLocator, NullFormatter

from cocap_opt.experiments.lab.results import STORED, read_csv
from cocap_opt.files.documents import FileError
from cocap_opt.formulations.result import OPTIMALITY
from cocap_opt.pictures.style import (
    SERIES,
    TITLE,
    add_legend,
    draw_level,
    new_figure,
    set_frame,
)

if TYPE_CHECKING:
    import pandas as pd

_MARKS = "osD^vP*X"
_SIZE = (10.5, 4.6)  # inches
_LEAST_GAP = 100 * OPTIMALITY  # %, of a bound that is called the optimum
_MOST_GAP = 1000.0  # %, where bounds are drawn that are larger, or missing
_LEAST_SECONDS = 1e-3  # where the axis of seconds begins
_SPREAD = 0.5  # of a step, over which methods lie beside each other


class RunStatus(StrEnum):
    """The way in which a run of an exact method ended."""

    PROVED = "proved"
    STOPPED = "stopped"  # by the limit
    REFUSED = "refused"  # the problem, as too large
    FAILED = "failed"  # it died, or ran on long after its limit


class MethodRun(NamedTuple):
    """A run of an exact method on a scene that is cut off after some steps.

    Attributes
    ----------
    seconds : by the clock; nan if it failed
    processor : seconds that a processor worked on it
    value : J of its plan by the referee; -inf without one
    bound : by its certificate or, of a generic solver, its own word; inf without one
    """

    method: str
    steps: int
    seed: int
    outcome: RunStatus
    seconds: float
    processor: float
    value: float
    bound: float
    message: str


@dataclass(frozen=True)
class Benchmark:
    """Runs of exact methods on one scene, cut off after more and more steps."""

    runs: Sequence[MethodRun]

    @classmethod
    def read(cls, path: Path = STORED / "solvers.csv") -> Self:
        """Reads a table that `cocap-opt study steps` has written, usually the stored one.

        Raises
        ------
        FileError
            If it cannot be read, or is no such table.
        """
        runs = read_csv(path, _run, "must be as `cocap-opt study steps` writes it")
        if not runs:
            raise FileError(f"{path}: has no runs")
        return cls(runs)

    @property
    def table(self) -> "pd.DataFrame":
        """The runs, a row each, with the bound above the optimum in %."""
        import pandas as pd

        above = "bound above the optimum (%)"
        return pd.DataFrame([run._asdict() | {above: self._above(run)} for run in self.runs])

    def plot(self, figure: Figure | None = None) -> Figure:
        """Draws time and bound against steps; a hollow mark is a run that proved nothing.

        Lines go through medians over seeds. A run that a limit stopped needs more time than where
        its mark is. Crosses are runs that failed, and problems that a method refuses.

        Parameters
        ----------
        figure : an empty one, such as one of pyplot's, to be drawn in
        """
        figure = figure or new_figure(*_SIZE)
        time, bound = figure.subplots(1, 2)
        methods = list(dict.fromkeys(run.method for run in self.runs))
        width = _SPREAD / max(len(methods) - 1, 1)
        styles = zip(cycle(SERIES), cycle(_MARKS), strict=False)
        for k, (method, style) in enumerate(zip(methods, styles, strict=False)):
            runs, aside = [r for r in self.runs if r.method == method], k * width - _SPREAD / 2
            _Series(runs, method, style, aside).draw(time, lambda run: run.processor)
            _Series(runs, method, style, aside).draw(bound, self._shown)
        time.set_title("time until the optimum is proved (hollow: stopped before)", fontsize=TITLE)
        time.set_ylabel("seconds of one processor")
        bound.set_title("bound above the optimum (hollow: not proved)", fontsize=TITLE)
        bound.set_ylabel(f"% (at most {_LEAST_GAP:g}: proved)")
        for ax in (time, bound):
            _set_axes(ax)
        most = max((run.processor for run in self.runs if run.processor > 0), default=1.0)
        time.set_ylim(_LEAST_SECONDS, 3 * most)
        bound.set_ylim(_LEAST_GAP / 3, 3 * _MOST_GAP)
        draw_level(bound, _MOST_GAP, "none, or more")
        add_legend(figure, time)
        return figure

    def _above(self, run: MethodRun) -> float:
        """Returns the gap of a run's bound to the optimum, in %; inf where one is not known."""
        optima = [
            other.value
            for other in self.runs
            if other.outcome is RunStatus.PROVED
            and (other.steps, other.seed) == (run.steps, run.seed)
        ]  # fmt: skip
        optimum = max(optima, default=math.nan)
        return 100 * (run.bound / optimum - 1) if optimum > 0 else math.inf

    def _shown(self, run: MethodRun) -> float:
        return min(max(self._above(run), _LEAST_GAP), _MOST_GAP)


class _Series(NamedTuple):
    """The runs of a method, with the style in which they are drawn."""

    runs: Sequence[MethodRun]
    method: str
    style: tuple[str, str]  # colour and mark
    aside: float  # steps, by which its marks are moved to the side

    def draw(self, ax: Axes, height: Callable[[MethodRun], float]) -> Axes:
        """Draws marks of all runs, and a line through medians over the seeds."""
        colour, mark = self.style
        for outcome, filling in ((RunStatus.PROVED, colour), (RunStatus.STOPPED, "none")):
            runs = [run for run in self.runs if run.outcome is outcome]
            at = [run.steps + self.aside for run in runs]
            ax.scatter(at, [height(run) for run in runs], s=18, lw=0.8, alpha=0.7, marker=mark,
                       facecolors=filling, edgecolors=colour)  # fmt: skip
        lost = [run for run in self.runs if run.outcome in (RunStatus.REFUSED, RunStatus.FAILED)]
        ax.plot([run.steps + self.aside for run in lost], [0.98] * len(lost), "x", ms=5,
                color=colour, transform=ax.get_xaxis_transform())  # fmt: skip
        line = list(self._medians(height))
        ax.plot([x for x, _ in line], [y for _, y in line], color=colour, lw=1.0, alpha=0.7)
        ax.plot([], [], color=colour, marker=mark, ms=5, lw=1.0, label=self.method)
        return ax

    def _medians(self, height: Callable[[MethodRun], float]) -> Iterator[tuple[float, float]]:
        """Yields the medians of steps at which the method has an answer for each seed."""
        for steps in sorted({run.steps for run in self.runs}):
            runs = [run for run in self.runs if run.steps == steps]
            if all(run.outcome in (RunStatus.PROVED, RunStatus.STOPPED) for run in runs):
                yield steps + self.aside, median(height(run) for run in runs)


def _set_axes(ax: Axes) -> None:
    ax.set_yscale("log")
    ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    ax.yaxis.set_minor_formatter(NullFormatter())
    ax.xaxis.set_major_locator(MaxNLocator(integer=True))
    ax.set_xlabel("steps")
    set_frame(ax)


def _run(row: dict[str, str]) -> MethodRun:
    """Returns the run that a row of the table tells of."""
    numbers = {name: float(row[name]) for name in ("seconds", "processor", "value", "bound")}
    return MethodRun(
        method=row["method"], steps=int(row["steps"]), seed=int(row["seed"]),
        outcome=RunStatus(row["outcome"]), message=row["message"], **numbers,
    )  # fmt: skip
