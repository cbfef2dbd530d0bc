"""A run: which cells are missing, who computes them, and the rows that they make.

The planners' cells of a scene and seed come first, then its bound, which begins with the best
of their plans.
"""

import math
from collections import deque
from collections.abc import Callable, Mapping, Sequence

import msgspec

from cocap_opt.experiments.results.rows import (
    Bounded,
    Judged,
    RefereeError,
    Row,
    bound_part,
    gap_row,
    hold_against,
    planner_part,
)
from cocap_opt.experiments.sweeps.cells import BOUND, Cell, CellFile, Status, Store, cell_of
from cocap_opt.experiments.sweeps.crew import Crew
from cocap_opt.experiments.sweeps.start import start_of
from cocap_opt.experiments.sweeps.work import Task, failed, given_plan
from cocap_opt.files.documents import problem_digest
from cocap_opt.formulations.result import no_bound
from cocap_opt.problem.plan import Plan
from cocap_opt.problem.problem import Problem
from cocap_opt.result import Reason, Result
from cocap_opt.stop import Limit, Stop


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

    Attributes
    ----------
    digest : of the problem
    asked : the planners that the command names, and plans of others that it gives
    cells : of the planners, by name; that of the bound is known once all of these are found
    found : what has become of them
    bound : what has become of the bound
    is_cut : whether Ctrl-C has cut one of them short
    """

    def __init__(
        self,
        problem: Problem,
        seed: int,
        planners: Sequence[str],
        settings: Settings,
        given: Mapping[str, Plan],
    ) -> None:
        self.problem, self.seed, self._settings = problem, seed, settings
        self.digest = problem_digest(problem)
        self.cells: dict[str, Cell] = {}
        self.found: dict[Cell, CellFile] = {}
        self.bound: CellFile | None = None
        self.is_cut = False
        for name, plan in given.items():
            self.give(name, plan)
        for name in planners:
            self.join(name)
        self.asked = tuple(self.cells)

    def cell(self, planner: str) -> Cell:
        """The cell that a planner has, or would have."""
        limit, rendered = self._settings.limit, self._settings.rendered
        return cell_of(self.problem, self.digest, self.seed, planner, limit, rendered)

    def join(self, planner: str, content: CellFile | None = None) -> None:
        """Have a planner's cell, too, of which it may be known what has become."""
        cell = self.cells.setdefault(planner, self.cell(planner))
        if content is not None:
            self.found[cell] = content

    def give(self, name: str, plan: Plan) -> None:
        """Have a plan of others, too."""
        self.join(name, given_plan(self.cell(name), self.problem, plan))

    def plan(self, name: str) -> Plan | None:
        """The plan of a planner or of others, if it is there yet."""
        content = self.found.get(self.cells[name])
        return None if content is None or content.plan is None else content.plan.plan

    def missing(self) -> list[Task]:
        """What can begin: the planners' cells, or the bound once all of them are there."""
        cells = [cell for cell in self.cells.values() if cell not in self.found]
        if not cells and self.bound is None:
            return [self._bound_task()]
        return [Task(cell, self.problem) for cell in cells]

    def recall(self, store: Store) -> None:
        """Find what is known already. A bound that a plan is better than is not known."""
        for cell in self.cells.values():
            if cell not in self.found and (content := store.find(cell)) is not None:
                self.found[cell] = content
        if self.bound is None and len(self.found) == len(self.cells):
            content = store.find(self._bound_task().cell)
            self.bound = content if content is not None and self.held(content) is content else None

    @property
    def contents(self) -> list[CellFile]:
        """What has become of its cells so far."""
        return [*self.found.values(), *([] if self.bound is None else [self.bound])]

    def held(self, content: CellFile) -> CellFile:
        """What has become of the bound: an error, if a plan is better than it."""
        try:
            for row in self._plan_parts() if content.is_finished else []:
                _hold(row, content.row)
        except RefereeError as error:
            return failed(content.cell, Status.ERROR, f"RefereeError: {error}")
        return content

    @property
    def is_whole(self) -> bool:
        """Whether all has been computed."""
        return self.bound is not None

    def rows(self) -> list[Row]:
        """A row per plan; a cell that failed has one, too."""
        assert self.bound is not None
        bound = _bound_part(self.bound)
        return [gap_row(part, bound) | {"digest": self.digest} for part in self._plan_parts()]

    def _bound_task(self) -> Task:
        start = start_of([self.found[cell] for cell in self.cells.values()])
        limit = self._settings.bound_limit
        cell = cell_of(self.problem, self.digest, self.seed, BOUND, limit, start=start.digest)
        return Task(cell, self.problem, start)

    def _plan_parts(self) -> list[Row]:
        return [self._plan_part(self.found[cell]) for cell in self.cells.values()]

    def _plan_part(self, content: CellFile) -> Row:
        if content.is_finished:
            return content.row
        cell = content.cell
        result = Result(None, -math.inf, Reason.FAILED, seconds=math.nan, message=content.message)
        part = planner_part(self.problem, cell.seed, cell.planner, Judged(result, None))
        part |= {"reward_rendered": None} if cell.rendered else {}
        return part | {"reason": str(content.status)}


