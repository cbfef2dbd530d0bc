"""Options of commands: allowed values, messages for others, and the limits that they set."""

import math
from collections.abc import Iterable, Sequence
from numbers import Real
from pathlib import Path
from typing import NamedTuple

from cocap_opt.data import ProblemError
from cocap_opt.stop import FirstOf, Stop, TimeLimit, WorkLimit, never
from cocap_opt.text import meant
from cocap_opt.vision.coverage import usable_cores

LARGEST = 9 * 10**15  # below 2**53, up to which JSON readers distinguish whole numbers
_MOST = 100_000  # numbers in a list
_LONGEST = 1e6  # m


class UsageError(ValueError):
    """The value of an option is not allowed; the message names the option."""


class Allowance(NamedTuple):
    """The limits of one computation, which start when it starts."""

    seconds: float
    work: int | None = None  # units of `WorkLimit`; None: unlimited

    def begin(self, stop: Stop = never) -> Stop:
        """Returns a criterion that is reached when `stop` is, or when this allowance is used up."""
        criteria = [stop, TimeLimit(self.seconds)]
        if self.work is not None:
            criteria.append(WorkLimit(self.work))
        return FirstOf(*criteria)


class OutputFile(NamedTuple):
    """A file to write, and the ending of its name, in lower case."""

    path: Path
    ending: str


