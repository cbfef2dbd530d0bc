"""Text files, XML and numbers in them, and the one-line errors that all file readers raise."""

import codecs
import csv
import math
import re
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path
from xml.etree.ElementTree import Element, ParseError

from cocap_opt.data import FloatArray, ProblemError
from cocap_opt.files.documents import unreadable
from cocap_opt.files.messages import no_text
from cocap_opt.scenarios.kinds import Kind, require
from cocap_opt.text import span, unread

UTF_16 = codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE  # marks at the beginning of a file


_DECIMAL_COMMA = re.compile(r"[-+]?\d*,\d+")
# A field, or a path of several fields: starts[0].height
_FIELD = re.compile(r"[a-z_]+(\[\w*\])*(\.[a-z_]+(\[\w*\])*)*")


class InFileError(ProblemError):
    """A ProblemError whose message begins with the name of a file."""


@contextmanager
def naming(place: Path | str) -> Iterator[None]:
    """Prefixes the message of a `ProblemError` raised inside with the name of a file or a field.

    A file must be a regular one. A field in a message becomes part of the prefixed field:
    `drones[0].starts: must ...`.
    """
    try:
        if isinstance(place, Path):
            _require_regular(place)
        yield
    except ProblemError as error:
        if isinstance(place, Path):
            raise InFileError(f"{place}: {error}") from error
        field, colon, _ = str(error).partition(": ")
        is_part = bool(colon and _FIELD.fullmatch(field) and _FIELD.fullmatch(place))
        is_part &= not isinstance(error, InFileError)
        raise ProblemError(f"{place}{'.' if is_part else ': '}{error}") from error


def _require_regular(path: Path) -> None:
    """Raises ProblemError if a path is not a valid name, or is a pipe or a device."""
    if words := unreadable(path):
        raise ProblemError(words)


def read_text(path: Path, takes: Collection[Kind] = ()) -> str:
    """Returns the text of a file in UTF-8, or in UTF-16 with a byte order mark; marks are removed.

    Lines end with a line feed, whatever their ending in the file.

    Parameters
    ----------
    takes
        Kinds of files, among those that are recognised by their content, that the caller reads; all
        others are rejected.

    Raises
    ------
    ProblemError
        If the file cannot be opened, is a pipe or a device, is not text, or is of a kind that the
        caller does not read; for known kinds, the message explains how to use the file.
    """
    _require_regular(path)
    require(path, takes)
    try:
        content = path.read_bytes()
        text = content.decode("utf-16" if content.startswith(UTF_16) else "utf-8-sig")
    except OSError as error:
        raise ProblemError(unread(error)) from error
    except UnicodeDecodeError as error:
        raise ProblemError(no_text(error)) from error
    if content in UTF_16:
        raise ProblemError("must be a text file in UTF-8; it has only a byte order mark of UTF-16")
    if "\0" in text:
        raise ProblemError("must be a text file in UTF-8; it has NUL characters, like UTF-16")
    return text.replace("\r\n", "\n").replace("\r", "\n")


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
        reader.fieldnames = names = [name.strip() for name in reader.fieldnames or ()]
        if not set(columns) <= set(names):
            found = ", ".join(names) or "nothing"
            raise ProblemError(f"header: must name the columns {', '.join(columns)}, not {found}")
        for row in reader:
            if None in row or None in row.values():
                raise ProblemError(f"line {reader.line_num}: must have {len(names)} values")
            rows.append((reader.line_num, row))
    except csv.Error as error:
        raise ProblemError(
            f"line {reader.line_num}: must be short values separated by commas"
        ) from error
    return rows


def rectangle(low: FloatArray, high: FloatArray) -> str:
    """Describes a rectangle from one corner [2] to the other, in m."""
    x, y = (span(a, b) for a, b in zip(low.tolist(), high.tolist(), strict=True))
    return f"x {x} and y {y} m"


def xml_root(content: bytes, kind: str) -> Element:
    """Returns the outermost element of XML, read without entities, which could grow without end.

    Parameters
    ----------
    kind : kind of the file, for messages

    Raises
    ------
    ProblemError
        If it is damaged, has an unknown encoding, or has a DOCTYPE.
    """
    from defusedxml import DefusedXmlException, ElementTree

    try:
        root: Element = ElementTree.fromstring(content, forbid_dtd=True)
    except DefusedXmlException as error:
        raise ProblemError(f"must be {kind} without a DOCTYPE or its own entities") from error
    except ParseError as error:
        line, _ = error.position
        raise ProblemError(f"line {line}: must be {kind}; it is damaged or truncated") from error
    except (ValueError, LookupError) as error:
        raise ProblemError(f"must be {kind} in UTF-8, not in an unknown encoding") from error
    return root


def require_no_comma(text: str, field: str) -> None:
    """Raises a ProblemError that names the field if a number has a decimal comma."""
    if _DECIMAL_COMMA.fullmatch(text):
        raise ProblemError(f"{field}: must have a decimal point, not a comma: {text[:40]!r}")


def plain_number(text: str) -> float:
    """Returns the number in a text; 1_000 is rejected, as few programs other than Python read it.

    Raises
    ------
    ValueError
        If the text is not a number.
    """
    if "_" in text:
        raise ValueError(text)
    return float(text)


def integer(text: str, field: str) -> int:
    """Returns the whole number in `text`.

    Raises
    ------
    ProblemError
        If it is not a whole number; the message starts with `field`.
    """
    try:
        if "_" in text:
            raise ValueError
        return int(text)
    except ValueError as error:
        raise ProblemError(f"{field}: must be a whole number, not {text[:40]!r}") from error


def number(text: str, field: str) -> float:
    """Returns the number in `text`, which must be within +-1e9.

    Raises
    ------
    ProblemError
        If it is not such a number; the message starts with `field`.
    """
    try:
        value = plain_number(text)
    except ValueError:
        value = math.nan
    if not abs(value) <= 1e9:  # False for nan, too
        raise ProblemError(f"{field}: must be a number within +-1e9, not {text[:40]!r}")
    return value
