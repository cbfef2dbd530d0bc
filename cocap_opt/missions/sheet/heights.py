"""The heights on a sheet: above the sea or the ellipsoid, if the scene has such a datum, and above
take-off.
"""

from typing import NamedTuple, Self

from cocap_opt.data import FloatArray
from cocap_opt.flight.flights import Flight


class Heights(NamedTuple):
    """The two heights that a crew needs: above a datum, and above a drone's take-off.

    Attributes
    ----------
    datum : vertical datum of the scene; empty if unknown
    base : height of the map's z = 0 above the datum, m
    place : where drones take off: "take-off" or "home"; empty if they are in the air
    surfaces : [R] z of the surface there, m
    """

    datum: str
    base: float
    place: str
    surfaces: FloatArray

    @classmethod
    def of(cls, flight: Flight) -> Self:
        """Returns the heights of a flight."""
        problem = flight.flown.problem
        earth, height_map = problem.earth, problem.height_map
        datum, base = "", 0.0
        if earth is not None and earth.heights is not None:
            datum, base = earth.heights, earth.base
        surfaces = flight.flown.start_surfaces
        place = "" if problem.begins_in_the_air else "take-off"
        for drone, robot in enumerate(problem.robots):
            if robot.home is not None:
                place, surfaces[drone] = "home", height_map.heights[robot.home]
        return cls(datum, base, place, surfaces)

    @property
    def head(self) -> str:
        """The head of a column of `above_datum`."""
        return f"m above\n{self.datum}" if self.datum else "z of\nmap (m)"

    @property
    def takes_off_at_0(self) -> bool:
        """True if the map's z is the height above take-off, so one of the two heights is enough."""
        return bool(self.place) and not self.datum and not self.surfaces.any()

    def heads(self) -> tuple[str, ...]:
        """Returns the heads of the columns of `columns`."""
        over = (f"m above\n{self.place}",) if self.place else ()
        return over if self.takes_off_at_0 else (self.head, *over)

    def columns(self, z: float, drone: int) -> tuple[float, ...]:
        """Returns the heights (m) of a drone's place, given its z on the map."""
        over = (z - float(self.surfaces[drone]),) if self.place else ()
        return over if self.takes_off_at_0 else (self.above_datum(z), *over)

    def above_datum(self, z: float) -> float:
        """Returns the height (m) above the datum, or the map's z if there is no datum."""
        return z + self.base

    def told(self, z: float, drone: int | None = None) -> str:
        """Returns words for the height of a place; for a drone, also above its take-off."""
        words = f"{self.above_datum(z):.1f} m above {self.datum}" if self.datum else f"z {z:.1f} m"
        if drone is None or not self.place:
            return words
        return f"{z - float(self.surfaces[drone]):.1f} m above {self.place}"

    def sentence(self) -> str:
        """Returns a sentence on the datum of the heights."""
        over = {
            "take-off": "; above take-off: above the surface below the drone's first place",
            "home": "; above home: above the surface at the drone's home",
        }.get(self.place, "")
        if self.takes_off_at_0:
            return f"Heights{over[1:].replace(':', ' are', 1)}, which is z = 0 of the map."
        if not self.datum:
            return f"Heights: z of the map, above an unknown datum{over}."
        zero = ""
        if self.base:
            side = "above" if self.base > 0 else "below"
            zero = f" (z = 0 of the map is {abs(self.base):g} m {side} the {self.datum})"
        return f"Heights: above the {self.datum}{zero}{over}."
