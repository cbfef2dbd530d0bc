import csv
import json
import random
import subprocess
import sys
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import msgspec
import pytest

from cocap_opt.coverage import usable_cores
from cocap_opt.io import decode
from cocap_opt.stop import Limit, never
from experiments.progress import unseen
from experiments.rows import SOLVERS, RefereeError
from experiments.sweeps import cells as cells_module
from experiments.sweeps import cluster as cluster_module
from experiments.sweeps.cells import BOUND, CellFile, Store
from experiments.sweeps.cluster import existing, local
from experiments.sweeps.crew import Alone, ClusterError
from experiments.sweeps.run import Group, Settings, recall, run
from scenarios import load_scene

SCENES = ("tiny-queue", "tiny-share")
PLANNER_NAMES = ("greedy", "sequential", "cocap")
SETTINGS = Settings(limit=60.0, bound_limit=60.0)
# What depends on how fast a machine is, or on where the folder is.
TIMES = ("seconds", "bound_seconds", "bound_free_seconds")


def groups(seeds: range = range(2), planners: tuple[str, ...] = PLANNER_NAMES) -> list[Group]:
    """Two small scenes."""
    return [
        Group(load_scene(scene, seed), seed, planners, SETTINGS, {})
        for scene in SCENES
        for seed in seeds
    ]


def computed(some: list[Group], folder: Path | None, retry: bool = False) -> list[CellFile]:
    """Compute what is missing in this process; the cells that were computed."""
    done: list[CellFile] = []
    store = Store(folder, retry)
    recall(some, store)
    run(some, Alone(never, unseen()), store, folder, never, done.append)
    return done


def folder_for_a_sweep(path: Path) -> Path:
    """A folder with the folders that a sweep has."""
    for part in ("cells", "plans", "certificates"):
        (path / part).mkdir(parents=True)
    return path


def table(some: list[Group]) -> list[dict[str, Any]]:
    """Rows without what depends on the machine."""
    rows = [row for group in some if group.is_whole for row in group.rows()]
    return [{key: row[key] for key in row if key not in TIMES} for row in rows]


def test_what_is_known_is_not_computed_again(tmp_path: Path) -> None:
    """A second run computes nothing and makes the same rows; new planners cost their own cells."""
    folder = folder_for_a_sweep(tmp_path / "run")
    first, again = groups(), groups()
    assert len(computed(first, folder)) == 4 * (len(PLANNER_NAMES) + 1)
    assert computed(again, folder) == []
    assert [group.rows() for group in again] == [group.rows() for group in first]
    more = computed(groups(planners=(*PLANNER_NAMES, "joint")), folder)
    assert {content.cell.planner for content in more} == {"joint", BOUND}


def test_rows_do_not_depend_on_where_cells_are_kept(tmp_path: Path) -> None:
    """Kept in a folder or not, cell by cell or at once: the same table, but for paths."""
    kept, free = groups(), groups()
    computed(kept, folder_for_a_sweep(tmp_path / "run"))
    computed(free, None)
    for one, other in zip(table(kept), table(free), strict=True):
        paths = ("certificate", "certificate_free")
        assert {k: v for k, v in one.items() if k not in paths} == {
            k: v for k, v in other.items() if k not in paths
        }


