"""Paired tests over scenes, their correction, and performance profiles."""

import csv
import math
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import result_rows
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats
from strategies import examples
from test_cli import Run

from cocap_opt.experiments.report.profiles import profiles_figure
from cocap_opt.experiments.tables.comparison import (
    SECONDS,
    J,
    holm,
    paired_tests,
    profiles,
    signed_rank,
)
from cocap_opt.experiments.tables.comparison_tables import comparison_tables, too_few_scenes
from cocap_opt.experiments.tables.rows import GapRow

WORTH = st.one_of(st.sampled_from([0.0, 0.0, 0.5, -0.5]), st.floats(-1, 1, width=16))


@examples(60)
@given(st.lists(WORTH, min_size=2, max_size=9))
def test_signed_ranks_are_scipys(differences: list[float]) -> None:
    """All signs are gone through, as SciPy does if asked to, ties and zeros (Pratt) included."""
    p = signed_rank(differences)
    assert 0 < p <= 1
    if not any(differences):
        assert p == 1
        return
    all_signs = stats.PermutationMethod(n_resamples=10_000)
    expected = stats.wilcoxon(differences, zero_method="pratt", method=all_signs).pvalue
    assert p == pytest.approx(expected, rel=1e-9)
    assert signed_rank([-d for d in differences]) == p


def test_signed_ranks_of_many_scenes_are_drawn() -> None:
    """With more scenes signs are drawn, the same each time, and p is about the exact one."""
    random = np.random.default_rng(1)
    differences = (random.normal(0.4, 1.0, 25)).tolist()
    p = signed_rank(differences)
    assert p == signed_rank(differences)
    assert p == pytest.approx(stats.wilcoxon(differences).pvalue, abs=0.02)
    assert 0 < signed_rank([1.0 + k for k in range(40)]) < 1e-3


def test_six_scenes_are_the_fewest_that_can_say_anything() -> None:
    """Where one planner is better on all scenes, p is 2 / 2^n: 0.03 of six, 0.06 of five."""
    assert [signed_rank([0.1 * (k + 1) for k in range(n)]) for n in (5, 6)] == [1 / 16, 1 / 32]
    rows = [result_rows.row("greedy", 0, 50.0, scene=f"scene {n}") for n in range(6)]
    assert too_few_scenes(rows) == ""
    assert "5 scenes" in too_few_scenes(rows[:5]) and "p < 0.05" in too_few_scenes(rows[:5])


def test_holm_is_the_textbooks() -> None:
    """The least p times the number of tests, the next times one less, never falling, at most 1."""
    assert holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx([0.03, 0.06, 0.06, 0.02])
    assert holm([0.5, 0.9]) == [1.0, 1.0]
    assert holm([]) == []


@given(st.lists(st.floats(0, 1), min_size=1, max_size=8))
def test_holm_never_says_more_than_the_tests(p: list[float]) -> None:
    """A corrected p is no less than p, no more than Bonferroni's, and keeps the order."""
    corrected = holm(p)
    for before, after in zip(p, corrected, strict=True):
        assert before <= after <= max(before, min(1.0, len(p) * before))
    order = np.argsort(p, kind="stable")
    assert all(a <= b for a, b in pairwise(np.array(corrected)[order].tolist()))


def sweep(**values: list[list[float | None]]) -> list[GapRow]:
    """Rows of planners by J on each seed of each scene; None: a plan that breaks the rules."""
    return [
        row(planner, seed, reward, f"scene {n}")
        for planner, scenes in values.items()
        for n, seeds in enumerate(scenes)
        for seed, reward in enumerate(seeds)
    ]


def row(planner: str, seed: int, reward: float | None, scene: str, **more: Any) -> GapRow:
    """A row of a plan with J, or, None, of one that breaks the rules."""
    broken = {"conflicts": 1, "gap": None} if reward is None else {}
    return result_rows.row(planner, seed, reward or 90.0, scene=scene, **(broken | more))


def test_scenes_are_the_sample_and_not_seeds() -> None:
    """Seeds of a scene are averaged: many seeds of one scene are no more evidence than one."""
    few = paired_tests(sweep(a=[[90.0], [80.0]], b=[[99.0], [88.0]]))[0]
    many = paired_tests(sweep(a=[[90.0] * 30, [80.0]], b=[[99.0] * 30, [88.0]]))[0]
    assert few == many
    assert (few.scenes, few.below, few.p) == (2, 2, 0.5)
    assert few.median == pytest.approx(-1 / 11)


def test_missing_and_colliding_plans_are_lost() -> None:
    """A plan that breaks the rules counts as J = 0, however much it sees."""
    test = paired_tests(sweep(a=[[90.0], [90.0], [None]], b=[[90.0 + 1e-9], [None], [None]]))[0]
    assert (test.above, test.equal, test.below) == (1, 2, 0)
    seconds = [
        row("a", 0, 90.0, "s", seconds=3.0), row("b", 0, None, "s", seconds=1.0, time_limit=60.0),
    ]  # fmt: skip
    assert paired_tests(seconds)[1].median == pytest.approx((3 - 60) / 60)


def test_each_measure_is_corrected_over_its_own_tests() -> None:
    """Three planners make three tests of J, with one of them two; an absent one makes none."""
    rows = sweep(a=[[n + 90.0] for n in range(7)], b=[[80.0]] * 7, c=[[70.0]] * 7)
    tests = paired_tests(rows)
    assert [test.measure for test in tests] == [J] * 3 + [SECONDS] * 3
    assert [test.p for test in tests[:3]] == [2 / 2**7] * 3
    assert [test.corrected for test in tests[:3]] == [6 / 2**7] * 3
    with_one = paired_tests(rows, "b")
    assert [(test.planner, test.against) for test in with_one[:2]] == [("a", "b"), ("c", "b")]
    assert with_one[0].corrected == 4 / 2**7
    assert paired_tests(rows, "nobody") == []
    assert all(test.p == 1 for test in tests[3:])  # all took a second


