"""Instances of a sweep: a scene with a seed, its cells, and the rows made of them."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Any, TypeVar

import msgspec
from msgspec import UNSET

from cocap_opt.experiments.sweeps.cells import (
    BOUND,
    FREE,
    RULES,
    CellFile,
    Status,
    Store,
    SweepCell,
)
from cocap_opt.experiments.sweeps.work import BoundStart, Task
from cocap_opt.experiments.tables.rows import OWN_STARTS, BoundColumns, GapRow, PlannedRow
from cocap_opt.files.documents import PlanFile, problem_digest
from cocap_opt.formulations.result import proved_by
from cocap_opt.planners import RECOMMENDED
from cocap_opt.problem import Plan, Problem
from cocap_opt.result import Reason, Result
from cocap_opt.run.judged import (
    Judged,
    RefereeError,
)
from cocap_opt.run.options import Option
from cocap_opt.run.own_planners import OwnPlanner
from cocap_opt.stop import NO_LIMIT

_T = TypeVar("_T")
_FIRST = "sequential"  # an exact method starts from its plan; it finds one quickly in any scene
Key = tuple[str, int | None]  # scene and seed; None if the starts are the scene file's own


class Settings(msgspec.Struct, frozen=True, kw_only=True):
    """The limits and options of a command, which all of its cells share."""

    time_limit: float  # s, for each planner
    bound_time_limit: float  # s, for each of the two bounds
    work_limit: int | None = None  # units of work, for each planner and each bound
    rendered: bool = False  # J of the rendered pixels is computed, too
    kept: bool = True  # cells are saved, or computed in other processes
    # The only planner is an exact method, whose certificate is the bound: there is no other search.
    proves_itself: bool = False

    def __post_init__(self) -> None:
        """Converts NumPy numbers to plain ones, and raises UsageError if a limit is not valid."""
        for name in ("time_limit", "bound_time_limit"):
            seconds = Option(name).require_seconds(getattr(self, name))
            msgspec.structs.force_setattr(self, name, seconds)
        if self.work_limit is not None:
            units = Option("work_limit").require_whole(self.work_limit)
            msgspec.structs.force_setattr(self, "work_limit", units)

    @property
    def cell_limit(self) -> float:
        """Seconds after which a worker counts as hung: ten times both limits, plus ten minutes."""
        return 10 * (self.time_limit + self.bound_time_limit) + 600


def _default_planners(problem: Problem) -> list[str]:
    """Returns a gap table's planners: the paper's, the recommended one, and joint if possible."""
    names = ["greedy", "sequential", "cocap", "cocap-vs", RECOMMENDED]
    return [*names, "joint"] if len(problem.robots) <= 2 else names


class Instance:
    """A scene with a seed: its cells, and their results so far.

    Parameters
    ----------
    planners : None for the paper's planners, the recommended one, and joint for one or two drones
    given : plans from files by name; their rows come after those of the planners
    own_starts : True if drones start where the scene's own file says, not where the seed says
    foreign : third-party planners among `planners`, by name

    Attributes
    ----------
    digest : of the problem
    asked : the requested planners, and the names of the given plans
    cells : the planners' cells, by name; the bound's cell depends on the results of all of them
    found : the planners' cells that have ended, with their results
    bound : the result of the bound's cell, once it has ended
    earlier_bound : the bound of an earlier command on the same scene, with its certificates
    is_cut : True if Ctrl-C cut one of its cells short
    """

    def __init__(
        self,
        problem: Problem,
        seed: int,
        planners: Sequence[str] | None,
        settings: Settings,
        given: Mapping[str, Plan | PlanFile] | None = None,
        own_starts: bool = False,
        foreign: Mapping[str, OwnPlanner] = MappingProxyType({}),
    ) -> None:
        self._foreign = foreign
        self.problem, self.seed, self._settings = problem, seed, settings
        self._foreign_starts = own_starts
        self.digest = problem_digest(problem)
        self.cells: dict[str, SweepCell] = {}
        self.found: dict[SweepCell, CellFile] = {}
        self.bound: CellFile | None = None
        self.earlier_bound: CellFile | None = None
        self.is_cut = False
        for name in _default_planners(problem) if planners is None else planners:
            self.cells[name] = self.cell(name)
        for name, plan in (given or {}).items():
            self.give(name, plan)
        self.asked = tuple(self.cells)

    @property
    def key(self) -> Key:
        """Scene and seed, as in its rows."""
        return self.problem.name, None if self._foreign_starts else self.seed

    # -- cells --------------------------------------------------------------------------------

    def cell(self, planner: str) -> SweepCell:
        """Returns the cell that a planner has, or would have, with the settings of the command."""
        settings, foreign = self._settings, self._foreign.get(planner)
        return self._cell(
            planner, settings.time_limit, settings.work_limit, rendered=settings.rendered,
            planner_digest="" if foreign is None else foreign.digest,
            start=_FIRST if settings.proves_itself else "",
        )  # fmt: skip

    def earlier_cells(self, row: GapRow) -> list[SweepCell]:
        """Returns the cells from which an earlier row may come, with the limits of that row."""
        if row.planner is None or row.time_limit is None:
            return []
        limits, digest = (row.time_limit, row.work_limit), row.planner_digest or ""
        return [
            self._cell(row.planner, *limits, rendered=rendered, planner_digest=digest)
            for rendered in (True, False)
        ]

    def _cell(self, planner: str, seconds: float, work: int | None, **more: Any) -> SweepCell:
        code = SweepCell.digest_of_code() if self._settings.kept else ""  # it takes half a second
        return SweepCell(
            scene=self.problem.name, seed=self.seed, planner=planner, digest=self.digest,
            time_limit=seconds, work_limit=work, code=code, **more,
        )  # fmt: skip

    def take(self, content: CellFile) -> None:
        """Adds a planner's cell that has ended, with its result."""
        self.cells[content.cell.planner] = content.cell
        self.found[content.cell] = content

    def give(self, name: str, plan: Plan | PlanFile) -> None:
        """Adds a plan from a file; a `PlanFile` also describes its search."""
        self.take(Task(self.cell(name), self.problem).given(plan))

    def plan(self, name: str) -> Plan | None:
        """Returns the plan of a planner or of a file; None if there is none yet."""
        content = self.found.get(self.cells[name])
        return None if content is None or content.plan is None else content.plan.plan

    def missing(self) -> list[Task]:
        """Returns the tasks that can start: planners' cells, or the bound once all have ended."""
        cells = [cell for cell in self.cells.values() if cell not in self.found]
        if not cells and self.bound is None:
            return [] if self._settings.proves_itself else [self._bound_task()]
        return [Task(cell, self.problem, foreign=self._foreign.get(cell.planner)) for cell in cells]

    def _bound_task(self) -> Task:
        start = BoundStart.of([self.found[cell] for cell in self.cells.values()])
        settings = self._settings
        cell = self._cell(
            BOUND, settings.bound_time_limit, settings.work_limit, start=start.digest
        )  # fmt: skip
        return Task(cell, self.problem, start)

    def recall(self, store: Store) -> None:
        """Looks up cells that were computed before.

        A stored bound is not used if a plan's J exceeds it.
        """
        for cell in self.cells.values():
            if cell not in self.found and (content := store.find(cell)) is not None:
                self.found[cell] = content
        if self.bound is not None or len(self.found) < len(self.cells):
            return
        if self._settings.proves_itself:
            self.bound = self.held(self._bound_task().self_proved(*self.found.values()))
        else:
            content = store.find(self._bound_task().cell)
            self.bound = content if content is not None and self.held(content) is content else None

    @property
    def contents(self) -> list[CellFile]:
        """The cells that have ended so far, with their results."""
        return [*self.found.values(), *([] if self.bound is None else [self.bound])]

    def held(self, content: CellFile) -> CellFile:
        """Returns the bound's cell, or a cell with an error if a plan's J exceeds the bound."""
        try:
            if content.columns is not None:
                for row in self._planned_rows():
                    _require_bounds(row, content.columns)
        except RefereeError as error:
            return CellFile.failed(content.cell, Status.ERROR, f"RefereeError: {error}")
        return content

    @property
    def is_whole(self) -> bool:
        """All cells have been computed."""
        return self.bound is not None

    @property
    def is_finished(self) -> bool:
        """All cells have been computed, and Ctrl-C cut none of them short."""
        return self.is_whole and not self.is_cut

    # -- rows ---------------------------------------------------------------------------------

    def rows(self) -> list[GapRow]:
        """Returns a row per plan; cells that failed have rows, too."""
        bound = _bound_columns(self.proved())
        rows = [GapRow.joined(planned, bound, self.digest) for planned in self._planned_rows()]
        rows = [replace(row, coverage_seconds=self.coverage_seconds) for row in rows]
        if self._foreign_starts:
            rows = [replace(row, seed=None, starts=OWN_STARTS) for row in rows]
        return rows

    def proved(self) -> CellFile:
        """Returns the lower of this bound and the earlier one, both with and without rules.

        A bound that ended with an error stays an error, as the earlier bound may be the wrong one.
        """
        assert self.bound is not None
        earlier = self.earlier_bound
        if earlier is None or self.bound.status is Status.ERROR:
            return self.bound
        try:
            return self.held(_lower(self.bound, earlier))
        except RefereeError as error:
            return CellFile.failed(self.bound.cell, Status.ERROR, f"RefereeError: {error}")

    @property
    def coverage_seconds(self) -> float | None:
        """Seconds of the scene's coverage; the shortest time if several workers computed it."""
        found = (content.coverage_seconds for content in self.contents)
        return min((seconds for seconds in found if seconds is not None), default=None)

    def _planned_rows(self) -> list[PlannedRow]:
        return [self._planned_row(self.found[cell]) for cell in self.cells.values()]

    def _planned_row(self, content: CellFile) -> PlannedRow:
        cell = content.cell
        digest = cell.planner_digest or UNSET
        if content.row is not None:
            return replace(content.row, planner_digest=digest)
        result = Result(None, -math.inf, Reason.FAILED, seconds=math.nan, message=content.message)
        return PlannedRow.of_planner(
            self.problem, cell.seed, cell.planner, Judged(result, None),
            time_limit=cell.time_limit, work_limit=cell.work_limit, reason=str(content.status),
            reward_rendered=None if cell.rendered else UNSET, planner_digest=digest,
        )  # fmt: skip


