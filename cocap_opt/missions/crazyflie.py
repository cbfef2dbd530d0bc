"""Smooth flights as polynomials of degree seven (.crazyflie.csv), one file per drone.

A row contains a duration (s) and the coefficients of x, y, z (m) and yaw (rad, counter-clockwise
from x) in the time since its beginning, in the form of Crazyswarm's `uav_trajectory.loadcsv` and
Bitcraze's high-level commander. Pieces of smooth flights have degree five and are represented to a
micrometre; consecutive pieces that continue the same polynomial, e.g. while a drone stays, are one
row. x and y are relative to the map's corner, since the drone computes in single precision.

The memory of a Crazyflie holds 31 pieces (132 of 4096 bytes each): "Trajectory formats",
https://www.bitcraze.io/documentation/repository/crazyflie-firmware/master/functional-areas/trajectory_formats/
"""

import io
from collections.abc import Iterator
from math import comb

import numpy as np

from cocap_opt.data import FieldError, FloatArray, ProblemError
from cocap_opt.flight.bernstein import parted
from cocap_opt.flight.flights import Flight
from cocap_opt.flight.notes import Kind, Note
from cocap_opt.flight.trajectory import DEGREE, YAW
from cocap_opt.missions.export import Export, require_nothing_else

_HOLDS = 31  # pieces
_COEFFICIENTS = 8
_OFF = 1e-6  # m or rad; tolerance for a polynomial that replaces several pieces
_AXES = "x", "y", "z", "yaw"
_HEADER = ("duration", *(f"{axis}^{k}" for axis in _AXES for k in range(_COEFFICIENTS)))
_NOTES = (
    Note(
        "upload each file to its drone and start all drones at once: from then on, each follows "
        "its own clock"
    ),
    Note("the ascent to the first point, the landing and the camera's pitch are not in the files"),
    Note(
        "x and y are from the map's corner; yaw is in radians, 0 along x, and grows "
        "counter-clockwise",
        Kind.READING,
    ),
)


def write(flight: Flight, every: float | None) -> Export:
    """Returns the polynomials of each drone.

    Raises
    ------
    ProblemError
        If the flight is straight, i.e. has discontinuous speeds, or if a drone's memory cannot hold
        it.
    """
    if not flight.is_smooth:
        raise FieldError("smooth", "must be given, as a drone cannot follow discontinuous speeds")
    require_nothing_else(every, "a polynomial has no moments")
    files = {}
    for i, pieces in enumerate(flight.flown.pieces):
        span = flight.flown.piece_seconds
        rows = [_row(piece, span, count) for piece, count in _runs(pieces[:, : YAW + 1])]
        if len(rows) > _HOLDS:
            raise ProblemError(
                f"drone {i} needs {len(rows)} polynomials, but the memory of a Crazyflie holds "
                f"{_HOLDS}; plan at most {_HOLDS} steps, and make them longer"
            )
        files[f"drone{i}"] = _table(rows)
    return Export(files, _NOTES)


def _runs(pieces: FloatArray) -> Iterator[tuple[FloatArray, int]]:
    """Yields a piece [4, 6], and the number of pieces that continue its polynomial."""
    first, count = pieces[0], 1
    for piece in pieces[1:]:
        if np.abs(_continued(first, count) - piece).max() <= _OFF:
            count += 1
        else:
            yield first, count
            first, count = piece, 1
    yield first, count


def _continued(piece: FloatArray, count: int) -> FloatArray:
    """Returns the coefficients of a polynomial continued by a number of pieces."""
    until, _ = parted(piece, count + 1)
    return parted(until, count / (count + 1))[1]


def _row(piece: FloatArray, span: float, count: int) -> FloatArray:
    """Returns a row [33]: a duration, and the coefficients of each axis.

    Parameters
    ----------
    span : duration of a piece, s
    count : number of pieces that continue its polynomial
    """
    powers = np.zeros((len(_AXES), _COEFFICIENTS))
    powers[:, : DEGREE + 1] = piece @ _powers() / span ** np.arange(DEGREE + 1)
    return np.array([count * span, *powers.ravel()])


def _powers() -> FloatArray:
    """Returns a matrix [6, 6] that converts Bernstein coefficients to powers of the share."""
    return np.array(
        [
            [
                comb(DEGREE, k) * comb(k, i) * (-1.0) ** (k - i) if i <= k else 0.0
                for k in range(DEGREE + 1)
            ]
            for i in range(DEGREE + 1)
        ]
    )


def _table(rows: list[FloatArray]) -> bytes:
    text = io.StringIO(newline="")
    np.savetxt(
        text, np.array(rows) + 0.0, fmt="%.12g", delimiter=",", header=",".join(_HEADER),
        comments="", newline="\n",
    )  # fmt: skip
    return text.getvalue().encode()