def _bound_part(content: CellFile) -> Row:
    if content.is_finished:
        return content.row
    nothing = Bounded(Judged(no_bound(Limit.NONE, math.nan), None))
    status = str(content.status)
    return bound_part(nothing, nothing) | {
        "bound_reason": status, "bound_free_reason": status,
        "bound_seconds": None, "bound_free_seconds": None,
    }  # fmt: skip


def _hold(plan: Row, bound: Row) -> None:
    """Refuse bounds and optima that are below the J of a plan that they are said to cover."""
    if plan["reward"] is None:
        return
    under_rules = () if plan["conflicts"] else ("bound", "optimum")
    for key in (*under_rules, "bound_free", "optimum_free"):
        if bound[key] is not None:
            hold_against(f"{plan['planner']}, {key}", plan["reward"], bound[key])


def recall(groups: Sequence[Group], store: Store) -> tuple[int, int]:
    """Find what is known already, and say how many cells are missing and how many known."""
    missing = known = 0
    for group in groups:
        given = len(group.contents)  # plans of others
        group.recall(store)
        known += len(group.contents) - given
        missing += len(group.cells) + 1 - len(group.contents)
    return missing, known


def run(
    groups: Sequence[Group],
    crew: Crew,
    store: Store,
    stop: Stop,
    told: Callable[[CellFile], None],
) -> None:
    """Compute what is missing. After Ctrl-C what has begun comes to an end, if it can.

    Parameters
    ----------
    told : of each cell that has ended, or has been recalled since
    """
    owner: dict[Cell, Group] = {}
    queue: deque[Task] = deque()
    running = 0
    for group in groups:
        tasks = group.missing()
        owner |= dict.fromkeys((task.cell for task in tasks), group)
        queue += tasks
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
        if content.cell.planner == BOUND:
            content = group.held(content)
        if stop() is Limit.NONE:
            store.save(content)
        else:  # what was cut short is not what was asked for
            group.is_cut = True
            queue = deque(task for task in queue if owner[task.cell] is group)
        for task in _taken(group, content, store, told):
            owner[task.cell] = group
            queue.appendleft(task)


def _taken(
    group: Group, content: CellFile, store: Store, told: Callable[[CellFile], None]
) -> list[Task]:
    """Take what has become of a cell; the bound, if it can begin now and is not known."""
    if content.cell.planner == BOUND:
        group.bound = content
        told(content)
        return []
    group.found[content.cell] = content
    told(content)
    if len(group.found) < len(group.cells):
        return []
    group.recall(store)
    if group.bound is None:
        return group.missing()
    told(group.bound)
    return []
