"""Rows of the table of solvers that measure our methods on one scene, with their targets.

Each row is a function that returns metrics: numbers with the targets that they must reach. If a
method needs more than the limit, its seconds are infinite, so that a median over seeds remains
correct.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from statistics import median
from typing import Literal, NamedTuple, Self

from cocap_opt.experiments.lab.studies.runs import Run, scene
from cocap_opt.result import UnsupportedError
from cocap_opt.run.engine import BOUND_METHOD

_MANY_SEEDS, SEEDS = tuple(range(10)), tuple(range(5))
_ROOT_SECONDS = 2.0


class Target(NamedTuple):
    """A number that a metric should reach."""

    relation: Literal["<", ">="]
    number: float

    @classmethod
    def below(cls, number: float) -> Self:
        """Makes the target of being below a number."""
        return cls("<", number)

    @classmethod
    def at_least(cls, number: float) -> Self:
        """Makes the target of being at least a number."""
        return cls(">=", number)

    def met(self, value: float) -> bool:
        """Returns True if a value reaches the target."""
        return value < self.number if self.relation == "<" else value >= self.number


class Metric(NamedTuple):
    """A measured number.

    Attributes
    ----------
    note : the instances on which it was measured, or why there is no number
    """

    name: str
    value: float
    unit: str
    must: Target | None = None
    moonshot: Target | None = None
    note: str = ""

    @property
    def met(self) -> str:
        """The most ambitious target that is met, in one word; empty without a target."""
        if self.moonshot is not None and self.moonshot.met(self.value):
            return "moonshot"
        if self.must is not None:
            return "must" if self.must.met(self.value) else "missed"
        return "" if self.moonshot is None else "open"

    @property
    def words(self) -> str:
        """The number with its unit."""
        if math.isinf(self.value):
            return "never" if self.value > 0 else "-"
        return "-" if math.isnan(self.value) else f"{self.value:.3g} {self.unit}"

    @property
    def targets(self) -> dict[str, str]:
        """The targets with their unit, by name; an empty text if there is no such target."""
        named = {"must": self.must, "moonshot": self.moonshot}
        return {
            name: "" if target is None else f"{target.relation} {target.number:g} {self.unit}"
            for name, target in named.items()
        }


@dataclass(frozen=True)
class RowOptions:
    """Options of the command; None if each row has its own default."""

    seeds: tuple[int, ...] | None = None
    limit: float | None = None
    large: Path | None = None

    def seeds_or(self, default: Sequence[int]) -> tuple[int, ...]:
        """Returns the seeds of a row."""
        return tuple(default) if self.seeds is None else self.seeds

    def at_most(self, seconds: float) -> float:
        """Returns the time limit (s) of a row whose targets name one, shortened to the option's."""
        return seconds if self.limit is None else min(seconds, self.limit)

    def limit_or(self, seconds: float) -> float:
        """Returns the time limit (s) of a row whose targets name none."""
        return seconds if self.limit is None else self.limit


def _corridor(options: RowOptions) -> list[Metric]:
    """Measures the corridor: 2 drones, 8 steps."""
    runs = _runs("corridor", options.seeds_or(_MANY_SEEDS), options.at_most(60.0))
    return [
        _proved(runs, must=1.0),
        Metric(
            "median seconds to proof", median(r.seconds_to_proof for r in runs), "s",
            Target.below(2), Target.below(0.3),
        ),
        _slowest(runs),
    ]  # fmt: skip


def _bottleneck(options: RowOptions) -> list[Metric]:
    """Measures the bottleneck: 4 drones, 11 steps."""
    seeds, seconds = options.seeds_or(_MANY_SEEDS), options.at_most(300.0)
    runs = _runs("bottleneck", seeds, seconds)
    roots = _runs("bottleneck", seeds, min(_ROOT_SECONDS, seconds), "column-generation")
    near = [r.seconds_to_gap(0.0002) for r in runs]
    in_time = min(60.0, seconds)
    # The best known J replaces the optimum, so the bound's distance is overestimated.
    off = [
        100 * (root.bound - max(r.value, root.value)) / root.bound
        for root, r in zip(roots, runs, strict=True)
    ]
    return [
        Metric(
            f"gap < 0.02 % in {in_time:g} s", sum(s <= in_time for s in near), f"of {len(runs)}",
            Target.at_least(len(runs)),
        ),
        Metric("median seconds to a gap of 0.02 %", median(near), "s"),
        _proved(runs, must=0.7, moonshot=1.0),
        Metric("median seconds to proof", median(r.seconds_to_proof for r in runs), "s",
               moonshot=Target.below(5)),
        _slowest(runs),
        Metric(f"root bound above the best J after {min(_ROOT_SECONDS, seconds):g} s, worst seed",
               max(off), "%", Target.below(0.5)),
    ]  # fmt: skip


