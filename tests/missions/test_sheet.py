import re
from dataclasses import replace
from datetime import datetime, timedelta, timezone
from importlib import import_module
from pathlib import Path

import numpy as np
import pyproj
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.figure import Figure
from strategies import examples
from test_cli import Run
from test_gltf import scene

import cocap_opt as co
from cocap_opt.data import ProblemError
from cocap_opt.flight.flights import Flight
from cocap_opt.missions import FORMATS
from cocap_opt.missions.briefing import briefing
from cocap_opt.problem import Limits
from cocap_opt.scenarios.hardware import AIRFRAMES, CAMERAS

# The package's name `sheet` is the writer.
sheet_module = import_module("cocap_opt.missions.sheet")


def text_of(flight: Flight, every: float | None = None) -> dict[str, list[str]]:
    """The lines of a sheet by their titles."""
    return dict(briefing(flight, every))


def numbers(line: str) -> list[float]:
    """The numbers in a line."""
    return [float(word) for word in re.findall(r"-?\d+\.?\d*", line)]


def test_a_battery_is_what_the_scene_knows() -> None:
    """Each drone has its own row, with what it is; what nobody knows is a blank to be filled in."""
    problem, plan = scene()
    kinds = (
        (CAMERAS["skydio-2"], AIRFRAMES["skydio-2"]),
        (co.Camera(width=640), Limits(endurance=1200.0)),
    )
    robots = tuple(
        robot.replace(camera=camera.replace(tilts=robot.camera.tilts), limits=limits)
        for robot, (camera, limits) in zip(problem.robots, kinds, strict=True)
    )
    lines = text_of(Flight.of(problem.replace(robots=robots), plan, False))["Drones"]
    assert lines[1].split() == ["0", "skydio-2", "skydio-2", "23.0", "min"]
    assert lines[2].split() == ["1", "__________", "__________", "20.0", "min"]


def test_a_plan_that_was_cut_short_says_so_first() -> None:
    """At the top of the first page, and not once more among what was not checked."""
    problem, plan = scene()
    words = "cut short: 1 of 2 drones stays at its start"
    flight = Flight.of(problem, plan, False)._replace(cut_short=words)
    sections = briefing(flight, None)
    assert sections[0][1][0] == f"ATTENTION: {words}."
    assert sum(words in line for _, lines in sections for line in lines) == 1


def test_the_crew_is_told_who_is_filmed_badly() -> None:
    """A line per person who counts, with the worst moment in seconds; nothing where nobody does."""
    problem, plan = scene()
    first, *others = problem.actors
    people = (first.replace(name="A" + 60 * "x"), *others)
    problem = problem.replace(actors=people)
    flight = Flight.of(problem, plan, False)
    lines = text_of(flight)["How people are filmed"]
    found = co.quality(problem, plan)
    assert lines[0] == f"Cameras: {found.summary.line}."
    for person, line in zip(found.by_person, lines[4:], strict=False):
        assert line.startswith(person.person[:5]) and line.endswith(person.worst or "none")
        assert numbers(line[24:])[0] == pytest.approx(100 * person.by_two, abs=0.5)
        assert len(line) <= 104
    hidden = [actor.replace(importance=(0.0,) * len(actor.poses)) for actor in people]
    nobody = Flight.of(problem.replace(actors=tuple(hidden)), plan, False)
    assert "How people are filmed" not in text_of(nobody)


def test_no_fly_zones_are_told_from_houses_on_the_map() -> None:
    """They have a colour of their own, which the map's legend names."""
    problem, plan = scene()
    assert problem.airspace.no_fly
    for airspace, count in ((problem.airspace, len(problem.airspace.no_fly)), (co.Airspace(), 0)):
        ax = Figure().add_subplot()
        sheet_module._draw_map(ax, Flight.of(problem.replace(airspace=airspace), plan, False))
        assert len(ax.patches) == count
        legend = ax.get_legend()
        assert legend is not None
        words = [text.get_text() for text in legend.get_texts()]
        assert ("no-fly zone" in words) == bool(count)
        assert {"end", "0, 1, ..: drone, start", "P0, P1, ..: person, start"} <= set(words)


