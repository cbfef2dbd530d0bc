"""Missions take the time that the plan has, by the rules of the autopilot that they are for."""

import math
import re
from collections.abc import Callable, Collection, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import ardupilot_missions
import numpy as np
import px4_missions
import pytest
from ardupilot_missions import ardupilot_moments
from hypothesis import given
from hypothesis import strategies as st
from mission_rows import Moment, Row, read_plan, read_waypoints
from px4_missions import px4_moments
from strategies import examples
from test_cli import Run

import cocap_opt as co
from cocap_opt.data import FloatArray, ProblemError
from cocap_opt.flight.flights import Flight
from cocap_opt.flight.notes import Kind, notes_of
from cocap_opt.missions import FORMATS, Export
from cocap_opt.missions.autopilots import AUTOPILOTS
from cocap_opt.missions.items import Item
from cocap_opt.missions.routes import Leg, Route, routes
from cocap_opt.problem import Airspace, Earth, Limits, Plan, Problem, State

pyproj = pytest.importorskip("pyproj")

FLIES: dict[str, Callable[..., Iterator[Moment]]] = {
    "px4": px4_moments,
    "ardupilot": ardupilot_moments,
}
LAYERS = 4.0, 5.0, 7.0
# Ways of one drone. Cells are of 2 m, steps of 4 s; states are x, y, layer, heading, pitch.
WAYS: dict[str, tuple[tuple[int, int, int, int, int], ...]] = {
    "level": ((3, 3, 0, 0, 0), (4, 3, 0, 0, 0), (5, 4, 0, 0, 0), (5, 3, 0, 0, 0)),
    "climbs on its way": ((3, 3, 0, 0, 0), (4, 3, 1, 0, 0), (5, 4, 2, 0, 0), (5, 3, 1, 0, 0)),
    "straight up": ((3, 3, 0, 0, 0), (3, 3, 1, 0, 0), (3, 3, 2, 0, 0), (4, 3, 2, 0, 0)),
    "straight down": ((3, 3, 2, 0, 0), (3, 3, 0, 0, 0), (3, 4, 0, 0, 0), (3, 4, 1, 1, 0)),
    "waits": ((3, 3, 0, 0, 0), (3, 3, 0, 0, 0), (3, 3, 0, 0, 0), (4, 3, 0, 0, 0)),
    "turns where it is": ((3, 3, 0, 0, 0), (3, 3, 0, 2, 0), (3, 3, 0, 4, 0), (4, 3, 0, 4, 1)),
    "turns and climbs": ((3, 3, 0, 0, 0), (3, 3, 1, 2, 0), (3, 3, 0, 4, 1), (4, 3, 0, 4, 1)),
    "hovers": ((3, 3, 0, 0, 0),) * 4,
}


def flight_of(way: tuple[tuple[int, ...], ...], step: float = 4.0, **more: Any) -> Flight:
    """The flight of one drone along a way."""
    path = tuple(State(*state) for state in way)
    motion = co.Motion(layers=LAYERS, radius=1, climb=2, turn=4)
    robot = co.Robot(start=path[0], motion=motion, camera=co.Camera(tilts=(0.2, 0.9)))
    fields = {
        "name": "way", "height_map": co.HeightMap(heights=np.zeros((12, 10)), resolution=2.0),
        "actors": (), "step": step, "robots": (robot,), "horizon": len(way) - 1,
        "earth": Earth(crs="EPSG:25830", origin=(43.26, -2.93), heights="sea"),
    }  # fmt: skip
    return Flight.of(Problem(**{**fields, **more}), Plan(paths=(path,)), False)


def route_of(flight: Flight) -> Route:
    """The route of its only drone."""
    assert flight.geodesy is not None
    (route,) = routes(flight, flight.geodesy)
    return route


def rows_of(items: list[Item]) -> list[Row]:
    """Items as readers tell them."""
    return [Row(int(item.command), item.frame, list(item.params)) for item in items]


