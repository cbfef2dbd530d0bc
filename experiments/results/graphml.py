"""The time-expanded graph of one drone as GraphML, which networkx, Gephi and igraph read."""

import math

import networkx as nx
import numpy as np

from cocap_opt.data import ProblemError
from cocap_opt.graph.move_rewards import Bonuses
from cocap_opt.graph.networks import Node, edges_in_reach, time_expanded_graph
from cocap_opt.model import compiled
from cocap_opt.objective import marginal_reward
from cocap_opt.problem import Problem

MOST_EDGES = 2_000_000  # of a file: half a gigabyte


def graphml(problem: Problem, robot: int) -> bytes:
    """Returns the time-expanded graph of a robot with its rewards, as a file's content.

    A node has the attributes step (0..T), x, y and z (m), heading and tilt (rad, from +x
    counter-clockwise and below the horizon), and reward: the weighted roots of the pixels per m2
    that the robot alone has there. The reward of an edge is that for the move. A node's id is
    step/x/y/layer/heading/pitch, in the indices that plans have.

    Raises
    ------
    ProblemError
        If the graph is too large, or empty since no path of the robot ends at its goal.
    """
    if edges_in_reach(problem, robot, MOST_EDGES) > MOST_EDGES:
        raise ProblemError(
            f"robots[{robot}]: the graph has more than {MOST_EDGES:,} edges; GraphML is for fewer"
        )
    graph = time_expanded_graph(problem, robot)
    if not graph:
        raise ProblemError(f"robots[{robot}]: no path ends at its goal, so there is no graph")
    rewards = _Rewards(problem, robot)
    named: nx.DiGraph[str] = nx.DiGraph(scene=problem.name, robot=robot, horizon=problem.horizon)
    for node, reward in zip(graph, rewards.of_nodes(list(graph)), strict=True):
        named.add_node(_name(node), **_place(problem, robot, node), reward=reward)
    edges = list(graph.edges)
    for (tail, head), reward in zip(edges, rewards.of_edges(edges), strict=True):
        named.add_edge(_name(tail), _name(head), reward=reward)
    return "\n".join(nx.generate_graphml(named)).encode()


def _name(node: Node) -> str:
    state, t = node
    return "/".join(map(str, (t, *state)))


def _place(problem: Problem, robot: int, node: Node) -> dict[str, float]:
    """Returns the attributes of a node but its reward."""
    state, t = node
    spec = problem.robots[robot]
    ((x, y, z),) = problem.where(spec, [state]).tolist()
    heading = math.tau * state.heading / spec.motion.headings
    tilt = spec.camera.tilts[state.pitch]
    return {"step": t, "x": x, "y": y, "z": z, "heading": heading, "tilt": tilt}


class _Rewards:
    """The rewards of a robot that is alone."""

    def __init__(self, problem: Problem, robot: int) -> None:
        model = compiled(problem)
        self._graph = model.class_of[robot].graph
        self._bonuses = Bonuses.of(problem.objective)
        self._views = marginal_reward(model, model.class_of[robot], problem.no_pixels())

    def of_nodes(self, nodes: list[Node]) -> list[float]:
        """Returns the rewards [n] for what is seen from nodes."""
        at = [(t, self._graph.index(state)) for state, t in nodes]
        rewards: list[float] = self._views[tuple(np.array(at).T)].tolist()
        return rewards

    def of_edges(self, edges: list[tuple[Node, Node]]) -> list[float]:
        """Returns the rewards [n] for moves."""
        ends = [[self._graph.index(state) for state, _ in edge] for edge in edges]
        tails, heads = np.array(ends).T
        rewards: list[float] = self._bonuses.of_edges(self._graph.shape, tails, heads).tolist()
        return rewards
