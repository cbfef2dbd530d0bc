"""Results of planners and solvers: a plan, a value, a bound, and why the method stopped."""

import html
import math
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Self, overload

from cocap_opt.problem import Ending, Plan, Problem
from cocap_opt.problem.pictures import TopView
from cocap_opt.stop import Limit
from cocap_opt.stop import Reason as Reason

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from cocap_opt.problem.pictures import WholeAxes


# Remedies if a limit was reached before there was a plan; Ctrl-C and accuracy have none.
_REMEDIES = {
    Limit.TIME: "set a larger --time-limit, and run `cocap-opt compile` once if you never did",
    Limit.WORK: "set a larger --work-limit",
}


class UnsupportedError(ValueError):
    """A method does not support problems of this kind; the message names those it supports."""


def remedy(limit: Limit | None) -> str:
    """Returns advice for a limit that was reached before there was a plan; empty without any."""
    return "" if limit is None else _REMEDIES.get(limit, "")


@dataclass(frozen=True, repr=False)
class Result:
    """The outcome of a planner: a value and a bound always exist, though they may be infinite.

    Attributes
    ----------
    plan : None if no plan was found
    value : J of the plan; -inf without one
    reason : why the method stopped
    limit : the limit that stopped it; None if none did
    bound : proved upper bound on J; inf without one
    seconds : s, wall-clock time of the search, excluding the coverage of all states
    coverage_seconds : s, wall-clock time of that coverage; 0 if it was computed before
    message : the reason why there is no plan, in words
    statistics : the method's own counts and times, by name
    in_coverage : the limit was reached before the coverage of all steps was complete
    told : note of the plan's file on how far the plan got before the limit; empty without a file
    problem : the problem that was planned; None: unknown
    method : name of the method that made the result; empty if unknown
    """

    plan: Plan | None
    value: float
    reason: Reason
    limit: Limit | None = None
    bound: float = math.inf
    seconds: float = 0.0
    coverage_seconds: float = 0.0
    message: str = ""
    statistics: Mapping[str, float] = field(default_factory=dict)
    in_coverage: bool = False
    told: str = ""
    problem: Problem | None = field(default=None, compare=False)
    method: str = field(default="", compare=False)

    @classmethod
    def without_plan(
        cls, reason: Reason, message: str, statistics: Mapping[str, float] | None = None
    ) -> Self:
        """Make a result without a plan, for a reason and in words."""
        return cls(None, -math.inf, reason, message=message, statistics=statistics or {})

    @classmethod
    def stopped_without_plan(
        cls, limit: Limit, statistics: Mapping[str, float] | None = None
    ) -> Self:
        """Make a result without a plan, because a limit was reached."""
        reached = "it was interrupted" if limit is Limit.INTERRUPT else f"the {limit} limit"
        words = [f"no plan was found before {reached}", remedy(limit)]
        message = ": ".join(filter(None, words))
        return replace(cls.without_plan(Reason.STOPPED, message, statistics), limit=limit)

    @property
    def gap(self) -> float:
        """The relative gap, (bound - value) / bound; infinite if either of them is."""
        return relative_gap(self.value, self.bound)

    @property
    def ending(self) -> Ending:
        """The end of the method's work, as files of plans record it."""
        return Ending(self.reason, self.limit, self.in_coverage, self.told)

    @property
    def cut_short(self) -> str:
        """Says how far the plan got before a limit; empty without a plan or a limit."""
        return "" if self.plan is None else self.ending.left_of(self.plan)

    def summary(self) -> str:
        """Describe the result in a few lines; the first says if a limit cut the plan short."""
        stopped = f"stopped by the {self.limit} limit"
        # J is at least 0, so a bound below 0 means that no plan meets the requirements.
        no_plan = " (below 0: no plan exists)" if self.bound < 0 else ""
        lines = {
            "J": f"{self.value:,.2f}" if self.plan else "no plan",
            "bound": f"{self.bound:,.2f}{no_plan}" if self.bound < math.inf else "none",
            "gap": f"{100 * self.gap:.3f} %" if math.isfinite(self.gap) else "unknown",
            "reason": str(self.reason) if self.limit is None else stopped,
            "seconds": f"{self.seconds:.3f}",
        }
        words = [f"{key:8}{value}" for key, value in lines.items()]
        first = [self.cut_short] if self.cut_short else []
        return "\n".join([*first, *words, *([self.message] if self.message else [])])

    def __repr__(self) -> str:
        lines = self.summary().splitlines()[: 6 if self.cut_short else 5]
        words = ", ".join(" ".join(line.split()) for line in lines)
        return f"{type(self).__name__}({words})"

    @overload
    def plot(self, ax: None = None) -> "WholeAxes": ...

    @overload
    def plot(self, ax: "Axes | None") -> "Axes": ...

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Draw the plan from above.

        Parameters
        ----------
        ax : matplotlib axes (default: those of a new figure)

        Raises
        ------
        ValueError
            If there is no plan, or the result does not know its problem.
        """
        if self.plan is None:
            raise ValueError("this result has no plan to draw")
        if self.problem is None:
            words = "this result does not know its problem; use problem.plot(result.plan)"
            raise ValueError(words)
        return self.problem.plot(self.plan, ax)

    def _repr_html_(self) -> str:
        """Describe the result in a notebook, with a picture of its plan."""
        words = f"<pre>{html.escape(self.summary())}</pre>"
        if self.problem is None or self.plan is None:
            return words
        return words + TopView.of(self.problem, self.plan).image()


def relative_gap(value: float, bound: float) -> float:
    """Returns (bound - value) / bound; infinite if either is infinite.

    A bound of 0 is rounded up to the least positive number, so that a value of 0 has no gap.
    """
    if not (math.isfinite(value) and math.isfinite(bound)):
        return math.inf
    return (bound - value) / max(bound, sys.float_info.min)