def moments_of(flight: Flight, name: str, without: Collection[str] = ()) -> list[Moment]:
    """What an autopilot makes of its own mission of a flight."""
    return list(FLIES[name](rows_of(AUTOPILOTS[name].items(route_of(flight))), without))


def require_in_time(flight: Flight, name: str) -> None:
    """Compares the times at which each waypoint is reached with those of the plan."""
    route = route_of(flight)
    steps = np.arange(len(route.places)) * flight.flown.step
    late = np.zeros(len(steps))
    for one in AUTOPILOTS[name].late(route):
        late[one.step :] += one.seconds
    moves = (np.diff(route.places, axis=0) != 0).any(axis=1)
    wanted = [k for k in range(1, len(steps)) if moves[k - 1]]
    found = moments_of(flight, name)
    place, arrivals = tuple(route.places[0].tolist()), []
    for moment in found:
        if moment.arrives and moment.place != place:
            place = moment.place
            arrivals.append(moment)
    assert len(arrivals) == len(wanted)
    for k, moment in zip(wanted, arrivals, strict=True):
        assert moment.t == pytest.approx(steps[k] + late[k], abs=0.1)
        assert moment.place == tuple(route.places[k].tolist())
        assert math.remainder(moment.compass - route.yaw[k], 360) == pytest.approx(0, abs=0.01)
        assert moment.pitch == pytest.approx(route.pitch[k])
    assert found[-1].t == pytest.approx(steps[-1] + late[-1], abs=0.1)
    assert found[-1].pitch == pytest.approx(route.pitch[-1])
    assert math.remainder(found[-1].compass - route.yaw[-1], 360) == pytest.approx(0, abs=0.01)


@pytest.mark.parametrize("step", [0.5, 4.0, 30.0])
@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("name", FLIES)
def test_each_waypoint_is_reached_when_the_plan_is_there(name: str, way: str, step: float) -> None:
    """Climbs, waits, turns and very slow legs take their time, or are said to be late."""
    require_in_time(flight_of(WAYS[way], step), name)


MOVES = st.tuples(*(st.integers(-1, 1) for _ in range(3)), st.integers(-2, 2), st.booleans())


@pytest.mark.slow
@examples(40)
@given(st.lists(MOVES, min_size=1, max_size=8), st.sampled_from([0.7, 1.0, 2.0, 5.0, 40.0]))
def test_random_ways_are_flown_in_time(moves: list[tuple[int, ...]], step: float) -> None:
    """Whatever a drone does, both autopilots fly it as planned, but for legs said to be late."""
    way = [(5, 5, 1, 0, 0)]
    for x, y, layer, heading, pitch in moves:
        i, j, k, h, _ = way[-1]
        way.append((
            min(max(i + x, 1), 10), min(max(j + y, 1), 8), min(max(k + layer, 0), 2),
            (h + heading) % 8, int(pitch),
        ))  # fmt: skip
    flight = flight_of(tuple(way), step)
    for name in FLIES:
        require_in_time(flight, name)
    if step >= 4:
        assert not any([*AUTOPILOTS[name].late(route_of(flight))] for name in FLIES)


def times(moments: list[Moment]) -> FloatArray:
    """The times of the moments after the start."""
    return np.nan_to_num([moment.t for moment in moments])


def mission(name: str, way: str, step: float = 4.0) -> list[Row]:
    """The mission of a way for an autopilot."""
    return rows_of(AUTOPILOTS[name].items(route_of(flight_of(WAYS[way], step))))


def foreign(way: str) -> list[Row]:
    """A mission with each turn before the speeds of its leg."""
    rows = mission("ardupilot", way)
    for k in range(1, len(rows)):
        if rows[k].command == 115 and rows[k - 1].command == 178:
            rows[k - 1 : k + 1] = rows[k], rows[k - 1]
    return rows


