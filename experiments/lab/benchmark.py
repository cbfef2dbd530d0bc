"""The benchmark of exact methods: time and bound against the number of steps, and its figure.

`cocap-opt study steps` measures it. Generic solvers get the whole problem as one integer program,
without help from column generation; no certificate proves their bounds.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from itertools import chain, cycle, repeat
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Any, NamedTuple, Self

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from cocap_opt.experiments.lab.results import STORED, read_csv
from cocap_opt.files.documents import FileError
from cocap_opt.formulations.result import OPTIMALITY
from cocap_opt.pictures.style import (
    LABEL,
    MARKS,
    SERIES,
    WIDTH,
    add_legend,
    draw_level,
    new_figure,
    set_frame,
    set_plain_log,
)

if TYPE_CHECKING:
    import pandas as pd

_SIZE = (WIDTH, 6.6)  # inches
_POINTS = (13, 11.5, 10, 9, 8, 8, 6)  # sizes of marks; they differ so that no mark hides another
_LEAST_GAP = 100 * OPTIMALITY  # %; bounds with a smaller gap count as the optimum
_MOST_GAP = 1000.0  # %; larger and missing bounds are drawn here
_LEAST_SECONDS = 1e-3  # start of the axis of seconds


class RunStatus(StrEnum):
    """The way in which a run of an exact method ended."""

    PROVED = "proved"
    STOPPED = "stopped"  # a limit stopped it
    REFUSED = "refused"  # it rejected the problem as too large
    FAILED = "failed"  # it died, or kept running long after its limit


class MethodRun(NamedTuple):
    """A run of an exact method on a scene that is cut off after some steps.

    Attributes
    ----------
    seconds : wall-clock time; nan if it failed
    processor : CPU time in seconds
    value : J of its plan by the referee; -inf without a plan
    bound : bound of its certificate, or, for a generic solver, as the solver states it; inf
        without a bound
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
        """Reads a table that `cocap-opt study steps` wrote; by default the stored one.

        Raises
        ------
        FileError
            If it cannot be read, or is not such a table.
        """
        runs = read_csv(path, _run, "must be a file of `cocap-opt study steps`")
        if not runs:
            raise FileError(f"{path}: has no runs")
        return cls(runs)

    @property
    def table(self) -> "pd.DataFrame":
        """The runs, one row each; bounds are in % above the optimum."""
        import pandas as pd

        above = "bound above the optimum (%)"
        return pd.DataFrame([run._asdict() | {above: self._above(run)} for run in self.runs])

    def plot(self, figure: Figure | None = None) -> Figure:
        """Draws time and bound against the number of steps, as medians over seeds.

        A hollow mark means that a limit stopped at least one run, so its real time is longer. A
        line ends if the method rejected the next problem, or failed on it.

        Parameters
        ----------
        figure : an empty figure to draw into, e.g. of pyplot
        """
        figure = figure or new_figure(*_SIZE)
        time, bound = figure.subplots(2, 1, sharex=True)
        methods = dict.fromkeys(run.method for run in self.runs)
        looks = zip(cycle(SERIES), cycle(MARKS), chain(_POINTS, repeat(_POINTS[-1])), strict=False)
        for method, (colour, mark, size) in zip(methods, looks, strict=False):
            of_method = [run for run in self.runs if run.method == method]
            look = {"color": colour, "marker": mark, "ms": size, "lw": 1.4, "mew": 1.4}
            _draw_medians(time, of_method, lambda run: run.processor, look)
            _draw_medians(bound, of_method, self._shown, look)
        time.set_title("time to prove the optimum (hollow: stopped by the limit)", fontsize=LABEL)
        time.set_ylabel("CPU time (s)")
        bound.set_title("bound above the optimum (hollow: not proved)", fontsize=LABEL)
        bound.set_ylabel(f"% ({_LEAST_GAP:g}: proved)")
        bound.set_xlabel("steps")
        for ax in (time, bound):
            set_plain_log(ax, "y")
            set_frame(ax)
        most = max((run.processor for run in self.runs if run.processor > 0), default=1.0)
        time.set_ylim(_LEAST_SECONDS, 3 * most)
        bound.set_ylim(_LEAST_GAP / 3, 6 * _MOST_GAP)
        bound.xaxis.set_major_locator(MaxNLocator(integer=True))
        draw_level(bound, _MOST_GAP, "no bound, or more", "right")
        add_legend(figure, time, columns=3)
        return figure

    def _above(self, run: MethodRun) -> float:
        """Returns the gap of a run's bound to the optimum, in %; inf if one of them is unknown."""
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


def _draw_medians(
    ax: Axes, runs: Sequence[MethodRun], height: Callable[[MethodRun], float], look: dict[str, Any]
) -> None:
    """Draws the medians of a method's runs at steps for which all seeds have an answer."""
    ends = (RunStatus.PROVED, RunStatus.STOPPED)
    by_steps = {steps: [run for run in runs if run.steps == steps]
                for steps in sorted({run.steps for run in runs})}  # fmt: skip
    answered = {steps: at_steps for steps, at_steps in by_steps.items()
                if all(run.outcome in ends for run in at_steps)}  # fmt: skip
    line = [(steps, median(map(height, at_steps))) for steps, at_steps in answered.items()]
    ax.plot([x for x, _ in line], [y for _, y in line], **{**look, "marker": ""})
    for (x, y), at_steps in zip(line, answered.values(), strict=True):
        proved = all(run.outcome is RunStatus.PROVED for run in at_steps)
        ax.plot(x, y, **{**look, "ls": "", "mfc": look["color"] if proved else "white"})
    ax.plot([], [], label=runs[0].method, **look)


def _run(row: dict[str, str]) -> MethodRun:
    """Returns the run that a row of the table describes."""
    numbers = {name: float(row[name]) for name in ("seconds", "processor", "value", "bound")}
    return MethodRun(
        method=row["method"], steps=int(row["steps"]), seed=int(row["seed"]),
        outcome=RunStatus(row["outcome"]), message=row["message"], **numbers,
    )  # fmt: skip
