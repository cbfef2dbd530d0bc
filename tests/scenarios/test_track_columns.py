"""What the columns of tracks say: units of times and lengths, boxes, and encodings."""

from contextlib import nullcontext
from pathlib import Path
from typing import Any

import pytest

from cocap_opt.data import ProblemError
from cocap_opt.problem import Earth
from cocap_opt.scenarios.earth.place import MapProjection
from cocap_opt.scenarios.tracks import Track


def read(folder: Path, text: str, **options: Any) -> list[Track]:
    """Tracks of a file with this text."""
    (folder / "walk.txt").write_bytes(text.encode())
    return Track.read_all(folder / "walk.txt", **options)


# -- times ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "per_second"),
    [
        ("time [s]", 1),
        ("time_s", 1),
        ("t", 1),
        ("Seconds", 1),
        ("timestamp (seconds)", 1),
        ("t_ms", 10**3),
        ("milliseconds", 10**3),
        ("timestampMs", 10**3),
        ("time/ms", 10**3),
        ("timestamp_us", 10**6),
        ("TimeUS", 10**6),
        ("time [\u00b5s]", 10**6),
        ("timestamp (microseconds)", 10**6),
        ("time_usec", 10**6),
        ("timestamp_micros", 10**6),
        ("time [ns]", 10**9),
        ("timestamp_ns", 10**9),
        ("time (nanoseconds)", 10**9),
        ("timestamp.nanos", 10**9),
        ("unix_time_ns", 10**9),
        ("time [us since midnight]", 10**6),
        ("time (s from the start)", 1),
        ("time (UTC time) [s]", 1),
    ],
)
def test_the_name_of_the_times_says_their_unit(tmp_path: Path, name: str, per_second: int) -> None:
    """From seconds to nanoseconds, short or spelt out; the recipe may repeat it."""
    text = f"id,{name},x,y\n1,{per_second // 2 or 0.5},0,0\n1,{per_second * 3 // 2 or 1.5},1,0\n"
    if per_second == 1:
        text = f"id,{name},x,y\n1,0.5,0,0\n1,1.5,1,0\n"
    unit = {1: "s", 10**3: "ms", 10**6: "us", 10**9: "ns"}[per_second]
    for given in (None, unit):
        assert read(tmp_path, text, unit="m", time_unit=given)[0].times.tolist() == [0.5, 1.5]


