"""The compiled graph is the networkx graph, and its sweep is plain dynamic programming."""

import gc
import math
import time
import weakref
from itertools import pairwise
from typing import NamedTuple

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from product_graph import motion_graph
from strategies import WALL, cameras, examples, height_maps, motions

from cocap_opt.data import FloatArray
from cocap_opt.graph.charges import NO_CHARGES, Charges
from cocap_opt.graph.frames import Frame
from cocap_opt.graph.motion import Window
from cocap_opt.graph.move_rewards import Bonuses
from cocap_opt.graph.networks import time_expanded_graph
from cocap_opt.graph.timegraph import CLOSED, TimeGraph
from cocap_opt.graph.value_iteration import backward_sweep, best_path, leads_to_goal
from cocap_opt.problem import Camera, Motion, Problem, Robot, State
from cocap_opt.world.workspace import HeightMap, Workspace

Node = tuple[State, int]


class Case(NamedTuple):
    """One robot with nothing to see, and its compiled graph."""

    problem: Problem
    graph: TimeGraph

    @property
    def start(self) -> int:
        """Number of the start state."""
        return self.graph.index(self.problem.robots[0].start)


def make_case(
    height_map: HeightMap,
    motion: Motion,
    start: State,
    horizon: int,
    tilts: tuple[float, ...] = (0.2,),
    goal: tuple[int, int] | None = None,
) -> Case:
    """Case of one robot."""
    robot = Robot(start=start, motion=motion, camera=Camera(tilts=tilts), goal=goal)
    problem = Problem(name="", height_map=height_map, robots=(robot,), actors=(), horizon=horizon)
    return Case(problem, TimeGraph(Workspace(height_map), motion, len(tilts)))


@st.composite
def cases(draw: st.DrawFn, goals: bool = False) -> Case:
    """Random maps, motions, gimbals and starts."""
    height_map, motion = draw(height_maps(most_cells=12)), draw(motions(5, most_radius=3))
    heights = height_map.heights.copy()
    heights[0, 0] = 0.0
    height_map = height_map.replace(heights=heights)
    camera = draw(cameras())
    start = State(0, 0, len(motion.layers) - 1, draw(st.integers(0, motion.headings - 1)))
    goal = None
    if goals and draw(st.booleans()):
        free = np.argwhere(heights < motion.layers[-1] - motion.clearance).tolist()
        goal = tuple(draw(st.sampled_from(free)))
    return make_case(height_map, motion, start, draw(st.integers(1, 5)), camera.tilts, goal)


@examples(35)
@given(cases())
def test_successors_are_those_of_networkx(case: Case) -> None:
    """Every state has the same successors in the compiled graph as in the networkx graph."""
    graph = motion_graph(case.problem, 0)
    for state in graph:
        expected = sorted(case.graph.index(head) for head in graph[state])
        assert case.graph.successors(0, case.graph.index(state)).tolist() == expected
    assert int(case.graph.free.sum()) * case.graph.n_orientations == len(graph)


@examples(40)
@given(cases())
def test_reachable_states_are_the_time_expanded_graph(case: Case) -> None:
    """The reachable set of the compiled graph is the node set of the time-expanded graph."""
    reachable = case.graph.reachable([case.start], case.problem.horizon)
    nodes = {(case.graph.state(int(s)), int(t)) for t, s in np.argwhere(reachable)}
    assert nodes == set(time_expanded_graph(case.problem, 0))


@examples(20)
@given(cases(goals=True), st.integers(0, 3), st.integers(0, 2**32 - 1))
def test_a_window_has_all_that_is_in_reach(case: Case, more: int, seed: int) -> None:
    """In a window around a start, as wide as it flies, nothing is missing and values are the same.

    A wider one, which may cut moves of places beyond reach, changes nothing either.
    """
    (robot,), horizon = case.problem.robots, case.problem.horizon
    motion, start = robot.motion, robot.start
    workspace = case.problem.workspace
    window = Window.around([(start.x, start.y)], motion.radius * horizon + more, workspace)
    graph = TimeGraph(workspace, motion, len(robot.camera.tilts), window)
    part, whole = (g.reachable([g.index(start)], horizon) for g in (graph, case.graph))
    nodes = [(t, graph.state(s)) for t, s in np.argwhere(part).tolist()]
    assert nodes == [(t, case.graph.state(s)) for t, s in np.argwhere(whole).tolist()]
    rewards = np.random.default_rng(seed).integers(0, 4, len(nodes)).astype(float)
    paths = []
    for g, reached in ((graph, part), (case.graph, whole)):
        reward = g.no_reward(horizon)
        reward[reached] = rewards
        value = backward_sweep(g, reward, goal=robot.goal)
        path = best_path(g, value, g.index(start))
        paths.append((value[reached].tolist(), path and [g.state(s) for s in path]))
    assert paths[0] == paths[1]


