"""Measures of simulated flights: errors, delays, and distances to other drones and to walls."""

import math
from itertools import combinations

import numpy as np

from cocap_opt.data import FloatArray
from cocap_opt.experiments.lab.studies.flight.simulation import Simulated
from cocap_opt.problem import Problem

_MOVING = 0.5  # m/s; delays are undefined below this speed
_NEAR = 4.0  # m; obstacles are searched for within this distance first


def errors(made: Simulated) -> FloatArray:
    """Returns the distances [R, n] in m of drones from their planned places."""
    found: FloatArray = np.linalg.norm(made.places - made.reference.states[..., :3], axis=-1)
    return found


def delays(made: Simulated) -> tuple[float, float]:
    """Returns the overall delay of the drones and the largest delay at any moment, in seconds.

    A delay is the error along the path divided by the speed. The overall delay is the delay of all
    flights that fits best, by least squares.
    """
    speeds = made.reference.rates[..., :3]
    behind = ((made.reference.states[..., :3] - made.places) * speeds).sum(axis=-1)
    squares = (speeds * speeds).sum(axis=-1)
    moving = squares > _MOVING**2
    if not moving.any():
        return 0.0, 0.0
    most = float((behind[moving] / squares[moving]).max())
    return float(behind[moving].sum() / squares[moving].sum()), most


def least_apart(places: FloatArray) -> float:
    """Returns the smallest distance (m) between two drones, given their places [R, n, 3]."""
    pairs = combinations(places, 2)
    return min((float(np.linalg.norm(a - b, axis=-1).min()) for a, b in pairs), default=math.inf)


def least_clearance(problem: Problem, places: FloatArray, ticks: int) -> float:
    """Returns the smallest distance (m) of drones to solids and the ground; 0 inside a solid.

    Parameters
    ----------
    places : [R, n, 3] m
    ticks : number of places that are processed together
    """
    corner = np.array([*problem.height_map.origin, 0.0])
    parts = [part for way in places for part in np.array_split(way - corner, 1 + len(way) // ticks)]
    return min(_clearance(problem, part) for part in parts)


def _clearance(problem: Problem, places: FloatArray) -> float:
    """Returns the smallest distance (m) of places [n, 3], from the map's corner, to solids."""
    size, shape = problem.height_map.resolution, np.array(problem.height_map.shape)
    reach = max(_NEAR, size)
    while True:
        low = np.floor((places.min(axis=0)[:2] - reach) / size).astype(np.int64)
        high = np.ceil((places.max(axis=0)[:2] + reach) / size).astype(np.int64)
        first, last = np.clip(low, 0, shape - 1), np.clip(high, 1, shape)
        least = _distance(problem, places, first, last)
        if least <= reach or ((low <= 0) & (high >= shape)).all():
            return least
        reach *= 2


def _distance(problem: Problem, places: FloatArray, first: FloatArray, last: FloatArray) -> float:
    """Returns the smallest distance (m) of places to the solids in some cells."""
    size, columns = problem.height_map.resolution, problem.workspace.columns
    window = slice(None), slice(first[0], last[0]), slice(first[1], last[1])
    bottoms, tops = columns.low[window], columns.high[window]
    _, i, j = found = np.nonzero(bottoms <= tops)
    if not len(i):
        return math.inf
    corners = np.stack([i + first[0], j + first[1]], axis=-1) * size
    low = np.column_stack([corners, bottoms[found]])
    high = np.column_stack([corners + size, tops[found]])
    ways = np.maximum(np.maximum(low - places[:, None], places[:, None] - high), 0.0)
    return float(np.sqrt((ways * ways).sum(axis=-1).min()))
