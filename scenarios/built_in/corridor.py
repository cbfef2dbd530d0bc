"""Corridor: two people walk through a narrow passage, and two drones film them from behind.

                 #######
    yard         #######
      R    0  1    --->      passage of one or two cells, walls 10 m high
        R        #######
                 #######

Why collisions are likely. The camera looks 10 degrees down and sees 41 degrees down at most,
so from 5 m above the ground people are seen best from about 5 m away. The walls hide them
from all places but those in line with the passage. The drones are a little faster than the
people, cannot get past them in time, and so each one's best path ends in the same one or two
cells that trail the last person by 5 m: a second drone in the best cell adds 41 % to the reward
of the first, which is worth more than any other cell. Planned one by one, both go there.

Why in the tight variant the optimum itself suffers. Two alike drones can exchange roles for
nothing, so a contested place costs something only if no other is as good. In a passage of
one cell, places are ordered by their distance to the people: two drones that start at its
mouth are there at the same steps, and the one that gives way sees everything from a metre
further until the end.
"""

from collections.abc import Callable

import numpy as np

from cocap_opt.problem import Problem
from cocap_opt.scenarios.built_in.parts import SIZE, Room, drones, walker

STEPS = 8  # horizon T
MOUTH, END = 9, 16  # cells x at which the passage begins and ends
LEAD, SPACING = -1.0, 2.0  # m, of the last person beyond the mouth, and to the one ahead


def _corridor(seed: int) -> Problem:
    """Two people walk through a narrow passage, and two drones film them from behind.

    The passage is two cells wide, and the drones start anywhere in front of it. The seed chooses
    the drones' cells and headings, and the people's pace and distance.
    """
    return _scene("corridor", seed, width=2, pace=0.95, starts=Room(3, 7, 9, 21))


def _corridor_tight(seed: int) -> Problem:
    """Two people walk through a passage so narrow that only one drone can film from its best place.

    The passage is one cell wide, and the drones start at its mouth. The seed chooses the same as
    in the wider corridor.
    """
    return _scene("corridor-tight", seed, width=1, pace=0.9, starts=Room(5, 9, 13, 18))


def _scene(name: str, seed: int, width: int, pace: float, starts: Room) -> Problem:
    """Builds the scene with a passage of `width` cells; people walk about `pace` m per step."""
    rng = np.random.default_rng(seed)
    low = 15 - width // 2
    middle = low + width / 2
    # One walks on the left and one on the right, their boxes (1 m wide) off the walls.
    side = 0.8 * (width - 1) / 2
    actors = []
    for j, y in enumerate((middle - side, middle + side)):
        own_pace = pace + rng.uniform(-0.03, 0.03)
        x = MOUTH + LEAD + SPACING * j + rng.uniform(-0.2, 0.2)
        actors.append(walker([(0.0, y), (SIZE, y)], x, own_pace, STEPS))
    return Problem(
        name=name,
        height_map=Room.cut_into_rock(
            Room(0, MOUTH, 0, SIZE), Room(MOUTH, END, low, low + width), Room(END, SIZE, 0, SIZE)
        ),
        robots=drones(2, starts.cells, [7, 0, 1], rng),
        actors=tuple(actors),
        horizon=STEPS,
    )


SCENES: dict[str, Callable[[int], Problem]] = {
    "corridor": _corridor,
    "corridor-tight": _corridor_tight,
}
