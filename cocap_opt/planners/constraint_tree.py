"""The constraint tree of CoCap: its nodes and queue, and what becomes of it at a limit."""

import heapq
from collections.abc import Mapping
from dataclasses import dataclass, replace

from cocap_opt.coordination.constraints import forbid
from cocap_opt.graph.charges import NO_CHARGES, Charges
from cocap_opt.planners.low_level import LowLevel, SingleRobotPath, SingleRobotTask
from cocap_opt.planners.sequential import sequential
from cocap_opt.planners.team import Team
from cocap_opt.problem import Conflict
from cocap_opt.result import Reason, Result
from cocap_opt.stop import Limit, Stop

SPARE_FROM = 64  # nodes generated from which on a spare plan costs little


@dataclass(frozen=True)
class Node:
    """Node of the constraint tree."""

    team: Team  # one path and its pixels per robot
    constraints: tuple[Charges, ...]  # per robot
    value: float  # J
    depth: int = 0  # number of constraints on the way from the root


class OpenNodes:
    """Queue of the nodes that are not expanded yet, the greatest J first, then the oldest.

    Attributes
    ----------
    pushed, popped : number of nodes so far
    last : the node popped last
    """

    def __init__(self) -> None:
        self._heap: list[tuple[float, int, Node]] = []
        self.pushed = self.popped = 0
        self.last: Node | None = None

    def __bool__(self) -> bool:
        return bool(self._heap)

    def push(self, node: Node) -> None:
        """Add a node."""
        heapq.heappush(self._heap, (-node.value, self.pushed, node))
        self.pushed += 1

    def pop(self) -> Node:
        """Take the node of greatest J."""
        self.popped += 1
        self.last = heapq.heappop(self._heap)[2]
        return self.last


class ConstraintTree:
    """Makes the nodes of a constraint tree, and keeps what a result says of the search."""

    def __init__(self, team: Team, low_level: LowLevel, stop: Stop, open_nodes: OpenNodes) -> None:
        self._model, self._low_level, self._stop = team.model, low_level, stop
        self._open = open_nodes
        self._team = team  # of the root, as far as it is planned
        self._spare: Result | None = None  # of sequential planning, once the tree is large
        self._evaluated = 0  # states whose coverage was needed by a lazy low level

    def root(self) -> Node | None:
        """Node of every robot's best path given the earlier ones; None where one has no path."""
        robots = range(len(self._model.problem.robots))
        for robot in robots:
            single = self._planned(self._team, robot, NO_CHARGES)
            if single.path is None:
                return None
            self._team = self._team.with_path(robot, single)
        return Node(self._team, (NO_CHARGES,) * len(robots), self._team.value)

    def first_conflict(self, node: Node) -> Conflict | None:
        """Earliest conflict of a node's plan, of the first robots."""
        plan = self._model.plan(node.team.paths)
        return next(plan.conflicts(self._model.problem), None)

    def child(self, node: Node, conflict: Conflict, robot: int) -> Node | None:
        """Node in which a robot of the conflict gives way; None where that leaves it no path.

        Only that robot is planned again.
        """
        self._keep_spare_plan()
        self._stop.begin_work()
        which = conflict.robots.index(robot)
        charges = forbid(self._model, conflict, which, node.constraints[robot])
        single = self._planned(node.team, robot, charges)
        if single.path is None:
            return None
        team = node.team.with_path(robot, single)
        constraints = (*node.constraints[:robot], charges, *node.constraints[robot + 1 :])
        return Node(team, constraints, team.value, node.depth + 1)

    def _planned(self, team: Team, robot: int, charges: Charges) -> SingleRobotPath:
        task = SingleRobotTask(self._model, robot, team.others(robot), charges, self._stop)
        single = self._low_level(task)
        self._evaluated += single.evaluated
        return single

    def _keep_spare_plan(self) -> None:
        """Plan sequentially once the tree is large: a plan for the case that time runs out."""
        if self._spare is None and self._open.pushed >= SPARE_FROM:
            self._spare = sequential(self._model.problem, self._stop, self._low_level)
            self._evaluated += int(self._spare.statistics.get("evaluated", 0))

    # -- results --------------------------------------------------------------------------

    def result(self, found: Node | None) -> Result:
        """Result of a search that ran to its end."""
        if found is None:
            words = "no plan obeys the rules: the constraint tree is exhausted"
            return Result.without_plan(
                Reason.INFEASIBLE, words, self._statistics(self._open.popped)
            )
        return found.team.result(statistics=self._statistics(self._open.popped - 1))

    def stopped(self, limit: Limit) -> Result:
        """Result of a search that a limit has stopped."""
        team = self._open.last.team if self._open.last else self._team
        result = team.without_conflicts(limit, self._statistics(self._open.popped))
        if self._spare is not None and self._spare.value > result.value:
            words = "stopped: this is the plan of sequential planning"
            return replace(result, plan=self._spare.plan, value=self._spare.value, message=words)
        return result

    def _statistics(self, expanded: int) -> Mapping[str, float]:
        return {
            "generated": self._open.pushed,
            "expanded": expanded,
            "depth": self._open.last.depth if self._open.last else 0,
            "evaluated": self._evaluated,
        }
