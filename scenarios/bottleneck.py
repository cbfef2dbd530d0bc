"""Bottleneck: four people come out of three corridors and leave through one, four drones film.

             # # # north
             # 1   #
        ######     ####
    west 3  0   R R    exit -->
        ######  R  R###
             # 2   #
             # # # south
"""
import numpy as np

from cocap_opt.problem import Problem
from scenarios._parts import SIZE, Point, Room, drones, rooms_in_rock, walker

STEPS = 11  # horizon T


def bottleneck(seed: int) -> Problem:
    """Corridors of two cells; the drones start anywhere on the square."""
    square = Room(10, 18, 11, 19)
    return _scene("bottleneck", seed, square, square, width=2, first=7.0, spacing=1.8)


def bottleneck_tight(seed: int) -> Problem:
    """Corridors of one cell; the drones start at the mouth of the exit."""
    square, starts = Room(13, 18, 12, 19), Room(14, 18, 13, 18)
    return _scene("bottleneck-tight", seed, square, starts, width=1, first=0.0, spacing=2.0)


def _scene(
    name: str, seed: int, square: Room, starts: Room, width: int, first: float, spacing: float
) -> Problem:
    rng = np.random.default_rng(seed)
    low = 15 - width // 2
    middle, mouth = low + width / 2, square.x1
    gate = square.x0 + 2 + width / 2  # x of the middle of the corridors north and south
    side = 0.8 * (width - 1) / 2
    north: list[Point] = [
        (gate, SIZE), (gate, square.y1 - 1), (mouth - 0.5, middle - side), (SIZE, middle - side)
    ]  # fmt: skip
    south: list[Point] = [
        (gate, 0), (gate, square.y0 + 1), (mouth - 0.5, middle + side), (SIZE, middle + side)
    ]  # fmt: skip
    west: list[Point] = [(0, middle), (SIZE, middle)]
    pace = 1.0 + rng.uniform(-0.03, 0.03)
    actors = []
    for j, way in enumerate((west, north, south, west)):
        to_mouth = first + spacing * j + rng.uniform(-0.2, 0.2)
        length = sum(float(np.hypot(*np.subtract(b, a))) for a, b in zip(way, way[1:], strict=False))
        actors.append(walker(way, length - (SIZE - mouth) - to_mouth, pace, STEPS))
    return Problem(
        name=name,
        height_map=rooms_in_rock(
            square,
            Room(0, mouth, low, low + width), Room(mouth, SIZE, low, low + width),
            Room(square.x0 + 2, square.x0 + 2 + width, 0, SIZE),
        ),
        robots=drones(4, starts, list(range(8)), rng),
        actors=tuple(actors),
        horizon=STEPS,
    )
