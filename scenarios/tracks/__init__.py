"""Recorded tracks of people as actors: tracks from files, their points at the steps, and headings.

Source of the formats: text files of PeTrack and JuPedSim (ped.fz-juelich.de), whose columns are id,
frame, x, y, z with z the height of the head above the floor, CSV files like them, the databases of
JuPedSim, and GPX. A track is the path of one person:

    tracks = Track.read_all(Path("walk.txt"), unit="cm", fps=16)
    there = [track for track in tracks if track.is_there(begin=5.0, step=0.5, steps=20)]
    actors = [track.actor(5.0, 0.5, 20) for track in there]

People are present from their first frame to their last. Between frames, they walk straight. In a
gap of more than `MOST_GAP`, their position is unknown, and at steps inside it they are not present.
GPS receivers leave out points on straight paths and begin a new segment after losing their
satellites, so the longer `MOST_GAP_GPX` applies to gaps within a segment of GPX. A step at the time
of a frame has the point of that frame.
"""

import logging
import math
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from cocap_opt.arithmetic import angles_of
from cocap_opt.data import LARGEST, MOST_STEPS, BoolArray, FloatArray, IntArray, ProblemError
from cocap_opt.problem import Actor, Prism, Shape
from cocap_opt.scenarios.earth.place import NOWHERE, MapProjection
from cocap_opt.scenarios.kinds import GPX, SQLITE, Kind, kind_of
from cocap_opt.scenarios.tables import TimeUnit, Unit
from cocap_opt.scenarios.text import naming
from cocap_opt.scenarios.tracks.database import read_database
from cocap_opt.scenarios.tracks.gpx import read_gpx
from cocap_opt.scenarios.tracks.table import Form, TrackTable
from cocap_opt.scenarios.tracks.text import read_text_table
from cocap_opt.scenarios.tracks.times import Epoch
from cocap_opt.scenarios.tracks.warnings import HEIGHTS, track_warnings
from cocap_opt.text import plain

log = logging.getLogger(__name__)

BODY = Prism(sides=6, apothem=0.25, height=1.75)  # m, as wide as shoulders
STILL = 0.1  # m/s, below which people keep their heading
MOST_GAP = 1.0  # s, between frames
MOST_GAP_GPX = 10.0  # s, between points of a segment
LEAST_HEIGHT = HEIGHTS[0]  # m, of a head; a lower z is the height of the floor or of a box
_NANO = 10**9
SLACK = 1e-6  # s, by which rounding may change times


READERS: dict[Kind | str, Callable[[Path, Form, MapProjection], TrackTable]] = {
    # Recognised by the first bytes or else by the ending of the name; all other files are text.
    SQLITE: read_database,
    GPX: read_gpx,
}


