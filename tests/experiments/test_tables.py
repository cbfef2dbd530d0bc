import json
import math
import os
import pty
import re
import subprocess
import sys
from contextlib import suppress
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.cells import cell_len
from scipy import stats
from strategies import examples

from cocap_opt.cli import commands
from cocap_opt.experiments.sweeps.results import load_results
from cocap_opt.experiments.tables.columns import TableColumn
from cocap_opt.experiments.tables.comparison_tables import comparison_tables
from cocap_opt.experiments.tables.gap_table import print_gap_table
from cocap_opt.experiments.tables.rows import COLUMNS, GapRow, PlanRow
from cocap_opt.experiments.tables.statistics import Mean
from cocap_opt.experiments.tables.tables import DOCUMENTS, Tables, html_table
from cocap_opt.files.documents import FileError
from cocap_opt.formulations.result import Snapshot
from cocap_opt.output.conflicts import grouped_conflicts
from cocap_opt.output.printing import Listing
from cocap_opt.output.trace import Trace
from cocap_opt.planners.sequential import sequential
from cocap_opt.referee import check
from cocap_opt.result import Reason, Result
from cocap_opt.run.judged import Judged
from cocap_opt.scenarios import load_scene

SOME = st.lists(st.floats(0, 1e6), min_size=5, max_size=30)


def test_few_values_have_no_interval() -> None:
    """Nothing is said of how sure the mean of a few values is, and of one there is no spread."""
    assert Mean.of([3.0]).value == 3.0
    assert math.isnan(Mean.of([3.0]).low) and math.isnan(Mean.of([3.0]).spread)
    assert Mean.of([1.0, 3.0]).spread == pytest.approx(math.sqrt(2))
    assert [Mean.of(range(n)).text(1) for n in (4, 5)] == ["1.5", "2.0 (0.8 to 3.2)"]


@examples(20)
@given(SOME)
def test_the_bootstrap_interval_is_within_the_values(values: list[float]) -> None:
    """What is never negative has no interval with negative ends; it is the same each time."""
    found = Mean.of(values)
    assert found.value == pytest.approx(np.mean(values))
    assert 0 <= min(values) <= found.low * (1 + 1e-9) and found.low <= found.high
    assert found.high <= max(values) * (1 + 1e-9)
    assert Mean.of(values) == found


def test_the_bootstrap_interval_is_that_of_all_resamples() -> None:
    """Of five values: quantiles of the means of all 3,125; groups weigh alike."""
    values = [0.0, 1.0, 5.0, 12.0, 7.0]
    means = [np.mean(some) for some in product(values, repeat=5)]
    found = Mean.of(values)
    ends = np.quantile(means, [0.025, 0.975], method="inverted_cdf")
    assert (found.low, found.high) == pytest.approx(ends, abs=0.3)
    assert Mean.of([0.0] * 9, [3.0] * 2).value == 1.5
    assert math.isnan(Mean.of([0.0] * 9, [3.0]).low)  # one seed settles nothing


@given(SOME, st.floats(0.1, 100))
def test_the_shifted_geometric_mean_is_between(values: list[float], shift: float) -> None:
    """It is one of geometric means, between the least and the largest value."""
    found = Mean.shifted_geometric(values, shift)
    assert found == pytest.approx(stats.gmean(np.array(values) + shift) - shift, rel=1e-6, abs=1e-6)
    assert min(values) - 1e-6 <= found <= max(values) * (1 + 1e-9) + 1e-6


def row(planner: str, seed: int, reward: float | None, **more: Any) -> GapRow:
    """A row of a scene whose optimum is 100 with rules and 110 without."""
    plain = {
        "scene": "a|b & c", "seed": seed, "planner": planner, "reward": reward, "bound": 100.0,
        "gap": None if reward is None else 1 - reward / 100,
        "gap_free": None if reward is None else 1 - reward / 110, "conflicts": 0,
        "seconds": 1.0, "reason": "finished", "limit": "none", "bound_reason": "optimal",
        "optimum": 100.0, "optimum_free": 109.0, "bound_free": 110.0,
        "bound_free_reason": "optimal", "message": "", "colliding": 0, "robots": 2, "actors": 1,
        "steps": 5, "digest": "0", "time_limit": 60.0,
    }  # fmt: skip
    return GapRow(**(plain | more))


