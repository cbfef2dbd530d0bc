"""Files as other programs write them: each rule with several spellings of the same kind."""

import json
from pathlib import Path
from typing import Any

import pytest

import cocap_opt as co
from cocap_opt.data import ProblemError
from cocap_opt.scenarios import load_scene
from cocap_opt.scenarios.maps.building_heights import STOREY, extent
from cocap_opt.scenarios.maps.raster_files import read_raster
from cocap_opt.scenarios.tracks import Track

GRID = [[0, 0, 5], [0, 12.5, 0]]  # the northernmost row first


def tracks(folder: Path, text: str, name: str = "walk.csv", **options: Any) -> list[Track]:
    """Tracks of a file with this text, in metres unless stated otherwise."""
    (folder / name).write_text(text, "utf-8")
    return Track.read_all(folder / name, **({"unit": "m"} | options))


# -- columns ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "names",
    [
        "trackId,frame,xCenter,yCenter",
        "track_id,frame,x_center,y_center",
        "tagId,Frame,x,y",
        "player,frame index,x_est,y_est",
        "name,frame,easting,northing",
        "participant_id,frame no,Center X,Center Y",
        "id,frame,x,y",
    ],
)
def test_columns_have_the_names_of_other_programs(tmp_path: Path, names: str) -> None:
    """Data sets of traffic, tags for indoor positioning, football, total stations."""
    [track] = tracks(tmp_path, f"{names}\n7,0,1,2\n7,25,3,2\n", fps=25)
    assert (track.id, track.times.tolist(), track.points.tolist()) == (7, [0, 1], [[1, 2], [3, 2]])


@pytest.mark.parametrize(
    "names", ["id,name,t,x,y", "name,id,t,x,y", "tag,id,t,x,y", "id,player,t,x,y"]
)
def test_a_usual_name_wins_over_a_rarer_one(tmp_path: Path, names: str) -> None:
    """A file may have both, in any order."""
    row = "1,2" if names.startswith("id") else "2,1"
    [track] = tracks(tmp_path, f"{names}\n{row},0,0,0\n{row},1,1,0\n")
    assert track.id == 1


@pytest.mark.parametrize("word", ["z (height) [mm]", "position z (height) [mm]", "z [mm]"])
def test_the_unit_may_be_in_a_second_bracket(tmp_path: Path, word: str) -> None:
    """As in the header of the ATC data set."""
    text = f"person id,t,position x [mm],position y [mm],{word}\n1,0,1000,0,1700\n1,1,2000,0,1700\n"
    [track] = tracks(tmp_path, text, unit=None)
    assert (track.points.tolist(), track.height) == ([[1, 0], [2, 0]], 1.7)


@pytest.mark.parametrize(
    ("names", "shown"),
    [
        ("team,player_id,x_loc,y_loc,moment", '["-", "id", "x", "y", "-"] in [[tracks]] with time'),
        ("id,time,across,up", '["id", "time", "-", "-"] in [[tracks]] with x and y in the right'),
        ("id,time,x,up", '["id", "time", "x", "-"] in [[tracks]] with y in the right place'),
        ("t,x1,y1,x2,y2", "write a row for each person and moment"),
        (
            "Runner,Clock,Along,Across",
            'if it has id, time, x and y under other names, set columns = ["-", "-", "-", "-"] in '
            "[[tracks]] with id, time, x and y in the right places: the words of this program",
        ),
        ("Clock,Along,Across", 'if it has time, x and y under other names, set columns = ["-", "'),
        ("id,frame,x", "not id, frame, x\n"),
        ("Along,Across", "not Along, Across\n"),
    ],
)
def test_a_header_without_a_column_gets_the_columns_to_set(
    tmp_path: Path, names: str, shown: str
) -> None:
    """The message lists what was recognised, if anything, ready to be completed; not if the file
    has too few columns.
    """
    row = ",".join("1" for _ in names.split(","))
    with pytest.raises(ProblemError) as told:
        tracks(tmp_path, f"{names}\n{row}\n")
    assert shown in f"{told.value}\n"


