"""A run: which cells are missing, who computes them, and the rows that they make.

The planners' cells of a scene and seed come first, then its bound, which begins with the best
of their plans.
"""

import math
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import msgspec

from cocap_opt.io import problem_digest
from cocap_opt.plan import Plan
from cocap_opt.problem import Problem
from cocap_opt.result import Reason, Result
from cocap_opt.stop import Limit, Stop
from experiments.files import save, save_bytes
from experiments.gap_table import stem_of
from experiments.rows import Bounded, Judged, Row, bound_part, gap_row, planner_part
from experiments.sweeps.cells import BOUND, CellFile, Store, cell_of
from experiments.sweeps.crew import Crew
from experiments.sweeps.work import Task, given_plan
from formulations.result import no_bound


class Settings(msgspec.Struct, frozen=True, kw_only=True):
    """What all cells of a run share."""

    limit: float  # s, for each planner
    bound_limit: float  # s, for each bound
    rendered: bool = False


class Group:
    """One scene and seed: its cells, and what has become of them so far.

    Parameters
    ----------
    given : plans of others by name, which get rows of their own
    """

    def __init__(
        self,
        problem: Problem,
        seed: int,
        planners: Sequence[str],
        settings: Settings,
        given: Mapping[str, Plan],
    ) -> None:
        self.problem, self.seed = problem, seed
        digest, names = problem_digest(problem), (*given, *dict.fromkeys(planners))
        self.cells = {
            name: cell_of(problem, digest, seed, name, settings.limit, settings.rendered)
            for name in names
        }
        self.bound = cell_of(problem, digest, seed, BOUND, settings.bound_limit, planners=names)
        self.found = {
            cell: given_plan(cell, problem, given[name])
            for name, cell in self.cells.items()
            if name in given
        }

    def missing(self) -> list[Task]:
        """What can begin: the planners' cells, or the bound once all of them are there."""
        cells = [cell for cell in self.cells.values() if cell not in self.found]
        if not cells and self.bound not in self.found:
            plans = tuple(self.found[cell] for cell in self.cells.values())
            return [Task(self.bound, self.problem, plans)]
        return [Task(cell, self.problem) for cell in cells]

    @property
    def is_whole(self) -> bool:
        """Whether all has been computed."""
        return self.bound in self.found

    def rows(self) -> list[Row]:
        """A row per plan; a cell that failed has one, too."""
        bound = self._bound_part(self.found[self.bound])
        parts = (self._plan_part(self.found[cell]) for cell in self.cells.values())
        return [gap_row(part, bound) for part in parts]

    def _plan_part(self, content: CellFile) -> Row:
        if content.is_finished:
            return content.row
        cell = content.cell
        nothing = Judged(Result(None, -math.inf, Reason.FAILED, message=content.message), None)
        part = planner_part(self.problem, cell.seed, cell.planner, nothing)
        part |= {"reward_rendered": None} if cell.rendered else {}
        return part | {"reason": str(content.status)}

    def _bound_part(self, content: CellFile) -> Row:
        if content.is_finished:
            return content.row
        nothing = Bounded(Judged(no_bound(Limit.NONE, content.seconds), None))
        status = str(content.status)
        return bound_part(nothing, nothing) | {"bound_reason": status, "bound_free_reason": status}


def recall(groups: Sequence[Group], store: Store) -> tuple[int, int]:
    """Find what is known already, and say how many cells are missing and how many known."""
    missing = known = 0
    for group in groups:
        for cell in (*group.cells.values(), group.bound):
            if cell in group.found:  # a plan of others
                continue
            found = store.find(cell)
            if found is None:
                missing += 1
            else:
                known += 1
                group.found[cell] = found
    return missing, known


def run(
    groups: Sequence[Group],
    crew: Crew,
    store: Store,
    folder: Path | None,
    stop: Stop,
    told: Callable[[CellFile], None],
) -> None:
    """Compute what is missing. After Ctrl-C what has begun comes to an end, if it can.

    Parameters
    ----------
    folder : for plans and certificates
    told : of each cell that has ended
    """
    owner = {cell: group for group in groups for cell in (*group.cells.values(), group.bound)}
    queue, running = deque(task for group in groups for task in group.missing()), 0
    while queue or running:
        while queue and crew.room() > 0:
            crew.begin(queue.popleft())
            running += 1
        content = crew.next()
        if content is None and stop() is Limit.NONE:  # there is room again
            continue
        if content is None:
            return
        running -= 1
        group = owner[content.cell]
        if stop() is Limit.NONE:
            content = _published(content, group, folder)
            store.save(content)
        else:  # what was cut short is not what was asked for
            queue = deque(task for task in queue if owner[task.cell] is group)
        group.found[content.cell] = content
        told(content)
        if content.cell != group.bound and set(group.cells.values()) <= set(group.found):
            queue.extendleft(group.missing())


def _published(content: CellFile, group: Group, folder: Path | None) -> CellFile:
    """Write the plan or the certificates of a cell, and say in its row where they are."""
    if folder is None or not content.is_finished:
        return content
    stem = stem_of(group.problem, group.seed)
    if content.plan is not None:
        save(folder / f"plans/{stem}-{content.cell.planner}.json", content.plan)
    if content.cell != group.bound:
        return content
    paths = {name: f"certificates/{stem}{name}.json" for name in content.certificates}
    for name, path in paths.items():
        save_bytes(folder / path, bytes(content.certificates[name]))
    row = content.row | {
        key: paths.get(content.row[key], "") for key in ("certificate", "certificate_free")
    }
    return msgspec.structs.replace(content, row=row, certificates={})