# A mission for each rule that takes another time without it. What no mission of ours leaves to a
# rule, because the dialect avoids it, is in one of the other autopilot, or in one made worse.
MATTERS = {
    ("px4", px4_missions.TYPES): partial(mission, "ardupilot", "climbs on its way"),
    ("px4", px4_missions.GROUND): partial(mission, "px4", "climbs on its way"),
    ("px4", px4_missions.CLIMBS): partial(mission, "px4", "straight up"),
    ("px4", px4_missions.CRUISE): partial(mission, "px4", "level", 0.15),
    ("px4", px4_missions.LOOKS): partial(mission, "px4", "turns and climbs", 0.5),
    ("px4", px4_missions.HOLDS): partial(mission, "px4", "turns where it is"),
    ("px4", px4_missions.DELAYS): partial(mission, "px4", "waits"),
    ("ardupilot", ardupilot_missions.TYPES): partial(mission, "ardupilot", "climbs on its way"),
    ("ardupilot", ardupilot_missions.BOTH): partial(mission, "ardupilot", "straight up"),
    ("ardupilot", ardupilot_missions.SLOWEST): partial(mission, "px4", "level", 30.0),
    ("ardupilot", ardupilot_missions.DELAYS): partial(mission, "ardupilot", "waits"),
    ("ardupilot", ardupilot_missions.WHOLE): partial(mission, "px4", "turns and climbs", 4.0),
    ("ardupilot", ardupilot_missions.HELD_UP): partial(foreign, "straight down"),
}  # fmt: skip
RULES = [
    *(("px4", rule) for rule in px4_missions.RULES),
    *(("ardupilot", rule) for rule in ardupilot_missions.RULES),
]


@pytest.mark.parametrize(("name", "rule"), RULES)
def test_no_rule_of_an_autopilot_is_idle(name: str, rule: str) -> None:
    """A mission takes another time without it, so that the missions are held to it."""
    rows = MATTERS[name, rule]()
    whole, less = (times([*FLIES[name](rows, without)]) for without in ((), (rule,)))
    assert len(whole) != len(less) or np.abs(whole - less).max() > 0.1


@pytest.mark.parametrize("name", FLIES)
def test_a_mission_is_for_its_autopilot_only(name: str) -> None:
    """A mission with climbs takes another time on the other autopilot, so names tell them apart."""
    (other,) = FLIES.keys() - {name}
    rows = mission(name, "climbs on its way" if name == "ardupilot" else "straight up")
    own, wrong = (times([*FLIES[flies](rows)]) for flies in (name, other))
    assert np.abs(own - wrong).max() > 0.1


def said(export: Export) -> str:
    """The notes of a mission."""
    return "; ".join(map(str, export.notes))


def test_px4_has_one_speed_a_leg_and_ardupilot_one_of_each_kind() -> None:
    """No type of speed follows another for PX4, which would take the last for its cruise speed."""
    for way in WAYS:
        for name in FLIES:
            rows = mission(name, way)
            speeds = [k for k, row in enumerate(rows) if row.command == 178]
            if name == "px4":
                assert {rows[k].params[0] for k in speeds} <= {1.0}
                assert not {k + 1 for k in speeds} & set(speeds)
            for k in speeds:
                rest = [row.command for row in rows[k + 1 :]]
                assert 16 in rest  # a leg follows


RECIPE = """
steps = 3
step = 4
[map]
size = [12, 8]
[earth]
crs = "EPSG:25830"
latitude = 43.26
longitude = -2.93
[[drones]]
starts = [{ x = 2.5, y = 2.5, height = 4 }]
[drones.motion]
layers = [4, 6]
"""


