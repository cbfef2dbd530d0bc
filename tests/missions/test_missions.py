import io
import json
import math
import re
import zipfile
from contextlib import nullcontext
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ardupilot_missions import ardupilot_moments
from mission_rows import Moment, read_plan, read_waypoints
from numpy.polynomial import Polynomial
from px4_missions import px4_moments
from test_cli import Run

import cocap_opt as co
from cocap_opt.data import FloatArray, ProblemError
from cocap_opt.flight.delays import bearable_delay, bearable_delay_of_people
from cocap_opt.flight.flights import Flight
from cocap_opt.missions import FORMATS, Export
from cocap_opt.missions.earth_tracks import geodesy_of
from cocap_opt.missions.routes import routes
from cocap_opt.missions.sheet.heights import Heights
from cocap_opt.missions.zones import ends
from cocap_opt.problem import CollisionRules, Earth, Plan, Problem, State

pyproj = pytest.importorskip("pyproj")

# Systems with the place of x = y = 0: UTM, a conical projection far from its middle, whose north
# is 11 degrees off, and UTM in the south beside the antimeridian.
SYSTEMS = {
    "EPSG:25830": (43.26, -2.93), "EPSG:3034": (35.3, 25.1), "EPSG:32760": (-17.0, 179.99995),
}  # fmt: skip
PATHS = (
    # It flies along x, stays, stays and turns, stays and tilts, climbs, comes down aside.
    ((3, 2, 0, 0, 0), (4, 2, 0, 0, 0), (4, 2, 0, 0, 0), (4, 2, 0, 1, 0), (4, 2, 0, 1, 1),
     (4, 2, 1, 1, 1), (5, 3, 0, 0, 0), (6, 3, 0, 7, 0)),
    ((3, 6, 1, 6, 1),) * 8,  # stays all the time
    # Begins where the first one comes near at last.
    ((7, 3, 0, 2, 0), (8, 4, 0, 2, 0), (9, 4, 0, 3, 0), (9, 5, 0, 3, 0), (9, 5, 0, 3, 0),
     (9, 5, 0, 3, 0), (8, 6, 1, 4, 1), (7, 6, 1, 4, 1)),
)  # fmt: skip
STEP = 2.0
NAMES = {".plan": "px4", ".waypoints": "ardupilot"}


def scene(crs: str | None = "EPSG:25830", **more: Any) -> tuple[Problem, Plan]:
    """A scene with a roof, from which the second drone takes off, and a plan for it."""
    heights = np.zeros((12, 10))
    heights[3, 6] = 2.5
    motion, camera = co.Motion(layers=(5.0, 8.0)), co.Camera(tilts=(0.2, 0.9))
    starts = [State(*path[0]) for path in PATHS]
    earth = None if crs is None else Earth(crs=crs, origin=SYSTEMS[crs], heights="sea", base=40.0)
    fields = {
        "name": "scene", "height_map": co.HeightMap(heights=heights), "actors": (), "step": STEP,
        "robots": tuple(co.Robot(start=s, motion=motion, camera=camera) for s in starts),
        "horizon": len(PATHS[0]) - 1, "earth": earth, "rules": CollisionRules(separation=2.0),
    }  # fmt: skip
    return Problem(**{**fields, **more}), Plan(
        paths=tuple(tuple(State(*state) for state in path) for path in PATHS)
    )


@lru_cache
def flown(crs: str | None = "EPSG:25830", smooth: bool = False) -> Flight:
    """The flight of the scene's plan."""
    return Flight.of(*scene(crs), smooth)


def written(ending: str, flight: Flight) -> list[bytes]:
    """The files of a flight, drone by drone."""
    return list(FORMATS[ending].writer()(flight, None).files.values())


def told_moments(ending: str, content: bytes, folder: Path) -> list[Moment]:
    """What the autopilot of a file makes of it."""
    if ending == ".plan":
        return list(px4_moments(read_plan(content)))
    return list(ardupilot_moments(read_waypoints(content, folder)))


