"""Scenes in which walls funnel people and drones: corridor, bottleneck, passage and bridge.

Cells are 1 m wide and walls 10 m high. A comment before each scene explains what happens in it.
"""

from collections.abc import Callable
from itertools import pairwise

import numpy as np

from cocap_opt.problem import Camera, Motion, Problem
from cocap_opt.scenarios.built_in import SIZE, Point, Room, drones, walker
from cocap_opt.world.workspace import HeightMap, Mesh

# -- Corridor: two people walk through a narrow passage, and two drones film them from behind.
#
#                  #######
#     yard         #######
#       R    0  1    --->      passage of one or two cells, walls 10 m high
#         R        #######
#                  #######
#
# Why collisions are likely. The camera looks 10 degrees down and sees 41 degrees down at most,
# so from 5 m above the ground people are seen best from about 5 m away. The walls hide them
# from all places but those in line with the passage. The drones are a little faster than the
# people, cannot get past them in time, and so each one's best path ends in the same one or two
# cells that trail the last person by 5 m: a second drone in the best cell adds 41 % to the reward
# of the first, which is worth more than any other cell. Planned one by one, both go there.
#
# Why the optimum itself suffers in the tight variant. Two identical drones can exchange roles at no
# cost, so a contested place costs something only if no other place is as good. In a passage of one
# cell, places are ordered by their distance to the people: two drones that start at its mouth are
# there at the same steps, and the one that gives way films everything from a metre farther away
# until the end.


def _corridor(seed: int) -> Problem:
    """Two people walk through a narrow passage, and two drones film them from behind.

    The passage is two cells wide, and the drones start anywhere in front of it. The seed chooses
    the drones' cells and headings, and the people's pace and distance.
    """
    return _any_corridor("corridor", seed, width=2, pace=0.95, starts=Room(3, 7, 9, 21))


def _corridor_tight(seed: int) -> Problem:
    """Two people walk through a passage so narrow that only one drone can film from its best place.

    The passage is one cell wide, and the drones start at its mouth. The seed chooses the same as
    in the wider corridor.
    """
    return _any_corridor("corridor-tight", seed, width=1, pace=0.9, starts=Room(5, 9, 13, 18))


def _any_corridor(name: str, seed: int, width: int, pace: float, starts: Room) -> Problem:
    """Builds the scene with a passage of `width` cells; people walk about `pace` m per step."""
    rng = np.random.default_rng(seed)
    steps = 8
    mouth, end = 9, 16  # cells x at which the passage begins and ends
    lead, spacing = -1.0, 2.0  # m, of the last person beyond the mouth, and to the one ahead
    low = 15 - width // 2
    middle = low + width / 2
    # One walks on the left and one on the right, their boxes (1 m wide) off the walls.
    side = 0.8 * (width - 1) / 2
    actors = []
    for j, y in enumerate((middle - side, middle + side)):
        walking_pace = pace + rng.uniform(-0.03, 0.03)
        x = mouth + lead + spacing * j + rng.uniform(-0.2, 0.2)
        actors.append(walker([(0.0, y), (SIZE, y)], x, walking_pace, steps))
    return Problem(
        name=name,
        height_map=Room.cut_into_rock(
            Room(0, mouth, 0, SIZE),
            Room(mouth, end, low, low + width),
            Room(end, SIZE, 0, SIZE),
        ),
        robots=drones(2, starts.cells, [7, 0, 1], rng),
        actors=tuple(actors),
        horizon=steps,
    )


# -- Bottleneck: four people come out of three corridors and leave by one exit, four drones film.
#
#              # 1 #
#           #### | ####
#     3 --- 0 -- square ====> exit
#           #### | ####              all around: walls 10 m high
#              # 2 #
#
# Why collisions are likely. The people's ways cross before the exit and merge in it, one behind
# the other. A camera that looks 10 degrees down sees people best from about 5 m away, and most of
# the time there is a place from which it sees several of them in one image at that distance; walls
# leave few such places. A face that k drones see equally well is worth sqrt(k), so the best view of
# four people beats a fresh view of one, and drones planned one by one meet there.
#
# Why the optimum itself suffers in the tight variant. Identical drones can exchange roles at no
# cost, so most collisions in a good plan can be resolved without loss. Here all people are soon in
# an exit of one cell. Drones that film them must be in line with it, and the places in line are
# ordered by how well they see. The drones, which start at the mouth, need the same best place at
# the same steps, but only one gets it, the next is a metre behind, and so on.


def _bottleneck(seed: int) -> Problem:
    """Four people come out of three corridors and leave by one exit, and four drones film them.

    Corridors and exit are two cells wide, and the drones start anywhere on the square. The seed
    chooses the drones' cells and headings, and the people's pace and distances.
    """
    square = Room(10, 18, 12, 18)
    return _any_bottleneck("bottleneck", seed, square, square, width=2, first=6.5, spacing=1.8)


def _bottleneck_tight(seed: int) -> Problem:
    """Four people leave by an exit so narrow that four drones contend for the places behind them.

    Corridors and exit are one cell wide, and the drones start near the mouth of the exit. At step 0
    the first person enters the exit, and the next two are on the square already. The seed chooses
    the same as in the wider bottleneck.
    """
    square, starts = Room(12, 17, 12, 19), Room(13, 17, 13, 18)
    return _any_bottleneck(
        "bottleneck-tight", seed, square, starts, width=1, first=0.0, spacing=2.0
    )


