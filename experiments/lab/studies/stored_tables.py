"""Tables in Markdown of what studies have stored as CSV, a function for each study."""

import csv
import math
from collections.abc import Sequence
from pathlib import Path
from statistics import median

from cocap_opt.experiments.lab.stored_results import STORED
from cocap_opt.experiments.lab.studies.growth.points import GAP, MEASURES, Point, Sample
from cocap_opt.experiments.lab.studies.lazy import means
from cocap_opt.experiments.lab.studies.others.tables import BETWEEN, PLAN, WORD
from cocap_opt.output.printing import Listing, Record, counted

_Rows = list[dict[str, str]]
_LEAST_PERCENT = 0.0001  # which optimal means; less is rounding
_PROSE = {"robots": "drones"}
_JUDGED = {PLAN: "the plan", BETWEEN: "between cells", WORD: "their word"}
_MET = {"must": "target", "moonshot": "ambitious", "missed": "missed", "open": "not yet"}


def start_sets_in_markdown() -> str:
    """Returns means over the start sets of Greedy Perspectives' scenes, as its paper has them."""
    return _table([
        {
            "scene": row["scene"],
            "planner": row["planner"],
            "reward": f"{float(row['reward']):,.0f} ± {float(row['sd']):,.0f}",
            "drones that collide": f"{float(row['colliding']):.1f}",
            "gap, mean": _percent(row["gap"]),
            "gap, largest": _percent(row["largest gap"]),
            "gap without rules": _percent(row["gap_free"]),
            "proved": f"{row['proved']} of {row['sets']}",
        }
        for row in _stored("greedy-perspectives.csv")
    ])  # fmt: skip


def published_in_markdown(name: str) -> str:
    """Returns plans that others have published beside ours, and of what their J is.

    Parameters
    ----------
    name : of the stored file
    """
    return _table([
        {
            "scene": row["scene"],
            "plan of": "them" if row["by"] == "them" else "us",
            "planner": row["planner"],
            "J": f"{float(row['reward']):,.1f}",
            "J of": _JUDGED[row["of"]],
            "below the bound": _percent(row["gap"]),
            "conflicts": row["conflicts"] or "-",
            "above their best": f"{float(row['above theirs (%)']):+.2f} %",
        }
        for row in _stored(name)
        if row["reward"] and row["above theirs (%)"]
    ])  # fmt: skip


def findings_in_markdown(name: str) -> str:
    """Returns what the study of others' scenes found, in sentences.

    Parameters
    ----------
    name : of the stored file, others.md as the study writes it
    """
    text = (STORED / name).read_text(encoding="utf-8")
    return text.partition("## Their evaluation\n\n")[2].partition("\n\n")[0]


def views_in_markdown() -> str:
    """Returns how far planned pixels are from rendered ones, face by face."""
    errors = {"median": "half", "90 %": "nine tenths", "99 %": "99 of 100", "largest": "all"}
    return _table([
        {
            "scene": row["scene"],
            "faces": words,
            "number": row[kind],
            **{
                f"{share} within": f"{float(row[f'{kind}, {error} error (%)']):.2g} %"
                for error, share in errors.items()
            },
        }
        for kind, words in (("clear", "in full view"), ("hidden", "partly hidden"))
        for row in _stored("views.csv")
    ])  # fmt: skip


def coverage_in_markdown() -> str:
    """Returns what coverage of wide maps costs: processor time, memory, and how many states."""
    return _table([
        {
            "map": row["scene"],
            "drones": row["robots"],
            "states": f"{int(row['states']):,}",
            "processor time": _number(row["processor (s)"], "s"),
            "memory": f"{float(row['peak (GB)']):.2f} GB",
            "us a state": f"{float(row['us']):.1f}",
        }
        for row in _stored("coverage.csv")
    ])  # fmt: skip


def solver_figures_in_markdown() -> str:
    """Returns what bounds and exact methods need, beside the targets."""
    return _table([
        {
            "row": row["row"],
            "figure": row["figure"],
            "measured": _number(row["value"], row["unit"]),
            "target": row["must"] or "-",
            "ambitious": row["moonshot"] or "-",
            "met": _MET.get(row["met"], "-"),
            "note": row["note"],
        }
        for row in _stored("solver-figures.csv")
    ])  # fmt: skip


def speed_in_markdown() -> str:
    """Returns processor times and ratios beside what is promised."""
    return _table([
        {
            "figure": row["figure"],
            "measured": _number(row["measured"], row["unit"]),
            "promised": row["target"] or "-",
        }
        for row in _stored("speed.csv")
    ])  # fmt: skip


def growth_in_markdown() -> str:
    """Returns the time and the gap of column generation for each size of the scene `field`."""
    samples = Sample.read(STORED / "growth.csv")
    points = Point.all_of(samples)
    middle = [
        {name: median(measure.of(point)) for name, measure in MEASURES.items()} for point in points
    ]
    table = _table([
        {
            "changes": _PROSE.get(point.axis, point.axis),
            "to": f"{point.size}",
            f"to a gap of {100 * GAP:g} %": _seconds(found["seconds_to_gap"]),
            "gap at the end": f"{found['gap_percent']:.2f} %",
            "without step envelopes": f"{found['gap_of_cuts_percent']:.2f} %",
            "stopped": f"{sum(not s.finished for s in point.samples)} of {len(point.samples)}",
            "memory": f"{max(sample.gigabytes for sample in point.samples):.2f} GB",
        }
        for point, found in zip(points, middle, strict=True)
    ])  # fmt: skip
    seeds = counted(len({sample.seed for sample in samples}), "seed")
    of = f"Medians over {seeds}" if len(samples) > len(points) else "One seed of each size"
    return f"{table}\n{of}; runs were stopped after {samples[0].limit:g} s.\n"


def lazy_in_markdown() -> str:
    """Returns what lazy value iteration asks for and takes, scene by scene."""
    return _table(means(_stored("lazy.csv")))


def _stored(name: str) -> _Rows:
    path: Path = STORED / name
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def _table(rows: Sequence[Record]) -> str:
    return Listing("", rows).markdown


def _percent(share: str) -> str:
    return f"{100 * float(share):.2f} %" if share else "-"


def _seconds(seconds: float) -> str:
    return f"{seconds:.3g} s" if math.isfinite(seconds) else "-"


def _number(text: str, unit: str) -> str:
    number = float(text)
    if unit == "%" and 0 < number < _LEAST_PERCENT:
        return f"< {_LEAST_PERCENT} %"
    return f"{number:.3g} {unit}".strip() if math.isfinite(number) else "-"