def test_rows_without_a_header_get_the_columns_of_known_data_sets(tmp_path: Path) -> None:
    """obsmat.txt of ETH has the height in the fourth of eight columns."""
    text = "780 1 8.4 0 3.5 1 0 0\n786 1 8.8 0 3.6 1 0 0\n"
    with pytest.raises(ProblemError, match=r'\["frame", "id", "x", "-", "y", "-", "-", "-"\]'):
        tracks(tmp_path, text)
    columns = ["frame", "id", "x", "-", "y", "-", "-", "-"]
    [track] = tracks(tmp_path, text, columns=columns, fps=15)
    assert track.points.tolist() == [[8.4, 3.5], [8.8, 3.6]]
    assert track.times[1] - track.times[0] == pytest.approx(0.4)


def test_a_file_of_one_person_needs_no_ids(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """As loggers of a phone or a tag write it; several rows for one moment are several people."""
    [track] = tracks(tmp_path, "time,x,y\n0,0,0\n1,1,0\n", name="ada.csv")
    assert track.id == "ada"
    assert "all rows are read as one person, ada" in caplog.text
    with pytest.raises(ProblemError, match="header: must name the columns id"):
        tracks(tmp_path, "time,x,y\n0,0,0\n0,1,0\n")


@pytest.mark.parametrize(
    "header",
    ["% id time x y", "// id time x y", "%% id time x y", "# id time x y", "sep=;\nid;time;x;y"],
)
def test_a_header_may_begin_like_a_comment(tmp_path: Path, header: str) -> None:
    """Of MATLAB, C and Python; and Excel's line that names the separator is no header."""
    separator = ";" if ";" in header else " "
    rows = "".join(separator.join(row) + "\n" for row in ("1000", "1110"))
    [track] = tracks(tmp_path, f"{header}\n{rows}")
    assert (track.id, track.points.tolist()) == (1, [[0, 0], [1, 0]])


def test_repeated_rows_are_one_row(tmp_path: Path) -> None:
    """The same person at the same place at the same moment; at another place it is an error."""
    text = "id,time,x,y\n1,0,0,0\n1,1,1,0\n1,1,1,0\n2,1,1,0\n1,2,2,0\n"
    first, _ = tracks(tmp_path, text)
    assert first.times.tolist() == [0, 1, 2]
    with pytest.raises(ProblemError, match="line 7: must not be a second row for id 1 at 2 s"):
        tracks(tmp_path, text + "1,2,2,1\n")
    with pytest.raises(ProblemError, match="line 3: must not be a second row for id 1 at 0 s"):
        tracks(tmp_path, "id,time,x,y,z\n1,0,0,0,1.8\n1,0,0,0,1.2\n1,1,1,0,1.8\n")


@pytest.mark.parametrize(
    ("names", "row", "said"),
    [
        ("latitude [rad],longitude [rad]", "0.91,0.22", "must be in degrees, not in rad"),
        ("lat_rad,lon_rad", "0.91,0.22", "must be in degrees, not in rad"),
        ("lat,lon", "524000000,130600000", "write decimal degrees"),
        ("lat,lon", "5224.001,01303.6", "write decimal degrees"),
        ("lat,NS,lon,EW", "52.4,N,13.06,W", "EW: must be left out"),
        ("lat,NS,lon,EW", "52.4,s,13.06,E", "NS: must be left out"),
        # what is right asks only for the place
        ("lat,NS,lon,EW", "52.4,N,13.06,E", "need .earth."),
        ("lat,NS,lon,EW", "52.4,N,-13.06,W", "need .earth."),
        ("lat_deg,lon_deg", "52.4,13.06", "need .earth."),
        ("Latitude (\N{DEGREE SIGN}),Longitude (\N{DEGREE SIGN})", "52.4,13.06", "need .earth."),
    ],
)
def test_degrees_are_decimal_and_have_signs(
    tmp_path: Path, names: str, row: str, said: str
) -> None:
    """Radians, minutes, parts of 1e7 and letters for the hemisphere would be other places."""
    with pytest.raises(ProblemError, match=said):
        tracks(tmp_path, f"id,time,{names}\n1,0,{row}\n1,1,{row}\n", unit=None)


# -- missing positions and times ----------------------------------------------------------------


@pytest.mark.parametrize("lost", ["nan,nan", "NaN,NaN", ",", "NA,NA", "null,null", "None,None"])
def test_rows_without_a_position_are_moments_without_a_person(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, lost: str
) -> None:
    """A short gap is bridged; in a long one the person is absent; lines keep their numbers."""
    rows = [(k, lost if k in (1, 4, 5, 6) else f"{k},0") for k in range(10)]
    text = "id,time,x,y\n" + "".join(f"1,{0.5 * k},{point}\n" for k, point in rows)
    [track] = tracks(tmp_path, text)
    assert track.points[:, 0].tolist() == [0, 2, 3, 7, 8, 9]
    assert track.spans() == [(0, 1.5), (3.5, 4.5)]
    assert "4 of 10 rows have no position" in caplog.text
    with pytest.raises(ProblemError, match="line 12: must not be a second row"):
        tracks(tmp_path, text + "1,4.5,1,1\n")


@pytest.mark.parametrize("half", ["nan,1", ",1", "1,NA"])
def test_half_a_position_is_refused(tmp_path: Path, half: str) -> None:
    """It is more likely an error than a loss."""
    with pytest.raises(ProblemError, match=r"line 3, [xy]: must be"):
        tracks(tmp_path, f"id,time,x,y\n1,0,0,0\n1,1,{half}\n")


@pytest.mark.parametrize(
    ("first", "second"),
    [
        ("00:00:59.5", "00:01:00.5"),
        ("9:59:59.5", "10:00:00.5"),
        ("23:58:59,5", "23:59:00,5"),
        ("100:00:59.5", "100:01:00.5"),
    ],
)
def test_times_of_day_are_read(tmp_path: Path, first: str, second: str) -> None:
    """Hours, minutes and seconds without a date."""
    [track] = tracks(tmp_path, f"id;time;x;y\n1;{first};0;0\n1;{second};1;0\n")
    assert track.times[1] - track.times[0] == pytest.approx(1)


@pytest.mark.parametrize(
    ("times", "match"),
    [
        (("23:59:59", "00:00:00"), "pass midnight"),
        (("10:00:00", "5"), "line 3, time: must be a time of day"),
        (("10:00.5", "10:01.5"), "a time of day such as"),
    ],
)
def test_times_of_day_that_could_mean_two_things_are_refused(
    tmp_path: Path, times: tuple[str, str], match: str
) -> None:
    """Midnight, other times among them, and two numbers of unknown meaning."""
    with pytest.raises(ProblemError, match=match):
        tracks(tmp_path, "id,time,x,y\n" + "".join(f"1,{time},0,0\n" for time in times))


def test_a_clock_that_counts_down_is_doubted(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """The clock of a game turns all walks around; newest rows first have dates, mostly."""
    tracks(tmp_path, "id,time,x,y\n" + "".join(f"1,{720 - k},{k},0\n" for k in range(5)))
    assert "times decrease from row to row" in caplog.text
    caplog.clear()
    tracks(tmp_path, "id,time,x,y\n" + "".join(f"1,{k},{k},0\n" for k in range(5)))
    tracks(
        tmp_path,
        "id,time,x,y\n" + "".join(f"1,2026-05-01T10:00:0{9 - k}Z,{k},0\n" for k in range(5)),
    )
    assert "times decrease" not in caplog.text


def test_axes_that_point_down_are_doubted(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """In north-east-down coordinates, x and y must be exchanged, too, or the scene is mirrored."""
    tracks(tmp_path, "id,time,x,y,z\n1,0,0,0,-1.7\n1,1,1,0,-1.7\n")
    assert "swap x and y in columns" in caplog.text


@pytest.mark.parametrize(
    ("points", "said"),
    [
        (["0,1.7,0", "0,1.72,2"], "does y point upwards"),
        (["5,0,9", "5.5,0.1,4"], "does y point upwards"),
        (["0,0,1.2", "1,0,1.2"], "people are 1.2 m tall (median): is it the height of a tag"),
        (["0,0,0.88", "1,2,0.88"], "people are 0.88 m tall"),
        (["0,0,1.7", "0,2,1.7"], ""),
        (["0,0,1.4", "1,0,1.7"], ""),
        (["0,0,0", "1,0,0"], ""),
    ],
)
def test_another_meaning_of_z_is_doubted(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, points: list[str], said: str
) -> None:
    """Engines whose y points upwards, tags on belts, and pawns whose place is their middle."""
    rows = "".join(f"1,{t},{point}\n" for t, point in enumerate(points))
    tracks(tmp_path, f"id,time,x,y,z\n{rows}")
    assert said in caplog.text if said else not caplog.text


# -- kinds of files --------------------------------------------------------------------------


CALIBRATION, ROS_MAP = "is a camera calibration; write its", "is a map of ROS; it has no heights"


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("ros.yaml", "image: m.pgm\nresolution: 0.05\norigin: [0, 0, 0]\nnegate: 0\n", ROS_MAP),
        ("info.yaml", "image_width: 640\ncamera_name: a\ncamera_matrix:\n  rows: 3\n", CALIBRATION),
        ("cv.yml", "%YAML:1.0\n---\nK: !!opencv-matrix\n   rows: 3\n", CALIBRATION),
        ("kalibr.yaml", "cam0:\n  camera_model: pinhole\n  resolution: [752, 480]\n", CALIBRATION),
        (
            "Calib.toml",
            "[cam]\nsize = [8.0, 9.0]\nmatrix = [[1.0]]\ndistortions = [0.0]\n",
            CALIBRATION,
        ),
    ],
)
def test_files_of_other_programs_named_as_a_scene(
    tmp_path: Path, name: str, text: str, said: str
) -> None:
    """They share an ending with scenes, so the words inside count."""
    (tmp_path / name).write_text(text)
    with pytest.raises(co.FileError, match=said):
        load_scene(str(tmp_path / name))


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        (
            "a.txt",
            "# Camera list with one line of data per camera:\n1 PINHOLE 9 9 1 1 1 1\n",
            "cal",
        ),
        ("b.txt", "1 SIMPLE_RADIAL 3072 2304 2559.8 1536 1152 -0.02\n", "a camera calibration"),
        ("c.cam", "Pix4D camera calibration file 0\n", "a camera calibration"),
        ("d.xml", "<?xml version='1.0'?><opencv_storage/>", "a camera calibration"),
        ("e.xml", "<calibration><projection>frame</projection></calibration>", "a camera cal"),
        ("f.sdf", "<sdf version='1.6'><world/></sdf>", "a world or model of Gazebo or ROS"),
        ("g.pgm", "P5\n# CREATOR: map_saver\n4 3\n255\n\xfe\xfe", "a PGM image"),
        ("h.dat", "1:1,14,4,10,20,0.1;0,3,7,20,8,1.2;:0,0,1;:\n", "football data with a frame"),
        ("i.txt", "0:10.5,5.25,1.2;20,8,0.9:0,0,0\n", "football data with a frame on each line"),
        ("j.csv", ",,,Away,,Away\n,,,25,,15\nPeriod,Frame,Time [s],P25\n", "Metrica Sports"),
        ("k.vsp", "2 - the number of splines\n3 - Number of control points\n", "splines of UCY"),
        ("l.asc", "north: 6\nsouth: 0\neast: 8\nwest: 0\nrows: 3\ncols: 4\n1 1\n", "of GRASS"),
        ("m.vrt", "<VRTDataset rasterXSize='4'/>", "a virtual raster of GDAL"),
        ("n.xyz", "1 2 3\n", "must be an ESRI ASCII grid"),
    ],
)
def test_files_of_other_programs_are_named(tmp_path: Path, name: str, text: str, said: str) -> None:
    """As people and as a map they are refused with the way to convert them."""
    (tmp_path / name).write_text(text, "latin-1")
    with pytest.raises(ProblemError, match=said):
        read_raster(tmp_path / name)
    if "must be" not in said:
        with pytest.raises(ProblemError, match=said):
            Track.read_all(tmp_path / name, unit="m")