@pytest.mark.parametrize("crs", SYSTEMS)
@pytest.mark.parametrize("ending", [".plan", ".waypoints"])
def test_waypoints_are_the_plan_s_places_times_and_looks(
    crs: str, ending: str, tmp_path: Path
) -> None:
    """Others' readers find each drone at each step where the plan is, to 1 cm and 0.1 s.

    Latitudes, longitudes and true north are pyproj's, by a way of its own: points ahead along the
    compass must lie ahead along the plan's yaw in the projection.
    """
    flight, geod = flown(crs), pyproj.Geod(ellps="WGS84")
    columns = {k: v.reshape(3, -1) for k, v in flight.columns().items()}
    grid = pyproj.Transformer.from_crs("EPSG:4326", crs, always_xy=True)
    corner = np.array(grid.transform(*SYSTEMS[crs][::-1]))
    off = []
    for drone, content in enumerate(written(ending, flight)):
        at: dict[int, Moment] = {}
        for moment in told_moments(ending, content, tmp_path):
            step = 0 if math.isnan(moment.t) else round(moment.t / STEP)
            if not abs(moment.t - step * STEP) >= 0.1:  # a wait may end in the middle of a step
                at.setdefault(step, moment)
        own = np.stack([columns[k][drone] for k in ("x", "y", "above_takeoff", "yaw", "pitch")], 1)
        changes = np.flatnonzero((np.diff(own, axis=0) != 0).any(axis=1)) + 1
        assert {0, *changes.tolist(), len(own) - 1} <= set(at)
        for step, (_, (latitude, longitude, height), compass, pitch, _) in at.items():
            here = np.array(grid.transform(longitude, latitude)) - corner
            ahead = grid.transform(*geod.fwd(longitude, latitude, compass, 5.0)[:2]) - corner - here
            yaw = math.degrees(math.atan2(ahead[1], ahead[0]))
            np.testing.assert_allclose([*here, height], own[step, :3], rtol=0, atol=0.01)
            assert math.remainder(yaw - own[step, 3], 360) == pytest.approx(0, abs=0.01)
            assert pitch == pytest.approx(own[step, 4])
            off.append(abs(math.remainder(90 - compass - own[step, 3], 360)))
    assert (min(off) > 10) == (max(off) > 2) == (crs == "EPSG:3034")


def test_files_of_waypoints_say_that_drones_keep_no_common_clock() -> None:
    """Their names and notes say so, with the difference in time that the separation bears."""
    flight = flown()
    for ending in (".plan", ".waypoints"):
        mission = FORMATS[ending].writer()(flight, None)
        assert list(mission.files) == [
            f"{NAMES[ending]}.no-common-clock.drone{i}" for i in range(3)
        ]
        bears = bearable_delay(flight.flown, CollisionRules(separation=2.0))
        shown = mission.facts["delay_tolerance"]
        assert shown is not None and bears - 0.01 < shown <= bears
        assert f"the scene's separation 2 m holds while no drone is {shown:.2f} s" in said(mission)
    for rules, words in (
        (CollisionRules(), f"a separation 2 m holds while no drone is {shown:.2f} s"),
        (
            CollisionRules(separation=1.0),
            "the scene's separation 1 m holds for any delay of any drone",
        ),
    ):
        found = Flight.of(*scene(rules=rules), False)
        assert words in said(FORMATS[".plan"].writer()(found, None))
    alone, plan = scene()
    alone = alone.replace(robots=alone.robots[:1])
    mission = FORMATS[".plan"].writer()(Flight.of(alone, Plan(paths=plan.paths[:1]), False), None)
    assert "common clock" not in said(mission)
    assert mission.facts["delay_tolerance"] is mission.facts["delay_tolerance_to_people"] is None


