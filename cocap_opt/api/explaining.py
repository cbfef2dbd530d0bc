"""Public functions that explain a gap: its parts, and the gains from re-planning single drones."""

from typing import TYPE_CHECKING

from cocap_opt.api.arguments import Bound, plan_for, require_flown, required_bound
from cocap_opt.formulations.result import CertifiedResult
from cocap_opt.model import Model, compiled
from cocap_opt.problem import Plan, Problem
from cocap_opt.referee import check as judge_plan
from cocap_opt.result import Result
from cocap_opt.run.verified import ProvedBound, Verified

if TYPE_CHECKING:
    import pandas as pd


def explain(
    problem: Problem,
    plan: Plan | Result | None,
    certificate: Bound | CertifiedResult | None = None,
) -> "pd.DataFrame":
    """Split the gap between a plan and a bound into terms that add up to it.

    There are three kinds of terms. A drone's move at a step may cost something compared with the
    best move. The bound may assume a larger reward for a face than the drones get. And the bound
    includes the prices of rules that no drone uses. Amounts are >= 0, with two exceptions: a rule
    that the plan breaks, and `stages`, the amount by which the stages of a staged certificate lower
    the bound of its multipliers. `cocap-opt verify --explain` prints the same in words.

    Parameters
    ----------
    problem : the problem that the plan is for
    plan : a plan that can be flown, or a result that has one
    certificate : the certificate or proof of the bound, or a result that has one; if None,
        that of `plan`

    Returns
    -------
    DataFrame
        A row per term: `kind` (path, face, views, row, decision, leaves, stages, claim, rounding),
        `step`, `robot`, `actor`, `face` (of the actor), `amount` in units of J, and `share` of the
        bound; for views also `robots` (the drones that see the person); for rows and decisions also
        `resource`, `sense` and `robots` (the largest or smallest number of drones that may use it),
        `used` and `price`. `attrs` has `bound`, `reward`, and their `difference`.

    Raises
    ------
    CertificateError
        If the certificate belongs to another problem, is not valid, or claims too low a bound.
    ValueError
        If the plan cannot be flown, or the certificate proves that there is no plan.

    Examples
    --------
    >>> co.explain(problem, result, best).nlargest(5, "amount")
    """
    from pandas import DataFrame

    from cocap_opt.run.explained import Explained

    flown = plan_for(problem, plan, "explained")
    file = required_bound(plan if certificate is None else certificate)
    require_flown("plan", judge_plan(problem, flown))
    proved = ProvedBound.of(Model(problem, plain=True), file)
    explained = Explained.of(Verified.of(problem, flown, bounds=[proved]))
    if explained is None:
        raise ValueError("certificate: it proves that no plan exists, so there is no gap")
    frame = DataFrame(explained.records)
    whole = ["step", "robot", "actor", "face", "robots", "used"]
    frame = frame.astype({**dict.fromkeys(whole, "Int64"), "price": "float64"})
    found = explained.explanation
    frame.attrs = {"bound": found.bound, "reward": found.reward, "difference": found.gap}
    return frame


def replans(problem: Problem, plan: Plan | Result | None) -> "pd.DataFrame":
    """Plan each drone again while all others keep their paths, and return the gains.

    Parameters
    ----------
    problem : the problem that the plan is for
    plan : a plan that can be flown, or a result that has one

    Returns
    -------
    DataFrame
        A row per drone that has such a path, the largest gain first: `robot`, `gain` (in J),
        `share` (of the plan's J), and the new `plan`. A gain is below 0 if the new path costs J in
        order to avoid a conflict. If pixels add up over time, the path may not be the drone's best.

    Raises
    ------
    ValueError
        If the plan cannot be flown.

    Examples
    --------
    >>> better = co.replans(problem, result).plan[0]
    """
    from pandas import DataFrame

    from cocap_opt.coordination.best_response import replans as replanned

    flown = plan_for(problem, plan, "replaced")
    verdict = judge_plan(problem, flown)
    require_flown("plan", verdict)
    found = sorted(replanned(compiled(problem), flown), key=lambda replan: -replan.gain)
    value = verdict.reward
    return DataFrame({
        "robot": [replan.robot for replan in found],
        "gain": [replan.gain for replan in found],
        "share": [replan.gain / value if value > 0 else 0.0 for replan in found],
        "plan": [replan.plan for replan in found],
    })  # fmt: skip
