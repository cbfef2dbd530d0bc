"""The time of a method, separate from the time for coverage."""

from collections.abc import Callable
from dataclasses import replace
from functools import wraps
from typing import ParamSpec, TypeVar, cast

from cocap_opt.model import compiled
from cocap_opt.problem import Problem
from cocap_opt.result import Result
from cocap_opt.stop import Clock

P = ParamSpec("P")
R = TypeVar("R", bound=Result)


def timed(method: Callable[P, R]) -> Callable[P, R]:
    """Make a method record the seconds that it took, and its problem, in its result.

    The problem is the method's first argument. The time for coverage of all states that the method
    has computed on the way is in `coverage_seconds`, not in `seconds`.
    """

    @wraps(method)
    def run(*args: P.args, **kwargs: P.kwargs) -> R:
        problem = cast(Problem, args[0] if args else kwargs["problem"])
        model, clock = compiled(problem), Clock()
        before = model.tables.seconds
        result = method(*args, **kwargs)
        coverage = model.tables.seconds - before
        return replace(
            result,
            seconds=max(clock.seconds - coverage, 0.0),
            coverage_seconds=coverage,
            problem=problem,
        )

    return run
