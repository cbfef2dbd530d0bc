"""Collision rules between robots.

Robots fly straight from cell to cell within a step, so the vector (m) from one to the other moves
along a straight line, too: before + tau (after - before), tau in [0, 1].
"""

import math
from typing import NamedTuple

import numpy as np

from cocap_opt.data import LARGEST, BoolArray, Data, FloatArray, require, within

_TWICE = 2 * (1 + 1e-8)
SEPARATION = 2.0  # m, for scenes that are to be flown; docs/results/flight.md gives the reasons
BODY = 0.7  # m, width of drones in drawings: two drones closer than that collide
TOLERANCE = 1e-6  # m; robots that are closer than the separation by less than this obey it


class Meeting(NamedTuple):
    """The midpoint between two robots at their moment of closest approach in a step."""

    point: FloatArray  # [3] m
    share: float  # share of the step, 0..1

    def ways(self, tails: FloatArray, heads: FloatArray) -> FloatArray:
        """Returns the vectors [n, 3] (m) from the point to robots that move from tails to heads."""
        return (1 - self.share) * tails + self.share * heads - self.point


class CollisionRules(Data, frozen=True):
    """The forbidden conflicts between robots.

    Planners, formulations and the referee take the rules only from here. The vertex rule forbids
    two robots to be in one cell at one step (layers count, headings do not), the swap rule forbids
    them to exchange cells in one step. The separation applies at every moment, at steps and between
    them: robots fly straight from cell to cell, and two robots exactly that far apart obey it (to
    1e-6 m). It implies the other two rules.

    Attributes
    ----------
    vertex : True: no two robots in one cell at one step
    swap : True: no two robots exchange cells in one step
    separation : m, minimum distance between robots at every moment; 0: no such rule
    vertical : m; 0: the separation is a distance in space; otherwise robots must be this far apart
        in height, or keep the separation horizontally, since drones blow air down on each other
    """

    vertex: bool = True
    swap: bool = True
    separation: float = 0.0
    vertical: float = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        for field in ("separation", "vertical"):
            value = getattr(self, field)
            within(value, 0, LARGEST, field, "m")
            allowed = f"must be 0 or more than 2e-6 m, not {value!r}"
            require(value == 0 or value > 2 * TOLERANCE, field, allowed)
        require(
            self.vertex or not (self.swap or self.separation),
            "vertex",
            "must be true if the swap or separation rule is on",
        )
        require(
            self.separation > 0 or not self.vertical,
            "vertical",
            "must be 0 if there is no separation",
        )

    @property
    def none(self) -> bool:
        """True if robots may pass through each other."""
        return not self.vertex

    @property
    def hold_between_steps(self) -> bool:
        """True if moves can break a rule even if the robots obey it at both steps."""
        return self.swap or self.separation > 0

    def __str__(self) -> str:
        if self.separation:
            aside = f"separation {self.separation:g} m"
            return f"{aside}, or {self.vertical:g} m in height" if self.vertical else aside
        return "+".join(name for name in ("vertex", "swap") if getattr(self, name)) or "none"

    def too_near(self, ways: FloatArray) -> BoolArray:
        """Returns an array [..], True if robots with vectors [.., 3] (m) between them break a
        rule.
        """
        if not self.vertex:
            return np.zeros(ways.shape[:-1], dtype=np.bool_)
        if self.vertical:
            aside = np.hypot(ways[..., 0], ways[..., 1])
            near = (aside < self._aside) & (np.abs(ways[..., 2]) < self._above)
        elif self.separation:
            near = np.sqrt((ways * ways).sum(axis=-1)) < self._aside
        else:
            near = (ways == 0).all(axis=-1)
        return np.asarray(near)

    def near_point(self, ways: FloatArray) -> BoolArray:
        """Returns an array [..], True if robots are closer to a point than half the separation.

        Any two such robots are too close to each other. On a grid, distances exactly equal to the
        separation are common, and such robots obey the rule: half the separation is therefore
        reduced by a little more than rounding errors.

        Parameters
        ----------
        ways : [.., 3] vectors from the point to the robots, m
        """
        if not self.separation:
            return np.zeros(ways.shape[:-1], dtype=np.bool_)
        return self.too_near(ways * _TWICE)

    def pass_too_near(self, before: FloatArray, after: FloatArray) -> BoolArray:
        """Returns an array [..], True if robots break the separation at some moment of a step.

        Parameters
        ----------
        before, after : [.., 3] vectors from one robot to the other when the step begins and ends, m
        """
        found = np.zeros(np.broadcast_shapes(before.shape, after.shape)[:-1], dtype=np.bool_)
        if not self.separation:
            return found
        # Most robots are far apart along one axis all the time, which is quick to check.
        before, after = np.broadcast_arrays(before, after)
        near = self._may_pass_too_near(before, after)
        before, after = before[near], after[near]
        if self.vertical:
            first, last = self._near_aside_and_above(before, after)
            found[near] = first < last
        else:
            found[near] = _closest(before, after)[1] < self._aside
        return found

    def _may_pass_too_near(self, before: FloatArray, after: FloatArray) -> BoolArray:
        """Returns an array [..], False if robots are far apart along one axis all the time."""
        may = np.ones(before.shape[:-1], dtype=np.bool_)
        most = self.separation, self.separation, self.vertical or self.separation
        for axis, far in enumerate(most):
            here, there = before[..., axis], after[..., axis]
            may &= ((here < far) | (there < far)) & ((here > -far) | (there > -far))
        return may

    def moves_conflict(
        self, first: tuple[FloatArray, FloatArray], second: tuple[FloatArray, FloatArray]
    ) -> BoolArray:
        """Returns an array [..], True if two robots' moves break a rule, at their ends or in
        between.

        Parameters
        ----------
        first, second : for each robot, the positions [.., 3] (m) at which its moves begin and end
        """
        return self._at_ends(first, second) | self._between(first, second)

    def conflict_between(
        self, first: tuple[FloatArray, FloatArray], second: tuple[FloatArray, FloatArray]
    ) -> BoolArray:
        """Returns an array [..], True if moves break a rule between two steps, but at neither step.

        Parameters
        ----------
        first, second : as in `moves_conflict`
        """
        return self._between(first, second) & ~self._at_ends(first, second)

    def _at_ends(
        self, first: tuple[FloatArray, FloatArray], second: tuple[FloatArray, FloatArray]
    ) -> BoolArray:
        before, after = (there - here for here, there in zip(first, second, strict=True))
        return self.too_near(before) | self.too_near(after)

    def _between(
        self, first: tuple[FloatArray, FloatArray], second: tuple[FloatArray, FloatArray]
    ) -> BoolArray:
        found = self.pass_too_near(second[0] - first[0], second[1] - first[1])
        if self.swap:
            ends = (first[0] == second[1]).all(axis=-1), (first[1] == second[0]).all(axis=-1)
            found = found | np.asarray(ends[0] & ends[1])
        return found

    def may_conflict(
        self, first: tuple[FloatArray, FloatArray], second: FloatArray, reach: float
    ) -> BoolArray:
        """Returns an array [..], True if some move of the other robot may conflict between the
        steps.

        Parameters
        ----------
        first : the positions [.., 3] (m) at which the move begins and ends
        second : the positions [.., 3] (m) at which the other robot's move begins
        reach : length of the other robot's longest move, m
        """
        found = np.asarray((first[1] == second).all(axis=-1))
        if self.separation:
            most = math.hypot(self.separation, self.vertical) + reach
            found = found | (_closest(second - first[0], second - first[1])[1] < most)
        return found

    def closest(self, before: FloatArray, after: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Returns the moments of closest approach in a step; in a conflict, a moment during the
        conflict.

        Parameters
        ----------
        before, after : as in `pass_too_near`

        Returns
        -------
        Shares [..] of the step, 0..1, and distances [..] (m) in space.
        """
        share, distance = _closest(before, after)
        if not self.vertical:
            return share, distance
        first, last = self._near_aside_and_above(before, after)
        share = np.where(first < last, np.clip(share, first, last), share)
        at = before + share[..., None] * (after - before)
        return share, np.sqrt((at * at).sum(axis=-1))

    def meeting(self, tails: FloatArray, heads: FloatArray) -> Meeting:
        """Returns the position and moment of two robots' closest approach in a step.

        Parameters
        ----------
        tails, heads : [2, 3] m, positions at which their moves begin and end
        """
        share = float(self.closest(tails[1] - tails[0], heads[1] - heads[0])[0])
        first, second = (1 - share) * tails + share * heads
        return Meeting((first + second) / 2, share)

    @property
    def _aside(self) -> float:
        """The horizontal distance (m) at which robots are far enough apart."""
        return self.separation - TOLERANCE

    @property
    def _above(self) -> float:
        """The difference in height (m) at which robots are far enough apart."""
        return self.vertical - TOLERANCE

    def _near_aside_and_above(
        self, before: FloatArray, after: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Returns the first and last moments at which robots are too close both horizontally and in
        height.

        If the first moment is after the last, they never are.
        """
        change = after - before
        dx, dy, dz = np.moveaxis(change, -1, 0)
        x, y, z = np.moveaxis(before + np.zeros_like(change), -1, 0)
        # |aside|^2 = a tau^2 + 2 b tau + c + (the minimum distance)^2
        a, b, c = dx * dx + dy * dy, x * dx + y * dy, x * x + y * y - self._aside**2
        root = np.sqrt(np.maximum(b * b - a * c, 0.0))
        moving, crossing = a > 0, b * b > a * c
        divisor = np.where(moving, a, 1.0)
        climbing = dz != 0
        slope = np.where(climbing, dz, 1.0)
        with np.errstate(over="ignore"):  # slow robots get there very late
            enter, leave = (-b - root) / divisor, (-b + root) / divisor
            ends = (-self._above - z) / slope, (self._above - z) / slope
        first = np.where(moving, np.where(crossing, enter, 2.0), np.where(c < 0, 0, 2))
        last = np.where(moving, np.where(crossing, leave, -1.0), np.where(c < 0, 1, -1))
        level = np.abs(z) < self._above
        low = np.where(climbing, np.minimum(*ends), np.where(level, 0.0, 2.0))
        high = np.where(climbing, np.maximum(*ends), np.where(level, 1.0, -1.0))
        return np.maximum(np.maximum(first, low), 0.0), np.minimum(np.minimum(last, high), 1.0)


def _closest(before: FloatArray, after: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Returns the moments at which lines from `before` to `after` are nearest to 0, and the
    distances.
    """
    change = after - before
    square = (change * change).sum(axis=-1)
    along = -(before * change).sum(axis=-1) / np.where(square > 0, square, 1.0)
    share = np.clip(along, 0.0, 1.0)
    at = before + share[..., None] * change
    return share, np.sqrt((at * at).sum(axis=-1))


NO_RULES = CollisionRules(vertex=False, swap=False)
VERTEX_ONLY = CollisionRules(vertex=True, swap=False)  # robots may exchange cells in a step
