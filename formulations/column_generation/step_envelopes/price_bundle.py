"""The bundle method over prices of states; each set of prices makes a step envelope.

Local search evaluates prices: the joint states that it finds above the constants, and the best
paths, enter the master problem (`price_master`) at the next iteration. As the master knows only
some joint states and arcs, its value is too low, and the missing ones are found iteration by
iteration; a penalty keeps prices near the best so far (a proximal bundle method; Kiwiel 1990).
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from cocap_opt.arithmetic import exact_sum
from cocap_opt.data import FloatArray
from cocap_opt.formulations.column_generation.parameters import BundleParameters
from cocap_opt.formulations.column_generation.step_envelopes.known_states import Known
from cocap_opt.formulations.column_generation.step_envelopes.price_master import (
    KnownJoint,
    PriceMaster,
    PriceSolution,
    gains_of,
)
from cocap_opt.formulations.column_generation.step_envelopes.priced_states import (
    CLEARLY,
    PricedStates,
)
from cocap_opt.mixtures.columns import Arc


class PriceBundle:
    """The bundle method over the prices of some states.

    Attributes
    ----------
    priced : the states
    best : the bound that the best prices prove, as far as local search can tell
    constants : the constants intended for the best prices, by step; with short lists, lower
        constants prove less, since they raise the prices of unlisted states
    flow : number of robots on each known arc in the latest mixture
    """

    def __init__(self, priced: PricedStates, known: Known, parameters: BundleParameters) -> None:
        self.priced, self._known, self._parameters = priced, known, parameters
        self._bound = priced.narrowing.bound
        # by step, the worth of each known joint state by the positions of its states
        self._worths: dict[int, dict[tuple[int, ...], float]] = {t: {} for t in priced.joints}
        self._master = PriceMaster(priced)
        self.best, self._prices = np.inf, priced.initial
        self.constants: Mapping[int, float] = {}
        self.flow: dict[Arc, float] = {}
        self._weight = parameters.first_weight / max(float(np.abs(priced.initial).mean()), 1e-9)
        for t, joint in priced.joints.items():
            for positions in known.at(joint) or known.ascended(joint):
                self.remember(t, positions)

    def run(self, cutoff: Callable[[], float], report: Callable[[], None]) -> FloatArray | None:
        """Returns prices that are clearly better according to local search; None if there are none.

        Parameters
        ----------
        cutoff : bound at which the root is closed
        report : called at every iteration

        Raises
        ------
        LimitReached
            If a limit is reached.
        """
        least_gain = self._parameters.converged * (self._bound - cutoff())
        latest = self._prices
        for iteration in range(
            self._parameters.most_listed_iterations
            if self.priced.has_lists
            else self._parameters.most_iterations
        ):
            self.priced.stop.check()
            arcs = gains_of(self.priced, self._known.paths)
            highest = self._highest_known(self._prices, latest)
            if {joint.t for joint in highest} != set(self.priced.joints):
                return None  # at some step, no joint state that counts is known
            solved = self._master.solved(arcs, highest, self._prices, self._weight)
            latest = solved.prices
            self.flow = {
                Arc(*tail, head[2]): amount
                for (tail, head), amount in zip(arcs, solved.flow.tolist(), strict=True)
            }
            value, constants, new = self._judged(solved)
            promised = self.best - solved.value - self.priced.rest
            gained = self.best - value
            if gained > CLEARLY * abs(value) and (
                promised == np.inf or gained >= self._parameters.serious * promised
            ):
                self._weight /= (
                    3 if promised < np.inf and gained > self._parameters.good * promised else 1
                )
                self.best, self._prices = value, solved.prices
                self.constants = constants
            elif gained < -promised or iteration % 4 == 3:
                self._weight *= 1.5
            if not new or self.best - cutoff() < least_gain:
                break
            if self.best - solved.value - self.priced.rest < least_gain:
                break
            report()
        return self._prices if self.best < self._bound - least_gain else None

    def correct(self, value: float) -> None:
        """Records the bound that the latest prices prove, if the estimate by local search was
        lower.
        """
        self.best = max(value, self.best)

    def _judged(self, solved: PriceSolution) -> tuple[float, dict[int, float], int]:
        """Returns the bound that prices prove according to local search, and its findings.

        Returns
        -------
        The bound, constants by step, and the number of new joint states and paths
        """
        known = self._known
        new, constants = 0, dict(solved.constants)
        for t, joint in self.priced.joints.items():
            repriced = replace(joint, price=solved.prices[self.priced.spans[t]])
            clearly = solved.constants[t] + CLEARLY * abs(self._bound)
            for found in known.ascended(repriced):
                if (height := repriced.reduced_profit(found)) > clearly:
                    new += self.remember(t, found)
                    constants[t] = max(constants[t], height)
        total, paths = self.priced.best_paths(solved.prices, constants)
        new += sum(known.add_path(number, path) for number, path in paths)
        bound = total + exact_sum(constants.values()) + self.priced.rest
        return bound, constants, new

    def remember(self, t: int, positions: Sequence[int]) -> bool:
        """Stores a joint state that counts; returns True if it is new."""
        joint, first = self.priced.joints[t], self.priced.spans[t].start
        is_new = self._known.add(joint, positions)
        at = tuple(sorted(first + k for k in positions))
        if at not in self._worths[t]:
            self._worths[t][at] = joint.worth(positions)
        return is_new

    def _highest_known(self, *prices: FloatArray) -> list[KnownJoint]:
        """Returns the known joint states that are among the highest for some prices."""
        chosen: list[KnownJoint] = []
        for t, worths in self._worths.items():
            every = list(worths.items())
            at = np.array([positions for positions, _ in every], dtype=np.int64)
            worth = np.array([value for _, value in every])
            highest: set[int] = set()
            for price in prices if every else ():
                heights = worth - price[at].sum(axis=1)
                highest.update(
                    np.argsort(-heights, kind="stable")[: self._parameters.most_heights].tolist()
                )
            chosen += [KnownJoint(t, *every[k]) for k in sorted(highest)]
        return chosen
