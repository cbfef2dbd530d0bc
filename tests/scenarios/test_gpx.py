"""GPX, as receivers of GPS record the ways of people, and several files on one clock."""

import logging
import math
import re
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("pyproj")

from cocap_opt.data import FloatArray, ProblemError
from cocap_opt.flight.earth import Geodesy
from cocap_opt.problem import Earth
from cocap_opt.scenarios import load_scene
from cocap_opt.scenarios.earth.place import MapProjection
from cocap_opt.scenarios.tracks import Track
from cocap_opt.scenarios.tracks.gpx import read_gpx
from cocap_opt.scenarios.tracks.table import Form

EARTH = Earth(crs="EPSG:32633", origin=(52.4010, 13.0590))
PLACE = MapProjection(EARTH)
RECIPE = """\
steps = 5
step = 0.5
[map]
size = [60, 60]
origin = [-20, -20]
resolution = 1
[earth]
crs = "EPSG:32633"
latitude = 52.4010
longitude = 13.0590
[[tracks]]
{tracks}
[[drones]]
count = 1
camera = "dji-mavic-pro"
motion = {{ layers = [6] }}
"""
N11, N10 = "http://www.topografix.com/GPX/1/1", "http://www.topografix.com/GPX/1/0"


def points(rows: Iterable[tuple[str, float, float]], prefix: str = "") -> str:
    """Points of a segment: a time, and x and y in m."""
    rows = list(rows)
    metres = np.array([(x, y) for _, x, y in rows])
    degrees = np.column_stack(Geodesy(EARTH, (0.0, 0.0)).degrees(*metres.T))
    return "".join(
        f'<{prefix}trkpt lat="{lat:.9f}" lon="{lon:.9f}"><{prefix}ele>35.1</{prefix}ele>'
        + (f"<{prefix}time>{time}</{prefix}time>" if time else "")
        + f"</{prefix}trkpt>"
        for (time, _, _), (lat, lon) in zip(rows, degrees.tolist(), strict=True)
    )


def segment(rows: Iterable[tuple[str, float, float]]) -> str:
    """A segment of such points."""
    return f"<trkseg>{points(rows)}</trkseg>"


def gpx(*tracks: str, names: Iterable[str] = (), namespace: str = N11) -> str:
    """A file of tracks, each of some segments."""
    given = [*names, *[""] * len(tracks)]
    body = "".join(
        f"<trk>{f'<name>{name}</name>' if name else ''}{track}</trk>"
        for track, name in zip(tracks, given, strict=False)
    )
    return f'<?xml version="1.0"?><gpx version="1.1" xmlns="{namespace}">{body}</gpx>'


def walk(seconds: Iterable[float], y: float = 2.0) -> str:
    """A segment of someone who goes along x at 1.5 m/s from 10 o'clock on."""
    return segment((f"2026-05-01T10:00:{t:06.3f}Z", 1.5 * t, y) for t in seconds)


def read(folder: Path, text: str | bytes, name: str = "ada.gpx") -> list[Track]:
    """The tracks of a file."""
    content = text if isinstance(text, bytes) else text.encode()
    (folder / name).write_bytes(content)
    return Track.read_all(folder / name, projection=PLACE)


def close(points: FloatArray, expected: list[tuple[float, float]]) -> bool:
    """True if points are those, to a millimetre."""
    return points == pytest.approx(np.array(expected), abs=1e-3)


@pytest.mark.parametrize("name", ["ada.gpx", "ada.txt", "ada"])
@pytest.mark.parametrize("namespace", [N11, N10, ""])
def test_a_recorded_way_is_read(tmp_path: Path, name: str, namespace: str) -> None:
    """Whatever the file is called: metres by [earth], seconds from the first point, a name."""
    text = gpx(walk(range(4)), names=["Ada &amp; Co"], namespace=namespace)
    (ada,) = read(tmp_path, text, name)
    assert (ada.id, ada.height, ada.times.tolist()) == ("Ada & Co", None, [0.0, 1.0, 2.0, 3.0])
    assert close(ada.points, [(0, 2), (1.5, 2), (3, 2), (4.5, 2)])
    assert str(ada.clock) == "2026-05-01 10:00:00 UTC"


def test_times_have_zones_and_fractions_in_any_order(tmp_path: Path) -> None:
    """All are moments; without a zone they are in UTC, as the standard has it."""
    rows = [
        ("2026-05-01T12:00:01.25+02:00", 1.0, 0.0),
        ("2026-05-01T10:00:00", 0.0, 0.0),
        (" 2026-05-01T10:00:00.500Z ", 0.5, 0.0),
        ("2026-05-01T04:30:02.000001-05:30", 2.0, 0.0),
    ]
    (found,) = read(tmp_path, gpx(segment(rows)))
    assert found.times.tolist() == [0.0, 0.5, 1.25, 2.000001]
    assert close(found.points, [(0, 0), (0.5, 0), (1, 0), (2, 0)])