def test_files_of_waypoints_say_what_late_drones_are_to_people() -> None:
    """The tolerance to people stands beside that between drones, and when people set out."""
    walk = np.column_stack([np.linspace(6.5, 9.5, 8), np.full(8, 8.5), np.zeros((8, 2))])
    for aside, words, shown in (
        (
            1.9,
            "drones keep 1.9 m from people for any delay or lead of drones and people",
            "unlimited",
        ),
        (
            2.05,
            "delay tolerance to people: drones keep 2.05 m from people while no drone is ",
            None,
        ),
        (0.0, "the scene requires no distance from people, so how close", None),
    ):
        airspace = co.Airspace(people_aside=aside)
        problem, plan = scene(actors=(co.Actor(poses=walk),), airspace=airspace)
        flight = Flight.of(problem, plan, False)
        mission = FORMATS[".plan"].writer()(flight, None)
        assert words in said(mission)
        told = mission.facts["delay_tolerance_to_people"]
        if isinstance(told, float):
            bears = bearable_delay_of_people(flight.flown)
            assert bears - 0.01 < told <= bears and f"{told:.2f} s or more ahead" in said(mission)
        else:
            assert told == shown
        assert "give people their signal 15.5 s after starting the missions" in said(mission)
    assert "signal" not in said(FORMATS[".plan"].writer()(flown(), None))


def test_drones_begin_their_flights_together(tmp_path: Path) -> None:
    """Whoever has less far to rise waits longer, by the speed at which its autopilot takes off."""
    for ending, rise, read in (
        (".plan", 1.5, read_plan),  # MPC_TKO_SPEED
        (".waypoints", 2.5, partial(read_waypoints, folder=tmp_path)),  # WPNAV_SPEED_UP
    ):
        own = [read(content) for content in written(ending, flown())]
        waits = [next(row.params[0] for row in rows if row.command == 93) for rows in own]
        ups = [next(row.params[6] for row in rows if row.command == 22) for rows in own]
        assert len(set(ups)) > 1
        begun = [wait + up / rise for wait, up in zip(waits, ups, strict=True)]
        assert begun == pytest.approx([15.5] * 3, abs=1e-3)


def said(mission: Export) -> str:
    """The notes of a mission."""
    return "; ".join(map(str, mission.notes))


def test_homes_are_above_the_sea_or_unknown() -> None:
    """Heights above the ellipsoid are not taken for heights above the sea."""
    for heights, base, homes in (
        ("sea", 40.0, [40.0, 42.5, 40.0]), ("ellipsoid", 90.0, [None] * 3), (None, 0.0, [None] * 3),
    ):  # fmt: skip
        earth = Earth(crs="EPSG:25830", origin=(43.26, -2.93), heights=heights, base=base)
        flight = Flight.of(*scene(earth=earth), False)
        plans = [json.loads(content)["mission"] for content in written(".plan", flight)]
        assert [plan["plannedHomePosition"][2] for plan in plans] == homes
        lists = [content.splitlines()[1].split() for content in written(".waypoints", flight)]
        assert [float(row[10]) for row in lists] == [home or 0.0 for home in homes]
        assert ("above the sea is unknown" in said(FORMATS[".plan"].writer()(flight, None))) == (
            heights != "sea"
        )
        assert plans[0]["items"][0]["params"][6] == 5.0


def between(points: list[list[Any]], t: float) -> FloatArray:
    """Where a show's drone is at a time, by de Casteljau's construction."""
    k = max(i for i in range(len(points) - 1) if points[i][0] <= t)
    (start, first, _), (end, last, control) = points[k], points[k + 1]
    assert len(control) in (0, 2)
    polygon, share = np.array([first, *control, last]), (t - start) / (end - start)
    while len(polygon) > 1:
        polygon = (1 - share) * polygon[:-1] + share * polygon[1:]
    return polygon[0]


