"""The plan of sequential planning, kept for the case that a limit stops the constraint tree."""

from dataclasses import replace

from cocap_opt.planners.constraint_tree import ConstraintTree
from cocap_opt.planners.low_level import PlannedTeam
from cocap_opt.planners.responses import Responses, followed, one_by_one
from cocap_opt.planners.results import hovering, result_of
from cocap_opt.result import Result
from cocap_opt.stop import Limit, Stop

# Nodes generated from which on a spare plan costs little: it takes a path of each robot, and each
# node has taken one, so that for 6 robots it is a tenth of the work before it.
SPARE_FROM = 64
FELL_BACK = "stopped: this is the plan of sequential planning"


class SparePlan:
    """Plans sequentially once a constraint tree is large, or time runs out.

    That takes about as long as the root has taken.
    """

    def __init__(self, nobody: PlannedTeam, responses: Responses, stop: Stop) -> None:
        self._nobody, self._responses, self._stop = nobody, responses, stop
        self._team: PlannedTeam | None = None

    def keep(self, tree: ConstraintTree) -> None:
        """Make the plan if it is time for it and it is not there."""
        is_late = self._stop.seconds_left < 2 * tree.root_seconds
        if self._team is None and (tree.open.pushed >= SPARE_FROM or is_late):
            changes = one_by_one(self._nobody, self._responses)
            self._team = hovering(followed(self._nobody, changes)[0])

    def or_better(self, result: Result, limit: Limit) -> Result:
        """Returns a result, or that of the spare plan where it has a greater J."""
        if self._team and self._team.is_whole and self._team.value > result.value:
            spare = result_of(self._team, limit, result.statistics)
            return replace(spare, message=FELL_BACK)
        return result
