"""Text of files as it is shown, and words that were meant."""

import unicodedata
from collections.abc import Iterable, Sequence
from decimal import ROUND_CEILING, Decimal
from difflib import get_close_matches

OTHERWISE = "name the scene and seed that it is for, or plan again if you changed the scene"
_NUMBERS = {1: "one", 2: "two", 3: "three", 4: "four", 5: "five", 6: "six", 7: "seven", 8: "eight"}


def printable(text: str, kept: str = "") -> str:
    """Returns the text with line breaks, control and other non-printable characters escaped.

    Spaces of any width are plain ones.

    Parameters
    ----------
    kept : characters that stay as they are
    """
    return "".join(
        c if c.isprintable() or c in kept
        else " " if unicodedata.category(c) == "Zs" else c.encode("unicode_escape").decode()
        for c in text
    )  # fmt: skip


def columns_of(text: str) -> int:
    """Returns the columns of a terminal that a line takes, as rich counts them in its tables.

    Chinese, Japanese and Korean letters take two, accents that are characters of their own none.
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

    Parameters
    ----------
    width : columns of a line, more than those of what stands before it
    first : what stands before the first line
    indent : what stands before all others
    """
    lines, before, line = list[str](), first, first
    for word in text.split():
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


def rounded_up(number: float, digits: int) -> str:
    """Returns a number with so many decimals that is not below it, as bounds are told.

    What is above by no more than rounding of the last bits is not.
    """
    step = Decimal(1).scaleb(-digits)
    return f"{Decimal(number - 1e-12 * abs(number)).quantize(step, ROUND_CEILING):,}"


def number_in_words(number: int) -> str:
    """Returns the word for a small number, the figures of any other."""
    return _NUMBERS.get(number, str(number))


def with_article(name: str) -> str:
    """Returns the name of a type after "a" or "an"; those that begin with u sound like "you"."""
    return f"{'an' if name[0] in 'AEIOaeio' else 'a'} {name}"


def in_ranges(numbers: Sequence[int]) -> str:
    """Returns increasing whole numbers in words, such as "3-5, 8"."""
    runs: list[list[int]] = []
    for number in numbers:
        if runs and number == runs[-1][-1] + 1:
            runs[-1].append(number)
        else:
            runs.append([number])
    return ", ".join(str(run[0]) if len(run) == 1 else f"{run[0]}-{run[-1]}" for run in runs)


def unread(error: OSError) -> str:
    """Returns why a file cannot be read, in the same words for all kinds of files."""
    is_missing = isinstance(error, FileNotFoundError)
    return "no such file" if is_missing else f"cannot be read: {error.strerror or error}"


def shortened(name: str, most: int = 60) -> str:
    """Returns a name without its middle, if it has more than `most` characters."""
    half = most // 2
    return name if len(name) <= most else f"{name[: most - half - 1]}…{name[-half:]}"


def meant(word: str, known: Iterable[str]) -> str:
    """Returns a question after the known word that is most like another; nothing if none is."""
    close = get_close_matches(word, list(known), n=1)
    return f"; did you mean {close[0]}?" if close else ""


def other_scene(theirs: str, ours: str) -> str:
    """Returns words for the scene that something was made for, where it is not one's own.

    Both are named; two of one name differ in what they are.
    """
    if theirs != ours:
        return f"{shortened(printable(theirs))}, not {shortened(printable(ours))}"
    return f"{shortened(printable(ours))} of another seed, content, rules or objective"
