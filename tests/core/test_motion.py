"""The networkx graphs of motion: what a robot can do in one step."""

import signal
from itertools import pairwise, product

import networkx as nx
import numpy as np
import pytest
from hypothesis import example, given
from pool import problems
from product_graph import motion_graph, pruned_product
from strategies import WALL, cameras, examples, height_maps, motions, tiny

from cocap_opt.data import MOST_TURN
from cocap_opt.graph.networks import (
    edges_in_reach,
    place_graph,
    reached_graph,
    time_expanded_graph,
)
from cocap_opt.problem import Camera, Motion, Plan, Problem, Robot, State
from cocap_opt.referee import _Referee
from cocap_opt.world.workspace import HeightMap, Workspace

PILLAR = HeightMap(heights=np.array([[0.0, 0.0], [0.0, 4.0]]))  # 4 m high in one corner of four


def one_robot(
    height_map: HeightMap,
    start: State,
    motion: Motion,
    horizon: int = 1,
    tilts: tuple[float, ...] = (0.2,),
    goal: tuple[int, int] | None = None,
) -> Problem:
    """Problem of one robot and nothing to see."""
    robot = Robot(start=start, motion=motion, camera=Camera(tilts=tilts), goal=goal)
    return Problem(name="", height_map=height_map, robots=(robot,), actors=(), horizon=horizon)


def all_states(problem: Problem) -> list[State]:
    """All states of the first robot in which it stands free."""
    motion, camera = problem.robots[0].motion, problem.robots[0].camera
    width, depth = problem.height_map.shape
    sizes = (width, depth, len(motion.layers), motion.headings, len(camera.tilts))
    states = (State(*indices) for indices in product(*map(range, sizes)))
    return [s for s in states if not problem.blocked(s.x, s.y, motion, s.layer)]


def test_default_actions() -> None:
    """The default action set is Greedy Perspectives': 3x3 cells times three turns, 27 in all."""
    problem = one_robot(HeightMap(heights=np.zeros((5, 5))), State(2, 2), Motion())
    heads = set(motion_graph(problem, 0)[State(2, 2)])
    assert heads == {
        State(x, y, 0, heading) for x in (1, 2, 3) for y in (1, 2, 3) for heading in (7, 0, 1)
    }


def test_the_first_move_is_to_stay() -> None:
    """Moves come without repetition, to stay first; climbing is limited to what exists."""
    for motion in (Motion(), Motion(radius=0), Motion(layers=(1.0, 2.0), climb=9, radius=2)):
        listed = motion.moves
        assert listed[0] == (0, 0, 0)
        assert len(set(listed)) == len(listed)
    assert len(Motion(layers=(1.0, 2.0), climb=9, radius=2).moves) == 3 * 25
    assert Motion(radius=0).moves == [(0, 0, 0)]


@example(PILLAR, Motion(layers=(3.0, 5.0), headings=1, corner_cutting=True), Camera())
@examples(25)
@given(height_maps(most_cells=8), motions(most_radius=2), cameras())
def test_graph_and_referee_agree_on_every_move(
    height_map: HeightMap, motion: Motion, camera: Camera
) -> None:
    """An edge is in the motion graph exactly where the referee finds nothing wrong with it."""
    robot = Robot(start=State(0, 0), motion=motion, camera=camera)
    heights = height_map.heights.copy()
    heights[0, 0] = 0.0
    problem = Problem(
        name="",
        height_map=height_map.replace(heights=heights),
        robots=(robot.replace(motion=motion.replace(clearance=min(motion.clearance, 1.0))),),
        actors=(),
        horizon=1,
    )
    graph, states = motion_graph(problem, 0), all_states(problem)
    assert set(graph) == set(states)
    for tail in states:
        team = (problem.robots[0].replace(start=tail),)
        started = problem.replace(robots=team)
        for head in states:
            broken = _Referee(started).violations(Plan(paths=((tail, head),)))
            assert (not broken) == graph.has_edge(tail, head), (tail, head, broken)


