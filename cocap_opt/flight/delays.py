"""Delays that flights tolerate: how late drones or people may be without coming too close.

Drones that fly waypoints have no common clock. This module finds the smallest difference between
two moments such that one drone at the first moment and another at the second would be too close,
over all pairs of moments: drones with smaller delays obey the separation, whether the delay grows,
shrinks or stays the same. A drone hovers before and after its flight, which adds no cases: a
drone that comes too close to it then is no later than at the flight's first or last moment.

Pairs of pieces of flights, with the square of their moments, are quartered until the smallest
difference at which two drones are too close is known. In a square, planes that separate the pieces
bound the difference from below: along each axis across a plane, a piece is no farther from the line
through its ends than its Bernstein coefficients are. So the result is never too large.
"""

from itertools import product

import numpy as np

from cocap_opt.data import LARGEST, FloatArray
from cocap_opt.flight.bernstein import parted, values
from cocap_opt.flight.trajectory import Trajectory
from cocap_opt.problem import CollisionRules
from cocap_opt.problem.rules import TOLERANCE

FINE = 2e-3  # s, by which a result may be too small
_FINEST = 1e-5  # share of a piece: smallest square
_MOST = 500_000  # squares at once; with more, the result may be even smaller
# halves of one piece and of the other: a square's quarters
_HALVES = tuple(product((0, 1), repeat=2))
_ENDS = tuple(product((0, -1), repeat=2))
_ROUNDING = 1e-9  # m
_SLOW = 1e-4  # m in a piece; slower pieces give no bound


def bearable_delay(flown: Trajectory, rules: CollisionRules) -> float:
    """Returns the delay in seconds below which two drones obey a separation, no matter which one is
    late.

    It is the largest such number, or too small by up to `FINE`, except for flights that nearly
    touch; inf if delays do not matter, 0 if the drones are too close without a delay.

    Parameters
    ----------
    rules : rules with a separation
    """
    pieces = flown.pieces[:, :, :3]
    first, second = np.argwhere(~np.eye(len(pieces), dtype=np.bool_)).T
    return _bearable(pieces[first], pieces[second], rules, np.inf, flown.piece_seconds)


def bearable_delay_of_people(flown: Trajectory) -> float:
    """Returns the delay in seconds below which drones keep their distance from people, no matter
    who is late.

    It is as accurate as `bearable_delay`, and inf if the scene requires no distance from people.
    People stand still before and after their walks.
    """
    airspace, pieces, most = flown.problem.airspace, flown.pieces[:, :, :3], np.inf
    for actor in flown.problem.actors if airspace.people_aside else ():
        walks = np.broadcast_to(flown.walk_of(actor), pieces.shape)
        first, second = np.concatenate([pieces, walks]), np.concatenate([walks, pieces])
        most = _bearable(first, second, airspace.rules_beside(actor), most, flown.piece_seconds)
    return most


def _bearable(
    left: FloatArray, right: FloatArray, rules: CollisionRules, most: float, piece_seconds: float
) -> float:
    """Returns the seconds by which the first of pairs [n, N, 3, 6] may be late, or `most` if it is
    more.
    """
    count, fine = left.shape[1], FINE / piece_seconds
    most /= piece_seconds
    for ahead in range(count):
        if ahead - 1 >= most:
            break  # pieces whose beginnings are this far apart may be up to one piece closer
        first = left[:, ahead:].reshape(-1, *left.shape[2:])
        second = right[:, : count - ahead].reshape(first.shape)
        most = _least(first, second, ahead, rules, most, fine)
    return most * piece_seconds


