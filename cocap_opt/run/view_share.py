"""V, the number of drones that see each person, added up over the person-steps that count.

Each person and step counts up to a number of drones, and as often as the person is important there;
people without any weight do not count. V is planned for with all else or alone, and may be asked
for as a share of the most that it could be.
"""

import math
from functools import lru_cache

import numpy as np

from cocap_opt.data import FloatArray
from cocap_opt.footage.quality import Assumptions, Quality, person_steps
from cocap_opt.problem import Objective, Plan, Problem, Views
from cocap_opt.referee import check

_ROUNDING = 1e-9  # relative
_KEPT = 64  # plans of a trade-off, which are told after each direction


def views_asked(
    problem: Problem,
    cameras: int | None = None,
    at_least: float | None = None,
    share: float | None = None,
) -> Views:
    """Returns the views that V counts, with weight 1 for each person who has any weight.

    What is None is as the problem's objective has it, or as usual.

    Raises
    ------
    ProblemError
        If a number is out of range; it names the field.
    """
    given = {"cameras": cameras, "at_least": at_least, "share": share}
    views = (problem.objective.views or Views()).replace(
        **{name: value for name, value in given.items() if value is not None}
    )
    counted = tuple((counted_weights(problem) > 0).any(axis=0).astype(float).tolist())
    return views.replace(weight=1.0 if all(counted) else counted)


def counted_weights(problem: Problem) -> FloatArray:
    """Returns the weight [T+1, A] of each person-step: the importance there, 0 if none counts."""
    return np.where(person_steps(problem), problem.importance, 0.0)


def views_alone(problem: Problem, views: Views) -> Problem:
    """Returns a problem in which drones that see people count, and nothing else."""
    objective = Objective(
        pixels=0.0, views=views.replace(share=None), count_start=problem.objective.count_start
    )
    return problem.replace(objective=objective)


def most_views(problem: Problem, cameras: int) -> float:
    """Returns the most that V could be, if all people were seen by so many drones at all steps."""
    return min(cameras, len(problem.robots)) * math.fsum(counted_weights(problem).ravel().tolist())


def views_of(problem: Problem, plan: Plan, views: Views) -> float:
    """Returns V of a plan."""
    return math.fsum(check(views_alone(problem, views), plan).count_reward)


@lru_cache(maxsize=_KEPT)
def seen_share(problem: Problem, plan: Plan, views: Views) -> float:
    """Returns the share of person-steps, by importance, that so many drones see; nan of none."""
    assumptions, weights = Assumptions(at_least=views.at_least), counted_weights(problem)
    found = Quality.of(problem, plan, assumptions=assumptions)
    seen, total = weights[found.views >= views.cameras].sum(), weights.sum()
    return float(seen / total) if total else math.nan


def missed_share(problem: Problem, plan: Plan) -> str:
    """Says that a plan does not keep the share of views that is asked for; empty if it does."""
    asked = views_asked(problem)
    if asked.share is None:
        return ""
    most, kept = most_views(problem, asked.cameras), views_of(problem, plan, asked)
    if kept >= asked.share * most * (1 - _ROUNDING):
        return ""
    return (
        f"{kept:g} of {most:g} views are kept, fewer than {100 * asked.share:g} %: `front` finds "
        "the best plan that keeps them, or proves that none does"
    )
