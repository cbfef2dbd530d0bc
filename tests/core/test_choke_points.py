"""Choke points: the fewest cells through which all ways lead, against all smaller sets of cells."""

from itertools import combinations

import networkx as nx
import numpy as np
import pytest
from hypothesis import given, reject
from hypothesis import strategies as st
from strategies import WALL, examples, tiny

from cocap_opt.graph.choke_points import ChokePoint
from cocap_opt.graph.networks import place_graph, time_expanded_graph
from cocap_opt.model import compiled
from cocap_opt.problem import Cell, Motion, Problem, Robot, State
from cocap_opt.scenarios import load_scene
from cocap_opt.world.workspace import HeightMap


def scene(rows: list[str], horizon: int, motion: Motion | None = None) -> Problem:
    """Scene of a map drawn from above, x to the right and y down: # walls and D drones."""
    drawn = np.array([list(row) for row in rows]).T
    robots = [Robot(State(x, y), motion or Motion()) for x, y in np.argwhere(drawn == "D").tolist()]
    heights = np.where(drawn == "#", WALL, 0.0)
    return Problem(
        name="drawn", height_map=HeightMap(heights=heights), robots=tuple(robots), actors=(),
        horizon=horizon,
    )  # fmt: skip


def marked(rows: list[str], mark: str) -> set[Cell]:
    """The cells that have this mark."""
    return {Cell(x, y) for y, row in enumerate(rows) for x, c in enumerate(row) if c == mark}


DOOR = [
    "D.#oo",
    "D...o",
    "D.#oo",
]
TWO_DOORS = [
    "D.#ooooo",
    "D...oooo",
    "D.#.....",
    "..#.....",
    "..#.....",
    "..#.....",
    "........",
]


def test_a_door_is_a_choke_point() -> None:
    """Three drones must pass one door; two that stand on its two sides need not."""
    problem, wanted = scene(DOOR, 4), marked(DOOR, "o")
    found = ChokePoint.of(problem, wanted)
    assert found == ((Cell(1, 1),), 3, 5, 5)
    assert str(found) == "cell (1, 1)"
    other_side = problem.robots[0].replace(start=State(4, 1))
    assert ChokePoint.of(problem.replace(robots=(other_side, problem.robots[1])), wanted) is None
    assert ChokePoint.of(problem.replace(robots=problem.robots[:1]), wanted) is None


def test_starts_of_their_own_are_no_choke_points() -> None:
    """Where only two of three drones arrive in time, each on its own way, nobody queues."""
    rows = ["D.....#", "######o", "D.....#", "#######", "D######"]
    problem, wanted = scene(rows, 9, Motion(corner_cutting=True)), marked(rows, "o")
    assert ChokePoint.of(problem, wanted) is None


def test_ways_that_are_too_long_do_not_count() -> None:
    """A second door that is too far away for the last step leaves the first a choke point."""
    wanted = marked(TWO_DOORS, "o")
    near = ChokePoint.of(scene(TWO_DOORS, 6), wanted)
    assert near is not None
    assert len(near.cells) == 1
    assert near.cells[0].y == 1
    far = ChokePoint.of(scene(TWO_DOORS, 30), wanted)
    assert far is not None
    assert len(far.cells) == 2


def test_what_is_too_large_is_not_looked_at() -> None:
    """The number of cells in reach is limited, since warnings must be cheap."""
    problem, wanted = scene(DOOR, 4), marked(DOOR, "o")
    assert ChokePoint.of(problem, wanted, most=13) is not None
    assert ChokePoint.of(problem, wanted, most=12) is None
    assert ChokePoint.of(problem, wanted, most=3) is None
    assert ChokePoint.of(problem, set()) is None


@pytest.mark.parametrize(
    ("name", "cells"), [("passage", [(8, 15)]), ("bottleneck", [(17, 14), (17, 15)])]
)
def test_the_passages_of_built_in_scenes_are_found(name: str, cells: list[tuple[int, int]]) -> None:
    """Of all cells from which somebody is seen at the last step, some are behind the mouth."""
    problem = load_scene(name, 0)
    found = ChokePoint.of(problem, compiled(problem).cells_with_a_view(problem.horizon))
    assert found is not None
    assert found.cells == tuple(Cell(x, y) for x, y in cells)
    assert found.drones == len(problem.robots)


def test_views_of_cells_are_those_of_states() -> None:
    """A cell has a view at a step where some state in it sees a face."""
    problem = tiny()
    model = compiled(problem)
    expected = {
        problem.cell(robot, state)
        for robot in range(2)
        for state, t in time_expanded_graph(problem, robot)
        if t == 2 and model.coverage_at(
            model.class_of[robot], 2, np.array([model.class_of[robot].graph.index(state)])
        ).any()
    }  # fmt: skip
    assert model.cells_with_a_view(2) == expected
    assert expected


@st.composite
def drawings(draw: st.DrawFn) -> list[str]:
    """Small maps: drones and room on one side of a wall with a door or two, wanted cells behind.

    Cells of all kinds would rarely have a choke point, and a test has to draw maps that do.
    """
    depth = draw(st.integers(2, 4))

    def column(cells: str) -> list[str]:
        return draw(st.lists(st.sampled_from(cells), min_size=depth, max_size=depth))

    doors = draw(st.sets(st.integers(0, depth - 1), min_size=1, max_size=2))
    wall = ["." if row in doors else "#" for row in range(depth)]
    near = ["D" * depth, column(".D#")]
    behind = [column("oo.#"), column("o#.D")]
    return ["".join(row) for row in zip(*near, wall, *behind, strict=True)]


@examples(20)
@given(drawings(), st.integers(2, 7), st.booleans())
def test_no_fewer_cells_part_what_is_behind(rows: list[str], horizon: int, cutting: bool) -> None:
    """Nothing behind is reached in time without the cells; fewer leave a way to some of it."""
    drones, wanted = marked(rows, "D"), marked(rows, "o") | marked(rows, "D")
    problem = scene(rows, horizon, Motion(corner_cutting=cutting))
    found = ChokePoint.of(problem, wanted)
    if found is None:
        reject()
    places = place_graph(problem.workspace, problem.robots[0].motion)
    graph = nx.relabel_nodes(places, {(k, x, y): Cell(x, y, k) for k, x, y in places})

    def reached(without: tuple[Cell, ...]) -> set[Cell]:
        left = graph.subgraph(graph.nodes - set(without))
        sources = [drone for drone in drones if drone not in without]
        layers = zip(range(horizon + 1), nx.bfs_layers(left, sources), strict=False)
        return {cell for _, layer in layers for cell in layer}

    behind = (reached(()) & wanted) - reached(found.cells) - set(found.cells)
    assert (found.behind, found.wanted) == (len(behind), len(reached(()) & wanted))
    assert 0 < len(found.cells) < found.drones
    arrivals = [
        nx.single_source_shortest_path_length(graph, drone, horizon).keys() for drone in drones
    ]
    assert found.drones == sum(bool(behind & cells) for cells in arrivals)
    in_reach = graph.subgraph(reached(()))
    for fewer in combinations(sorted(set(in_reach) - behind), len(found.cells) - 1):
        left = in_reach.subgraph(in_reach.nodes - set(fewer))
        ways = [nx.descendants(left, drone) | {drone} for drone in drones if drone not in fewer]
        assert behind & set().union(*ways)
