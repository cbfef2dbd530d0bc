"""People tracked by others: files, points at steps, headings, actors."""

import logging
import math
import os
import sqlite3
from contextlib import closing
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from others import data
from strategies import examples

from cocap_opt.data import FloatArray, ProblemError
from cocap_opt.problem import Cuboid, Prism, TriangulatedCuboid
from cocap_opt.scenarios.earth.place import NOWHERE
from cocap_opt.scenarios.maps.terrain import MapTable
from cocap_opt.scenarios.recipe.people import TracksTable
from cocap_opt.scenarios.tracks import Track

ROWS = [(1, 0, 100.0, 250.0), (1, 1, 112.5, 250.0), (2, 1, -30.0, 0.5), (2, 2, -30.0, 1.5)]
headings = Track.headings
HEADED = "id,frame,x,y\n1,0,1,2\n1,1,1,3\n"


def track(times: list[float], points: list[tuple[float, float]], height: float = 1.7) -> Track:
    """A track of number 7."""
    return Track(7, np.array(times), np.array(points), height)


def walk(fps: float = 10.0, seconds: float = 10.0) -> Track:
    """From (1, 2) at 1.5 m/s along x and -0.5 m/s along y."""
    times = np.arange(round(seconds * fps) + 1) / fps
    return Track("w", times, np.array([1.0, 2.0]) + np.outer(times, [1.5, -0.5]), None)


def read(folder: Path, text: str, **options: Any) -> list[Track]:
    """Tracks of a file with this text, byte by byte."""
    path = folder / "walk.txt"
    path.write_bytes(text.encode())
    return Track.read_all(path, **options)


def same(first: list[Track], second: list[Track]) -> bool:
    """Return True if all is equal, to the last bit."""
    return len(first) == len(second) and all(
        (a.id, a.height) == (b.id, b.height)
        and np.array_equal(a.times, b.times)
        and np.array_equal(a.points, b.points)
        for a, b in zip(first, second, strict=True)
    )


def rows(separator: str = " ", end: str = "\n") -> str:
    """The four rows as text."""
    return "".join(separator.join(f"{value:g}" for value in row) + end for row in ROWS)


# -- files --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "options"),
    [
        (rows(), {}),
        (rows("\t"), {}),
        (rows(" \t "), {"delimiter": " "}),
        (rows("\t"), {"delimiter": "\t"}),
        (rows(","), {}),
        (rows(" , "), {"delimiter": ","}),
        (rows(";"), {}),
        (rows(end="\r\n"), {}),
        ("\ufeff" + rows(), {}),
        ("# a comment\n\n" + rows().replace("\n", " # moves\n\n   \n"), {}),
        ("\n \n" + rows(",").replace("\n", "\n  \n"), {}),
        (rows()[:-1], {}),
        ("ID FR X Y\n" + rows(), {}),
        ("Ped_ID;frames;x/cm;y/cm\n" + rows(";"), {"unit": None}),
        ("agent id,Frame,x [cm],y [cm]\n" + rows(","), {"unit": None}),
        ('"id","frame","x","y"\n' + rows(","), {}),
        (rows(",").replace("1,0,", '"1",0,'), {}),
        (rows().replace("1 0 ", "1.0 0e0 "), {}),
        ("# unit: cm\n" + rows(), {"unit": None}),
        ("# x, y: the coordinates (in centimetres)\n" + rows(), {"unit": None}),
        ("#framerate: 8.00\n" + rows(), {"fps": None}),
        ("# framerate: 8 fps\n# id frame x/cm y/cm z/cm\n" + rows(), {"fps": None, "unit": None}),
        ("# fps = 8\nid frame x y\n# in between\n" + rows(), {"fps": None}),
        ("a b c d\n" + rows(), {"columns": ("id", "frame", "x", "y")}),
        (rows(), {"columns": ("person", "FR", "X", "pos_y")}),
        ("# framerate: 8.00\n" + rows(), {"fps": 8.00004}),
        ("# framerate: 8, of a camera of 50 fps\n" + rows(), {"fps": None}),
        ("# 8 frames/s\n# smoothed at 2 Hz\n" + rows(), {"fps": None}),
    ],
)
def test_one_scene_in_many_spellings(tmp_path: Path, text: str, options: dict[str, Any]) -> None:
    """However the file is written, ids, seconds and metres are the same."""
    tracks = read(tmp_path, text, **{"unit": "cm", "fps": 8, **options})
    assert [t.id for t in tracks] == [1, 2]
    assert [t.height for t in tracks] == [None, None]
    assert [t.times.tolist() for t in tracks] == [[0.0, 0.125], [0.125, 0.25]]
    assert tracks[0].points.tolist() == [[1.0, 2.5], [1.125, 2.5]]
    assert tracks[1].points.tolist() == [[-0.3, 0.005], [-0.3, 0.015]]
    with pytest.raises(ValueError, match="read-only"):
        tracks[0].points[0, 0] = 9.0


@pytest.mark.parametrize(
    ("text", "ids"),
    [
        ("id,frame,x,y,kind\n5,0,1,2,adult\n5,1,1,3,child\n", [5]),  # words in what is not read
        ("id,frame,x,y,kind\n5,0,1,2,nan\n5,1,1,3,inf\n", [5]),
        ("id,frame,x,y\nBob,0,1,2\nann,0,1,2\nBob,1,1,3\n", ["Bob", "ann"]),
        ("Bob,0,1,2\nann,0,1,2\n3,1,1,3\n", ["3", "Bob", "ann"]),  # no header: it has numbers
        ("y,x,speed,person,frame\n2,1,0,3,0\n3,1,9,3,1\n", [3]),
        ("#frame id x y z a b\n0 4 1 2 0 7 7\n1 4 1 3 0 7 7\n", [4]),
        ("# frame id x/m y/m\n0,4,1,2\n1,4,1,3\n", [4]),
    ],
)
def test_columns_are_found_by_name(tmp_path: Path, text: str, ids: list[int | str]) -> None:
    """In any order, among others; ids are numbers or words as in the first row."""
    tracks = read(tmp_path, text, unit="m", fps=2)
    assert [t.id for t in tracks] == ids
    assert all(t.points[0].tolist() in ([1.0, 2.0], [1.0, 3.0]) for t in tracks)
    assert max(t.times[-1] for t in tracks) <= 0.5


