from pathlib import Path

import pytest
from hypothesis import given
from strategies import examples, problems

from cocap_opt.check import check
from cocap_opt.planners import PLANNERS
from cocap_opt.problem import Problem
from cocap_opt.stop import never
from experiments.paper import answers, reproduction
from experiments.paper.__main__ import main
from experiments.paper.giving_way import encounters, most_generous, own_reward
from experiments.statistics import Mean, mean
from scenarios import load_scene


def interval(low: float, high: float) -> Mean:
    """A mean with this interval."""
    return Mean((low + high) / 2, low, high, 1.0, 5)


def test_claims_are_judged_by_the_whole_interval() -> None:
    """Only where the whole interval is on one side of the line something is said."""
    assert answers.verdict_below(interval(0.1, 0.9), 1.0) == answers.HOLDS
    assert answers.verdict_below(interval(1.1, 1.9), 1.0) == answers.FAILS
    assert answers.verdict_below(interval(0.5, 1.5), 1.0) == answers.OPEN
    assert answers.verdict_above(interval(0.1, 0.9), 0.0) == answers.HOLDS
    assert answers.verdict_above(interval(-0.9, -0.1), 0.0) == answers.FAILS
    assert answers.verdict_above(interval(-0.1, 0.1), 0.0) == answers.OPEN
    assert answers.verdict_below(mean([0.1]), 1.0) == answers.OPEN  # one seed settles nothing


@examples(20)
@given(problems())
def test_what_drones_have_alone_is_at_least_what_they_add(problem: Problem) -> None:
    """J of a team is at most the sum of what its drones have alone, as J is submodular."""
    found = PLANNERS["greedy"](problem, never)
    if found.plan is None or problem.meshes:
        return
    alone = [own_reward(problem, robot, found.plan) for robot in range(len(problem.robots))]
    assert check(problem, found.plan).reward <= sum(alone) * (1 + 1e-9) + 1e-9


def test_the_earlier_drone_gives_way_where_that_is_better() -> None:
    """Corridor, seed 2: sequential planning sends the later drone elsewhere, CoCap the earlier."""
    problem = load_scene("corridor", 2)
    plans = {
        name: PLANNERS[name](problem, never).plan for name in ("greedy", "sequential", "cocap")
    }
    free, sequential, cocap = plans["greedy"], plans["sequential"], plans["cocap"]
    assert free is not None and sequential is not None and cocap is not None
    (late,) = encounters(problem, 2, free, sequential)
    (early,) = encounters(problem, 2, free, cocap)
    assert late.moved == (False, True) and not late.earlier_gives_way
    assert early.moved == (True, False) and early.earlier_gives_way
    assert early.given_up[0] > 0.05 and early.given_up[1] == 0.0
    assert early.team > late.team
    assert most_generous([late, early]) is early
    assert most_generous([late]) is None


def test_one_command_makes_the_page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Tables, figures and answers are there, and a second run computes nothing."""
    monkeypatch.setattr(reproduction, "SCENES", ("corridor",))
    monkeypatch.setattr(reproduction, "FIELD", {"actors": 1, "cells": 15, "steps": 2})
    arguments = ["--out", str(tmp_path), "--seeds", "1-2", "--robots", "1,2"]
    arguments += ["--scaling-seeds", "0", "--time-limit", "20"]
    assert main(arguments) == 0
    page = (tmp_path / "paper.md").read_text(encoding="utf-8")
    for words in ("Does CoCap come close", "3981", "Who gives way", "drone 0", "field, 2 robots"):
        assert words in page
    for name in ("curves.png", "giving-way.png", "scaling.png"):
        assert name in page and (tmp_path / name).read_bytes().startswith(b"\x89PNG")
    cells = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("cells/*.json")}
    assert len(cells) == 2 * 5 + 2 * 5
    assert main(arguments) == 0
    assert {path: path.stat().st_mtime_ns for path in tmp_path.rglob("cells/*.json")} == cells


@pytest.mark.parametrize(
    ("option", "value"), [("--time-limit", "0"), ("--robots", "0"), ("--seeds", "x")]
)
def test_wrong_options_are_named(
    option: str, value: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """One line and exit code 2."""
    assert main(["--out", str(tmp_path), option, value]) == 2
    assert option in capsys.readouterr().err
