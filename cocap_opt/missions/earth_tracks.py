"""Flights, walks and footprints on the Earth: common parts of GeoJSON and KML."""

from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from typing import NamedTuple, Self

import numpy as np
import shapely
from matplotlib.colors import to_hex
from shapely.geometry.base import BaseGeometry

from cocap_opt.data import FieldError, FloatArray, ProblemError
from cocap_opt.flight.earth import Geodesy
from cocap_opt.flight.flights import Flight
from cocap_opt.flight.footprint import REACH, Footprints
from cocap_opt.flight.notes import Kind, Note
from cocap_opt.output.heights import over_datum
from cocap_opt.problem import Camera
from cocap_opt.problem.pictures import DRONE_COLOURS
from cocap_opt.scenarios.maps.parts import polygons_of
from cocap_opt.world import HeightMap

EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


class EarthTrack(NamedTuple):
    """The positions of a drone or a person on the Earth at moments [n].

    Attributes
    ----------
    t : [n] time since step 0, s
    longitude, latitude : [n] degrees, WGS 84
    heights : [n] heights by datum, m
    angles : [n] degrees: `yaw` clockwise from true north, 0..360, and of drones `pitch`, that of
        the camera, 0 is level and below is negative
    """

    t: FloatArray
    longitude: FloatArray
    latitude: FloatArray
    heights: dict[str, FloatArray]
    angles: dict[str, FloatArray]

    def parts(self) -> list[Self]:
        """Returns the track cut at the antimeridian, where each part gets its own point."""
        turns = self._turns()
        ends = np.flatnonzero(np.diff(turns))
        if not len(ends):
            return [self]
        along = self.longitude + 360 * turns  # without jumps
        edge = 360 * np.maximum(turns[ends], turns[ends + 1]) - 180
        share = (edge - along[ends]) / (along[ends + 1] - along[ends])
        numbers = np.arange(len(turns), dtype=np.float64)
        parts, first = [], 0.0
        for last in [*(ends + share).tolist(), numbers[-1]]:
            if last == first:
                continue  # it begins or ends there
            inner = numbers[(numbers > first) & (numbers < last)]
            part = self._between(np.array([first, *inner, last]), along)
            middle = (part.longitude.min() + part.longitude.max()) / 2
            turn = np.floor((middle + 180) / 360)
            parts.append(part._replace(longitude=part.longitude - 360 * turn))
            first = last
        return parts

    def _turns(self) -> FloatArray:
        """Returns the number of eastward crossings of the antimeridian so far [n]."""
        return -np.cumsum(np.rint(np.diff(self.longitude, prepend=self.longitude[0]) / 360))

    def _between(self, numbers: FloatArray, along: FloatArray) -> Self:
        """Returns the track at (possibly fractional) numbers of its points."""

        def at(values: FloatArray) -> FloatArray:
            return np.interp(numbers, np.arange(len(values)), values)

        heights = {name: at(values) for name, values in self.heights.items()}
        angles = {name: at(np.unwrap(v, period=360)) % 360 if name == "yaw" else at(v)
                  for name, v in self.angles.items()}  # fmt: skip
        return self._replace(
            t=at(self.t), longitude=at(along), latitude=at(self.latitude), heights=heights,
            angles=angles,
        )  # fmt: skip


class Footprint(NamedTuple):
    """The ground in a drone's image at a step.

    Attributes
    ----------
    rings : longitudes and latitudes [n, 2] of polygons, counter-clockwise, without repeating the
        first point; two if the antimeridian is crossed
    reach : distance from the drone at which the footprint ends, m
    cut : True if the camera sees farther
    """

    drone: int
    step: int
    rings: list[FloatArray]
    reach: float
    cut: bool


def geodesy_of(flight: Flight) -> Geodesy:
    """Returns the conversion from a flight's scene to the Earth.

    Raises
    ------
    ProblemError
        If the scene's position on the Earth is unknown.
    """
    if flight.geodesy is None:
        raise FieldError(
            "earth",
            "must say where the scene is, since the file contains latitudes "
            "and longitudes: use a map with a reference system, such as a GeoTIFF, or add "
            "[earth] to the recipe",
        )
    return flight.geodesy


def drone_tracks(flight: Flight, every: float | None = None) -> list[EarthTrack]:
    """Returns the track of each drone.

    Parameters
    ----------
    every : time between points, s, as in `Flight.columns`
    """
    geodesy, columns = geodesy_of(flight), flight.columns(every)
    yaw = geodesy.compass(columns["x"], columns["y"], np.radians(columns["yaw"]))
    points = np.column_stack([columns[axis] for axis in "xyz"])
    columns |= _over(flight.flown.problem.height_map, points)
    tracks = []
    for i in range(len(flight.flown.pieces)):
        rows = columns["drone"] == i
        tracks.append(EarthTrack(
            columns["t"][rows], columns["longitude"][rows], columns["latitude"][rows],
            {name: values[rows] for name, values in columns.items() if name.startswith("above_")},
            {"yaw": yaw[rows], "pitch": columns["pitch"][rows]},
        ))  # fmt: skip
    return tracks


def walks(flight: Flight) -> list[EarthTrack]:
    """Returns the track of each person's feet, a point per step."""
    geodesy, problem = geodesy_of(flight), flight.flown.problem
    t = _times(flight)
    tracks = []
    for actor in problem.actors:
        x, y, z, yaw = actor.poses[: len(t)].T
        latitude, longitude = geodesy.degrees(x, y)
        heights = _over(problem.height_map, actor.poses[: len(t)])
        if problem.earth is not None and problem.earth.heights is not None:
            heights[f"above_{problem.earth.heights}"] = z + problem.earth.base
        angles = {"yaw": geodesy.compass(x, y, yaw)}
        tracks.append(EarthTrack(t, longitude, latitude, heights, angles))
    return tracks


