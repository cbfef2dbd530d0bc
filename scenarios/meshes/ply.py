"""Reader of PLY, text and binary: a header declares elements and their properties; rows follow.

Source: G. Turk, The PLY Polygon File Format, 1994.
"""

import logging
import re
import struct
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from cocap_opt.data import FloatArray, ProblemError
from cocap_opt.scenarios.meshes.faces import MeshFaces, numbers, strip

_TYPES = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4",
    "float": "f4", "double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2",
    "int32": "i4", "uint32": "u4", "float32": "f4", "float64": "f8",
}  # fmt: skip
_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
# Codes of these types in the module struct.
_CODES = {
    "i1": "b", "u1": "B", "i2": "h", "u2": "H", "i4": "i", "u4": "I", "f4": "f", "f8": "d",
}  # fmt: skip
_FACES, _STRIPS = "face", ("tristrips", "tristrip")
_CORNERS = ("vertex_indices", "vertex_index")  # names of this property in both elements
_NO_GEOMETRY = ("camera", "material")  # elements that are silently left out
_RESTART = -1  # ends a strip and begins the next one
_END = re.compile(rb"[\r\n][ \t]*end_header[ \t]*(\r\n|\n|\r)")

_log = logging.getLogger(__name__)


class _Property(NamedTuple):
    """A property of an element: a number, or a list of numbers preceded by its length."""

    name: str
    type: str  # numpy's name, without the byte order
    length: str | None  # type of the length; None: it is not a list


class _Element(NamedTuple):
    name: str
    rows: int
    properties: list[_Property]

    @property
    def lists_of_corners(self) -> list[_Property]:
        return [given for given in self.properties if given.name in _CORNERS and given.length]


Columns = dict[str, Sequence[Any]]  # the numbers, or lists of numbers, of each property


def read_ply(path: Path) -> MeshFaces:
    """Reads all faces and triangle strips of a file.

    Raises
    ------
    ProblemError
        If the rows do not match the header, or if an element other than faces and strips lists
        corners.
    """
    content = path.read_bytes()
    end = _END.search(content)
    if not content.startswith(b"ply") or not end:
        raise ProblemError("must begin with `ply` and a header up to `end_header`")
    order, elements = _header(content[: end.start()].decode("ascii", errors="replace"))
    body = content[end.end() :]
    rows = _text(body, elements) if order == "" else _binary(body, elements, order)
    places: list[FloatArray] = []
    faces: list[list[int]] = []
    for element, columns in zip(elements, rows, strict=True):
        if element.name == "vertex":
            places.append(_places(element, columns))
        elif element.name == _FACES:
            faces += _corners(element, columns)
        elif element.name in _STRIPS:
            faces += [face for row in _corners(element, columns) for face in _cut(row)]
        elif element.lists_of_corners:
            raise ProblemError(
                f"element {element.name}: lists corners, but only those of {_FACES} and "
                f"{_STRIPS[0]} are read; MeshLab writes faces"
            )
        elif element.rows and element.name not in _NO_GEOMETRY:
            _log.warning("%s: element %s is left out", path, element.name)
    if len(places) != 1:
        raise ProblemError(f"must have one element vertex, not {len(places)}")
    return MeshFaces.of_lists(places[0], faces)


def _places(element: _Element, columns: Columns) -> FloatArray:
    if not {"x", "y", "z"} <= {given.name for given in element.properties if not given.length}:
        found = (
            f"{given.name} (list)" if given.length else given.name for given in element.properties
        )
        raise ProblemError(
            f"element vertex: must have x, y, z, each of them one number, not {', '.join(found)}"
        )
    return np.column_stack([np.asarray(columns[axis], dtype=np.float64) for axis in "xyz"])


def _corners(element: _Element, columns: Columns) -> list[list[int]]:
    """Returns the lists of corners of an element."""
    lists = element.lists_of_corners
    if len(lists) != 1:
        raise ProblemError(
            f"element {element.name}: must have one list {' or '.join(_CORNERS)}, not {len(lists)}"
        )
    (given,) = lists
    if given.type[0] == "f":
        raise ProblemError(f"element {element.name}: {given.name} must be whole numbers")
    return [[int(corner) for corner in row] for row in columns[given.name]]


def _cut(corners: list[int]) -> list[list[int]]:
    """Returns the triangles of the strips of a list."""
    given = np.array(corners, dtype=object)  # text may have numbers of any size
    parts = np.split(given, np.flatnonzero(given == _RESTART))
    return [face for part in parts for face in strip(part[part != _RESTART]).tolist()]


