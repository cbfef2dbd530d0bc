"""Narrowing down where better plans can be: payments for states, and states that are closed.

Multipliers bound J by constants K_t for the faces of each step, a constant for rows, and one best
path per robot (`pricing`). Write B for that bound, sigma_i(t, s) for what robot i's best path
through state s at step t lacks to its best path, and h_t for the height of the joint state of a
plan at t: its worth less what is paid for it (`joint_states`). Then

    J = B - sum of the paths' slacks - sum_t (K_t - h_t) - mu (1 - used),     all terms >= 0,

so that a plan with J > target obeys, at every step,

    sum_i sigma_i(t, s_i) + (K_t - h_t) <= B - target.                                         (*)

States whose own slack breaks it are closed: no plan above the target visits them (Lagrangian
fixing). From then on it is enough to bound plans that visit only states that are left, and
only joint states that obey (*). For these, robots may be paid anything for being in a state at a
step, if K_t is a number that none of their heights exceeds then: the concave envelope over joint
states, of which each set of payments is a supporting plane. Stages of the two take turns: new
payments and their constants, states closed. At the end

    J <= max(target, B)    for all plans.

Payments need not be told state by state. Where no joint state was higher than K' when payment' was
paid, none is now higher than

    K' - sum_i [payment(s_i) - payment'(s_i)],                                                (**)

so that a state that is paid K' - K more than before, all others no less, is in no joint state
higher than K. A stage pays all states of a step that much more, but for those on a short list;
K_t is then found by search among the states on the list. What others are paid more costs nothing
where their paths' slack is as large. Joint states that break (*) of an earlier stage may be higher
than (**), but no plan above the target visits these.
"""

import math
from collections.abc import Sequence
from copy import copy
from typing import NamedTuple

import numpy as np

from cocap_opt.data import BoolArray, FloatArray, IntArray
from cocap_opt.formulations.certificates.format import (
    CertificateError,
    Multipliers,
    StepConstant,
    StepPayments,
)
from cocap_opt.formulations.certificates.pricing import (
    UNIT_ROUNDOFF,
    Prices,
    Pricing,
    rounding_factor,
)
from cocap_opt.formulations.certificates.staged.joint_states import (
    Ceiling,
    Highest,
    JointStates,
    Wanted,
)
from cocap_opt.formulations.certificates.sweep import (
    reward_of_staying,
    values_so_far,
    values_to_go,
)
from cocap_opt.graph.charges import Charges
from cocap_opt.model import Model
from cocap_opt.stop import Stop, never
from cocap_opt.sums import exact_sum


class _Earlier(NamedTuple):
    """Payments that were replaced, and the constant of their step."""

    constant: float  # rounding included
    rewards: list[FloatArray]  # of each class, the payments [S]


class _Closing(NamedTuple):
    """The constants [T+1] when states were closed, and each class's slack [T+1, S]."""

    constants: FloatArray
    slack: list[FloatArray]


