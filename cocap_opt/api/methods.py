"""Public functions that run planners, bounds and exact methods, given by name or as callables."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, Protocol, TypeVar, overload

from cocap_opt.api.arguments import (
    followed,
    listed,
    name_of,
    require,
    require_callable,
    require_number,
    require_problem,
    rest_of,
    start_for,
)
from cocap_opt.formulations import BOUNDS, EXACT
from cocap_opt.formulations.result import OPTIMALITY, CertifiedResult, Report, silent
from cocap_opt.method import START_AND_REPORT, Method
from cocap_opt.planners import RECOMMENDED, Planner
from cocap_opt.problem import Plan, Problem
from cocap_opt.result import Result
from cocap_opt.run.engine import SOLVERS
from cocap_opt.run.forecast import warn_of_limit
from cocap_opt.run.judged import Judged
from cocap_opt.run.kept_share import run_keeping
from cocap_opt.run.named_planners import planner_named
from cocap_opt.run.options import Allowance, Option
from cocap_opt.run.own_planners import OwnPlanner, bounding
from cocap_opt.run.replanning import BOUND_SECONDS, Replanned, Replanning
from cocap_opt.stop import Stop, never

R = TypeVar("R", bound=Result)

# Types of the callables used here: your own methods need no defaults.
_BoundMethod = Callable[[Problem, Stop, Plan | None, Report], CertifiedResult]


class ExactMethod(Protocol):
    """A method that returns the best plan, and proves that none is better by more than a gap."""

    def __call__(
        self, problem: Problem, stop: Stop, start: Plan | None, report: Report, /, *, gap: float
    ) -> CertifiedResult:
        """Solve a problem; at a limit, return the best plan and bound so far."""


@overload
def plan(
    problem: Problem,
    planner: str | Planner = RECOMMENDED,
    *,
    time_limit: float | None = None,
    stop: Stop = never,
    follow: None = None,
) -> Result: ...


@overload
def plan(
    problem: Problem,
    planner: str | Planner = RECOMMENDED,
    *,
    time_limit: float | None = None,
    stop: Stop = never,
    follow: Plan | Result,
    from_step: int,
    without: Sequence[int] = (),
    bound_limit: float = BOUND_SECONDS,
) -> Replanned: ...


def plan(
    problem: Problem,
    planner: str | Planner = RECOMMENDED,
    *,
    time_limit: float | None = None,
    stop: Stop = never,
    follow: Plan | Result | None = None,
    from_step: int | None = None,
    without: Sequence[int] = (),
    bound_limit: float = BOUND_SECONDS,
) -> Result | Replanned:
    """Plan all drones of a problem, or the rest of a mission that is being flown.

    If the objective requires a share of all views and the plan has fewer, the weight of views is
    raised until a plan has that share or the time is up.

    `follow` and `from_step` replan the rest of a plan that has been flown up to a step, because
    drones were lost or people walk differently from those that the plan was made for. The new rest
    is at least as good as the old one, unless the old one now breaks a rule.

    Parameters
    ----------
    problem : the scene, with its drones and people
    planner : a name in `PLANNERS` or `EXACT`, "module:function", a name that an installed package
        offers, or any callable that takes a problem and a stop
    time_limit : seconds, including coverage
    stop : a further stopping criterion, such as ``co.WorkLimit(100)``
    follow : a plan of the whole mission, whose first steps have been flown
    from_step : the step at which the rest begins, from 1 to T - 1
    without : numbers of the drones that are lost at that step
    bound_limit : seconds for the bound of the rest, which is computed after the plan, until the
        plan is proved to be within 1 %; 0: no bound

    Returns
    -------
    Result
        With the plan, its J in `value` as the referee computes it, and the reason why the planner
        stopped. `seconds` is the wall-clock time of the search; the time for the coverage of all
        states is separate, in `coverage_seconds`. For the rest of a mission it is a `Replanned`.

    Raises
    ------
    UnsupportedError
        If the planner does not support such problems.
    RefereeError
        If the planner's plan cannot be flown, or its J differs from the planner's claim.
    ValueError
        If there is no planner with this name, it returns no result, or the time limit is negative;
        for a rest, if there is no such step or drone, the steps before cannot be flown in this
        problem, or pixels add up over time.

    Examples
    --------
    >>> result = co.plan(problem, time_limit=10)
    >>> result.plot()
    >>> co.plan(problem, follow=result, from_step=1, without=[1], time_limit=2).rest.gap
    """
    require_problem(problem)
    method, name = _planner(planner), name_of(planner)
    lost = listed(without, "without", "a list of numbers of drones")
    if follow is not None or from_step is not None or lost:
        rest = rest_of(problem, follow, from_step, lost)
        replanning = Replanning(rest, followed(follow))
        seconds = _bound_seconds(bound_limit)
        limits = _limits(rest.scene, method, time_limit, stop)
        planned = replanning.planned(method, limits, name)
        return replanning.answer(replanning.bounded(planned, seconds, stop), name)
    if bound_limit != BOUND_SECONDS:
        raise ValueError("bound_limit: must be left out unless the rest of a plan is planned")
    judged: Judged[Result] = run_keeping(
        problem, method, _limits(problem, method, time_limit, stop), name=name
    )
    return judged.answer(problem, name)


def bound(
    problem: Problem,
    method: str | _BoundMethod = "column-generation",
    *,
    time_limit: float | None = None,
    stop: Stop = never,
    start: Plan | Result | None = None,
    report: Report = silent,
) -> CertifiedResult:
    """Compute an upper bound on J, which no plan exceeds, with the certificate that proves it.

    Parameters
    ----------
    problem : the scene, with its drones and people
    method : a name in `BOUNDS`, or any callable with the same arguments as those
    time_limit : seconds, including coverage
    stop : a further stopping criterion
    start : a plan that the method may start from
    report : called with a `Snapshot` of value and bound from time to time

    Returns
    -------
    CertifiedResult
        With the bound and its `certificate`, which `verify` checks without any solver, and the
        plan that the method found, if any, with the referee's J.

    Raises
    ------
    UnsupportedError
        If the method does not support such problems.
    RefereeError
        If the J of its plan differs from its claim, or its bound is below a plan's J.
    ValueError
        If there is no method with this name, the time limit is negative, or the start cannot be
        flown in this problem.

    Examples
    --------
    >>> co.bound(problem, time_limit=10).bound
    """
    require_problem(problem)
    require_callable(report, "report")
    known = _bounding(method, BOUNDS, START_AND_REPORT)
    begin = start_for(problem, start)
    limits = _limits(problem, known, time_limit, stop)
    return _answer(problem, method, known, limits, start=begin, report=report)


def solve(
    problem: Problem,
    method: str | ExactMethod = "branch-and-price",
    *,
    time_limit: float | None = None,
    stop: Stop = never,
    gap: float = 0.0,
    start: Plan | Result | None = None,
    report: Report = silent,
) -> CertifiedResult:
    """Find the best plan, and prove that no other is better.

    Parameters
    ----------
    problem : the scene, with its drones and people
    method : a name in `EXACT`, or any callable with the same arguments as those
    time_limit : seconds, including coverage; at the limit, the best plan and bound so far are
        returned
    stop : a further stopping criterion
    gap : (bound - J) / bound at which to stop; 0 means 1e-6, which counts as optimal
    start : a plan to start from
    report : called with a `Snapshot` of value and bound from time to time

    Returns
    -------
    CertifiedResult
        With plan, value, bound, gap and `certificate`, which is None for brute force. The plan is
        called optimal only if the bound proves it; a claim by the solver alone is in the message.

    Raises
    ------
    UnsupportedError
        If the method does not support such problems, or needs a solver that is not installed.
    RefereeError
        If the J of its plan differs from its claim, or its bound is below a plan's J.
    ValueError
        If there is no method with this name, the time limit is negative, `gap` is not in [0, 1), or
        the start cannot be flown in this problem.

    Examples
    --------
    >>> co.solve(co.load("corridor"), time_limit=60).summary()
    """
    require_problem(problem)
    require_number(gap, "gap")
    least = max(Option("gap").require_share(gap), OPTIMALITY)
    require_callable(report, "report")
    known = _bounding(method, EXACT, START_AND_REPORT | {"gap"})
    begin = start_for(problem, start)
    limits = _limits(problem, known, time_limit, stop)
    return _answer(problem, method, known, limits, start=begin, report=report, gap=least)


def _bound_seconds(bound_limit: float) -> float:
    """Returns the seconds that the bound of a rest may take."""
    require_number(bound_limit, "bound_limit")
    return Option("bound_limit").require_limit(bound_limit)


def _planner(given: str | Planner) -> Method[Result]:
    """Returns the record of a planner by name, or of a callable."""
    if isinstance(given, str):
        return planner_named(Option("planner"), given)
    require_callable(given, "planner", f"one of {', '.join(SOLVERS)}, or a function")
    if isinstance(given, Method):
        return _recorded(given)
    return OwnPlanner.of_function(given, name_of(given), kept=False).method


def _bounding(
    given: str | Callable[..., CertifiedResult],
    known: Mapping[str, Method[CertifiedResult]],
    takes: frozenset[str],
) -> Method[CertifiedResult]:
    """Returns the record of a bound or an exact method by name, or of a callable."""
    if isinstance(given, str):
        Option("method").require_one_of(given, known)
        return known[given]
    require_callable(given, "method", f"one of {', '.join(known)}, or a function")
    if isinstance(given, Method):
        return _recorded(given)
    return bounding(given, name_of(given), takes)


def _recorded(given: Method[R]) -> Method[R]:
    """Returns a given record, marked as foreign if it is in no registry."""
    is_ours = any(given is known for known in (*BOUNDS.values(), *SOLVERS.values()))
    return given if is_ours else replace(given, foreign=True)


def _answer(problem: Problem, given: object, method: Method[R], stop: Stop, **options: Any) -> R:
    """Runs a method, and returns its result with the referee's J."""
    name = name_of(given)
    judged: Judged[R] = run_keeping(problem, method, stop, name=name, **options)
    return judged.answer(problem, name)


def _limits(problem: Problem, method: Method[Any], seconds: float | None, stop: Stop) -> Stop:
    """Returns a stop with a time limit; warns if the limit is hardly enough to compute coverage."""
    require(stop, "stop", "a stopping criterion, such as WorkLimit(100)", Stop)
    allowance = Allowance(math.inf)
    if seconds is not None:
        require_number(seconds, "time_limit")
        allowance = Allowance(Option("time_limit").require_limit(seconds))
    left = min(stop.seconds_left, allowance.seconds)
    warn_of_limit(problem, method, left, option="time_limit =")
    return allowance.begin(stop)
