"""The table of solvers: what ours reach, beside what they must, and beside the generic way."""

import os
import platform
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path

from cocap_opt.experiments.console.streams import say
from cocap_opt.experiments.results.files import make_folder, save_csv
from cocap_opt.experiments.results.printing import print_table
from cocap_opt.experiments.results.rows import Row as Record
from cocap_opt.experiments.studies.benchmarks.comparisons import (
    cone_program,
    milps,
    relaxations,
    rooted_milps,
)
from cocap_opt.experiments.studies.benchmarks.figures import Figure, number, target
from cocap_opt.experiments.studies.benchmarks.rows import (
    Options,
    Row,
    SkippedError,
    bottleneck,
    corridor,
    field_large,
    field_long,
    large,
    passage,
)
from cocap_opt.experiments.studies.benchmarks.tables import commit, read_csv
from cocap_opt.files.documents import FileError

ROWS: dict[str, Row] = {
    "corridor": corridor,
    "bottleneck": bottleneck,
    "passage": passage,
    "large": large,
    "field-long": field_long,
    "field-large": field_large,
    "relaxations": relaxations,
    "cone-program": cone_program,
    "milp": milps,
    "milp-with-our-root": rooted_milps,
}


def solvers(names: Sequence[str], options: Options, out: Path | None = None) -> bool:
    """Measure rows and print them; the file keeps what it has of other rows.

    Returns
    -------
    bool
        Whether no row failed.
    """
    wanted = list(dict.fromkeys(names)) or list(ROWS)
    if unknown := [name for name in wanted if name not in ROWS]:
        raise FileError(f"--rows: no row {unknown[0]!r}; rows: {', '.join(ROWS)}")
    make_folder(out)
    path = None if out is None else out / "solvers.csv"
    kept = [] if path is None else read_csv(path)
    records: list[Record] = []
    shown: list[Record] = []
    try:
        for name in wanted:
            figures = _measure(name, options)
            records += [_record(name, figure, options) for figure in figures]
            shown += [_shown(name, figure) for figure in figures]
            if figures[0].name != "skipped":
                kept = [record for record in kept if record.get("row") != name]
            if path is not None:
                save_csv(path, _in_order([*kept, *records]))
    finally:
        title = f"solvers (one thread; load {_load()}, {os.cpu_count()} cores)"
        print_table(title, _names_once(shown))
    return not any(record["figure"] == "failed" for record in records)


def _measure(name: str, options: Options) -> list[Figure]:
    """The figures of a row; one without a number where it is skipped or fails."""
    try:
        return ROWS[name](options)
    except SkippedError as error:
        return [Figure("skipped", float("nan"), "", note=str(error))]
    except Exception as error:  # the other rows are still worth having
        say(f"{name}: failed: {error}")
        return [Figure("failed", float("nan"), "", note=f"{type(error).__name__}: {error}")]


def _record(name: str, figure: Figure, options: Options) -> Record:
    """Row of the CSV file."""
    seeds = "row's own" if options.seeds is None else " ".join(map(str, options.seeds))
    return {
        "row": name,
        "figure": figure.name,
        "value": figure.value,
        "unit": figure.unit,
        "must": target(figure.must, figure.unit),
        "moonshot": target(figure.moonshot, figure.unit),
        "met": figure.met,
        "note": figure.note,
        "seeds": seeds,
        "limit": "row's own" if options.limit is None else options.limit,
        "load": _load(),
        "machine": f"{platform.machine()}, {os.cpu_count()} cores",
        "commit": commit(),
        "written": datetime.now(UTC).isoformat(timespec="seconds"),
    }


def _shown(name: str, figure: Figure) -> Record:
    """Row of the table that is printed."""
    return {
        "row": name,
        "figure": figure.name,
        "measured": number(figure.value, figure.unit),
        "must": target(figure.must, figure.unit),
        "moonshot": target(figure.moonshot, figure.unit),
        "met": figure.met,
        "message": figure.note,
    }


def _names_once(rows: Sequence[Record]) -> list[Record]:
    """Rows in which a name that is that of the row before is left out."""
    before = ["", *(row["row"] for row in rows)]
    return [
        row | {"row": "" if row["row"] == other else row["row"]}
        for row, other in zip(rows, before, strict=False)
    ]


def _in_order(records: Sequence[Record]) -> list[Record]:
    """Records in the order of the rows; those of no row at the end."""
    order = list(ROWS)
    return sorted(records, key=lambda r: order.index(r["row"]) if r["row"] in ROWS else len(order))


def _load() -> str:
    """Load average of the last minute."""
    return f"{os.getloadavg()[0]:.1f}"