# -- maps ---------------------------------------------------------------------------------------


def grid(folder: Path, name: str, header: str, comma: bool = False) -> list[list[float]]:
    """The heights of an ESRI ASCII grid with `GRID`, as rows from the north."""
    rows = "\n".join(" ".join(f"{value:g}" for value in row) for row in GRID)
    (folder / name).write_text(header + (rows.replace(".", ",") if comma else rows) + "\n")
    raster = read_raster(folder / name)
    assert raster.origin == (100, 200)
    rows_from_south: list[list[float]] = raster.values.T.tolist()
    return rows_from_south[::-1]


HEADER = "ncols 3\nnrows 2\nxllcorner 100\nyllcorner 200\ncellsize 2\n"


@pytest.mark.parametrize("name", ["dem.asc", "dem.txt", "dem.grd", "dem.agr", "dem"])
@pytest.mark.parametrize(
    "header",
    [
        HEADER,
        "NROWS 2\nNCOLS 3\nXLLCENTER 101\nYLLCENTER 201\nCELLSIZE 2\nNODATA_VALUE -9999\n",
        "cellsize\t2\nyllcorner\t200\nxllcorner\t100\nncols\t3\nnrows\t2\n",
    ],
)
def test_a_grid_of_text_is_known_by_its_header(tmp_path: Path, name: str, header: str) -> None:
    """Programs give it other endings than .asc."""
    assert grid(tmp_path, name, header) == GRID


