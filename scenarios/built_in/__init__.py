"""The scenes that come with the project, and their shared parts: rooms, walking actors, drones.

Each module has a dict `SCENES` of its scenes: functions from a seed to a Problem, by name.
"""

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from cocap_opt.data import FloatArray
from cocap_opt.problem import Actor, Motion, Robot, State
from cocap_opt.world.workspace import HeightMap

SIZE = 30  # cells of 1 m along x and y
WALL = 10.0  # m, twice the flight height: a wall stops drones and their views
NEIGHBOURS = Motion()  # motion of most drones: 3x3 cells, yaw by -45, 0 or 45 degrees

Point = tuple[float, float]  # m


class Room(NamedTuple):
    """A rectangle of free cells, x0 <= x < x1 and y0 <= y < y1."""

    x0: int
    x1: int
    y0: int
    y1: int

    @property
    def cells(self) -> list[tuple[int, int]]:
        """All cells (x, y) of the room."""
        return [(x, y) for x in range(self.x0, self.x1) for y in range(self.y0, self.y1)]

    @staticmethod
    def cut_into_rock(*rooms: "Room") -> HeightMap:
        """Returns the map of SIZE x SIZE cells in which everything except these rooms is wall."""
        heights = np.full((SIZE, SIZE), WALL)
        for x0, x1, y0, y1 in rooms:
            heights[x0:x1, y0:y1] = 0.0
        return HeightMap(heights=heights)


def walker(points: list[Point], first: float, pace: float, steps: int) -> Actor:
    """Returns an actor that walks along straight legs, facing its direction.

    Parameters
    ----------
    points : corners of the walk (m)
    first : length of the walk (m) completed at step 0
    pace : m per step
    steps : horizon T; the walk must be long enough
    """
    legs = [np.subtract(b, a) for a, b in pairwise(points)]
    lengths = [float(np.hypot(*leg)) for leg in legs]
    corners = np.concatenate([[0.0], np.cumsum(lengths)])
    poses: FloatArray = np.zeros((steps + 1, 4))
    for t in range(steps + 1):
        done = first + pace * t
        leg = int(np.searchsorted(corners, done, side="right")) - 1
        share = (done - corners[leg]) / lengths[leg]
        poses[t, :2] = points[leg] + share * legs[leg]
        poses[t, 3] = math.atan2(legs[leg][1], legs[leg][0])
    return Actor(poses=poses)


def drones(
    count: int,
    cells: list[tuple[int, int]],
    headings: list[int],
    rng: np.random.Generator,
    motion: Motion = NEIGHBOURS,
) -> tuple[Robot, ...]:
    """Returns drones in distinct random cells, with random headings out of the given ones.

    The cells must be free.
    """
    chosen = rng.choice(cells, size=count, replace=False)
    return tuple(
        Robot(start=State(int(x), int(y), heading=int(rng.choice(headings))), motion=motion)
        for x, y in chosen
    )
