import io
import json
import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from test_cli import Run

import cocap_opt as co
from cocap_opt.cli import flight_answer
from cocap_opt.data import FieldError
from cocap_opt.flight import flights
from cocap_opt.flight.flights import Flight
from cocap_opt.flight.safety import Danger
from cocap_opt.flight.touchdowns import Touchdowns
from cocap_opt.flight.urgent import attention
from cocap_opt.missions import FORMATS, Export, MissionFormat, table
from cocap_opt.missions.sheet import pages_of
from cocap_opt.missions.sheet.fonts import USUAL

STRAIGHT = 'flown = "straight"'
RECIPE = """
steps = 4
{step}
[map]
size = [12, 8]
[[walk]]
points = [[3, 4], [9, 4]]
[[drones]]
starts = [{{ x = 2.5, y = 2.5 }}, {{ x = 2.5, y = 6.5, heading = 45 }}]
tilts = [10, 40]
{limits}
"""


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A recipe, and a plan for it."""
    folder = tmp_path_factory.mktemp("fly")
    scene, plan = folder / "scene.toml", folder / "plan.json"
    scene.write_text(RECIPE.format(step="step = 0.5", limits=""))
    co.save(plan, co.plan(co.load(scene), "sequential"))
    return scene, plan


def test_a_plan_becomes_a_file_of_times_and_places(
    files: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """At each step drones are where the plan says, in m and degrees, straight or smooth."""
    scene, plan = files
    problem, planned = co.load(scene), co.read(plan)
    assert isinstance(planned, co.Plan)
    for words, rows in (([], 5), (["--smooth"], 41), (["--smooth", "--every", "0.3"], 8)):
        run = Run(capsys, "fly", scene, plan, "-o", tmp_path / "flight.csv", *words, "--json")
        assert run.code == 0
        assert run.json["step"] == 0.5
        table = pd.read_csv(tmp_path / "flight.csv")
        assert len(table) == 2 * rows
        assert table.t.max() == 2.0
        if rows == 8:  # whose rows pass by the steps
            continue
        for i, path in enumerate(planned.paths):
            own = table[table.drone == i].set_index("t").loc[[0, 0.5, 1, 1.5, 2]]
            np.testing.assert_allclose(own.x, [s.x + 0.5 for s in path])
            np.testing.assert_allclose(own.y, [s.y + 0.5 for s in path])
            np.testing.assert_allclose(own.z, 5.0)
            np.testing.assert_allclose(own.above_takeoff, 5.0)
            np.testing.assert_allclose(own.yaw % 360, [45 * s.heading for s in path])
            np.testing.assert_allclose(own.pitch, [(-10, -40)[s.pitch] for s in path])
            assert np.abs(np.diff(own.yaw)).max() <= 45.000001
    smooth = co.trajectory(problem, planned, smooth=True)
    assert smooth.attrs["reward"] == co.check(problem, planned).reward
    assert run.json["people_distance"] == smooth.attrs["people_distance"] > 0
    nobody = problem.replace(actors=())
    assert co.trajectory(nobody, co.Plan(paths=planned.paths)).attrs["people_distance"] is None
    text = io.BytesIO((tmp_path / "flight.csv").read_bytes())
    assert list(pd.read_csv(text).columns) == list(smooth.columns)
    assert len(co.trajectory(problem, planned)) == 10


def test_flights_that_cannot_be_made_are_refused(
    files: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """One line says why, the exit code is 2, and nothing is written."""
    scene, plan = files
    flight, clash = tmp_path / "flight.csv", tmp_path / "clash.json"
    Run(capsys, "plan", "tiny-queue", "--planner", "greedy", "-o", clash)
    for words, expected in (
        ((scene, plan, "-o", tmp_path / "flight.txt"), "-o: name a file that ends in .csv"),
        ((scene, plan), "-o: name a file that ends in .csv"),
        (("tiny-queue", clash, "-o", flight), "--step: must be given"),
        ((scene, plan, "-o", flight, "--step", 1), "--step: must be left out"),
        (("tiny-queue", clash, "-o", flight, "--step", 0), "--step: must be more than 0"),
        ((scene, plan, "-o", flight, "--every", 1e-9), "--every: must make at most"),
        ((scene, plan, "-o", plan), "must not be an input file|ends in .csv"),
        (("tiny-queue", clash, "-o", flight, "--step", 1), "clash.json: step 2: drones"),
    ):
        run = Run(capsys, "fly", *words)
        assert run.code == 2
        (line,) = [line for line in run.err.splitlines() if "seed" not in line]
        assert re.search(expected, line), line
        assert not flight.exists()


@pytest.mark.slow
def test_lines_between_rows_are_told(
    files: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A note says how far they are beside the flight; help says what is not checked."""
    problem, plan = co.load(files[0]), co.read(files[1])
    assert isinstance(plan, co.Plan)
    far = []
    for words in ([], ["--smooth", "--every", "1"]):
        run = Run(capsys, "fly", *files, "-o", tmp_path / "flight.csv", *words, "--json")
        notes = [note for note in run.json["notes"] if "straight lines between them" in note]
        far.append([float(re.findall(r"up to (\S+) m", note)[0]) for note in notes])
    off = co.trajectory(problem, plan, smooth=True, every=1).attrs["off_between_rows"]
    assert far == [[], [pytest.approx(off, rel=0.1)]]
    assert off > 0.01
    told = " ".join(Run(capsys, "fly", "--help").out.split())
    assert "Wind, deviations from the planned flight, take-off" in told


