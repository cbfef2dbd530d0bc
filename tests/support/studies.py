"""Runs commands of `cocap-opt study`, and reads the tables that they write."""

import csv
from pathlib import Path

import pytest


def study(*words: object) -> int:
    """Run a command of `cocap-opt study`; returns its exit code."""
    from cocap_opt.cli.main import main

    with pytest.raises(SystemExit) as caught:
        main(["study", *map(str, words)])
    return int(caught.value.code or 0)


def rows_of(path: Path) -> list[dict[str, str]]:
    """Rows of a CSV file."""
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))
