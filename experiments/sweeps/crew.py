"""The crew that computes cells: this process, or the workers of a dask cluster.

The planners' cells of an instance come first, then its bound, which begins with the best of their
plans.
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
    """A cluster cannot be used; the message says why in one line."""


class Crew(ABC):
    """Computes cells, some at a time."""

    @abstractmethod
    def room(self) -> int:
        """Returns the number of cells that may begin now."""

    @abstractmethod
    def begin(self, task: Task) -> None:
        """Begins a cell."""

    @abstractmethod
    def next(self) -> CellFile | None:
        """Waits until one of the cells that have begun ends.

        Returns None after Ctrl-C, and where none has begun, once there is room for one.
        """

    def run(
        self,
        instances: Sequence[Instance],
        store: Store,
        stop: Stop,
        told: Callable[[CellFile], None],
    ) -> None:
        """Computes what instances miss. After Ctrl-C what has begun comes to an end, if it can.

        Parameters
        ----------
        told : of each cell that has ended, or has been recalled since
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
            if is_cut:  # what was cut short is not what was asked for
                instance.is_cut = True
                queue = deque(task for task in queue if owner[task.cell] is instance)
            else:
                store.save(content)
            for task in _taken(instance, content, store, told):
                owner[task.cell] = instance
                queue.appendleft(task)


class Alone(Crew):
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


def _taken(
    instance: Instance, content: CellFile, store: Store, told: Callable[[CellFile], None]
) -> list[Task]:
    """Takes a cell that has ended; returns the bound, if it can begin now and is not known."""
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
