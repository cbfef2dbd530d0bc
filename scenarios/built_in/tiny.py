"""Tiny scenes whose optimum is worked out by hand, for tests and first steps.

In all of them, drones fly at half the height of the actors, 0.9 m, and look straight ahead, and
only an actor's front counts. A front that a camera sees squarely from r metres covers F^2 / r^2
px/m2, for a focal length of F = 60 px, wherever it is in the image, as long as it is completely
inside; its root is F / r per step. Cameras and fronts are in the middles of cells 1 m wide, so r is
a whole number of metres.
"""

import math
from collections.abc import Callable

import numpy as np

from cocap_opt.problem import Actor, Camera, Motion, Objective, Problem, Robot, State
from cocap_opt.world.workspace import HeightMap

WALL = 10.0  # m
HALF = 0.5  # m, half an actor's length
# sees r/2 to each side at distance r
CAMERA = Camera(width=60, height=60, focal=60.0, tilts=(0.0,))
EYE_LEVEL = (0.9,)  # m, the only layer
STRAIGHT = Motion(headings=1, layers=EYE_LEVEL)  # moves to all neighbours, looks along +x
TURNING = Motion(radius=0, headings=4, layers=EYE_LEVEL)  # stays, turns by a right angle
EAST, NORTH, WEST, SOUTH = range(4)  # quarter turns from +x; headings of TURNING
MOST_STEPS = 6  # steps of any tiny scene
FRONT_ONLY = (1.0, 0.0, 0.0, 0.0, 0.0)  # weights of front, left, back, right, top


def _tiny_approach(seed: int) -> Problem:
    """One drone flies up to the front of a person.

    At step 0 the front is 7 m away and each of three steps makes it one less:
    60/6 + 60/5 + 60/4 = 10 + 12 + 15 = 37.
    """
    return _tiny(
        "tiny-approach", cells=["...."], robots=[(0, 0)], actors=[_front(7.5, HALF, WEST)], steps=3
    )


def _tiny_hover(seed: int) -> Problem:
    """One drone weighs a better view against the reward of 3.5 for standing still.

    Views are worth 10, 12, 15 in cells 0, 1, 2. In two steps: stay twice 2 (10 + 3.5) = 27; move,
    then stay 12 + (12 + 3.5) = 27.5; stay, then move 10 + 3.5 + 12 = 25.5; move twice 12 + 15 = 27.
    The best is 27.5.
    """
    return _tiny(
        "tiny-hover",
        cells=["..."],
        robots=[(0, 0)],
        actors=[_front(6.5, HALF, WEST)],
        steps=2,
        stationarity=3.5,
    )


def _tiny_share(seed: int) -> Problem:
    """Two drones fly side by side up to the front of the same person.

    Pixels add up, so at equal distances a front is worth sqrt(2) 60/r: with r = 5 and then 4,
    sqrt(2) (12 + 15) = 27 sqrt(2). Each in its row, they never meet.
    """
    return _tiny(
        "tiny-share",
        cells=["...", "..."],
        robots=[(0, 0), (0, 1)],
        actors=[_front(6.5, 1.0, WEST)],
        steps=2,
    )


def _tiny_queue(seed: int) -> Problem:
    """Two drones queue in a passage of one cell that ends 4 m before the front of a person.

    They start in cells 0 and 1 of 3. The first is at the end after one step, the second must
    stay behind it: in both steps the front is seen from 4 and from 5 m and is worth
    60 sqrt(1/16 + 1/25) = 3 sqrt(41), together 6 sqrt(41). Were they allowed to share the last
    cell, the second step would be worth 15 sqrt(2) instead of 3 sqrt(41): 2 more.
    """
    return _tiny(
        "tiny-queue",
        cells=["..."],
        robots=[(0, 0), (1, 0)],
        actors=[_front(6.5, HALF, WEST)],
        steps=2,
    )


def _tiny_doorway(seed: int) -> Problem:
    """Two drones look through a doorway that has room for one of them.

    A wall hides the person from all cells but those of the southern row: a front is worth 15 in the
    doorway and 12 in the cell before it. The first drone is before the doorway after one step and
    in it after two, the second is a step behind, so that three steps are worth at most 12, then
    sqrt(15^2 + 12^2) = 3 sqrt(41) twice: 12 + 6 sqrt(41). Planned without looking at each other
    both are in the doorway at last, which is worth 15 sqrt(2) instead of 3 sqrt(41): 2 more.
    """
    return _tiny(
        "tiny-doorway",
        cells=["..#", "..#", "..."],
        robots=[(1, 1), (0, 2)],
        actors=[_front(6.5, HALF, WEST)],
        steps=3,
    )


def _tiny_turn(seed: int) -> Problem:
    """One drone turns on the spot, from a view of nobody past one person to another.

    It looks west; a front 4 m north is one turn away and worth 15, one 3 m east is two turns
    away and worth 20. In three steps north alone is worth 3 * 15 = 45; north in passing, then east,
    is worth 15 + 20 + 20 = 55.
    """
    return _tiny(
        "tiny-turn",
        cells=["."],
        robots=[(0, 0)],
        headings=(WEST,),
        motion=TURNING,
        actors=[_front(HALF, 4.5, SOUTH), _front(3.5, HALF, WEST)],
        steps=3,
    )


