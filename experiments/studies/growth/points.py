"""Sizes at which growth is measured, the runs of each, and power laws fitted to them.

The exponent of a size n is the slope of log seconds over log n, by least squares over the sizes
at which all seeds came to their end within the limit; that of the gap is over all sizes.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from statistics import median
from typing import NamedTuple

import numpy as np

from cocap_opt.experiments.studies.runs import Run
from cocap_opt.formulations.result import OPTIMALITY

GAP = 0.03  # certified gap whose time is taken: one that most sizes reach
_LEAST_SIZES = 3  # of a fit: any two points are on a line


class Field(NamedTuple):
    """Parameters of the scene `field`."""

    robots: int
    actors: int
    cells: int  # along each edge
    steps: int

    @property
    def words(self) -> str:
        """The parameters in one line, such as "8 robots, 8 actors, 30 cells, 16 steps"."""
        return ", ".join(f"{n} {what}" for what, n in self._asdict().items())


_BASE = Field(robots=8, actors=8, cells=30, steps=16)
# Where 15 x 15 cells are to compare with more, there is room for two people only.
BASES = {"robots": _BASE, "steps": _BASE, "cells": _BASE._replace(actors=2)}
SIZES: dict[str, tuple[int, ...]] = {
    "robots": (2, 4, 8, 16, 32, 64),
    "steps": (8, 16, 32, 64, 80),
    "cells": (15, 30, 48, 64, 96),
}


@dataclass(frozen=True)
class Point:
    """Runs of one size, one per seed.

    Attributes
    ----------
    axis : a key of SIZES, the parameter that changes
    size : its value
    """

    axis: str
    size: int
    runs: tuple[Run, ...]

    @property
    def field(self) -> Field:
        """Parameters of the scene."""
        return BASES[self.axis]._replace(**{self.axis: self.size})

    @property
    def finished(self) -> bool:
        """True if all runs came to their end."""
        return all(r.finished for r in self.runs)

    @property
    def seconds(self) -> list[float]:
        """Seconds of each run."""
        return [r.seconds for r in self.runs]

    @property
    def seconds_to_gap(self) -> list[float]:
        """Seconds of each run to a certified gap of GAP; infinite where it was not reached."""
        return [r.seconds_to_gap(GAP) for r in self.runs]

    @property
    def gaps(self) -> list[float]:
        """Certified gap (%) of each run at its end or the limit, at least the gap of a proof."""
        return [100 * max(r.gap, OPTIMALITY) for r in self.runs]


class Measure(NamedTuple):
    """A number that each run has.

    Attributes
    ----------
    of : the numbers of a point's runs
    whole : true of a point if no limit has cut one of its numbers short
    """

    of: Callable[[Point], list[float]]
    whole: Callable[[Point], bool]

    def exponent(self, points: Sequence[Point]) -> float:
        """Returns the exponent of the power law through the medians; NaN from too few sizes."""
        line = self.fit(points)
        return math.nan if line is None else line[0]

    def fit(self, points: Sequence[Point]) -> tuple[float, float] | None:
        """Returns slope and offset of log measure over log size, of sizes that no limit cut short.

        None if there are fewer than three such sizes.
        """
        pairs = [(p.size, median(self.of(p))) for p in points if self.whole(p)]
        pairs = [(size, value) for size, value in pairs if 0 < value < math.inf]
        if len(pairs) < _LEAST_SIZES:
            return None
        n, values = np.log(np.array(pairs)).T
        slope, offset = np.polyfit(n, values, 1)
        return float(slope), float(offset)


MEASURES: dict[str, Measure] = {
    "seconds": Measure(lambda point: point.seconds, lambda point: point.finished),
    "seconds_to_gap": Measure(
        lambda point: point.seconds_to_gap,
        lambda point: all(map(math.isfinite, point.seconds_to_gap)),
    ),
    "gap_percent": Measure(lambda point: point.gaps, lambda point: True),
}
