"""A town for measuring coverage: any number of cells, robots, people and steps.

Houses 8 to 20 m high and wide stand between streets; drones fly only in the streets. Each person
walks around a block. The drones' starts are spread over the map, so that together they reach nearly
all of its streets.
"""

import numpy as np
from numpy.typing import NDArray

from cocap_opt.data import BoolArray, FloatArray
from cocap_opt.problem import Actor, Motion, Problem, Robot, State
from cocap_opt.world.workspace import HeightMap

_STREET = 7.0  # m from house to house
HOUSE = 8.0, 20.0  # m, smallest and largest width, depth and height
PACE = 1.0  # m per step


def town(seed: int, robots: int, actors: int, cells: int, steps: int, resolution: float) -> Problem:
    """Builds a square town; the seed chooses the houses, walks and starts.

    Parameters
    ----------
    cells : along each edge
    resolution : m, edge of a cell
    """
    rng = np.random.default_rng(seed)
    ends = [_blocks(cells * resolution, rng) for _ in range(2)]
    heights = np.zeros((cells, cells))
    middles = (np.arange(cells) + 0.5) * resolution
    for left, right in zip(ends[0][:-1], ends[0][1:], strict=True):
        for low, high in zip(ends[1][:-1], ends[1][1:], strict=True):
            inside = [_inside(middles, left, right), _inside(middles, low, high)]
            heights[np.ix_(*inside)] = rng.uniform(*HOUSE)
    return Problem(
        name="town",
        height_map=HeightMap(heights=heights, resolution=resolution),
        robots=_spread(robots, heights == 0.0),
        actors=tuple(_walker(ends, steps, rng) for _ in range(actors)),
        horizon=steps,
    )


def _blocks(length: float, rng: np.random.Generator) -> FloatArray:
    """Returns the middles (m) of the parallel streets along one side of the town."""
    middles = [_STREET / 2]
    while middles[-1] + _STREET + HOUSE[1] < length:
        middles.append(middles[-1] + _STREET + rng.uniform(*HOUSE))
    return np.array(middles)


def _inside(x: NDArray[np.floating], left: float, right: float) -> BoolArray:
    """Returns True for places of a house between two streets."""
    result: BoolArray = (x > left + _STREET / 2) & (x < right - _STREET / 2)
    return result


def _walker(ends: list[FloatArray], steps: int, rng: np.random.Generator) -> Actor:
    """Makes a person who walks around a block, along the middles of its streets."""
    (left, right), (low, high) = (
        middles[k : k + 2] for middles, k in ((m, int(rng.integers(len(m) - 1))) for m in ends)
    )
    corners = np.array([[left, low], [right, low], [right, high], [left, high], [left, low]])
    sides = np.hypot(*np.diff(corners, axis=0).T)
    way = np.concatenate([[0.0], np.cumsum(sides)])
    walked = (rng.uniform(0, way[-1]) + PACE * np.arange(steps + 1)) % way[-1]
    side = np.searchsorted(way, walked, side="right") - 1
    yaw = np.arctan2(*np.diff(corners, axis=0)[:, ::-1].T)[side]
    x, y = (np.interp(walked, way, corner) for corner in corners.T)
    return Actor(poses=np.column_stack([x, y, np.zeros(steps + 1), yaw]))


def _spread(count: int, free: BoolArray) -> tuple[Robot, ...]:
    """Puts robots on the free cells that are nearest to points spread evenly over the map."""
    cells = np.argwhere(free)
    columns = max(int(np.ceil(np.sqrt(count))), 1)
    rows = -(-count // columns)
    robots = []
    for i in range(count):
        wanted = [(i % columns + 0.5) / columns, (i // columns + 0.5) / rows]
        offset = cells - np.array(wanted) * free.shape
        x, y = cells[np.argmin((offset**2).sum(axis=1))].tolist()
        robots.append(Robot(start=State(x, y, heading=i % 8), motion=Motion()))
    return tuple(robots)
