import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from itertools import permutations
from pathlib import Path

import numpy as np
import pytest
import result_rows
from cyclopts import App
from scene_files import SMALL_SEQUENCE

import cocap_opt as co
from cocap_opt import scenarios
from cocap_opt.cli import commands
from cocap_opt.cli.main import main
from cocap_opt.cli.solver_commands import AT_THE_ROOT
from cocap_opt.console import progress
from cocap_opt.experiments.sweeps.scenes import Scenes
from cocap_opt.experiments.tables.gap_table import print_gap_table
from cocap_opt.experiments.tables.rows import GapRow
from cocap_opt.files.documents import SceneFile
from cocap_opt.formulations import BOUNDS, EXACT
from cocap_opt.formulations.column_generation.tree import root
from cocap_opt.method import Method
from cocap_opt.output.answer import LABELS, WIDEST, print_pairs, print_result
from cocap_opt.output.printing import Listing, terminal
from cocap_opt.planners.results import without_a_path
from cocap_opt.problem import NO_RULES, Problem
from cocap_opt.run.engine import SOLVERS
from cocap_opt.scenarios import SCENES
from cocap_opt.scenarios.built_in.field import field

KEYS = {
    "scene", "seed", "planner", "method", "reward", "bound", "gap", "reason", "limit", "seconds",
    "conflicts",
}  # fmt: skip
GAP_KEYS = KEYS | {
    "robots", "actors", "steps", "bound_method", "certificate", "optimum_free", "bound_free",
    "gap_free", "bound_reason", "bound_limit",
}  # fmt: skip


class Run:
    """Exit code and output of one command."""

    def __init__(self, capsys: pytest.CaptureFixture[str], *words: object) -> None:
        capsys.readouterr()
        with pytest.raises(SystemExit) as caught:
            main([str(word) for word in words])
        self.code = caught.value.code
        self.out, self.err = capsys.readouterr()

    @property
    def json(self) -> dict:
        """The one JSON object on standard output."""
        return json.loads(self.out)


def start_command(*words: object, talkative: bool = False) -> subprocess.Popen[str]:
    """One command in a process of its own; if it is talkative, it says all its progress."""
    code = f"from cocap_opt.cli.main import main; main({[str(word) for word in words]})"
    if talkative:
        module = "from cocap_opt.console import progress"
        code = f"{module}; progress.SECONDS_BETWEEN_LINES = 0.01; {code}"
    return subprocess.Popen(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )


def wait_for(process: subprocess.Popen[str], folder: Path, pattern: str) -> None:
    """Wait until a process has made a file, or has ended."""
    while not list(folder.glob(pattern)) and process.poll() is None:
        time.sleep(0.02)


