"""The bounds on all plans of an instance: under the scene's rules, and without any."""

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any

import msgspec

from cocap_opt.experiments.console.progress import Watch
from cocap_opt.experiments.results.judging import (
    BOUND_METHOD,
    Allowance,
    Judged,
    RefereeError,
)
from cocap_opt.files.documents import problem_digest
from cocap_opt.formulations.result import OPTIMALITY, CertifiedResult, Report
from cocap_opt.model import compiled
from cocap_opt.problem import Problem
from cocap_opt.result import Reason, Result, relative_gap
from cocap_opt.stop import Limit, LimitReached, Stop

WITHOUT_RULES, WITH_RULES = "without rules", "with rules"  # names of the two searches


def cover(problem: Problem, stop: Stop, watch: Watch) -> None:
    """Computes coverage before any limit of a planner or a bound begins to count.

    Results then do not depend on what coverage has been computed before.
    """
    with suppress(LimitReached):  # what comes after it meets the limit as well
        compiled(problem).prepare_all(stop, watch.counter("coverage"))


class Bounds:
    """The search for the best plan and the best certified bound.

    Parameters
    ----------
    plans : that the bound covers, and begins with
    allowance : of each of the two searches
    stop : another limit, of both together
    report_to : returns what a search reports to, by its name
    """

    def __init__(
        self,
        problem: Problem,
        plans: Sequence[Judged[Any]],
        allowance: Allowance,
        stop: Stop,
        report_to: Callable[[str], Report],
    ) -> None:
        self._problem, self._plans, self._report_to = problem, plans, report_to
        self._allowance, self._stop = allowance, stop

    def search(self) -> tuple[Judged[CertifiedResult], Judged[CertifiedResult]]:
        """Returns best plan and bound under the scene's rules, and without any rules.

        What bounds all plans bounds those that obey the rules, and the best plan of all may obey
        them; so the problem without rules comes first, and sometimes settles both.
        """
        free = self._run(self._problem.without_rules(), _best(self._plans), WITHOUT_RULES)
        if self._problem.rules.none:
            return free, free
        under = self._under_rules(free)
        if under.reward > free.reward:  # what obeys the rules may fly where there are none
            free = _joined(under, free.result)
        return under, free

    def _under_rules(self, free: Judged[CertifiedResult]) -> Judged[CertifiedResult]:
        known = [plan.result for plan in self._plans if isinstance(plan.result, CertifiedResult)]
        known.append(self._of_all_plans(free.result))
        bound = min((b for b in known if b.certificate), key=_bound, default=known[-1])
        judged = (*self._plans, Judged.of(BOUND_METHOD, self._problem, free.result))
        best = _best([one for one in judged if one.valid])
        if relative_gap(best.reward, bound.bound) > OPTIMALITY and bound.bound >= 0:
            found = self._run(self._problem, best, WITH_RULES)
            best = _best([best, found])
            tightest = min(found.result, bound, key=_bound)
            bound = replace(found.result, bound=tightest.bound, certificate=tightest.certificate)
        return _joined(best, bound)

    def _run(self, problem: Problem, start: Judged[Any], name: str) -> Judged[CertifiedResult]:
        stop = self._allowance.begin(self._stop)
        return Judged.certified(
            problem, BOUND_METHOD, stop, start.result.plan, self._report_to(name)
        )

    def _of_all_plans(self, free: CertifiedResult) -> CertifiedResult:
        """Returns a bound on all plans as one on those that obey the problem's rules."""
        if free.certificate is None:
            return free
        digest = problem_digest(self._problem)
        return replace(free, certificate=msgspec.structs.replace(free.certificate, digest=digest))


def _bound(result: Result) -> float:
    return result.bound


def _best(plans: Sequence[Judged[Any]]) -> Judged[Any]:
    none = Judged(Result(None, -math.inf, Reason.FAILED), None)
    return max(plans, key=lambda judged: judged.reward, default=none)


def _joined(best: Judged[Any], bound: CertifiedResult) -> Judged[CertifiedResult]:
    """Returns a plan and a bound that may come from different runs, and what both prove."""
    RefereeError.unless_bound(BOUND_METHOD, best.reward, bound.bound)
    result = replace(bound, plan=best.result.plan, value=best.result.value)
    if relative_gap(best.reward, bound.bound) <= OPTIMALITY:
        result = replace(result, reason=Reason.OPTIMAL, limit=Limit.NONE)
    elif bound.bound < 0:  # J >= 0
        result = replace(result, reason=Reason.INFEASIBLE, limit=Limit.NONE)
    return Judged(result, best.verdict)