def test_legs_that_cannot_be_flown_in_time_are_said() -> None:
    """Which legs, by how much, by which parameter; they are among the warnings."""
    hasty = flight_of(WAYS["climbs on its way"], 0.5)
    export = FORMATS[".plan"].writer()(hasty, None)
    assert re.search(
        r"NOT IN TIME: drone 0, step 2 to 3: its height changes by 2 m, which takes PX4 1.33 s by "
        r"MPC_Z_V_AUTO_DN 1.5 m/s, not 0.50 s; drone 0, step 1 to 2.* up to 1.00 s late at the end",
        notes_of(export.notes, Kind.URGENT)[0],
    )
    assert export.facts["late"] == pytest.approx(2 / 1.5 - 0.5 + 2 / 3 - 0.5, abs=0.01)
    other = FORMATS[".waypoints"].writer()(hasty, None)
    assert other.facts["late"] == 0 and "NOT IN TIME" not in said(other)
    calm = FORMATS[".plan"].writer()(flight_of(WAYS["climbs on its way"]), None)
    assert calm.facts["late"] == 0 and notes_of(calm.notes, Kind.URGENT) == []


def test_a_warning_comes_before_the_files(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], caplog: pytest.LogCaptureFixture
) -> None:
    """It is logged before they are written, which is standard error, and among the notes."""
    scene, plan = tmp_path / "a.toml", tmp_path / "plan.json"
    scene.write_text(RECIPE.replace("step = 4", "step = 1"))
    problem = co.load(scene)
    (start,) = (robot.start for robot in problem.robots)
    path = (start, *(start._replace(layer=k) for k in (1, 0, 1)))
    co.save(plan, Plan(paths=(path,)), problem)
    for ending, count in ((".plan", 1), (".waypoints", 0)):
        caplog.clear()
        run = Run(capsys, "fly", scene, plan, "-o", tmp_path / f"f{ending}", "--json")
        assert run.code == 0 and len(run.json["files"]) == 1
        assert (run.json["late"] > 0.3) == (count > 0)
        warned = [line for line in caplog.messages if "NOT IN TIME" in line]
        assert len(warned) == count == sum("NOT IN TIME" in note for note in run.json["notes"])


def test_waits_before_a_leg_are_said_beside_the_delay_tolerance() -> None:
    """PX4 goes straight up at its own speed; how far it is behind the plan is told."""
    flight = flight_of(WAYS["straight up"])
    export = FORMATS[".plan"].writer()(flight, None)
    assert "up to 3.67 s behind the plan" in said(export)
    behind = [note.kind for note in export.notes if "behind the plan" in note.text]
    assert behind == [Kind.CREW]
    assert "TOO LATE" not in said(export)
    walk = np.column_stack([[9.6, 10.0, 10.8, 11.7], np.full(4, 7.0), np.zeros((4, 2))])
    for aside, bears in ((2.5, False), (1.0, True)):
        beside = flight_of(
            WAYS["straight up"],
            actors=(co.Actor(poses=walk),),
            airspace=Airspace(people_aside=aside),
        )
        found = FORMATS[".plan"].writer()(beside, None)
        told = found.facts["delay_tolerance_to_people"]
        assert (told == "unlimited" or float(told or 0) > 3.67) == bears
        assert ("TOO LATE: " in said(found)) != bears
        assert [words[:8] for words in notes_of(found.notes, Kind.URGENT)] == (
            [] if bears else ["TOO LATE"]
        )
    assert "behind the plan" not in said(FORMATS[".waypoints"].writer()(flight, None))


def test_too_many_items_are_refused_with_what_to_do() -> None:
    """Each autopilot has its own limit, the home position counts, and a board may hold more."""
    steps = 300
    zigzag = tuple((3 + k % 2, 3, k % 2, k % 2 * 2, k % 2) for k in range(steps + 1))
    flight = flight_of(zigzag)
    for ending, name, holds in ((".plan", "px4", 500), (".waypoints", "ardupilot", 718)):
        board = partial(FORMATS[ending].writer, name)
        home = int(name == "ardupilot")
        count = len(AUTOPILOTS[name].items(route_of(flight))) + home
        assert count > holds
        words = rf"{count} items, more than the {holds} that .*PX4 500, ArduPilot 718"
        with pytest.raises(ProblemError, match=words):
            board()(flight, None)
        assert board(count)(flight, None).facts["items"] == count - home
        with pytest.raises(ProblemError, match="plan fewer or longer steps, or parts"):
            board(count - 1)(flight, None)


