"""What a bounding method returns."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from cocap_opt.plan import Plan
from cocap_opt.problem import Problem
from cocap_opt.result import Limit, Reason
from cocap_opt.stop import Stop
from formulations.certificate import CertificateFile


@dataclass(frozen=True)
class BoundResult:
    """A certified bound and why the method stopped."""

    certificate: CertificateFile  # its `bound` is the bound
    reason: Reason  # finished: the method converged; infeasible: J >= 0 > bound
    limit: Limit = Limit.NONE
    seconds: float = 0.0
    statistics: Mapping[str, float] = field(default_factory=dict)

    @property
    def bound(self) -> float:
        """Certified upper bound on J."""
        return self.certificate.bound


BoundMethod = Callable[[Problem, Stop, Plan | None], BoundResult]
