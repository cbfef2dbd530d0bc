"""Parts of sentences and of tables that the built site never divides at the end of a line.

They are numbers with their units, intervals, counts such as "10 of 10", and dates.
"""

import re
from collections.abc import Iterator

_NUMBER = r"[+-]?\d[\d,]*(?:\.\d+)?(?:e[+-]?\d+)?"
_UNIT = r"(?:%|ms|s|mm|cm|m|km|GB|MB|KB|px|m/s|px/m2|h|x(?! \d))(?![\w/^-])"
_WHOLE = re.compile(
    rf"(\({_NUMBER} to {_NUMBER}\)|\b\d{{4}}-\d\d-\d\d\b|(?<![\w.-])"
    rf"(?:{_NUMBER} of {_NUMBER}\b|{_NUMBER} ± {_NUMBER}|(?:< )?{_NUMBER} {_UNIT}(?: \*)?"
    rf"|< {_NUMBER}\b))"
)


def with_wholes(words: str) -> Iterator[tuple[str, bool]]:
    """Yields words in pieces, each with whether it must stay on one line; no piece is empty."""
    for k, piece in enumerate(_WHOLE.split(words)):
        if piece:
            yield piece, k % 2 == 1
