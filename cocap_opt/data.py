"""Base of all problem data: immutable structs whose fields are checked once, when they are made.

Units: metres, radians, pixels. Every message of a `ProblemError` names the field.
"""

from functools import cache
from types import NoneType, UnionType
from typing import Any, Self, Union, get_args, get_origin, get_type_hints

import msgspec
import numpy as np
from numpy.typing import NDArray

from cocap_opt.text import plain, with_article

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]
# Indices in compiled loops: for signed ones, numba compiles a check for negative indices.
IndexArray = NDArray[np.uint32]


# These limits are far beyond what any scene needs, so a number outside them is a mistake. Within
# them, every coverage and every J is finite, and a face at any place keeps some digits of its size.
MOST_STEPS = 10_000
MOST_LETTERS = 1_000  # letters of a name
MOST_TURN = 10_000  # indices per step
MOST_PIXELS = 100_000  # along an edge of the image
FOCAL = 1e-3, 1e9  # px
SMALLEST = 1e-4  # m, edge of a cell or an actor
LARGEST = 1e9  # m, coordinates and lengths; rad, yaw
MOST_WEIGHT = 1e12


class ProblemError(ValueError):
    """A field of a problem has a value that is not allowed; the message names the field."""


class FieldError(ProblemError):
    """A ProblemError whose field is separate from its text, so that callers can rename it."""

    def __init__(self, field: str, allowed: str) -> None:
        super().__init__(field, allowed)
        self.field = field
        self.allowed = allowed

    def __str__(self) -> str:
        return f"{self.field}: {self.allowed}"


def require(condition: bool, field: str, allowed: str) -> None:
    """Raise a ProblemError unless the condition holds."""
    if not condition:
        raise ProblemError(f"{field}: {allowed}")


def within(value: float, low: float, high: float, field: str, unit: str = "") -> None:
    """Require low <= value <= high."""
    allowed = f"must be {plain(low)}..{plain(high)} {unit}".rstrip()
    is_number = isinstance(value, (int, float, np.number)) and not isinstance(value, bool)
    # False for nan, too.
    require(is_number and low <= value <= high, field, f"{allowed}, not {value!r}")


def whole(value: object, field: str) -> None:
    """Require a whole number."""
    is_whole = isinstance(value, (int, np.integer)) and not isinstance(value, bool)
    require(is_whole, field, f"must be a whole number, not {value!r}")


def _plain(value: Any) -> Any:
    """Returns the value with Python's own numbers and tuples; other objects are unchanged."""
    if isinstance(value, np.floating):
        return float(value)
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, (list, tuple)):
        parts = [_plain(part) for part in value]
        same = isinstance(value, tuple) and all(a is b for a, b in zip(parts, value, strict=True))
        named = hasattr(value, "_fields")
        return value if same else type(value)(*parts) if named else tuple(parts)
    return value


def _with_floats(value: Any, hint: Any) -> Any:
    """Returns the value with whole numbers made floats where its type requires, as in files."""
    if get_origin(hint) in (Union, UnionType):
        floats = [part for part in get_args(hint) if part is float or get_origin(part) is tuple]
        for part in floats:
            value = _with_floats(value, part)
        return value
    if hint is float and type(value) is int:
        try:
            return float(value)
        except OverflowError:  # the check of the range reports it
            return value
    parts = get_args(hint)
    if get_origin(hint) is tuple and type(value) is tuple and parts[0] is float:
        return tuple(_with_floats(part, float) for part in value)
    return value


def _holds_array(hint: Any) -> bool:
    """Returns True if a field of this type may contain an array."""
    return get_origin(hint) is np.ndarray or any(map(_holds_array, get_args(hint)))


