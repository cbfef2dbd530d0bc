"""Plans of other projects and ours under one evaluator, with certified bounds."""

import json
import re
import signal
from pathlib import Path
from statistics import fmean, stdev
from typing import Any

import numpy as np
import pytest
from hypothesis import given, reject
from others import DATA
from pool import meetings
from scene_files import SEQUENCE, actor, solution, write_hughes
from strategies import examples
from studies import rows_of, study

from cocap_opt.cli.main import main as cocap_opt
from cocap_opt.experiments.lab.studies.others.cases import Case
from cocap_opt.experiments.lab.studies.others.published import Scene
from cocap_opt.experiments.lab.studies.others.stored_values import solutions_beside
from cocap_opt.experiments.lab.studies.others.tables import OverSets
from cocap_opt.experiments.sweeps import work
from cocap_opt.experiments.tables.rows import GapRow
from cocap_opt.files.documents import PlanFile
from cocap_opt.planners import PLANNERS
from cocap_opt.problem import Plan, Problem
from cocap_opt.referee import check
from cocap_opt.result import relative_gap
from cocap_opt.run.judged import Judged
from cocap_opt.scenarios import load_scene
from cocap_opt.scenarios.formats import hughes

# In both sets greedy planning sends both robots to one cell; in the first all planners differ.
STARTS = "x,y,z,theta\n0,1,5,1.58\n4,2,5,3.95\n5,3,5,1.58\n3,3,5,2.37\n"
ALIKE = SEQUENCE.replace("[1000, 400, 300], tilt: 1.2", "[2500, 4000, 3000], tilt: 1.4")
APART = ALIKE.replace("[1.5, 0, 5, 0]", "[0, 3, 5, -1.58]").replace("[4, 1, 6, -1]", "[4, 1, 5, 0]")
OURS = ("greedy", "cocap", "branch-and-price")
HEADER = "robot,t,x_cell,y_cell,heading_idx\n"


@pytest.fixture
def sequence(tmp_path: Path) -> Path:
    """Two robots, one actor, two moves, two start sets."""
    folder = tmp_path / "theirs" / "tiny"
    folder.mkdir(parents=True)
    np.save(folder / "map.npy", np.zeros((6, 4)))
    (folder / "seq.yaml").write_text(APART)
    (folder / "starts.csv").write_text(STARTS)
    return folder / "seq.yaml"


@pytest.fixture
def with_peer(sequence: Path) -> Path:
    """The scene with a plan beside it that stays at the file's own starts."""
    starts = ("0,{t},0,3,6\n", "1,{t},4,1,0\n")
    paths = [start.format(t=t) for start in starts for t in range(3)]
    sequence.with_name("peer_paths.csv").write_text(HEADER + "".join(paths))
    rewards = "t,reported_view_reward,own_tilt_view_reward\n0,1,10\n1,2,20\n2,4,40\n"
    sequence.with_name("peer_reward.csv").write_text(rewards)
    return sequence


@pytest.fixture
def meeting(tmp_path: Path) -> Path:
    """A folder with a scene of Hughes et al., and results of five planners of theirs.

    Of `greedy` and `assignment` there are plans, `formation` flies between the cells, of `myopic`
    there are rewards from the same starts, and of `circles` from others.
    """
    folder = write_hughes(tmp_path / "theirs" / "meeting").parent
    problem = load_scene(str(folder / "meeting" / "scene.json"))
    stay = [[(1, 1, "NE")] * 3, [(8, 7, "W")] * 3]
    between = [[(1.5, 1.5, "NE")] * 3, [(8, 7, "W")] * 3]
    for name, paths in (("assignment", stay), ("formation", between)):
        (folder / "meeting" / name).mkdir()
        (folder / "meeting" / name / "solution.json").write_text(json.dumps(solution(*paths)))
    solutions = solutions_beside(folder / "meeting" / "scene.json")
    assert list(solutions) == ["assignment", "formation", "greedy"]
    plans = [hughes.read_plan(solutions[name], problem) for name in ("assignment", "greedy")]
    verdicts = [check(problem, Plan(paths=paths)) for paths in plans]
    stays, moves = ([v.reward_at_start, *v.reward_per_step] for v in verdicts)
    flies = hughes.rewards_between_cells(solutions["formation"], problem) or ()
    rows = zip(stays, moves, flies, [stays[0], 0.5, 0.25], [9.0, 9.0, 9.0], strict=True)
    lines = [",".join(map(repr, (t, *row))) for t, row in enumerate(rows, 1)]
    header = "t,assignment,greedy,formation,myopic,circles"
    (folder / "meeting" / "ppa_evaluation.csv").write_text("\n".join([header, *lines]))
    return folder


