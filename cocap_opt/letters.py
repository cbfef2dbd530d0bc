"""The width of text on a terminal, and text wrapped into lines of a given width."""

import re
import unicodedata

_BEFORE_UNIT = re.compile(r"(?<=\d) (?=%|(?:px|mm|cm|m|s|deg)\b)")
_HELD = "\0"  # a space at which lines must not break


def columns_of(text: str) -> int:
    """Returns the number of terminal columns that a line takes.

    Chinese, Japanese and Korean letters take two columns, combining accents none. The characters of
    a composite emoji are counted one by one, which may be too many.
    """
    if text.isascii():
        return len(text)
    return sum(2 if unicodedata.east_asian_width(c) in "WF" else 1 for c in text if not _joins(c))


def _joins(character: str) -> bool:
    """Returns True for characters drawn on the previous one: accents, and parts of Hangul."""
    return (
        unicodedata.category(character) in ("Mn", "Me", "Mc", "Cf")
        or "\u1160" <= character <= "\u11ff"
    )


def folded(text: str, width: int, first: str = "", indent: str = "") -> str:
    """Returns text wrapped into lines; words wider than a line are split.

    A number and its unit stay on one line.

    Parameters
    ----------
    width : terminal columns per line, more than `first` and `indent` take
    first : prefix of the first line
    indent : prefix of all other lines
    """
    lines, before, line = list[str](), first, first
    for held in _BEFORE_UNIT.sub(_HELD, text).split():
        word = held.replace(_HELD, " ")
        if line == before:
            line += word
        elif columns_of(f"{line} {word}") <= width:
            line += f" {word}"
        else:
            lines.append(line)
            before, line = indent, indent + word
        # A line has at least one letter, however narrow the terminal; accents stay with letters.
        while columns_of(line) > width and len(line) > len(before) + 1:
            wide = next(k for k in range(len(line)) if columns_of(line[: k + 1]) > width)
            end = max(wide, len(before) + 1)
            lines.append(line[:end])
            before, line = indent, indent + line[end:]
    return "\n".join([*lines, line])
