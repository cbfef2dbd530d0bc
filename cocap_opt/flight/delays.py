"""Delays that flights bear: by so much one drone may be late and keeps away from the others.

Nothing keeps drones that fly waypoints to a common clock. This finds the least difference between
two moments at which one drone at the first and another at the second would be too near, over all
pairs of moments: whoever keeps below it keeps the separation, whether the delay grows, shrinks or
stays. Before its flight a drone hovers where it begins, afterwards where it ends.

Two pieces of flights and a square of their moments are quartered until a plane between the pieces
proves that they are apart (their Bernstein coefficients lie on its two sides), or until nothing
is left below a difference at which two drones are too near indeed. So the answer is never too
large.
"""

from itertools import product

import numpy as np

from cocap_opt.data import LARGEST, BoolArray, FloatArray, IntArray
from cocap_opt.flight.bernstein import halves
from cocap_opt.flight.trajectory import Trajectory
from cocap_opt.problem import CollisionRules
from cocap_opt.problem.rules import TOLERANCE

_FINE = 2e-3  # s, by which an answer may be too small
_FINEST = 1e-6  # steps, and
_MOST = 500_000  # squares at once, below and above which it may be smaller still
_CORNERS = tuple(product((0, -1), repeat=2))
_ROUNDING = 1e-9  # m


def bearable_delay(flown: Trajectory, rules: CollisionRules) -> float:
    """Returns the seconds below which two drones keep a separation, however one is late.

    It is the largest such number to 5 ms, but for flights that nearly touch; inf where no delay
    matters, 0 where they are too near without any.

    Parameters
    ----------
    rules : have a separation
    """
    pieces = flown.pieces[:, :, :3]
    robots, steps = pieces.shape[:2]
    pairs = np.argwhere(~np.eye(robots, dtype=np.bool_))
    most, fine = np.inf, _FINE / flown.step
    for late in range(steps + 1):
        if not len(pairs) or late - 1 >= most:
            break  # pieces so many steps apart are less apart by up to one step
        ahead = np.arange(steps + late)
        one = _pieces(pieces, pairs[:, 0], ahead)
        other = _pieces(pieces, pairs[:, 1], ahead - late)
        most = _least(one, other, float(late), rules, most, fine)
    return most * flown.step


def _pieces(pieces: FloatArray, robots: IntArray, steps: IntArray) -> FloatArray:
    """Returns the pieces [robots steps, 3, 6] in some steps, before and after the flight too."""
    last = pieces.shape[1] - 1
    found = pieces[robots][:, np.clip(steps, 0, last)]
    found[:, steps < 0] = pieces[robots, 0, :, :1][:, None]
    found[:, steps > last] = pieces[robots, last, :, -1:][:, None]
    result: FloatArray = found.reshape(-1, 3, pieces.shape[-1])
    return result


def _least(
    one: FloatArray, other: FloatArray, late: float, rules: CollisionRules, most: float, fine: float
) -> float:
    """Returns the least difference (steps) between moments at which drones may be too near.

    Parameters
    ----------
    one, other : [n, 3, 6] pieces of flights
    late : steps from the beginning of the others to that of the first ones
    most : steps, beyond which nothing matters
    fine : steps, by which the answer may be too small
    """
    apart, width = np.full(len(one), late), 1.0
    while len(one):
        for i, j in _CORNERS:
            near = rules.too_near(other[:, :, j] - one[:, :, i])
            most = min(most, _smallest(np.abs(apart[near] - width * (i - j))))
        least = np.maximum(np.abs(apart) - width, 0.0)
        some = np.flatnonzero(least < most)
        some = some[~_surely_apart(one[some], other[some], rules)]
        answer = min(most, _smallest(least[some]))
        if answer >= most - fine or width < _FINEST or 4 * len(some) > _MOST:
            return answer
        width /= 2
        first, second = halves(one[some]), halves(other[some])
        one = np.concatenate([first[i] for i, _ in _CORNERS])
        other = np.concatenate([second[j] for _, j in _CORNERS])
        apart = np.concatenate([apart[some] - width * (i - j) for i, j in _CORNERS])
    return most


def _smallest(values: FloatArray) -> float:
    return float(values.min(initial=np.inf))


def _surely_apart(one: FloatArray, other: FloatArray, rules: CollisionRules) -> BoolArray:
    """Returns an array [n], true if no moments of two pieces [n, 3, 6] break a separation.

    True is proved; false may be an accident.
    """
    far = rules.separation - TOLERANCE - _ROUNDING
    aside = slice(None, 2 if rules.vertical else None)
    found = np.zeros(len(one), dtype=np.bool_)
    ways = [other[:, aside, j] - one[:, aside, i] for i, j in _CORNERS]
    for way in (*ways, np.sum(ways, axis=0)):
        length = np.sqrt((way * way).sum(axis=-1, keepdims=True))
        normal = way / np.where(length > 0, length, 1.0)
        found |= _gap(one[:, aside], other[:, aside], normal) >= far
    if 0 < rules.vertical < LARGEST / 2:
        up = np.tile([0.0, 0.0, 1.0], (len(one), 1))
        above = np.maximum(_gap(one, other, up), _gap(one, other, -up))
        found |= above >= rules.vertical - TOLERANCE - _ROUNDING
    return found


def _gap(one: FloatArray, other: FloatArray, normal: FloatArray) -> FloatArray:
    """Returns the width [n] of what parts pieces [n, d, 6] along directions [n, d]."""
    before = np.einsum("nd,ndk->nk", normal, one).max(axis=-1)
    behind = np.einsum("nd,ndk->nk", normal, other).min(axis=-1)
    result: FloatArray = behind - before
    return result
