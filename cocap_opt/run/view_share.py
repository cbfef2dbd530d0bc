"""The number of drones that see people, alone, and as a share of the most there could be."""

import math

from cocap_opt.problem import Objective, Plan, Problem, Views
from cocap_opt.referee import check

_ROUNDING = 1e-9  # relative


def views_alone(problem: Problem, views: Views) -> Problem:
    """Returns a problem in which drones that see people count, and nothing else."""
    objective = Objective(pixels=0.0, views=views, count_start=problem.objective.count_start)
    return problem.replace(objective=objective)


def most_views(problem: Problem, cameras: int) -> float:
    """Returns the most that V could be, if all people were seen by so many drones at all steps.

    Each person and step counts as often as it is important.
    """
    most = min(cameras, len(problem.robots))
    return most * float(problem.importance[problem.first_step :].sum())


def missed_share(problem: Problem, plan: Plan) -> str:
    """Says that a plan does not keep the share of views that is asked for; empty if it does."""
    views = problem.objective.views
    if views is None or views.share is None:
        return ""
    most = most_views(problem, views.cameras)
    kept = math.fsum(check(views_alone(problem, views.replace(weight=1.0)), plan).count_reward)
    if kept >= views.share * most * (1 - _ROUNDING):
        return ""
    return (
        f"{100 * kept / most:.1f} % of views are kept, not {100 * views.share:g} %: `front` finds "
        "the best plan that keeps them, or proves that none does"
    )
