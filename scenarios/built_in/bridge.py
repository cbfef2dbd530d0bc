"""Bridge: two people walk through an underpass, and three drones film them from both sides.

            #######                      the deck, 6 to 7 m high, seen from the side:
            #deck #
     0 1 -->                                9 m   - - - - - - - - - -   above the deck
            #     #                             ########
      R     #######                         3 m - - - - - - - - - - -   below it

A height map has one top in each cell: in it the underpass would be solid rock, in which nobody can
be seen, and which drones must climb over. With the deck as a mesh drones fly through below it, and
drones above it do not see through it.
"""

from collections.abc import Callable

import numpy as np

from cocap_opt.problem import Camera, Motion, Problem
from cocap_opt.scenarios.built_in.parts import SIZE, Room, drones, walker
from cocap_opt.world.workspace import HeightMap, Mesh

STEPS = 10  # horizon T
DECK = Room(12, 19, 11, 19)  # cells; north and south of it are embankments
BOTTOM, TOP = 6.0, 7.0  # m
MOTION = Motion(layers=(3.0, 9.0), clearance=0.5)
GIMBAL = Camera(tilts=(np.radians(10.0), np.radians(40.0)))


def _bridge(seed: int) -> Problem:
    """Two people walk through an underpass, and three drones film them from below and above a deck.

    The deck is a mesh. The seed chooses the drones' cells and headings, and the people's pace and
    distance.
    """
    rng = np.random.default_rng(seed)
    heights = np.zeros((SIZE, SIZE))
    heights[DECK.x0 : DECK.x1] = TOP
    heights[DECK.x0 : DECK.x1, DECK.y0 : DECK.y1] = 0.0
    actors = []
    for x, y in ((8.0, 14.0), (10.0, 16.0)):
        first, pace = x + rng.uniform(-0.3, 0.3), 1.3 + rng.uniform(-0.1, 0.1)
        actors.append(walker([(0.0, y), (SIZE, y)], first, pace, STEPS))
    team = drones(3, Room(3, 8, 10, 20).cells, [7, 0, 1], rng, MOTION)
    return Problem(
        name="bridge",
        height_map=HeightMap(heights=heights),
        meshes=(Mesh.box((DECK.x0, DECK.y0, BOTTOM), (DECK.x1, DECK.y1, TOP)),),
        robots=tuple(robot.replace(camera=GIMBAL) for robot in team),
        actors=tuple(actors),
        horizon=STEPS,
    )


SCENES: dict[str, Callable[[int], Problem]] = {"bridge": _bridge}
