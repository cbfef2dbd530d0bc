"""The constraint tree of CoCap: its nodes, their order, and a plan to fall back on."""

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
    """Node of the constraint tree."""

    team: PlannedTeam  # one path and its pixels per robot
    constraints: tuple[Charges, ...]  # per robot
    value: float  # J
    depth: int = 0  # number of constraints on the way from the root

    @property
    def conflicts(self) -> tuple[Conflict, ...]:
        """Conflicts of the node's plan, earliest step first."""
        return self.team.conflicts


class OpenNodes:
    """Queue of nodes that are not expanded yet: the greatest J first, and of equal ones the oldest.

    Attributes
    ----------
    pushed, popped : number of nodes so far
    last : the node popped last
    """

    def __init__(self) -> None:
        self.pushed = self.popped = 0
        self.last: Node | None = None
        self._heap: list[tuple[float, int, Node]] = []  # less J, number, node

    def __bool__(self) -> bool:
        return bool(self._heap)

    def push(self, node: Node) -> None:
        """Add a node."""
        heapq.heappush(self._heap, (-node.value, self.pushed, node))
        self.pushed += 1

    def pop(self) -> Node:
        """Take the node that comes first."""
        self.popped += 1
        self.last = self._take()
        return self.last

    def _take(self) -> Node:
        return heapq.heappop(self._heap)[2]


class FocalNodes(OpenNodes):
    """Queue that gives the node with the fewest conflicts among those of nearly the greatest J.

    It gives up a little J to find a plan without conflicts sooner: where many robots meet, the node
    with the greatest J nearly always has conflicts left. Source: focal search as in Enhanced
    Conflict-Based Search (Barer et al. 2014), there for the least cost.

    Parameters
    ----------
    within : share of the greatest J that a node may lack, 0..1
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
    """Makes the nodes of a constraint tree, and holds those that are not expanded yet.

    The numbers beside the code are those of Alg. 1 in `cocap`.

    Parameters
    ----------
    nobody : team in which no robot is planned yet, or only the first ones are
    plan_root : plans the team of the root, ignoring conflicts (default: once, as published)
    before_child : called before each child is made

    Attributes
    ----------
    open : OPEN, the queue of nodes that are not expanded yet
    team : of the node popped last; before there is one, that of the root as far as it is planned
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
        """The node of every robot's best path given the earlier ones; None if one has none."""
        clock = Clock()
        for team in self._plan_root(self._root, self._responses):  # 2
            self._root = team
        if not self._root.is_whole:
            return None
        self.root_seconds = clock.seconds
        unconstrained = (NO_CHARGES,) * self._root.size  # 1
        return Node(self._root, unconstrained, self._root.value)  # 3

    def first_conflict(self, node: Node) -> Conflict | None:
        """The earliest conflict of a node's plan, and of several the one with the first robots."""
        return next(iter(node.conflicts), None)  # 7

    def child(self, node: Node, conflict: Conflict, robot: int) -> Node | None:
        """The node in which a robot of the conflict gives way; None if it then has no path.

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
        """Team of the node popped last, or of the root as far as it is planned."""
        return self.open.last.team if self.open.last else self._root

    def statistics(self, expanded: int) -> Mapping[str, float]:
        """Returns the statistics of a search that has expanded so many nodes."""
        return {
            "generated": self.open.pushed,
            "expanded": expanded,
            "depth": self.open.last.depth if self.open.last else 0,
            "evaluated": self._responses.evaluated,
        }


# Generated nodes after which a spare plan costs little: it takes a path of each robot, and each
# node has taken one, so that for 6 robots it is a tenth of the work before it.
SPARE_FROM = 64
FELL_BACK = "stopped: this is the plan of sequential planning"


class SparePlan:
    """Makes a sequential plan once a constraint tree is large or time runs out.

    This takes about as long as planning the root has taken.
    """

    def __init__(self, nobody: PlannedTeam, responses: Responses, stop: Stop) -> None:
        self._nobody, self._responses, self._stop = nobody, responses, stop
        self._team: PlannedTeam | None = None

    def keep(self, tree: ConstraintTree) -> None:
        """Make the plan if it is due and has not been made yet."""
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
