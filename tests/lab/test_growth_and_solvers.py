import dataclasses
import math
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from studies import rows_of, study

from cocap_opt.experiments.lab.benchmark import Benchmark, MethodRun, RunStatus
from cocap_opt.experiments.lab.studies import runs as runs_module
from cocap_opt.experiments.lab.studies import steps as steps_module
from cocap_opt.experiments.lab.studies.growth.points import MEASURES, GrowthPoint, Runs, Sample
from cocap_opt.experiments.lab.studies.runs import Run, _measured, scene
from cocap_opt.experiments.lab.studies.solvers import table as solvers_module
from cocap_opt.experiments.lab.studies.solvers.rows import Metric, RowOptions, Target
from cocap_opt.experiments.lab.studies.steps import METHODS
from cocap_opt.formulations.column_generation.branch_and_price import (
    branch_and_price,
)
from cocap_opt.formulations.result import CertifiedResult, Snapshot
from cocap_opt.output.files import save_csv
from cocap_opt.problem import Problem
from cocap_opt.result import Reason
from cocap_opt.stop import Limit

MADE = [
    Metric("seconds", 1.5, "s", Target.below(2), Target.below(1), note="a, note"),
    Metric("more", 3.0, "x"),
]


def finished(seconds: float, limit: Limit | None = None, bound: float = 100.0) -> Run:
    """A run that found its plan at once and lowered its bound twice."""
    moments = (Snapshot(90.0, 200.0, 1.0), Snapshot(90.0, 100.0, 2.0), Snapshot(99.5, 100.0, 3.0))
    return Run(moments, 99.5, bound, Reason.FINISHED, limit, seconds)


def replaced(monkeypatch: pytest.MonkeyPatch, **rows: Callable[[RowOptions], list[Metric]]) -> None:
    """Have the command know these rows only."""
    monkeypatch.setattr(solvers_module, "ROWS", rows)


def dying(problem: Problem, *arguments: Any) -> CertifiedResult:
    """A method that ends its process."""
    raise SystemExit(3)


@pytest.mark.slow
def test_solvers_command_measures_a_row(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    """A real row runs in processes of its own, is printed, and is in the CSV file."""
    assert study("solvers", "--rows", "corridor", "--seeds", "0", "--out", tmp_path) == 0
    rows = rows_of(tmp_path / "solvers.csv")
    assert {row["row"] for row in rows} == {"corridor"}
    figures = {row["figure"]: row for row in rows}
    assert figures["proved optima"]["value"] == "1"
    assert figures["proved optima"]["met"] == "must"
    assert math.isfinite(float(figures["median seconds to proof"]["value"]))
    printed = capsys.readouterr()
    assert "median seconds to proof" in printed.out and "< 0.3 s" in printed.out
    assert "corridor seed 0: optimal" in printed.err


def test_a_row_that_fails_stops_no_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    """It says why; what was measured before it and after it is there; the exit code is 1."""

    def failing(options: RowOptions) -> list[Metric]:
        raise Run.Error("out of luck")

    replaced(monkeypatch, first=lambda o: MADE, bad=failing, last=lambda o: MADE)
    assert study("solvers", "--out", tmp_path) == 1
    rows = rows_of(tmp_path / "solvers.csv")
    assert [row["row"] for row in rows] == ["first", "first", "bad", "last", "last"]
    assert "out of luck" in rows[2]["note"]
    assert [row["met"] for row in rows[:2]] == ["must", ""]
    assert "out of luck" in capsys.readouterr().out


def test_the_file_is_whole_after_each_row(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An interrupt in a later row leaves the earlier ones, and no other file."""

    def interrupted(options: RowOptions) -> list[Metric]:
        raise KeyboardInterrupt

    replaced(monkeypatch, first=lambda o: MADE, second=interrupted)
    assert study("solvers", "--out", tmp_path) == 130
    assert [row["row"] for row in rows_of(tmp_path / "solvers.csv")] == ["first", "first"]
    assert [path.name for path in tmp_path.iterdir()] == ["solvers.csv"]


def test_rows_measured_alone_join_those_of_the_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A row is replaced where it is measured again; the file keeps the others."""
    replaced(monkeypatch, one=lambda o: MADE, two=lambda o: MADE[:1])
    for names in (["two"], ["one"], ["two"]):
        assert study("solvers", "--rows", *names, "--out", tmp_path) == 0
    assert [r["row"] for r in rows_of(tmp_path / "solvers.csv")] == ["one", "one", "two"]


def test_large_is_skipped_without_its_file(capsys: pytest.CaptureFixture) -> None:
    """The scene is not ours to bring: the row says what it needs, which is no failure."""
    assert study("solvers", "--rows", "large") == 0
    assert "--large FILE" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (["solvers", "--rows", "nonsense"], "nonsense"),
        (["solvers", "--seeds", "a-b"], "--seeds"),
        (["solvers", "--limit", "0"], "--limit"),
        (["growth", "--robots", ""], "--robots"),
        (["growth", "--limit", "nan"], "--limit"),
    ],
)
def test_wrong_options_are_named(
    arguments: list[str], named: str, capsys: pytest.CaptureFixture
) -> None:
    """Wrong input is one line that names it, before any work, and exit code 2."""
    assert study(*arguments) == 2
    assert named in capsys.readouterr().err


