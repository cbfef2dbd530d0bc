"""Passage: eight drones must queue at a passage of one cell to film four people walking in it.

                    #####
    yard      RRR   #####
           0  RRR1  2  3          passage of one cell, walls 10 m high; all walk to the right
              RR    #####
                    #####

It is the tight corridor with more drones than the passage holds. They start close together
before its mouth and are a little faster than the people, of whom two are in it at step 0 and
two walk through it below the drones. Each drone would be best off in line with the passage, 5 m
behind the people in it, or beyond it with the people who have left. Only one can fly in at a step,
and in the passage nobody can overtake, so a plan must say who enters when, who waits and who films
from the yard. Drones planned one by one, in an order that is not that of their places, shut one
another out; in the constraint tree each step of waiting is a conflict of its own.
"""

from collections.abc import Callable

import numpy as np

from cocap_opt.problem import Problem
from cocap_opt.scenarios.built_in.parts import SIZE, Room, drones, walker

STEPS = 12  # horizon T
ROBOTS, ACTORS = 8, 4
MOUTH, END = 9, 14  # cells x at which the passage begins and ends
ROW = 15  # cell y of the passage
STARTS = Room(6, MOUTH, 13, 18)
LEAD, SPACING = -3.0, 2.5  # m, of the last person beyond the mouth, and to the next one ahead
PACE = 0.9  # m per step


def _passage(seed: int) -> Problem:
    """Four people walk through a passage of one cell, where eight drones must queue to film them.

    The seed chooses the drones' cells and headings, and the people's pace and distances.
    """
    rng = np.random.default_rng(seed)
    middle = ROW + 0.5
    pace = PACE + rng.uniform(-0.03, 0.03)
    actors = []
    for j in range(ACTORS):
        x = MOUTH + LEAD + SPACING * j + rng.uniform(-0.2, 0.2)
        actors.append(walker([(0.0, middle), (SIZE, middle)], x, pace, STEPS))
    return Problem(
        name="passage",
        height_map=Room.cut_into_rock(
            Room(0, MOUTH, 0, SIZE), Room(MOUTH, END, ROW, ROW + 1), Room(END, SIZE, 0, SIZE)
        ),
        robots=drones(ROBOTS, STARTS.cells, [7, 0, 1], rng),
        actors=tuple(actors),
        horizon=STEPS,
    )


SCENES: dict[str, Callable[[int], Problem]] = {"passage": _passage}