class Option(NamedTuple):
    """An option of a command, or a parameter of a function; all methods may raise UsageError.

    Attributes
    ----------
    name : name as users write it, e.g. "--seeds"; messages begin with it
    """

    name: str

    @staticmethod
    def refused(error: ProblemError) -> "UsageError":
        """Returns an error about a field as an error about the option with that name."""
        field, _, words = str(error).partition(": ")
        return UsageError(f"--{field.replace('_', '-')}: {words}")

    def require_one_of(self, value: str, allowed: Iterable[str]) -> None:
        """Raises an error unless a value is among the allowed ones."""
        words = list(allowed)
        if value not in words:
            raise self.not_among(value, words)

    def not_among(self, value: str, allowed: Iterable[str]) -> "UsageError":
        """Returns the error for a value that is not among the allowed ones."""
        words = list(allowed)
        return UsageError(
            f"{self.name}: must be one of {', '.join(words)}, not {value!r}"
            f"{meant(str(value), words)}"
        )

    def require_limit(self, value: object) -> float:
        """Returns a time limit in seconds as a plain float; infinite means no limit."""
        seconds = _number(value)
        if not 0 <= seconds <= LARGEST and seconds != math.inf:
            raise UsageError(
                f"{self.name}: must be a number of seconds, 0 or more, or inf for no limit, "
                f"not {value!r}"
            )
        return seconds

    def require_seconds(self, value: object) -> float:
        """Returns seconds as a plain float; rejects values that are negative, too large or not a
        number.

        With 0 seconds, everything is done except the search for better plans and bounds.
        """
        seconds = _number(value)
        if not 0 <= seconds <= LARGEST:
            raise UsageError(
                f"{self.name}: must be a finite number of seconds, 0 or more, not {value!r}"
            )
        return seconds

    def require_share(self, value: object) -> float:
        """Returns a share as a plain float; accepts only numbers from 0 to less than 1."""
        share = _number(value)
        if not 0 <= share < 1:
            raise UsageError(
                f"{self.name}: must be at least 0 and less than 1, such as 0.01, not {value}"
            )
        return share

    def require_part(self, value: object) -> float:
        """Returns a part of a whole as a plain float; accepts only numbers above 0, up to 1."""
        part = _number(value)
        if not 0 < part <= 1:
            raise UsageError(
                f"{self.name}: must be more than 0 and at most 1, such as 0.95, not {value}"
            )
        return part

    def require_duration(self, value: object) -> float:
        """Returns seconds as a plain float; accepts only finite numbers above 0."""
        seconds = _number(value)
        if not 0 < seconds <= LARGEST:
            raise UsageError(f"{self.name}: must be more than 0 seconds, and finite, not {value!r}")
        return seconds

    def require_whole(
        self, value: object, least: int = 0, most: int = LARGEST, about: str = ""
    ) -> int:
        """Returns a whole number as a plain int; rejects everything else, including fractions.

        Parameters
        ----------
        least, most : limits
        about : words for the message that explain the limit `most`
        """
        number = _number(value)
        if not (least <= number <= most and number.is_integer()):
            raise UsageError(
                f"{self.name}: must be a whole number from {least:,} to {most:,}{about}, "
                f"not {value!r}"
            )
        return int(number)

    def require_cores(self, count: object) -> int | None:
        """Returns a number of processes; it must be at least 1, with a core for each."""
        if count is None:
            return None
        return self.require_whole(count, 1, usable_cores(), ", with a core for each")

    def whole(self, text: str) -> int:
        """Returns the whole number that a word spells; rejects fractions such as 1.5."""
        digits = text.removeprefix("-")
        if not (digits.isascii() and digits.isdecimal()) or len(text) > len(str(LARGEST)):
            raise UsageError(
                f"{self.name}: must be a whole number from 0 to {LARGEST:,}, not {text[:40]!r}"
            )
        return int(text)

    def numbers(self, text: str) -> tuple[int, ...]:
        """Returns the distinct numbers of a list of numbers and ranges, e.g. "0-9,12"."""
        found: list[int] = []
        for part in text.split(","):
            wanted = self._range(part, text)
            count = len(found) + len(wanted)
            if count > _MOST:
                raise UsageError(f"{self.name}: must be at most {_MOST:,} numbers, not {count:,}")
            found += wanted
        return tuple(dict.fromkeys(found))

    def lengths(self, text: str) -> tuple[float, ...]:
        """Returns the distinct numbers, in metres, of a list, e.g. "6,9.5"."""
        found = []
        for part in text.split(","):
            try:
                number = float(part)
            except ValueError:
                number = math.nan
            if not abs(number) <= _LONGEST:
                raise UsageError(
                    f"{self.name}: must be numbers of metres such as 6,9.5, not {text!r}"
                )
            found.append(number)
        return tuple(dict.fromkeys(found))

    def _range(self, part: str, text: str) -> range:
        first, dash, last = part.partition("-")
        ends = (first, last) if dash else (first,)
        if not all(end.isascii() and end.isdecimal() for end in ends):
            raise UsageError(
                f"{self.name}: must be numbers and ranges such as 0-9,12, not {text!r}"
            )
        longest = max(map(len, ends))
        if longest > len(str(LARGEST)) or max(map(int, ends)) > LARGEST:
            raise UsageError(
                f"{self.name}: must be whole numbers from 0 to {LARGEST:,}, not {part[:40]!r}"
            )
        wanted = range(int(first), int(last or first) + 1)
        if not wanted:
            raise UsageError(f"{self.name}: ranges must go up, not {part!r}")
        return wanted

    def values(self, words: Sequence[str]) -> dict[str, str]:
        """Returns values by name from words NAME=VALUE; each name must occur only once."""
        found: dict[str, str] = {}
        for word in words:
            name, equals, value = word.partition("=")
            if not equals:
                raise UsageError(f"{self.name}: must be NAME=VALUE, not {word!r}")
            if name in found:
                raise UsageError(f"{self.name}: {name!r} must be given only once")
            found[name] = value
        return found

    def file(self, path: Path | None, allowed: tuple[str, ...]) -> OutputFile:
        """Returns an output file, which must be named, with the ending that determines its kind.

        If several endings match, such as .csv and .crazyflie.csv, the longest is returned.
        """
        name = "" if path is None else path.name.lower()
        fitting = [word for word in allowed if name.endswith(word) and name != word]
        if path is None or not fitting:
            words = " or ".join(filter(None, (", ".join(allowed[:-1]), allowed[-1])))
            raise UsageError(f"{self.name}: name a file that ends in {words}")
        return OutputFile(path, max(fitting, key=len))


def _number(value: object) -> float:
    """Returns a Python or NumPy number as a float; nan for everything else, including truth
    values.
    """
    if isinstance(value, bool) or not isinstance(value, Real):
        return math.nan
    try:
        return float(value)
    except OverflowError:
        return math.inf