@pytest.mark.parametrize("smooth", [False, True])
def test_a_show_of_skybrush_is_the_flight(smooth: bool) -> None:
    """Its curves, evaluated by another, are where the drones are, and its yaw is theirs."""
    flight = flown(smooth=smooth)
    (content,) = written(".skyc", flight)
    assert written(".skyc", flight) == [content]  # the same bytes each time
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        assert archive.namelist() == ["show.json"]
        show = json.loads(archive.read("show.json"))
    assert show["version"] == 1
    assert show["environment"] == {"type": "outdoor"}
    assert show["settings"] == {"validation": {"minDistance": 2.0}}
    columns = {k: v.reshape(3, -1) for k, v in flight.columns(0.07).items()}
    assert len(show["swarm"]["drones"]) == 3
    for i, drone in enumerate(show["swarm"]["drones"]):
        settings = drone["settings"]
        trajectory, yaw = settings["trajectory"], settings["yawControl"]
        assert (trajectory["version"], trajectory["takeoffTime"], yaw["version"]) == (1, 0, 1)
        assert settings["home"][2] == (2.5 if i == 1 else 0.0)
        points, setpoints = trajectory["points"], np.array(yaw["setpoints"])
        assert points[0][0] == 0 and points[-1][0] == flight.flown.seconds
        assert np.diff([t for t, _, _ in points]).min() >= 0.001
        found = np.array([between(points, t) for t in columns["t"][i]])
        wanted = np.stack([columns[axis][i] for axis in "xyz"], axis=1)
        assert np.abs(found - wanted).max() < 0.0015
        turned = -np.interp(columns["t"][i], *setpoints.T)
        assert np.abs(turned - columns["yaw"][i]).max() < 0.15


def test_polynomials_of_a_crazyflie_are_the_flight() -> None:
    """NumPy evaluates them to the places and yaws of the flight; steps without a change are one."""
    flight = flown(smooth=True)
    columns = {k: v.reshape(3, -1) for k, v in flight.columns(0.07).items()}
    for i, content in enumerate(written(".crazyflie.csv", flight)):
        text = content.decode()
        assert text.startswith("duration,x^0,x^1,x^2,x^3,x^4,x^5,x^6,x^7,y^0,")
        table = np.loadtxt(io.StringIO(text), delimiter=",", skiprows=1, ndmin=2)
        assert table.shape == ((7, 1, 7)[i], 33)
        ends = np.cumsum(table[:, 0])
        assert ends[-1] == pytest.approx(flight.flown.seconds)
        rows = np.minimum(np.searchsorted(ends, columns["t"][i]), len(table) - 1)
        for row, t, *own in zip(
            rows, *(columns[k][i] for k in ("t", "x", "y", "z", "yaw")), strict=True
        ):
            since = t - ends[row] + table[row, 0]
            found = [Polynomial(part)(since) for part in table[row, 1:].reshape(4, 8)]
            np.testing.assert_allclose([*found[:3], math.degrees(found[3])], own, atol=1e-6)


def test_flights_that_a_format_cannot_hold_are_refused() -> None:
    """One line says what to change."""
    straight, smooth = flown(), flown(smooth=True)
    nowhere = Flight.of(*scene(None), False)
    problem, plan = scene(horizon=32)
    there_and_back = [(State(3 + k % 2, 2, 0, 0, 0)) for k in range(33)]
    paths = (there_and_back, *([path[0]] * 33 for path in plan.paths[1:]))
    long = Flight.of(problem, Plan(paths=tuple(map(tuple, paths))), True)
    hasty = Flight.of(problem.replace(step=0.002), Plan(paths=tuple(map(tuple, paths))), True)
    for ending, flight, every, words in (
        (".plan", nowhere, None, "earth: must say where the scene is"),
        (".waypoints", nowhere, None, "earth: must say where the scene is"),
        (".plan", smooth, None, "smooth: must be left out"),
        (".waypoints", straight, 0.1, "every: must be left out"),
        (".skyc", straight, 0.1, "every: must be left out"),
        (".skyc", hasty, None, "step: must be at least 0.016 s .*, not 0.002 s"),
        (".crazyflie.csv", straight, None, "smooth: must be given"),
        (".crazyflie.csv", smooth, 0.1, "every: must be left out"),
        (".crazyflie.csv", long, None, "drone 0 needs 32 polynomials, .* holds 31"),
    ):
        with pytest.raises(ProblemError, match=words) as caught:
            FORMATS[ending].writer()(flight, every)
        assert "\n" not in str(caught.value)


