"""Tables in Markdown of what studies have stored as CSV, a function for each study."""

import csv
from collections.abc import Sequence
from pathlib import Path

from cocap_opt.experiments.results.printing import Listing, Record
from cocap_opt.experiments.studies.paper.measured import STORED

_Rows = list[dict[str, str]]


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
    """Returns plans that others have published beside ours, all judged by one referee.

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
            "below the bound": _percent(row["gap"]),
            "conflicts": row["conflicts"],
            "above theirs": f"{float(row['above theirs (%)']):+.2f} %",
        }
        for row in _stored(name)
        if row["reward"] and row["above theirs (%)"]
    ])  # fmt: skip


def views_in_markdown() -> str:
    """Returns how far planned pixels are from rendered ones, face by face."""
    errors = {"clear": ("99 %", "largest"), "hidden": ("median", "90 %")}
    return _table([
        {
            "scene": row["scene"],
            **{
                title: text
                for kind, shown in errors.items()
                for title, text in (
                    (f"{kind} faces", row[kind]),
                    *((f"{one} error", f"{float(row[f'{kind}, {one} error (%)']):.2g} %")
                      for one in shown),
                )
            },
        }
        for row in _stored("views.csv")
    ])  # fmt: skip


def solver_figures_in_markdown() -> str:
    """Returns what bounds and exact methods need, beside the targets."""
    return _table([
        {
            "row": row["row"],
            "figure": row["figure"],
            "measured": f"{float(row['value']):.3g} {row['unit']}".strip(),
            "target": row["must"] or "-",
            "met": row["met"],
        }
        for row in _stored("solver-figures.csv")
    ])  # fmt: skip


def growth_in_markdown() -> str:
    """Returns the time and the gap of column generation for each size of the scene `field`."""
    return _table([
        {
            "changes": row["axis"],
            **{key: row[key] for key in ("robots", "actors", "cells", "steps")},
            "to a gap of 3 %": _seconds(row["seconds_to_gap"]),
            "gap at the end": f"{float(row['gap_percent']):.2f} %",
            "stopped": f"{row['at_limit']} of {row['seeds']}",
            "memory": f"{float(row['gigabytes']):.2f} GB",
        }
        for row in _stored("growth.csv")
    ])  # fmt: skip


def speed_in_markdown() -> str:
    """Returns the speed of coverage, planners and the command line, beside what is promised."""
    return _table([
        {
            "figure": row["figure"],
            "measured": f"{float(row['measured']):.3g} {row['unit']}".strip(),
            "target": row["target"] or "-",
        }
        for row in _stored("speed.csv")
    ])  # fmt: skip


def _stored(name: str) -> _Rows:
    path: Path = STORED / name
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def _table(rows: Sequence[Record]) -> str:
    return Listing("", rows).markdown


def _percent(share: str) -> str:
    return f"{100 * float(share):.2f} %" if share else "-"


def _seconds(text: str) -> str:
    seconds = float(text)
    return "-" if seconds == float("inf") else f"{seconds:.3g} s"
