"""Text files and numbers in them, and the errors of one line that all readers of files raise."""

import csv
import math
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from cocap_opt.data import ProblemError
from cocap_opt.files.documents import unreadable
from cocap_opt.files.messages import no_text

# How files begin that are no text, and the way out.
_NO_TEXT = {
    b"\x89HDF\r\n\x1a\n": "is HDF5; write its dataset of trajectories as text, with the columns "
    "id frame x y",
    b"SQLite format 3\0": "is an SQLite database; as JuPedSim writes them, they are people, for "
    "[[tracks]] of a recipe",
}


@contextmanager
def naming(place: Path | str) -> Iterator[None]:
    """Puts the name of a file or a field before the message of a `ProblemError` raised inside.

    A file must be a regular one.
    """
    try:
        if isinstance(place, Path):
            _require_regular(place)
        yield
    except ProblemError as error:
        raise ProblemError(f"{place}: {error}") from error


def _require_regular(path: Path) -> None:
    """Raises ProblemError if a path is no name, or a pipe or a device."""
    if words := unreadable(path):
        raise ProblemError(words)


def read_text(path: Path) -> str:
    """Returns the text of a UTF-8 file, without a byte order mark.

    Raises
    ------
    ProblemError
        If the file cannot be opened, is a pipe or a device, or is not UTF-8; of known kinds of
        files that are no text the message names the way out.
    """
    _require_regular(path)
    try:
        with path.open("rb") as file:
            begin = file.read(max(map(len, _NO_TEXT)))
    except OSError as error:
        raise ProblemError(f"cannot be read: {error.strerror}") from error
    for magic, words in _NO_TEXT.items():
        if begin.startswith(magic):
            raise ProblemError(words)
    try:
        return path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise ProblemError(f"cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise ProblemError(no_text(error)) from error


def read_table(path: Path, columns: tuple[str, ...]) -> list[tuple[int, dict[str, str]]]:
    """Returns the rows of a CSV file, each with its line number; further columns are kept.

    Raises
    ------
    ProblemError
        If a column is missing from the header, or a row is longer or shorter than the header.
    """
    reader = csv.DictReader(read_text(path).splitlines(), skipinitialspace=True)
    rows = []
    try:
        names = list(reader.fieldnames or ())
        if not set(columns) <= set(names):
            found = ", ".join(names) or "nothing"
            raise ProblemError(f"header: must name the columns {', '.join(columns)}, not {found}")
        for row in reader:
            if None in row or None in row.values():
                raise ProblemError(f"line {reader.line_num}: must have {len(names)} values")
            rows.append((reader.line_num, row))
    except csv.Error as error:
        raise ProblemError(
            f"line {reader.line_num}: must be short values with commas between them"
        ) from error
    return rows


def integer(text: str, field: str) -> int:
    """Returns the whole number that `text` spells.

    Raises
    ------
    ProblemError
        If it spells none; the message starts with `field`.
    """
    try:
        return int(text)
    except ValueError as error:
        raise ProblemError(f"{field}: must be a whole number, not {text[:40]!r}") from error


def number(text: str, field: str) -> float:
    """Returns the finite number that `text` spells, of at most a thousand million.

    Raises
    ------
    ProblemError
        If it spells none; the message starts with `field`.
    """
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not abs(value) <= 1e9:  # false for nan too
        raise ProblemError(f"{field}: must be a number within +-1e9, not {text[:40]!r}")
    return value
