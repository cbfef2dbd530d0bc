"""How well a plan films people, by the command line and by the face."""

import csv
import math
from pathlib import Path

import numpy as np
import pytest
from test_cli import Run

import cocap_opt as co
from cocap_opt.footage.assumptions import Assumptions
from cocap_opt.footage.quality import Quality
from cocap_opt.footage.summary import cameras_line, whole_percent

SCENE = "tiny-queue"


@pytest.fixture(scope="module")
def plan(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The file of a plan, which tests only read."""
    path = tmp_path_factory.mktemp("quality") / "plan.json"
    problem = co.load(SCENE)
    co.save(path, co.plan(problem, "sequential"))
    return path


def test_face_and_command_say_the_same(plan: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The command prints the face's words; its JSON has the same numbers, angles in degrees."""
    problem, planned = co.load(SCENE), co.read(plan, co.Plan)
    found = co.quality(
        problem, planned, at_least=0.4, attitude_error=math.radians(0.5), drone_pixels=10
    )
    words = ("--at-least", 0.4, "--attitude-error", 0.5, "--drone-pixels", 10)
    run = Run(capsys, "quality", SCENE, plan, *words)
    assert run.code == 0 and run.out.startswith(f"{found}\n\n")
    told = Run(capsys, "quality", SCENE, plan, *words, "--json").json
    assert [told["scene"], told["seed"]] == [SCENE, 0]
    finite = {k: v for k, v in found.summary._asdict().items() if math.isfinite(v)}
    assert {key: told[key] for key in finite} == finite
    assert told["worst"] == found.worst
    assert told["assumptions"] == {
        "at_least": 0.4, "pixel_error": 5.0, "position_error": 0.0, "attitude_error": 0.5,
        "exposure": 0.002, "drone_size": 0.4, "drone_pixels": 10.0,
    }  # fmt: skip
    assert [p["person"] for p in told["people"]] == list(found.people)
    assert [row["views"] for row in told["table"]] == found.table.views.tolist()
    assert isinstance(found, co.Quality)


def test_the_defaults_are_those_of_the_assumptions(plan: Path) -> None:
    """Whoever states nothing gets the same from the face as from inside."""
    problem, planned = co.load(SCENE), co.read(plan, co.Plan)
    assert co.quality(problem, planned).assumptions == Assumptions()
    result = co.Result(planned, 0.0, co.Reason.FINISHED)
    assert str(co.quality(problem, result)) == str(Quality.of(problem, planned))


def test_plans_for_other_objectives_are_measured(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], caplog: pytest.LogCaptureFixture
) -> None:
    """One line says so, and they can be played side by side; `verify` holds them to their claim."""
    problem = co.load(SCENE)
    asked = co.with_views(problem, cameras=2)
    for name, scene in (("one", problem), ("two", asked)):
        co.save(tmp_path / f"{name}.json", co.plan(scene, "sequential"))
    one, two = tmp_path / "one.json", tmp_path / "two.json"
    run = Run(capsys, "quality", SCENE, two)
    assert run.code == 0 and "was made for another objective" in caplog.text
    assert Run(capsys, "show", SCENE, one, two, "-o", tmp_path / "both.html").code == 0
    assert Run(capsys, "verify", SCENE, two).code == 1
    other = Run(capsys, "quality", "tiny-share", two)
    assert other.code == 2 and "was made for" in other.err