def _any_bottleneck(
    name: str, seed: int, square: Room, starts: Room, width: int, first: float, spacing: float
) -> Problem:
    """Builds the scene.

    Parameters
    ----------
    width : of corridors and exit, in cells
    first, spacing : walking distance (m) of the first person from the exit at step 0, and the
        additional distance of each following person
    """
    rng = np.random.default_rng(seed)
    steps = 11
    low, left, mouth = 15 - width // 2, square.x0 + 2, square.x1
    gate, middle = left + width / 2, low + width / 2
    # People from the north leave on the south side, and the other way round, so that their ways
    # cross. Their boxes are 1 m wide and must stay off the walls.
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
        actors.append(walker(way, length - left_to_go, pace, steps))
    return Problem(
        name=name,
        height_map=Room.cut_into_rock(
            square,
            Room(0, SIZE, low, low + width),
            Room(left, left + width, 0, SIZE),
        ),
        robots=drones(4, starts.cells, list(range(8)), rng),
        actors=tuple(actors),
        horizon=steps,
    )


# -- Passage: eight drones must queue at a passage of one cell to film four people walking in it.
#
#                     #####
#     yard      RRR   #####
#            0  RRR1  2  3          passage of one cell, walls 10 m high; all walk to the right
#               RR    #####
#                     #####
#
# It is the tight corridor with more drones than the passage holds. They start close together
# before its mouth and are a little faster than the people, of whom two are in it at step 0 and
# two walk through it below the drones. Each drone would be best off in line with the passage, 5 m
# behind the people in it, or beyond it with the people who have left. Only one can fly in at a
# step, and none can overtake in the passage, so a plan must decide which drone enters when, which
# waits, and which films from the yard. Drones planned one by one, in another order than that of
# their places, block each other; in the constraint tree, each step of waiting is its own conflict.


def _passage(seed: int) -> Problem:
    """Four people walk through a passage of one cell, where eight drones must queue to film them.

    The seed chooses the drones' cells and headings, and the people's pace and distances.
    """
    rng = np.random.default_rng(seed)
    steps, people = 12, 4
    mouth, end = 9, 14  # cells x at which the passage begins and ends
    row = 15  # cell y of the passage
    lead, spacing = -3.0, 2.5  # m, of the last person beyond the mouth, and to the next one ahead
    middle = row + 0.5
    pace = 0.9 + rng.uniform(-0.03, 0.03)
    actors = []
    for j in range(people):
        x = mouth + lead + spacing * j + rng.uniform(-0.2, 0.2)
        actors.append(walker([(0.0, middle), (SIZE, middle)], x, pace, steps))
    return Problem(
        name="passage",
        height_map=Room.cut_into_rock(
            Room(0, mouth, 0, SIZE),
            Room(mouth, end, row, row + 1),
            Room(end, SIZE, 0, SIZE),
        ),
        robots=drones(8, Room(6, mouth, 13, 18).cells, [7, 0, 1], rng),
        actors=tuple(actors),
        horizon=steps,
    )


# -- Bridge: two people walk through an underpass, and three drones film them from both sides.
#
#             #######                      the deck, 6 to 7 m high, seen from the side:
#             #deck #
#      0 1 -->                                9 m   - - - - - - - - - -   above the deck
#             #     #                             ########
#       R     #######                         3 m - - - - - - - - - - -   below it
#
# A height map has one top in each cell, so in it the underpass would be solid rock, in which nobody
# can be seen, and which drones must fly over. As the deck is a mesh, drones can fly through below
# it, and drones above it do not see through it.


def _bridge(seed: int) -> Problem:
    """Two people walk through an underpass, and three drones film them from below and above a deck.

    The deck is a mesh. The seed chooses the drones' cells and headings, and the people's pace and
    distance.
    """
    rng = np.random.default_rng(seed)
    steps = 10
    deck, bottom, top = Room(12, 19, 11, 19), 6.0, 7.0  # m; embankments lie north and south of it
    heights = np.zeros((SIZE, SIZE))
    heights[deck.x0 : deck.x1] = top
    heights[deck.x0 : deck.x1, deck.y0 : deck.y1] = 0.0
    actors = []
    for x, y in ((8.0, 14.0), (10.0, 16.0)):
        first, pace = x + rng.uniform(-0.3, 0.3), 1.3 + rng.uniform(-0.1, 0.1)
        actors.append(walker([(0.0, y), (SIZE, y)], first, pace, steps))
    gimbal = Camera(tilts=(np.radians(10.0), np.radians(40.0)))
    team = drones(
        3, Room(3, 8, 10, 20).cells, [7, 0, 1], rng, Motion(layers=(3.0, 9.0), clearance=0.5)
    )
    return Problem(
        name="bridge",
        height_map=HeightMap(heights=heights),
        meshes=(Mesh.box((deck.x0, deck.y0, bottom), (deck.x1, deck.y1, top)),),
        robots=tuple(robot.replace(camera=gimbal) for robot in team),
        actors=tuple(actors),
        horizon=steps,
    )


SCENES: dict[str, Callable[[int], Problem]] = {
    "corridor": _corridor,
    "corridor-tight": _corridor_tight,
    "bottleneck": _bottleneck,
    "bottleneck-tight": _bottleneck_tight,
    "passage": _passage,
    "bridge": _bridge,
}
