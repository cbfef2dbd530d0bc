import os
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import msgspec
import pytest
from distributed import Client, LocalCluster
from sweeps import SETTINGS, csv_rows, folder_for_a_sweep, instances, small_field, small_sweep

from cocap_opt.cli import commands
from cocap_opt.experiments.sweeps import cluster as cluster_module
from cocap_opt.experiments.sweeps.cells import Store
from cocap_opt.experiments.sweeps.cluster import Cluster
from cocap_opt.experiments.sweeps.crew import ClusterError
from cocap_opt.experiments.sweeps.instances import Instance
from cocap_opt.experiments.sweeps.work import Task
from cocap_opt.model import compiled
from cocap_opt.problem import Problem
from cocap_opt.result import Result
from cocap_opt.run.own_planners import OwnPlanner
from cocap_opt.stop import Limit, Stop, never
from cocap_opt.vision.coverage import usable_cores


@pytest.mark.long(seconds=8)
def test_workers_make_the_same_table(undisturbed: Path, tmp_path: Path) -> None:
    """On workers of its own, as many as there are cores."""
    folder, workers = tmp_path / "run", min(2, usable_cores())
    assert commands.run(small_sweep("--out", folder, "--workers", workers)) == 0
    assert csv_rows(folder) == csv_rows(undisturbed)


@pytest.mark.long(seconds=8)
def test_workers_that_are_there_make_the_same_table(
    undisturbed: Path, local: Cluster, tmp_path: Path
) -> None:
    """Those of a scheduler that somebody has started already."""
    folder, scheduler = tmp_path / "run", local.client.scheduler.address
    assert commands.run(small_sweep("--out", folder, "--scheduler", scheduler)) == 0
    assert csv_rows(folder) == csv_rows(undisturbed)


@pytest.mark.slow
def test_a_scheduler_that_is_not_there(monkeypatch: pytest.MonkeyPatch) -> None:
    """Is named."""
    monkeypatch.setattr(cluster_module, "ANSWER", 0.5)
    with (
        pytest.raises(ClusterError, match=r"--scheduler: tcp://127\.0\.0\.1:9 does not answer"),
        Cluster.existing("tcp://127.0.0.1:9", never, 60.0),
    ):
        pass


@contextmanager
def threads(n: int, workers: int = 1) -> Iterator[LocalCluster]:
    """A cluster of threads of this process, which has no nanny."""
    with LocalCluster(
        n_workers=workers, threads_per_worker=n, processes=False, dashboard_address=None,
        scheduler_kwargs={"dashboard_address": "127.0.0.1:0"},
    ) as cluster:  # fmt: skip
        yield cluster


@pytest.mark.parametrize(("n", "words"), [(2, "--nthreads 1"), (1, "no nanny")])
def test_workers_that_cannot_take_cells_are_refused(n: int, words: str) -> None:
    """One cell at a time, and somebody to restart them; the message says what to start."""
    with (
        threads(n) as cluster,
        pytest.raises(ClusterError, match=words),
        Cluster.existing(cluster.scheduler_address, never, 60.0),
    ):
        pass


@pytest.mark.filterwarnings("ignore")  # of what is closed in its back
def test_a_lost_scheduler_is_no_cells_fault(tmp_path: Path) -> None:
    """It is one line; no cell is recorded as died."""
    folder = folder_for_a_sweep(tmp_path / "run")
    with threads(1) as cluster, Client(cluster) as client:
        crew = Cluster(client, never, 60.0)
        crew.begin(Task(instances()[0].cells["cocap"], small_field(0)))
        cluster.close()
        with pytest.raises(ClusterError, match="--scheduler: the connection was lost"):
            crew.run(instances(), Store(folder), never, lambda content: None)
    assert not list((folder / "cells").iterdir())


class AfterLooks(Stop):
    """A stop that is reached once it has been asked so many times."""

    def __init__(self, looks: int) -> None:
        self._looks = looks

    def reached(self) -> Limit | None:
        """Count one more look."""
        self._looks -= 1
        return None if self._looks >= 0 else Limit.INTERRUPT


def test_waiting_for_workers_is_said(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A sweep whose workers are all gone says once that it waits, until Ctrl-C."""
    monkeypatch.setattr(cluster_module, "POLL", 0.01)
    monkeypatch.setattr(cluster_module, "ANSWER", 0.02)
    with threads(1, workers=0) as cluster, Client(cluster) as client:
        assert Cluster(client, AfterLooks(6), 60.0).next() is None
    assert capsys.readouterr().err.count("no workers") == 1


def test_processes_that_do_not_start_are_said(monkeypatch: pytest.MonkeyPatch) -> None:
    """As when somebody kills one that begins: one line, and no traceback of dask."""

    def killed(**_: object) -> None:
        raise RuntimeError("Nanny failed to start.")

    monkeypatch.setattr(cluster_module, "LocalCluster", killed)
    with pytest.raises(ClusterError, match="did not start"), Cluster.local(1, never, 60.0):
        pass


def test_a_worker_lets_go_of_its_models_and_knows_its_code() -> None:
    """No cell uses another's model; a worker that joins late with other code computes nothing."""
    instance = instances(range(1), ("cocap",))[0]
    (task,) = instance.missing()
    assert cluster_module._run_task(task).is_finished
    assert compiled.cache_info().currsize == 0
    other = msgspec.structs.replace(task.cell, code="other")
    with pytest.raises(ClusterError, match="other code"):
        cluster_module._run_task(task._replace(cell=other))


def sent(name: str, function: Callable[[Problem, Stop], Result]) -> OwnPlanner:
    """A planner of the test's own, as workers get it."""
    return OwnPlanner.of_function(function, name, kept=False).to_be_sent()


@pytest.mark.filterwarnings("ignore")  # of processes that are killed
@pytest.mark.long(seconds=8)
def test_a_worker_that_dies_or_hangs_costs_its_own_cell(local: Cluster, tmp_path: Path) -> None:
    """Both are recorded with their reason; the only worker computes all other cells after it."""
    folder = folder_for_a_sweep(tmp_path / "run")
    assert local.client.cluster.scheduler.http_server.port != 8787  # no dashboard
    own = {
        "sleeps": sent("sleeps", lambda problem, stop: time.sleep(1000)),  # type: ignore[func-returns-value, return-value]
        "dies": sent("dies", lambda problem, stop: os._exit(1)),
    }
    hangs = Instance(small_field(0), 0, ("sleeps",), SETTINGS, foreign=own)
    impatient = Cluster(local.client, never, cell_limit=0.5, local=local.client.cluster)
    impatient.begin(hangs.missing()[0])
    assert (found := impatient.next()) is not None and found.status == "exceeded"
    some = [Instance(small_field(0), 0, ("greedy", "dies", "cocap"), SETTINGS, foreign=own)]
    some += instances(range(1, 2))[:1]
    local.run(some, Store(folder), never, lambda content: None)
    masks = local.client.run(signal.pthread_sigmask, signal.SIG_BLOCK, [])
    assert all(signal.SIGINT in blocked for blocked in masks.values())  # Ctrl-C is for us
    assert all(instance.is_whole for instance in some)
    reasons = {row.planner: row.reason for row in some[0].rows()}
    assert reasons == {"greedy": "finished", "dies": "died", "cocap": "finished"}
    assert {row.reason for instance in some[1:] for row in instance.rows()} == {"finished"}