def test_a_show_names_the_step_that_all_of_it_needs() -> None:
    """Drone 0 moves and turns, so that its yaw needs more curves than its way; another stays."""
    problem, plan = scene(horizon=8)
    turning = tuple(State(3 + k % 2, 2, 0, k % 2, 0) for k in range(9))
    staying = tuple((path[0],) * 9 for path in plan.paths[1:])
    for paths in ((turning, *staying), (turning[:1] * 9, *staying)):
        hasty = problem.replace(step=0.001)
        with pytest.raises(ProblemError, match="step: must be at least") as caught:
            FORMATS[".skyc"].writer()(Flight.of(hasty, Plan(paths=paths), True), None)
        (least,) = re.findall(r"at least (\S+) s", str(caught.value))
        for step, fits in ((float(least), True), (float(least) - 0.001, False)):
            flight = Flight.of(problem.replace(step=step), Plan(paths=paths), True)
            with nullcontext() if fits else pytest.raises(ProblemError):
                FORMATS[".skyc"].writer()(flight, None)


RECIPE = """
steps = 3
[map]
size = [12, 8]
{earth}
[[drones]]
starts = [{{ x = 2.5, y = 2.5 }}, {{ x = 2.5, y = 6.5, heading = 45 }}]
"""
EARTH = """
[earth]
crs = "EPSG:25830"
latitude = 43.26
longitude = -2.93
"""


