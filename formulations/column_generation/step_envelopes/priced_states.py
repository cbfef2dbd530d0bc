"""The states that get prices of their own, and the best paths at their prices.

At steps with a ceiling, only some states are listed. Their prices are at least the initial ones,
and all other states are priced higher by the difference between the ceiling and the step's
constant (`staged.narrowing`).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cocap_opt.arithmetic import exact_sum
from cocap_opt.data import FloatArray
from cocap_opt.formulations.certificates.format import StepPrices
from cocap_opt.formulations.certificates.staged import JointStates, Narrowing
from cocap_opt.graph.move_rewards import Bonuses
from cocap_opt.graph.value_iteration import backward_sweep, best_path
from cocap_opt.model import Path
from cocap_opt.stop import Stop

CLEARLY = 1e-9  # relative to the bound: a height this much above a constant exceeds it


@dataclass(frozen=True, eq=False)
class PricedStates:
    """The remaining states that get prices, or the best of them, step by step.

    Attributes
    ----------
    narrowing : the states that remain, and their current prices
    joints : the joint states of each step
    ceilings : for steps at which only some of the states are in `joints`, a value that no joint
        state's height currently exceeds
    stop : checked during sweeps
    """

    narrowing: Narrowing
    joints: Mapping[int, JointStates]
    ceilings: Mapping[int, float]
    stop: Stop

    @cached_property
    def initial(self) -> FloatArray:
        """The initial prices of all states of `joints` [n]."""
        return np.concatenate([joint.price for joint in self.joints.values()])

    @cached_property
    def spans(self) -> dict[int, slice]:
        """The positions of the prices of each step."""
        ends = np.cumsum([0, *(len(joint.states) for joint in self.joints.values())]).tolist()
        return {t: slice(a, b) for t, a, b in zip(self.joints, ends[:-1], ends[1:], strict=True)}

    @cached_property
    def unpriced(self) -> list[FloatArray]:
        """For each class, the current prices of states [T+1, S]; -inf where they are closed."""
        both = zip(self.narrowing.left, self.narrowing.rewards, strict=True)
        return [np.where(left, rewards, -np.inf) for left, rewards in both]

    @cached_property
    def bonuses(self) -> Bonuses:
        """The rewards for moves."""
        return Bonuses.of(self.narrowing.model.problem.objective)

    @cached_property
    def positions(self) -> dict[tuple[int, int, int], int]:
        """The position of the price of each place: class number, step and state number."""
        return {
            (int(c), t, int(s)): self.spans[t].start + k
            for t, joint in self.joints.items()
            for k, (c, s) in enumerate(zip(joint.class_of, joint.states, strict=True))
        }

    @cached_property
    def rest(self) -> float:
        """The part of the bound besides the constants of steps, the paths and what moves save."""
        narrowing = self.narrowing
        constants = exact_sum(float(narrowing.constants[t]) for t in self.joints)
        saved = float(narrowing.saved.sum())
        return narrowing.bound + saved - constants - self.best_paths(self.initial, {})[0]

    @property
    def has_lists(self) -> bool:
        """True if only some of the states have their own prices."""
        return bool(self.ceilings)

    def raised_by(self, constants: Mapping[int, float]) -> dict[int, float]:
        """Returns the price increase of states without a price, by step, for lower constants.

        The increase is clearly larger than needed, so that rounding cannot make it too small.
        """
        return {
            t: max(ceiling - constants[t], 0.0) + CLEARLY * abs(ceiling)
            for t, ceiling in self.ceilings.items()
            if t in constants
        }

    def best_paths(
        self, prices: FloatArray, constants: Mapping[int, float]
    ) -> tuple[float, list[tuple[int, Path]]]:
        """Returns the total worth of the best paths, and the paths with their classes.

        Parameters
        ----------
        constants : constants of steps at which the prices of states without their own price rise
        """
        raised = self.raised_by(constants)
        total, paths = 0.0, []
        for number, robot_class in enumerate(self.narrowing.model.classes):
            reward = self.unpriced[number].copy()
            for t, joint in self.joints.items():
                reward[t] += raised.get(t, 0.0)
                of_class = joint.class_of == number
                reward[t, joint.states[of_class]] = prices[self.spans[t]][of_class]
            charges = self.narrowing.charges[number]
            value = backward_sweep(
                robot_class.graph, reward, self.bonuses, charges, robot_class.goal, self.stop
            )
            for starts in robot_class.starts:
                total += float(value[0, starts].max())
                path = best_path(robot_class.graph, value, starts, self.bonuses, charges)
                if path is not None:
                    paths.append((number, tuple(path)))
        return total, paths

    def written(self, t: int, prices: FloatArray, constant: float) -> list[StepPrices]:
        """Returns the prices of a step in the form of a certificate, class by class."""
        joint = self.joints[t]
        others = self.raised_by({t: constant}).get(t, 0.0)
        parts = []
        for number, robot_class in enumerate(self.narrowing.model.classes):
            of_class, graph = joint.class_of == number, robot_class.graph
            states = tuple(graph.state(int(state)) for state in joint.states[of_class])
            parts.append(StepPrices(t, number, states, tuple(prices[of_class].tolist()), others))
        return parts
