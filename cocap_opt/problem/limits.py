"""The limits of a drone's motion, which its airframe and its autopilot set."""

import math
from collections.abc import Iterator, Sequence

from cocap_opt.data import LARGEST, Data, require, within
from cocap_opt.problem.motion import Motion

ROUNDING = 1e-9  # share of a limit by which motion may exceed it


class Limits(Data, frozen=True):
    """The speeds at which a drone may move and turn, and how long it may fly.

    What is None is not known, and not checked.

    Attributes
    ----------
    speed : m/s, seen from above
    climb : m/s, upwards
    descent : m/s, downwards
    acceleration : m/s2, in space
    yaw_rate : rad/s
    gimbal_rate : rad/s, of the camera's pitch
    endurance : s for which the battery lasts
    """

    speed: float | None = None
    climb: float | None = None
    descent: float | None = None
    acceleration: float | None = None
    yaw_rate: float | None = None
    gimbal_rate: float | None = None
    endurance: float | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        for field in self.__struct_fields__:
            value = getattr(self, field)
            if value is not None:
                within(value, 0, LARGEST, field)
                require(value > 0, field, "must be more than 0")

    def outlasted_by(self, seconds: float) -> str:
        """Says that a flight of so many seconds is longer than the battery lasts, if it is."""
        if self.endurance is None or seconds <= self.endurance * (1 + ROUNDING):
            return ""
        return f"the flight takes {seconds:.4g} s, but the battery lasts {self.endurance:.4g} s"

    def broken_by(
        self, motion: Motion, tilts: Sequence[float], resolution: float, step: float
    ) -> str:
        """Says which of the moves of a motion takes longer than a step, and what would do.

        Parameters
        ----------
        tilts : rad, of the drone's camera
        resolution : m, edge of a cell
        step : s
        """
        for field, words, most, limit, way_out, unit in self._demands(
            motion, tilts, resolution, step
        ):
            if limit is not None and most > limit * step * (1 + ROUNDING):
                return (
                    f"motion.{field}: must allow at most {limit:.4g} {unit}, but {words} in a "
                    f"step of {step:g} s is {most / step:.4g} {unit}; a step of "
                    f"{_up(most / limit):g} s{way_out} would do"
                )
        return self._start_breaks(motion, resolution, step)

    def _start_breaks(self, motion: Motion, resolution: float, step: float) -> str:
        """Says that not even the shortest move can be made from rest in a step, if it is so.

        Drones begin at rest, so that without such a move none gets anywhere. More is not asked of
        all scenes: drones need not stop at each step, and one that goes straight on accelerates
        no more (`strained_by` tells of the longest move; a smooth flight is checked as it is).
        """
        shortest = motion.shortest_move(resolution)
        if self.acceleration is None or math.isinf(shortest):
            return ""
        least = math.sqrt(2 * shortest / self.acceleration)
        if step * math.sqrt(1 + ROUNDING) >= least:
            return ""
        field, shorter = "layers", "layers {:g} m apart"
        if motion.radius and shortest == resolution:
            field, shorter = "radius", "cells of {:g} m"
        return (
            f"motion.{field}: must allow at most {self.acceleration:.4g} m/s2, but from rest the "
            f"shortest move, {shortest:.4g} m, in a step of {step:g} s asks for "
            f"{2 * shortest / step**2:.4g} m/s2; a step of {_up(least):g} s, or "
            f"{shorter.format(_down(self.acceleration * step**2 / 2))} would do"
        )

    def strained_by(self, motion: Motion, resolution: float, step: float) -> str:
        """Says that the longest move from rest to rest takes longer than a step, if it does.

        The best law speeds up for half of the step and slows down for the other half.

        Parameters
        ----------
        resolution : m, edge of a cell
        step : s
        """
        longest = motion.longest_move(resolution)
        if self.acceleration is None or 4 * longest <= self.acceleration * step**2 * (1 + ROUNDING):
            return ""
        return (
            f"cannot stop at each step: from rest to rest the longest move, {longest:.4g} m, in a "
            f"step of {step:g} s asks for {4 * longest / step**2:.4g} m/s2, more than its "
            f"{self.acceleration:.4g}, so that smooth flights with sharp turns may be refused; a "
            f"step of {_up(2 * math.sqrt(longest / self.acceleration)):g} s would do"
        )

    def _demands(
        self, motion: Motion, tilts: Sequence[float], resolution: float, step: float
    ) -> Iterator[tuple[str, str, float, float | None, str, str]]:
        """Yields of each kind of move its field, words, its size, its limit, a way out, a unit.

        Angles are in degrees.
        """
        diagonal = math.sqrt(2) * resolution
        most = motion.radius * diagonal
        cells = 0 if self.speed is None else math.floor(self.speed * step / diagonal + ROUNDING)
        words = f"a move of {motion.radius} cells of {resolution:g} m along both axes, {most:.4g} m"
        smaller = f", or a radius of {cells}" if cells else ""
        yield "radius", words, most, self.speed, smaller, "m/s"
        most = motion.largest_climb
        for way, limit in (("climb", self.climb), ("descent", self.descent)):
            yield "climb", f"a {way} of {most:g} m", most, limit, ", or nearer layers", "m/s"
        turn = min(motion.turn, motion.headings // 2) * 360 / motion.headings
        rate = None if self.yaw_rate is None else math.degrees(self.yaw_rate)
        yield "turn", f"a turn by {turn:g} degrees", turn, rate, ", or smaller turns", "deg/s"
        tilt = math.degrees(_largest(tilts, motion.pitch_turn))
        rate = None if self.gimbal_rate is None else math.degrees(self.gimbal_rate)
        words = f"a tilt of the gimbal by {tilt:g} degrees"
        yield "pitch_turn", words, tilt, rate, ", or nearer tilts", "deg/s"


def _largest(values: Sequence[float], reach: int) -> float:
    """Returns the largest difference of two values that are at most so many places apart."""
    return max(abs(a - b) for k, a in enumerate(values) for b in values[k : k + reach + 1])


def _up(value: float) -> float:
    """Returns a number >= 0, rounded up to three digits."""
    if value <= 0:
        return 0.0
    digit = 10.0 ** (math.floor(math.log10(value)) - 2)
    return float(f"{math.ceil(value / digit - ROUNDING) * digit:.3g}")


def _down(value: float) -> float:
    """Returns a number > 0, rounded down to three digits."""
    digit = 10.0 ** (math.floor(math.log10(value)) - 2)
    return float(f"{math.floor(value / digit + ROUNDING) * digit:.3g}")