def test_cells_outside_a_window_have_no_number() -> None:
    """A state outside is an error, not the number of another state."""
    window = Window(1, 1, 3, 3)
    graph = TimeGraph(Workspace(HeightMap(heights=np.zeros((4, 4)))), Motion(), 1, window)
    assert graph.state(graph.index(State(2, 1))) == State(2, 1)
    with pytest.raises(IndexError, match=r"cell \(0, 2\) is not in Window"):
        graph.index(State(0, 2))


@examples(20)
@given(cases(), st.data())
def test_reachable_of_several_starts_is_the_union(case: Case, data: st.DataObject) -> None:
    """What several robots reach is the union of what each reaches."""
    states = [case.graph.index(state) for state in motion_graph(case.problem, 0)]
    starts = data.draw(st.lists(st.sampled_from(states), min_size=1, max_size=3))
    together = case.graph.reachable(starts, 2)
    alone = [case.graph.reachable([start], 2) for start in starts]
    assert (together == np.logical_or.reduce(alone)).all()


@examples(15)
@given(cases())
def test_numbering_is_one_to_one(case: Case) -> None:
    """State numbers and states, and places and their coordinates, map back to each other."""
    graph = case.graph
    for state in motion_graph(case.problem, 0):
        index = graph.index(state)
        assert 0 <= index < graph.n_states
        assert graph.state(index) == state
        place = graph.place(state.layer, state.x, state.y)
        assert index % graph.n_places == place
        assert graph.coordinates(np.array([place]))[:, 0].tolist() == [
            state.layer, state.x, state.y,
        ]  # fmt: skip


@st.composite
def charges(draw: st.DrawFn, graph: TimeGraph, horizon: int) -> Charges:
    """Random charges on places, moves and states: finite, negative and infinite."""
    free = np.flatnonzero(graph.free).tolist()
    costs = st.sampled_from([0.5, 3.0, -2.0, math.inf])
    at = st.tuples(st.integers(0, graph.n_orientations - 1), st.sampled_from(free))
    states = draw(
        st.dictionaries(
            st.tuples(st.integers(0, horizon), at.map(lambda k: k[0] * graph.n_places + k[1])),
            costs,
            max_size=4,
        )
    )
    places = draw(
        st.dictionaries(
            st.tuples(st.integers(0, horizon), st.sampled_from(free)), costs, max_size=5
        )
    )
    rows = graph.neighbours(np.arange(graph.n_places))
    edges = [(tail, int(head)) for row in rows for tail, head in enumerate(row) if head >= 0]
    moves = draw(
        st.dictionaries(
            st.tuples(st.integers(0, horizon - 1), st.sampled_from(edges)).map(
                lambda key: (key[0], *key[1])
            ),
            costs,
            max_size=12,
        )
    )
    return Charges(places, moves, states)


RATES = st.sampled_from([0.0, 0.0, 0.3, 5.0])
BONUSES = st.builds(Bonuses, RATES, RATES, RATES, RATES)


class Priced(NamedTuple):
    """Node rewards, rewards for moves and charges over one graph, for the plain algorithms."""

    graph: TimeGraph
    reward: FloatArray  # [T+1, S]
    bonuses: Bonuses
    charges: Charges

    def _place(self, state: State) -> int:
        return self.graph.place(state.layer, state.x, state.y)

    def at(self, state: State, t: int) -> float:
        """Reward of being in a state, less its charge."""
        charge = self.charges.places.get((t, self._place(state)), 0.0)
        charge += self.charges.states.get((t, self.graph.index(state)), 0.0)
        return float(self.reward[t, self.graph.index(state)]) - charge

    def along(self, tail: State, head: State, t: int) -> float:
        """Reward of one step, less its charge."""
        charge = self.charges.moves.get((t, self._place(tail), self._place(head)), 0.0)
        still = tail == head, tail[:3] == head[:3], tail.heading == head.heading
        kinds = *still, head.x - tail.x == tail.y - head.y
        gain = sum(rate for rate, kind in zip(self.bonuses, kinds, strict=True) if kind)
        return gain - charge

    def of_path(self, path: list[int]) -> float:
        """Value of a path of state numbers."""
        states = [self.graph.state(s) for s in path]
        total = sum(self.at(state, t) for t, state in enumerate(states))
        steps = enumerate(pairwise(states))
        return total + sum(self.along(tail, head, t) for t, (tail, head) in steps)

    def values(self, expanded: "nx.DiGraph[Node]", horizon: int) -> dict[Node, float]:
        """Reward to go of every node of a time-expanded graph, by recursion from the end."""
        value: dict[Node, float] = {}
        for state, t in sorted(expanded, key=lambda node: -node[1]):
            ahead = 0.0
            if t < horizon:
                ahead = max(
                    self.along(state, head, t) + value[head, u] for head, u in expanded[state, t]
                )
            value[state, t] = self.at(state, t) + ahead
        return value