def measure(folder: Path, *words: str, limit: int = 20) -> Path:
    """Run the command; returns the folder of the results."""
    out = folder.parent / "out"
    options = ("--limit", limit, "--out", out, "--planner", *OURS, *words)
    assert study("others", folder, *options) == 0
    return out


def cells(out: Path) -> dict[Path, int]:
    """When the file of each cell of a sweep was written."""
    return {path: path.stat().st_mtime_ns for path in out.rglob("cells/*.json")}


def read_all(folder: Path) -> list[Case]:
    """Read the scenes in a folder, with all that is published with them."""
    return Case.all_of(Scene.all_in(folder), None, print)


def made(**changes: Any) -> GapRow:
    """A row of two robots in ten steps that count."""
    fields: dict[str, Any] = {
        "scene": "made", "seed": 0, "digest": "d", "planner": "greedy", "robots": 2, "actors": 1,
        "steps": 9, "reward": 100.0, "bound": 110.0, "bound_free": 125.0, "gap": 0.1,
        "gap_free": 0.2, "conflicts": 0, "colliding": 0, "reason": "finished", "limit": "none",
        "seconds": 1.0, "message": "", "bound_reason": "optimal", "bound_free_reason": "optimal",
    }  # fmt: skip
    return GapRow(**(fields | changes))


def means(*rows: GapRow) -> list[dict[str, Any]]:
    """The table over start sets of rows that `made` has made."""
    return OverSets(rows, {"made": 10}).records()


# -- start sets ---------------------------------------------------------------------------


def test_the_table_is_what_the_plans_are_worth(sequence: Path) -> None:
    """Means and spreads are those of the referee's J of the plans on disk, per robot and step.

    The bounds beside them are the optima that joint planning of two robots finds. All start sets
    are measured unless some are named.
    """
    out = measure(sequence.parent.parent)
    table = {row["planner"]: row for row in rows_of(out / "start_sets.csv")}
    assert list(table) == list(OURS)
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
    assert in_conflict == dict.fromkeys(OURS, "0.0") | {"greedy": "2.0"}
    page = (out / "others.md").read_text()
    assert re.search(r"\| tiny +\| cocap +\| +2 \|", page)


