"""Columns of tables: each is defined once, for all code that reads, writes or documents it."""

import csv
import io
from collections.abc import Collection, Mapping
from pathlib import Path
from types import NoneType
from typing import Annotated, Any, NamedTuple, get_args, get_origin, get_type_hints

from msgspec import UnsetType

from cocap_opt.files.documents import FileError
from cocap_opt.output.files import read_text

_LARGEST = 2**63 - 1


class TableColumn(NamedTuple):
    """A column of a table; `all_of` takes its name and kind from the field that it annotates.

    Attributes
    ----------
    meaning : a sentence
    unit : of a number; empty if it has none
    least, most : range of a number
    name : of the field
    kind : int, float or str
    is_optional : cells may be empty, where there is no value
    is_extra : only some tables have the column
    """

    meaning: str
    unit: str = ""
    least: float = 0
    most: float = _LARGEST
    name: str = ""
    kind: type = str
    is_optional: bool = False
    is_extra: bool = False

    @classmethod
    def all_of(cls, row: type) -> "dict[str, TableColumn]":
        """Returns the columns, by name, of a data class whose fields are annotated with them."""
        return {
            name: _completed(name, hint)
            for name, hint in get_type_hints(row, include_extras=True).items()
        }

    def parse(self, text: str, where: str) -> Any:
        """Returns the value of a cell of a CSV file; None if the cell is empty and may be.

        Raises
        ------
        FileError
            If the text should be a number but is not, or the number is out of range; the message
            starts with `where`.
        """
        if self.kind is str:
            return text
        if not text and self.is_optional:
            return None
        try:
            number = self.kind(text)
        except ValueError:
            raise FileError(f"{where}: must be a number, not {text[:30]!r}") from None
        if not self.least <= number <= self.most:
            raise FileError(f"{where}: must be {self.least:g}..{self.most:g}, not {text[:30]!r}")
        return number


def _completed(name: str, hint: Any) -> TableColumn:
    assert get_origin(hint) is Annotated, f"{name}: has no TableColumn annotation"
    inner, column = get_args(hint)
    kinds = set(get_args(inner)) or {inner}
    (kind,) = kinds - {NoneType, UnsetType}
    completed: TableColumn = column._replace(
        name=name, kind=kind, is_optional=NoneType in kinds, is_extra=UnsetType in kinds
    )
    return completed


def read_rows(
    path: Path, columns: Mapping[str, TableColumn], may_lack: Collection[str] = ()
) -> list[dict[str, Any]]:
    """Reads a table, and returns the values of each row by the names of its columns.

    Parameters
    ----------
    columns : by name
    may_lack : names of columns that may be missing, as older versions did not write them

    Raises
    ------
    FileError
        If the file is not such a table, has no rows, or has a number that is out of range.
    """
    table = csv.DictReader(io.StringIO(read_text(path)))
    try:
        names = set(table.fieldnames or ())
        for name, column in columns.items():
            if not (name in names or column.is_extra or name in may_lack):
                raise FileError(f"{path}: has no column {name!r}")
        rows = [_values(fields, columns, f"{path}: line {table.line_num}") for fields in table]
    except csv.Error as error:
        words = "must be short values separated by commas"
        raise FileError(f"{path}: line {table.line_num}: {words}") from error
    if not rows:
        raise FileError(f"{path}: has no results yet")
    return rows


def _values(
    fields: dict[str, str], columns: Mapping[str, TableColumn], where: str
) -> dict[str, Any]:
    if None in fields.values() or None in fields:
        raise FileError(f"{where}: must have as many fields as there are columns")
    return {
        name: column.parse(fields[name], f"{where}: {name}")
        for name, column in columns.items()
        if name in fields
    }
