"""Chooses the step from which joint paths are explored: the start, or a step in the middle.

From some steps an exploration takes far fewer nodes than from others, and that is known only after
trying. So the plans above a very high target are explored from many steps, and those above ever
lower targets from the best of these steps.
"""

from collections.abc import Iterable
from dataclasses import dataclass

from cocap_opt.formulations.certificates.staged import (
    Narrowing,
    NotEndedError,
    best_plan_from,
    may_begin_later,
)
from cocap_opt.formulations.column_generation.parameters import MiddleParameters
from cocap_opt.stop import Stop


@dataclass
class MiddleStep:
    """The step from which paths are explored.

    Attributes
    ----------
    from_step : the step; 0: the start
    nodes : total nodes of the explorations by which it was chosen
    """

    parameters: MiddleParameters
    from_step: int = 0
    nodes: int = 0

    def choose(self, narrowing: Narrowing, most_nodes: int, stop: Stop) -> None:
        """Chooses the step from which the plans above a high target take the fewest nodes.

        The step remains if no exploration ends, or if paths cannot begin at a later step.

        Parameters
        ----------
        most_nodes : largest number of nodes of the trial that follows

        Raises
        ------
        LimitReached
            If a limit is reached.
        """
        if not may_begin_later(narrowing.model):
            return
        horizon, parameters = narrowing.model.problem.horizon, self.parameters
        room, less = max(narrowing.bound - narrowing.target, 0.0), parameters.first_less
        few, many = int(parameters.few * most_nodes), int(parameters.many * most_nodes)
        apart = -(-horizon // parameters.most_steps)  # distance between the steps compared first
        steps = [*dict.fromkeys((self.from_step, *range(0, horizon + 1, apart)))]
        while steps and less <= 1:
            higher = narrowing.above(narrowing.target + (1 - less) * room)
            ranked = self._ranked(higher, steps, many, stop)
            if less == parameters.first_less and apart > 1:
                # The best step may be next to the best of those.
                near = {s + k for _, s in ranked[:1] for k in range(1 - apart, apart)}
                near &= {*range(horizon + 1)} - {*steps}
                ranked = sorted(ranked + self._ranked(higher, sorted(near), many, stop))
            if not ranked:
                return
            least, self.from_step = ranked[0]
            if least >= few:
                return  # the size of explorations now says enough about the next trial
            steps = [from_step for _, from_step in ranked[: parameters.most_kept]]
            less *= 2

    def _ranked(
        self, narrowing: Narrowing, steps: Iterable[int], most_nodes: int, stop: Stop
    ) -> list[tuple[int, int]]:
        """Explores all plans above the target from some steps; returns pairs of a number of nodes
        and a step, fewest nodes first.

        Explorations that take too many nodes, also in comparison with the best one before, do not
        count.
        """
        ranked = list[tuple[int, int]]()
        for from_step in steps:
            most = self.parameters.times * ranked[0][0] if ranked else most_nodes
            most = min(max(most, self.parameters.least_nodes), most_nodes)
            try:
                found = best_plan_from(narrowing, from_step, most, stop)
            except NotEndedError:
                self.nodes += most
                continue
            self.nodes += found.nodes
            ranked = sorted([*ranked, (found.nodes, from_step)])
        return ranked
