"""The face's planners, bounds and exact methods: by name or callable, with a limit."""

from collections.abc import Callable, Mapping
from typing import Any, Protocol, TypeVar

from cocap_opt.api.arguments import require, require_number, require_problem, start_for
from cocap_opt.formulations import BOUNDS, EXACT
from cocap_opt.formulations.result import OPTIMALITY, CertifiedResult, Report, silent
from cocap_opt.method import START_AND_REPORT, Method
from cocap_opt.planners import RECOMMENDED, Planner
from cocap_opt.problem import Plan, Problem
from cocap_opt.result import Result
from cocap_opt.run.engine import SOLVERS, run
from cocap_opt.run.forecast import warn_of_limit
from cocap_opt.run.judged import Judged
from cocap_opt.run.named_planners import own_planners
from cocap_opt.run.options import Allowance, Option
from cocap_opt.stop import Stop, never

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
    planner : a name in `PLANNERS` or `EXACT`, "module:function", a name that an installed package
        offers, or any callable that takes a problem and a stop
    time_limit : seconds, the coverage included
    stop : a further stopping criterion, such as ``co.WorkLimit(100)``

    Returns
    -------
    Result
        With the plan, its J in `value` as the referee computes it, and why the planner stopped.
        Its `seconds` are the wall-clock time of the search; the coverage of all states is apart,
        in `coverage_seconds`.

    Raises
    ------
    UnsupportedError
        If the planner takes no such problems.
    RefereeError
        If the planner's plan cannot be flown, or has another J than the planner claims.
    ValueError
        If there is no planner of this name, it returns no result, or the time limit is negative.

    Examples
    --------
    >>> result = co.plan(problem, time_limit=10)
    >>> result.plot()
    """
    require_problem(problem)
    if isinstance(planner, str) and (own := own_planners(Option("planner"), [planner])):
        method: str | Method[Result] = own[planner].method
    else:
        method = _known("planner", planner, SOLVERS, frozenset())
    return _answer(problem, planner, method, _limits(problem, planner, time_limit, stop))


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
        With the bound and its `certificate`, which `verify` checks without any solver, and the
        plan that it found, if any, with the referee's J.

    Raises
    ------
    UnsupportedError
        If the method takes no such problems.
    RefereeError
        If its plan has another J than it claims, or its bound is below a plan's J.
    ValueError
        If there is no method of this name, the time limit is negative, or the start cannot be
        flown in this problem.

    Examples
    --------
    >>> co.bound(problem, time_limit=10).bound
    """
    require_problem(problem)
    method_or_name = _known("method", method, BOUNDS, START_AND_REPORT)
    begin = start_for(problem, start)
    limits = _limits(problem, method, time_limit, stop)
    return _answer(problem, method, method_or_name, limits, start=begin, report=report)


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
    RefereeError
        If its plan has another J than it claims, or its bound is below a plan's J.
    ValueError
        If there is no method of this name, the time limit is negative, `gap` is not in [0, 1), or
        the start cannot be flown in this problem.

    Examples
    --------
    >>> co.solve(co.load("corridor"), time_limit=60).summary()
    """
    require_problem(problem)
    require_number(gap, "gap")
    least = max(Option("gap").require_share(gap), OPTIMALITY)
    method_or_name = _known("method", method, EXACT, START_AND_REPORT | {"gap"})
    begin = start_for(problem, start)
    limits = _limits(problem, method, time_limit, stop)
    return _answer(problem, method, method_or_name, limits, start=begin, report=report, gap=least)


def _known(
    option: str,
    given: str | Callable[..., R],
    known: Mapping[str, Method[R]],
    takes: frozenset[str],
) -> str | Method[R]:
    """Returns the name of a method if there is one of this name, or the record of a callable."""
    if isinstance(given, str):
        Option(option).require_one_of(given, known)
        return given
    if not callable(given):
        raise ValueError(f"{option}: must be one of {', '.join(known)}, not {given!r}")
    return given if isinstance(given, Method) else Method(given, takes=takes)


def _answer(
    problem: Problem, given: object, method: str | Method[R], stop: Stop, **options: Any
) -> R:
    """Runs a method, and returns its result with the referee's J."""
    name = given if isinstance(given, str) else getattr(given, "__name__", type(given).__name__)
    judged: Judged[R] = run(problem, method, stop, name=name, **options)
    return judged.answer(problem, name)


def _limits(problem: Problem, method: object, seconds: float | None, stop: Stop) -> Stop:
    """Returns a stop with a time limit; warns of one in which coverage will hardly be done."""
    require(stop, "stop", "a stopping criterion, such as WorkLimit(100)", Stop)
    if seconds is not None:
        require_number(seconds, "time_limit")
        stop = Allowance(Option("time_limit").require_limit(seconds)).begin(stop)
    if isinstance(method, str):
        warn_of_limit(problem, method, stop.seconds_left, option="time_limit =")
    return stop
