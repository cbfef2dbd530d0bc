import json
import re
import shutil
from collections.abc import Callable
from html import unescape
from pathlib import Path
from typing import Any

import pytest
from result_rows import row

import cocap_opt as co
from cocap_opt.cli import commands
from cocap_opt.experiments.report import explaining
from cocap_opt.experiments.report.limitations import limitations
from cocap_opt.experiments.report.report import _rules, _telling_pair, _telling_seed
from cocap_opt.experiments.sweeps.results import CommandRun, RunFile, load_results
from cocap_opt.experiments.tables.layout import Paths
from cocap_opt.problem import NO_RULES, CollisionRules

SWEEP = ("gap", "tiny-queue", "bottleneck", "--time-limit", "0.5", "--seeds", "0",
         "--planner", "greedy", "--planner", "cocap", "--planner", "sequential")  # fmt: skip


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of a small sweep, whose bound of the bottleneck is not proved in time."""
    folder = tmp_path_factory.mktemp("report")
    assert commands.run([*SWEEP, "--out", str(folder)]) == 0
    return folder


def report(folder: Path, page: Path, *options: str) -> int:
    """Exit code of the command."""
    return commands.run(["report", str(folder), "-o", str(page), *options])


@pytest.mark.long
def test_players_are_as_many_as_asked_for(results: Path, tmp_path: Path) -> None:
    """None leaves the section out; everything else stays."""
    page = tmp_path / "report.html"
    assert report(results, page, "--players", "0") == 0
    text = page.read_text(encoding="utf-8")
    assert "<iframe" not in text and ">Plans<" not in text and "Paired differences" in text


@pytest.mark.long
def test_a_report_needs_only_its_folder(
    results: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It may be made from a copy somewhere else, where nobody knows the scenes."""
    copy = shutil.copytree(results, tmp_path / "copy")
    monkeypatch.setattr("cocap_opt.scenarios.SCENES", {})
    assert report(copy, tmp_path / "report.html") == 0
    assert "Parts of the gaps" in (tmp_path / "report.html").read_text(encoding="utf-8")


def played(page: str) -> list[dict[str, Any]]:
    """The data of the players in a page."""
    frames = re.findall(r'srcdoc="([^"]*)"', page)
    found = [re.search(r'id="data">(.*?)</script>', unescape(frame), re.S) for frame in frames]
    return [json.loads(data[1]) for data in found if data]


