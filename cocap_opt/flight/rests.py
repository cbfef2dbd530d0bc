"""Flights in which drones rest at both ends of a step, and the time laws of their moves.

A drone that rests at both steps flies the straight line of the plan, with a time law s(tau) that is
0 at the first step and 1 at the next. Its safety is known, regardless of the rest of the plan:

- It keeps clear of walls and zones like the straight move, as it flies the same line.
- At every moment, drones with the same law are as far apart as on straight flights at some moment,
  since all have completed the same share of their moves.
- Its distance from a person, who walks at a constant speed, is at least that of a flight at
  constant speed, less |s(tau) - tau| of its move: the `stray` of the law.
- Its speeds and accelerations are those of the move, times constants of the law.

So if moves obey the limits of drones at rest (`Rests.stride`), and the distance from people
includes the stray, every plan has a smooth flight, whatever its moves and their order.
"""

from functools import cached_property
from itertools import pairwise

import numpy as np

from cocap_opt.data import LARGEST, FloatArray, read_only
from cocap_opt.flight.bernstein import Peak, derivative, elevated
from cocap_opt.flight.trajectory import DEGREE, split
from cocap_opt.problem import Limits, Stride

PARTS = 8  # pieces of a step that make up a law
_OVER = 1 + 1e-7  # factor on a constant, so that rounding exceeds no limit


class Rests:
    """A time law between two rests, with continuous speed and acceleration.

    Parameters
    ----------
    ramp : pieces of the step, 1..4 of `PARTS`, in which the drone accelerates to a constant speed,
        and in which it decelerates; `PARTS`: its speed is never constant, and its acceleration is
        small
    """

    def __init__(self, ramp: int) -> None:
        self.ramp = ramp

    @cached_property
    def law(self) -> FloatArray:
        """Coefficients [PARTS, 6] of s(tau), piece by piece; the second half mirrors the first."""
        if self.ramp == PARTS:
            return read_only(split(np.array([[[0.0, 0, 0, 1, 1, 1]]]), PARTS)[:, 0])
        share = self.ramp / PARTS
        speed = 1 / (1 - share)
        # The speed rises by 3 u^2 - 2 u^3, which leads to u^3 - u^4 / 2.
        rise = elevated(np.array([[[0.0, 0, 0, 1 / 4, 1 / 2]]]), DEGREE)
        start = split(speed * share * rise, self.ramp)[:, 0]
        middle = np.linspace(start[-1, -1], 0.5, PARTS // 2 - self.ramp + 1)
        even = [np.linspace(a, b, DEGREE + 1) for a, b in pairwise(middle)]
        half = np.array([*start, *even])
        return read_only(np.concatenate([half, 1 - half[::-1, ::-1]]))

    @cached_property
    def rate(self) -> float:
        """The largest speed, relative to that of a flight at constant speed."""
        return Peak.of(derivative(self.law) * PARTS).value * _OVER

    @cached_property
    def acceleration(self) -> float:
        """The largest acceleration, in moves per squared step."""
        bends = derivative(derivative(self.law)) * PARTS**2
        return max(Peak.of(bends).value, Peak.of(-bends).value) * _OVER

    @cached_property
    def stray(self) -> float:
        """The largest deviation from constant speed, as a share of the move."""
        even = np.linspace(0.0, 1.0, PARTS * DEGREE + 1)
        pieces = np.array([even[k * DEGREE : (k + 1) * DEGREE + 1] for k in range(PARTS)])
        return max(Peak.of(self.law - pieces).value, Peak.of(pieces - self.law).value) * _OVER

    def stride(self, limits: Limits, step: float) -> Stride:
        """Returns the longest moves that a drone can make between two rests.

        Parameters
        ----------
        step : length of a step, s
        """

        def most(rates: list[float | None], seconds: float, share: float) -> float | None:
            """Returns the distance (m) for the lowest known rate, within the range of numbers."""
            known = [rate for rate in rates if rate is not None]
            return min(min(known) * seconds / share, LARGEST) if known else None

        return Stride(
            aside=most([limits.speed], step, self.rate),
            upright=most([limits.climb, limits.descent], step, self.rate),
            space=most([limits.acceleration], step**2, self.acceleration),
        )

    def between(self, points: FloatArray) -> FloatArray:
        """Returns the coefficients [.., T, PARTS, d, 6] of flights through points [.., T+1, d].

        They begin and end exactly at the points; a drone that stays has constant coefficients.
        """
        a, b = points[..., :-1, None, :, None], points[..., 1:, None, :, None]
        share = self.law[:, None, :]
        way: FloatArray = np.where(share < 0.5, a + (b - a) * share, b - (b - a) * (1 - share))
        return way


GENTLE = Rests(PARTS)
LAWS = GENTLE, Rests(2), Rests(1)  # gentlest first
TURNS = Rests(1)  # law for angles, whose accelerations have no known limits
