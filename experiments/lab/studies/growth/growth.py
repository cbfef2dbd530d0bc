"""The growth of column generation with drones, steps and cells.

Only one of the three changes at a time, starting from a base field.
"""

import math
from collections.abc import Sequence
from functools import partial
from statistics import median
from typing import Annotated

from cyclopts import Parameter

from cocap_opt.console.streams import say
from cocap_opt.experiments.lab.results import STORED, Results, markdown
from cocap_opt.experiments.lab.studies.growth.figure import growth_figure
from cocap_opt.experiments.lab.studies.growth.points import (
    BASES,
    GAP,
    MEASURES,
    PROVED,
    SIZES,
    Field,
    GrowthPoint,
    Runs,
    Sample,
)
from cocap_opt.experiments.lab.studies.options import Out, Seconds
from cocap_opt.experiments.lab.studies.runs import Run
from cocap_opt.formulations.column_generation.branch_and_price import column_generation
from cocap_opt.formulations.column_generation.tree.root import Root
from cocap_opt.output.printing import Listing
from cocap_opt.run.options import Option
from cocap_opt.scenarios.built_in.field import field
from cocap_opt.text import counted

_TABLE = "growth.csv"
_PROSE = {"robots": "drones"}
_CUTS = partial(column_generation, solve_root=partial(Root.solve_aggregated, by_cuts_only=True))


def growth(
    *,
    robots: Annotated[str, Parameter(help="numbers of drones")] = "2,4,8,16,32,64",
    steps: Annotated[str, Parameter(help="numbers of steps")] = "8,16,32,64,80",
    cells: Annotated[
        str, Parameter(help="numbers of cells along each edge of the map")
    ] = "15,30,48,64,96",
    seeds: Annotated[str, Parameter(help="seeds, over which medians are taken")] = "0-4",
    limit: Seconds = 60.0,
    out: Out = None,
) -> int:
    """Measures, prints, and writes the samples (growth.csv) and the figure (growth.png)."""
    sizes = {
        axis: sorted(Option(f"--{axis}").numbers(text))
        for axis, text in (("robots", robots), ("steps", steps), ("cells", cells))
    }
    numbers, results = Option("--seeds").numbers(seeds), Results.into(out)
    samples: list[Sample] = []
    known: dict[tuple[Field, int], Runs | None] = {}
    wanted = [(axis, size, seed) for axis in SIZES for size in sizes[axis] for seed in numbers]
    try:
        for axis, size, seed in wanted:
            key = BASES[axis]._replace(**{axis: size}), seed
            if key not in known:
                known[key] = _measured(*key, limit)
            if (runs := known[key]) is not None:
                samples.append(Sample.of(axis, size, seed, limit, runs))
                results.save(_TABLE, samples)
    finally:
        _print(samples)
    if samples:
        results.draw("growth.png", lambda: growth_figure(GrowthPoint.all_of(samples), limit))
    return int(any(runs is None for runs in known.values()))


def growth_in_markdown() -> str:
    """Returns the stored time and gap for each size of the scene `field`."""
    samples = Sample.read(STORED / _TABLE)
    points = GrowthPoint.all_of(samples)
    middle = [
        {name: median(measure.of(point)) for name, measure in MEASURES.items()} for point in points
    ]
    table = markdown([
        {
            "changes": _PROSE.get(point.axis, point.axis),
            "to": f"{point.size}",
            f"to a gap of {100 * GAP:g} %": _seconds(found["seconds_to_gap"]),
            "gap at the end": _gap(found["gap_percent"]),
            "without step envelopes": _gap(found["gap_of_cuts_percent"]),
            "stopped": f"{sum(not s.finished for s in point.samples)} of {len(point.samples)}",
            "memory": f"{max(sample.gigabytes for sample in point.samples):.2f} GB",
        }
        for point, found in zip(points, middle, strict=True)
    ])  # fmt: skip
    seeds = counted(len({sample.seed for sample in samples}), "seed")
    of = f"Medians over {seeds}" if len(samples) > len(points) else "One seed of each size"
    return f"{table}\n{of}; runs were stopped after {samples[0].limit:g} s.\n"


def _seconds(seconds: float) -> str:
    return f"{seconds:.3g} s" if math.isfinite(seconds) else "-"


def _gap(percent: float) -> str:
    """Returns a gap in words; a gap that is not a proof is never rounded to zero."""
    if percent <= PROVED:
        return "proved"
    return "< 0.01 %" if percent < 0.01 else f"{percent:.2f} %"


def _measured(wanted: Field, seed: int, limit: float) -> Runs | None:
    """Runs column generation on a field; returns None if it failed."""
    build = partial(field, seed, **wanted._asdict())
    try:
        runs = Runs(*(Run.of(build, method, limit) for method in ("column-generation", _CUTS)))
    except Run.Error as error:
        say(f"{wanted.words}, seed {seed}: {error}")
        return None
    say(f"{wanted.words}, seed {seed}: {runs.whole.seconds:.2f} s, "
        f"gap {100 * runs.whole.gap:.4f} %, by cuts alone {100 * runs.cuts.gap:.4f} %")  # fmt: skip
    return runs


def _print(samples: Sequence[Sample]) -> None:
    points, to_gap = GrowthPoint.all_of(samples), f"to a gap of {100 * GAP:g} %"
    middle = {name: [median(m.of(p)) for p in points] for name, m in MEASURES.items()}
    rows = [
        {
            "axis": point.axis,
            "size": point.size,
            "to the end (s)": f"{seconds:.2f}{'' if point.finished else ' *'}",
            f"{to_gap} (s)": _number(seconds_to_gap),
            "gap (%)": f"{gap:.4f}",
            "by cuts alone (%)": f"{cuts:.4f}",
            "peak (GB)": f"{max(s.gigabytes for s in point.samples):.2f}",
        }
        for point, seconds, seconds_to_gap, cuts, gap in zip(points, *middle.values(), strict=True)
    ]
    Listing("growth of column generation (medians; * the limit stopped some)", rows).print()
    slopes = [
        {
            "axis": axis,
            **{
                words: _number(MEASURES[name].exponent([p for p in points if p.axis == axis]))
                for words, name in (
                    ("to the end", "seconds"), (to_gap, "seconds_to_gap"),
                    ("of the gap", "gap_percent"),
                )
            },
        }
        for axis in SIZES
    ]  # fmt: skip
    Listing("exponents, where medians follow a power law (times: of sizes that got there)",
            slopes).print()  # fmt: skip


def _number(value: float) -> str:
    return f"{value:.2f}" if math.isfinite(value) else "-"