@pytest.mark.parametrize(
    ("header", "unit"),
    [
        ("id,frame,x/ft,y/ft", None),
        ("id,frame,x [ft],y [ft]", None),
        ("id,frame,x_ft,y_ft", None),
        ("# id frame x_ft y_ft", None),
        ("# x and y in feet\nid,frame,x,y", None),
        ("id,frame,x,y", "ft"),
    ],
)
def test_feet_are_read(tmp_path: Path, header: str, unit: Any) -> None:
    """A file of feet, which says so or of which the recipe says so, comes out in metres."""
    (found,) = read(tmp_path, header + "\n7,0,100,-50\n7,1,101,-50\n", unit=unit, fps=1)
    assert found.points == pytest.approx(np.array([[30.48, -15.24], [30.7848, -15.24]]))


def test_times_stand_for_frames(tmp_path: Path) -> None:
    """A column of seconds needs no frame rate; with frames beside it, the caller chooses."""
    text = "t,id,x,y\n1351038575.5,1,0,0\n1351038576,1,1,0\n"
    assert read(tmp_path, text, unit="m")[0].times.tolist() == [0.0, 0.5]  # since 1970
    both = "id,frame,time/s,x,y\n1,10,0.5,0,0\n1,20,1.5,1,0\n"
    assert read(tmp_path, both, unit="m")[0].times.tolist() == [0.5, 1.5]
    assert read(tmp_path, both, unit="m", fps=10)[0].times.tolist() == [1.0, 2.0]


def test_times_of_trackers_are_read(tmp_path: Path) -> None:
    """Milliseconds become seconds; dates with times become seconds since the first of them."""
    for name in ("time [ms]", "time_ms", "timestamp (ms)", "t/ms"):
        found = read(tmp_path, f"id,{name},x,y\n1,500,0,0\n1,1500,1,0\n", unit="m")
        assert found[0].times.tolist() == [0.5, 1.5]
    for date in (
        "2026-05-01T10:00:{}",
        "2026-05-01 10:00:{}",
        "2026-05-01T10:00:{}+02:00",
        "20260501T1000{}Z",
        "202605011000{}",
    ):
        rows = "".join(f"anna,{date.format(s)},{s},0\n" for s in ("03", "01", "01.250"))
        (track,) = read(tmp_path, "id,timestamp,x,y\n" + rows, unit="m")
        assert track.times == pytest.approx([0.0, 0.25, 2.0])
        assert track.points[:, 0].tolist() == [1, 1.25, 3]
    rows = "".join(f"anna,202605011000{ms},{ms},0\n" for ms in ("03000", "01000", "01250"))
    (track,) = read(tmp_path, "id,timestamp,x,y\n" + rows, unit="m")
    assert track.times == pytest.approx([0.0, 0.25, 2.0])


def test_height_is_the_median_of_z(tmp_path: Path) -> None:
    """Heads bob; a z of 0 throughout is no height."""
    rows = [f"{k} {t} 0 {t} {(k - 1) * (150 + t * t)}\n" for k in (1, 2) for t in range(5)]
    text = "id frame x y z\n" + "".join(rows)
    assert [t.height for t in read(tmp_path, text, unit="cm", fps=5)] == [None, 1.54]


