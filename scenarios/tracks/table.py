"""Tables of tracked people, in seconds and metres: the result of each format's reader.

A row is a person at a moment.
"""

import math
from collections.abc import Callable, Collection, Sequence
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from cocap_opt.data import LARGEST, FloatArray, IntArray, ProblemError
from cocap_opt.scenarios.tables import PER_METRE, PER_SECOND
from cocap_opt.scenarios.tracks.times import Epoch
from cocap_opt.text import plain

Values = dict[str, FloatArray]  # role -> [n]; ids that are words are stored separately
DELIMITERS = (" ", "\t", ",", ";")
MOST_FPS = 1e6
MOST = 1e12  # largest id, frame and time
_MOST = {"x": LARGEST, "y": LARGEST, "z": LARGEST, "latitude": 90.0, "longitude": 180.0}

T = TypeVar("T", str, float)


class Form(NamedTuple):
    """The form of a file as stated by the caller; None: as stated in the file."""

    columns: Sequence[str] | None = None
    unit: str | None = None
    fps: float | None = None
    delimiter: str | None = None
    time_unit: str | None = None

    def require_allowed(self) -> None:
        """Raises a ProblemError if a field has a value that is not allowed."""
        if self.unit is not None and self.unit not in PER_METRE:
            raise ProblemError(f"unit: must be {', '.join(PER_METRE)}, not {self.unit!r}")
        if self.time_unit is not None and self.time_unit not in PER_SECOND:
            raise ProblemError(
                f"time_unit: must be {', '.join(PER_SECOND)}, not {self.time_unit!r}"
            )
        if self.fps is not None:
            _check_rate(self.fps)
        if self.delimiter is not None and self.delimiter not in DELIMITERS:
            allowed = "a blank, a tabulator, a comma or a semicolon"
            raise ProblemError(f"delimiter: must be {allowed}, not {self.delimiter!r}")

    def require_left_out(self, what: str, *fields: str) -> None:
        """Raises a ProblemError if a field is given that does not apply to a kind of file."""
        for field in fields:
            if getattr(self, field) is not None:
                raise ProblemError(f"{field}: must be left out for {what}")


class TrackTable(NamedTuple):
    """The rows of a file, in its order."""

    ids: IntArray | NDArray[np.str_]  # [n]
    times: FloatArray  # [n] s
    points: FloatArray  # [n, 2] m
    heights: FloatArray | None  # [n] m, the column z
    # describes the place of a row, such as "line 7"; slow, for messages only
    where: Callable[[int], str]
    unit: str  # unit of the file
    rate: float | None  # frames/s; None: the file has times
    clock: Epoch | None = None  # if times are dates
    segments: IntArray | None = None  # [n] numbers of parts between which nothing was recorded
    stamps: FloatArray | None = None  # [n] s, the column of times if frames are used instead

    @classmethod
    def of(
        cls,
        values: Values,
        words: NDArray[np.str_] | None,
        where: Callable[[int], str],
        unit: str,
        rate: float | None,
    ) -> "TrackTable":
        """Returns the table of columns by role.

        Parameters
        ----------
        values : as in the file, but times in seconds
        words : ids that are words; None: ids are numbers
        where : describes the place of a row
        unit : of x, y and z, a key of `PER_METRE`
        rate : frames per second; None: there are times

        Raises
        ------
        ProblemError
            If a number is out of range, or an id or a frame is not whole.
        """
        per_metre = PER_METRE[unit]
        return cls(
            ids=values["id"].astype(np.int64) if words is None else words,
            times=values["time"] if rate is None else values["frame"] / rate,
            points=np.column_stack([values["x"], values["y"]]) / per_metre,
            heights=values["z"] / per_metre if "z" in values else None,
            where=where,
            unit=unit,
            rate=rate,
        )

    def part(self, rows: IntArray) -> "TrackTable":
        """Returns the table of some rows, given by their numbers."""
        columns = {
            name: column[rows]
            for name in ("ids", "times", "points", "heights", "segments", "stamps")
            if (column := getattr(self, name)) is not None
        }
        return self._replace(**columns, where=lambda row: self.where(int(rows[row])))


# What to write if a file does not state a field.
_EXAMPLES = {
    "unit": f'unit = "m" (or {", ".join(list(PER_METRE)[1:])})',
    "time_unit": f'time_unit = "s" (or {", ".join(list(PER_SECOND)[1:])})',
    "fps": "fps = 25 (its frames per second)",
}


_IN_DEGREES = "; write decimal degrees, not minutes or parts of 1e7"
_ADVICE = {
    "frame": "; is it a time? Name it time in columns",
    "id": "; with a letter in front, it is read as a word",
    "z": '; "-" in its place in columns of [[tracks]] leaves z out',
    "latitude": _IN_DEGREES,
    "longitude": _IN_DEGREES,
}


def require_numbers(values: Values, where: Callable[[int], str]) -> None:
    """Raises a ProblemError unless numbers are finite and in range, and ids and frames whole."""
    for role, column in values.items():
        most = _MOST.get(role, MOST)
        whole = role in ("id", "frame")
        wrong = ~(np.abs(column) <= most)  # true for nan, too
        if whole:
            wrong |= column != np.floor(column)
        if wrong.any():
            row = int(np.argmax(wrong))
            kind = "a whole number" if whole else "a number"
            raise ProblemError(
                f"{where(row)}, {role}: must be {kind} within +-{plain(most)}, not {column[row]:g}"
                + _ADVICE.get(role, "")
            )


def settled(field: str, stated: set[T], given: T | None) -> T:
    """Returns the value that the file or the caller states; if both do, they must agree."""
    if len(stated) > 1:
        both = " and ".join(sorted(f"{value}" for value in stated))
        raise ProblemError(f"{field}: must be one, but the file states {both}")
    for value in stated:
        if given not in (None, value):
            raise ProblemError(f"{field}: must be {value}, as the file states, not {given}")
        return value
    if given is None:
        words = f"must be given, as the file does not state it: write {_EXAMPLES[field]}"
        raise ProblemError(f"{field}: {words} in [[tracks]]")
    return given


def settled_rate(stated: set[float], fps: float | None, mentioned: Collection[float] = ()) -> float:
    """Returns the frames per second that the file or the caller states.

    Comments may mention others besides, such as that of the video; then the caller must choose.
    """
    rates = stated | {*mentioned}
    if fps is not None:  # 29.97 is 29.97003
        fps = next((rate for rate in rates if math.isclose(fps, rate, rel_tol=1e-5)), float(fps))
    if len(stated) < len(rates) > 1 and len(stated) < 2:
        if fps is None:
            told = " and ".join(f"{rate:g}" for rate in sorted(rates))
            raise ProblemError(
                f"fps: must be given in [[tracks]], the rate of the rows, as comments state {told}"
            )
        stated = {fps} & rates or stated
    rate = settled("fps", stated, fps)
    _check_rate(rate)
    return rate


def _check_rate(fps: float) -> None:
    """Raises a ProblemError if a frame rate is out of range."""
    if not 0 < fps <= MOST_FPS:  # false for nan, too
        raise ProblemError(f"fps: must be > 0 and at most {MOST_FPS:g} frames/s, not {fps:g}")
