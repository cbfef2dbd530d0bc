"""The flight of a plan between the steps, as the player draws it.

Drones fly the plan's smooth flight, as with `cocap-opt fly --smooth`: at the steps they are at the
plan's places, and in between `flight` has proved that they keep the rules. If there is no smooth
flight, they fly straight from step to step.
"""

from typing import Any

import numpy as np

from cocap_opt.data import FloatArray
from cocap_opt.flight.smooth import Smooth
from cocap_opt.flight.trajectory import DEGREE, PITCH, Trajectory, in_steps, split
from cocap_opt.player.player_scene import PlayerScene
from cocap_opt.problem import Plan, Problem

_SAME = 1e-5  # m and rad, largest difference between a piece and the two that it replaces


def smooth_flight(problem: Problem, plan: Plan) -> Trajectory | None:
    """Returns the smooth flight of a plan, if one is safe.

    If the scene defines no step length, speeds are unknown, and the flight is that of a drone
    without limits.
    """
    found = Smooth.of(in_steps(problem), plan)
    return None if found.dangers else found.trajectory


def knots(scene: PlayerScene, flown: Trajectory) -> list[Any]:
    """Returns the flight of each drone as rows: the step, the pose, its rates and accelerations.

    A pose is x, y, z (m), yaw and tilt (rad), as in paths, except that the yaw does not jump at a
    full turn; rates are per step. Between two rows, each coordinate is the polynomial of degree
    five with these values at both. There is a row at each step, and more in between if necessary.
    """
    parts, steps = flown.parts, flown.problem.horizon
    pieces = flown.pieces.copy()
    pieces[:, :, :3] += scene.local(np.array([*scene.problem.height_map.origin, 0.0]))[:, None]
    pieces[:, :, PITCH] *= -1
    return [_rows(scene, flight.reshape(steps, parts, 5, -1)) for flight in pieces]


def _rows(scene: PlayerScene, pieces: FloatArray) -> list[Any]:
    """Returns the rows of a drone's pieces [T, parts, 5, 6]."""
    rows = []
    for step, made in enumerate(pieces):
        begins, _ = _ends(merged := _fewest(made))
        rows += [[step + k / len(merged), *row.T.ravel()] for k, row in enumerate(begins)]
    rows.append([len(pieces), *_ends(pieces[-1])[1][-1].T.ravel()])
    found: list[Any] = scene.rounded(np.array(rows))
    return found


def _fewest(pieces: FloatArray) -> FloatArray:
    """Returns the fewest pieces of equal length [n, 5, 6] that make the same flight in a step."""
    parts, (begins, ends) = len(pieces), _ends(pieces)
    for count in (n for n in range(1, parts) if parts % n == 0):
        each = parts // count
        joined = _between(begins[::each], ends[each - 1 :: each], 1 / count)
        if np.abs(split(joined, each) - pieces).max() < _SAME:
            return joined
    return pieces


def _ends(pieces: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Returns values, rates and accelerations [n, 5, 3], per step, at begin and end of pieces."""

    def of(a: FloatArray, b: FloatArray, c: FloatArray, sign: int) -> FloatArray:
        rate, bend = DEGREE * (b - a), DEGREE * (DEGREE - 1) * (a - 2 * b + c)
        return np.stack([a, sign * rate * len(pieces), bend * len(pieces) ** 2], axis=-1)

    p = np.moveaxis(pieces, -1, 0)
    return of(p[0], p[1], p[2], 1), of(p[5], p[4], p[3], -1)


def _between(begins: FloatArray, ends: FloatArray, share: float) -> FloatArray:
    """Returns pieces [n, 5, 6], each of a share of a step, with these `_ends`."""

    def of(end: FloatArray, sign: int) -> list[FloatArray]:
        value, rate, bend = np.moveaxis(end, -1, 0)
        second = value + sign * rate * share / DEGREE
        return [value, second, 2 * second - value + bend * share**2 / (DEGREE * (DEGREE - 1))]

    return np.stack([*of(begins, 1), *of(ends, -1)[::-1]], axis=-1)
