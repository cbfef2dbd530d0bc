"""The ground on which drones take off and land, and warnings of roofs, water and obstacles.

Drones with homes use those; others go straight up to their first places and straight down from
their last ones.
"""

from collections.abc import Iterable, Iterator
from itertools import groupby
from typing import NamedTuple

import numpy as np

from cocap_opt.flight.flights import Flight
from cocap_opt.problem.land_cover import Land, lands_at
from cocap_opt.text import in_ranges
from cocap_opt.world.workspace import OBSTACLE

TAKE_OFF, LANDING, HOME = "take-off", "landing", "home"
# Of one drone, of several, and what to do with them.
_DOES = {
    TAKE_OFF: ("takes off from", "take off from", "start"),
    LANDING: ("lands on", "land on", "land"),
    HOME: ("takes off from and lands on", "take off from and land on", "start and land"),
}


class Touchdown(NamedTuple):
    """A place on which a drone takes off, lands, or does both.

    Attributes
    ----------
    kind : TAKE_OFF, LANDING or HOME
    x, y : m
    z : m, of the drone above it before it lands, or after it took off; at home of the surface
    surface : m, the altitude of what the drone stands on
    above : m, by which that is higher than the ground; None: the map does not tell the ground
    land : by the land cover; None: unknown
    """

    drone: int
    kind: str
    x: float
    y: float
    z: float
    surface: float
    above: float | None
    land: Land | None

    @property
    def is_bad(self) -> bool:
        """True for a roof, an obstacle or water, as far as the scene tells."""
        return self.is_raised or self.land in {"building", "water"}

    @property
    def what(self) -> str:
        """The ground or the thing on which the drone stands."""
        if self.is_raised:
            return "a roof" if self.land == "building" else "an obstacle"
        if self.land == "building":
            return "a building, by the land cover"
        if self.land is not None and self.land != "other":
            return self.land
        return "unknown" if self.above is None else "ground"

    @property
    def ground(self) -> str:
        """The same, with its height if it is none of the ground."""
        return self.what + (f" {self.above:.1f} m above the ground" if self.is_raised else "")

    @property
    def is_raised(self) -> bool:
        """True if the drone stands on something that is known to be no ground."""
        return self.above is not None and self.above > OBSTACLE


def touchdowns(flight: Flight) -> list[Touchdown]:
    """Returns where drones take off, unless they are in the air already, and where they land.

    A drone with a home has one of the two, for both.
    """
    problem, height_map = flight.flown.problem, flight.flown.problem.height_map
    places = list(_places(flight))
    lands = lands_at(problem.land_cover, np.array([place[:2] for _, _, place in places]))
    found = []
    for (drone, kind, (x, y, z)), land in zip(places, lands, strict=True):
        i, j = (int(cell[0]) for cell in height_map.cells_below(np.array([[x, y]])))
        tops = (high for _, high in problem.workspace.columns.at(i, j) if high <= z)
        surface = max(tops, default=float(height_map.heights[i, j]))
        above = surface - float(height_map.ground[i, j]) if height_map.knows_ground else None
        found.append(Touchdown(drone, kind, x, y, z, surface, above, land))
    return found


def _places(flight: Flight) -> Iterator[tuple[int, str, list[float]]]:
    """Yields each drone, what it does, and the place (m) below which it does."""
    problem, flown = flight.flown.problem, flight.flown
    height_map = problem.height_map
    ends = flown.at(np.array([0.0, flown.seconds]))
    for drone, robot in enumerate(problem.robots):
        if robot.home is not None:
            place = [*height_map.centre(*robot.home), float(height_map.heights[robot.home])]
            yield drone, HOME, place
            continue
        first, last = ends.place[ends.drone == drone].tolist()
        if not problem.begins_in_the_air:
            yield drone, TAKE_OFF, first
        yield drone, LANDING, last


def bad_touchdowns(found: Iterable[Touchdown]) -> Iterator[str]:
    """Yields which drones take off from or land on roofs, obstacles and water, and what to do."""

    def key(each: Touchdown) -> tuple[int, str]:
        return list(_DOES).index(each.kind), each.what

    bad = sorted((each for each in found if each.is_bad), key=key)
    for _, group in groupby(bad, key=key):
        first, *others = alike = list(group)
        does, do, instead = _DOES[first.kind]
        if not others:
            yield f"drone {first.drone} {does} {first.ground}; {instead} it elsewhere"
            continue
        most = max(each.above or 0.0 for each in alike)
        high = f" up to {most:.1f} m above the ground" if first.is_raised else ""
        drones = in_ranges([each.drone for each in alike])
        yield f"drones {drones} {do} {first.what}{high}; {instead} them elsewhere"
