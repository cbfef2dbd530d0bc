"""Flights as a Skybrush show (.skyc), whose drones share one clock.

The file is a zip with `show.json`. It contains, for each drone, a trajectory of points [t, [x, y,
z], control points] of Bezier curves, and yaw setpoints [t, degrees] between which the yaw changes
linearly, clockwise. Readers support lines and curves of degree two and three (Skybrush Viewer no
others), so each piece of a smooth flight becomes cubic curves with the same positions and speeds at
their ends, as many as are needed for an accuracy of half a millimetre. Times are then rounded to
milliseconds, as readers do; a drone flies some millimetres in that time. Steps too short for that
are rejected.

Coordinates are local: x and y begin at the map's corner, z at the lowest take-off. The position on
the Earth is set in Skybrush Live when the show is set up.

Sources: `@skybrush/show-format` (types and player) in https://github.com/skybrush-io/skybrush.js,
`TrajectorySpecification` and `YawSetpointList` in https://github.com/skybrush-io/skybrush-server,
https://doc.collmot.com/public/skybrush-studio-for-blender/latest/concepts.html
"""

import json
import math
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from cocap_opt.data import FieldError, FloatArray
from cocap_opt.flight.bernstein import Peak, elevated, parted, squared_length
from cocap_opt.flight.flights import Flight
from cocap_opt.flight.notes import Kind, Note
from cocap_opt.flight.trajectory import DEGREE, YAW, Trajectory
from cocap_opt.missions.archive import zipped
from cocap_opt.missions.export import Export, require_nothing_else
from cocap_opt.problem import Problem

_OFF = 5e-4  # m; tolerance for cubic curves
_TURNED_OFF = np.radians(0.1)  # rad; tolerance for the yaw
_SHORTEST = 2e-3  # s; shortest curve
_DIGITS = 5


def write(flight: Flight, every: float | None) -> Export:
    """Returns a show of a flight, straight or smooth."""
    require_nothing_else(every, "a show has curves, not moments")
    problem = flight.flown.problem
    grounds = flight.flown.start_surfaces.tolist()
    local = flight.flown.pieces - np.array([0, 0, min(grounds), 0, 0])[:, None]
    curves = [_split(pieces[:, :3], _cubic, _OFF) for pieces in local]
    turns = [_split(pieces[:, YAW : YAW + 1], _line, _TURNED_OFF) for pieces in local]
    _require_seconds(max(map(len, [*curves, *turns])), flight.flown)
    drones = [
        _drone(f"drone{i}", way, yaw, float(ground) - min(grounds), flight.flown)
        for i, (way, yaw, ground) in enumerate(zip(curves, turns, grounds, strict=True))
    ]
    show = {
        "version": 1,
        "environment": {"type": "outdoor"},
        "meta": {"title": problem.name, "segments": {"show": [0, _ms(flight.flown.seconds)]}},
        "settings": _settings(problem),
        "swarm": {"drones": drones},
    }
    axes = Note(
        "x and y are measured from the map's corner, "
        f"z from the lowest take-off at {min(grounds):g} m; "
        "yaw is 0 along x and grows clockwise (degrees)",
        Kind.READING,
    )
    return Export(
        {"": zipped({"show.json": json.dumps(show, allow_nan=False)})},
        (*map(Note, _notes(flight, grounds)), axes),
    )


def _settings(problem: Problem) -> dict[str, Any]:
    separation = problem.rules.separation
    return {"validation": {"minDistance": separation}} if separation else {}


def _drone(
    name: str, curves: FloatArray, turns: FloatArray, ground: float, flown: Trajectory
) -> dict[str, Any]:
    """Returns the specification of a drone.

    Parameters
    ----------
    curves : [n, 3, 4]
    turns : [m, 1, 2] lines of its yaw
    ground : altitude of its take-off, m
    flown : the flights of all drones
    """
    home = [*_rounded(curves[0, :2, 0]), round(ground, _DIGITS)]
    trajectory = {"version": 1, "takeoffTime": 0, "points": _points(curves, flown)}
    yaw = {"version": 1, "setpoints": _setpoints(turns, flown)}
    settings = {"name": name, "home": home, "trajectory": trajectory, "yawControl": yaw}
    return {"type": "generic", "settings": settings}


