"""Latitudes and longitudes (WGS 84) of points of a scene, computed by pyproj, which only this
module imports.

Operations that pyproj only guesses (ballpark transformations), or that are not the best because a
grid is not installed, are rejected. Heights are not converted.
"""

import math
from functools import cached_property
from typing import Any

import numpy as np

from cocap_opt.data import FieldError, FloatArray
from cocap_opt.problem import Earth
from cocap_opt.text import pair

WGS_84 = "EPSG:4326"
# Largest relative difference between lengths in a projection and on the ground. Survey projections
# differ by 0.4 % within their area (UTM 0.04 to 0.1 %, Lambert-93 0.1 to 0.35 %), continental ones
# by up to 3.5 % (EPSG:3034 at 50 and at 70 degrees); all by `Proj.get_factors` of pyproj 3.7.
STRETCH = 0.02
_AHEAD = 10.0  # m; distance of the auxiliary point that gives a direction
_SHOWN = 60  # characters of a system's name in a message
_AROUND = 0.01  # degrees; area around a point for which pyproj chooses an operation

Place = tuple[float, float]  # latitude and longitude, degrees


class Geodesy:
    """Converts a scene's coordinates to positions on the Earth.

    Parameters
    ----------
    earth : the place of the scene
    point : x and y of a point of the scene in m; the conversion is chosen for its surroundings

    Raises
    ------
    ProblemError
        If pyproj or a grid that it needs is not installed, or if the system is unknown, or does not
        have true metres and axes to the east and north.
    """

    def __init__(self, earth: Earth, point: tuple[float, float]) -> None:
        self._earth = earth
        self._pyproj = _pyproj()
        self._crs = _system(earth.crs)
        self._to_earth = self._best(self._near(point))
        self._corner = (0.0, 0.0)
        if earth.origin is not None:
            self._corner = self._from_earth(earth.origin)
        x, y = (np.array([value]) for value in point)
        self._require_true(*(float(value[0]) for value in self.degrees(x, y)))

    @staticmethod
    def is_meant_for(crs: str, place: Place) -> bool | None:
        """Returns True if a place is in the area of use of a reference system.

        Returns None if the system names no area.

        Raises
        ------
        ProblemError
            If the system is not accepted.
        """
        return _holds(_system(crs).area_of_use, place)

    def degrees(self, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Returns latitudes and longitudes [n] (degrees) of points [n] of the scene (m)."""
        east, north = x + self._corner[0], y + self._corner[1]
        longitude, latitude = self._to_earth.transform(east, north)
        self._require_defined(longitude, latitude, (east[0], north[0]))
        return np.asarray(latitude), np.asarray(longitude)

    def metres(self, latitude: FloatArray, longitude: FloatArray) -> FloatArray:
        """Returns the points [n, 2] (m) of the scene at latitudes and longitudes [n] (degrees).

        They are not finite if the system is not defined there.
        """
        east, north = self._to_earth.transform(
            longitude, latitude, direction=self._pyproj.enums.TransformDirection.INVERSE
        )
        points: FloatArray = np.column_stack([east, north]) - np.array(self._corner)
        return points

    def compass(self, x: FloatArray, y: FloatArray, yaw: FloatArray) -> FloatArray:
        """Returns directions [n] in degrees from true north, clockwise, 0..360.

        They are relative to true north, including the convergence of the grid.

        Parameters
        ----------
        x, y : [n] m, points of the scene
        yaw : [n] angle from +x, counter-clockwise, rad
        """
        latitude, longitude = self.degrees(x, y)
        aside = self.degrees(x + _AHEAD * np.cos(yaw), y + _AHEAD * np.sin(yaw))
        azimuth, _, _ = self._ellipsoid.inv(longitude, latitude, aside[1], aside[0])
        return np.asarray(azimuth) % 360.0

    def convergence(self, x: float, y: float) -> float:
        """Returns the direction of +y at a point (m), in degrees clockwise from true north."""
        here, there = np.array([x]), np.array([y])
        turned = float(self.compass(here, there, np.array([math.pi / 2]))[0])
        return (turned + 180.0) % 360.0 - 180.0

    def lengths(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Returns the distances [n-1] (m) on the ground between consecutive points [n] of the
        scene.
        """
        latitude, longitude = self.degrees(x, y)
        return np.asarray(self._ellipsoid.line_lengths(longitude, latitude))

    @property
    def is_on_wgs_84(self) -> bool:
        """True if the system's ellipsoid is that of WGS 84, to a millimetre (GRS 80 is)."""
        ellipsoid, other = self._crs.ellipsoid, self._ellipsoid
        sizes = ellipsoid.semi_major_metre - other.a, ellipsoid.semi_minor_metre - other.b
        return all(abs(size) < 1e-3 for size in sizes)

    @cached_property
    def name(self) -> str:
        """Name of the reference system, with its code if it has one."""
        code = self._crs.to_authority()
        return f"{self._crs.name} ({':'.join(code)})" if code else str(self._crs.name)

    @property
    def axes(self) -> str:
        """The meaning of x and y in the scene, in words."""
        if self._earth.origin is None:
            return f"x and y in {self.name}"
        latitude, longitude = self._earth.origin
        return (
            f"x and y (m) from latitude {latitude:.9g}, longitude {longitude:.9g}, along the axes "
            f"of {self.name}"
        )

    @property
    def accuracy(self) -> float | None:
        """Possible error in m of latitudes and longitudes; None if unknown."""
        metres = float(self._to_earth.accuracy)
        return metres if metres >= 0 else None

    @cached_property
    def _ellipsoid(self) -> Any:
        """The ellipsoid of WGS 84."""
        return self._pyproj.Geod(ellps="WGS84")

    def _near(self, point: tuple[float, float]) -> Place:
        """Returns the approximate latitude and longitude of a point, by the system's own datum."""
        if self._earth.origin is not None:
            return self._earth.origin
        geodetic = self._crs.geodetic_crs
        transformer = self._pyproj.Transformer.from_crs(
            self._crs, geodetic, always_xy=True, allow_ballpark=False
        )
        longitude, latitude = transformer.transform(*point)
        self._require_defined(longitude, latitude, point)
        degrees = math.degrees(geodetic.axis_info[0].unit_conversion_factor)  # some are in grads
        return float(latitude) * degrees, float(longitude) * degrees + _meridian(self._crs)

    def _require_defined(self, longitude: Any, latitude: Any, at: tuple[float, float]) -> None:
        """Raises an error if the system is not defined at a point of the scene, given in its
        coordinates `at` (m).
        """
        if not (np.isfinite(longitude).all() and np.isfinite(latitude).all()):
            raise FieldError(
                "crs",
                f"must be a system that is defined where the scene is, at "
                f"{pair(*at[:2])}, not {self.name}",
            )

    def _best(self, near: Place) -> Any:
        """Returns the best operation to WGS 84 near a latitude and longitude."""
        import warnings

        latitude, longitude = near
        around = self._pyproj.aoi.AreaOfInterest(
            longitude - _AROUND, latitude - _AROUND, longitude + _AROUND, latitude + _AROUND
        )
        with warnings.catch_warnings():
            # pyproj warns if the best operation is unavailable, which is checked below
            warnings.simplefilter("ignore")
            group = self._pyproj.transformer.TransformerGroup(
                self._crs, WGS_84, always_xy=True, allow_ballpark=False, area_of_interest=around
            )
        if not group.transformers or not group.best_available:
            raise FieldError(
                "crs",
                f"must be a system that can be converted to WGS 84, but {self.name} "
                f"{self._obstacle(near, group.unavailable_operations)}",
            )
        return group.transformers[0]

    def _obstacle(self, near: Place, unavailable: list[Any]) -> str:
        """Returns the reason why there is no good operation near a latitude and longitude."""
        latitude, longitude = near
        if _holds(self._crs.area_of_use, near) is False:
            return f"is for another place than latitude {latitude:.5g}, longitude {longitude:.5g}"
        grids = sorted(grid.short_name for operation in unavailable[:1] for grid in operation.grids)
        if grids:
            return f"needs {' and '.join(grids)}, not installed here; `pyproj sync` downloads it"
        return "has a datum whose relation to WGS 84 is unknown"

    def _from_earth(self, place: Place) -> tuple[float, float]:
        """Returns the coordinates (m) in the system of a latitude and longitude."""
        east, north = self.metres(*np.array(place)[:, None])[0].tolist()
        if not (np.isfinite(east) and np.isfinite(north)):
            raise FieldError(
                "origin",
                f"must lie where {self.name} is defined, not at latitude {place[0]:g} and "
                f"longitude {place[1]:g}",
            )
        return east, north

    def _require_true(self, latitude: float, longitude: float) -> None:
        """Rejects a projection whose metres are not true metres on the ground, such as web
        Mercator.
        """
        scales = scales_of(self._crs, latitude, longitude)
        if not all(abs(scale - 1) <= STRETCH for scale in scales):  # True for nan, too
            zone = (32700 if latitude < 0 else 32600) + min(int((longitude + 180) // 6) + 1, 60)
            raise FieldError(
                "crs",
                f"must have true metres, but those of {self.name} are {1 / max(scales):.3g} m "
                f"long at latitude {latitude:.1f}; EPSG:{zone} has true ones there",
            )


def scales_of(crs: Any, latitude: float, longitude: float) -> tuple[float, float]:
    """Returns the lengths in a projection of a metre on the ground, to the north and to the east.

    Parameters
    ----------
    crs : projected reference system of pyproj
    latitude, longitude : degrees, from Greenwich
    """
    # `get_factors` counts from the system's own meridian (pyproj 3.7).
    factors = _pyproj().Proj(crs).get_factors(longitude - _meridian(crs), latitude)
    return factors.meridional_scale, factors.parallel_scale


def _meridian(crs: Any) -> float:
    """Returns the longitude (degrees) from which a system counts, such as that of Paris."""
    meridian = crs.geodetic_crs.prime_meridian
    return math.degrees(meridian.longitude * meridian.unit_conversion_factor)


def _holds(area: Any, place: Place) -> bool | None:
    """Returns True if a place is in an area of pyproj, which may cross longitude 180."""
    if area is None:
        return None
    latitude, longitude = place
    east_of, west_of = area.west <= longitude, longitude <= area.east
    within = east_of and west_of if area.west <= area.east else east_of or west_of
    return bool(within and area.south <= latitude <= area.north)


def _system(text: str) -> Any:
    """Returns the projection, without the vertical part of a compound system."""
    pyproj = _pyproj()
    try:
        crs = pyproj.CRS.from_user_input(text)
    except pyproj.exceptions.CRSError as error:
        shown = text if len(text) <= _SHOWN else f"{text[:_SHOWN]}.."
        raise FieldError(
            "crs",
            f"must be a known reference system, such as EPSG:25830, not {shown!r}",
        ) from error
    crs = crs.sub_crs_list[0] if crs.is_compound else crs.to_2d()
    units = {axis.unit_name for axis in crs.axis_info}
    if crs.is_geographic or not crs.is_projected:
        raise FieldError("crs", f"must be a projection in metres, not {crs.name}")
    if units != {"metre"}:
        raise FieldError("crs", f"must be in metres, not {', '.join(sorted(units))}: {crs.name}")
    ways = {axis.direction for axis in crs.axis_info}
    if ways != {"east", "north"}:
        raise FieldError(
            "crs",
            f"must have axes to the east and to the north, not {', '.join(sorted(ways))}: "
            f"{crs.name}",
        )
    return crs


def _pyproj() -> Any:
    """Returns pyproj with the modules that are used."""
    try:
        import pyproj
        import pyproj.aoi
        import pyproj.enums
        import pyproj.exceptions
        import pyproj.transformer
    except ImportError as error:
        raise FieldError(
            "crs", "places on the Earth need pyproj: pip install 'cocap-opt[earth]'"
        ) from error
    return pyproj


def told_accuracy(metres: float | None) -> str:
    """Describes the accuracy of latitudes and longitudes; None: unknown."""
    if metres is None:
        return "conversion to WGS 84 of unknown accuracy"
    return f"conversion to WGS 84 {f'accurate to {metres:g} m' if metres else 'exact'}"