@pytest.mark.parametrize("change", ["limit", "problem", "planner", "seed", "code", "rendered"])
def test_a_cell_of_other_settings_is_another_cell(
    change: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nothing that a result depends on may change without the cell's name."""
    problem, settings = load_scene("tiny-queue", 0), SETTINGS
    one = Group(problem, 0, ["cocap"], settings, {}).cells["cocap"]
    planner, seed = "cocap", 0
    if change == "limit":
        settings = msgspec.structs.replace(settings, limit=61.0)
    elif change == "rendered":
        settings = msgspec.structs.replace(settings, rendered=True)
    elif change == "problem":
        problem = problem.replace(horizon=problem.horizon - 1)
    elif change == "planner":
        planner = "cocap-vs"
    elif change == "seed":
        seed = 1
    else:
        monkeypatch.setattr(cells_module, "code_digest", lambda: "other")
    other = Group(problem, seed, [planner], settings, {}).cells[planner]
    assert other.key != one.key


def test_a_planner_that_fails_costs_its_own_cell(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is recorded with its reason, not tried again unasked, and computed once it is."""

    def broken(problem: object, stop: object) -> object:
        raise RefereeError("it was wrong")

    folder = folder_for_a_sweep(tmp_path / "run")
    with monkeypatch.context() as patch:
        patch.setitem(SOLVERS, "cocap", broken)  # type: ignore[arg-type]
        first = groups()
        computed(first, folder)
        assert computed(groups(), folder) == []
    rows = table(first)
    failed = [row for row in rows if row["planner"] == "cocap"]
    assert {row["reason"] for row in failed} == {"error"}
    assert all("RefereeError: it was wrong" in row["message"] for row in failed)
    assert all(row["reward"] is None and row["bound"] is not None for row in failed)
    assert all(row["gap"] is not None for row in rows if row["planner"] == "sequential")
    again = groups()
    assert {content.cell.planner for content in computed(again, folder, retry=True)} == {"cocap"}
    assert all(row["gap"] is not None for row in table(again) if row["planner"] == "cocap")


def test_a_bound_that_fails_leaves_the_plans(monkeypatch: pytest.MonkeyPatch) -> None:
    """Rewards are there, bounds and gaps are not, and why."""
    from experiments.sweeps import work

    def broken(*_: object) -> object:
        raise MemoryError

    monkeypatch.setattr(work, "bounds_of", broken)
    some = groups()
    computed(some, None)
    for row in table(some):
        assert row["reward"] is not None
        assert row["bound"] is None and row["gap"] is None
        assert row["bound_reason"] == "error"


@pytest.mark.parametrize("cut", [0, 1, 10, -2])
def test_a_damaged_cell_is_computed_again(cut: int, tmp_path: Path) -> None:
    """A file that is no cell, or another one's, is as good as none."""
    folder = folder_for_a_sweep(tmp_path / "run")
    computed(groups(range(1)), folder)
    paths = sorted((folder / "cells").iterdir())
    paths[0].write_bytes(paths[0].read_bytes()[:cut])
    paths[1].write_bytes(paths[2].read_bytes())
    assert len(computed(groups(range(1)), folder)) == 2


def test_what_an_interrupt_cut_short_is_not_kept(tmp_path: Path) -> None:
    """After Ctrl-C the scene that has begun is shown as far as it got; no cell of it is kept."""
    folder = folder_for_a_sweep(tmp_path / "run")
    some, pressed = groups(), False

    def stop() -> Limit:
        return Limit.INTERRUPT if pressed else Limit.NONE

    def told(content: CellFile) -> None:
        nonlocal pressed
        pressed = pressed or content.cell.planner == "sequential"

    run(some, Alone(stop, unseen()), Store(folder), folder, stop, told)
    assert [group.is_whole for group in some] == [True, False, False, False]
    kept = [decode(p.read_bytes(), CellFile, "") for p in (folder / "cells").iterdir()]
    assert {content.cell.planner for content in kept} == {"greedy", "sequential"}


# -- the command ----------------------------------------------------------------------------


def command(*arguments: object) -> list[str]:
    """Command line of a small sweep."""
    return [
        sys.executable, "-c", "from experiments.cli import main; main()", "gap", *SCENES,
        "--planner", "greedy", "--planner", "cocap", *map(str, arguments),
    ]  # fmt: skip


def run_command(*arguments: object) -> subprocess.CompletedProcess[str]:
    """Run it to its end."""
    return subprocess.run(
        command(*arguments), capture_output=True, text=True, timeout=120, check=False
    )


def csv_rows(folder: Path) -> list[dict[str, str]]:
    """The table in a folder, without what depends on the machine."""
    with (folder / "results.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    return [{key: row[key] for key in row if key not in TIMES} for row in rows]


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of a sweep that nobody disturbed."""
    folder = tmp_path_factory.mktemp("undisturbed") / "run"
    done = run_command("--seeds", "0-3", "--out", folder)
    assert done.returncode == 0, done.stderr
    return folder


def test_a_sweep_that_is_killed_goes_on_where_it_was(undisturbed: Path, tmp_path: Path) -> None:
    """Killed hard at random moments and begun again: every cell once, the same table."""
    rng, folder = random.Random(0), tmp_path / "run"
    for _ in range(5):
        process = subprocess.Popen(
            command("--seeds", "0-3", "--out", folder), stderr=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
        )  # fmt: skip
        time.sleep(rng.uniform(0.8, 1.6))
        process.kill()
        process.communicate()
    assert run_command("--seeds", "0-3", "--out", folder).returncode == 0
    assert csv_rows(folder) == csv_rows(undisturbed)
    cells = [decode(p.read_bytes(), CellFile, "").cell for p in (folder / "cells").glob("*.json")]
    assert len(cells) == len(set(cells)) == 2 * 4 * 3
    assert {p.name for p in (folder / "plans").iterdir() if p.suffix == ".json"} == {
        p.name for p in (undisturbed / "plans").iterdir()
    }


def test_workers_make_the_same_table(undisturbed: Path, tmp_path: Path) -> None:
    """On workers of its own, as many as there are cores."""
    folder, workers = tmp_path / "run", min(2, usable_cores())
    done = run_command("--seeds", "0-3", "--out", folder, "--workers", workers)
    assert done.returncode == 0, done.stderr
    assert csv_rows(folder) == csv_rows(undisturbed)


@pytest.fixture
def scheduler(tmp_path: Path) -> Iterator[str]:
    """Address of a scheduler with two workers, all started by hand."""
    file, dask = tmp_path / "scheduler.json", [sys.executable, "-m", "dask"]
    local = ["--scheduler-file", str(file), "--host", "127.0.0.1", "--no-dashboard"]
    crew = [subprocess.Popen([*dask, "scheduler", *local, "--port", "0"], stderr=subprocess.PIPE)]
    try:
        while not file.exists():
            assert crew[0].poll() is None
            time.sleep(0.05)
        join = ["--nthreads", "1", "--nworkers", "2", "--local-directory", str(tmp_path)]
        crew.append(subprocess.Popen([*dask, "worker", *local, *join], stderr=subprocess.PIPE))
        yield json.loads(file.read_text(encoding="utf-8"))["address"]
    finally:
        for process in reversed(crew):
            process.terminate()
            process.communicate()


def test_workers_started_by_hand_make_the_same_table(
    undisturbed: Path, scheduler: str, tmp_path: Path
) -> None:
    """On the workers of a scheduler that is there already."""
    folder = tmp_path / "run"
    done = run_command("--seeds", "0-3", "--out", folder, "--scheduler", scheduler)
    assert done.returncode == 0, done.stderr
    assert csv_rows(folder) == csv_rows(undisturbed)


def test_wrong_workers_are_refused() -> None:
    """More workers than cores, none, or workers of two kinds: one line, exit code 2."""
    for arguments, word in (
        (("--workers", usable_cores() + 1), "--workers"),
        (("--workers", 0), "--workers"),
        (("--workers", 1, "--scheduler", "tcp://127.0.0.1:9"), "--workers"),
        (("--cell-limit", 0), "--cell-limit"),
    ):
        done = run_command(*arguments)
        assert done.returncode == 2, done
        assert word in done.stderr and len(done.stderr.splitlines()) == 1


def test_a_scheduler_that_is_not_there(monkeypatch: pytest.MonkeyPatch) -> None:
    """Is named."""
    monkeypatch.setattr(cluster_module, "ANSWER", 0.5)
    with (
        pytest.raises(ClusterError, match=r"--scheduler: tcp://127\.0\.0\.1:9 does not answer"),
        existing("tcp://127.0.0.1:9", never, 60.0),
    ):
        pass


BAD_PLANNERS = """
import os, time
from experiments.rows import SOLVERS
SOLVERS["sleeps"] = lambda problem, stop: time.sleep(1000)
SOLVERS["dies"] = lambda problem, stop: os._exit(1)
"""


@pytest.mark.filterwarnings("ignore")  # of processes that are killed
def test_a_worker_that_dies_or_hangs_costs_its_own_cell(tmp_path: Path) -> None:
    """Both are recorded with their reason; the only worker computes all other cells after it."""
    folder = folder_for_a_sweep(tmp_path / "run")
    some = groups(range(1), ("greedy", "dies", "sleeps", "cocap"))[:1]
    some += groups(range(1, 2))
    with local(1, never, cell_limit=8.0) as cluster:
        cluster.client.register_worker_callbacks(partial(exec, BAD_PLANNERS, {}))
        run(some, cluster, Store(folder), folder, never, lambda content: None)
    assert all(group.is_whole for group in some)
    reasons = {row["planner"]: row["reason"] for row in some[0].rows()}
    assert reasons["sleeps"] == "exceeded" and reasons["dies"] == "died"
    assert reasons["greedy"] == reasons["cocap"] == "finished"
    assert {row["reason"] for group in some[1:] for row in group.rows()} == {"finished"}


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