def test_names_stay_as_they_are() -> None:
    """A person's table has her name over it as the scene writes it."""
    problem, plan = scene()
    (actor,) = problem.actors
    for name, title in ((None, "Person 0"), ("Ada LOVELACE", "Person 0 (Ada LOVELACE)"),
                        ("ada", "Person 0 (ada)")):  # fmt: skip
        named = problem.replace(actors=(actor.replace(name=name),))
        assert title in text_of(Flight.of(named, plan, False))


@pytest.mark.parametrize("smooth", [False, True])
def test_a_battery_has_to_last_for_the_way_up_and_the_wait(smooth: bool) -> None:
    """The sheet says how long drones are in the air, and whose battery is too small for that."""
    problem, plan = scene()
    flight = Flight.of(problem, plan, smooth)
    heights = flight.columns(flight.flown.seconds)
    rise = heights["above_takeoff"][heights["t"] == 0].max()
    seconds = rise + (0 if smooth else 10) + flight.flown.seconds
    for endurance, lasts in ((seconds - 0.1, False), (seconds + 0.1, True)):
        limits = Limits(endurance=endurance)
        robots = (problem.robots[0], problem.robots[1].replace(limits=limits))
        lines = text_of(Flight.of(problem.replace(robots=robots), plan, smooth))["Drones"]
        (told,) = [line for line in lines if line.startswith("In the air:")]
        assert numbers(told)[0] == pytest.approx(seconds, abs=0.06)
        assert any("BATTERY OF DRONE 1 DOES NOT LAST" in line for line in lines) != lasts
        assert not any("DRONE 0" in line for line in lines)


def test_the_crew_reads_which_file_is_for_which_autopilot() -> None:
    """And above what the ceiling is, and where no-fly zones are."""
    problem, plan = scene()
    earth = co.Earth(crs="EPSG:25830", origin=(43.26, -2.93), heights="sea", base=3.0)
    airspace = problem.airspace.replace(ceiling=50.0)
    flight = Flight.of(problem.replace(earth=earth, airspace=airspace), plan, False)
    sections = text_of(flight)
    lines = "\n".join(sections["Missions of waypoints"])
    assert "*.px4.*.plan: for PX4" in lines
    assert "*.ardupilot.*.waypoints or *.ardupilot.*.plan: for ArduPilot" in lines
    limits = "\n".join(sections["Distances and limits"])
    assert "The ceiling is 50 m above " in limits
    assert re.search(r"No-fly zone 0, .*, with corners x \d+\.\d y \d+\.\d, ", limits)
    for other in (
        Flight.of(problem.replace(earth=earth), plan, True),
        Flight.of(problem.replace(earth=None), plan, False),
    ):
        assert "Missions of waypoints" not in text_of(other)


def test_the_crew_reads_where_in_their_tracks_people_begin() -> None:
    """Step 0 need not be the first moment of a track."""
    problem, plan = scene()
    (actor,) = problem.actors
    for begin, count in ((None, 0), (15.5, 1)):
        own = problem.replace(actors=(actor.replace(begin=begin),))
        lines = text_of(Flight.of(own, plan, False))["Flight"]
        assert (
            sum("Step 0 is at 15.5 s of the tracks of person 0." in line for line in lines) == count
        )


def test_a_margin_is_told_beside_what_the_scene_asks_for() -> None:
    """The crew reads which distance to people is kept, and which the scene says."""
    problem, plan = scene()
    flight = Flight.of(problem, plan, False)
    for asked, count in ((None, 0), (problem.airspace.replace(people_aside=9.0), 1)):
        lines = text_of(flight._replace(asked=asked))["Distances and limits"]
        assert sum("The scene asks for 9 m from people" in line for line in lines) == count