@pytest.mark.parametrize(
    ("unit", "per_second"), [("s", 1), ("ms", 10**3), ("us", 10**6), ("ns", 10**9)]
)
def test_times_since_1970_lose_nothing(tmp_path: Path, unit: Any, per_second: int) -> None:
    """They count from the first of them, to the nanosecond, in any unit and order of rows."""
    first = 1532402927 * per_second + 123456789 * per_second // 10**9
    ticks = (7 * per_second // 10 or 1, 0, 3 * per_second // 10 or 2)
    rows = "".join(f"ann,{first + tick},{k},0\n" for k, tick in enumerate(ticks))
    for header, given in ((f"id,time_{unit},x,y", None), ("id,timestamp,x,y", unit)):
        (found,) = read(tmp_path, f"{header}\n{rows}", unit="m", time_unit=given)
        assert found.times.tolist() == [tick / per_second for tick in sorted(ticks)]
        assert found.clock is not None and found.clock.nanoseconds * per_second == first * 10**9
        assert str(found.clock).startswith("2018-07-24 03:28:47")


@pytest.mark.parametrize(
    ("rows", "options", "words"),
    [
        # Times since 1970 in a plain column, by their size.
        (
            [1532402927647, 1532402928147],
            {},
            'as ms since 1970 it is 2018-07-24; if so, set time_unit = "ms"',
        ),
        (
            [1532402927647951, 1532402928147951],
            {},
            "as us since 1970 it is 2018-07-24; if so, set time_unit =",
        ),
        ([1532402927647951000, 1532402928147951000], {}, "as ns since 1970 it is 2018-07-24; "),
        # A clock that began when the device did, by how far rows are apart.
        ([1600000000000, 1600033000000], {}, "in ns the rows of a person are as far apart as"),
        # Beyond all units.
        ([1e30, 2e30], {}, "set time_unit in [[tracks]] to one of s, ms, us, ns"),
        ([1532402927647951, 1532402928147951], {"time_unit": "ms"}, "is the unit ms right?"),
    ],
)
def test_times_that_no_clock_shows_are_asked_about(
    tmp_path: Path, rows: list[float], options: dict[str, Any], words: str
) -> None:
    """The message says which unit is likely, and what to write in the recipe."""
    text = "id,timestamp,x,y\n" + "".join(f"1,{t},{k},0\n" for k, t in enumerate(rows))
    with pytest.raises(ProblemError) as error:
        read(tmp_path, text, unit="m", **options)
    assert words in str(error.value) and "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("text", "options", "words"),
    [
        (
            "id,time_ms,x,y\n1,0,0,0\n",
            {"time_unit": "s"},
            "time_unit: must be ms, as the file states",
        ),
        ('id,t,x,y\n"",us,m,m\n1,0,0,0\n', {"time_unit": "s"}, "time_unit: must be us, as the"),
        (
            "id,t_ms,x,y\n,us,m,m\n1,0,0,0\n",
            {},
            "time_unit: must be one, but the file states ms and us",
        ),
        ("# times are in us\nid,t_ms,x,y\n1,0,0,0\n", {}, "time_unit: must be one, but the file"),
        (
            "id,frame,x,y\n1,0,0,0\n",
            {"fps": 1, "time_unit": "s"},
            "time_unit: must be left out for fr",
        ),
        (
            "id,t,x,y\n1,2026-05-01T10:00:00,0,0\n",
            {"time_unit": "s"},
            "time_unit: must be left out for d",
        ),
        (
            "id,t,x,y\n1,0,0,0\n",
            {"time_unit": "min"},
            "time_unit: must be s, ms, us, ns, not 'min'",
        ),
        (
            "id,t,x,y\n1,20260501100000,0,0\n",
            {"time_unit": "us"},
            "time_unit: must be left out for dates",
        ),
        (
            "id,t,x,y\n1,20260501100000,0,0\n1,20260501100060,0,0\n",
            {},
            "line 3, time: must be a date with a time such as 2026-05-01T10:00:00.25, as in the",
        ),
        (
            "id,t,x,y\n1,2026-05-01T10:00:00,0,0\n1,2026-05-01,0,0\n",
            {},
            "line 3, time: must be a date with a time such as 2026-05-01T10:00:00.25, as in the",
        ),
        (
            "id,t,x,y\n1,2026-05-01T10:00:00,0,0\n1,2026-05-01T10:00:01Z,0,0\n",
            {},
            "line 3, time: must have an offset such as Z or +02:00 in all rows, or in none",
        ),
        (
            "id,t,x,y\n1,2026-05-01T10:00:00,0,0\n1,1066-10-14T10:00:01,0,0\n",
            {},
            "line 3, time: must",
        ),
    ],
)
def test_units_of_time_must_agree(
    tmp_path: Path, text: str, options: dict[str, Any], words: str
) -> None:
    """Of two units for one column, or of one where there can be none, neither is believed."""
    with pytest.raises(ProblemError) as error:
        read(tmp_path, text, unit="m", **options)
    assert f": {words}" in str(error.value)


def test_of_several_times_the_plainest_is_taken(tmp_path: Path) -> None:
    """Files tell a moment twice; two columns that are alike are asked about."""
    for header in ("id,time,timestamp_ns,x,y", "id,t [s],datetime,x,y", "id,timestamp,epoch,x,y"):
        (found,) = read(tmp_path, f"{header}\n1,0.5,7e9,0,0\n1,1,8e9,1,0\n", unit="m")
        assert found.times.tolist() == [0.5, 1.0]
    with pytest.raises(ProblemError, match="header: must name one column time, not two"):
        read(tmp_path, "id,secs,nsecs,x,y\n1,0,7,0,0\n", unit="m")


