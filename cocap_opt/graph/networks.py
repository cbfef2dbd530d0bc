"""Motion of one robot as networkx graphs, for inspecting, counting or checking paths.

Planners and bounds use the compiled form, `timegraph`. This module builds the graphs node by node,
directly from the reachable states: most of the product of places, orientations and steps is not
reachable.
"""

from __future__ import annotations  # networkx graphs take type arguments in stubs only

from collections.abc import Iterator
from functools import cache
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from cocap_opt.graph.motion import Window, allowed_moves
from cocap_opt.graph.timegraph import TimeGraph
from cocap_opt.problem import Motion, Problem, State
from cocap_opt.world.workspace import Workspace

Place = tuple[int, int, int]  # (layer, x, y)
Node = tuple[State, int]  # (state, step)
if TYPE_CHECKING:
    import networkx as nx

    Graph = nx.DiGraph[Any]


def place_graph(workspace: Workspace, motion: Motion, window: Window | None = None) -> Graph:
    """Returns the directed graph of places (layer, x, y) and moves, self-loops included.

    Parameters
    ----------
    window : the part of the map to which robots are confined (default: all)
    """
    import networkx as nx  # takes a fifth of a second, and few commands need it

    window = window or Window.all_of(workspace)
    graph: Graph = nx.DiGraph()
    for (climb, dx, dy), starts in allowed_moves(workspace, motion, window):
        graph.add_edges_from(
            ((layer, x, y), (layer + climb, x + dx, y + dy))
            for layer, x, y in (np.argwhere(starts) + np.array([0, window.x0, window.y0])).tolist()
        )
    return graph


def reached_graph(problem: Problem, robot: int) -> Graph:
    """Returns the graph of all states that one robot can reach from its starts, step by step.

    Nodes are (State, t), in the order of their steps t = 0..T; an edge is a step that the robot can
    take. Nodes may be dead ends: a path through them need not reach the goal, or the last step.
    """
    import networkx as nx

    steps, states = _GridSteps(problem, robot), list(problem.starts[robot])
    graph: Graph = nx.DiGraph()
    graph.add_nodes_from((state, 0) for state in states)
    for t in range(problem.horizon):
        heads = {state: steps.after(t, state) for state in states}
        graph.add_edges_from(
            ((state, t), (head, t + 1)) for state, following in heads.items() for head in following
        )
        states = list(dict.fromkeys(head for following in heads.values() for head in following))
    return graph


def time_expanded_graph(problem: Problem, robot: int) -> Graph:
    """Returns the time-expanded graph of one robot; nodes (State, t) lie on a path from a start.

    The path lasts until step T and ends at the robot's goal, if it has one; if there is no such
    path, the graph is empty. Every planner searches this graph; `timegraph.TimeGraph` is its
    compiled form.
    """
    graph = reached_graph(problem, robot)
    keep_paths(graph, problem, robot)
    return graph


def keep_paths(graph: Graph, problem: Problem, robot: int) -> None:
    """Removes the nodes from which no path leads to step T, at the robot's goal if it has one.

    Parameters
    ----------
    graph : a graph with its nodes in the order of their steps, as from `reached_graph`
    """
    spec = problem.robots[robot]
    kept = {(state, t) for state, t in graph if t == problem.horizon and spec.may_end_in(state)}
    for node in reversed(list(graph)):
        if any(head in kept for head in graph[node]):
            kept.add(node)
    graph.remove_nodes_from([node for node in graph if node not in kept])


def edges_in_reach(problem: Problem, robot: int, most: int) -> int:
    """Returns the number of edges of `reached_graph`, or an upper bound, without building the
    graph.

    Cells closed by people count as open. The count stops once it exceeds `most`.
    """
    spec = problem.robots[robot]
    window = _reach(problem, robot)
    graph = TimeGraph.of(problem.workspace, spec.motion, len(spec.camera.tilts), window)
    degrees = np.count_nonzero(graph.allowed, axis=0)
    starts = graph.indices(problem.starts[robot].array)
    turned = set((starts // graph.n_places).tolist())
    reached = np.zeros(graph.n_places, dtype=bool)
    new, moves, edges = np.unique(starts % graph.n_places), 0, 0
    for _ in range(problem.horizon):
        reached[new] = True
        moves += int(degrees[new].sum())
        edges += moves * sum(len(graph.turns[k]) for k in turned)
        if edges > most:
            break
        heads = graph.neighbours(new).ravel()
        new = np.unique(heads[(heads >= 0) & ~reached[heads]])
        turned |= {head for k in turned for head in graph.turns[k]}
    return edges


def _reach(problem: Problem, robot: int) -> Window:
    """Returns the cells that a robot can reach."""
    spec = problem.robots[robot]
    cells = problem.starts[robot].columns
    return Window.around(cells, spec.motion.radius * problem.horizon, problem.workspace)


class _GridSteps:
    """The steps that one robot can take, computed on first use and cached."""

    def __init__(self, problem: Problem, robot: int) -> None:
        self._problem, self._spec = problem, problem.robots[robot]
        self._window = window = _reach(problem, robot)
        self._moves = list(allowed_moves(problem.workspace, self._spec.motion, window))
        self._keeps_away = problem.airspace.people_aside > 0
        self._turns, self._heads = cache(self._find_turns), cache(self._find_heads)
        self._open_heads, self._after = cache(self._find_open_heads), cache(self._find_after)

    def after(self, t: int, state: State) -> list[State]:
        """Returns the states at step t+1 to which one step leads from a state at t."""
        return self._after(t if self._keeps_away else 0, state)

    def _find_after(self, t: int, state: State) -> list[State]:
        here = state.layer, state.x, state.y
        heads = self._open_heads(t, here) if self._keeps_away else self._heads(here)
        return [
            State(x, y, layer, heading, pitch)
            for layer, x, y in heads
            for heading, pitch in self._turns(state.heading, state.pitch)
        ]

    def _find_turns(self, heading: int, pitch: int) -> list[tuple[int, int]]:
        """Returns the headings and pitches to which one step can turn."""
        motion, pitches = self._spec.motion, len(self._spec.camera.tilts)
        headings = sorted(motion.headings_after(heading))
        return list(product(headings, sorted(motion.pitches_after(pitch, pitches))))

    def _find_heads(self, place: Place) -> list[Place]:
        """Returns the places to which a move leads, regardless of people."""
        layer, x, y = place
        at = layer, x - self._window.x0, y - self._window.y0
        return [
            (layer + climb, x + dx, y + dy) for (climb, dx, dy), starts in self._moves if starts[at]
        ]

    def _find_open_heads(self, t: int, place: Place) -> list[Place]:
        """Returns the places to which a move leads from step t without coming too close to
        anybody.
        """
        return [head for head in self._heads(place) if not any(self._too_near(t, place, head))]

    def _too_near(self, t: int, tail: Place, head: Place) -> Iterator[bool]:
        """Yields, for each person, True if a move comes too close on the way or at its end."""
        states = [State(x, y, layer) for layer, x, y in (tail, head)]
        here, there = self._problem.where(self._spec, states)
        airspace = self._problem.airspace
        for actor in self._problem.distinct_people:
            yield bool(airspace.near_person(actor, t, here, there))
            yield bool(airspace.near_person(actor, t + 1, there))
