"""The crew that computes cells: this process, or the workers of a dask cluster."""

from typing import Protocol

from cocap_opt.experiments.console.progress import Watch
from cocap_opt.experiments.sweeps.cells import CellFile
from cocap_opt.experiments.sweeps.work import Task
from cocap_opt.stop import Stop


class ClusterError(ValueError):
    """A cluster cannot be used; the message says why in one line."""


class Crew(Protocol):
    """Computes cells, some at a time."""

    def room(self) -> int:
        """Returns how many more cells may begin now."""

    def begin(self, task: Task) -> None:
        """Begins a cell."""

    def next(self) -> CellFile | None:
        """Waits until one of the cells that have begun ends.

        Returns None after Ctrl-C, and where none has begun, once there is room for one.
        """


class Alone:
    """This process, which computes one cell after the other and shows how far each is."""

    def __init__(self, stop: Stop, watch: Watch) -> None:
        self._stop, self._watch = stop, watch
        self._task: Task | None = None

    def room(self) -> int:
        """Returns 1, or 0 once a cell has begun."""
        return int(self._task is None)

    def begin(self, task: Task) -> None:
        """Takes a cell, which `next` computes."""
        self._task = task

    def next(self) -> CellFile | None:
        """Computes the cell; after Ctrl-C it may be cut short."""
        assert self._task is not None
        task, self._task = self._task, None
        self._watch.begin(task.cell.words)
        return task.run(self._stop, self._watch)