@pytest.mark.slow
def test_growth_writes_table_and_figure(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    """Each size on each axis is a row with the exponents, and the figure is a picture.

    What the limit stopped is counted, and left out of the fit.
    """

    def made(build: partial[Problem], method: object, seconds: float) -> Run:
        steps, robots = build.keywords["steps"], build.keywords["robots"]
        return finished(0.1 * steps * robots**2, Limit.TIME if steps == 64 else None)

    monkeypatch.setattr(Run, "of", made)
    arguments = ["growth", "--robots", "2,4,8,16", "--steps", "8,16,32,64", "--cells", "15,30"]
    assert study(*arguments, "--seeds", "0-1", "--out", tmp_path) == 0
    samples = Sample.read(tmp_path / "growth.csv")
    assert [s.axis for s in samples] == ["robots"] * 8 + ["steps"] * 8 + ["cells"] * 4
    points = GrowthPoint.all_of(samples)
    slopes = {axis: MEASURES["seconds"].exponent([p for p in points if p.axis == axis])
              for axis in ("robots", "steps", "cells")}  # fmt: skip
    assert slopes == pytest.approx({"robots": 2, "steps": math.nan, "cells": math.nan}, nan_ok=True)
    assert [point.finished for point in points[4:8]] == [True, True, True, False]
    assert (tmp_path / "growth.png").read_bytes().startswith(b"\x89PNG")
    assert "power law" in capsys.readouterr().out


def test_growth_outlives_a_failed_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A size that fails is left out, said by the exit code, and all others are there.

    Each has two runs, the second without step envelopes.
    """

    def made(build: partial[Problem], method: object, seconds: float) -> Run:
        if build.keywords["robots"] == 4:
            raise Run.Error("its process died")
        return finished(1.0) if method == "column-generation" else finished(1.0, bound=104.0)

    monkeypatch.setattr(Run, "of", made)
    arguments = ["growth", "--robots", "2,4", "--steps", "8", "--cells", "15", "--seeds", "0"]
    assert study(*arguments, "--out", tmp_path) == 1
    sizes = [(row["axis"], row["size"]) for row in rows_of(tmp_path / "growth.csv")]
    assert sizes == [("robots", "2"), ("steps", "8"), ("cells", "15")]
    for sample in Sample.read(tmp_path / "growth.csv"):
        assert sample.gap < sample.gap_of_cuts
    assert (tmp_path / "growth.png").exists()


@pytest.mark.slow
def test_a_process_that_dies_is_an_error_in_words() -> None:
    """Also one that says nothing before it ends."""
    with pytest.raises(Run.Error, match="exit code 3"):
        Run.of(partial(scene, "corridor", 0, 2), dying, 1.0)


def test_a_run_is_judged_and_traced() -> None:
    """Truncated scenes are proved as a whole; each improvement is a moment before the end."""
    result = _measured(partial(scene, "corridor", 0, 3), branch_and_price, 10.0)
    assert result.reason is Reason.OPTIMAL
    assert result.value <= result.bound
    assert result.seconds_to_gap(0.5) <= result.moments[-1].seconds <= result.seconds
    assert result.seconds_to_proof == result.seconds


def test_what_a_run_says_of_its_course() -> None:
    """Gaps and times come from the moments, and from the end where they came only there."""
    late = finished(10.0)
    assert late.gap_after(0.5) == math.inf
    assert late.gap_after(2.5) == pytest.approx(0.1)
    assert late.gap_after(10.0) == pytest.approx(0.005)
    assert late.seconds_to_gap(0.2) == 2.0
    assert late.seconds_to_gap(0.01) == 3.0
    assert late.seconds_to_gap(0.001) == math.inf
    assert late.seconds_to_bound(150.0) == 2.0
    assert late.seconds_to_bound(99.0) == math.inf
    assert late.seconds_to_proof == math.inf


def test_outcomes_come_from_one_process_until_it_dies(monkeypatch: pytest.MonkeyPatch) -> None:
    """The problem on which a process dies has an error, and the rest goes to another process."""
    begun = []

    def outcomes(builds: list[Any], *rest: Any) -> Iterator[Run | Run.Error]:
        begun.append(len(builds))
        yield finished(1.0)
        yield Run.Error("died")

    monkeypatch.setattr(runs_module, "_outcomes", outcomes)
    builds = [partial(scene, "corridor", 0, 1)] * 4
    kinds = [isinstance(one, Run) for one in Run.each(builds, branch_and_price, 1.0)]
    assert (kinds, begun) == ([True, False] * 2, [4, 2])


# -- exact methods against steps ----------------------------------------------------------

# Two seeds: `good` proves both, `slow` one of two with a bound of 20 % above, `odd` refuses.
STEPS = [
    MethodRun("good", 1, 0, RunStatus.PROVED, 0.2, 0.1, 100.0, 100.0, ""),
    MethodRun("good", 1, 1, RunStatus.PROVED, 0.4, 0.3, 200.0, 200.0, ""),
    MethodRun("slow", 1, 0, RunStatus.PROVED, 4.0, 2.0, 100.0, 100.0, "by the solver's word"),
    MethodRun("slow", 1, 1, RunStatus.STOPPED, 5.0, 3.0, 150.0, 240.0, 'a, "b"'),
    MethodRun("odd", 1, 0, RunStatus.REFUSED, math.nan, math.nan, -math.inf, math.inf, "too large"),
]


def test_the_benchmark_is_what_was_written(tmp_path: Path) -> None:
    """A table that is read is that which was written; bounds are held against proved optima."""
    save_csv(tmp_path / "solvers.csv", [run._asdict() for run in STEPS])
    read = Benchmark.read(tmp_path / "solvers.csv")
    assert list(map(repr, read.runs)) == list(map(repr, STEPS))
    above = read.table["bound above the optimum (%)"].tolist()
    assert above == pytest.approx([0, 0, 0, 20, math.inf])


def test_the_figure_tells_proofs_from_limits() -> None:
    """A median is hollow where a limit stopped a run; a refused problem has no mark."""
    time, bound = Benchmark(STEPS).plot().axes
    for ax, heights in ((time, [0.2, 2.5]), (bound, [1e-4, (1e-4 + 20) / 2])):
        marks = [line for line in ax.lines if line.get_linestyle() == "None"]
        assert [line.get_ydata()[0] for line in marks] == pytest.approx(heights)
        assert [line.get_markerfacecolor() == "white" for line in marks] == [False, True]


@pytest.mark.parametrize("text", ["", "method,steps\n1,2\n", "MADE,one"])
def test_another_table_is_refused(tmp_path: Path, text: str) -> None:
    """The error names the file."""
    file = tmp_path / "solvers.csv"
    save_csv(file, [run._asdict() for run in STEPS])
    file.write_text(file.read_text().replace("1,0", "one,0", 1) if "MADE" in text else text)
    with pytest.raises(ValueError, match=r"solvers\.csv"):
        Benchmark.read(file)


def test_the_stored_benchmark_holds() -> None:
    """It has 1 to 8 steps and five seeds of seven methods, whose proofs agree on the optimum."""
    runs = Benchmark.read().runs
    assert {run.steps for run in runs} == set(range(1, 9))
    assert {run.seed for run in runs} == set(range(5))
    assert list(dict.fromkeys(run.method for run in runs)) == list(METHODS)
    for steps in range(1, 9):
        for seed in range(5):
            some = [run for run in runs if (run.steps, run.seed) == (steps, seed)]
            optima = [run.value for run in some if run.outcome is RunStatus.PROVED]
            assert max(optima) <= min(optima) * (1 + 2e-6)
            assert all(run.bound >= max(optima) * (1 - 1e-6) for run in some)


def test_methods_are_measured_until_they_refuse(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    """A method that fails goes on with the next steps, and one that refuses does not."""

    def each(builds: list[Any], method: Any, *rest: Any) -> Iterator[Run | Run.Error]:
        assert [build.args for build in builds] == [("corridor", 3, h) for h in range(1, 6)]
        yield dataclasses.replace(finished(1.0), elapsed=0.5)
        yield Run.Error("the process died")
        yield Run.Error("UnsupportedError: too large")
        raise AssertionError("no more is asked for")

    monkeypatch.setattr(Run, "each", each)
    monkeypatch.setattr(steps_module, "METHODS", {"made": branch_and_price})
    assert study("steps", "--steps", "1-5", "--seeds", "3", "--limit", "2", "--out", tmp_path) == 1
    rows = rows_of(tmp_path / "solvers.csv")
    assert [row["outcome"] for row in rows] == ["stopped", "failed", "refused"]
    assert (tmp_path / "solvers.png").stat().st_size > 1000
    assert "made, 2 steps, seed 3: failed" in capsys.readouterr().err


def sampled(size: int, seconds: float, limit: Limit | None = None) -> GrowthPoint:
    """A point of one run."""
    run = finished(seconds, limit)
    return GrowthPoint("robots", size, (Sample.of("robots", size, 0, 40.0, Runs(run, run)),))


def test_exponents_are_those_of_power_laws() -> None:
    """The slope is exact on a power law, and unknown from few sizes and where there is none."""
    points = [sampled(n, 0.5 * n**1.5) for n in (2, 8, 16, 32)]
    exponent = MEASURES["seconds"].exponent
    assert exponent(points) == pytest.approx(1.5)
    assert exponent([*points, sampled(64, 1.0, Limit.TIME)]) == pytest.approx(1.5)
    assert math.isnan(exponent(points[:3]))
    assert math.isnan(exponent([*points, sampled(64, 1.0)]))


def test_targets() -> None:
    """The most that is met is named; a number that is missing meets nothing."""
    assert Metric("", 0.1, "s", Target.below(2), Target.below(1)).met == "moonshot"
    assert Metric("", 1.5, "s", Target.below(2), Target.below(1)).met == "must"
    assert Metric("", math.inf, "s", Target.below(2), Target.below(1)).met == "missed"
    assert Metric("", math.nan, "x", Target.at_least(50)).met == "missed"
    assert Metric("", 3.0, "s").met == ""
