"""Flights as KML 2.2 (.kml) with Google's extension `gx:Track`, for Google Earth and others.

KML supports heights above the sea ("absolute") and above the viewer's own ground
("relativeToGround"), but not above the ellipsoid. Heights are absolute only if the scene's heights
are above the sea. The angles of a track are those of a drone's body, which is level; the camera's
pitch is in the track's extended data.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import NamedTuple
from xml.etree import ElementTree

import numpy as np

from cocap_opt.data import FloatArray
from cocap_opt.flight.flights import Flight
from cocap_opt.missions.earth_tracks import (
    EarthTrack,
    FlightClock,
    Footprint,
    colour_of,
    drone_tracks,
    footprints_on_earth,
    geodesy_of,
    readings,
    rings_of,
    walks,
)
from cocap_opt.missions.export import Export
from cocap_opt.missions.zones import ZONE, End, Zone, ends, zones
from cocap_opt.problem.pictures import PERSON

_KML = "http://www.opengis.net/kml/2.2"
_GX = "http://www.google.com/kml/ext/2.2"
_SCHEMA = "drone"
_METRES_OF_A_DEGREE = 111_000.0
_RANGE, _NEAREST = 3.0, 50.0  # distance of the first view: multiple of the tracks' size, and m

ElementTree.register_namespace("", _KML)
ElementTree.register_namespace("gx", _GX)


def write(flight: Flight, every: float | None) -> Export:
    """Returns the tracks of drones and people and the cameras' footprints, with their times."""
    drones, people = drone_tracks(flight, every), walks(flight)
    mode = _Heights.of(drones[0])
    details = readings(flight, mode.words)
    notes = (*flight.between_rows(every, "points of the file"), *details)
    writer = _Placemarks(FlightClock.of(flight), mode, flight.flown.step)
    root = ElementTree.Element(f"{{{_KML}}}kml")
    document = _add(root, "Document")
    _add(document, "name", flight.flown.problem.name)
    _add(document, "description", "; ".join(map(str, notes)))
    writer.add_view(document, drones)
    _add_styles(document, len(drones))
    with _folder(document, "drones") as folder:
        for i, track in enumerate(drones):
            writer.add_track(folder, f"drone {i}", f"#drone{i}", track)
    with _folder(document, "people") as folder:
        for j, walk in enumerate(people):
            writer.add_track(folder, flight.flown.problem.person(j), "#person", walk)
    with _folder(document, "footprints") as folder:
        for found in footprints_on_earth(flight):
            writer.add_footprint(folder, found)
    with _folder(document, "no-fly zones") as folder:
        for zone in zones(flight, geodesy_of(flight)):
            _add_zone(folder, zone)
    with _folder(document, "take-off and landing") as folder:
        for end in ends(flight, geodesy_of(flight)):
            _add_end(folder, end)
    ElementTree.indent(root, "")
    text = ElementTree.tostring(root, encoding="UTF-8", xml_declaration=True)
    return Export({"": text + b"\n"}, notes)


class _Heights(NamedTuple):
    """The heights that serve as altitudes in a file."""

    name: str  # name of these heights
    mode: str
    words: str

    @classmethod
    def of(cls, track: EarthTrack) -> "_Heights":
        if "above_sea" in track.heights:
            return cls("above_sea", "absolute", "altitudes are above the sea")
        if "above_ground" in track.heights:
            words = "altitudes are above the ground, which is the viewer's and not the map's"
            return cls("above_ground", "relativeToGround", words)
        words = (
            "altitudes are above the map's surface, which viewers take for the ground; the map "
            "does not separate its ground from what is on it"
        )
        return cls("above_surface", "relativeToGround", words)


class _Placemarks(NamedTuple):
    """Adds the parts of a flight to a document."""

    clock: FlightClock
    heights: _Heights
    step: float

    def add_view(self, document: ElementTree.Element, drones: list[EarthTrack]) -> None:
        """Adds the initial view: from above all drones, at the times of their flights."""
        first = drones[0]
        longitude = np.concatenate([track.longitude for track in drones])
        east = (longitude - first.longitude[0] + 180) % 360 - 180
        north = np.concatenate([track.latitude for track in drones])
        middle = first.longitude[0] + (east.min() + east.max()) / 2
        size = max(float(np.ptp(east)), float(np.ptp(north))) * _METRES_OF_A_DEGREE
        view = _add(document, "LookAt")
        self._add_span(_add(view, "TimeSpan", space=_GX), 0.0, float(first.t[-1]))
        _add(view, "longitude", f"{(middle + 180) % 360 - 180:.8f}")
        _add(view, "latitude", f"{(north.min() + north.max()) / 2:.8f}")
        _add(view, "tilt", "45")
        _add(view, "range", f"{_RANGE * size + _NEAREST:.1f}")

    def add_track(
        self, folder: ElementTree.Element, name: str, style: str, track: EarthTrack
    ) -> None:
        """Adds a drone's or a person's track."""
        place = _add(folder, "Placemark")
        _add(place, "name", name)
        _add(place, "styleUrl", style)
        line = _add(place, "Track", space=_GX)
        _add(line, "altitudeMode", self.heights.mode)
        for t in track.t.tolist():
            _add(line, "when", self.clock.text(t))
        height = track.heights[self.heights.name]
        for row in zip(track.longitude.tolist(), track.latitude.tolist(), height.tolist(),
                       strict=True):  # fmt: skip
            _add(line, "coord", "{:.8f} {:.8f} {:.3f}".format(*row), space=_GX)
        for yaw in track.angles["yaw"].tolist():
            _add(line, "angles", f"{yaw:.3f} 0 0", space=_GX)
        if "pitch" in track.angles:
            data = _add(_add(line, "ExtendedData"), "SchemaData", schemaUrl=f"#{_SCHEMA}")
            pitch = _add(data, "SimpleArrayData", space=_GX, name="pitch")
            for value in track.angles["pitch"].tolist():
                _add(pitch, "value", f"{value:.3f}", space=_GX)

    def add_footprint(self, folder: ElementTree.Element, found: Footprint) -> None:
        """Adds the ground in a drone's image, shown until the next step."""
        t = found.step * self.step
        place = _add(folder, "Placemark")
        _add(place, "name", f"drone {found.drone}, step {found.step}")
        self._add_span(_add(place, "TimeSpan"), t, t + self.step)
        _add(place, "styleUrl", f"#footprint{found.drone}")
        _add_polygons(place, found.rings)

    def _add_span(self, span: ElementTree.Element, first: float, last: float) -> None:
        _add(span, "begin", self.clock.text(first))
        _add(span, "end", self.clock.text(last))