def _tiny_trap(seed: int) -> Problem:
    """Two drones turn on the spot; planned one by one, the first takes the view of the second.

    The first looks north and can turn to a front 4 m east (15) or to one 5 m west (12); the
    second looks east and is no more than one turn from it, so the west is out of its reach.
    One by one, the first takes the east and the second adds little: 15 sqrt(2) = 21.2. The
    best is west and east, 12 + 15 = 27.
    """
    return _tiny(
        "tiny-trap",
        cells=[".", "."],
        robots=[(0, 0), (0, 1)],
        headings=(NORTH, EAST),
        motion=TURNING,
        actors=[_front(4.5, 1.0, WEST), _front(-4.5, 1.0, EAST)],
        steps=1,
    )


def _tiny_hidden(seed: int) -> Problem:
    """A wall hides the only person, so nothing can be seen and the optimum is 0."""
    return _tiny(
        "tiny-hidden",
        cells=["..#", "..#", "..#"],
        robots=[(0, 1)],
        actors=[_front(6.5, 1.5, WEST)],
        steps=2,
    )


def _tiny_give_way(seed: int) -> Problem:
    """Two drones must pass each other in a passage of one cell with one bay.

    Their goals are at each other's start, 4 moves away. They can only pass where one waits in
    the bay (above cell 2; its corners are walls, so the way in and out is straight): 2 moves
    more. Nobody sees the actor, and standing still is worth 1. Of 2 * 6 steps at least 4 + 6 are
    moves, so at most 2 stand still; cells 0 1 2 bay 2 3 4 against 4 4 3 2 1 0 0 attain that: 2.
    Could they fly through each other, it would be 4.
    """
    return _tiny(
        "tiny-give-way",
        cells=["##.##", "....."],
        robots=[(0, 0), (4, 0)],
        goals=((4, 0), (0, 0)),
        actors=[_front(-3.0, HALF, WEST)],
        steps=6,
        stationarity=1.0,
    )


def _tiny_head_on(seed: int) -> Problem:
    """Two drones have their goals at each other's start in a passage of one cell: no plan exists.

    They would have to change places or be in one cell at some step.
    """
    return _tiny(
        "tiny-head-on",
        cells=["...."],
        robots=[(0, 0), (3, 0)],
        goals=((3, 0), (0, 0)),
        actors=[_front(7.5, HALF, WEST)],
        steps=4,
    )


def _front(x: float, y: float, facing: int) -> Actor:
    """Returns an actor that stands still and faces `facing`, with the middle of its front at (x, y)
    m.
    """
    yaw = facing * math.pi / 2
    pose = [x - HALF * math.cos(yaw), y - HALF * math.sin(yaw), 0.0, yaw]
    return Actor(poses=np.tile(pose, (MOST_STEPS + 1, 1)), weights=FRONT_ONLY)


def _tiny(
    name: str,
    cells: list[str],
    robots: list[tuple[int, int]],
    actors: list[Actor],
    steps: int,
    motion: Motion = STRAIGHT,
    headings: tuple[int, ...] = (EAST, EAST),
    goals: tuple[tuple[int, int] | None, ...] = (None, None),
    stationarity: float = 0.0,
) -> Problem:
    """Builds a tiny scene; `cells` are rows from north to south, `#` is wall."""
    walls = np.array([[cell == "#" for cell in row] for row in reversed(cells)]).T
    return Problem(
        name=name,
        height_map=HeightMap(heights=np.where(walls, WALL, 0.0)),
        robots=tuple(
            Robot(start=State(x, y, heading=heading), motion=motion, camera=CAMERA, goal=goal)
            for (x, y), heading, goal in zip(robots, headings, goals, strict=False)
        ),
        actors=tuple(actors),
        horizon=steps,
        objective=Objective(stationarity=stationarity),
    )


SCENES: dict[str, Callable[[int], Problem]] = {
    "tiny-approach": _tiny_approach,
    "tiny-hover": _tiny_hover,
    "tiny-share": _tiny_share,
    "tiny-queue": _tiny_queue,
    "tiny-doorway": _tiny_doorway,
    "tiny-turn": _tiny_turn,
    "tiny-trap": _tiny_trap,
    "tiny-hidden": _tiny_hidden,
    "tiny-give-way": _tiny_give_way,
    "tiny-head-on": _tiny_head_on,
}

# J of the best plan, as derived in the docstrings above; -inf: no plan exists.
TINY_OPTIMA = {
    "tiny-approach": 37.0,
    "tiny-hover": 27.5,
    "tiny-share": 27 * math.sqrt(2),
    "tiny-queue": 6 * math.sqrt(41),
    "tiny-doorway": 12 + 6 * math.sqrt(41),
    "tiny-turn": 55.0,
    "tiny-trap": 27.0,
    "tiny-hidden": 0.0,
    "tiny-give-way": 2.0,
    "tiny-head-on": -math.inf,
}
