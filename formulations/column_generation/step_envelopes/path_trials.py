"""Trials of the joint paths of all robots, once stages have left few of them (`joint_paths`).

The number of remaining paths is known only after trying them, and trials of too many fail. So each
trial has a limit on its nodes, in proportion to the nodes of the stages so far. If the paths of all
better plans are too many, the paths of plans above a higher target may be few enough: the lowest
target for which a trial ends is then the bound.

Large trials begin in the middle, at the step from which the paths of plans above a very high target
take the fewest nodes.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

from cocap_opt.formulations.certificates.staged import (
    Narrowing,
    NotEndedError,
    best_plan,
    best_plan_through,
    may_be_used,
    may_begin_later,
)
from cocap_opt.formulations.certificates.staged.joint_paths import BestPlan
from cocap_opt.formulations.column_generation.parameters import TrialParameters
from cocap_opt.formulations.column_generation.primal.incumbent import Incumbent
from cocap_opt.formulations.column_generation.primal.recombination import searches_are_fast
from cocap_opt.formulations.column_generation.search import Search


@dataclass
class PathTrials:
    """The trials made so far.

    Attributes
    ----------
    bound : lowest bound on all plans that a trial has proved; infinite before any has ended
    above : J above which that trial has explored all plans
    begun : step at which its paths begin
    stages : number of stages at that time
    nodes : total nodes of all trials
    is_on : False: make no trials, only stages
    """

    search: Search
    bound: float = math.inf
    above: float | None = None
    begun: int = 0
    stages: int = 0
    nodes: int = 0
    is_on: bool = True
    _failed_room: float = math.inf
    _failed_nodes: int = 0
    _middle: int = 0  # step at which the next trial begins

    def after_stages(self, narrowing: Narrowing, stages: int, nodes: int) -> bool:
        """Explores all better plans if that seems worthwhile; returns True if the trial has ended.

        Parameters
        ----------
        narrowing : after the stages
        stages : number of stages
        nodes : number of nodes of their searches
        """
        allowed = max(int(self._times_nodes() * nodes) - self.nodes, self._fewest_nodes())
        room = narrowing.room_above(self.search.value)
        is_easier = room <= self.search.parameters.recombination.less_room * self._failed_room
        if not is_easier and allowed < self._parameters.more_nodes * self._failed_nodes:
            return False
        is_large = allowed > self._fewest_nodes()
        self._middle = self._easiest_middle(narrowing, allowed) if is_large else 0
        if self._has_ended(narrowing, 0.0, allowed, stages):
            return True
        self._failed_room, self._failed_nodes = room, allowed
        return False

    def for_higher_targets(
        self, narrowing: Narrowing, stages: int, nodes: int, report: Callable[[], None]
    ) -> None:
        """Explores the plans above ever lower targets, as long as trials end; raises LimitReached.

        Parameters
        ----------
        narrowing, stages, nodes : as in `after_stages`
        report : called to report the bound that has been proved
        """
        allowed = max(nodes, self._parameters.first_times * self._fewest_nodes())
        self._middle = self._easiest_middle(narrowing, allowed)
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
        """Returns the reduction of the next target, after a trial that has ended.

        Parameters
        ----------
        less : the last reduction of the target
        nodes_before, nodes_now : nodes of the last two trials, of which the second took more
        """
        least = self._parameters.less
        if not 0 < nodes_before < nodes_now:
            return least
        # Each reduction multiplies the nodes by about the same factor, or a larger one later on.
        steps = math.log(self._parameters.aimed_times) / math.log(nodes_now / nodes_before)
        return max(least, min(steps * less, self._parameters.most_less))

    def _has_ended(self, narrowing: Narrowing, share: float, most_nodes: int, stages: int) -> bool:
        """Explores the plans above a target; returns False if there are too many.

        Parameters
        ----------
        share : distance of the target from the best plan, as a share of the remaining gap
        """
        if not self.is_on or not may_be_used(narrowing.model):
            return False
        higher = narrowing.above(self._target(narrowing, share))
        found = self._explored(higher, self._middle, most_nodes)
        if found is None:
            return False
        if found.paths:
            self.search.offer(Incumbent.along(narrowing.model, found.paths))
        bound = found.pricing.bound
        if bound < self.bound:
            self.bound, self.above, self.stages = bound, higher.target, stages
            self.begun = self._middle
        return True

    def _target(self, narrowing: Narrowing, share: float) -> float:
        """Returns the J between the best plan, at share 0, and the bound, at share 1."""
        value = self.search.value
        return value + share * max(narrowing.bound - value, 0.0)

    def _explored(self, narrowing: Narrowing, middle: int, most_nodes: int) -> BestPlan | None:
        """Explores the plans above a target, from a step on; returns None if there are too many."""
        stop = self.search.stop
        try:
            if middle:
                found = best_plan_through(narrowing, middle, most_nodes, stop)
            else:
                found = best_plan(narrowing, most_nodes, stop)
        except NotEndedError:
            # counted in full, even if too many joint states ended the search earlier
            self.nodes += most_nodes
            return None
        self.nodes += found.nodes
        return found

    def _easiest_middle(self, narrowing: Narrowing, most_nodes: int) -> int:
        """Returns the step from which the plans above a high target take the fewest nodes; 0: paths
        begin at the start.

        Parameters
        ----------
        most_nodes : largest number of nodes of the trial that follows
        """
        if not (self.is_on and may_begin_later(narrowing.model)):
            return 0
        less = self._parameters.probed_less
        least, easiest = int(self._parameters.probed_share * most_nodes), self._middle
        while less <= 1:
            higher = narrowing.above(self._target(narrowing, 1 - less))
            easiest, nodes = self._easiest(higher, easiest, least)
            if nodes >= self._parameters.least_probed * most_nodes:
                break
            less *= 2
        return easiest

    def _easiest(self, narrowing: Narrowing, first: int, most_nodes: int) -> tuple[int, int]:
        """Returns the step from which all plans above the target take the fewest nodes, and their
        number.

        A few steps are tried first, and then the steps next to the best of these.

        Parameters
        ----------
        first : the step that is tried first, and is returned if no exploration ends
        most_nodes : largest number of nodes of one exploration
        """
        horizon = narrowing.model.problem.horizon
        apart = -(-horizon // self._parameters.most_probed)
        easiest, least, tried = first, most_nodes, set[int]()

        def probe(middle: int) -> None:
            nonlocal easiest, least
            if middle in tried or not 0 <= middle <= horizon:
                return
            tried.add(middle)
            found = self._explored(narrowing, middle, least)
            if found is not None and found.nodes < least:
                easiest, least = middle, found.nodes

        for middle in (first, *range(0, horizon + 1, apart)):
            probe(middle)
        for middle in range(easiest - apart + 1, easiest + apart):
            probe(middle)
        return easiest, least

    @property
    def _parameters(self) -> TrialParameters:
        return self.search.parameters.trials

    def _times_nodes(self) -> float:
        """Returns the limit on the nodes of all trials, as a multiple of the nodes of the
        stages.
        """
        is_fast = searches_are_fast(self.search.stop)
        return self._parameters.times_nodes if is_fast else self._parameters.plain_times_nodes

    def _fewest_nodes(self) -> int:
        """Returns the number of nodes that every trial may use at least."""
        few, plain = self._parameters.fewest_nodes, self._parameters.fewest_plain_nodes
        return few if searches_are_fast(self.search.stop) else plain