def test_a_csv_file_has_a_row_per_person_and_step(
    plan: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """It holds the table of the face."""
    path = tmp_path / "q.csv"
    assert Run(capsys, "quality", SCENE, plan, "--csv", path).code == 0
    table = co.quality(co.load(SCENE), co.read(plan, co.Plan)).table
    with path.open(newline="") as lines:
        rows = list(csv.DictReader(lines))
    assert list(rows[0]) == list(table)
    assert [float(row["error"]) for row in rows] == pytest.approx(table.error.tolist())
    assert [int(row["views"]) for row in rows] == table.views.tolist()


def test_wrong_input_is_one_line(
    plan: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """It names the option or the file, and what is allowed; the exit code is 2."""
    for words, expected in (
        ((SCENE, plan, "--at-least", 0), "--at-least: must be > 0"),
        ((SCENE, plan, "--pixel-error", -1), "--pixel-error: must be 1e-06"),
        ((SCENE, plan, "--position-error", "x"), "--position-error: must be a number, not 'x'"),
        ((SCENE, plan, "--attitude-error", 181), "--attitude-error: must be 0..180 degrees, not"),
        ((SCENE, plan, "--exposure", "nan"), "--exposure: must be 0..3600 s, not nan"),
        ((SCENE, plan, "--csv", tmp_path / "x.txt"), "--csv: name a file that ends in .csv"),
        ((SCENE, plan, "-o", tmp_path), "-o: applies to bounds; add --bound"),
        ((SCENE, plan, "--bound", "--cameras", 0), "--cameras: must be 1..64, not 0"),
        ((SCENE, plan, "--bound", "--seconds", 0), "--seconds: must be more than 0"),
        (("corridor", plan), "the plan was made for tiny-queue, not corridor"),
        ((SCENE, tmp_path / "none.json"), "none.json: no such file"),
    ):
        run = Run(capsys, "quality", *words)
        assert (run.code, run.out) == (2, "")
        (line,) = run.err.splitlines()
        assert expected in line


def test_the_face_refuses_what_it_cannot_measure(plan: Path) -> None:
    """No plan, a plan of another scene, one that cannot be flown, a number out of range."""
    problem, planned = co.load(SCENE), co.read(plan, co.Plan)
    with pytest.raises(ValueError, match="plan: the result has no plan to be measured"):
        co.quality(problem, co.Result(None, -math.inf, co.Reason.FAILED))
    with pytest.raises(ValueError, match="plan: it was made for"):
        co.quality(co.load("corridor"), planned)
    with pytest.raises(ValueError, match=r"^plan: "):
        co.quality(problem, co.Plan(paths=planned.paths[1:]))
    with pytest.raises(ValueError, match=r"^exposure: must be"):
        co.quality(problem, planned, exposure=-1.0)
    with pytest.raises(TypeError, match="problem: must be a Problem"):
        co.quality(SCENE, planned)  # type: ignore[arg-type]


def test_each_person_has_a_summary(plan: Path) -> None:
    """The shares of all are those of people, by their steps; who does not count has none."""
    problem, planned = co.load(SCENE), co.read(plan, co.Plan)
    found = co.quality(problem, planned)
    people = found.by_person
    steps = np.array([person.steps for person in people])
    assert steps.sum() == found.summary.person_steps
    for name in ("by_two", "by_three", "apart"):
        shares = np.array([getattr(person, name) for person in people])
        assert steps @ shares / steps.sum() == pytest.approx(getattr(found.summary, name))
    assert {f"{p.person}: {p.worst}" for p in people if p.worst} >= set(found.worst[:1])
    hidden = [actor.replace(importance=(0.0,) * len(actor.poses)) for actor in problem.actors]
    nobody = problem.replace(actors=tuple(hidden))
    assert co.quality(nobody, co.Plan(paths=planned.paths)).by_person == []


def test_a_plan_in_a_line() -> None:
    """Whole per cents, of which 0 and 100 are none and all; no error where none is finite."""
    words = "two see 84 % of person-steps, three 55 %"
    assert cameras_line(0.84, 0.55, 21.4) == f"{words}; median error 21 mm"
    for unknown in (None, math.inf, math.nan):
        assert cameras_line(0.84, 0.55, unknown) == words
    assert cameras_line(None, None, None) == cameras_line(math.nan, math.nan, math.nan) == ""
    told = [whole_percent(part) for part in (0.0, 0.001, 0.5, 0.999, 1.0)]
    assert told == ["0 %", "under 1 %", "50 %", "over 99 %", "100 %"]


def test_plan_and_verify_say_it_in_a_line(
    plan: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The line stands in a terminal; JSON has the numbers too. A bound alone has none."""
    found = co.quality(co.load(SCENE), co.read(plan, co.Plan)).summary
    for words in (("plan", SCENE, "--planner", "sequential"), ("verify", SCENE, plan)):
        told = Run(capsys, *words, "--json").json
        assert told["cameras"] == found.line != ""
        assert (told["seen_by_two"], told["seen_by_three"]) == (found.by_two, found.by_three)
        assert told["median_error"] == (found.median if math.isfinite(found.median) else None)
        lines = [" ".join(line.split()) for line in Run(capsys, *words).out.splitlines()]
        assert f"cameras {found.line}" in lines
        assert not any("seen_by" in line or "median_error" in line for line in lines)
    certificate = tmp_path / "certificate.json"
    Run(capsys, "bound", SCENE, "-o", certificate)
    assert "cameras" not in Run(capsys, "verify", SCENE, certificate, "--json").json


def test_what_no_plan_can_do_stands_beside_the_plan(
    plan: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The sentences are the face's; the folder has what `verify` proves again."""
    problem, planned = co.load(SCENE), co.read(plan, co.Plan)
    limits = co.quality_bound(problem, cameras=2, start=planned)
    found = co.quality(problem, planned)
    words = ("quality", SCENE, plan, "--bound", "-o", tmp_path / "proof")
    told = Run(capsys, *words, "--json").json["bound"]
    assert told["words"] == list(limits.sentences(found))
    assert [row["drones"] for row in told["most"]] == [1, 2]
    assert [row["share"] for row in told["most"]] == [limits.most(m).share for m in (1, 2)]
    assert [row["share_of_plan"] for row in told["most"]] == [
        limits.share(found, m) for m in (1, 2)
    ]
    out = " ".join(Run(capsys, *words).out.split())
    assert " ".join(told["words"]) in out
    for number, bound in enumerate(told["sums"], 1):
        file = tmp_path / "proof" / f"seen-by-{number}.bound.json"
        verified = Run(capsys, "verify", SCENE, file, "--json").json
        assert verified["bound_there"] == bound and verified["bound"] is None
        assert "another objective: pixels 0.0" in verified["message"]
