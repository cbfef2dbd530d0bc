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
from typing import NamedTuple

from cocap_opt.formulations.certificates.format import Stage
from cocap_opt.formulations.certificates.staged import (
    Narrowing,
    NotEndedError,
    best_plan_from,
    may_be_used,
)
from cocap_opt.formulations.column_generation.parameters import TrialParameters
from cocap_opt.formulations.column_generation.primal.incumbent import Incumbent
from cocap_opt.formulations.column_generation.primal.recombination import searches_are_fast
from cocap_opt.formulations.column_generation.search import Search
from cocap_opt.formulations.column_generation.step_envelopes.middle_step import MiddleStep
from cocap_opt.formulations.column_generation.step_envelopes.stages import Stages


class EndedTrial(NamedTuple):
    """A trial that has ended, and what it proves."""

    bound: float  # on all plans
    above: float  # J above which all plans have been explored
    from_step: int  # step from which paths have been explored; 0: the start
    stages: tuple[Stage, ...]  # stages before the trial


@dataclass
class PathTrials:
    """The trials made so far.

    Attributes
    ----------
    best : the trial that has proved the lowest bound; None before any has ended
    nodes : total nodes of all trials
    is_on : False: make no trials, only stages
    """

    search: Search
    best: EndedTrial | None = None
    nodes: int = 0
    is_on: bool = True
    _failed_room: float = math.inf
    _failed_nodes: int = 0

    def __post_init__(self) -> None:
        """Begins with paths from the start."""
        self._middle = MiddleStep(self.search.parameters.middle)

    @property
    def bound(self) -> float:
        """The lowest bound on all plans that a trial has proved; infinite before any has ended."""
        return math.inf if self.best is None else self.best.bound

    def after_stages(self, proved: Stages, nodes: int) -> bool:
        """Explores all better plans if that seems worthwhile; returns True if the trial has ended.

        Parameters
        ----------
        proved : the stages
        nodes : number of nodes of their searches
        """
        narrowing = proved.narrowing
        allowed = max(int(self._times_nodes() * nodes) - self.nodes, self._fewest_nodes())
        allowed = min(allowed, self._parameters.most_nodes)
        room = narrowing.room_above(self.search.value)
        is_easier = room <= self.search.parameters.recombination.less_room * self._failed_room
        if not is_easier and allowed < self._parameters.more_nodes * self._failed_nodes:
            return False
        from_step = self._middle_step(narrowing, allowed)
        if self._has_ended(proved, from_step, 0.0, allowed):
            return True
        self._failed_room, self._failed_nodes = room, allowed
        return False

    def for_higher_targets(
        self,
        proved: Stages,
        nodes: int,
        report: Callable[[], None],
        to_the_end: bool = False,
    ) -> None:
        """Explores the plans above ever lower targets, as long as trials end; raises LimitReached.

        After a trial that has not ended, the reduction of the target is halved. Once it is the
        least, trials begin at another step in the middle, if a new choice gives one.

        Parameters
        ----------
        proved, nodes : as in `after_stages`
        report : called to report the bound that has been proved
        to_the_end : False: stop before trials become long in comparison with the stages
        """
        narrowing = proved.narrowing
        of_stages = self._parameters.times_stages * max(nodes, self._fewest_nodes())
        most_expected = math.inf if to_the_end else of_stages
        allowed = max(nodes, self._parameters.first_times * self._fewest_nodes())
        from_step, failed = self._middle_step(narrowing, allowed), set[int]()
        targets = _Targets(self._parameters, self._share(narrowing), self._parameters.less)
        while targets.explored > 0:
            before, most_nodes = self.nodes, min(allowed, self._parameters.most_nodes)
            if self._has_ended(proved, from_step, targets.next, most_nodes):
                report()
                taken = self.nodes - before
                allowed = max(allowed, self._parameters.next_times * taken)
                if not targets.lower(taken, most_expected) and not to_the_end:
                    return
                continue
            failed.add(from_step)
            if not targets.halve():
                from_step = self._middle_step(narrowing, most_nodes)
                if from_step in failed:
                    return  # no other step is better for larger explorations

    def _share(self, narrowing: Narrowing) -> float:
        """Returns the proved bound's distance from the best plan, as a share of the gap that the
        stages leave; targets above it would prove nothing.
        """
        value = self.search.value
        room = max(narrowing.bound - value, 0.0)
        return min((self.bound - value) / room, 1.0) if room else 1.0

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

    def _has_ended(self, proved: Stages, from_step: int, share: float, most_nodes: int) -> bool:
        """Explores the plans above a target; returns False if there are too many.

        Parameters
        ----------
        from_step : step from which paths are explored; 0: the start
        share : distance of the target from the best plan, as a share of the remaining gap
        """
        if not self.is_possible:
            return False
        narrowing, value = proved.narrowing, self.search.value
        target = value + share * max(narrowing.bound - value, 0.0)
        try:
            higher = narrowing.above(target)
            self.search.stop.check()
            found = best_plan_from(higher, from_step, most_nodes, self.search.stop)
        except NotEndedError:
            # counted in full, even if too many joint states ended the search earlier
            self.nodes += most_nodes
            return False
        self.nodes += found.nodes
        if found.paths:
            self.search.offer(Incumbent.along(narrowing.model, found.paths))
        bound = found.pricing.bound
        if bound < self.bound:
            self.best = EndedTrial(bound, target, from_step, proved.stages)
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


@dataclass
class _Targets:
    """Ever lower targets: each is J of the best plan and a share of the gap that the stages leave.

    Attributes
    ----------
    explored : the share above which all plans have been explored
    less : the next reduction of that share
    nodes : nodes of the last trial that has ended
    is_halved : True once a trial has not ended: reductions then grow no more
    """

    parameters: TrialParameters
    explored: float
    less: float
    nodes: int = 0
    is_halved: bool = False

    @property
    def next(self) -> float:
        """The share of the next target."""
        return max(self.explored - self.less, 0.0)

    def lower(self, nodes: int, most_expected: float) -> bool:
        """Lowers the target after a trial that has ended; returns False if the next trial is
        expected to take too many nodes even for the least reduction.

        Parameters
        ----------
        nodes : nodes of the trial
        most_expected : largest number of nodes that the next trial may be expected to take
        """
        times = min(most_expected / max(nodes, 1), self.parameters.aimed_times)
        less = self._less_for(nodes, times)
        self.explored, self.nodes = self.next, nodes
        if not self.is_halved:
            self.less = max(less, self.parameters.least_less)
        return less >= self.parameters.least_less

    def halve(self) -> bool:
        """Halves the reduction after a trial that has not ended; returns False if it was the
        least.
        """
        self.is_halved = True
        before = self.less
        self.less = max(before / 2, self.parameters.least_less)
        return self.less < before

    def _less_for(self, nodes: int, times: float) -> float:
        """Returns the reduction for which the next trial takes so many times the nodes of this
        one.
        """
        if not 0 < self.nodes < nodes:
            return self.parameters.less
        # Each reduction multiplies the nodes by about the same factor, or a larger one later on.
        steps = math.log(times) / math.log(nodes / self.nodes)
        return min(steps * (self.explored - self.next), self.parameters.most_less)
