import csv
import time
from dataclasses import replace
from itertools import permutations
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from sweeps import SETTINGS, TIMES, small_field
from test_sweeps import swept, untimed

from cocap_opt.api.measuring import gap as gap_frame
from cocap_opt.cli import commands
from cocap_opt.experiments.sweeps.instances import Instance, Settings
from cocap_opt.experiments.sweeps.results import load_results
from cocap_opt.experiments.tables.gap_table import print_gap_table
from cocap_opt.experiments.tables.rows import GapRow
from cocap_opt.model import compiled
from cocap_opt.output.files import save_csv
from cocap_opt.planners import PLANNERS
from cocap_opt.problem import Plan, Problem
from cocap_opt.referee import check
from cocap_opt.result import Reason, Result
from cocap_opt.run.engine import SOLVERS
from cocap_opt.stop import Stop
from cocap_opt.vision.coverage import GrowingTable
from cocap_opt.vision.views import PinholeViews

LAZY = [name for name, planner in PLANNERS.items() if planner.lazy]

# One of each kind: with the coverage of all states, with views of its own, exact.
MIXED = ("cocap", "cocap-vs", "branch-and-price")


@pytest.fixture
def cold(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A cache of the test's own, with nothing in it, on disk or in memory."""
    monkeypatch.setenv("COCAP_OPT_CACHE", str(tmp_path / "cache"))
    compiled.cache_clear()
    return tmp_path / "cache"


def measured(
    planners: tuple[str, ...], settings: Settings, folder: Path | None = None
) -> list[GapRow]:
    """Rows of planners on one scene, in the order of their names."""
    rows = swept([Instance(small_field(0, steps=3), 0, planners, settings)], folder)
    return sorted(rows, key=lambda row: str(row.planner))


@pytest.mark.slow
def test_rows_depend_on_no_order_and_no_cache(cold: Path) -> None:
    """All orders of planners, with a cold cache and a warm one, give the same rows."""
    settings = Settings(time_limit=600.0, bound_time_limit=600.0, work_limit=3)
    found = []
    for order in permutations(MIXED):
        compiled.cache_clear()
        for path in cold.glob("*"):
            path.unlink()
        found.append(untimed(measured(order, settings)))
    assert any(cold.iterdir())
    compiled.cache_clear()
    found.append(untimed(measured(MIXED, settings)))
    assert {len(rows) for rows in found} == {len(MIXED)}
    assert all(rows == found[0] for rows in found)


@pytest.mark.long
def test_slow_coverage_is_charged_to_nobody(cold: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whoever comes first: a limit shorter than the coverage stops no planner and no bound, whose
    seconds are their own; all rows have the seconds of the coverage, from a warm cache, too."""
    slow, grow = 1.5, GrowingTable.grow

    def slowly(*arguments: Any) -> None:
        time.sleep(slow)
        grow(*arguments)

    monkeypatch.setattr(GrowingTable, "grow", slowly)
    settings = Settings(time_limit=1.0, bound_time_limit=1.0)
    tables = [measured(("cocap", "cocap-vs", "sequential"), settings)]
    compiled.cache_clear()
    tables.append(measured(("sequential", "cocap-vs", "cocap"), settings))
    for rows in tables:
        assert {row.reason for row in rows} == {"finished"}
        assert {row.bound_reason for row in rows} == {"optimal"}
        assert all(row.seconds is not None and row.seconds < 1 for row in rows)
        assert len({row.coverage_seconds for row in rows}) == 1
        assert all(slow <= (row.coverage_seconds or 0) < 2 * slow for row in rows)
    assert untimed(tables[0]) == untimed(tables[1])
    assert tables[0][0].coverage_seconds == tables[1][0].coverage_seconds  # the cache tells


@pytest.mark.long
@pytest.mark.parametrize("planner", LAZY)
def test_views_of_others_are_nobodys(
    planner: str, cold: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A planner that evaluates views evaluates as many after itself and after all others."""
    asked, seen, begun = 0, PinholeViews.seen, list[int]()

    def counted(self: Any, nodes: Any, steps: Any = None) -> Any:
        nonlocal asked
        asked += len(nodes)
        return seen(self, nodes, steps)

    def watched(problem: Problem, stop: Stop) -> Result:
        before = asked
        result = lazy(problem, stop)
        if problem.name.startswith("field"):  # and not that on which methods warm up
            begun.append(asked - before)
        return result

    lazy = SOLVERS[planner]
    monkeypatch.setattr(PinholeViews, "seen", counted)
    monkeypatch.setitem(SOLVERS, planner, replace(lazy, call=watched))
    for seconds in (60.0, 0.0):  # without time, all stay where they are, and see what they see
        begun.clear()
        settings = Settings(time_limit=seconds, bound_time_limit=0.0)
        for others in ((), ("cocap", *(set(LAZY) - {planner}))):
            measured((*others, planner), settings)
        assert begun[0] > 0 and set(begun) == {begun[0]}


@pytest.mark.slow
def test_a_scene_has_one_time_of_coverage(cold: Path, tmp_path: Path) -> None:
    """Rows that join later, and rows of planners without coverage, have it like all others."""
    first = measured(("cocap-vs",), SETTINGS, tmp_path / "out")
    measured(("cocap",), SETTINGS, tmp_path / "out")
    rows = load_results(tmp_path / "out")
    assert {row.planner for row in rows} == {"cocap", "cocap-vs"}
    assert {row.coverage_seconds for row in rows} == {first[0].coverage_seconds}
    assert first[0].coverage_seconds


def staying(problem: Problem, stop: Stop) -> Result:
    """Moves nobody, whatever the time."""
    plan = Plan.hovering(problem)
    assert plan is not None
    return Result(plan, check(problem, plan).reward, Reason.FINISHED)


@pytest.mark.slow
def test_who_overruns_a_limit_is_marked(
    cold: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A planner that does not ask for the time is marked beside it, below, and in the table."""

    def sleeps(problem: Problem, stop: Stop) -> Result:
        time.sleep(1.2)
        return staying(problem, stop)

    frame = gap_frame("tiny-queue", [sleeps, staying], time_limit=0.1)
    assert list(frame.reason) == ["finished", "finished"]
    assert frame.overrun[0] == pytest.approx(frame.seconds[0] - 0.1) and np.isnan(frame.overrun[1])
    row = measured(("cocap",), SETTINGS)[0]
    assert row.overrun is None
    print_gap_table([replace(row, seconds=8.0, time_limit=3.0, overrun=5.0), row])
    printed = capsys.readouterr().out
    assert "8.000!" in printed and "(8.0 s of 3 s)" in printed
    print_gap_table([row])
    assert "time limit allows" not in capsys.readouterr().out


def test_tables_of_before_are_read(cold: Path, tmp_path: Path) -> None:
    """They lack columns, such as for who overran a limit, and are not lost for that."""
    (row,) = measured(("cocap",), SETTINGS, tmp_path)
    with (tmp_path / "results.csv").open(encoding="utf-8", newline="") as file:
        table = list(csv.DictReader(file))
    for fields in table:
        for name in ("overrun", "cut_short", "seen_by_two", "seen_by_three", "median_error"):
            del fields[name]
    save_csv(tmp_path / "results.csv", table)
    unknown = dict.fromkeys(("seen_by_two", "seen_by_three", "median_error"))
    assert load_results(tmp_path) == [replace(row, **unknown)]


def test_the_table_says_what_coverage_took(capsys: pytest.CaptureFixture[str]) -> None:
    """It is a column of its own, and a line says that nobody pays for it."""
    words = ["gap", "tiny-queue", "--planner", "cocap-vs", "--time-limit", "9", "--verbose"]
    assert commands.run(words) == 0
    printed = capsys.readouterr().out
    assert "coverage_seconds" in printed and "seconds do not include it" in " ".join(
        printed.split()
    )
    assert "coverage_seconds" in TIMES
