"""The face's planners, bounds and exact methods: by name or callable, with a limit."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Protocol, TypeVar

import numpy as np

from cocap_opt.api.arguments import require, require_problem, start_for
from cocap_opt.formulations import BOUNDS, EXACT
from cocap_opt.formulations.result import (
    OPTIMALITY,
    CertifiedResult,
    Report,
    proved_reason,
    silent,
)
from cocap_opt.planners import PLANNERS, RECOMMENDED, Planner
from cocap_opt.problem import Plan, Problem
from cocap_opt.result import Result
from cocap_opt.run.forecast import warn_of_limit
from cocap_opt.run.judging import with_coverage_told
from cocap_opt.stop import Clock, FirstOf, Stop, TimeLimit, never

M = TypeVar("M")
R = TypeVar("R", bound=Result)

# What is called here: methods of one's own need no defaults.
_Bound = Callable[[Problem, Stop, Plan | None, Report], CertifiedResult]


class _Exact(Protocol):
    def __call__(
        self, problem: Problem, stop: Stop, start: Plan | None, report: Report, /, *, gap: float
    ) -> CertifiedResult: ...


def plan(
    problem: Problem,
    planner: str | Planner = RECOMMENDED,
    *,
    time_limit: float | None = None,
    stop: Stop = never,
) -> Result:
    """Plan all drones of a problem.

    Parameters
    ----------
    problem : the drones, the people, and where they are
    planner : a name in `PLANNERS`, "module:function", a name that an installed package offers, or
        any callable that takes a problem and a stop
    time_limit : seconds, the coverage included
    stop : a further stopping criterion, such as ``co.WorkLimit(100)``

    Returns
    -------
    Result
        With the plan, its J in `value` as the planner claims it (`verify` computes it anew), and
        why the planner stopped. Its `seconds` are the wall-clock time of the search; the coverage
        of all states is apart, in `coverage_seconds`. A callable that does not say how long it
        took is timed as a whole.

    Raises
    ------
    UnsupportedError
        If the planner takes no such problems.
    ValueError
        If there is no planner of this name, it returns no result, or the time limit is negative.

    Examples
    --------
    >>> result = co.plan(problem, time_limit=10)
    >>> result.plot()
    """
    call = _planner(planner)
    require_problem(problem)
    _warn(problem, planner, time_limit, stop)
    clock = Clock()
    return _whole(call(problem, _limits(time_limit, stop)), problem, planner, clock)


def bound(
    problem: Problem,
    method: str | _Bound = "column-generation",
    *,
    time_limit: float | None = None,
    stop: Stop = never,
    start: Plan | Result | None = None,
    report: Report = silent,
) -> CertifiedResult:
    """Compute an upper bound on J, which no plan exceeds, with the certificate that proves it.

    Parameters
    ----------
    problem : the drones, the people, and where they are
    method : a name in `BOUNDS`, or any callable that takes what those take
    time_limit : seconds, the coverage included
    stop : a further stopping criterion
    start : a plan that the method may begin with
    report : called with a `Snapshot` of value and bound now and then

    Returns
    -------
    CertifiedResult
        With the bound and its `certificate`; `verify` checks it without any solver.

    Raises
    ------
    UnsupportedError
        If the method takes no such problems.
    ValueError
        If there is no method of this name, the time limit is negative, or the start cannot be
        flown in this problem.

    Examples
    --------
    >>> co.bound(problem, time_limit=10).bound
    """
    clock, known = Clock(), dict[str, _Bound](BOUNDS)
    call = _named("method", method, known)
    require_problem(problem)
    begin = start_for(problem, start)
    _warn(problem, method, time_limit, stop)
    result = call(problem, _limits(time_limit, stop), begin, report)
    return _whole(_told(result, problem, method), problem, method, clock)


def solve(
    problem: Problem,
    method: str | _Exact = "branch-and-price",
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
    problem : the drones, the people, and where they are
    method : a name in `EXACT`, or any callable that takes what those take
    time_limit : seconds, the coverage included; when they are over, the best plan and bound so far
        are returned
    stop : a further stopping criterion
    gap : (bound - J) / bound at which to stop; 0 means 1e-6, which is called optimal
    start : a plan to begin with
    report : called with a `Snapshot` of value and bound now and then

    Returns
    -------
    CertifiedResult
        With plan, value, bound, gap and `certificate`, which is None for brute force. It is called
        optimal only where the bound proves it; a solver's own word for it is in the message.

    Raises
    ------
    UnsupportedError
        If the method takes no such problems, or a solver that it needs is not installed.
    ValueError
        If there is no method of this name, the time limit is negative, `gap` is not in [0, 1), or
        the start cannot be flown in this problem.

    Examples
    --------
    >>> co.solve(co.load("corridor"), time_limit=60).summary()
    """
    require_problem(problem)
    require(gap, "gap", "a number", int, float, np.number)
    if not 0 <= gap < 1:
        raise ValueError(f"gap: must be at least 0 and less than 1, not {gap}")
    call, clock = _named("method", method, EXACT), Clock()
    begin = start_for(problem, start)
    _warn(problem, method, time_limit, stop)
    stop = _limits(time_limit, stop)
    result = call(problem, stop, begin, report, gap=max(gap, OPTIMALITY))
    result = _whole(_told(result, problem, method), problem, method, clock)
    return replace(result, reason=proved_reason(result.reason, result.bound, result.gap))


def _planner(given: str | Planner) -> Planner:
    """The planner itself, or the one of this name, ours or somebody's own."""
    if isinstance(given, str) and given not in PLANNERS:
        from cocap_opt.experiments.sweeps.named_planners import is_own, own_planners
        from cocap_opt.run.options import Option

        if is_own(given):
            return own_planners(Option("planner"), [given])[given].seeded(0)
    return _named("planner", given, PLANNERS)


def _named(kind: str, given: str | M, known: Mapping[str, M]) -> M:
    """The method itself, or the one of this name."""
    if callable(given) and not isinstance(given, str):
        return given
    if not isinstance(given, str) or given not in known:
        raise ValueError(f"{kind}: must be one of {', '.join(known)}, not {given!r}")
    return known[given]


def _whole(result: R, problem: Problem, method: object, clock: Clock) -> R:
    """The result with its problem, seconds and method, where it does not know them itself."""
    name = method if isinstance(method, str) else getattr(method, "__name__", "")
    require(result, name or "method", "a callable that returns a Result", Result)
    return replace(
        result,
        problem=problem if result.problem is None else result.problem,
        seconds=result.seconds or clock.seconds,
        method=result.method or name,
    )


def _told(result: R, problem: Problem, method: object) -> R:
    """The result of a method of ours, which says if a limit came before coverage was there."""
    return with_coverage_told(problem, result) if isinstance(method, str) else result


def _warn(problem: Problem, method: object, seconds: float | None, stop: Stop) -> None:
    """Warns, before coverage begins, of a limit in which it will hardly be done."""
    if isinstance(method, str):
        left = _limits(seconds, stop).seconds_left
        warn_of_limit(problem, method, left, option="time_limit =")


def _limits(seconds: float | None, stop: Stop) -> Stop:
    require(stop, "stop", "a stopping criterion, such as WorkLimit(100)", Stop)
    if seconds is None:
        return stop
    require(seconds, "time_limit", "a number of seconds >= 0", int, float, np.number)
    if not seconds >= 0:
        raise ValueError(f"time_limit: must be a number of seconds >= 0, not {seconds}")
    return FirstOf(stop, TimeLimit(seconds))