def beside_somebody() -> tuple[co.Problem, co.Plan]:
    """A drone at the minimum distance ahead of somebody who walks at its pace, and its plan."""
    walk = np.array([[1.5 + t, 4.5, 0.0, 0.0] for t in range(5)])
    path = tuple(co.State(4 + t, 4) for t in range(5))
    problem = co.Problem(
        name="ahead", height_map=co.HeightMap(heights=np.zeros((12, 9))), horizon=4, step=1.0,
        actors=(co.Actor(poses=walk),), robots=(co.Robot(start=path[0]),),
        airspace=co.Airspace(people_aside=2.99),
    )  # fmt: skip
    return problem, co.Plan(paths=(path,))


@pytest.mark.slow
def test_a_smooth_flight_beside_people_may_be_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """A drone that starts is overtaken; what is said to be enough, and of the straight one, is."""
    problem, plan = beside_somebody()
    assert len(co.trajectory(problem, plan)) == 5
    words = r"person 0, even .*; plan with people = 3.03 .* --margin 0.04; .* omit --smooth$"
    with pytest.raises(ValueError, match=words):
        co.trajectory(problem, plan, smooth=True)
    over = co.Airspace(people_aside=2.9899, people_above=12345.678)
    words = r" people = 3.03 and over_people = 12345.72 in .* --margin 0.04; "
    with pytest.raises(ValueError, match=words):
        co.trajectory(problem.replace(airspace=over), plan, smooth=True)
    monkeypatch.setattr(flights, "dangers", lambda flown: [Danger(2, (0,), "falls")])
    with pytest.raises(
        ValueError, match=r"the straight flight is not safe either: .* drone 0 falls$"
    ):
        co.trajectory(problem, plan, smooth=True)


def saved(folder: Path, problem: co.Problem, plan: co.Plan) -> tuple[Path, Path, Path]:
    """Files of a scene and its plan, and the name of one that is to be flown."""
    scene, file, out = (folder / name for name in ("scene.json", "plan.json", "f.csv"))
    co.save(scene, problem)
    co.save(file, plan, problem)
    return scene, file, out