class Track(NamedTuple):
    """The path of one person. Arrays are read-only."""

    id: int | str  # as in the file
    times: FloatArray  # [n] s, increasing
    points: FloatArray  # [n, 2] m, x and y
    height: float | None  # m, of the head above the floor; None if the file has none
    gaps: BoolArray | None = None  # [n-1] where the path is unknown; None: by `MOST_GAP`
    # the date of 0 s; None: the file's own clock, without dates
    clock: Epoch | None = None

    @classmethod
    def read_all(
        cls,
        path: Path,
        *,
        columns: Sequence[str] | None = None,
        unit: Unit | None = None,
        fps: float | None = None,
        delimiter: str | None = None,
        time_unit: TimeUnit | None = None,
        gap: float | None = None,
        projection: MapProjection = NOWHERE,
    ) -> list["Track"]:
        """Reads the tracks of a file, in the order of their ids; rows may have any order.

        Signs of a wrong unit or frame rate are logged as warnings. A track's height is the median
        of its z, and None if that is below `LEAST_HEIGHT`, as in files whose z is the height of the
        floor.

        Parameters
        ----------
        path
            A text file, a database or GPX; `cocap_opt.scenarios.tracks.text` describes the lines of
            text.
        columns
            Names of all its columns: id, frame or time, x, y and, if present, z; others are not
            read. None: the names in its header or in a comment, or else id, frame, x, y, z.
        unit
            Unit of x, y and z. None: as the file states.
        fps
            Frames per second. None: as the file states; not needed for files with times.
        delimiter
            " " (any blanks), tabulator, "," or ";". None: as in the first row.
        time_unit
            Unit of times. None: as the file states, else seconds; dates have none.
        gap
            Longest time, s, between rows of a person in which the path counts as straight. None:
            `MOST_GAP`, or `MOST_GAP_GPX` within a segment of GPX.
        projection
            Converts latitudes and longitudes to metres, in GPX and in columns with such names.

        Raises
        ------
        ProblemError
            If the file cannot be read or contains something that is not allowed, if the unit or the
            frame rate is neither stated nor given, or stated differently, or if a person has two
            rows for one moment; one line that names the file.
        """
        with naming(path):
            form = Form(columns, unit, fps, delimiter, time_unit)
            form.require_allowed()
            kind = kind_of(path)
            read = READERS.get(kind) if kind else None
            reader = read or READERS.get(path.suffix.lower(), read_text_table)
            table = _without_repeats(reader(path, form, projection))
            tracks = _tracks(table, gap)
        for warning in track_warnings(table):
            log.warning("%s: %s", path, warning)
        longest = max(track.longest() for track in tracks)
        if gap is None and longest > MOST_GAP + SLACK:
            log.warning(
                "%s: points are up to %.3g s apart, and people are assumed to walk straight from "
                "one to the next; if they are absent in between, set gap = 1 in [[tracks]]",
                path, longest,
            )  # fmt: skip
        return tracks

    def is_there(self, begin: float, step: float, steps: int) -> bool:
        """Returns True if the person is present at all steps, so that `at_steps` works.

        Raises
        ------
        ProblemError
            If a parameter is out of range.
        """
        return not self._absent(_times(begin, step, steps)).any()

    def at_steps(self, begin: float, step: float, steps: int) -> FloatArray:
        """Returns the points [T+1, 2] (m) at the times begin + t step, linear between frames.

        Parameters
        ----------
        begin
            Time of step 0, s.
        step
            Time between steps, s.
        steps
            Number of steps T.

        Raises
        ------
        ProblemError
            If the person is not present at a step, or a parameter is out of range.
        """
        times = _times(begin, step, steps)
        absent = self._absent(times)
        if absent.any():
            t = int(np.argmax(absent))
            raise ProblemError(
                f"track {self.id}: must be present at step {t} ({times[t]:.12g} s), but is present "
                f"{self.presence()}"
            )
        return np.column_stack([np.interp(times, self.times, axis) for axis in self.points.T])

    def swerve(self, begin: float, step: float, steps: int) -> tuple[float, float]:
        """Returns the largest distance (m) from the straight walk between steps, and its time (s).

        Parameters
        ----------
        begin, step, steps
            As in `at_steps`.

        Raises
        ------
        ProblemError
            If the person is not present at a step, or a parameter is out of range.
        """
        walk = self.at_steps(begin, step, steps)
        return off_walk(_times(begin, step, steps), walk, self.times, self.points)

    def actor(
        self,
        begin: float,
        step: float,
        steps: int,
        *,
        shape: Shape = BODY,
        still: float = STILL,
        ground: Callable[[float, float], float] = lambda x, y: 0.0,
    ) -> Actor:
        """Returns the actor that walks along the track and looks in the direction of its movement.

        Parameters
        ----------
        begin, step, steps
            As in `at_steps`.
        shape
            The actor's body; if the track has a height, this replaces the height of the shape.
        still
            Speed (m/s) below which the actor keeps its heading, see `headings`.
        ground
            Height (m) of the floor at (x, y).

        Raises
        ------
        ProblemError
            If the person is not present at a step, or a parameter is out of range.
        """
        points = self.at_steps(begin, step, steps)
        floor = [ground(x, y) for x, y in points.tolist()]
        return Actor(
            poses=np.column_stack([points, floor, Track.headings(points, still * step)]),
            shape=shape if self.height is None else shape.replace(height=self.height),
            name=self.id if isinstance(self.id, str) else f"id {self.id}",
            begin=begin,
            swerve=swerve_of(self.swerve(begin, step, steps)[0]),
        )

    @staticmethod
    def headings(points: FloatArray, still: float) -> FloatArray:
        """Returns the yaw [T+1] of a person at the points [T+1, 2] (m), one at each step.

        It is in rad, from +x, counter-clockwise, in (-pi, pi]: the direction from the point of the
        previous step to that of the next one. At the ends, the point of the step itself replaces
        the missing one. A person who moves by less than `still` metres a step keeps the heading of
        the last step with a move. Before the first move, the heading is that of the first move; if
        there is no move, it is 0.

        Raises
        ------
        ProblemError
            If `still` is not >= 0.
        """
        if not still >= 0:  # true for nan, too
            raise ProblemError(f"still: must be >= 0 m, not {still:g}")
        if len(points) < 2:
            return np.zeros(len(points))
        motion = np.gradient(points, axis=0)  # m per step
        length = np.hypot(*motion.T)
        moving = np.flatnonzero((length >= still) & (length > 0))
        if not len(moving):
            return np.zeros(len(points))
        last = np.searchsorted(moving, np.arange(len(points)), side="right") - 1
        dx, dy = motion[moving[np.maximum(last, 0)]].T
        yaw = angles_of(dy, dx)
        return np.where(yaw <= -math.pi, math.pi, yaw)

    def spans(self) -> list[tuple[float, float]]:
        """Returns the periods (s) in which the person is present, as pairs of begin and end."""
        gaps = np.flatnonzero(self.lost())
        begins, ends = self.times[[0, *(gaps + 1)]], self.times[[*gaps, -1]]
        return list(zip(begins.tolist(), ends.tolist(), strict=True))

    def lost(self) -> BoolArray:
        """Returns an array [n-1] that is true where the path to the next point is unknown."""
        if self.gaps is not None:
            return self.gaps
        return np.asarray(np.diff(self.times) > MOST_GAP + SLACK)

    def longest(self) -> float:
        """Returns the longest time (s) between consecutive points of the known path; 0 without
        any.
        """
        return float(np.diff(self.times)[~self.lost()].max(initial=0.0))

    def presence(self) -> str:
        """Describes the periods in which the person is present."""
        spans = [f"from {a:.12g} to {b:.12g} s" for a, b in self.spans()]
        return " and ".join(
            spans if len(spans) < 5 else [*spans[:3], f"at {len(spans) - 3} more times"]
        )

    def _absent(self, times: FloatArray) -> BoolArray:
        """Returns an array that is true at the times at which the person's position is unknown."""
        after = np.searchsorted(self.times, times).clip(0, len(self.times) - 1)
        before = np.maximum(after - 1, 0)
        last, following = self.times[before], self.times[after]
        gap = np.append(self.lost(), False)[before] & (before < after)
        lost = gap & (times > last + SLACK) & (times < following - SLACK)
        outside = (times < self.times[0] - SLACK) | (times > self.times[-1] + SLACK)
        return np.asarray(lost | outside)


