"""The table of a sweep as files: results.csv, and results.parquet with the types of columns.

A value that does not exist (no plan, no bound, no gap) is an empty field, or null in Parquet.
"""

import csv
import io
from collections.abc import Sequence
from pathlib import Path

from cocap_opt.io import FileError
from experiments.files import read_text, save_bytes, save_csv, write
from experiments.rows import GAP_KEYS, Row

PARQUET = "results.parquet"
# Columns that are not text; all others are.
WHOLE_NUMBERS = ("seed", "conflicts", "colliding", "robots", "actors", "steps")
NUMBERS = (
    "reward", "bound", "gap", "seconds", "gap_free", "bound_seconds", "optimum", "optimum_free",
    "bound_free", "bound_free_seconds", "reward_rendered",
)  # fmt: skip


def load_results(folder: Path) -> list[Row]:
    """Rows of results.csv, with the types of columns."""
    path = folder / "results.csv"
    return [_typed(row, path) for row in csv.DictReader(io.StringIO(read_text(path)))]


def _typed(row: dict[str, str], path: Path) -> Row:
    """A row with numbers; empty fields of numbers are None."""
    missing = [key for key in GAP_KEYS if row.get(key) is None]
    if missing:
        raise FileError(f"{path}: has no column {missing[0]!r}, or a row that ends before it")
    types = dict.fromkeys(WHOLE_NUMBERS, int) | dict.fromkeys(NUMBERS, float)
    try:
        return {
            key: (types[key](text) if text else None) if key in types else text
            for key, text in row.items()
        }
    except ValueError as error:
        raise FileError(f"{path}: {error}") from error


def save_results(folder: Path, rows: Sequence[Row], whole: bool) -> None:
    """Write what there is of a table; as Parquet only once it is whole."""
    if not whole:
        write(folder / PARQUET, lambda: (folder / PARQUET).unlink(missing_ok=True))
    save_csv(folder / "results.csv", rows)
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
