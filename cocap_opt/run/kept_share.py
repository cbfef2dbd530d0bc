"""Plans that keep a share of all views, where the objective asks for one.

The weight of views may leave plans below the share. For a planner views are then given more weight,
four times as much each time, and people come before all else at last; the first plan that keeps the
share counts. What methods do that prove bounds is in `proved_share`.
"""

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

from cocap_opt.data import ProblemError
from cocap_opt.method import Method
from cocap_opt.model import share_coverage
from cocap_opt.problem import Problem
from cocap_opt.referee import check
from cocap_opt.run.engine import record_of, run
from cocap_opt.run.judged import Judged
from cocap_opt.run.proved_share import solve_with_share
from cocap_opt.run.view_share import keeps_share, missed_share
from cocap_opt.stop import Stop
from cocap_opt.vision.default_weights import FIRST, default_weights, with_views

_HEAVIER = (4.0, 16.0, 64.0)  # times the weight that the objective has


def run_keeping(
    problem: Problem, method: str | Method[Any], stop: Stop, **options: Any
) -> Judged[Any]:
    """Runs a method, as `run` does, and again with more weight of views until the share is kept.

    Without such a plan it returns the first one. The bound of a method that proves bounds is then
    one on plans that keep the share, as is its certificate, which has an objective of its own.

    Parameters
    ----------
    options : of `run`
    """
    views = problem.objective.views
    if views is None or views.share is None:
        return run(problem, method, stop, **options)
    if record_of(method).bounds:
        return solve_with_share(problem, method, stop, **options)
    first = run(problem, method, stop, **options)
    seconds = first.result.seconds
    if not _misses(problem, first):
        return first
    for words, variant in _heavier(problem):
        if stop.reached() is not None:
            break
        share_coverage(variant, problem)
        found = run(variant, method, stop, **options)
        seconds += found.result.seconds
        if found.valid and not _misses(problem, found):
            told = f"{100 * views.share:g} % of views are kept with {words}"
            result = replace(
                found.result, value=check(problem, found.result.plan).reward, bound=math.inf,
                seconds=seconds, message="; ".join(filter(None, (found.result.message, told))),
            )  # fmt: skip
            judged = Judged.of(options.get("name") or str(method), problem, result)
            return judged._replace(coverage_seconds=first.coverage_seconds, views=first.views)
    if not first.valid:
        return first
    said = (first.result.message, missed_share(problem, first.result.plan))
    return first._replace(result=replace(first.result, message="; ".join(filter(None, said))))


def _misses(problem: Problem, judged: Judged[Any]) -> bool:
    """Returns True if the result has no plan that obeys the rules and keeps the share."""
    return not judged.valid or not keeps_share(problem, judged.result.plan)


def _heavier(problem: Problem) -> Iterator[tuple[str, Problem]]:
    """Yields problems in which views weigh more and more, with words for how much."""
    views, people = problem.objective.views, problem.actors
    assert views is not None
    weights = views.weights(len(people))
    try:
        weights = weights if any(weights) else default_weights(people, problem.robots)
    except ProblemError:  # a drone has no pictures, by which a weight could be found
        return
    for factor in _HEAVIER:
        weight = tuple(factor * weight for weight in weights)
        heavier = problem.objective.replace(views=views.replace(weight=weight))
        yield f"{factor:g} times the weight of views", problem.replace(objective=heavier)
    try:
        first = with_views(problem, views.cameras, FIRST, views.at_least, views.share)
    except ProblemError:
        return
    yield "people before all pixels", first
