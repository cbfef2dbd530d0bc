"""V, the number of drones that see each person, added up over the person-steps that count.

Each person-step counts up to a number of drones, weighted by the person's importance; people
without any weight do not count. V can be part of the objective or the only part, and a share of its
largest possible value can be required.
"""

import math
from functools import lru_cache

import numpy as np

from cocap_opt.data import FloatArray
from cocap_opt.footage.quality import Assumptions, Quality, person_steps
from cocap_opt.formulations.certificates import CertificateFile, ProofFile
from cocap_opt.formulations.result import OPTIMALITY
from cocap_opt.output.told_bounds import told_bound
from cocap_opt.problem import Objective, Plan, Problem, Views
from cocap_opt.referee import check

_ROUNDING = 1e-9  # relative rounding error
_KEPT = 64  # plans of a trade-off that are cached, as they are reported after each direction


def views_asked(
    problem: Problem,
    cameras: int | None = None,
    at_least: float | None = None,
    share: float | None = None,
) -> Views:
    """Returns the views that V counts, with weight 1 for each person who has any weight.

    None: as in the problem's objective, or the default.

    Raises
    ------
    ProblemError
        If a number is out of range; the message names the field.
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


def views_alone(problem: Problem, views: Views, name: str | None = None) -> Problem:
    """Returns a problem in which only the drones that see people count.

    Parameters
    ----------
    name : name of the new problem; None: that of the given problem
    """
    objective = Objective(
        pixels=0.0, views=views.replace(share=None), count_start=problem.objective.count_start
    )
    return problem.replace(objective=objective, name=problem.name if name is None else name)


def counting_gap(problem: Problem) -> float:
    """Returns the relative gap below which a plan is proved optimal because J is a whole number of
    units.

    This applies if J counts only views of equal weight; otherwise the gap is `OPTIMALITY`.
    """
    views = problem.objective.views
    if views is None or problem.objective != views_alone(problem, views).objective:
        return OPTIMALITY
    weights = counted_weights(problem) * views.weights(len(problem.actors))
    units = weights[weights > 0]
    if len(np.unique(units)) != 1:
        return OPTIMALITY
    return 0.999 / (views.cameras * len(units))


def most_views(problem: Problem, cameras: int) -> float:
    """Returns the largest possible V, if all people were seen by this many drones at all steps."""
    return min(cameras, len(problem.robots)) * math.fsum(counted_weights(problem).ravel().tolist())


def views_of(problem: Problem, plan: Plan, views: Views) -> float:
    """Returns V of a plan."""
    return math.fsum(check(views_alone(problem, views), plan).count_reward)


@lru_cache(maxsize=_KEPT)
def seen_share(problem: Problem, plan: Plan, views: Views) -> float:
    """Returns the share of person-steps, by importance, that this many drones see; nan if there are
    none.
    """
    assumptions, weights = Assumptions(at_least=views.at_least), counted_weights(problem)
    found = Quality.of(problem, plan, assumptions=assumptions)
    seen, total = weights[found.views >= views.cameras].sum(), weights.sum()
    return float(seen / total) if total else math.nan


def views_to_keep(problem: Problem, views: Views) -> float:
    """Returns the smallest V of a plan that reaches the requested share of all views.

    If all person-steps have equal weight, V is a multiple of that weight.
    """
    least = (views.share or 0.0) * most_views(problem, views.cameras)
    counted = counted_weights(problem)
    units = np.unique(counted[counted > 0])
    if len(units) != 1:
        return least
    unit = float(units[0])
    return unit * math.ceil(least / unit * (1 - _ROUNDING) - _ROUNDING)


def lagrangian_bound(bound: float, multiplier: float, views: float) -> float:
    """Returns a J that no plan with at least this many views exceeds, from a bound on J + m V.

        J <= B - m V

    Parameters
    ----------
    bound, multiplier : B, and m >= 0, the Lagrange multiplier of V >= views
    """
    taken = multiplier * views
    if not taken or math.isinf(bound):
        return bound
    return bound - taken + _ROUNDING * (abs(bound) + taken)


def bound_with_share(problem: Problem, other: Problem, bound: float) -> float:
    """Returns a J that no plan that reaches the requested share exceeds, from a bound for another
    objective.

    Parameters
    ----------
    other : the problem with more weight of views for each person who counts, or with views alone
    bound : a bound on its J

    Returns
    -------
    float
        -inf if no plan reaches the share; inf if the bound proves nothing about it, or no share is
        requested.
    """
    given, heavier = problem.objective.views, other.objective.views
    if given is None or heavier is None or given.share is None:
        return math.inf
    if (given.cameras, given.at_least) != (heavier.cameras, heavier.at_least):
        return math.inf
    people, counted = len(problem.actors), (counted_weights(problem) > 0).any(axis=0)
    weights, kept = np.array(heavier.weights(people)), views_to_keep(problem, given)
    if not counted.any():
        return math.inf
    found = math.inf
    if other.objective.replace(views=given) == problem.objective:
        more = weights - given.weights(people)
        if more.min() >= 0:
            found = lagrangian_bound(bound, float(more[counted].min()), kept)
    is_alone = other.objective == views_alone(problem, heavier).objective
    if is_alone and lagrangian_bound(bound, float(weights[counted].min()), kept) < 0:
        return -math.inf
    return found if found >= 0 else -math.inf  # J is never negative


def proved_in(
    problem: Problem, file: CertificateFile | ProofFile, bound: float | None = None
) -> float:
    """Returns the bound on J of a problem that a file claims, for its own objective or the scene's.

    If the file has its own objective, the bound holds for plans that reach the requested share of
    views.

    Parameters
    ----------
    bound : the bound that its numbers prove; None: use the claimed bound
    """
    other, proved = file.problem_of(problem), file.proved if bound is None else bound
    if other.objective == problem.objective:
        return proved
    return bound_with_share(problem, other, proved)


def told_share(share: float, reward: float | None, bound: float) -> str:
    """Describes what is known about the plans that reach a share of views.

    Parameters
    ----------
    reward : J of the best such plan; None if none is known
    bound : J that no such plan exceeds; negative: none exists
    """
    if bound < 0:
        return f"proved: no plan of these drones keeps {100 * share:g} %"
    words = "no plan was found" if reward is None else f"the best one found has J = {reward:,.2f}"
    proved = f"; no plan has more than {told_bound(bound, reward)}" if bound < math.inf else ""
    return f"with {100 * share:g} % of views {words}{proved}"


def keeps_share(problem: Problem, plan: Plan) -> bool:
    """Returns True if a plan reaches the requested share of views, or if none is requested."""
    asked = views_asked(problem)
    if asked.share is None:
        return True
    return views_of(problem, plan, asked) >= views_to_keep(problem, asked) * (1 - _ROUNDING)


def missed_share(problem: Problem, plan: Plan) -> str:
    """Returns a message if a plan does not reach the requested share of views; otherwise empty."""
    if keeps_share(problem, plan):
        return ""
    asked = views_asked(problem)
    most, kept = most_views(problem, asked.cameras), views_of(problem, plan, asked)
    return (
        f"{kept:g} of {most:g} views are kept, fewer than {100 * (asked.share or 0):g} %: use "
        "`solve` to find the best plan that keeps them, or a proof that none does"
    )
