"""Planners compared over scenes: paired tests with a correction, and performance profiles.

Scenes are the sample, not seeds: the seeds of one scene give similar results, so a test that took
them for independent would find differences that are not there. Each pair of planners, a and b, has
one number for each scene: the mean of (a - b) / max(a, b) over the scene's seeds, which has no
unit. A run without a plan that obeys the rules counts as J = 0 and, unless it proves that no such
plan exists, as its whole time limit.

Wilcoxon's signed-rank test checks if these numbers are distributed symmetrically around 0. Zeros
keep their ranks (Pratt). With many pairs of planners, some p are small by chance; Holm's correction
limits the probability of any false positive to the chosen level.

For each factor, a performance profile gives the share of scenes on which a planner is within this
factor of the best planner; the seeds of a scene share its weight equally. It shows how often a
planner is close to the best, but with three or more planners it does not rank the others.

Sources: Wilcoxon 1945; Pratt 1959; Holm 1979; Dolan and More 2002; Demsar 2006.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np

from cocap_opt.data import BoolArray, FloatArray
from cocap_opt.experiments.tables.rows import GapRow
from cocap_opt.result import Reason

J, SECONDS = "J", "time"
ENOUGH = 6  # scenes; with fewer, no two-sided test has p < 0.05
_EXACT = 13  # up to this number of scenes, all signs are enumerated
_RESAMPLES, _SEED = 10_000, 0  # random signs, with more scenes
_SAME = 1e-9  # relative difference that rounding can cause between equal sums
_LEAST = 0.001  # s; shorter times count as this long, as ratios of them would mean nothing

_Values = Mapping[tuple[str, int | None], float]  # values by scene and seed


class PairedTest(NamedTuple):
    """Wilcoxon's signed-rank test of two planners over scenes.

    Attributes
    ----------
    measure : J or time
    planner, against : a and b
    above, equal, below : numbers of scenes on which a is higher than, equal to and lower than b
    median : median over scenes of (a - b) / max(a, b)
    p : two-sided, as if it were the only test
    corrected : p after Holm's correction over all tests of the measure
    """

    measure: str
    planner: str
    against: str
    above: int
    equal: int
    below: int
    median: float
    p: float
    corrected: float

    @property
    def scenes(self) -> int:
        """Number of scenes on which both planners were run."""
        return self.above + self.equal + self.below


class Profile(NamedTuple):
    """The performance profile of a planner, a step function.

    Attributes
    ----------
    measure : J or time
    planner : name of the planner
    ratios : [n] factors from the best at which the profile rises, >= 1, increasing
    shares : [n] shares of scenes on which the planner is within each factor
    """

    measure: str
    planner: str
    ratios: tuple[float, ...]
    shares: tuple[float, ...]

    def share(self, ratio: float) -> float:
        """Returns the share of scenes on which the planner is within a factor of the best."""
        at = int(np.searchsorted(self.ratios, ratio * (1 + _SAME), side="right"))
        return self.shares[at - 1] if at else 0.0


def paired_tests(rows: Sequence[GapRow], against: str | None = None) -> list[PairedTest]:
    """Returns tests of all pairs of planners, or of each planner with one; tests of J come first.

    Parameters
    ----------
    rows : of the gap table
    against : the planner to compare all others with; None: all pairs are compared
    """
    return [
        test
        for measure, values in _measured(rows).items()
        for test in _corrected(
            [
                _test(measure, a, b, values)
                for a, b in _pairs(list(values), against)
                if values[a].keys() & values[b].keys()
            ]
        )
    ]


def profiles(rows: Sequence[GapRow]) -> list[Profile]:
    """Returns the profiles of all planners; profiles of J come first.

    A scene and seed counts only if all planners were run on it, and at least one of them found a
    plan that obeys the rules.
    """
    return [
        profile
        for measure, values in _measured(rows).items()
        for profile in _profiles(measure, values, _plans(rows))
    ]


def _measured(rows: Sequence[GapRow]) -> dict[str, dict[str, _Values]]:
    """Returns J and seconds of each planner by scene and seed."""
    measures: dict[str, Callable[[GapRow], float | None]] = {J: _reward, SECONDS: _seconds}
    found: dict[str, dict[str, _Values]] = {}
    for measure, value_of in measures.items():
        groups = GapRow.grouped(
            [row for row in rows if row.reason != Reason.UNSUPPORTED], "planner"
        )
        values = {
            planner: {(row.scene, row.seed): v for row in group if (v := value_of(row)) is not None}
            for (planner,), group in groups.items()
        }
        found[measure] = {planner: known for planner, known in values.items() if known}
    return found


def _reward(row: GapRow) -> float:
    return max(row.reward or 0.0, 0.0) if row.valid else 0.0


def _seconds(row: GapRow) -> float | None:
    """Returns the seconds that a run counts as; None for plans from files."""
    if row.valid or row.reason == Reason.INFEASIBLE:
        return row.seconds
    return row.time_limit if row.time_limit is not None else row.seconds


def _plans(rows: Sequence[GapRow]) -> set[tuple[str, str, int | None]]:
    """Returns the planners, scenes and seeds for which a plan that obeys the rules was found."""
    return {(row.planner or "", row.scene, row.seed) for row in rows if row.valid}


# -- tests ---------------------------------------------------------------------------------------


def _pairs(planners: Sequence[str], against: str | None) -> list[tuple[str, str]]:
    if against is None:
        return list(combinations(planners, 2))
    others = (planner for planner in planners if planner != against)
    return [(planner, against) for planner in others if against in planners]


def _test(measure: str, a: str, b: str, values: Mapping[str, _Values]) -> PairedTest:
    """Returns a test whose `corrected` is still p itself."""
    of_scenes: dict[str, list[float]] = {}
    for scene, seed in sorted(values[a].keys() & values[b].keys(), key=str):
        first, second = values[a][scene, seed], values[b][scene, seed]
        most = max(first, second)
        of_scenes.setdefault(scene, []).append((first - second) / most if most > 0 else 0.0)
    means = np.array([math.fsum(part) / len(part) for part in of_scenes.values()])
    means[np.abs(means) <= _SAME] = 0.0
    p = signed_rank(means.tolist())
    counts = (int((means > 0).sum()), int((means == 0).sum()), int((means < 0).sum()))
    return PairedTest(measure, a, b, *counts, float(np.median(means)), p, p)


def signed_rank(differences: Sequence[float]) -> float:
    """Returns the two-sided p of Wilcoxon's signed-rank test; 1 if all differences are zero.

    Zeros keep their ranks (Pratt). For few differences, p is exact even with ties and zeros, as all
    signs are enumerated.
    """
    from scipy.stats import rankdata  # slow to import

    given = np.asarray(differences, dtype=np.float64)
    ranks = rankdata(np.abs(given))[given != 0]
    signs = np.sign(given[given != 0])
    if not len(ranks):
        return 1.0
    if len(ranks) <= _EXACT:
        bits = np.arange(2 ** len(ranks))[:, None] >> np.arange(len(ranks)) & 1
        drawn = (2 * bits - 1) @ ranks
    else:
        random = np.random.default_rng(_SEED)
        drawn = random.choice([-1.0, 1.0], size=(_RESAMPLES, len(ranks))) @ ranks
        drawn = np.append(drawn, signs @ ranks)  # so that p is never 0
    return float(np.mean(np.abs(drawn) >= abs(signs @ ranks) - 1e-9))


def _corrected(tests: Sequence[PairedTest]) -> list[PairedTest]:
    """Returns tests with Holm's corrected p."""
    corrected = holm([test.p for test in tests])
    return [test._replace(corrected=p) for test, p in zip(tests, corrected, strict=True)]