@pytest.mark.parametrize(
    "header", [HEADER, HEADER.replace("00\n", "00,0\n"), HEADER.replace("size 2", "size 2,0")]
)
def test_decimal_commas_of_a_grid_are_read_and_said(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, header: str
) -> None:
    """As in GDAL; blanks separate the numbers, so a comma cannot."""
    assert grid(tmp_path, "dem.asc", header, comma=True) == GRID
    assert "decimal commas" in caplog.text


@pytest.mark.parametrize("wrong", ["1,234.5", "1,2,3", "1,5 2.5 0", ",", "0,-5"])
def test_other_commas_in_a_grid_are_refused(tmp_path: Path, wrong: str) -> None:
    """Thousands, separators, and two notations at once."""
    cells = wrong.split() + ["0"] * (6 - len(wrong.split()))
    (tmp_path / "dem.asc").write_text(HEADER + " ".join(cells) + "\n")
    with pytest.raises(ProblemError, match="must be a number, not"):
        read_raster(tmp_path / "dem.asc")


@pytest.mark.parametrize(
    ("properties", "top"),
    [
        ({"height": -1}, None),
        ({"height": -1.0}, None),
        ({"height": "-1"}, None),
        ({"height": -1, "building:levels": 2}, 2 * STOREY),
        ({"height": None, "num_floors": 4}, 4 * STOREY),
        ({"measuredHeight": 11.5}, 11.5),
        ({"measured_height": "11.5"}, 11.5),
    ],
)
def test_heights_of_footprints_in_other_collections(
    properties: dict[str, Any], top: float | None
) -> None:
    """Microsoft has -1 for unknown heights, Overture counts floors, CityGML measures."""
    assert extent(properties, "properties").top == top