ROWS = [
    row("sequential", 0, 80.0), row("cocap", 0, 100.0),
    row("sequential", 1, 90.0), row("cocap", 1, 90.0, seconds=3.0),
    row("sequential", 2, None), row("cocap", 2, 95.0, conflicts=2, gap=None, gap_free=None),
]  # fmt: skip


def test_planners_are_judged_by_plans_that_obey_the_rules() -> None:
    """A plan with conflicts has no gap and is not optimal; its reward is a reward."""
    sequential, cocap = Tables.of(ROWS)["Planners"]
    assert (sequential["obeys the rules"], cocap["obeys the rules"]) == ("2 of 3", "2 of 3")
    assert (sequential["proved optimal"], cocap["proved optimal"]) == ("0 of 3", "1 of 3")
    assert sequential["mean J"] == "85.00 ± 7.07 (n = 2)"
    assert cocap["gap (%)"].startswith("5.000 (") and cocap["largest gap (%)"] == "10.000"
    assert cocap["gap (%)"].endswith("(n = 2)")  # of three seeds, as is said
    assert "(n: their number)" in Tables.of(ROWS).markdown()
    assert "(n: their number)" not in Tables.of(ROWS[:4]).markdown()  # where there is no n


def test_differences_are_paired() -> None:
    """Only seeds count on which both plans obey the rules."""
    (cocap,) = Tables.of(ROWS)["Paired differences"]
    assert cocap["against sequential (%)"] == "12.500"
    assert [cocap[key] for key in ("better", "equal", "worse", "seeds")] == ["1", "1", "0", "2"]


def test_the_price_has_two_certified_ends() -> None:
    """At least (109 - 100) / 110, at most (110 - 100) / 110, of each seed once."""
    (only,) = Tables.of(ROWS)["Price of collision avoidance"]
    assert only["costs at least (%)"].startswith("8.182") and only["costs at most (%)"].startswith(
        "9.091"
    )
    assert (only["seeds"], only["optimum known"]) == ("3", "3 of 3")


def test_a_run_without_a_plan_counts_as_its_own_time_limit() -> None:
    """In the shifted geometric mean, but not in the median of what was measured."""
    (only,) = Tables.of([row("cocap", 0, None, seconds=1.0, time_limit=7.0)])["Time"]
    assert only["shifted geometric mean (s)"] == "7.000"
    sequential, cocap = Tables.of(ROWS)["Time"]
    expected = Mean.shifted_geometric([1.0, 1.0, 60.0])
    assert sequential["shifted geometric mean (s)"] == f"{expected:.3f}"
    assert (sequential["median (s)"], cocap["longest (s)"]) == ("1.000", "3.000")
    assert (sequential["times the fastest"], sequential["no valid plan"]) == ("1.0", "1")


def test_who_breaks_rules_is_nobodys_measure() -> None:
    """The time of a plan that is no plan is shown, and compared with nothing."""
    rows = [row("greedy", s, 99.0, seconds=0.001, conflicts=1) for s in range(3)]
    rows += [row("cocap", s, 90.0, seconds=1.0) for s in range(3)]
    greedy, cocap = Tables.of(rows)["Time"]
    assert (greedy["times the fastest"], cocap["times the fastest"]) == ("-", "1.0")
    assert (greedy["shifted geometric mean (s)"], greedy["median (s)"]) == ("-", "0.001")


def test_conflicts_are_said_once_for_each_pair() -> None:
    """With all steps of it; what differs from step to step is said as it was first."""
    lines = [f"step {t}: drones 0 and 3 are in one cell" for t in (5, 6, 7, 9)]
    lines += ["step 2: drones 1 and 2 are 1 m apart, less than 2 m",
              "step 2 to 3: drones 1 and 2 pass 0.5 m apart, less than 2 m", "another"]  # fmt: skip
    assert grouped_conflicts(lines) == [
        "another",
        "drones 0 and 3 are in one cell: steps 5 to 7 and 9",
        "drones 1 and 2 are 1 m apart, less than 2 m at first: steps 2 to 3",
    ]
    assert grouped_conflicts(lines[:1]) == ["drones 0 and 3 are in one cell: step 5"]


