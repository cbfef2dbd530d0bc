"""The time-expanded graph of one drone as GraphML, which networkx, Gephi and igraph can read."""

import math
from collections.abc import Callable, Iterator
from html import escape
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from cocap_opt.data import IntArray, ProblemError
from cocap_opt.graph.move_rewards import Bonuses
from cocap_opt.graph.networks import edges_in_reach, time_expanded_graph
from cocap_opt.model import compiled
from cocap_opt.objective import marginal_reward
from cocap_opt.problem import Problem, State

if TYPE_CHECKING:
    from cocap_opt.graph.networks import Graph

MOST_EDGES = 2_000_000  # edges of a file: half a gigabyte
_EVERY = 10_000  # elements between reports
_GRAPHML = (
    '<graphml xmlns="http://graphml.graphdrawing.org/xmlns" '
    'xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance" '
    'xsi:schemaLocation="http://graphml.graphdrawing.org/xmlns '
    'http://graphml.graphdrawing.org/xmlns/1.0/graphml.xsd">'
)
# Attributes d0, d1, ..: the elements that have them, their names and types.
_KEYS = (
    ("graph", "scene", "string"), ("graph", "robot", "long"), ("graph", "horizon", "long"),
    ("node", "step", "long"), ("node", "x", "double"), ("node", "y", "double"),
    ("node", "z", "double"), ("node", "heading", "double"), ("node", "tilt", "double"),
    ("node", "reward", "double"), ("edge", "reward", "double"),
)  # fmt: skip

Counter = Callable[[str], Callable[[int, int], None]]


def _uncounted(noun: str) -> Callable[[int, int], None]:
    return lambda done, total: None


def graphml(problem: Problem, robot: int, counter: Counter = _uncounted) -> bytes:
    """Returns the time-expanded graph of a robot with its rewards, as the content of a file.

    A node has the attributes step (0..T), x, y and z (m), heading and tilt (rad, from +x
    counter-clockwise and below the horizon), and reward: the weighted roots of the pixels per m2
    that the robot alone has there, plus its reward for people whom it sees. The reward of an edge
    is that for the move. A node's id is step/x/y/layer/heading/pitch, in the indices used in plans.

    Parameters
    ----------
    counter : given the name of some items, returns a function to call with the number of finished
        items

    Raises
    ------
    ProblemError
        If the graph is too large, or empty because no path of the robot ends at its goal.
    """
    if edges_in_reach(problem, robot, MOST_EDGES) > MOST_EDGES:
        raise ProblemError(
            f"robots[{robot}]: the graph has more than {MOST_EDGES:,} edges, too many for GraphML"
        )
    graph = time_expanded_graph(problem, robot)
    if not graph:
        raise ProblemError(f"robots[{robot}]: no path ends at its goal, so there is no graph")
    model = compiled(problem)
    model.prepare(model.class_of[robot], progress=counter("coverage"))
    lines, count = list[str](), counter("node or edge")
    total = len(graph) + graph.number_of_edges()
    for k, element in enumerate(_elements(problem, robot, graph)):
        if k % _EVERY == 0:
            count(k, total)
        lines.append(element)
    text = "\n".join([*_head(), *lines, *_tail(problem, robot)])
    return text.encode("ascii", "xmlcharrefreplace")


def _head() -> Iterator[str]:
    """Yields the lines before the nodes."""
    yield _GRAPHML
    for k, (kind, name, of_type) in reversed(list(enumerate(_KEYS))):
        yield f'  <key id="d{k}" for="{kind}" attr.name="{name}" attr.type="{of_type}" />'
    yield '  <graph edgedefault="directed">'


def _tail(problem: Problem, robot: int) -> Iterator[str]:
    """Yields the lines after the edges."""
    for k, value in enumerate((escape(problem.name, quote=False), robot, problem.horizon)):
        yield f'    <data key="d{k}">{value}</data>'
    yield "  </graph>"
    yield "</graphml>"


def _elements(problem: Problem, robot: int, graph: "Graph") -> Iterator[str]:
    """Yields the nodes followed by the edges, each as lines of the file.

    They are written as text, since a tree of elements takes several times the time and memory.
    """
    nodes = list(graph)
    known = {
        state: _Known.of(problem, robot, state) for state in dict.fromkeys(s for s, _ in nodes)
    }
    rewards = _Rewards(problem, robot)
    index = {state: rewards.index(state) for state in known}
    at = np.array([(t, index[state]) for state, t in nodes])
    for (state, t), reward in zip(nodes, rewards.of_nodes(*at.T), strict=True):
        yield (
            f'    <node id="{t}/{known[state].name}">\n      <data key="d3">{t}</data>\n'
            f'{known[state].data}\n      <data key="d9">{reward}</data>\n    </node>'
        )
    ends = np.array([(index[tail], index[head]) for (tail, _), (head, _) in graph.edges])
    if not len(ends):
        return
    for ((tail, t), (head, _)), reward in zip(graph.edges, rewards.of_edges(*ends.T), strict=True):
        yield (
            f'    <edge source="{t}/{known[tail].name}" target="{t + 1}/{known[head].name}">\n'
            f'      <data key="d10">{reward}</data>\n    </edge>'
        )


class _Known(NamedTuple):
    """The part of a node that is the same at every step of its state."""

    name: str
    data: str  # lines

    @classmethod
    def of(cls, problem: Problem, robot: int, state: State) -> "_Known":
        spec = problem.robots[robot]
        heading = math.tau * state.heading / spec.motion.headings
        place = problem.where(spec, [state])[0].tolist()
        values = (*place, heading, spec.camera.tilts[state.pitch])
        data = (f'      <data key="d{k}">{value}</data>' for k, value in enumerate(values, 4))
        return cls("/".join(map(str, state)), "\n".join(data))


class _Rewards:
    """The rewards of a robot if it is alone."""

    def __init__(self, problem: Problem, robot: int) -> None:
        model = compiled(problem)
        self._graph = model.class_of[robot].graph
        self._bonuses = Bonuses.of(problem.objective)
        self._views = marginal_reward(model, model.class_of[robot], problem.no_pixels())

    def index(self, state: State) -> int:
        """Returns the number of a state."""
        return self._graph.index(state)

    def of_nodes(self, t: IntArray, states: IntArray) -> list[float]:
        """Returns the rewards [n] for views from states [n] at steps [n]."""
        rewards: list[float] = self._views[t, states].tolist()
        return rewards

    def of_edges(self, tails: IntArray, heads: IntArray) -> list[float]:
        """Returns the rewards [n] for moves between states."""
        rewards: list[float] = self._bonuses.of_edges(self._graph.shape, tails, heads).tolist()
        return rewards
