"""Means with confidence intervals, and shifted geometric means, as solver benchmarks use them."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from cocap_opt.data import FloatArray

_CONFIDENCE = 0.95
NONE = "-"  # in place of a number that does not exist
ENOUGH = 5  # smallest number of values for an interval
_RESAMPLES, _SEED = 10_000, 0  # resamples and seed of a bootstrap interval
_SHIFT = 10.0  # s, for geometric means of times, as in qpbenchmark and Mittelmann's benchmarks


class Mean(NamedTuple):
    """Mean of a sample and its confidence interval, whose ends are nan if there are few values."""

    value: float
    low: float
    high: float
    spread: float  # standard deviation of the sample
    size: int

    @classmethod
    def of(cls, *groups: Sequence[float]) -> "Mean":
        """Returns the mean of the groups' means, with a percentile bootstrap interval.

        Each group is resampled with replacement on its own, with a fixed seed, so that the order of
        the groups does not matter. The interval of values that are never negative, such as gaps,
        has no negative ends (Efron and Tibshirani 1993). With few values the interval would be far
        too short, so there is none.
        """
        samples = [np.asarray(group, dtype=float) for group in sorted(groups, key=list)]
        values = np.concatenate(samples)
        mean = float(np.mean([sample.mean() for sample in samples]))
        spread = float(values.std(ddof=1)) if len(values) > 1 else math.nan
        if len(values) < ENOUGH or min(map(len, samples)) < 2:
            return cls(mean, math.nan, math.nan, spread, len(values))
        from scipy.stats import bootstrap  # slow to import

        interval = bootstrap(
            samples, _mean_of_means, vectorized=True, n_resamples=_RESAMPLES,
            confidence_level=_CONFIDENCE, method="percentile", random_state=_SEED,
        ).confidence_interval  # fmt: skip
        return cls(mean, float(interval.low), float(interval.high), spread, len(values))

    def text(self, digits: int, unit: str = "") -> str:
        """Returns the mean with its unit, and its interval if there is one, as text."""
        mean, *ends = (Mean.rounded(number, digits) for number in self[:3])
        reach = "" if math.isnan(self.low) else f" ({' to '.join(ends)})"
        return mean + unit + reach

    @staticmethod
    def shifted_geometric(values: Sequence[float], shift: float = _SHIFT) -> float:
        """Returns exp(mean(log(value + shift))) - shift.

        Neither the easiest nor the hardest instances dominate it.
        """
        logs = [math.log(value + shift) for value in values]
        return math.exp(math.fsum(logs) / len(values)) - shift

    @staticmethod
    def in_words(values: Sequence[float], digits: int = 3) -> str:
        """Returns the mean of values and its interval as text; "-" without values."""
        if not values:
            return NONE
        return Mean.of(values).text(digits)

    @staticmethod
    def rounded(value: float | None, digits: int) -> str:
        """Returns a number with so many decimals; "-" if it is None or not finite."""
        if value is None or not math.isfinite(value):
            return NONE
        return f"{round(value, digits) + 0.0:,.{digits}f}"  # never -0


def _mean_of_means(*samples: FloatArray, axis: int) -> FloatArray:
    means: FloatArray = np.mean([sample.mean(axis=axis) for sample in samples], axis=0)
    return means
