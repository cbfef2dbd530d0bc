"""What one cell takes: a planner, or the bound, and the referee after it. Runs anywhere."""

import math
import platform
import time
from collections.abc import Mapping
from traceback import extract_tb, format_exception
from typing import NamedTuple

import msgspec

from cocap_opt.experiments.console.progress import Watch, unseen
from cocap_opt.experiments.results.files import decode_certificate, plan_file
from cocap_opt.experiments.results.gap_table import (
    WITH_RULES,
    WITHOUT_RULES,
    Limits,
    bounds_of,
    cover,
    plans_of,
    rendered_j,
)
from cocap_opt.experiments.results.rows import (
    Bounded,
    Judged,
    bound_part,
    of_others,
    planner_part,
    without_rules,
)
from cocap_opt.experiments.results.trace import Trace, both, trace_text
from cocap_opt.experiments.sweeps.cells import BOUND, FREE, OWN, RULES, Cell, CellFile, Status
from cocap_opt.experiments.sweeps.start import Start
from cocap_opt.files.documents import encode
from cocap_opt.formulations.certificates.certificate import CertificateFile
from cocap_opt.formulations.certificates.proof import ProofFile
from cocap_opt.formulations.result import CertifiedResult
from cocap_opt.problem.plan import Plan
from cocap_opt.problem.problem import Problem
from cocap_opt.result import Reason, Result
from cocap_opt.stop import FirstOf, Stop, TimeLimit, never

NO_START = Start()


class Task(NamedTuple):
    """A cell, and what is needed to compute it."""

    cell: Cell
    problem: Problem
    start: Start = NO_START  # of BOUND: what it begins with


def run_task(task: Task, stop: Stop = never, watch: Watch | None = None) -> CellFile:
    """Compute a cell. An error is a result, too: it costs this cell only.

    Parameters
    ----------
    stop : a limit besides the cell's own, of coverage, too
    """
    begin = time.perf_counter()
    compute = _bound if task.cell.planner == BOUND else _plan
    try:
        found = compute(task, stop, unseen() if watch is None else watch)
    except Exception as error:  # whatever it is, the other cells go on
        where = extract_tb(error.__traceback__)[-1]
        words = f"{type(error).__name__}: {error} (in {where.name}, line {where.lineno})"
        found = failed(task.cell, Status.ERROR, words, traceback="".join(format_exception(error)))
    return msgspec.structs.replace(
        found, seconds=time.perf_counter() - begin, machine=platform.node()
    )


def failed(
    cell: Cell, status: Status, message: str, seconds: float = 0.0, traceback: str = ""
) -> CellFile:
    """What has become of a cell without a result."""
    return CellFile(cell=cell, status=status, message=message, seconds=seconds, traceback=traceback)


def given_plan(cell: Cell, problem: Problem, plan: Plan) -> CellFile:
    """A plan of others as if a planner had found it; nobody says how long that took."""
    return _planned(cell, problem, of_others(problem, plan))


def _plan(task: Task, stop: Stop, watch: Watch) -> CellFile:
    """Run a planner."""
    cell, problem = task.cell, task.problem
    cover(problem, stop, watch)
    plans = plans_of(problem, cell.seed, [cell.planner], _limits(cell, stop), None, watch)
    return _planned(cell, problem, plans[cell.planner])


def _limits(cell: Cell, stop: Stop) -> Limits:
    return lambda: FirstOf(stop, TimeLimit(cell.limit))


def _planned(cell: Cell, problem: Problem, judged: Judged[Result]) -> CellFile:
    row = planner_part(problem, cell.seed, cell.planner, judged)
    if judged.result.reason is Reason.UNSUPPORTED:  # nobody timed it
        row["seconds"] = None
    if cell.rendered:
        row["reward_rendered"] = rendered_j(problem, judged)
    own = judged.result.certificate if isinstance(judged.result, CertifiedResult) else None
    return CellFile(
        cell=cell,
        status=Status.FINISHED,
        row=row,
        plan=plan_file(problem, cell.planner, judged),
        certificates=_encoded({OWN: own}),
    )


def _bound(task: Task, stop: Stop, watch: Watch) -> CellFile:
    """Bound all plans of a scene and seed, and those of the scene without rules."""
    cell, problem = task.cell, task.problem
    cover(problem, stop, watch)
    cover(without_rules(problem), stop, watch)
    traces = {WITH_RULES: Trace(), WITHOUT_RULES: Trace()}
    under, free = bounds_of(
        problem, _start_plans(problem, task.start), _limits(cell, stop), watch,
        lambda run: both(watch.report(f"{run}:"), traces[run].report),
    )  # fmt: skip
    traces[WITHOUT_RULES].end(free.result)
    if free is under:
        traces[WITH_RULES] = traces[WITHOUT_RULES]
    else:
        traces[WITH_RULES].end(under.result)
    named = {RULES: under.result.certificate}
    if free is not under:
        named[FREE] = free.result.certificate
    return CellFile(
        cell=cell,
        status=Status.FINISHED,
        row=bound_part(Bounded(under), Bounded(free)),
        certificates=_encoded(named),
        traces={
            RULES: trace_text(traces[WITH_RULES]), FREE: trace_text(traces[WITHOUT_RULES])
        },
    )  # fmt: skip


def _encoded(
    certificates: Mapping[str, CertificateFile | ProofFile | None],
) -> dict[str, msgspec.Raw]:
    """The files' content, of those that there are."""
    return {name: msgspec.Raw(encode(c)) for name, c in certificates.items() if c is not None}


def _start_plans(problem: Problem, start: Start) -> list[Judged[Result]]:
    """What a bound begins with, as `bounds_of` takes it."""
    plans = [of_others(problem, plan) for plan in (start.plan, start.valid) if plan is not None]
    if not start.certificate:
        return plans
    own = decode_certificate(start.certificate, "a planner's certificate")
    proved = CertifiedResult(
        None, -math.inf, Reason.FINISHED, bound=own.proved, seconds=start.seconds, certificate=own
    )
    return [*plans, Judged(proved, None)]
