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
from cocap_opt.formulations.certificates import CertificateFile, ProofFile
from cocap_opt.formulations.result import OPTIMALITY
from cocap_opt.output.told_bounds import told_bound
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


def views_alone(problem: Problem, views: Views, name: str | None = None) -> Problem:
    """Returns a problem in which drones that see people count, and nothing else.

    Parameters
    ----------
    name : of it; None: that of the problem
    """
    objective = Objective(
        pixels=0.0, views=views.replace(share=None), count_start=problem.objective.count_start
    )
    return problem.replace(objective=objective, name=problem.name if name is None else name)


def counting_gap(problem: Problem) -> float:
    """Returns the relative gap below which a plan is proved best, as J is a whole number of units.

    So it is where J counts views of one weight and nothing else; elsewhere it is `OPTIMALITY`.
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


def views_to_keep(problem: Problem, views: Views) -> float:
    """Returns the least V of a plan that keeps the share of all views that is asked for.

    Where all person-steps count alike, V is a multiple of what one of them counts.
    """
    least = (views.share or 0.0) * most_views(problem, views.cameras)
    counted = counted_weights(problem)
    units = np.unique(counted[counted > 0])
    if len(units) != 1:
        return least
    unit = float(units[0])
    return unit * math.ceil(least / unit * (1 - _ROUNDING) - _ROUNDING)


def lagrangian_bound(bound: float, multiplier: float, views: float) -> float:
    """Returns the J that no plan of at least so many views exceeds, by a bound on J + m V.

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
    """Returns the J that no plan that keeps the share asked for exceeds, by a bound elsewhere.

    Parameters
    ----------
    other : the problem with more weight of views for each person who counts, or with views alone
    bound : on its J

    Returns
    -------
    float
        -inf where no plan keeps the share; inf where the bound says nothing of it, or no share is
        asked for.
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
    return found if found >= 0 else -math.inf  # no J is negative


def proved_in(
    problem: Problem, file: CertificateFile | ProofFile, bound: float | None = None
) -> float:
    """Returns the bound on J of a problem that a file claims, by its own objective or the scene's.

    Where the objective is its own, that is of plans that keep the share of views asked for.

    Parameters
    ----------
    bound : that its numbers prove, in place of the one that it claims
    """
    other, proved = file.problem_of(problem), file.proved if bound is None else bound
    if other.objective == problem.objective:
        return proved
    return bound_with_share(problem, other, proved)


def told_share(share: float, reward: float | None, bound: float) -> str:
    """Says what is known of the plans that keep a share of views.

    Parameters
    ----------
    reward : J of the best one; None if none is known
    bound : J that none of them exceeds; negative: there is none
    """
    if bound < 0:
        return f"no plan of these drones keeps {100 * share:g} %: that is proved"
    words = "none was found" if reward is None else f"the best one found has J = {reward:,.2f}"
    proved = f"; none has more than {told_bound(bound, reward)}" if bound < math.inf else ""
    return f"with {100 * share:g} % of views {words}{proved}"


def keeps_share(problem: Problem, plan: Plan) -> bool:
    """Returns True for a plan that keeps the share of views that is asked for, if one is."""
    asked = views_asked(problem)
    if asked.share is None:
        return True
    return views_of(problem, plan, asked) >= views_to_keep(problem, asked) * (1 - _ROUNDING)


def missed_share(problem: Problem, plan: Plan) -> str:
    """Says that a plan does not keep the share of views that is asked for; empty if it does."""
    if keeps_share(problem, plan):
        return ""
    asked = views_asked(problem)
    most, kept = most_views(problem, asked.cameras), views_of(problem, plan, asked)
    return (
        f"{kept:g} of {most:g} views are kept, fewer than {100 * (asked.share or 0):g} %: `solve` "
        "looks for the best plan that keeps them, or a proof that none does"
    )