def test_missions_are_written_whole_or_not_at_all(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Files are named after their drones; what is refused ends with 2, one line and no file."""
    scene, nowhere, plan = (tmp_path / name for name in ("a.toml", "b.toml", "plan.json"))
    scene.write_text(RECIPE.format(earth=EARTH))
    nowhere.write_text(RECIPE.format(earth=""))
    for recipe, path in ((scene, plan), (nowhere, tmp_path / "there.json")):
        problem = co.load(recipe)
        co.save(path, Plan(paths=tuple((r.start,) * 4 for r in problem.robots)), problem)
    before = set(tmp_path.iterdir())
    for words, expected in (
        ((scene, plan, "-o", "f.plan", "--smooth"), "^cocap-opt: --smooth: must be left out"),
        ((scene, plan, "-o", "f.waypoints", "--every", 1), "^cocap-opt: --every: must be left"),
        (
            (scene, plan, "-o", "f.plan", "--local"),
            "^cocap-opt: --local: must be left out for .plan",
        ),
        ((nowhere, tmp_path / "there.json", "-o", "f.plan"), "b.toml: earth: must .* x = y = 0$"),
        ((scene, plan, "-o", ".plan"), "^cocap-opt: -o: name a file that ends in .*.skyc, .* or"),
    ):
        words = [tmp_path / w if isinstance(w, str) and w[0] in "f." else w for w in words]
        run = Run(capsys, "fly", *words)
        assert run.code == 2
        (line,) = run.err.splitlines()
        assert re.search(expected, line), line
        assert set(tmp_path.iterdir()) == before
    for words, names in (
        (["f.plan"], [f"f.px4.no-common-clock.drone{i}.plan" for i in (0, 1)]),
        (["f.SKYC"], ["f.SKYC"]),
        (["f.colmap.zip"], ["f.colmap.zip"]),
        (["g.crazyflie.csv", "--smooth"], [f"g.drone{i}.crazyflie.csv" for i in (0, 1)]),
    ):
        words += ["--hovering", "--json"]
        run = Run(capsys, "fly", scene, plan, "-o", tmp_path / words[0], *words[1:])
        assert run.code == 0
        made = sorted(path.name for path in set(tmp_path.iterdir()) - before)
        assert made == names
        assert [Path(name).name for name in run.json["files"]] == names
        assert ("delay_tolerance" in run.json) == (words[0] == "f.plan")
        before |= set(tmp_path.iterdir())
    old = tmp_path / "f.px4.no-common-clock.drone2.plan"
    old.write_text("{}")
    run = Run(capsys, "fly", scene, plan, "--hovering", "-o", tmp_path / "f.plan", "--json")
    (note,) = [words for words in run.json["notes"] if "files of another flight" in words]
    assert old.name in note
    assert "drone1" not in note


def test_heights_above_take_off_are_above_what_a_drone_stands_on() -> None:
    """A roof that is a mesh, a home, or nothing for drones that are in the air already."""
    box = co.Mesh.box((2.0, 1.0, 0.0), (5.0, 4.0, 1.5))  # below the first place of drone 0
    problem, plan = scene(meshes=(box,))
    flight = Flight.of(problem, plan, False)
    columns = flight.columns()
    assert columns["above_takeoff"][columns["t"] == 0].tolist() == [3.5, 5.5, 5.0]
    assert [route.places[0, 2] for route in routes(flight, geodesy_of(flight))] == [3.5, 5.5, 5.0]
    assert Heights.of(flight).surfaces.tolist() == [1.5, 2.5, 0.0]
    slope = np.add.outer(0.25 * np.arange(12), np.zeros(10))
    homes = ((0, 0), (8, 8), (4, 8))
    robots = [robot.replace(home=home) for robot, home in zip(problem.robots, homes, strict=True)]
    problem, plan = scene(height_map=co.HeightMap(heights=slope), robots=tuple(robots))
    flight = Flight.of(problem, plan, False)
    columns = flight.columns()
    assert "above_takeoff" not in columns
    assert columns["above_home"][columns["t"] == 0].tolist() == [5.0, 6.0, 4.0]
    assert [end.kind for end in ends(flight, geodesy_of(flight))] == ["home"] * 3
    rest = [robot.replace(number=k + 1) for k, robot in enumerate(scene()[0].robots)]
    flight = Flight.of(*scene(robots=tuple(rest)), False)
    assert not {"above_takeoff", "above_home"} & flight.columns().keys()
    assert [end.kind for end in ends(flight, geodesy_of(flight))] == ["landing"] * 3


def test_drones_of_a_rest_that_have_landed_take_off_again(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], caplog: pytest.LogCaptureFixture
) -> None:
    """Missions of a rest begin in the air, and are refused, unless its drones have landed."""
    problem, plan = scene()
    robots = [
        robot.replace(number=3 - k, limits=co.Limits(endurance=20.0))
        for k, robot in enumerate(problem.robots)
    ]
    rest = problem.replace(robots=tuple(robots))
    co.save(tmp_path / "rest.json", rest)
    co.save(tmp_path / "plan.json", plan, rest)
    fly = "fly", tmp_path / "rest.json", tmp_path / "plan.json", "-o"
    run = Run(capsys, *fly, tmp_path / "a.plan")
    assert run.code == 2 and "--landed says that they have landed" in run.err
    run = Run(capsys, *fly, tmp_path / "b.plan", "--landed")
    assert run.code == 0 and "drone 0 of these files is drone 3 of the mission" in caplog.text
    assert "how long the batteries last is not checked" in caplog.text
    assert len(list(tmp_path.glob("b.*.plan"))) == 3
    co.save(tmp_path / "whole.json", problem)
    co.save(tmp_path / "all.json", plan, problem)
    run = Run(
        capsys, "fly", tmp_path / "whole.json", tmp_path / "all.json", "-o", tmp_path / "c.plan",
        "--landed",
    )  # fmt: skip
    assert run.code == 2 and "--landed: must be left out" in run.err