def off_walk(
    times: FloatArray, walk: FloatArray, frames: FloatArray, points: FloatArray
) -> tuple[float, float]:
    """Returns the largest distance (m) of a path from a walk that meets it at the steps, and its
    time (s).

    Both are straight between their points, so the distance is largest at a frame of the path.

    Parameters
    ----------
    times, walk : times [T+1] (s) of the steps, and points [T+1, 2] (m) of the walk
    frames, points : times [n] (s) of the path, and its points [n, 2] (m)
    """
    within = (frames >= times[0]) & (frames <= times[-1])
    if not within.any():
        return 0.0, float(times[0])
    frames = frames[within]
    straight = np.column_stack([np.interp(frames, times, axis) for axis in walk.T])
    away = np.hypot(*(points[within] - straight).T)
    k = int(np.argmax(away))
    return float(away[k]), float(frames[k])


def swerve_of(away: float) -> float:
    """Returns a distance (m) in whole millimetres, rounded up unless it is rounding itself."""
    return max(math.ceil(away * 1e3 - 1e-3), 0) / 1e3


def _tracks(table: TrackTable, gap: float | None) -> list[Track]:
    ids, person = np.unique(table.ids, return_inverse=True)
    order = np.lexsort((table.times, person))
    _require_distinct(table, order)
    parts = np.split(order, np.flatnonzero(np.diff(person[order])) + 1)
    return [_track(table, name, rows, gap) for name, rows in zip(ids.tolist(), parts, strict=True)]


def _without_repeats(table: TrackTable) -> TrackTable:
    """Returns the table without rows that repeat an earlier one, as in logs and joined tables."""
    persons = np.unique(table.ids, return_inverse=True)[1]
    order = np.lexsort((table.times, persons))
    heights = () if table.heights is None else (table.heights,)
    rows = np.column_stack([persons, table.times, table.points, *heights])[order]
    repeats = np.append(False, (rows[1:] == rows[:-1]).all(axis=1))
    return table.part(np.sort(order[~repeats])) if repeats.any() else table


