"""Results: rows, tables, statistics, files and what is printed of them."""
