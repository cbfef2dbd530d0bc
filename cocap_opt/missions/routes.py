"""The waypoints of a drone's flight, and the legs between them, in the form that autopilots
need.
"""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from cocap_opt.data import FloatArray
from cocap_opt.flight.earth import Geodesy
from cocap_opt.flight.flights import Flight
from cocap_opt.flight.ways import rising
from cocap_opt.missions.items import Place

_SETTLE = 10.0  # s that the last drone has left at its place
_REACHED = 0.5  # m from a waypoint, or a quarter of the shortest leg if that is less
_STAYS = 1e-3  # m; shorter moves count as staying


class Leg(NamedTuple):
    """The move of a drone in a step.

    Attributes
    ----------
    step : the step at the end of the leg
    seconds : planned duration, s
    along : horizontal distance, m; 0 if the drone stays, or moves straight up or down
    rise : change of height, m; negative for a descent
    turn : degrees by which the drone turns, clockwise
    """

    step: int
    seconds: float
    along: float
    rise: float
    turn: float

    @property
    def is_way(self) -> bool:
        """True if the drone moves."""
        return self.along > 0 or self.rise != 0


class Route(NamedTuple):
    """The waypoints of a drone at the steps 0..T.

    Attributes
    ----------
    drone : number of the drone
    places : [T+1, 3] latitude, longitude (degrees) and m above the take-off
    yaw : [T+1] degrees from true north, clockwise
    pitch : [T+1] degrees, of the camera, 0 is level and below the horizon is negative
    lengths : [T] m along the ground
    step : s
    sea : height of the take-off above the sea, m; None if unknown
    until : time from the start of the mission to step 0, s; the drone waits in its place until then
    """

    drone: int
    places: FloatArray
    yaw: FloatArray
    pitch: FloatArray
    lengths: FloatArray
    step: float
    sea: float | None
    until: float

    @property
    def fastest(self) -> float:
        """Largest speed over ground, m/s."""
        return float(self.lengths.max() / self.step)

    @property
    def reached(self) -> float:
        """Distance (m) within which a waypoint counts as reached."""
        legs = np.hypot(self.lengths, np.diff(self.places[:, 2]))
        return min(_REACHED, float(legs[legs > _STAYS].min(initial=np.inf)) / 4)

    def place(self, step: int) -> Place:
        """Returns the position of the drone at a step."""
        return tuple(self.places[step].tolist())

    def legs(self) -> Iterator[Leg]:
        """Yields the legs in order."""
        rises = np.diff(self.places[:, 2])
        for k, (length, rise) in enumerate(zip(self.lengths.tolist(), rises.tolist(), strict=True)):
            turn = math.remainder(self.yaw[k + 1] - self.yaw[k], 360.0)
            along = length if length > _STAYS else 0.0
            yield Leg(k + 1, self.step, along, rise if abs(rise) > _STAYS else 0.0, turn)


def routes(flight: Flight, geodesy: Geodesy) -> list[Route]:
    """Returns the route of each drone of a flight."""
    problem, columns = flight.flown.problem, flight.columns(flight.flown.step)
    rows = {name: column.reshape(len(problem.robots), -1) for name, column in columns.items()}
    surfaces, earth = flight.flown.start_surfaces, problem.earth
    height = rows["z"] - surfaces[:, None]
    until = seconds_to_step_0(flight)
    found = []
    for i in range(len(problem.robots)):
        x, y, ground = rows["x"][i], rows["y"][i], float(surfaces[i])
        above_sea = earth is not None and earth.heights == "sea"
        lengths = geodesy.lengths(x, y)
        places = np.column_stack([rows["latitude"][i], rows["longitude"][i], height[i]])
        for k in np.flatnonzero(np.hypot(lengths, np.diff(height[i])) < _STAYS):
            places[k + 1] = places[k]  # the same place, except for rounding
        found.append(Route(
            i,
            places,
            geodesy.compass(x, y, np.radians(rows["yaw"][i])),
            rows["pitch"][i],
            lengths,
            flight.flown.step,
            ground + earth.base if earth is not None and above_sea else None,
            until,
        ))  # fmt: skip
    return found


def seconds_to_step_0(flight: Flight) -> float:
    """Returns the time from the start of all waypoint missions to step 0 of the plan, s.

    A drone that rises at 1 m/s to the highest place then has 10 s left; autopilots rise faster.
    """
    speeds = [rising(robot) for robot in flight.flown.problem.robots]
    return _SETTLE + float((_first_heights(flight) / np.array(speeds)).max())


def seconds_in_the_air(flight: Flight) -> float:
    """Returns the time from take-off to the last step, which is the same for all drones, s.

    A drone rises and waits as in waypoint missions; for smooth flights, which begin when all drones
    are in place, the drone that rises highest does not wait. The descent is not included.
    """
    settles = _SETTLE if flight.is_smooth else 0.0
    return seconds_to_step_0(flight) - settles + flight.flown.seconds


def _first_heights(flight: Flight) -> FloatArray:
    """Returns the heights [R] (m) of the first places above take-off."""
    return flight.flown.at(np.zeros(1)).place[:, 2] - flight.flown.start_surfaces
