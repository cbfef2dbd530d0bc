"""Smooth flights as polynomials of the seventh degree (.crazyflie.csv), one file per drone.

A row has a duration (s) and the coefficients of x, y, z (m) and yaw (rad, counter-clockwise from
x) in the seconds since it began, as Crazyswarm's `uav_trajectory.loadcsv` and Bitcraze's
high-level commander take them. Pieces of smooth flights are of the fifth degree and become rows
exactly; steps in which a drone stays as it is are one row. x and y begin at the map's corner,
for the drone computes in single precision.

The memory of a Crazyflie holds 31 pieces (132 of 4096 bytes each): "Trajectory formats",
https://www.bitcraze.io/documentation/repository/crazyflie-firmware/master/functional-areas/trajectory_formats/
"""

import io
from collections.abc import Iterator
from itertools import groupby
from math import comb

import numpy as np

from cocap_opt.data import FloatArray, ProblemError
from cocap_opt.experiments.missions.mission import Mission, require_nothing_else
from cocap_opt.experiments.results.flights import Flight
from cocap_opt.flight.trajectory import DEGREE, YAW

_HOLDS = 31  # pieces
_COEFFICIENTS = 8
_AXES = "x", "y", "z", "yaw"
_HEADER = ("duration", *(f"{axis}^{k}" for axis in _AXES for k in range(_COEFFICIENTS)))
_NOTES = (
    "upload each file to its drone and start all at once: they then fly by one clock, each its own",
    "x and y are from the map's corner; take-off to the first point and landing are not in it, "
    "nor the camera's pitch",
)


def crazyflie(flight: Flight, every: float | None) -> Mission:
    """Returns the polynomials of each drone.

    Raises
    ------
    ProblemError
        If the flight is straight, whose speeds jump, or a drone's memory cannot hold it.
    """
    if not flight.is_smooth:
        raise ProblemError("smooth: must be given, for a drone cannot follow speeds that jump")
    require_nothing_else(every, "a polynomial has no moments")
    files = {}
    for i, pieces in enumerate(flight.flown.pieces):
        rows = [_row(run, flight.flown.step) for run in _runs(pieces[:, : YAW + 1])]
        if len(rows) > _HOLDS:
            raise ProblemError(
                f"drone {i} needs {len(rows)} polynomials, and the memory of a Crazyflie holds "
                f"{_HOLDS}; a plan of {_HOLDS} longer steps would do"
            )
        files[f"drone{i}"] = _table(rows)
    return Mission(files, _NOTES)


def _runs(pieces: FloatArray) -> Iterator[list[FloatArray]]:
    """Yields each piece [4, 6] alone, but those in a row in which a drone stays as it is."""
    for stays, run in groupby(pieces, key=lambda piece: bool((piece == piece[:, :1]).all())):
        if stays:
            yield list(run)
        else:
            yield from ([piece] for piece in run)


def _row(run: list[FloatArray], step: float) -> FloatArray:
    """Returns a row [33]: a duration, and the coefficients of each axis."""
    powers = np.zeros((len(_AXES), _COEFFICIENTS))
    powers[:, : DEGREE + 1] = run[0] @ _powers() / step ** np.arange(DEGREE + 1)
    return np.array([len(run) * step, *powers.ravel()])


def _powers() -> FloatArray:
    """Returns [6, 6], which makes of Bernstein coefficients those of powers of the share."""
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
