"""The table of solvers: the time and the gap of our methods, beside their targets and others."""

import csv
import os
import platform
import subprocess
from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path

from cocap_opt.console.streams import say
from cocap_opt.experiments.lab.studies.solvers.comparisons import COMPARISONS
from cocap_opt.experiments.lab.studies.solvers.figures import Figure
from cocap_opt.experiments.lab.studies.solvers.rows import SCENE_ROWS, Options
from cocap_opt.files.documents import FileError
from cocap_opt.output.files import make_folder, save_csv
from cocap_opt.output.printing import Listing, Record
from cocap_opt.result import UnsupportedError
from cocap_opt.text import unread

ROWS: Mapping[str, Callable[[Options], list[Figure]]] = {**SCENE_ROWS, **COMPARISONS}


def solvers(names: Sequence[str], options: Options, out: Path | None = None) -> bool:
    """Measures rows and prints them; the file solvers.csv keeps its other rows.

    Parameters
    ----------
    names : keys of ROWS; all if there is none

    Returns
    -------
    bool
        True if no row failed.

    Raises
    ------
    FileError
        If a row is unknown.
    """
    wanted = list(dict.fromkeys(names)) or list(ROWS)
    if unknown := [name for name in wanted if name not in ROWS]:
        raise FileError(f"--rows: must be among {', '.join(ROWS)}, not {unknown[0]!r}")
    make_folder(out)
    path = None if out is None else out / "solvers.csv"
    kept = [] if path is None else _read(path)
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
        Listing(title, _names_once(shown)).print()
    return not any(record["figure"] == "failed" for record in records)


def _measure(name: str, options: Options) -> list[Figure]:
    """Measures a row; a row that is skipped or fails has one figure without a number."""
    try:
        return ROWS[name](options)
    except UnsupportedError as error:
        return [Figure("skipped", float("nan"), "", note=str(error))]
    except Exception as error:  # the other rows are still worth having
        say(f"{name}: failed: {error}")
        return [Figure("failed", float("nan"), "", note=f"{type(error).__name__}: {error}")]


def _record(name: str, figure: Figure, options: Options) -> Record:
    """Returns the row of the CSV file."""
    seeds = "row's own" if options.seeds is None else " ".join(map(str, options.seeds))
    return {
        "row": name,
        "figure": figure.name,
        "value": figure.value,
        "unit": figure.unit,
        **figure.targets,
        "met": figure.met,
        "note": figure.note,
        "seeds": seeds,
        "limit": "row's own" if options.limit is None else options.limit,
        "load": _load(),
        "machine": f"{platform.machine()}, {os.cpu_count()} cores",
        "commit": _commit(),
        "written": datetime.now(UTC).isoformat(timespec="seconds"),
    }


def _shown(name: str, figure: Figure) -> Record:
    """Returns the row of the table that is printed."""
    return {
        "row": name,
        "figure": figure.name,
        "measured": figure.words,
        **figure.targets,
        "met": figure.met,
        "message": figure.note,
    }


def _names_once(rows: Sequence[Record]) -> list[Record]:
    """Returns the rows in which a name is left out if the row before has the same."""
    before = ["", *(row["row"] for row in rows)]
    return [
        row | {"row": "" if row["row"] == other else row["row"]}
        for row, other in zip(rows, before, strict=False)
    ]


def _in_order(records: Sequence[Record]) -> list[Record]:
    """Returns the records in the order of ROWS, and at the end those whose row is unknown."""
    order = list(ROWS)
    return sorted(records, key=lambda r: order.index(r["row"]) if r["row"] in ROWS else len(order))


def _load() -> str:
    """Returns the load average of the last minute."""
    return f"{os.getloadavg()[0]:.1f}"


def _read(path: Path) -> list[Record]:
    """Returns the rows of the file of earlier runs; none if there is no file."""
    try:
        with path.open(encoding="utf-8", newline="") as file:
            return [dict(row) for row in csv.DictReader(file)]
    except FileNotFoundError:
        return []
    except OSError as error:
        raise FileError(f"{path}: {unread(error)}") from error
    except (UnicodeDecodeError, csv.Error) as error:
        raise FileError(f"{path}: must be a table that this study has written") from error


def _commit() -> str:
    """Returns the commit of this code, with a + if files have changed since; empty if unknown."""
    command = ["git", "-C", str(Path(__file__).parent), "describe", "--always", "--dirty=+"]
    try:
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return ""
