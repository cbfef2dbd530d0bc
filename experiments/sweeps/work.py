"""The work of one cell: runs a planner or the bound, then the referee, in any process."""

import hashlib
import math
import platform
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from traceback import extract_tb, format_exception
from typing import Any, NamedTuple

import msgspec

from cocap_opt.console.progress import Watch
from cocap_opt.experiments.sweeps.cells import BOUND, FREE, OWN, RULES, CellFile, Status, SweepCell
from cocap_opt.experiments.tables.rows import BoundColumns, PlannedRow
from cocap_opt.files.documents import PlanFile, decode_document, encode, problem_digest
from cocap_opt.formulations.certificates import CertificateFile, ProofFile
from cocap_opt.formulations.result import CertifiedResult, Report, proved_by
from cocap_opt.model import compiled, compiled_anew
from cocap_opt.output.trace import Trace
from cocap_opt.problem import Plan, Problem
from cocap_opt.result import Reason, Result, UnsupportedError
from cocap_opt.run.engine import BOUND_METHOD, run, warm_up
from cocap_opt.run.judged import Judged, RefereeError
from cocap_opt.run.options import Allowance
from cocap_opt.run.own_planners import OwnPlanner, OwnPlannerError
from cocap_opt.run.view_share import counting_gap
from cocap_opt.stop import Clock, Stop, never


class BoundStart(NamedTuple):
    """The start of the bound's search: the best plans, and the lowest bound of the planners."""

    plan: Plan | None = None  # the best of all
    valid: Plan | None = None  # the best of those that obey the rules
    certificate: bytes = b""  # content of the lowest bound's file; empty if there is none
    seconds: float = 0.0  # time in which that bound was proved

    @classmethod
    def of(cls, contents: Sequence[CellFile]) -> "BoundStart":
        """Returns the start made of planners' cells; their names and order do not matter."""
        certificate, seconds = _lowest_bound(contents)
        valid = [content for content in contents if content.row and content.row.valid]
        return BoundStart(_best_plan(contents), _best_plan(valid), certificate, seconds)

    @property
    def proof(self) -> CertificateFile | ProofFile | None:
        """The certificate or the proof of the lowest bound, if there is one."""
        return _decoded(self.certificate, "a planner's proof") if self.certificate else None

    @property
    def digest(self) -> str:
        """Digest of the plans and the proof, as a bound depends on both."""
        content = msgspec.json.encode((self.plan, self.valid)) + self.certificate
        return hashlib.sha256(content).hexdigest()


def _decoded(content: bytes, name: str) -> CertificateFile | ProofFile:
    """Returns the certificate or the proof in a file's content."""
    kinds: tuple[type[CertificateFile | ProofFile], ...] = (CertificateFile, ProofFile)
    return decode_document(content, name, *kinds)


def _best_plan(contents: Sequence[CellFile]) -> Plan | None:
    ranked = [
        (-content.row.reward, encode(content.plan.plan), content.plan.plan)
        for content in contents
        if content.plan is not None and content.row is not None and content.row.reward is not None
    ]
    return min(ranked, key=lambda entry: entry[:2])[2] if ranked else None


def _lowest_bound(contents: Sequence[CellFile]) -> tuple[bytes, float]:
    ranked = []
    for content in contents:
        if OWN in content.certificates and content.row is not None:
            file = content.certificate(OWN)
            ranked.append(
                (
                    _decoded(file, content.cell.words).proved,
                    file,
                    content.row.seconds or 0.0,
                )
            )
    return min(ranked)[1:] if ranked else (b"", 0.0)


_NO_START = BoundStart()
_WITHOUT_RULES, _WITH_RULES = "without rules", "with rules"  # names of the two searches


