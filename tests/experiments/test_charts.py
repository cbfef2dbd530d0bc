import math
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.figure import Figure
from result_rows import row

from cocap_opt.cli import commands
from cocap_opt.experiments.report.charts import (
    _draw_conflicts,
    _draw_gaps,
    _draw_progress,
    gaps_figure,
    progress_figure,
)
from cocap_opt.files.documents import FileError
from cocap_opt.formulations.result import CertifiedResult, Snapshot
from cocap_opt.output.trace import Trace
from cocap_opt.pictures.figures import picture
from cocap_opt.pictures.style import GREY, LINES, families_for
from cocap_opt.planners import PLANNERS
from cocap_opt.problem import SwapConflict
from cocap_opt.result import Reason
from cocap_opt.scenarios import load_scene
from cocap_opt.stop import Limit

NUMBER = st.floats(0, 1e6)


@given(st.lists(st.builds(Snapshot, NUMBER, NUMBER, NUMBER), max_size=20))
def test_a_trace_never_gets_worse(snapshots: list[Snapshot]) -> None:
    """Values rise, bounds fall, whatever a method reports of the node it is in."""
    trace = Trace()
    for snapshot in snapshots:
        trace.report(snapshot)
    for before, after in pairwise(trace.snapshots):
        assert (before.value, -before.bound) < (after.value, -after.bound)
        assert before.value <= after.value and before.bound >= after.bound
    if snapshots:
        assert trace.snapshots[-1].value == max(s.value for s in snapshots)
        assert trace.snapshots[-1].bound == min(s.bound for s in snapshots)


def test_a_trace_ends_with_its_result() -> None:
    """The last point is that of the result, whose seconds it has."""
    trace = Trace()
    trace.report(Snapshot(-math.inf, 9.0, 0.5))
    trace.end(CertifiedResult(None, 3.0, Reason.STOPPED, Limit.TIME, 8.0, 2.0))
    assert trace.snapshots[1:] == (Snapshot(3.0, 8.0, 2.0),)


def test_a_trace_is_read_as_it_was_written(tmp_path: Path) -> None:
    """A value or a bound that there was not yet is an empty field."""
    trace = Trace([Snapshot(-math.inf, math.inf, 0.25), Snapshot(1.5, 2.5, 1.0, 3, 4)])
    path = tmp_path / "trace.csv"
    path.write_text(trace.text, encoding="utf-8")
    assert Trace.load(path).snapshots == trace.snapshots
    assert path.read_text(encoding="utf-8").splitlines()[1] == ",,0.25,0,0"


