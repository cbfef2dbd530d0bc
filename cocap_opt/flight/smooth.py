"""Smooth flights: flights of a plan with continuous speed and acceleration.

At each step, a drone has exactly the position and orientation of the plan. Its speed at the step is
the mean of the speeds before and after, and its acceleration changes the one speed into the other;
a drone begins and ends at rest. The part of a flight in which the speed changes is a blend; it
takes all of the steps before and after. If it breaks a rule (`safety`), it is repaired in one of
two ways, as far as necessary:

- slower: the drone passes with a share of that speed, and finally stops. Drones that stop at the
  steps before and after a move fly the straight line of the plan, all with the same time law if
  their blends are equally short. So the flight is as safe as the plan with respect to walls, zones
  and drones.
- shorter: the blend takes only one of the two steps, or a half, a quarter or an eighth of them; for
  the rest, the drone has the constant speed of the plan. This is needed near people, who walk at
  constant speed.

In a blend, a drone deviates from its constant speed by two polynomials of degree five: one contains
the change of its speed at the step, the other its acceleration there, and both vanish at the end
with their derivatives. A drone that stops deviates by no more than a fifth of its move times the
part of the step that the stop takes. So a plan that keeps farther from people than required, by a
40th of the longest move in space, always has a smooth flight (`spare`). Otherwise, drones may be
too close to people where they start, land, or change their speed at two steps in a row.
"""

from collections import defaultdict
from collections.abc import Iterator
from typing import NamedTuple, Self

import numpy as np

from cocap_opt.data import BoolArray, FloatArray, IntArray, read_only
from cocap_opt.flight.bernstein import Peak
from cocap_opt.flight.pace import Excess
from cocap_opt.flight.rests import LAWS, PARTS, TURNS, Rests
from cocap_opt.flight.safety import Danger, dangers
from cocap_opt.flight.strain import longest_move
from cocap_opt.flight.trajectory import DEGREE, Trajectory, evenly, split, waypoints
from cocap_opt.problem import Plan, Problem, Robot

SHORTEST = 8  # the shortest blend takes this fraction (1/8) of a step
_SLOWER = 0.5
_LEAST = 0.2  # share below which a drone stops
_STEADY = 1.25  # relative to the slower rate beside it: no angle exceeds those at the steps
# has the speed 1 at 0; all other values and derivatives at 0 and 1 are 0
_SPEED = np.array([0, 1 / 5, 2 / 5, 0, 0, 0])
_BEND = np.array([0, 0, 1 / 20, 0, 0, 0])  # the same for the acceleration
_SAME = 1e-9  # m; tolerance for equal moves
_BEFORE, _BOTH, _AFTER = -1, 0, 1
_Blend = tuple[int, int]  # its drone and its step


class Smooth(NamedTuple):
    """Smooth flights, and the violations that could not be repaired.

    Attributes
    ----------
    slowed : steps of drones at which they pass more slowly than they could
    shortened : steps of drones at which they change speed in less time than possible
    """

    trajectory: Trajectory
    dangers: tuple[Danger, ...]
    slowed: int
    shortened: int

    @classmethod
    def of(cls, problem: Problem, plan: Plan) -> Self:
        """Returns the smooth flights of a plan that can be flown and breaks no rule.

        If they are not safe, or exceed a drone's limits, flights with rests are used, provided that
        these are safe and within the limits.
        """
        made = cls._mended(problem, plan, slow=True)
        if made.dangers:
            made = cls._mended(problem, plan, slow=False)
        if made.is_flyable:
            return made
        rested = (cls._rested(problem, plan, law) for law in LAWS)
        return next((found for found in rested if found.is_flyable), made)

    @property
    def is_flyable(self) -> bool:
        """True if the flights are safe and obey the drones' limits."""
        return not self.dangers and not any(Excess.all_of(self.trajectory))

    @classmethod
    def _rested(cls, problem: Problem, plan: Plan, law: Rests) -> Self:
        """Returns smooth flights that are slower at the steps, down to rests, until they are
        flyable.

        Parameters
        ----------
        law : time law between two rests
        """
        straight, points = Trajectory.straight(problem, plan), waypoints(problem, plan)
        blends = _Blends.longest(points)
        known: dict[tuple[int, bytes], str] = {}
        while True:
            flown = straight.with_pieces(blends.pieces_with_rests(points, law))
            found, beyond = dangers(flown, known), list(Excess.all_of(flown))
            mended = blends.slower(found, beyond)
            if mended.same(blends):
                return cls(flown, tuple(found), blends.slowed, blends.shortened)
            blends = mended

    @classmethod
    def _mended(cls, problem: Problem, plan: Plan, slow: bool) -> Self:
        """Returns smooth flights, repaired until they are safe or cannot be repaired further.

        Parameters
        ----------
        slow : True: make blends slower first, except near people who walk; False: make them shorter
            first
        """
        straight, points = Trajectory.straight(problem, plan), waypoints(problem, plan)
        blends = _Blends.longest(points)
        known: dict[tuple[int, bytes], str] = {}  # results for pieces that do not change
        while True:
            flown = straight.with_pieces(blends.pieces(points))
            found = dangers(flown, known)
            mended = blends.mended(found, [not slow or _walks(problem, danger) for danger in found])
            if mended.same(blends):
                return cls(flown, tuple(found), blends.slowed, blends.shortened)
            blends = mended


