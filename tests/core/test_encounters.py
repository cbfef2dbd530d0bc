"""Where it makes sense to start: places from which somebody can be met."""

import numpy as np
import pytest
from strategies import standing

from cocap_opt.data import FloatArray
from cocap_opt.graph.encounters import Encounters
from cocap_opt.plausibility import warnings
from cocap_opt.problem import Actor, Motion, Problem, Robot, State
from cocap_opt.world.workspace import HeightMap, Mesh, Workspace

STEPS = 8
FLOOR, ROOF = [0, 1, 2, 3], [4, 5, 6, 7]


def courtyard() -> FloatArray:
    """Heights of a street, y < 6, and a courtyard of 4 x 4 cells that walls shut in."""
    heights = np.zeros((20, 20))
    heights[7:13, 7:13] = 20.0
    heights[8:12, 8:12] = 0.0
    return heights


def encounters(heights: FloatArray, *actors: Actor, steps: int = STEPS) -> Encounters:
    """Those of a drone at 5 m."""
    return Encounters(Workspace(HeightMap(heights=heights)), Motion(), actors, steps)


def test_nobody_starts_in_a_sealed_courtyard() -> None:
    """Though it is only a few metres from a person in the street; who is inside can be met."""
    outside = encounters(courtyard(), standing(10.5, 4.5, 0.0, 0.0, steps=STEPS))
    meets = outside.graph.without_border(outside.can_meet())[0]
    assert meets[10, 2] and not meets[8:12, 8:12].any()
    inside = encounters(courtyard(), standing(10.5, 10.5, 0.0, 0.0, steps=STEPS))
    meets = inside.graph.without_border(inside.can_meet())[0]
    assert meets[8:12, 8:12].all() and not meets[10, 2]


def test_who_is_too_far_away_in_time_is_not_met() -> None:
    """A drone flies one cell a step: within T steps it comes T cells nearer, no more."""
    street = np.zeros((60, 1))
    far = encounters(street, standing(0.5, 0.5, 0.0, 0.0, steps=STEPS))
    meets = far.graph.without_border(far.can_meet())[0, :, 0]
    assert meets[: 15 + STEPS + 1].all() and not meets[15 + STEPS + 1 :].any()
    moves = far.graph.without_border(far.moves_to_meet())[0, :, 0]
    assert (moves[:16] == 0).all() and moves[20] == 5


def test_an_outing_ends_at_walls_or_at_the_last_step() -> None:
    """The courtyard is closed; of the street, a square of cells is reached, within its walls."""
    outings = [
        encounters(courtyard(), standing(10.5, 0.5, 0.0, 0.0, steps=steps), steps=steps).outing
        for steps in (2, STEPS, 40)
    ]
    yard, street = State(9, 9), State(0, 0)
    assert outings[1](yard) == (16, True, False)
    assert outings[0](street) == (9, False, True)
    assert outings[2](street) == (400 - 36, True, True)


def shell(floor: bool) -> Mesh:
    """A hollow building around cells 8..11: walls and a roof, 6 m high, with a floor or without."""
    low, high = 7.5, 12.5
    corners = [(low, low), (high, low), (high, high), (low, high)]
    vertices = [(x, y, z) for z in (0.0, 9.0) for x, y in corners]
    sides = [(k, (k + 1) % 4, (k + 1) % 4 + 4, k + 4) for k in range(4)]
    squares = [*sides, tuple(ROOF), *([tuple(FLOOR[::-1])] if floor else [])]
    triangles = [t for a, b, c, d in squares for t in ((a, b, c), (a, c, d))]
    return Mesh(vertices=np.array(vertices), triangles=np.array(triangles))


def scene(start: State, *meshes: Mesh, heights: FloatArray | None = None) -> Problem:
    """A drone at 5 m and a person in the street."""
    return Problem(
        name="courtyard",
        height_map=HeightMap(heights=np.zeros((20, 20)) if heights is None else heights),
        meshes=meshes,
        robots=(Robot(start=start),),
        actors=(standing(10.5, 4.5, 0.0, 0.0, steps=STEPS),),
        horizon=STEPS,
    )


@pytest.mark.parametrize(
    ("problem", "words"),
    [
        (scene(State(9, 9), heights=courtyard()), "drone 0 is shut in a pocket of 16 cells"),
        (scene(State(9, 9), shell(floor=False)), "drone 0 is shut in a pocket of 16 cells"),
        (scene(State(2, 2), shell(floor=False)), "meshes[0] has no floor"),
    ],
)
def test_a_drone_that_is_shut_in_is_said(problem: Problem, words: str) -> None:
    """By walls of a height map, or by a hollow building, which is said to have no floor."""
    assert any(warning.startswith(words) for warning in warnings(problem))


def test_a_drone_that_can_get_nowhere_is_said() -> None:
    """A single free cell between walls; in the street nothing is doubtful."""
    heights = courtyard()
    heights[8:12, 8:12] = 20.0
    heights[9, 9] = 0.0
    assert warnings(scene(State(9, 9), heights=heights)) == ["drone 0 can reach only 1 cell"]
    assert warnings(scene(State(2, 2), heights=heights)) == []
