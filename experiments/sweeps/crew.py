"""Who computes cells: this process, or the workers of a dask cluster."""

from typing import Protocol

from cocap_opt.experiments.console.progress import Watch
from cocap_opt.experiments.sweeps.cells import CellFile
from cocap_opt.experiments.sweeps.work import Task, run_task
from cocap_opt.stop import Stop


class ClusterError(ValueError):
    """A cluster cannot be used; the message says why in one line."""


class Crew(Protocol):
    """Computes cells, some at a time."""

    def room(self) -> int:
        """How many more cells may begin now."""

    def begin(self, task: Task) -> None:
        """Begin a cell."""

    def next(self) -> CellFile | None:
        """Wait until one of those that have begun ends.

        None after Ctrl-C, and where none has begun, once there is room for one.
        """


class Alone:
    """This process, which computes one cell after the other and shows how far each is."""

    def __init__(self, stop: Stop, watch: Watch) -> None:
        self._stop, self._watch = stop, watch
        self._task: Task | None = None

    def room(self) -> int:
        """One, or none once a cell has begun."""
        return int(self._task is None)

    def begin(self, task: Task) -> None:
        """Take a cell, which `next` computes."""
        self._task = task

    def next(self) -> CellFile | None:
        """Compute the cell; it may be what Ctrl-C has left of it."""
        assert self._task is not None
        task, self._task = self._task, None
        self._watch.begin(task.cell.words)
        return run_task(task, self._stop, self._watch)