def spare(problem: Problem, robot: Robot) -> float:
    """Returns the largest distance (m) of a drone that stops at each step from its position at
    constant speed.

    This assumes the shortest blends. With this additional distance from people, every plan has a
    smooth flight.
    """
    return longest_move(problem, robot.motion) * Peak.of(_SPEED[None]).value / SHORTEST


class _Blends(NamedTuple):
    """The speed and the duration of each drone's blend at each step, including the first and last.

    Attributes
    ----------
    shares : [R, T+1] share of the speed with which the drone could pass
    cuts : [R, T+1] c, where a blend takes 1/c of the steps before and after
    sides : [R, T+1] side of the step on which the blend lies: before, after or both
    bent : [R, T+1] True if the moves before and after differ
    turning : [R, T+1] True if angles need not rest
    """

    shares: FloatArray
    cuts: IntArray
    sides: IntArray
    bent: BoolArray
    turning: BoolArray

    @classmethod
    def longest(cls, points: FloatArray) -> Self:
        """Returns blends at points [R, T+1, 5] that take the whole steps, with the mean speeds."""
        shares = np.ones(points.shape[:2])
        shares[:, [0, -1]] = 0.0
        cuts = np.ones(shares.shape, dtype=np.int64)
        bent = np.ones(shares.shape, dtype=np.bool_)
        bent[:, 1:-1] = (np.abs(np.diff(points[..., :3], n=2, axis=1)) > _SAME).any(axis=-1)
        return cls(shares, cuts, _BOTH * cuts, bent, np.ones(shares.shape, dtype=np.bool_))

    @property
    def slowed(self) -> int:
        """Number of blends that are slower than possible."""
        return int((self.shares[:, 1:-1] < 1).sum())

    @property
    def shortened(self) -> int:
        """Number of blends that are shorter than possible."""
        return int(((self.cuts > 1) | (self.sides != _BOTH)).sum())

    @property
    def parts(self) -> int:
        """Pieces per step."""
        return int(self.cuts.max())

    def same(self, other: Self) -> bool:
        """Returns True if these blends equal others."""
        return all((part == rows).all() for part, rows in zip(self, other, strict=True))

    def pieces_with_rests(self, points: FloatArray, law: Rests) -> FloatArray:
        """Returns flights through points like `pieces`, but with a time law between rests."""
        robots, steps = self.shares[:, 1:].shape
        pieces = self.pieces(points, PARTS).reshape(robots, steps, PARTS, *points.shape[2:], -1)
        still, fixed = self.shares == 0, ~self.turning
        fixed[:, [0, -1]] = True
        found = pieces.copy()
        for rests, rows, rule in (
            (still, slice(3), law),
            (fixed, slice(3, None), TURNS),
        ):
            both = rests[:, :-1] & rests[:, 1:]
            found[both, :, rows] = rule.between(points[..., rows])[both]
        return read_only(found.reshape(robots, steps * PARTS, *found.shape[3:]))

    def pieces(self, points: FloatArray, parts: int | None = None) -> FloatArray:
        """Returns the coefficients [R, N, 5, 6] of flights through points [R, T+1, 5].

        Parameters
        ----------
        parts : pieces per step; None: as few as the blends require
        """
        moves = np.diff(points, axis=1)
        speed, bend = self._rates(moves)
        parts = self.parts if parts is None else parts
        cuts = np.repeat(self.cuts[..., None], points.shape[2], axis=-1)
        cuts[..., 3:] = 1
        first = _off(cuts[:, :-1], parts, speed[:, :-1] - moves, bend[:, :-1])
        # The part before a step is, reversed in time, like the part after it.
        last = _off(cuts[:, 1:], parts, moves - speed[:, 1:], bend[:, 1:])[:, :, ::-1, :, ::-1]
        even = evenly(points, parts)
        return read_only(even + (first + last).reshape(even.shape))

    def mended(self, found: list[Danger], shorter: list[bool]) -> Self:
        """Returns blends of which those at violations are repaired, as far as possible.

        Parameters
        ----------
        shorter : for each violation, True: make blends shorter first, False: make them slower first
        """
        new = self._replace(**{name: rows.copy() for name, rows in self._asdict().items()})
        near = defaultdict[_Blend, set[int]](set)  # sides of each blend
        slow = set[tuple[Danger, _Blend]]()  # several pieces of a step are one violation
        for danger, short in zip(found, shorter, strict=True):
            ends, drones = (danger.step, danger.step + 1), danger.drones
            blends = [(drone, k) for drone in drones for k in ends]
            if len(drones) > 1 and not any(self.shares[blend] for blend in blends):
                for k in ends:  # all with the same time law
                    new.cuts[drones, k] = new.cuts[drones, k].max()
            elif short and (reaching := list(self._reaching(danger))):
                for blend in reaching:
                    near[blend].add(_AFTER if blend[1] == danger.step else _BEFORE)
            else:
                slow |= {(danger._replace(part=0), blend) for blend in blends}
        for _, blend in slow:  # a drone in two violations at once is slowed for each
            new.shares[blend] *= _SLOWER
        for blend, sides in near.items():
            self._shorten(new, blend, sides)
        new.shares[new.shares < _LEAST] = 0.0
        new.sides[new.shares < 1] = _BOTH
        return new

    def slower(self, found: list[Danger], beyond: list[Excess]) -> Self:
        """Returns blends that are slower where flights are unsafe or exceed limits of drones."""
        new = self._replace(shares=self.shares.copy(), turning=self.turning.copy())
        slow = {(drone, danger.step) for danger in found for drone in danger.drones}
        slow |= {(excess.drone, excess.step) for excess in beyond if not excess.is_turn}
        for blend in {(drone, k) for drone, step in slow for k in (step, step + 1)}:
            new.shares[blend] *= _SLOWER
        for excess in beyond:
            if excess.is_turn:
                new.turning[excess.drone, excess.step : excess.step + 2] = False
        new.shares[new.shares < _LEAST] = 0.0
        return new

    def _shorten(self, new: Self, blend: _Blend, near: set[int]) -> None:
        """Makes a blend shorter: only on the side away from the violation, or in half of the
        time.
        """
        (side, *others), passes = near, self.shares[blend] == 1
        if passes and self.sides[blend] == _BOTH and not others:
            new.sides[blend] = -side
        elif self.cuts[blend] < SHORTEST:
            new.cuts[blend] = 2 * self.cuts[blend]
            new.sides[blend] = _BOTH
        else:
            new.shares[blend] *= _SLOWER

    def _reaching(self, danger: Danger) -> Iterator[_Blend]:
        """Yields the blends of drones that reach into a piece of a step and can be repaired."""
        for drone in danger.drones:
            first = (drone, danger.step), danger.part, _AFTER
            last = (drone, danger.step + 1), self.parts - 1 - danger.part, _BEFORE
            for blend, away, side in (first, last):
                share, cuts, bent = self.shares[blend], self.cuts[blend], self.bent[blend]
                reaches = away * cuts < self.parts and self.sides[blend] != -side
                if reaches and (bent or share < 1) and (share > 0 or cuts < SHORTEST):
                    yield blend

    def _rates(self, moves: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Returns speeds and accelerations [R, T+1, 5] at the steps, per duration of a step."""
        before, after = moves[:, :-1], moves[:, 1:]
        speed = np.zeros((moves.shape[0], moves.shape[1] + 1, moves.shape[2]))
        bend = np.zeros_like(speed)
        share, cuts, side, _, turning = (rows[:, 1:-1, None] for rows in self)
        mean = (1 + side) / 2 * before + (1 - side) / 2 * after
        speed[:, 1:-1, :3] = (share * mean)[..., :3]
        bend[:, 1:-1, :3] = (share * cuts * (side == _BOTH) * (after - before))[..., :3]
        speed[:, 1:-1, 3:] = turning * _steady(before[..., 3:], after[..., 3:])
        return speed, bend


def _off(cuts: IntArray, parts: int, speed: FloatArray, bend: FloatArray) -> FloatArray:
    """Returns the coefficients [R, T, parts, 5, 6] of deviations from constant speed after each
    step.

    Parameters
    ----------
    cuts : [R, T, 5] c, where blends take 1/c of the steps
    parts : pieces per step
    speed, bend : [R, T, 5] deviations of speed and acceleration at the step, per duration of a step
    """
    which = np.log2(cuts).astype(np.int64)
    total = np.zeros((*cuts.shape, parts, DEGREE + 1))
    for unit, values in ((_SPEED, speed / cuts), (_BEND, bend / cuts**2)):
        kinds = np.array([_part(unit, 2**k, parts) for k in range(int(which.max()) + 1)])
        total += kinds[which] * values[..., None, None]
    return total.swapaxes(2, 3)


def _part(unit: FloatArray, cut: int, parts: int) -> FloatArray:
    """Returns the coefficients [parts, 6] of a polynomial over the first 1/cut of a step, followed
    by 0.
    """
    found = np.zeros((parts, len(unit)))
    found[: parts // cut] = split(unit[None, None], parts // cut)[:, 0]
    return found


def _walks(problem: Problem, danger: Danger) -> bool:
    """Returns True if a violation involves a person who does not stand still."""
    if danger.person is None:
        return False
    middles = problem.actors[danger.person].middles
    return bool((middles[danger.step] != middles[danger.step + 1]).any())


def _steady(before: FloatArray, after: FloatArray) -> FloatArray:
    """Returns rates between those before and after; 0 if one of them is 0 or if their signs differ.

    The coefficients are then monotonic, so no value between the steps exceeds those at the steps.
    """
    same = before * after > 0
    total = np.where(same, before + after, 1.0)
    mean = np.where(same, 2 * before * after / total, 0.0)
    most = _STEADY * np.minimum(np.abs(before), np.abs(after))
    result: FloatArray = np.clip(mean, -most, most)
    return result
