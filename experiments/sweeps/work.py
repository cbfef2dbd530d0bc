"""What one cell takes: a planner, or the bound, and the referee after it. Runs anywhere."""

import math
import platform
import time
import traceback
from collections.abc import Mapping
from typing import NamedTuple

import msgspec

from cocap_opt.check import check
from cocap_opt.io import encode
from cocap_opt.plan import Plan
from cocap_opt.problem import Problem
from cocap_opt.result import Reason, Result
from cocap_opt.stop import FirstOf, Limit, Stop, TimeLimit, never
from experiments.files import decode_certificate, plan_file
from experiments.gap_table import Limits, bounds_of, plans_of, rendered_j
from experiments.progress import Watch, unseen
from experiments.rows import (
    Bounded,
    Judged,
    bound_part,
    of_others,
    planner_part,
)
from experiments.sweeps.cells import BOUND, Cell, CellFile, Status
from formulations.certificate import CertificateFile
from formulations.proof import ProofFile
from formulations.result import CertifiedResult

OWN = "own"  # the certificate of a planner that proves a bound itself
FREE = "-free"  # that of the bound without rules; that under the rules has no name


class Task(NamedTuple):
    """A cell, and what is needed to compute it."""

    cell: Cell
    problem: Problem
    plans: tuple[CellFile, ...] = ()  # of BOUND: what it begins with


def run_task(task: Task, stop: Stop = never, watch: Watch | None = None) -> CellFile:
    """Compute a cell. An error is a result, too: it costs this cell only.

    Parameters
    ----------
    stop : a limit besides the cell's own
    """
    begin = time.perf_counter()
    compute = _bound if task.cell.planner == BOUND else _plan
    try:
        found = compute(task, stop, unseen() if watch is None else watch)
    except Exception as error:  # whatever it is, the other cells go on
        where = traceback.extract_tb(error.__traceback__)[-1]
        words = f"{type(error).__name__}: {error} (in {where.name}, line {where.lineno})"
        found = failed(task.cell, Status.ERROR, words)
    return msgspec.structs.replace(
        found, seconds=time.perf_counter() - begin, machine=platform.node()
    )


def failed(cell: Cell, status: Status, message: str) -> CellFile:
    """What has become of a cell without a result."""
    return CellFile(cell=cell, status=status, message=message)


def given_plan(cell: Cell, problem: Problem, plan: Plan) -> CellFile:
    """A plan of others as if a planner had found it; nobody says how long that took."""
    return _planned(cell, problem, of_others(problem, plan))


def _plan(task: Task, stop: Stop, watch: Watch) -> CellFile:
    """Run a planner."""
    cell, problem = task.cell, task.problem
    plans = plans_of(problem, cell.seed, [cell.planner], _limits(cell, stop), None, watch)
    return _planned(cell, problem, plans[cell.planner])


def _limits(cell: Cell, stop: Stop) -> Limits:
    return lambda: FirstOf(stop, TimeLimit(cell.limit))


def _planned(cell: Cell, problem: Problem, judged: Judged[Result]) -> CellFile:
    row = planner_part(problem, cell.seed, cell.planner, judged)
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
    watch.coverage_of(problem)
    plans = [_judged(problem, content) for content in task.plans if content.is_finished]
    under, free = bounds_of(problem, plans, _limits(cell, stop), watch)
    named = {"": under.result.certificate}
    if free is not under:
        named[FREE] = free.result.certificate
    return CellFile(
        cell=cell,
        status=Status.FINISHED,
        row=bound_part(Bounded(under), Bounded(free, "" if free is under else FREE)),
        certificates=_encoded(named),
    )


def _encoded(
    certificates: Mapping[str, CertificateFile | ProofFile | None],
) -> dict[str, msgspec.Raw]:
    """The files' content, of those that there are."""
    return {name: msgspec.Raw(encode(c)) for name, c in certificates.items() if c is not None}


def _judged(problem: Problem, content: CellFile) -> Judged[Result]:
    """A planner's result, as far as a bound needs it, with the verdict of the referee."""
    plan = None if content.plan is None else content.plan.plan
    verdict = None if plan is None else check(problem, plan)
    value = -math.inf if verdict is None else verdict.reward
    reason, limit = Reason(content.row["reason"]), Limit(content.row["limit"])
    if OWN not in content.certificates:
        return Judged(Result(plan, value, reason, limit), verdict)
    own = decode_certificate(bytes(content.certificates[OWN]), content.cell.words)
    seconds = content.row["seconds"]
    proved = CertifiedResult(
        plan, value, reason, limit, own.proved, seconds, certificate=own
    )  # fmt: skip
    return Judged(proved, verdict)