def test_what_is_on_disk_holds(sequence: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """`cocap-opt verify` finds the numbers of a row in its plan and its certificate."""
    out = measure(sequence.parent, "--sets", "1")
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
    folder = with_peer.parent.parent
    first = cells(measure(folder, "--sets", "1"))
    out = measure(folder)
    before = {name: (out / name).read_bytes() for name in ("start_sets.csv", "others.csv")}
    assert len(rows_of(out / "results.csv")) == 3 * len(OURS) + 1
    known = cells(out)
    assert first.items() <= known.items()
    capsys.readouterr()
    measure(folder)
    assert f"{len(known)} of {len(known)} cells are in" in capsys.readouterr().err
    assert before == {name: (out / name).read_bytes() for name in before}
    assert cells(out) == known


def test_rows_of_another_scene_leave(sequence: Path) -> None:
    """Where the file of a scene has changed, its earlier rows are those of another scene."""
    measure(sequence.parent.parent, "--sets", "0")
    sequence.write_text(APART.replace("[3, 3.5, 0.1]", "[3, 3.4, 0.1]"))
    out = measure(sequence.parent.parent, "--sets", "1")
    assert {row["seed"] for row in rows_of(out / "results.csv")} == {"1"}


def test_an_interrupt_leaves_what_is_whole(
    sequence: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Ctrl-C gives the tables of the sets that are measured, and no row of the one that is not."""
    compute, begun = work._plan, []

    def pressed(task: work.Task, *rest: Any) -> Any:
        begun.append(task.cell)
        if len(begun) == len(OURS) + 2:
            signal.raise_signal(signal.SIGINT)
        return compute(task, *rest)

    monkeypatch.setattr(work, "_plan", pressed)
    out = sequence.parents[2] / "out"
    words = ("others", sequence.parents[1], "--limit", "20", "--out", out, "--planner", *OURS)
    assert study(*words) == 130
    assert {row["seed"] for row in rows_of(out / "results.csv")} == {"0"}
    assert {row["sets"] for row in rows_of(out / "start_sets.csv")} == {"1"}
    assert "branch-and-price" in capsys.readouterr().out
    assert study(*words) == 0
    assert {row["sets"] for row in rows_of(out / "start_sets.csv")} == {"2"}


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


# -- plans of theirs ----------------------------------------------------------------------


def test_their_plan_is_held_against_the_same_bound(with_peer: Path) -> None:
    """Theirs is evaluated by the referee from the file's own starts; what it took is unknown."""
    out = measure(with_peer.parent, "--sets", "0")
    rows = {row["planner"]: row for row in rows_of(out / "others.csv")}
    assert list(rows) == ["theirs", *OURS]
    problem = load_scene(str(with_peer), 0, {"start-set": "yaml"})
    theirs, best = rows["theirs"], PLANNERS["joint"](problem).value
    hovering = Plan(paths=tuple((robot.start,) * 3 for robot in problem.robots))
    verdict = check(problem, PlanFile.read(out / "plans/tiny-own-starts-own-cocap.json").plan)
    assert float(rows["cocap"]["reward"]) == verdict.reward
    expected = check(problem, hovering).reward
    assert float(theirs["reward"]) == pytest.approx(expected)
    assert (theirs["reported"], theirs["own tilts"]) == ("7.0", "70.0")
    assert theirs["seconds"] == "" and rows["cocap"]["seconds"] != ""
    assert float(theirs["gap"]) == pytest.approx(relative_gap(expected, best), abs=2e-6)
    above = 100 * (best / expected - 1)
    assert float(rows["branch-and-price"]["above theirs (%)"]) == pytest.approx(above, abs=1e-3)
    assert {row["scene"] for row in rows_of(out / "start_sets.csv")} == {"tiny"}
    assert "each drone's own tilt, the reward is 900.00 % more" in (out / "others.md").read_text()


def test_a_row_of_nothing_after_the_last_step_is_left_out(with_peer: Path) -> None:
    """Their program writes one row too many, of 0; the column of own tilts may be missing."""
    rewards = "t,reported_view_reward\n0,1\n1,2\n2,4\n3,0\n"
    with_peer.with_name("peer_reward.csv").write_text(rewards)
    *_, own = read_all(with_peer.parent)
    (theirs,) = own.published.values()
    assert (theirs.reported, theirs.own_tilts) == ((1.0, 2.0, 4.0), None)


@pytest.mark.parametrize(
    ("file", "text", "words"),
    [
        ("peer_reward.csv", "t,own_tilt_view_reward\n", "header"),
        ("peer_reward.csv", "t,reported_view_reward\n0,1\n2,1\n", "t: must be the steps 0..2"),
        ("peer_reward.csv", "t,reported_view_reward\n0,1\n1,1\n2,1\n3,1\n", "steps 0..2"),
        ("peer_paths.csv", HEADER, "robot 0: must have a row"),
        (
            "peer_paths.csv",
            HEADER + "".join(f"{i},{t},{3 * t},{i},0\n" for i in (0, 1) for t in range(3)),
            "paths[0]",
        ),
    ],
)
def test_what_is_of_no_use_is_left_out(
    with_peer: Path, file: str, text: str, words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Whatever is wrong with their files is one line that names the file, and no more."""
    with_peer.with_name(file).write_text(text)
    published = [one for case in read_all(with_peer.parent) for one in case.published.values()]
    assert len(published) == (file == "peer_reward.csv")  # the plan alone
    (line,) = capsys.readouterr().out.splitlines()
    assert "left out" in line and words in line and file in line


def test_five_planners_of_theirs_are_judged(
    meeting: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Plans are judged by the referee; rewards without a plan are theirs, and said to be.

    No gap is given where the drones start elsewhere or fly between the cells. The table has at
    most 80 columns.
    """
    monkeypatch.setenv("COLUMNS", "80")
    out = measure(meeting)
    rows = {row["planner"]: row for row in rows_of(out / "others.csv")}
    assert [row["by"] for row in rows.values()] == ["them"] * 5 + ["us"] * len(OURS)
    kinds = {name: row["of"] for name, row in rows.items() if row["by"] == "them"}
    assert kinds == {
        "their-assignment": "plan", "their-greedy": "plan", "their-formation": "no plan",
        "their-myopic": "their word", "their-circles": "no plan",
    }  # fmt: skip
    for name, row in rows.items():
        assert (row["gap"] != "") == (row["of"] != "no plan")
        if row["gap"] and name != "branch-and-price":
            gap = relative_gap(float(row["reward"]), float(row["bound"]))
            assert float(row["gap"]) == pytest.approx(gap)
    problem = load_scene(str(meeting / "meeting" / "scene.json"))
    best = PLANNERS["joint"](problem).value
    assert float(rows["branch-and-price"]["reward"]) == pytest.approx(best, rel=2e-6)
    assert float(rows["their-myopic"]["reward"]) == float(rows["their-myopic"]["reported"])
    printed = capsys.readouterr().out
    assert max(map(len, printed.splitlines())) <= 80
    assert "+ starts elsewhere" in printed and "* as their file says" in printed


@pytest.mark.parametrize("frame", [None, 2])
def test_stored_rewards_are_held_against_stored_plans(meeting: Path, frame: int | None) -> None:
    """Frames of which the stored reward is not that of the stored plan are named.

    Then their evaluator is not ours, and no gap is made of its word alone.
    """
    file = meeting / "meeting" / "ppa_evaluation.csv"
    lines = file.read_text().splitlines()
    if frame is not None:
        t, *rewards = lines[frame].split(",")
        lines[frame] = ",".join([t, rewards[0], repr(1.5 * float(rewards[1])), *rewards[2:]])
    file.write_text("\n".join(lines))
    out = measure(meeting)
    text = (out / "others.md").read_text().replace("&#95;", "_")
    (myopic,) = (r for r in rows_of(out / "others.csv") if r["planner"] == "their-myopic")
    assert (myopic["gap"] != "") == (frame is None)
    if frame is None:
        assert "rewards of assignment, greedy, formation are those" in text
    else:
        assert f"rewards of greedy are not those of its stored solution at frames {frame}" in text
        assert "rewards of assignment, formation are those" in text


@pytest.mark.slow
def test_drones_in_one_cell_are_counted_where_no_rule_forbids_it(meeting: Path) -> None:
    """Their plans and ours have the same column, which asks for no rule of the scene."""
    paths = [[(1, 1, "NE")] * 3, [(1, 1, "NE"), (1, 1, "NE"), (2, 1, "NE")]]
    for file in solutions_beside(meeting / "meeting" / "scene.json").values():
        file.write_text(json.dumps(solution(*paths)))
    rows = {row["planner"]: row for row in rows_of(measure(meeting) / "others.csv")}
    assert (rows["their-greedy"]["shared cells"], rows["their-greedy"]["conflicts"]) == ("2", "0")


@examples(25)
@given(meetings(team=3))
def test_robots_that_collide_are_those_that_the_referee_names(problem: Problem) -> None:
    """A robot is counted once, however many conflicts it takes part in, and with whom."""
    plan = PLANNERS["greedy"](problem).plan
    if plan is None:
        reject()
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
    *_, own = read_all(folder)
    (theirs,) = own.published.values()
    assert theirs.plan is not None and theirs.own_tilts is not None
    verdict = check(own.problem, theirs.plan)
    assert verdict.valid
    assert verdict.reward == pytest.approx(sum(theirs.own_tilts), rel=1e-3)
    assert theirs.reported != theirs.own_tilts


# -- folders ------------------------------------------------------------------------------


def test_what_is_missing_is_named(
    sequence: Path, meeting: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Scenes that cannot be read, and published scenes that are not there, stop nobody."""
    (meeting / "broken").mkdir()
    (meeting / "broken" / "seq.yaml").write_text("planner: 3")
    (meeting / "alone").mkdir()
    (meeting / "alone" / "alone_data.json").write_text(
        json.dumps(
            {"scene": {"scale": {"x": 5, "y": 5}}, "actor_positions": [[actor(1, 1, 0)]] * 2}
        )
    )
    assert study("others", meeting, "--planner", "greedy", "--sets", "0", "--limit", "20") == 0
    errors = capsys.readouterr().err
    for words in (
        "Hughes et al.: cluster, cross_mix", "Perspectives: corridor, forest",
        "broken/seq.yaml: left out", "alone/alone_data.json: left out", "no peer_paths.csv",
    ):  # fmt: skip
        assert words in errors


def test_scenes_of_one_name_are_told_apart(sequence: Path) -> None:
    """Two folders may have the same name, one below the other."""
    other = sequence.parent.parent / "more" / "tiny"
    other.mkdir(parents=True)
    for file in sequence.parent.iterdir():
        (other / file.name).write_bytes(file.read_bytes())
    names = [case.problem.name for case in read_all(sequence.parent.parent)]
    assert names == ["more/tiny/seq.yaml"] * 2 + ["tiny/seq.yaml"] * 2


@pytest.mark.parametrize(
    ("words", "named"),
    [
        ([], "FOLDER"),
        (["NOWHERE"], "must be a folder of scenes"),
        (["EMPTY"], "must contain folders with a seq.yaml"),
        (["SEQ", "--sets", "0-2"], "no scene can be read"),
        (["SEQ", "--sets", "x"], "--sets"),
        (["SEQ", "--limit", "0"], "--limit"),
        (["SEQ", "--planner", "cocapp"], "--planner"),
        (["SEQ", "--sets", "0", "--out", "OUT"], "results.csv: has no column"),
    ],
)
def test_wrong_input_is_said(
    sequence: Path, words: list[str], named: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Exit code 2 before any work, and a last line that names what is wrong."""
    top = sequence.parents[2]
    (top / "results.csv").write_text("scene,reward\ntiny,much\n")
    (top / "empty").mkdir()
    places = {"SEQ": sequence.parent, "OUT": top, "EMPTY": top / "empty", "NOWHERE": top / "none"}
    assert study("others", *(places.get(word, word) for word in words)) == 2
    assert named in capsys.readouterr().err.splitlines()[-1]