def test_with_corner_cutting_only_the_target_must_be_free() -> None:
    """With the papers' rule a robot may pass over a lower blocked cell while it climbs.

    The move up and the move back down are the same line, so both are allowed or neither.
    """
    motion = Motion(layers=(3.0, 5.0), headings=1, corner_cutting=True)
    graph = place_graph(Workspace(PILLAR), motion)
    low, high = (0, 0, 1), (1, 1, 1)  # beside the 4 m pillar, and above it
    assert graph.has_edge(high, low)
    assert graph.has_edge(low, high)


def test_no_corner_is_cut() -> None:
    """A diagonal move past one blocked cell is not allowed, unless corners may be cut."""
    heights = np.zeros((2, 2))
    heights[0, 1] = WALL
    for cutting in (False, True):
        graph = place_graph(Workspace(HeightMap(heights=heights)), Motion(corner_cutting=cutting))
        assert graph.has_edge((0, 0, 0), (0, 1, 1)) == cutting
        assert graph.has_edge((0, 1, 1), (0, 0, 0)) == cutting
        assert graph.has_edge((0, 0, 0), (0, 1, 0))
        assert (0, 0, 1) not in graph


def test_a_long_move_does_not_jump_a_wall() -> None:
    """With a radius of two, a robot does not pass through a blocked cell on its line."""
    heights = np.zeros((3, 1))
    heights[1, 0] = WALL
    height_map = HeightMap(heights=heights)
    assert not place_graph(Workspace(height_map), Motion(radius=2)).has_edge((0, 0, 0), (0, 2, 0))
    assert place_graph(Workspace(height_map), Motion(radius=2, corner_cutting=True)).has_edge(
        (0, 0, 0), (0, 2, 0)
    )


def test_climbing_passes_no_blocked_layer() -> None:
    """A climbing move needs its cells free in both layers unless corners may be cut."""
    graph = place_graph(Workspace(PILLAR), Motion(layers=(3.0, 5.0)))
    assert not graph.has_edge((0, 0, 1), (1, 1, 1))
    assert not graph.has_edge((1, 1, 1), (0, 0, 1))
    assert graph.has_edge((1, 0, 1), (1, 1, 1))


def _dense_line(dx: int, dy: int) -> set[tuple[int, int]]:
    """Cells whose closed square holds one of many exact points of the line, in integers.

    All points where the line enters or leaves a cell are among them.
    """
    n = 4 * max(1, abs(dx)) * max(1, abs(dy))
    touched = set()
    for k in range(n + 1):
        x, y = dx * k, dy * k  # n times the coordinates
        for i, j in product(range(-3, 4), repeat=2):
            if abs(2 * x - 2 * n * i) <= n and abs(2 * y - 2 * n * j) <= n:
                touched.add((i, j))
    return touched


@pytest.mark.parametrize(("dx", "dy"), list(product(range(-3, 4), repeat=2)))
def test_swept_cells_are_those_the_line_touches(dx: int, dy: int) -> None:
    """The cells of a move are exactly those that the line between the centres touches."""
    cells = Motion.swept_cells(dx, dy)
    assert set(cells) == _dense_line(dx, dy)
    assert {(0, 0), (dx, dy)} <= set(cells)
    assert {(-i, -j) for i, j in cells} == set(Motion.swept_cells(-dx, -dy))
    assert {(dx - i, dy - j) for i, j in cells} == set(cells)  # the way back


@examples(40)
@given(height_maps(most_cells=8), motions(most_radius=2))
def test_place_graph_is_sound(height_map: HeightMap, motion: Motion) -> None:
    """Nodes are the free places, each may be stayed in, and no edge leaves map or radius."""
    graph = place_graph(Workspace(height_map), motion)
    free = motion.free_places(Workspace(height_map))
    assert set(graph) == set(map(tuple, np.argwhere(free).tolist()))
    for node in graph:
        assert graph.has_edge(node, node)
    for a, b in graph.edges:
        reach = [abs(i - k) for i, k in zip(a, b, strict=True)]
        assert reach[0] <= motion.climb
        assert max(reach[1:]) <= motion.radius
    if not motion.corner_cutting:
        assert nx.utils.graphs_equal(graph, graph.reverse())