def test_times_are_compared_on_the_same_runs() -> None:
    """A planner that ran on one scene only is compared there, not with others' harder scenes."""
    hard = [row("cocap", seed, 90.0, scene="hard", seconds=100.0) for seed in range(3)]
    easy = [row("joint", seed, 100.0, scene="easy", seconds=4.0) for seed in range(3)]
    easy += [row("cocap", seed, 90.0, scene="easy", seconds=1.0) for seed in range(3)]
    table = Tables.of(hard + easy)["Time"]
    found = {(r["scene"], r["planner"]): r["times the fastest"] for r in table}
    assert found == {
        ("hard", "cocap"): "1.0", ("easy", "joint"): "4.0", ("easy", "cocap"): "1.0",
        ("all", "cocap"): "1.0",
    }  # fmt: skip
    ragged = [row("cocap", seed, 90.0, seconds=100.0 * seed + 1) for seed in range(3)]
    cocap, joint = Tables.of([*ragged, row("joint", 0, 90.0, seconds=2.0)])["Time"]
    assert (cocap["times the fastest"], joint["times the fastest"]) == ("1.0", "2.0")
    cocap, joint = Tables.of([*ragged, row("joint", 7, 90.0)])["Time"]
    assert (cocap["times the fastest"], joint["times the fastest"]) == ("-", "-")


def test_only_runs_are_timed() -> None:
    """What failed took the limit; plans of others and scenes that are not taken are no runs."""
    rows = [
        row("cocap", 0, 90.0), row("cocap", 1, None, seconds=None, reason="exceeded"),
        row("theirs", 0, 90.0, seconds=None), row("joint", 0, None, seconds=None,
                                                  reason="unsupported"),
    ]  # fmt: skip
    (cocap,) = Tables.of(rows)["Time"]
    assert (cocap["runs"], cocap["no valid plan"], cocap["longest (s)"]) == ("2", "1", "1.000")
    expected = Mean.shifted_geometric([1.0, 60.0])
    assert cocap["shifted geometric mean (s)"] == f"{expected:.3f}"


def test_a_table_of_differences_needs_its_planner() -> None:
    """Where nobody planned sequentially there is nothing to compare with, and no such table."""
    titles = Tables.of([row("cocap", 0, 90.0)])
    assert "Paired differences" not in titles and "Planners" in titles


@pytest.mark.parametrize(
    ("style", "name"),
    [("markdown", "a&#124;b &amp; c"), ("latex", r"a|b \& c"), ("html", "a|b &amp; c")],
)
def test_names_are_escaped(style: str, name: str) -> None:
    """A scene's name breaks no table."""
    text = DOCUMENTS[style](Tables.of(ROWS))
    assert name in text
    assert all(title in text for title in ("Planners", "Paired differences", "Price", "Time"))


def test_all_formats_say_what_columns_mean(capsys: pytest.CaptureFixture[str]) -> None:
    """Markdown in a paragraph, LaTeX in the caption, as on a terminal and on HTML pages."""
    for tables in (Tables.of(ROWS), comparison_tables(ROWS)):
        tables.print()
        found = [capsys.readouterr().out, tables.html(), tables.markdown(), tables.latex()]
        for text in found:
            plain = " ".join(re.sub(r"\\(?=%)", "", text).split())
            for words in (
                ("95 % bootstrap", "Optimum known: seeds on which", "the shift of")
                if ("Time" in tables)
                else ("corrected for the number of tests", "Share of scenes on which J")
            ):
                assert words in plain, (words, text)


