"""Runs commands of `cocap-opt study`, and reads the tables that they write."""

import csv
from pathlib import Path


def study(*words: object) -> int:
    """Run a command of `cocap-opt study`; returns its exit code."""
    from cocap_opt.experiments.cli import commands

    return commands.run(["study", *map(str, words)])


def rows_of(path: Path) -> list[dict[str, str]]:
    """Rows of a CSV file."""
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))
