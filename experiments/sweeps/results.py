"""The table of a sweep as files: results.csv, and results.parquet with the types of columns.

A value that does not exist (no plan, no bound, no gap) is an empty field, or null in Parquet.
"""

import csv
import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from cocap_opt.experiments.results.files import read_text, remove, save_bytes, save_csv
from cocap_opt.experiments.results.rows import GAP_KEYS, ROUNDING, Row
from cocap_opt.files.documents import FileError

RESULTS, PARQUET = "results.csv", "results.parquet"
MOST = 2**63 - 1  # that any number may be
SHARE, ANY = (-ROUNDING, 1 + ROUNDING), (-MOST, MOST)
RANGES = {  # of columns whose numbers are not just positive; a bound below 0 proves infeasibility
    "gap": SHARE, "gap_free": SHARE, "reward": ANY, "reward_rendered": ANY, "optimum": ANY,
    "optimum_free": ANY, "bound": ANY, "bound_free": ANY,
}  # fmt: skip
# Columns that are not text; all others are.
WHOLE_NUMBERS = ("seed", "conflicts", "colliding", "robots", "actors", "steps")
NUMBERS = (
    "reward", "bound", "gap", "seconds", "gap_free", "bound_seconds", "optimum", "optimum_free",
    "bound_free", "bound_free_seconds", "reward_rendered",
)  # fmt: skip


def load_results(folder: Path) -> list[Row]:
    """Rows of results.csv, at least one, with the types of columns.

    Raises
    ------
    FileError
        If it is no such table, or has a number that no sweep writes.
    """
    path = folder / RESULTS
    table = csv.DictReader(io.StringIO(read_text(path)))
    try:
        missing = [key for key in (*GAP_KEYS, "digest") if key not in (table.fieldnames or ())]
        if missing:
            raise FileError(f"{path}: has no column {missing[0]!r}")
        rows = [_typed(row, f"{path}: line {table.line_num}") for row in table]
    except csv.Error as error:
        raise FileError(f"{path}: line {table.line_num}: {error}") from None
    if not rows:
        raise FileError(f"{path}: has no results yet")
    return rows


def _typed(row: dict[str, str], where: str) -> Row:
    """A row with numbers; empty fields of numbers are None."""
    if None in row.values() or None in row:
        raise FileError(f"{where}: must have as many fields as there are columns")
    return {key: _value(key, text, f"{where}: {key}") for key, text in row.items()}


def _value(key: str, text: str, where: str) -> Any:
    if key not in (*WHOLE_NUMBERS, *NUMBERS):
        return text
    if not text:
        return None
    try:
        number = int(text) if key in WHOLE_NUMBERS else float(text)
    except ValueError:
        raise FileError(f"{where}: must be a number, not {text[:30]!r}") from None
    least, most = RANGES.get(key, (0, MOST))
    if not least <= number <= most:
        raise FileError(f"{where}: must be {least:g}..{most:g}, not {text[:30]!r}")
    return number


def save_results(folder: Path, rows: Sequence[Row], whole: bool) -> None:
    """Write what there is of a table; as Parquet only once it is whole.

    Rows of different commands may have different keys.
    """
    numbers = (*WHOLE_NUMBERS, *NUMBERS)
    nothing = {key: None if key in numbers else "" for row in rows for key in row}
    rows = [nothing | row for row in rows]
    if not whole:
        remove(folder / PARQUET)
    save_csv(folder / RESULTS, rows)
    if whole:
        save_bytes(folder / PARQUET, parquet(rows))


def parquet(rows: Sequence[Row]) -> bytes:
    """Rows that all have the keys of the first as a Parquet file."""
    import pyarrow as pa  # slow to import
    from pyarrow.parquet import write_table

    types = {key: pa.int64() for key in WHOLE_NUMBERS} | {key: pa.float64() for key in NUMBERS}
    schema = pa.schema([(key, types.get(key, pa.string())) for key in rows[0]])
    content = io.BytesIO()
    write_table(pa.Table.from_pylist(list(rows), schema=schema), content)
    return content.getvalue()
