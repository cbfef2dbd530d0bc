"""Public function for the player, which shows plans side by side in a notebook or on a page."""

from typing import TYPE_CHECKING

from cocap_opt.api.arguments import (
    Bound,
    plan_of,
    require_flown,
    require_made_for,
    require_problem,
    required_bound,
)
from cocap_opt.formulations.result import CertifiedResult
from cocap_opt.problem import Plan, Problem
from cocap_opt.referee import check as judge_plan
from cocap_opt.result import Result

if TYPE_CHECKING:
    from cocap_opt.player.player import Player


def show(
    problem: Problem,
    *plans: Plan | Result | None,
    certificate: Bound | CertifiedResult | None = None,
) -> "Player":
    """Play plans side by side, inline in a notebook; `.save("plans.html")` writes the page.

    Parameters
    ----------
    problem : the problem that the plans are for
    plans : plans, or results that have one, shown with their planners and J in the titles; None,
        or a result without a plan, is left out. Without any plan the drones are shown at their
        starts; for drones that may choose their start, the ground above which they may start is
        shown
    certificate : a certificate, a proof or a result that has one, from which the player shows the
        bound, what is proved about each plan, and the cost of each move

    Returns
    -------
    Player
        A notebook plays it; `save` writes a single-file page, which needs no network.

    Raises
    ------
    CertificateError
        If the certificate belongs to another problem, is not valid, or claims too low a bound.
    ValueError
        If a plan cannot be flown in this problem or is known to be for another; a plan that breaks
        collision rules is shown.

    Examples
    --------
    >>> co.show(problem, greedy, best, certificate=best).save("plans.html")
    """
    from cocap_opt.player.player import Player
    from cocap_opt.run.explained import gaps_of

    require_problem(problem)
    for n, given in enumerate(plans, 1):
        require_made_for(f"plan {n}", given, problem)
    known = [(given, p) for given in plans if given is not None and (p := plan_of(given))]
    for n, (_, found) in enumerate(known, 1):
        require_flown(f"plan {n}", judge_plan(problem, found))
    gaps = []
    if certificate is not None and known:
        gaps = gaps_of(problem, [p for _, p in known], required_bound(certificate))
    titled = [(_title(n, given), found) for n, (given, found) in enumerate(known, 1)]
    cut_short = ["" if given is None else given.cut_short for given, _ in known]
    planners = [given.method if isinstance(given, Result) else None for given, _ in known]
    return Player(problem, titled, gaps, [name or None for name in planners], cut_short)


def _title(number: int, given: Plan | Result) -> str:
    return f"{number}: J = {given.value:,.0f}" if isinstance(given, Result) else f"plan {number}"