def _header(text: str) -> tuple[str, list[_Element]]:
    """Returns the byte order, "" for text, and the elements that a header declares."""
    order: str | None = None
    elements: list[_Element] = []
    for number, line in enumerate(text.splitlines(), start=1):
        words = line.split()
        match words:
            case [] | ["ply"] | ["comment" | "obj_info", *_]:
                pass
            case ["format", name, "1.0"] if name in _ORDERS and order is None:
                order = _ORDERS[name]
            case ["element", name, count] if re.fullmatch("[0-9]{1,18}", count):
                elements.append(_Element(name, int(count), []))
            case ["property", "list", length, kind, name] if (
                elements and kind in _TYPES and _TYPES.get(length, "f")[0] != "f"
            ):
                elements[-1].properties.append(_Property(name, _TYPES[kind], _TYPES[length]))
            case ["property", kind, name] if elements and kind in _TYPES:
                elements[-1].properties.append(_Property(name, _TYPES[kind], None))
            case _:
                raise ProblemError(
                    f"line {number}: must be a line of PLY's header, not {line[:60]!r}"
                )
    if order is None:
        raise ProblemError(f"must declare its format, {', '.join(_ORDERS)} 1.0")
    if empty := [given.name for given in elements if given.rows and not given.properties]:
        raise ProblemError(f"element {empty[0]}: must have properties")
    for element in elements:
        if len({given.name for given in element.properties}) < len(element.properties):
            raise ProblemError(f"element {element.name}: must have properties of different names")
    return order, elements


def _text(body: bytes, elements: list[_Element]) -> Iterator[Columns]:
    """Yields the columns of each element; each row is one line."""
    lines = [line for line in body.decode("ascii", errors="replace").splitlines() if line.strip()]
    wanted = sum(element.rows for element in elements)
    if len(lines) != wanted:
        found = f"ends after {len(lines)}" if len(lines) < wanted else f"has {len(lines)}"
        raise ProblemError(f"must have {wanted} rows, as its header says, but {found}")
    begin = 0
    for element in elements:
        part = lines[begin : begin + element.rows]
        rows = [_row(line.split(), element, k) for k, line in enumerate(part)]
        yield {given.name: [row[n] for row in rows] for n, given in enumerate(element.properties)}
        begin += element.rows


def _row(words: list[str], element: _Element, k: int) -> list[Any]:
    """Returns the numbers and lists of numbers of a line."""
    values = numbers(words, f"{element.name}[{k}]")
    row: list[Any] = []
    at = 0
    for given in element.properties:
        length = values[at] if given.length and at < len(values) else 0.0
        if given.length and not (0 <= length <= len(values) and length.is_integer()):
            raise ProblemError(f"{element.name}[{k}]: must have a length before each list")
        begin = at + 1 if given.length else at
        at = begin + int(length) if given.length else at + 1
        part = values[begin:at]
        if any(not value.is_integer() for value in part if given.type[0] != "f"):
            raise ProblemError(f"{element.name}[{k}]: {given.name} must be whole numbers")
        row.append(part if given.length else part[0] if part else 0.0)
    if at != len(values):
        raise ProblemError(f"{element.name}[{k}]: must have {at} numbers, not {len(values)}")
    return row


def _binary(body: bytes, elements: list[_Element], order: str) -> Iterator[Columns]:
    """Yields the columns of each element; each number has the width of its type."""
    at = 0
    for element in elements:
        try:
            columns, at = _equal_rows(body, at, element, order) or _rows(body, at, element, order)
        except struct.error as error:
            raise ProblemError(
                f"ends within its {element.rows} rows of the element {element.name}, which its "
                "header declares: it is truncated"
            ) from error
        yield columns
    if at != len(body):
        raise ProblemError(
            f"must end after the rows that its header declares, not {len(body) - at} bytes later"
        )


def _equal_rows(body: bytes, at: int, element: _Element, order: str) -> tuple[Columns, int] | None:
    """Returns the columns and the position of their end, if lists have the same length in all
    rows.
    """
    if not element.rows:
        return None
    first, _ = _rows(body, at, element._replace(rows=1), order)
    fields: list[tuple[str, str] | tuple[str, str, int]] = []
    for k, given in enumerate(element.properties):
        if given.length:
            fields.append((f"length {k}", order + given.length))
            fields.append((f"{k}", order + given.type, len(first[given.name][0])))
        else:
            fields.append((f"{k}", order + given.type))
    kind = np.dtype(fields)
    end = at + element.rows * kind.itemsize
    if end > len(body) or not kind.itemsize:
        return None
    rows = np.frombuffer(body[at:end], kind)
    columns: Columns = {}
    for k, given in enumerate(element.properties):
        values: Any = rows[f"{k}"]
        if given.length and (rows[f"length {k}"] != values.shape[-1]).any():
            return None
        columns[given.name] = values.tolist() if given.length else values
    return columns, end


def _rows(body: bytes, at: int, element: _Element, order: str) -> tuple[Columns, int]:
    """Returns the columns and the position of their end, for lists of any length."""
    columns: dict[str, list[Any]] = {given.name: [] for given in element.properties}
    for _ in range(element.rows):
        for given in element.properties:
            length = 1
            if given.length:
                (length,) = struct.unpack_from(order + _CODES[given.length], body, at)
                at += struct.calcsize(order + _CODES[given.length])
                if length < 0:
                    raise ProblemError(f"element {element.name}: a list has the length {length}")
            code = f"{order}{length}{_CODES[given.type]}"
            values = struct.unpack_from(code, body, at)
            at += struct.calcsize(code)
            columns[given.name].append(list(values) if given.length else values[0])
    return dict(columns), at
