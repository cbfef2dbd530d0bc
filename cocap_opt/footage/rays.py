"""Angles between the rays to a person from the drones that see them."""

from itertools import combinations

import numpy as np

from cocap_opt.data import BoolArray, FloatArray


def widest_angle(rays: FloatArray, seen: BoolArray) -> FloatArray:
    """Returns the widest angles [T+1, A] (degrees) between two rays to each person.

    Rays count as lines, so that it is 0 to 90 degrees: from opposite sides one sees a person along
    the same line, and neither drone tells how far away they are. It is nan where fewer than two
    drones see the person, since there is no angle. A drone at the very middle of a person has no
    ray, and an angle of 0 with all others.

    Parameters
    ----------
    rays : [T+1, R, A, 3] m, from drones to people
    seen : [T+1, R, A] true where a drone sees a person
    """
    steps, robots, people, _ = rays.shape
    widest = np.full((steps, people), np.nan)
    for i, k in combinations(range(robots), 2):
        both = seen[:, i] & seen[:, k]
        found = between_lines(rays[:, i], rays[:, k])
        widest[both] = np.fmax(widest[both], found[both])
    return widest


def between_lines(first: FloatArray, second: FloatArray) -> FloatArray:
    """Returns the angles [..] (degrees), 0 to 90, between lines along vectors [.., 3]."""
    # The arc cosine would lose half of the digits near 0 degrees.
    crossing = np.linalg.norm(np.cross(first, second), axis=-1)
    along = np.abs((first * second).sum(axis=-1))
    result: FloatArray = np.degrees(np.arctan2(crossing, along))
    return result
