"""What a bounding method returns."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from cocap_opt.plan import Plan
from cocap_opt.problem import Problem
from cocap_opt.result import Reason
from cocap_opt.stop import Limit, Stop
from formulations.certificate import CertificateFile


@dataclass(frozen=True)
class BoundResult:
    """A certified bound and why the method stopped."""

    method: str
    certificate: CertificateFile | None  # None: a limit was reached before there was any bound
    reason: Reason  # finished: the method converged; infeasible: no plan, since J >= 0 > bound
    limit: Limit = Limit.NONE
    seconds: float = 0.0
    statistics: Mapping[str, float] = field(default_factory=dict)

    @property
    def bound(self) -> float:
        """Certified upper bound on J; infinite without a certificate."""
        return math.inf if self.certificate is None else self.certificate.proved


def no_bound(method: str, limit: Limit, seconds: float) -> BoundResult:
    """What a method returns that was stopped before it had any bound."""
    return BoundResult(method, None, Reason.STOPPED, limit, seconds)


BoundMethod = Callable[[Problem, Stop, Plan | None], BoundResult]