def _points(curves: FloatArray, flown: Trajectory) -> list[list[Any]]:
    """Returns the points of a trajectory of curves [n, 3, 4]."""
    points: list[list[Any]] = [[0, _rounded(curves[0, :, 0]), []]]
    for k, curve in enumerate(curves):
        is_line = np.allclose(elevated(curve[:, [0, -1]], 3), curve, rtol=0, atol=1e-9)
        control = [] if is_line else [_rounded(point) for point in curve[:, 1:-1].T]
        t = (k + 1) * flown.seconds / len(curves)
        points.append([_ms(t), _rounded(curve[:, -1]), control])
    return points


def _setpoints(lines: FloatArray, flown: Trajectory) -> list[list[float]]:
    """Returns the setpoints of a yaw of lines [n, 1, 2] (rad, counter-clockwise)."""
    times = np.arange(len(lines) + 1) * (flown.seconds / len(lines))
    angles = -np.degrees([lines[0, 0, 0], *lines[:, 0, -1]])
    return [[_ms(t), round(a + 0.0, _DIGITS)] for t, a in zip(times, angles.tolist(), strict=True)]


def _split(
    pieces: FloatArray, simpler: Callable[[FloatArray], FloatArray], off: float
) -> FloatArray:
    """Returns curves [n, d, .] of a lower degree, evenly spaced, along pieces [N, d, 6]."""
    while True:
        found = simpler(pieces)
        ways = elevated(found, DEGREE) - pieces
        if Peak.of(squared_length(ways)).value <= off**2:
            return found
        pieces = np.stack(parted(pieces), axis=1).reshape(-1, *pieces.shape[1:])


def _require_seconds(curves: int, flown: Trajectory) -> None:
    """Rejects a flight for which a drone has so many curves that they are too short."""
    shortest = flown.seconds / curves
    if shortest < _SHORTEST:
        least = math.ceil(1000 * flown.step * _SHORTEST / shortest - 1e-6) / 1000
        raise FieldError(
            "step",
            f"must be at least {least:g} s for a show of this flight, not {flown.step:g} s: its "
            f"curves, of {1000 * shortest:.2g} ms, begin and end at whole milliseconds",
        )


def _cubic(pieces: FloatArray) -> FloatArray:
    """Returns cubic curves with the same positions and speeds at their ends as curves [n, d, 6]."""
    a, b, y, z = (pieces[..., k] for k in (0, 1, -2, -1))
    share = DEGREE / 3
    return np.stack([a, a + share * (b - a), z - share * (z - y), z], axis=-1)


def _line(pieces: FloatArray) -> FloatArray:
    return pieces[..., [0, -1]]


def _ms(seconds: float) -> float:
    """Returns seconds, rounded to milliseconds."""
    return round(float(seconds), 3)


def _rounded(point: FloatArray) -> list[float]:
    return [round(value + 0.0, _DIGITS) for value in point.tolist()]


def _notes(flight: Flight, grounds: list[float]) -> Iterator[str]:
    yield "all drones share one clock"
    yield (
        "the show begins and ends in the air: take-off, landing and the camera's pitch are not "
        "included"
    )
    if max(grounds) > min(grounds):
        yield "drones take off at different heights: let Skybrush control altitudes above the sea"
    if flight.geodesy is not None:
        x, y = (np.array([value]) for value in flight.flown.problem.height_map.origin)
        (latitude,), (longitude,) = flight.geodesy.degrees(x, y)
        (orientation,) = flight.geodesy.compass(x, y, np.zeros(1))
        yield (
            f"the show's origin is at latitude {latitude:.7f}, longitude {longitude:.7f}; its X+ "
            f"axis points to {orientation:.2f} degrees"
        )
