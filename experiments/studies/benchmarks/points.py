"""Sizes at which growth is measured, what is known of each, and the fits.

The exponent of a size n is the slope of log seconds over log n, by least squares over the
sizes at which all seeds got there within the limit; that of the gap is over all sizes.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from statistics import median
from typing import NamedTuple

import numpy as np

from cocap_opt.experiments.studies.benchmarks.runs import Run
from cocap_opt.formulations.result import OPTIMALITY
from cocap_opt.stop import Limit

GAP = 0.03  # certified gap whose time is taken: one that most sizes reach
LEAST_SIZES = 3  # of a fit: any two points are on a line


class Field(NamedTuple):
    """Parameters of a field."""

    robots: int
    actors: int
    cells: int
    steps: int


BASE = Field(robots=8, actors=8, cells=30, steps=16)
# Where 15 x 15 cells are to compare with more, there is room for two people only.
BASES = {"robots": BASE, "steps": BASE, "cells": BASE._replace(actors=2)}
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
    axis : what changes
    size : how many of it
    """

    axis: str
    size: int
    runs: tuple[Run, ...]

    @property
    def finished(self) -> bool:
        """Whether all runs came to their end."""
        return all(r.limit is Limit.NONE for r in self.runs)

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
        """Certified gap (%) of each run at its end or the limit, at least what counts as none."""
        return [100 * max(r.gap, OPTIMALITY) for r in self.runs]


class Measure(NamedTuple):
    """A number of each run.

    Attributes
    ----------
    of : the numbers of a point's runs
    whole : whether a limit has spoilt none of them
    """

    of: Callable[[Point], list[float]]
    whole: Callable[[Point], bool]


def reached(point: Point) -> bool:
    """Whether all runs reached a certified gap of GAP, wherever they ended."""
    return all(map(math.isfinite, point.seconds_to_gap))


def exponent(points: Sequence[Point], measure: Measure) -> float:
    """Slope of log measure over log size, of the medians of sizes that no limit has spoilt.

    NaN with fewer than LEAST_SIZES.
    """
    line = fitted(points, measure)
    return math.nan if line is None else line[0]


def fitted(points: Sequence[Point], measure: Measure) -> tuple[float, float] | None:
    """Slope and offset of log measure over log size; None with fewer than LEAST_SIZES."""
    pairs = [(p.size, median(measure.of(p))) for p in points if measure.whole(p)]
    pairs = [(size, value) for size, value in pairs if 0 < value < math.inf]
    if len(pairs) < LEAST_SIZES:
        return None
    n, values = np.log(np.array(pairs)).T
    slope, offset = np.polyfit(n, values, 1)
    return float(slope), float(offset)


MEASURES: dict[str, Measure] = {
    "seconds": Measure(lambda point: point.seconds, lambda point: point.finished),
    "seconds_to_gap": Measure(lambda point: point.seconds_to_gap, reached),
    "gap_percent": Measure(lambda point: point.gaps, lambda point: True),
}