def _require_distinct(table: TrackTable, order: IntArray) -> None:
    ids, times = table.ids[order], table.times[order]
    same = (ids[1:] == ids[:-1]) & (times[1:] == times[:-1])
    if same.any():
        k = int(np.argmax(same))
        raise ProblemError(
            f"{table.where(int(order[k + 1]))}: must not be a second row for id {ids[k]} at "
            f"{times[k]:.12g} s; the first is {table.where(int(order[k]))}"
        )


def _track(table: TrackTable, name: int | str, rows: IntArray, gap: float | None) -> Track:
    times, points = table.times[rows], table.points[rows]
    times.setflags(write=False)
    points.setflags(write=False)
    height = 0.0 if table.heights is None else float(np.median(table.heights[rows]))
    known = height if height >= LEAST_HEIGHT else None
    return Track(name, times, points, known, _gaps(table, rows, gap), table.clock)


def _gaps(table: TrackTable, rows: IntArray, gap: float | None) -> BoolArray:
    """Returns an array [n-1] that is true where the path to the next row is unknown."""
    ways = np.diff(table.times[rows])
    if table.segments is None:
        return np.asarray(ways > (MOST_GAP if gap is None else gap) + SLACK)
    within = np.diff(table.segments[rows]) == 0
    most = np.where(within, MOST_GAP_GPX if gap is None else gap, MOST_GAP)
    return np.asarray(ways > most + SLACK)


def _times(begin: float, step: float, steps: int) -> FloatArray:
    """Returns the times [T+1] of the steps, s."""
    if not 1 <= steps <= MOST_STEPS:
        raise ProblemError(f"steps: must be 1..{MOST_STEPS}, not {steps}")
    if not 0 < step <= LARGEST:  # false for nan, too
        raise ProblemError(f"step: must be > 0 s and at most {plain(LARGEST)} s, not {step:g}")
    if not math.isfinite(begin):
        raise ProblemError(f"begin: must be a number, not {begin:g}")
    return begin + step * np.arange(steps + 1, dtype=np.float64)


# -- several files, usually each with the path that one person recorded


def on_one_clock(files: dict[str, list[Track]]) -> list[Track]:
    """Returns the tracks of all files, with times that count from the same moment.

    Dates count from the earliest date in all files; files without dates keep their times. If two
    files use the same id and each file has one person, the people get the names of their files.

    Parameters
    ----------
    files : tracks by the name of their file

    Raises
    ------
    ProblemError
        If some files have dates and others have none, or only some have an offset from UTC; or if
        an id is in two files that have several people. One line.
    """
    clocks = {name: tracks[0].clock for name, tracks in files.items()}
    _require_comparable(clocks)
    first = min((clock.nanoseconds for clock in clocks.values() if clock), default=0)
    _require_names(files)
    count = Counter(track.id for tracks in files.values() for track in tracks)
    shared = []
    for name, tracks in files.items():
        for track in tracks:
            who = track.id if count[track.id] == 1 else Path(name).stem
            shared.append(_shifted(track, first)._replace(id=who))
    return shared


def _shifted(track: Track, first: int) -> Track:
    """Returns a track whose dates, if it has any, count from a moment in ns since 1970."""
    if track.clock is None:
        return track
    times = track.times + (track.clock.nanoseconds - first) / _NANO
    times.setflags(write=False)
    return track._replace(times=times, clock=track.clock._replace(nanoseconds=first))


def _require_comparable(clocks: dict[str, Epoch | None]) -> None:
    kinds: dict[str, str] = {}
    for name, clock in clocks.items():
        kind = "numbers" if clock is None else "dates"
        if clock is not None and not clock.is_universal:
            kind = "dates without an offset"
        kinds.setdefault(kind, name)
    if len(kinds) > 1:
        said = " and ".join(f"{name} has {kind}" for kind, name in kinds.items())
        raise ProblemError(
            f"file: all files must use one clock, but {said}; times must all be numbers, or all "
            "dates with an offset such as Z, or all dates without an offset"
        )


def _require_names(files: dict[str, list[Track]]) -> None:
    """Raises a ProblemError if neither ids nor files distinguish the people of several files."""
    where: dict[int | str, str] = {}
    for name, tracks in files.items():
        for track in tracks:
            other = where.setdefault(track.id, name)
            if other == name:
                continue
            alone = len(tracks) == len(files[other]) == 1
            if not alone or Path(name).stem == Path(other).stem:
                raise ProblemError(
                    f"file: {track.id!r} must not be in two files, {other} and {name}; give people "
                    "different ids"
                )
