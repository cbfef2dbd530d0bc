"""The ground on which drones take off and land, and warnings about it and about nearby drones.

Drones with homes use those; others fly straight up to their first places and straight down from
their last ones. Warnings are about roofs, water and obstacles, and about drones that are one above
the other, or closer than the separation, between those places and the ground.
"""

from collections.abc import Collection, Iterable, Iterator, Sequence
from itertools import groupby
from typing import NamedTuple, Self

import numpy as np

from cocap_opt.flight.flights import Flight
from cocap_opt.problem import SEPARATION, CollisionRules
from cocap_opt.problem.land_cover import Land, lands_at
from cocap_opt.text import in_ranges
from cocap_opt.world.workspace import OBSTACLE

TAKE_OFF, LANDING, HOME = "take-off", "landing", "home"
KINDS = TAKE_OFF, LANDING, HOME
_SAME_SPOT = 0.05  # m


class _Deed(NamedTuple):
    """The wording for an action of one drone or of several, with or without the kind of ground, and
    its remedy.
    """

    does_on: str
    do_on: str
    does: str
    do: str
    instead: str


_DEEDS = {
    TAKE_OFF: _Deed("takes off from", "take off from", "takes off", "take off", "start"),
    LANDING: _Deed("lands on", "land on", "lands", "land", "land"),
    HOME: _Deed(
        "takes off from and lands on", "take off from and land on", "takes off and lands",
        "take off and land", "start and land",
    ),
}  # fmt: skip