def test_frames_that_are_times_are_asked_about(tmp_path: Path) -> None:
    """A rate makes nothing of milliseconds since 1970."""
    text = "id,frame,x,y\n1,1532402927647,0,0\n"
    with pytest.raises(ProblemError, match=r"is it a time\? Name it time in columns"):
        read(tmp_path, text, unit="m", fps=1000)
    columns = ("id", "time_ms", "x", "y")
    assert read(tmp_path, text, unit="m", columns=columns)[0].times.tolist() == [0.0]


# -- lengths ---------------------------------------------------------------------------------

FOOT, US_FOOT = 0.3048, 1200 / 3937
SPELT = {
    "us-ft": US_FOOT, "US survey feet": US_FOOT, "ftUS": US_FOOT, "international feet": FOOT,
    "Feet": FOOT, "metres": 1.0, "centimeter": 0.01, "m\u00e8tres": 1.0,
}  # fmt: skip


@pytest.mark.parametrize("head", ["x [{0}],y [{0}]", "x ({0}),y ({0})", "x/{0},y/{0}"])
@pytest.mark.parametrize(("unit", "metres"), SPELT.items())
def test_units_of_lengths_are_spelt_as_in_other_files(
    tmp_path: Path, head: str, unit: str, metres: float
) -> None:
    """A US survey foot of tracks is that of maps, in a name of several words, too."""
    texts = [f"id,time,{head.format(unit)}\n", f"id,time,x,y\n-,s,{unit},{unit}\n"]
    if "foot" in unit or "feet" in unit.lower() or "us" in unit.lower():
        texts.append(f"# unit: {unit}\n# id,time,x,y\n")
    for text in texts:
        (found,) = read(tmp_path, f"{text}1,0,1e6,2e6\n")
        assert found.points.tolist() == [pytest.approx([1e6 * metres, 2e6 * metres], rel=1e-12)]


@pytest.mark.parametrize(
    ("head", "words"),
    [
        ("id,time,x [US survey yards],y [US survey yards]", "states 'us survey yards'"),
        ("id,time,x_px,y_px", "states 'px'"),
        ("id,time (US/Eastern),x_m,y_m", "time: must be in s, ms, us, ns, not us/eastern"),
        ("id,time [US Central],x_m,y_m", "time: must be in s, ms, us, ns, not us central"),
    ],
)
def test_words_that_only_begin_as_units_do_are_none(tmp_path: Path, head: str, words: str) -> None:
    """Clocks of a place are no microseconds."""
    with pytest.raises(ProblemError, match=words):
        read(tmp_path, f"{head}\n1,0,1,2\n")


@pytest.mark.parametrize(
    ("comment", "unit"),
    [
        ("x and y in m, position error in cm", "m"),
        ("x, y in m; step length in cm; 1.4 m/s", "m"),
        ("positions in cm. Resolution of the grid: cells in m", "cm"),
        ("trajectories, all in mm", "mm"),
        ("x and y in m, z in cm", "the file states cm and m"),
        ("RTK rover log, position accuracy in cm", "must be given, as the file does not state it"),
    ],
)
def test_units_of_errors_and_the_like_are_not_those_of_places(
    tmp_path: Path, comment: str, unit: str
) -> None:
    """A comment that names two units for x, y and z is refused."""
    text = f"# {comment}\nid,time,x,y\n1,0,1200,2400\n"
    if " " in unit:
        with pytest.raises(ProblemError, match=unit):
            read(tmp_path, text)
        return
    (found,) = read(tmp_path, text)
    scale = {"m": 1.0, "cm": 100.0, "mm": 1000.0}[unit]
    assert found.points.tolist() == [pytest.approx([1200 / scale, 2400 / scale])]


@pytest.mark.parametrize(
    "name",
    ["date", "day", "floor", "match_id", "camera", "Half", "file", "case_id", "scenario_id",
     "logId", "scene_name", "video name", "seq_name", "run_number", "trial_no", "track_file"],
)  # fmt: skip
def test_rows_of_several_days_or_places_are_refused(tmp_path: Path, name: str) -> None:
    """They would be laid on top of each other."""
    text = f"id,{name},time,x [m],y [m]\n1,a,0,1,2\n2,{{}},0,3,4\n"
    assert len(read(tmp_path, text.format("a"))) == 2
    with pytest.raises(ProblemError, match=f"{name}: must be the same in all rows, as ids or tim"):
        read(tmp_path, text.format("b"))


