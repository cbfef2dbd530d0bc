import math
import re
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from statistics import fmean
from typing import Any

import numpy as np
import pytest
from hypothesis import given, reject
from pool import problems
from result_rows import row
from strategies import examples
from studies import study

from cocap_opt.experiments.lab.results import STORED, Results
from cocap_opt.experiments.lab.studies.paper import (
    ablation,
    answers,
    conditions,
    measured,
    reproduction,
)
from cocap_opt.experiments.lab.studies.paper.conditions import Corridor, CorridorSearch, Trial
from cocap_opt.experiments.lab.studies.paper.giving_way import Encounter, _own_reward
from cocap_opt.experiments.lab.studies.paper.page import Page
from cocap_opt.experiments.lab.studies.paper.planner_table import (
    planner_table,
)
from cocap_opt.experiments.tables.rows import GapRow
from cocap_opt.experiments.tables.statistics import Mean
from cocap_opt.files.documents import FileError
from cocap_opt.model import compiled
from cocap_opt.output.files import save_csv
from cocap_opt.planners import PLANNERS, RECOMMENDED
from cocap_opt.problem import Plan, Problem
from cocap_opt.referee import check
from cocap_opt.run.engine import run
from cocap_opt.scenarios import load_scene
from cocap_opt.stop import never

COMPARED = ("sequential", "sequential-rounds", "cocap", "cocap-vs", "cocap-lns")


def interval(low: float, high: float) -> Mean:
    """A mean with this interval."""
    return Mean((low + high) / 2, low, high, 1.0, 5)


def test_claims_are_judged_by_the_whole_interval() -> None:
    """Only where the whole interval is on one side of the line something is said."""
    assert answers.ClaimAnswer.below(interval(0.1, 0.9), 1.0) == answers.HOLDS
    assert answers.ClaimAnswer.below(interval(1.1, 1.9), 1.0) == answers.FAILS
    assert answers.ClaimAnswer.below(interval(0.5, 1.5), 1.0) == answers.OPEN
    assert answers.ClaimAnswer.above(interval(0.1, 0.9), 0.0) == answers.HOLDS
    assert answers.ClaimAnswer.above(interval(-0.9, -0.1), 0.0) == answers.FAILS
    assert answers.ClaimAnswer.above(interval(-0.1, 0.1), 0.0) == answers.OPEN
    one_seed = Mean.of([0.1])  # which settles nothing
    assert answers.ClaimAnswer.below(one_seed, 1.0) == answers.OPEN


def closeness(rows: Sequence[GapRow]) -> str:
    """The answer to the question if CoCap comes close to unconstrained performance."""
    return answers.SceneAnswers("a", rows).closeness().words


FINE = {"bound_free": 110.0, "optimum_free": 110.0, "gap_free": 0.002}


def test_what_is_open_is_not_judged() -> None:
    """A gap to a bound that may be too high, or a mean over survivors, refutes nothing."""
    near = [row("cocap", seed, 99.0, **FINE) for seed in range(5)]
    assert "Claim confirmed: it comes within 1 % of unconstrained" in closeness(near)
    lost = [*near, row("cocap", 9, None, gap_free=None)]
    assert "Inconclusive, as it has no plan on 1 of 6 seeds: it comes" in closeness(lost)
    far = {"gap_free": 0.05, "bound_free": 104.2}
    stopped = [row("cocap", s, 99.0, **far, optimum_free=99.5) for s in range(5)]
    assert "Inconclusive with 5 seeds: it comes" in closeness(stopped)
    proved = [row("cocap", s, 99.0, **far, optimum_free=104.2) for s in range(5)]
    assert "Claim refuted: it comes" in closeness(proved)
    assert "cannot be tested" in closeness(lost[-1:])