@examples(30)
@given(cases(goals=True), st.data())
def test_backward_sweep_is_dynamic_programming(case: Case, data: st.DataObject) -> None:
    """The sweep's values are those of plain dynamic programming over the networkx graph.

    With random rewards, also for moves themselves, finite and infinite charges on places and
    moves, and a goal; and the path read off attains the value.
    """
    graph, horizon, goal = case.graph, case.problem.horizon, case.problem.robots[0].goal
    rng = np.random.default_rng(data.draw(st.integers(0, 2**32)))
    reward = graph.no_reward(horizon) + rng.random((horizon + 1, graph.n_states))
    bonuses = data.draw(BONUSES)
    priced = Priced(graph, reward, bonuses, data.draw(charges(graph, horizon)))
    value = backward_sweep(graph, reward, bonuses, priced.charges, goal)
    expanded = time_expanded_graph(case.problem, 0)
    for (state, t), expected in priced.values(expanded, horizon).items():
        assert value[t, graph.index(state)] == pytest.approx(expected, abs=1e-12)
    if (case.problem.robots[0].start, 0) not in expanded:
        assert value[0, case.start] == CLOSED
    path = best_path(graph, value, case.start, bonuses, priced.charges)
    assert (path is None) == (value[0, case.start] == CLOSED)
    if path is not None:
        assert path[0] == case.start
        assert len(path) == horizon + 1
        nodes = [(graph.state(s), t) for t, s in enumerate(path)]
        assert nx.is_path(expanded, nodes)
        assert priced.of_path(path) == pytest.approx(value[0, case.start], abs=1e-9)


@examples(20)
@given(cases(goals=True), st.data())
def test_frames_hold_all_that_a_robot_can_reach(case: Case, data: st.DataObject) -> None:
    """A sweep in them gives every state in reach the value that a sweep over all states gives it.

    It does so to the last bit, under bonuses, charges and a goal, and when it is swept again.
    """
    graph, horizon, goal = case.graph, case.problem.horizon, case.problem.robots[0].goal
    rng = np.random.default_rng(data.draw(st.integers(0, 2**32)))
    reward = graph.no_reward(horizon) + rng.random((horizon + 1, graph.n_states))
    bonuses, charged = data.draw(BONUSES), data.draw(charges(graph, horizon))
    free = np.flatnonzero(np.tile(graph.free, graph.n_orientations))
    start = data.draw(st.sampled_from(free.tolist())) if len(free) else case.start
    reached = graph.reachable([start], horizon)
    frames = Frame.all_from(graph, np.array([start]), horizon)
    value = backward_sweep(graph, reward, bonuses, charged, goal)
    found = backward_sweep(graph, reward, bonuses, charged, goal, frames=frames)
    assert np.array_equal(found[reached], value[reached])
    last = int(rng.integers(0, horizon + 1))
    reward[: last + 1] *= 0.5
    value = backward_sweep(graph, reward, bonuses, charged, goal)
    earlier = (found, last)
    found = backward_sweep(graph, reward, bonuses, charged, goal, earlier=earlier, frames=frames)
    assert np.array_equal(found[reached], value[reached])


@examples(20)
@given(cases())
def test_sweep_changes_nothing_it_is_given(case: Case) -> None:
    """The reward array is the caller's: a sweep and the path read off it leave it as it was."""
    reward = case.graph.no_reward(case.problem.horizon)
    reward += np.linspace(0, 1, reward.size).reshape(reward.shape)
    before = reward.copy()
    bonuses = Bonuses(1.0, 2.0, 3.0, 4.0)
    value = backward_sweep(case.graph, reward, bonuses)
    swept = value.copy()
    best_path(case.graph, value, case.start, bonuses)
    assert (reward == before).all()
    assert (value == swept).all()


