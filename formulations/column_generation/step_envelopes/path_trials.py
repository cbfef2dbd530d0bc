"""Trials of the joint paths of all robots, once stages have left few of them (`joint_paths`).

The number of remaining paths is known only after trying them, and trials of too many fail. So each
trial has a limit on its nodes, in proportion to the nodes of the stages so far. If the paths of all
better plans are too many, the paths of plans above a higher target may be few enough: the lowest
target for which a trial ends is then the bound.

Large trials begin at a step in the middle (`middle_step`).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

from cocap_opt.formulations.certificates.staged import Narrowing, NotEndedError, may_be_used
from cocap_opt.formulations.column_generation.parameters import TrialParameters
from cocap_opt.formulations.column_generation.primal.incumbent import Incumbent
from cocap_opt.formulations.column_generation.primal.recombination import searches_are_fast
from cocap_opt.formulations.column_generation.search import Search
from cocap_opt.formulations.column_generation.step_envelopes.middle_step import MiddleStep, explored


@dataclass
class PathTrials:
    """The trials made so far.

    Attributes
    ----------
    bound : lowest bound on all plans that a trial has proved; infinite before any has ended
    above : J above which that trial has explored all plans
    from_step : step from which it has explored paths; 0: the start
    stages : number of stages at that time
    nodes : total nodes of all trials
    is_on : False: make no trials, only stages
    """

    search: Search
    bound: float = math.inf
    above: float | None = None
    from_step: int = 0
    stages: int = 0
    nodes: int = 0
    is_on: bool = True
    _failed_room: float = math.inf
    _failed_nodes: int = 0

    def __post_init__(self) -> None:
        """Begins with paths from the start."""
        self._middle = MiddleStep(self.search.parameters.middle)

    def after_stages(self, narrowing: Narrowing, stages: int, nodes: int) -> bool:
        """Explores all better plans if that seems worthwhile; returns True if the trial has ended.

        Parameters
        ----------
        narrowing : after the stages
        stages : number of stages
        nodes : number of nodes of their searches
        """
        allowed = max(int(self._times_nodes() * nodes) - self.nodes, self._fewest_nodes())
        allowed = min(allowed, self._parameters.most_nodes)
        room = narrowing.room_above(self.search.value)
        is_easier = room <= self.search.parameters.recombination.less_room * self._failed_room
        if not is_easier and allowed < self._parameters.more_nodes * self._failed_nodes:
            return False
        from_step = self._middle_step(narrowing, allowed)
        if self._has_ended(narrowing, from_step, 0.0, allowed, stages):
            return True
        self._failed_room, self._failed_nodes = room, allowed
        return False

    def for_higher_targets(
        self,
        narrowing: Narrowing,
        stages: int,
        nodes: int,
        report: Callable[[], None],
        to_the_end: bool = False,
    ) -> None:
        """Explores the plans above ever lower targets, as long as trials end; raises LimitReached.

        After a trial that has not ended, the reduction of the target is halved. Once it is the
        least, trials begin at another step in the middle, if a new choice gives one.

        Parameters
        ----------
        narrowing, stages, nodes : as in `after_stages`
        report : called to report the bound that has been proved
        to_the_end : False: stop before trials become long in comparison with the stages
        """
        of_stages = self._parameters.times_stages * max(nodes, self._fewest_nodes())
        most_expected = math.inf if to_the_end else of_stages
        allowed = max(nodes, self._parameters.first_times * self._fewest_nodes())
        from_step = self._middle_step(narrowing, allowed)
        less, nodes_before, failed = self._parameters.less, 0, set[int]()
        value = self.search.value
        room = max(narrowing.bound - value, 0.0)
        # Targets above a bound that is proved already would prove nothing.
        share = min((self.bound - value) / room, 1.0) if room else 1.0
        while share > 0:
            before, lower = self.nodes, max(share - less, 0.0)
            most_nodes = min(allowed, self._parameters.most_nodes)
            if self._has_ended(narrowing, from_step, lower, most_nodes, stages):
                report()
                nodes_now = self.nodes - before
                allowed = max(allowed, self._parameters.next_times * nodes_now)
                times = min(most_expected / max(nodes_now, 1), self._parameters.aimed_times)
                longer = self._next_less(share - lower, nodes_before, nodes_now, times)
                if longer < self._parameters.least_less and not to_the_end:
                    return
                if not failed:
                    less = max(longer, self._parameters.least_less)
                share, nodes_before = lower, nodes_now
                continue
            failed.add(from_step)
            if less > self._parameters.least_less:
                less = max(less / 2, self._parameters.least_less)
            elif (from_step := self._middle_step(narrowing, most_nodes)) in failed:
                return  # no other step is better for larger explorations

    def _middle_step(self, narrowing: Narrowing, most_nodes: int) -> int:
        """Returns the step from which a trial explores paths; 0: the start.

        Parameters
        ----------
        most_nodes : largest number of nodes of the trial
        """
        if most_nodes < self.search.parameters.middle.least_trial:
            return 0
        if self.is_possible:
            before = self._middle.nodes
            self._middle.choose(narrowing, self.search.value, most_nodes, self.search.stop)
            self.nodes += self._middle.nodes - before
        return self._middle.from_step

    def _next_less(self, less: float, nodes_before: int, nodes_now: int, times: float) -> float:
        """Returns the reduction of the next target, after a trial that has ended.

        Parameters
        ----------
        less : the last reduction of the target
        nodes_before, nodes_now : nodes of the last two trials, of which the second took more
        times : wanted size of the next trial, relative to the second
        """
        if not 0 < nodes_before < nodes_now:
            return self._parameters.less
        # Each reduction multiplies the nodes by about the same factor, or a larger one later on.
        steps = math.log(times) / math.log(nodes_now / nodes_before)
        return min(steps * less, self._parameters.most_less)

    def _has_ended(
        self, narrowing: Narrowing, from_step: int, share: float, most_nodes: int, stages: int
    ) -> bool:
        """Explores the plans above a target; returns False if there are too many.

        Parameters
        ----------
        from_step : step from which paths are explored; 0: the start
        share : distance of the target from the best plan, as a share of the remaining gap
        """
        if not self.is_possible:
            return False
        value = self.search.value
        target = value + share * max(narrowing.bound - value, 0.0)
        try:
            found = explored(narrowing.above(target), from_step, most_nodes, self.search.stop)
        except NotEndedError:
            # counted in full, even if too many joint states ended the search earlier
            self.nodes += most_nodes
            return False
        self.nodes += found.nodes
        if found.paths:
            self.search.offer(Incumbent.along(narrowing.model, found.paths))
        bound = found.pricing.bound
        if bound < self.bound:
            self.bound, self.above, self.stages, self.from_step = bound, target, stages, from_step
        return True

    @property
    def is_possible(self) -> bool:
        """True if trials may be made: they are switched on, and joint states determine J."""
        return self.is_on and may_be_used(self.search.model)

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