@pytest.mark.parametrize("smooth", [False, True])
def test_the_crew_reads_when_and_where_people_walk(smooth: bool) -> None:
    """Each person has a table, the signal a time, and the distance to people its tolerance."""
    problem, plan = scene()
    problem = problem.replace(airspace=problem.airspace.replace(people_aside=1.0))
    flight = Flight.of(problem, plan, smooth)
    sections = text_of(flight)
    walk = problem.actors[0].poses[:4, :2]
    rows = [numbers(line) for line in sections["Person 0"][1:]]
    assert rows == [pytest.approx([0.5 * t, *walk[t]], abs=0.006) for t in range(4)]
    (signal,) = [line for line in sections["Flight"] if "signal" in line]
    assert ("15 s after starting the missions" in signal) == (not smooth)
    assert any("drones keep 1 m from people" in line for line in sections["Late drones and people"])


@pytest.mark.parametrize("smooth", [False, True])
def test_least_distances_are_those_of_dense_samples(smooth: bool) -> None:
    """Between drones, and from drones to people seen from above, with when and where."""
    flight = Flight.of(*scene(), smooth)
    drones, people, airspace, *_ = text_of(flight)["Distances and limits"]
    t = np.linspace(0, 1.5, 3001)
    found = flight.flown.at(t)
    one, other = (found.place[found.drone == i] for i in range(2))
    apart = np.linalg.norm(other - one, axis=1)
    least, first, second, when, *place = numbers(drones)
    assert (first, second) == (0, 1)
    assert least == pytest.approx(apart.min(), abs=0.006)
    assert np.interp(when, t, apart) == pytest.approx(least, abs=0.02)
    at = flight.flown.at(np.array([when])).place[0]
    assert place == pytest.approx(at.tolist(), abs=0.06)
    walk = flight.flown.problem.actors[0].poses[:, :2]
    feet = np.column_stack([np.interp(t / 0.5, range(4), column) for column in walk.T])
    aside = np.linalg.norm([drone[:, :2] - feet for drone in (one, other)], axis=2)
    least, drone, person, when, *_ = numbers(people)
    assert (drone, person) == (np.argmin(aside.min(axis=1)), 0)
    assert least == pytest.approx(aside.min(), abs=0.006)
    assert flight.record()["people_distance"] == pytest.approx(aside.min(), abs=1e-4)
    assert "1 no-fly zone" in airspace


def test_tables_have_the_places_of_the_flight() -> None:
    """Rows are the trajectory's, to the digits that are printed; a step is at most one row."""
    flight = Flight.of(*scene(), True)
    sections = text_of(flight, 0.75)
    for i in range(2):
        rows = [numbers(line) for line in sections[f"Drone {i}"][2 - i :]]
        found = flight.flown.at(np.array([0, 0.75, 1.5]))
        own = found.drone == i
        np.testing.assert_allclose([row[0] for row in rows], [0, 0.75, 1.5])
        np.testing.assert_allclose([row[1:4] for row in rows], found.place[own], atol=0.006)
        yaw = np.degrees(found.yaw[own]) % 360
        np.testing.assert_allclose([row[-2] for row in rows], yaw, atol=0.06)
    legs = [numbers(line) for line in sections["Take-off and landing (a suggestion)"][4:]]
    assert [leg[-3:] for leg in legs[:2]] == [[0, 5, 5], [0, 8, 8]]
    assert "__" in sections["Flight"][1]  # nobody says when it starts
    with pytest.raises(ProblemError, match="every: must make at most 10000 rows on paper"):
        briefing(flight, 1e-4)


