"""What a planner or a solver returns, and why it stopped, in two words that do not mix."""

import math
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum
from functools import wraps
from typing import ParamSpec, TypeVar

from cocap_opt.problem.plan import Plan
from cocap_opt.stop import Clock, Limit


class UnsupportedError(ValueError):
    """This method does not take problems of this kind; the message says which it takes."""


class Reason(StrEnum):
    """Why it stopped."""

    OPTIMAL = "optimal"  # the value is proved to be the best
    FINISHED = "finished"  # the method ran to its end; it proves nothing
    INFEASIBLE = "infeasible"  # proved: no plan obeys the rules
    FAILED = "failed"  # the method ran to its end without a plan; one may exist
    UNSUPPORTED = "unsupported"  # the method does not take such problems
    STOPPED = "stopped"  # a limit stopped it; the other word says which


@dataclass(frozen=True)
class Result:
    """Outcome of a planner: a value and a bound always exist, be they infinite."""

    plan: Plan | None
    value: float  # J of the plan; -inf without one
    reason: Reason
    limit: Limit = Limit.NONE
    bound: float = math.inf  # proved upper bound on J
    seconds: float = 0.0
    message: str = ""  # why there is no plan, in words
    statistics: Mapping[str, float] = field(default_factory=dict)

    @property
    def gap(self) -> float:
        """(bound - value) / bound."""
        return relative_gap(self.value, self.bound)


def relative_gap(value: float, bound: float) -> float:
    """(bound - value) / bound; infinite where one is infinite.

    A bound of 0 is rounded up to the least positive number, which is no gap.
    """
    if not (math.isfinite(value) and math.isfinite(bound)):
        return math.inf
    return (bound - value) / max(bound, sys.float_info.min)


P = ParamSpec("P")
R = TypeVar("R", bound=Result)


def timed(method: Callable[P, R]) -> Callable[P, R]:
    """Make a method's result say how many seconds the method took."""

    @wraps(method)
    def run(*args: P.args, **kwargs: P.kwargs) -> R:
        clock = Clock()
        result = method(*args, **kwargs)
        return replace(result, seconds=clock.seconds)

    return run
