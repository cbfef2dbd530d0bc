"""The table of a sweep as files: results.csv, and results.parquet with the types of columns.

A value that does not exist (no plan, no bound, no gap) is an empty field, or null in Parquet.
"""

import io
from collections.abc import Sequence
from pathlib import Path

from experiments.files import save_bytes, save_csv
from experiments.report import Row

# Columns that are not text; all others are.
WHOLE_NUMBERS = ("seed", "conflicts", "colliding", "robots", "actors", "steps")
NUMBERS = (
    "reward", "bound", "gap", "seconds", "gap_free", "bound_seconds", "optimum_free",
    "bound_free", "bound_free_seconds", "reward_rendered",
)  # fmt: skip


def save_results(folder: Path | None, rows: Sequence[Row], whole: bool = False) -> None:
    """Write what there is of a table; once it is whole, as Parquet, too."""
    if folder is None or not rows:
        return
    save_csv(folder / "results.csv", rows)
    if whole:
        save_bytes(folder / "results.parquet", parquet(rows))


def parquet(rows: Sequence[Row]) -> bytes:
    """Rows that all have the keys of the first as a Parquet file."""
    import pyarrow as pa  # slow to import
    from pyarrow.parquet import write_table

    types = {key: pa.int64() for key in WHOLE_NUMBERS} | {key: pa.float64() for key in NUMBERS}
    schema = pa.schema([(key, types.get(key, pa.string())) for key in rows[0]])
    content = io.BytesIO()
    write_table(pa.Table.from_pylist(list(rows), schema=schema), content)
    return content.getvalue()