def test_fields_between_quotes_may_contain_commas(tmp_path: Path) -> None:
    """As in names with a comma, and in times of day with a decimal comma."""
    text = 'id,time,x [m],y [m]\n"Doe, John","00:00:00,000",1,2\n"Doe, John","00:00:00,040","3",4\n'
    (found,) = read(tmp_path, text)
    assert found.id == "Doe, John"
    assert found.times.tolist() == [0.0, pytest.approx(0.04)]
    assert found.points.tolist() == [[1, 2], [3, 4]]


def test_titles_above_the_header_are_no_header(tmp_path: Path) -> None:
    """They have no numbers either, but do not name people and places."""
    text = "Recorded by: J. Doe\nLocation: Delft, NL\nid,time,x [m],y [m]\n1,0,1,2\n1,1,3,4\n"
    (found,) = read(tmp_path, text)
    assert found.points.tolist() == [[1, 2], [3, 4]]


def test_a_number_of_each_row_is_no_recording(tmp_path: Path) -> None:
    """Many programs number the records of a table."""
    text = "id,record,time,x [m],y [m]\n1,1,0,1,2\n1,2,1,1,2\n2,3,0,3,4\n2,4,1,3,4\n"
    assert len(read(tmp_path, text)) == 2


@pytest.mark.parametrize(
    ("column", "words"),
    [("agent_type\npedestrian\nArticulatedTruck", "'ArticulatedTruck'"),
     ("category\nhuman.pedestrian.adult\nvehicle.car", "'vehicle.car'"),
     ("label\nBiker\nSkater", "")],
)  # fmt: skip
def test_vehicles_are_told(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, column: str, words: str
) -> None:
    """They would be filmed as people."""
    name, first, second = column.split("\n")
    text = f"id,{name},time,x [m],y [m]\n1,{first},0,1,2\n2,{second},0,3,4\n"
    assert len(read(tmp_path, text)) == 2
    told = f"column {name} has {words}, and all rows are read as people"
    assert (told in caplog.text) == bool(words)


@pytest.mark.parametrize("last", [1.1, 4.0])
def test_a_direction_that_is_not_read_is_told_if_somebody_stands(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, last: float
) -> None:
    """Whoever walks looks ahead."""
    assert read(tmp_path, f"id,time,x [m],y [m],Heading\n7,0,1,2,90\n7,1,{last},2,90\n")
    assert ("column Heading is not read, and id 7 stands" in caplog.text) == (last < 2)


@pytest.mark.parametrize(
    ("before", "after"),
    [("02:59:{:02}", "02:00:{:02}"), ("12:59:{:02}", "01:00:{:02}"),
     ("2026-10-25T02:59:{:02}", "2026-10-25T02:00:{:02}")],
)  # fmt: skip
def test_a_clock_that_goes_back_is_refused(tmp_path: Path, before: str, after: str) -> None:
    """At the end of summer time, and on a clock of twelve hours; but rows may be in any order."""
    times = [*map(before.format, range(40, 60)), *map(after.format, range(20))]
    rows = [f"1,{time},{k},2\n" for k, time in enumerate(times)]
    head = "id,time,x [m],y [m]\n"
    with pytest.raises(ProblemError, match=r"line 22, time: must not be \d+ s before the row abo"):
        read(tmp_path, head + "".join(rows))
    assert read(tmp_path, head + "".join(rows[::-2] + rows[::2]))
    zoned = [row.replace(",", "+02:00,", 2).replace("1+02:00", "1", 1) for row in rows[:20]]
    zoned += [row.replace(",", "+01:00,", 2).replace("1+01:00", "1", 1) for row in rows[20:]]
    if "T" in before:
        assert read(tmp_path, head + "".join(zoned))


@pytest.mark.parametrize("name", ["ms", "msec", "time_ns", "microseconds"])
def test_fractions_of_seconds_in_another_column_are_refused(tmp_path: Path, name: str) -> None:
    """Without them, people would shift against one another."""
    text = f"id,time,{name},x [m],y [m]\n1,10:00:00,0,1,2\n2,10:00:00,900,3,4\n"
    with pytest.raises(ProblemError, match=f"{name}: must be added to the times"):
        read(tmp_path, text)
    columns = ("id", "time", "-", "x [m]", "y [m]")
    assert len(read(tmp_path, text, columns=columns)) == 2


