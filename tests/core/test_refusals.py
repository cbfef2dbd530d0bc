"""Starts that are refused: all at once, each with the nearest free place."""

import math
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from strategies import examples

from cocap_opt.data import ProblemError
from cocap_opt.problem import (
    Actor,
    Airspace,
    CollisionRules,
    Motion,
    Problem,
    Robot,
    StartStates,
    State,
)
from cocap_opt.problem.refusals import refused_starts, told
from cocap_opt.problem.scene import SceneData
from cocap_opt.world.workspace import HeightMap, Mesh

LAYERS = (5.0, 8.0)


def street(
    blocked: list[tuple[int, int]], starts: list[State], separation: float = 2.0
) -> SceneData:
    """A map of 8 x 6 cells with houses of 6 m, and a person in the middle of cell (4, 3)."""
    heights = np.zeros((8, 6))
    for cell in blocked:
        heights[cell] = 6.0
    return SceneData(
        name="street",
        height_map=HeightMap(heights=heights),
        robots=tuple(Robot(start=start, motion=Motion(layers=LAYERS)) for start in starts),
        actors=(Actor(poses=np.tile([4.5, 3.5, 0.0, 0.0], (3, 1))),),
        horizon=2,
        rules=CollisionRules(separation=separation),
        airspace=Airspace(people_aside=1.2, people_above=4.0),
    )


def may_start(scene: SceneData, state: State) -> bool:
    """One cell looked at by itself, by the rules of the scene, in other words than the program."""
    x, y = state.x + 0.5, state.y + 0.5
    height = LAYERS[state.layer]
    if scene.height_map.heights[state.x, state.y] >= height:
        return False
    aside = math.hypot(x - 4.5, y - 3.5)
    top = scene.actors[0].shape.height
    return not (aside < 1.2 and height < top + 4.0)


def apart(a: State, b: State, separation: float) -> bool:
    """Distance of two starts on flat ground."""
    up = LAYERS[a.layer] - LAYERS[b.layer]
    return math.dist((a.x, a.y, 0), (b.x, b.y, up)) >= separation and a[:3] != b[:3]


def largest(scene: SceneData, layer: int) -> set[tuple[int, int]]:
    """The cells of the largest free areas at a flight height, by filling one after the other."""
    left = {
        (x, y) for x in range(8) for y in range(6)
        if scene.height_map.heights[x, y] < LAYERS[layer]
    }  # fmt: skip
    areas: list[set[tuple[int, int]]] = []
    while left:
        area, edge = set[tuple[int, int]](), [left.pop()]
        while edge:
            x, y = edge.pop()
            area.add((x, y))
            beside = {(x + 1, y), (x - 1, y), (x, y + 1), (x, y - 1)}
            if scene.robots[0].motion.corner_cutting:
                beside |= {(x + i, y + j) for i in (-1, 1) for j in (-1, 1)}
            edge += beside & left
            left -= beside
        areas.append(area)
    most = max(map(len, areas), default=0)
    return {cell for area in areas for cell in area if len(area) == most}


cells = st.tuples(st.integers(0, 7), st.integers(0, 5))
places = st.builds(lambda cell, layer: State(*cell, layer), cells, st.integers(0, 1))


@examples(60)
@given(
    st.lists(cells, max_size=40), st.lists(places, min_size=1, max_size=4),
    st.sampled_from((0.0, 1.5, 2.5)), st.booleans(),
)  # fmt: skip
def test_the_places_that_are_proposed_are_free_nearest_and_apart(
    blocked: list[tuple[int, int]], starts: list[State], separation: float, cuts: bool
) -> None:
    """By going through all cells, those of the largest area first; taken all, they are a scene."""
    scene = street(blocked, starts, separation)
    motion = Motion(layers=LAYERS, corner_cutting=cuts)
    scene = scene.replace(robots=tuple(robot.replace(motion=motion) for robot in scene.robots))
    refusals = refused_starts(scene)
    refused = {found.robot: found for found in refusals}
    kept = [state for i, state in enumerate(starts) if i not in refused]
    assert all(may_start(scene, state) for state in kept)
    for i, state in enumerate(starts):  # the second of two that are too close
        before = [k for k in range(i) if k not in refused]
        free = may_start(scene, state) and all(apart(state, starts[k], separation) for k in before)
        assert free == (i not in refused)
    taken = list(kept)
    for found in refusals:
        grid = (State(x, y, found.state.layer) for x in range(8) for y in range(6))
        open_ = [
            place for place in grid
            if may_start(scene, place) and all(apart(place, each, separation) for each in taken)
        ]  # fmt: skip
        roomy = largest(scene, found.state.layer)
        best = [place for place in open_ if place[:2] in roomy] or open_
        far = [math.dist(place[:2], found.state[:2]) for place in best]
        assert (found.nearest is None) == (not open_)
        if found.nearest is not None:
            assert found.nearest in best
            away = math.dist(found.nearest[:2], found.state[:2])
            assert away == min(far)
            nearer = (place for place in open_ if math.dist(place[:2], found.state[:2]) < away)
            assert found.has_nearer == any(nearer)
            taken.append(found.nearest)
    if refusals and all(found.nearest is not None for found in refusals):
        fixed = [refused[i].nearest if i in refused else s for i, s in enumerate(starts)]
        robots = tuple(
            robot.replace(start=state) for robot, state in zip(scene.robots, fixed, strict=True)
        )
        assert not refused_starts(scene.replace(robots=robots))


