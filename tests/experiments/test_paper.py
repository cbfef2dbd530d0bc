from collections.abc import Sequence
from pathlib import Path

import pytest
from hypothesis import given
from result_rows import row
from strategies import examples, problems
from studies import study

from cocap_opt.experiments.results.rows import Row
from cocap_opt.experiments.results.statistics import Mean
from cocap_opt.experiments.studies.paper import answers, reproduction
from cocap_opt.experiments.studies.paper.giving_way import Encounter, _own_reward
from cocap_opt.planners import PLANNERS
from cocap_opt.problem import Plan, Problem
from cocap_opt.referee import check
from cocap_opt.scenarios import load_scene
from cocap_opt.stop import never


def interval(low: float, high: float) -> Mean:
    """A mean with this interval."""
    return Mean((low + high) / 2, low, high, 1.0, 5)


def test_claims_are_judged_by_the_whole_interval() -> None:
    """Only where the whole interval is on one side of the line something is said."""
    assert answers._verdict_below(interval(0.1, 0.9), 1.0) == answers.HOLDS
    assert answers._verdict_below(interval(1.1, 1.9), 1.0) == answers.FAILS
    assert answers._verdict_below(interval(0.5, 1.5), 1.0) == answers.OPEN
    assert answers._verdict_above(interval(0.1, 0.9), 0.0) == answers.HOLDS
    assert answers._verdict_above(interval(-0.9, -0.1), 0.0) == answers.FAILS
    assert answers._verdict_above(interval(-0.1, 0.1), 0.0) == answers.OPEN
    assert answers._verdict_below(Mean.of([0.1]), 1.0) == answers.OPEN  # one seed settles nothing


def closeness(rows: Sequence[Row]) -> str:
    """The answer to the question if CoCap comes close to unconstrained performance."""
    return answers.SceneAnswers("a", rows).closeness()


FINE = {"bound_free": 110.0, "optimum_free": 110.0, "gap_free": 0.002}


def test_what_is_open_is_not_judged() -> None:
    """A gap to a bound that may be too high, or a mean over survivors, refutes nothing."""
    near = [row("cocap", seed, 99.0, **FINE) for seed in range(5)]
    assert "performance holds" in closeness(near)
    lost = [*near, row("cocap", 9, None, gap_free=None)]
    assert "is left open by so many seeds, as it has no plan on 1 of 6" in (closeness(lost))
    far = {"gap_free": 0.05, "bound_free": 104.2}
    stopped = [row("cocap", s, 99.0, **far, optimum_free=99.5) for s in range(5)]
    assert "is left open" in closeness(stopped)
    proved = [row("cocap", s, 99.0, **far, optimum_free=104.2) for s in range(5)]
    assert "does not hold" in closeness(proved)
    assert "cannot be tried" in closeness(lost[-1:])


def test_low_levels_are_compared_with_the_coverage_that_one_needs() -> None:
    """Value iteration's time has the coverage of all states in it, on the same seeds."""
    rows = [row("cocap", s, 99.0, seconds=1.0 + 0.1 * s) for s in range(3)]
    rows += [row("cocap-vs", s, 90.0, seconds=2.0 + 0.1 * s) for s in range(3)]
    assert "view search is the faster one holds" in answers.SceneAnswers("a", rows).times(9.0)
    assert "does not hold" in answers.SceneAnswers("a", rows).times(0.1)
    assert "is left open" in answers.SceneAnswers("a", rows).times(1.0)  # equal on every seed
    assert "not both" in answers.SceneAnswers("a", rows[:3]).times(1.0)


def test_sequential_planning_is_judged_with_and_without_collisions() -> None:
    """Seeds are told apart by the conflicts of the greedy plan; failures are counted."""
    rows = [row("greedy", 0, 120.0, conflicts=2), row("greedy", 1, 99.0), row("greedy", 2, 99.0)]
    rows += [row("sequential", 0, 90.0), row("sequential", 1, 98.0), row("sequential", 2, None)]
    words = answers.SceneAnswers("a", rows).sequential_failures()
    assert "10.00 % on the 1 seeds with collisions" in words
    assert "2.00 % on the 1 seeds without collisions" in words
    assert "no plan on 1 of 3 seeds" in words