class Task(NamedTuple):
    """A cell, and what is needed to compute it."""

    cell: SweepCell
    problem: Problem
    start: BoundStart = _NO_START  # start of BOUND
    foreign: OwnPlanner | None = None  # a third-party planner; the cell has its name

    def run(self, stop: Stop = never, watch: Watch | None = None) -> CellFile:
        """Computes the cell. An error becomes the result of this cell, so others go on.

        Parameters
        ----------
        stop : a limit in addition to the cell's own, which start once coverage is computed
        """
        clock = Clock()
        compute = _bound if self.cell.planner == BOUND else _plan
        try:
            if self.foreign is None:
                warm_up(BOUND_METHOD if self.cell.planner == BOUND else self.cell.planner)
            compiled_anew(self.problem)
            found = compute(self, stop, watch or Watch())
            coverage_seconds = compiled(self.problem).tables.cost
        except OwnPlannerError as error:  # its message is complete
            cause = error.__cause__  # the exception that a planner raised
            trace = "" if cause is None else "".join(format_exception(cause))
            found = CellFile.failed(self.cell, Status.ERROR, str(error), traceback=trace)
            coverage_seconds = None
        except Exception as error:  # whatever it is, the other cells go on
            where = extract_tb(error.__traceback__)[-1]
            words = f"{type(error).__name__}: {error} (in {where.name}, line {where.lineno})"
            # The third-party planner is at fault, so the place in this code does not matter.
            if self.foreign is not None and isinstance(error, RefereeError):
                words = str(error)
            trace = "".join(format_exception(error))
            found = CellFile.failed(self.cell, Status.ERROR, words, traceback=trace)
            coverage_seconds = None
        return msgspec.structs.replace(
            found,
            seconds=clock.seconds,
            coverage_seconds=coverage_seconds,
            machine=platform.node(),
        )

    def self_proved(self, content: CellFile) -> CellFile:
        """Returns the bound that an exact method proved itself, as the bound's cell.

        Nothing is computed. There is no bound without rules.
        """
        if content.row is None:
            return CellFile.failed(self.cell, content.status, content.message, content.seconds)
        columns = BoundColumns.self_proved(content.row, self.start.proof)
        certificates = {RULES: content.certificates[OWN]} if OWN in content.certificates else {}
        return CellFile(
            cell=self.cell, status=Status.FINISHED, columns=columns, certificates=certificates
        )

    def given(self, plan: Plan | PlanFile) -> CellFile:
        """Returns the cell of a given plan, with the limits of its search if its file has them."""
        allowance, columns = None, {}
        if isinstance(plan, PlanFile):
            columns = {"time_limit": plan.time_limit, "work_limit": plan.work_limit}
            if plan.time_limit is not None:
                allowance = Allowance(plan.time_limit, plan.work_limit)
        judged = Judged.of_plan(self.problem, plan)
        return _planned(self.cell, self.problem, judged, allowance, columns)


def _plan(task: Task, stop: Stop, watch: Watch) -> CellFile:
    """Runs a planner."""
    cell, problem = task.cell, task.problem
    method = cell.planner if task.foreign is None else task.foreign.method
    columns = {"time_limit": cell.time_limit, "work_limit": cell.work_limit}
    try:
        first, allowance = _first_plan(task, stop, watch)
        judged = run(
            problem, method, stop, name=cell.planner, allowance=allowance, watch=watch,
            seed=cell.seed, gap=counting_gap(problem), start=first,
        )  # fmt: skip
    except UnsupportedError as error:
        judged = Judged(Result(None, -math.inf, Reason.UNSUPPORTED, message=str(error)), None)
        columns["seconds"] = None  # it did not run
    return _planned(cell, problem, judged, cell.allowance, columns)


def _first_plan(task: Task, stop: Stop, watch: Watch) -> tuple[Plan | None, Allowance]:
    """Returns the plan that an exact method starts from, if any, and the time that is left."""
    cell, allowance = task.cell, task.cell.allowance
    if not cell.start:
        return None, allowance
    first = run(task.problem, cell.start, stop, allowance=allowance, watch=watch)
    left = max(allowance.seconds - first.result.seconds, 0.0)
    return first.result.plan if first.valid else None, allowance._replace(seconds=left)


def _planned(
    cell: SweepCell,
    problem: Problem,
    judged: Judged[Any],
    allowance: Allowance | None,
    columns: dict[str, Any],
) -> CellFile:
    if cell.rendered:
        columns = {**columns, "reward_rendered": _rendered_reward(problem, judged)}
    judged.warn(problem, cell.seed, cell.planner)
    file = judged.result.certificate if isinstance(judged.result, CertifiedResult) else None
    return CellFile(
        cell=cell,
        status=Status.FINISHED,
        row=PlannedRow.of_planner(problem, cell.seed, cell.planner, judged, **columns),
        plan=judged.plan_file(problem, cell.planner, allowance),
        certificates=_encoded({OWN: file}),
    )


def _rendered_reward(problem: Problem, judged: Judged[Any]) -> float | None:
    """Returns J of a plan's rendered pixels; None if there is no plan."""
    from cocap_opt.output.rendered import FaceView, Pose
    from cocap_opt.vision.render import Renderer

    if judged.result.plan is None or judged.verdict is None:
        return None
    poses = Pose.all_of(judged.result.plan, problem.first_step)
    views = FaceView.all_from(compiled(problem), Renderer(problem), poses)
    return FaceView.reward(problem, views, judged.verdict.reward_moves)


def _bound(task: Task, stop: Stop, watch: Watch) -> CellFile:
    """Bounds the plans of an instance, under its rules and without rules."""
    cell, problem = task.cell, task.problem
    traces = {_WITH_RULES: Trace(), _WITHOUT_RULES: Trace()}
    bounds = _Bounds(
        problem, _start_plans(problem, task.start), cell.allowance, stop, watch,
        lambda name: traces[name].beside(watch.report(f"{name}:")),
    )  # fmt: skip
    under, free = bounds.search()
    traces[_WITHOUT_RULES].end(free.result)
    if free is under:
        traces[_WITH_RULES] = traces[_WITHOUT_RULES]
    else:
        traces[_WITH_RULES].end(under.result)
    limits = {"bound_time_limit": cell.time_limit, "bound_work_limit": cell.work_limit}
    return CellFile(
        cell=cell,
        status=Status.FINISHED,
        columns=BoundColumns.of_bounds(under, free, **limits),
        certificates=_encoded({
            RULES: under.result.certificate,
            FREE: None if free is under else free.result.certificate,
        }),
        traces={RULES: traces[_WITH_RULES].text, FREE: traces[_WITHOUT_RULES].text},
    )  # fmt: skip


