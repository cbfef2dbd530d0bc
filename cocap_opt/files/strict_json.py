"""Strict reading of JSON: the value must have a given type, and no object may repeat a key.

Decoders silently take the last of repeated values, whichever was meant.
"""

import codecs
import json
from collections.abc import Callable
from typing import Any, TypeVar

import msgspec

from cocap_opt.data import ProblemError

T = TypeVar("T")


def decode_json(
    content: bytes | str, kind: type[T], hook: Callable[[type, Any], Any] | None = None
) -> T:
    """Returns the value of JSON, after a byte order mark if there is one.

    Parameters
    ----------
    kind : type of the value
    hook : makes values of types that msgspec does not know, as its `dec_hook`

    Raises
    ------
    MsgspecError, UnicodeDecodeError, RecursionError
        If the value does not have this type, or the text is not JSON.
    ProblemError
        If an object has a key twice.
    """
    content = without_mark(content)
    value = msgspec.json.decode(content, type=kind, dec_hook=hook)
    text = content if isinstance(content, str) else content.decode(errors="replace")
    # Numbers are not converted, as unused ones may have thousands of digits.
    json.loads(text, object_pairs_hook=_require_distinct, parse_int=str, parse_float=str)
    return value


def without_mark(content: bytes | str) -> bytes | str:
    """Returns the content of a file in UTF-8 without a byte order mark, which some programs write
    first.
    """
    if isinstance(content, bytes):
        return content.removeprefix(codecs.BOM_UTF8)
    return content.removeprefix("\ufeff")


def _require_distinct(pairs: list[tuple[str, Any]]) -> None:
    keys = [key for key, _ in pairs]
    if len(set(keys)) < len(keys):
        twice = next(key for k, key in enumerate(keys) if key in keys[:k])
        raise ProblemError(f"{twice[:40]}: must be given once in an object, not twice")
