"""Measures how column generation grows with drones, steps and cells.

One of the three changes at a time, around a base field.
"""

import math
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from statistics import median

from cocap_opt.console.streams import say
from cocap_opt.experiments.lab.studies.growth.figure import growth_figure
from cocap_opt.experiments.lab.studies.growth.points import (
    BASES,
    GAP,
    MEASURES,
    SIZES,
    Field,
    Point,
    Runs,
    Sample,
)
from cocap_opt.experiments.lab.studies.runs import Run
from cocap_opt.formulations.column_generation.branch_and_price import column_generation
from cocap_opt.formulations.column_generation.tree.root import Root
from cocap_opt.output.files import make_folder, save_bytes, save_csv
from cocap_opt.output.printing import Listing
from cocap_opt.pictures.figures import picture
from cocap_opt.scenarios.built_in.field import field

TABLE = "growth.csv"
_CUTS = partial(column_generation, solve_root=partial(Root.solve_aggregated, by_cuts_only=True))


def growth(
    sizes: Mapping[str, Sequence[int]], seeds: Sequence[int], limit: float, out: Path | None = None
) -> bool:
    """Measures, prints, and writes the samples (growth.csv) and the figure (growth.png).

    Parameters
    ----------
    sizes : by axis, a key of SIZES
    limit : s, of each run

    Returns
    -------
    bool
        True if no run failed.
    """
    make_folder(out)
    samples: list[Sample] = []
    known: dict[tuple[Field, int], Runs | None] = {}
    wanted = [
        (axis, size, seed) for axis in SIZES for size in sorted(sizes[axis]) for seed in seeds
    ]
    try:
        for axis, size, seed in wanted:
            key = BASES[axis]._replace(**{axis: size}), seed
            if key not in known:
                known[key] = _measured(*key, limit)
            if (runs := known[key]) is not None:
                samples.append(Sample.of(axis, size, seed, limit, runs))
                if out is not None:
                    save_csv(out / TABLE, [sample._asdict() for sample in samples])
    finally:
        _print(samples)
    if out is not None and samples:
        draw(samples, out)
    return all(runs is not None for runs in known.values())


def draw(samples: Sequence[Sample], out: Path) -> None:
    """Writes the figure into a folder."""
    figure = growth_figure(Point.all_of(samples), samples[0].limit)
    save_bytes(out / "growth.png", picture(figure, ".png"))


def _measured(wanted: Field, seed: int, limit: float) -> Runs | None:
    """Runs column generation on a field; returns None if it failed."""
    build = partial(field, seed, **wanted._asdict())
    try:
        runs = Runs(*(Run.of(build, method, limit) for method in (column_generation, _CUTS)))
    except Run.Error as error:
        say(f"{wanted.words}, seed {seed}: {error}")
        return None
    say(f"{wanted.words}, seed {seed}: {runs.whole.seconds:.2f} s, "
        f"gap {100 * runs.whole.gap:.4f} %, by cuts alone {100 * runs.cuts.gap:.4f} %")  # fmt: skip
    return runs


def _print(samples: Sequence[Sample]) -> None:
    points, to_gap = Point.all_of(samples), f"to a gap of {100 * GAP:g} %"
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
