"""Compares flights with the limits of drones: finds the most demanding moments of each drone."""

import math
from collections.abc import Iterator
from typing import NamedTuple, Self

import numpy as np

from cocap_opt.data import FloatArray
from cocap_opt.flight.bernstein import Peak, ever_positive, squared_length
from cocap_opt.flight.trajectory import PITCH, YAW, Trajectory
from cocap_opt.problem import Limits
from cocap_opt.problem.motion import ROUNDING

_AT_REST = 1e-4  # m/s, rad/s, ..: smaller values are rounding errors
_SIGNS = {"climb": 1.0, "descent": -1.0}
_TURNS = "yaw_rate", "gimbal_rate"
_SECOND = ("acceleration",)  # kinds that fall with the square of a step's duration


class Demand(NamedTuple):
    """The largest speed, turning rate or the like that a flight demands of a drone.

    Attributes
    ----------
    kind : a field of `Limits`
    most : the largest value, in its unit
    t : time since step 0, s
    limit : the limit, in the same unit; None: unknown
    """

    drone: int
    kind: str
    most: float
    t: float
    limit: float | None

    @classmethod
    def all_of(cls, flown: Trajectory, is_smooth: bool) -> list[Self]:
        """Returns the largest demand of each kind on each drone.

        Parameters
        ----------
        is_smooth : False: speeds are discontinuous at the steps, and accelerations are left out
        """
        found = []
        for i, robot in enumerate(flown.problem.robots):
            limits = robot.limits or Limits()
            for kind, peak in _peaks(flown, i, is_smooth):
                t = (peak.which % flown.pieces.shape[1] + peak.share) * flown.piece_seconds
                most = 0.0 if peak.value < _AT_REST else peak.value
                found.append(cls(i, kind, most, t, getattr(limits, kind)))
        return found

    @staticmethod
    def tightest(found: list["Demand"]) -> list["Demand"]:
        """Returns, for each drone, the demand that is closest to its limit; without limits, its
        speed.
        """
        drones = sorted({demand.drone for demand in found})
        by_drone = [[demand for demand in found if demand.drone == i] for i in drones]
        return [max(row, key=lambda demand: demand.share) for row in by_drone]

    @property
    def share(self) -> float:
        """The value as a share of the limit; 0 if the limit is unknown."""
        return 0.0 if self.limit is None else self.most / self.limit

    @property
    def is_kept(self) -> bool:
        """True if the value does not exceed its limit."""
        return self.share <= 1 + 2 * ROUNDING

    @property
    def slower(self) -> float:
        """The factor by which steps must be longer to obey the limit."""
        return math.sqrt(self.share) if self.kind in _SECOND else self.share


class Excess(NamedTuple):
    """A piece of a flight in which a drone exceeds a limit."""

    drone: int
    step: int
    is_turn: bool  # a limit of turning, of the drone or its camera

    @classmethod
    def all_of(cls, flown: Trajectory) -> Iterator[Self]:
        """Yields the pieces of smooth flights that are not proved to obey all limits."""
        for i, robot in enumerate(flown.problem.robots):
            for kind, vectors in _demanded(flown, i, is_smooth=True):
                limit = getattr(robot.limits, kind, None)
                if limit is None:
                    continue
                most = limit * (1 + ROUNDING)
                above = [squared_length(vectors) - most**2]
                if kind in _SIGNS:  # a fast descent is not a climb
                    above.append(vectors[:, 0] * _SIGNS[kind])
                for piece in np.flatnonzero(ever_positive(above)).tolist():
                    yield cls(i, piece // flown.parts, kind in _TURNS)


def _demanded(flown: Trajectory, drone: int, is_smooth: bool) -> Iterator[tuple[str, FloatArray]]:
    """Yields each kind of demand on a drone, with the vectors [N, d, n+1] whose length it is."""
    rates = flown.velocities[drone]
    yield "speed", rates[:, :2]
    yield "climb", rates[:, 2:3]
    yield "descent", rates[:, 2:3]
    if is_smooth:
        yield "acceleration", flown.accelerations[drone][:, :3]
    yield "yaw_rate", rates[:, [YAW]]
    yield "gimbal_rate", rates[:, [PITCH]]


def _peaks(flown: Trajectory, drone: int, is_smooth: bool) -> Iterator[tuple[str, Peak]]:
    """Yields each kind of demand on a drone, with its peak."""
    for kind, vectors in _demanded(flown, drone, is_smooth):
        sign = _SIGNS.get(kind)
        yield kind, _longest(vectors) if sign is None else Peak.of(sign * vectors[:, 0])


def _longest(vectors: FloatArray) -> Peak:
    """Returns the peak of the lengths of vectors [T, d, n+1]."""
    peak = Peak.of(squared_length(vectors))
    return peak._replace(value=math.sqrt(max(peak.value, 0.0)))