def test_closed_outside_the_free_states() -> None:
    """No reward array and no value is finite in a blocked cell or in the border."""
    heights = np.zeros((3, 3))
    heights[1, 1] = WALL
    graph = TimeGraph(Workspace(HeightMap(heights=heights)), Motion(headings=2), 1)
    free = np.tile(graph.free, graph.n_orientations)
    assert int(graph.free.sum()) == 8
    value = backward_sweep(graph, graph.no_reward(2))
    assert (value[:, free] == 0.0).all()
    assert (value[:, ~free] == CLOSED).all()


def test_ties_go_to_the_calmest_step() -> None:
    """Among equally good paths the one that moves and turns least is read off."""
    graph = TimeGraph(Workspace(HeightMap(heights=np.zeros((3, 1)))), Motion(headings=1), 1)
    value = backward_sweep(graph, graph.no_reward(2))
    path = best_path(graph, value, graph.index(State(1, 0)))
    assert path is not None
    assert [graph.state(s).x for s in path] == [1, 1, 1]
    value[1, graph.index(State(1, 0))] = -1.0
    path = best_path(graph, value, graph.index(State(1, 0)))
    assert path is not None
    assert [graph.state(s).x for s in path] == [1, 0, 0]  # of both sides the lower number


def test_a_closed_start_has_no_path() -> None:
    """Where the start itself is closed or all ways out are, there is no path."""
    graph = TimeGraph(Workspace(HeightMap(heights=np.zeros((2, 1)))), Motion(headings=1), 1)
    here, there = graph.place(0, 0, 0), graph.place(0, 1, 0)
    for charges in (
        Charges({(0, here): math.inf}),
        Charges({(1, here): math.inf, (1, there): math.inf}),
        Charges({(1, here): math.inf}, {(0, here, there): math.inf}),
    ):
        value = backward_sweep(graph, graph.no_reward(1), charges=charges)
        assert best_path(graph, value, here, charges=charges) is None


def test_a_charged_place_is_left_for_a_cheaper_one() -> None:
    """A finite charge is a price: it is paid where the reward is worth it, and only there."""
    graph = TimeGraph(Workspace(HeightMap(heights=np.zeros((2, 1)))), Motion(headings=1), 1)
    here, there = graph.place(0, 0, 0), graph.place(0, 1, 0)
    reward = graph.no_reward(1)
    reward[1, there] = 1.0
    for cost, expected in ((0.4, [here, there]), (1.5, [here, here])):
        for charges in (Charges({(1, there): cost}), Charges({}, {(0, here, there): cost})):
            value = backward_sweep(graph, reward, charges=charges)
            assert best_path(graph, value, here, charges=charges) == expected
            assert value[0, here] == pytest.approx(max(0.0, 1.0 - cost))


def test_staying_can_be_charged() -> None:
    """Where it costs more than another way, that is taken; turns on the spot are charged, too."""
    graph = TimeGraph(Workspace(HeightMap(heights=np.zeros((2, 1)))), Motion(headings=2), 1)
    here, there = graph.place(0, 0, 0), graph.place(0, 1, 0)
    for rate in (0.0, 0.2):
        bonuses = Bonuses(rate, rate)
        reward = graph.no_reward(2)
        reward[:, here] += 1.0
        charges = Charges({}, {(0, here, here): 0.5, (1, here, here): math.inf})
        value = backward_sweep(graph, reward, bonuses, charges)
        assert best_path(graph, value, here, bonuses, charges) == [here, there, here]
        assert value[0, here] == 2.0
        assert value[1, here + graph.n_places] == 0.0


@pytest.mark.parametrize(
    ("shape", "motion"),
    [
        ((1, 1), Motion(radius=0, headings=1, turn=0)),
        pytest.param((1, 1), Motion(radius=16, headings=1), marks=pytest.mark.slow),
        ((1, 1), Motion(radius=0, headings=360, turn=2)),
        ((1, 1), Motion(radius=1, headings=2, turn=0)),
        ((2, 1), Motion(radius=0, headings=3, layers=(1.0, 2.0, 3.0, 4.0), climb=3)),
        ((1, 5), Motion(radius=3, headings=2, turn=5, layers=(1.0, 2.0), climb=0)),
        ((3, 2), Motion(radius=4, headings=1, layers=tuple(map(float, range(1, 12))), climb=99)),
    ],
)
def test_extreme_motions(shape: tuple[int, int], motion: Motion) -> None:
    """Maps of one cell, radius 0 or beyond the map, one heading or many, many layers."""
    case = make_case(HeightMap(heights=np.zeros(shape)), motion, State(0, 0), 2)
    expanded = time_expanded_graph(case.problem, 0)
    reachable = case.graph.reachable([case.start], 2)
    assert int(reachable.sum()) == len(expanded)
    reward = case.graph.no_reward(2) + np.arange(case.graph.n_states) % 7
    bonuses = Bonuses(0.5, 0.25, 1.5, 2.0)
    priced = Priced(case.graph, reward, bonuses, NO_CHARGES)
    value = backward_sweep(case.graph, reward, bonuses)
    for (state, t), expected in priced.values(expanded, 2).items():
        assert value[t, case.graph.index(state)] == pytest.approx(expected, abs=1e-12)


