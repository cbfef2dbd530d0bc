"""Errors of msgspec's decoders in the words of this project: what was found, what is allowed."""

import re
from collections.abc import Iterator, Sequence
from typing import Any

import msgspec
from msgspec import inspect

from cocap_opt.files.strict_json import without_mark
from cocap_opt.text import meant, shortened

_MALFORMED = re.compile(r"malformed.*\(byte (\d+)\)")
_NO_TOML = re.compile(r"(.*) \(at (?:end of document|line (\d+), column (\d+))\)")
_TWICE = "Cannot overwrite", "Cannot declare", "Cannot mutate", "Cannot define", "Duplicate"
_NO_NUMBER = re.compile(r"-?(?:nan|inf(?:inity)?)", re.IGNORECASE)
_PLACE = re.compile(r"(.*) - at `(key` in `|key in )?\$\.?(.*)`")
_UNKNOWN_WORD = re.compile(r"Invalid (?:enum )?value (.*)")
_WRONG = re.compile(r"Expected `([^`]*)`(.*?)(?:, got `?([^`]*)`?)?")
_UNKNOWN_FIELD = re.compile(r"Object contains unknown field `(.*)`")
_MISSING_FIELD = re.compile(r"Object missing required field `(.*)`")
_OTHER_NAMES = {  # for fields
    "heights": "layers", "height": "layers", "altitudes": "layers",
    **dict.fromkeys(("fx", "fy", "f", "focal_length", "focal_px"), "focal"),
    "image_width": "width", "image_height": "height", "hfov": "fov", "vfov": "fov_vertical",
    "dfov": "fov_diagonal",
}  # fmt: skip
_CENTRED = "; leave it out: the principal point is in the middle of the image"
_STRAIGHT = "; leave it out: the lens has no distortion, as in undistorted images"
_LEFT_OUT = {  # fields of cameras that have no counterpart
    **dict.fromkeys(("cx", "cy", "principal_point", "ppx", "ppy"), _CENTRED),
    **dict.fromkeys(("distortion", "distortions", "dist_coeffs", "distortion_coefficients", "k1",
                     "k2", "p1", "p2"), _STRAIGHT),
}  # fmt: skip
_FEW_FIELDS = 8  # up to this number, the fields of a required object are named
_PART = re.compile(r"([^.\[\]]+)|\[([^\]]*)\]")  # a part of a path such as tracks[0].unit
_LONGEST = 40  # letters of a value that a message quotes
_HUGE = 1e9  # no scene needs numbers beyond this limit
_UNKNOWN = object()  # a value that cannot be found again
_TYPES = {
    "float": "a number", "int": "a whole number", "str": "text", "bool": "true or false",
    "array": "a list", "object": "an object with fields", "null": "null", "date": "a date",
    "datetime": "a date with a time", "time": "a time of day",
}  # fmt: skip


def in_words(error: Exception, content: bytes | str, kind: object, value: object = _UNKNOWN) -> str:
    """Rewords an error that decoding a file has raised, on one line.

    Parameters
    ----------
    error : an error of msgspec or of another decoder
    content : content of the file
    kind : the type that the content should have
    value : the value that was read from the content, if it is neither JSON nor TOML
    """
    if isinstance(error, RecursionError):
        return "must not be nested so deeply"
    if isinstance(error, UnicodeDecodeError):
        return no_text(error)
    content = without_mark(content)
    if isinstance(content, bytes):
        try:
            content.decode()
        except UnicodeDecodeError as wrong:  # msgspec 0.23 does not give the place of this error
            return no_text(wrong)
    words = " ".join(str(error).split()) or type(error).__name__
    raw = content.encode() if isinstance(content, str) else content
    if not raw.strip():
        return "is empty"
    if words == "Input data was truncated":
        return "ends before its JSON is complete"
    if malformed := _MALFORMED.search(words):
        byte = int(malformed[1])
        found = _NO_NUMBER.search(raw[max(byte - 1, 0) : byte + 10].decode(errors="replace"))
        if found and found.start() <= 1:
            return f"must hold finite numbers only, not {found[0]} (byte {byte})"
        line = raw[:byte].count(b"\n") + 1
        return (
            f"line {line}, byte {byte}: must be JSON; a bracket, a quotation mark or a comma is "
            "missing, or one too many"
        )
    if no_toml := _NO_TOML.fullmatch(words):
        return _no_toml(*no_toml.groups())
    placed = _PLACE.fullmatch(words)
    said, key, path = placed.groups() if placed else (words, None, "")
    if value is _UNKNOWN and not key:
        value = _read_again(content)
    said = _allowed_words(said, kind, path, _UNKNOWN if key else _value_at(value, path))
    said = f"its keys {said}" if key else said
    return f"{path}: {said}" if path else said