def test_names_are_those_of_the_tracks_or_of_the_file(tmp_path: Path) -> None:
    """A track is a person. Names that do not tell people apart are not used."""
    one, two = walk(range(3)), walk(range(3), y=4.0)
    names = {
        ("Ada", "Ben"): ["Ada", "Ben"],
        ("Run", "Run"): ["ada 1", "ada 2"],
        ("Ada", ""): ["ada 1", "ada 2"],
    }
    for given, expected in names.items():
        assert [track.id for track in read(tmp_path, gpx(one, two, names=given))] == expected
    assert [track.id for track in read(tmp_path, gpx(one))] == ["ada"]
    assert [track.id for track in read(tmp_path, gpx(one, "", names=["", "Ben"]))] == ["ada"]


def test_a_segment_ends_a_stay_and_a_point_left_out_does_not(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """Receivers leave out points on straight ways, and begin a segment where they were off."""
    text = gpx(walk([0, 1, 4]) + walk([8, 9]) + walk([9, 10, 21]))
    (ada,) = read(tmp_path, text)
    assert ada.spans() == [(0.0, 4.0), (8.0, 10.0), (21.0, 21.0)]
    assert "points are up to 3 s apart, and people are assumed to walk straight" in caplog.text
    assert ada.is_there(0.0, 1.0, 4) and not ada.is_there(0.0, 1.0, 5)
    assert close(ada.at_steps(1.0, 1.0, 3), [(1.5, 2), (3, 2), (4.5, 2), (6, 2)])
    for gap, spans in ((1.0, 4), (2.0, 4), (12.0, 2)):
        (ada,) = Track.read_all(tmp_path / "ada.gpx", projection=PLACE, gap=gap)
        assert len(ada.spans()) == spans


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16", "iso-8859-1"])
def test_names_have_any_letters(tmp_path: Path, encoding: str) -> None:
    """XML says its encoding itself."""
    text = gpx(walk(range(2)), names=["Zo\u00eb"])
    text = text.replace('"1.0"?>', f'"1.0" encoding="{encoding}"?>')
    assert read(tmp_path, text.encode(encoding))[0].id == "Zo\u00eb"


def test_names_may_have_a_prefix(tmp_path: Path) -> None:
    """The namespace counts, not how a file abbreviates it."""
    rows = [("2026-05-01T10:00:00Z", 1.0, 2.0)]
    text = (
        f'<g:gpx xmlns:g="{N11}" version="1.1"><g:trk><g:trkseg>{points(rows, "g:")}'
        "</g:trkseg></g:trk></g:gpx>"
    )
    assert close(read(tmp_path, text)[0].points, [(1, 2)])


WAYPOINT = '<wpt lat="52.4" lon="13.05"><time>2026-05-01T10:00:00Z</time></wpt>'
ROUTE = '<rte><rtept lat="52.4" lon="13.05"/></rte>'
NO_TIME = segment([("2026-05-01T10:00:00Z", 0.0, 0.0), ("", 1.0, 0.0)])


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (gpx(), "must have a track (trk) of points with times, but has none"),
        (gpx().replace("</gpx>", ROUTE + WAYPOINT * 2 + "</gpx>"),
         "must have a track (trk) of points with times, but has only 1 route and 2 waypoints"),
        (gpx("<trkseg/>"), "but has only tracks without points"),
        (gpx(walk([0]), NO_TIME), "track 2, segment 1, point 2: must have a time; recorded tracks"),
        (gpx(walk([0]) + NO_TIME), "track 1, segment 2, point 2: must have a time"),
        (gpx(walk([0]).replace("2026-05-01T", "yesterday ")), "point 1, time: must be a date with"),
        (gpx(walk([0]).replace("2026", "0001")), "point 1, time: must be a date with a time"),
        (gpx(re.sub("T10.*?Z", "", walk([0]))), "point 1, time: must be a date with a time"),
        (gpx(walk([0]).replace("10:00:00", "25:00:00")), "point 1, time: must be a date"),
        (gpx(walk([0]).replace('lat="52', 'lat="95')), "point 1, lat: must be within +-90 degrees"),
        (gpx(walk([0]).replace('lat="52.', 'lat="nan" no="')), "point 1, lat: must be a number of"),
        (gpx(walk([0]).replace('lat="52.', 'lat="52,')), "lat: must have a decimal point, not a c"),
        (gpx(walk([0]).replace("lon=", "long=")), "point 1, lon: must be given"),
        (gpx(walk([0]).replace('lon="', 'lon="1_')), "point 1, lon: must be a number of degrees, "),
        (gpx(walk([0])).replace("</trkseg>", ""), "line 1: must be GPX; it is damaged or trunc"),
        (gpx(walk([0]))[:-20], "must be GPX; it is damaged or truncated"),
        (gpx(walk([0]).replace('lat="52', 'lat="42')), "latitude, longitude: must be near the map"),
        (gpx(walk([0]) + walk([0], y=3.0)), "track 1, segment 2, point 1: must not be a secon"),
        (gpx(walk([0, 4]) + walk([2.5, 6], y=5.0)), "track 1, segment 2, point 1: must not be "
         "earlier than track 1, segment 1, point 2: two segments of ada overlap in time"),
    ],
)  # fmt: skip
def test_what_is_no_recorded_way_is_told(tmp_path: Path, text: str, words: str) -> None:
    """One line names the file, the track, the segment and the point."""
    with pytest.raises(ProblemError) as error:
        read(tmp_path, text)
    assert words in str(error.value) and "\n" not in str(error.value)
    assert str(error.value).startswith(str(tmp_path / "ada.gpx"))


