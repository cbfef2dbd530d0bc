"""The constraint tree of CoCap: how its nodes are made, and what becomes of it at a limit."""

from collections.abc import Mapping
from dataclasses import replace

from cocap_opt.coordination.constraints import forbid
from cocap_opt.graph.charges import NO_CHARGES
from cocap_opt.planners.open_nodes import Node, OpenNodes
from cocap_opt.planners.responses import Responses, followed, in_rounds, one_by_one
from cocap_opt.planners.team import Team
from cocap_opt.problem import Conflict
from cocap_opt.result import Reason, Result
from cocap_opt.stop import Clock, Limit, Stop

EXHAUSTED = "no plan obeys the rules: the constraint tree is exhausted"
SPARE_FROM = 64  # nodes generated from which on a spare plan costs little


class ConstraintTree:
    """Makes the nodes of a constraint tree, and keeps what a result says of the search.

    Parameters
    ----------
    team : of which nobody is planned yet, or the first robots are
    rounds : the root is planned in rounds of best responses; else once, as published
    spare : a plan for the case that time runs out; if None, it is made once the tree is large
    """

    def __init__(
        self,
        team: Team,
        responses: Responses,
        stop: Stop,
        open_nodes: OpenNodes,
        rounds: bool = False,
        spare: Team | None = None,
    ) -> None:
        self._model, self._responses, self._stop = team.model, responses, stop
        self._open, self._rounds = open_nodes, rounds
        self._team = team  # of the root, as far as it is planned
        self._spare = spare
        self._root_seconds = 0.0

    def root(self) -> Node | None:
        """Node of every robot's best path given the earlier ones; None where one has no path."""
        clock = Clock()
        for team in one_by_one(self._team, self._responses, rules=False):
            self._team = team
        if not self._team.is_whole:
            return None
        if self._rounds:
            for team in in_rounds(self._team, self._responses, rules=False):
                self._team = team
        self._root_seconds = clock.seconds
        return Node(self._team, (NO_CHARGES,) * self._team.size, self._team.value)

    def first_conflict(self, node: Node) -> Conflict | None:
        """Earliest conflict of a node's plan, of the first robots."""
        return next(iter(node.conflicts), None)

    def child(self, node: Node, conflict: Conflict, robot: int) -> Node | None:
        """Node in which a robot of the conflict gives way; None where that leaves it no path.

        Only that robot is planned again.
        """
        self._keep_spare_plan()
        self._stop.begin_work()
        which = conflict.robots.index(robot)
        charges = forbid(self._model, conflict, which, node.constraints[robot])
        single = self._responses.charged(node.team, robot, charges)
        if single.path is None:
            return None
        team = node.team.with_path(robot, single)
        constraints = (*node.constraints[:robot], charges, *node.constraints[robot + 1 :])
        return Node(team, constraints, team.value, node.depth + 1)

    def _keep_spare_plan(self) -> None:
        """Plan sequentially once the tree is large, or time runs out: a plan for that case.

        That takes about as long as the root has taken.
        """
        is_late = self._stop.seconds_left < 2 * self._root_seconds
        if self._spare is None and (self._open.pushed >= SPARE_FROM or is_late):
            nobody = Team.nobody(self._model)
            self._spare = followed(nobody, one_by_one(nobody, self._responses))[0].hovering()

    # -- results --------------------------------------------------------------------------

    def result(self, found: Node | None) -> Result:
        """Result of a search that ran to its end."""
        if found is None:
            return Result.without_plan(
                Reason.INFEASIBLE, EXHAUSTED, self._statistics(self._open.popped)
            )
        return found.team.result(statistics=self._statistics(self._open.popped - 1))

    def polished(self, found: Node) -> Result:
        """Result of a search that ran to its end, after rounds of best responses.

        These obey the rules, and end where no robot alone can gain.
        """
        team, limit = followed(found.team, in_rounds(found.team, self._responses))
        return team.result(limit, self._statistics(self._open.popped - 1))

    def stopped(self, limit: Limit) -> Result:
        """Result of a search that a limit has stopped."""
        team = self._open.last.team if self._open.last else self._team
        result = team.without_conflicts(limit, self._statistics(self._open.popped))
        if self._spare and self._spare.is_whole and self._spare.value > result.value:
            words = "stopped: this is the plan of sequential planning"
            return replace(self._spare.result(limit, result.statistics), message=words)
        return result

    def _statistics(self, expanded: int) -> Mapping[str, float]:
        return {
            "generated": self._open.pushed,
            "expanded": expanded,
            "depth": self._open.last.depth if self._open.last else 0,
            "evaluated": self._responses.evaluated,
        }
