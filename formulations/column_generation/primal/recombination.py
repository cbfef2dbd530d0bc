"""Recombination: the best plan along the states of several plans.

Local search ends in many plans that differ here and there. Where each of them is better than the
others, a plan that is made of parts of all is better than any; and its robots need not go on along
the path of one robot, nor its steps come from one plan. Value iteration over joint states
(`staged.joint_paths`) finds the best of all these plans, since the bound on all plans leaves
few of their joint states to look at. So many plans are taken, the best first, as it can cope with.

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
    """Returns True if searches are compiled, or will be once they are long."""
    return compiled_search.is_loaded() or compiled_search.may_take_over(stop)


@dataclass
class Recombination:
    """The plans that were found, and what is known of their recombinations.

    Attributes
    ----------
    values : J of each plan
    """

    parameters: RecombinationParameters
    values: dict[PlanKey, float] = field(default_factory=dict)
    _done: set[frozenset[PlanKey]] = field(default_factory=set)
    _failed_plans: float = np.inf  # of the last recombination of too many
    _failed_room: float = np.inf

    def add(self, plan: Incumbent) -> None:
        """Adds a plan; once there are too many, only the best are kept."""
        self.values[plan.paths] = plan.value
        if len(self.values) > 2 * self.parameters.most_plans:
            self.values = {
                key: self.values[key] for key in self._best_keys(self.parameters.most_plans)
            }

    def _best_keys(self, most: int) -> list[PlanKey]:
        """Returns the best plans, those first that were found first if they are equal."""
        return sorted(self.values, key=lambda key: -self.values[key])[:most]

    def applies_to(self, model: Model) -> bool:
        """Returns True if there are plans to recombine, and joint states decide J of the model."""
        return len(self.values) > 1 and may_be_used(model)

    def better_plans(
        self, plan: Incumbent, narrowing: Narrowing, stop: Stop = never
    ) -> Iterator[Incumbent]:
        """Yields better plans along the states of a plan and others, each the best of more plans.

        Parameters
        ----------
        narrowing : of the same model, to which recombination applies; its target is not above J

        Raises
        ------
        LimitReached
            At a limit.
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
        """Returns the most nodes that the searches may take."""
        most, plain = self.parameters.most_nodes, self.parameters.most_plain_nodes
        return most if searches_are_fast(stop) else plain

    def _recombined(
        self, parents: frozenset[PlanKey], best: Incumbent, narrowing: Narrowing, stop: Stop
    ) -> Incumbent | None:
        """Returns the best plan along the states of some plans; None if it is not better.

        Raises
        ------
        NotEndedError
            If these are too many.
        LimitReached
            At a limit.
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
    """Returns the states [T+1, S] of each class that its robots visit in any of some plans."""
    steps = np.arange(model.problem.horizon + 1)
    visited = []
    for robot_class in model.classes:
        on_paths = np.zeros((len(steps), robot_class.graph.n_states), dtype=np.bool_)
        for paths in plans:
            for robot in robot_class.robots:
                on_paths[steps, paths[robot]] = True
        visited.append(on_paths)
    return visited