def test_entities_are_refused_and_do_not_grow(tmp_path: Path) -> None:
    """Neither a bomb of entities nor the name of a file is followed; a bare DOCTYPE is refused."""
    grown = "".join(f'<!ENTITY a{k} "{f"&a{k - 1};" * 10}">' for k in range(1, 10))
    for inside, used in (
        ('<!ENTITY a0 "ha">' + grown, "&a9;"),
        ('<!ENTITY a SYSTEM "file:///etc/passwd">', "&a;"),
        ("", "Ada"),
    ):
        body = gpx(walk([0]), names=[used]).partition("?>")[2]
        text = f'<?xml version="1.0"?><!DOCTYPE gpx [{inside}]>{body}'
        with pytest.raises(ProblemError, match="must be GPX without a DOCTYPE or its own"):
            read(tmp_path, text)


def test_without_earth_its_place_is_proposed(tmp_path: Path) -> None:
    """Degrees alone are no metres; the message says what to write for this file."""
    (tmp_path / "ada.gpx").write_text(gpx(walk(range(9))))
    recipe = RECIPE.format(tracks='file = "ada.gpx"\ncount = 1')
    bare = recipe.split("[earth]")[0] + "[[tracks]]" + recipe.split("[[tracks]]")[1]
    (tmp_path / "scene.toml").write_text(bare)
    with pytest.raises(Exception, match=r'need \[earth\] .*crs = "EPSG:32633", latitude = 52'):
        load_scene(str(tmp_path / "scene.toml"))
    for field in ('columns = ["id"]', "fps = 1", 'delimiter = ","', 'time_unit = "s"'):
        (tmp_path / "scene.toml").write_text(recipe.replace("count = 1", f"count = 1\n{field}", 1))
        with pytest.raises(Exception, match=rf"{field.split()[0]}: must be left out for GPX"):
            load_scene(str(tmp_path / "scene.toml"))


def test_people_who_recorded_themselves_are_on_one_clock(tmp_path: Path) -> None:
    """Files of one table count from the same moment, and step 0 is when all of them are there."""
    (tmp_path / "ada.gpx").write_text(gpx(walk(range(20)), names=["Run"]))
    (tmp_path / "ben.gpx").write_text(gpx(walk(range(7, 20), y=4.0), names=["Run"]))
    recipe = RECIPE.format(tracks='file = ["ben.gpx", "ada.gpx"]\nids = ["ada", "ben"]')
    (tmp_path / "scene.toml").write_text(recipe)
    ada, ben = load_scene(str(tmp_path / "scene.toml")).actors
    assert (ada.name, ben.name, ada.begin, ben.begin) == ("ada", "ben", 7.0, 7.0)
    assert close(ada.poses[:2, :2], [(10.5, 2), (11.25, 2)])
    assert close(ben.poses[:2, :2], [(10.5, 4), (11.25, 4)])


