"""The work of one cell: a planner, or the bound, and the referee after it. Runs anywhere."""

import math
import platform
from collections.abc import Mapping
from traceback import extract_tb, format_exception
from typing import Any, NamedTuple

import msgspec

from cocap_opt.experiments.console.progress import Watch
from cocap_opt.experiments.results.judging import Judged
from cocap_opt.experiments.results.rows import BoundColumns, PlannedRow
from cocap_opt.experiments.results.trace import Trace
from cocap_opt.experiments.sweeps.bounds import WITH_RULES, WITHOUT_RULES, Bounds, cover
from cocap_opt.experiments.sweeps.cells import BOUND, FREE, OWN, RULES, Cell, CellFile, Status
from cocap_opt.experiments.sweeps.start import BoundStart
from cocap_opt.files.documents import encode
from cocap_opt.formulations.certificates import CertificateFile, ProofFile
from cocap_opt.formulations.result import CertifiedResult
from cocap_opt.model import compiled
from cocap_opt.problem import Plan, Problem
from cocap_opt.result import Reason
from cocap_opt.stop import Clock, Stop, never

_NO_START = BoundStart()


class Task(NamedTuple):
    """A cell, and what is needed to compute it."""

    cell: Cell
    problem: Problem
    start: BoundStart = _NO_START  # of BOUND

    def run(self, stop: Stop = never, watch: Watch | None = None) -> CellFile:
        """Computes the cell. An error is a result, too: it costs this cell only.

        Parameters
        ----------
        stop : a limit besides the cell's own, of coverage, too
        """
        clock = Clock()
        compute = _bound if self.cell.planner == BOUND else _plan
        try:
            found = compute(self, stop, watch or Watch())
        except Exception as error:  # whatever it is, the other cells go on
            where = extract_tb(error.__traceback__)[-1]
            words = f"{type(error).__name__}: {error} (in {where.name}, line {where.lineno})"
            trace = "".join(format_exception(error))
            found = CellFile.failed(self.cell, Status.ERROR, words, traceback=trace)
        return msgspec.structs.replace(found, seconds=clock.seconds, machine=platform.node())

    def given(self, plan: Plan) -> CellFile:
        """Returns a plan of others as if a planner had found it; its seconds are not known."""
        return _planned(self.cell, self.problem, Judged.of_plan(self.problem, plan), {})


def _plan(task: Task, stop: Stop, watch: Watch) -> CellFile:
    """Runs a planner."""
    cell, problem = task.cell, task.problem
    cover(problem, stop, watch)
    watch.show(cell.planner)
    judged = Judged.planned(problem, cell.planner, cell.allowance.begin(stop))
    columns = {"time_limit": cell.time_limit, "work_limit": cell.work_limit}
    if judged.result.reason is Reason.UNSUPPORTED:  # nobody timed it
        columns["seconds"] = None
    return _planned(cell, problem, judged, columns)


def _planned(
    cell: Cell, problem: Problem, judged: Judged[Any], columns: dict[str, Any]
) -> CellFile:
    if cell.rendered:
        columns = {**columns, "reward_rendered": _rendered_reward(problem, judged)}
    own = judged.result.certificate if isinstance(judged.result, CertifiedResult) else None
    return CellFile(
        cell=cell,
        status=Status.FINISHED,
        row=PlannedRow.of_planner(problem, cell.seed, cell.planner, judged, **columns),
        plan=judged.plan_file(problem, cell.planner),
        certificates=_encoded({OWN: own}),
    )


def _rendered_reward(problem: Problem, judged: Judged[Any]) -> float | None:
    """Returns J of a plan's rendered pixels; None where there is no plan."""
    from cocap_opt.experiments.results.rendered import FaceView, Pose
    from cocap_opt.vision.render import Renderer

    if judged.result.plan is None or judged.verdict is None:
        return None
    poses = Pose.all_of(judged.result.plan, problem.first_step)
    views = FaceView.all_from(compiled(problem), Renderer(problem), poses)
    return FaceView.reward(problem, views, judged.verdict.reward_moves)


def _bound(task: Task, stop: Stop, watch: Watch) -> CellFile:
    """Bounds all plans of an instance, and those of the scene without rules."""
    cell, problem = task.cell, task.problem
    cover(problem, stop, watch)
    cover(problem.without_rules(), stop, watch)
    traces = {WITH_RULES: Trace(), WITHOUT_RULES: Trace()}
    bounds = Bounds(
        problem, _start_plans(problem, task.start), cell.allowance, stop,
        lambda name: traces[name].beside(watch.report(f"{name}:")),
    )  # fmt: skip
    under, free = bounds.search()
    traces[WITHOUT_RULES].end(free.result)
    if free is under:
        traces[WITH_RULES] = traces[WITHOUT_RULES]
    else:
        traces[WITH_RULES].end(under.result)
    limits = {"bound_time_limit": cell.time_limit, "bound_work_limit": cell.work_limit}
    return CellFile(
        cell=cell,
        status=Status.FINISHED,
        columns=BoundColumns.of_bounds(under, free, **limits),
        certificates=_encoded({
            RULES: under.result.certificate,
            FREE: None if free is under else free.result.certificate,
        }),
        traces={RULES: traces[WITH_RULES].text, FREE: traces[WITHOUT_RULES].text},
    )  # fmt: skip


def _encoded(
    certificates: Mapping[str, CertificateFile | ProofFile | None],
) -> dict[str, msgspec.Raw]:
    """Returns the content of the files that there are."""
    return {name: msgspec.Raw(encode(c)) for name, c in certificates.items() if c is not None}


def _start_plans(problem: Problem, start: BoundStart) -> list[Judged[Any]]:
    """Returns the start as judged plans."""
    plans = [
        Judged.of_plan(problem, plan) for plan in (start.plan, start.valid) if plan is not None
    ]
    if (own := start.proof) is None:
        return plans
    proved = CertifiedResult(
        None, -math.inf, Reason.FINISHED, bound=own.proved, seconds=start.seconds, certificate=own
    )
    return [*plans, Judged(proved, None)]