def _add(
    parent: ElementTree.Element, tag: str, text: str | None = None, space: str = _KML,
    **attributes: str,
) -> ElementTree.Element:  # fmt: skip
    element = ElementTree.SubElement(parent, f"{{{space}}}{tag}", attributes)
    element.text = text
    return element


def _add_polygons(
    place: ElementTree.Element, rings: list[FloatArray], top: float | None = None
) -> None:
    """Adds polygons on the ground, or from a height above the sea (m) down to the ground."""
    into = _add(place, "MultiGeometry") if len(rings) > 1 else place
    for ring in rings:
        polygon = _add(into, "Polygon")
        _add(polygon, "tessellate" if top is None else "extrude", "1")
        _add(polygon, "altitudeMode", "clampToGround" if top is None else "absolute")
        outer = _add(_add(polygon, "outerBoundaryIs"), "LinearRing")
        height = "" if top is None else f",{top:.3f}"
        _add(outer, "coordinates", " ".join(f"{corner}{height}" for corner in _corners(ring)))


def _add_zone(folder: ElementTree.Element, zone: Zone) -> None:
    """Adds a no-fly zone; a zone in the air is drawn down to the ground, and its name gives its
    heights.
    """
    place = _add(folder, "Placemark")
    _add(place, "name", zone.name)
    _add(place, "styleUrl", "#zone")
    _, top = zone.heights.get("above_sea", (None, None))
    _add_polygons(place, rings_of(zone.corners), top)


def _add_end(folder: ElementTree.Element, end: End) -> None:
    """Adds a place where a drone takes off or lands."""
    place = _add(folder, "Placemark")
    _add(place, "name", end.name)
    _add(place, "styleUrl", f"#drone{end.drone}")
    point = _add(place, "Point")
    _add(point, "altitudeMode", "clampToGround")
    _add(point, "coordinates", f"{end.longitude:.8f},{end.latitude:.8f}")


@contextmanager
def _folder(document: ElementTree.Element, name: str) -> Iterator[ElementTree.Element]:
    """Yields a folder to be filled; an empty one is left out, as GIS make a layer of each."""
    folder = ElementTree.Element(f"{{{_KML}}}Folder")
    _add(folder, "name", name)
    yield folder
    if len(folder) > 1:
        document.append(folder)


def _add_styles(document: ElementTree.Element, drones: int) -> None:
    """Adds the colours of drones, footprints and people, and the names of the extended data."""
    colours = {f"drone{i}": colour_of(i) for i in range(drones)} | {"person": PERSON}
    for name, colour in colours.items():
        style = _add(document, "Style", id=name)
        _add(_add(style, "IconStyle"), "color", _colour(colour, 255))
        line = _add(style, "LineStyle")
        _add(line, "color", _colour(colour, 255))
        _add(line, "width", "3")
    for i in range(drones):
        style = _add(document, "Style", id=f"footprint{i}")
        _add(_add(style, "LineStyle"), "color", _colour(colour_of(i), 200))
        _add(_add(style, "PolyStyle"), "color", _colour(colour_of(i), 60))
    style = _add(document, "Style", id="zone")
    _add(_add(style, "LineStyle"), "color", _colour(ZONE, 255))
    _add(_add(style, "PolyStyle"), "color", _colour(ZONE, 90))
    schema = _add(document, "Schema", id=_SCHEMA, name="drone")
    field = _add(schema, "SimpleArrayField", space=_GX, name="pitch", type="float")
    _add(field, "displayName", "pitch of the camera (degrees)")


def _colour(rgb: str, opacity: int) -> str:
    """Returns #rrggbb and an opacity 0..255 in KML's form, aabbggrr."""
    return f"{opacity:02x}{rgb[5:7]}{rgb[3:5]}{rgb[1:3]}"


def _corners(ring: FloatArray) -> Iterator[str]:
    """Yields longitudes and latitudes of a ring, repeating the first at the end."""
    for longitude, latitude in [*ring.tolist(), ring[0].tolist()]:
        yield f"{longitude:.8f},{latitude:.8f}"
