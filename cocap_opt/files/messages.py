"""Errors of msgspec's decoders in the words of this project: what is there, and what is allowed."""

import re
from collections.abc import Iterator

from msgspec import inspect

_MALFORMED = re.compile(r"malformed.*\(byte (\d+)\)")
_NO_NUMBER = re.compile(r"-?(?:nan|inf(?:inity)?)", re.IGNORECASE)
_UNKNOWN_WORD = re.compile(r"Invalid (?:enum )?value (.*) - at `\$\.?(.*)`")
_PART = re.compile(r"([^.\[\]]+)|\[([^\]]*)\]")  # of a path such as tracks[0].unit


def in_words(error: Exception, content: bytes | str, kind: object) -> str:
    """Returns what an error says that decoding a file has raised, on one line.

    Parameters
    ----------
    error : of msgspec, or any other
    content : of the file
    kind : the type that it should have
    """
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
    if unknown := _UNKNOWN_WORD.fullmatch(words):
        value, path = unknown.groups()
        if allowed := _allowed(inspect.type_info(kind), path):
            return f"{path}: must be one of {', '.join(allowed)}, not {value}"
    return words


def _allowed(kind: inspect.Type, path: str) -> list[str]:
    """Returns the words that may stand at a path; none where others than words may."""
    kinds = [kind]
    for field, _ in _PART.findall(path):
        kinds = [part for whole in kinds for part in _parts(whole, field)]
    found = [kind.values for kind in _alternatives(kinds) if isinstance(kind, inspect.LiteralType)]
    return [str(value) for values in found for value in values]


def _parts(kind: inspect.Type, field: str) -> Iterator[inspect.Type]:
    """Yields the types of a field of a struct, or of the items of a sequence if it has no name."""
    for one in _alternatives([kind]):
        if isinstance(one, inspect.StructType) and field:
            yield from (f.type for f in one.fields if f.encode_name == field)
            if one.tag_field == field:
                yield inspect.LiteralType((one.tag,))
        elif isinstance(one, inspect.ListType | inspect.VarTupleType) and not field:
            yield one.item_type
        elif isinstance(one, inspect.TupleType) and not field:
            yield from one.item_types
        elif isinstance(one, inspect.DictType) and not field:
            yield one.value_type


def _alternatives(kinds: list[inspect.Type]) -> Iterator[inspect.Type]:
    for kind in kinds:
        if isinstance(kind, inspect.UnionType):
            yield from _alternatives(list(kind.types))
        else:
            yield kind
