"""What bounds and exact methods take and return."""

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import NamedTuple, Protocol

from cocap_opt.check import check
from cocap_opt.formulations.certificates.certificate import CertificateFile
from cocap_opt.formulations.certificates.proof import ProofFile
from cocap_opt.problem.plan import Plan
from cocap_opt.problem.problem import Problem
from cocap_opt.result import Reason, Result, relative_gap
from cocap_opt.stop import Limit, Stop, never

OPTIMALITY = 1e-6  # relative gap at which a plan is called optimal


@dataclass(frozen=True)
class CertifiedResult(Result):
    """A value and a bound, with the file that proves the bound.

    `bound` is what the certificate proves, never a solver's own word for it; those are in
    `statistics`. A method without a plan has the value -inf.
    """

    certificate: CertificateFile | ProofFile | None = None


class Snapshot(NamedTuple):
    """How far a method is."""

    value: float  # J of the best plan so far; -inf without one
    bound: float  # best certified bound so far; inf without one
    seconds: float
    columns: int = 0
    nodes: int = 0

    @property
    def gap(self) -> float:
        """(bound - value) / bound."""
        return relative_gap(self.value, self.bound)


Report = Callable[[Snapshot], None]


def silent(snapshot: Snapshot) -> None:
    """Report to nobody."""


class BoundMethod(Protocol):
    """A method that gives an upper bound on J, and may give a plan."""

    def __call__(
        self,
        problem: Problem,
        stop: Stop = never,
        start: Plan | None = None,
        report: Report = silent,
    ) -> CertifiedResult:
        """Bound a problem; the plan `start` helps some methods."""


class ExactMethod(Protocol):
    """A method that goes on until the relative gap is at most `gap`, or a limit stops it."""

    def __call__(
        self,
        problem: Problem,
        stop: Stop = never,
        start: Plan | None = None,
        report: Report = silent,
        gap: float = OPTIMALITY,
    ) -> CertifiedResult:
        """Solve a problem, beginning with the plan `start`."""


def usable_start(problem: Problem, start: Plan | None) -> tuple[Plan | None, str]:
    """The plan if it can be flown and breaks no rule; otherwise None and why not, in words."""
    if start is None:
        return None, ""
    verdict = check(problem, start)
    if verdict.valid:
        return start, ""
    return None, f"start rejected: {(*verdict.violations, *verdict.conflicts)[0]}"


def hovering(problem: Problem) -> Plan | None:
    """The plan in which nobody moves: starts obey all rules. None where a goal is elsewhere."""
    if any(r.goal not in (None, (r.start.x, r.start.y)) for r in problem.robots):
        return None
    return Plan(paths=tuple((r.start,) * (problem.horizon + 1) for r in problem.robots))


def first_plan(problem: Problem, start: Plan | None) -> tuple[Plan | None, str]:
    """A plan to begin with: the start if it is usable, else that nobody moves; and why not."""
    plan, message = usable_start(problem, start)
    return (hovering(problem) if plan is None else plan), message


def bounded(
    file: CertificateFile | ProofFile,
    limit: Limit,
    begin: float,
    statistics: Mapping[str, float] | None = None,
) -> CertifiedResult:
    """Result of a method that looks for no plan; a negative bound proves that there is none."""
    reason = Reason.FINISHED if limit is Limit.NONE else Reason.STOPPED
    if file.proved < 0:  # J >= 0
        reason, limit = Reason.INFEASIBLE, Limit.NONE
    return CertifiedResult(
        None, -math.inf, reason, limit, file.proved, time.perf_counter() - begin,
        statistics=statistics or {}, certificate=file,
    )  # fmt: skip


def no_bound(limit: Limit, seconds: float) -> CertifiedResult:
    """What a method returns that was stopped before it had any bound."""
    return CertifiedResult(None, -math.inf, Reason.STOPPED, limit, seconds=seconds)


def only_start(
    problem: Problem, start: Plan | None, limit: Limit, seconds: float
) -> CertifiedResult:
    """What an exact method returns that was stopped at once: its start, or that nobody moves."""
    plan, message = first_plan(problem, start)
    value = -math.inf if plan is None else check(problem, plan).reward
    return CertifiedResult(
        plan, value, Reason.STOPPED, limit, seconds=seconds, message=message
    )  # fmt: skip
