"""Options that are lists of numbers, or values by name."""

from collections.abc import Sequence

from cocap_opt.files.documents import FileError

LARGEST = 2**63 - 1  # what JSON readers can take
MOST = 100_000  # numbers in a list


def numbers(option: str, text: str) -> tuple[int, ...]:
    """Numbers of a list of numbers and ranges, "0-9,12", each once.

    Raises
    ------
    FileError
        If it is no such list; the message names the option.
    """
    found: list[int] = []
    for part in text.split(","):
        first, dash, last = part.partition("-")
        ends = (first, last) if dash else (first,)
        if not all(end.isdecimal() for end in ends):
            raise FileError(f"{option}: must be numbers and ranges such as 0-9,12, not {text!r}")
        if max(map(len, ends)) >= len(str(LARGEST)):
            raise FileError(f"{option}: must be 0..{LARGEST}")
        wanted = range(int(first), int(last or first) + 1)
        if not wanted:
            raise FileError(f"{option}: ranges must go up, not {part!r}")
        if len(found) + len(wanted) > MOST:
            raise FileError(f"{option}: must be at most {MOST} numbers")
        found += wanted
    return tuple(dict.fromkeys(found))


def values(option: str, words: Sequence[str]) -> dict[str, str]:
    """Values by name, from NAME=VALUE each.

    Raises
    ------
    FileError
        If one is no such pair, or a name is there twice; the message names the option.
    """
    found: dict[str, str] = {}
    for word in words:
        name, equals, value = word.partition("=")
        if not equals:
            raise FileError(f"{option}: must be NAME=VALUE, not {word!r}")
        if name in found:
            raise FileError(f"{option}: {name!r} must be given only once")
        found[name] = value
    return found