def test_headings_are_a_ring_and_pitches_a_line() -> None:
    """A robot turns from the last heading to the first, but no gimbal wraps around."""
    assert Motion().headings_after(0) == {7, 0, 1}
    assert Motion().pitches_after(0, 3) == {0, 1}
    assert Motion().pitches_after(2, 3) == {1, 2}
    problem = one_robot(PILLAR, State(0, 0), Motion(), tilts=(0.1, 0.2, 0.3))
    heads = motion_graph(problem, 0)[State(0, 0)]
    assert State(0, 0, heading=7, pitch=1) in heads
    assert State(0, 0, pitch=2) not in heads
    assert State(0, 0, heading=2) not in heads


@pytest.mark.parametrize("headings", [1, 2, 3])
def test_few_headings(headings: int) -> None:
    """With one, two or three headings a single turn reaches all of them, each once."""
    for heading in range(headings):
        assert Motion(headings=headings).headings_after(heading) == set(range(headings))


def test_a_robot_that_turns_freely() -> None:
    """However many headings a step may turn, finding those reached takes no longer."""

    def too_long(*_: object) -> None:
        raise TimeoutError

    before = signal.signal(signal.SIGVTALRM, too_long)
    signal.setitimer(signal.ITIMER_VIRTUAL, 0.5)  # of this process: others may be busy
    try:
        motion = Motion(turn=MOST_TURN, pitch_turn=MOST_TURN)
        for _ in range(10_000):
            assert motion.headings_after(3) == set(range(8))
            assert motion.pitches_after(3, 8) == set(range(8))
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
        signal.signal(signal.SIGVTALRM, before)


@examples(25)
@given(problems(robots=[1]))
def test_time_expanded_graph_holds_what_lies_on_a_path(problem: Problem) -> None:
    """A node is kept exactly where a path from the start to a legal end passes through it.

    People, who close places for a while, are left to the next property.
    """
    open_to_people = problem.airspace.replace(people_aside=0.0, people_above=None)
    problem = problem.replace(airspace=open_to_people)
    graph = time_expanded_graph(problem, 0)
    steps, robot = motion_graph(problem, 0), problem.robots[0]
    forward = [set(problem.starts[0])]
    for _ in range(problem.horizon):
        forward.append({head for state in forward[-1] for head in steps[state]})
    backward = [{s for s in steps if robot.goal in (None, (s.x, s.y))}]
    for _ in range(problem.horizon):
        backward.append({tail for state in backward[-1] for tail in steps.predecessors(state)})
    expected = [f & b for f, b in zip(forward, reversed(backward), strict=True)]
    assert set(graph) == {(state, t) for t, states in enumerate(expected) for state in states}
    for (a, t), (b, u) in graph.edges:
        assert u == t + 1
        assert steps.has_edge(a, b)
    for t, (now, following) in enumerate(pairwise(expected)):
        inside = sum(1 for a in now for b in steps[a] if b in following)
        assert inside == sum(1 for (_, u), _ in graph.edges if u == t)


@examples(25)
@given(problems(robots=[1]))
def test_time_expanded_graph_is_the_pruned_product(problem: Problem) -> None:
    """Built step by step it has the nodes and edges of the product, people and goals included."""
    graph = time_expanded_graph(problem, 0)
    assert nx.utils.graphs_equal(graph, pruned_product(problem, 0))
    assert [t for _, t in graph] == sorted(t for _, t in graph)


@examples(25)
@given(problems(robots=[1]))
def test_edges_are_counted_before_they_are_made(problem: Problem) -> None:
    """The estimate is never too low, and exact where people close nothing."""
    edges = reached_graph(problem, 0).number_of_edges()
    estimate = edges_in_reach(problem, 0, 10**9)
    assert estimate == edges if not problem.airspace.people_aside else estimate >= edges


def test_unreachable_goal_leaves_no_graph() -> None:
    """Where the goal cannot be reached in time, the time-expanded graph is empty."""
    problem = one_robot(HeightMap(heights=np.zeros((5, 1))), State(0, 0), Motion(), 2, goal=(4, 0))
    assert len(time_expanded_graph(problem, 0)) == 0
    assert len(time_expanded_graph(problem.replace(horizon=4), 0)) > 0


def test_default_graph_of_the_tiny_instance() -> None:
    """The tiny instance never changes unnoticed: its graph has known numbers of nodes."""
    graph = time_expanded_graph(tiny(), 0)
    assert [sum(1 for _, t in graph if t == step) for step in range(3)] == [1, 9, 20]