def no_text(error: UnicodeDecodeError) -> str:
    """Returns the message on a file that is not text, with the place of the error."""
    line = error.object[: error.start].count(b"\n") + 1
    return f"must be a text file in UTF-8, but byte {error.start + 1}, in line {line}, is not"


def _no_toml(said: str, line: str | None, column: str | None) -> str:
    """Returns the message on malformed TOML, with the place that Python's decoder names."""
    place = f"line {line}, column {column}" if line else "at the end"
    if said.startswith(_TWICE):
        return f"{place}: each key and each table must be given once"
    if line is None:
        return "ends before its TOML is complete: a value or a closing mark is missing"
    return f"{place}: must be TOML; a bracket, a quotation mark, = or a value may be missing"


def _read_again(content: bytes | str) -> object:
    """Returns the value of JSON or TOML, of any type, so that a message can quote a part of it."""
    for decode in (msgspec.json.decode, msgspec.toml.decode):
        try:
            value: object = decode(content)
        except (msgspec.MsgspecError, ValueError, RecursionError):
            continue
        return value
    return _UNKNOWN


def _value_at(value: Any, path: str) -> object:
    """Returns the part of a value that a path leads to."""
    try:
        for field, index in _PART.findall(path):
            value = value[field] if field else value[int(index)]
    except (LookupError, TypeError, ValueError):
        return _UNKNOWN
    return value


def _quoted(value: object) -> str:
    """Returns a number, a truth value or a text as a message quotes it; otherwise empty."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return f"the text {shortened(value, _LONGEST)!r}"
    return shortened(repr(value), _LONGEST) if isinstance(value, (int, float)) else ""


def _within(kind: inspect.Type, value: object) -> str:
    """Returns the limits of a number in words, after a space; empty if there are none.

    A limit whose only purpose is to keep numbers finite is left out, unless the value exceeds it.
    """
    if not isinstance(kind, inspect.FloatType | inspect.IntType):
        return ""
    number = value if isinstance(value, (int, float)) else 0.0
    low = kind.ge if kind.ge is None or kind.ge > -_HUGE or number < kind.ge else None
    high = kind.le if kind.le is None or kind.le < _HUGE or number > kind.le else None
    if low is not None and high is not None:
        words = [f"from {_limit(low)} to {_limit(high)}"]
    else:
        limits = {">=": low, ">": kind.gt, "<=": high, "<": kind.lt}
        words = [f"{sign} {_limit(end)}" for sign, end in limits.items() if end is not None]
    if kind.multiple_of is not None:
        words.append(f"that is a multiple of {_limit(kind.multiple_of)}")
    return f" {' and '.join(words)}" if words else ""


def _limit(number: float) -> str:
    """Returns a limit in plain digits."""
    return f"{number:,.0f}" if float(number).is_integer() else f"{number:.6g}"


def _allowed_words(said: str, kind: object, path: str, value: object) -> str:
    """Rewords msgspec's message on the value at a path, to name the values allowed there."""
    whole = inspect.type_info(kind)
    if unknown := _UNKNOWN_WORD.fullmatch(said):
        return _of_unknown_word(unknown[1], whole, path) or said
    if wrong := _WRONG.fullmatch(said):
        expected, limits, found = wrong.groups()
        # If null is one of several types, the field may be left out.
        types = [word for word in expected.split(" | ") if word != "null"] or ["null"]
        allowed = f"must be {_types_in_words(types, whole, path)}"
        numbers = {_within(part, value) for part in _kinds_at(whole, path)} - {""}
        if types in (["float"], ["int"]) and len(numbers) < 2:
            limits = "".join(numbers)
        given = _given(value, found, "length" in limits)
        return f"{allowed}{limits}" + (f", not {given}" if given else "")
    if said == "Number out of range":
        return "must be a number within +-1.8e308"
    if field := _UNKNOWN_FIELD.fullmatch(said):
        return _of_unknown_field(field[1], _fields(whole, path))
    if field := _MISSING_FIELD.fullmatch(said):
        return f"must have the field `{field[1]}`"
    return said