def holm(p: Sequence[float]) -> list[float]:
    """Returns p-values corrected by Holm's step-down procedure, in the order given."""
    found, least = [0.0] * len(p), 0.0
    for k, at in enumerate(sorted(range(len(p)), key=lambda i: p[i])):
        least = max(least, min(1.0, (len(p) - k) * p[at]))
        found[at] = least
    return found


# -- profiles ------------------------------------------------------------------------------------


def _profiles(
    measure: str, values: Mapping[str, _Values], plans: set[tuple[str, str, int | None]]
) -> list[Profile]:
    if not values:
        return []
    everywhere = set.intersection(*(set(known) for known in values.values()))
    instances = sorted(
        (key for key in everywhere if any((planner, *key) in plans for planner in values)), key=str
    )
    scenes = [scene for scene, _ in instances]
    if not instances:
        return []
    weights = np.array([1 / scenes.count(scene) for scene in scenes]) / len(set(scenes))
    known = [[values[planner][key] for key in instances] for planner in values]
    has_plan = [[(planner, *key) in plans for key in instances] for planner in values]
    ratios = _ratios(measure, np.array(known), np.array(has_plan))
    return [
        Profile(measure, planner, *_staircase(row, weights))
        for planner, row in zip(values, ratios, strict=True)
    ]


def _ratios(measure: str, values: FloatArray, has_plan: BoolArray) -> FloatArray:
    """Returns factors from the best planner [P, n] of values [P, n]; infinite without a plan."""
    if measure == SECONDS:
        costs = np.where(has_plan, np.maximum(values, _LEAST), math.inf)
        return np.asarray(costs / costs.min(axis=0, initial=math.inf))
    best = np.where(has_plan, values, 0.0).max(axis=0, initial=0.0)
    ratios = np.full(values.shape, math.inf)
    np.divide(best, values, out=ratios, where=has_plan & (values > 0))
    ratios[has_plan & (best == 0)] = 1.0  # no planner has more than J = 0
    return ratios


def _staircase(
    ratios: FloatArray, weights: FloatArray
) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Returns the factors at which the share of scenes rises, and the share there."""
    finite = np.isfinite(ratios)
    rising = np.where(ratios[finite] <= 1 + _SAME, 1.0, ratios[finite])
    steps, at = np.unique(rising, return_inverse=True)
    shares = np.cumsum(np.bincount(at, weights[finite], minlength=len(steps)))
    return tuple(steps.tolist()), tuple(np.round(shares, 12).tolist())