@pytest.mark.parametrize(
    ("text", "options", "words"),
    [
        ("", {}, "must contain at least one row"),
        ("# nothing\n\n", {}, "must contain at least one row"),
        ("id,frame,x,y\n", {}, "must contain at least one row"),
        ("1 0 1 2\n1 1 1\n", {}, "line 2: must have 4 values, not 3"),
        ("# c\n\n1 0 1 2\n1 1 1 2 3\n", {}, "line 4: must have 4 values, not 5"),
        ("id,frame,x,y\n1,0,1,2,\n", {}, "line 2: must have 4 values, not 5; does the row end"),
        (
            "id t x y\n1 2026/05/01 10:00:00.0 1 2\n",
            {},
            "line 2: must have 4 values, not 5; wri",
        ),
        ("1 0 1 2\n# c\n1 1 one 2\n", {}, "line 3, x: must be a number, not 'one'"),
        ("Bob,0,1,2\n,1,1,2\n", {}, "line 2, id: must not be empty"),
        (
            f"{10**18},0,1,2\n{10**18 + 1},0,1,2\n",
            {},
            "line 1, id: must be a whole number within +-1,000,000,000,000, not 1e+18; with a ",
        ),
        (
            "id,frame,x,y,z\n1,0,1,2,1.7\n1,1,1,2,nan\n",
            {},
            'line 3, z: must be a number within +-1,000,000,000, not nan; "-" in its place',
        ),
        ("1;0;1,5;2\n", {}, "line 1, x: must have a decimal point, not a comma: '1,5'"),
        ("1 0 1,5 2\n", {}, "line 1, x: must have a decimal point, not a comma: '1,5'"),
        ("1\t0\t1,5\t2\n", {}, "line 1, x: must have a decimal point, not a comma: '1,5'"),
        (
            "id,frame,x,y\n1,0,1,5,2,5\n",
            {},
            "line 2: must have 4 values, not 6; are the commas dec",
        ),
        (
            "1 0 1 2\n\n1 1 nan 2\n",
            {},
            "line 3, x: must be a number within +-1,000,000,000, not nan",
        ),
        (
            "1 0 1 2\n1 1 1 -inf\n",
            {},
            "line 2, y: must be a number within +-1,000,000,000, not -inf",
        ),
        ("1 0 1e10 2\n", {}, "line 1, x: must be a number within +-1,000,000,000, not 1e+10"),
        ("1 0 1 2\n1.5 1 1 2\n", {}, "line 2, id: must be a whole number"),
        ("1 0 1 2\n1 0.5 1 2\n", {}, "line 2, frame: must be a whole number"),
        ("Bob,0,1,2\nBob,1,1,inf\n", {}, "line 2, y: must be a number within"),
        ("id frame x y\n1 3 1 2\n2 3 1 2\n#\n1 3 1 3\n", {}, "line 5: must not be a second row"),
        ("id,frame,x\n1,0,1\n", {}, "header: must name the columns id, frame or time, and x and y"),
        ("id,x,y\n1,0,1\n", {}, "header: must name the columns"),
        ("id,frame,x,X,y\n1,0,1,1,1\n", {}, "header: must name one column x, not two"),
        ("id,time [min],x,y\n1,0,1,1\n", {}, "time: must be in s, ms, us, ns, not min"),
        (
            "id,t,lat,lon\n1,0,-34.6,-58.4\n",
            {"fps": None},
            "latitude, longitude: need [earth] in the recipe to be converted to metres: "
            'set crs = "EPSG:32721", latitude = -34.6000 and longitude = -58.4000',
        ),
        (
            "id,time,x,y\n1,2026-05-01T10:00,1,1\n1,1,1,1\n",
            {"fps": None},
            "line 3, time: must be a date with a time such as",
        ),
        (
            "anna,0.0,6,18\nanna,0.25,6,18\n",
            {"fps": None},
            "fps: must be given, as the file does "
            "not state it: write fps = 25 (its frames per second) in [[tracks]]; the file has no "
            "header, so its columns are read as id, frame, x, y; if the second column contains "
            'times, set columns = ["id", "time", "x", "y"]',
        ),
        ("id,t,x,y\n1,0,1,1\n", {}, "fps: must be left out"),
        (HEADED, {"columns": ("id", "x", "y")}, "line 2: must have 3 values, not 4"),
        (HEADED, {"columns": ("id", "-", "x", "y")}, "columns: must name the columns"),
        ("1 0 1 2 3 4\n", {}, "columns: must be given"),
        ("1 0 1\n", {}, "columns: must be given"),
        (HEADED, {"unit": None}, "unit: must be given"),
        (HEADED, {"fps": None}, "fps: must be given"),
        ("# unit: cm\n" + HEADED, {}, "unit: must be cm, as the file states, not m"),
        ("# framerate: 8\n" + HEADED, {}, "fps: must be 8.0, as the file states, not 1.0"),
        ("# unit: cm\n# x in mm\n" + HEADED, {}, "unit: must be one, but the file states cm and"),
        ("# fps: 8\n# fps: 9\n" + HEADED, {}, "fps: must be one, but the file states 8.0 and 9.0"),
        (
            "# framerate: 12,5 fps\n" + HEADED,
            {},
            "fps: must have a decimal point, not a comma: '12,5",
        ),
        ("# 12,5 Hz\n" + HEADED, {}, "fps: must have a decimal point, not a comma: '12,5'"),
        ("# 10 frames per second\n" + HEADED, {}, "fps: must be 10.0, as the file states, not 1.0"),
        ("# Hz = 10\n" + HEADED, {}, "fps: must be 10.0, as the file states, not 1.0"),
        ("# recorded at 10 Hz\n" + HEADED, {}, "fps: must be 10.0, as the file states, not 1.0"),
        ("# 25fps\n" + HEADED, {}, "fps: must be 25.0, as the file states, not 1.0"),
        (HEADED + "1,2,1_0,2\n", {}, "line 4, x: must be a number, not '1_0'"),
        (HEADED + "1,2,\u0661,2\n", {}, "line 4, x: must be a number, not '\u0661'"),
        ("# fps: 0\n" + HEADED, {"fps": None}, "fps: must be > 0"),
        (HEADED, {"fps": 0}, "fps: must be > 0"),
        (HEADED, {"fps": math.nan}, "fps: must be > 0"),
        (HEADED, {"unit": "yd"}, "unit: must be m, cm, mm, ft, us-ft, not 'yd'"),
        (HEADED.replace("x,y", "x/ft,y/ft"), {}, "unit: must be ft, as the file states, not m"),
        (HEADED.replace("x,y", "x_cm,y_cm"), {}, "unit: must be cm, as the file states, not m"),
        (
            HEADED.replace("x,y", "x/ft,y/ft"),
            {"columns": ("id", "frame", "x", "y")},
            "unit: must be ft, as the file states, not m",
        ),
        (HEADED.replace("x,y", "x [in],y [in]"), {}, "unit: must be m, cm, mm, ft, us-ft, but"),
        (HEADED.replace("x,y", "x_px,y_px"), {}, "unit: must be m, cm, mm, ft, us-ft, but"),
        ("# x and y in pixels\n" + HEADED, {}, "unit: must be m, cm, mm, ft, us-ft, but"),
        (HEADED, {"delimiter": "|"}, "delimiter: must be"),
        # A comment says the same wherever it stands, as in files that were joined.
        (HEADED + "# unit: cm\n", {}, "unit: must be cm, as the file states, not m"),
        (HEADED + "1,2,1,4 # framerate: 25\n", {}, "fps: must be 25.0, as the file states, not 1"),
        (
            "# framerate: 8\n" + HEADED + "# framerate: 16\n1,2,1,4\n",
            {"fps": None},
            "fps: must be one, but the file states 16.0 and 8.0",
        ),
        (HEADED + "# frame id x y\n2,1,1,4\n", {}, "columns: must be the same for all rows, id, "),
        *(
            (f"# framerate: {rate}\n" + HEADED, {"fps": None}, f"fps: must be a number of {words}")
            for rate in ("30000/1001", "1/16", "16.2.3", "15-16", "16x2")
            for words in (f"frames per second, but a comment states {rate!r}",)
        ),
        (
            "scene," + HEADED.replace("\n1,", "\nA,1,") + "B,1,9,1,2\n",
            {},
            "scene: must be the same in all rows, as ids or times may count anew in each, "
            "but is 'A' and 'B'; ",
        ),
        (
            "recordingId," + HEADED.replace("\n1,", "\n4,1,") + "5,1,9,1,2\n",
            {},
            "recordingId: must be the same in all rows",
        ),
        ("\ud800", {}, "must be a text file"),
    ],
)
def test_what_is_not_allowed_is_said(
    tmp_path: Path, text: str, options: dict[str, Any], words: str
) -> None:
    """One line, with the file's name, and the row's line where it is a row's fault."""
    path = tmp_path / "walk.txt"
    path.write_bytes(text.encode("utf-8", "surrogatepass"))
    with pytest.raises(ProblemError) as caught:
        Track.read_all(path, **{"unit": "m", "fps": 1, **options})
    assert str(caught.value).startswith(f"{path}: {words}")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "rate", ["16", "16.", "16.0 fps", "16fps", "16 Hz", "16Hz,", "16/s", "1.6e1", "16)", "16, 2 px"]
)
def test_spellings_of_a_frame_rate(tmp_path: Path, rate: str) -> None:
    """With a unit, and with whatever follows it in a sentence."""
    (found,) = read(tmp_path, f"# frame rate: {rate}\n" + HEADED, unit="m")
    assert found.times.tolist() == [0, 1 / 16]


