"""Results: rows, judging, tables, statistics, files, and what is printed of them."""

__all__ = [
    "claims",
    "columns",
    "documents",
    "files",
    "gap_table",
    "judging",
    "layout",
    "printing",
    "rendered",
    "rows",
    "statistics",
    "tables",
    "trace",
]
