"""Gap tables that compare where drones start, and the study of it."""

import json
import re
from pathlib import Path

import pytest

import cocap_opt as co
from cocap_opt.cli.main import main
from cocap_opt.experiments.lab.studies.starts import optima_of, starts_in_markdown, stored_optima
from cocap_opt.experiments.sweeps.start_choices import CHOICES, DRAWS, StartChoices
from cocap_opt.result import Reason
from cocap_opt.run.options import UsageError


def said(capsys: pytest.CaptureFixture[str], *words: object) -> tuple[int, str, str]:
    """Runs `gap`; returns the exit code, standard output and standard error."""
    with pytest.raises(SystemExit) as caught:
        main(["gap", *map(str, words)])
    out, err = capsys.readouterr()
    return int(caught.value.code or 0), out, err


def test_choices_are_scenes_of_their_own() -> None:
    """Ten random ones, and each other choice once, under names that tell them apart."""
    problem = co.load("tiny-doorway", 0)
    choices = StartChoices.of({("tiny-doorway", 0): problem}, CHOICES)
    assert len(choices.problems) == DRAWS + 3
    names = {(variant.name, seed) for (_, seed), variant in choices.problems.items()}
    assert len(names) == DRAWS + 3
    assert {name for group in choices.groups.values() for name in group} == set(CHOICES)
    assert StartChoices.of({("tiny-doorway", 0): problem}, []).groups == {}
    with pytest.raises(UsageError, match="--starts"):
        StartChoices.of({("tiny-doorway", 0): problem}, ["best"])


def test_a_table_compares_the_choices(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """No set of starts is worth more than the proved optimum from any start."""
    words = ("tiny-doorway", "--planner", "sequential", "--starts", "stated", "--starts", "free")
    code, out, _ = said(capsys, *words, "--out", tmp_path)
    assert code == 0 and "where drones start" in out and "of the best" in out
    code, out, _ = said(capsys, *words, "--out", tmp_path, "--json")
    rows = {row["scene"]: row for row in json.loads(out)["rows"]}
    stated, free = rows["tiny-doorway"], rows["tiny-doorway, free starts"]
    assert free["optimum"] > stated["optimum"] * 1.01
    assert free["bound_reason"] == stated["bound_reason"] == "optimal"


@pytest.mark.long
def test_choices_without_reward_or_plan_are_compared(capsys: pytest.CaptureFixture[str]) -> None:
    """J of 0 is a value; a set of starts of which it is proved that no plan exists is proved."""
    words = ("--planner", "greedy", "--time-limit", 5, "--starts")
    _, out, _ = said(capsys, "tiny-hidden", *words, "free")
    assert re.search(r"free +0.00 +0.00 +yes", out)
    _, out, _ = said(capsys, "tiny-head-on", *words, "random")
    assert re.search(r"best of 10 +[\d.]+ +[\d.]+ +yes", out)


def test_the_page_has_the_stored_optima() -> None:
    """Shares are of the bound from any start, which no set exceeds; most are proved."""
    rows = stored_optima()
    bounds = {(row.scene, row.seed): row.bound for row in rows if row.starts == "free"}
    assert all(row.reward <= bounds[row.scene, row.seed] * (1 + 1e-9) for row in rows)
    table = starts_in_markdown().splitlines()
    assert [line.split("|")[1].strip() for line in table[2:]] == [
        "corridor",
        "bottleneck",
        "bridge",
    ]
    stated = [row for row in rows if (row.scene, row.starts) == ("corridor", "stated")]
    of = [row.reward / bounds[row.scene, row.seed] for row in stated]
    assert f"{100 * sum(of) / len(of):.1f} %" in table[2]


def test_wrong_choices_are_one_line(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """Starts that there are not, and plans beside other starts."""
    code, _, err = said(capsys, "tiny-doorway", "--starts", "best")
    assert code == 2 and err.count("\n") == 1 and "stated, free, random, greedy" in err
    code, _, err = said(
        capsys, "tiny-doorway", "--starts", "free", "--plan", tmp_path / "plan.json"
    )
    assert code == 2 and err.count("\n") == 1 and "omit --starts" in err


@pytest.mark.slow
def test_the_study_proves_that_no_set_beats_all() -> None:
    """Each row has a bound above its J, and none is above that of free starts."""
    optima = list(optima_of("tiny-doorway", 0, co.load("tiny-doorway", 0), 20.0))
    (free,) = [row for row in optima if row.starts == "free"]
    assert free.reason == Reason.OPTIMAL
    assert all(row.reward <= row.bound * (1 + 1e-9) for row in optima)
    assert max(row.reward for row in optima) <= free.bound * (1 + 1e-9)