@pytest.mark.parametrize(
    "text", ["value,bound\n", "value,bound,seconds,columns,nodes\n1,2\n",
             "value,bound,seconds,columns,nodes\n1,2,-3,0,0\n",
             "value,bound,seconds,columns,nodes\nnan,2,3,0,0\n",
             "value,bound,seconds,columns,nodes\n1,1e308,3,0,0\n",
             "value,bound,seconds,columns,nodes\n1,2,3,4,5,6\n"],
)  # fmt: skip
def test_what_is_no_trace_is_said(
    text: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """One line names the file, and nothing is written."""
    path, chart = tmp_path / "trace.csv", tmp_path / "x.png"
    path.write_text(text, encoding="utf-8")
    assert commands.run(["figure", "progress", str(path), "-o", str(chart)]) == 2
    assert capsys.readouterr().err.startswith(f"cocap-opt: {path}: ")
    assert not chart.exists()


@pytest.mark.slow
def test_solve_writes_the_trace_that_figure_draws(tmp_path: Path) -> None:
    """A trace ends at the proved gap; it may not be the file of the plan."""
    trace, chart = tmp_path / "trace.csv", tmp_path / "x.svg"
    solve = ["solve", "tiny-turn", "--json", "--trace", str(trace)]
    assert commands.run(solve) == 0
    assert Trace.load(trace).snapshots[-1].gap <= 1e-6
    assert commands.run(["figure", "progress", str(trace), "-o", str(chart)]) == 0
    assert b"<svg" in chart.read_bytes()
    assert commands.run([*solve, "-o", str(trace)]) == 2


def test_traces_of_earlier_versions_are_read(tmp_path: Path) -> None:
    """Their bound was that of what was not searched yet: where it is lower, the value is one."""
    path = tmp_path / "trace.csv"
    path.write_text("value,bound,seconds,columns,nodes\n5.0,4.5,1.0,3,1\n5.0,6.0,2.0,3,1\n")
    assert [s.bound for s in Trace.load(path).snapshots] == [5.0, 6.0]
    for damaged in ("nan,6.0,1.0,3,1", "5.0,nan,1.0,3,1", "5.0,6.0,-1.0,3,1", "5.0,6.0,nan,3,1"):
        path.write_text(f"value,bound,seconds,columns,nodes\n{damaged}\n")
        with pytest.raises(FileError, match="line 2: must be five numbers"):
            Trace.load(path)


def test_conflicts_are_drawn_where_they_are() -> None:
    """A bar per conflict joins its two drones at its step, or between steps where they swap."""
    problem = load_scene("bottleneck", 0)
    plan = PLANNERS["greedy"](problem).plan
    assert plan is not None
    ax = _draw_conflicts(Figure().subplots(), problem, plan)
    bars = sorted(
        (tuple(np.ravel(line.get_ydata())), float(np.ravel(line.get_xdata())[0]))
        for line in ax.lines
        if len(np.ravel(line.get_xdata())) == 2 and line.get_xdata()[0] == line.get_xdata()[1]
    )
    wanted = sorted(
        (c.robots, c.t + 0.5 * isinstance(c, SwapConflict)) for c in plan.conflicts(problem)
    )
    assert [robots for robots, _ in bars] == [robots for robots, _ in wanted]
    assert [x for _, x in bars] == pytest.approx([t for _, t in wanted], abs=0.25)


def test_gaps_are_drawn_for_plans_that_obey_the_rules() -> None:
    """A stroke per seed; whose bound is open is faint; who breaks a rule is counted."""
    rows = [row("greedy", 0, 120.0, conflicts=3, gap=None)]
    rows += [row("cocap", seed, 100 - seed) for seed in range(3)]
    rows += [row("cocap", 3, 90.0, bound_reason="stopped")]
    ax = _draw_gaps(Figure().subplots(), rows)
    strokes = [line.get_xdata() for line in ax.lines if line.get_marker() == "|"]
    assert sorted(float(x) for some in strokes for x in some) == pytest.approx([0, 1, 2, 10])
    assert [text.get_text() for text in ax.get_yticklabels()] == [
        "greedy\n(1 of 1 breaks rules)", "cocap",
    ]  # fmt: skip
    assert "not proved" in ax.get_title(loc="right")


def test_runs_without_a_gap_are_not_drawn() -> None:
    """A bound without a plan has no gap to draw, and is no error."""
    ax = _draw_progress(Figure().subplots(), {"bound": Trace([Snapshot(-math.inf, 5.0, 1.0)])})
    assert len(ax.lines) == 1  # where optima lie


@pytest.mark.parametrize("count", [2, 4, 12, LINES])
def test_runs_are_told_apart_by_a_legend(count: int) -> None:
    """Each has a name, and colour and dashes that no other has."""
    trace = Trace([Snapshot(1.0, 2.0, 1.0), Snapshot(1.5, 2.0, 2.0)])
    names = [f"run {k}" for k in range(count)]
    figure = progress_figure(dict.fromkeys(names, trace))
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == names
    looks = [(line.get_color(), line._dash_pattern) for line in legend.get_lines()]
    assert len({str(look) for look in looks}) == count


def test_more_runs_than_can_be_told_apart_are_not_coloured() -> None:
    """A colour that two runs have in common would tell nothing: all are grey, and counted."""
    trace = Trace([Snapshot(1.0, 2.0, 1.0), Snapshot(1.5, 2.0, 2.0)])
    figure = progress_figure({f"run {k}": trace for k in range(LINES + 1)})
    (ax,) = figure.axes
    assert figure.legends == []
    assert {line.get_color() for line in ax.lines} == {GREY}
    assert ax.get_title(loc="right") == f"{LINES + 1} runs"


@pytest.mark.slow
def test_names_are_no_mathematics(tmp_path: Path) -> None:
    """A scene or a file may have dollar signs in its name."""
    rows = [row("$x^{_$", 0, 99.0, scene="$a^{_$"), row("cocap", 0, 98.0, scene="$a^{_$")]
    assert picture(gaps_figure(rows), ".png").startswith(b"\x89PNG")
    trace = Trace([Snapshot(1.0, 2.0, 1.0)])
    assert b"<svg" in picture(progress_figure({"$x^{_$": trace, "b": trace}), ".svg")


@pytest.mark.slow
@pytest.mark.filterwarnings("error")
def test_names_break_no_picture() -> None:
    """Control characters would make an SVG that nothing opens; letters of any font are let be."""
    trace = Trace([Snapshot(1.0, 2.0, 1.0)])
    text = picture(progress_figure({"a\x1b[2J": trace, "\u65b0\n": trace}), ".svg")
    assert ElementTree.fromstring(text).tag.endswith("svg")


@pytest.mark.slow
def test_the_traces_of_a_sweep_are_drawn(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A folder stands for the traces in it; one without any is refused."""
    (tmp_path / "traces").mkdir()
    draw = ["figure", "progress", str(tmp_path), "-o", str(tmp_path / "x.png")]
    assert commands.run(draw) == 2
    assert "has no traces" in capsys.readouterr().err
    (tmp_path / "traces" / "a-0.csv").write_text(Trace([Snapshot(1.0, 2.0, 1.0)]).text)
    assert commands.run(draw) == 0


def test_letters_are_looked_for_in_other_fonts(caplog: pytest.LogCaptureFixture) -> None:
    """The common font has Latin, Greek and Cyrillic; what no font has is said once."""
    assert families_for("gap (%), ±, é, λ, Ж") == ("DejaVu Sans",)
    families_for("\U000e0001 and \U000f8ff0")  # letters that are nobody's
    families_for("\U000e0001 and \U000f8ff0")
    assert caplog.text.count("no installed font has") == 1