def test_long_horizons() -> None:
    """A thousand steps on a small map are no more than a thousand small sweeps."""
    graph = TimeGraph(Workspace(HeightMap(heights=np.zeros((3, 3)))), Motion(headings=4), 1)
    reward = graph.no_reward(1000)
    reward[1000, graph.index(State(2, 2, 0, 2))] = 1.0
    value = backward_sweep(graph, reward)
    path = best_path(graph, value, graph.index(State(0, 0)))
    assert path is not None
    assert graph.state(path[-1]) == State(2, 2, 0, 2)


@pytest.mark.slow
def test_long_moves_on_a_wide_map_are_compiled_in_seconds() -> None:
    """A million edges take a few seconds: once they took half a minute."""
    begin = time.perf_counter()
    graph = TimeGraph(
        Workspace(HeightMap(heights=np.zeros((40, 40)))), Motion(radius=16, headings=1), 1
    )
    assert int(graph.allowed.sum()) == (40 * 33 - 16 * 17) ** 2
    assert time.perf_counter() - begin < 15


def test_graphs_are_made_once() -> None:
    """The same map and motion give the same compiled graph; another map never does."""
    workspace, motion = Workspace(HeightMap(heights=np.zeros((3, 3)))), Motion(headings=4)
    again = Workspace(workspace.height_map)
    assert TimeGraph.of(workspace, motion, 1) is TimeGraph.of(again, Motion(headings=4), 1)
    other = Workspace(HeightMap(heights=np.zeros((3, 3))))
    assert TimeGraph.of(other, motion, 1) is not TimeGraph.of(workspace, motion, 1)
    assert TimeGraph.of(workspace, motion, 2) is not TimeGraph.of(workspace, motion, 1)


@pytest.mark.slow
def test_graphs_that_nobody_uses_are_forgotten() -> None:
    """All but the last two, for a graph may be as large as the memory; what is in use stays."""
    workspace = Workspace(HeightMap(heights=np.zeros((3, 3))))
    used = TimeGraph.of(workspace, Motion(headings=4), 1)
    known = [weakref.ref(TimeGraph.of(workspace, Motion(headings=4), n)) for n in (2, 3, 4)]
    gc.collect()
    assert [one() is None for one in known] == [True, False, False]
    assert TimeGraph.of(workspace, Motion(headings=4), 1) is used


@pytest.mark.slow
def test_states_that_lead_to_a_goal_are_kept_with_their_graph() -> None:
    """They are computed once for each goal and horizon, and go when nobody uses the graph."""
    graph = TimeGraph(Workspace(HeightMap(heights=np.zeros((3, 3)))), Motion(headings=1), 1)
    leads = leads_to_goal(graph, 2, (0, 0))
    assert leads_to_goal(graph, 2, (0, 0)) is leads
    assert [int(step.sum()) for step in leads] == [9, 4, 1]
    assert [int(step.sum()) for step in leads_to_goal(graph, 1, (1, 1))] == [9, 1]
    used = weakref.ref(leads)
    del graph, leads
    gc.collect()
    assert used() is None


@examples(60)
@given(cases(), st.integers(0, 2), st.integers(0, 2**32 - 1))
def test_moves_that_may_pass_are_all_found(case: Case, reach: int, seed: int) -> None:
    """Of all moves, those that are left out are farther than `reach` along x or y all the time."""
    graph, rng = case.graph, np.random.default_rng(seed)
    tails, heads = graph.moves_around(0, 0, max(graph.shape))
    one = int(rng.integers(len(tails)))
    ends = [graph.coordinates(places[one : one + 1])[1:, 0].tolist() for places in (tails, heads)]
    found = set(zip(*(x.tolist() for x in graph.moves_past(*map(tuple, ends), reach)), strict=True))
    before, after = (
        graph.coordinates(places)[1:].T - end
        for places, end in zip((tails, heads), ends, strict=True)
    )
    for k, move in enumerate(zip(tails.tolist(), heads.tolist(), strict=True)):
        ways = np.array([before[k], after[k]])
        apart = ((ways > reach).all(axis=0) | (ways < -reach).all(axis=0)).any()
        assert (move in found) is not bool(apart)