@pytest.mark.slow
def test_who_collides_with_a_third_is_no_encounter() -> None:
    """Bottleneck, seed 0: of three that collide nobody can tell who makes way for whom."""
    problem = load_scene("bottleneck", 0)
    free, plan = (PLANNERS[name](problem, never).plan for name in ("greedy", "cocap"))
    assert free is not None and plan is not None
    pairs = {conflict.robots for conflict in free.conflicts(problem)}
    assert pairs == {(1, 3), (0, 2)}  # two encounters, as they share no drone
    assert {e.robots for e in Encounter.all_of(problem, 0, free, plan)} == pairs
    three = free.paths[:1] * 3 + free.paths[3:]
    assert Encounter.all_of(problem, 0, Plan(paths=three), plan) == []


def test_every_seed_counts_in_the_scaling_figure() -> None:
    """The unconstrained plans count with their conflicts, against the bound that they have."""
    rows = [row("greedy", s, 104.5, conflicts=3 * (s > 0), robots=2, **FINE) for s in range(4)]
    rows += [row("cocap", 0, 99.0, robots=2, **FINE), row("cocap", 1, None, robots=2, **FINE)]
    assert reproduction._points(rows, [2, 4]) == {"greedy": [(2, 1.0, pytest.approx(95.0))]}


@examples(20)
@given(problems())
def test_what_drones_have_alone_is_at_least_what_they_add(problem: Problem) -> None:
    """J of a team is at most the sum of what its drones have alone, as J is submodular."""
    found = PLANNERS["greedy"](problem, never)
    if found.plan is None or problem.meshes:
        return
    alone = [_own_reward(problem, robot, found.plan) for robot in range(len(problem.robots))]
    assert check(problem, found.plan).reward <= sum(alone) * (1 + 1e-9) + 1e-9


def test_the_earlier_drone_gives_way_where_that_is_better() -> None:
    """Corridor, seed 2: sequential planning sends the later drone elsewhere, CoCap the earlier."""
    problem = load_scene("corridor", 2)
    plans = {
        name: PLANNERS[name](problem, never).plan for name in ("greedy", "sequential", "cocap")
    }
    free, sequential, cocap = plans["greedy"], plans["sequential"], plans["cocap"]
    assert free is not None and sequential is not None and cocap is not None
    (late,) = Encounter.all_of(problem, 2, free, sequential)
    (early,) = Encounter.all_of(problem, 2, free, cocap)
    assert late.moved == (False, True) and not late.earlier_gives_way
    assert early.moved == (True, False) and early.earlier_gives_way
    assert early.given_up[0] > 0.05 and early.given_up[1] == 0.0
    assert early.team > late.team
    assert Encounter.most_generous([late, early]) is early
    assert Encounter.most_generous([late]) is None


@pytest.mark.slow
def test_one_command_makes_the_page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Tables, figures and answers are there, and a second run computes nothing."""
    monkeypatch.setattr(reproduction, "SCENES", ("corridor",))
    monkeypatch.setattr(reproduction, "FIELD", {"actors": 1, "cells": 15, "steps": 2})
    arguments = ["paper", "--out", str(tmp_path), "--seeds", "1-2", "--robots", "1,2"]
    arguments += ["--scaling-seeds", "0", "--time-limit", "20"]
    assert study(*arguments) == 0
    page = (tmp_path / "paper.md").read_text(encoding="utf-8")
    for words in ("Does CoCap come close", "3981", "Who gives way", "drone 0", "field, 2 drones"):
        assert words in page
    for name in ("curves.png", "giving-way.png", "scaling.png"):
        assert name in page and (tmp_path / name).read_bytes().startswith(b"\x89PNG")
    cells = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("cells/*.json")}
    assert len(cells) == 2 * 5 + 2 * 5
    assert study(*arguments) == 0
    assert {path: path.stat().st_mtime_ns for path in tmp_path.rglob("cells/*.json")} == cells


@pytest.mark.parametrize(
    ("option", "value"),
    [
        ("--time-limit", "0"), ("--robots", "0"), ("--seeds", "x"), ("--workers", "0"),
        ("--workers", "1000000"),
    ],
)  # fmt: skip
def test_wrong_options_are_named(
    option: str, value: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """One line and exit code 2."""
    assert study("paper", "--out", tmp_path, option, value) == 2
    assert option in capsys.readouterr().err
