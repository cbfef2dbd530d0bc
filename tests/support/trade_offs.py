"""A tiny scene in which J and views want different things."""

import numpy as np

from cocap_opt.problem import Actor, Problem, Robot, State
from cocap_opt.scenarios.built_in.tiny import CAMERA, HALF, NORTH, TURNING
from cocap_opt.world.workspace import HeightMap

STEPS = 2


def crossroads() -> Problem:
    """One drone turns on the spot, from a person 3 m north to two people 6 m east, and back.

    A step pays 20 to the north, where one person is seen. To the east two are, whose fronts pay a
    tenth of 10 each.
    """
    south, west = -np.pi / 2, np.pi
    people = [
        Actor(poses=np.tile([x, y, 0.0, yaw], (STEPS + 1, 1)), weights=(weight, 0.0, 0.0, 0.0, 0.0))
        for x, y, yaw, weight in (
            (0.5, 3.5 + HALF, south, 1.0),
            (6.5 + HALF, -0.5, west, 0.1),
            (6.5 + HALF, 1.5, west, 0.1),
        )
    ]
    return Problem(
        name="crossroads", height_map=HeightMap(heights=np.zeros((1, 1))), actors=tuple(people),
        robots=(Robot(start=State(0, 0, heading=NORTH), motion=TURNING, camera=CAMERA),),
        horizon=STEPS,
    )  # fmt: skip
