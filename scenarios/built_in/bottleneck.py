"""Bottleneck: four people come out of three corridors and leave by one exit, four drones film.

             # 1 #
          #### | ####
    3 --- 0 -- square ====> exit
          #### | ####              all around: walls 10 m high
             # 2 #

Why collisions are likely. The people's ways cross before the exit and merge in it, one behind
the other. A camera that looks 10 degrees down sees people best from about 5 m away, and most of
the time there is a place from which it sees several of them in one image at that distance; walls
leave few such places. A face that k drones see equally well pays sqrt(k), so the best view of four
people beats a fresh view of one, and drones planned one by one meet there.

Why in the tight variant the optimum itself suffers. Alike drones can exchange roles for
nothing, so a collision in a good plan can mostly be resolved without loss. Here all people
are soon in an exit of one cell. Whoever films them must be in line with it, and the places
in line are ordered by how well they see: the drones, at the mouth from the start, need the
same best place at the same steps, but only one gets it, the next is a metre behind, and so on.
"""

from collections.abc import Callable
from itertools import pairwise

import numpy as np

from cocap_opt.problem import Problem
from cocap_opt.scenarios.built_in.parts import SIZE, Point, Room, drones, walker

STEPS = 11  # horizon T


def _bottleneck(seed: int) -> Problem:
    """Four people come out of three corridors and leave by one exit, and four drones film them.

    Corridors and exit are two cells wide, and the drones start anywhere on the square. The seed
    chooses the drones' cells and headings, and the people's pace and distances.
    """
    square = Room(10, 18, 12, 18)
    return _scene("bottleneck", seed, square, square, width=2, first=6.5, spacing=1.8)


def _bottleneck_tight(seed: int) -> Problem:
    """Four people leave by an exit so narrow that four drones contend for the places behind them.

    Corridors and exit are one cell wide, and the drones start near the mouth of the exit. At step 0
    the first person enters the exit, and the next two are on the square already. The seed chooses
    the same as in the wider bottleneck.
    """
    square, starts = Room(12, 17, 12, 19), Room(13, 17, 13, 18)
    return _scene("bottleneck-tight", seed, square, starts, width=1, first=0.0, spacing=2.0)


def _scene(
    name: str, seed: int, square: Room, starts: Room, width: int, first: float, spacing: float
) -> Problem:
    """Builds the scene.

    Parameters
    ----------
    width : of corridors and exit, in cells
    first, spacing : way (m) that the first person has left to the exit at step 0, and how
        much longer that of each following one is
    """
    rng = np.random.default_rng(seed)
    low, left, mouth = 15 - width // 2, square.x0 + 2, square.x1
    gate, middle = left + width / 2, low + width / 2
    # Who comes from the north leaves on the south side and the other way round, so that the ways
    # cross. People's boxes are 1 m wide and must stay off the walls.
    side = 0.8 * (width - 1) / 2
    north, south = middle + side, middle - side
    ways: list[list[Point]] = [
        [(0, middle), (SIZE, middle)],
        [(gate, SIZE), (gate, square.y1 - 1), (mouth - 0.5, south), (SIZE, south)],
        [(gate, 0), (gate, square.y0 + 1), (mouth - 0.5, north), (SIZE, north)],
        [(0, middle), (SIZE, middle)],
    ]
    pace = 1.0 + rng.uniform(-0.03, 0.03)
    actors = []
    for j, way in enumerate(ways):
        left_to_go = SIZE - mouth + first + spacing * j + rng.uniform(-0.2, 0.2)
        length = sum(float(np.hypot(*np.subtract(b, a))) for a, b in pairwise(way))
        actors.append(walker(way, length - left_to_go, pace, STEPS))
    return Problem(
        name=name,
        height_map=Room.cut_into_rock(
            square,
            Room(0, SIZE, low, low + width),
            Room(left, left + width, 0, SIZE),
        ),
        robots=drones(4, starts.cells, list(range(8)), rng),
        actors=tuple(actors),
        horizon=STEPS,
    )


SCENES: dict[str, Callable[[int], Problem]] = {
    "bottleneck": _bottleneck,
    "bottleneck-tight": _bottleneck_tight,
}
