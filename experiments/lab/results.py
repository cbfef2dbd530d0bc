"""Results of studies: writing them, reading them, and the folder of stored ones."""

import csv
import io
import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, Self, TypeVar, get_type_hints

import msgspec

from cocap_opt.files.documents import FileError
from cocap_opt.output.files import make_folder, read_text, save_bytes, save_csv
from cocap_opt.output.printing import Listing

if TYPE_CHECKING:
    from matplotlib.figure import Figure

T = TypeVar("T")
RowT = TypeVar("RowT", bound=tuple[Any, ...])
STORED = Path(__file__).parent / "stored"
_LEAST_PERCENT = 0.0001  # gaps of optimal plans are smaller, by rounding


class Results(NamedTuple):
    """The folder into which a study writes its results; without a folder, it writes nothing."""

    folder: Path | None

    @classmethod
    def into(cls, folder: Path | None) -> Self:
        """Makes the folder; call this before the work, as it may fail."""
        make_folder(folder)
        return cls(folder)

    def save(self, name: str, rows: Sequence[Mapping[str, Any] | tuple[Any, ...]]) -> None:
        """Writes rows, which are mappings or named tuples, as a CSV file, unless there are none."""
        if self.folder is not None and rows:
            save_csv(self.folder / name, [_mapping(row) for row in rows])

    def draw(self, name: str, figure: "Callable[[], Figure]") -> None:
        """Draws a figure and writes it as a PNG file."""
        if self.folder is not None:
            from cocap_opt.pictures.figures import picture  # memory of studies is measured

            save_bytes(self.folder / name, picture(figure(), ".png"))


def _mapping(row: Any) -> Mapping[str, Any]:
    found: Mapping[str, Any] = row if isinstance(row, Mapping) else row._asdict()
    return found


def read_csv(path: Path, make: Callable[[dict[str, str]], T], words: str = "") -> list[T]:
    """Reads a CSV file that a study wrote.

    Parameters
    ----------
    make : converts the fields of a row
    words : message for a row that `make` rejects; empty to use the error's own message

    Raises
    ------
    FileError
        If the file cannot be read, or `make` rejects a row; the message names the line.
    """
    table = csv.DictReader(io.StringIO(read_text(path)))
    try:
        return [make(fields) for fields in table]
    except (KeyError, TypeError, ValueError, csv.Error) as error:
        raise FileError(f"{path}: line {table.line_num}: {words or error}") from error


def load_csv(path: Path, kind: type[RowT], study: str) -> list[RowT]:
    """Reads a CSV file whose columns are the fields of a named tuple.

    Parameters
    ----------
    study : name of the study that writes such files, for messages
    """
    table = csv.reader(io.StringIO(read_text(path)))
    fields = list(get_type_hints(kind))
    try:
        if next(table, []) != fields:
            raise ValueError(f"the columns must be {','.join(fields)}")
        return [msgspec.convert(row, kind, strict=False) for row in table]
    except (ValueError, csv.Error) as error:
        words = f"must be a file of `cocap-opt study {study}`"
        raise FileError(f"{path}: {words}: {error}") from error


def stored_rows(name: str) -> list[dict[str, str]]:
    """Returns the fields of each row of a stored CSV file."""
    return read_csv(STORED / name, dict)


def markdown(rows: Sequence[Mapping[str, Any]]) -> str:
    """Returns rows as a table in Markdown for pages."""
    return Listing("", [dict(row) for row in rows]).markdown


def in_unit(text: str, unit: str) -> str:
    """Returns a number of a stored table with three digits and its unit, for pages."""
    number = float(text)
    if unit == "%" and 0 < number < _LEAST_PERCENT:
        return f"< {_LEAST_PERCENT} %"
    return f"{number:.3g} {unit}".strip() if math.isfinite(number) else "-"


def in_percent(share: str) -> str:
    """Returns a share of a stored table in %; "-" if it is missing."""
    return f"{100 * float(share):.2f} %" if share else "-"