def _times(flight: Flight) -> FloatArray:
    """Returns the times [T+1] (s) of the steps."""
    return np.arange(flight.flown.problem.horizon + 1, dtype=np.float64) * flight.flown.step


def _over(height_map: HeightMap, points: FloatArray) -> dict[str, FloatArray]:
    """Returns the heights of points [n, 3] above the ground, or above the surface if the map does
    not give the ground.

    The surface of a map is the top of everything on it.
    """
    known = height_map.knows_ground
    name, below = ("above_ground", height_map.ground) if known else (
        "above_surface", height_map.heights
    )  # fmt: skip
    return {name: points[:, 2] - below[height_map.cells_below(points)]}


def footprints_on_earth(flight: Flight) -> Iterator[Footprint]:
    """Yields the footprints of all cameras at all steps; a cone has no image, and therefore no
    footprint.
    """
    geodesy, problem = geodesy_of(flight), flight.flown.problem
    found = flight.flown.at(_times(flight))
    for i, robot in enumerate(problem.robots):
        if not isinstance(robot.camera, Camera):
            continue
        rows = found.drone == i
        pose = found.place[rows], found.yaw[rows], found.pitch[rows]
        prints = Footprints.of(problem.height_map, robot.camera, *pose)
        for t in np.flatnonzero(~np.isnan(prints.corners).any(axis=(1, 2))).tolist():
            latitude, longitude = geodesy.degrees(*prints.corners[t, :, :2].T)
            rings = rings_of(np.column_stack([longitude, latitude]))
            if rings:
                yield Footprint(i, t, rings, float(prints.reach[t]), bool(prints.cut[t]))


def rings_of(corners: FloatArray) -> list[FloatArray]:
    """Returns the polygon of corners [n, 2] (degrees), cut at the antimeridian.

    If walls of the map cause its sides to cross, the result is the convex hull.
    """
    jumps = np.rint((corners[:, 0] - corners[0, 0]) / 360)
    ring = corners - np.column_stack([360 * jumps, np.zeros(len(corners))])
    polygon = shapely.Polygon(ring)
    whole: BaseGeometry = polygon
    if not (polygon.is_valid and polygon.exterior.is_ccw):
        whole = polygon.convex_hull
    rings = []
    for turn in (-1, 0, 1) if jumps.any() else (0,):
        side = shapely.box(360 * turn - 180, -90, 360 * turn + 180, 90)
        part = shapely.orient_polygons(whole & side if jumps.any() else whole, exterior_cw=False)
        rings += [np.array(p.exterior.coords)[:-1] - [360 * turn, 0] for p in polygons_of(part)]
    return rings


class FlightClock(NamedTuple):
    """Dates and times of a flight."""

    start: datetime

    @classmethod
    def of(cls, flight: Flight) -> Self:
        """Returns the clock of a flight; without a start, it begins in 1970.

        Raises
        ------
        ProblemError
            If the flight ends after the year 9999.
        """
        start = (flight.start or EPOCH).astimezone(UTC)
        try:
            start + timedelta(seconds=2 * flight.flown.seconds)
        except OverflowError as error:
            seconds = f"{flight.flown.seconds:.3g} s"
            words = f"the flight of {seconds} must end in a year that has four digits"
            if flight.start is None:
                raise ProblemError(words) from error
            raise FieldError("start", f"must be earlier, as {words}") from error
        return cls(start)

    def text(self, t: float) -> str:
        """Returns the time (UTC, ISO 8601) of a moment t (s since step 0), to the millisecond."""
        at = self.start + timedelta(seconds=round(t, 3))
        return f"{at.replace(tzinfo=None).isoformat(timespec='milliseconds')}Z"


def colour_of(drone: int) -> str:
    """Returns a drone's colour, the same as in all pictures, as #rrggbb."""
    return to_hex(DRONE_COLOURS[drone % len(DRONE_COLOURS)])


def readings(flight: Flight, heights: str) -> Iterator[Note]:
    """Yields notes on how to read tracks, angles, times and footprints.

    Parameters
    ----------
    heights : a sentence on the heights in a file
    """
    yield from (Note(words, Kind.READING) for words in (heights, _ANGLES, *_caveats(flight)))


_ANGLES = (
    "angles in the file are in degrees: yaw is clockwise from true north; pitch is that of the "
    "camera, 0 where it is level and negative where it looks down"
)


def _caveats(flight: Flight) -> Iterator[str]:
    """Yields sentences on the meaning of tracks, times and footprints."""
    if flight.start is None:
        yield "times begin at 1970-01-01T00:00:00Z; use --start to give the start of the flight"
    problem = flight.flown.problem
    if problem.airspace.ceiling is not None:
        yield f"the ceiling is {problem.airspace.ceiling:g} m {over_datum(problem)}"
    cameras = [isinstance(robot.camera, Camera) for robot in flight.flown.problem.robots]
    if any(cameras):
        yield (
            f"footprints are the ground in the images at the steps, up to {REACH:g} times a "
            "drone's height above it, including parts hidden by buildings and people"
        )
    if not all(cameras):
        yield "a cone is not a camera: it has no image, and no footprint"
