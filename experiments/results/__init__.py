"""Results: rows, judging, tables, statistics, files, and what is printed of them."""

__all__ = [
    "conflicts",
    "explained",
    "explained_tables",
    "explained_words",
    "files",
    "flight_scene",
    "flights",
    "gap_table",
    "graphml",
    "judging",
    "layout",
    "printing",
    "rendered",
    "robustness",
    "rows",
    "statistics",
    "stored",
    "tables",
    "trace",
    "verification",
]
