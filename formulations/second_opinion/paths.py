"""The best path of one drone by networkx: the longest path of its priced time-expanded graph."""

from __future__ import annotations  # networkx graphs take type arguments in stubs only

import math
from typing import TYPE_CHECKING

from cocap_opt.graph.networks import Node, keep_paths
from cocap_opt.problem import Cell, Objective, Problem, State

if TYPE_CHECKING:
    from cocap_opt.graph.networks import Graph

Worth = tuple[float, float]  # a sum, and that of the absolute values that it is made of
Uses = dict[tuple[object, ...], float]  # cost of (t, Cell), (t, State) and (t, Cell, Cell)


def longest_path(
    problem: Problem, robot: int, graph: Graph, paid: dict[Node, float], uses: Uses
) -> Worth:
    """Returns the worth of a robot's best path; -infinite where it has none.

    Parameters
    ----------
    graph : all that the robot can reach from its start
    paid : for being in a node
    """
    import networkx as nx  # a fifth of a second, which few commands need

    cells = {state: problem.cell(robot, state) for state in {state for state, _ in graph}}

    def worth(node: Node) -> float:
        state, t = node
        cost = uses.get((t, cells[state]), 0.0) + uses.get((t, state), 0.0)
        return paid.get(node, 0.0) - cost

    start = problem.robots[robot].start, 0
    worths = {node: worth(node) for node in graph}
    weighted = _weighted(problem.objective, graph, worths, cells, uses)
    keep_paths(weighted, problem, robot)
    if start not in weighted or worths[start] == -math.inf:
        return -math.inf, 0.0
    edges = [edge for _, _, edge in weighted.edges(data=True)]
    lift = max(0.0, -min(edge["weight"] for edge in edges))
    for edge in edges:
        edge["weight"] += lift
    length = float(nx.dag_longest_path_length(weighted))
    lifted, first = problem.horizon * lift, worths[start]
    return length - lifted + first, length + lifted + abs(first)


def _weighted(
    objective: Objective,
    graph: Graph,
    worth: dict[Node, float],
    cells: dict[State, Cell],
    uses: Uses,
) -> Graph:
    """Returns the nodes and edges of a graph that are open and in reach, edges with weights.

    An edge weighs what its move and its head are worth; the start's own worth is in none.
    """
    import networkx as nx

    rewarded = any(
        (objective.stationarity, objective.keep_cell, objective.keep_heading, objective.balanced)
    )
    charged = {use[0] for use in uses if len(use) == 3}  # steps from which moves are charged
    weighted: Graph = nx.DiGraph()
    weighted.add_nodes_from(list(graph)[:1])
    for tail in graph:
        if tail not in weighted:
            continue
        (state, t), edges = tail, []
        for head in graph[tail]:
            weight = worth[head]
            if rewarded:
                weight += _reward_of_move(objective, state, head[0])
            if t in charged:
                weight -= uses.get((t, cells[state], cells[head[0]]), 0.0)
            if weight > -math.inf:
                edges.append((tail, head, weight))
        weighted.add_weighted_edges_from(edges)
    return weighted


def _reward_of_move(objective: Objective, tail: State, head: State) -> float:
    """Returns what the objective pays for one step, whatever is seen."""
    reward = objective.stationarity if tail == head else 0.0
    if tail[:3] == head[:3]:
        reward += objective.keep_cell
    if tail.heading == head.heading:
        reward += objective.keep_heading
    if tail.x + tail.y == head.x + head.y:
        reward += objective.balanced
    return reward
