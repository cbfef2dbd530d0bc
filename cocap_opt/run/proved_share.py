"""Finds the best plan that reaches a share of all views, and a bound on all such plans.

Let V be the views of a plan and V0 the required views. With a Lagrange multiplier m >= 0 of V >=
V0, a bound B on J + m V proves that no plan that reaches the share has

    J > B - m V0

(Lagrangian relaxation: Geoffrion, "Lagrangean relaxation for integer programming", Mathematical
Programming Study 2, 1974). The search for m is the search of the trade-off between J and V
(`front`), whose half-planes are such bounds. The gap between two plans that are best for the same m
remains: the duality gap.
"""

import math
from dataclasses import replace
from functools import partial
from typing import Any

from cocap_opt.console.progress import Watch
from cocap_opt.data import ProblemError
from cocap_opt.formulations.result import OPTIMALITY, proved_by
from cocap_opt.method import Method
from cocap_opt.planners import RECOMMENDED
from cocap_opt.problem import Plan, Problem
from cocap_opt.result import Reason, relative_gap
from cocap_opt.run.engine import run
from cocap_opt.run.front import REWARD_ALONE, VIEWS_ALONE, Direction, Front, HalfPlane
from cocap_opt.run.front_search import towards
from cocap_opt.run.judged import Judged
from cocap_opt.run.options import Allowance
from cocap_opt.run.view_share import (
    bound_with_share,
    keeps_share,
    told_share,
    views_asked,
    views_to_keep,
)
from cocap_opt.stop import Clock, Stop

# the first run and each direction get 1 / _RUNS of the remaining time; a direction, at least
# _LEAST seconds
_RUNS, _LEAST = 3, 0.2


def solve_with_share(
    problem: Problem, method: str | Method[Any], stop: Stop, start: Plan | None = None,
    watch: Watch | None = None, gap: float = OPTIMALITY, **options: Any,
) -> Judged[Any]:  # fmt: skip
    """Returns the best plan that reaches the requested share, with the lowest bound on all such
    plans.

    If no such plan is found, and it is not proved that none exists, the result is that of the
    objective alone: its plan, which misses the share, and its bound, which holds for all plans.

    Parameters
    ----------
    options : options of `run`
    """
    clock, options = Clock(), {**options, "watch": watch or Watch(), "gap": gap}
    part = Allowance(stop.seconds_left / _RUNS)
    first = run(problem, method, stop, start=start, allowance=part, **options)
    plans = [plan for plan in (start, first.result.plan) if plan is not None]
    if _keeps(problem, first) and first.result.limit is not None and stop.reached() is None:
        first = run(problem, method, stop, start=first.result.plan, **options)
        plans.append(first.result.plan)
    if _keeps(problem, first) or first.result.reason is Reason.INFEASIBLE:
        return first._replace(result=replace(first.result, seconds=clock.seconds))
    front = Front(problem, views_asked(problem), problem)
    plane = HalfPlane(REWARD_ALONE, first.result.bound, first.result.certificate)
    front = replace(front, half_planes=(plane,)).with_plans(plans)
    options.pop("report", None)  # it expects reports for a single objective
    while stop.reached() is None and (direction := _next(front, gap)) is not None:
        seconds = max(stop.seconds_left / _RUNS, _LEAST)
        front = towards(front, direction, stop, seconds, RECOMMENDED, method, **options)
    limit = stop.reached()
    found = replace(_result(front, first.result), seconds=clock.seconds)
    if found.reason not in (Reason.OPTIMAL, Reason.INFEASIBLE):
        ended = Reason.FINISHED if limit is None else Reason.STOPPED
        found = replace(found, reason=ended, limit=limit)
    judged = Judged.of(options.get("name") or str(method), problem, found)
    return judged._replace(coverage_seconds=first.coverage_seconds, views=first.views)


def _keeps(problem: Problem, judged: Judged[Any]) -> bool:
    """Returns True if the result has a plan that obeys the rules and reaches the share."""
    return judged.valid and keeps_share(problem, judged.result.plan)


def _next(front: Front, gap: float) -> Direction | None:
    """Returns the next direction that may improve the plans that reach the share, or their bound;
    None if there is none.
    """
    kept = views_to_keep(front.problem, front.views)
    best, bound = front.best_with(kept), front.reward_bound(kept)
    if bound < 0 or (best is not None and relative_gap(best.reward, bound) <= gap):
        return None
    if not front.tries(VIEWS_ALONE):
        return VIEWS_ALONE
    asked = front.asked_direction()
    if asked is None or front.tries(asked):
        return None
    try:
        front.scene(asked)
    except ProblemError:  # the weight would be too large
        return None
    return asked


def _with_share(front: Front, plane: HalfPlane) -> float:
    """Returns a J that no plan that reaches the share exceeds, from one half-plane."""
    if plane.direction == REWARD_ALONE:
        return plane.bound
    return bound_with_share(front.problem, front.scene(plane.direction), plane.bound)


def _result(front: Front, first: Any) -> Any:
    """Returns the result of a trade-off: the best plan that reaches the share, and its bound.

    Parameters
    ----------
    first : the result of the objective alone
    """
    plane = min(front.half_planes, key=partial(_with_share, front))
    bound, file = _with_share(front, plane), front.file(plane)
    best = front.best_with(views_to_keep(front.problem, front.views))
    told = told_share(front.views.share or 0.0, None if best is None else best.reward, bound)
    if bound < 0:
        return replace(
            first, plan=None, value=-math.inf, bound=bound, message=told, certificate=file,
            reason=Reason.INFEASIBLE, limit=None, statistics={},
        )  # fmt: skip
    if best is None:
        words = "; ".join(filter(None, (first.message, told)))
        return replace(first, message=words, reason=Reason.FINISHED)
    return replace(
        first, plan=best.plan, value=best.reward, bound=bound, message=told, certificate=file,
        reason=proved_by(best.reward, bound) or Reason.FINISHED, limit=None,
        statistics={"multiplier of the share": plane.direction.views},
    )  # fmt: skip
