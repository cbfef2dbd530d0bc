"""Text, names and numbers as messages show them, and suggestions for misspelt words."""

import unicodedata
from collections.abc import Iterable, Sequence
from decimal import ROUND_CEILING, Decimal
from difflib import get_close_matches

OTHERWISE = "name the scene and seed that it is for, or plan again if you changed the scene"
_PLURALS = {"person": "people"}
_NUMBERS = {1: "one", 2: "two", 3: "three", 4: "four", 5: "five", 6: "six", 7: "seven", 8: "eight"}


def printable(text: str, kept: str = "") -> str:
    """Returns the text with line breaks, control and other non-printable characters escaped.

    Spaces of any width become plain spaces.

    Parameters
    ----------
    kept : characters that stay as they are
    """
    return "".join(
        c if c.isprintable() or c in kept
        else " " if unicodedata.category(c) == "Zs" else c.encode("unicode_escape").decode()
        for c in text
    )  # fmt: skip


def rounded_up(number: float, digits: int) -> str:
    """Returns a number rounded up to so many decimals, as proved bounds are printed.

    An excess that rounding of the last bits explains is not rounded up.
    """
    step = Decimal(1).scaleb(-digits)
    size = max(abs(number), 1)
    return f"{Decimal(number - 1e-12 * size).quantize(step, ROUND_CEILING) + 0:,}"


def plain(number: float) -> str:
    """Returns a limit in plain digits; large ones have commas and no exponent."""
    return f"{number:,.0f}" if abs(number) >= 1e6 else f"{number:g}"


def significant(number: float, digits: int) -> str:
    """Returns a number >= 0 with so many digits, or with all digits before the point."""
    short = f"{number:.{digits}g}"
    return f"{number:,.0f}" if "e+" in short else short


def pair(x: float, y: float) -> str:
    """Returns a point in brackets, in plain digits."""
    return f"({in_digits(x)}, {in_digits(y)})"


def span(low: float, high: float) -> str:
    """Returns a range in plain digits, like the coordinates of points."""
    return f"{in_digits(low)}..{in_digits(high)}"


def in_digits(number: float) -> str:
    """Returns a coordinate with nine digits; larger numbers have all digits before the point."""
    return f"{round(number, 6):.9g}" if abs(number) < 1e9 else f"{number:.0f}"


def distance(metres: float) -> str:
    """Returns a distance with its unit, in plain digits; long distances are in kilometres."""
    if metres >= 10_000:
        return f"{metres / 1000:,.0f} km"
    return f"{metres:,.0f} m" if metres >= 1000 else f"{metres:.4g} m"


def counted(number: int, noun: str) -> str:
    """Returns a number with its noun, e.g. "1 row" or "2,000 rows"."""
    return f"{number:,} {noun if number == 1 else _PLURALS.get(noun, f'{noun}s')}"


def number_in_words(number: int) -> str:
    """Returns the word for a small number, and the digits of any other."""
    return _NUMBERS.get(number, str(number))


def with_article(name: str) -> str:
    """Returns the name of a type after "a" or "an"; an initial u is pronounced as "you"."""
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
    """Returns the reason why a file cannot be read, in the same words for all kinds of files."""
    is_missing = isinstance(error, FileNotFoundError)
    return "no such file" if is_missing else f"cannot be read: {error.strerror or error}"


def shortened(name: str, most: int = 60) -> str:
    """Returns a name, with an ellipsis for its middle if it has more than `most` characters."""
    half = most // 2
    return name if len(name) <= most else f"{name[: most - half - 1]}…{name[-half:]}"


def on_a_line(value: object, most: int = 80) -> str:
    """Returns the `repr` of a value on one line, with an ellipsis if it is long."""
    return shortened(" ".join(repr(value).split()), most)


def meant(word: str, known: Iterable[str]) -> str:
    """Returns a question that suggests the most similar known word; empty if none is similar."""
    close = get_close_matches(word, list(known), n=1)
    return f"; did you mean {close[0]}?" if close else ""


def other_scene(theirs: str, ours: str) -> str:
    """Returns words for the scene that something was made for, if it differs from the given one.

    Both scenes are named; if they have the same name, the possible differences are listed.
    """
    if theirs != ours:
        return f"{shortened(printable(theirs))}, not {shortened(printable(ours))}"
    return f"{shortened(printable(ours))} of another seed, content, rules or objective"
