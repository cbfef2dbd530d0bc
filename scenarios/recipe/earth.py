"""The table of a recipe that says where on the Earth its coordinates are."""

from typing import Annotated, Literal

import numpy as np
from msgspec import Meta

from cocap_opt.data import ProblemError
from cocap_opt.flight.earth import Geodesy
from cocap_opt.problem import Earth
from cocap_opt.scenarios.recipe.systems import same_system, short_name
from cocap_opt.scenarios.recipe.tables import Coordinate, Table
from cocap_opt.world.workspace import HeightMap

_ABOVE: dict[str, Literal["sea", "ellipsoid"]] = {
    "above-sea": "sea",
    "above-ellipsoid": "ellipsoid",
}
_FARTHEST = 50_000.0  # m; a point farther away is none that a scene's own axes begin in


class EarthTable(Table):
    """The table `earth`: the reference system, and the place of the point x = y = z = 0."""

    crs: str | None = None  # None: that of the map's file
    latitude: Annotated[float, Meta(ge=-90, le=90)] | None = None
    longitude: Annotated[float, Meta(ge=-180, le=180)] | None = None
    height: Coordinate | None = None  # m, of z = 0
    heights: Literal["above-sea", "above-ellipsoid"] | None = None  # what height is above

    def earth(self, of_map: str | None, height_map: HeightMap) -> Earth:
        """Returns the place of the scene.

        Parameters
        ----------
        of_map : reference system that the map's file states

        Raises
        ------
        ProblemError
            If the system is missing, is not the map's, or cannot be converted to latitudes and
            longitudes; or something else is missing or too much.
        """
        if (self.latitude is None) != (self.longitude is None):
            raise ProblemError("latitude, longitude: must be given both, or neither")
        if of_map is not None and self.latitude is not None:
            raise ProblemError(
                "latitude, longitude: must be left out where the map's file says where it is"
            )
        if of_map is not None and self.crs is not None and not same_system(of_map, self.crs):
            raise ProblemError(
                f"crs: must be left out, or that of the map's file, {short_name(of_map)}, not "
                f"{self.crs}"
            )
        away = float(np.hypot(*height_map.centre(0, 0)))
        if self.latitude is not None and away > _FARTHEST:
            raise ProblemError(
                f"latitude, longitude: must be those of the point x = 0, y = 0, which is "
                f"{away / 1000:.0f} km from the map; where x and y are coordinates of the system, "
                "as on most maps, leave both out"
            )
        system = of_map or self.crs
        if system is None:
            raise ProblemError("crs: must be given, for no file of the map states one")
        if (self.height is None) != (self.heights is None):
            raise ProblemError("height, heights: must be given both, or neither")
        earth = Earth(
            crs=system,
            origin=None if self.latitude is None else (self.latitude, self.longitude or 0.0),
            heights=_ABOVE[self.heights] if self.heights else None,
            base=self.height or 0.0,
        )
        if of_map is None:  # else the map's reader has looked at it
            Geodesy(earth, height_map.centre(0, 0))
        return earth