def _least(
    left: FloatArray, right: FloatArray, ahead: int, rules: CollisionRules, most: float, fine: float
) -> float:
    """Returns the smallest difference (in pieces) between moments at which drones may be too close.

    Parameters
    ----------
    left, right : [n, 3, 6] pieces of flights
    ahead : pieces by which the first ones begin later; negative differences do not count
    most : largest relevant difference, in pieces
    fine : pieces by which the result may be too small
    """
    apart, width, answer = np.full(len(left), float(ahead)), 1.0, most
    clash = most + fine  # smallest known difference at which two drones are too close
    while len(left):
        least = np.maximum(apart + width * _bound(left, right, rules), 0.0)
        undecided = (least < answer) & (least <= apart + width)
        left, right, apart, least = (
            left[undecided],
            right[undecided],
            apart[undecided],
            least[undecided],
        )
        tried = least + fine / 2
        near = rules.too_near(_ways(left, right, (tried - apart) / width))
        clash = min(clash, _smallest(tried[near]))
        undecided = least < clash - fine
        if width < _FINEST or 4 * undecided.sum() > _MOST:
            undecided[:] = False
        answer = min(answer, _smallest(least[~undecided]))
        width /= 2
        first, second = parted(left[undecided]), parted(right[undecided])
        left = np.concatenate([first[i] for i, _ in _HALVES])
        right = np.concatenate([second[j] for _, j in _HALVES])
        apart = np.concatenate([apart[undecided] + width * (i - j) for i, j in _HALVES])
    return answer


def _ways(first: FloatArray, second: FloatArray, ahead: FloatArray) -> FloatArray:
    """Returns the vectors [n, 3] between pieces, at shares of the pieces that differ by [n]."""
    ahead = np.clip(ahead, -1.0, 1.0)
    return values(second, (1 - ahead) / 2) - values(first, (1 + ahead) / 2)


def _bound(first: FloatArray, second: FloatArray, rules: CollisionRules) -> FloatArray:
    """Returns the smallest lead [n] of pieces [n, 3, 6] over others at which they may break rules.

    The lead is a difference of shares, -1..1; inf: they certainly break no rule.
    """
    aside = slice(None, 2 if rules.vertical else None)
    a, b = first[:, aside], second[:, aside]
    ways = [b[:, :, j] - a[:, :, i] for i, j in _ENDS]
    found = np.full(len(first), -1.0)
    for way in (*ways, np.sum(ways, axis=0)):
        length = np.sqrt((way * way).sum(axis=-1, keepdims=True))
        normal = way / np.where(length > 0, length, 1.0)
        found = np.maximum(found, _bound_along(a, b, normal, rules.separation))
    if 0 < rules.vertical < LARGEST / 2:
        for sign in (-1.0, 1.0):
            normal = np.tile([0.0, 0.0, sign], (len(first), 1))
            found = np.maximum(found, _bound_along(first, second, normal, rules.vertical))
    return found


def _bound_along(
    first: FloatArray, second: FloatArray, normal: FloatArray, separation: float
) -> FloatArray:
    """Returns the lead of `_bound` for a separation (m) along normals [n, d] only."""
    p, q = (np.einsum("nd,ndk->nk", normal, piece) for piece in (first, second))
    far = separation - TOLERANCE + _ROUNDING
    shares = np.linspace(0.0, 1.0, p.shape[-1])
    faster, slower = p[:, -1:] - p[:, :1], q[:, -1:] - q[:, :1]
    above = (p - p[:, :1] - faster * shares).max(axis=-1)
    below = (q - q[:, :1] - slower * shares).min(axis=-1)
    faster, slower = faster[:, 0], slower[:, 0]
    # Too close if q - p < far, thus spare < faster (u - v): u and v are the shares, and faster u -
    # slower v is at most faster (u - v) + the larger of faster - slower and 0.
    spare = q[:, 0] + below - p[:, 0] - above - far - np.maximum(faster - slower, 0.0)
    found = np.full(len(p), -1.0)
    moves = faster > _SLOW
    found[moves] = np.maximum(spare[moves] / faster[moves], -1.0)
    never = (q.min(axis=-1) - p.max(axis=-1) >= far) | (found > 1)
    result: FloatArray = np.where(never, np.inf, found)
    return result


def _smallest(values: FloatArray) -> float:
    return float(values.min(initial=np.inf))
