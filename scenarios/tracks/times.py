"""The column of times of tracks, in seconds: numbers in any unit, and dates.

Dates, and numbers that count since 1970, are absolute times. They are converted to times since the
first of them, and `Epoch` records when that was, so that files can be put on one clock. They are
read as whole nanoseconds, because a double cannot represent parts of a microsecond since 1970.
"""

import re
from collections.abc import Callable, Iterable, Sequence
from datetime import UTC, datetime, timedelta
from decimal import Decimal
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cocap_opt.data import FloatArray, IntArray, ProblemError
from cocap_opt.scenarios.tables import PER_SECOND

A_DATE = "a date with a time such as 2026-05-01T10:00:00.25"
A_CLOCK = "a time of day such as 10:00:00.25"
_DATE = re.compile(r"\d{4}-\d\d-\d\d[T ]|\d{8}T\d")
# A date of digits alone, 20260501100000, with the fraction of its second or the milliseconds.
_DIGITS = re.compile(
    r"((?:19|20)\d\d(?:0[1-9]|1[0-2])(?:0[1-9]|[12]\d|3[01]))"
    r"((?:[01]\d|2[0-3])[0-5]\d[0-5]\d)(?:[.,](\d+)|(\d{3}))?"
)
_CLOCK = re.compile(r"(\d{1,3}):([0-5]\d):([0-5]\d(?:[.,]\d+)?)")
_HALF_A_DAY = 43_200.0  # s
_SET_BACK = 1_800.0  # s, least time by which a clock goes back that was set or counts to 12
_FEW_TIMES = 0.1  # share of the steps between rows; if more go back, rows are not in order
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_YEARS = 1678, 2261  # years whose nanoseconds since 1970 fit into an int64
SINCE_1970 = 1e8  # s; later times can only be times since 1970
_DATES = SINCE_1970, 4.2e9  # s since 1970; from 1973 to 2103
_MOST = 1e11  # s, the latest time of any clock; 3,000 years
_NANO = 10**9
_LIKELY = 0.002, 2.0  # s, usual time between the rows of a person


