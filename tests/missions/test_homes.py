"""Homes of recipes, in what `fly` prints and writes."""

import json
import re
from pathlib import Path

import pytest
from test_sheet import clock_of, text_of

import cocap_opt as co
from cocap_opt.cli.commands import run
from cocap_opt.data import ProblemError
from cocap_opt.flight.flights import Flight
from cocap_opt.missions.sheet.clock import phases_of
from cocap_opt.missions.sheet.words import running_order, to_check
from cocap_opt.planners import PLANNERS
from cocap_opt.problem import Problem
from cocap_opt.scenarios.recipe import read
from cocap_opt.stop import never

RECIPE = """
steps = 6
step = 2.0
[map]
size = [20, 12]
[[walk]]
points = [[8, 6], [14, 6]]
[[drones]]
starts = [{ x = 6.5, y = 3.5 }, { x = 6.5, y = 8.5 }]
homes = {homes}
limits = { endurance = {endurance}, speed = 5 }
motion = { layers = [5] }
"""


def recipe(folder: Path, homes: str = "[[2.5, 3.5], [2.5, 8.5]]", endurance: float = 60) -> Path:
    """The file of a recipe with homes."""
    path = folder / "scene.toml"
    text = RECIPE.replace("{homes}", homes).replace("{endurance}", str(endurance))
    path.write_text(text)
    return path


def flight(problem: Problem) -> Flight:
    """The flight of a plan."""
    plan = PLANNERS["sequential"](problem, never).plan
    assert plan is not None
    return Flight.of(problem, plan, False)