def _bound_columns(content: CellFile) -> BoundColumns:
    if content.columns is not None:
        return content.columns
    status = str(content.status)
    return BoundColumns(
        bound_reason=status, bound_free_reason=status, bound_time_limit=content.cell.time_limit,
        bound_work_limit=content.cell.work_limit,
    )  # fmt: skip


# Columns of each of the two bounds, its value first. The time and work limits apply to both, and
# are moved with the bound under the rules.
_COLUMNS_OF = {
    RULES: (
        "bound", "bound_method", "bound_reason", "bound_limit", "bound_seconds",
        "bound_time_limit", "bound_work_limit",
    ),
    FREE: ("bound_free", "bound_free_reason", "bound_free_limit", "bound_free_seconds"),
}  # fmt: skip
_OPTIMA = {RULES: "optimum", FREE: "optimum_free"}


def _lower(new: CellFile, earlier: CellFile) -> CellFile:
    """Returns the bound's cell with the lower of two bounds, and the larger of two best known J."""
    assert earlier.columns is not None
    columns, certificates, traces = _bound_columns(new), dict(new.certificates), dict(new.traces)
    for name, (value, *others) in _COLUMNS_OF.items():
        if _or(earlier.columns, value, math.inf) < _or(columns, value, math.inf):
            taken = {field: getattr(earlier.columns, field) for field in (value, *others)}
            columns = replace(columns, **taken)
            _move(name, earlier.certificates, certificates)
            _move(name, earlier.traces, traces)
        best = max((columns, earlier.columns), key=lambda c: _or(c, _OPTIMA[name], -math.inf))
        columns = replace(columns, **{_OPTIMA[name]: getattr(best, _OPTIMA[name])})
        columns = replace(columns, **_met(columns, name))
    return msgspec.structs.replace(
        new, status=Status.FINISHED, columns=columns, certificates=certificates, traces=traces
    )


