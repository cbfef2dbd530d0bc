"""Flights as GeoJSON (.geojson), by RFC 7946, for maps and geographic information systems.

Its positions have a third coordinate only if the scene's heights are above the ellipsoid of WGS 84,
as section 4 defines that coordinate; all heights are properties. Times of the points of a line are
in `coordTimes`, where togeojson used to write them and Leaflet.TimeDimension and folium look for
them; other values of these points are in `coordinateProperties`, as togeojson writes them now. A
property of its own for each list would share its name with a number of the points, and GIS give
all features of a file one type of field: QGIS then reads each height as a list of one. Colours
follow the simplestyle specification.
"""

from collections.abc import Iterator
from typing import Any

import msgspec
import numpy as np

from cocap_opt.data import FloatArray
from cocap_opt.flight.flights import Flight
from cocap_opt.missions.earth_tracks import (
    EarthTrack,
    FlightClock,
    colour_of,
    drone_tracks,
    footprints_on_earth,
    geodesy_of,
    readings,
    rings_of,
    walks,
)
from cocap_opt.missions.export import Export
from cocap_opt.missions.zones import ZONE, ends, zones
from cocap_opt.problem.pictures import PERSON

_DEGREES = 8  # decimals, a millimetre
_METRES = 3
_ANGLE = 3
_THIRD = "above_ellipsoid"

_Feature = dict[str, Any]


def write(flight: Flight, every: float | None) -> Export:
    """Returns tracks, a point per step, footprints and people's walks as a FeatureCollection."""
    writer = _Features(flight)
    features = b",\n".join(map(msgspec.json.encode, writer.features(every)))
    name = msgspec.json.encode(flight.flown.problem.name)
    details = readings(flight, writer.heights())
    notes = (*flight.between_rows(every, "points of the file"), *details)
    head = b'{"type":"FeatureCollection","name":%b,"description":%b,"features":[\n'
    text = head % (name, msgspec.json.encode("; ".join(map(str, notes))))
    return Export({"": text + features + b"\n]}\n"}, notes)


class _Features:
    """Makes features of a flight."""

    def __init__(self, flight: Flight) -> None:
        self._flight = flight
        earth = flight.flown.problem.earth
        geodesy = geodesy_of(flight)
        on_ellipsoid = earth is not None and earth.heights == "ellipsoid"
        self._has_third = on_ellipsoid and geodesy.is_on_wgs_84
        self._clock = FlightClock.of(flight)

    def heights(self) -> str:
        if self._has_third:
            return "third coordinates are metres above the ellipsoid of WGS 84"
        return (
            "positions have no third coordinate, as RFC 7946 defines it as metres above the "
            "ellipsoid of WGS 84; heights are properties, named by their datum"
        )

    def features(self, every: float | None) -> Iterator[_Feature]:
        flight = self._flight
        for i, track in enumerate(drone_tracks(flight, every)):
            yield self._line(track, {"kind": "track", "drone": i, "stroke": colour_of(i)})
        for i, track in enumerate(drone_tracks(flight, flight.flown.step)):
            yield from self._points(track, i)
        yield from self._footprints()
        for j, walk in enumerate(walks(flight)):
            name = flight.flown.problem.person(j)
            yield self._line(walk, {"kind": "walk", "person": j, "name": name, "stroke": PERSON})
        yield from self._zones()
        yield from self._ends()

    def _positions(self, track: EarthTrack) -> list[list[float]]:
        columns = [track.longitude.round(_DEGREES), track.latitude.round(_DEGREES)]
        if self._has_third:
            columns.append(track.heights[_THIRD].round(_METRES))
        positions: list[list[float]] = np.column_stack(columns).tolist()
        return positions

    def _line(self, track: EarthTrack, properties: dict[str, Any]) -> _Feature:
        """Returns a line, or two if it crosses the antimeridian, with a time for each point."""
        parts = track.parts()
        lines = [self._positions(part) for part in parts]
        times = [[self._clock.text(t) for t in part.t.tolist()] for part in parts]
        values = [_rounded({"t": part.t, **part.heights}, _METRES) for part in parts]
        if len(parts) == 1:
            properties |= {"coordTimes": times[0], "coordinateProperties": values[0]}
            return _feature("LineString", lines[0], properties)
        nested = {name: [by_name[name] for by_name in values] for name in values[0]}
        properties |= {"coordTimes": times, "coordinateProperties": nested}
        return _feature("MultiLineString", lines, properties)

    def _points(self, track: EarthTrack, drone: int) -> Iterator[_Feature]:
        values = {**_rounded(track.angles, _ANGLE), **_rounded(track.heights, _METRES)}
        for step, position in enumerate(self._positions(track)):
            t = float(track.t[step])
            properties = {
                "kind": "step", "drone": drone, "step": step, "t": round(t, _METRES),
                "time": self._clock.text(t), "marker-color": colour_of(drone),
            }  # fmt: skip
            at = {name: column[step] for name, column in values.items()}
            yield _feature("Point", position, {**properties, **at})

    def _footprints(self) -> Iterator[_Feature]:
        for found in footprints_on_earth(self._flight):
            t = found.step * self._flight.flown.step
            properties = {
                "kind": "footprint", "drone": found.drone, "step": found.step,
                "t": round(t, _METRES), "time": self._clock.text(t),
                "reach": round(found.reach, _METRES), "cut": found.cut,
                "stroke": colour_of(found.drone), "fill": colour_of(found.drone),
                "fill-opacity": 0.08,
            }  # fmt: skip
            yield _polygons(found.rings, properties)

    def _zones(self) -> Iterator[_Feature]:
        """Yields no-fly zones, with their lowest and highest points as properties."""
        for zone in zones(self._flight, geodesy_of(self._flight)):
            properties = {
                "kind": "no-fly zone", "zone": zone.number, "name": zone.name, "stroke": ZONE,
                "fill": ZONE, "fill-opacity": 0.3,
            }  # fmt: skip
            for name, (low, high) in zone.heights.items():
                properties[f"lowest_{name}"] = None if low is None else round(low, _METRES)
                properties[f"highest_{name}"] = None if high is None else round(high, _METRES)
            yield _polygons(rings_of(zone.corners), properties)

    def _ends(self) -> Iterator[_Feature]:
        """Yields the places where drones take off and land."""
        for end in ends(self._flight, geodesy_of(self._flight)):
            properties = {
                "kind": end.kind, "drone": end.drone, "name": end.name,
                "marker-color": colour_of(end.drone),
            }  # fmt: skip
            at = [round(end.longitude, _DEGREES), round(end.latitude, _DEGREES)]
            yield _feature("Point", at, properties)


def _polygons(rings: list[FloatArray], properties: dict[str, Any]) -> _Feature:
    """Returns a polygon, or two if it crosses the antimeridian."""
    closed = [[_closed(ring)] for ring in rings]
    if len(closed) == 1:
        return _feature("Polygon", closed[0], properties)
    return _feature("MultiPolygon", closed, properties)


def _feature(kind: str, coordinates: object, properties: dict[str, Any]) -> _Feature:
    geometry = {"type": kind, "coordinates": coordinates}
    return {"type": "Feature", "geometry": geometry, "properties": properties}


def _rounded(columns: dict[str, FloatArray], digits: int) -> dict[str, list[float]]:
    """Returns columns with the given number of decimals, without -0."""
    return {name: (values.round(digits) + 0.0).tolist() for name, values in columns.items()}


def _closed(ring: FloatArray) -> list[list[float]]:
    rounded: list[list[float]] = np.concatenate([ring, ring[:1]]).round(_DEGREES).tolist()
    return rounded
