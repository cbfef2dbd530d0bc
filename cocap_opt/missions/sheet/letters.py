"""Text on paper: its style, its width, and how it is folded."""

import re
from collections.abc import Iterator
from functools import lru_cache
from typing import NamedTuple

from matplotlib.font_manager import FontProperties
from matplotlib.textpath import text_to_path

POINT = 25.4 / 72  # mm per point
_LEADING = 1.36  # line spacing, relative to the size
_LEFTWARD = "[\u0590-\u08ff\ufb1d-\ufdff\ufe70-\ufeff\U00010800-\U00010fff\U0001e800-\U0001efff]"
_LEFTWARDS = re.compile(rf"({_LEFTWARD}+(?:[\s'\"\u00b4\u2019.-]*{_LEFTWARD}+)*)")


class Text(NamedTuple):
    """The style of text."""

    size: float = 8.0  # points
    bold: bool = False

    @property
    def line(self) -> float:
        """Height of a line (mm)."""
        return self.size * _LEADING * POINT

    @property
    def in_bold(self) -> "Text":
        """The same style in bold letters."""
        return self._replace(bold=True)


BODY, SMALL = Text(), Text(7.0)
STRONG, SMALL_STRONG = BODY.in_bold, SMALL.in_bold
HEAD, TITLE = Text(10.0, bold=True), Text(16.0, bold=True)


def wrapped(words: str, width: float, look: Text, families: tuple[str, ...]) -> list[str]:
    """Returns the lines of a folded text; words wider than a line are split.

    Parameters
    ----------
    width : width of a line, mm
    families : font families
    """
    if "\n" in words:
        parts = (wrapped(part, width, look, families) for part in words.split("\n"))
        return [line for lines in parts for line in lines]
    lines, line = list[str](), ""
    for word in words.split(" "):
        longer = f"{line} {word}" if line else word
        if _fits(longer, width, look, families):
            line = longer
            continue
        if line:
            lines.append(line)
        *whole, line = _parted(word, width, look, families)
        lines += whole
    return [*lines, line]


def _parted(word: str, width: float, look: Text, families: tuple[str, ...]) -> Iterator[str]:
    """Yields the parts of a word, each no wider than a line, with at least one letter."""
    part = ""
    for letter in word:
        if part and not _fits(part + letter, width, look, families):
            yield part
            part = ""
        part += letter
    yield part


def _fits(words: str, width: float, look: Text, families: tuple[str, ...]) -> bool:
    return wide(words, look, families) <= width + 0.01


def in_order(words: str) -> list[str]:
    """Returns the parts of a line from left to right: names that are written from right to left,
    and what is between them.

    Each part must be drawn by itself. As a whole line, numbers beside such a name would be on its
    other side.
    """
    return [part for part in _LEFTWARDS.split(words) if part]


def wide(words: str, look: Text, families: tuple[str, ...]) -> float:
    """Returns the width of text (mm)."""
    return sum(_wide(part, look, families) for part in in_order(words))


@lru_cache(maxsize=20_000)
def _wide(words: str, look: Text, families: tuple[str, ...]) -> float:
    """Returns the width of text (mm)."""
    weight = "bold" if look.bold else "normal"
    font = FontProperties(family=list(families), weight=weight, size=look.size)
    points: float = text_to_path.get_text_width_height_descent(words, font, ismath=False)[0]
    return points * POINT