def _or(columns: BoundColumns, name: str, missing: float) -> float:
    value: float | None = getattr(columns, name)
    return missing if value is None else value


def _move(name: str, source: Mapping[str, _T], target: dict[str, _T]) -> None:
    """Replaces an entry with the one of another mapping; removes it if there is none."""
    target.pop(name, None)
    if name in source:
        target[name] = source[name]


def _met(columns: BoundColumns, name: str) -> dict[str, Any]:
    """Returns the reason and limit of a proved optimum, if the best known J attains the bound."""
    bound = _COLUMNS_OF[name][0]
    value, best = _or(columns, bound, math.inf), _or(columns, _OPTIMA[name], -math.inf)
    RefereeError.unless_bound(f"{bound} of two commands", best, value)
    if proved_by(best, value) is not Reason.OPTIMAL:
        return {}
    return {f"{bound}_reason": str(Reason.OPTIMAL), f"{bound}_limit": NO_LIMIT}


def _require_bounds(plan: PlannedRow, bound: BoundColumns) -> None:
    """Raises RefereeError if a plan's J exceeds a bound or an optimum that covers the plan."""
    if plan.reward is None:
        return
    covering = {"bound_free": bound.bound_free, "optimum_free": bound.optimum_free}
    if not plan.conflicts:
        covering = {"bound": bound.bound, "optimum": bound.optimum, **covering}
    for name, value in covering.items():
        if value is not None:
            RefereeError.unless_bound(f"{plan.planner}, {name}", plan.reward, value)