@pytest.mark.parametrize("column", ["lost\n0\n1", "valid\nTrue\nFalse", "Is Present\n1.0\n0.0"])
def test_rows_marked_as_lost_are_left_out(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, column: str
) -> None:
    """A tracker repeats the last place, or writes any place, of people that it has lost."""
    name, kept, lost = column.split("\n")
    text = f"id,time,x [m],y [m],{name}\n1,0,1,2,{kept}\n1,1,1,2,{lost}\n"
    (found,) = read(tmp_path, text)
    assert found.times.tolist() == [0.0]
    assert f"1 of 2 rows are left out, as column {name} marks them" in caplog.text
    with pytest.raises(ProblemError, match=f"{name}: must not mark all rows"):
        read(tmp_path, text.replace(f",{kept}\n", f",{lost}\n"))


@pytest.mark.parametrize("names", ["X (north) [m],Y (east) [m]", "x [m] north,y [m]", "x,y (down)"])
def test_axes_that_point_elsewhere_are_refused(tmp_path: Path, names: str) -> None:
    """Surveyors' x points north, and the y of images down."""
    with pytest.raises(ProblemError, match=r"header: [xy] must point"):
        read(tmp_path, f"id,time,{names}\n1,0,1,2\n", unit="m")


def test_rates_by_name_and_in_words_must_agree(tmp_path: Path) -> None:
    """That of the video is not that of the table."""
    text = "# sampling rate: 5 Hz\n# framerate: {}\nid,frame,x [m],y [m]\n1,0,1,2\n1,5,2,2\n"
    with pytest.raises(ProblemError, match=r"fps: must be given .*, as comments state 5 and 25"):
        read(tmp_path, text.format(25))
    for rate, options in ((5, {}), (25, {"fps": 5})):
        assert read(tmp_path, text.format(rate), **options)[0].times.tolist() == [0.0, 1.0]


# -- a row of units, boxes, and encodings ----------------------------------------------------


@pytest.mark.parametrize(
    ("text", "options"),
    [
        (
            '"t","id","name","x","y","z","v"\n"s","","","m","m","m","m/s"\n0.5,0,"00001",1,2,1.7,0\n',
            {},
        ),
        ("t;id;x;y;z\nms;-;cm;cm;cm\n500;0;100;200;170\n", {}),
        ("t\tid\tx\ty\tz\n[s]\t[-]\t[mm]\t[mm]\t[mm]\n0.5\t0\t1000\t2000\t1700\n", {}),
        ("id,frame,x,y,z\n,,cm,cm,cm\n0,5,100,200,170\n", {"fps": 10}),
        ("id\tt\tx\ty\tz\n\ts\tm\tm\tm\n0\t0.5\t1\t2\t1.7\n", {}),
        ("id,t,x,y,z\nnone,-,cm,cm,n/a\n0,0.5,100,200,170\n", {}),
        ("id frame x y z\n- - (m) (m) (m)\n0 5 1 2 1.7\n", {"fps": 10}),
        ("# from a simulation\nt,id,x/m,y/m,z/m\nseconds,,metres,m,m\n0.5,0,1,2,1.7\n", {}),
        ("a,b,c,d,e\ns,,m,m,m\n0.5,0,1,2,1.7\n", {"columns": ("time", "id", "x", "y", "z")}),
    ],
)
def test_units_stand_below_the_header(tmp_path: Path, text: str, options: dict[str, Any]) -> None:
    """A row of units says those of x, y, z and time, and is no person."""
    (found,) = read(tmp_path, text, **options)
    assert found.id == 0 and found.times.tolist() == [0.5]
    assert found.points.tolist() == [[1.0, 2.0]] and found.height == 1.7