def _passage(options: RowOptions) -> list[Metric]:
    """Measures the one-cell passage: 8 drones, 12 steps."""
    seconds = options.at_most(30.0)
    runs = _runs("passage", options.seeds_or(SEEDS), seconds)
    return [
        *_gaps(runs, seconds, Target.below(0.1)),
        _proved(runs, moonshot=1.0),
        Metric("median seconds to proof", median(r.seconds_to_proof for r in runs), "s"),
    ]


def _large(options: RowOptions) -> list[Metric]:
    """Measures Greedy Perspectives' `large`: 18 drones, 10 steps; a seed is a start set."""
    if options.large is None:
        raise UnsupportedError("this row needs --large FILE, the path of the scene's seq.yaml")
    seconds = options.at_most(120.0)
    runs = _runs(str(options.large), options.seeds_or(SEEDS), seconds)
    return [
        *_gaps(runs, seconds, Target.below(0.5)),
        *_gaps(runs, seconds / 2, None, Target.below(0.1)),
    ]


def _field(options: RowOptions) -> list[Metric]:
    """Measures the field: 6 drones, 6 people, 20 steps."""
    seconds = options.at_most(120.0)
    runs = _runs("field", options.seeds_or(SEEDS), seconds)
    return [
        *_gaps(runs, seconds, Target.below(0.05)),
        _proved(runs, must=0.6),
    ]


def _field_long(options: RowOptions) -> list[Metric]:
    """Measures the long field: 6 drones, 6 people, 60 steps, 75 moves a step."""
    return _wide(options, "field-long", {15.0: 1.5, 300.0: 0.3}, gigabytes=6)


def _field_large(options: RowOptions) -> list[Metric]:
    """Measures the large field: 64 drones, 32 people, 64 x 64 cells, 40 steps."""
    return _wide(options, "field-large", {60.0: 2.5, 120.0: 1.2, 600.0: 0.6}, gigabytes=12)


def _wide(
    options: RowOptions, name: str, gaps: Mapping[float, float], gigabytes: float
) -> list[Metric]:
    """Measures a scene too large for proofs: gaps and memory.

    Parameters
    ----------
    gaps : median gap (%) that must be reached, by time in s; the last time is the time limit
    """
    longest = options.at_most(max(gaps))
    runs = _runs(name, options.seeds_or(SEEDS), longest)
    figures: list[Metric] = []
    for seconds, gap in gaps.items():
        if seconds <= longest:
            figures += _gaps(runs, seconds, Target.below(gap))
    if longest not in gaps:
        figures += _gaps(runs, longest, None)
    return [*figures, _memory(runs, gigabytes)]


def _runs(
    name: str,
    seeds: Sequence[int],
    seconds: float,
    method: str = BOUND_METHOD,
) -> list[Run]:
    """Runs a method on each seed of a scene."""
    return [Run.of(partial(scene, name, seed), method, seconds).told(name, seed) for seed in seeds]


def _proved(
    runs: Sequence[Run], must: float | None = None, moonshot: float | None = None
) -> Metric:
    """Returns the number of optima that are proved; targets are shares of the runs."""

    def of_all(share: float | None) -> Target | None:
        return None if share is None else Target.at_least(math.ceil(share * len(runs)))

    count = sum(math.isfinite(r.seconds_to_proof) for r in runs)
    return Metric("proved optima", count, f"of {len(runs)}", of_all(must), of_all(moonshot))


def _slowest(runs: Sequence[Run]) -> Metric:
    return Metric("slowest seed's seconds to proof", max(r.seconds_to_proof for r in runs), "s")


def _gaps(
    runs: Sequence[Run], seconds: float, must: Target | None, moonshot: Target | None = None
) -> list[Metric]:
    gaps = [100 * r.gap_after(seconds) for r in runs]
    late = max(r.seconds for r in runs)
    note = f"the slowest run returned after {late:.1f} s"
    return [
        Metric(f"median gap after {seconds:g} s", median(gaps), "%", must, moonshot, note),
        Metric(f"largest gap after {seconds:g} s", max(gaps), "%"),
    ]


def _memory(runs: Sequence[Run], most: float) -> Metric:
    return Metric("largest peak memory", max(r.gigabytes for r in runs), "GB", Target.below(most))


SCENE_ROWS: Mapping[str, Callable[[RowOptions], list[Metric]]] = {
    "corridor": _corridor,
    "bottleneck": _bottleneck,
    "passage": _passage,
    "large": _large,
    "field": _field,
    "field-long": _field_long,
    "field-large": _field_large,
}