def test_legs_end_on_a_deck_where_the_flight_is_above_it() -> None:
    """The surface below is the highest matter that is not over the drone."""
    heights, deck = np.zeros((4, 3)), co.Mesh.box((0.0, 0.0, 2.0), (4.0, 1.0, 3.0))
    motion = co.Motion(layers=(1.0, 6.0), clearance=0.5)
    starts = [co.State(1, 0, layer) for layer in (0, 1)]
    problem = co.Problem(
        name="deck", height_map=co.HeightMap(heights=heights), meshes=(deck,), horizon=1,
        robots=tuple(co.Robot(start=start, motion=motion) for start in starts), actors=(), step=1.0,
    )  # fmt: skip
    flight = Flight.of(problem, co.Plan(paths=tuple((start, start) for start in starts)), False)
    *_, under, _, over, _ = text_of(flight)["Take-off and landing (a suggestion)"]
    assert numbers(under)[-3:] == [0, 1, 1]
    assert numbers(over)[-3:] == [3, 6, 3]


@examples(50)
@given(st.lists(st.integers(1, 150), min_size=1, max_size=6), st.floats(0.3, 0.9))
def test_pages_have_all_lines_in_order(sizes: list[int], top: float) -> None:
    """None is lost or runs off its page, and what fits on a page is on one."""
    sections = [[(f"{k}.{line}", not line) for line in range(n)] for k, n in enumerate(sizes)]
    pages = sheet_module._paged(sections, top)
    assert [line for page in pages for line in page] == [line for s in sections for line in s]
    room = [(edge - sheet_module._BOTTOM) / sheet_module._LINE for edge in (top, sheet_module._TOP)]
    for k, page in enumerate(pages):
        assert len(page) <= room[min(k, 1)]
    for section in sections:
        on = [k for k, page in enumerate(pages) if section[0] in page or section[-1] in page]
        assert len(on) == 1 or len(section) > int(room[1])


@pytest.mark.slow
def test_the_sheet_is_printed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A4 pages, the same each time; north is the true one; it says when the flight starts."""
    problem, plan = scene()
    problem = problem.replace(
        name="yard \u98db", earth=co.Earth(crs="EPSG:2154", origin=(48.85, -3.5)),
        height_map=problem.height_map.replace(origin=(0.0, 0.0)), actors=(), meshes=(),
        airspace=co.Airspace(),
    )  # fmt: skip
    files = tmp_path / "scene.json", tmp_path / "plan.json"
    co.save(files[0], problem)
    co.save(files[1], plan, problem)
    words = "--start", "2026-05-01T10:00:00+02:00", "-o", tmp_path / "sheet.pdf"
    run = Run(capsys, "fly", *files, *words)
    assert run.code == 0, run.err
    page = (tmp_path / "sheet.pdf").read_bytes()
    flight = Flight.of(problem, plan, False)
    start = datetime(2026, 5, 1, 10, tzinfo=timezone(timedelta(hours=2)))
    for base, words in ((0.0, "z: height above the sea"), (-7.5, "z + -7.5 m is the height")):
        above = problem.replace(earth=co.Earth(crs="EPSG:2154", heights="sea", base=base))
        other = flight._replace(flown=replace(flight.flown, problem=above))
        assert words in text_of(other)["Flight"][-1]
    assert (
        "2026-05-01 10:00:00+02:00, which is 2026-05-01 08:00:00 UTC"
        in text_of(flight._replace(start=start))["Flight"][1]
    )
    assert FORMATS[".pdf"].writer()(flight._replace(start=start), None).files[""] == page
    (box,) = set(re.findall(rb"/MediaBox \[([\d. ]+)\]", page))
    assert [float(side) for side in box.split()] == pytest.approx([0, 0, 595.28, 841.89], abs=0.01)
    ax = Figure().add_subplot()
    sheet_module._draw_north(ax, flight)
    (arrow,) = ax.texts
    x, y = arrow.get_position()
    # The grid's north is west of the true one here, so that the arrow leans to the right.
    convergence = pyproj.Proj("EPSG:2154").get_factors(-3.5, 48.85).meridian_convergence
    assert np.degrees(np.arctan2(-x, -y)) == pytest.approx(-convergence, abs=0.01)
    assert convergence < -4