@pytest.mark.parametrize(
    ("text", "options", "words"),
    [
        ("t,id,x,y\ns,,m,cm\n0,0,1,2\n", {}, "unit: must be one, but the file states cm and m"),
        (
            "t,id,x/cm,y/cm\ns,,m,m\n0,0,1,2\n",
            {},
            "unit: must be one, but the file states cm and m",
        ),
        (
            "t,id,x,y\ns,,m,m\n0,0,1,2\n",
            {"unit": "cm"},
            "unit: must be m, as the file states, not cm",
        ),
        (
            "t,id,x,y\ns,,px,px\n0,0,1,2\n",
            {"unit": "m"},
            "unit: must be m, cm, mm, ft",
        ),
        ("t,id,x,y\nmin,,m,m\n0,0,1,2\n", {}, "time: must be in s, ms, us, ns, not min"),
        (
            "t,id,x,y\ns,m,m\n0,0,1,2\n",
            {},
            "line 2: must have a unit, or - for none, for each of 4",
        ),
        (
            "t,id,x,y\nfloat,int,float,float\n0,0,1,2\n",
            {"unit": "m"},
            "line 2, time: must be seconds",
        ),
    ],
)
def test_a_row_of_units_that_contradicts_is_refused(
    tmp_path: Path, text: str, options: dict[str, Any], words: str
) -> None:
    """The header, the row below, and the recipe must say the same."""
    with pytest.raises(ProblemError) as error:
        read(tmp_path, text, **options)
    assert f": {words}" in str(error.value)


@pytest.mark.parametrize(
    ("header", "words"),
    [
        (
            "frame,trackId,x,y,width,height",
            "header: width and height are the width and height of a box, .* = "
            '["frame", "id", "x", "y", "-", "-"]',
        ),
        ("frame,id,x,y,w,h", "header: w and h are the width and height of a box"),
        ("frame,id,x [m],y [m],bb_width [m],bb_height [m]", "header: bb_width .* of a box"),
        (
            "frame,id,bb_left,bb_top,bb_width,bb_height",
            "write the place where each person stands as x and y",
        ),
        ("frame,id,left,top,width,height", "write the place where each person stands as x and y"),
        ("frame,id,xmin,ymin,xmax,ymax", "xmin, ymin, xmax, ymax are edges of boxes"),
        ("frame,id,bb,a,b,the_geom", "write the points in the_geom as columns x and y"),
        (
            "frame,id,x,y,length,height",
            "height: must be the height of heads above the floor, 0.9..2.5 m, "
            'but its median is 0.62 m: .* columns = ["frame", "id", "x", "y", "-", "-"]',
        ),
    ],
)
def test_the_height_of_a_box_is_no_height_of_a_head(
    tmp_path: Path, header: str, words: str
) -> None:
    """It is asked about, and the columns that the message names read the file without it."""
    rows = "".join(f"{k},1,{10 + 0.1 * k:g},6,0.55,0.62\n" for k in range(3))
    text = f"{header}\n{rows}"
    pattern = words.replace("[", r"\[").replace("]", r"\]")
    with pytest.raises(ProblemError, match=pattern):
        read(tmp_path, text, unit="m", fps=25)
    with pytest.raises(ProblemError):
        read(tmp_path, text, unit="m", fps=25, columns=header.split(","))
    columns = ("frame", "id", "x", "y", "-", "-")
    (found,) = read(tmp_path, text, unit="m", fps=25, columns=columns)
    assert found.height is None and found.points[0].tolist() == [10.0, 6.0]
    if "x [m]" not in header:
        tall = text.replace("0.62", "1.62")
        heads = ("frame", "id", "x", "y", "-", "z")
        assert read(tmp_path, tall, unit="m", fps=25, columns=heads)[0].height == 1.62