@pytest.mark.long
@pytest.mark.parametrize("is_large", [False, True])
def test_players_have_the_bounds_that_the_report_tells(
    is_large: bool, results: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All plans do, the best ones and those that break rules too, and in very large scenes."""
    monkeypatch.setattr(explaining, "is_too_large", lambda _: is_large)
    assert report(results, tmp_path / "report.html") == 0
    rows = {(row.scene, row.planner): row for row in load_results(results)}
    players = played((tmp_path / "report.html").read_text(encoding="utf-8"))
    assert len(players) == 2
    for data in players:
        for plan in data["plans"]:
            told, gap = rows[data["name"], plan["title"]], plan["gap"]
            assert gap["bound"] == pytest.approx(told.bound)
            assert gap["optimal"] == told.is_optimal
            assert told.gap is None or gap["total"] == pytest.approx(told.gap, abs=1e-9)
            assert bool(gap["losses"]) != is_large
    assert any(plan["gap"]["optimal"] for data in players for plan in data["plans"])


def _without_results(folder: Path) -> str:
    (folder / "results.csv").unlink()
    return "results.csv: no such file"


def _without_rows(folder: Path) -> str:
    path = folder / "results.csv"
    path.write_text(path.read_text().splitlines()[0] + "\n")
    return "has no results yet"


def _of_another_run(folder: Path) -> str:
    name = folder / "plans" / "bottleneck-0-greedy.json"
    shutil.copy(folder / "plans" / "bottleneck-0-sequential.json", name)
    return "belongs to another run"


@pytest.mark.slow
@pytest.mark.parametrize("spoil", [_without_results, _without_rows, _of_another_run])
def test_a_folder_that_cannot_be_told_of_is_refused(
    spoil: Callable[[Path], str],
    results: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """In one line, and no page is written."""
    copy, page = shutil.copytree(results, tmp_path / "copy"), tmp_path / "report.html"
    words = spoil(copy)
    capsys.readouterr()
    assert report(copy, page) == 2
    err = capsys.readouterr().err
    assert words in err and len(err.splitlines()) == 1
    assert not page.exists()


@pytest.mark.long
def test_names_cannot_break_a_report(results: Path, tmp_path: Path) -> None:
    """A scene's name is text, whatever it looks like, and is marked as such once."""
    evil, copy = "</td><script>x\x1b[2J</script>", shutil.copytree(results, tmp_path / "copy")
    path = copy / "results.csv"
    for scene in copy.glob("scenes/*.json"):  # where names are no part of the digest
        scene.write_text(scene.read_text().replace('"bottleneck"', '"R&D"'))
    path.write_text(path.read_text().replace("tiny-queue,", f'"{evil}",'))
    page = tmp_path / "report.html"
    assert report(copy, page) == 0
    text = page.read_text(encoding="utf-8")
    assert evil not in text and "<script>x" not in text and "\x1b" not in text
    captions = [part.split("</figcaption>")[0] for part in text.split("<figcaption>")]
    assert any("R&amp;D, seed" in words for words in captions[1:])
    assert not any("amp;amp;" in words for words in captions[1:])


def test_the_seed_with_most_to_avoid_is_shown() -> None:
    """Most conflicts first, then rewards that differ most; the pair is the worst and the best."""
    rows = [
        row("greedy", 0, 99.0), row("cocap", 0, 60.0), row("best", 0, 100.0),
        row("greedy", 1, 120.0, conflicts=2), row("cocap", 1, 99.0), row("best", 1, 100.0),
        row("greedy", 2, 120.0, conflicts=2), row("cocap", 2, 98.0), row("best", 2, 100.0),
    ]  # fmt: skip
    seed, some = _telling_seed(rows)
    assert seed == 2 and [r.planner for r in _telling_pair(some)] == ["greedy", "best"]
    alone = row("greedy", 3, 120.0, conflicts=9)
    assert _telling_seed([*rows, alone])[0] == 2  # nothing to compare it with
    assert _telling_seed([alone])[0] == 3
    seed, some = _telling_seed(rows[:3])
    assert seed == 0 and [r.planner for r in _telling_pair(some)] == ["cocap", "best"]
    assert _telling_pair([row("cocap", 0, None)]) == []


def test_limitations_are_those_of_the_results() -> None:
    """What is open, lost or failed is said with its number; what is not is not."""
    run = RunFile(
        code="", runs=[CommandRun.now(["a"], [0], who) for who in ("this process", "2 processes")]
    )  # fmt: skip
    fine = [row("cocap", seed, 99.0) for seed in range(9)]
    assert not any("not proved" in words or "have no plan" in words
                   for words in limitations(fine, run, {}))  # fmt: skip
    assert any("by this process, 2 processes" in words for words in limitations(fine, run, {}))
    rows = [*fine, row("cocap", 9, 90.0, bound_reason="stopped"),
            row("cocap", 10, None, reason="died")]  # fmt: skip
    text = "\n".join(limitations(rows, run, {}))
    assert "1 of 11 bounds are not proved" in text
    assert "1 of 11 runs of cocap have no plan" in text and "1 of 11 runs failed" in text
    assert "one seed" in "\n".join(limitations([row("cocap", 0, 99.0)], run, {}))


def test_limitations_say_which_crossings_are_conflicts() -> None:
    """By each scene's rules: cells and steps alone, or a separation at every moment, or none."""
    run = RunFile(code="", runs=[CommandRun.now(["a"], [0], "this process")])
    papers, apart = CollisionRules(), CollisionRules(separation=2.0)
    rules = {"a": papers, "b": apart, "c": papers, "d": NO_RULES}
    told = {words[:8]: words for words in limitations([row("cocap", 0, 99.0)], run, rules)}
    assert "vertex+swap" in told["In a, c,"] and "are not in conflict" in told["In a, c,"]
    assert "separation 2 m at every moment" in told["In b, dr"]
    assert "not in conflict" not in told["In b, dr"]
    assert "no rule" in told["In d, no"]
    only = "\n".join(limitations([row("cocap", 0, 99.0)], run, {"b": apart}))
    assert "diagonally" not in only and "are in conflict, too" in only


@pytest.mark.parametrize(
    ("rules", "words"),
    [(CollisionRules(), "diagonally"), (CollisionRules(separation=0.9), "at every moment")],
    ids=str,
)
def test_the_rules_of_a_report_are_read_from_its_scenes(
    tmp_path: Path, rules: CollisionRules, words: str
) -> None:
    """The page says of a scene's own file, with a separation and without, which rule it has."""
    found = row("cocap", 0, 99.0)
    scene = tmp_path / Paths(found).scene
    scene.parent.mkdir(parents=True, exist_ok=True)
    co.save(scene, co.load("tiny-queue").replace(rules=rules))
    run = RunFile(code="", runs=[CommandRun.now(["a"], [0], "this process")])
    assert _rules(tmp_path, [found]) == {found.scene: rules}
    assert any(words in told for told in limitations([found], run, _rules(tmp_path, [found])))
