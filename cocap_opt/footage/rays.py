"""Angles between the rays from a person to the drones that see them."""

from itertools import combinations

import numpy as np

from cocap_opt.data import BoolArray, FloatArray


def widest_angle(rays: FloatArray, seen: BoolArray) -> FloatArray:
    """Returns the widest angles [T+1, A] (degrees) between two rays to each person.

    Rays count as lines, so the angle is 0 to 90 degrees: drones on opposite sides see a person
    along the same line, which does not determine the distance. It is nan if fewer than two drones
    see the person. A drone at the exact middle of a person has no ray, and an angle of 0 with all
    others.

    Parameters
    ----------
    rays : [T+1, R, A, 3] rays from drones to people, m
    seen : [T+1, R, A] True if a drone sees a person
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