def test_joined_files_that_say_the_same_are_read(tmp_path: Path) -> None:
    """Also where the names of their columns are spelt in another way."""
    head = "# framerate: 8\n# id frame x/m y/m\n"
    other = "# framerate: 8.0\n# ID FR x [m] y [m]\n"
    assert len(read(tmp_path, f"{head}1 0 1 2\n1 1 1 3\n{other}2 0 1 2\n2 1 1 3\n")) == 2


def test_ids_of_several_scenes_may_be_kept(tmp_path: Path) -> None:
    """If the caller names the columns without that of the scenes, and in files of one scene."""
    text = "scene," + HEADED.replace("\n1,", "\nA,1,")
    assert len(read(tmp_path, text, unit="m", fps=1)) == 1
    columns = ("-", "id", "frame", "x", "y")
    assert len(read(tmp_path, text + "B,2,1,1,2\n", unit="m", fps=1, columns=columns)) == 2


def test_ids_may_contain_the_sign_of_comments(tmp_path: Path) -> None:
    """It begins a comment only at the start of a line or after a blank; people are not joined."""
    for name, other in (("P#1", "P#2"), ("1#1", "1#2")):
        text = f"frame,x,y,id\n0,1,2,{name}\n#1,1,2,A\n1,1,2,{name} # stays\n2,1,3,{other}\n"
        assert [track.id for track in read(tmp_path, text, unit="m", fps=1)] == [name, other]
    with pytest.raises(ProblemError, match=r"line 2, id: must not have a blank before #, .*: #1"):
        read(tmp_path, "frame,x,y,id\n0,1,2,P #1\n1,1,2,P #2\n", unit="m", fps=1)


@pytest.mark.parametrize("ids", [("1", "2", "P7"), ("P7", "1", "2"), ("1", "1#2", "01")])
def test_if_some_ids_are_words_all_are(tmp_path: Path, ids: tuple[str, ...]) -> None:
    """Whichever comes first: as where vehicles have numbers and pedestrians a letter before."""
    text = "frame,x,y,id\n" + "".join(f"0,{k},2,{name}\n" for k, name in enumerate(ids))
    assert [track.id for track in read(tmp_path, text, unit="m", fps=1)] == sorted(ids)


@pytest.mark.parametrize(
    ("one", "other"), [("007", "07"), ("1000", "1e3"), ("7e0", "7.0"), ("+7", "7"), ("-0", "0")]
)
@pytest.mark.parametrize("time", ["0", "10:00:00"])
def test_ids_that_are_the_same_number_are_refused(
    tmp_path: Path, one: str, other: str, time: str
) -> None:
    """They may be of different people; beside words, they are different words."""
    later = time.replace("0", "1", 1)
    text = f"id,time,x,y\n{one},{time},1,2\n{other},{later},1,3\n"
    with pytest.raises(ProblemError) as caught:
        read(tmp_path, text, unit="m")
    assert {one, other.removesuffix(".0")} <= set(str(caught.value).split())
    assert "must not both be ids, as they are the same number" in str(caught.value)
    text = f"id,time,x,y,note\n{one},{time},1,2,a\n{other},{later},1,3,b\n"
    with pytest.raises(ProblemError, match="must not both be ids"):
        read(tmp_path, text, unit="m")
    words = text.replace("note\n", f"note\nA,{time},1,2,a\n")
    assert [track.id for track in read(tmp_path, words, unit="m")] == sorted([one, other, "A"])


def test_a_missing_file_is_said(tmp_path: Path) -> None:
    """It is wrong input, too."""
    with pytest.raises(ProblemError, match="no such file"):
        Track.read_all(tmp_path / "none.txt", unit="m", fps=1)


numbers = st.floats(-1e6, 1e6, allow_nan=False).map(lambda value: round(value, 4))


@st.composite
def walks(draw: st.DrawFn) -> list[Track]:
    """A few people at whole frames of 4 fps."""
    tracks = []
    for name in draw(st.lists(st.integers(-5, 99), min_size=1, max_size=4, unique=True)):
        frames = sorted(draw(st.sets(st.integers(-30, 30), min_size=1, max_size=8)))
        points = draw(st.lists(st.tuples(numbers, numbers), min_size=len(frames),
                               max_size=len(frames)))  # fmt: skip
        tracks.append(Track(name, np.array(frames) / 4, np.array(points), None))
    return sorted(tracks)


@given(walks(), st.randoms(use_true_random=False), st.sampled_from([" ", "\t", ",", ";"]))
@examples(60)
def test_rows_in_any_order_and_among_words(
    tmp_path_factory: pytest.TempPathFactory, tracks: list[Track], random: Any, separator: str
) -> None:
    """Rows are read as written: in any order, fast, and row by row if a column has words."""
    lines = [
        [f"{t.id}", f"{time * 4:g}", f"{x!r}", f"{y!r}"]
        for t in tracks
        for time, (x, y) in zip(t.times.tolist(), t.points.tolist(), strict=True)
    ]
    random.shuffle(lines)
    folder = tmp_path_factory.mktemp("walk")
    for extra, columns in (("0", "-"), ("word", "-"), ('"0"', "note")):
        text = "".join(separator.join([*line, extra]) + "\n" for line in lines)
        options: dict[str, Any] = {"columns": ("id", "frame", "x", "y", columns)}
        assert same(read(folder, text, unit="m", fps=4, **options), tracks)


