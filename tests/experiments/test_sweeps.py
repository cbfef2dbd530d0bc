import csv
import json
import math
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import dask
import msgspec
import numpy as np
import pytest
from sources import FRONT, reached
from sweeps import (
    PLANNER_NAMES,
    SETTINGS,
    TIMES,
    csv_rows,
    folder_for_a_sweep,
    instances,
    small_field,
    small_sweep,
)

from cocap_opt.api.measuring import gap as gap_frame
from cocap_opt.cli import commands
from cocap_opt.console.progress import Watch
from cocap_opt.console.threads import ONE_THREAD
from cocap_opt.experiments.sweeps import cells as cells_module
from cocap_opt.experiments.sweeps import results as results_module
from cocap_opt.experiments.sweeps.cells import (
    BOUND,
    OWN,
    CellFile,
    Status,
    Store,
    SweepCell,
)
from cocap_opt.experiments.sweeps.cluster import Cluster
from cocap_opt.experiments.sweeps.crew import Alone
from cocap_opt.experiments.sweeps.folder import only_writer
from cocap_opt.experiments.sweeps.instances import Instance, Settings
from cocap_opt.experiments.sweeps.results import RunFile, load_results
from cocap_opt.experiments.sweeps.sweep import Hired, sweep
from cocap_opt.experiments.sweeps.work import BoundStart, Task
from cocap_opt.experiments.tables import rows as rows_module
from cocap_opt.experiments.tables.layout import FOLDERS, Paths
from cocap_opt.experiments.tables.rows import GapRow
from cocap_opt.files.documents import PlanFile, SceneFile, decode_document, problem_digest
from cocap_opt.formulations.certificates import CertificateFile, ProofFile
from cocap_opt.method import Method
from cocap_opt.model import compiled
from cocap_opt.output.trace import Trace
from cocap_opt.problem import NO_RULES, Plan, Problem
from cocap_opt.referee import check
from cocap_opt.result import Reason, Result, relative_gap
from cocap_opt.run.engine import SOLVERS
from cocap_opt.run.judged import RefereeError
from cocap_opt.scenarios import load_scene
from cocap_opt.scenarios.built_in.field import field
from cocap_opt.stop import Interrupt, Stop, never
from cocap_opt.vision.coverage import usable_cores


class Listed(Alone):
    """This process, which says what it was asked to compute."""

    def __init__(self, stop: Stop = never) -> None:
        super().__init__(stop, Watch())
        self.begun: list[SweepCell] = []

    def begin(self, task: Task) -> None:
        """Keep the cell."""
        self.begun.append(task.cell)
        super().begin(task)


def computed(some: list[Instance], folder: Path | None, retry: bool = False) -> list[str]:
    """Compute what is missing in this process; the planners whose cells were computed."""
    store, crew = Store(folder, retry), Listed()
    for instance in some:
        instance.recall(store)
    crew.run(some, store, never, lambda content: None)
    return [cell.planner for cell in crew.begun]


def swept(some: list[Instance], folder: Path | None) -> list[GapRow]:
    """Rows of a sweep in this process, with all its files."""
    return sweep(some, folder, Hired(cell_limit=1e4))


def table(some: list[Instance]) -> list[GapRow]:
    """Rows without what depends on the machine."""
    return untimed([row for instance in some if instance.is_whole for row in instance.rows()])


def untimed(rows: Sequence[GapRow]) -> list[GapRow]:
    """Rows without what depends on the machine."""
    return [replace(row, **dict.fromkeys(TIMES)) for row in rows]


def staying(problem: Problem, stop: Stop) -> Result:
    """A planner that moves nobody."""
    plan = Plan.hovering(problem)
    assert plan is not None
    return Result(plan, check(problem, plan).reward, Reason.FINISHED)


@pytest.mark.slow
def test_what_is_known_is_not_computed_again(tmp_path: Path) -> None:
    """A second run computes nothing and makes the same rows, whatever the order of planners."""
    folder = folder_for_a_sweep(tmp_path / "run")
    first, again = instances(), instances()
    assert len(computed(first, folder)) == 4 * (len(PLANNER_NAMES) + 1)
    assert computed(again, folder) == []
    assert [instance.rows() for instance in again] == [instance.rows() for instance in first]
    assert computed(instances(planners=PLANNER_NAMES[::-1]), folder) == []


