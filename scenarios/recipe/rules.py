"""The tables of a recipe that define where drones may not fly although there is no obstacle."""

from collections.abc import Callable

from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from cocap_opt.data import LARGEST, ProblemError
from cocap_opt.problem import SEPARATION, Airspace, CollisionRules
from cocap_opt.scenarios.maps.ground_plans import sound
from cocap_opt.scenarios.maps.terrain import Ground
from cocap_opt.scenarios.maps.walls import extruded
from cocap_opt.scenarios.tables import Coordinate, Point, Size, Table
from cocap_opt.scenarios.text import naming
from cocap_opt.world.workspace import Mesh


class NoFlyTable(Table):
    """One of the tables `no_fly`: a polygon that no drone may enter between two altitudes."""

    polygon: list[Point]
    bottom: Coordinate = -LARGEST  # m, altitude
    top: Coordinate = LARGEST  # m, altitude

    def zone(self, ground_below: Callable[[BaseGeometry], Ground], zero: float) -> Mesh:
        """Returns the zone as a solid.

        Parameters
        ----------
        ground_below : the ground below an area
        zero : altitude (m) of z = 0

        Raises
        ------
        ProblemError
            If the polygon has fewer than three corners or crosses itself, bottom is not below top,
            or top is below the ground everywhere.
        """
        if len(self.polygon) < 3:
            raise ProblemError(f"polygon: must have at least 3 corners, not {len(self.polygon)}")
        area = sound(Polygon(self.polygon), "polygon")
        if not self.bottom < self.top:
            raise ProblemError(f"top: must be above bottom, {self.bottom:g} m, not {self.top:g}")
        top, bottom = (z if abs(z) == LARGEST else z - zero for z in (self.top, self.bottom))
        if top < LARGEST and top <= (ground := ground_below(area)).lowest:
            raise ProblemError(
                f"top: must be above the ground below the zone, which is at "
                f"{ground.lowest + zero:g} m or more, not {self.top:g}: it is an altitude, not a "
                "height above the ground"
            )
        return extruded(area, top, bottom)


class AirspaceTable(Table):
    """The table `airspace`: the ceiling, and the distance that drones keep from people."""

    # m, relative to the same datum as layers; None: there is none
    ceiling: Coordinate | None = None
    people: Size = 0.0  # m, horizontally
    # m above heads at which drones may be closer; None: they may not
    over_people: Size | None = None

    def airspace(
        self,
        zones: tuple[NoFlyTable, ...],
        ground_below: Callable[[BaseGeometry], Ground],
        zero: float,
    ) -> Airspace:
        """Returns the limits of the airspace.

        Parameters
        ----------
        zones : the no-fly zones
        ground_below : the ground below an area
        zero : altitude (m) of z = 0
        """
        solids = []
        for k, table in enumerate(zones):
            with naming(f"no_fly[{k}]"):
                solids.append(table.zone(ground_below, zero))
        if self.over_people is not None and not self.people:
            raise ProblemError("airspace: over_people: must be left out if people is 0")
        return Airspace(
            no_fly=tuple(solids),
            ceiling=self.ceiling,
            people_aside=self.people,
            people_above=self.over_people,
        )


class RulesTable(Table):
    """The collision rules of a scene, whose default is that of flown scenes."""

    vertex: bool = True
    swap: bool = True
    separation: Size | None = None  # m; None: SEPARATION, unless drones may share a cell
    vertical: Size = 0.0  # m

    def rules(self) -> CollisionRules:
        """Returns the collision rules."""
        separation = self.separation
        if separation is None:
            separation = SEPARATION if self.vertex else 0.0
        return CollisionRules(self.vertex, self.swap, separation, self.vertical)
