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
        return ""

    def strained_by(self, motion: Motion, resolution: float, step: float) -> str:
        """Says which moves, at rest before or after, take longer than a step, if there are any.

        It is no proof that nothing can be flown: drones need not stop at each step, one that goes
        straight on accelerates no more, and one that stays for a step can take a run-up in it. A
        smooth flight is checked as it is. The best law from rest speeds up for all of the step;
        that from rest to rest speeds up for half of it and slows down for the other half.

        Parameters
        ----------
        resolution : m, edge of a cell
        step : s
        """
        if self.acceleration is None:
            return ""
        most = self.acceleration * step**2 * (1 + ROUNDING)
        shortest, longest = motion.shortest_move(resolution), motion.longest_move(resolution)
        if math.isfinite(shortest) and 2 * shortest > most:
            ask, flights = 2 * shortest, "smooth flights"
            words = f"can make no move in a step from rest: the shortest, {shortest:.4g} m"
        elif 4 * longest > most:
            ask, flights = 4 * longest, "smooth flights with sharp turns"
            words = f"cannot stop at each step: from rest to rest the longest move, {longest:.4g} m"
        else:
            return ""
        return (
            f"{words}, in a step of {step:g} s asks for {ask / step**2:.4g} m/s2, more than its "
            f"{self.acceleration:.4g}, so that {flights} may be refused; a step of "
            f"{_up(math.sqrt(ask / self.acceleration)):g} s would do"
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
