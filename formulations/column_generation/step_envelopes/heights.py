"""The heights of steps at new prices, and the stages that they make.

A step has a height if the search ends for one that no joint state exceeds. Once heights lower the
bound they are a stage, so that fewer states are left to the searches after it. Long searches wait
until all short ones have ended: among fewer states they are shorter, here and for anyone who later
checks the certificate.
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
from cocap_opt.formulations.column_generation.step_envelopes.stages import Stages
from cocap_opt.formulations.column_generation.step_envelopes.step_searches import StepSearches


@dataclass
class Heights:
    """The heights of steps at new prices, which no joint state exceeds.

    Attributes
    ----------
    bundle, prices : that they are of
    proved : the stages so far
    searches : for joint states
    lengths : of the lists of states
    keep : takes the stages so far, again and again, and reports; may raise LimitReached
    adopted : by step, those that are part of a stage
    waiting : by step, those that are not yet
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
        """Notes the nodes of all searches when a stage was made or thought of last."""
        self._nodes = self.searches.nodes
        self._parameters = self.searches.parameters

    @property
    def _narrowing(self) -> Narrowing:
        return self.proved.narrowing

    def adopt(self) -> bool:
        """Makes the prices a stage or several if they are better; other steps keep their prices.

        Returns
        -------
        bool
            False if there is no stage; if any search has ended, the bundle knows why, then.

        Raises
        ------
        LimitReached
            At a limit.
        """
        left = sorted(self.bundle.joints, key=lambda t: len(self.bundle.joints[t].states))
        for most, patience in self._limits_of_nodes():
            left = self._left_after(left, most, patience)
        for t in left:
            self.lengths.note(t, len(self.bundle.joints[t].states), None)
        if self.waiting:
            total = self._total()
            if total < self._narrowing.bound:
                self._add()
            elif not self.adopted:
                self.bundle.correct(total)
        return bool(self.adopted)

    def _limits_of_nodes(self) -> Iterable[tuple[int, float]]:
        """Yields the nodes that searches may have, first few and then more, up to the most.

        With each comes the number of searches that may fail before all get more, or are given up:
        where none has ended with fewer nodes, none is likely to.
        """
        most, limit = self.searches.many_nodes(), self._parameters.first_nodes
        while limit < most:
            yield limit, max(self._parameters.patience, self._parameters.most_in_vain / limit)
            limit = max(limit * self._parameters.next_times, limit + 1)
        has_ended = self.adopted or self.waiting
        yield most, math.inf if has_ended else self._parameters.patience

    def _left_after(self, steps: Sequence[int], most_nodes: int, patience: float) -> list[int]:
        """Returns the steps that have no height after searches of so many nodes each."""
        left: list[int] = []
        for k, t in enumerate(steps):
            if len(left) >= patience:
                return [*steps[k:], *left]
            if not self.find(t, most_nodes):
                left.append(t)
        return left

    def find(self, t: int, most_nodes: int) -> bool:
        """Looks for the height of a step, and makes a stage of all that wait where it is time.

        Returns
        -------
        bool
            False if the search does not end within so many nodes.
        """
        self.keep(self.proved)
        joint, paid = self.bundle.joints[t], self.prices[self.bundle.span(t)]
        if self.adopted:
            joint, paid = self._still_left(joint, paid)
        joint = _repriced(joint, paid, self._narrowing.ceiling(t))
        least = self.searches.known.highest(joint)
        if self.bundle.has_lists:
            least = max(least, self.bundle.constants[t])
        found = self.searches.highest(joint, least, most_nodes)
        if found is None:
            return False
        self.lengths.note(t, len(self.bundle.joints[t].states), found.nodes)
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
        """Returns the joint states of a step that are still left, and their states' prices."""
        left = np.zeros(len(joint.states), dtype=np.bool_)
        states = []
        for number, of_class in enumerate(self._narrowing.left):
            mine = joint.class_of == number
            left[mine] = of_class[joint.t, joint.states[mine]]
            states.append(joint.states[mine & left])
        return self._narrowing.joint_states_of(joint.t, states), prices[left]

    def _total(self) -> float:
        """Returns the bound at new prices of the steps that have a height."""
        bundle, known = self.bundle, self.adopted | self.waiting
        chosen = bundle.centre.copy()
        for t in known:
            chosen[bundle.span(t)] = self.prices[bundle.span(t)]
        constants = self._narrowing.constants
        total = exact_sum(known.get(t, float(constants[t])) for t in bundle.joints)
        return total + bundle.rest + bundle.best_paths(chosen, known)[0]

    def _add(self) -> None:
        """Adds a stage of the new prices of the steps whose heights wait for one."""
        bundle, waiting = self.bundle, self.waiting
        written = (bundle.written(t, self.prices[bundle.span(t)], waiting[t]) for t in waiting)
        constants = tuple(StepConstant(t, height) for t, height in waiting.items())
        self.proved = self.proved.then(Stage(tuple(chain.from_iterable(written)), constants))
        self.adopted |= waiting
        self.waiting = {}
        self.keep(self.proved)


def _repriced(joint: JointStates, price: FloatArray, constant: float) -> JointStates:
    """Returns the same joint states at other prices.

    Parameters
    ----------
    constant : that no joint state's profit exceeds at the present prices, rounding included
    """
    raised = price - joint.price
    ceilings = [(profit, before + raised) for profit, before in joint.ceilings]
    if constant < math.inf:
        ceilings.append((constant, raised))
    return replace(joint, price=price, ceilings=tuple(ceilings))
