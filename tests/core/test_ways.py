"""Ways from home to the first places and back, and how long batteries must last."""

import itertools
import math
from collections.abc import Sequence

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from strategies import examples

from cocap_opt.data import FloatArray, ProblemError
from cocap_opt.files.documents import problem_digest
from cocap_opt.flight.ways import AirTime, Part, Way, parts_of_take, pauses_of, records_of
from cocap_opt.problem import (
    Airspace,
    CollisionRules,
    Limits,
    Motion,
    Plan,
    Problem,
    Robot,
    State,
)
from cocap_opt.problem.motion import Stride
from cocap_opt.world.workspace import HeightMap, Mesh

MOTION = Motion(layers=(3.0, 6.0), clearance=0.5)


def place(
    starts: Sequence[State],
    homes: Sequence[tuple[int, int] | None],
    blocked: Sequence[tuple[int, int]] = (),
    endurance: float | None = None,
    steps: int = 4,
    separation: float = 1.5,
    **fields: object,
) -> Problem:
    """A map of 9 x 7 cells of 1 m with houses of 4 m; steps of 2 s, so 0.5 m/s in the take."""
    heights = np.zeros((9, 7))
    for cell in blocked:
        heights[cell] = 4.0
    limits = None if endurance is None else Limits(endurance=endurance)
    robots = [
        Robot(start=start, home=home, motion=MOTION, limits=limits)
        for start, home in zip(starts, homes, strict=True)
    ]
    return Problem(
        name="place", height_map=HeightMap(heights=heights), robots=tuple(robots), actors=(),
        horizon=steps, rules=CollisionRules(separation=separation), step=2.0, **fields,
    )  # fmt: skip


def hovering(problem: Problem) -> Plan:
    """All drones stay."""
    steps = problem.horizon + 1
    return Plan(paths=tuple((robot.start,) * steps for robot in problem.robots))


def along(way: Way) -> FloatArray:
    """Points [n, 3] every few centimetres of a way."""
    parts = [
        a + (b - a) * np.linspace(0, 1, 1 + math.ceil(math.dist(a, b) / 0.05))[:, None]
        for a, b in itertools.pairwise(way.points)
    ]
    return np.concatenate(parts)


def at(problem: Problem, drone: int, state: State) -> FloatArray:
    """Where a drone is in a state (m)."""
    return np.array([state.x + 0.5, state.y + 0.5, MOTION.layers[state.layer]])


cells = st.tuples(st.integers(0, 8), st.integers(0, 6))


@examples(60)
@given(
    st.lists(cells, max_size=14, unique=True), st.lists(cells, min_size=4, max_size=4, unique=True),
    st.lists(st.integers(0, 1), min_size=2, max_size=2),
)  # fmt: skip
def test_ways_keep_away_from_houses_and_from_who_hovers(
    blocked: list[tuple[int, int]], given_cells: list[tuple[int, int]], layers: list[int]
) -> None:
    """Every few centimetres, beside the others where they are while one flies; in time, too."""
    homes, places = given_cells[:2], given_cells[2:]
    houses = [cell for cell in blocked if cell not in given_cells]
    starts = [State(*cell, layer) for cell, layer in zip(places, layers, strict=True)]
    try:
        problem = place(starts, homes, houses)
    except ProblemError as error:
        assert "must obey the rules" in str(error)
        return
    try:
        (part,) = parts_of_take(problem, hovering(problem))
    except ProblemError as error:
        assert "has no way" in str(error)  # the other is in the only way
        return
    assert (part.first, part.last) == (0, problem.horizon)
    for name in ("out", "back"):
        ways = [getattr(each, name) for each in part.drones]
        order = sorted(ways, key=lambda way: way.waits)
        waits = list(itertools.accumulate([0.0, *(way.seconds for way in order)]))
        assert [way.waits for way in order] == pytest.approx(waits[:-1])
        for k, way in enumerate(order):
            ground = np.array([homes[way.drone][0] + 0.5, homes[way.drone][1] + 0.5, 0.0])
            ends = [ground, at(problem, way.drone, starts[way.drone])]
            first, last = ends if name == "out" else ends[::-1]
            np.testing.assert_allclose(way.points[[0, -1]], [first, last])
            points = along(way)
            in_cells = np.floor(points[:, :2]).astype(int)
            over = problem.height_map.heights[in_cells[:, 0], in_cells[:, 1]]
            low = points[:, 2] < 2.4  # up and down at home
            assert (np.floor(points[low, :2]) == homes[way.drone]).all()
            assert (over[~low] < points[~low, 2] - 0.49).all()
            # Who waits longer is still at its place, or already.
            for other in order[k + 1 :]:
                hovers = at(problem, other.drone, starts[other.drone])
                assert np.linalg.norm(points - hovers, axis=1).min() > 1.5 - 1e-6
    for each in part.drones:
        total = each.out.seconds + each.out.waits + 8.0 + each.back.waits + each.back.seconds
        assert each.seconds == pytest.approx(total) and each.lasts