def _encoded(
    certificates: Mapping[str, CertificateFile | ProofFile | None],
) -> dict[str, msgspec.Raw]:
    """Returns the contents of the certificates, without those that are None."""
    return {name: msgspec.Raw(encode(c)) for name, c in certificates.items() if c is not None}


def _start_plans(problem: Problem, start: BoundStart) -> list[Judged[Any]]:
    """Returns the plans of the start, judged, and its proof as a result without a plan."""
    plans = [
        Judged.of_plan(problem, plan) for plan in (start.plan, start.valid) if plan is not None
    ]
    if (file := start.proof) is None:
        return plans
    proved = CertifiedResult(
        None, -math.inf, Reason.FINISHED, bound=file.proved, seconds=start.seconds, certificate=file
    )
    return [*plans, Judged(proved, None)]


class _Bounds:
    """The search for the best plan and the best certified bound.

    Parameters
    ----------
    plans : results that the search starts from; the bound must not be below them
    allowance : limits of each of the two searches
    stop : a further limit on both searches
    watch : shows the progress of coverage
    report_to : returns the receiver of a search's reports, by the search's name
    """

    def __init__(
        self,
        problem: Problem,
        plans: Sequence[Judged[Any]],
        allowance: Allowance,
        stop: Stop,
        watch: Watch,
        report_to: Callable[[str], Report],
    ) -> None:
        self._problem, self._plans, self._report_to = problem, plans, report_to
        self._allowance, self._stop, self._watch = allowance, stop, watch

    def search(self) -> tuple[Judged[CertifiedResult], Judged[CertifiedResult]]:
        """Returns the best plan and the bound under the scene's rules, and without any rules.

        A bound on all plans also holds for plans that obey the rules, and the best of all plans may
        obey them. So the problem without rules comes first, and sometimes solves both.
        """
        free = self._run(self._problem.without_rules(), _best(self._plans), _WITHOUT_RULES)
        if self._problem.rules.none:
            return free, free
        under = self._under_rules(free)
        if under.reward > free.reward:  # without rules, plans that obey them are allowed, too
            free = _joined(under, free.result)
        return under, free

    def _under_rules(self, free: Judged[CertifiedResult]) -> Judged[CertifiedResult]:
        known = [plan.result for plan in self._plans if isinstance(plan.result, CertifiedResult)]
        known.append(self._of_all_plans(free.result))
        bound = min((b for b in known if b.certificate), key=_bound_of, default=known[-1])
        judged = (*self._plans, Judged.of(BOUND_METHOD, self._problem, free.result))
        best = _best([plan for plan in judged if plan.valid])
        if proved_by(best.reward, bound.bound) is None:
            found = self._run(self._problem, best, _WITH_RULES)
            best = _best([best, found])
            tightest = min(found.result, bound, key=_bound_of)
            bound = replace(found.result, bound=tightest.bound, certificate=tightest.certificate)
        return _joined(best, bound)

    def _run(self, problem: Problem, start: Judged[Any], name: str) -> Judged[CertifiedResult]:
        return run(
            problem, BOUND_METHOD, self._stop, allowance=self._allowance, watch=self._watch,
            start=start.result.plan, report=self._report_to(name),
        )  # fmt: skip

    def _of_all_plans(self, free: CertifiedResult) -> CertifiedResult:
        """Returns a bound on all plans as a bound on plans that obey the problem's rules."""
        if free.certificate is None:
            return free
        digest = problem_digest(self._problem)
        return replace(free, certificate=msgspec.structs.replace(free.certificate, digest=digest))


def _bound_of(result: Result) -> float:
    return result.bound


def _best(plans: Sequence[Judged[Any]]) -> Judged[Any]:
    none = Judged(Result(None, -math.inf, Reason.FAILED), None)
    return max(plans, key=lambda judged: judged.reward, default=none)


def _joined(best: Judged[Any], bound: CertifiedResult) -> Judged[CertifiedResult]:
    """Returns a plan and a bound, maybe of different runs, as one result, optimal if they meet."""
    RefereeError.unless_bound(BOUND_METHOD, best.reward, bound.bound)
    result = replace(bound, plan=best.result.plan, value=best.result.value)
    if (reason := proved_by(best.reward, bound.bound)) is not None:
        result = replace(result, reason=reason, limit=None)
    return Judged(result, best.verdict)
