"""The place of a recipe's coordinates on the Earth, and the conversion of files in degrees."""

import logging
import math
from typing import Annotated, Literal, NamedTuple

import numpy as np
from msgspec import Meta

from cocap_opt.data import FieldError, FloatArray, ProblemError
from cocap_opt.flight.earth import Geodesy, Place
from cocap_opt.problem import Earth
from cocap_opt.scenarios.earth import has_heights, same_system, short_name, utm
from cocap_opt.scenarios.earth.units import has_ellipsoid_heights
from cocap_opt.scenarios.tables import Coordinate, Table
from cocap_opt.scenarios.text import rectangle
from cocap_opt.world.workspace import HeightMap

_ABOVE: dict[str, Literal["sea", "ellipsoid"]] = {
    "above-sea": "sea",
    "above-ellipsoid": "ellipsoid",
}
FARTHEST = 50_000.0  # m; points farther away cannot belong to a scene with its own axes
_OWN = "in [earth] latitude and longitude are those of the point x = 0, y = 0"
_EQUATOR = 0.5  # degrees from the equator, where maps are rare and wrong coordinates are common

log = logging.getLogger(__name__)


class MapProjection(NamedTuple):
    """Converts latitudes and longitudes of files to coordinates of the scene.

    Attributes
    ----------
    earth : the place of the scene; None if unspecified
    point : m, a point of the map
    """

    earth: Earth | None = None
    point: Place = (0.0, 0.0)

    def metres(self, latitude: FloatArray, longitude: FloatArray) -> FloatArray:
        """Returns the points [n, 2] (m) at latitudes and longitudes [n] (degrees, WGS 84).

        Raises
        ------
        ProblemError
            If the place of the scene is unknown, or if the points are far from it.
        """
        if self.earth is None:
            raise ProblemError(_wanted_place(latitude, longitude))
        geodesy = self._geodesy
        points = geodesy.metres(latitude, longitude)
        away = np.hypot(*(points - np.array(self.point)).T)
        if not (away <= FARTHEST).all():  # True for nan, too
            k = int(np.argmax(~(away <= FARTHEST)))
            there, here = (latitude[k], longitude[k]), _degrees(geodesy, self.point)
            swapped = geodesy.metres(longitude[[k]], latitude[[k]])[0] - np.array(self.point)
            likely = math.hypot(*swapped.tolist()) <= FARTHEST
            raise ProblemError(
                f"latitude, longitude: {'are they swapped? They ' if likely else ''}must be near "
                f"the map, which [earth] places at ({here[0]:.5f}, {here[1]:.5f}), not at "
                f"({there[0]:.5f}, {there[1]:.5f})" + ("" if self.earth.origin else f"; {_OWN}")
            )
        return points

    def plane(self, latitude: FloatArray, longitude: FloatArray) -> FloatArray:
        """Returns points [n, 2] (m) like `metres`, but for any place; not finite if undefined.

        The scene's place on the Earth must be known.
        """
        return self._geodesy.metres(latitude, longitude)

    @property
    def place(self) -> Place:
        """Latitude and longitude (degrees) of the point of the map."""
        return _degrees(self._geodesy, self.point)

    @property
    def _geodesy(self) -> Geodesy:
        if self.earth is None:
            raise ProblemError("earth: must be known")
        return Geodesy(self.earth, self.point)


NOWHERE = MapProjection()


def _wanted_place(latitude: FloatArray, longitude: FloatArray) -> str:
    """Returns a message with the table that a recipe needs for points in degrees."""
    south, west = (math.floor(1e4 * float(values.min())) / 1e4 for values in (latitude, longitude))
    west = (west + 180) % 360 - 180
    return (
        "latitude, longitude: need [earth] in the recipe to be converted to metres: set crs = "
        f'"{utm(west, south)}", latitude = {south:.4f} and longitude = {west:.4f} there, the place '
        "of x = 0, y = 0; or write coordinates of a projection, in metres"
    )


def _degrees(geodesy: Geodesy, point: Place) -> Place:
    """Returns the latitude and longitude (degrees) of a point (m) of the scene."""
    latitude, longitude = geodesy.degrees(*np.array(point)[:, None])
    return float(latitude[0]), float(longitude[0])