def test_stopped_runs_are_told_apart_from_those_that_ended() -> None:
    """What a limit stopped has the plan of another planner, and says little of CoCap's own."""
    rows = [row("cocap", s, 99.0, **FINE) for s in range(3)]
    rows += [row("cocap", s, 90.0, limit="time", **FINE | {"gap_free": 0.1}) for s in (3, 4)]
    rows += [row("sequential", s, 90.0) for s in range(5)]
    said = answers.SceneAnswers("a", rows)
    assert "0.20 % on the 3 seeds on which it ended, and 10.00 % on the 2" in closeness(rows)
    assert "on 2 of 5 seeds, where its plan is that of sequential" in said.stopped().words
    assert "10.00 % on the 3 seeds on which it ended, and 0.00 %" in said.against_sequential().words
    assert [one.stopped for one in ablation.Effect.all_of(rows, ablation.TREE_ALONE)] == [2, 2]
    better = [*rows[:4], row("cocap", 4, 95.0, limit="time", **FINE), *rows[5:]]
    assert "on 1 of which its plan is" in closeness(better)
    assert "That is" not in closeness(rows[:3])
    assert "stopped it on all of these seeds, where its plan is that" in closeness(rows[3:])


def test_low_levels_are_compared_with_the_coverage_that_one_needs() -> None:
    """Value iteration's time has the coverage of all states in it, on the same seeds."""

    def times(coverage: float, count: int = 5) -> answers.ClaimAnswer:
        own = {"coverage_seconds": coverage}
        rows = [row("cocap", s, 99.0, seconds=1.0 + 0.1 * s, **own) for s in range(5)]
        rows += [row("cocap-vs", s, 90.0, seconds=2.0 + 0.1 * s, **own) for s in range(count)]
        return answers.SceneAnswers("a", rows).times()

    for coverage, verdict in ((9.0, answers.HOLDS), (0.1, answers.FAILS), (1.0, answers.OPEN)):
        found = times(coverage)
        assert found.verdict == verdict
        seeds = " with 5 seeds" if verdict == answers.OPEN else ""
        assert f"{verdict}{seeds}: view search is the faster one." in found.words
    assert "are needed" in times(1.0, 0).words


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
        reject()
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
    monkeypatch.setattr(conditions, "_tried", lambda *values: trial(*values, gain=1.0))
    some = {name: PLANNERS[name] for name in ("greedy", *COMPARED)}
    monkeypatch.setattr(reproduction, "PLANNERS", some)
    arguments = ["paper", "--out", str(tmp_path), "--seeds", "2", "--robots", "1"]
    arguments += ["--scaling-seeds", "0", "--time-limit", "20", "--corridors", "1"]
    assert study(*arguments) == 0
    page = (tmp_path / "paper.md").read_text(encoding="utf-8")
    for words in ("comes within 1 %", "3981", "Who gives way", "drone 0", "field, 1 drones"):
        assert words in page
    for name in ("curves", "giving-way", "scaling", "ablation", "conditions"):
        picture = (tmp_path / f"{name}.png").read_bytes()
        assert f"{name}.png" in page and picture.startswith(b"\x89PNG")
    kept = [*tmp_path.rglob("cells/*.json"), tmp_path / "conditions.csv"]
    times = {path: path.stat().st_mtime_ns for path in kept}
    assert len(kept) == (len(some) + 1) + (5 + 1) + 1
    measured = (tmp_path / "measured.csv").read_bytes()
    monkeypatch.setattr(Results, "draw", lambda *figure: None)
    assert study(*arguments) == 0
    assert {path: path.stat().st_mtime_ns for path in times} == times
    assert (tmp_path / "measured.csv").read_bytes() == measured


