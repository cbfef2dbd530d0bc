"""The table of solvers: times and gaps of our methods, with targets, and of other solvers."""

import os
import platform
import subprocess
from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from cocap_opt.console.streams import say
from cocap_opt.experiments.lab.results import Results, in_unit, markdown, read_csv, stored_rows
from cocap_opt.experiments.lab.studies.options import Out, positive_seconds
from cocap_opt.experiments.lab.studies.solvers.comparisons import COMPARISONS
from cocap_opt.experiments.lab.studies.solvers.rows import SCENE_ROWS, Metric, RowOptions
from cocap_opt.output.printing import Listing, Record
from cocap_opt.result import UnsupportedError
from cocap_opt.run.options import Option, UsageError

ROWS: Mapping[str, Callable[[RowOptions], list[Metric]]] = {**SCENE_ROWS, **COMPARISONS}
_TABLE = "solvers.csv"


def solvers(
    *,
    rows: Annotated[
        list[str] | None,
        Parameter(
            consume_multiple=True,
            negative="",
            help=f"rows to measure, of {', '.join(ROWS)} (default: all, which takes hours)",
        ),
    ] = None,
    seeds: Annotated[
        str | None, Parameter(help="seeds, e.g. 0-4 (default: those of each row)")
    ] = None,
    limit: Annotated[
        float | None,
        positive_seconds(help="seconds for each run, at most"),
    ] = None,
    large: Annotated[
        Path | None, Parameter(help="seq.yaml of Greedy Perspectives' scene `large`")
    ] = None,
    out: Out = None,
) -> int:
    """Measures rows and prints them; other rows in solvers.csv are kept."""
    options = RowOptions(None if seeds is None else Option("--seeds").numbers(seeds), limit, large)
    wanted = list(dict.fromkeys(rows or ROWS))
    if unknown := [name for name in wanted if name not in ROWS]:
        raise UsageError(f"--rows: must be among {', '.join(ROWS)}, not {unknown[0]!r}")
    results = Results.into(out)
    kept = [] if out is None or not (out / _TABLE).exists() else read_csv(out / _TABLE, dict)
    records: list[Record] = []
    shown: list[Record] = []
    try:
        for name in wanted:
            metrics = _measure(name, options)
            records += [_record(name, metric, options) for metric in metrics]
            shown += [_shown(name, metric) for metric in metrics]
            if metrics[0].name != "skipped":
                kept = [record for record in kept if record.get("row") != name]
            results.save(_TABLE, _in_order([*kept, *records]))
    finally:
        title = f"solvers (one thread; load {_load()}, {os.cpu_count()} cores)"
        Listing(title, _names_once(shown)).print()
    return int(any(record["figure"] == "failed" for record in records))


def solvers_in_markdown() -> str:
    """Returns the stored metrics of bounds and exact methods, without the project's targets."""
    return markdown([
        {
            "row": row["row"],
            "figure": row["figure"],
            "measured": in_unit(row["value"], row["unit"]),
            "note": row["note"],
        }
        for row in stored_rows("solver-figures.csv")
    ])  # fmt: skip


def _measure(name: str, options: RowOptions) -> list[Metric]:
    """Measures a row; a row that is skipped or fails has one metric without a number."""
    try:
        return ROWS[name](options)
    except UnsupportedError as error:
        return [Metric("skipped", float("nan"), "", note=str(error))]
    except Exception as error:  # the other rows are measured all the same
        say(f"{name}: failed: {error}")
        return [Metric("failed", float("nan"), "", note=f"{type(error).__name__}: {error}")]


def _record(name: str, metric: Metric, options: RowOptions) -> Record:
    """Returns the row of the CSV file."""
    seeds = "row's own" if options.seeds is None else " ".join(map(str, options.seeds))
    return {
        "row": name,
        "figure": metric.name,
        "value": metric.value,
        "unit": metric.unit,
        **metric.targets,
        "met": metric.met,
        "note": metric.note,
        "seeds": seeds,
        "limit": "row's own" if options.limit is None else options.limit,
        "load": _load(),
        "machine": f"{platform.machine()}, {os.cpu_count()} cores",
        "commit": _commit(),
        "written": datetime.now(UTC).isoformat(timespec="seconds"),
    }


def _shown(name: str, metric: Metric) -> Record:
    """Returns the row of the table that is printed."""
    return {
        "row": name,
        "figure": metric.name,
        "measured": metric.words,
        **metric.targets,
        "met": metric.met,
        "message": metric.note,
    }


def _names_once(rows: Sequence[Record]) -> list[Record]:
    """Returns the rows, without names that are the same as in the row above."""
    before = ["", *(row["row"] for row in rows)]
    return [
        row | {"row": "" if row["row"] == other else row["row"]}
        for row, other in zip(rows, before, strict=False)
    ]


def _in_order(records: Sequence[Record]) -> list[Record]:
    """Returns the records in the order of ROWS; records of unknown rows come last."""
    order = list(ROWS)
    return sorted(records, key=lambda r: order.index(r["row"]) if r["row"] in ROWS else len(order))


def _load() -> str:
    """Returns the load average of the last minute."""
    return f"{os.getloadavg()[0]:.1f}"


def _commit() -> str:
    """Returns the commit of this code, with a + if files were changed; empty if unknown."""
    command = ["git", "-C", str(Path(__file__).parent), "describe", "--always", "--dirty=+"]
    try:
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return ""