def test_fly_tells_the_time_from_take_off_to_landing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], caplog: pytest.LogCaptureFixture
) -> None:
    """The tightest in a line; all in a table and in JSON, with the points of the ways.

    Where batteries do not last it warns.
    """
    plan, out = str(tmp_path / "plan.json"), str(tmp_path / "flight.csv")
    scene = str(recipe(tmp_path))
    assert run(["plan", scene, "--planner", "sequential", "-o", plan]) == 0
    capsys.readouterr()
    assert run(["fly", scene, plan, "-o", out]) == 0
    printed = capsys.readouterr().out
    assert re.search(
        r"in the air +\d+ s at most \(drone \d\); \d+ s of battery left at least", printed
    )
    assert "people were not considered" in " ".join(printed.split())
    assert "batteries do not last" not in caplog.text + printed
    assert run(["fly", scene, plan, "-o", out, "--verbose"]) == 0
    assert "from take-off to landing" in capsys.readouterr().out
    assert run(["fly", scene, plan, "-o", out, "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)["from_home"]
    assert rows == co.trajectory(co.load(scene), co.read(plan)).attrs["from_home"]
    assert [(row["first"], row["last"], row["drone"]) for row in rows] == [(0, 6, 0), (0, 6, 1)]
    for row, home in zip(rows, ([2.5, 3.5, 0], [2.5, 8.5, 0]), strict=True):
        assert row["out"]["points"][0] == home == row["back"]["points"][-1]
        assert 12 + 2 * 5 < row["seconds"] <= row["endurance"] == 60

    scene = str(recipe(tmp_path, endurance=29))
    assert run(["plan", scene, "--planner", "sequential", "-o", plan]) == 0
    assert run(["fly", scene, plan, "-o", out, "--json"]) == 0
    assert re.search(
        r"batteries do not last for the whole take: pause it \(people, too\) at steps? \d",
        caplog.text,
    )
    capsys.readouterr()
    assert run(["fly", scene, plan, "-o", out]) == 0
    assert capsys.readouterr().out.startswith("ATTENTION: batteries do not last")


def test_missions_do_not_hold_the_ways(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Which a note says; the sheet has them."""
    text = recipe(tmp_path).read_text() + '[earth]\ncrs = "EPSG:25830"\n'
    path = tmp_path / "scene.toml"
    path.write_text(text.replace("size = [20, 12]", "size = [20, 12]\norigin = [500000, 4790000]")
                    .replace("[[8, 6], [14, 6]]", "[[500008, 4790006], [500014, 4790006]]")
                    .replace("x = 6.5, y = ", "x = 500006.5, y = 479000")
                    .replace("[[2.5, 3.5], [2.5, 8.5]]",
                             "[[500002.5, 4790003.5], [500002.5, 4790008.5]]"))  # fmt: skip
    plan = str(tmp_path / "plan.json")
    assert run(["plan", str(path), "--planner", "sequential", "-o", plan]) == 0
    capsys.readouterr()
    assert run(["fly", str(path), plan, "-o", str(tmp_path / "f.waypoints")]) == 0
    printed = " ".join(capsys.readouterr().out.split())
    assert ".waypoints contains no flights from and to home: see the sheet (.pdf) or" in printed
    assert "put drones below their first places, not at home" in printed


def test_the_sheet_has_ways_and_batteries(tmp_path: Path) -> None:
    """Order, seconds, points, a map of the ways; what is not checked then are people on them."""
    flown = flight(read(recipe(tmp_path)))
    clock = clock_of(flown)
    found = text_of(flown)
    assert "Take-off and landing (a suggestion)" not in found
    rows = [line.split() for line in found["From home and back"] if line.startswith("0..6")]
    assert [(row[1], row[-1]) for row in rows] == [("0", "60"), ("1", "60")]
    for row in rows:
        assert sum(map(float, row[2:7])) == pytest.approx(float(row[7]), abs=0.3)
    assert found["Ways"][1].split() == ["0", "out", "2.5", "3.5", "0.0"]
    assert "the flights from and to home are clear of people" in [*to_check(flown, True)]
    order = running_order(flown, clock).rows
    assert [row[2].split(",")[0] for row in order if row[1].startswith("drone ")] == [
        "takes off", "takes off", "flies home", "flies home"
    ]  # fmt: skip
    (part,) = clock.parts
    first = max(part.drones, key=lambda drone: drone.out.waits)
    assert order[0][:2] == (clock.at(-first.out.waits - first.out.seconds), f"drone {first.drone}")
    assert [phase.kind for phase in phases_of(flown, clock.parts)] == ["out", "take", "back"]
    parted = flight(read(recipe(tmp_path, endurance=29)))
    clock = clock_of(parted)
    assert len(clock.parts) > 1 and "Ways of steps 0..6" not in text_of(parted)
    pause = clock.parts[0].last * 2.0
    assert clock.at(pause, 1) == "T2+0:00" and clock.at(pause, 0) == f"T+0:{pause:02.0f}"
    assert any(row[1] == "crew" for row in running_order(parted, clock).rows)


@pytest.mark.parametrize(("homes", "words"), [
    ("[[2.5, 3.5]]", r"drones\[0\].homes: must be a place for each of 2 drones, not 1"),
    ("[[2.5, 3.5], [90, 3.5]]", r"drones\[0\].homes\[1\]: must lie on the map, x 0..20"),
    ("[[2.5, 3.5], [2.2, 3.1]]", r"drones\[0\].homes\[1\]: must be in a cell of its own; \(2,"),
    ("[]", r"drones\[0\].homes: must"),
])  # fmt: skip
def test_homes_that_do_not_fit_are_named(tmp_path: Path, homes: str, words: str) -> None:
    """One line with the table and the field."""
    with pytest.raises(ProblemError, match=words) as error:
        read(recipe(tmp_path, homes))
    assert "\n" not in str(error.value)


def test_all_tables_have_homes_or_none(tmp_path: Path) -> None:
    """The message has the recipe's names."""
    path = recipe(tmp_path)
    path.write_text(path.read_text() + "[[drones]]\nstarts = [{ x = 15, y = 9 }]\n")
    with pytest.raises(
        ProblemError, match=r"drones\[1\].homes\[0\]: must be given for all drones or"
    ):
        read(path)


def test_the_answer_names_unknown_batteries_and_whole_rules(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A known battery hides no unknown one, and a distance in height belongs to the rule."""
    one, other = (
        f"[[drones]]\nstarts = [{{ x = 6.5, y = {y} }}]\nhomes = [[2.5, {y}]]\n"
        f"motion = {{ layers = [5] }}\nlimits = {{ {endurance}speed = 5 }}\n"
        for y, endurance in ((3.5, "endurance = 60, "), (8.5, ""))
    )
    before, _ = RECIPE.split("[[drones]]")
    scene, plan = tmp_path / "scene.toml", str(tmp_path / "plan.json")
    scene.write_text(f"{before}[rules]\nseparation = 2\nvertical = 1.5\n{one}{other}")
    assert run(["plan", str(scene), "--planner", "sequential", "-o", plan]) == 0
    capsys.readouterr()
    assert run(["fly", str(scene), plan, "-o", str(tmp_path / "flight.csv")]) == 0
    printed = " ".join(capsys.readouterr().out.split())
    assert re.search(r"battery left at least \(drone 0\); endurance of drone 1 unknown", printed)
    assert "m at least; the scene's rule is 2 m, or 1.5 m in height" in printed
