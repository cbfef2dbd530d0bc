"""The table of a sweep, results.csv, as it is read.

`COLUMNS` of `cocap_opt.experiments.results.rows` says what the columns mean. A value that does not
exist (no plan, no bound, no gap) is an empty field.
"""

import csv
import io
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from cocap_opt.experiments.results.files import read_text
from cocap_opt.experiments.results.rows import COLUMNS, Row
from cocap_opt.experiments.sweeps.run_file import RunFile
from cocap_opt.files.documents import FileError

RESULTS = "results.csv"
_LIMITS = ("time_limit", "work_limit", "bound_time_limit", "bound_work_limit")  # once in run.json


def load_results(folder: Path) -> list[Row]:
    """Reads results.csv, also as earlier versions wrote it, whose limits are in run.json.

    Raises
    ------
    FileError
        If it is no such table, has no rows, or has a number that no sweep writes.
    """
    path = folder / RESULTS
    table = csv.DictReader(io.StringIO(read_text(path)))
    try:
        names = set(table.fieldnames or ())
        for name, column in COLUMNS.items():
            if not (name in names or column.is_extra or name in _LIMITS):
                raise FileError(f"{path}: has no column {name!r}")
        rows = [_row(fields, f"{path}: line {table.line_num}") for fields in table]
    except csv.Error as error:
        raise FileError(f"{path}: line {table.line_num}: {error}") from None
    if not rows:
        raise FileError(f"{path}: has no results yet")
    return rows if names.issuperset(_LIMITS) else _with_limits(rows, folder)


def _row(fields: dict[str, str], where: str) -> Row:
    if None in fields.values() or None in fields:
        raise FileError(f"{where}: must have as many fields as there are columns")
    values = {
        name: column.parse(fields[name], f"{where}: {name}")
        for name, column in COLUMNS.items()
        if name in fields
    }
    return Row(**values)


def _with_limits(rows: Sequence[Row], folder: Path) -> list[Row]:
    with suppress(FileError):
        if (old := RunFile.load(folder).settings) is not None:
            return [
                replace(r, time_limit=old.limit, bound_time_limit=old.bound_limit) for r in rows
            ]
    return [*rows]