class Touchdown(NamedTuple):
    """A place on which a drone takes off, lands, or does both.

    Attributes
    ----------
    kind : TAKE_OFF, LANDING or HOME
    x, y : m
    z : altitude of the drone before landing or after take-off, m; at a home, altitude of the
        surface
    surface : altitude of the surface on which the drone stands, m
    above : height of that surface above the ground, m; None: the map does not give the ground
    land : kind of land, by the land cover; None: unknown
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
        """True for a roof, an obstacle or water, as far as the scene shows it."""
        return self.is_raised or self.land in {"building", "water"}

    @property
    def what(self) -> str:
        """The ground or the object on which the drone stands."""
        if self.is_raised:
            return "a roof" if self.land == "building" else "an obstacle"
        if self.land == "building":
            return "a building, by the land cover"
        if self.land is not None and self.land != "other":
            return self.land
        return "unknown" if self.above is None else "ground"

    @property
    def ground(self) -> str:
        """The same, with its height if it is not the ground."""
        return self.what + (f" {self.above:.1f} m above the ground" if self.is_raised else "")

    @property
    def is_raised(self) -> bool:
        """True if the drone stands on something that is known not to be the ground."""
        return self.above is not None and self.above > OBSTACLE


class Near(NamedTuple):
    """Two drones that are too close to each other while they take off, or while they land.

    Attributes
    ----------
    first, second : numbers of the drones
    kind : kind of both touchdowns
    distance : smallest distance between their vertical flights, m
    """

    first: int
    second: int
    kind: str
    distance: float

    @property
    def is_above(self) -> bool:
        """True if one drone is above the other."""
        return self.distance < _SAME_SPOT


class Touchdowns(NamedTuple):
    """The landings of a flight, and its take-offs, unless its drones are in the air already.

    A drone with a home has one touchdown, for both.

    Attributes
    ----------
    found : touchdowns by drone
    near : pairs of drones that come too close to each other below their places
    separation : required distance between drones, m
    """

    found: tuple[Touchdown, ...]
    near: tuple[Near, ...]
    separation: float

    @classmethod
    def of(cls, flight: Flight) -> Self:
        """Returns the touchdowns of a flight.

        If the scene has no separation, the default separation of flown scenes is used.
        """
        found, rules = tuple(_found(flight)), flight.flown.problem.rules
        if not rules.separation:
            rules = CollisionRules(separation=SEPARATION)
        near = tuple(pair for kind in KINDS for pair in _near(found, kind, rules))
        return cls(found, near, rules.separation)

    def warnings(self, kinds: Collection[str] = KINDS) -> Iterator[str]:
        """Yields messages on drones that touch down badly or too close to each other, with
        remedies.
        """
        yield from _of_ground([each for each in self.found if each.kind in kinds])
        for kind in KINDS:
            if near := [pair for pair in self.near if pair.kind == kind and kind in kinds]:
                yield _of_others(near, self.separation)

    def of_drone(self, drone: int) -> Iterator[str]:
        """Yields the warnings of one drone, without its name."""
        for words in _of_ground([each for each in self.found if each.drone == drone]):
            yield words.removeprefix(f"drone {drone} ")
        for kind, deed in _DEEDS.items():
            pairs = [pair for pair in self.near if pair.kind == kind and drone in pair[:2]]
            others = [pair.second if drone == pair.first else pair.first for pair in pairs]
            if len(pairs) > 1:
                yield (
                    f"{deed.does} less than {self.separation:g} m from drones "
                    f"{in_ranges(sorted(others))}; {deed.instead} some of them elsewhere"
                )
            elif pairs:
                how = f"on the same spot as drone {others[0]}" if pairs[0].is_above else (
                    f"{pairs[0].distance:.2f} m from drone {others[0]}, less than "
                    f"{self.separation:g} m"
                )  # fmt: skip
                yield f"{deed.does} {how}; {deed.instead} one of them elsewhere"


def _found(flight: Flight) -> Iterator[Touchdown]:
    """Yields the touchdowns of a flight."""
    problem, height_map = flight.flown.problem, flight.flown.problem.height_map
    places = list(touchdown_places(flight))
    lands = lands_at(problem.land_cover, np.array([place[:2] for _, _, place in places]))
    ground = height_map.ground if height_map.knows_ground else None
    for (drone, kind, (x, y, z)), land in zip(places, lands, strict=True):
        point = np.array([[x, y, z]])
        surface = float(problem.workspace.surfaces_below(point)[0])
        cell = height_map.cells_below(point)
        above = None if ground is None else surface - float(ground[cell][0])
        yield Touchdown(drone, kind, x, y, z, surface, above, land)


def touchdown_places(flight: Flight) -> Iterator[tuple[int, str, list[float]]]:
    """Yields each drone, the kind of its touchdown, and the position (m) above it."""
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


def _near(found: Iterable[Touchdown], kind: str, rules: CollisionRules) -> Iterator[Near]:
    """Yields the pairs of drones whose vertical flights come too close to each other."""
    alike = [each for each in found if each.kind == kind]
    if not alike:
        return
    x, y, low, high = np.array([(each.x, each.y, each.surface, each.z) for each in alike]).T
    for k, each in enumerate(alike[:-1]):
        after = slice(k + 1, None)
        between = np.maximum(low[k] - high[after], low[after] - high[k]).clip(0.0)
        ways = np.column_stack([x[after] - x[k], y[after] - y[k], between])
        for n in np.flatnonzero(rules.too_near(ways)).tolist():
            other = alike[k + 1 + n].drone
            yield Near(each.drone, other, kind, float(np.linalg.norm(ways[n])))


def _of_ground(found: Iterable[Touchdown]) -> Iterator[str]:
    """Yields messages on drones that take off from or land on roofs, obstacles and water, with
    remedies.
    """

    def key(each: Touchdown) -> tuple[int, str]:
        return KINDS.index(each.kind), each.what

    bad = sorted((each for each in found if each.is_bad), key=key)
    for _, group in groupby(bad, key=key):
        first, *others = alike = list(group)
        deed = _DEEDS[first.kind]
        if not others:
            yield f"drone {first.drone} {deed.does_on} {first.ground}; {deed.instead} it elsewhere"
            continue
        most = max(each.above or 0.0 for each in alike)
        high = f" up to {most:.1f} m above the ground" if first.is_raised else ""
        drones = in_ranges([each.drone for each in alike])
        yield f"drones {drones} {deed.do_on} {first.what}{high}; {deed.instead} them elsewhere"


def _of_others(near: Sequence[Near], separation: float) -> str:
    """Returns a message on drones that are too close to each other at touchdowns of one kind, with
    a remedy.
    """
    nearest = min(near, key=lambda pair: pair.distance)
    deed, two = _DEEDS[nearest.kind], f"{nearest.first} and {nearest.second}"
    spot, least = "on the same spot", f"less than {separation:g} m"
    if len(near) == 1:
        how = spot if nearest.is_above else f"{nearest.distance:.2f} m from each other, {least}"
        return f"drones {two} {deed.do} {how}; {deed.instead} one of them elsewhere"
    drones = in_ranges(sorted({drone for pair in near for drone in pair[:2]}))
    how = spot if nearest.is_above else f"{nearest.distance:.2f} m"
    return (
        f"drones {drones} {deed.do} {least} from each other, {two} {how}; {deed.instead} some of "
        "them elsewhere"
    )
