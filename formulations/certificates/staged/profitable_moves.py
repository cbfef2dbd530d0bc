"""Searches for the moves of a whole team between two steps that have the most reduced profit.

The reduced profit of a move is that of the joint states at its two ends together (`narrowing`). If
K is a constant of the second step, only joint states of the first with a profit above `least - K`
can begin a move above `least`. From each of these, a search finds the joint states of the second
step to which the team can move and which have the profit that is missing.
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple, Self

import numpy as np

from cocap_opt.arithmetic import exact_sum
from cocap_opt.data import BoolArray, FloatArray, IntArray
from cocap_opt.formulations.certificates.pricing import UNIT_ROUNDOFF
from cocap_opt.formulations.certificates.staged.joint_states import Ceiling, JointStates
from cocap_opt.formulations.certificates.staged.move_searches import Choices, MoveSearches
from cocap_opt.formulations.certificates.staged.narrowing import Narrowing
from cocap_opt.formulations.certificates.staged.search import NotEndedError
from cocap_opt.formulations.certificates.staged.team_moves import MOST_CHOICES, MOST_PLACED, Team
from cocap_opt.model import Model
from cocap_opt.stop import Stop


class Moves(NamedTuple):
    """Moves of the team between two steps.

    Attributes
    ----------
    profits : [M] reduced profit of both ends together, in units of J
    tails, heads : [M, R] number of each robot's state at the two ends
    """

    profits: FloatArray
    tails: IntArray
    heads: IntArray

    @classmethod
    def joined(cls, parts: list[Self]) -> Self:
        """Returns the moves of all parts, best first; there must be at least one part."""
        moves = cls(*map(np.concatenate, zip(*parts, strict=True)))
        order = np.argsort(-moves.profits, kind="stable")
        return moves.part(order)

    def part(self, chosen: IntArray | BoolArray | slice) -> Self:
        """Returns some of the moves."""
        return self._replace(
            profits=self.profits[chosen], tails=self.tails[chosen], heads=self.heads[chosen]
        )


class HighJointStates(NamedTuple):
    """The joint states of a step with a profit above a value.

    Attributes
    ----------
    above : the value, in units of J
    profits : [L] their reduced profits
    placed : [L, R] number of each robot's state
    """

    above: float
    profits: FloatArray
    placed: IntArray


def high_joint_states(
    model: Model, joint: JointStates, above: float, searches: MoveSearches, stop: Stop
) -> HighJointStates:
    """Returns the joint states of a step with a profit above a value; some may have a little less.

    Parameters
    ----------
    joint : the step's joint states with their prices

    Raises
    ------
    NotEndedError
        If the search uses too many nodes, or there are too many joint states.
    LimitReached
        If a limit is reached.
    """
    if len(joint.states) > MOST_CHOICES:
        raise NotEndedError
    robots = np.concatenate([robot_class.robots for robot_class in model.classes])
    collecting = _collecting(joint, above)
    choices = Choices.of_classes(collecting, robots)
    places, profits = [np.zeros((0, len(robots)), dtype=np.int64)], [np.zeros(0)]
    for _, chosen in searches.found(collecting, choices, np.array([above]), stop):
        placed = np.empty_like(chosen)
        placed[:, robots] = joint.states[chosen]
        places.append(placed)
        profits.append(counted_profits(joint, chosen))
        if sum(part.size for part in places) > MOST_PLACED:
            raise NotEndedError
    return HighJointStates(above, np.concatenate(profits), np.concatenate(places))


def counted_profits(joint: JointStates, chosen: IntArray) -> FloatArray:
    """Returns the profits of joint states [K, R], limited by ceilings; -inf for those that do not
    count.
    """
    worths = joint.worths(chosen)
    profits: FloatArray = worths - joint.price[chosen].sum(axis=1)
    for profit, raised in joint.ceilings:
        profits = np.minimum(profits, profit - raised[chosen].sum(axis=1))
    low = worths - joint.charge[chosen].sum(axis=1)
    profits[low < joint.floor - joint.margin] = -np.inf
    return profits


def _collecting(joint: JointStates, above: float) -> JointStates:
    """Returns the joint states for a search that collects those with a profit above a value.

    Such searches take prices for charges, and compare ceilings with the value. Limits on the
    charges, whose floor is another, are shifted by the difference. A file may claim any value, so
    the shift and the sums after it have a rounding of their own, besides that of the limit.
    """
    robots, limits = sum(joint.sizes), list[Ceiling]()
    for profit, raised in joint.limits:
        most = abs(profit) + abs(joint.floor) + abs(above)
        most += robots * float(np.abs(raised).max(initial=0.0))
        rounding = 16 * (robots + 4) * UNIT_ROUNDOFF * most
        limits.append((profit - joint.floor + above + rounding, raised))
    return replace(
        joint, charge=joint.price, floor=above, ceilings=(), limits=(*joint.ceilings, *limits)
    )


class ProfitableMoves:
    """The moves of a team from a step to the next.

    Parameters
    ----------
    narrowing : its prices and remaining states; both steps must have a constant
    t : the first of the two steps
    """

    def __init__(self, narrowing: Narrowing, t: int) -> None:
        self._narrowing, self._t, self._team = narrowing, t, Team(narrowing)
        self._margin = narrowing.margin_of_move(t)

    def above(
        self, least: float, searches: MoveSearches, stop: Stop, tails: HighJointStates | None = None
    ) -> Moves:
        """Returns the moves with a profit clearly above a value, best first.

        An excess of up to half of the allowance for rounding does not count, so that searches among
        fewer states, whose rounding differs, find no others.

        Parameters
        ----------
        tails : high joint states of the first step, if known

        Raises
        ------
        NotEndedError
            If the searches use too many nodes, or there are too many moves.
        LimitReached
            If a limit is reached.
        """
        nothing = np.zeros((0, len(self._team.numbers)), dtype=np.int64)
        found, placed = [Moves(np.zeros(0), nothing, nothing)], 0
        if least >= exact_sum(self._narrowing.ceiling(at) for at in (self._t, self._t + 1)):
            return found[0]
        above = least - self._narrowing.ceiling(self._t + 1)
        if tails is None or tails.above > above:
            joint = self._narrowing.joint_states(self._t)
            tails = high_joint_states(self._narrowing.model, joint, above, searches, stop)
        for moves in self._from(tails, least, searches, stop):
            found.append(moves.part(moves.profits > least + self._margin / 2))
            placed += found[-1].heads.size
            if placed > MOST_PLACED:
                raise NotEndedError
        return Moves.joined(found)

    def _from(
        self, tails: HighJointStates, least: float, searches: MoveSearches, stop: Stop
    ) -> Iterator[Moves]:
        """Yields the moves from joint states that may have a profit above a value."""
        t, team, narrowing = self._t + 1, self._team, self._narrowing
        profits = np.minimum(tails.profits, narrowing.ceiling(self._t))
        high = np.flatnonzero(profits > least - narrowing.ceiling(t) - self._margin)
        if not len(high):
            return
        profits, placed = profits[high], tails.placed[high]
        numbers = team.numbers.tolist()
        choices = Choices.of(placed, [team.heads(number, t) for number in numbers])
        if sum(map(len, choices.states)) > MOST_CHOICES:
            raise NotEndedError
        apart = team.numbers[choices.robots].tolist()
        joint = narrowing.joint_states_of(t, choices.states, apart)
        floors = least - profits
        collecting = _collecting(joint, float(floors.max()))
        for rows, chosen in searches.found(collecting, choices, floors, stop):
            heads = np.empty_like(chosen)
            heads[:, choices.robots] = joint.states[chosen]
            able = ~team.conflicts(placed[rows], heads)
            rows, chosen, heads = rows[able], chosen[able], heads[able]
            ends = np.minimum(counted_profits(joint, chosen), narrowing.ceiling(t))
            yield Moves(profits[rows] + ends, placed[rows], heads)


def most_profitable_move(
    narrowing: Narrowing, t: int, least: float, searches: MoveSearches, stop: Stop
) -> float:
    """Returns the largest profit of a move from step t to the next if it is clearly above a value,
    and otherwise that value; errors are those of `ProfitableMoves.above`.
    """
    moves = ProfitableMoves(narrowing, t).above(least, searches, stop)
    return float(moves.profits[0]) if len(moves.profits) else least
