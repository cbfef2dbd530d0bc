"""The motion and the time-expanded graph from their definition: tensor products, then pruned.

It is slow, since most of a product is out of reach, and the oracle of what is built directly.
"""

from __future__ import annotations  # networkx graphs take type arguments in stubs only

from collections.abc import Iterator
from itertools import product
from typing import TYPE_CHECKING, Any, cast

import networkx as nx

from cocap_opt.graph.networks import place_graph
from cocap_opt.problem import AnyCamera, Motion, Problem, State

if TYPE_CHECKING:
    Graph = nx.DiGraph[Any]


def _orientation_graph(motion: Motion, camera: AnyCamera) -> Graph:
    """The directed graph of orientations (heading, pitch), self-loops included."""
    graph: Graph = nx.DiGraph()
    for heading, pitch in product(range(motion.headings), range(len(camera.tilts))):
        graph.add_edges_from(
            ((heading, pitch), (next_heading, next_pitch))
            for next_heading in motion.headings_after(heading)
            for next_pitch in motion.pitches_after(pitch, len(camera.tilts))
        )
    return graph


def motion_graph(problem: Problem, robot: int) -> Graph:
    """The motion graph of one robot on the whole map; nodes are `State`, an edge is one step."""
    motion, camera = problem.robots[robot].motion, problem.robots[robot].camera
    graph = nx.tensor_product(
        place_graph(problem.workspace, motion), _orientation_graph(motion, camera)
    )
    names = {((z, x, y), turned): State(x, y, z, *turned) for (z, x, y), turned in graph}
    # The stubs of both functions say Graph where they return the type they are given.
    return cast("Graph", nx.relabel_nodes(graph, names))


def pruned_product(problem: Problem, robot: int) -> Graph:
    """The product of the motion graph and the path 0..T, pruned to ways from start to end."""
    steps: Graph = nx.path_graph(problem.horizon + 1, create_using=nx.DiGraph)
    graph = cast("Graph", nx.tensor_product(motion_graph(problem, robot), steps))
    _remove_near_people(graph, problem, robot)
    spec = problem.robots[robot]
    keep = {(start, 0) for start in problem.starts[robot]}
    keep |= {node for source in sorted(keep) for node in nx.descendants(graph, source)}
    ends = [(state, t) for state, t in keep if t == problem.horizon and spec.may_end_in(state)]
    keep &= set(_reached(graph.reverse(copy=False), ends))
    pruned: Graph = graph.subgraph(keep).copy()
    return pruned


def _remove_near_people(graph: Graph, problem: Problem, robot: int) -> None:
    """Remove the nodes and edges at which a robot is too close to somebody."""

    def near(t: int, *states: State) -> bool:
        at = problem.where(problem.robots[robot], states)
        return any(bool(problem.airspace.near_person(actor, t, *at)) for actor in problem.actors)

    if problem.airspace.people_aside:
        graph.remove_nodes_from([(s, t) for s, t in graph if near(t, s)])
        graph.remove_edges_from([(a, b) for a, b in graph.edges if near(a[1], a[0], b[0])])


def _reached(graph: Graph, sources: list[tuple[State, int]]) -> Iterator[tuple[State, int]]:
    for layer in nx.bfs_layers(graph, sources):
        yield from layer
