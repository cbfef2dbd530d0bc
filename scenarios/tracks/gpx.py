"""Reader of GPX 1.0 and 1.1, the format of the paths that GPS receivers record.

Source of the format: topografix.com/GPX/1/0 and 1/1. A track (trk) is one person. A new segment
(trkseg) begins where the receiver had lost its satellites or was off. Times are in UTC. Elevations
(ele) are not read, because they may be those of the ground or of the receiver.

gpxpy is not used, because it ignores names with a prefix and times that it cannot parse.
"""

import math
from collections.abc import Iterable, Iterator
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple
from xml.etree.ElementTree import Element

import numpy as np

from cocap_opt.data import ProblemError
from cocap_opt.scenarios.earth.place import MapProjection
from cocap_opt.scenarios.text import plain_number, require_no_comma, xml_root
from cocap_opt.scenarios.tracks.table import Form, TrackTable, settled
from cocap_opt.scenarios.tracks.times import moment_of, nanoseconds_of, since_first
from cocap_opt.text import unread

_OTHERS = {"rte": "route", "wpt": "waypoint"}  # elements without times, or that are not paths


class _TrackPoint(NamedTuple):
    person: str
    place: str
    segment: int
    nanoseconds: int
    latitude: float
    longitude: float


def read_gpx(path: Path, form: Form, projection: MapProjection) -> TrackTable:
    """Reads all tracks of a file.

    Raises
    ------
    ProblemError
        If the file is not well-formed XML, declares entities or has no track, or if a point has no
        time or place; one line, without the file's name.
    """
    form.require_left_out("GPX", "columns", "delimiter", "time_unit", "fps")
    root = _root(path)
    points = _distinct(_points(root, path.stem))
    if not points:
        raise ProblemError(f"must have a track (trk) of points with times{_instead(root)}")
    _require_one_place_at_a_time(points)
    times, clock = since_first([point.nanoseconds for point in points], is_universal=True)
    latitude, longitude = np.array([(point.latitude, point.longitude) for point in points]).T
    return TrackTable(
        ids=np.array([point.person for point in points]),
        times=times,
        points=projection.metres(latitude, longitude),
        heights=None,
        where=lambda row: points[row].place,
        unit=settled("unit", {"m"}, form.unit),
        rate=None,
        clock=clock,
        segments=np.array([point.segment for point in points]),
    )


def _root(path: Path) -> Element:
    try:
        content = path.read_bytes()
    except OSError as error:
        raise ProblemError(unread(error)) from error
    return xml_root(content, "GPX")


def _points(root: Element, stem: str) -> Iterator[_TrackPoint]:
    tracks = [track for track in _children(root, "trk") if _has_points(track)]
    names = _names(tracks, stem)
    segment = 0
    for k, (track, name) in enumerate(zip(tracks, names, strict=True), start=1):
        for s, part in enumerate(_children(track, "trkseg"), start=1):
            segment += 1
            for p, point in enumerate(_children(part, "trkpt"), start=1):
                place = f"track {k}, segment {s}, point {p}"
                yield _TrackPoint(
                    name, place, segment, _moment(point, place),
                    _degrees(point, "lat", 90, place), _degrees(point, "lon", 180, place),
                )  # fmt: skip


def _distinct(points: Iterable[_TrackPoint]) -> list[_TrackPoint]:
    """Returns the points without repetitions of the same place at the same moment.

    Receivers repeat the last point at the beginning of the next segment.
    """
    found: dict[tuple[object, ...], _TrackPoint] = {}
    for point in points:
        said = point.person, point.nanoseconds, point.latitude, point.longitude
        found.setdefault(said, point)
    return list(found.values())


def _require_one_place_at_a_time(points: Iterable[_TrackPoint]) -> None:
    """Raises a ProblemError if a segment of a person begins before an earlier one has ended."""
    segments: dict[tuple[str, int], list[_TrackPoint]] = {}
    for point in points:
        segments.setdefault((point.person, point.segment), []).append(point)
    for part in segments.values():
        part.sort(key=lambda point: point.nanoseconds)
    in_time = sorted(segments.items(), key=lambda item: (item[0][0], item[1][0].nanoseconds))
    for ((person, _), earlier), ((other, _), later) in pairwise(in_time):
        first, last = later[0], earlier[-1]
        if person == other and first.nanoseconds < last.nanoseconds:
            raise ProblemError(
                f"{first.place}: must not be earlier than {last.place}: two segments of {person} "
                "overlap in time; keep one of them, or put each in a track with its own name"
            )


def _has_points(track: Element) -> bool:
    parts = _children(track, "trkseg")
    return any(next(_children(part, "trkpt"), None) is not None for part in parts)


def _names(tracks: list[Element], stem: str) -> list[str]:
    """Returns the names of people: the names of their tracks if these differ, otherwise the
    file's.
    """
    names = [_text(track, "name") for track in tracks]
    if all(names) and len(set(names)) == len(names):
        return names
    return [stem] if len(tracks) == 1 else [f"{stem} {k}" for k in range(1, len(tracks) + 1)]


def _moment(point: Element, place: str) -> int:
    text = _text(point, "time")
    if not text:
        raise ProblemError(
            f"{place}: must have a time; recorded tracks have times, planned routes do not"
        )
    try:
        return nanoseconds_of(moment_of(text))
    except ValueError:
        raise ProblemError(
            f"{place}, time: must be a date with a time such as 2026-05-01T10:00:00Z, not "
            f"{text[:40]!r}"
        ) from None


def _degrees(point: Element, name: str, most: float, place: str) -> float:
    field = f"{place}, {name}"
    text = point.get(name)
    if text is None:
        raise ProblemError(f"{field}: must be given")
    require_no_comma(text, field)
    try:
        value = plain_number(text)
    except ValueError:
        value = math.nan
    if math.isnan(value):
        raise ProblemError(f"{field}: must be a number of degrees, not {text[:40]!r}")
    if abs(value) > most:
        raise ProblemError(f"{field}: must be within +-{most:g} degrees, not {text[:40]!r}")
    return value


def _instead(root: Element) -> str:
    """Describes what a file without tracks contains."""
    counts = {word: sum(1 for _ in _children(root, name)) for name, word in _OTHERS.items()}
    found = [f"{count} {word}{'s' * (count > 1)}" for word, count in counts.items() if count]
    if next(_children(root, "trk"), None) is not None:
        found.append("tracks without points")
    return f", but has only {' and '.join(found)}" if found else ", but has none"


def _children(element: Element, name: str) -> Iterator[Element]:
    """Yields the child elements with a name, in any namespace."""
    return (child for child in element if str(child.tag).rpartition("}")[2] == name)


def _text(element: Element, name: str) -> str:
    child = next(_children(element, name), None)
    return "" if child is None else " ".join((child.text or "").split())
