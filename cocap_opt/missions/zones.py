"""No-fly zones from above, with positions on the Earth, and drones' first and last places."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import shapely

from cocap_opt.data import LARGEST, FloatArray
from cocap_opt.flight.earth import Geodesy
from cocap_opt.flight.flights import Flight
from cocap_opt.flight.touchdowns import touchdown_places
from cocap_opt.scenarios.maps.parts import polygons_of
from cocap_opt.world import Mesh

ZONE = "#d03030"  # the colour of no-fly zones


class Zone(NamedTuple):
    """A part of a no-fly zone.

    Attributes
    ----------
    number : number of the zone in the scene; the parts of one zone share it
    outline : x and y, m; holes are filled, so the outline encloses all of the zone
    corners : [n, 2] longitudes and latitudes, counter-clockwise, the first point not repeated
    heights : lowest and highest point (m; None: unlimited) by datum: `z`, that of the map, and
        `above_sea` or `above_ellipsoid` if that is known
    """

    number: int
    outline: shapely.Polygon
    corners: FloatArray
    heights: dict[str, tuple[float | None, float | None]]

    @property
    def name(self) -> str:
        """The name of the zone, with its heights."""
        return f"no-fly zone {self.number}, {self.told_heights}"

    @property
    def is_cut(self) -> bool:
        """True if longitude 180 cuts the zone, so that its corners are no polygon in degrees."""
        return bool(np.ptp(self.corners[:, 0]) > 180)

    @property
    def told_heights(self) -> str:
        """Its heights in words: above the sea or the ellipsoid, otherwise above the map's zero."""
        name = next((name for name in self.heights if name != "z"), "z")
        low, high = self.heights[name]
        above = "above z = 0 of the map" if name == "z" else name.replace("above_", "above the ")
        if low is None and high is None:
            return "at all heights"
        if low is None or high is None:
            return f"up to {high:.6g} m {above}" if low is None else f"from {low:.6g} m {above} on"
        return f"from {low:.6g} to {high:.6g} m {above}"


class End(NamedTuple):
    """A place where a drone takes off or lands: its home, or below its first or its last place."""

    drone: int
    kind: str  # take-off, landing or home
    longitude: float
    latitude: float

    @property
    def name(self) -> str:
        """The name of the place."""
        return f"{self.kind} of drone {self.drone}"


def zones(flight: Flight, geodesy: Geodesy) -> list[Zone]:
    """Returns the parts of the no-fly zones of a flight's scene."""
    problem, found = flight.flown.problem, []
    earth = problem.earth
    for number, mesh in enumerate(problem.airspace.no_fly):
        ends = float(mesh.vertices[:, 2].min()), float(mesh.vertices[:, 2].max())
        heights = {"z": _limits(ends, 0.0)}
        if earth is not None and earth.heights is not None:
            heights[f"above_{earth.heights}"] = _limits(ends, earth.base)
        for outline in outlines(mesh):
            x, y = np.array(outline.exterior.coords)[:-1].T
            latitude, longitude = geodesy.degrees(x, y)
            corners = np.column_stack([longitude, latitude])
            found.append(Zone(number, outline, corners, heights))
    return found


def crossed(flight: Flight, zone: Zone) -> bool:
    """Returns True if a drone flies above or below a zone."""
    origin = np.array(flight.flown.problem.height_map.origin)
    ways = flight.flown.pieces[:, :, :2].transpose(0, 1, 3, 2) + origin  # [R, N, 6, 2]
    # A polynomial stays in the convex hull of its coefficients.
    hulls = shapely.convex_hull(shapely.multipoints(ways.reshape(-1, *ways.shape[2:])))
    return bool(shapely.intersects(hulls, zone.outline).any())


def ends(flight: Flight, geodesy: Geodesy) -> Iterator[End]:
    """Yields where each drone takes off and lands."""
    found = list(touchdown_places(flight))
    x, y, _ = np.array([place for _, _, place in found]).T
    latitude, longitude = geodesy.degrees(x, y)
    for k, (drone, kind, _) in enumerate(found):
        yield End(drone, kind, float(longitude[k]), float(latitude[k]))


def _limits(ends: tuple[float, float], base: float) -> tuple[float | None, float | None]:
    """Returns the lower and the upper end of a zone (m), those that there are, above a base (m)."""
    low, high = (None if abs(end) >= LARGEST else end + base for end in ends)
    return low, high


def outlines(mesh: Mesh) -> list[shapely.Polygon]:
    """Returns the polygons that a solid covers, seen from above, without their holes."""
    triangles = [shapely.Polygon(corners) for corners in mesh.corners[:, :, :2]]
    whole = shapely.union_all([triangle for triangle in triangles if triangle.area > 0])
    filled = (shapely.Polygon(p.exterior) for p in polygons_of(shapely.simplify(whole, 0.0)))
    return [shapely.orient_polygons(polygon, exterior_cw=False) for polygon in filled]