# -- warnings -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("rows", "unit", "words"),
    [
        ([(0, 0, 170), (130, 0, 170)], "cm", []),
        ([(0, 0, 170), (130, 0, 170)], "m", ["130 m/s: is the unit cm, or is fps = 1 right?",
                                             "height of 1 of 1 people is outside 0.4..2.6 m, 170 m "
                                             "for id 1: is the unit cm?"]),
        ([(0, 0, 1.7), (1.3, 0, 1.7)], "cm", ["is the unit m?", "within 0.013 m"]),
        ([(0, 0, 1.7), (1.3, 0, 1.7)], "m", []),
        ([(0, 0, 1.7), (0, 0, 1.7)], "m", []),  # somebody stands
        ([(0, 0, 1.7), (30, 0, 1.7)], "m", ["median speed 30 m/s: is fps = 1 right?"]),
        ([(0, 0, 1.7), (15, 0, 1.7)], "m", ["median speed 15 m/s: is fps = 1 right?"]),
        ([(0, 0, 12.0), (1, 0, 12.0)], "m", ["is z a height above the floor?"]),
        ([(0, 0, 0), (5e5, 0, 0)], "m", ["median speed", "all points lie within 500 km"]),
        ([(13.059, 52.4, 1.7), (13.06, 52.4, 1.7)], "m", ["are they degrees?"]),
        ([(0, 0, -1.7), (1, 0, -1.7)], "m", ["below 0 for 1 of 1 people, -1.7 m for id 1: does z"]),
    ],
)  # fmt: skip
def test_odd_tracks_are_warned_of(
    tmp_path: Path,
    caplog: pytest.LogCaptureFixture,
    rows: list[tuple[float, float, float]],
    unit: Any,
    words: list[str],
) -> None:
    """A wrong unit is likely where people race, are giants or dwarfs, or fill no room."""
    text = "".join(f"1 {t} {x} {y} {z}\n" for t, (x, y, z) in enumerate(rows))
    with caplog.at_level(logging.WARNING, logger="cocap_opt.scenarios.tracks"):
        read(tmp_path, text, unit=unit, fps=1)
    assert len(caplog.messages) == len(words)
    for message, word in zip(caplog.messages, words, strict=True):
        assert message.startswith(f"{tmp_path / 'walk.txt'}: ") and word in message


