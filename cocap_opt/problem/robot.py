"""A robot of a problem, and the limits that its airframe and autopilot set to its motion."""

import math
from collections.abc import Iterator, Sequence
from typing import Any

import msgspec

from cocap_opt.data import LARGEST, Data, require, within
from cocap_opt.problem.camera import AnyCamera, Camera
from cocap_opt.problem.goals import AnyGoal, GoalArea
from cocap_opt.problem.motion import ROUNDING, Motion, State, Stride
from cocap_opt.problem.starts import AnyStart, StartStates


class Limits(Data, frozen=True):
    """The speeds at which a drone may move and turn, and how long it may fly.

    A limit that is None is unknown and not checked.

    Attributes
    ----------
    speed : horizontal speed, m/s
    climb : speed upwards, m/s
    descent : speed downwards, m/s
    acceleration : m/s2, in space
    yaw_rate : rad/s
    gimbal_rate : rate of the camera's pitch, rad/s
    endurance : time for which the battery lasts, s
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
                require(value > 0, field, f"must be more than 0, not {value!r}")

    def outlasted_by(self, seconds: float) -> str:
        """Returns a message if the battery does not last for a flight of this length; empty if it
        does.
        """
        if self.endurance is None or seconds <= self.endurance * (1 + ROUNDING):
            return ""
        return f"the flight takes {seconds:.4g} s, but the battery lasts {self.endurance:.4g} s"

    def broken_by(
        self, motion: Motion, tilts: Sequence[float], resolution: float, step: float
    ) -> str:
        """Returns a message that names a move that takes longer than a step, and a remedy; empty if
        there is none.

        Parameters
        ----------
        tilts : tilts of the drone's camera, rad
        resolution : m, edge of a cell
        step : length of a step, s
        """
        for field, words, most, limit, way_out, unit in self._demands(
            motion, tilts, resolution, step
        ):
            if limit is not None and most > limit * step * (1 + ROUNDING):
                return (
                    f"motion.{field}: must allow at most {limit:.4g} {unit}, but {words} in a "
                    f"step of {step:g} s is {most / step:.4g} {unit}; use a step of "
                    f"{rounded_up(most / limit):g} s{way_out}"
                )
        return ""

    def _demands(
        self, motion: Motion, tilts: Sequence[float], resolution: float, step: float
    ) -> Iterator[tuple[str, str, float, float | None, str, str]]:
        """Yields, for each kind of move, its field, words, size, limit, remedy and unit.

        Angles are in degrees.
        """
        diagonal, stride = math.sqrt(2) * resolution, motion.stride or Stride()
        most = min(motion.radius * diagonal, LARGEST if stride.aside is None else stride.aside)
        cells = 0 if self.speed is None else math.floor(self.speed * step / diagonal + ROUNDING)
        words = f"a move of {motion.radius} cells of {resolution:g} m along both axes, {most:.4g} m"
        smaller = f", or a radius of {cells}" if cells else ""
        yield "radius", words, most, self.speed, smaller, "m/s"
        upright = LARGEST if stride.upright is None else stride.upright
        most = min(motion.largest_climb, upright)
        for way, limit in (("climb", self.climb), ("descent", self.descent)):
            words = f"a {way} of {most:g} m"
            yield "climb", words, most, limit, ", or layers closer together", "m/s"
        turn = min(motion.turn, motion.headings // 2) * 360 / motion.headings
        rate = None if self.yaw_rate is None else math.degrees(self.yaw_rate)
        yield "turn", f"a turn by {turn:g} degrees", turn, rate, ", or smaller turns", "deg/s"
        tilt = math.degrees(motion.largest_tilt(tilts))
        rate = None if self.gimbal_rate is None else math.degrees(self.gimbal_rate)
        words = f"a tilt of the gimbal by {tilt:g} degrees"
        yield "pitch_turn", words, tilt, rate, ", or tilts closer together", "deg/s"


def rounded_up(value: float) -> float:
    """Returns a number >= 0, rounded up to three digits."""
    if value <= 0:
        return 0.0
    digit = 10.0 ** (math.floor(math.log10(value)) - 2)
    return float(f"{math.ceil(value / digit - ROUNDING) * digit:.3g}")


def _are_states(start: Any) -> bool:
    """Returns True for a sequence of possible start states."""
    is_sequence = isinstance(start, (list, tuple)) and not isinstance(start, State)
    return is_sequence and bool(start) and all(isinstance(state, State) for state in start)


class Robot(Data, frozen=True):
    """One camera drone: its start, motion and camera, and possibly a goal for step T.

    Attributes
    ----------
    start : cell, layer, heading and pitch at step 0; or several such states, or an area, from which
        planners choose. A sequence of states becomes `StartStates`
    motion : the moves that the drone can make in one step
    camera : the drone's camera: a `Camera`, or the `Cone` of Hughes et al.
    goal : cell (x, y), in any layer and orientation; or several cells, from which planners choose
    limits : speed and turn limits; None if unknown
    home : cell (x, y) on whose ground the drone takes off and lands; None: below its first and last
        place
    number : if the scene is the rest of a mission, the robot's number in that mission; the drone is
        then in the air before step 0. None: the drone takes off
    """

    start: AnyStart
    motion: Motion = Motion()
    camera: AnyCamera = Camera()
    goal: AnyGoal | None = None
    limits: Limits | None = None
    home: tuple[int, int] | None = None
    number: int | None = None

    def __post_init__(self) -> None:
        given: Any = self.start
        if _are_states(given):
            msgspec.structs.force_setattr(self, "start", StartStates(states=tuple(given)))
        super().__post_init__()
        if isinstance(self.start, StartStates) and len(self.start.states) == 1:
            msgspec.structs.force_setattr(self, "start", self.start.states[0])
        if isinstance(self.goal, GoalArea) and len(self.goal.cells) == 1:
            msgspec.structs.force_setattr(self, "goal", self.goal.cells[0])
        sizes = not isinstance(self.goal, tuple) or len(self.goal) == 2
        require(sizes, "goal", "must be a cell (x, y)")
        if self.number is not None:
            require(self.number >= 0, "number", f"must be 0 or more, not {self.number}")

    def may_start_in(self, state: State) -> bool:
        """Returns True if this state is a possible start of the robot, provided that it is free."""
        return state == self.start if isinstance(self.start, State) else self.start.holds(state)

    def may_end_in(self, state: State) -> bool:
        """Returns True if the robot may end in this state at step T, provided that it is free."""
        if isinstance(self.goal, GoalArea):
            return (state.x, state.y) in self.goal.inside
        return self.goal is None or self.goal == (state.x, state.y)

    @property
    def orientation_sizes(self) -> tuple[int, int, int]:
        """Number of layers, headings and pitches, in the order of `State`."""
        return len(self.motion.layers), self.motion.headings, len(self.camera.tilts)
