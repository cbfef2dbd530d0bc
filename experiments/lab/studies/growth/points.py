"""Sizes at which growth is measured, the samples of each, and power laws fitted to them.

The exponent of a size n is the slope of log seconds over log n, fitted by least squares to the
sizes at which all seeds finished within the limit; the exponent of the gap, to all sizes that have
a gap. If medians are not near such a line, no power law is stated.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import NamedTuple, Self

import numpy as np

from cocap_opt.experiments.lab.results import load_csv
from cocap_opt.experiments.lab.studies.runs import Run
from cocap_opt.formulations.result import OPTIMALITY

PROVED = 100 * OPTIMALITY  # %; with at most this gap, a plan is proved optimal
GAP = 0.03  # certified gap to which time is measured; most sizes reach it
_LEAST_SIZES = 4  # sizes for a fit: any two points are on a line, and three are often near one
_NEAR = 1.5  # largest factor between a median and a power law


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
# When the number of cells changes, there are two people, as 15 x 15 cells have no room for more.
BASES = {"robots": _BASE, "steps": _BASE, "cells": _BASE._replace(actors=2)}
SIZES: dict[str, tuple[int, ...]] = {
    "robots": (2, 4, 8, 16, 32, 64),
    "steps": (8, 16, 32, 64, 80),
    "cells": (15, 30, 48, 64, 96),
}


class Runs(NamedTuple):
    """Column generation on one field, as it is, and without step envelopes."""

    whole: Run
    cuts: Run


class Sample(NamedTuple):
    """Column generation on one field: a row of growth.csv."""

    axis: str  # a key of SIZES, the parameter that changes
    size: int  # its value
    seed: int
    limit: float  # s
    finished: bool  # no limit stopped it
    seconds: float
    seconds_to_gap: float  # to a certified gap of GAP; infinite if it was not reached
    gap: float  # certified, relative, at the end or the limit
    gap_of_cuts: float  # the same of envelope cuts alone, which bound faces one by one
    gigabytes: float  # peak memory

    @classmethod
    def of(cls, axis: str, size: int, seed: int, limit: float, runs: "Runs") -> Self:
        """Makes the row of the runs on one field."""
        run = runs.whole
        return cls(
            axis, size, seed, limit, run.finished, run.seconds, run.seconds_to_gap(GAP), run.gap,
            runs.cuts.gap, run.gigabytes,
        )  # fmt: skip

    @classmethod
    def read(cls, path: Path) -> list[Self]:
        """Returns the samples that are stored in a file."""
        return load_csv(path, cls, "growth")


@dataclass(frozen=True)
class GrowthPoint:
    """The samples of one size, one per seed."""

    axis: str
    size: int
    samples: tuple[Sample, ...]

    @classmethod
    def all_of(cls, samples: Sequence[Sample]) -> list[Self]:
        """Returns the points of some samples, axis by axis."""
        sizes = dict.fromkeys((sample.axis, sample.size) for sample in samples)
        return [
            cls(axis, size, tuple(s for s in samples if (s.axis, s.size) == (axis, size)))
            for axis, size in sizes
        ]

    @property
    def finished(self) -> bool:
        """True if no limit stopped a run."""
        return all(sample.finished for sample in self.samples)


class Measure(NamedTuple):
    """A number that each run has.

    Attributes
    ----------
    number : of a sample
    whole : returns True for a point if no limit cut one of its numbers short
    least : smaller numbers count as this one; a law is fitted to larger medians only
    """

    number: Callable[[Sample], float]
    whole: Callable[[GrowthPoint], bool]
    least: float = 0.0

    def of(self, point: GrowthPoint) -> list[float]:
        """Returns the numbers of a point's samples."""
        return [self.number(sample) for sample in point.samples]

    def exponent(self, points: Sequence[GrowthPoint]) -> float:
        """Returns the exponent of the power law through the medians; NaN if there is none."""
        line = self.fit(points)
        return math.nan if line is None else line[0]

    def fitted(self, points: Sequence[GrowthPoint]) -> list[GrowthPoint]:
        """Returns the points that a power law goes through."""
        return [p for p in points if self.whole(p) and self.least < median(self.of(p)) < math.inf]

    def fit(self, points: Sequence[GrowthPoint]) -> tuple[float, float] | None:
        """Returns slope and offset of log measure over log size, for sizes that no limit cut short.

        None if there are fewer than four such sizes, or if the medians are not near the line.
        """
        pairs = [(p.size, median(self.of(p))) for p in self.fitted(points)]
        if len(pairs) < _LEAST_SIZES:
            return None
        n, values = np.log(np.array(pairs)).T
        slope, offset = np.polyfit(n, values, 1)
        if np.abs(slope * n + offset - values).max() > math.log(_NEAR):
            return None
        return float(slope), float(offset)


MEASURES: dict[str, Measure] = {
    "seconds": Measure(lambda sample: sample.seconds, lambda point: point.finished),
    "seconds_to_gap": Measure(
        lambda sample: sample.seconds_to_gap,
        lambda point: all(math.isfinite(sample.seconds_to_gap) for sample in point.samples),
    ),
    "gap_of_cuts_percent": Measure(
        lambda sample: max(100 * sample.gap_of_cuts, PROVED), lambda point: True, PROVED
    ),
    "gap_percent": Measure(
        lambda sample: max(100 * sample.gap, PROVED), lambda point: True, PROVED
    ),
}