def test_a_height_that_is_one_is_taken(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """A column called height may be of heads; z may be of the floor, and then says nothing."""
    text = "id,frame,x,y,height\n1,0,1,2,1.6\n2,0,3,4,1.8\n"
    assert [one.height for one in read(tmp_path, text, unit="m", fps=1)] == [1.6, 1.8]
    flat = "id,frame,x,y,z\n1,0,1,2,0.02\n2,0,3,4,1.8\n"
    assert [one.height for one in read(tmp_path, flat, unit="m", fps=1)] == [None, 1.8]
    assert "0.02 m for id 1: is z a height above the floor? People who are lower get" in caplog.text


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be"])
@pytest.mark.parametrize("delimiter", [",", ";", "\t"])
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_tables_of_spreadsheets_are_read(
    tmp_path: Path, encoding: str, delimiter: str, end: str
) -> None:
    """In UTF-8 and, with its mark, in UTF-16, as Excel saves text, with lines of any system."""
    rows = ["id", "t", "x", "y"], ["zo\u00eb", "0", "1", "2"]
    text = "".join(delimiter.join(row) + end for row in rows)
    mark = "\ufeff" if encoding.endswith("e") else ""
    (tmp_path / "some.txt").write_bytes((mark + text).encode(encoding))
    (found,) = Track.read_all(tmp_path / "some.txt", unit="m")
    assert (found.id, found.points.tolist()) == ("zo\u00eb", [[1.0, 2.0]])


def test_utf_16_without_its_mark_is_named(tmp_path: Path) -> None:
    """Its bytes are those of UTF-8, too, with a NUL after each."""
    (tmp_path / "some.txt").write_bytes("id,t,x,y\n1,0,1,2\n".encode("utf-16-le"))
    with pytest.raises(ProblemError, match="must be a text file in UTF-8; it has NUL characters"):
        Track.read_all(tmp_path / "some.txt", unit="m")


def test_decimal_commas_are_named(tmp_path: Path) -> None:
    """They are not taken for anything else, whatever separates the fields."""
    for text in ("id;t;x;y\n1;0,5;1,5;2\n", "id\tt\tx\ty\n1\t0\t1,5\t2\n"):
        with pytest.raises(ProblemError, match="must have a decimal point, not a comma"):
            read(tmp_path, text, unit="m")


@pytest.mark.parametrize(
    "text",
    [
        "id\ttime [s]\tx [m]\ty [m]\n1\t0\t5\t8\n",
        "id\ttime\tnote\tx\ty\n1\t0\t\t5\t8\n",
        "id\ttime\tx\ty\n1 0 5 8\n",
    ],
)
def test_tabs_separate_names_of_several_words_and_empty_fields(tmp_path: Path, text: str) -> None:
    """Below a header with as many tabs; else any blanks do."""
    path = tmp_path / "tracks.txt"
    path.write_text(text)
    (found,) = Track.read_all(path, unit="m")
    assert found.points.tolist() == [[5.0, 8.0]]


def test_a_comment_that_names_another_system_is_refused(tmp_path: Path) -> None:
    """Unless it also names that of the scene, or the scene has coordinates of its own."""
    path = tmp_path / "tracks.txt"
    here = MapProjection(Earth(crs="EPSG:25832"))
    for comment, is_refused in (
        ("crs: EPSG:25833", True), ("EPSG:25832", False), ("from EPSG:4326 to EPSG:25832", False),
    ):  # fmt: skip
        path.write_text(f"# {comment}\nid,time,x,y\n1,0,500000,5800000\n")
        with pytest.raises(ProblemError, match="names EPSG:25833") if is_refused else nullcontext():
            Track.read_all(path, unit="m", projection=here)
        Track.read_all(path, unit="m")


@pytest.mark.parametrize(
    ("column", "is_refused"),
    [
        ("epsg,25832", False),
        ("EPSG code,EPSG:25833", True),
        ("zone,32N", False),
        ("zone,32T", False),
        ("utm_zone,33", True),
        ("zone,32K", True),
        ("zone,courtyard", False),
    ],
)
def test_a_column_that_names_another_system_is_refused(
    tmp_path: Path, column: str, is_refused: bool
) -> None:
    """A letter after a zone of UTM is N, S or a band."""
    path, (name, value) = tmp_path / "tracks.txt", column.split(",")
    path.write_text(f"id,time,x,y,{name}\n1,0,500000,5800000,{value}\n")
    words = f"line 2, {name}: must be the reference system of the scene"
    with pytest.raises(ProblemError, match=words) if is_refused else nullcontext():
        Track.read_all(path, unit="m", projection=MapProjection(Earth(crs="EPSG:25832")))
    Track.read_all(path, unit="m")