@examples(60)
@given(st.lists(cells, max_size=25, unique=True), cells, cells)
def test_ways_are_the_quickest(
    blocked: list[tuple[int, int]], home: tuple[int, int], cell: tuple[int, int]
) -> None:
    """As networkx finds them among moves that are listed by themselves."""
    houses = [each for each in blocked if each not in (home, cell)]
    problem = place([State(*cell, 0)], [home], houses)
    graph = nx.DiGraph()
    grid = list(itertools.product(range(9), range(7), range(2)))

    def free(x: int, y: int, layer: int) -> bool:
        return (x, y) not in houses or layer == 1

    for x, y, layer in grid:
        for dx, dy, up in itertools.product((-1, 0, 1), repeat=3):
            head = (x + dx, y + dy, layer + up)
            if head not in grid or (dx, dy, up) == (0, 0, 0):
                continue
            passed = {(x, y), head[:2], *([(x + dx, y), (x, y + dy)] if dx and dy else [])}
            if all(free(*each, min(layer, head[2])) for each in passed):
                seconds = max(math.hypot(dx, dy) / 0.5, 3.0 * abs(up))  # up and down at 1 m/s
                graph.add_edge((x, y, layer), head, weight=seconds)
    for layer in (0, 1):
        graph.add_edge((*home, layer), "ground", weight=MOTION.layers[layer])
    graph.add_node((*cell, 0))
    (part,) = parts_of_take(problem, hovering(problem))
    expected = nx.shortest_path_length(graph, (*cell, 0), "ground", weight="weight")
    assert part.drones[0].back.seconds == pytest.approx(expected)
    assert part.drones[0].out.seconds == pytest.approx(expected)


def test_limits_set_the_pace() -> None:
    """On the level 4 m/s where a drone can, and never more than it can; up and down likewise."""
    for limits, seconds in (
        (None, 3.0 + 12.0),
        (Limits(speed=10.0), 3.0 + 1.5),
        (Limits(speed=0.75), 3.0 + 8.0),
        (Limits(climb=9.0), 3.0 + 12.0),
    ):
        problem = place([State(7, 3)], [(1, 3)])
        robots = (problem.robots[0].replace(limits=limits),)
        (part,) = parts_of_take(problem.replace(robots=robots), hovering(problem))
        assert part.drones[0].back.seconds == pytest.approx(seconds)
        assert records_of([part])[0]["endurance"] is None


def test_takes_are_parted_as_late_as_batteries_let() -> None:
    """Each part lasts, and one step more would not; the parts follow each other."""
    steps = 30
    plans = hovering(place([State(3, 3), State(6, 3)], [(1, 1), (1, 5)], steps=steps))
    paths = list(plans.paths)
    paths[0] = tuple(State(3, 3 if t < 9 else 4 if t < 20 else 5) for t in range(steps + 1))
    plan = Plan(paths=tuple(paths))
    for endurance in (70.0, 80.0, 100.0, 130.0):
        problem = place(
            [State(3, 3), State(6, 3)], [(1, 1), (1, 5)], steps=steps, endurance=endurance
        )
        parts = parts_of_take(problem, plan)
        assert [part.first for part in parts] == [0, *(part.last for part in parts[:-1])]
        assert parts[-1].last == steps
        for part in parts:
            for each in part.drones:
                assert each.filming == 2.0 * (part.last - part.first)
                assert each.seconds <= endurance
            if part.last < steps:  # the tail from its first step on, one step longer
                tail = problem.replace(
                    horizon=part.last + 1 - part.first,
                    robots=tuple(
                        robot.replace(start=path[part.first], limits=None)
                        for robot, path in zip(problem.robots, plan.paths, strict=True)
                    ),
                )
                rest = Plan(paths=tuple(p[part.first : part.last + 2] for p in plan.paths))
                (longer,) = parts_of_take(tail, rest)
                assert max(each.seconds for each in longer.drones) > endurance
        words = pauses_of(parts)
        assert words.count("pause") == (len(parts) > 1)
        if len(parts) > 1:
            assert f" {parts[0].last}" in words and len(records_of(parts)) == 2 * len(parts)


