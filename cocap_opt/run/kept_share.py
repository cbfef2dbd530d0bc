"""Plans that keep a share of all views, where the objective asks for one.

The weight of views may leave plans below the share. For a planner views are then given more weight,
four times as much each time, and people come before all else at last; the first plan that keeps the
share counts. A method that proves bounds looks for the multiplier of the share, as a trade-off
(`front`) does for weights: with it, a bound on J and so much more weight of views bounds the J of
all plans that keep the share.
"""

import math
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from typing import Any

from cocap_opt.console.progress import Watch
from cocap_opt.data import ProblemError
from cocap_opt.formulations.result import OPTIMALITY, proved_by
from cocap_opt.method import Method
from cocap_opt.model import share_coverage
from cocap_opt.planners import RECOMMENDED
from cocap_opt.problem import Plan, Problem
from cocap_opt.referee import check
from cocap_opt.result import Reason, relative_gap
from cocap_opt.run.engine import record_of, run
from cocap_opt.run.front import REWARD_ALONE, VIEWS_ALONE, Direction, Front, HalfPlane
from cocap_opt.run.front_search import towards
from cocap_opt.run.judged import Judged
from cocap_opt.run.options import Allowance
from cocap_opt.run.view_share import (
    bound_with_share,
    missed_share,
    most_views,
    told_share,
    views_asked,
)
from cocap_opt.stop import Clock, Stop
from cocap_opt.vision.default_weights import FIRST, default_weights, with_views

_HEAVIER = (4.0, 16.0, 64.0)  # times the weight that the objective has
_RUNS, _LEAST = 3, 0.2  # each run has that part of the time that is left, and so many seconds
_DONE = Reason.OPTIMAL, Reason.INFEASIBLE


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
        return _proved_keeping(problem, method, stop, **options)
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


def _proved_keeping(
    problem: Problem, method: str | Method[Any], stop: Stop, start: Plan | None = None,
    watch: Watch | None = None, gap: float = OPTIMALITY, **options: Any,
) -> Judged[Any]:  # fmt: skip
    """Looks for the best plan that keeps the share, and for the multiplier of the least bound."""
    share_of, clock, watch = views_asked(problem), Clock(), watch or Watch()
    assert share_of.share is not None
    kept = share_of.share * most_views(problem, share_of.cameras)
    options |= {"watch": watch, "gap": gap}  # of all runs
    part = Allowance(stop.seconds_left / _RUNS)
    first = run(problem, method, stop, start=start, allowance=part, **options)
    if first.result.reason in _DONE or stop.reached() is not None:
        if not _misses(problem, first) or first.result.reason is Reason.INFEASIBLE:
            return first
    elif not _misses(problem, first):
        return run(problem, method, stop, start=first.result.plan, **options)
    plans = [plan for plan in (start, first.result.plan) if plan is not None]
    first_plane = HalfPlane(REWARD_ALONE, first.result.bound, first.result.certificate)
    front = Front(problem, share_of, half_planes=(first_plane,), with_own=True).with_plans(plans)
    rest = {name: option for name, option in options.items() if name != "report"}
    while stop.reached() is None and (direction := _next(front, kept, gap)) is not None:
        seconds = max(stop.seconds_left / _RUNS, _LEAST)
        front = towards(front, direction, stop, seconds, RECOMMENDED, method, **rest)
    plane = min(front.half_planes, key=partial(_with_share, front))
    bound, best, file = _with_share(front, plane), front.best_with(kept), front.file(plane)
    told = told_share(share_of.share, None if best is None else best.reward, bound)
    result = replace(first.result, seconds=clock.seconds, limit=stop.reached(), statistics={})
    if bound < 0:
        result = replace(
            result, plan=None, value=-math.inf, bound=bound, message=told, certificate=file,
            reason=Reason.INFEASIBLE, limit=None,
        )  # fmt: skip
    elif best is not None:
        ended = Reason.FINISHED if result.limit is None else Reason.STOPPED
        result = replace(
            result, plan=best.plan, value=best.reward, bound=bound, message=told, certificate=file,
            reason=proved_by(best.reward, bound) or ended,
            statistics={"multiplier of the share": plane.direction.views},
        )  # fmt: skip
    else:  # the bound of all plans holds for the first one as well
        result = replace(result, message="; ".join(filter(None, (result.message, told))))
    judged = Judged.of(options.get("name") or str(method), problem, result)
    return judged._replace(coverage_seconds=first.coverage_seconds, views=first.views)


def _next(front: Front, kept: float, gap: float) -> Direction | None:
    """Returns the direction that tells more of plans that keep so many views, if one does."""
    best, bound = front.best_with(kept), front.reward_bound(kept)
    if bound < 0 or (best is not None and relative_gap(best.reward, bound) <= gap):
        return None
    if not front.tries(VIEWS_ALONE):
        return VIEWS_ALONE
    asked = front.asked_direction()
    return None if asked is None or front.tries(asked) else asked


def _with_share(front: Front, plane: HalfPlane) -> float:
    """Returns the J that no plan that keeps the share exceeds by one half-plane."""
    if plane.direction == REWARD_ALONE:
        return plane.bound
    return bound_with_share(front.problem, front.scene(plane.direction), plane.bound)


def _misses(problem: Problem, judged: Judged[Any]) -> bool:
    """Returns True if there is no plan that obeys the rules and keeps the share."""
    return not judged.valid or bool(missed_share(problem, judged.result.plan))


def _heavier(problem: Problem) -> Iterator[tuple[str, Problem]]:
    """Yields problems in which views weigh more and more, with words for how much."""
    views, people = problem.objective.views, problem.actors
    assert views is not None
    weights = views.weights(len(people))
    if not any(weights):
        weights = default_weights(people, problem.robots)
    for factor in _HEAVIER:
        weight = tuple(factor * weight for weight in weights)
        heavier = problem.objective.replace(views=views.replace(weight=weight))
        yield f"{factor:g} times the weight of views", problem.replace(objective=heavier)
    try:
        first = with_views(problem, views.cameras, FIRST, views.at_least, views.share)
    except ProblemError:  # a drone has no pictures, by which a weight could be found
        return
    yield "people before all pixels", first
