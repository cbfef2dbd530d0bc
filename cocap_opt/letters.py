"""The width of text on a terminal, and text folded into lines of a width."""

import re
import unicodedata

_BEFORE_UNIT = re.compile(r"(?<=\d) (?=%|(?:px|mm|cm|m|s|deg)\b)")
_HELD = "\0"  # a space at which no line ends


def columns_of(text: str) -> int:
    """Returns the columns of a terminal that a line takes.

    Chinese, Japanese and Korean letters take two, accents that are characters of their own none.
    Emoji that are made of several characters are counted one by one, which may be too many.
    """
    if text.isascii():
        return len(text)
    return sum(2 if unicodedata.east_asian_width(c) in "WF" else 1 for c in text if not _joins(c))


def _joins(character: str) -> bool:
    """Returns True for characters that are drawn on the one before: accents, and ends of Hangul."""
    return (
        unicodedata.category(character) in ("Mn", "Me", "Mc", "Cf")
        or "\u1160" <= character <= "\u11ff"
    )


def folded(text: str, width: int, first: str = "", indent: str = "") -> str:
    """Returns text in lines of a terminal; words that are wider than a line are parted.

    A number and its unit stay in one line.

    Parameters
    ----------
    width : columns of a line, more than those of what stands before it
    first : what stands before the first line
    indent : what stands before all others
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
        # At least a letter, however narrow the terminal; accents stay with theirs.
        while columns_of(line) > width and len(line) > len(before) + 1:
            wide = next(k for k in range(len(line)) if columns_of(line[: k + 1]) > width)
            end = max(wide, len(before) + 1)
            lines.append(line[:end])
            before, line = indent, indent + line[end:]
    return "\n".join([*lines, line])
