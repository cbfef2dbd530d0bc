"""Runs the missing cells of a sweep on a crew.

The planners' cells of an instance come first, then its bound, which begins with the best of their
plans.
"""

from collections import deque
from collections.abc import Callable, Sequence

from cocap_opt.experiments.sweeps.cells import BOUND, Cell, CellFile, Store
from cocap_opt.experiments.sweeps.crew import Crew
from cocap_opt.experiments.sweeps.instances import Instance
from cocap_opt.experiments.sweeps.work import Task
from cocap_opt.stop import Stop


def run(
    instances: Sequence[Instance],
    crew: Crew,
    store: Store,
    stop: Stop,
    told: Callable[[CellFile], None],
) -> None:
    """Computes what is missing. After Ctrl-C what has begun comes to an end, if it can.

    Parameters
    ----------
    told : of each cell that has ended, or has been recalled since
    """
    owner: dict[Cell, Instance] = {}
    queue: deque[Task] = deque()
    running = 0
    for instance in instances:
        tasks = instance.missing()
        owner |= dict.fromkeys((task.cell for task in tasks), instance)
        queue += tasks
    while queue or running:
        while queue and crew.room() > 0:
            crew.begin(queue.popleft())
            running += 1
        content = crew.next()
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
