"""Planners over start sets with certified bounds, and Greedy Perspectives' own plan beside ours."""

import re
import signal
from pathlib import Path
from statistics import fmean, stdev
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from others import DATA
from scene_files import SEQUENCE
from strategies import examples, meetings
from studies import rows_of, study

from cocap_opt.experiments.cli.main import main as cocap_opt
from cocap_opt.experiments.results.judging import Judged
from cocap_opt.experiments.results.rows import Row
from cocap_opt.experiments.studies.start_sets.start_sets import PLANNERS as PLANNED
from cocap_opt.experiments.studies.start_sets.start_sets import _Peer
from cocap_opt.experiments.studies.start_sets.tables import SetTables
from cocap_opt.experiments.sweeps import work
from cocap_opt.files.documents import PlanFile
from cocap_opt.planners import PLANNERS
from cocap_opt.problem import Plan, Problem
from cocap_opt.referee import check
from cocap_opt.result import relative_gap
from cocap_opt.scenarios import load_scene

# In both sets greedy planning sends both robots to one cell; in the first all planners differ.
STARTS = "x,y,z,theta\n0,1,5,1.58\n4,2,5,3.95\n5,3,5,1.58\n3,3,5,2.37\n"
ALIKE = SEQUENCE.replace("[1000, 400, 300], tilt: 1.2", "[2500, 4000, 3000], tilt: 1.4")
APART = ALIKE.replace("[1.5, 0, 5, 0]", "[0, 3, 5, -1.58]").replace("[4, 1, 6, -1]", "[4, 1, 5, 0]")


@pytest.fixture
def sequence(tmp_path: Path) -> Path:
    """Two robots, one actor, two moves, two start sets."""
    folder = tmp_path / "tiny"
    folder.mkdir()
    np.save(folder / "map.npy", np.zeros((6, 4)))
    (folder / "seq.yaml").write_text(APART)
    (folder / "starts.csv").write_text(STARTS)
    return folder / "seq.yaml"


@pytest.fixture
def with_peer(sequence: Path) -> Path:
    """The scene with a plan beside it that stays at the file's own starts."""
    header = "robot,t,x_cell,y_cell,heading_idx\n"
    starts = ("0,{t},0,3,6\n", "1,{t},4,1,0\n")
    paths = [start.format(t=t) for start in starts for t in range(3)]
    sequence.with_name("peer_paths.csv").write_text(header + "".join(paths))
    rewards = "t,reported_view_reward,own_tilt_view_reward\n0,1,10\n1,2,20\n2,4,40\n"
    sequence.with_name("peer_reward.csv").write_text(rewards)
    return sequence


def measure(sequence: Path, *words: str, sets: str = "0-1", limit: int = 20) -> Path:
    """Run the command; returns the folder of the results."""
    out = sequence.parent.parent / "out"
    options = ("--sets", sets, "--limit", limit, "--out", out, *words)
    assert study("start-sets", sequence, *options) == 0
    return out


def cells(out: Path) -> dict[Path, int]:
    """When the file of each cell of a sweep was written."""
    return {path: path.stat().st_mtime_ns for path in out.rglob("cells/*.json")}


def made(**changes: Any) -> Row:
    """A row of two robots in ten steps that count."""
    fields: dict[str, Any] = {
        "scene": "made", "seed": 0, "digest": "d", "planner": "greedy", "robots": 2, "actors": 1,
        "steps": 9, "reward": 100.0, "bound": 110.0, "bound_free": 125.0, "gap": 0.1,
        "gap_free": 0.2, "conflicts": 0, "colliding": 0, "reason": "finished", "limit": "none",
        "seconds": 1.0, "message": "", "bound_reason": "optimal", "bound_free_reason": "optimal",
    }  # fmt: skip
    return Row(**(fields | changes))


def means(*rows: Row) -> list[dict[str, Any]]:
    """The table over start sets of rows that `made` has made."""
    return SetTables(rows, {"made": 10}, {}).over_sets()


