"""The table of a sweep, results.csv, as it is read.

`COLUMNS` of `cocap_opt.experiments.tables.rows` says what the columns mean. A value that does not
exist (no plan, no bound, no gap) is an empty field.
"""

import csv
import io
from pathlib import Path

from cocap_opt.experiments.sweeps.run_file import RUN, RunFile
from cocap_opt.experiments.tables.rows import COLUMNS, Row
from cocap_opt.files.documents import FileError
from cocap_opt.output.files import read_text

RESULTS = "results.csv"
# Columns that tables of older versions do not have, and nobody misses.
_NEWER = ("cut_short", "overrun")


def load_results(folder: Path) -> list[Row]:
    """Reads results.csv.

    Raises
    ------
    FileError
        If it is no such table, has no rows, has a number that no sweep writes, or if an older
        version wrote it, whose rewards are others.
    """
    path = folder / RESULTS
    if (folder / RUN).exists():
        RunFile.load(folder)
    table = csv.DictReader(io.StringIO(read_text(path)))
    try:
        names = set(table.fieldnames or ())
        for name, column in COLUMNS.items():
            if not (name in names or column.is_extra or name in _NEWER):
                raise FileError(f"{path}: has no column {name!r}")
        rows = [_row(fields, f"{path}: line {table.line_num}") for fields in table]
    except csv.Error as error:
        words = "must be short values with commas between them"
        raise FileError(f"{path}: line {table.line_num}: {words}") from error
    if not rows:
        raise FileError(f"{path}: has no results yet")
    return rows


def _row(fields: dict[str, str], where: str) -> Row:
    if None in fields.values() or None in fields:
        raise FileError(f"{where}: must have as many fields as there are columns")
    values = {
        name: column.parse(fields[name], f"{where}: {name}")
        for name, column in COLUMNS.items()
        if name in fields
    }
    return Row(**values)
