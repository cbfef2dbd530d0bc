"""The heights of steps at new prices, and the stages made from them.

A step has a height once a search has ended and found a value that no joint state exceeds. As soon
as heights lower the bound, they become a stage, so that fewer states remain for the searches after
it. Long searches wait until all short ones have ended: with fewer states they are shorter, both
here and for anyone who checks the certificate later.
"""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain

import numpy as np

from cocap_opt.arithmetic import exact_sum
from cocap_opt.data import FloatArray
from cocap_opt.formulations.certificates.format import Stage, StepConstant
from cocap_opt.formulations.certificates.staged import JointStates, Narrowing
from cocap_opt.formulations.column_generation.step_envelopes.list_lengths import ListLengths
from cocap_opt.formulations.column_generation.step_envelopes.price_bundle import PriceBundle
from cocap_opt.formulations.column_generation.step_envelopes.priced_states import PricedStates
from cocap_opt.formulations.column_generation.step_envelopes.stages import Stages
from cocap_opt.formulations.column_generation.step_envelopes.step_searches import StepSearches


@dataclass
class Heights:
    """The heights of steps at new prices, which no joint state exceeds.

    Attributes
    ----------
    bundle, prices : the bundle, and the prices of the heights
    proved : the stages so far
    searches : searches for joint states
    lengths : lengths of the lists of states
    keep : called repeatedly with the stages so far, which it stores and reports; may raise
        LimitReached
    adopted : by step, the heights that are part of a stage
    waiting : by step, the heights that are not yet part of a stage
    """

    bundle: PriceBundle
    prices: FloatArray
    proved: Stages
    searches: StepSearches
    lengths: ListLengths
    keep: Callable[[Stages], None]
    adopted: dict[int, float] = field(default_factory=dict)
    waiting: dict[int, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Records the number of nodes of all searches when a stage was last made or considered."""
        self._nodes = self.searches.nodes
        self._parameters = self.searches.parameters

    @property
    def _priced(self) -> PricedStates:
        return self.bundle.priced

    @property
    def _narrowing(self) -> Narrowing:
        return self.proved.narrowing

    def adopt(self) -> bool:
        """Turns the prices into one or more stages if they are better; other steps keep their
        prices.

        Returns
        -------
        bool
            False if there is no stage; if any search has ended, the bundle has then been corrected.

        Raises
        ------
        LimitReached
            If a limit is reached.
        """
        left = sorted(self._priced.joints, key=self._n_states)
        for most, patience in self._limits_of_nodes():
            left = self._left_after(left, most, patience)
        for t in left:
            self.lengths.note(t, self._n_states(t), None)
        if self.waiting:
            total = self._total()
            if total < self._narrowing.bound:
                self._add()
            elif not self.adopted:
                self.bundle.correct(total)
        return bool(self.adopted)

    def _n_states(self, t: int) -> int:
        """Returns the number of states that have prices at a step."""
        return len(self._priced.joints[t].states)

    def _limits_of_nodes(self) -> Iterable[tuple[int, float]]:
        """Yields the number of nodes that searches may use, first few and then more, up to the
        limit.

        Each comes with the number of searches that may fail before all get more nodes, or are
        abandoned: if none has ended with fewer nodes, none is likely to.
        """
        most, limit = self.searches.many_nodes(), self._parameters.first_nodes
        while limit < most:
            yield limit, max(self._parameters.patience, self._parameters.most_in_vain / limit)
            limit = max(limit * self._parameters.next_times, limit + 1)
        has_ended = self.adopted or self.waiting
        yield most, math.inf if has_ended else self._parameters.patience

    def _left_after(self, steps: Sequence[int], most_nodes: int, patience: float) -> list[int]:
        """Returns the steps that have no height after searches with the given number of nodes
        each.
        """
        left: list[int] = []
        for k, t in enumerate(steps):
            if len(left) >= patience:
                return [*steps[k:], *left]
            if not self.find(t, most_nodes):
                left.append(t)
        return left

    def find(self, t: int, most_nodes: int) -> bool:
        """Searches for the height of a step, and makes a stage of all waiting heights when it is
        time.

        Returns
        -------
        bool
            False if the search does not end within the given nodes.
        """
        self.keep(self.proved)
        joint, price = self._priced.joints[t], self.prices[self._priced.spans[t]]
        if self.adopted:
            joint, price = self._still_left(joint, price)
        joint = _repriced(joint, price, self._narrowing.ceiling(t))
        least = self.searches.known.highest(joint)
        if self._priced.has_lists:
            least = max(least, self.bundle.constants[t])
        found = self.searches.highest(joint, least, most_nodes)
        if found is None:
            return False
        self.lengths.note(t, self._n_states(t), found.nodes)
        if found.positions and not self.adopted:
            self.bundle.remember(t, found.positions)
        self.waiting[t] = found.profit
        if self.searches.nodes - self._nodes >= self._parameters.nodes_of_stage:
            self._nodes = self.searches.nodes
            room = self._narrowing.bound - self._narrowing.target
            least_gain = self._parameters.least_of_stage * room
            if self._narrowing.bound - self._total() >= least_gain:
                self._add()
        return True

    def _still_left(self, joint: JointStates, prices: FloatArray) -> tuple[JointStates, FloatArray]:
        """Returns the remaining joint states of a step, and the prices of their states."""
        left = np.zeros(len(joint.states), dtype=np.bool_)
        states = []
        for number, of_class in enumerate(self._narrowing.left):
            mine = joint.class_of == number
            left[mine] = of_class[joint.t, joint.states[mine]]
            states.append(joint.states[mine & left])
        return self._narrowing.joint_states_of(joint.t, states), prices[left]

    def _total(self) -> float:
        """Returns the bound with new prices at the steps that have a height."""
        priced, known = self._priced, self.adopted | self.waiting
        chosen = priced.initial.copy()
        for t in known:
            chosen[priced.spans[t]] = self.prices[priced.spans[t]]
        constants = self._narrowing.constants
        total = exact_sum(known.get(t, float(constants[t])) for t in priced.joints)
        return total + priced.rest + priced.best_paths(chosen, known)[0]

    def _add(self) -> None:
        """Adds a stage with the new prices of all steps with waiting heights."""
        priced, waiting = self._priced, self.waiting
        written = (priced.written(t, self.prices[priced.spans[t]], waiting[t]) for t in waiting)
        constants = tuple(StepConstant(t, height) for t, height in waiting.items())
        self.proved = self.proved.then(Stage(tuple(chain.from_iterable(written)), constants))
        self.adopted |= waiting
        self.waiting = {}
        self.keep(self.proved)


def _repriced(joint: JointStates, price: FloatArray, constant: float) -> JointStates:
    """Returns the same joint states at other prices.

    Parameters
    ----------
    constant : an upper bound on the profit of joint states at the current prices, including
        rounding
    """
    raised = price - joint.price
    ceilings = [(profit, before + raised) for profit, before in joint.ceilings]
    if constant < math.inf:
        ceilings.append((constant, raised))
    return replace(joint, price=price, ceilings=tuple(ceilings))
