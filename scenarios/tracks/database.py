"""Reader of JuPedSim's trajectories: an SQLite database, in metres, with its frame rate.

Source of the format: JuPedSim (jupedsim.org), whose table trajectory_data has a row for each person
at each frame, and whose table metadata has the frames per second under the key fps, and the version
of the format. Version 2, the newest known one, has all columns of version 1 that are read here.
Newer versions are rejected, because their columns may have another meaning.
"""

import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from urllib.parse import quote

import numpy as np

from cocap_opt.data import FloatArray, ProblemError
from cocap_opt.scenarios.earth.place import MapProjection
from cocap_opt.scenarios.tracks.table import (
    Form,
    TrackTable,
    require_numbers,
    settled,
    settled_rate,
)

_COLUMNS = {"id": "id", "frame": "frame", "x": "pos_x", "y": "pos_y"}  # columns by role
_TABLE = "trajectory_data"
_NEWEST = 2  # version of the format


def read_database(path: Path, form: Form, projection: MapProjection) -> TrackTable:
    """Reads the trajectories of a database, which is not changed.

    Raises
    ------
    ProblemError
        If it is damaged, is not a database of JuPedSim, has an unknown newer version, or has a row
        with values that are not numbers.
    """
    form.require_left_out("a database of JuPedSim", "columns", "delimiter", "time_unit")
    with _opened(path) as connection:
        tables = dict(connection.execute("select name, type from sqlite_master").fetchall())
        if tables.get(_TABLE) != "table":  # a view could run forever
            raise ProblemError(
                f"must have the table {_TABLE}, as databases of JuPedSim do; its tables: "
                f"{', '.join(sorted(map(str, tables))[:5]) or 'none'}"
            )
        _require_known_version(connection, tables)
        found = {row[1] for row in connection.execute(f"pragma table_info({_TABLE})")}
        for column in _COLUMNS.values():
            if column not in found:
                raise ProblemError(f"{_TABLE}: must have the column {column}")
        columns = ", ".join(_COLUMNS.values())
        values = _values(connection.execute(f"select {columns} from {_TABLE}").fetchall())
        rates = _stated(connection, tables, "fps")
    require_numbers(values, _where)
    rate = settled_rate(rates, form.fps)
    unit = settled("unit", {"m"}, form.unit)
    return TrackTable.of(values, None, _where, unit, rate)


def _where(row: int) -> str:
    """Names a row."""
    return f"{_TABLE}, row {row + 1}"


@contextmanager
def _opened(path: Path) -> Iterator[sqlite3.Connection]:
    """Opens a database for reading only."""
    try:
        with closing(sqlite3.connect(f"file:{quote(str(path))}?mode=ro", uri=True)) as connection:
            yield connection
    except (sqlite3.Error, UnicodeDecodeError) as error:
        raise ProblemError(
            "is an SQLite database that cannot be read; it is damaged, or still being written"
        ) from error


def _values(rows: list[tuple[object, ...]]) -> dict[str, FloatArray]:
    if not rows:
        raise ProblemError(f"{_TABLE}: must contain at least one row")
    for k, row in enumerate(rows):
        for name, value in zip(_COLUMNS.values(), row, strict=True):
            if not isinstance(value, int | float):
                what = "nothing" if value is None else repr(value)[:40]
                raise ProblemError(f"{_where(k)}, {name}: must be a number, not {what}")
    table = np.array(rows, dtype=np.float64)
    return dict(zip(_COLUMNS, table.T, strict=True))


def _require_known_version(connection: sqlite3.Connection, tables: dict[str, str]) -> None:
    """Raises a ProblemError if the format is newer than the known ones; unstated means an old
    one.
    """
    for version in _stated(connection, tables, "version"):
        if version not in range(1, _NEWEST + 1):
            raise ProblemError(
                f"metadata, version: must be 1..{_NEWEST}, the formats of JuPedSim that are known, "
                f"not {version:g}; write its people as a table with the columns id, frame, x and y"
            )


def _stated(connection: sqlite3.Connection, tables: dict[str, str], key: str) -> set[float]:
    """Returns the number that the metadata states under a key, in a set that is empty if it has
    none.
    """
    if tables.get("metadata") != "table":
        return set()
    stated = connection.execute("select value from metadata where key = ?", (key,)).fetchall()
    try:
        return {float(value) for (value,) in stated}
    except (TypeError, ValueError):
        raise ProblemError(
            f"metadata, {key}: must be a number, not {str(stated[0][0])[:40]!r}"
        ) from None