def _of_unknown_word(word: str, whole: inspect.Type, path: str) -> str:
    """Returns the message on a word that is not allowed at a path; empty if no word is."""
    words = _allowed(whole, path)
    if not words:
        return ""
    others = _other_types(whole, path)
    any_of_them = f'"{words[0]}"' if len(words) == 1 else f"one of {', '.join(words)}"
    either = " or ".join([*others, *words]) if others else any_of_them
    question = meant(word.strip("'"), words)
    return f"must be {either}, not {word}{question}"


def _types_in_words(types: Sequence[str], whole: inspect.Type, path: str) -> str:
    """Returns the types that are allowed at a path in words, from msgspec's names for them."""
    words = _allowed(whole, path)  # otherwise any text is allowed
    fields = _fields(whole, path) if "object" in types else []
    of_fields = f" ({', '.join(fields)})" if 0 < len(fields) <= _FEW_FIELDS else ""
    return " or ".join(
        f'"{words[0]}"'
        if word == "str" and len(words) == 1
        else _TYPES.get(word, word) + of_fields * (word == "object")
        for word in types
    )


def _given(value: object, found: str | None, counts: bool) -> str:
    """Returns the value that was found, in words; empty if it is unknown.

    Parameters
    ----------
    found : msgspec's name for its type
    counts : True if the length of a list or a text is limited
    """
    if given := _quoted(value):
        return given
    if found == "float":
        return "a number with decimals"
    if found:
        return _TYPES.get(found, found)
    return str(len(value)) if counts and isinstance(value, (list, tuple, str)) else ""


def _of_unknown_field(name: str, known: Sequence[str]) -> str:
    """Returns the message on a field that an object must not have, given those that it may have."""
    if not known:
        return f"must have no unknown field `{name}`"
    other = _OTHER_NAMES.get(name, "")
    question = f"; did you mean {other}?" if other in known else meant(name, known)
    if "focal" in known:
        question = _LEFT_OUT.get(name, question)
    return f"must have no unknown field `{name}`{question}; known are {', '.join(known)}"


def _allowed(kind: inspect.Type, path: str) -> list[str]:
    """Returns the words that are allowed at a path; none if other values are allowed, too."""
    kinds = _kinds_at(kind, path)
    words = [
        str(word) for part in kinds if isinstance(part, inspect.LiteralType) for word in part.values
    ]
    members = [
        member for part in kinds if isinstance(part, inspect.EnumType) for member in part.cls
    ]
    return words + [str(member.value) for member in members]


def _other_types(kind: inspect.Type, path: str) -> list[str]:
    """Returns the types of values that are allowed at a path besides words, in words."""
    names = {
        inspect.FloatType: "float", inspect.IntType: "int", inspect.StructType: "object",
        inspect.VarTupleType: "array", inspect.ListType: "array",
    }  # fmt: skip
    found = (names.get(type(part)) for part in _kinds_at(kind, path))
    return [_TYPES[name] for name in dict.fromkeys(found) if name]


def _fields(kind: inspect.Type, path: str) -> list[str]:
    """Returns the fields of the object at a path; none if several kinds of objects are allowed."""
    found = [part for part in _kinds_at(kind, path) if isinstance(part, inspect.StructType)]
    return [field.encode_name for field in found[0].fields] if len(found) == 1 else []


def _kinds_at(kind: inspect.Type, path: str) -> list[inspect.Type]:
    """Returns the types that are allowed at a path."""
    kinds = [kind]
    for field, _ in _PART.findall(path):
        kinds = [part for whole in kinds for part in _parts(whole, field)]
    return list(_alternatives(kinds))


def _parts(kind: inspect.Type, field: str) -> Iterator[inspect.Type]:
    """Yields the types of a field of a struct, or of the items of a sequence if it is empty."""
    for alternative in _alternatives([kind]):
        if isinstance(alternative, inspect.StructType) and field:
            yield from (f.type for f in alternative.fields if f.encode_name == field)
            if alternative.tag_field == field:
                yield inspect.LiteralType((alternative.tag,))
        elif isinstance(alternative, inspect.ListType | inspect.VarTupleType) and not field:
            yield alternative.item_type
        elif isinstance(alternative, inspect.TupleType) and not field:
            yield from alternative.item_types
        elif isinstance(alternative, inspect.DictType) and not field:
            yield alternative.value_type


def _alternatives(kinds: list[inspect.Type]) -> Iterator[inspect.Type]:
    for kind in kinds:
        if isinstance(kind, inspect.UnionType):
            yield from _alternatives(list(kind.types))
        else:
            yield kind
