"""Narrows down the states of better plans: sets prices of states, and closes states.

Multipliers bound J by constants K_t for the faces of each step, a constant for rows, and one best
path per robot (`pricing`). Let B be that bound, sigma_i(t, s) the difference between robot i's
best path and its best path through state s at step t, and h_t the reduced profit of the joint
state of a plan at t: its worth less the prices of its states (`joint_states`). Then

    J = B - sum of the paths' slacks - sum_t (K_t - h_t) - mu (1 - used),     all terms >= 0,

so a plan with J > target obeys, at every step,

    sum_i sigma_i(t, s_i) + (K_t - h_t) <= B - target.                                         (*)

States whose slack alone violates (*) are closed: no plan above the target visits them (Lagrangian
fixing). From then on it is enough to bound plans that visit only remaining states, and only joint
states that obey (*). For these plans, a state at a step may have any price, which is credited to a
robot for visiting it, provided that none of their reduced profits exceeds K_t: each set of prices
is a supporting plane of the concave envelope over joint states. Each stage does both: it sets new
prices and their constants, then closes states. At the end

    J <= max(target, B)    for all plans.

Prices need not be listed state by state. If no joint state had a profit above K' at price', none
now has a profit above

    K' - sum_i [price(s_i) - price'(s_i)],                                                    (**)

so a state whose price has risen by K' - K is in no joint state with a profit above K, unless
another price has fallen. A stage raises the prices of all states of a step by that much, except for
those on a short list; K_t is then found by search among the states on the list. Higher prices of
the other states do not raise the bound if their paths' slack is at least as large. Joint states
that violate (*) of an earlier stage may have more profit than (**), but no plan above the target
visits these.

A constant may also bound the moves of the whole team from step t to t + 1: no two joint states with
a move between them have reduced profits of more than K_t,t+1 together. Such a move saves

    d_t = max(0, K_t + K_t+1 - K_t,t+1),

and B is less by the sum of these, where no two moves share a step. The left-hand side of (*) is
then at most B - target + d of the step's own move.

A `Narrowing` is immutable: methods that narrow further return a new one. A stage is one call that
sets prices, searches for the constants of its own joint states, and closes states. Therefore no
order of calls can prove a false bound, and joint states of another narrowing cannot lower a
constant.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, Self

import numpy as np

from cocap_opt.arithmetic import exact_sum
from cocap_opt.data import BoolArray, FloatArray, IntArray
from cocap_opt.formulations.certificates.format import (
    CertificateError,
    Multipliers,
    Stage,
    StepPrices,
)
from cocap_opt.formulations.certificates.pricing import (
    UNIT_ROUNDOFF,
    CertificatePrices,
    Pricing,
)
from cocap_opt.formulations.certificates.staged.joint_states import Ceiling, JointStates
from cocap_opt.formulations.certificates.sweep import (
    reward_of_staying,
    values_so_far,
    values_to_go,
)
from cocap_opt.graph.charges import Charges
from cocap_opt.model import Model
from cocap_opt.stop import Stop, never

# A constant of a step whose prices have been replaced, including rounding, and the prices of each
# class [S].
_Earlier = tuple[float, list[FloatArray]]

# Given a constant's position and its joint states, finds a profit that none of them exceeds.
Search = Callable[[int, JointStates], float]
# Given the position of a move's constant and the narrowing at its prices, finds a profit that no
# move exceeds.
MoveSearch = Callable[[int, "Narrowing"], float]


class _Closing(NamedTuple):
    """The values that decide which joint states count, from the last time that states were
    closed.
    """

    constants: FloatArray  # [T+1]
    floors: FloatArray  # [T+1] least worth less charges of a joint state that counts
    slack: list[FloatArray]  # slack of each state, by class [T+1, S]
    charges: list[FloatArray]  # sum of price and slack of each state, by class [T+1, S]


class _Sweeps(NamedTuple):
    """The paths of each class over the remaining states, at the current prices."""

    left: list[BoolArray]  # [T+1, S]
    slack: list[FloatArray]  # [T+1, S]
    to_go: list[FloatArray]  # [T+1, S] value of the best path from each state on
    worth: float  # worth of the best paths of all robots
    magnitude: float  # largest sum of absolute values along these paths

    @classmethod
    def of(
        cls,
        model: Model,
        charges: Sequence[Charges],
        rewards: Sequence[FloatArray],
        left: Sequence[BoolArray],
    ) -> Self:
        """Prices the paths over the remaining states, and computes the slack of every state."""
        problem = model.problem
        found = cls([], [], [], 0.0, 0.0)
        worth = 0.0
        magnitude = len(problem.robots) * problem.horizon * reward_of_staying(problem.objective)
        for robot_class, charge, prices, is_left in zip(
            model.classes, charges, rewards, left, strict=True
        ):
            reward = np.where(is_left, prices, -np.inf)
            to_go = np.array([*values_to_go(problem, robot_class, reward, charge)])[::-1]
            best = [float(to_go[0, starts].max()) for starts in robot_class.starts]
            worth += float(np.sum(best))
            most = np.abs(np.where(is_left, reward, 0.0)).max(axis=1)
            magnitude += float(most.sum()) * len(best)
            first = np.full(reward.shape[1], -np.inf)
            for starts, worth_of_path in zip(robot_class.starts, best, strict=True):
                if worth_of_path > -np.inf:
                    first[starts] = np.maximum(first[starts], -worth_of_path)
            so_far = np.array([*values_so_far(problem, robot_class, reward, charge, first)])
            slack = np.maximum(-(so_far + to_go), 0.0)
            found.to_go.append(to_go)
            found.slack.append(slack)
            found.left.append(is_left & (slack < np.inf))
        return found._replace(worth=worth, magnitude=magnitude)


@dataclass(frozen=True, eq=False)
class Narrowing:
    """The bound on the plans above a target, at some prices and with some states closed.

    Attributes
    ----------
    model : a model with the classes of the multipliers
    target : J; only plans above it are bounded
    constants : [T+1] K_t; infinite where prices are new
    move_constants : [T+1] K_t,t+1; infinite where the move that begins at the step has none
    rewards : for each class, the prices of states [T+1, S], credited to its robots for visiting
        them
    charges : for each class, the charges that rows put on its robots
    row_multipliers : the step and the multiplier of each row
    """

    model: Model
    target: float
    constants: FloatArray
    move_constants: FloatArray
    rewards: list[FloatArray]
    charges: list[Charges]
    row_multipliers: tuple[tuple[int, float], ...]
    _prices: CertificatePrices
    _sweeps: _Sweeps
    _closing: _Closing
    _earlier: tuple[tuple[_Earlier, ...], ...]  # earlier prices and constants by step
    # True: bounds all plans above the target; False: only plans that visit certain states
    _bounds_all: bool = True

    @classmethod
    def of(
        cls, model: Model, multipliers: Multipliers, target: float, stop: Stop = never
    ) -> "Narrowing":
        """Returns the narrowing by multipliers alone, with no state closed yet.

        Raises
        ------
        CertificateError
            If the multipliers prove nothing, or pixels add up over time.
        LimitReached
            If a limit is reached.
        """
        if model.problem.objective.over_time:
            raise CertificateError("certificate: must not be staged if pixels add up over time")
        if not math.isfinite(target):
            raise CertificateError(f"certificate.target: must be finite, not {target!r}")
        prices = CertificatePrices.of(model, multipliers, stop=stop)
        constants = model.problem.by_step(prices.pixels.constants)
        classes = range(len(model.classes))
        rewards = [prices.rewards(number) for number in classes]
        charges = [prices.charges(number) for number in classes]
        everywhere = [np.ones(reward.shape, dtype=np.bool_) for reward in rewards]
        sweeps = _Sweeps.of(model, charges, rewards, everywhere)
        first = cls(
            model, target, constants, np.full(len(constants), np.inf), rewards, charges,
            tuple((row.resource.t, row.multiplier) for row in multipliers.rows), prices, sweeps,
            _Closing(constants, constants, [], []), ((),) * len(constants),
        )  # fmt: skip
        first._require_finite()
        return replace(first, _closing=first._closed_now(np.full(len(constants), -np.inf)))

    @property
    def left(self) -> list[BoolArray]:
        """The states [T+1, S] of each class that plans above the target may visit."""
        return self._sweeps.left

    @property
    def slack(self) -> list[FloatArray]:
        """The loss of the best path through each state [T+1, S] of a class, relative to the best
        path.
        """
        return self._sweeps.slack

    @property
    def to_go(self) -> list[FloatArray]:
        """The value of the best path from each state [T+1, S] of a class to the end."""
        return self._sweeps.to_go

    @property
    def bound(self) -> float:
        """B, which no plan above the target exceeds, except for rounding."""
        constants = float(self.constants.sum()) - float(self.saved.sum())
        return constants + self._prices.row_constant + self._sweeps.worth

    @property
    def saved(self) -> FloatArray:
        """d_t [T+1], in units of J, of the move that begins at each step; no two share a step."""
        saved, known = np.zeros(len(self.constants)), np.flatnonzero(self.move_constants < np.inf)
        both = self.constants[known] + self.constants[known + 1]
        saved[known] = np.maximum(both - self.move_constants[known], 0.0)
        return saved

    @property
    def rounding(self) -> float:
        """The largest effect of rounding on B, in units of J."""
        return self._rounding(float(np.abs(self.constants).sum() + self.saved.sum()))

    def _rounding(self, constants: float) -> float:
        """Returns the largest effect of rounding on a sum of constants, multipliers and prices."""
        prices, sweeps = self._prices, self._sweeps
        magnitude = prices.pixels.magnitude + prices.row_magnitude + sweeps.magnitude + constants
        return prices.rounding_factor * magnitude

    @property
    def pricing(self) -> Pricing:
        """The bound on all plans that the stages so far prove.

        Raises
        ------
        CertificateError
            If the bound is infinite.
        ValueError
            If only some of the plans above the target are bounded.
        """
        if not self._bounds_all:
            raise ValueError("narrowing: the bound does not hold for all plans")
        self._require_finite()
        return Pricing(self._proved_by(self.bound), self.rounding)

    def pricing_of(self, best: float) -> Pricing:
        """Returns the bound on all plans, given the most that those above the target are worth.

        `BestPlan.pricing` calls this method after exploring these plans, and `Tails.pricing` after
        exploring what they lose.

        Parameters
        ----------
        best : J that none of them exceeds; -inf if there is none

        Raises
        ------
        CertificateError, ValueError
            As in `pricing`.
        """
        of_stages = self.pricing
        return of_stages._replace(bound=min(of_stages.bound, self._proved_by(best)))

    @property
    def bound_of_steps(self) -> float:
        """The bound without constants of moves, from which losses of tails are subtracted."""
        return self.bound + float(self.saved.sum())

    def _proved_by(self, most: float) -> float:
        """Returns the bound on all plans, given that none above the target exceeds `most`."""
        return max(self.target, math.nextafter(most + self.rounding, math.inf))

    def room_above(self, target: float) -> float:
        """Returns the right-hand side of (*) for a target, including rounding."""
        return self.bound + 2 * self.rounding - target

    # -- the next narrowing -------------------------------------------------------------------

    def closed(self) -> "Narrowing":
        """Returns the narrowing after closing all states that no plan above the target visits.

        Raises
        ------
        CertificateError
            If a step has new prices but no constant yet.
        """
        self._require_finite()
        room = self.room_above(self.target)
        left = [
            is_left & (slack <= room) for is_left, slack in zip(self.left, self.slack, strict=True)
        ]
        after = replace(self, _sweeps=_Sweeps.of(self.model, self.charges, self.rewards, left))
        saved = after.saved
        saved_here = saved + np.append(0.0, saved[:-1])  # by the move of which a step is a part
        floors = after.constants - saved_here - after.room_above(after.target)
        return replace(after, _closing=after._closed_now(floors))

    def above(self, target: float, among: Sequence[BoolArray] | None = None) -> "Narrowing":
        """Returns the narrowing for an equal or higher target, with more states closed.

        Parameters
        ----------
        among : for each class, the only states [T+1, S] that plans may visit; plans that visit
            other states are not bounded, so `pricing` is not available

        Raises
        ------
        CertificateError
            If the target is lower, or not finite.
        """
        if not self.target <= target < math.inf:
            raise CertificateError("certificate.paths_above: must be finite, and not below target")
        left = [
            is_left & wanted for is_left, wanted in zip(self.left, among or self.left, strict=True)
        ]
        return replace(
            self,
            target=target,
            _sweeps=self._sweeps._replace(left=left),
            _bounds_all=self._bounds_all and among is None,
        ).closed()

    def after(
        self, stage: Stage, search: Search, search_moves: MoveSearch, field: str = "stage",
        most_states: float = math.inf,
    ) -> "Narrowing":  # fmt: skip
        """Returns the narrowing after a stage, which sets prices, then constants of steps, then of
        moves, then closes states.

        Parameters
        ----------
        search : called with the position of each constant of the stage, and with the joint states
            that may have more profit than the constant; returns a profit that none of them
            exceeds. A constant is never lowered below its stated value.
        search_moves : the same for the constants of moves
        field : name of the stage, for messages
        most_states : largest number of remaining states at a step

        Raises
        ------
        CertificateError
            If a step has new prices but no constant, or has more states.
        """
        narrowing = self._repriced(stage.prices)
        for k, claim in enumerate(stage.constants):
            states = narrowing._states_of_joint(claim.t, claim.constant)
            _require_few(states, claim.t, most_states, f"{field}.constants[{k}]")
            joint = narrowing.joint_states_of(claim.t, states)
            narrowing = narrowing._lowered(joint, max(search(k, joint), claim.constant))
        if not math.isfinite(narrowing.rounding):
            raise CertificateError(
                f"{field}: a step has payments but no constant, or its payments are too large"
            )
        for k, move in enumerate(stage.moves):
            for t in (move.t, move.t + 1):
                states = narrowing._states_of_joint(t)
                _require_few(states, t, most_states, f"{field}.moves[{k}]")
            profit = max(search_moves(k, narrowing), move.constant)
            narrowing = narrowing._with_move(move.t, profit)
        return narrowing.closed()

    def _repriced(self, prices: Sequence[StepPrices]) -> "Narrowing":
        """Returns the narrowing at new prices; K_t of their steps is still unknown."""
        if not prices:
            return self
        rewards, constants = [reward.copy() for reward in self.rewards], self.constants.copy()
        moves = self.move_constants.copy()
        earlier = [*self._earlier]
        for step in prices:
            t, graph = step.t, self.model.classes[step.class_number].graph
            if constants[t] < math.inf:
                before = [reward[t].copy() for reward in rewards]
                earlier[t] = (*earlier[t], (self.ceiling(t), before))
            reward = rewards[step.class_number][t]
            reward += step.others
            reward[[graph.index(state) for state in step.states]] = step.prices
            constants[t] = math.inf
            moves[max(t - 1, 0) : t + 1] = math.inf
        sweeps = _Sweeps.of(self.model, self.charges, rewards, self.left)
        return replace(
            self, rewards=rewards, constants=constants, move_constants=moves, _sweeps=sweeps,
            _earlier=tuple(earlier),
        )  # fmt: skip

    def _lowered(self, joint: JointStates, profit: float) -> "Narrowing":
        """Returns the narrowing with K_t lowered to a profit plus an allowance for rounding.

        Parameters
        ----------
        joint : remaining joint states of a step, including all with a larger profit
        """
        constants = self.constants.copy()
        constants[joint.t] = min(float(constants[joint.t]), profit + joint.margin)
        return replace(self, constants=constants)

    def _with_move(self, t: int, profit: float) -> "Narrowing":
        """Returns the narrowing with the constant of a move lowered to a profit plus an allowance
        for rounding; constants of moves that share a step with it end.

        Parameters
        ----------
        profit : a profit that no remaining move from step t to the next exceeds
        """
        moves = self.move_constants.copy()
        moves[t] = min(float(moves[t]), profit + self.margin_of_move(t))
        moves[max(t - 1, 0) : t] = math.inf
        moves[t + 1] = math.inf
        return replace(self, move_constants=moves)

    def margin_of_move(self, t: int) -> float:
        """Returns the allowance for rounding in the constant of the move from a step to the next,
        in units of J.
        """
        return exact_sum(self.joint_states(at).margin for at in (t, t + 1))

    def _closed_now(self, floors: FloatArray) -> _Closing:
        """Returns the values that decide from now on which joint states count."""
        charges = [
            reward + np.where(is_left, slack, 0.0)
            for reward, slack, is_left in zip(self.rewards, self.slack, self.left, strict=True)
        ]
        return _Closing(self.constants, floors, self.slack, charges)

    def _require_finite(self) -> None:
        """Raises an error if numbers are so large that they prove nothing (inf - inf)."""
        if not math.isfinite(self.rounding) or math.isnan(self.bound) or self.bound == math.inf:
            raise CertificateError("certificate: too large: the bound is infinite")

    # -- the joint states of a step -----------------------------------------------------------

    def joint_states(self, t: int, above: float = -math.inf) -> JointStates:
        """Returns the remaining joint states of a step, with the prices of their states.

        Parameters
        ----------
        above : states that are in no joint state with a profit above this may be left out
        """
        return self.joint_states_of(t, self._states_of_joint(t, above))

    def joint_states_of(
        self, t: int, states: Sequence[IntArray], apart: Sequence[int] | None = None
    ) -> JointStates:
        """Returns the joint states over some of the remaining states of each class at a step.

        Parameters
        ----------
        apart : the class of each robot, if every robot is a class of its own in the joint states;
            `states` then has an entry per robot
        """
        numbers = range(len(self.rewards)) if apart is None else apart

        def of_states(by_class: Sequence[FloatArray]) -> list[FloatArray]:
            return [by_class[n][at] for n, at in zip(numbers, states, strict=True)]

        price, charge, slack = (
            of_states([array[t] for array in arrays])
            for arrays in (self.rewards, self._closing.charges, self._closing.slack)
        )
        now = np.concatenate(price)
        ceilings = tuple(
            self.ceiling_of(constant, now - np.concatenate(of_states(rewards)))
            for constant, rewards in self._earlier[t]
        )
        # The slacks in (*) limit joint states, since K_t - h_t is not negative.
        constant = float(self._closing.constants[t])
        limit = self.ceiling_of(constant + self._rounding(abs(constant)), np.concatenate(slack))
        floor = float(self._closing.floors[t])
        return JointStates.of(
            self.model, t, states, price, charge, floor, ceilings, (limit,), apart
        )

    def charged_joint_states(self, t: int) -> JointStates:
        """Returns the remaining joint states of a step with their charges as prices, to collect
        those that count: a joint state counts if its profit reaches the floor.
        """
        joint = self.joint_states(t)
        more = joint.charge - joint.price
        limits = [self.ceiling_of(profit, raised + more) for profit, raised in joint.ceilings]
        return replace(joint, price=joint.charge, ceilings=(), limits=(*limits, *joint.limits))

    def profitable_joint_states(self, t: int, above: float) -> tuple[JointStates, JointStates]:
        """Returns the remaining joint states of a step, to collect those with larger profits; and
        the same joint states with their charges, which decide whether they count.

        Parameters
        ----------
        above : states that are in no joint state with a profit above this are left out
        """
        joint = self.joint_states(t, above)
        less = joint.price - joint.charge
        limits = [self.ceiling_of(profit, raised + less) for profit, raised in joint.limits]
        profits = replace(joint, charge=joint.price, ceilings=(), limits=(*joint.ceilings, *limits))
        return profits, joint

    def ceiling(self, t: int) -> float:
        """Returns the ceiling that the current constant of a step sets for later prices."""
        return float(self.constants[t]) + self._rounding(abs(float(self.constants[t])))

    def _states_of_joint(self, t: int, above: float = -math.inf) -> list[IntArray]:
        """Returns the states of each class that, by the ceilings, may be in a joint state with a
        larger profit.
        """
        states = [np.flatnonzero(is_left[t]) for is_left in self.left]
        sizes = self.model.class_sizes
        for constant, rewards in self._earlier[t] if above > -math.inf else ():
            raised = self._raised(t, rewards, states)
            least = [float(more.min(initial=0.0)) for more in raised]
            together = exact_sum(n * more for n, more in zip(sizes, least, strict=True))
            magnitude = abs(constant) - together
            states = [
                at[
                    constant - (together - fewest) - more
                    + self._rounding_of_sums(magnitude + np.abs(more)) > above
                ]
                for at, more, fewest in zip(states, raised, least, strict=True)
            ]  # fmt: skip
        return states

    def _raised(
        self, t: int, earlier: Sequence[FloatArray], states: Sequence[IntArray]
    ) -> list[FloatArray]:
        """Returns the amounts by which prices of each class's states exceed earlier ones."""
        return [
            now[t, at] - was[at] for now, was, at in zip(self.rewards, earlier, states, strict=True)
        ]

    def ceiling_of(self, constant: float, raised: FloatArray) -> Ceiling:
        """Returns a ceiling, including the rounding of the search."""
        magnitude = abs(constant) + len(self.model.problem.robots) * np.abs(raised)
        rounding = float(self._rounding_of_sums(magnitude).max(initial=0.0))
        return constant + rounding, raised

    def _rounding_of_sums(self, magnitude: FloatArray) -> FloatArray:
        """Returns the largest effect of rounding on sums over all robots."""
        robots = len(self.model.problem.robots)
        rounding: FloatArray = 16 * robots * (robots + 4) * UNIT_ROUNDOFF * magnitude
        return rounding


def _require_few(states: Sequence[IntArray], t: int, most: float, field: str) -> None:
    """Raises CertificateError if more states remain at a step than can be searched.

    Parameters
    ----------
    states : the remaining states of each class
    field : name of the claim, for the message
    """
    if (left := sum(map(len, states))) > most:
        raise CertificateError(
            f"{field}: {left:,} states remain at step {t}; at most {most:,} can be searched"
        )