def test_the_table_is_what_the_plans_are_worth(
    sequence: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Means and spreads are those of the referee's J of the plans on disk, per robot and step.

    The bounds beside them are the optima that joint planning of two robots finds.
    """
    out = measure(sequence)
    table = {row["planner"]: row for row in rows_of(out / "start_sets.csv")}
    assert list(table) == list(PLANNED)
    problems = [load_scene(str(sequence), k) for k in (0, 1)]
    optima = [PLANNERS["joint"](problem).value / 6 for problem in problems]
    free = [PLANNERS["joint"](problem.without_rules()).value / 6 for problem in problems]
    for name, row in table.items():
        files = [out / "plans" / f"tiny-{k}-{name}.json" for k in (0, 1)]
        verdicts = [check(p, PlanFile.read(f).plan) for p, f in zip(problems, files, strict=True)]
        rewards = [verdict.reward / (2 * 3) for verdict in verdicts]  # robots, rows
        assert float(row["reward"]) == pytest.approx(fmean(rewards))
        assert float(row["sd"]) == pytest.approx(stdev(rewards))
        assert int(row["valid"]) == sum(verdict.valid for verdict in verdicts)
        assert float(row["bound"]) == pytest.approx(fmean(optima), rel=2e-6)
        assert float(row["bound_free"]) == pytest.approx(fmean(free), rel=2e-6)
        gaps = [relative_gap(a, b) for a, b in zip(rewards, optima, strict=True)]
        if name == "greedy":
            assert row["gap"] == row["largest gap"] == ""
        else:
            assert float(row["gap"]) == pytest.approx(fmean(gaps), abs=2e-6)
            assert float(row["largest gap"]) == pytest.approx(max(gaps), abs=2e-6)
        gaps_free = [relative_gap(a, b) for a, b in zip(rewards, free, strict=True)]
        assert float(row["gap_free"]) == pytest.approx(fmean(gaps_free), abs=2e-6)
    in_conflict = {name: row["colliding"] for name, row in table.items()}
    assert in_conflict == dict.fromkeys(PLANNED, "0.0") | {"greedy": "2.0"}
    printed = capsys.readouterr().out
    written = (out / "start_sets.md").read_text()
    for name in PLANNED:
        assert name in printed and f"| tiny | {name} | 2 |" in written


def test_what_is_on_disk_holds(sequence: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """`cocap-opt verify` finds the numbers of a row in its plan and its certificate."""
    out = measure(sequence, sets="1")
    (row,) = (row for row in rows_of(out / "results.csv") if row["planner"] == "branch-and-price")
    files = [out / "plans" / "tiny-1-branch-and-price.json", out / row["certificate"]]
    with pytest.raises(SystemExit) as caught:
        cocap_opt(["verify", str(sequence), *map(str, files), "--seed", "1", "--json"])
    assert caught.value.code == 0
    answer = capsys.readouterr().out
    assert f'"reward":{row["reward"]}' in answer and f'"bound":{row["bound"]}' in answer


def test_what_is_measured_is_not_measured_again(
    with_peer: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A second run makes the same tables from the folder, and says so; more sets are joined."""
    out = measure(with_peer, sets="1")
    first = cells(out)
    measure(with_peer)
    before = {name: (out / name).read_bytes() for name in ("start_sets.csv", "peers.csv")}
    assert len(rows_of(out / "results.csv")) == 3 * len(PLANNED) + 1
    known = cells(out)
    assert first.items() <= known.items()
    capsys.readouterr()
    measure(with_peer)
    assert f"{len(known)} of {len(known)} cells are in" in capsys.readouterr().err
    assert before == {name: (out / name).read_bytes() for name in before}
    assert cells(out) == known


def test_rows_and_files_stay_together(sequence: Path) -> None:
    """Measured on another scene, rows are replaced like the plans that they name."""
    out = measure(sequence)
    measure(sequence, "--option", "triangles=no", sets="1")
    rows = rows_of(out / "results.csv")
    assert {row["seed"] for row in rows} == {"1"}  # set 0 is of the scene as it was
    for row in rows:
        plan = PlanFile.read(out / "plans" / f"tiny-{row['seed']}-{row['planner']}.json")
        assert (plan.digest, repr(plan.reward)) == (row["digest"], row["reward"])


def test_an_interrupt_leaves_what_is_whole(
    sequence: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Ctrl-C gives the tables of the sets that are measured, and no row of the one that is not."""
    compute, begun = work._plan, []

    def pressed(task: work.Task, *rest: Any) -> Any:
        begun.append(task.cell)
        if len(begun) == len(PLANNED) + 2:
            signal.raise_signal(signal.SIGINT)
        return compute(task, *rest)

    monkeypatch.setattr(work, "_plan", pressed)
    out = sequence.parent.parent / "out"
    arguments = ("start-sets", sequence, "--sets", "0-1", "--limit", "20", "--out", out)
    assert study(*arguments) == 130
    assert {row["seed"] for row in rows_of(out / "results.csv")} == {"0"}
    assert {row["sets"] for row in rows_of(out / "start_sets.csv")} == {"1"}
    assert "branch-and-price" in capsys.readouterr().out
    assert study(*arguments) == 0
    assert {row["sets"] for row in rows_of(out / "start_sets.csv")} == {"2"}


def test_their_plan_is_held_against_the_same_bound(with_peer: Path) -> None:
    """Theirs is evaluated by the referee from the file's own starts; what it took is unknown."""
    out = measure(with_peer, sets="0")
    rows = {row["planner"]: row for row in rows_of(out / "peers.csv")}
    assert list(rows) == ["theirs", *PLANNED]
    problem = load_scene(str(with_peer), 0, {"start-set": "yaml"})
    theirs, best = rows["theirs"], PLANNERS["joint"](problem).value
    hovering = Plan(paths=tuple((robot.start,) * 3 for robot in problem.robots))
    verdict = check(problem, PlanFile.read(out / "plans/tiny-own-starts-own-cocap.json").plan)
    assert float(rows["cocap"]["J"]) == verdict.reward
    expected = check(problem, hovering).reward
    assert float(theirs["J"]) == pytest.approx(expected)
    assert float(theirs["reward"]) == pytest.approx(expected / 6)
    assert (theirs["J as reported"], theirs["J with own tilts"]) == ("7.0", "70.0")
    assert theirs["seconds"] == "" and rows["cocap"]["seconds"] != ""
    assert float(theirs["gap"]) == pytest.approx(relative_gap(expected, best), abs=2e-6)
    above = 100 * (best / expected - 1)
    assert float(rows["branch-and-price"]["above theirs (%)"]) == pytest.approx(above, abs=1e-3)
    assert "tiny-own-starts" not in {row["scene"] for row in rows_of(out / "start_sets.csv")}


@pytest.mark.parametrize(
    ("file", "text", "words"),
    [
        ("peer_reward.csv", "t,reported_view_reward\n", "header"),
        (
            "peer_reward.csv",
            "t,reported_view_reward,own_tilt_view_reward\n0,1,1\n2,1,1\n",
            "t: must be the steps 0..2",
        ),
        ("peer_paths.csv", "robot,t,x_cell,y_cell,heading_idx\n", "robot 0: must have a row"),
        (
            "peer_paths.csv",
            "robot,t,x_cell,y_cell,heading_idx\n"
            + "".join(f"{i},{t},{3 * t},{i},0\n" for i in (0, 1) for t in range(3)),
            "paths[0]",
        ),
    ],
)
def test_a_plan_of_no_use_is_left_out(
    with_peer: Path, file: str, text: str, words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Whatever is wrong with their files is one line that names the file, and no more."""
    with_peer.with_name(file).write_text(text)
    assert not list(_Peer.all_beside([str(with_peer)], {}))
    (line,) = capsys.readouterr().err.splitlines()
    assert "left out" in line and words in line and file in line


def test_options_are_those_of_export(sequence: Path) -> None:
    """The scenes may be read under other conventions, which change J and its steps."""
    out = measure(sequence, "--option", "conventions=ours", sets="0")
    problem = load_scene(str(sequence), 0, {"conventions": "ours"})
    (row,) = (r for r in rows_of(out / "results.csv") if r["planner"] == "branch-and-price")
    assert float(row["reward"]) == pytest.approx(PLANNERS["joint"](problem).value)


@pytest.mark.parametrize(
    ("words", "named"),
    [
        ([], "SCENE"),
        (["SEQ", "--sets", "0-2"], "0..1 (2 start sets)"),
        (["SEQ", "--sets", "0,1", "--option", "start-set=yaml"], "0 and 1 are the same"),
        (["SEQ", "--sets", "x"], "--sets"),
        (["SEQ", "--limit", "0"], "--limit"),
        (["SEQ", "--option", "tilt=mine"], "own, first"),
        (["SEQ", "--sets", "0", "--out", "OUT"], "results.csv: has no column"),
    ],
)
def test_wrong_input_is_one_line(
    sequence: Path,
    words: list[str],
    named: str,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Exit code 2 before any work, and a line that names what is wrong."""
    (sequence.parent / "results.csv").write_text("scene,reward\ntiny,much\n")
    places = {"SEQ": str(sequence), "OUT": str(sequence.parent)}
    assert study("start-sets", *(places.get(word, word) for word in words)) == 2
    error = capsys.readouterr().err
    assert named in error and error.count("\n") == 1


def test_means_are_over_all_sets_or_not_there() -> None:
    """Of a planner that has no plan in one set, or none that obeys the rules, no mean is given."""
    runs = [
        made(),
        made(seed=1, reward=200.0, colliding=2, conflicts=3, gap=None, bound_reason="stopped"),
        made(planner="cocap", reward=None, gap=None, conflicts=None, colliding=None),
        made(planner="cocap", seed=1),
    ]
    first, second = means(*runs)
    assert (first["sets"], first["valid"], first["proved"]) == (2, 1, 1)
    assert first["reward"] == pytest.approx(7.5)  # (100 + 200) / 2, of 2 robots in 10 steps
    assert first["sd"] == pytest.approx(stdev([5, 10]))
    assert (first["colliding"], first["gap"], first["largest gap"]) == (1.0, None, None)
    assert first["gap_free"] == pytest.approx((0.2 - 0.6) / 2)
    assert (second["reward"], second["gap"], second["valid"]) == (None, None, 1)
    assert means(*runs[:1])[0]["sd"] is None


@examples(25)
@given(meetings(team=3))
def test_robots_that_collide_are_those_that_the_referee_names(problem: Problem) -> None:
    """A robot is counted once, however many conflicts it takes part in, and with whom."""
    plan = PLANNERS["greedy"](problem).plan
    if plan is None:
        return
    named = re.findall(r"drones (\d+) and (\d+)", " ".join(check(problem, plan).conflicts))
    assert Judged.of_plan(problem, plan).colliding(problem) == len(
        {robot for pair in named for robot in pair}
    )


@pytest.mark.parametrize("name", ["corridor", "split"])
def test_their_plans_are_read_from_their_folders(name: str) -> None:
    """By our evaluation J of their plan is that of their pixels with each robot's own tilt."""
    folder = DATA / "greedy_perspectives" / name
    if not (folder / "peer_reward.csv").exists():
        pytest.skip(f"needs {name} in the data folder (COCAP_OPT_DATA)")
    (peer,) = _Peer.all_beside([str(folder)], {})
    verdict = check(peer.problem, peer.plan)
    assert verdict.valid
    assert verdict.reward == pytest.approx(peer.reported[1], rel=1e-3)
    assert peer.reported[0] != peer.reported[1]
