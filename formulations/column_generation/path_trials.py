"""Trials of the paths of all robots together, once stages have left few (`joint_paths`).

How many paths are left is only known once they have been tried, and trials of too many are in vain.
So each has a number of nodes that it may take, in proportion to what the stages took so far. Where
the paths of all better plans are too many, those of plans above a higher target may not be: the
lowest target that can be tried is the bound then.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

from cocap_opt.formulations.certificates import (
    Narrowing,
    NotEndedError,
    best_plan,
    compiled_search,
    may_be_used,
)
from cocap_opt.formulations.column_generation.incumbent import Incumbent
from cocap_opt.formulations.column_generation.search import Search

FEWEST_NODES, FEWEST_PLAIN_NODES = 100_000, 5_000  # of a trial, compiled or not
LESS_ROOM, MORE_NODES = 0.7, 2.0  # times what was open, or allowed, when a trial has failed
SHARE_OF_NODES = 0.5  # of what stages took, that trials may take between them
# Of trials for higher targets: times as many nodes as stages took, and the most. The first levels
# are soon through, and each last one brings the bound down by about as much as the one before.
LEVELS, MOST_NODES = (0.3, 3.0, 30.0), 300_000_000
TRIALS_OF_LEVEL = 3
SMALL_SHARE = 0.15  # of what is open: the next lower target is J itself


class Tried(NamedTuple):
    """A trial that has ended."""

    bound: float  # on all plans
    above: float  # J: the plans above it were tried
    stages: int  # how many there were


@dataclass
class PathTrials:
    """The trials so far.

    Attributes
    ----------
    best : the one that proves most
    nodes : of all searches of trials
    is_on : False: there are no trials, only stages
    """

    search: Search
    narrowing: Narrowing
    best: Tried | None = None
    nodes: int = 0
    is_on: bool = True
    _failed_room: float = field(default=float("inf"))
    _failed_nodes: int = 0

    def after_stages(self, stages: int, nodes: int) -> bool:
        """Tries all better plans, if that may be worth it; returns True if that has ended.

        Parameters
        ----------
        stages : how many there are
        nodes : that their searches took
        """
        fewest = FEWEST_NODES if compiled_search.is_there() else FEWEST_PLAIN_NODES
        allowed = max(int(SHARE_OF_NODES * nodes) - self.nodes, fewest)
        room = self.narrowing.room
        is_easier = room <= LESS_ROOM * self._failed_room
        if not is_easier and allowed < MORE_NODES * self._failed_nodes:
            return False
        if self._has_ended(0.0, allowed, stages):
            return True
        self._failed_room, self._failed_nodes = room, allowed
        return False

    def for_higher_targets(self, stages: int, nodes: int, report: Callable[[], None]) -> None:
        """Looks for the lowest target for which a trial ends; raises LimitReached.

        Parameters
        ----------
        stages, nodes : as in `after_stages`
        report : tells what has been proved
        """
        ended = 1.0  # share of what is open, as below
        for times in LEVELS:
            allowed, failed = min(int(times * nodes), MOST_NODES), 0.0
            for _ in range(TRIALS_OF_LEVEL):
                share = 0.0 if ended <= SMALL_SHARE and not failed else (failed + ended) / 2
                if self._has_ended(share, allowed, stages):
                    ended = share
                    report()
                else:
                    failed = share
                if ended == 0 or failed == share == 0:
                    break
            if ended == 0:
                return

    def _has_ended(self, share: float, most_nodes: int, stages: int) -> bool:
        """Tries the plans above a target; returns False if these are too many.

        Parameters
        ----------
        share : of what is open, by which the target is above the best plan
        """
        if not self.is_on or not may_be_used(self.narrowing.model):
            return False
        value = self.search.value
        target = value + share * max(self.narrowing.bound - value, 0.0)
        higher = self.narrowing.above(target)
        try:
            found = best_plan(higher, most_nodes, self.search.stop)
        except NotEndedError:
            self.nodes += most_nodes
            return False
        self.nodes += found.nodes
        if found.paths:
            self.search.offer(Incumbent.along(self.narrowing.model, found.paths))
        tried = Tried(higher.pricing_of(found.value).bound, target, stages)
        if self.best is None or tried.bound < self.best.bound:
            self.best = tried
        return True