class EarthTable(Table):
    """The table `earth`: the reference system, and the place of the point x = y = z = 0."""

    crs: str | None = None  # None: the system of the map's file
    latitude: Annotated[float, Meta(ge=-90, le=90)] | None = None
    longitude: Annotated[float, Meta(ge=-180, le=180)] | None = None
    height: Coordinate | None = None  # m, of z = 0
    heights: Literal["above-sea", "above-ellipsoid"] | None = None  # vertical datum of height

    def earth(self, of_map: str | None, height_map: HeightMap) -> Earth:
        """Returns the place of the scene.

        Parameters
        ----------
        of_map : reference system stated in the map's file

        Raises
        ------
        ProblemError
            If the system is missing, is not the map's, or cannot be converted to latitudes and
            longitudes; or if another field is missing or superfluous.
        """
        if (self.latitude is None) != (self.longitude is None):
            raise ProblemError("latitude, longitude: both must be given, or neither")
        if of_map is not None and self.latitude is not None:
            raise ProblemError(
                "latitude, longitude: must be left out, as the map's file states its own location"
            )
        if of_map is not None and self.crs is not None and not same_system(of_map, self.crs):
            raise ProblemError(
                f"crs: must be left out, or the same as in the map's file, {short_name(of_map)}, "
                f"not {self.crs}"
            )
        away = float(np.hypot(*height_map.centre(0, 0)))
        if self.latitude is not None and away > FARTHEST:
            raise ProblemError(
                f"latitude, longitude: must be those of the point x = 0, y = 0, but that point is "
                f"{away / 1000:.0f} km from the map; if x and y are coordinates of the reference "
                "system, as in most maps, leave both out"
            )
        system = of_map or self.crs
        if system is None:
            raise ProblemError(f"crs: must be given, {self._what_crs_is()}")
        if (self.height is None) != (self.heights is None):
            raise ProblemError("height, heights: both must be given, or neither")
        if self.heights == "above-ellipsoid" and has_heights(system):
            raise ProblemError(
                'heights: must be "above-sea", as the reference system says by its own system of '
                f"heights: {short_name(system)}"
            )
        if self.heights == "above-sea" and has_ellipsoid_heights(system):
            raise ProblemError(
                'heights: must be "above-ellipsoid", as the reference system says: '
                f"{short_name(system)}"
            )
        earth = Earth(
            crs=system,
            origin=None if self.latitude is None else (self.latitude, self.longitude or 0.0),
            heights=_ABOVE[self.heights] if self.heights else None,
            base=self.height or 0.0,
        )
        if of_map is None:  # otherwise the map's reader has checked it
            _require_system(earth, height_map.centre(0, 0))
        return earth

    def _what_crs_is(self) -> str:
        """Explains `crs` to users who only have a latitude and a longitude."""
        example = "EPSG:25830"
        if self.latitude is not None and self.longitude is not None:
            example = f"{utm(self.longitude, self.latitude)} here"
        return (
            "as no file of the map states one: name the projection in which x points east and y "
            f"north, e.g. {example}"
        )


def _require_system(earth: Earth, corner: Place) -> None:
    """Rejects a system without true metres at a corner (m) of the map."""
    if earth.origin is not None and _are_swapped(earth.crs, earth.origin):
        latitude, longitude = earth.origin
        raise ProblemError(
            f"latitude, longitude: are they swapped? {short_name(earth.crs)} covers latitude "
            f"{longitude:g}, longitude {latitude:g}, but not latitude {latitude:g}, longitude "
            f"{longitude:g}"
        )
    Geodesy(earth, corner)


def of_map_file(crs: str, corner: Place) -> Earth:
    """Returns the place of a map in a system that its file states; a warning says if flights cannot
    be written in that system.
    """
    earth = Earth(crs=crs)
    try:
        Geodesy(earth, corner)
    except FieldError as error:
        if error.allowed.startswith("must"):  # otherwise pyproj is missing
            log.warning(
                "map: flights cannot be written in its reference system, which %s; convert all "
                "maps, e.g. with gdalwarp -t_srs EPSG:326ZZ, where ZZ is the UTM zone",
                error.allowed,
            )
    return earth


def require_likely(earth: Earth, height_map: HeightMap) -> None:
    """Rejects a place where a map cannot be, and warns of one where maps are rare.

    Maps whose x and y are not coordinates of the system appear at its origin.

    Raises
    ------
    ProblemError
        If the place is outside the system's area of use; the message is one line.
    """
    corner = height_map.centre(0, 0)
    place = _degrees(Geodesy(earth, corner), corner)
    meant = Geodesy.is_meant_for(earth.crs, place)
    if earth.origin is not None or meant is None:
        return
    where = (
        f"{short_name(earth.crs)} places the map, {rectangle(*height_map.ends)}, at latitude "
        f"{place[0]:.4f}, longitude {place[1]:.4f}"
    )
    near = np.abs(corner) < FARTHEST
    if near.any() and not meant:
        raise ProblemError(
            f"latitude, longitude: must be given, unless origin of [map] is the map's corner in "
            f"that system; without them, {where}, outside its area of use; {_OWN}"
        )
    if near.all() or abs(place[0]) < _EQUATOR:
        log.warning("earth: %s: is that right?", where)


def _are_swapped(crs: str, place: Place) -> bool:
    """Returns True if a place is in a system's area of use only with latitude and longitude
    swapped.
    """
    swapped = place[1], place[0]
    return Geodesy.is_meant_for(crs, place) is False and Geodesy.is_meant_for(crs, swapped) is True
