"""Tables of times and places, with latitudes and longitudes."""

from collections.abc import Iterator

import numpy as np

from cocap_opt.data import FieldError, FloatArray
from cocap_opt.flight.flights import Flight
from cocap_opt.missions.sheet.heights import Heights
from cocap_opt.missions.sheet.pages import Section, Table

_OVER = {"above_ground": "ground", "above_takeoff": "take-off", "above_home": "home"}
_MOST_ROWS = 10_000


def degree_heads(flight: Flight) -> tuple[str, ...]:
    """Returns the heads of the columns filled by `degrees`."""
    return () if flight.geodesy is None else ("latitude", "longitude")


def degrees(flight: Flight, x: float, y: float, digits: int = 7) -> tuple[str, ...]:
    """Returns latitude and longitude of a point (m); empty if the scene's position on the Earth is
    unknown.
    """
    if flight.geodesy is None:
        return ()
    latitude, longitude = flight.geodesy.degrees(np.array([x]), np.array([y]))
    return f"{latitude[0]:.{digits}f}", f"{longitude[0]:.{digits}f}"


def _columns(flight: Flight, every: float) -> dict[str, FloatArray]:
    """Returns the flights at the times of the tables."""
    rows = flight.flown.seconds / every * len(flight.flown.pieces)
    if rows > _MOST_ROWS:
        raise FieldError("every", f"must make at most {_MOST_ROWS} rows on paper, not {rows:.3g}")
    return flight.columns(every)


def places(flight: Flight, every: float) -> Iterator[Section]:
    """Yields a table of times and places for each drone."""
    columns = _columns(flight, every)
    over = [name for name in _OVER if name in columns][:1]
    heights = Heights.of(flight)
    yaw = columns["yaw"] % 360
    if flight.geodesy is not None:
        yaw = flight.geodesy.compass(columns["x"], columns["y"], np.radians(yaw))
    heads = ("t (s)", "x (m)", "y (m)", heights.head, *(f"m above\n{_OVER[name]}" for name in over),
             "yaw" if flight.geodesy is None else "compass", "pitch",
             *degree_heads(flight))  # fmt: skip
    for drone in range(len(flight.flown.pieces)):
        rows = []
        for k in np.flatnonzero(columns["drone"] == drone).tolist():
            x, y = float(columns["x"][k]), float(columns["y"][k])
            rows.append((
                f"{columns['t'][k]:.2f}", f"{x:.2f}", f"{y:.2f}",
                f"{heights.above_datum(float(columns['z'][k])):.2f}",
                *(f"{columns[name][k]:.2f}" for name in over), f"{yaw[k] % 360:.1f}",
                f"{columns['pitch'][k]:.1f}", *degrees(flight, x, y),
            ))  # fmt: skip
        yield Section(f"Places of drone {drone}",
                      [Table(heads, rows, frozenset(range(len(heads))))])  # fmt: skip


def walks(flight: Flight, every: float) -> Iterator[Section]:
    """Yields a table of times and places for each person."""
    problem, columns = flight.flown.problem, _columns(flight, every)
    times = columns["t"][columns["drone"] == 0]
    steps = np.arange(problem.horizon + 1) * flight.flown.step
    heads = ("t (s)", "x (m)", "y (m)", *degree_heads(flight))
    for j, actor in enumerate(problem.actors):
        walk = [np.interp(times, steps, axis) for axis in actor.poses[: len(steps), :2].T]
        rows = [
            (f"{t:.2f}", f"{x:.2f}", f"{y:.2f}", *degrees(flight, x, y))
            for t, x, y in zip(times.tolist(), *(axis.tolist() for axis in walk), strict=True)
        ]
        yield Section(f"Places of {problem.person(j)}",
                      [Table(heads, rows, frozenset(range(len(heads))))])  # fmt: skip
