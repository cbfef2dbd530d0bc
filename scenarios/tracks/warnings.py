"""Signs that a file of tracks is misread: a wrong unit, frame rate or id, or z pointing down.

These are only warnings: people may run fast, and an unusual file may be right.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from cocap_opt.data import BoolArray, FloatArray, IntArray
from cocap_opt.scenarios.tables import PER_METRE
from cocap_opt.scenarios.tracks.table import TrackTable
from cocap_opt.text import distance, pair

# Values outside these ranges suggest a wrong unit or frame rate.
HEIGHTS = 0.4, 2.6  # m
SPEEDS = 0.2, 10.0  # m/s
EXTENTS = 0.5, 1e5  # m, of all points
APART = 0.2, 5.0  # m, between people and their nearest neighbours

_FASTEST = 12.0  # m/s, of people between two rows
_BLUR = 1.0  # m, possible error of a position
_FEW = 0.1  # share of all moves; if more are too fast, the cause is not a few wrong rows
_CLOCKS = 0.01  # relative difference that the clocks of frames and of times may have
_LOW = 1.3  # m; adults are taller
_WAY, _BOB = 1.0, 0.3  # m, way of a person on the ground, and up and down of a head
_COUNTDOWN = 3  # fewest moves that suggest a clock that counts down
_MOMENTS = 20  # evenly spread moments at which distances between people are measured
_MOST = 500  # people per moment whose distances are measured


class _Moves(NamedTuple):
    """The moves between consecutive rows of one person, person by person."""

    rows: IntArray  # [n] rows at which the moves end
    ways: FloatArray  # [n] m, lengths of the moves
    seconds: FloatArray  # [n]
    persons: IntArray  # [n] numbers of people

    @classmethod
    def of(cls, table: TrackTable) -> "_Moves":
        persons = np.unique(table.ids, return_inverse=True)[1]
        order = np.lexsort((table.times, persons))
        same = np.flatnonzero(np.diff(persons[order]) == 0)
        steps = np.diff(table.points[order], axis=0)[same]
        return cls(
            rows=order[same + 1],
            ways=np.hypot(steps[:, 0], steps[:, 1]),
            seconds=np.diff(table.times[order])[same],
            persons=persons[order][same],
        )

    def speed(self) -> float:
        """Returns the median over people who move of their median speed while they move, m/s."""
        moving = self.ways > 0
        if not moving.any():
            return 0.0
        speeds = (self.ways / self.seconds)[moving]
        others = np.flatnonzero(np.diff(self.persons[moving])) + 1
        return float(np.median([np.median(part) for part in np.split(speeds, others)]))


def track_warnings(table: TrackTable) -> Iterator[str]:
    """Yields the signs that a file is misread, each in words."""
    moves, heights = _Moves.of(table), _heights(table)
    jumps = np.flatnonzero(moves.ways > _FASTEST * moves.seconds + _BLUR)
    single = 0 < len(jumps) <= _FEW * len(moves.ways)
    if single:
        yield _jump(table, moves, jumps)
    elif (speed := moves.speed()) > SPEEDS[1]:
        # If the heights are plausible, the unit is right.
        known = heights[heights > 0]
        fits = len(known) > 0 and bool(_within(known, HEIGHTS).all())
        unit_of = None if fits else _likely(speed, table.unit, SPEEDS)
        clock = "are the times right" if table.rate is None else f"is fps = {table.rate:g} right"
        asked = f"is {unit_of}, or {clock}?" if unit_of else f"{clock}?"
        yield f"median speed {speed:.4g} m/s: {asked}"
    if _is_y_up(table):
        yield (
            "z varies while y stays: does y point upwards, as in Unity? Then exchange y and z in "
            "columns; if the axes are right-handed, as in OpenGL, change the sign of z, too"
        )
    else:
        yield from _about_heights(table, heights)
        yield from _about_low_heads(heights)
    yield from _about_stamps(table)
    yield from _about_countdown(table)
    if not single:
        yield from _about_room(table)


def _jump(table: TrackTable, moves: _Moves, jumps: IntArray) -> str:
    """Describes the first row at which a person is suddenly far away."""
    first = jumps[np.argmin(moves.rows[jumps])]
    row, way, seconds = int(moves.rows[first]), moves.ways[first], moves.seconds[first]
    more = f", the first of {len(jumps)} such rows" if len(jumps) > 1 else ""
    return (
        f"{table.where(row)}: id {table.ids[row]} is {distance(way)} from where it was "
        f"{seconds:.3g} s before{more}: are its id and position right?"
    )


def _heights(table: TrackTable) -> FloatArray:
    """Returns the median z of each person, m; empty if the file has none."""
    if table.heights is None:
        return np.zeros(0)
    order = np.argsort(table.ids, kind="stable")
    starts = np.flatnonzero(table.ids[order][1:] != table.ids[order][:-1]) + 1
    return np.array([np.median(part) for part in np.split(table.heights[order], starts)])


def _about_heights(table: TrackTable, heights: FloatArray) -> Iterator[str]:
    """Yields warnings about the heights of people [n], m; if all are 0, the file has no heights."""
    names = np.unique(table.ids)
    below, known = np.flatnonzero(heights < 0), np.flatnonzero(heights > 0)
    if len(below):
        yield (
            f"z is below 0 for {len(below)} of {len(heights)} people, {heights[below[0]]:.3g} m "
            f"for id {names[below[0]]}: does z point downwards? They get the height of the shape; "
            "if x points north and y east, as in PX4 and AirSim, the scene is mirrored: swap x "
            "and y in columns"
        )
    odd = known[~_within(heights[known], HEIGHTS)]
    if len(odd):
        height = float(heights[odd[0]])
        yield (
            f"the height of {len(odd)} of {len(known)} people is outside {HEIGHTS[0]:g}.."
            f"{HEIGHTS[1]:g} m, {distance(height)} for id {names[odd[0]]}: is "
            f"{_likely(height, table.unit, HEIGHTS) or 'z a height above the floor'}?"
            + (
                " People who are lower get the height of the shape"
                if (heights[odd] < HEIGHTS[0]).any()
                else ""
            )
        )


def _about_low_heads(heights: FloatArray) -> Iterator[str]:
    """Yields a warning if z is plausible for a tag on the body or for its middle, not for heads."""
    known = heights[heights >= HEIGHTS[0]]
    if len(known) and np.median(known) < _LOW:
        yield (
            f"by z, people are {np.median(known):.3g} m tall (median): is it the height of a tag "
            "or of the middle of the body? Then leave z out of columns"
        )


def _is_y_up(table: TrackTable) -> bool:
    """Returns True if everybody who moves along z keeps to one y, as where y is the height."""
    if table.heights is None:
        return False
    order = np.argsort(table.ids, kind="stable")
    starts = np.flatnonzero(table.ids[order][1:] != table.ids[order][:-1]) + 1
    people = np.split(np.column_stack([table.points[:, 1], table.heights])[order], starts)
    ranges = np.array([np.ptp(rows, axis=0) for rows in people])
    moving = ranges[:, 1] > _WAY
    return bool(moving.any() and (ranges[moving, 0] < _BOB).all())


def _about_stamps(table: TrackTable) -> Iterator[str]:
    """Yields a warning if frames and times of a file disagree on its duration."""
    if table.stamps is None or table.rate is None:
        return
    by_frames, by_times = float(np.ptp(table.times)), float(np.ptp(table.stamps))
    if abs(by_frames - by_times) > _CLOCKS * by_frames:
        yield (
            f"the column frame lasts {by_frames:.4g} s at fps = {table.rate:g}, the column time "
            f"{by_times:.4g} s: frames are used; without fps, times are"
        )


def _about_countdown(table: TrackTable) -> Iterator[str]:
    """Yields a warning if times decrease down the file, as on the clock of a game.

    Dates cannot count down: such a file merely has its latest rows first.
    """
    if table.clock is not None or table.rate is not None:
        return
    persons = np.unique(table.ids, return_inverse=True)[1]
    order = np.argsort(persons, kind="stable")
    same = np.diff(persons[order]) == 0
    steps = np.diff(table.times[order])[same]
    if len(steps) >= _COUNTDOWN and (steps < 0).all():
        yield (
            "times decrease from row to row: are they the time that is left, as on the clock of a "
            "game? Then people walk backwards here; write the time since the beginning"
        )


def _about_room(table: TrackTable) -> Iterator[str]:
    """Yields a warning if all points lie too close together, or too far apart."""
    extent = float(np.ptp(table.points, axis=0).max())
    if 0 < extent < EXTENTS[0] and _may_be_degrees(table):
        x, y = table.points[0].tolist()
        yield (
            f"all points lie within {extent:.3g} m, at {pair(x, y)}: are they degrees? "
            "If so, name the columns longitude and latitude, and add [earth] to the recipe"
        )
    elif extent > 0 and not EXTENTS[0] <= extent <= EXTENTS[1]:  # a standing person has extent 0
        yield f"all points lie within {distance(extent)}: is the unit {table.unit} right?"
    elif (apart := _apart(table)) < APART[0]:
        unit_of = _likely(apart, table.unit, APART) or f"the unit {table.unit} right"
        yield f"the median distance to the nearest person is {apart:.2g} m: is {unit_of}?"


def _may_be_degrees(table: TrackTable) -> bool:
    """Returns True if the points could be longitudes and latitudes and are not around 0."""
    x, y = np.abs(table.points * PER_METRE[table.unit]).T
    return bool(x.max() <= 180 and y.max() <= 90 and max(x.min(), y.min()) > 1)


def _apart(table: TrackTable) -> float:
    """Returns the median distance (m) from a person to the nearest other one; inf if all are alone.

    It is measured at some of the moments at which several people are present, evenly spread.
    """
    moments, counts = np.unique(table.times, return_counts=True)
    crowded = moments[counts > 1]
    chosen = crowded[np.linspace(0, len(crowded) - 1, min(_MOMENTS, len(crowded))).astype(int)]
    nearest = []
    for moment in chosen:
        points = table.points[table.times == moment][:_MOST]
        ways = points[:, None] - points[None]
        distances = np.hypot(ways[..., 0], ways[..., 1])
        np.fill_diagonal(distances, np.inf)
        nearest.append(distances.min(axis=0))
    return float(np.median(np.concatenate(nearest))) if nearest else np.inf


def _within(values: FloatArray, limits: tuple[float, float]) -> BoolArray:
    return (limits[0] <= values) & (values <= limits[1])


def _likely(value: float, unit: str, limits: tuple[float, float]) -> str | None:
    """Names the unit in which a length or speed, read in another unit, would be within limits."""
    for other, per_metre in PER_METRE.items():
        if other != unit and limits[0] <= value * PER_METRE[unit] / per_metre <= limits[1]:
            return f"the unit {other}"
    return None