def test_when_step_0_is_is_said_if_tracks_begin_before(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """A gap in a track puts step 0 behind it, and the actor keeps the time of its track."""
    rows = [f"ann,2026-05-01T10:00:{t:02d}.1,{t},1" for t in range(20)]
    rows += [f"bob,2026-05-01T10:00:{t:02d}.1,{t},3" for t in range(20) if not 3 < t < 7]
    (tmp_path / "walk.csv").write_text("\n".join(["id,time,x [m],y [m]", *rows]))
    table = TracksTable(file="walk.csv", count=2)
    terrain = MapTable(size=(20.0, 4.0)).terrain(tmp_path, "above-ground")
    for steps, begin in ((3, 0.0), (9, 7.0)):
        caplog.clear()
        actors, _ = table.actors(tmp_path, terrain, 1.0, steps, NOWHERE)
        assert [actor.begin for actor in actors] == [begin, begin]
        assert actors[0].poses[0, 0] == begin
        assert ("step 0 is 7 s into the tracks, because only then are 2 people present for 9 s; id "
                "bob is present from 0 to 3 s and from 7 to 19 s; set begin" in caplog.text) == (
            steps == 9
        )  # fmt: skip
    words = r"for more than 3 s from begin = 0 s on; set steps = 3, or another begin"
    with pytest.raises(ProblemError, match=words):
        TracksTable(file="walk.csv", count=2, begin=0.0).actors(tmp_path, terrain, 1.0, 9, NOWHERE)


def test_who_stands_does_not_make_the_rest_fast(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """The median is over people who move: a crowd that waits hides no wrong unit."""
    standing = "".join(f"{k} {t} {k} 0\n" for k in range(5) for t in range(2))
    read(tmp_path, standing + "9 0 0 0\n9 1 130 0\n", unit="m", fps=1)
    assert "median speed 130 m/s" in caplog.text


def test_a_single_bad_row_is_named(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """One wrong position, or an id that goes over to somebody else, is no matter of the unit."""
    rows = [[1, frame, 5 + 0.05 * frame, 5.0] for frame in range(100)]
    rows[30][2] = 1e6
    text = "".join(" ".join(map(str, row)) + "\n" for row in rows)
    read(tmp_path, text, unit="m", fps=25)
    (message,) = caplog.messages
    assert "line 31: id 1 is 1,000 km from where it was 0.04 s before, the first of 2" in message


def test_people_in_one_place_raise_warnings(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """Nobody stands in another: metres read as centimetres are seen, though the room is long."""
    text = "".join(f"{k} {t} {2 * k + 0.1 * t} {k}\n" for k in range(60) for t in range(20))
    read(tmp_path, text, unit="m", fps=25)
    assert not caplog.messages
    read(tmp_path, text, unit="cm", fps=25)
    assert "to the nearest person is 0.022 m: is the unit m?" in caplog.text


# -- at steps -----------------------------------------------------------------------------


@given(
    st.tuples(st.floats(-50, 50), st.floats(-50, 50)),
    st.tuples(st.floats(-3, 3), st.floats(-3, 3)),
    st.sampled_from([1.0, 2.5, 8.0, 16.0, 25.0, 29.97]),
    st.integers(1, 12),
    st.floats(0, 1),
)
@examples(100)
def test_straight_walks_are_exact(
    origin: tuple[float, float],
    velocity: tuple[float, float],
    fps: float,
    steps: int,
    begin: float,
) -> None:
    """At constant speed the points are those of the line, at any frame rate and half of it."""
    step = (10.0 - begin) / steps / 1.2
    times = np.arange(math.ceil(10 * fps) + 3) / fps
    line = Track(1, times, np.array(origin) + np.outer(times, velocity), None)
    halved = Track(1, times[::2], line.points[::2], None)
    moments = begin + step * np.arange(steps + 1)
    assume(moments[-1] <= halved.times[-1])
    exact = np.array(origin) + np.outer(moments, velocity)
    assert line.at_steps(begin, step, steps) == pytest.approx(exact, abs=1e-9)
    if fps >= 2:  # else every second frame leaves gaps
        assert halved.at_steps(begin, step, steps) == pytest.approx(exact, abs=1e-9)


@given(st.lists(st.tuples(numbers, numbers), min_size=2, max_size=9), st.integers(1, 30))
@examples(60)
def test_frames_are_met_exactly(points: list[tuple[float, float]], fps: int) -> None:
    """Steps at frames have their points, from the first to the last, whatever rounding does."""
    tracked = track([k / fps for k in range(len(points))], points)
    found = tracked.at_steps(0.0, 1 / fps, len(points) - 1)
    assert found == pytest.approx(np.array(points), rel=1e-9, abs=1e-6)
    assert np.array_equal(tracked.at_steps(0.0, 1 / fps, 1), points[:2])


def test_rounding_takes_nobody_away() -> None:
    """3 x 0.1 s is later than 3/10 s, where the track ends or a gap begins; and is there."""
    ends = track([k / 10 for k in range(4)], [(k, 0.0) for k in range(4)])
    gap = track([*ends.times, 3.0], [*ends.points, (9.0, 0.0)])
    assert ends.times[-1] < 3 * 0.1
    for tracked in (ends, gap):
        assert tracked.at_steps(0.0, 0.1, 3)[3] == pytest.approx([3.0, 0.0])


def test_absence_is_said() -> None:
    """Before the first frame, after the last, and when there are spans between."""
    tracked = track([1.0, 2.0, 5.0, 5.5], [(0, 0)] * 4)
    words = (
        r"^track 7: must be present at step 2 \(3 s\), but is present from 1 to 2 s and from 5 to"
    )
    with pytest.raises(ProblemError, match=words):
        tracked.at_steps(1.0, 1.0, 4)
    rare = track([60.0 * k for k in range(9)], [(0, 0)] * 9)
    with pytest.raises(ProblemError, match=r"from 120 to 120 s and at 6 more times$"):
        rare.at_steps(0.0, 1.0, 1)
    for begin, step in ((0.5, 0.5), (5.25, 0.5)):
        with pytest.raises(ProblemError, match="must be present"):
            tracked.at_steps(begin, step, 1)


def test_gaps_are_not_walked_over() -> None:
    """Nobody is there inside a gap of more than a second; at its ends they are."""
    points = [(0.0, 0.0), (4.0, 0.0), (5.0, 0.0)]
    short, long = track([0.0, 1.0, 2.0], points), track([0.0, 1.1, 2.0], points)
    assert short.at_steps(0.0, 0.5, 4)[1].tolist() == [2.0, 0.0]
    with pytest.raises(ProblemError, match="must be present at step 1"):
        long.at_steps(0.0, 0.5, 4)
    assert long.at_steps(0.0, 1.1, 1).tolist() == [[0.0, 0.0], [4.0, 0.0]]
    assert track([0.0, 60.0], points[:2]).at_steps(0.0, 60.0, 1).tolist() == [[0, 0], [4, 0]]


@given(walks(), st.integers(-30, 30), st.integers(1, 12), st.integers(1, 6))
@examples(55)
def test_present_are_those_who_can_walk(
    tracks: list[Track], begin: int, step: int, steps: int
) -> None:
    """People are there if and only if `at_steps` works; by brute force, too."""
    times = [begin / 8 + t * step / 8 for t in range(steps + 1)]

    def there(tracked: Track, time: float) -> bool:
        spans = pairwise(tracked.times.tolist())
        return time in tracked.times or any(a <= time <= b and b - a <= 1 for a, b in spans)

    found = {t.id for t in tracks if t.is_there(begin / 8, step / 8, steps)}
    assert found == {t.id for t in tracks if all(there(t, time) for time in times)}
    for t in tracks:
        if t.id in found:
            assert t.at_steps(begin / 8, step / 8, steps).shape == (steps + 1, 2)
        else:
            with pytest.raises(ProblemError):
                t.at_steps(begin / 8, step / 8, steps)


@pytest.mark.parametrize(
    ("begin", "step", "steps", "field"),
    [
        (math.nan, 1.0, 2, "begin"),
        (0.0, 0.0, 2, "step"),
        (0.0, math.nan, 2, "step"),
        (0.0, -1.0, 2, "step"),
        (0.0, 1.0, 0, "steps"),
        (0.0, 1.0, 10_001, "steps"),
    ],
)
def test_steps_are_checked(begin: float, step: float, steps: int, field: str) -> None:
    """Both methods check their parameters."""
    for attempt in (
        lambda: walk().at_steps(begin, step, steps),
        lambda: walk().is_there(begin, step, steps),
    ):
        with pytest.raises(ProblemError, match=f"^{field}: must be"):
            attempt()


# -- headings -----------------------------------------------------------------------------

# Metres on a coarse grid, half a cell away from the distance that counts as standing.
STEP, STILL = 1.0, 0.3
paths = st.lists(st.tuples(st.integers(-4, 4), st.integers(-4, 4)), min_size=2, max_size=12).map(
    lambda points: STEP * np.array(points, dtype=np.float64)
)


def turned(first: FloatArray, second: FloatArray) -> FloatArray:
    """Difference of angles, in (-pi, pi]."""
    return np.asarray(np.angle(np.exp(1j * (first - second))))


def moves(path: FloatArray) -> bool:
    """Return True if the person moves at all; otherwise the heading is 0 in any turned copy."""
    return bool((np.hypot(*np.gradient(path, axis=0).T) >= STILL).any())


@given(paths, st.floats(-7, 7), st.floats(-100, 100))
@examples(150)
def test_headings_turn_with_the_walk(path: FloatArray, angle: float, shift: float) -> None:
    """Turning turns them, mirroring mirrors them, shifting changes nothing."""
    assume(moves(path))
    c, s = math.cos(angle), math.sin(angle)
    yaw = headings(path, STILL)
    around = headings(path @ np.array([[c, s], [-s, c]]), STILL)
    assert turned(around, yaw + angle) == pytest.approx(np.zeros(len(path)), abs=1e-9)
    mirrored = headings(path * np.array([1.0, -1.0]), STILL)
    assert turned(mirrored, -yaw) == pytest.approx(np.zeros(len(path)), abs=1e-9)
    moved = headings(path + np.array([shift, -2 * shift]), STILL)
    assert turned(moved, yaw) == pytest.approx(np.zeros(len(path)), abs=1e-9)
    for found in (yaw, around, mirrored, moved):
        assert (found > -math.pi).all() and (found <= math.pi).all()


@given(paths)
@examples(80)
def test_headings_by_their_definition(path: FloatArray) -> None:
    """From the step before to the step after, kept while standing: by slow, obvious loops."""
    end = len(path) - 1
    expected: list[float | None] = []
    for t in range(len(path)):
        before, after = max(t - 1, 0), min(t + 1, end)
        dx, dy = (path[after] - path[before]) / (after - before)
        standing = math.hypot(dx, dy) < STILL
        expected.append((expected[-1] if t else None) if standing else math.atan2(dy, dx))
    first = next((yaw for yaw in expected if yaw is not None), 0.0)
    filled = np.array([first if yaw is None else yaw for yaw in expected])
    assert turned(headings(path, STILL), filled) == pytest.approx(np.zeros(len(path)), abs=1e-12)


def test_headings_of_known_walks() -> None:
    """A walk north, a wobbly halt, then west; a person who never walks looks along +x."""
    path = np.array([[0, 0], [0.01, 0], [0, 1], [0, 2], [0, 2.02], [0, 2], [-1, 2], [-2.0, 2.0]])
    north, west = math.pi / 2, math.pi
    assert headings(path, 0.1)[[0, 1, 2, 3, 4]] == pytest.approx([math.atan2(1, 0)] * 5, abs=0.02)
    assert headings(path, 0.1)[5:] % math.tau == pytest.approx([west] * 3, abs=0.03)
    assert headings(path[3:6], 0.1).tolist() == [0.0, 0.0, 0.0]
    assert headings(path[3:6], 0.0)[0] == pytest.approx(north)
    assert headings(np.zeros((4, 2)), 0.0).tolist() == [0.0] * 4
    assert headings(path[[6, 7, 7, 7]], 0.0).tolist() == [math.pi] * 4
    assert headings(np.array([[0.0, 0.0], [-1.0, -0.0]]), 0.1).tolist() == [math.pi] * 2
    assert headings(np.array([[0.0, 0.0], [-1.0, -1e-300]]), 0.1).tolist() == [math.pi] * 2
    assert headings(np.zeros((1, 2)), 0.1).tolist() == [0.0]
    with pytest.raises(ProblemError, match="still: must be >= 0"):
        headings(path, math.nan)


# -- actors -------------------------------------------------------------------------------


@pytest.mark.parametrize("shape", [Prism(), Cuboid(length=0.3, width=0.5), TriangulatedCuboid()])
def test_an_actor_walks_its_track(shape: Prism | Cuboid | TriangulatedCuboid) -> None:
    """Its feet are on the ground below the track, it looks ahead, and is as tall as the file says.

    Where the file does not say, it is as tall as the caller's shape.
    """
    tracked = walk()
    tall = tracked._replace(height=1.62)
    walker = tall.actor(1.0, 0.5, 4, shape=shape, ground=lambda x, y: x - y)
    points = tracked.at_steps(1.0, 0.5, 4)
    assert walker.poses[:, :2].tolist() == points.tolist()
    assert walker.poses[:, 2] == pytest.approx(points[:, 0] - points[:, 1])
    assert walker.poses[:, 3] == pytest.approx(np.full(5, math.atan2(-0.5, 1.5)))
    assert walker.shape == shape.replace(height=1.62)
    plain = tracked.actor(1.0, 0.5, 4, shape=shape)
    assert plain.shape == shape
    assert plain.poses[:, 2].tolist() == [0.0] * 5


# -- files of others ----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "options", "people", "end", "largest"),
    [
        ("040_c_56_h-.txt", {}, 75, 66.24, 8.0),
        ("uo-050-180-180.txt", {"unit": "cm", "fps": 16}, 61, 63.5625, 15.0),
    ],
)
def test_their_files(
    name: str,
    options: dict[str, Any],
    people: int,
    end: float,
    largest: float,
    caplog: pytest.LogCaptureFixture,
) -> None:
    """People of human height walk at human speed through rooms of human size, without warnings."""
    tracks = Track.read_all(data(f"pedestrians/{name}"), **options)
    assert len(tracks) == people and not caplog.messages
    assert max(t.times[-1] for t in tracks) == pytest.approx(end)
    assert all(t.height is not None and 1.4 < t.height < 2.0 for t in tracks)
    points = np.concatenate([t.points for t in tracks])
    assert np.ptp(points, axis=0).max() < largest
    there = [t for t in tracks if t.is_there(36.0, 0.5, 10)]
    assert len(there) > 3
    for t in there:
        walker = t.actor(36.0, 0.5, 10)
        speeds = np.hypot(*np.diff(walker.poses[:, :2], axis=0).T) / 0.5
        assert speeds.max() < 3.0


def test_their_units_are_held_against_ours(caplog: pytest.LogCaptureFixture) -> None:
    """A file that states its unit is not read in another; one that does not raises warnings."""
    stated, silent = (
        data(f"pedestrians/{name}") for name in ("040_c_56_h-.txt", "uo-050-180-180.txt")
    )
    with pytest.raises(ProblemError, match="unit: must be m, as the file states, not cm"):
        Track.read_all(stated, unit="cm")
    with pytest.raises(ProblemError, match=r"fps: must be 25\.0, as the file states, not 16"):
        Track.read_all(stated, fps=16)
    Track.read_all(silent, unit="m", fps=16)
    assert "is the unit cm, or is fps = " in caplog.text


WALKERS = [
    (person, frame, 1.0 * person + 0.05 * frame, 3.0 * person)
    for person in range(1, 5)
    for frame in range(10 * person, 10 * person + 40)
]


@pytest.mark.parametrize("order", [(0, 1), (1, 0)], ids=["id frame", "frame id"])
def test_columns_that_nothing_names_are_told_by_how_people_move(
    tmp_path: Path, order: tuple[int, int], caplog: pytest.LogCaptureFixture
) -> None:
    """ETH, UCY and others write the frame first; a wrong reading would be nonsense."""
    path = tmp_path / "tracks.txt"
    rows = sorted((row[order[0]], row[order[1]], *row[2:]) for row in WALKERS)
    path.write_text("".join(" ".join(map(str, row)) + "\n" for row in rows))
    tracks = Track.read_all(path, unit="m", fps=25.0)
    assert [track.id for track in tracks] == [1, 2, 3, 4]
    assert {len(track.times) for track in tracks} == {40}
    assert ("frame id x y" in caplog.text) == (order == (1, 0))


def test_columns_that_fit_both_readings_are_refused(tmp_path: Path) -> None:
    """The message has both readings, and the line to write."""
    path = tmp_path / "tracks.txt"
    path.write_text("".join(f"{a} {b} {a} {b}\n" for a in range(9) for b in range(9)))
    with pytest.raises(ProblemError, match=r'columns = \["id", "frame", "x", "y"\] or \["frame"'):
        Track.read_all(path, unit="m", fps=25.0)
    assert len(Track.read_all(path, columns=["frame", "id", "x", "y"], unit="m", fps=25.0)) == 9


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"\x89HDF\r\n\x1a\n" + bytes(20), "is HDF5; export its trajectories"),
        (b'1 10 20 30 40 5 0 0 0 "Biker"\n', "annotations.txt of the Stanford"),
    ],
)
def test_other_exports_of_tracks_are_refused_with_the_way_out(
    tmp_path: Path, content: bytes, words: str
) -> None:
    """One line says what the file is and what to do."""
    path = tmp_path / "tracks"
    path.write_bytes(content)
    with pytest.raises(ProblemError, match=words):
        Track.read_all(path, unit="m", fps=25.0)