@pytest.mark.parametrize(
    ("option", "value"),
    [
        ("--time-limit", "0"), ("--bound-limit", "0"), ("--corridors", "-1"), ("--robots", "0"),
        ("--seeds", "x"), ("--workers", "0"), ("--workers", "1000000"),
    ],
)  # fmt: skip
def test_wrong_options_are_named(
    option: str, value: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """One line and exit code 2."""
    assert study("paper", "--out", tmp_path, option, value) == 2
    assert option in capsys.readouterr().err


# -- the ablation ---------------------------------------------------------------------------


def test_parts_are_measured_in_pairs() -> None:
    """Only seeds count on which both have a plan; scenes weigh alike, whatever their seeds."""
    rows = [row("cocap", s, 99.0, scene="a") for s in range(6)]
    rows += [row("sequential", s, 98.0 - s / 2, scene="a") for s in range(5)]
    rows += [row("cocap", s, 97.0, scene="b") for s in range(5)]
    rows += [row("sequential", s, 98.0, scene="b") for s in range(5)]
    first, second, both = ablation.Effect.all_of(rows, ablation.TREE_ALONE)
    assert first.mean is not None and second.mean is not None and both.mean is not None
    assert (first.mean.value, first.lost) == (pytest.approx(2.0), 1)
    assert (second.mean.low, second.mean.high) == (pytest.approx(-1.0), pytest.approx(-1.0))
    assert both.mean.value == pytest.approx(0.5)
    assert first.answer().verdict == answers.HOLDS and second.answer().verdict == answers.FAILS
    assert both.record["better"] == both.record["worse"] == "5"


def test_what_changes_next_to_nothing_is_said_to_be_as_good() -> None:
    """A part that adds less than a tenth of a percent either way speaks against it."""
    for step, verdict in ((0.01, answers.FAILS), (1.0, answers.OPEN)):
        rows = [row("sequential", s, 98.0) for s in range(6)]
        rows += [row("cocap", s, 98.0 + step * (-1) ** s) for s in range(6)]
        found = ablation.Effect.over_all(rows, ablation.TREE_ALONE).answer()
        assert found.verdict == verdict
        assert ("planning is as good without it" in found.words) == (verdict == answers.FAILS)


def test_compositions_obey_the_rules_and_lose_nothing() -> None:
    """Rounds after a plan never make it worse."""
    problem = load_scene("corridor-tight", 1)
    sequential, rounds = (PLANNERS[n](problem) for n in ("sequential", "sequential-rounds"))
    assert sequential.plan is not None
    better = measured.polished(problem, plan=sequential.plan)
    assert better.plan is not None
    assert better.value == pytest.approx(rounds.value)  # no drone can better it
    assert rounds.value > sequential.value
    assert check(problem, better.plan).valid


def test_what_adds_little_is_said_to_add_little() -> None:
    """A part may add something for certain that is next to nothing."""
    rows = [row("sequential", s, 98.0) for s in range(5)]
    rows += [row("cocap", s, 98.02 + 0.01 * s) for s in range(5)]
    found = ablation.Effect.over_all(rows, ablation.TREE_ALONE).answer()
    assert found.verdict == answers.HOLDS and "nearly as good" in found.words


# -- where CoCap gains most -----------------------------------------------------------------


def test_corridors_are_as_their_parameters_say() -> None:
    """Width, length, height, starts, drones, people and steps."""
    corridor = Corridor(2, 7, 4.0, "file", 3, 2, 9)
    problem = corridor.built(5)
    free = np.array(problem.height_map.heights) == 0
    assert [int(free[x].sum()) for x in (8, 9, 15, 16)] == [30, 2, 2, 30]
    assert {robot.motion.layers for robot in problem.robots} == {(4.0,)}
    assert {(robot.start.x, robot.start.y) for robot in problem.robots} == {
        (6, 15),
        (7, 15),
        (8, 15),
    }
    assert (len(problem.robots), len(problem.actors), problem.horizon) == (3, 2, 9)
    others = list(corridor.changed)
    assert len(set(others)) == len(others) and corridor not in others
    for other in others:  # each differs in one parameter
        assert sum(a != b for a, b in zip(corridor, other, strict=True)) == 1


def trial(stage: str, corridor: Corridor, seed: int, gain: float, **more: Any) -> Trial:
    """A trial in which CoCap gains so many percent."""
    values = {
        "sequential": 100.0, "rounds": 105.0, "cocap": 100.0 + gain, "orders": 102.0, "lns": 120.0,
        "bound": 125.0, "limit": "none",
    }  # fmt: skip
    return Trial(stage=stage, corridor=corridor, seed=seed, **(values | more))


def test_the_best_is_judged_by_fresh_seeds(monkeypatch: pytest.MonkeyPatch) -> None:
    """A search climbs, and what it says of the best is from seeds that took no part in it."""

    def tried(stage: str, corridor: Corridor, seed: int) -> Trial:
        fits = 10.0 * (corridor.width == 1) + 10.0 * (corridor.starts == "file")
        luck = 50.0 if stage == conditions.DRAWN and seed == 3 else 0.0
        return trial(stage, corridor, seed, fits + luck)

    monkeypatch.setattr(conditions, "_tried", tried)
    found = CorridorSearch(drawn=12, again=3, seeds=2, rounds=4, fresh=5).trials(
        0, lambda words: None
    )
    fresh = [one for one in found if one.stage == conditions.FRESH]
    assert {one.seed for one in fresh}.isdisjoint(one.seed for one in found if one not in fresh)
    assert fresh[0].corridor.width == 1 and fresh[0].corridor.starts == "file"
    said = conditions.sentences(found)
    assert "20.0 % (20.0 to 20.0) on average over 5 fresh seeds, 13 % or more on 5" in said[1]
    assert "2.0 % (2.0 to 2.0) if it takes the best of ten orders" in said[2]
    gains = "20.0 % at 1 m; 10.0 % at 2 m; 10.0 % at 3 m"
    assert f"Gain when only the width varies: {gains}." in said


def test_trials_are_read_as_they_were_written(tmp_path: Path) -> None:
    """A table of trials has all that is said of them."""
    corridor = Corridor(1, 3, 2.5, "yard", 2, 1, 6)
    unasked = {"orders": None, "lns": None, "bound": None}
    some = [
        trial(conditions.DRAWN, corridor, 0, 1.0, **unasked),
        trial(conditions.DRAWN, corridor, 2, 0.0, **unasked, limit="work"),
        trial(conditions.DRAWN, corridor, 3, 0.0, **unasked, limit="work", fell_back=True),
        trial(conditions.DRAWN, corridor, 4, -math.inf, **unasked),
        trial(conditions.FRESH, corridor, 1, 2.0, orders=-math.inf),
    ]
    save_csv(tmp_path / "c.csv", [one.record for one in some])
    assert conditions.read_trials(tmp_path / "c.csv") == some
    assert conditions.planned(some) == [*some[:3], some[4]]
    words = conditions.sentences(some)
    assert "its tree was stopped after 400 nodes, on 1 of these with" in words[0]
    assert "sequential planning gains nothing if it takes the best of ten" in words[2]
    # Older files have 0 where nothing was asked or found, and do not say what fell back.
    names = [name for name in some[0].record if name != "fell_back"]
    rows = [{name: one.record[name] for name in names} for one in some]
    rows = [
        {n: 0.0 if value in (None, -math.inf) else value for n, value in row.items()}
        for row in rows
    ]
    save_csv(tmp_path / "c.csv", rows)
    older = [one._replace(fell_back=one.seed in (2, 3)) for one in some]
    assert conditions.read_trials(tmp_path / "c.csv") == older
    (tmp_path / "c.csv").write_text("stage,width\ndrawn,1\n")
    with pytest.raises(FileError, match="line 2: is not a trial"):
        conditions.read_trials(tmp_path / "c.csv")


# -- stored results -------------------------------------------------------------------------


@cache
def stored_rows() -> list[GapRow]:
    """The stored rows of the study."""
    return measured.read_rows(STORED / "paper.csv")


@cache
def stored_trials() -> list[Trial]:
    """The stored trials of the search."""
    return conditions.read_trials(STORED / "paper-conditions.csv")


def numbers_of(planner: str, scene: str, column: str) -> dict[int | None, float]:
    """A column of the stored table by seed, of plans that obey the rules."""
    rows = [r for r in stored_rows() if (r.planner, r.scene) == (planner, scene) and r.valid]
    return {r.seed: getattr(r, column) for r in rows if getattr(r, column) is not None}


SCENES = ("corridor", "corridor-tight", "bottleneck", "bottleneck-tight", "passage")


def test_the_page_says_how_many_cameras_see_people() -> None:
    """Its shares are those of the stored rows, of plans that obey the rules."""
    said = Page(stored_rows(), stored_trials()).questions()["How many cameras see people?"]
    assert [sentence.partition(":")[0] for sentence in said] == [*SCENES]
    for scene, sentence in zip(SCENES, said, strict=True):
        for planner in ("sequential", "cocap", RECOMMENDED):
            shares = list(numbers_of(planner, scene, "seen_by_two").values())
            assert shares
            assert re.search(rf"{100 * fmean(shares):.1f} % \([^)]*\) with {planner}\b", sentence)


@pytest.mark.slow
def test_the_stored_page_is_made_of_the_stored_tables(tmp_path: Path) -> None:
    """All of its sentences and tables, made again from the tables, are the stored ones."""
    assert study("paper", "--out", tmp_path, "--stored") == 0
    stored, made = ((folder / "paper.md").read_text("utf-8") for folder in (STORED, tmp_path))
    assert made == stored
    assert {row.scene for row in stored_rows()} == set(SCENES)
    sides = Page(stored_rows(), stored_trials()).verdict()
    assert sum(map(len, sides.values())) == 5 * len(SCENES) + 3  # every claim is on one side


@pytest.mark.parametrize("scene", SCENES)
def test_sentences_have_the_numbers_of_the_table(scene: str) -> None:
    """Each sentence of a scene, computed again by plain means over the stored table."""
    said = answers.SceneAnswers(scene, [r for r in stored_rows() if r.scene == scene])
    ours, theirs = (numbers_of(name, scene, "reward") for name in ("cocap", "sequential"))
    gains = [100 * (ours[s] / theirs[s] - 1) for s in ours.keys() & theirs.keys()]
    found = said.against_sequential()
    assert f"reward is {fmean(gains):.2f} % (" in found.words
    assert f"at most {max(gains):.2f} % (better on {sum(g > 0 for g in gains)}," in found.words
    free = [100 * gap for gap in numbers_of("cocap", scene, "gap_free").values()]
    assert f"CoCap is {fmean(free):.2f} % (" in said.closeness().words
    lost = [
        100 * (1 - value / ours[s]) for s, value in numbers_of("cocap-vs", scene, "reward").items()
    ]
    assert f"reward is {fmean(lost):.2f} % (" in said.kept_by_view_search().words
    views, whole = (numbers_of(name, scene, "views") for name in ("cocap-vs", "cocap"))
    assert f"evaluates {100 * fmean(views[s] / whole[s] for s in views):.1f} % of" in said.views()
    late = sum(r.limit == "time" for r in stored_rows() if (r.planner, r.scene) == ("cocap", scene))
    assert f"stops CoCap on {late or 'none'} of" in said.stopped().words
    for answer in (found, said.closeness(), said.kept_by_view_search()):  # as the interval says
        low, high = map(float, re.findall(r"\((-?[\d.]+) to (-?[\d.]+)\)", answer.words)[0])
        line = 0.0 if answer is found else 1.0
        sides = {low > line: answers.HOLDS, high < line: answers.FAILS}
        if answer is not found:
            sides = {high < line: answers.HOLDS, low > line: answers.FAILS}
        assert answer.verdict == sides.get(True, answers.OPEN)
        assert answer.verdict in answer.words


def test_the_ablation_has_the_numbers_of_the_table() -> None:
    """Each contrast is the mean over scenes of mean differences of J, in % of the bound."""
    for contrast in ablation.CONTRASTS:
        means = []
        for scene in SCENES:
            one, other = (
                numbers_of(n, scene, "reward") for n in (contrast.with_it, contrast.without)
            )
            bound = numbers_of(contrast.with_it, scene, "bound")
            means.append(
                fmean(100 * (one[s] - other[s]) / bound[s] for s in one.keys() & other.keys())
            )
        words = ablation.Effect.over_all(stored_rows(), contrast).answer().words
        gain = fmean(means)
        said = f"{'gains' if gain >= 0 else 'loses'} {abs(gain):.3f} % ("
        assert said in words


def test_the_stored_search_is_what_planners_do() -> None:
    """A trial of two drones and a short one with three, made again, have the same J."""
    assert {t.stage for t in stored_trials()} >= {
        conditions.DRAWN,
        conditions.AGAIN,
        conditions.FRESH,
    }
    small = [t for t in stored_trials() if t.corridor.steps == 6 and t.limit == "none"]
    for count in (2, 3):
        one = next(t for t in small if t.corridor.drones == count)
        again = conditions._tried(conditions.DRAWN, one.corridor, one.seed)
        ours, theirs = ((t.sequential, t.rounds, t.cocap) for t in (one, again))
        assert ours == pytest.approx(theirs, rel=1e-9)


def test_the_stored_rows_are_what_planners_do() -> None:
    """Corridor, seed 0: the same J, from the same views."""
    problem = load_scene("corridor", 0)
    for name in ("sequential", "cocap", "cocap-lns", "cocap-vs"):
        (own,) = [r for r in stored_rows() if (r.scene, r.seed, r.planner) == ("corridor", 0, name)]
        again = run(problem, name)
        assert (again.reward, again.views) == (pytest.approx(own.reward, rel=1e-8), own.views)


def test_views_are_those_of_all_coverage_or_those_evaluated() -> None:
    """View search needs some of the views of which others need all that drones can have."""
    problem = load_scene("tiny-turn", 0)
    model = compiled(problem)
    every = sum(int(model.reachable(c)[problem.first_step :].sum()) for c in model.classes)
    views = {name: run(problem, name).views for name in ("cocap", "cocap-vs")}
    assert views["cocap"] == every
    assert views["cocap-vs"] == PLANNERS["cocap-vs"](problem).statistics["evaluated"] <= every


# -- the table of planners ------------------------------------------------------------------


def test_every_planner_is_in_the_table_of_planners() -> None:
    """It says of what each is made, and of nearly each how long it takes."""
    rows = planner_table(stored_rows())
    assert [row["planner"].split("`")[1] for row in rows] == list(PLANNERS)
    assert all(row["algorithm"] != "-" for row in rows)
    assert sum(row["time"] != "-" for row in rows) >= 15


def test_gaps_of_the_table_of_planners_are_means_of_the_stored_rows() -> None:
    """Of plans that obey the rules; the number of seeds stands behind where it is not all."""
    table = {row["planner"].split("`")[1]: row for row in planner_table(stored_rows())}
    seeds = {row.seed for row in stored_rows()}
    for name, cells in table.items():
        for scene in SCENES:
            gaps = numbers_of(name, scene, "gap")
            shown = cells[scene].replace("\\*", "").split(" ")[0]
            assert shown == (f"{100 * fmean(gaps.values()):.2f}" if gaps else "-")
            assert ("(" in cells[scene]) == (0 < len(gaps) < len(seeds))


def test_a_folder_without_results_makes_no_table(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """One line that names the file, and exit code 2; nothing is printed."""
    for content in (None, "a,b\n", "scene,seed\ncorridor,x\n"):
        if content is not None:
            (tmp_path / "measured.csv").write_text(content)
        assert study("planners", "--paper", tmp_path) == 2
        (line,) = capsys.readouterr().err.splitlines()
        assert str(tmp_path / "measured.csv") in line