# -- cameras ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("camera", "said"),
    [
        ('"calib.yaml"', "must be a name or numbers, not the file 'calib.yaml'"),
        ('"cameras.txt"', "with focal = fx"),
        ("{ width = 640, height = 480, fx = 500, fy = 500 }", "did you mean focal?"),
        (
            "{ width = 640, height = 480, focal = 500, cx = 300 }",
            "principal point is in the middle",
        ),
        ("{ width = 640, height = 480, focal = 500, k1 = 0.1 }", "the lens has no distortion"),
        ("{ width = 640, height = 480, hfov = 70 }", "did you mean fov?"),
    ],
)
def test_numbers_of_a_calibration_get_their_names_here(
    tmp_path: Path, camera: str, said: str
) -> None:
    """What has no counterpart is named, and why."""
    (tmp_path / "scene.toml").write_text(
        "steps = 4\n[map]\nsize = [20, 20]\n[[walk]]\npoints = [[8, 8], [12, 8]]\n"
        f"[[drones]]\nstarts = [{{ x = 4.5, y = 4.5 }}]\ncamera = {camera}\n"
    )
    with pytest.raises(co.FileError) as told:
        co.load(str(tmp_path / "scene.toml"))
    assert said in str(told.value)


# -- other planners' scenes -----------------------------------------------------------------------