def test_a_battery_that_lasts_for_no_step_is_named() -> None:
    """With the seconds that a step and the ways take."""
    problem = place([State(7, 3)], [(1, 3)], endurance=25.0)
    words = (
        "drone 0 cannot fly even one step from step 0 on: with its flights from and to home and "
        "the waits for others it is 32 s in the air, but its battery lasts 25 s; move its home"
    )
    with pytest.raises(ProblemError, match=words):
        parts_of_take(problem, hovering(problem))


def test_drones_that_are_shut_in_are_named() -> None:
    """By houses as high as all layers, or by a drone that hovers in the only gap."""
    wall = [(4, y) for y in range(7)]
    problem = place([State(7, 3)], [(1, 3)])
    heights = np.zeros((9, 7))
    heights[4] = 9.0
    high = problem.replace(height_map=HeightMap(heights=heights))
    with pytest.raises(
        ProblemError, match="drone 0 has no way from home to its place that is clear"
    ):
        parts_of_take(high, hovering(high))
    assert parts_of_take(place([State(7, 3)], [(1, 3)], wall), hovering(problem))  # over it
    zone = Mesh.box((1.0, 3.0, 1.0), (2.0, 4.0, 2.0))
    crown = Mesh.box((1.0, 3.0, 2.0), (2.0, 4.0, 8.0))
    for shut in ({"airspace": Airspace(no_fly=(zone,))}, {"meshes": (crown,)}):
        with pytest.raises(
            ProblemError,
            match=r"robots\[0\].home: cell \(1, 3\), at x = 1.5, y = 3.5 m, must be open",
        ):
            problem.replace(**shut)


def test_ways_lead_by_all_cells_whatever_the_moves_of_the_take() -> None:
    """Drones that move by several cells in a step, or may not climb, find the same ways home."""
    problem = place([State(7, 3)], [(2, 3)], [(4, y) for y in range(7)])
    wide = MOTION.replace(radius=4, spacing=2, stride=Stride(aside=2.0, upright=0.0))
    robots = tuple(robot.replace(motion=wide) for robot in problem.robots)
    parts = [parts_of_take(p, hovering(p)) for p in (problem, problem.replace(robots=robots))]
    ways = [[part.drones[0].out.points.tolist() for part in found] for found in parts]
    assert ways[0] == ways[1]


def test_drones_rise_and_sink_no_faster_than_their_limits() -> None:
    """At 1 m/s, or as slowly as limits say: up at one speed, down at another."""
    problem = place([State(1, 3)], [(1, 3)])
    times = []
    for limits in (None, Limits(climb=5.0, descent=5.0), Limits(climb=0.2, descent=0.5)):
        still = MOTION.replace(climb=0)  # in the take
        robots = tuple(robot.replace(limits=limits, motion=still) for robot in problem.robots)
        (part,) = parts_of_take(problem.replace(robots=robots), hovering(problem))
        times.append((part.drones[0].out.seconds, part.drones[0].back.seconds))
    assert times[0] == times[1] == (3.0, 3.0)
    assert times[2] == pytest.approx((15.0, 6.0))


def test_homes_are_checked_and_change_no_digest() -> None:
    """They are on the map, of all drones or none; plans for a scene fit it with any homes."""
    starts = [State(3, 3), State(6, 3)]
    plain = place(starts, [None, None])
    homed = place(starts, [(1, 1), (1, 5)])
    assert problem_digest(plain) == problem_digest(homed)
    for homes, words in (
        ([(1, 1), None], r"robots\[1\].home: must be given for all drones or for none"),
        ([(1, 1), (1, 1)], r"robots\[1\].home: must be in a cell of its own; robots\[0\] has"),
        ([(1, 1), (9, 1)], r"robots\[1\].home: must lie inside the map of 9 x 7 cells, not \(9, 1"),
        ([(1,), (1, 1)], "home: must be 2 numbers"),
    ):
        with pytest.raises(ProblemError, match=words):
            place(starts, homes)
    with pytest.raises(ProblemError, match="use fewer steps, or define homes, at which batteries"):
        place(starts, [None, None], endurance=7.0)
    assert place(starts, [(1, 1), (1, 5)], endurance=7.0).robots[0].limits is not None


def test_unknown_batteries_last() -> None:
    """Nothing is claimed where nobody knows how long they do."""
    way = Way(0, np.zeros((2, 3)), 10.0, 5.0)
    assert AirTime(0, way, 20.0, way, None).lasts
    assert not AirTime(0, way, 20.0, way, 49.9).lasts
    assert AirTime(0, way, 20.0, way, 50.0).lasts
    assert pauses_of([Part(0, 5, ())]) == ""
