"""Trials of the joint paths of all robots, once stages have left few of them (`joint_paths`).

The number of remaining paths is known only after trying them, and trials of too many fail. So each
trial has a limit on its nodes, in proportion to the nodes of the stages so far.

Large trials begin at a step in the middle (`middle_step`).
"""

import math
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
        room = narrowing.room_above(narrowing.target)
        is_easier = room <= self.search.parameters.recombination.less_room * self._failed_room
        if not is_easier and allowed < self._parameters.more_nodes * self._failed_nodes:
            return False
        from_step = self._middle_step(narrowing, allowed)
        if self._has_ended(proved, from_step, allowed):
            return True
        self._failed_room, self._failed_nodes = room, allowed
        return False

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
            self._middle.choose(narrowing, most_nodes, self.search.stop)
            self.nodes += self._middle.nodes - before
        return self._middle.from_step

    def _has_ended(self, proved: Stages, from_step: int, most_nodes: int) -> bool:
        """Explores the plans above the target; returns False if there are too many.

        Parameters
        ----------
        from_step : step from which paths are explored; 0: the start
        """
        if not self.is_possible:
            return False
        narrowing = proved.narrowing
        target = max(narrowing.target, self.search.value)
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
