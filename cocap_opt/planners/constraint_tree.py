"""The constraint tree of CoCap: its nodes, their order, and a fallback plan."""

import heapq
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from cocap_opt.coordination.best_response import forbid
from cocap_opt.coordination.low_level import PlannedTeam
from cocap_opt.coordination.responses import Planning, Responses, followed, greedily, one_by_one
from cocap_opt.graph.charges import NO_CHARGES, Charges
from cocap_opt.planners.results import hovering, result_of
from cocap_opt.problem import Conflict
from cocap_opt.result import Result
from cocap_opt.stop import Clock, Limit, Stop


@dataclass(frozen=True)
class Node:
    """A node of the constraint tree."""

    team: PlannedTeam  # one path and its pixels per robot
    constraints: tuple[Charges, ...]  # per robot
    value: float  # J
    depth: int = 0  # number of constraints on the way from the root

    @property
    def conflicts(self) -> tuple[Conflict, ...]:
        """Conflicts of the node's plan, earliest step first."""
        return self.team.conflicts


class OpenNodes:
    """A queue of unexpanded nodes: the greatest J first; among equal ones, the oldest.

    Attributes
    ----------
    pushed, popped : number of nodes pushed and popped so far
    last : the most recently popped node
    """

    def __init__(self) -> None:
        self.pushed = self.popped = 0
        self.last: Node | None = None
        self._heap: list[tuple[float, int, Node]] = []  # -J, number, node

    def __bool__(self) -> bool:
        return bool(self._heap)

    def push(self, node: Node) -> None:
        """Add a node."""
        heapq.heappush(self._heap, (-node.value, self.pushed, node))
        self.pushed += 1

    def pop(self) -> Node:
        """Take the first node."""
        self.popped += 1
        self.last = self._take()
        return self.last

    def _take(self) -> Node:
        return heapq.heappop(self._heap)[2]


class FocalNodes(OpenNodes):
    """A queue that returns the node with the fewest conflicts among those with nearly the greatest
    J.

    It sacrifices a little J to find a plan without conflicts sooner: if many robots meet, the node
    with the greatest J nearly always has conflicts. Source: focal search as in Enhanced
    Conflict-Based Search (Barer et al. 2014), there for the least cost.

    Parameters
    ----------
    within : largest relative difference from the greatest J, 0..1
    """

    def __init__(self, within: float = 0.01) -> None:
        super().__init__()
        self._within = within

    def _take(self) -> Node:
        greatest = -self._heap[0][0]
        focal = (entry for entry in self._heap if -entry[0] >= greatest * (1 - self._within))
        entry = min(focal, key=lambda entry: (len(entry[2].conflicts), *entry[:2]))
        self._heap.remove(entry)
        heapq.heapify(self._heap)
        return entry[2]


def _nothing(tree: "ConstraintTree") -> None:
    pass


class ConstraintTree:
    """Creates the nodes of a constraint tree, and holds those that are not expanded yet.

    The numbers beside the code are those of Alg. 1 in `cocap`.

    Parameters
    ----------
    nobody : a team in which no robot is planned yet, or only the first ones
    plan_root : plans the team of the root, ignoring conflicts (default: once, as published)
    before_child : called before each child is made

    Attributes
    ----------
    open : OPEN, the queue of nodes that are not expanded yet
    team : team of the most recently popped node; before the first, the team of the root as far as
        it is planned
    root_seconds : s, time that planning the root has taken
    """

    def __init__(
        self,
        nobody: PlannedTeam,
        responses: Responses,
        stop: Stop,
        open_nodes: OpenNodes,
        plan_root: Planning = greedily,
        before_child: "Callable[[ConstraintTree], None]" = _nothing,
    ) -> None:
        self._model, self._responses, self._stop = nobody.model, responses, stop
        self._plan_root, self._before_child = plan_root, before_child
        self._root = nobody
        self.open = open_nodes
        self.root_seconds = 0.0

    def root(self) -> Node | None:
        """Returns the node of every robot's best path given the earlier ones; None if a robot has
        no path.
        """
        clock = Clock()
        for team in self._plan_root(self._root, self._responses):  # 2
            self._root = team
        if not self._root.is_whole:
            return None
        self.root_seconds = clock.seconds
        unconstrained = (NO_CHARGES,) * self._root.size  # 1
        return Node(self._root, unconstrained, self._root.value)  # 3

    def first_conflict(self, node: Node) -> Conflict | None:
        """Returns the earliest conflict of a node's plan; among several, the one with the first
        robots.
        """
        return next(iter(node.conflicts), None)  # 7

    def child(self, node: Node, conflict: Conflict, robot: int) -> Node | None:
        """Returns the node in which a robot of the conflict gives way; None if it then has no path.

        Only that robot is replanned.
        """
        self._before_child(self)
        self._stop.begin_work()
        which = conflict.robots.index(robot)
        charges = forbid(self._model, conflict, which, node.constraints[robot])  # 11
        single = self._responses.charged(node.team, robot, charges)  # 12
        if single.path is None:
            return None
        team = node.team.with_path(robot, single)
        constraints = (*node.constraints[:robot], charges, *node.constraints[robot + 1 :])
        return Node(team, constraints, team.value, node.depth + 1)  # 13

    @property
    def team(self) -> PlannedTeam:
        """Team of the most recently popped node, or of the root as far as it is planned."""
        return self.open.last.team if self.open.last else self._root

    def statistics(self, expanded: int) -> Mapping[str, float]:
        """Returns the statistics of a search that has expanded a number of nodes."""
        return {
            "generated": self.open.pushed,
            "expanded": expanded,
            "depth": self.open.last.depth if self.open.last else 0,
            "evaluated": self._responses.evaluated,
        }


# Number of generated nodes after which a spare plan is cheap: it computes one path per robot, as
# much work as that many nodes, so for 6 robots it adds a tenth to the work before it.
SPARE_FROM = 64
FELL_BACK = "stopped early: this is the plan of sequential planning"


class SparePlan:
    """Makes a sequential plan once a constraint tree is large or time runs out.

    This takes about as long as planning the root took.
    """

    def __init__(self, nobody: PlannedTeam, responses: Responses, stop: Stop) -> None:
        self._nobody, self._responses, self._stop = nobody, responses, stop
        self._team: PlannedTeam | None = None

    def keep(self, tree: ConstraintTree) -> None:
        """Makes the plan if it is due and has not been made yet."""
        is_late = self._stop.seconds_left < 2 * tree.root_seconds
        if self._team is None and (tree.open.pushed >= SPARE_FROM or is_late):
            changes = one_by_one(self._nobody, self._responses)
            self._team = hovering(followed(self._nobody, changes)[0])

    def or_better(self, result: Result, limit: Limit) -> Result:
        """Returns the given result, or that of the spare plan if its J is greater."""
        if self._team and self._team.is_whole and self._team.value > result.value:
            spare = result_of(self._team, limit, result.statistics)
            return replace(spare, message=FELL_BACK)
        return result