@pytest.fixture(scope="session")
def files(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A plan and a certificate of the tight corridor, which tests only read."""
    folder = tmp_path_factory.mktemp("corridor-tight")
    plan, certificate = folder / "plan.json", folder / "certificate.json"
    assert commands.run(["plan", "corridor-tight", "-o", str(plan)]) == 0
    assert commands.run(["bound", "corridor-tight", "-o", str(certificate)]) == 0
    return plan, certificate


@pytest.mark.slow
def test_a_path_that_is_no_text_is_shown_escaped(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """JSON is text: a byte that is none in a file's name is escaped in it, not in the name."""
    path = tmp_path / "\udcff.json"
    try:
        path.touch()
    except (OSError, UnicodeEncodeError):
        pytest.skip("this file system takes text only")
    run = Run(capsys, "plan", "tiny-share", "-o", path, "--json")
    assert run.code == 0 and path.stat().st_size > 0
    assert run.json["file"].endswith("\\udcff.json")


@pytest.mark.slow
def test_gap_prints_and_writes_the_keys_that_do_not_change(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """`gap --json` prints {"rows": ...}; results.csv has a row per scene, seed and planner."""
    run = Run(capsys, "gap", "tiny-share", "tiny-queue", "--out", tmp_path / "o", "--json")
    assert run.code == 0 and all(" done, " in line for line in run.err.splitlines())  # progress
    rows = run.json["rows"]
    assert len(rows) == 2 * 6
    for row in rows:
        assert set(row) >= GAP_KEYS
        if row["conflicts"] == 0:
            assert row["reward"] <= row["bound"]
            assert row["gap"] == pytest.approx((row["bound"] - row["reward"]) / row["bound"])
            free = row["bound_free"]
            assert row["gap_free"] == pytest.approx((free - row["reward"]) / free)
        assert row["reward"] <= row["optimum_free"] * (1 + 1e-9) <= row["bound_free"] * (1 + 2e-9)
        assert row["bound"] <= row["bound_free"]
        assert (row["bound_reason"], row["bound_limit"]) == ("optimal", "none")
        assert (tmp_path / "o" / row["certificate"]).is_file()
        assert (tmp_path / "o" / row["certificate_free"]).is_file()
    header, *lines = (tmp_path / "o" / "results.csv").read_text().splitlines()
    assert set(header.split(",")) >= GAP_KEYS
    assert len(lines) == len(rows)


@pytest.mark.slow
def test_gap_never_writes_two_scenes_into_one_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Scenes whose names differ only in what file names cannot hold have files of their own."""
    names = ["a b", "a/b", "a_b", "A_b", "x" * 300, "x" * 301, "..", "\udcff", "b.json"]
    scenes = [tmp_path / name for name in ("a.json", "b.json", *map("{}.json".format, range(8)))]
    for scene, name in zip(scenes, ["a_b", *names], strict=True):
        SceneFile(problem=SCENES["tiny-share"](0).replace(name=name)).save(scene)
    out = tmp_path / "out"
    run = Run(capsys, "gap", *scenes, "--planner", "greedy", "--out", out, "--json")
    assert run.code == 0
    assert len({row["scene"] for row in run.json["rows"]}) == len(scenes)
    assert len({row["certificate"].lower() for row in run.json["rows"]}) == len(scenes)
    assert len(list((out / "plans").iterdir())) == len(scenes)
    assert len(list((out / "certificates").iterdir())) == 2 * len(scenes)
    assert (out / run.json["rows"][3]["certificate"]).is_file()


def test_gap_calls_no_two_scenes_the_same() -> None:
    """A scene that is called as it was typed does not take the name of a third one."""
    build = SCENES["tiny-share"]
    named = {"a.json": "twin", "b.json": "twin", "c.json": "a.json", "d.json": "own"}
    problems = {(scene, 0): build(0).replace(name=name) for scene, name in named.items()}
    names = [problem.name for problem in Scenes.told_apart(problems).values()]
    assert names == ["a.json", "b.json", "c.json", "own"]


@pytest.mark.long
def test_every_plan_and_certificate_of_gap_is_verified(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """What `gap --out` writes passes `verify`, but for plans that ignore collisions."""
    Run(capsys, "gap", "corridor-tight", "--seeds", "0", "--out", tmp_path)
    certificate = tmp_path / "certificates" / "corridor-tight-0.json"
    best = 0.0
    for plan in sorted((tmp_path / "plans").iterdir()):
        run = Run(capsys, "verify", "corridor-tight", plan, certificate, "--json")
        answer = run.json
        assert answer["valid"] is (run.code == 0)
        assert answer["valid"] is ("greedy" not in plan.name)
        assert len(answer["reward_per_step"]) == 8
        assert sum(answer["reward_per_step"]) == pytest.approx(answer["reward"])
        if answer["valid"]:
            assert answer["optimal"] is (answer["gap"] <= 1e-6)
            best = max(best, answer["reward"])
    assert best == pytest.approx(answer["bound"], rel=1e-6)  # joint's plan
    free = tmp_path / "certificates" / "corridor-tight-0-free.json"
    assert Run(capsys, "verify", "corridor-tight", free).code == 1
    assert Run(capsys, "verify", "corridor-tight", free, "--free").code == 0


@pytest.mark.slow
def test_what_bounds_all_plans_bounds_those_that_obey_the_rules(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Where the best plan of all has no conflicts, one proof serves with and without rules."""
    run = Run(capsys, "gap", "tiny-share", "--planner", "cocap", "--out", tmp_path, "--json")
    (row,) = run.json["rows"]
    assert (row["bound"], row["bound_seconds"]) == (row["bound_free"], row["bound_free_seconds"])
    assert row["certificate"] != row["certificate_free"]
    for path, option in ((row["certificate"], ()), (row["certificate_free"], ("--free",))):
        assert Run(capsys, "verify", "tiny-share", tmp_path / path, *option).code == 0


@pytest.mark.slow
def test_a_scene_without_rules_is_bounded_once(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Its one certificate is that of the problem without rules."""
    scene = tmp_path / "scene.json"
    SceneFile(problem=SCENES["tiny-queue"](0).replace(rules=NO_RULES)).save(scene)
    run = Run(capsys, "gap", scene, "--planner", "cocap", "--out", tmp_path / "o", "--json")
    (row,) = run.json["rows"]
    assert (row["gap"], row["certificate"]) == (row["gap_free"], row["certificate_free"])
    assert len(list((tmp_path / "o" / "certificates").iterdir())) == 1


def test_plans_of_others_get_rows_in_the_gap_table(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """A plan in a file is held against the same bound; its row loses nothing that the file says."""
    path = tmp_path / "mine.json"
    words = ("plan", "tiny-queue", "--planner", "sequential", "-o", path, "--json")
    made = Run(capsys, *words, "--time-limit", 7, "--work-limit", 9).json
    run = Run(capsys, "gap", "tiny-queue", "--plan", path, "--planner", "cocap", "--json")
    cocap, mine = run.json["rows"]
    assert mine["planner"] == "sequential (mine.json)"
    assert (mine["time_limit"], mine["work_limit"], mine["overrun"]) == (7.0, 9, None)
    assert all(mine[key] == made[key] for key in ("seconds", "reason", "limit", "reward"))
    assert mine["bound"] == cocap["bound"] >= mine["reward"]
    assert mine["gap"] >= 0
    other = Run(capsys, "gap", "corridor", "--plan", path)
    assert other.code == 2


def small(seed: int) -> Problem:
    """Two drones and a person, elsewhere for each seed."""
    return field(seed, robots=2, actors=1, cells=15, steps=2).replace(name="small")


@pytest.fixture
def mine(tmp_path: Path) -> list[Path]:
    """Plans of a planner of somebody's own for seeds 0 and 1 of a scene."""
    paths = [tmp_path / f"mine-{seed}.json" for seed in (0, 1)]
    for seed, path in enumerate(paths):
        problem = small(seed)
        found = co.plan(problem, "greedy")
        co.save(path, replace(found, method="mine"), problem)
    return paths


@pytest.mark.slow
def test_plans_for_several_seeds_are_rows_of_one_planner(
    mine: list[Path], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each plan is at the seed whose digest it has, below our planners, by its planner's name."""
    monkeypatch.setattr(scenarios, "SCENES", {**SCENES, "small": small})
    words = ("gap", "small", "--seeds", "0-1", "--planner", "greedy", "--time-limit", 10, "--json")
    rows = Run(capsys, *words, "--plan", mine[1], "--plan", mine[0]).json["rows"]
    assert [(row["seed"], row["planner"]) for row in rows] == [
        (seed, name) for seed in (0, 1) for name in ("greedy", "mine")
    ]
    assert all(own["reward"] == ours["reward"] for ours, own in zip(*2 * [iter(rows)], strict=True))
    rows = Run(capsys, *words, "--plan", mine[1]).json["rows"]
    assert [row["planner"] for row in rows] == ["greedy", "greedy", "mine"]


@pytest.mark.slow
def test_plans_for_none_of_the_seeds_are_refused(
    mine: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    """So are certificates, and plans of formats that do not say their seed: a line has the file."""
    monkeypatch.setattr(scenarios, "SCENES", {**SCENES, "small": small})
    foreign, bound = tmp_path / "paths.csv", tmp_path / "bound.json"
    states = (f"{robot},{step},1,0,0\n" for robot in (0, 1) for step in (0, 1, 2))
    foreign.write_text("robot,t,x_cell,y_cell,heading_idx\n" + "".join(states))
    Run(capsys, "bound", "small", "--method", "alone", "-o", bound)
    for path, why in (
        (mine[0], "digest: the plan was made for small of another seed"),
        (bound, "must be a plan, not a certificate"),
        (foreign, "does not say which seed it is for"),
    ):
        run = Run(capsys, "gap", "small", "--seeds", "1-2", "--plan", mine[1], "--plan", path)
        assert (run.code, run.out, len(run.err.splitlines())) == (2, "", 1)
        assert f"{path}: {why}" in run.err


def test_a_file_of_one_scene_has_no_seed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A scene's own file was made of some seed, which it does not know: `verify` names none."""
    scene, plan = tmp_path / "scene.json", tmp_path / "plan.json"
    Run(capsys, "export", "tiny-share", "--seed", 2, "-o", scene)
    Run(capsys, "plan", scene, "-o", plan)
    assert Run(capsys, "verify", scene, plan, "--json").json["seed"] is None
    assert "seed" not in Run(capsys, "verify", scene, plan).out
    assert Run(capsys, "verify", "tiny-share", plan, "--seed", 2, "--json").json["seed"] == 2


@pytest.mark.slow
def test_rows_of_an_explanation_name_their_drones(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A drone's number does not read as how many there are; tables fit into narrow terminals."""
    plan, bound = tmp_path / "plan.json", tmp_path / "bound.json"
    Run(capsys, "plan", "corridor-tight", "--planner", "sequential", "-o", plan)
    Run(capsys, "bound", "corridor-tight", "-o", bound)
    text = Run(capsys, "verify", "corridor-tight", plan, bound, "--explain", "--all").out
    assert "which drones" in text
    assert re.search(r"^[^\n]+ \d+ +(drone \d|drones \d, \d|none) +[\d.,]+ ", text, re.MULTILINE)
    monkeypatch.setenv("COLUMNS", "60")
    narrow = Run(capsys, "verify", "corridor-tight", plan, bound, "--explain", "--all").out
    assert "drones leave the best paths" in narrow
    assert re.search(r"Hidden \(terminal too narrow\): .*price.*; --json has all\.", narrow)
    assert max(len(line.rstrip()) for line in narrow.splitlines()) <= 60


def test_scenes_are_warned_of_and_recipes_printed(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """What `recipe` prints can be adapted; a scene in which nobody is seen says why."""
    run = Run(capsys, "recipe")
    assert run.code == 0 and "[[drones]]" in run.out
    assert Run(capsys, "recipe", "--json").json["recipe"] == run.out
    example = tmp_path / "example.toml"
    example.write_text(run.out)
    told = Run(capsys, "plan", example)
    assert told.code == 2 and "houses.tif: no such file; " in told.err
    assert "`cocap-opt recipe delft -o shoot`" in told.err and "shortest recipe" in told.err
    scene = tmp_path / "scene.toml"
    scene.write_text(
        "steps = 2\n[map]\nsize = [20, 12]\n[[walk]]\npoints = [[90, 60]]\n"
        "[[drones]]\nstarts = [{ x = 2.5, y = 6.5, heading = 225 }]\n"
    )
    run = Run(capsys, "plan", scene, "--json")
    assert run.json["reward"] == 0
    assert "no drone sees anybody" in run.json["message"]
    assert "seed 0, cocap-prices: no drone sees anybody at any step" in caplog.text
    assert "person 0 is off the map at 3 of 3 steps" in caplog.text
    assert "the start at (2.5, 6.5)" not in caplog.text


def test_what_was_said_when_a_scene_was_planned_is_not_said_again(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """Warnings of a scene come before there is a plan; built-in scenes have none."""
    scene, plan = tmp_path / "heavy.toml", tmp_path / "plan.json"
    scene.write_text(
        "steps = 1\nflown = 'straight'\n[map]\nsize = [8, 8]\n[[walk]]\npoints = [[50, 6]]\n"
        "[[drones]]\nstarts = [{ x = 2.1, y = 6.1 }]\nlimits = { acceleration = 1 }\n"
    )
    Run(capsys, "plan", scene, "-o", plan)
    said = (
        "is off the map",
        "cannot move from rest within a step",
        "start at (2.1, 6.1) m is moved by 0.57",
    )
    assert all(words in caplog.text for words in said)
    caplog.clear()
    for command in ("robustness", "verify"):
        Run(capsys, command, scene, plan)
        assert not any(words in caplog.text for words in said), command
    Run(capsys, "plan", "tiny-doorway")
    assert not caplog.text


def test_long_lists_of_rewards_are_summed_up(capsys: pytest.CaptureFixture[str]) -> None:
    """A few rewards are listed; of many there are the mean and both ends; JSON has them all."""
    few, many = (3.0, 1500.0), tuple(float(k) for k in range(100, 140))
    print_result({"reward_per_person": few, "reward_per_step": many}, False)
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert lines[0] == ["J", "by", "person", "3.00", "1,500.00"]
    assert " ".join(lines[1]) == "J by step mean 119.50 over 40; --json has all"
    assert lines[2] == ["least", "100.00,", "step", "1"]
    assert lines[3] == ["most", "139.00,", "step", "40"]
    print_result({"reward_per_step": many}, True)
    assert json.loads(capsys.readouterr().out)["reward_per_step"] == list(many)


@pytest.mark.parametrize("width", [60, 80])
def test_values_stand_beside_short_labels(
    width: int, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A label takes one line, in all answers; a number and its unit are not parted.

    A key that people can read as it is has no label.
    """
    labels = [*LABELS.values()]
    assert max(map(len, labels)) <= WIDEST <= 60 - 30
    assert not {key for key, label in LABELS.items() if key == label}
    monkeypatch.setenv("COLUMNS", str(width))
    words = "two see 100 % of person-steps, three 62 %; median error 24 mm; step 4 s; width 100 px"
    print_pairs([(label, words) for label in labels])
    out = capsys.readouterr().out
    assert all(len(line) <= width for line in out.splitlines())
    begun = [line[1:].split("  ")[0] for line in out.splitlines() if line[1] != " "]
    assert begun == labels
    assert not any(re.match(r"\s+(%|mm|px|s)\b", line) for line in out.splitlines())


def test_labels_are_words(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """No key of JSON with underscores is in an answer that people read, however long."""
    plan, proof = tmp_path / "plan.json", tmp_path / "proof.json"
    for words in (
        ("solve", "tiny-share", "-o", plan, "--certificate", proof),
        ("plan", "tiny-share"), ("bound", "tiny-share"), ("verify", "tiny-share", plan, proof),
        ("fly", "tiny-share", plan, "--step", 2, "--smooth", "-o", tmp_path / "flight.csv"),
    ):  # fmt: skip
        lines = Run(capsys, *words, "--verbose").out.splitlines()
        labels = [re.split("  +", line[1:])[0] for line in lines if re.match(" [A-Za-z]", line)]
        assert len(labels) > 5 and not any("_" in label for label in labels)


@pytest.mark.parametrize("columns", ["0", "00"])
def test_an_answer_is_printed_whatever_the_width(
    columns: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Programs that run commands without a terminal may tell them that it has no columns."""
    print_pairs([("J", "1,347.65")])
    usual = capsys.readouterr().out
    monkeypatch.setenv("COLUMNS", columns)
    print_pairs([("J", "1,347.65")])
    assert "1,347.65" in usual and capsys.readouterr().out == usual
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    assert terminal().width == 80


@pytest.mark.parametrize("width", [60, 80])
def test_names_of_files_are_not_folded(
    width: int, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A name that has no room beside its label stands below it, and can be copied."""
    monkeypatch.setenv("COLUMNS", str(width))
    names = [f"mission.px4.no-common-clock.drone{k}.plan" for k in (0, 17)]
    print_result({"files": [Path(name) for name in names], "delay_tolerance": 7.0}, False)
    out = capsys.readouterr().out
    assert all(name in out.split() for name in names)
    assert all(len(line) <= width for line in out.splitlines())
    assert "delay tolerance less than 7.00 s between drones" in " ".join(out.split())


def test_answers_come_first_and_internals_on_request(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """J, the gap in words, the cameras and the file; --verbose and JSON have the rest."""
    monkeypatch.chdir(tmp_path)
    plan = Path("plan.json")  # short, so that no line is folded
    words = "solve", "corridor-tight", "-o", plan
    short = Run(capsys, *words).out.splitlines()
    keys = [line.split()[0] for line in short]
    assert keys[:7] == ["J", "bound", "gap", "cameras", "between", "to", "file"]
    assert "0.000 %: proved, no plan is better" in short[2]
    assert "more lines with --verbose" in short[-1]
    full = [line.split()[0] for line in Run(capsys, *words, "--verbose").out.splitlines()]
    assert set(keys[:-1]) < set(full) and "with --verbose" not in "".join(full)
    for key in ("coverage", "nodes", "proof"):
        assert key in full and key not in keys
    answer = Run(capsys, *words, "--json").json
    assert {"reward", "coverage_seconds", "nodes", "iterations"} <= set(answer)
    worse = Run(capsys, "plan", "corridor-tight", "--planner", "sequential", "-o", plan).out
    assert [line.split()[0] for line in worse.splitlines()[:2]] == ["J", "cameras"]


def test_verify_tells_rewards_by_person(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """People read what each person gets, which adds up to J; JSON has it face by face."""
    plan = tmp_path / "plan.json"
    Run(capsys, "plan", "corridor-tight", "--planner", "sequential", "-o", plan)
    answer = Run(capsys, "verify", "corridor-tight", plan, "--json").json
    text = Run(capsys, "verify", "corridor-tight", plan, "--verbose").out
    told = next(line for line in text.splitlines() if "J by person" in line)
    first, second = (float(word.replace(",", "")) for word in told.split()[3:])
    faces = answer["reward_per_face"]
    assert (first, second) == pytest.approx((sum(faces[:5]), sum(faces[5:])), abs=0.01)
    assert first + second == pytest.approx(answer["reward"], abs=0.02)
    assert "J by side" not in text


def test_the_gap_table_says_what_its_bounds_are(capsys: pytest.CaptureFixture[str]) -> None:
    """The title tells proved optima from other bounds; what a limit stopped is marked."""
    proved = Run(capsys, "gap", "tiny-queue", "--planner", "cocap").out
    assert "gap to the proved optimum (branch-and-price)" in proved
    assert "*" not in proved
    stopped = Run(capsys, "gap", "tiny-queue", "--planner", "cocap", "--bound-limit", 0).out
    assert "gap to a certified bound (simple)" in stopped
    assert "*" in stopped
    exact = Run(capsys, "gap", "tiny-queue", "--planner", "brute-force", "--json").json["rows"][0]
    assert (exact["planner"], exact["bound_method"]) == ("brute-force", "branch-and-price")
    assert exact["gap"] < 1e-6


def gap_rows(*bounds: tuple[float | None, str]) -> list[GapRow]:
    """A row of the gap table per bound and the reason why the search for it stopped."""
    return [
        result_rows.row("cocap", seed, 1.0, scene="s", gap=None, gap_free=None, bound=bound,
            bound_reason=reason, bound_free=bound, bound_free_reason=reason)
        for seed, (bound, reason) in enumerate(bounds)
    ]  # fmt: skip


FAILURES = {
    "error": "its search ended in an error",
    "exceeded": "its search exceeded the time limit of a cell",
    "died": "the process of its search died",
    "stopped": "a limit stopped its search before there was one",
}


@pytest.mark.parametrize("reason", FAILURES)
def test_a_bound_that_is_missing_is_not_said_to_be_certified(
    reason: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Each kind of failure has words of its own; the star is explained where there is one."""
    print_gap_table(gap_rows((2.0, "optimal"), (None, reason)))
    out = capsys.readouterr().out
    assert "gap to the proved optimum (branch-and-price)" in out and "*" not in out
    assert f"No bound for s seed 1: {FAILURES[reason]}." in out
    print_gap_table(gap_rows(*5 * [(None, reason)]))
    out = capsys.readouterr().out
    assert "no bounds" in out and "certified" not in out
    assert "No bound for s seed 0, s seed 1, s seed 2 and 2 more:" in out
    print_gap_table(gap_rows((2.0, "stopped"), (None, reason)))
    assert "gap to a certified bound" in (out := capsys.readouterr().out)
    assert "* A limit stopped" in out and FAILURES[reason] in out


@pytest.mark.parametrize("command", ["fly", "export"])
def test_long_help_is_short_above_the_options(
    command: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Two paragraphs and an example; the rest of the docstring is below them."""
    above, _, below = Run(capsys, command, "--help").out.partition("Arguments")
    assert len(above.splitlines()) < 16 and "Example: " in above
    assert len(below.rpartition("\u256f")[2].split()) > 80


@pytest.mark.parametrize(("width", "left"), [
    (54, "gap without rules, seconds; --json or --out"),
    (60, "gap without rules; --json or --out"),
    (140, None),
])  # fmt: skip
def test_narrow_terminals_get_the_columns_that_matter(
    width: int, left: str | None, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    """No row is broken, a line names what is left out; a pipe gets all."""
    monkeypatch.setenv("COLUMNS", str(width))
    rows = gap_rows((2.0, "stopped"), (2.0, "stopped"))
    print_gap_table(rows)  # to a pipe
    assert "seconds" in capsys.readouterr().out
    monkeypatch.setattr("sys.stdout.isatty", lambda: True, raising=False)
    print_gap_table(rows)
    out = re.sub("\x1b[^m]*m", "", capsys.readouterr().out)
    told = " ".join(out.split())
    assert max(map(len, out.splitlines())) <= width
    head = next(line.split() for line in out.splitlines() if "planner" in line)
    assert head[:5] == ["scene", "seed", "planner", "gap", "J"]
    assert {"bound", "conflicts"} <= set(head)
    if left is None:
        assert {"seconds", "rules"} <= set(head) and "Hidden" not in told
    else:
        assert f"Hidden (terminal too narrow): {left}" in told
        assert "rules" not in head


@pytest.mark.parametrize("width", [40, 60, 80])
def test_wide_tables_are_folded(
    width: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """No column is lost, and no line is broken; the names of rows are in each part.

    A pipe, where nobody asks for a width, gets whole lines.
    """
    monkeypatch.delenv("COLUMNS", raising=False)
    rows = [
        {"date": "2026-05-01", "kind": kind} | {f"column {k}": float(k) for k in range(12)}
        for kind in ("plan", "bound")
    ]
    Listing("title", rows).print()  # to a pipe
    assert "column 0  column 1  " in capsys.readouterr().out
    monkeypatch.setenv("COLUMNS", str(width))
    for _ in range(2):  # to a pipe with a width, and to a terminal
        Listing("title", rows).print()
        lines = re.sub("\x1b[^m]*m", "", capsys.readouterr().out).splitlines()
        assert max(map(len, lines)) <= width
        heads = [line for line in lines if "date" in line]
        assert " ".join(heads).count("column ") == 12 and len(heads) > 1
        assert all("kind" in head for head in heads)
        assert sum("title" in line for line in lines) == 1
        monkeypatch.setattr("sys.stdout.isatty", lambda: True, raising=False)


def test_a_marked_bound_stays_in_narrow_terminals(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Without marks the bound may go, and with it a seed that is the same in all rows."""
    monkeypatch.setenv("COLUMNS", "40")
    monkeypatch.setattr("sys.stdout.isatty", lambda: True, raising=False)
    for reason, kept in (("optimal", False), ("stopped", True)):
        print_gap_table(gap_rows((2.0, reason)))
        head = next(line for line in capsys.readouterr().out.splitlines() if "planner" in line)
        assert ("bound" in head, "seed" in head) == (kept, False)


@pytest.mark.slow
def test_a_certificate_can_be_verified_alone(
    files: tuple[Path, Path], capsys: pytest.CaptureFixture[str]
) -> None:
    """A bound needs no plan to be checked; one that takes too long is not said to be false."""
    run = Run(capsys, "verify", "corridor-tight", files[1], "--json")
    assert (run.code, run.json["valid"]) == (0, True)
    assert run.json["bound"] > 0
    run = Run(capsys, "verify", "corridor-tight", files[1], "--time-limit", 0, "--json")
    assert (run.code, run.json["bound"]) == (1, None)
    assert "was reached before the end; the claim may still hold" in run.json["violations"][0]


def number_paths(content: object, path: tuple = ()) -> list[tuple]:
    """Paths to all numbers of plain data."""
    if isinstance(content, dict):
        return [p for key, value in content.items() for p in number_paths(value, (*path, key))]
    if isinstance(content, list):
        return [p for k, value in enumerate(content) for p in number_paths(value, (*path, k))]
    return [path] if isinstance(content, (int, float)) else []


@pytest.mark.slow
def test_every_altered_number_of_a_plan_is_noticed(
    files: tuple[Path, Path], capsys: pytest.CaptureFixture[str]
) -> None:
    """A plan whose file was altered is refused, or still is what it claims to be."""
    honest = Run(capsys, "verify", "corridor-tight", files[0], "--json").json["reward"]
    plain = json.loads(files[0].read_text())
    paths = number_paths(plain)
    heads = {path[0] for path in paths if len(path) == 1}
    assert heads == {"version", "seconds", "time_limit", "coverage_version", "reward"}
    assert len(paths) == len(heads) + 2 * 9 * 5
    for path in paths[::7]:
        altered = json.loads(files[0].read_text())
        inner = altered
        for key in path[:-1]:
            inner = inner[key]
        inner[path[-1]] += 1
        files[0].with_name("altered.json").write_text(json.dumps(altered))
        run = Run(capsys, "verify", "corridor-tight", files[0].with_name("altered.json"), "--json")
        if run.code == 0:
            assert run.json["reward"] == pytest.approx(honest, rel=1e-9), path


@pytest.mark.slow
@pytest.mark.parametrize("words", [["show"], ["gap", "--plan"], ["render"]])
def test_plans_of_other_scenes_are_not_shown_or_compared(
    words: list[str],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    caplog: pytest.LogCaptureFixture,
) -> None:
    """Even where it could be flown: J and pictures would be of a scene it was not made for."""
    scene, plan = tmp_path / "scene.json", tmp_path / "plan.json"
    Run(capsys, "export", "tiny-queue", "-o", scene)
    Run(capsys, "plan", scene, "-o", plan)
    content = json.loads(scene.read_text())
    command, *option = words
    output = {"show": ["-o", tmp_path / "a.html"], "render": ["-o", tmp_path / "a"]}.get(
        command, []
    )
    if command != "gap":
        assert Run(capsys, command, scene, plan, *output).code == 0
    content["problem"]["name"] = "renamed"
    scene.write_text(json.dumps(content))
    run = Run(capsys, command, scene, *option, plan, *output)
    assert run.code == 0
    assert "was made for tiny-queue, which is the same scene as renamed" in caplog.text
    content["problem"]["rules"]["swap"] = not content["problem"]["rules"]["swap"]
    scene.write_text(json.dumps(content))
    run = Run(capsys, command, scene, *option, plan, *output)
    assert (run.code, len(run.err.splitlines())) == (2, 1)
    assert f"{plan}: scene: the plan was made for tiny-queue, not renamed" in run.err
    content["problem"]["name"] = "tiny-queue"
    scene.write_text(json.dumps(content))
    run = Run(capsys, command, scene, *option, plan, *output)
    assert f"{plan}: digest: the plan was made for tiny-queue of another seed" in run.err
    assert run.err.endswith("that it is for, or plan again if you changed the scene\n")


def test_long_names_are_shown_in_short(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A name of a thousand letters pushes no number off the table, and no longer one is read."""
    scene = tmp_path / "scene.json"
    Run(capsys, "export", "tiny-approach", "-o", scene)
    text = scene.read_text()
    scene.write_text(text.replace('"tiny-approach"', f'"begin{"a" * 900}end"'))
    run = Run(capsys, "gap", scene, "--planner", "greedy")
    assert max(map(len, run.out.splitlines())) < 200
    assert re.search("begina+…a+end ", run.out)
    scene.write_text(text.replace('"tiny-approach"', f'"{"a" * 1001}"'))
    assert "name: must have at most 1000 letters, not 1001" in Run(capsys, "gap", scene).err


def test_files_of_another_seed_are_refused(
    files: tuple[Path, Path], capsys: pytest.CaptureFixture[str]
) -> None:
    """A plan and a certificate belong to one scene and seed."""
    for file in files:
        assert Run(capsys, "verify", "corridor-tight", file, "--seed", 1).code == 1
    start = ("solve", "corridor-tight", "--seed", 1, "--start", files[0])
    assert "made for corridor-tight of another seed" in Run(capsys, *start).err


@pytest.mark.slow
def test_a_plan_without_a_way_is_a_result(capsys: pytest.CaptureFixture[str]) -> None:
    """Infeasible is an answer in words with exit code 0, not an error."""
    run = Run(capsys, "plan", "tiny-head-on", "--json")
    assert run.code == 0
    assert (run.json["reward"], run.json["reason"]) == (None, "infeasible")
    assert "no plan obeys the rules" in run.json["message"]
    for command in ("plan", "solve"):  # said before anything else
        first = Run(capsys, command, "tiny-head-on").out.splitlines()[0]
        assert first.split()[0] == "note" and "no plan" in first


def test_a_proof_that_there_is_no_plan_is_verified(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A negative bound proves that there is no plan, since J >= 0; -infinity is null in files."""
    scene, certificate = tmp_path / "scene.json", tmp_path / "certificate.json"
    Run(capsys, "export", "tiny-head-on", "-o", scene)
    content = json.loads(scene.read_text())
    content["problem"]["horizon"] = 1  # too short for one robot alone
    scene.write_text(json.dumps(content))
    bound = Run(capsys, "bound", scene, "-o", certificate, "--json").json
    assert (bound["reason"], bound["bound"]) == ("infeasible", None)
    verified = Run(capsys, "verify", scene, certificate, "--json")
    assert (verified.code, verified.json["valid"]) == (0, True)
    assert "no plan" in verified.json["message"]


OPTIMA = {"tiny-approach": 37.0, "tiny-hover": 27.5, "tiny-share": 27 * 2**0.5}  # by hand


@pytest.mark.slow
@pytest.mark.parametrize("scene", OPTIMA)
@pytest.mark.parametrize("method", EXACT)
def test_solve_gives_the_optimum_and_a_proof(
    method: str, scene: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Every exact method finds the known optimum; `verify` accepts what it writes."""
    plan, proof = tmp_path / "plan.json", tmp_path / "proof.json"
    run = Run(capsys, "solve", scene, "--method", method, "-o", plan, "--certificate", proof,
              "--json")  # fmt: skip
    row = run.json
    assert (run.code, set(row) >= KEYS) == (0, True)
    assert row["reward"] == pytest.approx(OPTIMA[scene])
    assert (row["method"], row["reason"], row["limit"]) == (method, "optimal", "none")
    assert 0 <= row["gap"] <= 1e-6
    assert row["file"] == str(plan)
    claims = [plan, proof] if proof.exists() else [plan]
    if len(claims) == 1:
        assert "no certificate" in row["message"]
        assert row["certificate"] is None
    answer = Run(capsys, "verify", scene, *claims, "--json").json
    assert answer["valid"] is True
    assert answer["optimal"] is (True if proof.exists() else None)


@pytest.mark.slow
def test_solve_at_the_root_and_to_a_gap(capsys: pytest.CaptureFixture[str]) -> None:
    """Column generation has a plan and a bound; with --gap, `optimal` is not said too early."""
    root = Run(capsys, "solve", "corridor-tight", "--method", AT_THE_ROOT, "--json").json
    near = Run(capsys, "solve", "corridor-tight", "--gap", 0.05, "--json").json
    best = Run(capsys, "solve", "corridor-tight", "--json").json
    assert root["reward"] <= best["reward"] * (1 + 1e-9)
    assert best["reward"] <= best["bound"] <= root["bound"] * (1 + 1e-9)
    assert near["reward"] <= best["reward"] * (1 + 1e-9) <= near["bound"] * (1 + 1e-9)
    assert near["gap"] <= 0.05
    for row in (root, near, best):
        assert (row["reason"] == "optimal") is (row["gap"] <= 1e-6)
    assert best["reason"] == "optimal"


@pytest.mark.long
def test_solve_without_rules(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """--free plans, bounds and verifies the scene without collisions between drones."""
    plan, proof = tmp_path / "plan.json", tmp_path / "proof.json"
    scene = "corridor-tight"
    obeying = Run(capsys, "solve", scene, "--json").json
    free = Run(capsys, "solve", scene, "--free", "-o", plan, "--certificate", proof,
               "--json").json  # fmt: skip
    assert free["reward"] > obeying["reward"] * 1.001
    assert (free["free"], free["conflicts"], free["reason"]) == (True, 0, "optimal")
    assert Run(capsys, "verify", scene, plan, proof, "--free", "--json").json["optimal"] is True
    refused = Run(capsys, "verify", scene, plan, proof, "--json")
    assert refused.code == 1
    assert any("in one cell" in violation for violation in refused.json["violations"])
    for method in BOUNDS:
        words = ["bound", scene, "--method", method, "--free", "--time-limit", 0.2, "--json"]
        assert Run(capsys, *words).json["bound"] >= free["reward"]
    greedy = Run(capsys, "plan", scene, "--planner", "greedy", "--free", "--json").json
    assert obeying["reward"] < greedy["reward"] <= free["reward"] * (1 + 1e-9)
    assert greedy["conflicts"] == 0


@pytest.mark.long
def test_a_start_is_used_or_rejected_with_the_reason(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A plan that breaks a rule is rejected in words; one that cannot be flown is an error."""
    plans = {name: tmp_path / f"{name}.json" for name in ("greedy", "joint", "other")}
    for name in ("greedy", "joint"):
        Run(capsys, "plan", "corridor-tight", "--planner", name, "-o", plans[name])
    Run(capsys, "plan", "corridor-tight", "--seed", 1, "-o", plans["other"])
    for words in (["solve"], ["bound"], ["solve", "--method", AT_THE_ROOT]):
        command, *options = words
        run = Run(capsys, command, "corridor-tight", *options, "--start", plans["greedy"], "--json")
        assert run.code == 0
        assert re.search("start rejected: step .* drones 0 and 1", run.json["message"])
    best = Run(capsys, "plan", "corridor-tight", "--planner", "joint", "--json").json["reward"]
    for command in ("solve", "bound"):
        run = Run(capsys, command, "corridor-tight", "--start", plans["joint"], "--json")
        assert run.json["message"] == ""
        assert run.json["reward"] == pytest.approx(best)
    free = Run(capsys, "solve", "corridor-tight", "--start", plans["greedy"], "--free", "--json")
    assert free.json["message"] == ""
    for wrong in (plans["other"], tmp_path / "absent.json"):
        run = Run(capsys, "solve", "corridor-tight", "--start", wrong)
        assert (run.code, run.out) == (2, "")
        assert str(wrong) in run.err


def test_a_bound_says_that_it_has_a_better_plan_than_the_start(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Its gap is that of the plan it has found, which `bound` does not write."""
    start = tmp_path / "start.json"
    Run(capsys, "plan", "tiny-queue", "--planner", "sequential", "-o", start)
    run = Run(capsys, "bound", "tiny-queue", "--start", start, "--json")
    best = Run(capsys, "solve", "tiny-queue", "--json").json["reward"]
    assert run.json["reward"] == pytest.approx(best)
    assert "a better plan than the start" in run.json["message"]


def test_verify_says_what_the_numbers_of_a_cautious_claim_prove(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A claim may be higher than what is proved: both are told, and the gap is to the latter."""
    path = tmp_path / "bound.json"
    Run(capsys, "bound", "tiny-queue", "-o", path)
    assert "bound_proved" not in Run(capsys, "verify", "tiny-queue", path, "--json").json
    content = json.loads(path.read_text())
    path.write_text(json.dumps(content | {"bound": 1.5 * content["bound"]}))
    plan = tmp_path / "plan.json"
    reward = Run(capsys, "plan", "tiny-queue", "-o", plan, "--json").json["reward"]
    found = Run(capsys, "verify", "tiny-queue", path, plan, "--json", "--explain").json
    assert found["bound_claimed"] == pytest.approx(1.5 * content["bound"])
    assert found["bound"] == found["bound_proved"] == pytest.approx(content["bound"], rel=1e-6)
    assert found["gap"] == (found["bound"] - reward) / found["bound"]
    assert found["explanation"]["difference"] == pytest.approx(found["bound"] - reward)


@pytest.mark.slow
def test_a_foreign_start_brings_its_own_scene(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """What is solved from a plan for the scene's own starts can be verified as such.

    All claims are held against that scene, in whatever order their files are named.
    """
    scene, start, plan, proof = (
        tmp_path / name for name in ("seq.yaml", "paths.csv", "plan.json", "proof.json")
    )
    scene.write_text(SMALL_SEQUENCE)
    np.save(tmp_path / "map.npy", np.zeros((4, 4)))
    (tmp_path / "starts.csv").write_text("x,y,z,theta\n3,3,5,0\n")
    start.write_text("robot,t,x_cell,y_cell,heading_idx\n0,0,1,0,0\n0,1,1,1,0\n")
    run = Run(capsys, "solve", scene, "--start", start, "-o", plan, "--certificate", proof,
              "--json")  # fmt: skip
    assert run.json["reason"] == "optimal"
    assert run.json["seed"] is None
    assert Run(capsys, "verify", scene, plan, proof, "--json").json["optimal"] is True
    assert Run(capsys, "solve", scene, "--start", plan, "--json").json["message"] == ""
    other = tmp_path / "other.json"
    Run(capsys, "bound", scene, "--method", "alone", "-o", other)  # of the seed's start set
    for claims, code in (((start, proof), 0), ((start, proof, other), 1)):
        runs = [Run(capsys, "verify", scene, *some, "--json") for some in permutations(claims)]
        assert {(run.code, run.out) for run in runs} == {(code, runs[0].out)}
    assert any(str(other) in violation for violation in runs[0].json["violations"])


@pytest.mark.slow
def test_solve_says_that_there_is_no_plan(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Infeasible is a proved answer; the plan is not written, the proof is."""
    plan, proof = tmp_path / "plan.json", tmp_path / "proof.json"
    run = Run(capsys, "solve", "tiny-head-on", "-o", plan, "--certificate", proof, "--json")
    assert (run.code, run.json["reason"], run.json["reward"]) == (0, "infeasible", None)
    assert f"{plan} was not written" in run.json["message"]
    assert not plan.exists()
    verified = Run(capsys, "verify", "tiny-head-on", proof, "--json")
    assert (verified.code, verified.json["valid"]) == (0, True)
    assert "no plan" in verified.json["message"]
    assert Run(capsys, "gap", "tiny-head-on").code == 0


def split_leaf(proof: dict) -> None:
    """Branch a proof of one leaf on whether a robot is in a cell at step 1."""
    (leaf,) = proof["nodes"]
    children = []
    for _ in range(2):
        child = json.loads(json.dumps(leaf))
        child["certificate"]["decisions"] = [0.0]
        children.append(child)
    resource = {"type": "cells", "t": 1, "cells": [[1, 1, 0]]}
    branch = {"type": "branch", "resource": resource, "robots": 0, "at_most": 1, "at_least": 2}
    proof["nodes"] = [branch, *children]
    proof["bound"] *= 1 + 1e-12  # one more number in the sums: a little more rounding


def test_names_of_files_are_no_lists(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Brackets at the beginning of a name are a part of it."""
    monkeypatch.chdir(tmp_path)
    for words in (
        ("plan", "tiny-share", "-o", "[x].json"), ("verify", "tiny-share", "[x].json"),
        ("show", "tiny-share", "[x].json", "-o", "x.html"),
    ):  # fmt: skip
        assert Run(capsys, *words).code == 0, words


def test_what_is_worth_nothing_is_shown_as_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A bound that rounding lifts above 0 is no cent, and rules that cost nothing cost 0 %."""
    for command in ("solve", "bound"):
        assert re.search(r"bound +0\.00\n", Run(capsys, command, "tiny-hidden").out)
    Run(capsys, "gap", "tiny-hidden", "--planner", "greedy", "--time-limit", 3, "-o", tmp_path)
    (row,) = co.gap("tiny-hidden", ["greedy"]).itertuples()
    assert row.bound < 1e-9
    prices = Run(capsys, "table", tmp_path).out.split("## Price of collision avoidance")[1]
    assert "| tiny-hidden |                0.000 |               0.000 |" in prices


def test_a_false_claim_breaks_no_rule(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The gap is that of what `verify` computed, whatever the file claims."""
    plan, bound = tmp_path / "plan.json", tmp_path / "bound.json"
    Run(capsys, "solve", "tiny-share", "-o", plan, "--certificate", bound)
    claim = json.loads(plan.read_text())
    for factor in 0.5, 2.0:
        plan.write_text(json.dumps(claim | {"reward": factor * claim["reward"]}))
        run = Run(capsys, "verify", "tiny-share", plan, bound)
        assert run.code == 1 and "reward: the plan claims" in run.out
        words = "0.000 %: between J and the bound as verified, not as claimed"
        assert words in " ".join(run.out.split())


@pytest.mark.slow
def test_altered_proofs_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A proof with a part removed, of another scene, or that claims too much is not accepted."""
    monkeypatch.setattr(root, "step_envelopes", lambda *_: None)  # they leave nothing to a tree
    good, altered = tmp_path / "proof.json", tmp_path / "altered.json"
    Run(capsys, "solve", "tiny-share", "--certificate", good)
    proof = json.loads(good.read_text())
    assert len(proof["nodes"]) == 1
    split_leaf(proof)

    def verified(change: str) -> int:
        changed = json.loads(json.dumps(proof))
        exec(change, {"proof": changed})
        altered.write_text(json.dumps(changed))
        run = Run(capsys, "verify", "tiny-share", altered, "--json")
        assert "Traceback" not in run.err
        if run.code == 1:
            assert run.json["violations"][0].startswith(f"{altered}: ")
            assert run.json["bound"] is None
        return run.code

    assert verified("pass") == 0
    for change in (
        "proof['nodes'].pop()",  # a leaf
        "proof['nodes'] = proof['nodes'][1:]",  # the branching row
        "proof['nodes'][0]['at_least'] = 1",  # one side counted twice
        "proof['nodes'][0]['robots'] = -1",
        "proof['nodes'][0]['resource']['t'] = 99",
        "proof['nodes'][2]['certificate']['decisions'] = []",
        "proof['bound'] *= 0.999",
        "proof['bound'] = None",
        "proof['digest'] = proof['digest'][::-1]",
    ):
        assert verified(change) == 1, change
    assert verified("proof['format'] = 'proof'") == 2
    assert verified("proof['nodes'][1]['type'] = 'twig'") == 2
    Run(capsys, "solve", "tiny-share", "--certificate", good)
    assert Run(capsys, "verify", "tiny-queue", good).code == 1


@pytest.mark.long
def test_every_altered_number_of_a_proof_is_noticed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whatever number of a proof is changed, it is refused or still proves a true bound."""
    monkeypatch.setattr(root, "step_envelopes", lambda *_: None)
    good, altered = tmp_path / "proof.json", tmp_path / "altered.json"
    Run(capsys, "solve", "tiny-share", "--certificate", good)
    proof = json.loads(good.read_text())
    split_leaf(proof)
    for path in number_paths(proof)[::3]:
        for change in (0.0, 0.5, 2):
            changed = json.loads(json.dumps(proof))
            inner = changed
            for key in path[:-1]:
                inner = inner[key]
            inner[path[-1]] *= change
            altered.write_text(json.dumps(changed))
            run = Run(capsys, "verify", "tiny-share", altered, "--json")
            assert run.code in (0, 1, 2)
            if run.code == 0:
                assert run.json["bound"] >= OPTIMA["tiny-share"] - 1e-9, path


@pytest.mark.slow
def test_verify_says_whether_a_plan_is_optimal(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """true where J and the bound agree, false where they do not, null where one is missing."""
    plan, proof = tmp_path / "plan.json", tmp_path / "proof.json"
    Run(capsys, "solve", "corridor-tight", "--certificate", proof)
    answers = []
    for planner in ("joint", "sequential"):
        Run(capsys, "plan", "corridor-tight", "--planner", planner, "-o", plan)
        answers.append(Run(capsys, "verify", "corridor-tight", plan, proof, "--json").json)
    answers += [Run(capsys, "verify", "corridor-tight", f, "--json").json for f in (plan, proof)]
    assert [answer["optimal"] for answer in answers] == [True, False, None, None]


@pytest.mark.parametrize("options", [(), ("--views", "2")])
def test_certificates_name_the_instance_that_export_writes(
    options: tuple[str, ...], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """It is that of the bound's objective; `verify` says where another one is named."""
    scene, bound = tmp_path / "scene.json", tmp_path / "bound.json"
    Run(capsys, "export", "tiny-share", "-o", scene, *options)
    Run(capsys, "bound", scene, "-o", bound)
    told = Run(capsys, "export", scene, "-o", tmp_path / "x.instance", "--json").json
    file = json.loads(bound.read_text())
    assert file["instance"] == told["sha256"]
    assert "message" not in Run(capsys, "verify", scene, bound, "--json").json
    forged = tmp_path / "forged.json"
    forged.write_text(json.dumps(file | {"instance": 64 * "0"}))
    for files in ((forged,), (bound, forged)):
        altered = Run(capsys, "verify", scene, *files, "--json").json
        assert "names a different instance" in altered["message"]


@pytest.mark.parametrize(
    ("command", "scene", "method", "proof"),
    [
        ("bound", "corridor", "column-generation", "searched, in stages: "),
        ("bound", "tiny-share", "alone", "reference pixels, no search"),
        ("solve", "tiny-share", "branch-and-price", "multipliers, no search"),
        ("solve", "corridor-tight", "searchless", "multipliers at 3 leaves of a tree, no search"),
    ],
)
def test_a_bound_says_if_it_was_searched(
    command: str, scene: str, method: str, proof: str, tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    """Numbers alone prove it, or searches that have to be repeated, of so many nodes."""
    file = tmp_path / "file.json"
    option = "-o" if command == "bound" else "--certificate"
    told = Run(capsys, command, scene, "--method", method, option, file, "--json").json["proof"]
    checked = Run(capsys, "verify", scene, file, "--json").json["proof"]
    assert proof.startswith(told)
    assert checked.startswith(proof)
    assert (checked != told) == ("searched" in told)


def test_verify_keeps_the_lower_of_two_bounds(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Two certificates may stand together, in any order; the lower bound is the one shown."""
    loose, tight = tmp_path / "loose.json", tmp_path / "tight.json"
    Run(capsys, "bound", "tiny-share", "--method", "alone", "-o", loose)
    Run(capsys, "solve", "tiny-share", "--certificate", tight)
    alone, *both = (
        Run(capsys, "verify", "tiny-share", *files, "--json").json
        for files in ((tight,), (loose, tight), (tight, loose))
    )
    for answer in both:
        assert (answer["bound"], answer["method"]) == (alone["bound"], "branch-and-price")


@pytest.mark.slow
def test_of_a_proved_optimum_nothing_is_left_to_explain(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its terms cancel, so that none is named as a cause; --json has them all the same."""
    monkeypatch.setenv("COLUMNS", "300")
    plan, proof = tmp_path / "plan.json", tmp_path / "proof.json"
    Run(capsys, "solve", "corridor-tight", "-o", plan, "--certificate", proof)
    said = "No plan is better: up to rounding, J of this plan equals the bound, and there is no gap"
    for words in ((), ("--all",)):
        out = Run(capsys, "verify", "corridor-tight", plan, proof, "--explain", *words).out
        assert out.startswith(said)
        assert not any(
            cause in out for cause in ("costs", "part", "overestimates", "Parts of the gap")
        )
    told = Run(capsys, "verify", "corridor-tight", plan, proof, "--explain", "--json").json
    (sentence,) = told["explanation"]["sentences"]
    assert sentence.startswith(said) and told["explanation"]["terms"]


@pytest.mark.slow
def test_a_gap_is_explained(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """`verify --explain` prints terms that add up and says what they mean; --json has them all."""
    monkeypatch.setenv("COLUMNS", "300")  # a sentence is a line
    plan, proof = tmp_path / "plan.json", tmp_path / "proof.json"
    Run(capsys, "solve", "corridor-tight", "--certificate", proof)
    Run(capsys, "plan", "corridor-tight", "--planner", "sequential", "-o", plan)
    answer = Run(capsys, "verify", "corridor-tight", plan, proof, "--explain", "--json").json
    told = answer["explanation"]
    assert sum(term["amount"] for term in told["terms"]) == pytest.approx(told["difference"])
    assert told["difference"] == pytest.approx(answer["bound"] - answer["reward"])
    assert {"path", "face", "stages", "rounding"} <= {term["kind"] for term in told["terms"]}
    assert {one["robot"] for one in told["replans"]} <= {0, 1}
    short = Run(capsys, "verify", "corridor-tight", plan, proof, "--explain").out
    first, second, third, blank, valid = short.partition("valid")[0].splitlines()
    rest = short.splitlines()[4:]
    assert re.match(
        r"The plan is at most \d\.\d+ % of the bound \([\d.,]+\) below the best plan; ", first
    )
    adds, back = re.findall(r"(add|subtract) [\d.]+ % of the bound \([\d.,]+\)", first)
    assert (adds, back) == ("add", "subtract") and "largest part" not in short
    assert not (blank + valid).strip()
    assert re.search("optimal +not proved", short)
    assert second.startswith("The largest single term: ")
    assert third in told["sentences"] and "replanning" in third.lower()
    assert "valid" in rest[0] and "--all" in rest[-1] and "Parts of the gap" not in short
    text = Run(capsys, "verify", "corridor-tight", plan, proof, "--explain", "--all").out
    total, difference = re.findall(r"^(?:sum|bound - J) +([\d,.]+)", text, re.MULTILINE)
    assert total == difference
    words = " ".join(text.split())
    assert all(sentence in words for sentence in told["sentences"])
    page, show = (
        tmp_path / "plan.html",
        ("show", "corridor-tight", plan, "-o", tmp_path / "plan.html"),
    )
    assert Run(capsys, *show, "--certificate", proof).code == 0
    assert '"losses":[[' in page.read_text()
    refused = Run(capsys, *show, "--certificate", plan)
    assert (refused.code, "must be a certificate or a proof" in refused.err) == (2, True)
    alone = Run(capsys, "verify", "corridor-tight", plan, "--explain")
    assert (alone.code, "certificate or a proof" in alone.err) == (2, True)


@pytest.mark.slow
@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_completion_knows_the_allowed_values(
    shell: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """A shell offers methods of bounds, exact methods, and formats of tables."""
    run = Run(capsys, "completion", shell)
    assert run.code == 0
    for word in (*BOUNDS, *EXACT, "latex"):
        assert word in run.out


@pytest.mark.long
def test_progress_is_a_plain_line_now_and_then(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where standard error is no terminal, lines that stay say how far a solver is."""
    monkeypatch.setattr(progress, "SECONDS_BETWEEN_LINES", 0.0)
    run = Run(capsys, "solve", "tiny-queue", "--json")
    assert run.json["reason"] == "optimal"
    line = r"cocap-opt: tiny-queue seed 0, \d+ s: J .*, bound .*, gap .* %"
    assert any(re.fullmatch(line, said) for said in run.err.splitlines())
    run = Run(capsys, "gap", "tiny-queue", "tiny-share", "--json")
    assert re.search(r"tiny-share seed 0, cocap, 9 of 14 done, \d+ s, about \d+ s left", run.err)
    assert len(run.json["rows"]) == 12
    monkeypatch.setattr(progress, "SECONDS_BETWEEN_LINES", 60.0)
    assert Run(capsys, "solve", "tiny-queue", "--json").err == ""


WRONG = [
    (["plan", "no-such-scene"], "no such scene"),
    (["plan", "absent.json"], "absent.json"),
    (["plan", "corridor", "--planner", "best"], "--planner"),
    (["plan", "corridor", "--seed", "-1"], "seed"),
    (["plan", "corridor", "--seed", "one"], "--seed"),
    (["plan", "corridor", "--time-limit", "-1"], "--time-limit"),
    (["plan", "corridor", "--time-limit", "nan"], "--time-limit"),
    (["plan", "corridor", "--colour", "red"], "--colour"),
    (["plan", "corridor", "-o", "no/such/folder/plan.json"], "no/such/folder"),
    (["plan", "corridor", "-o", "x" * 300], "x" * 300 + ": cannot be written"),
    (["export", "corridor", "--views", "0", "-o", "x.json"], "--views: must be 1..64, not 0"),
    (["export", "corridor", "--views-weight", "2", "-o", "x.json"], "requires --views"),
    (["export", "corridor", "--views-share", "0.9", "-o", "x.json"], "requires --views"),
    (
        ["export", "corridor", "--views", "2", "--views-share", "2", "-o", "x.json"],
        "--views-share: must be 0..1, not 2.0",
    ),
    (
        ["export", "corridor", "--views", "2", "--views-weight", "-2", "-o", "x.json"],
        "--views-weight: must be 0..1,000,000,000,000, not -2.0",
    ),
    (["export", "corridor", "-o", "/dev/null"], "/dev/null: cannot be written"),
    (
        ["export", "corridor", "-o", "scene.yaml"],
        "-o: name a file that ends in .json, .mps, .lp, .cbf, .nl, .graphml, .instance or .csv",
    ),
    (["plan", "corridor", "-o", "plan.xyz"], "-o: name a file that ends in .json"),
    (["solve", "corridor", "--trace", "t.json"], "--trace: name a file that ends in .csv"),
    (["bound", "corridor", "-o", "/"], "/: cannot be written"),
    (["plan", "bottleneck", "--planner", "joint"], "one or two drones"),
    (["plan"], "SCENE"),
    (["fly", "corridor"], "fly"),
    (["bound", "corridor", "--method", "guess"], "--method"),
    (["solve", "corridor", "--method", "guess"], "--method"),
    (["solve", "corridor", "--method", "alone"], "--method"),
    (["solve", "corridor", "--method", "brute-force"], "at most"),
    (["bound", "corridor", "--method", "envelop"], "not 'envelop'; did you mean envelope?"),
    (["table", "results", "--format", "htm"], "must be one of markdown, latex, html, not 'htm'"),
    (["solve", "corridor", "--gap", "-0.1"], "--gap"),
    (["solve", "corridor", "--gap", "nan"], "--gap"),
    (["solve", "corridor", "--gap", "1"], "--gap"),
    (["solve", "corridor", "--gap", "few"], "--gap"),
    (["solve", "corridor", "--method", AT_THE_ROOT, "--gap", "0.1"], "--gap"),
    (["gap", "corridor", "--time-limit", "inf"], "--time-limit"),
    (["solve", "corridor", "--time-limit", "nan"], "--time-limit"),
    (["solve", "corridor", "--start", "absent.json"], "absent.json"),
    (["solve", "corridor", "--certificate", "no/such/folder/c.json"], "no/such/folder"),
    (["solve", "corridor", "-o", "./x.json", "--certificate", "x.json"], "--certificate"),
    (["bound", "corridor", "--start", "absent.json"], "absent.json"),
    (["gap"], "SCENE"),
    (["gap", "corridor", "--seeds", "3-1"], "--seeds"),
    (["gap", "corridor", "--seeds", "0-3,9-5"], "--seeds: ranges must go up, not '9-5'"),
    (["gap", "corridor", "--seeds", "a"], "--seeds"),
    (["gap", "corridor", "--seeds", "9" * 5000], "--seeds"),
    (["gap", "corridor", "--seeds", "0-" + "9" * 40], "--seeds"),
    (["plan", "corridor", "--seed", "9" * 40], "--seed"),
    (["plan", "corridor", "--seed", "9" * 5000], "--seed"),
    (["gap", "corridor", "--bound-limit", "-1"], "--bound-limit"),
    (["gap", "corridor", "--work-limit", "-1"], "--work-limit: must be a whole number"),
    (["plan", "corridor", "--work-limit", "few"], "--work-limit"),
    (["plan", "corridor", "--work-limit", "1.5"], "--work-limit"),
    (["plan", "corridor", "--work-limit", "9" * 16], "--work-limit"),
    (["plan", "corridor", "--seed", "1.9"], "--seed"),
    (["plan", "corridor", "--seed", "True"], "--seed"),
    (["export", "corridor", "--seed", "1.9", "-o", "x.json"], "--seed"),
    (["plan", "corridor", "--time-limit", "1e16"], "--time-limit"),
    (["gap", "corridor", "--work-limit", "1.5"], "--work-limit"),
    (["gap", "corridor", "--workers", "1.5"], "--workers"),
    (["gap", "corridor", "--bound-limit", "1e16"], "--bound-limit"),
    (["gap", "corridor", "--seeds", "9" * 16], "--seeds"),
    (["study", "no-such-study"], "no-such-study"),
    (["gap", "corridor", "--out", "/dev/null/x"], "/dev/null/x"),
    (["verify", "corridor", "absent.json"], "absent.json"),
    (["show", "corridor", "absent.json", "-o", "x.txt"], "-o"),
    (["show", "corridor", "absent.json", "-o", "x.png"], "absent.json"),
    (["export", "corridor"], "-o"),
]


@pytest.mark.parametrize(("words", "named"), WRONG, ids=lambda value: " ".join(value)[:60])
def test_wrong_input_is_one_line_and_exit_code_2(
    words: list[str], named: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """One line on standard error that names what is wrong, nothing on standard output."""
    run = Run(capsys, *words)
    assert run.code == 2
    assert run.out == ""
    assert len(run.err.splitlines()) == 1
    assert named in run.err
    assert "Traceback" not in run.err


def test_wrong_content_of_a_file_is_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A file that is no plan, and a scene with a wrong field, name the file and the field."""
    scene = tmp_path / "scene.json"
    Run(capsys, "export", "corridor", "-o", scene)
    content = json.loads(scene.read_text())
    content["problem"]["robots"][1]["camera"]["width"] = 0
    scene.write_text(json.dumps(content))
    for words in (["plan", scene], ["verify", "corridor", scene], ["gap", scene]):
        run = Run(capsys, *words)
        assert run.code == 2
        assert len(run.err.splitlines()) == 1
        assert str(scene) in run.err
    assert "width: must be 1..100000 px" in Run(capsys, "plan", scene).err


@pytest.mark.slow
def test_exported_scene_is_the_scene(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A scene's file gives the same plan as its name and seed."""
    file = tmp_path / "scene.json"
    Run(capsys, "export", "corridor", "--seed", 3, "-o", file)
    by_name = Run(capsys, "plan", "corridor", "--seed", 3, "--json").json
    by_file = Run(capsys, "plan", file, "--json").json
    assert by_name["reward_per_step"] == by_file["reward_per_step"]


@pytest.mark.parametrize("suffix", [".png", pytest.param(".gif", marks=pytest.mark.slow)])
def test_show_draws_a_picture(
    suffix: str, tmp_path: Path, files: tuple[Path, Path], capsys: pytest.CaptureFixture[str]
) -> None:
    """A PNG of the last step, or a GIF with a frame for each step that is named."""
    from PIL import Image

    picture, frames = tmp_path / f"picture{suffix}", {".gif": 2}.get(suffix, 1)
    steps = ("--steps", "0,8") if suffix == ".gif" else ()
    assert Run(capsys, "show", "corridor-tight", files[0], *steps, "-o", picture).code == 0
    with Image.open(picture) as image:
        assert getattr(image, "n_frames", 1) == frames
        assert image.width > 300


@pytest.mark.slow
def test_show_draws_any_step(
    tmp_path: Path, files: tuple[Path, Path], capsys: pytest.CaptureFixture[str]
) -> None:
    """One of them, or several beside each other; what the scene has not is refused."""
    from PIL import Image

    sizes, show = {}, ("show", "corridor-tight", files[0])
    for steps in ("0", "0,8"):
        picture = tmp_path / f"{steps}.png"
        assert Run(capsys, *show, "--steps", steps, "-o", picture).code == 0
        with Image.open(picture) as image:
            sizes[steps] = image.size
    assert sizes["0,8"] != sizes["0"]
    for steps, name, words in (
        ("9", "a.png", "--steps: must be 0..8, not 9"),
        ("1-", "a.png", "--steps: must be numbers and ranges"),
        ("1", "a.html", "--steps: requires a plan, and a picture"),
    ):
        run = Run(capsys, *show, "--steps", steps, "-o", tmp_path / name)
        assert run.code == 2 and words in run.err


@pytest.mark.slow
def test_scenes_lists_all_scenes_and_formats(capsys: pytest.CaptureFixture[str]) -> None:
    """Everything that can stand for SCENE is listed."""
    from cocap_opt.scenarios import FORMATS, SCENES

    listed = Run(capsys, "scenes", "--json").json
    assert {row["scene"] for row in listed["scenes"]} == set(SCENES)
    assert {row["format"] for row in listed["formats"]} == set(FORMATS)


def test_a_time_limit_of_zero_still_answers(capsys: pytest.CaptureFixture[str]) -> None:
    """Out of time is a result: the best there is, with the reason and the limit."""
    rows = Run(capsys, "gap", "corridor", "--time-limit", 0, "--json").json["rows"]
    assert {row["limit"] for row in rows} == {"time"}
    for row in rows:
        assert row["reason"] == "stopped"
        assert row["reward"] > 0  # all stay where they are
        assert row["conflicts"] == 0
        assert row["bound"] is None or row["bound"] >= row["reward"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "limited"),
    [
        pytest.param(
            ("plan", "bottleneck-tight", "--planner", "cocap"), "reason", marks=pytest.mark.slow
        ),
        (("bound", "corridor-tight"), "bound"),
        (("solve", "corridor-tight", "--seed", 1), "bound"),
    ],
)
def test_a_work_limit_stops_where_it_stops_anywhere(
    words: tuple[object, ...], limited: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """The same answer twice, and another one without the limit; a limit in the other column."""
    times = ("seconds", "coverage_seconds", "checking_seconds")
    first, again, free = (
        {k: v for k, v in Run(capsys, *words, *more, "--json").json.items() if k not in times}
        for more in (["--work-limit", 1], ["--work-limit", 1], [])
    )
    assert first == again
    assert (first["reason"], first["limit"], free["limit"]) == ("stopped", "work", "none")
    assert first[limited] != free[limited]


@pytest.mark.long
def test_the_same_plan_file_in_any_process(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Same scene and seed: the same plan file but for its seconds, whatever the hash seed."""
    here, there = tmp_path / "here.json", tmp_path / "there.json"
    Run(capsys, "plan", "bottleneck", "-o", here)
    code = "from cocap_opt.cli.main import main; main()"
    subprocess.run(
        [sys.executable, "-c", code, "plan", "bottleneck", "-o", str(there)], check=True,
        capture_output=True, env=os.environ | {"PYTHONHASHSEED": "2"},
    )  # fmt: skip
    plans = [re.sub(rb'"seconds": [0-9.e-]+', b"", path.read_bytes()) for path in (here, there)]
    assert plans[0] == plans[1]


@pytest.mark.long
def test_ctrl_c_prints_what_is_finished(tmp_path: Path) -> None:
    """An interrupted gap table is printed as far as it got; scripts learn that it is not whole."""
    words = "gap", "corridor", "--seeds", "0-9", "--planner", "greedy", "--planner", "sequential"
    process = start_command(*words, "--json", "--out", tmp_path)
    wait_for(process, tmp_path, "results.csv")
    process.send_signal(signal.SIGINT)
    out, _ = process.communicate(timeout=60)
    assert process.returncode == 130
    assert 0 < len(json.loads(out)["rows"]) < 20
    assert (tmp_path / "results.csv").is_file()


def parameters(program: App, *path: str) -> Iterator[tuple[str, str]]:
    """The names of all commands' parameters, with their help."""
    for name in program:
        command = program[name]
        if name.startswith("-"):
            continue
        if command.default_command is None:
            yield from parameters(command, *path, name)
            continue
        for argument in command.assemble_argument_collection():
            if argument.show:  # a group of options is none itself
                yield " ".join((*path, name, argument.name)), argument.parameter.help or ""


def test_every_parameter_has_help() -> None:
    """Nobody has to guess what a FILE or a FOLDER is."""
    found = dict(parameters(commands.app))
    assert {"verify FILE", "plan SCENE", "figure gaps FOLDER", "study others FOLDER"} <= set(found)
    assert {"plan --time-limit", "fly --margin", "gap --workers"} <= set(found)
    assert [name for name, words in found.items() if len(words) < 5] == []


def test_narrow_ways_are_said_where_they_help(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    caplog: pytest.LogCaptureFixture,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Where drones must queue is in `show`, in explanations, and beside plans that do not hold."""
    said = "must pass cell (1, 0)"
    plan, bound = tmp_path / "plan.json", tmp_path / "bound.json"
    Run(capsys, "plan", "tiny-queue", "--planner", "sequential", "-o", plan)
    Run(capsys, "bound", "tiny-queue", "--method", "alone", "-o", bound)
    assert said in Run(capsys, "verify", "tiny-queue", plan, bound, "--explain", "--all").out
    assert "must pass" not in caplog.text
    for words in (
        ("show", "tiny-queue", "-o", tmp_path / "starts.html"),
        ("plan", "tiny-queue", "--planner", "greedy", "-o", plan),
        ("verify", "tiny-queue", plan),  # in which two drones collide
    ):
        caplog.clear()
        Run(capsys, *words)
        assert caplog.text.count(said) == 1, words
    caplog.clear()
    monkeypatch.setitem(SOLVERS, "sequential", Method(lambda problem, stop: without_a_path(0)))
    Run(capsys, "gap", "tiny-queue", "--planner", "sequential", "--work-limit", 0)
    assert caplog.text.count(said) == 1


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_ctrl_c_gives_the_best_plan_and_bound_so_far(
    number: signal.Signals,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A solver told to end has a result: exit code 0, both files are written, and they hold."""
    plan, proof = tmp_path / "plan.json", tmp_path / "proof.json"
    monkeypatch.setenv("COCAP_OPT_CACHE", str(tmp_path / "cache"))
    process = start_command("solve", "bottleneck", "--seed", 2, "--time-limit", 600, "-o", plan,
                            "--certificate", proof, "--json", talkative=True)  # fmt: skip
    assert process.stderr is not None
    has_both = re.compile(r"cocap-opt: bottleneck seed 2, .* J [\d,.]+, bound [\d,.]+, gap ")
    assert any(has_both.match(line) for line in process.stderr)  # it waits for such a line
    process.send_signal(number)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 0
    assert all(line.startswith("cocap-opt: bottleneck") for line in err.splitlines()[1:])
    row = json.loads(out)
    assert (row["reason"], row["limit"]) == ("stopped", "interrupt")
    assert row["reward"] < row["bound"]
    answer = Run(capsys, "verify", "bottleneck", plan, proof, "--seed", 2, "--json").json
    assert (answer["valid"], answer["optimal"]) == (True, False)
    assert (answer["reward"], answer["bound"]) == (row["reward"], row["bound"])


@pytest.mark.slow
@pytest.mark.parametrize("module", ["cyclopts", "cocap_opt.experiments.report.report"])
def test_ctrl_c_while_modules_are_imported_is_one_line(module: str) -> None:
    """The half second before a command begins ends without a traceback, and so does a command."""
    code = f"""
import os, signal, sys
from cocap_opt.cli.main import main

class Press:
    @staticmethod
    def find_spec(name, path=None, target=None):
        if name == "{module}":
            os.kill(os.getpid(), signal.SIGINT)

sys.meta_path.insert(0, Press)
main(["report", "folder", "-o", "report.html"])
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (130, "")
    assert done.stderr == "cocap-opt: interrupted\n"


@pytest.mark.parametrize(
    ("redirection", "code"),
    [
        (">&-", 0),
        ("> /dev/full", 2),
        ("| head -n 1", 0),
    ],
)
@pytest.mark.slow
def test_standard_output_that_takes_nothing(redirection: str, code: int) -> None:
    """A closed, full or cut-off standard output is no traceback."""
    if "full" in redirection and not Path("/dev/full").exists():
        pytest.skip("needs /dev/full")
    python = f"{sys.executable} -c 'from cocap_opt.cli.main import main; main([\"recipe\"])'"
    done = subprocess.run(
        ["bash", "-c", f"set -o pipefail; {python} {redirection}"], capture_output=True, text=True,
        check=False,
    )  # fmt: skip
    assert done.returncode == code
    assert "Traceback" not in done.stderr
    assert len(done.stderr.splitlines()) == (1 if code else 0)


@pytest.mark.slow
@pytest.mark.parametrize("redirection", ["2>&-", "2> /dev/full", ">&- 2>&-"])
def test_standard_error_that_takes_nothing(redirection: str) -> None:
    """What is wrong with the input is told by the exit code alone."""
    if "full" in redirection and not Path("/dev/full").exists():
        pytest.skip("needs /dev/full")
    words = ["plan", "no-such-scene"]
    program = "from cocap_opt.cli.main import main"
    python = f"{sys.executable} -c '{program}; main({json.dumps(words)})'"
    done = subprocess.run(
        ["bash", "-c", f"{python} {redirection}"], capture_output=True, check=False
    )
    assert (done.returncode, done.stdout) == (2, b"")


def test_a_file_of_the_system_that_is_missing_is_named(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Where /proc is not mounted, it is not standard output that is to blame."""

    def run(arguments: list[str]) -> int:
        raise FileNotFoundError(2, "No such file or directory", "/proc/meminfo")

    monkeypatch.setattr(commands, "run", run)
    with pytest.raises(SystemExit, match="2"):
        main(["scenes"])
    assert capsys.readouterr().err == "cocap-opt: /proc/meminfo: No such file or directory\n"


HOSTILE = "\x1b[2A\x1b[31mvalid\x9b1A\u202e\r\x07|`<b>"


def hostile_files(tmp_path: Path) -> list[Path]:
    """A scene, a plan and a certificate of it, with control sequences in every text field."""
    scene, plan, bound = (tmp_path / f"{name}.json" for name in ("scene", "plan", "bound"))
    main_ = [["export", "tiny-queue", "-o", scene], ["plan", scene, "-o", plan],
             ["bound", scene, "-o", bound]]  # fmt: skip
    for words in main_:
        with pytest.raises(SystemExit):
            main([str(word) for word in words])
    fields = {scene: (), plan: ("scene", "planner"), bound: ("scene", "method")}
    for path, names in fields.items():
        content = json.loads(path.read_text())
        content |= dict.fromkeys(names, HOSTILE)
        if "problem" in content:
            content["problem"]["name"] = HOSTILE
        path.write_text(json.dumps(content))
    return [scene, plan, bound]


@pytest.mark.slow
def test_text_of_files_steers_no_terminal(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Whatever text is in a file, what is printed is plain lines."""
    scene, plan, bound = hostile_files(tmp_path)
    broken = tmp_path / f"{HOSTILE.replace('/', '')}.json"
    broken.write_text(json.dumps({"format": HOSTILE, "version": 1}))
    (tmp_path / f"f.{HOSTILE.replace('/', '')}.crazyflie.csv").touch()  # of another flight
    for words in (
        ["verify", scene, plan, bound], ["verify", scene, plan, bound, "--json"],
        ["plan", scene], ["plan", scene, "--json"], ["verify", "tiny-queue", plan],
        ["gap", scene, "--planner", "greedy"], ["gap", scene, "--planner", "greedy", "--json"],
        ["gap", scene, "--planner", "greedy", "--out", tmp_path / "run"],
        ["table", tmp_path / "run", "--format", "markdown"], ["verify", scene, broken],
        ["show", scene, plan, "-o", tmp_path / "a.png"], ["plan", HOSTILE], ["plan", broken],
        ["fly", scene, plan, "--step", "2", "--smooth", "-o", tmp_path / "f.crazyflie.csv"],
    ):  # fmt: skip
        run = Run(capsys, *words)
        text = run.out + run.err
        assert text and all(c.isprintable() or c == "\n" for c in text), words
        if "markdown" in words:
            assert "<b>" not in text


@pytest.mark.parametrize(
    "words", [("plan",), ("bound",), ("solve", "--certificate", "other.json"), ("export",)]
)
def test_a_scene_is_not_overwritten(
    words: tuple[str, ...], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The scene's own file is no place for what is made of it."""
    scene = tmp_path / "scene.json"
    Run(capsys, "export", "tiny-share", "-o", scene)
    before = scene.read_bytes()
    run = Run(capsys, words[0], scene, *words[1:], "-o", scene)
    assert run.code == 2 and "must not be an input file" in run.err
    assert scene.read_bytes() == before


WALLS = """
steps = 2
[map]
size = [9, 9]
[[walls]]
file = "w.json"
unit = "m"
height = 2
polygons = "obstacles"
[[drones]]
count = 1
camera = "px4-gimbal"
"""
SQUARE = {"type": "Polygon", "coordinates": [[[4, 4], [5, 4], [5, 5], [4, 5], [4, 4]]]}


@pytest.mark.parametrize("words", [("plan", "-o"), ("bound", "-o"), ("export", "-o")])
def test_a_file_that_a_recipe_names_is_not_overwritten(
    words: tuple[str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Maps, walls and tracks are no place for what is made of them, however they are named."""
    scene, walls = tmp_path / "scene.toml", tmp_path / "w.json"
    scene.write_text(WALLS)
    walls.write_text(json.dumps(SQUARE))
    before = walls.read_bytes()
    run = Run(capsys, words[0], scene, words[1], tmp_path / ".." / tmp_path.name / "w.json")
    assert run.code == 2 and "must not be an input file" in run.err
    assert walls.read_bytes() == before
    assert Run(capsys, "export", scene, "-o", tmp_path / "other.json").code == 0


def test_long_words_do_not_fill_the_screen(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Of a wrong value of thousands of characters a message shows both ends."""
    scene = tmp_path / "scene.toml"
    scene.write_text(f'flown = "{"a" * 5000}"' + WALLS)
    run = Run(capsys, "plan", scene)
    assert run.code == 2 and "flown: must be one of" in run.err
    assert len(run.err) < 1000


def test_names_that_no_file_can_have_are_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A name that is too long is refused as any other that is not there, where it is written."""
    scene = tmp_path / "scene.toml"
    scene.write_text(WALLS.replace("w.json", "x" * 300 + ".json"))
    run = Run(capsys, "plan", scene)
    assert run.code == 2 and "scene.toml: walls[0]: " in run.err and "too long" in run.err
    run = Run(capsys, "verify", "tiny-share", "x" * 300 + ".json")
    assert run.code == 2 and "too long" in run.err


@pytest.mark.slow
def test_python_runs_the_module_as_the_command() -> None:
    """`python -m` of its module does what `cocap-opt` does, and does not end in silence."""
    words = [sys.executable, "-m", "cocap_opt.cli.main", "--version"]
    found = subprocess.run(words, capture_output=True, text=True, check=True)
    assert co.__version__ in found.stdout


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("bound", "corridor", "--method", "alon"), "--method: must be one of alone, .*; did you"),
        (("figure", "gap"), "COMMAND: must be one of gaps, .*, not 'gap'; did you mean gaps"),
        (("slve",), "COMMAND: must be one of scenes, .*, not 'slve'; did you mean solve"),
        (("compile", "more"), "more: must be left out, as the command does not take it"),
        (("plan", "corridor", "--seed", "-1"), "--seed: .* from 0 to 9,000,000,000,000,000, not"),
    ],
)
def test_wrong_words_are_told_like_all_else(
    words: tuple[str, ...], told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """What must be, what is given, and what was meant: also where Cyclopts reads the command."""
    run = Run(capsys, *words)
    assert run.code == 2
    assert re.search(told, run.err)
