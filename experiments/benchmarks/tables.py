"""Tables of earlier runs, what code is measured, and options that are numbers."""

import csv
import subprocess
from pathlib import Path

from cocap_opt.io import FileError
from experiments.report import Row

LARGEST = 10**9


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


def numbers(option: str, text: str) -> tuple[int, ...]:
    """Numbers of a list of numbers and ranges, "0-9,12", each once.

    Raises
    ------
    FileError
        If it is no such list; the message names the option.
    """
    found: list[int] = []
    for part in text.split(","):
        first, dash, last = part.partition("-")
        ends = (first, last) if dash else (first,)
        if not all(end.isdecimal() and int(end) < LARGEST for end in ends):
            raise FileError(f"{option}: must be numbers and ranges such as 0-9,12, not {text!r}")
        found += range(int(first), int(last or first) + 1)
    if not found:
        raise FileError(f"{option}: {text!r} holds no number")
    return tuple(dict.fromkeys(found))
