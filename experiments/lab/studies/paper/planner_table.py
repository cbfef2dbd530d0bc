"""The table of planners: parts, requirements and guarantees of each, its gap and its time."""

import math
from collections.abc import Sequence
from pathlib import Path
from statistics import fmean, median
from typing import Annotated

from cyclopts import Parameter

from cocap_opt.experiments.lab.results import STORED
from cocap_opt.experiments.lab.studies.paper.measured import MEASURED, read_rows
from cocap_opt.experiments.lab.studies.paper.stopped import StoppedRuns
from cocap_opt.experiments.tables.rows import GapRow
from cocap_opt.experiments.tables.statistics import NONE
from cocap_opt.experiments.tables.tables import Table
from cocap_opt.files.documents import FileError
from cocap_opt.method import Method
from cocap_opt.output.printing import markdown_table, print_texts
from cocap_opt.planners import PLANNERS, RECOMMENDED
from cocap_opt.result import Result
from cocap_opt.stop import NO_LIMIT

_IN_SHORT = (  # planners of the README's table
    "greedy", "sequential", "sequential-rounds", "cocap", "cocap-vs", "cocap-lns", "cocap-prices",
)  # fmt: skip


def planner_table(rows: Sequence[GapRow]) -> Table:
    """Returns a row per planner; gaps are means over seeds, in % of the certified bound."""
    base = {row.key: row.seconds for row in rows if row.planner == "sequential"}
    scenes = list(dict.fromkeys(row.scene for row in rows))
    table = []
    for name, planner in PLANNERS.items():
        of_planner = [row for row in rows if row.planner == name]
        table.append(
            {
                "planner": f"`{name}`" + (" (recommended)" if name == RECOMMENDED else ""),
                "algorithm": planner.made_of,
                "requires": _needs(planner),
                "guarantees": planner.promises,
                **{
                    scene: _gap([row for row in of_planner if row.scene == scene])
                    for scene in scenes
                },
                "time": time_ratio(of_planner, base),
            }
        )
    return table


def _needs(planner: Method[Result]) -> str:
    """Returns the largest number of drones of a planner, if limited, and the coverage it needs."""
    views = "single views" if planner.lazy else "all coverage"
    if planner.most_robots is None:
        return views
    return f"{' or '.join(map(str, range(1, planner.most_robots + 1)))} drones, {views}"


def _gap(rows: Sequence[GapRow]) -> str:
    """Returns the mean gap of plans that obey the rules, with a * if a limit stopped some."""
    gaps = GapRow.percent([row for row in rows if row.valid], "gap")
    if not gaps:
        return NONE
    late = "\\*" if any(row.limit != NO_LIMIT for row in rows) else ""
    number = "" if len(gaps) == len(rows) else f" ({len(gaps)} of {len(rows)})"
    return f"{fmean(gaps):.2f}{late}{number}"


def time_ratio(rows: Sequence[GapRow], base: dict[tuple[str, int | None], float | None]) -> str:
    """Returns a planner's time divided by that of sequential planning, as a geometric mean."""
    logs = [
        math.log(row.seconds / other)
        for row in rows
        if row.seconds and (other := base.get(row.key))
    ]  # fmt: skip
    if not logs:
        return NONE
    ratio = math.exp(fmean(logs))
    return f"{ratio:.1f}" if ratio < 9.95 else f"{ratio:,.0f}"


def planners(
    *,
    paper: Annotated[
        Path | None, Parameter(help="folder of `study paper` (default: stored results)")
    ] = None,
) -> None:
    """Prints the table in Markdown, and a note that explains its numbers."""
    rows = _rows() if paper is None else _rows(paper / MEASURED)
    print_texts([_with_note(planner_table(rows), rows)], [])


def described_planners_in_markdown() -> str:
    """Returns the parts of each planner, the problems that it supports, and its guarantees."""
    return markdown_table(_without(planner_table(()), "time"))


def measured_planners_in_markdown() -> str:
    """Returns the stored gap and time of each planner."""
    rows = _rows()
    return _with_note(_without(planner_table(rows), "algorithm", "requires", "guarantees"), rows)


def short_planners_in_markdown() -> str:
    """Returns the rows and columns of the stored table that matter most to newcomers."""
    rows = _rows()
    table = [row for row in planner_table(rows) if row["planner"].split("`")[1] in _IN_SHORT]
    return _with_note(_without(table, "requires", "guarantees"), rows)


def numbers_in_markdown() -> str:
    """Returns three numbers of the stored table in sentences: optima, gaps and seconds."""
    rows = _rows()
    best = [row for row in rows if row.planner == RECOMMENDED]
    proved = sum(row.bound_is_proved for row in best)
    gaps = {
        name: GapRow.percent([row for row in rows if row.planner == name and row.valid], "gap")
        for name in (RECOMMENDED, "cocap")
    }
    limit = max(GapRow.values(rows, "bound_time_limit"))
    return (
        f"- **{proved} of {len(best)} optima proved**, each within {limit:g} s: "
        f"{len({row.scene for row in best})} scenes of the paper's size, "
        f"{len({row.seed for row in best})} seeds each.\n"
        f"- Plans of the recommended planner are **{fmean(gaps[RECOMMENDED]):.3f} % below the "
        f"bound** on average, {max(gaps[RECOMMENDED]):.2f} % at worst; CoCap's are "
        f"{fmean(gaps['cocap']):.2f} % below.\n"
        "- Half of the recommended planner's searches take less than "
        f"**{median(GapRow.values(best, 'seconds')):.1f} s**."
    )


def _without(table: Table, *columns: str) -> Table:
    return [{key: cell for key, cell in row.items() if key not in columns} for row in table]


def _rows(path: Path = STORED / "paper.csv") -> Sequence[GapRow]:
    rows = read_rows(path)
    if not rows:
        raise FileError(f"{path}: has no rows of the paper's study")
    return rows


def _with_note(table: Table, rows: Sequence[GapRow]) -> str:
    """Returns a table in Markdown, and a note that explains its numbers."""
    seeds = len({row.seed for row in rows})
    limit = max(GapRow.values(rows, "time_limit"), default=0.0)
    joint = any("`joint`" in row["planner"] for row in table)
    without = ", or the planner does not support such teams" if joint else ""
    return (
        f"{markdown_table(table)}\n\n"
        "Gaps: distance below the certified bound in %, averaged over the seeds on which the "
        f"planner's plan obeys the rules: all {seeds}, or the number in brackets; -: no such "
        f"plan{without}; \\*: the limit of {limit:g} s stopped some runs.{_fallen_back(rows)} "
        "Time: CPU time of the search relative to `sequential` on the same scenes (geometric "
        "mean), excluding coverage except for planners that evaluate views on demand.\n"
    )


def _fallen_back(rows: Sequence[GapRow]) -> str:
    """States on which scenes stopped runs of `cocap` have the plans of `sequential`, if any."""
    said = ""
    for (scene,), of_scene in GapRow.grouped(rows, "scene").items():
        fallen = StoppedRuns.of(of_scene, "cocap").fallen_back
        of_cocap = [row for row in of_scene if row.planner == "cocap" and row.valid]
        ended, stopped = (
            GapRow.percent([row for row in of_cocap if (row.seed in fallen) == late], "gap")
            for late in (False, True)
        )
        if stopped:
            others = f"; its other plans are {fmean(ended):.2f} % below" if ended else ""
            said += (
                f" On the {scene}, {len(stopped)} of {len(of_cocap)} runs of `cocap` were stopped "
                f"and fell back on the plan of `sequential`, {fmean(stopped):.2f} % below the "
                f"bound{others}."
            )
    return said
