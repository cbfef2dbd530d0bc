"""Measures how column generation grows with drones, steps and cells.

One of the three changes at a time, around a base field.
"""

import math
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from statistics import median

from cocap_opt.experiments.console.streams import say
from cocap_opt.experiments.report.figures import picture
from cocap_opt.experiments.results.files import make_folder, save_bytes, save_csv
from cocap_opt.experiments.results.printing import Listing, Record
from cocap_opt.experiments.studies.growth.figure import growth_figure
from cocap_opt.experiments.studies.growth.points import (
    BASES,
    GAP,
    MEASURES,
    SIZES,
    Field,
    Point,
)
from cocap_opt.experiments.studies.runs import Run
from cocap_opt.formulations.column_generation.column_generation import column_generation
from cocap_opt.scenarios.built_in.field import field


def growth(
    sizes: Mapping[str, Sequence[int]], seeds: Sequence[int], limit: float, out: Path | None = None
) -> bool:
    """Measures, prints, and writes the table (growth.csv) and the figure (growth.png).

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
    points: list[Point] = []
    known: dict[tuple[Field, int], Run | None] = {}
    try:
        for axis in SIZES:
            for size in sorted(sizes[axis]):
                wanted = BASES[axis]._replace(**{axis: size})
                for seed in seeds:
                    if (wanted, seed) not in known:
                        known[wanted, seed] = _measured(wanted, seed, limit)
                found = [r for seed in seeds if (r := known[wanted, seed]) is not None]
                if found:
                    points.append(Point(axis, size, tuple(found)))
                if out is not None and found:
                    save_csv(out / "growth.csv", _table(points, limit))
    finally:
        _print(points, limit)
    if out is not None and points:
        save_bytes(out / "growth.png", picture(growth_figure(points, limit), ".png"))
    return all(r is not None for r in known.values())


def _table(points: Sequence[Point], limit: float) -> list[Record]:
    """Returns the rows of the CSV file: medians per size, and the exponents of each axis so far."""
    return [
        {
            "axis": point.axis, "size": point.size, **point.field._asdict(),
            "seeds": len(point.runs),
            "at_limit": sum(not r.finished for r in point.runs),
            "limit": limit,
            **{name: median(measure.of(point)) for name, measure in MEASURES.items()},
            "gigabytes": max(r.gigabytes for r in point.runs),
            **{
                f"exponent_of_{name}": measure.exponent(_on_axis(points, point.axis))
                for name, measure in MEASURES.items()
            },
        }
        for point in points
    ]  # fmt: skip


def _on_axis(points: Sequence[Point], axis: str) -> list[Point]:
    return [point for point in points if point.axis == axis]


def _measured(wanted: Field, seed: int, limit: float) -> Run | None:
    """Runs column generation on a field; returns None if it failed."""
    try:
        result = Run.of(partial(field, seed, **wanted._asdict()), column_generation, limit)
    except Run.Error as error:
        say(f"{wanted.words}, seed {seed}: {error}")
        return None
    say(f"{wanted.words}, seed {seed}: {result.seconds:.2f} s, gap {100 * result.gap:.4f} %")
    return result


def _print(points: Sequence[Point], limit: float) -> None:
    rows = [
        {
            "axis": point.axis,
            "size": point.size,
            "to the end (s)": f"{median(point.seconds):.2f}{'' if point.finished else ' *'}",
            f"to a gap of {100 * GAP:g} % (s)": _number(median(point.seconds_to_gap)),
            "gap (%)": f"{median(point.gaps):.4f}",
            "peak (GB)": f"{max(r.gigabytes for r in point.runs):.2f}",
        }
        for point in points
    ]
    Listing(f"growth of column generation (medians; * stopped at {limit:g} s)", rows).print()
    slopes = [
        {
            "axis": axis,
            "to the end": _number(MEASURES["seconds"].exponent(some)),
            f"to a gap of {100 * GAP:g} %": _number(MEASURES["seconds_to_gap"].exponent(some)),
            "of the gap": _number(MEASURES["gap_percent"].exponent(some)),
        }
        for axis in SIZES
        if (some := _on_axis(points, axis))
    ]
    Listing("fitted exponents (times: of sizes that got there; gap: of all sizes)", slopes).print()


def _number(value: float) -> str:
    return f"{value:.2f}" if math.isfinite(value) else "-"
