"""Defines the contract of bounds and exact methods: their arguments and results."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple, Protocol

from cocap_opt.files.documents import problem_digest
from cocap_opt.formulations.certificates import (
    Certificate,
    CertificateFile,
    ProofFile,
    Staged,
    priced,
)
from cocap_opt.model import Model
from cocap_opt.problem import COVERAGE_VERSION, Plan, Problem
from cocap_opt.referee import check
from cocap_opt.result import Reason, Result, relative_gap
from cocap_opt.stop import Limit, Stop, never

__all__ = [
    "OPTIMALITY",
    "BoundMethod",
    "CertifiedResult",
    "Report",
    "Snapshot",
    "certify",
    "checked_start",
    "proved_by",
    "silent",
]

OPTIMALITY = 1e-6  # relative gap at which a plan is called optimal


def certify(
    problem: Problem, model: Model, method: str, certificate: Certificate | Staged
) -> CertificateFile:
    """Prices a certificate and returns a file that claims the resulting bound.

    Parameters
    ----------
    method : name of the method that found the certificate's numbers
    """
    bound = priced(model, certificate).bound
    return CertificateFile(
        scene=problem.name,
        digest=problem_digest(problem),
        method=method,
        coverage_version=COVERAGE_VERSION,
        classes="single" if model.is_disaggregated else "alike",
        bound=None if bound == -math.inf else bound,
        certificate=certificate,
    )


@dataclass(frozen=True, repr=False)
class CertifiedResult(Result):
    """A plan with its value, a bound, and the file that proves the bound.

    `bound` is always the bound that the certificate proves, never a solver's own claim, which is in
    `statistics`. A result without a plan has the value -inf.

    Attributes
    ----------
    certificate : the file that proves the bound; None if the method makes no file, e.g. brute force
    """

    certificate: CertificateFile | ProofFile | None = None

    @classmethod
    def bounded(
        cls, file: CertificateFile | ProofFile, statistics: Mapping[str, float]
    ) -> "CertifiedResult":
        """Returns the result of a method that has finished and that does not search for plans."""
        reason = proved_by(-math.inf, file.proved) or Reason.FINISHED
        return cls(
            None, -math.inf, reason, bound=file.proved, statistics=statistics, certificate=file
        )

    def with_start(self, problem: Problem, start: Plan | None) -> "CertifiedResult":
        """Returns the bound of an exact method that was stopped at once, together with a plan.

        The plan is the start, or, without a start, the plan in which no drone moves. If the bound
        proves that no plan exists, no plan is added.
        """
        if self.reason is Reason.INFEASIBLE:
            return self
        plan, message = checked_start(problem, start)
        plan = Plan.hovering(problem) if plan is None else plan
        value = -math.inf if plan is None else check(problem, plan).reward
        missing = f"no plan was found before the {self.limit} limit" if plan is None else ""
        words = "; ".join(filter(None, (message, missing, self.message)))
        return replace(self, plan=plan, value=value, message=words)

    def stopped_by(self, limit: Limit) -> "CertifiedResult":
        """Returns the same result, marked with the limit that stopped the method.

        A result that proves that no plan exists is final and is returned unchanged.
        """
        if self.reason is Reason.INFEASIBLE:
            return self
        return replace(self, reason=Reason.STOPPED, limit=limit)


def proved_by(value: float, bound: float) -> Reason | None:
    """Returns the conclusion that follows from a J and a bound: OPTIMAL, INFEASIBLE or None.

    A negative bound proves that no plan exists, since J >= 0.
    """
    if relative_gap(value, bound) <= OPTIMALITY:
        return Reason.OPTIMAL
    return Reason.INFEASIBLE if bound < 0 else None


def checked_start(problem: Problem, plan: Plan | None) -> tuple[Plan | None, str]:
    """Returns the plan if it can be flown and breaks no rule, otherwise None and the reason."""
    if plan is None:
        return None, ""
    verdict = check(problem, plan)
    if verdict.valid:
        return plan, ""
    return None, f"start rejected: {(*verdict.violations, *verdict.conflicts)[0]}"


class Snapshot(NamedTuple):
    """The progress of a method.

    Attributes
    ----------
    value : J of the best plan found so far; -inf if there is none
    bound : the best certified bound found so far; inf if there is none
    seconds : time since the method began, in s
    columns : number of paths in the restricted master problem
    nodes : number of finished nodes of the search tree
    """

    value: float
    bound: float
    seconds: float
    columns: int = 0
    nodes: int = 0

    @property
    def gap(self) -> float:
        """The relative gap, (bound - value) / bound; infinite if either of the two is infinite."""
        return relative_gap(self.value, self.bound)


Report = Callable[[Snapshot], None]


def silent(snapshot: Snapshot) -> None:
    """Ignores progress reports."""


class BoundMethod(Protocol):
    """A method that gives an upper bound on J, and possibly a plan."""

    def __call__(
        self,
        problem: Problem,
        stop: Stop = never,
        start: Plan | None = None,
        report: Report = silent,
    ) -> CertifiedResult:
        """Computes a bound for a problem; some methods use the plan `start`."""
