"""Recombination: the best plan along the states of several plans.

Local search ends in many plans that differ here and there. Where each of them is better than the
others, a plan that is made of parts of all is better than any; and its robots need not go on along
the path of one robot, nor its steps come from one plan. Value iteration over joint states
(`certificates.joint_paths`) finds the best of all these plans, since the bound on all plans leaves
few of their joint states to look at. So many plans are taken, the best first, as it can cope with.

Compare optimal recombination in genetic algorithms (Aggarwal, Orlin, Tai 1997; Eremeev, Kovalenko
2014), which finds the best offspring of two parents.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np

from cocap_opt.data import BoolArray
from cocap_opt.formulations.certificates import (
    Narrowing,
    NotEndedError,
    best_plan,
    compiled_search,
    may_be_used,
)
from cocap_opt.formulations.column_generation.column_pool import PlanKey
from cocap_opt.formulations.column_generation.incumbent import Incumbent
from cocap_opt.model import Model
from cocap_opt.stop import Stop, never

FIRST_PLANS, MORE_PLANS = 4, 2  # how many are taken at first; how many times more each time
MOST_PLANS = 64  # beyond which only the best are kept
# Of the searches from all joint states, each time: one or two seconds, compiled.
MOST_NODES, MOST_PLAIN_NODES = 3_000_000, 10_000
LESS_ROOM = 0.7  # where plans were too many: so much less must be open for another try


@dataclass
class Recombination:
    """The plans that were found, and what is known of their recombinations.

    Attributes
    ----------
    values : J of each plan
    """

    values: dict[PlanKey, float] = field(default_factory=dict)
    _done: set[frozenset[PlanKey]] = field(default_factory=set)
    _failed: tuple[float, float] = (math.inf, math.inf)  # number of plans, and the room then

    def add(self, plan: Incumbent) -> None:
        """Adds a plan; of too many, the worst are forgotten."""
        self.values[plan.paths] = plan.value
        if len(self.values) > 2 * MOST_PLANS:
            self.values = {key: self.values[key] for key in self._best(MOST_PLANS)}

    def _best(self, most: int) -> list[PlanKey]:
        """Returns the best plans, those first that were found first if they are equal."""
        return sorted(self.values, key=lambda key: -self.values[key])[:most]

    def better(self, plan: Incumbent, narrowing: Narrowing, stop: Stop = never) -> Incumbent | None:
        """Returns the best plan along the states of a plan and others; None if it is no better.

        Parameters
        ----------
        narrowing : of the same model; its target is not above the plan's J

        Raises
        ------
        LimitReached
            At a limit.
        """
        if not may_be_used(narrowing.model):
            return None
        best, most = plan, FIRST_PLANS
        too_many, room = self._failed
        while most < too_many or narrowing.room <= LESS_ROOM * room:
            found = self._of(most, best, narrowing, stop)
            if found is None:
                self._failed = most, narrowing.room
                break
            best = found
            if most >= len(self.values):
                break
            most *= MORE_PLANS
        return best if best.clearly_better_than(plan) else None

    def _of(self, most: int, best: Incumbent, narrowing: Narrowing, stop: Stop) -> Incumbent | None:
        """Returns the best plan along the states of the best plans; None if these are too many."""
        parents = frozenset((best.paths, *self._best(most)))
        if parents in self._done:
            return best
        above = narrowing.above(best.value)
        try:
            found = best_plan(
                above.among(_states(narrowing.model, parents, above.left)), _most_nodes(stop), stop
            )
        except NotEndedError:
            return None
        self._done.add(parents)
        better = Incumbent.along(narrowing.model, found.paths) if found.paths else None
        return best if better is None or not better.clearly_better_than(best) else better


def _states(model: Model, plans: Iterable[PlanKey], like: Sequence[BoolArray]) -> list[BoolArray]:
    """Returns the states [T+1, S] of each class that its robots visit in any of some plans."""
    visited = [np.zeros_like(some) for some in like]
    for number, robot_class in enumerate(model.classes):
        steps = np.arange(len(visited[number]))
        for paths in plans:
            for robot in robot_class.robots:
                visited[number][steps, paths[robot]] = True
    return visited


def _most_nodes(stop: Stop) -> int:
    """Returns how many nodes the searches may take."""
    return MOST_NODES if compiled_search.is_fast(stop) else MOST_PLAIN_NODES
