"""Finds plans that reach the share of all views that the objective requires.

With the objective's weight of views, plans may miss the share. For planners, the weight of views is
then increased, by a factor of four each time, and finally people get priority over everything else;
the first plan that reaches the share is returned. For methods that prove bounds, see
`proved_share`.
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

_HEAVIER = (4.0, 16.0, 64.0)  # factors on the objective's weight of views


def run_keeping(
    problem: Problem, method: str | Method[Any], stop: Stop, **options: Any
) -> Judged[Any]:
    """Runs a method like `run`, repeatedly with more weight of views until a plan reaches the
    share.

    If no plan reaches it, returns the first plan. The bound of a method that proves bounds then
    holds for plans that reach the share, as does its certificate, which has its own objective.

    Parameters
    ----------
    options : options of `run`
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
    """Returns True unless the result has a plan that obeys the rules and reaches the share."""
    return not judged.valid or not keeps_share(problem, judged.result.plan)


def _heavier(problem: Problem) -> Iterator[tuple[str, Problem]]:
    """Yields problems with increasing weight of views, each with words for the weight."""
    views, people = problem.objective.views, problem.actors
    assert views is not None
    weights = views.weights(len(people))
    try:
        weights = weights if any(weights) else default_weights(people, problem.robots)
    except ProblemError:  # a drone has no images, from which a weight could be computed
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
