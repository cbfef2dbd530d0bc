"""Tables of earlier runs and what code is measured."""

import csv
import subprocess
from pathlib import Path

from cocap_opt.experiments.results.rows import Row
from cocap_opt.files.documents import FileError


def read_csv(path: Path) -> list[Row]:
    """Rows of a file that `save_csv` wrote; none where there is no file."""
    try:
        with path.open(encoding="utf-8", newline="") as file:
            return [dict(row) for row in csv.DictReader(file)]
    except FileNotFoundError:
        return []
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise FileError(f"{path}: cannot be read: {error}") from error


def commit() -> str:
    """The commit of this code, with a + where files have changed since; empty if unknown."""
    command = ["git", "-C", str(Path(__file__).parent), "describe", "--always", "--dirty=+"]
    try:
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return ""