def test_tables_at_other_moments_are_warned_of(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """Each table has a step 0 of its own; who recorded at another time is not met in the scene."""
    (tmp_path / "ada.gpx").write_text(gpx(walk(range(20))))
    (tmp_path / "ben.gpx").write_text(gpx(walk(range(7, 20), y=4.0)))
    table = 'file = "{}.gpx"\ncount = 1'
    both = f"{table.format('ada')}\n[[tracks]]\n{table.format('ben')}"
    (tmp_path / "scene.toml").write_text(RECIPE.format(tracks=both))
    words = "tracks[1]: step 0 is 2026-05-01 10:00:07 UTC for its people, but 2026-05-01 10:00:00"
    for begin, is_warned in (("", True), ("\nbegin = 7", False)):
        caplog.clear()
        (tmp_path / "scene.toml").write_text(
            RECIPE.format(tracks=both.replace("count = 1", f"count = 1{begin}", 1))
        )
        with caplog.at_level(logging.WARNING):
            load_scene(str(tmp_path / "scene.toml"))
        assert (words in caplog.text) == is_warned


@pytest.mark.parametrize(
    ("first", "second", "words"),
    [
        ("id,t,x,y\n1,0,0,0\n", "id,t,x,y\n1,0,3,0\n2,0,4,0\n", "file: 1 must not be in two files"),
        ("id,t,x,y\n1,0,0,0\n", "id,t,x,y\n2,2026-05-01T10:00:00Z,3,0\n", "a.csv has numbers and "
         "b.csv has dates; times must all be"),
        ("id,t,x,y\n1,2026-05-01T10:00:00,0,0\n", "id,t,x,y\n2,2026-05-01T10:00:00Z,3,0\n",
         "a.csv has dates without an offset and b.csv has dates"),
    ],
)  # fmt: skip
def test_files_that_have_no_clock_or_name_in_common_are_refused(
    tmp_path: Path, first: str, second: str, words: str
) -> None:
    """Nothing tells when one of them was, by the other, or who is who."""
    (tmp_path / "a.csv").write_text(first)
    (tmp_path / "b.csv").write_text(second)
    recipe = RECIPE.format(tracks='file = ["a.csv", "b.csv"]\ncount = 1\nunit = "m"')
    (tmp_path / "scene.toml").write_text(recipe)
    with pytest.raises(Exception, match=words.replace("[", r"\[")):
        load_scene(str(tmp_path / "scene.toml"))


def test_tables_of_several_files_share_a_clock(tmp_path: Path) -> None:
    """One file for each person, with frames or times since 1970, is as good as one file for all."""
    for name, text in {
        "a.csv": "id,time_ms,x,y\n1,1532402927500,0,0\n1,1532402928000,1,0\n",
        "b.csv": "id,timestamp_ns,x,y\n1,1532402927000000000,5,0\n1,1532402928500000000,8,0\n",
    }.items():
        (tmp_path / name).write_text(text)
    tracks = 'file = ["a.csv", "b.csv"]\ncount = 2\nunit = "m"\ngap = 2'
    recipe = RECIPE.format(tracks=tracks).replace("steps = 5", "steps = 1")
    for begin in ("", "\nbegin = 0.5", "\nbegin = 1532402927.5"):
        text = recipe.replace("gap = 2", f"gap = 2{begin}")
        (tmp_path / "scene.toml").write_text(text)
        a, b = load_scene(str(tmp_path / "scene.toml")).actors
        assert (a.name, b.name) == ("a", "b") and a.begin == pytest.approx(0.5)
        assert a.poses[:, 0].tolist() == [0, 1] and b.poses[:, 0] == pytest.approx([6, 7])


def test_a_long_way_between_points_is_said_with_the_way_out(tmp_path: Path) -> None:
    """Rows that are far apart may have another unit of time, or be straight ways."""
    rows = "".join(f"1,{t},{t / 40000:g},0\n" for t in range(0, 400001, 40000))
    for unit, times in (("us", 1), ("ms", 1000)):
        shown = "".join(f"1,{t // times},{t / 40000:g},0\n" for t in range(0, 400001, 40000))
        (tmp_path / "a.csv").write_text("id,t,x,y\n" + (rows if times == 1 else shown))
        recipe = RECIPE.format(tracks='file = "a.csv"\ncount = 1\nunit = "m"')
        (tmp_path / "scene.toml").write_text(recipe)
        with pytest.raises(Exception, match=f'if they are in {unit}, set time_unit = "{unit}"'):
            load_scene(str(tmp_path / "scene.toml"))
    (tmp_path / "a.csv").write_text("id,t,x,y\n1,0,0,0\n1,5,5,0\n1,10,9,0\n")
    with pytest.raises(Exception, match="gap = 5 lets people walk straight for that long"):
        load_scene(str(tmp_path / "scene.toml"))
    text = recipe.replace("count = 1", "count = 1\ngap = 5", 1)
    (tmp_path / "scene.toml").write_text(text)
    (actor,) = load_scene(str(tmp_path / "scene.toml")).actors
    assert actor.poses[:3, 0].tolist() == [0, 0.5, 1]


def test_an_empty_segment_is_nothing(tmp_path: Path) -> None:
    """Recorders write a segment even where no point follows."""
    (tmp_path / "ada.gpx").write_text(gpx("<trkseg></trkseg>" + walk(range(2)) + "<trkseg/>"))
    found = read_gpx(tmp_path / "ada.gpx", Form(), PLACE)
    assert found.segments is not None and found.segments.tolist() == [2, 2]
    assert found.where(0) == "track 1, segment 2, point 1"
    assert math.isclose(found.times[1], 1.0)