def test_bad_ground_and_tight_timing_are_told_first(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A drone at the minimum distance ahead of somebody, which ends above a wall."""
    problem, plan = beside_somebody()
    heights = np.zeros((12, 9))
    heights[8, 4] = 2.0
    problem = problem.replace(height_map=co.HeightMap(heights=heights))
    scene, file, out = saved(tmp_path, problem, plan)
    run = Run(capsys, "fly", scene, file, "-o", out, "--json")
    assert run.code == 0
    ground, timing, *others = run.json["notes"]
    lands = "drone 0 lands on an obstacle 2.0 m above the ground; land it elsewhere"
    assert ground == f"ATTENTION: {lands}"
    assert timing.startswith("ATTENTION: drones keep 2.99 m from people only if no drone or ")
    assert not any("ATTENTION" in note for note in others)


@pytest.mark.parametrize(("row", "words"), [
    (4, "drones 0 and 1 collide at 0.0 s (0.00 m apart); plan with `separation` under [rules]"),
    (5, "drones 0 and 1 come within 1.00 m of each other at 0.0 s; plan with `separation` under "
     "[rules]"),
    (6, ""),
])  # fmt: skip
def test_drones_and_people_that_meet_without_a_rule_are_told_first(
    row: int, words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The short answer names who, when and how near; from 2 m on there is no warning."""
    problem, _ = beside_somebody()
    paths = tuple(tuple(co.State(4 + t, y) for t in range(5)) for y in (4, row))
    problem = problem.replace(
        robots=tuple(co.Robot(start=path[0]) for path in paths),
        rules=co.NO_RULES, airspace=co.Airspace(),
    )  # fmt: skip
    scene, file, out = saved(tmp_path, problem, co.Plan(paths=paths))
    told = Run(capsys, "fly", scene, file, "-o", out, "--json").json["notes"]
    assert [note for note in told if "drones 0 and 1" in note and "off" not in note
            and "land" not in note] == ([f"ATTENTION: {words}"] if words else [])  # fmt: skip
    near = problem.replace(actors=(problem.actors[0].replace(
        poses=problem.actors[0].poses + np.array([3.0, 0.0, 0.0, 0.0])
    ),))  # fmt: skip
    saved(tmp_path, near, co.Plan(paths=paths))
    short = Run(capsys, "fly", scene, file, "-o", out).out
    assert "ATTENTION: drone 0 comes within 0.00 m of person 0 at" in short
    assert (words in " ".join(short.split())) and "person 0" not in "".join(told)


@pytest.mark.parametrize("known", ["", "speed = 16", "speed = 16, acceleration = 40"])
def test_accelerations_that_few_drones_can_do_are_told(
    known: str, tmp_path: Path, capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    """Makers of drones state speeds, but often no accelerations."""
    monkeypatch.setenv("COLUMNS", "400")
    scene, plan = tmp_path / "scene.toml", tmp_path / "plan.json"
    limits = f"limits = {{ {known} }}" if known else ""
    scene.write_text(STRAIGHT + RECIPE.format(step="step = 0.5", limits=limits))
    problem = co.load(scene)
    first, second = problem.first_starts
    moves = tuple(second._replace(x=x) for x in (2, 3, 3, 2, 2))
    co.save(plan, co.Plan(paths=((first,) * 5, moves)), problem)
    words = Run(capsys, "fly", scene, plan, "--smooth", "-o", tmp_path / "f.csv").out
    is_unknown = "acceleration" not in known
    assert ("ATTENTION: drone 1 has to accelerate by " in words) == is_unknown
    which = "some limits of the drones" if known else "the limits of these drones"
    required = r" are unknown and were not checked; the flight requires .*acceleration [\d.]+ m/s2"
    assert bool(re.search(which + required + r" \(drone 1\)", words)) == is_unknown


@pytest.mark.parametrize("ending", [".csv", ".plan", ".kml", ".skyc", ".opencv.json"])
def test_warnings_come_before_a_few_lines_of_answer(
    ending: str, tmp_path: Path, capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    """Then come notes for the crew; how to read the file, and each drone, come with --verbose.

    Each note of JSON is among all of them, and the file's yaw is told once.
    """
    pytest.importorskip("pyproj")
    monkeypatch.setenv("COLUMNS", "400")  # a note is a line
    problem, plan = beside_somebody()
    problem = problem.replace(earth=co.Earth(crs="EPSG:25830", heights="sea"))
    corner = co.HeightMap(heights=np.zeros((12, 9)), origin=(500_000.0, 4_790_000.0))
    walker = problem.actors[0]
    walk = walker.poses + np.array([*corner.origin, 0.0, 0.0])
    problem = problem.replace(height_map=corner, actors=(walker.replace(poses=walk),))
    words = ("fly", *saved(tmp_path, problem, plan)[:2], "-o", tmp_path / f"f{ending}")
    told = Run(capsys, *words, "--json").json["notes"]
    short, full = Run(capsys, *words).out, Run(capsys, *words, "--verbose").out
    for out in (short, full):
        assert out.splitlines()[0] == f"{told[0]}." and told[0].startswith("ATTENTION")
    answer, notes = short.split("Before you fly:")
    assert len(answer.strip().splitlines()) <= 10 and "yaw" not in notes
    assert all(note in full for note in told)
    assert len(re.findall("yaw is", full)) == (ending != ".opencv.json")
    assert "tightest moment" in full and "tightest moment" not in short
    assert {note for note in told if note in short} > {told[0]}


@pytest.mark.parametrize(("height", "words"), [
    (2.0, "inside an obstacle at 1 of 5 steps; at step 2 their feet are 2 m below the top of the "
     "obstacle"),
    (0.0, ""),
])  # fmt: skip
def test_somebody_who_walks_through_a_wall_is_told_by_name(
    height: float, words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """In a note of `fly`, and in the frame of the sheet."""
    heights = np.zeros((12, 9))
    heights[3, 4] = height
    problem, plan = beside_somebody()
    walker = problem.actors[0].replace(name="Cleo")
    problem = problem.replace(height_map=co.HeightMap(heights=heights), actors=(walker,))
    run = Run(
        capsys, "fly", *saved(tmp_path, problem, plan)[:2], "-o", tmp_path / "f.csv", "--json"
    )
    told = [f"ATTENTION: Cleo (0) is {words}"] if words else []
    assert [note for note in run.json["notes"] if "Cleo" in note and "ATT" in note][:1] == told
    flight = Flight.of(problem, plan, False)
    framed = [*map(str, attention(flight, Touchdowns.of(flight), ()))]
    assert [each for each in framed if "obstacle" in each] == told


@pytest.mark.parametrize(("separation", "people", "told"), [
    (0.0, 0.0, {"near_drones", "near_people"}), (1.0, 0.0, {"near_people"}),
    (0.0, 0.1, {"near_drones"}), (1.0, 0.1, set()),
])  # fmt: skip
def test_plans_tell_distances_without_a_rule(
    separation: float, people: float, told: set[str],
    tmp_path: Path, capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    """Those that `fly` warns of: `verify` has the same line, and no line where there is a rule."""
    problem, _ = beside_somebody()
    paths = tuple(tuple(co.State(4 + t, y) for t in range(5)) for y in (4, 5))
    near = problem.actors[0].replace(poses=problem.actors[0].poses + np.array([3.0, 0.5, 0, 0]))
    problem = problem.replace(
        robots=tuple(co.Robot(start=path[0]) for path in paths),
        actors=(near,),
        rules=co.CollisionRules(separation=separation),
        airspace=co.Airspace(people_aside=people),
    )
    scene, file, out = saved(tmp_path, problem, co.Plan(paths=paths))
    found = Run(capsys, "verify", scene, file, "--json").json
    assert {key for key in found if key.startswith("near_")} == told
    answer = Run(capsys, "verify", scene, file).out
    for line in Run(capsys, "fly", scene, file, "-o", out).out.splitlines():
        if line.endswith(("no rule between the steps", "no rule on people")):
            told = told - {"near_drones" if "between the steps" in line else "near_people"}
            assert " ".join(line.split()) in " ".join(answer.split())
    assert not told


def test_fly_and_the_sheet_warn_of_the_same(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Of a limit, of drones and people that meet, and of the ground: in one order, each once."""
    problem, _ = beside_somebody()
    paths = tuple(tuple(co.State(4 + t, y) for t in range(5)) for y in (4, 5))
    robots = tuple(co.Robot(start=path[0]) for path in paths)
    problem = problem.replace(robots=robots, rules=co.NO_RULES, airspace=co.Airspace())
    near = problem.actors[0].replace(poses=problem.actors[0].poses + np.array([3.0, 0, 0, 0]))
    problem, plan = problem.replace(actors=(near,)), co.Plan(paths=paths)
    scene, file, out = saved(tmp_path, problem, plan)
    words = "cut short: 1 of 2 drones stays at its start"
    content = json.loads(file.read_text()) | {"cut_short": words}
    file.write_text(json.dumps(content))
    run = Run(capsys, "fly", scene, file, "-o", out, "--json")
    told = [note for note in run.json["notes"] if note.startswith("ATTENTION: ")]
    assert told == run.json["notes"][:5] and told[0] == f"ATTENTION: {words}"
    lines = Run(capsys, "fly", scene, file, "-o", out).out.split("\n\n")[0]
    assert " ".join(lines.split()) == " ".join(f"{each}." for each in told)
    flight = Flight.of(problem, plan, False)._replace(cut_short=words)
    pages = pages_of(flight, None, [USUAL])
    crew = [note.text for note in attention(flight, Touchdowns.of(flight), ())]
    assert all(each.startswith(text) for each, text in zip(told, crew, strict=True))
    (first, *_), printed = pages.figures, " ".join(f"{text}." for text in crew)
    assert printed in " ".join(" ".join(text.get_text() for text in first.texts).split())


@pytest.mark.slow
def test_a_margin_makes_room_for_a_smooth_flight(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A plan that keeps more from people is flown as the message says, and keeps the rest."""
    problem, plan = beside_somebody()
    scene, file, out = saved(tmp_path, problem, plan)
    run = Run(capsys, "fly", scene, file, "--smooth", "-o", out)
    assert run.code == 2 and not out.exists()
    (margin,) = re.findall(r"--margin (\S+);", run.err)
    run = Run(capsys, "fly", scene, file, "--smooth", "-o", out, "--margin", margin, "--json")
    assert run.code == 0
    assert run.json["people_distance"] >= 2.99 - float(margin)
    note = "--margin lets drones come closer to people: 2.95 m aside; the scene requires 2.99 m"
    assert note in run.json["notes"]
    run = Run(capsys, "robustness", scene, file, "--smooth", "--margin", margin, "--json")
    assert run.code == 0 and note in run.json["notes"]
    for wrong in (-0.1, 2.99, 2.99 - 1e-9, "nan"):
        run = Run(capsys, "fly", scene, file, "-o", out, "--margin", wrong)
        assert run.code == 2 and "--margin: must be at least 0 m and less than" in run.err
        assert "people_aside" not in run.err
    over = problem.replace(airspace=co.Airspace(people_aside=2.99, people_above=3.0))
    co.save(scene, over)
    co.save(file, plan, over)
    run = Run(capsys, "robustness", scene, file, "--margin", 1, "--json")
    words = "1.99 m aside or 2 m over heads; the scene requires 2.99 and 3 m"
    assert any(note.endswith(words) for note in run.json["notes"])
    free = problem.replace(airspace=co.Airspace())
    co.save(scene, free)
    co.save(file, plan, free)
    run = Run(capsys, "fly", scene, file, "-o", out, "--margin", 1)
    assert run.code == 2 and "--margin: the scene requires no distance from people" in run.err


def test_a_margin_of_the_face_is_that_of_the_command(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Functions fly what commands fly with the same margin, and refuse what they refuse."""
    problem, plan = beside_somebody()
    scene, file, out = saved(tmp_path, problem, plan)
    words = (scene, file, "--smooth", "--margin", 0.04, "--json")
    flown = co.trajectory(problem, plan, smooth=True, margin=0.04)
    told = Run(capsys, "fly", *words, "-o", out).json
    assert flown.attrs["people_distance"] == told["people_distance"] < 2.99
    changed = co.robustness(problem, plan, smooth=True, margin=0.04, lag=[1])
    told = Run(capsys, "robustness", *words, "--lag", 1).json
    assert list(changed.reward) == [row["reward"] for row in told["changes"]]
    assert changed.rules[0] == "kept"
    for function in (co.trajectory, co.robustness):
        for wrong in (-0.1, 2.99, float("nan")):
            with pytest.raises(ValueError, match="margin: must be at least 0 m and less than"):
                function(problem, plan, margin=wrong)
        with pytest.raises(TypeError, match="margin: must be a number of metres"):
            function(problem, plan, margin="wide")
        free = problem.replace(airspace=co.Airspace())
        with pytest.raises(ValueError, match="margin: the scene requires no distance from people"):
            function(free, plan, margin=1)


def test_errors_name_what_is_to_be_changed(
    files: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    """Fields of options and of the scene's place are told apart; all else is the plan's."""
    cases = {
        "every": "--every: is odd",
        "crs": "scene.toml: earth.crs: is odd",
        "earth.crs": "scene.toml: earth.crs: is odd; use --local to leave latitudes and longitudes "
        "out",
        "drone 0": "plan.json: drone 0: is odd",
    }  # fmt: skip
    for field, words in cases.items():

        def refuse(flight: flights.Flight, every: float | None, field: str = field) -> Export:
            raise FieldError(field, "is odd")

        monkeypatch.setattr(table, "write", refuse)
        run = Run(capsys, "fly", *files, "-o", tmp_path / "flight.csv")
        assert run.code == 2
        assert run.err.strip().endswith(words)


def test_a_new_format_is_one_module_and_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A registered format is written, named in messages, and asked only for what its line says."""
    (tmp_path / "places_format.py").write_text(
        "from cocap_opt.flight.notes import Kind, Note\n"
        "from cocap_opt.missions import Export\n"
        "def write(flight, every):\n"
        "    notes = Note('only x is in it'), Note('x is in m', Kind.READING)\n"
        "    return Export({'': flight.columns(every)['x'].tobytes()}, notes)\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setitem(FORMATS, ".places.txt", MissionFormat("places_format"))
    plan, out = tmp_path / "plan.json", tmp_path / "flight.places.txt"
    co.save(plan, co.plan(co.load("tiny-queue"), "sequential"))
    run = Run(capsys, "fly", "tiny-queue", plan, "-o", out, "--step", 4, "--hovering")
    assert run.code == 0 and out.read_bytes()
    assert "only x is in it" in run.out and "x is in m" not in run.out
    run = Run(capsys, "fly", "tiny-queue", plan, "-o", tmp_path / "flight.odd")
    assert run.code == 2 and ".places.txt" in run.err
    for option, value in (("--start", "2026-05-01T10:00:00Z"), ("--autopilot", "px4")):
        run = Run(capsys, "fly", "tiny-queue", plan, "-o", out, "--hovering", option, value)
        assert run.code == 2 and f"{option}: must be left out for .places.txt" in run.err


def test_formats_are_imported_when_they_are_asked_for() -> None:
    """Knowing the formats loads none of their modules, nor matplotlib."""
    code = (
        "import sys, cocap_opt.missions as m; assert m.FORMATS; "
        "assert 'matplotlib' not in sys.modules; "
        "assert not any(f'cocap_opt.missions{f.module}' in sys.modules for f in m.FORMATS.values())"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_a_step_that_is_too_short_for_a_show_is_named_by_its_option(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """It is `--step` that is to be changed where it was given."""
    plan, out = tmp_path / "plan.json", tmp_path / "show.skyc"
    co.save(plan, co.plan(co.load("tiny-queue"), "sequential"))
    run = Run(capsys, "fly", "tiny-queue", plan, "-o", out, "--smooth", "--step", 0.001)
    assert run.code == 2 and not out.exists()
    assert re.search("--step: must be at least .* s for a show of this flight", run.err)


@pytest.mark.slow
def test_limits_hold_for_scenes_and_for_flights(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Moves that no step allows make no scene; accelerations that are too large make no flight."""
    scene, plan = tmp_path / "scene.toml", tmp_path / "plan.json"
    for limits, words in (
        ("limits = { speed = 2 }", r"drones\[0\].motion.radius: .* use a step of 0.708 s"),
        ('airframe = "px4"', r"drones\[0\].motion.turn: .* a step of 0.75 s"),
        ('airframe = "kite"', "airframe: must be one of px4"),
        ("limits = { wings = 2 }", "wings"),
        ("limits = { endurance = 1.9 }", "endurance: the flight takes 2 s, but the battery lasts"),
    ):
        scene.write_text(RECIPE.format(step=f"step = 0.5\n{STRAIGHT}", limits=limits))
        run = Run(capsys, "plan", scene)
        assert run.code == 2
        assert re.search(words, run.err), run.err
    for step, most, code in (("1", 2.0, 2), ("2.03", 2.0, 0), ("1", 100.0, 0)):
        limits = f"limits = {{ acceleration = {most} }}"
        scene.write_text(RECIPE.format(step=f"step = {step}\n{STRAIGHT}", limits=limits))
        co.save(plan, co.plan(co.load(scene), "sequential"))
        run = Run(capsys, "fly", scene, plan, "--smooth", "-o", tmp_path / "f.csv", "--json")
        assert run.code == code
        assert (tmp_path / "f.csv").exists() == (code == 0)
        words = r"cannot fly this: acceleration .*; set step = 2.03 in the scene's recipe and"
        assert code == 0 or re.search(words, run.err)
    assert run.json["step"] == 1.0
    assert [row["tightest"] for row in run.json["drones"]] == ["acceleration"] * 2


def test_of_many_drones_the_tightest_are_shown(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The drones nearest to a limit come first, and a note says how many are left out."""
    scene, plan = tmp_path / "scene.toml", tmp_path / "plan.json"
    scene.write_text(RECIPE.format(step="", limits="limits = { speed = 30 }"))
    co.save(plan, co.plan(co.load(scene), "sequential"))
    every = ("fly", scene, plan, "-o", tmp_path / "f.csv", "--verbose")
    assert "--json has all" not in Run(capsys, *every).out
    monkeypatch.setattr(flight_answer, "_MANY", 1)
    monkeypatch.setattr(flight_answer, "_FEW", 1)
    rows = Run(capsys, *every, "--json").json["drones"]
    assert len(rows) == 2
    first = max(rows, key=lambda row: row["value"])
    out = Run(capsys, *every).out
    assert "the fastest: 1 of 2; --json has all" in out
    assert f"{first['drone']}  speed" in out and f"{1 - first['drone']}  speed" not in out


def test_the_way_out_of_a_refused_flight_works(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A scene that states no step is told a --step, with which the same plan is flown."""
    problem = co.load("tiny-queue")
    limited = (robot.replace(limits=co.Limits(acceleration=2.0)) for robot in problem.robots)
    problem = problem.replace(robots=tuple(limited))
    scene, plan = tmp_path / "scene.json", tmp_path / "plan.json"
    co.save(scene, problem)
    co.save(plan, co.plan(problem, "sequential"))
    words = "fly", scene, plan, "--smooth", "-o", tmp_path / "f.csv", "--step"
    run = Run(capsys, *words, 1)
    assert run.code == 2
    found = re.search(r"more than its 2; use --step ([0-9.]+)$", run.err.strip())
    assert found, run.err
    assert Run(capsys, *words, found[1]).code == 0


def test_the_face_refuses_what_cannot_be_flown() -> None:
    """A duration must come once, from the scene or from the call."""
    problem = co.load("tiny-queue")
    plan = co.plan(problem, "sequential")
    with pytest.raises(ValueError, match="step: must be given"):
        co.trajectory(problem, plan)
    with pytest.raises(ValueError, match="step: must be left out"):
        co.trajectory(problem.replace(step=2.0), plan.plan, step=1.0)
    assert co.trajectory(problem, plan, step=2.0).t.max() == 2.0 * problem.horizon


def test_a_plan_that_is_not_flown_as_planned(
    files: tuple[Path, Path], capsys: pytest.CaptureFixture[str]
) -> None:
    """Command and face have the same rows; the first is the plan, and a change costs J."""
    scene, plan = files
    words = ("--late", 1, 0.5, "--aside", 2, "--lag", 0.7)
    run = Run(capsys, "robustness", scene, plan, *words, "--json")
    assert run.code == 0
    problem, planned = co.load(scene), co.read(plan)
    assert isinstance(planned, co.Plan)
    table = co.robustness(problem, planned, late=[1, 0.5], aside=[2], lag=[0.7])
    assert run.json["changes"] == table.astype(object).where(table.notna(), None).to_dict("records")
    assert list(table.change)[:-2] == [
        "as planned", "people 1 s late", "people 1 s early", "people 0.5 s late",
        "people 0.5 s early", "people 2 m left", "people 2 m right", "any drone 0.7 s late",
    ]  # fmt: skip
    assert list(table.lost_drone[-2:]) == [0, 1] and table.by_two[:-2].count() == 1
    at_two = Run(capsys, "robustness", scene, plan, "--lost", 2, 4, "--json").json["changes"]
    assert [row["change"] for row in at_two[-2:]] == [
        "drone 1 lost at step 2", "drone 1 lost at step 4",
    ]  # fmt: skip
    assert at_two[-2]["reward"] <= at_two[-1]["reward"] <= at_two[0]["reward"]
    first = table.iloc[0]
    assert (first.share, first.rules) == (1, "kept")
    assert first.reward == co.trajectory(problem, planned).attrs["reward_straight"]
    assert first.least_distance >= 2 - 1e-6 and table.people_distance.isna().all()
    assert (run.json["delay_tolerance"], table.attrs["delay_tolerance"]) == ("unlimited", np.inf)
    assert run.json["delay_tolerance_to_people"] is None
    run = Run(capsys, "robustness", scene, plan, *words)
    assert "if a drone is lost" in run.out
    assert max(map(len, run.out.splitlines())) <= 200 and "any drone 0.7 s late" in run.out


def test_usual_changes_are_no_longer_than_the_flight(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A flight may be shorter than the usual delays: nobody asked for these."""
    scene, plan = tmp_path / "scene.toml", tmp_path / "plan.json"
    for step, times in ((0.1, set()), (0.25, {"0.5", "1"}), (0.5, {"0.5", "1", "2"})):
        scene.write_text(RECIPE.format(step=f"step = {step}", limits=""))
        co.save(plan, co.plan(co.load(scene), "sequential"))
        run = Run(capsys, "robustness", scene, plan, "--json")
        changes = [row["change"].split() for row in run.json["changes"]]
        assert {words[2] for words in changes if words[1] == "drone"} == times
        assert {words[1] for words in changes if "early" in words} == times - {"0.5"}
        assert ["people", "1", "m", "left"] in changes


def test_changes_that_are_none_are_refused(
    files: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """One line names the option, the exit code is 2."""
    scene, plan = files
    clash = tmp_path / "clash.json"
    Run(capsys, "plan", "tiny-queue", "--planner", "greedy", "-o", clash)
    for words, expected in (
        ((scene, plan, "--lag", 0), "--lag: must be more than 0 and at most 2 s, as long as the"),
        ((scene, plan, "--late", "nan"), "--late: must be more than 0 and at most 2 s"),
        ((scene, plan, "--aside", 1000), "--aside: must be more than 0 and at most 100 m"),
        ((scene, plan, "--lost", 5), "--lost: must be steps of the plan, 0..4, not 5"),
        ((scene, plan, "--step", 1), "--step: must be left out"),
        (("tiny-queue", clash), "--step: must be given"),
        (("tiny-queue", clash, "--step", "-1"), "--step: must be more than 0 seconds, and finite"),
        (("tiny-queue", clash, "--step", 1), "clash.json: step 2: drones"),
    ):
        run = Run(capsys, "robustness", *words)
        assert run.code == 2
        (line,) = [line for line in run.err.splitlines() if "seed" not in line]
        assert expected in line
    with pytest.raises(ValueError, match="lag: must be more than 0"):
        co.robustness(co.load(scene), co.plan(co.load(scene), "sequential"), lag=[-1])


def test_ctrl_c_while_files_are_written_is_told_what_they_are(
    files: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    """All files are there, and so are the notes; pressed twice, one line says that they are."""
    real, out = os.replace, tmp_path / "f.crazyflie.csv"
    for presses in (1, 2):
        left = [signal.SIGINT] * presses

        def press(source: str, target: Path, left: list[int] = left) -> None:
            while left:
                signal.raise_signal(left.pop())
            real(source, target)

        with monkeypatch.context() as patch:
            patch.setattr(os, "replace", press)
            run = Run(capsys, "fly", *files, "--smooth", "-o", out)
        names = sorted(tmp_path.glob("f.drone*.crazyflie.csv"))
        assert len(names) == 2
        if presses == 1:
            assert run.code == 0 and "start all drones at once" in run.out
        else:
            assert run.code == 130
            expected = ", ".join(map(str, names))
            assert run.err.strip() == f"cocap-opt: interrupted, written: {expected}"
        for path in names:
            path.unlink()


def test_a_straight_flight_down_a_steep_ground_names_the_ground_and_a_step_for_straight_ones() -> (
    None
):
    """Layers as far apart as a straight flight may be do not hide that the ground is too steep."""
    ground = np.add.outer(np.minimum(0.5 * np.arange(9), 2.0), np.zeros(9))
    robot = co.Robot(start=co.State(4, 1, 1), motion=co.Motion(layers=(9.0, 12.0)),
                  limits=co.Limits(climb=3.0, descent=3.0))  # fmt: skip
    problem = co.Problem(
        name="hill", height_map=co.HeightMap(heights=ground, datum=ground), robots=(robot,),
        actors=(), horizon=2, step=1.0,
    )  # fmt: skip
    path = (co.State(4, 1, 1), co.State(3, 1, 0), co.State(3, 1, 0))
    with pytest.raises(flights.LimitError) as raised:
        flights.Flight.of(problem, co.Plan(paths=(path,)), smooth=False)
    assert "descent 3.5 m/s" in raised.value.words
    assert "the cause is the ground" in raised.value.way_out
    assert raised.value.any_plan == 1.17  # 3.5 m at 3 m/s, not 15/8 of it as smooth flights need
    slower = problem.replace(step=raised.value.any_plan)
    assert flights.Flight.of(slower, co.Plan(paths=(path,)), smooth=False).flown.seconds > 2
    with pytest.raises(flights.LimitError) as raised:
        flights.Flight.of(slower, co.Plan(paths=(path,)), smooth=True)
    assert not raised.value.way_out  # of 3 m alone a smooth flight asks for too much


def test_beside_level_water_nobody_knows_the_height_above_the_ground() -> None:
    """A canal is level, but the ground rises from it: a height above the water is none above it."""
    heights = np.zeros((20, 20))
    heights[2:, :] = np.linspace(0.1, 3.0, 18)[:, None]  # a bank, from the water to a hill
    robot = co.Robot(start=co.State(15, 3), motion=co.Motion(layers=(9.0,)))
    plan = co.Plan(paths=((co.State(15, 3),) * 2,))
    for above, known in ((heights, False), (np.where(heights > 2, 7.0, 0.0), True)):
        problem = co.Problem(
            name="canal", height_map=co.HeightMap(heights=above), robots=(robot,), actors=(),
            horizon=1, step=1.0,
        )  # fmt: skip
        columns = flights.Flight.of(problem, plan, smooth=False).columns()
        assert ("above_ground" in columns) is known


def test_of_a_plan_cut_short_judgements_say_so_first(
    files: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str],
    caplog: pytest.LogCaptureFixture,
) -> None:  # fmt: skip
    """A valid plan that bears every delay may be one in which no drone moves."""
    scene, plan = files[0], tmp_path / "cut.json"
    problem = co.load(scene)
    hovering = co.Plan(paths=tuple((r.start,) * (problem.horizon + 1) for r in problem.robots))
    value = co.check(problem, hovering).reward
    co.save(plan, co.Result(hovering, value, co.Reason.STOPPED, limit="time"), problem)
    run = Run(capsys, "verify", scene, plan)
    assert run.code == 0 and run.out.splitlines()[0].split()[0] == "attention"
    run = Run(capsys, "robustness", scene, plan)
    assert run.code == 0 and "cut.json: no plan: " in caplog.text
    assert "no plan" in Run(capsys, "robustness", scene, plan, "--json").json["cut_short"]
