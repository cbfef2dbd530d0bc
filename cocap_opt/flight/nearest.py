"""The moments at which drones are nearest to each other and to people, of all moments."""

import math
from typing import NamedTuple

import numpy as np

from cocap_opt.data import FloatArray, IntArray
from cocap_opt.flight.bernstein import largest, squared_length
from cocap_opt.flight.safety import walk_of
from cocap_opt.flight.trajectory import DEGREE, Trajectory, between_drones


class Nearest(NamedTuple):
    """The moment at which two are nearest to each other."""

    distance: float  # m
    t: float  # s since step 0
    one: int
    other: int
    place: FloatArray  # [3] m, of the first


def nearest_drones(flown: Trajectory) -> Nearest | None:
    """Returns when two drones are nearest to each other; None for one drone."""
    ways = between_drones(flown.pieces)
    if not len(ways):
        return None
    one, other = (side.astype(np.int64) for side in np.triu_indices(len(flown.pieces), 1))
    return _nearest(flown, ways, one, other)


def nearest_people(flown: Trajectory) -> Nearest | None:
    """Returns when a drone is nearest to the middle of a person, seen from above.

    None: the scene has no people.
    """
    problem, pieces = flown.problem, flown.pieces
    if not problem.actors:
        return None
    walks = np.array([walk_of(problem, actor, flown.parts)[:, :2] for actor in problem.actors])
    ways = (pieces[:, None, :, :2] - walks).reshape(-1, 2, DEGREE + 1)
    one, other = np.divmod(np.arange(len(pieces) * len(walks)), len(walks))
    return _nearest(flown, ways, one, other)


def _nearest(flown: Trajectory, ways: FloatArray, one: IntArray, other: IntArray) -> Nearest:
    """Returns the least length of ways [pairs N, d, 6], and when and where that is."""
    peak = largest(-squared_length(ways))
    pair, piece = divmod(peak.which, flown.pieces.shape[1])
    t = (piece + peak.share) * flown.piece_seconds
    place = flown.at(np.array([t])).place[int(one[pair])]
    distance = math.sqrt(max(-peak.value, 0.0))
    return Nearest(distance, t, int(one[pair]), int(other[pair]), place)
