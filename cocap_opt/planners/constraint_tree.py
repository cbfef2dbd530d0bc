"""The constraint tree of CoCap: how its nodes are made, and which of them are open."""

from collections.abc import Callable, Mapping

from cocap_opt.coordination.constraints import forbid
from cocap_opt.graph.charges import NO_CHARGES
from cocap_opt.planners.low_level import PlannedTeam
from cocap_opt.planners.open_nodes import Node, OpenNodes
from cocap_opt.planners.responses import Planning, Responses, greedily
from cocap_opt.problem import Conflict
from cocap_opt.stop import Clock, Stop


def _nothing(tree: "ConstraintTree") -> None:
    pass


class ConstraintTree:
    """Makes the nodes of a constraint tree, and holds those that are not expanded yet.

    Parameters
    ----------
    nobody : team of which nobody is planned yet, or the first robots are
    plan_root : plans the team of the root, conflicts ignored; once, as published, if not given
    before_child : called before each child is made

    Attributes
    ----------
    open : OPEN, the queue of nodes that are not expanded yet
    team : of the node popped last; before there is one, that of the root as far as it is planned
    root_seconds : that the root has taken
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
        """Node of every robot's best path given the earlier ones; None where one has no path."""
        clock = Clock()
        for team in self._plan_root(self._root, self._responses):
            self._root = team
        if not self._root.is_whole:
            return None
        self.root_seconds = clock.seconds
        return Node(self._root, (NO_CHARGES,) * self._root.size, self._root.value)

    def first_conflict(self, node: Node) -> Conflict | None:
        """Earliest conflict of a node's plan, of the first robots."""
        return next(iter(node.conflicts), None)

    def child(self, node: Node, conflict: Conflict, robot: int) -> Node | None:
        """Node in which a robot of the conflict gives way; None where that leaves it no path.

        Only that robot is planned again.
        """
        self._before_child(self)
        self._stop.begin_work()
        which = conflict.robots.index(robot)
        charges = forbid(self._model, conflict, which, node.constraints[robot])
        single = self._responses.charged(node.team, robot, charges)
        if single.path is None:
            return None
        team = node.team.with_path(robot, single)
        constraints = (*node.constraints[:robot], charges, *node.constraints[robot + 1 :])
        return Node(team, constraints, team.value, node.depth + 1)

    @property
    def team(self) -> PlannedTeam:
        """Team of the node popped last, or of the root as far as it is planned."""
        return self.open.last.team if self.open.last else self._root

    def statistics(self, expanded: int) -> Mapping[str, float]:
        """Returns the numbers of a search that has expanded so many nodes."""
        return {
            "generated": self.open.pushed,
            "expanded": expanded,
            "depth": self.open.last.depth if self.open.last else 0,
            "evaluated": self._responses.evaluated,
        }