def test_a_pipe_is_refused(tmp_path: Path) -> None:
    """Reading it would wait for somebody to write."""
    path = tmp_path / "tracks"
    os.mkfifo(path)
    with pytest.raises(ProblemError, match="regular file"):
        Track.read_all(path, unit="m", fps=25.0)


def database(folder: Path, *statements: str) -> Path:
    """A database that some statements have made."""
    path = folder / "people #1.sqlite"
    with closing(sqlite3.connect(path)) as connection, connection:
        for statement in statements:
            connection.execute(statement)
    return path


TRAJECTORIES = (
    "create table trajectory_data (frame integer, id integer, pos_x real, pos_y real, ori_x real)"
)
PEOPLE = "insert into trajectory_data values (0, 7, 1.5, 2, 0), (1, 7, 1.75, 2, 0), (0, 3, 9, 9, 0)"
METADATA = "create table metadata (key text, value text)"
RATE = "insert into metadata values ('version', '2'), ('fps', '10.0')"


def test_databases_of_jupedsim_are_read(tmp_path: Path) -> None:
    """They are in metres, and state their frame rate, which is held against ours."""
    path = database(tmp_path, TRAJECTORIES, PEOPLE, METADATA, RATE)
    first = RATE.replace("'2'", "'1'"), RATE.replace("('version', '2'), ", "")
    for folder, rate in zip(("1", "none"), first, strict=True):
        (tmp_path / folder).mkdir()
        old = database(tmp_path / folder, TRAJECTORIES, PEOPLE, METADATA, rate)
        assert [track.id for track in Track.read_all(old)] == [3, 7]
    three, seven = Track.read_all(path)
    assert (three.id, seven.id, seven.height) == (3, 7, None)
    assert seven.times.tolist() == [0, 0.1] and seven.points.tolist() == [[1.5, 2], [1.75, 2]]
    assert [track.id for track in Track.read_all(path, unit="m", fps=10.00001)] == [3, 7]
    for options, words in (
        ({"fps": 25}, "fps: must be 10.0, as the file states, not 25"),
        ({"unit": "cm"}, "unit: must be m, as the file states, not cm"),
        ({"columns": ["id", "frame", "x", "y"]}, "columns: must be left out for a database"),
        ({"delimiter": ","}, "delimiter: must be left out for a database"),
    ):
        with pytest.raises(ProblemError, match=words):
            Track.read_all(path, **options)


