"""Trials of the paths of all robots together, once stages have left few (`joint_paths`).

How many paths are left is only known once they have been tried, and trials of too many are in vain.
So each has a number of nodes that it may take, in proportion to what the stages took so far. Where
the paths of all better plans are too many, those of plans above a higher target may not be: the
lowest target that can be tried is the bound then.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

from cocap_opt.formulations.certificates.staged import (
    Narrowing,
    NotEndedError,
    best_plan,
    may_be_used,
)
from cocap_opt.formulations.column_generation.parameters import TrialParameters
from cocap_opt.formulations.column_generation.primal.incumbent import Incumbent
from cocap_opt.formulations.column_generation.primal.recombination import searches_are_fast
from cocap_opt.formulations.column_generation.search import Search


@dataclass
class PathTrials:
    """The trials so far.

    Attributes
    ----------
    bound : on all plans, of the trial that proves most; infinite before any has ended
    above : J, above which that has tried the plans
    stages : how many there were then
    nodes : of all searches of trials
    is_on : False: there are no trials, only stages
    """

    search: Search
    bound: float = math.inf
    above: float | None = None
    stages: int = 0
    nodes: int = 0
    is_on: bool = True
    _failed_room: float = math.inf
    _failed_nodes: int = 0

    def after_stages(self, narrowing: Narrowing, stages: int, nodes: int) -> bool:
        """Tries all better plans, if that may be worth it; returns True if that has ended.

        Parameters
        ----------
        narrowing : after the stages
        stages : how many there are
        nodes : that their searches took
        """
        allowed = max(int(self._times_nodes() * nodes) - self.nodes, self._fewest_nodes())
        room = narrowing.room_above(self.search.value)
        is_easier = room <= self.search.parameters.recombination.less_room * self._failed_room
        if not is_easier and allowed < self._parameters.more_nodes * self._failed_nodes:
            return False
        if self._has_ended(narrowing, 0.0, allowed, stages):
            return True
        self._failed_room, self._failed_nodes = room, allowed
        return False

    def for_higher_targets(
        self, narrowing: Narrowing, stages: int, nodes: int, report: Callable[[], None]
    ) -> None:
        """Tries the plans above ever lower targets, as long as that ends; raises LimitReached.

        Parameters
        ----------
        narrowing, stages, nodes : as in `after_stages`
        report : tells what has been proved
        """
        allowed = max(nodes, self._parameters.first_times * self._fewest_nodes())
        share, less, nodes_before = 1.0, self._parameters.less, 0
        while share > 0:
            before, lower = self.nodes, max(share - less, 0.0)
            most_nodes = min(allowed, self._parameters.most_nodes)
            if self._has_ended(narrowing, lower, most_nodes, stages):
                report()
                nodes_now = self.nodes - before
                allowed = max(allowed, self._parameters.next_times * nodes_now)
                less = self._next_less(share - lower, nodes_before, nodes_now)
                share, nodes_before = lower, nodes_now
            elif less > self._parameters.less:
                less = max(less / 2, self._parameters.less)
            else:
                return

    def _next_less(self, less: float, nodes_before: int, nodes_now: int) -> float:
        """Returns by how much the next target may be less than one whose trial has ended.

        Parameters
        ----------
        less : by how much that was less than the one before
        nodes_before, nodes_now : that the two trials took, of which the second takes more
        """
        least = self._parameters.less
        if not 0 < nodes_before < nodes_now:
            return least
        # Nodes grow by about the same factor with each step down, and more later on.
        steps = math.log(self._parameters.aimed_times) / math.log(nodes_now / nodes_before)
        return max(least, min(steps * less, self._parameters.most_less))

    def _has_ended(self, narrowing: Narrowing, share: float, most_nodes: int, stages: int) -> bool:
        """Tries the plans above a target; returns False if these are too many.

        Parameters
        ----------
        share : of the remaining gap, by which the target is above the best plan
        """
        if not self.is_on or not may_be_used(narrowing.model):
            return False
        value = self.search.value
        target = value + share * max(narrowing.bound - value, 0.0)
        try:
            found = best_plan(narrowing.above(target), most_nodes, self.search.stop)
        except NotEndedError:
            self.nodes += most_nodes  # also where there were too many joint states before that
            return False
        self.nodes += found.nodes
        if found.paths:
            self.search.offer(Incumbent.along(narrowing.model, found.paths))
        bound = found.pricing.bound
        if bound < self.bound:
            self.bound, self.above, self.stages = bound, target, stages
        return True

    @property
    def _parameters(self) -> TrialParameters:
        return self.search.parameters.trials

    def _times_nodes(self) -> float:
        """Returns the nodes that all trials may take, in times of those of the stages."""
        is_fast = searches_are_fast(self.search.stop)
        return self._parameters.times_nodes if is_fast else self._parameters.plain_times_nodes

    def _fewest_nodes(self) -> int:
        """Returns the number of nodes that every trial may take, whatever is left."""
        few, plain = self._parameters.fewest_nodes, self._parameters.fewest_plain_nodes
        return few if searches_are_fast(self.search.stop) else plain