class Narrowing:
    """The bound on the plans above a target, as payments change and states are closed.

    Attributes
    ----------
    model : whose classes the multipliers count
    target : J: plans that are not above it need not be bounded
    constants : [T+1] K_t; infinite where payments are new
    rewards : of each class, the payments [T+1, S]
    left : of each class, the states [T+1, S] that plans above the target may visit
    slack : of each class, what the best path through each state [T+1, S] lacks to the best path
    """

    def __init__(
        self, model: Model, multipliers: Multipliers, target: float, stop: Stop = never
    ) -> None:
        if model.problem.objective.over_time:
            raise CertificateError("certificate: where pixels add up over time, there are no steps")
        if not math.isfinite(target):
            raise CertificateError("certificate.target: must be finite")
        self.model, self.target, self._rows = model, target, multipliers.rows
        self._prices = prices = Prices.of(model, multipliers, stop=stop)
        constants = prices.payment.constants.reshape(model.problem.horizon + 1, model.n_faces)
        self.constants: FloatArray = constants.sum(axis=1)
        classes = range(len(model.classes))
        self.rewards = [prices.rewards(number) for number in classes]
        self.slack: list[FloatArray] = []
        self.left: list[BoolArray] = [np.ones(some.shape, dtype=np.bool_) for some in self.rewards]
        self._charges = [prices.charges(number) for number in classes]
        self.price()
        self._require_finite()
        # Whether a joint state counts is decided with the payments with which states were closed.
        self._charged = self._charged_now()
        self._floors = np.full(len(self.constants), -np.inf)
        self._closing = _Closing(self.constants.copy(), self.slack)
        self._earlier: list[list[_Earlier]] = [[] for _ in self.constants]

    @property
    def bound(self) -> float:
        """B, which no plan above the target exceeds, but for rounding."""
        return float(self.constants.sum()) + self._prices.charge.constant + self._paths

    @property
    def rounding(self) -> float:
        """The most that rounding changes of B, in units of J."""
        return self._rounding(float(np.abs(self.constants).sum()))

    def _rounding(self, constants: float) -> float:
        """Returns the most that rounding changes of a sum of constants, prices and payments."""
        payment, charge = self._prices.payment, self._prices.charge
        made_of = payment.magnitude + charge.magnitude + self._paths_made_of + constants
        return rounding_factor(self.model, len(charge.costs), payment.cuts) * made_of

    @property
    def pricing(self) -> Pricing:
        """The bound on all plans that the stages so far prove; raises CertificateError."""
        self._require_finite()
        return Pricing(self._proved_by(self.bound), self.rounding)

    def pricing_of(self, best: float) -> Pricing:
        """Returns the bound on all plans, once those above the target have been tried.

        Parameters
        ----------
        best : J of the best of them; -infinity if there is none
        """
        of_stages = self.pricing
        return of_stages._replace(bound=min(of_stages.bound, self._proved_by(best)))

    def _proved_by(self, most: float) -> float:
        """Returns the bound on all plans if none above the target exceeds `most`."""
        return max(self.target, math.nextafter(most + self.rounding, math.inf))

    @property
    def room(self) -> float:
        """The right side of (*), rounding included."""
        return self.room_above(self.target)

    def room_above(self, target: float) -> float:
        """Returns the right side of (*) for another target."""
        return self.bound + 2 * self.rounding - target

    @property
    def states_left(self) -> IntArray:
        """Number of states that are left at each step [T+1]."""
        left: IntArray = np.sum([some.sum(axis=1) for some in self.left], axis=0)
        return left

    @property
    def joint_states_left(self) -> int:
        """Number of joint states of all steps, conflicts included; none are too many for an int."""
        first, sizes = self.model.problem.first_step, self.model.class_sizes
        per_step = np.array([some.sum(axis=1) for some in self.left]).T[first:].tolist()
        return sum(
            math.prod(math.comb(n + k - 1, k) for n, k in zip(left, sizes, strict=True))
            for left in per_step
        )

    def rest(self, t: int) -> float:
        """Returns what later constants and rows add to the worth so far and `future`, in J.

        A plan above the target whose steps up to t are worth F is worth at most F, this, and the
        sum of what all robots can get from their states at t on.
        """
        later = float(self.constants[t + 1 :].sum())
        # Rows charge at most their multipliers at the step itself, which this sum holds.
        return later + exact_sum(row.multiplier for row in self._rows if row.resource.t >= t)

    def future(self, number: int, t: int, states: IntArray) -> FloatArray:
        """Returns what robots of a class can get for later steps [n], in units of J.

        Parameters
        ----------
        states : [n] where they are at step t
        """
        future: FloatArray = self._to_go[number][t, states] - self.rewards[number][t, states]
        return future

    def apart(self, numbers: Sequence[int], t: int, states: Sequence[IntArray]) -> JointStates:
        """Returns the joint states of robots apart; what they are charged is `future`, negated.

        So worth less charges is what the step and the later payments can bring, and the present
        payments are one limit of it.

        Parameters
        ----------
        numbers : of each robot, its class
        states : of each robot, some of the states that are left at the step
        """
        charge = [
            -self.future(number, t, some) for number, some in zip(numbers, states, strict=True)
        ]
        paid_more = [
            own - self.rewards[number][t, some]
            for number, some, own in zip(numbers, states, charge, strict=True)
        ]
        limit = self._ceiling_of(self.ceiling(t), np.concatenate(paid_more))
        return JointStates.of(
            self.model, t, states, charge, charge, -np.inf, limits=(limit,), apart=numbers
        )

    def charges(self, number: int) -> Charges:
        """Returns what the robots of a class are charged by rows."""
        return self._charges[number]

    def close_states(self) -> None:
        """Closes the states that no plan above the target visits; raises CertificateError."""
        self._require_finite()
        for left, slack in zip(self.left, self.slack, strict=True):
            left &= slack <= self.room
        self.price()
        self._charged = self._charged_now()
        self._floors = self.constants - self.room
        self._closing = _Closing(self.constants.copy(), self.slack)

    def above(self, target: float, among: Sequence[BoolArray] | None = None) -> "Narrowing":
        """Returns the same for a target that is not lower, for which more states are closed.

        What changes later in one of the two does not change in the other.

        Parameters
        ----------
        among : of each class, the only states [T+1, S] that plans may visit; no others are bounded

        Raises
        ------
        CertificateError
            If the target is lower, or not finite.
        """
        if not self.target <= target < math.inf:
            raise CertificateError("certificate.paths_above: must be finite, and not below target")
        other = copy(self)
        other.target, other.constants = target, self.constants.copy()
        other.rewards = [some.copy() for some in self.rewards]
        other.left = [some.copy() for some in self.left]
        other._earlier = [some.copy() for some in self._earlier]
        for left, some in zip(other.left, among or other.left, strict=True):
            left &= some
        other.close_states()
        return other

    def _require_finite(self) -> None:
        """Refuses numbers so large that nothing follows from them: inf - inf bounds nothing."""
        if not math.isfinite(self.rounding) or math.isnan(self.bound) or self.bound == math.inf:
            raise CertificateError("certificate: too large, the bound is infinite")

    def pay(self, payments: StepPayments) -> None:
        """Replaces the payments of a class at a step; K_t is not known from then on."""
        t, graph = payments.t, self.model.classes[payments.class_number].graph
        if (constant := float(self.constants[t])) < math.inf:
            rewards = [own[t].copy() for own in self.rewards]
            earlier = _Earlier(constant + self._rounding(abs(constant)), rewards)
            self._earlier[t].append(earlier)
        states = [graph.index(state) for state in payments.states]
        reward = self.rewards[payments.class_number][t]
        reward += payments.others
        reward[states] = payments.payments
        self.constants[t] = math.inf

    def joint_states(self, t: int, above: float = -math.inf) -> JointStates:
        """Returns the joint states that are left at a step, with what they are paid.

        Parameters
        ----------
        above : states may be missing that are in no joint state higher than this
        """
        return self.joint_states_of(t, self.states_of_joint(t, above))

    def joint_states_of(self, t: int, states: Sequence[IntArray]) -> JointStates:
        """Returns the joint states of some of the states that are left to each class at a step."""
        ceilings = tuple(self._ceiling(t, earlier, states) for earlier in self._earlier[t])
        payment, charge = (
            [array[t, some] for array, some in zip(arrays, states, strict=True)]
            for arrays in (self.rewards, self._charged)
        )
        floor = float(self._floors[t])
        limits = (self._limit(t, states),)
        return JointStates.of(self.model, t, states, payment, charge, floor, ceilings, limits)

    def ceiling(self, t: int) -> float:
        """Returns the ceiling that the present constant of a step is to later payments."""
        return float(self.constants[t]) + self._rounding(abs(float(self.constants[t])))

    def states_of_joint(self, t: int, above: float = -math.inf) -> list[IntArray]:
        """Returns the states of each class that by all ceilings may be in a higher joint state."""
        states = [np.flatnonzero(left[t]) for left in self.left]
        sizes = self.model.class_sizes
        for earlier in self._earlier[t] if above > -math.inf else ():
            more = self._paid_more(t, earlier, states)
            least = [float(some.min(initial=0.0)) for some in more]
            together = exact_sum(n * one for n, one in zip(sizes, least, strict=True))
            made_of = abs(earlier.constant) - together
            states = [
                some[
                    earlier.constant - (together - one) - own
                    + self._rounding_of_sums(made_of + np.abs(own)) > above
                ]
                for some, own, one in zip(states, more, least, strict=True)
            ]  # fmt: skip
        return states

    def _ceiling(self, t: int, earlier: _Earlier, states: Sequence[IntArray]) -> Ceiling:
        """Returns what earlier payments say of joint states, rounding of the search included."""
        return self._ceiling_of(
            earlier.constant, np.concatenate(self._paid_more(t, earlier, states))
        )

    def _ceiling_of(self, constant: float, more: FloatArray) -> Ceiling:
        """Returns a ceiling, rounding of the search included."""
        made_of = abs(constant) + len(self.model.problem.robots) * np.abs(more)
        rounding = float(self._rounding_of_sums(made_of).max(initial=0.0))
        return Ceiling(constant + rounding, more)

    def _limit(self, t: int, states: Sequence[IntArray]) -> Ceiling:
        """Returns what the slacks in (*) say of joint states, as K_t - h_t is not negative."""
        slack = [own[t, some] for own, some in zip(self._closing.slack, states, strict=True)]
        constant = float(self._closing.constants[t])
        constant += self._rounding(abs(constant))
        return self._ceiling_of(constant, np.concatenate(slack))

    def _paid_more(self, t: int, earlier: _Earlier, states: Sequence[IntArray]) -> list[FloatArray]:
        """Returns what states of each class are paid more than earlier."""
        return [
            now[t, some] - was[some]
            for now, was, some in zip(self.rewards, earlier.rewards, states, strict=True)
        ]

    def _rounding_of_sums(self, made_of: FloatArray) -> FloatArray:
        """Returns the most that rounding changes of sums over all robots."""
        robots = len(self.model.problem.robots)
        rounding: FloatArray = 16 * robots * (robots + 4) * UNIT_ROUNDOFF * made_of
        return rounding

    def lower(self, joint: JointStates, wanted: Wanted, stop: Stop = never) -> Highest:
        """Lowers K_t to the height of the highest joint state, or to the least height wanted.

        Parameters
        ----------
        joint : the joint states that are left at a step, all that may be higher than wanted

        Raises
        ------
        NotEndedError
            If the search takes more nodes.
        LimitReached
            At a limit.
        """
        highest = joint.highest(wanted, stop)
        self._lower_to(highest.height, joint)
        return highest

    def lower_as_claimed(self, claim: StepConstant) -> bool:
        """Lowers K_t to a claim, as `lower` does where nothing is higher; False if it is lower.

        A producer, who has searched among more states, so leaves as much room for rounding as a
        checker does.
        """
        before = float(self.constants[claim.t])
        self._lower_to(claim.constant, self.joint_states(claim.t, claim.constant))
        return bool(self.constants[claim.t] < before)

    def _lower_to(self, height: float, joint: JointStates) -> None:
        """Lowers K_t to a height that was the highest in a search, and room for rounding."""
        self.constants[joint.t] = min(float(self.constants[joint.t]), height + joint.margin)

    def price(self) -> None:
        """Prices the paths that are left, and finds the slack of every state.

        It is asked for after payments have been replaced.
        """
        problem = self.model.problem
        self.slack = []
        self._to_go: list[FloatArray] = []
        self._paths = 0.0
        moves = len(problem.robots) * problem.horizon
        self._paths_made_of = moves * reward_of_staying(problem.objective)
        for number, robot_class in enumerate(self.model.classes):
            reward = np.where(self.left[number], self.rewards[number], -np.inf)
            charges, starts = self._charges[number], list(robot_class.starts)
            to_go = np.array([*values_to_go(problem, robot_class, reward, charges)])[::-1]
            self._to_go.append(to_go)
            best = to_go[0, starts]
            self._paths += float(best.sum())
            most = np.abs(np.where(self.left[number], reward, 0.0)).max(axis=1)
            self._paths_made_of += float(most.sum()) * len(starts)
            first = np.full(reward.shape[1], -np.inf)
            found = best > -np.inf
            np.maximum.at(first, np.array(starts)[found], -best[found])
            so_far = np.array([*values_so_far(problem, robot_class, reward, charges, first)])
            self.slack.append(np.maximum(-(so_far + to_go), 0.0))
            self.left[number] &= self.slack[number] < np.inf

    def _charged_now(self) -> list[FloatArray]:
        """Returns payment and slack together of each class's states [T+1, S] that are left."""
        return [
            reward + np.where(left, slack, 0.0)
            for reward, slack, left in zip(self.rewards, self.slack, self.left, strict=True)
        ]