def test_all_refused_starts_are_in_one_line() -> None:
    """With the reason, the nearest place in metres and as a cell, and another flight height."""
    starts = [State(1, 1), State(6, 5), State(4, 3), State(6, 4), State(0, 5, 1)]
    scene = street([(1, 1), (1, 2)], starts)
    line = told(scene, refused_starts(scene))
    assert line.split("; ") == [
        "robots[0].start: cell (1, 1) is blocked: height 6 m, flight height 5 m",
        "the nearest free place, 1 m away, is x = 0.5, y = 1.5, cell (0, 1)",
        "here it is free at 8 m",
        "robots[2].start: is 0.00 m from person 0 at step 0, must be 1.2 m from people or 4 m "
        "above",
        "the nearest free place, 1.414 m away, is x = 3.5, y = 2.5, cell (3, 2)",
        "here it is free at 8 m",
        "robots[3].start: is 1.00 m from robots[1].start, must obey the rules separation 2 m",
        "the nearest free place, 1 m away, is x = 6.5, y = 3.5, cell (6, 3)",
        "here it is free at 8 m",
    ]
    fields = {name: getattr(scene, name) for name in scene.__struct_fields__}
    with pytest.raises(ProblemError, match=re.escape(line)):
        Problem(**fields)


def test_no_closed_yard_is_proposed() -> None:
    """The yard is nearer, but nobody gets out of it; where all else is taken it will do."""
    walls = [(x, y) for x in range(3) for y in range(3) if (x, y) != (0, 0)]
    scene = street(walls, [State(0, 1)])
    assert told(scene, refused_starts(scene)).endswith(
        "; the nearest free place that is not shut in, 2 m away, is x = 0.5, y = 3.5, "
        "cell (0, 3); here it is free at 8 m"
    )
    few = [(x, y) for x in range(8) for y in range(6) if (x, y) not in ((0, 0), (7, 4), (7, 5))]
    scene = street(few, [State(7, 5), State(0, 1)])
    assert told(scene, refused_starts(scene)).endswith(
        "; the nearest free place, 1 m away, is x = 0.5, y = 0.5, cell (0, 0); "
        "here it is free at 8 m"
    )


def test_where_nothing_is_free_it_is_said() -> None:
    """At this height, and of another one where it is; of many, so many are named."""
    everywhere = [(x, y) for x in range(8) for y in range(6)]
    scene = street(everywhere, [State(1, 1)])
    assert told(scene, refused_starts(scene)).endswith(
        "; no cell is free at 5 m; here it is free at 8 m"
    )
    many = street(everywhere, [State(x, y) for x in range(8) for y in range(2)])
    assert told(many, refused_starts(many)).endswith("; 4 more are rejected")


def test_zones_are_named_and_one_of_several_states() -> None:
    """A no-fly zone closes a cell, also where a drone may choose."""
    scene = street([], [State(1, 1)])
    zone = Mesh.box((0.0, 0.0, 0.0), (3.0, 3.0, 20.0))
    scene = scene.replace(airspace=Airspace(no_fly=(zone,)))
    line = told(scene, refused_starts(scene))
    assert line == (
        "robots[0].start: cell (1, 1) is in a no-fly zone, flight height 5 m; "
        "the nearest free place, 2 m away, is x = 1.5, y = 3.5, cell (1, 3)"
    )
    low = scene.replace(airspace=Airspace(no_fly=(zone,), ceiling=4.0))
    assert "cell (1, 1) is in a no-fly zone, flight" in told(low, refused_starts(low))
    low = low.replace(airspace=Airspace(ceiling=4.0))
    assert "cell (1, 1) is above the ceiling, flight height 5 m" in told(low, refused_starts(low))
    states = StartStates(states=(State(5, 5), State(2, 2), State(1, 2)))
    several = scene.replace(robots=(scene.robots[0].replace(start=states),))
    (found,) = refused_starts(several)
    assert found.field == "robots[0].start.states[0]"
    assert found.state == State(1, 2)