class Epoch(NamedTuple):
    """The moment of second 0."""

    nanoseconds: int  # since 1970
    is_universal: bool  # False: local time, whose offset from UTC is unknown

    def later(self, seconds: float) -> "Epoch":
        """Returns the clock whose second 0 is later by the given seconds."""
        return self._replace(nanoseconds=self.nanoseconds + round(seconds * _NANO))

    def __str__(self) -> str:
        moment = _EPOCH + timedelta(microseconds=self.nanoseconds // 1000)
        return moment.isoformat(sep=" ").split("+")[0] + " UTC" * self.is_universal


# Seconds of rows [n], and their clock; None: the file's own clock, which has no date.
Times = tuple[FloatArray, Epoch | None]


def since_first(nanoseconds: Sequence[int], is_universal: bool) -> Times:
    """Returns the times of moments, in ns since 1970, counted from the first of them."""
    moments = np.array(nanoseconds, dtype=np.int64)
    first = int(moments.min())
    return (moments - first) / _NANO, Epoch(first, is_universal)


def is_date(text: str) -> bool:
    """Returns True if a field is a date with a time."""
    return _DATE.match(text) is not None or _DIGITS.fullmatch(text) is not None


def moment_of(text: str) -> datetime:
    """Returns the moment that a date with a time describes.

    Raises
    ------
    ValueError
        If it is not a date with a time; a date alone would mean midnight.
    """
    if not is_date(text):
        raise ValueError(text)
    if found := _DIGITS.fullmatch(text):
        date, time, fraction, milliseconds = found.groups()
        text = f"{date}T{time}.{fraction or milliseconds or 0}"
    return datetime.fromisoformat(text)


def is_clock(text: str) -> bool:
    """Returns True if a field is hours, minutes and seconds, without a date."""
    return _CLOCK.fullmatch(text) is not None


def times_of_clock(rows: Iterable[tuple[int, str]]) -> FloatArray:
    """Returns the seconds [n] of times of day, each given with its line number.

    Raises
    ------
    ProblemError
        If one is not hours, minutes and seconds, or they may pass midnight.
    """
    seconds: list[float] = []
    for line, text in rows:
        found = _CLOCK.fullmatch(text)
        if found is None:
            raise ProblemError(
                f"line {line}, time: must be {A_CLOCK}, as in the first row, not {text[:40]!r}"
            )
        hours, minutes, rest = found.groups()
        seconds.append(3600 * int(hours) + 60 * int(minutes) + float(rest.replace(",", ".")))
    if max(seconds) - min(seconds) > _HALF_A_DAY:
        raise ProblemError(
            "time: must be within 12 hours; if the times of day pass midnight, write dates with "
            "them"
        )
    return np.array(seconds)


def require_no_clock_set_back(
    ids: IntArray | NDArray[np.str_], times: FloatArray, where: Callable[[int], str]
) -> None:
    """Raises a ProblemError if the clock of rows in order of time goes back once, by far.

    That is so at the end of summer time, and where 12:59 is followed by 01:00. Rows that are not
    in order go back more often.
    """
    order = np.argsort(ids, kind="stable")
    same = ids[order][1:] == ids[order][:-1]
    steps = np.diff(times[order])
    back = np.flatnonzero(same & (steps < 0))
    people = len(np.unique(ids[order][1:][back]))
    if not len(back) or len(back) > people or (steps[back] > -_SET_BACK).any():
        return
    if len(back) > _FEW_TIMES * np.count_nonzero(same):
        return
    row = int(order[back[0] + 1])
    raise ProblemError(
        f"{where(row)}, time: must not be {-steps[back[0]]:.6g} s before the row above of the same "
        "person: at the end of summer time write dates with an offset from UTC, such as "
        "2026-10-25T02:00:00+01:00; write hours of 0 to 23"
    )


def times_of_dates(rows: Iterable[tuple[int, str]]) -> Times:
    """Returns the times of dates, each given with its line number.

    Raises
    ------
    ProblemError
        If one is not a date, or if some but not all have an offset from UTC.
    """
    moments: list[int] = []
    zoned: bool | None = None
    for line, text in rows:
        try:
            found = moment_of(text)
            moments.append(nanoseconds_of(found))
        except ValueError:
            raise ProblemError(
                f"line {line}, time: must be {A_DATE}, as in the first row, not {text[:40]!r}"
            ) from None
        if zoned is None:
            zoned = found.tzinfo is not None
        elif zoned != (found.tzinfo is not None):
            raise ProblemError(
                f"line {line}, time: must have an offset such as Z or +02:00 in all rows, or in "
                f"none, unlike {text[:40]!r}"
            )
    return since_first(moments, bool(zoned))


def nanoseconds_of(moment: datetime) -> int:
    """Returns the whole nanoseconds since 1970; a moment without an offset counts as UTC.

    Raises
    ------
    ValueError
        If the year is out of range.
    """
    if not _YEARS[0] <= moment.year <= _YEARS[1]:
        raise ValueError("an implausible year")
    aware = moment if moment.tzinfo else moment.replace(tzinfo=UTC)
    return (aware - _EPOCH) // timedelta(microseconds=1) * 1000


def times_of_numbers(
    values: FloatArray,
    ids: FloatArray | None,
    unit: str | None,
    texts: Callable[[], Iterable[tuple[int, str]]],
) -> Times:
    """Returns the times of numbers.

    Parameters
    ----------
    values : [n] as in the file
    ids : [n] ids of people, for guessing a unit in messages; None if the ids are words
    unit : a key of `PER_SECOND`; None if unspecified: seconds
    texts : returns line numbers and fields as text, without loss of digits

    Raises
    ------
    ProblemError
        If the seconds are implausible for any clock; the message names the likely unit.
    """
    per_second = PER_SECOND[unit or "s"]
    if not len(values) or not np.isfinite(values).all():
        return values / per_second, None  # rejected later, with the line
    seconds = values / per_second
    if np.abs(seconds).max() > _MOST:
        raise ProblemError(_too_late(values, ids, unit))
    if not _DATES[0] <= seconds.min() <= seconds.max() <= _DATES[1]:
        return seconds, None
    scale = _NANO // per_second
    return since_first([round(Decimal(text) * scale) for _, text in texts()], True)


def likely_unit(apart: float) -> str | None:
    """Names the unit that makes this time between rows of a person plausible; None without any."""
    for unit, per_second in PER_SECOND.items():
        if _LIKELY[0] <= apart / per_second <= _LIKELY[1]:
            return unit
    return None


def _too_late(values: FloatArray, ids: FloatArray | None, unit: str | None) -> str:
    """Explains which unit implausibly late times may have instead of seconds."""
    value = float(values[np.argmax(np.abs(values))])
    words = f"time: {value:.16g} {unit or 's'} is not a plausible time"
    likely = [
        other
        for other, per_second in PER_SECOND.items()
        if _DATES[0] <= value / per_second <= _DATES[1]
    ]
    if ids is not None and (apart := _apart(values, ids)):
        by_rows = likely_unit(apart)
        likely = likely if not by_rows or by_rows in likely else [by_rows]
    if not likely:
        return f"{words}; set time_unit in [[tracks]] to one of {', '.join(PER_SECOND)}"
    since = value / PER_SECOND[likely[0]]
    date = (
        f"as {likely[0]} since 1970 it is {_EPOCH + timedelta(seconds=since):%Y-%m-%d}"
        if _DATES[0] <= since <= _DATES[1]
        else f"in {likely[0]} the rows of a person are as far apart as in usual tracks"
    )
    way_out = (
        f'if so, set time_unit = "{likely[0]}" in [[tracks]]'
        if unit is None
        else f"is the unit {unit} right?"
    )
    return f"{words}; {date}; {way_out}"


def _apart(values: FloatArray, ids: FloatArray) -> float:
    """Returns the median time between consecutive rows of a person; 0 if no person has two rows."""
    order = np.lexsort((values, ids))
    ways = np.diff(values[order])[np.diff(ids[order]) == 0]
    return float(np.median(ways)) if len(ways) else 0.0
