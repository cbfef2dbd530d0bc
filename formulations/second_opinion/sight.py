"""What drones see from all nodes in their reach, node by node."""

from __future__ import annotations  # networkx graphs take type arguments in stubs only

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from cocap_opt.graph.motion import Window
from cocap_opt.graph.networks import Node
from cocap_opt.graph.timegraph import TimeGraph
from cocap_opt.problem import Problem, Robot
from cocap_opt.vision.faces import FaceGeometry
from cocap_opt.vision.views import Views

if TYPE_CHECKING:
    from cocap_opt.graph.networks import Graph

Seen = dict[Node, list[tuple[int, float]]]  # the faces that a node sees, and their px/m2


def seen_by_robots(problem: Problem, graphs: Sequence[Graph]) -> list[Seen]:
    """Returns what the nodes in reach of each robot see, or of any robot that sees alike."""
    geometry = FaceGeometry(problem)
    nodes: dict[tuple[object, ...], set[Node]] = {}
    specs: dict[tuple[object, ...], list[Robot]] = {}
    for robot, graph in zip(problem.robots, graphs, strict=True):
        nodes.setdefault((robot.motion, robot.camera), set()).update(graph)
        specs.setdefault((robot.motion, robot.camera), []).append(robot)
    seen = {
        sight: _seen_from(problem, geometry, alike, nodes[sight]) for sight, alike in specs.items()
    }
    return [seen[robot.motion, robot.camera] for robot in problem.robots]


def _seen_from(
    problem: Problem, geometry: FaceGeometry, alike: Sequence[Robot], nodes: set[Node]
) -> Seen:
    """Returns what robots that move and see alike see from their nodes."""
    spec, starts = alike[0], [(robot.start.x, robot.start.y) for robot in alike]
    window = Window.around(starts, spec.motion.radius * problem.horizon, problem.workspace)
    graph = TimeGraph.of(problem.workspace, spec.motion, len(spec.camera.tilts), window)
    views = Views.of(geometry, problem, graph, spec.camera)
    by_step: dict[int, list[int]] = {}
    for state, t in nodes:
        by_step.setdefault(t, []).append(graph.index(state))
    found: Seen = {}
    for t in range(problem.first_step, problem.horizon + 1):
        states = np.sort(np.array(by_step.get(t, []), dtype=np.int64))
        for some in np.array_split(states, -(-len(states) // views.batch) or 1):
            coverage = views.coverage(t, some)
            for row, face in np.argwhere(coverage > 0).tolist():
                node = graph.state(int(some[row])), t
                found.setdefault(node, []).append((face, float(coverage[row, face])))
    return found