def test_no_character_of_a_caption_has_a_meaning_in_latex() -> None:
    """A per cent sign would hide the rest of the line; labels are plain."""
    text = comparison_tables(ROWS).latex()
    for caption in re.findall(r"\\caption(.*)", text):
        assert not re.search(r"(?<!\\)[%&#_$]", caption.replace(r"$\pm$", ""))
    assert re.findall(r"\\label{(.*)}", text) == re.findall(r"\\label{([a-z0-9:-]+)}", text)
    odd = Tables({"a_b": [{"x": "< 1 ± 2", "y": "50 %", "z": "~^\\"}]}).latex()
    line = r"\textless{} 1 $\pm$ 2 & 50 \% & \textasciitilde{}\textasciicircum{}\textbackslash{}"
    assert line in odd
    assert r"\caption{a\_b}" in odd and r"\label{tab:a-b}" in odd


@pytest.mark.parametrize("name", ["规划器甲乙丙 规划器甲乙丙", 30 * "e\u0301", "김철수 ä"])
def test_columns_end_alike_whatever_the_letters(
    name: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Wide letters take two columns of a terminal, accents none; lines of 60 columns hold names."""
    monkeypatch.setenv("COLUMNS", "60")
    row = {"planner": name, "reward": 1234.5, "bound": 1240.0, "gap": 0.004, "seconds": 1.0}
    Listing("a title", [row, row | {"planner": "cocap"}]).print()
    lines = capsys.readouterr().out.splitlines()
    for part in " ".join(lines).split("planner")[1:]:
        assert part.count(name) == 1 and part.count("cocap") == 1
    widths = [cell_len(line.rstrip()) for line in lines if "1,234.50" in line or "reward" in line]
    assert max(map(cell_len, lines)) <= 60 and len(set(widths)) == 1
    # As many columns are beside each other as have room.
    wide = max(7, cell_len(name))
    assert any("reward" in line and "bound" in line for line in lines) == (wide + 23 <= 60)


def test_html_tables_align_numbers_and_say_what_they_are() -> None:
    """Columns of numbers end alike, those of words do not; a table has a name and scrolls alone."""
    text = DOCUMENTS["html"](Tables.of(ROWS))
    heads = set(re.findall(r'<th scope="col" class="n">(.*?)</th>', text))
    assert {"gap (%)", "costs at least (%)", "seeds", "proved optimal", "longest (s)"} <= heads
    assert not {"scene", "planner"} & heads
    tables, notes = text.count("<table "), text.count("<p>")
    assert tables == notes == text.count(' tabindex="0" aria-label="') == text.count("<h2>")
    rows = [{"a": "1.5 (0.2 to 3.1)", "b": "-", "c": "1 of 3", "d": "< 0.0001", "e": "x 1"}]
    assert re.findall(r'<td class="n">', html_table("T", rows)) == 4 * ['<td class="n">']


def test_latex_tables_fit_across_a_page() -> None:
    """Headings are stacked, so that eleven columns take no more than some 120 small letters."""
    text = DOCUMENTS["latex"](Tables.of(ROWS))
    assert (
        text.count(r"\begin{table*}") == text.count(r"\end{table*}") == text.count(r"\label{tab:")
    )
    for body in text.split(r"\toprule")[1:]:
        lines = [line for line in body.split(r"\bottomrule")[0].splitlines() if " & " in line]
        cells = [line.removesuffix(r" \\").split(" & ") for line in lines]
        assert len({len(row) for row in cells}) == 1
        parts = [
            [re.split(r"\\\\", cell.removeprefix(r"\shortstack{")) for cell in row] for row in cells
        ]
        widths = [max(len(part) for row in parts for part in row[k]) for k in range(len(parts[0]))]
        assert sum(widths) <= 125, widths


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of a small sweep."""
    folder = tmp_path_factory.mktemp("tables")
    names = ("--planner", "sequential", "--planner", "cocap", "--planner", "greedy")
    sweep = ["gap", "tiny-queue", "tiny-share", "--seeds", "0-1", *names, "--out", str(folder)]
    assert commands.run(sweep) == 0
    return folder


def test_cameras_are_counted_of_plans_that_obey_the_rules() -> None:
    """Shares are means; the error is that of the plan in the middle, infinite ones included."""
    rows = [
        row("a", 0, 80.0, seen_by_two=0.5, seen_by_three=0.25, median_error=20.0),
        row("a", 1, 80.0, seen_by_two=0.7, seen_by_three=0.35, median_error=40.0),
        row("a", 2, 80.0, seen_by_two=0.3, seen_by_three=0.0),
        row("b", 0, 80.0, seen_by_two=1.0, seen_by_three=1.0, median_error=1.0, conflicts=1),
        row("b", 1, 80.0, seen_by_two=0.4, seen_by_three=0.1),
        row("b", 2, None), row("c", 0, 80.0),
    ]  # fmt: skip
    assert Tables.of(rows)["Cameras on people"] == [
        {"scene": "a|b & c", "planner": "a", "seen by two (%)": "50.0",
         "seen by three (%)": "20.0", "median error (mm)": "40", "plans": "3"},
        {"scene": "a|b & c", "planner": "b", "seen by two (%)": "40.0",
         "seen by three (%)": "10.0", "median error (mm)": "-", "plans": "1"},
    ]  # fmt: skip
    assert "Cameras on people" not in Tables.of(ROWS)
    assert rows[0].cameras == "two see 50 % of person-steps, three 25 %; median error 20 mm"
    assert (rows[2].cameras, rows[6].cameras) == ("two see 30 % of person-steps, three 0 %", "")


def test_the_gap_table_has_a_second_one_of_cameras(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """It fits a terminal, and has the median of errors that `table` has, of the same name."""
    monkeypatch.setenv("COLUMNS", "80")
    rows = [
        row("a", 0, 80.0, seen_by_two=0.5, seen_by_three=0.25, median_error=20.0),
        row("b", 0, 80.0, seen_by_two=0.5, seen_by_three=0.25, median_error=20.0),
        row("b", 1, 80.0, seen_by_two=0.7, seen_by_three=0.35),
    ]
    print_gap_table(rows)
    _, title, text = capsys.readouterr().out.rpartition("cameras on people")
    assert title and max(len(line.rstrip()) for line in text.splitlines()) <= 80
    lines = [line.split()[-5:] for line in text.splitlines() if "a|b & c" in line]
    assert lines == [["a", "1", "50", "25", "20"], ["b", "2", "60", "30", "20"]]
    words = " ".join(text.split())
    assert "median error (mm)" in words
    assert Tables.of(rows)["Cameras on people"][1]["median error (mm)"] == "20"
    print_gap_table(ROWS)
    assert "cameras" not in capsys.readouterr().out


def test_the_command_makes_tables(results: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """On standard output, as JSON, or in a file."""
    assert commands.run(["table", str(results)]) == 0
    text = capsys.readouterr().out
    assert "| tiny-queue | sequential |" in " ".join(text.split())
    assert commands.run(["table", str(results), "--json", "--against", "cocap"]) == 0
    tables = json.loads(capsys.readouterr().out)["tables"]
    assert {r["planner"] for r in tables["Paired differences"]} == {"sequential", "greedy"}
    some = ["--scene", "tiny-share", "--planner", "cocap", "--planner", "greedy"]
    assert commands.run(["table", str(results), "--json", *some]) == 0
    tables = json.loads(capsys.readouterr().out)["tables"]
    found = {(r["scene"], r["planner"]) for r in tables["Planners"]}
    assert found == {("tiny-share", "cocap"), ("tiny-share", "greedy")}
    assert commands.run(["table", str(results), "--scene", "tiny"]) == 2
    assert "--scene: must be one of tiny-queue, tiny-share, not 'tiny'" in capsys.readouterr().err
    path = results / "tables.tex"
    assert commands.run(["table", str(results), "-o", str(path)]) == 0
    assert path.read_text().count(r"\begin{tabular}") == 5
    assert commands.run(["table", str(results), "-o", str(path.with_suffix(".doc"))]) == 2
    assert "-o: name a file that ends in .md, .txt, .tex or .html" in capsys.readouterr().err
    assert commands.run(["table", str(results), "--format", "html", "-o", str(path)]) == 2
    assert "-o: name a file that ends in .html" in capsys.readouterr().err


def test_every_column_says_what_it_means() -> None:
    """One statement has type, unit, range and meaning; the header of results.csv follows it."""
    assert TableColumn.all_of(GapRow) == COLUMNS
    for name, column in COLUMNS.items():
        assert column.name == name and column.kind in (int, float, str)
        assert column.meaning.endswith(".") and column.least <= column.most
        assert not column.is_optional or column.kind is not str or name in ("planner", "method")
    assert [name for name, c in COLUMNS.items() if c.is_extra] == [
        "planner_digest", "reward_rendered", "starts"
    ]  # fmt: skip


def test_a_trace_can_be_read_that_ends_below_the_best_value(tmp_path: Path) -> None:
    """The last nodes of a tree may have bounds below the best plan, which then is the bound."""
    trace = Trace()
    for value, bound in ((1.0, 4.0), (2.0, 3.0), (2.0, 1.5)):
        trace.report(Snapshot(value, bound, 0.1))
    (tmp_path / "trace.csv").write_text(trace.text)
    found = [(s.value, s.bound) for s in Trace.load(tmp_path / "trace.csv").snapshots]
    assert found == [(1.0, 4.0), (2.0, 3.0), (2.0, 2.0)]


def test_the_columns_are_printed(capsys: pytest.CaptureFixture[str]) -> None:
    """With type, unit and meaning, so that nobody needs the code to read results.csv."""
    assert commands.run(["columns", "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)["columns"]
    assert [line["column"] for line in printed] == list(COLUMNS)
    assert printed[4] == {
        "column": "reward", "type": "float", "unit": "px^0.5/m",
        "about": "J of the plan by the referee; empty without a plan.",
    }  # fmt: skip
    assert commands.run(["columns"]) == 0
    assert "bound_time_limit" in capsys.readouterr().out


def test_a_column_reads_what_is_written() -> None:
    """Numbers in range, text as it is, and nothing where nothing is."""
    cells = {"seed": "3", "bound": "1.5", "scene": "s"}
    assert [COLUMNS[k].parse(v, k) for k, v in cells.items()] == [3, 1.5, "s"]
    assert COLUMNS["gap"].parse("", "gap") is None
    with pytest.raises(FileError, match="robots: must be a number, not ''"):
        COLUMNS["robots"].parse("", "robots")


def test_results_of_earlier_versions_are_refused(results: Path, tmp_path: Path) -> None:
    """Their coverage was sampled, so that their rewards are others."""
    (tmp_path / "results.csv").write_bytes((results / "results.csv").read_bytes())
    run = json.loads((results / "run.json").read_text())
    (tmp_path / "run.json").write_text(json.dumps(run | {"version": 3}))
    with pytest.raises(FileError, match=r"run\.json: version: must be 4, not 3: .* sampled"):
        load_results(tmp_path)
    assert commands.run(["table", str(tmp_path)]) == 2


def test_results_are_read_as_they_were_written(results: Path) -> None:
    """Numbers are numbers, and what does not exist is None."""
    rows = load_results(results)
    assert {type(r.seed) for r in rows} == {int}
    assert {type(r.bound) for r in rows} == {float}
    assert any(r.gap is None for r in rows)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (None, "no such file"),
        (b"scene,seed\na,0\n", "has no column 'planner'"),
        (b"", "has no column 'scene'"),
        (("reward", "nan"), "line 2: reward: must be -9"),
        (("gap", "-0.5"), "line 2: gap: must be"),
        (("seed", "9" * 400), "line 2: seed: must be 0..9"),
        (("seconds", "-inf"), "line 2: seconds: must be 0..9"),
        (("conflicts", "-1"), "line 2: conflicts: must be 0..9"),
        (b"\xff\xfe", "UTF-8"),
        (("reward", "one"), "line 2: reward: must be a number, not 'one'"),
    ],
)
def test_what_is_no_table_is_refused(
    content: bytes | tuple[str, str] | None, words: str, results: Path, tmp_path: Path
) -> None:
    """In one line that names the file."""
    if isinstance(content, tuple):
        text = (results / "results.csv").read_text()
        head, first = text.splitlines()[:2]
        fields = first.split(",")
        fields[head.split(",").index(content[0])] = content[1]
        content = f"{head}\n{','.join(fields)}\n".encode()
    if isinstance(content, bytes):
        (tmp_path / "results.csv").write_bytes(content)
    with pytest.raises(FileError, match=words) as caught:
        load_results(tmp_path)
    assert "results.csv" in str(caught.value) and "\n" not in str(caught.value)


_ON_A_TERMINAL = """
import fcntl, struct, sys, termios
from cocap_opt.cli.commands import run
for width in (60, 80, 140):
    fcntl.ioctl(1, termios.TIOCSWINSZ, struct.pack("HHHH", 40, width, 0, 0))
    print("=", width)
    for words in (["gap", "tiny-queue", "tiny-share", "--seeds", "0-1", *sys.argv[2:]],
                  ["table", sys.argv[1]]):
        assert run([*words, *(["--out", sys.argv[1]] if words[0] == "gap" else [])]) == 0
"""


@pytest.mark.long
def test_tables_fit_into_a_terminal(results: Path) -> None:
    """At 60, 80 and 140 columns no line is longer; scene, planner, gap and conflicts are there."""
    here, there = pty.openpty()
    own = ["--planner", "sequential", "--planner", "cocap", "--planner", "greedy"]
    process = subprocess.Popen(
        [sys.executable, "-c", _ON_A_TERMINAL, str(results), *own], stdin=there, stdout=there,
        stderr=subprocess.DEVNULL, env={k: v for k, v in os.environ.items() if k != "COLUMNS"},
    )  # fmt: skip
    os.close(there)
    read = b""
    with suppress(OSError):  # the other end is closed
        while some := os.read(here, 1 << 16):
            read += some
    assert process.wait() == 0
    text = re.sub(r"\x1b\[[\d;]*[a-zA-Z]", "", read.decode()).replace("\r", "")
    pages = re.split(r"^= (\d+)$", text, flags=re.M)[1:]
    assert pages[::2] == ["60", "80", "140"]
    for width, page in zip(pages[::2], pages[1::2], strict=True):
        assert max(map(len, page.splitlines())) <= int(width)
        heads = [line.split() for line in page.splitlines() if line.startswith(" scene")]
        assert {"scene", "planner", "gap", "conflicts"} <= set(heads[0])
        assert all(head[:2] == ["scene", "planner"] or head[0] == "scene" for head in heads)
        assert "Hidden (terminal too narrow)" in page or width == "140"
    assert "&#" not in text and "tiny-share" in text


def test_narrow_terminals_keep_all_columns(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A table wider than the terminal is folded; scene and seed tell rows of its parts apart."""
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.setattr("sys.stdout.isatty", lambda: True, raising=False)
    row = {"scene": "corridor", "seed": 7} | {f"column {k}": 1e9 + k for k in range(8)}
    Listing("a wide table", [row, row | {"seed": 8}]).print()
    lines = capsys.readouterr().out.splitlines()
    rows = [line.split() for line in lines if "corridor" in line]
    assert len(rows) > 2 and [row[1] for row in rows] == ["7", "8"] * (len(rows) // 2)
    assert sum(number.startswith("1,000,000,00") for row in rows for number in row) == 16


def test_optimal_is_what_the_certificate_proves() -> None:
    """Where the bound leaves something open, the method has finished, and the row says why."""
    problem = load_scene("tiny-share", 0)
    plan = sequential(problem).plan
    value = check(problem, plan).reward
    for bound, reason in ((value, "optimal"), (1.001 * value, "finished"), (math.inf, "finished")):
        judged = Judged.of("made", problem, Result(plan, value, Reason.OPTIMAL, bound=bound))
        row = PlanRow.of(problem, 0, "made", judged)
        assert (row.reason, row.limit) == (reason, "none")
        assert ("within the accuracy" in row.message) == (bound == 1.001 * value)