def _is_a(value: object, hint: Any) -> bool:
    """Returns True if a value has a field's type; numbers and arrays are checked elsewhere."""
    origin, parts = get_origin(hint), get_args(hint)
    if origin in (Union, UnionType):
        return any(_is_a(value, part) for part in parts)
    if origin is tuple and isinstance(value, tuple):
        if parts[-1] is Ellipsis:
            parts = parts[:1] * len(value)
        return len(value) == len(parts) and all(
            _is_a(item, part) and (part not in (float, int) or _is_number(item))
            for item, part in zip(value, parts, strict=True)
        )
    if origin is tuple or hint in (bool, str, NoneType):
        return isinstance(value, origin or hint)
    if isinstance(hint, type) and issubclass(hint, (msgspec.Struct, tuple)):
        return isinstance(value, hint)
    return True


def _is_number(value: object) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def _kind(hint: Any) -> str:
    """Names a field's type in words."""
    names = {bool: "true or false", str: "text", NoneType: "None", float: "number", int: "number"}
    origin, parts = get_origin(hint), get_args(hint)
    if origin in (Union, UnionType):
        return " or ".join(map(_kind, parts))
    if origin is tuple and parts[-1] is Ellipsis:
        if get_origin(parts[0]) is tuple:
            return f"a sequence of sequences of {_kind(parts[0])}"
        return f"a sequence of {_kind(parts[0]).removeprefix('a ').removeprefix('an ')}s"
    if origin is tuple:
        return f"{len(parts)} {_kind(parts[0])}s"
    if hint in names:
        return names[hint]
    name = getattr(hint, "__name__", "array")
    return f"{with_article(name)} object"


def read_only(array: FloatArray) -> FloatArray:
    """Returns the same array, protected from changes."""
    array.setflags(write=False)
    return array


def frozen(array: Any, field: str, ndim: int) -> FloatArray:
    """Return a read-only float64 copy of an array with `ndim` axes and numbers within +-LARGEST."""
    try:
        given = np.asarray(array)
    except ValueError:  # rows of different length
        given = np.asarray(None)
    require(given.dtype.kind in "iuf", field, f"must be a {ndim}-D array of numbers")
    result = np.array(given, dtype=np.float64)
    require(result.ndim == ndim, field, f"must have {ndim} axes, not {result.ndim}")
    require(result.size > 0, field, "must not be empty")
    inside = bool((np.abs(result) <= LARGEST).all())  # false for nan, too
    require(inside, field, f"must hold finite numbers within +-{plain(LARGEST)} only")
    return read_only(result)


def _ready_types(hint: Any) -> set[type]:
    """Returns the types whose values need no conversion and no check in a field of this type."""
    if get_origin(hint) in (Union, UnionType):
        ready = set[type]().union(*map(_ready_types, get_args(hint)))
        return ready - {int} if float in ready else ready  # a whole number becomes a float
    is_struct = isinstance(hint, type) and issubclass(hint, msgspec.Struct)
    return {hint} if is_struct or hint in (float, int, str, bool, NoneType) else set()


@cache
def _hints(kind: "type[Data]") -> dict[str, tuple[Any, set[type]]]:
    """Returns the types of the fields of a struct, each with its `_ready_types`."""
    hints = get_type_hints(kind)
    return {field: (hints[field], _ready_types(hints[field])) for field in kind.__struct_fields__}


class Data(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Base of all problem data: it is immutable, and a misspelt field in a file is an error."""

    def __post_init__(self) -> None:
        """Convert NumPy's numbers and arrays to plain ones, and lists to tuples, as in files.

        Raises
        ------
        ProblemError
            If a field has the wrong type.
        """
        for field, (hint, ready) in _hints(type(self)).items():
            value = getattr(self, field)
            if type(value) in ready:
                continue
            if isinstance(value, np.ndarray) and not _holds_array(hint):
                plain = _plain(value.tolist())
            else:
                plain = _with_floats(_plain(value), hint)
            if plain is not value:
                msgspec.structs.force_setattr(self, field, plain)
            if not _is_a(plain, hint):
                found = repr(value)
                found = type(value).__name__ if len(found) > 40 or "\n" in found else found
                raise ProblemError(f"{field}: must be {_kind(hint)}, not {found}")

    def replace(self, **changes: Any) -> Self:
        """Return a checked copy with some fields changed."""
        return msgspec.structs.replace(self, **changes)