def test_a_bound_is_computed_anew_for_better_plans_only(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """New planners cost their own cells, and the bound where they are better; no row has an
    optimum that is below a plan that obeys the rules."""
    for name in ("stays", "stays-too"):
        monkeypatch.setitem(SOLVERS, name, Method(staying))
    folder = folder_for_a_sweep(tmp_path / "run")
    for planners, expected in (
        (("stays",), {"stays", BOUND}),
        (("stays", "cocap"), {"cocap", BOUND}),
        (("stays-too", "cocap"), {"stays-too"}),
        (("cocap", "stays"), set()),
    ):
        some = instances(range(1), planners)
        assert set(computed(some, folder)) == expected
        for row in table(some):
            assert row.conflicts or row.reward <= row.optimum <= row.bound * (1 + 1e-9)


def test_a_bound_begins_with_the_best_of_all_whoever_found_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The best plan, the best that obeys the rules, the lowest bound; names and order are none."""

    def crossed(problem: Problem, stop: Stop) -> Result:
        paths = SOLVERS["cocap"](problem, stop).plan.paths
        plan = Plan(paths=paths[::-1])  # the drones are alike but for their starts
        return Result(plan, check(problem, plan).reward, Reason.FINISHED)

    symmetric = small_field(0, steps=3)
    first, second = symmetric.robots
    monkeypatch.setitem(SOLVERS, "twin", Method(crossed))
    problem = symmetric.replace(robots=(first, second.replace(start=first.start)), rules=NO_RULES)
    found = planned(problem, ("cocap", "twin"))
    one, other = (content.plan.plan for content in found if content.plan)
    assert one != other and found[0].row.reward == found[1].row.reward
    assert BoundStart.of(found) == BoundStart.of(found[::-1])
    found = planned(load_scene("tiny-queue", 0), ("cocap", "branch-and-price", "greedy"))
    start = BoundStart.of(found)
    assert start == BoundStart.of(found[::-1])
    assert start.plan == found[2].plan.plan and found[2].row.conflicts  # type: ignore[union-attr]
    assert start.valid in [content.plan.plan for content in found[:2] if content.plan]
    assert start.certificate == found[1].certificate(OWN)
    assert len({start.digest, *(s._replace(**{k: v}).digest for s, k, v in (
        (start, "plan", None), (start, "valid", None), (start, "certificate", b"")
    ))}) == 4  # fmt: skip


def planned(problem: Problem, planners: tuple[str, ...]) -> list[CellFile]:
    """What planners' cells hold."""
    return [task.run() for task in Instance(problem, 0, planners, SETTINGS).missing()]


def test_another_plan_under_the_same_name_has_a_bound_of_its_own(tmp_path: Path) -> None:
    """What a bound begins with is known by its content: a better plan in the same file counts."""
    folder, problem = folder_for_a_sweep(tmp_path / "run"), small_field(0)
    settings = msgspec.structs.replace(SETTINGS, bound_time_limit=0.0)
    for name in ("stays", "cocap"):
        plan = (staying if name == "stays" else SOLVERS[name])(problem, never).plan
        assert plan is not None
        instance = Instance(problem, 0, (), settings, {"mine.json": plan})
        assert computed([instance], folder) == [BOUND]
        assert (instance.rows()[0].optimum or 0.0) >= instance.rows()[0].reward


def test_a_bound_below_a_plan_is_an_error(tmp_path: Path) -> None:
    """Wherever it comes from, it is never shown as a bound."""
    folder = folder_for_a_sweep(tmp_path / "run")
    computed(instances(range(1)), folder)
    some = instances(range(1))
    for key in ("bound", "optimum", "bound_free", "optimum_free"):
        some[0].recall(Store(folder))
        instance = some[0]
        assert instance.bound is not None and instance.bound.columns is not None
        columns = replace(instance.bound.columns, **{key: 1.0})
        wrong = msgspec.structs.replace(instance.bound, columns=columns)
        instance.bound = instance.held(wrong)
        assert all(key in row.message or row.bound is None for row in instance.rows())
        assert {row.bound_reason for row in instance.rows()} == {"error"}
        assert key in instance.bound.message
        some = instances(range(1))


@pytest.mark.slow
def test_the_files_that_rows_name_prove_them(tmp_path: Path) -> None:
    """Whatever ran in the folder in between: scene, plans, certificates and traces are a row's."""
    short = msgspec.structs.replace(SETTINGS, time_limit=0.0, bound_time_limit=0.0)
    found = []
    for settings in (short, SETTINGS, short):
        rows = swept(instances(range(1), settings=settings), tmp_path)
        assert untimed(load_results(tmp_path)) == untimed(rows)
        for row in rows:
            assert PlanFile.read(tmp_path / Paths(row).plan).reward == row.reward
            scene = SceneFile.read(tmp_path / Paths(row).scene).problem
            assert problem_digest(scene) == PlanFile.read(tmp_path / Paths(row).plan).digest
            for key, free in (("bound", False), ("bound_free", True)):
                last = Trace.load(tmp_path / Paths(row).trace(free)).snapshots[-1]
                bound = getattr(row, key)
                assert last.bound == pytest.approx(math.inf if bound is None else bound)
                proof = tmp_path / Paths(row).certificate(free)
                assert proof.is_file() is (bound is not None)
                if proof.is_file():
                    content = decode_document(proof.read_bytes(), "", CertificateFile, ProofFile)
                    assert content.proved == bound
        found.append(untimed(rows))
    weak, proved, again = ({row.planner: row for row in rows} for rows in found)
    assert weak != proved
    for name, row in again.items():  # plans of its own limits, and the bound that was proved
        assert (row.reward, row.time_limit) == (weak[name].reward, 0.0)
        assert (row.bound, row.optimum) == (proved[name].bound, proved[name].optimum)


@pytest.mark.parametrize("own_starts", [False, True])
def test_a_folder_can_be_verified_anywhere(own_starts: bool, tmp_path: Path) -> None:
    """Scene, plan and certificate are all that `verify` needs; a row says where they are."""
    some = [Instance(small_field(1), 1, ("cocap",), SETTINGS, own_starts=own_starts)]
    (row,) = swept(some, tmp_path)
    assert (row.seed is None) is own_starts
    paths = (Paths(row).scene, Paths(row).plan, Paths(row).certificate(free=False))
    assert commands.run(["verify", *(str(tmp_path / path) for path in paths)]) == 0


def in_table(rows: Sequence[GapRow]) -> list[GapRow]:
    """Untimed rows, sorted."""
    return sorted(untimed(rows), key=lambda row: (*row.key, row.planner))


@pytest.mark.slow
def test_results_accumulate(tmp_path: Path) -> None:
    """Commands one after the other leave the table of one command; each answers for itself."""
    whole = swept(instances(planners=("greedy", "cocap")), tmp_path / "whole")
    folder = tmp_path / "parts"
    swept(instances(range(1), ("greedy",)), folder)
    swept(instances(range(1, 2), ("cocap", "greedy")), folder)
    rows = swept(instances(range(1), ("cocap",)), folder)
    assert {(row.seed, row.planner) for row in rows} == {(0, "cocap")}
    assert in_table(load_results(folder)) == in_table(whole)
    assert (folder / "results.parquet").is_file()
    assert [run.seeds for run in RunFile.load(folder).runs] == [[0], [1]]  # the same command line


@pytest.mark.parametrize(
    "what",
    ["code", *(pytest.param(w, marks=pytest.mark.slow) for w in ("scene", "run.json", "cells"))],
)
def test_rows_that_do_not_fit_leave(
    what: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Of other code or scenes, or of nobody knows which: no table mixes them."""
    swept(instances(range(1), ("greedy",)), tmp_path)
    some = instances(range(1), ("cocap",))
    if what == "code":
        monkeypatch.setattr(results_module, "_rows_digest", lambda: "another")
    elif what == "scene":
        changed = [g.problem.replace(face_samples=1) for g in some]
        some = [Instance(problem, 0, ("cocap",), SETTINGS) for problem in changed]
    elif what == "run.json":
        (tmp_path / what).unlink()
    else:
        for path in (tmp_path / what).iterdir():
            path.unlink()
    capsys.readouterr()
    rows = swept(some, tmp_path)
    assert in_table(load_results(tmp_path)) == in_table(rows)
    assert "removed from results.csv" in capsys.readouterr().err


@pytest.mark.slow
def test_rows_of_other_limits_stay_and_the_newest_of_a_planner_wins(tmp_path: Path) -> None:
    """Limits are columns: of a scene, seed and planner there is one row, with its own limits."""
    other = Settings(time_limit=30.0, bound_time_limit=20.0, work_limit=1000)
    swept(instances(range(2), ("greedy", "cocap")), tmp_path)
    rows = swept(instances(range(1), ("cocap", "sequential"), other), tmp_path)
    assert {(row.time_limit, row.work_limit) for row in rows} == {(30.0, 1000)}
    found = {(*row.key, row.planner): row for row in load_results(tmp_path)}
    assert len(found) == 2 * (3 + 2)
    for (_, seed, planner), row in found.items():
        is_new = seed == 0 and planner != "greedy"
        assert (row.time_limit, row.work_limit) == ((30.0, 1000) if is_new else (60.0, None))
        assert row.bound_time_limit == (20.0 if seed == 0 else 60.0)  # one bound for all planners
        assert row.bound_work_limit == (1000 if seed == 0 else None)
    back = instances(range(1), ("greedy", "cocap"))
    assert computed(back, tmp_path) == []  # what it was is known still


@pytest.mark.long
def test_a_rendered_reward_stays_with_its_row(tmp_path: Path) -> None:
    """Rows with and without it stand in one table; a planner that is not named keeps its own."""
    rendered = msgspec.structs.replace(SETTINGS, rendered=True)
    (first,) = swept(instances(range(1), ("greedy",), rendered)[:1], tmp_path)
    swept(instances(range(1), ("cocap",))[:1], tmp_path)
    found = {row.planner: row.reward_rendered for row in load_results(tmp_path)}
    assert found == {"cocap": None, "greedy": first.reward_rendered}
    assert isinstance(first.reward_rendered, float)


@pytest.mark.slow
def test_a_work_limit_makes_the_same_rows_again(tmp_path: Path) -> None:
    """Whatever the machine does: a search that is cut by its units of work is cut at the same."""
    settings = Settings(time_limit=1e4, bound_time_limit=1e4, work_limit=1)
    problem = load_scene("bottleneck-tight", 1)
    runs = [
        untimed(swept([Instance(problem, 1, ("sequential", "cocap"), settings)], None))
        for _ in range(2)
    ]
    assert runs[0] == runs[1]
    assert {row.bound_limit for row in runs[0]} == {"work"}
    assert all(row.bound is not None for row in runs[0])


@pytest.mark.slow
def test_the_gap_table_is_a_function(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """Scenes are names, files or problems; it prints nothing, and says in words what is wrong."""
    frame = gap_frame(["tiny-queue", small_field(0)], ["greedy", "cocap"], out=tmp_path)
    assert capsys.readouterr() == ("", "")
    assert list(frame.scene) == ["tiny-queue", "tiny-queue", "field-2", "field-2"]
    rows = load_results(tmp_path)
    assert list(frame.reward) == [row.reward for row in rows]
    assert len(gap_frame("tiny-queue", ["greedy"], seeds=range(3), time_limit=0.0)) == 1
    assert capsys.readouterr() == ("", "")
    assert gap_frame("tiny-queue", ["cocap"], work_limit=0).bound_limit[0] == "work"
    for wrong in ({"planners": ["best"]}, {"time_limit": -1.0}, {"work_limit": -1}):
        with pytest.raises(ValueError, match="must be"):
            gap_frame("tiny-queue", **wrong)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="two have the same name"):
        gap_frame([small_field(0), small_field(1)])


@pytest.mark.slow
def test_a_row_stays_until_it_is_replaced(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A command that is killed loses no row, and the next takes all planners along."""
    first = swept(instances(range(1), ("greedy",)), tmp_path)

    def killed(*_: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(Alone, "begin", killed)
        with pytest.raises(KeyboardInterrupt):
            swept(instances(range(2), ("cocap",)), tmp_path)
    assert in_table(load_results(tmp_path)) == in_table(first)
    swept(instances(range(2), ("cocap",)), tmp_path)
    assert len(load_results(tmp_path)) == 6


def test_plans_of_others_stay(tmp_path: Path) -> None:
    """They are in the folder; a command that does not name them keeps their rows."""
    problem = small_field(0)
    plan = staying(problem, never).plan
    assert plan is not None
    swept([Instance(problem, 0, (), SETTINGS, {"mine.json": plan})], tmp_path)
    swept([Instance(problem, 0, ("cocap",), SETTINGS)], tmp_path)
    assert {row.planner for row in load_results(tmp_path)} == {"mine.json", "cocap"}


@pytest.mark.slow
def test_rows_do_not_depend_on_where_cells_are_kept(tmp_path: Path) -> None:
    """Kept in a folder or not: the same table; certificates are named where there are files."""
    kept, free = swept(instances(), tmp_path), swept(instances(), None)
    assert {row.certificate for row in free} == {row.certificate_free for row in free} == {""}
    for row in kept:
        assert (tmp_path / row.certificate).is_file()
        assert (tmp_path / row.certificate_free).is_file()
    unnamed = [replace(row, certificate="", certificate_free="") for row in kept]
    assert untimed(unnamed) == untimed(free)


def test_a_limit_counts_from_when_coverage_is_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without any time there is coverage, and a plan and a bound."""
    settings = msgspec.structs.replace(SETTINGS, time_limit=0.0, bound_time_limit=0.0)
    for number, planners in enumerate((("cocap",), ())):  # without planners, the bound is missing
        monkeypatch.setenv("COCAP_OPT_CACHE", str(tmp_path / str(number)))
        compiled.cache_clear()
        content = instances(range(1), planners, settings)[0].missing()[0].run()
        assert content.coverage_seconds and list(tmp_path.glob(f"{number}/*.coverage"))
        if planners:
            assert content.row is not None and content.row.reward is not None
            assert content.row.limit == "time" and "coverage" not in content.row.message
        else:
            assert content.columns is not None and content.columns.bound is not None


@pytest.mark.parametrize("change", ["limit", "problem", "planner", "seed", "code", "rendered"])
def test_a_cell_of_other_settings_is_another_cell(
    change: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nothing that a result depends on may change without the cell's name."""
    problem, settings = small_field(0), SETTINGS
    one = Instance(problem, 0, ["cocap"], settings).cells["cocap"]
    planner, seed = "cocap", 0
    if change == "limit":
        settings = msgspec.structs.replace(settings, time_limit=61.0)
    elif change == "rendered":
        settings = msgspec.structs.replace(settings, rendered=True)
    elif change == "problem":
        problem = problem.replace(horizon=problem.horizon - 1)
    elif change == "planner":
        planner = "cocap-vs"
    elif change == "seed":
        seed = 1
    else:
        monkeypatch.setattr(SweepCell, "digest_of_code", lambda: "other")
    other = Instance(problem, seed, [planner], settings).cells[planner]
    assert other.key != one.key


@pytest.mark.slow
def test_the_code_is_all_that_cells_depend_on(monkeypatch: pytest.MonkeyPatch) -> None:
    """Other code beside the planners, and other versions of libraries, make other cells."""
    digested = set(cells_module.digested_modules())
    reached_by_work = reached("cocap_opt.experiments.sweeps.work")
    for name in sorted(reached_by_work | reached("cocap_opt.run.engine")):
        silent = name.startswith(tuple(cells_module._SILENT)) or name == "cocap_opt"
        assert silent != bool({name, f"{name}.__init__"} & digested), name
    assert {"cocap_opt.run.engine", "cocap_opt.run.judged", "cocap_opt.planners.cocap"} <= digested
    digests = {SweepCell.digest_of_code()}
    with monkeypatch.context() as patch:
        patch.setattr(cells_module, "version", lambda name: "0.0")
        digests.add(SweepCell.digest_of_code.__wrapped__())
    monkeypatch.setattr(cells_module, "_SILENT", ("cocap_opt.output.trace",))
    digests.add(SweepCell.digest_of_code.__wrapped__())
    assert len(digests) == 3


def test_no_digest_of_the_code_where_nothing_is_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    """It takes half a second, which a table of limits of one second does not have."""
    monkeypatch.setattr(SweepCell, "digest_of_code", None)
    assert list(gap_frame("tiny-queue", ["sequential"]).planner) == ["sequential"]
    with pytest.raises(TypeError):
        gap_frame("tiny-queue", ["sequential"], workers=1)


def test_all_of_the_core_but_the_face_is_digested() -> None:
    """A module that planners or bounds use counts; the front, scenes and flights change no row.

    But where drones are at the steps, which the flights know, says how they film people.
    """
    modules = cells_module.digested_modules()
    rooms = {name.split(".")[1] for name in modules}
    assert {"planners", "formulations", "vision", "graph", "objective", "stop"} <= rooms
    assert not {"scenarios", "missions", "player", *FRONT} & rooms
    flights = {name.rpartition(".")[2] for name in modules if name.split(".")[1] == "flight"}
    assert flights == {"__init__", "bernstein", "earth", "rests", "strain", "trajectory"}


@pytest.mark.parametrize(
    ("old", "new", "is_another"),
    [
        ("The scene's name.", "The name of the scene.", False),
        ('"""Returns the row of a plan, without', '"""Returns a row of a plan, without', False),
        ("and result.bound < 0:", "and result.bound <= 0:", True),
        ("conflicts: Annotated[_Count,", "conflicts: Annotated[_Number,", True),
    ],
)
def test_meanings_of_columns_change_no_result(
    old: str, new: str, is_another: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Rows are digested but for what explains them; what computes them counts."""
    digest, text = SweepCell.digest_of_code(), Path(rows_module.__file__).read_text()
    assert text.count(old) == 1
    (tmp_path / "rows.py").write_text(text.replace(old, new))
    monkeypatch.setattr(rows_module, "__file__", str(tmp_path / "rows.py"))
    assert (SweepCell.digest_of_code.__wrapped__() != digest) is is_another


@pytest.mark.slow
def test_a_planner_that_fails_costs_its_own_cell(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is recorded with its reason, not tried again unasked, and computed once it is."""

    def broken(problem: object, stop: object) -> Result:
        raise RefereeError("it was wrong")

    folder = folder_for_a_sweep(tmp_path / "run")
    with monkeypatch.context() as patch:
        patch.setitem(SOLVERS, "cocap", Method(broken))
        first = instances()
        computed(first, folder)
        assert computed(instances(), folder) == []
    rows = table(first)
    failed = [row for row in rows if row.planner == "cocap"]
    assert {row.reason for row in failed} == {"error"}
    assert all("RefereeError: it was wrong" in row.message for row in failed)
    assert all(row.reward is None and row.bound is not None for row in failed)
    assert all(
        row.seconds is None
        for instance in first for row in instance.rows() if row.planner == "cocap"
    )  # fmt: skip
    assert all(row.gap is not None for row in rows if row.planner == "sequential")
    again = instances()
    assert "cocap" in computed(again, folder, retry=True)
    assert all(row.gap is not None for row in table(again) if row.planner == "cocap")


def test_a_bound_that_fails_leaves_the_plans(monkeypatch: pytest.MonkeyPatch) -> None:
    """Rewards are there, bounds and gaps are not, and why."""
    from cocap_opt.experiments.sweeps import work

    def broken(*_: object) -> object:
        raise MemoryError

    monkeypatch.setattr(work, "_Bounds", broken)
    some = instances()
    computed(some, None)
    for row in table(some):
        assert row.reward is not None
        assert row.bound is None and row.gap is None
        assert row.bound_reason == "error"
    assert {row.bound_seconds for instance in some for row in instance.rows()} == {None}


@pytest.mark.parametrize(
    "cut", [10, *(pytest.param(n, marks=pytest.mark.slow) for n in (0, 1, -2))]
)
def test_a_damaged_cell_is_computed_again(cut: int, tmp_path: Path) -> None:
    """A file that is no cell, or another one's, is as good as none."""
    folder = folder_for_a_sweep(tmp_path / "run")
    computed(instances(range(1)), folder)
    paths = sorted((folder / "cells").iterdir())
    paths[0].write_bytes(paths[0].read_bytes()[:cut])
    paths[1].write_bytes(paths[2].read_bytes())
    assert len(computed(instances(range(1)), folder)) == 2


@pytest.mark.slow
def test_what_an_interrupt_cut_short_is_not_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """After Ctrl-C the scene that has begun is shown as far as it got; files do not have it."""
    whole = swept(instances(range(3)), tmp_path / "whole")
    solver, calls = SOLVERS["sequential"], 0

    def pressed(problem: Problem, stop: Stop) -> Result:
        nonlocal calls
        calls += 1
        if calls == 2:
            signal.raise_signal(signal.SIGINT)
        return solver(problem, stop)

    monkeypatch.setitem(SOLVERS, "sequential", Method(pressed))
    (tmp_path / "results.parquet").write_bytes(b"of another run")
    rows = swept(instances(range(3)), tmp_path)
    assert [row.seed for row in rows] == [0, 0, 0, 1, 1, 1]
    assert {(row.certificate, row.certificate_free) for row in rows[3:]} == {("", "")}
    assert untimed(load_results(tmp_path)) == untimed(whole[:3])
    assert not (tmp_path / "results.parquet").exists()
    kept = [CellFile.read(p).cell for p in (tmp_path / "cells").iterdir()]
    assert len(kept) == 5 and {cell.planner for cell in kept if cell.seed == 1} == {"greedy"}
    assert len(list((tmp_path / "scenes").iterdir())) == 1


def test_run_json_tells_of_the_run_that_has_results(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A run that ends before it has any leaves that of the results that are there."""
    swept(instances(range(1)), tmp_path)
    before = (tmp_path / "run.json").read_bytes()

    def pressed(problem: Problem, stop: Stop) -> Result:
        signal.raise_signal(signal.SIGINT)
        return staying(problem, stop)

    monkeypatch.setitem(SOLVERS, "greedy", Method(pressed))
    swept(instances(range(4, 6)), tmp_path)
    assert (tmp_path / "run.json").read_bytes() == before


def test_cells_that_exceeded_a_lower_limit_are_tried_again(tmp_path: Path) -> None:
    """A raised --cell-limit says that they may take longer; the same one does not."""
    folder = folder_for_a_sweep(tmp_path / "run")
    cell = instances()[0].cells["cocap"]
    Store(folder).save(CellFile.failed(cell, Status.EXCEEDED, "", seconds=10.0))
    assert Store(folder, cell_limit=10.0).find(cell) is not None
    assert Store(folder, cell_limit=11.0).find(cell) is None
    rows = swept(instances(range(1)), folder)
    assert {row.reason for row in rows} == {"finished"}


def test_nobody_timed_what_was_not_planned() -> None:
    """A planner that does not take a scene has no seconds."""
    (content,) = planned(field(0, robots=3, actors=1, cells=15, steps=2), ("joint",))
    assert (content.row.reason, content.row.seconds) == ("unsupported", None)


# -- the command ----------------------------------------------------------------------------


def command(*arguments: object) -> list[str]:
    """The same in a process of its own."""
    program = "from cocap_opt.cli.main import main; main()"
    return [sys.executable, "-c", program, *small_sweep(*arguments)]


@pytest.mark.long(seconds=8)
def test_a_sweep_that_is_killed_goes_on_where_it_was(undisturbed: Path, tmp_path: Path) -> None:
    """Killed hard once it has some cells, and begun again: each cell once, the same table."""
    folder = tmp_path / "run"
    process = subprocess.Popen(
        command("--out", folder), stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL
    )
    while len(cell_times(folder)) < 6 and process.poll() is None:
        time.sleep(0.002)
    process.kill()
    process.communicate()
    assert process.returncode != 0, "it ended before it could be killed"
    written = cell_times(folder)
    assert len(written) >= 6
    assert len(load_results(folder)) % 2 == 0  # whole scenes and seeds
    assert commands.run(small_sweep("--out", folder)) == 0
    assert csv_rows(folder) == csv_rows(undisturbed)
    assert {path: cell_times(folder)[path] for path in written} == written
    assert len(cell_times(folder)) == 3 * 3
    for part in FOLDERS:
        names = {p.name for p in (folder / part).iterdir() if p.suffix in (".json", ".csv")}
        assert names == {p.name for p in (undisturbed / part).iterdir()}


def cell_times(folder: Path) -> dict[Path, int]:
    """When each cell was written."""
    return {path: path.stat().st_mtime_ns for path in (folder / "cells").glob("*.json")}


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (("--workers", usable_cores() + 1), "--workers"),
        (("--workers", 0), "--workers"),
        (("--workers", 1, "--scheduler", "tcp://127.0.0.1:9"), "--workers"),
        (("--workers", 1, "--cell-limit", 0), "--cell-limit"),
        (("--cell-limit", 5), "--cell-limit"),
        (("--retry",), "--retry"),
        (("--plan", "cocap"), "--plan: cocap"),
        (("--plan", "bound"), "--plan: bound"),
    ],
)
def test_wrong_options_are_refused(
    arguments: tuple[object, ...], word: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Workers that cannot be, options without effect, plans called as planners: one line."""
    assert commands.run(["gap", "tiny-share", *map(str, arguments)]) == 2
    captured = capsys.readouterr()
    assert word in captured.err and len(captured.err.splitlines()) == 1


@pytest.mark.slow
def test_seeds_that_change_nothing_are_one(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The same scene again is no other sample, in this command or a later one; a line says so."""
    words = ["gap", "tiny-share", "corridor", "--planner", "greedy", "--json", "--bound-limit", "0"]
    words += ["--out", str(tmp_path)]
    assert commands.run([*words, "--seeds", "0-1"]) == 0
    captured = capsys.readouterr()
    rows = json.loads(captured.out)["rows"]
    assert [(r["scene"], r["seed"]) for r in rows] == [
        ("tiny-share", 0), ("corridor", 0), ("corridor", 1)
    ]  # fmt: skip
    assert "tiny-share: seed 1 makes the scene of seed 0" in captured.err
    assert commands.run([*words, "--seeds", "2"]) == 0
    found = {(row.scene, row.seed) for row in load_results(tmp_path)}
    assert found == {("tiny-share", 0), ("corridor", 0), ("corridor", 1), ("corridor", 2)}


@pytest.mark.slow
def test_an_error_is_no_success(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The exit code is 1, now and when it is recalled, and the traceback is named and kept."""

    def broken(problem: object, stop: object) -> Result:
        raise RefereeError("it was wrong")

    monkeypatch.setitem(SOLVERS, "cocap", Method(broken))
    words = ["gap", "tiny-share", "--planner", "cocap", "--out", str(tmp_path)]
    for _ in range(2):
        assert commands.run(words) == 1
        (line,) = (line for line in capsys.readouterr().err.splitlines() if "; traceback: " in line)
        path = Path(line.partition("; traceback: ")[2])
        assert "raise RefereeError" in CellFile.read(path).traceback


@pytest.mark.slow
def test_the_table_is_written_as_parquet(undisturbed: Path) -> None:
    """The same rows as in the CSV file, with types."""
    from pyarrow.parquet import read_table

    rows = read_table(undisturbed / "results.parquet").to_pylist()
    with (undisturbed / "results.csv").open(encoding="utf-8", newline="") as file:
        texts = list(csv.DictReader(file))
    assert [*rows[0]] == [*texts[0]]
    for row, text in zip(rows, texts, strict=True):
        assert {key: "" if row[key] is None else str(row[key]) for key in row} == text
    assert {type(row["reward"]) for row in rows} == {float}
    assert {type(row["seed"]) for row in rows} == {int}


@pytest.mark.slow
def test_the_face_changes_nothing_in_its_process() -> None:
    """Neither its import nor a function sets variables; the command line has one thread."""
    code = """
import os
before = dict(os.environ)
import cocap_opt as co
co.gap, co.load("tiny-queue")
assert os.environ == before
from cocap_opt.cli.main import main
try:
    main(["recipe"])
finally:
    names = "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"
    assert [os.environ.get(name) for name in names] == ["1"] * 3
"""
    clean = {key: text for key, text in os.environ.items() if key not in ONE_THREAD}
    subprocess.run([sys.executable, "-c", code], env=clean, check=True, capture_output=True)


@pytest.mark.slow
def test_workers_have_one_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever dask is set to; and before they load NumPy."""
    for name in ONE_THREAD:
        monkeypatch.delenv(name, raising=False)
    threads = dict.fromkeys(ONE_THREAD, 7)
    with (
        dask.config.set({"distributed.nanny.pre-spawn-environ": threads}),
        Cluster.local(1, never, 60.0) as cluster,
    ):
        (found,) = cluster.client.run(lambda: dict(os.environ)).values()
    assert ONE_THREAD.items() <= found.items()


def test_the_gap_table_is_made_in_any_thread() -> None:
    """As in a server or a notebook's worker, where Ctrl-C goes to another thread."""
    with ThreadPoolExecutor(1) as thread:
        frame = thread.submit(gap_frame, "tiny-queue", ["greedy"], time_limit=10.0).result()
    assert list(frame["planner"]) == ["greedy"]


@pytest.mark.slow
def test_leftovers_of_killed_processes_are_cleared(tmp_path: Path) -> None:
    """Old temporary files go, those that somebody may be writing stay."""
    (tmp_path / "cells").mkdir()
    old, new = tmp_path / "cells" / ".cocap-opt-old", tmp_path / "cells" / ".cocap-opt-new"
    for path in (old, new):
        path.touch()
    os.utime(old, (0, 0))
    assert commands.run(["gap", "tiny-queue", "--out", str(tmp_path), "--planner", "greedy"]) == 0
    assert new.exists() and not old.exists()


def test_ctrl_c_with_nothing_to_give_is_no_success(tmp_path: Path) -> None:
    """Before anything is whole it is an interrupt, and not an empty table."""
    instance = Instance(load_scene("tiny-queue", 0), 0, ("greedy",), SETTINGS)

    @contextmanager
    def interrupted() -> Iterator[Interrupt]:
        pressed = Interrupt()
        pressed.pressed = True
        yield pressed

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Interrupt, "caught", interrupted)
        patch.setattr(Alone, "run", lambda *_: None)
        with pytest.raises(KeyboardInterrupt):
            sweep([instance], tmp_path)


# -- one folder, several commands ---------------------------------------------------------


def gap(folder: Path, *words: object) -> int:
    """Exit code of a command that adds to a folder; bounds are not searched for."""
    given = ["gap", *map(str, words), "--out", str(folder), "--bound-limit", "0"]
    return commands.run(given)


def seeds_of(folder: Path) -> list[tuple[str, int | None]]:
    """Scenes and seeds of the table, each row's."""
    return [(row.scene, row.seed) for row in load_results(folder)]


@pytest.mark.slow
def test_an_exported_scene_takes_no_seed_of_another(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """It has the name of what it was made of, and is one sample: rows never mix."""
    scene, folder = tmp_path / "corridor-3.json", tmp_path / "run"
    assert commands.run(["export", "corridor", "--seed", "3", "-o", str(scene)]) == 0
    assert gap(folder, scene, "--planner", "greedy", "--seeds", 5) == 0
    assert seeds_of(folder) == [("corridor", 0)]
    assert gap(folder, "corridor", "--planner", "greedy", "--seeds", "1-3") == 0
    assert seeds_of(folder) == [("corridor", seed) for seed in (1, 2, 3)]
    assert "a scene that now has another seed" in capsys.readouterr().err
    for row in load_results(folder):
        problem = SceneFile.read(folder / Paths(row).scene).problem
        assert problem_digest(problem) == row.digest
        assert check(problem, PlanFile.read(folder / Paths(row).plan).plan).reward == row.reward


@pytest.mark.slow
def test_an_edited_scene_leaves_its_old_rows(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Seeds that are not named again are of what the file was before."""
    scene, folder = tmp_path / "scene.toml", tmp_path / "run"
    text = """
steps = 2
[map]
size = [20, 12]
[[walk]]
points = [[5, 6], [15, 6]]
speed = 1.5
[[drones]]
count = 1
"""
    scene.write_text(text)
    assert gap(folder, scene, "--planner", "greedy", "--seeds", "0-1") == 0
    scene.write_text(text.replace("1.5", "1.6"))
    assert gap(folder, scene, "--planner", "greedy", "--seeds", "2") == 0
    assert [seed for _, seed in seeds_of(folder)] == [2]
    assert "another scene of that name" in capsys.readouterr().err


@pytest.mark.parametrize("content", [b"epoch,loss\n1,0.5\n", b"scene,seed\n\r\r", b""])
def test_a_table_that_cannot_be_read_is_not_written_over(
    content: bytes, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """It may be somebody's, or may be mended."""
    (tmp_path / "results.csv").write_bytes(content)
    assert gap(tmp_path, "tiny-share", "--planner", "greedy") == 2
    assert "results.csv" in capsys.readouterr().err
    assert (tmp_path / "results.csv").read_bytes() == content


def test_one_command_at_a_time_writes_into_a_folder(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A second one would write over the first one's rows."""
    with only_writer(tmp_path):
        assert gap(tmp_path, "tiny-share", "--planner", "greedy") == 2
    assert "another command is writing here" in capsys.readouterr().err
    assert gap(tmp_path, "tiny-share", "--planner", "greedy") == 0


def test_planners_that_are_not_named_are_not_tried_again(tmp_path: Path) -> None:
    """What became of them is known; only what is named is computed, or retried."""
    folder = folder_for_a_sweep(tmp_path / "run")
    (instance,) = instances(range(1), ("greedy", "cocap"))[:1]
    Store(folder).save(CellFile.failed(instance.cells["cocap"], Status.EXCEEDED, "", seconds=1e6))
    swept([instance], folder)
    (again,) = instances(range(1), ("sequential",))[:1]
    sweep([again], folder, retry=True)
    reasons = {row.planner: row.reason for row in load_results(folder)}
    assert reasons == {"sequential": "finished", "greedy": "finished", "cocap": "exceeded"}


def rows_by_planner(folder: Path) -> dict[str, GapRow]:
    """The table of one scene and seed, by planner."""
    return {row.planner or "": row for row in load_results(folder)}


PROVED = (
    "bound", "bound_method", "bound_reason", "bound_limit", "bound_seconds", "bound_time_limit",
    "bound_work_limit", "certificate", "bound_free", "bound_free_reason", "bound_free_limit",
    "bound_free_seconds", "certificate_free",
)  # fmt: skip


@pytest.mark.parametrize("planner", ["greedy", "cocap"])
def test_a_proved_bound_is_not_replaced_by_a_weaker_one(planner: str, tmp_path: Path) -> None:
    """Any certificate holds for the scene: the lower one stays, with columns and files."""
    words = ["tiny-queue", "--planner"]
    assert commands.run(["gap", *words, "cocap", "--out", str(tmp_path)]) == 0
    (first,) = load_results(tmp_path)
    files = {
        p: p.read_bytes() for d in ("certificates", "traces") for p in (tmp_path / d).iterdir()
    }
    fresh = tmp_path / "fresh"
    assert gap(fresh, *words, planner) == 0
    (weak,) = load_results(fresh)
    assert first.bound and weak.bound and weak.bound > first.bound
    assert gap(tmp_path, *words, planner) == 0
    rows = rows_by_planner(tmp_path)
    assert set(rows) == {"cocap", planner}
    for row in rows.values():
        assert [getattr(row, name) for name in PROVED] == [getattr(first, name) for name in PROVED]
        assert row.optimum == first.optimum and row.optimum_free == first.optimum_free
        assert row.conflicts or row.gap == relative_gap(row.reward or 0.0, first.bound)
    assert {path: path.read_bytes() for path in files} == files


def test_the_lower_of_two_bounds_is_kept_each_for_itself(tmp_path: Path) -> None:
    """One run may have the lower bound with rules and the other that without."""
    (instance,) = instances(range(1), ("cocap",))[:1]
    swept([instance], tmp_path)
    (row,) = rows_by_planner(tmp_path).values()
    (again,) = instances(range(1), ("cocap",))[:1]
    again.recall(Store(tmp_path))
    assert again.bound is not None and again.bound.columns is not None and row.bound is not None
    lower = replace(again.bound.columns, bound_free=9e9, bound_free_reason="stopped", optimum=None)
    higher = replace(again.bound.columns, bound=8e9, bound_reason="stopped", bound_time_limit=7.0)
    again.earlier_bound = msgspec.structs.replace(again.bound, columns=lower)
    again.bound = msgspec.structs.replace(again.bound, columns=higher)
    (joined,) = again.rows()
    assert (joined.bound, joined.bound_reason) == (row.bound, row.bound_reason)
    assert (joined.bound_free, joined.bound_free_reason) == (row.bound_free, row.bound_free_reason)
    assert (joined.optimum, joined.bound_time_limit) == (row.optimum, 60.0)


@pytest.mark.parametrize("what", ["gone", "damaged", "of another scene", "another bound"])
def test_an_earlier_bound_counts_with_its_certificate_only(what: str, tmp_path: Path) -> None:
    """A number in a table proves nothing."""
    swept(instances(range(1), ("cocap",))[:1], tmp_path)
    (row,) = rows_by_planner(tmp_path).values()
    path = tmp_path / row.certificate
    if what == "gone":
        path.unlink()
    elif what == "damaged":
        path.write_bytes(path.read_bytes()[:-9])
    elif what == "of another scene":
        path.write_bytes(path.read_bytes().replace(row.digest.encode(), b"0" * len(row.digest)))
    else:
        table = tmp_path / "results.csv"
        table.write_text(table.read_text().replace(str(row.bound), str((row.bound or 0) * 0.999)))
    weak = Settings(time_limit=60.0, bound_time_limit=0.0)
    swept(instances(range(1), ("greedy",), weak)[:1], tmp_path)
    assert {row.bound_time_limit for row in load_results(tmp_path)} == {0.0}


def test_a_bound_that_dies_leaves_the_earlier_one(tmp_path: Path) -> None:
    """Its certificate still holds."""
    (first,) = swept(instances(range(1), ("cocap",))[:1], tmp_path)
    (again,) = instances(range(1), ("cocap", "greedy"))[:1]
    again.recall(Store(tmp_path))
    for task in again.missing():
        again.take(task.run())
    (task,) = again.missing()
    Store(tmp_path).save(CellFile.failed(task.cell, Status.DIED, "it died", 1.0))
    rows = swept([again], tmp_path)
    assert {(row.bound, row.certificate) for row in rows} == {(first.bound, first.certificate)}


def test_an_earlier_bound_below_a_plan_is_an_error(tmp_path: Path) -> None:
    """One of the two is wrong, which nobody may miss."""
    (instance,) = instances(range(1), ("cocap",))[:1]
    swept([instance], tmp_path)
    (again,) = instances(range(1), ("cocap",))[:1]
    again.recall(Store(tmp_path))
    assert again.bound is not None and again.bound.columns is not None
    wrong = replace(again.bound.columns, bound=1e-3, optimum=None)
    again.earlier_bound = msgspec.structs.replace(again.bound, columns=wrong)
    assert {row.bound_reason for row in again.rows()} == {"error"}


@pytest.mark.parametrize("has_results", [True, False])
@pytest.mark.parametrize("what", ["newer", "damaged", "empty", "of somebody else"])
def test_a_run_file_that_cannot_be_read_is_not_written_over(
    what: str, has_results: bool, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Nothing in the folder changes, and one line says why."""
    assert gap(tmp_path / "made", "tiny-share", "--planner", "greedy") == 0
    made = (tmp_path / "made" / "run.json").read_text()
    contents = {"newer": made.replace('"version": 4', '"version": 5'), "damaged": made[:40]}
    folder = tmp_path / "run"
    folder.mkdir()
    (folder / "run.json").write_text(contents.get(what, "" if what == "empty" else "[1, 2]"))
    if has_results:
        (folder / "results.csv").write_bytes((tmp_path / "made" / "results.csv").read_bytes())
    before = {path: path.read_bytes() for path in folder.iterdir()}
    capsys.readouterr()
    assert gap(folder, "tiny-share", "--planner", "greedy") == 2
    captured = capsys.readouterr()
    assert len(captured.err.splitlines()) == 1 and "run.json" in captured.err
    assert captured.out == ""
    assert {path: path.read_bytes() for path in folder.iterdir()} == before
    with pytest.raises(ValueError, match=r"run\.json"):
        gap_frame("tiny-share", ["greedy"], out=folder)


# -- numbers that are given ---------------------------------------------------------------

NO_NUMBERS = (True, math.nan, math.inf, -1, 9.1e15, 10**400, "7", [])


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("time_limit", NO_NUMBERS),
        ("work_limit", (*NO_NUMBERS, 1.5, np.float64(1.5))),
        ("seeds", ([True], [math.nan], [-1], [1.9], [10**16], ["7"], 3, "a-b", "")),
        ("workers", (*NO_NUMBERS, 1.5, 0)),
    ],
)
def test_numbers_of_the_gap_table_are_checked_first(
    name: str, values: Sequence[object], monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is no such number is refused in words that name it, before a scene is loaded."""
    monkeypatch.setattr("cocap_opt.experiments.sweeps.scenes.Scenes.__init__", None)
    for value in values:
        with pytest.raises((TypeError, ValueError), match=f"^{name}: must be"):
            gap_frame("tiny-queue", ["greedy"], **{name: value})  # type: ignore[arg-type]


def test_limits_are_plain_numbers() -> None:
    """Those of NumPy are taken; a bound's limit is checked, too."""
    some = Settings(
        time_limit=np.float64(5), bound_time_limit=np.int64(3), work_limit=np.int32(7)  # type: ignore[arg-type]
    )  # fmt: skip
    assert some == Settings(time_limit=5, bound_time_limit=3.0, work_limit=7)
    assert [type(v) for v in (some.time_limit, some.bound_time_limit, some.work_limit)] == [
        float, float, int
    ]  # fmt: skip
    for wrong in NO_NUMBERS:
        with pytest.raises(ValueError, match=r"^bound_time_limit: must be"):
            Settings(time_limit=1.0, bound_time_limit=wrong)  # type: ignore[arg-type]
    frame = gap_frame(
        "tiny-queue", ["cocap"], np.arange(2), time_limit=np.int64(9), work_limit=np.int64(0)  # type: ignore[arg-type]
    )  # fmt: skip
    assert list(frame.bound_limit) == ["work"]
