"""Nodes of the constraint tree that are not expanded yet, and which of them comes first."""

import heapq
from abc import ABC, abstractmethod
from dataclasses import dataclass

from cocap_opt.graph.charges import Charges
from cocap_opt.planners.low_level import PlannedTeam
from cocap_opt.problem import Conflict


@dataclass(frozen=True)
class Node:
    """Node of the constraint tree."""

    team: PlannedTeam  # one path and its pixels per robot
    constraints: tuple[Charges, ...]  # per robot
    value: float  # J
    depth: int = 0  # number of constraints on the way from the root

    @property
    def conflicts(self) -> tuple[Conflict, ...]:
        """Conflicts of the node's plan, earliest step first."""
        return self.team.conflicts


class OpenNodes(ABC):
    """Queue of the nodes that are not expanded yet.

    Attributes
    ----------
    pushed, popped : number of nodes so far
    last : the node popped last
    """

    def __init__(self) -> None:
        self.pushed = self.popped = 0
        self.last: Node | None = None

    @abstractmethod
    def __bool__(self) -> bool:
        """True if a node is left."""

    @abstractmethod
    def _put(self, node: Node) -> None:
        """Adds a node, number `pushed`."""

    @abstractmethod
    def _take(self) -> Node:
        """Takes the node that comes first."""

    def push(self, node: Node) -> None:
        """Add a node."""
        self._put(node)
        self.pushed += 1

    def pop(self) -> Node:
        """Take the node that comes first."""
        self.popped += 1
        self.last = self._take()
        return self.last


class BestNodes(OpenNodes):
    """Queue from which the node of the greatest J comes first, then the oldest."""

    def __init__(self) -> None:
        super().__init__()
        self._heap: list[tuple[float, int, Node]] = []

    def __bool__(self) -> bool:
        return bool(self._heap)

    def _put(self, node: Node) -> None:
        heapq.heappush(self._heap, (-node.value, self.pushed, node))

    def _take(self) -> Node:
        return heapq.heappop(self._heap)[2]


class FocalNodes(OpenNodes):
    """Queue from which, of the nodes of nearly the greatest J, that of the fewest conflicts comes.

    It gives up a little J to come to a plan without conflicts sooner: where many robots meet, the
    node of greatest J nearly always has conflicts left. Source: focal search as in Enhanced
    Conflict-Based Search (Barer et al. 2014), there for the least cost.

    Parameters
    ----------
    within : share of the greatest J that a node may lack, 0..1
    """

    def __init__(self, within: float = 0.01) -> None:
        super().__init__()
        self._within = within
        self._nodes: list[Node] = []

    def __bool__(self) -> bool:
        return bool(self._nodes)

    def _put(self, node: Node) -> None:
        self._nodes.append(node)

    def _take(self) -> Node:
        least = max(node.value for node in self._nodes) * (1 - self._within)
        focal = (n for n, node in enumerate(self._nodes) if node.value >= least)
        return self._nodes.pop(min(focal, key=lambda n: _conflicts_then_value(self._nodes[n])))


def _conflicts_then_value(node: Node) -> tuple[int, float]:
    return len(node.conflicts), -node.value
