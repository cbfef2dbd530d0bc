"""Cells on a dask cluster: one on this machine's cores, or an existing one.

Each worker has one cell at a time. If a worker is killed, only its cell fails. If the connection to
the scheduler is lost, the sweep ends, and no cell counts as failed.
"""

import logging
import os
import platform
import signal
import time
from collections.abc import Iterator
from concurrent.futures import CancelledError
from contextlib import ExitStack, contextmanager, suppress
from multiprocessing import resource_tracker
from traceback import format_exception

import dask
import distributed
from distributed import Client, Future, KilledWorker, LocalCluster, Worker, WorkerPlugin
from distributed.client import ClosedClientError

from cocap_opt.console.streams import say
from cocap_opt.console.threads import ONE_THREAD
from cocap_opt.experiments.sweeps.cells import CellFile, Status, SweepCell
from cocap_opt.experiments.sweeps.crew import ClusterError, Crew
from cocap_opt.experiments.sweeps.work import Task
from cocap_opt.model import compiled
from cocap_opt.run.own_planners import OwnPlannerError
from cocap_opt.stop import Limit, Stop

POLL = 0.2  # s between checks for Ctrl-C and for late cells
ANSWER = 10.0  # s, the longest wait for a scheduler's answer
_RESTART = 120.0  # s, enough for a worker to restart on a busy machine; a later one never does
_GONE = "--workers: the processes did not restart; results are kept; run the command again"
_LOST = "--scheduler: the connection was lost; results are kept; run the command again"
_OTHER_CODE = "has other code, or other versions of libraries, than this process"
_LOCAL = {
    "distributed.scheduler.allowed-failures": 0,  # a cell that killed its worker would do so again
    "distributed.scheduler.worker-saturation": 1.0,  # no cell waits at a busy worker
    # For workers only; this process keeps its own number of threads.
    **{f"distributed.nanny.pre-spawn-environ.{name}": n for name, n in ONE_THREAD.items()},
}


