"""Recombination: the best plan along the states of several plans.

Local search ends in many plans that differ in places. If each is better than the others in some
part, a plan that combines the best parts is better than all; in such a plan, a robot need not
follow one robot's path, and the steps need not come from one plan. Value iteration over joint
states (`staged.joint_paths`) finds the best of all such plans, since the bound on all plans leaves
few joint states to explore. As many plans are recombined as the search can handle, best first.

Compare optimal recombination in genetic algorithms (Aggarwal, Orlin, Tai 1997; Eremeev, Kovalenko
2014), which finds the best offspring of two parents.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

import numpy as np

from cocap_opt.data import BoolArray
from cocap_opt.formulations.certificates.staged import (
    Narrowing,
    NotEndedError,
    best_plan,
    compiled_search,
    may_be_used,
)
from cocap_opt.formulations.column_generation.parameters import RecombinationParameters
from cocap_opt.formulations.column_generation.primal.incumbent import Incumbent
from cocap_opt.mixtures.column_pool import PlanKey
from cocap_opt.model import Model
from cocap_opt.stop import Stop, never


def searches_are_fast(stop: Stop) -> bool:
    """Returns True if searches are compiled, or will be once they take long."""
    return compiled_search.KERNEL.may_take_over(stop)


@dataclass
class Recombination:
    """The plans found so far, and the outcomes of their recombinations.

    Attributes
    ----------
    values : J of each plan
    """

    parameters: RecombinationParameters
    values: dict[PlanKey, float] = field(default_factory=dict)
    _done: set[frozenset[PlanKey]] = field(default_factory=set)
    # number of plans in the last recombination that failed because there were too many
    _failed_plans: float = np.inf
    _failed_room: float = np.inf

    def add(self, plan: Incumbent) -> None:
        """Adds a plan; if there are too many, only the best are kept."""
        self.values[plan.paths] = plan.value
        if len(self.values) > 2 * self.parameters.most_plans:
            self.values = {
                key: self.values[key] for key in self._best_keys(self.parameters.most_plans)
            }

    def _best_keys(self, most: int) -> list[PlanKey]:
        """Returns the best plans; among equal ones, those that were found first."""
        return sorted(self.values, key=lambda key: -self.values[key])[:most]

    def applies_to(self, model: Model) -> bool:
        """Returns True if there are plans to recombine, and if joint states determine J of the
        model.
        """
        return len(self.values) > 1 and may_be_used(model)

    def better_plans(
        self, plan: Incumbent, narrowing: Narrowing, stop: Stop = never
    ) -> Iterator[Incumbent]:
        """Yields ever better plans along the states of a plan and others, using more plans each
        time.

        Parameters
        ----------
        narrowing : a narrowing of the same model, to which recombination applies; its target is not
            above J

        Raises
        ------
        LimitReached
            If a limit is reached.
        """
        best, most = plan, self.parameters.first_plans
        least, most_room = self._failed_plans, self.parameters.less_room * self._failed_room
        while True:
            room = narrowing.room_above(best.value)
            if most >= least and room > most_room:
                return
            parents = frozenset((best.paths, *self._best_keys(most)))
            try:
                better = self._recombined(parents, best, narrowing, stop)
            except NotEndedError:
                self._failed_plans, self._failed_room = most, room
                return
            if better is not None:
                yield (best := better)
            if most >= len(self.values):
                return
            most *= self.parameters.more_plans

    def _most_nodes(self, stop: Stop) -> int:
        """Returns the largest number of nodes that the searches may use."""
        most, plain = self.parameters.most_nodes, self.parameters.most_plain_nodes
        return most if searches_are_fast(stop) else plain

    def _recombined(
        self, parents: frozenset[PlanKey], best: Incumbent, narrowing: Narrowing, stop: Stop
    ) -> Incumbent | None:
        """Returns the best plan along the states of some plans; None if it is not better.

        Raises
        ------
        NotEndedError
            If there are too many joint states.
        LimitReached
            If a limit is reached.
        """
        if parents in self._done:
            return None
        stop.check()
        visited = _visited_states(narrowing.model, parents)
        found = best_plan(narrowing.above(best.value, visited), self._most_nodes(stop), stop)
        self._done.add(parents)
        better = Incumbent.along(narrowing.model, found.paths) if found.paths else None
        return None if better is None or not better.gains_over(best) else better


def _visited_states(model: Model, plans: Iterable[PlanKey]) -> list[BoolArray]:
    """Returns the states [T+1, S] of each class that its robots visit in any of the given plans."""
    steps = np.arange(model.problem.horizon + 1)
    visited = []
    for robot_class in model.classes:
        on_paths = np.zeros((len(steps), robot_class.graph.n_states), dtype=np.bool_)
        for paths in plans:
            for robot in robot_class.robots:
                on_paths[steps, paths[robot]] = True
        visited.append(on_paths)
    return visited