def test_profiles_are_dolan_and_mores() -> None:
    """The share of scenes on which the best J is within a factor; one without a plan is never."""
    rows = sweep(a=[[100.0], [50.0], [80.0], [None]], b=[[90.0], [100.0], [80.0], [70.0]])
    a, b = (p for p in profiles(rows) if p.measure == J)
    assert (a.ratios, a.shares) == ((1.0, 2.0), (0.5, 0.75))
    assert b.ratios == (1.0, pytest.approx(10 / 9)) and b.shares == (0.75, 1.0)
    assert [a.share(1.0), a.share(1.999), a.share(2.0), a.share(1e9)] == [0.5, 0.5, 0.75, 0.75]
    assert [p.shares[-1] for p in profiles(rows)[2:]] == [0.75, 1.0]  # time, of those with a plan


def test_profiles_are_of_what_all_were_run_on() -> None:
    """Scenes weigh alike, whatever seeds they have; those without any plan, or missing, are out."""
    rows = sweep(a=[[100.0] * 4, [50.0], [None]], b=[[50.0] * 4, [100.0], [None]])
    rows.append(row("a", 0, 90.0, "only a"))
    for profile in profiles(rows)[:2]:
        assert (profile.ratios, profile.shares) == ((1.0, 2.0), (0.5, 1.0))
    assert profiles(sweep(a=[[None]], b=[[None]])) == []


def test_nobody_sees_anybody() -> None:
    """Where J = 0 is all there is, all plans are the best."""
    rows = [result_rows.row(planner, 0, 0.0, scene="s") for planner in "ab"]
    assert [(p.ratios, p.shares) for p in profiles(rows)[:2]] == [((1.0,), (1.0,))] * 2


def test_tables_name_the_test_and_its_correction() -> None:
    """Whoever reads a table knows by which test p is, and over how many tests it is corrected."""
    rows = sweep(a=[[n + 90.0] for n in range(7)], b=[[80.0]] * 7)
    tables = comparison_tables(rows)
    first, second, third, fourth = tables
    assert first == ("Paired tests of J over scenes (Wilcoxon signed-rank, p by Holm over 1 test)")
    assert tables[first] == [
        {
            "planner": "a", "against": "b", "median difference (%)": "13.978", "higher": "7",
            "equal": "0", "lower": "0", "scenes": "7", "p": "0.0156", "p (Holm)": "0.0156",
        }
    ]  # fmt: skip
    assert "time" in second and "time" in fourth
    assert [shares["the best"] for shares in tables[third]] == ["100", "0"]
    assert tables.markdown() and tables.latex() and tables.html()


def test_the_figure_has_a_staircase_for_each_planner() -> None:
    """Both panels have the same planners in the same colours, and shares of at most 1."""
    figure = profiles_figure(profiles(sweep(a=[[90.0], [50.0]], b=[[80.0], [100.0]])))
    panels = figure.axes
    assert [len(ax.lines) for ax in panels] == [2, 2]
    for first, second in zip(*(ax.lines for ax in panels), strict=True):
        assert first.get_color() == second.get_color()
        assert max(first.get_ydata()) <= 1
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["a", "b"]


@pytest.mark.slow
def test_the_commands_compare(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], caplog: pytest.LogCaptureFixture
) -> None:
    """`table --compare` prints tables or writes CSV; `figure profiles` draws or writes steps."""
    out = tmp_path / "results"
    scenes = ["tiny-queue", "tiny-share", "tiny-turn"]
    planners = ["--planner", "greedy", "--planner", "cocap"]
    assert Run(capsys, "gap", *scenes, *planners, "--out", out).code == 0
    run = Run(capsys, "table", out, "--compare")
    assert "Wilcoxon signed-rank, p by Holm over 1 test" in run.out
    assert "3 scenes: a paired test over fewer than 6 scenes cannot have p < 0.05" in caplog.text
    for name, columns, words in (
        ("tests.csv", "measure,planner,against,scenes,", ("table", "--compare")),
        ("steps.csv", "measure,planner,ratio,share", ("figure", "profiles")),
    ):
        file = tmp_path / name
        command, *more = words
        given = (*more, out) if command == "figure" else (out, *more)
        assert Run(capsys, command, *given, "-o", file).code == 0
        assert file.read_text().startswith(columns)
        rows = list(csv.DictReader(file.read_text().splitlines()))
        assert {r["measure"] for r in rows} == {J, SECONDS}
        assert all(math.isfinite(float(r.get("share", r.get("p_holm")) or "nan")) for r in rows)
    assert Run(capsys, "figure", "profiles", out, "-o", tmp_path / "profiles.svg").code == 0
    page = tmp_path / "report.html"
    assert Run(capsys, "report", out, "-o", page).code == 0
    assert "p by Holm over 1 test" in page.read_text()
    Run(capsys, "report", out, "--scene", "tiny-turn", "-o", page)
    assert "Holm" not in page.read_text()  # of one scene there is nothing to say
    run = Run(capsys, "table", out, "--compare", "--planner", "cocap")
    assert (run.code, run.err.count("\n")) == (2, 1)
    assert "--compare: needs the results of two planners or more" in run.err
    run = Run(capsys, "table", out, "-o", tmp_path / "all.csv")
    assert run.code == 2 and "name a file that ends in" in run.err
