"""The crew that computes cells: this process, or the workers of a dask cluster.

The planners' cells of an instance come first, then its bound, whose search starts from the best of
their plans.
"""

from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Sequence

from cocap_opt.console.progress import Watch
from cocap_opt.experiments.sweeps.cells import BOUND, CellFile, Store, SweepCell
from cocap_opt.experiments.sweeps.instances import Instance
from cocap_opt.experiments.sweeps.work import Task
from cocap_opt.stop import Stop


class ClusterError(ValueError):
    """A cluster cannot be used; the message gives the reason in one line."""


class Crew(ABC):
    """Computes cells, one or several at a time."""

    @abstractmethod
    def room(self) -> int:
        """Returns the number of cells that can start now."""

    @abstractmethod
    def begin(self, task: Task) -> None:
        """Starts a cell."""

    @abstractmethod
    def next(self) -> CellFile | None:
        """Waits until a running cell ends, and returns it.

        Returns None after Ctrl-C, or, if no cell is running, once there is room for one.
        """

    def run(
        self,
        instances: Sequence[Instance],
        store: Store,
        stop: Stop,
        told: Callable[[CellFile], None],
    ) -> None:
        """Computes the missing cells of instances.

        After Ctrl-C, this process completes its current instance with cells that are cut short; a
        cluster stops at once.

        Parameters
        ----------
        told : called with each cell that has ended, or was found in the store
        """
        owner: dict[SweepCell, Instance] = {}
        queue: deque[Task] = deque()
        running = 0
        for instance in instances:
            tasks = instance.missing()
            owner |= dict.fromkeys((task.cell for task in tasks), instance)
            queue += tasks
        while queue or running:
            while queue and self.room() > 0:
                self.begin(queue.popleft())
                running += 1
            content = self.next()
            is_cut = bool(stop.reached())
            if content is None and not is_cut:  # there is room again
                continue
            if content is None:
                return
            running -= 1
            instance = owner[content.cell]
            if content.cell.planner == BOUND:
                content = instance.held(content)
            if is_cut:  # a cell that was cut short is not saved
                instance.is_cut = True
                queue = deque(task for task in queue if owner[task.cell] is instance)
            else:
                store.save(content)
            for task in _taken(instance, content, store, told):
                owner[task.cell] = instance
                queue.appendleft(task)


class Alone(Crew):
    """This process, which computes one cell after another and shows its progress."""

    def __init__(self, stop: Stop, watch: Watch) -> None:
        self._stop, self._watch = stop, watch
        self._task: Task | None = None

    def room(self) -> int:
        """Returns 1, or 0 if a cell is waiting for `next`."""
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


def _taken(
    instance: Instance, content: CellFile, store: Store, told: Callable[[CellFile], None]
) -> list[Task]:
    """Adds a cell that has ended; returns the task of the bound if it can start now and must."""
    if content.cell.planner == BOUND:
        instance.bound = content
        told(content)
        return []
    instance.found[content.cell] = content
    told(content)
    if len(instance.found) < len(instance.cells):
        return []
    instance.recall(store)
    if instance.bound is None:
        return instance.missing()
    told(instance.bound)
    return []