def test_a_battery_lasts_for_the_way_up_and_the_wait_too() -> None:
    """The wait at the start and the rise count; the flight alone would do."""
    for endurance, fits in ((12.0 + 13.9, False), (12.0 + 14.1, True)):  # 4 m up, 10 s of waiting
        flight = flight_of(WAYS["level"])
        (robot,) = flight.flown.problem.robots
        own = robot.replace(limits=Limits(endurance=endurance))
        path = tuple(State(*state) for state in WAYS["level"])
        problem = flight.flown.problem.replace(robots=(own,))
        limited = Flight.of(problem, Plan(paths=(path,)), False)
        if fits:
            FORMATS[".plan"].writer()(limited, None)
            continue
        for ending in (".plan", ".waypoints"):
            with pytest.raises(ProblemError, match=r"it is 26 s in the air, 14 s of them .* 25.9"):
                FORMATS[ending].writer()(limited, None)


def test_the_autopilot_is_chosen_and_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The file's name and the answer say which it is for; what cannot be is refused."""
    scene, plan = tmp_path / "a.toml", tmp_path / "plan.json"
    scene.write_text(RECIPE)
    problem = co.load(scene)
    co.save(plan, Plan(paths=tuple((r.start,) * 4 for r in problem.robots)), problem)
    for ending, options, name, title in (
        (".plan", (), "px4", "PX4"),
        (".plan", ("--autopilot", "px4"), "px4", "PX4"),
        (".plan", ("--autopilot", "ardupilot"), "ardupilot", "ArduPilot"),
        (".waypoints", (), "ardupilot", "ArduPilot"),
    ):
        words = "fly", scene, plan, "--hovering", "-o", tmp_path / f"f{ending}", *options, "--json"
        run = Run(capsys, *words)
        assert run.code == 0
        (file,) = run.json["files"]
        assert Path(file).name == f"f.{name}.no-common-clock.drone0{ending}"
        assert run.json["autopilot"] == title
        content = Path(file).read_bytes()
        firmware = 12 if name == "px4" else 3
        if ending == ".plan":
            assert read_plan(content, firmware)[0].command == 22
        else:
            assert read_waypoints(content, tmp_path)[0].command == 22
    for ending, options, words in (
        (".waypoints", ("--autopilot", "px4"), "--autopilot: must be ardupilot for .waypoints"),
        (".csv", ("--autopilot", "px4"), "--autopilot: must be left out for .csv"),
        (".csv", ("--items", 9), "--items: must be left out for .csv"),
        (".plan", ("--items", 0), "--items: must be more than 0"),
        (".plan", ("--items", 3), "items, more than the 3 that PX4 takes, as set by --items"),
    ):
        given = "fly", scene, plan, "--hovering", "-o", tmp_path / f"g{ending}", *options
        run = Run(capsys, *given)
        assert run.code == 2 and words in run.err and len(run.err.splitlines()) == 1
        assert not list(tmp_path.glob("g*"))


def test_a_turn_before_a_climb_is_said_with_the_climb() -> None:
    """A drone turns where it waits, and climbs then; either alone would be in time."""
    climb, turn, both = (
        AUTOPILOTS["px4"].pace(Leg(1, 1.0, 0.0, *rest))
        for rest in ((2.0, 0.0), (0.0, 45.0), (2.0, 45.0))
    )
    assert climb.late == turn.late == 0
    assert both.late == pytest.approx(33 / 45 + 2 / 3 - 1)
    assert "turns by 45 degrees, which takes PX4 0.73 s by " in both.why
    assert both.why.endswith(" and then 0.67 s for its height, not 1.00 s")