class Cluster(Crew):
    """The workers of a cluster.

    Parameters
    ----------
    stop : checked several times a second; ends the waiting
    cell_limit : time (s) after which a cell's worker is restarted
    local : the cluster, if this process started it; then no other process can add workers
    """

    def __init__(
        self, client: Client, stop: Stop, cell_limit: float, local: LocalCluster | None = None
    ) -> None:
        self.client, self._stop, self._limit, self._local = client, stop, cell_limit, local
        self._running: dict[Future, tuple[Task, float]] = {}

    @classmethod
    @contextmanager
    def local(cls, workers: int, stop: Stop, cell_limit: float) -> "Iterator[Cluster]":
        """Yields a cluster on this machine, with `workers` processes of one thread each."""
        _silence_dask()
        cores = sorted(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else [0]
        with dask.config.set(_LOCAL), ExitStack() as stack:
            try:
                with _interrupts_wait(), _started():
                    cluster = LocalCluster(
                        n_workers=workers, threads_per_worker=1, processes=True,
                        dashboard_address=None, host="127.0.0.1",
                        scheduler_kwargs={"dashboard_address": "127.0.0.1:0"},
                    )  # fmt: skip
                    client = stack.enter_context(Client(stack.enter_context(cluster)))
                    client.register_plugin(_Quiet(cores))
            except ClusterError as error:
                if stop.reached() is Limit.INTERRUPT:  # a batch system ends all processes at once
                    raise KeyboardInterrupt from error
                raise
            yield cls(client, stop, cell_limit, local=cluster)

    @classmethod
    @contextmanager
    def existing(cls, address: str, stop: Stop, cell_limit: float) -> "Iterator[Cluster]":
        """Yields a cluster whose scheduler is running, after checking that workers are usable."""
        _silence_dask()
        try:
            client = Client(address, timeout=ANSWER)
        except (OSError, ValueError, TimeoutError) as error:
            raise ClusterError(f"--scheduler: {address} does not answer: {error}") from error
        with client:
            with _scheduler_there(client):
                _require_usable(client)
            yield cls(client, stop, cell_limit)

    def room(self) -> int:
        """Returns the number of workers without a cell."""
        with _scheduler_there(self.client):
            workers: dict[str, int] = self.client.nthreads()
        return len(workers) - len(self._running)

    def begin(self, task: Task) -> None:
        """Hands a cell to a worker."""
        name = f"{task.cell.key}-{time.monotonic_ns()}"  # a retry is another piece of work
        with _scheduler_there(self.client):
            future = self.client.submit(_run_task, task, key=name, pure=False, retries=0)
        self._running[future] = task, time.monotonic()

    def next(self) -> CellFile | None:
        """Waits until a cell ends or exceeds the limit."""
        with _scheduler_there(self.client):
            return self._next()

    def _next(self) -> CellFile | None:
        looks = 0  # number of checks that found no worker
        while not self._stop.reached():
            late = time.monotonic() - self._limit
            for future, (task, begun) in list(self._running.items()):
                if future.done():
                    del self._running[future]
                    return _outcome(task, future)
                if begun < late:
                    del self._running[future]
                    self._restart(future)
                    words = f"took longer than {self._limit:g} s (--cell-limit)"
                    return CellFile.failed(task.cell, Status.EXCEEDED, words, seconds=self._limit)
            if self._running:
                with suppress(TimeoutError):
                    distributed.wait([*self._running], POLL, return_when="FIRST_COMPLETED")
            elif self.room() > 0:  # there were no workers, and now there are
                return None
            else:
                time.sleep(POLL)
                looks += 1
                if looks == round(ANSWER / POLL) and self._local is None:
                    say("there are no workers left; waiting for new ones")
                if looks == round(_RESTART / POLL) and self._local is not None:
                    raise ClusterError(_GONE)
        return None

    def _restart(self, future: Future) -> None:
        """Restarts the worker of a cell that has taken too long, as nothing else stops it."""
        busy = [w for w, keys in self.client.processing().items() if future.key in keys]
        future.cancel()
        if self._local is not None:
            self._kill(self._local, busy)
            return
        with suppress(ValueError, TimeoutError):  # a worker may have no nanny that restarts it
            self.client.restart_workers(busy, timeout=_RESTART, raise_for_error=False)

    def _kill(self, local: LocalCluster, busy: list[str]) -> None:
        """Kills workers, and waits until the scheduler notices; their nannies start new ones.

        Asking a nanny to restart its worker is not reliable: on a busy machine the
        nanny may close instead.
        """
        for nanny in local.workers.values():
            if nanny.worker_address in busy:
                os.kill(nanny.pid, getattr(signal, "SIGKILL", signal.SIGTERM))
        end = time.monotonic() + _RESTART
        while not set(busy).isdisjoint(self.client.nthreads()) and time.monotonic() < end:
            time.sleep(POLL)


def _outcome(task: Task, future: Future) -> CellFile:
    """Returns the file of a cell that has ended on a worker."""
    if future.status == "finished":
        result: CellFile = future.result()
        return result
    if future.status != "error":
        raise ClusterError(_LOST)
    error = future.exception()
    assert error is not None
    if isinstance(error, KilledWorker):
        return CellFile.failed(
            task.cell, Status.DIED, "its process died, perhaps because memory ran out"
        )
    if isinstance(error, ClusterError):
        raise error
    words, trace = f"{type(error).__name__}: {error}", "".join(format_exception(error))
    return CellFile.failed(task.cell, Status.ERROR, words, traceback=trace)


@contextmanager
def _scheduler_there(client: Client) -> Iterator[None]:
    """Raises ClusterError, with a message of one line, if the connection is lost."""
    try:
        yield
    except (OSError, CancelledError, ClosedClientError) as error:
        raise ClusterError(_LOST) from error
    except AttributeError as error:
        if client.scheduler is None:  # dask uses its attributes without checking for None
            raise ClusterError(_LOST) from error
        raise


@contextmanager
def _started() -> Iterator[None]:
    """Raises ClusterError, with a message of one line, if a process dies while it starts."""
    try:
        yield
    except RuntimeError as error:
        raise ClusterError(f"--workers: the processes did not start: {error}") from error


def _run_task(task: Task) -> CellFile:
    """Computes a cell on a worker, then drops compiled models, which the next cell cannot use."""
    if task.cell.code != SweepCell.digest_of_code():  # the worker may have joined late, unchecked
        raise ClusterError(f"the worker on {platform.node()} {_OTHER_CODE}")
    try:
        if task.foreign is not None:
            task = task._replace(foreign=task.foreign.ready())
    except OwnPlannerError as error:
        raise ClusterError(f"the worker on {platform.node()}: {error}") from error
    try:
        return task.run()
    finally:
        compiled.cache_clear()


def _silence_dask() -> None:
    """Silences dask, as this project reports errors itself."""
    for name in ("distributed", "distributed.client"):  # the latter has its own level
        logging.getLogger(name).setLevel(logging.CRITICAL)


class _Quiet(WorkerPlugin):
    """Silences each worker and pins it to its own core, so that cells do not compete for one."""

    def __init__(self, cores: list[int]) -> None:
        self._cores = cores

    def setup(self, worker: Worker) -> None:
        _silence_dask()
        if hasattr(os, "sched_setaffinity"):
            os.sched_setaffinity(0, {self._cores[int(worker.name) % len(self._cores)]})


@contextmanager
def _interrupts_wait() -> Iterator[None]:
    """Blocks Ctrl-C, which a terminal sends to all processes, in this context.

    Threads and processes that start meanwhile inherit the block, so only this process gets it.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    resource_tracker.ensure_running()  # started later, it would unblock the signal
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _require_usable(client: Client) -> None:
    try:
        client.wait_for_workers(1, timeout=ANSWER)
    except TimeoutError as error:
        raise ClusterError("--scheduler: it has no workers") from error
    for name, worker in client.scheduler_info()["workers"].items():
        if worker["nthreads"] != 1:
            words = f"has {worker['nthreads']} threads; start it with --nthreads 1"
            raise ClusterError(f"--scheduler: the worker {name} {words}")
        if not worker["nanny"]:
            words = "has no nanny to restart it when a cell hangs; start it without --no-nanny"
            raise ClusterError(f"--scheduler: the worker {name} {words}")
    _require_same_code(client)


def _require_same_code(client: Client) -> None:
    try:
        found = client.run(SweepCell.digest_of_code)
    except Exception as error:  # whatever the worker raised
        raise ClusterError(f"--scheduler: a worker cannot run this: {error}") from error
    for worker, digest in found.items():
        if digest != SweepCell.digest_of_code():
            raise ClusterError(f"--scheduler: the worker {worker} {_OTHER_CODE}")