@pytest.mark.parametrize(
    ("statements", "words"),
    [
        ((TRAJECTORIES, PEOPLE), "fps: must be given, .*: write fps = 25 .its frames per second"),
        ((TRAJECTORIES, METADATA, RATE), "trajectory_data: must contain at least one row"),
        ((METADATA, RATE), "must have the table trajectory_data, .*; its tables: metadata"),
        (("create view trajectory_data as select 1",), "must have the table trajectory_data"),
        (("create table trajectory_data (id, frame, x, y)",), "must have the column pos_x"),
        ((TRAJECTORIES, PEOPLE.replace("1.75", "'far'"), METADATA, RATE),
         "trajectory_data, row 2, pos_x: must be a number, not 'far'"),
        ((TRAJECTORIES, PEOPLE.replace("1.75", "null"), METADATA, RATE), "a number, not nothing"),
        ((TRAJECTORIES, PEOPLE.replace("(1, 7", "(0.5, 7"), METADATA, RATE),
         "trajectory_data, row 2, frame: must be a whole number"),
        ((TRAJECTORIES, PEOPLE.replace("(1, 7", "(0, 7"), METADATA, RATE),
         "row 2: must not be a second row for id 7 at 0 s; the first is trajectory_data, row 1"),
        ((TRAJECTORIES, PEOPLE, METADATA, RATE.replace("10.0", "ten")), "fps: must be a number, n"),
        ((TRAJECTORIES, PEOPLE, METADATA, RATE.replace("'2'", "'3'")),
         r"metadata, version: must be 1\.\.2, .*, not 3; write its people as a table"),
        ((TRAJECTORIES, PEOPLE, METADATA, RATE.replace("'2'", "'1.5'")), "version: .*, not 1.5;"),
        ((TRAJECTORIES, PEOPLE, METADATA, RATE.replace("'2'", "'new'")), "version: must be a numb"),
    ],
)  # fmt: skip
def test_other_databases_are_refused(
    tmp_path: Path, statements: tuple[str, ...], words: str
) -> None:
    """In our words, which name the table, the row and the column."""
    path = database(tmp_path, *statements)
    with pytest.raises(ProblemError, match=words) as caught:
        Track.read_all(path)
    assert str(caught.value).startswith(f"{path}: ")


def test_a_damaged_database_is_refused(tmp_path: Path) -> None:
    """In our words, not in those of SQLite."""
    path = database(tmp_path, TRAJECTORIES, PEOPLE, METADATA, RATE)
    content = path.read_bytes()
    for damaged in (content[:100], content[:5000], content[:16] + b"x" * 5000):
        path.write_bytes(damaged)
        with pytest.raises(ProblemError, match="is an SQLite database that cannot be read"):
            Track.read_all(path)


@pytest.mark.parametrize(
    ("fps", "last", "warned"), [(10, "0.2", False), (5, "0.2", True), (5, "late", False)]
)
def test_frames_that_last_otherwise_than_times_are_told(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, fps: float, last: str, warned: bool
) -> None:
    """A frame rate that is given counts, but a file that has times may contradict it."""
    rows = "".join(f"1,{k},{t},{0.1 * k:.1f},0\n" for k, t in enumerate(["0", "0.1", last]))
    (found,) = read(tmp_path, f"id,frame,time,x,y\n{rows}", unit="m", fps=fps)
    assert found.times[-1] == 2 / fps
    words = "the column frame lasts 0.4 s at fps = 5, the column time 0.2 s: frames are used"
    assert (words in caplog.text) == warned
