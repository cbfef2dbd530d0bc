"""Results: rows, judging, tables, statistics, files, and what is printed of them."""

__all__ = [
    "columns",
    "files",
    "flights",
    "gap_table",
    "judging",
    "layout",
    "printing",
    "rendered",
    "rows",
    "statistics",
    "tables",
    "trace",
    "verification",
]