ROWS = ["......", ".@@T..", "......", "..W.S.", "......"]


def scenario(folder: Path, header: str, file: str = "a.map", row: str = "") -> co.Problem:
    """The scene of a MovingAI scenario with two rows."""
    rows = [*ROWS[:-1], row or ROWS[-1]]
    (folder / "a.map").write_text(f"{header}\nmap\n" + "\n".join(rows) + "\n")
    trips = ["0 0 5 4 9", "1 0 5 0 4", "0 4 5 2 7", "4 2 0 2 4"]
    text = "".join(f"0\t{file}\t6\t5\t{trip.replace(' ', chr(9))}\n" for trip in trips)
    (folder / "a.scen").write_text("version 1\n" + text)
    return co.load(str(folder / "a.scen"))


@pytest.mark.parametrize(
    ("header", "file"),
    [
        ("type octile\nheight 5\nwidth 6", "a.map"),
        ("type tile\nheight 5\nwidth 6", "a.map"),
        ("type octile\nwidth 6\nheight 5", "maps/dao/a.map"),
        ("type octile\nheight 5\nwidth 6", "maps\\dao\\a.map"),
    ],
)
def test_variants_of_movingai_maps(tmp_path: Path, header: str, file: str) -> None:
    """Other types, the order of the sizes, and paths of another system; x is the column."""
    problem = scenario(tmp_path, header, file)
    blocked = {(x, y) for y, row in enumerate(ROWS) for x, cell in enumerate(row) if cell in "@TW"}
    heights = problem.height_map.heights
    assert {(x, y) for x in range(6) for y in range(5) if heights[x, y] > 0} == blocked
    assert problem.actors[0].poses[0, :2].tolist() == [0.5, 0.5]


def test_unknown_characters_of_movingai_maps_are_named(tmp_path: Path) -> None:
    """Warehouses of other benchmarks have E, S and #."""
    with pytest.raises(co.FileError, match="not '#E'; replace these"):
        scenario(tmp_path, "type octile\nheight 5\nwidth 6", row="..E#..")
    (tmp_path / "a.map").unlink()
    with pytest.raises(co.FileError, match=r"no such file; the map must be beside a\.scen"):
        co.load(str(tmp_path / "a.scen"))


def test_robots_of_hughes_in_any_order(tmp_path: Path) -> None:
    """The numbers of the robots count, not the order in which a solution lists them."""
    person = {"location": [5.0, 5.0, 0.0], "rotation": [0.0, 0.0, 0.5], "weight": 1.0}
    scene = {"scene": {"scale": {"x": 9, "y": 8}}, "actor_positions": [[person]] * 3}
    (tmp_path / "scene.json").write_text(json.dumps(scene))
    elements = [
        [robot, [{"state": {"x": robot, "y": 2, "heading": "N"}}] * 3] for robot in (3, 1, 2)
    ]
    (tmp_path / "solution_a.json").write_text(json.dumps({"elements": elements, "value": 0}))
    problem = co.load(str(tmp_path / "scene.json"))
    assert [robot.start.x for robot in problem.robots] == [0, 1, 2]
