"""The face's comparison of plans beside takes."""

from cocap_opt.api.arguments import require_problem
from cocap_opt.data import require
from cocap_opt.problem import Problem
from cocap_opt.run.options import Option
from cocap_opt.run.takes import Hedging, hedging
from cocap_opt.stop import Stop, never


def compare_takes(problem: Problem, *, seconds: float = 10.0, stop: Stop = never) -> Hedging:
    """Show what a plan for one take loses in another, and what hedging costs.

    For each take alone, and for all of them on average, it searches for the best plan and proves a
    bound, with branch-and-price. All plans keep away from the people of all takes, so that each of
    them can be flown whichever take it is.

    Parameters
    ----------
    problem : with takes
    seconds : for each plan, the coverage included
    stop : a further stopping criterion

    Returns
    -------
    Hedging
        With `plans`, one for each take, and `hedged`, the one for all. Each has its `rewards` in
        each take, the `mean`, and the `bound` that no plan exceeds, with its certificate. `table`
        has a row for each plan. `sentences()` says what plans for one take lose and what hedging
        costs; printed it tells both.

    Raises
    ------
    ProblemError
        If the problem has no takes.
    ValueError
        If `seconds` is not valid.

    Examples
    --------
    >>> co.compare_takes(co.takes(problem, aside=0.5), seconds=5).table
    """
    require_problem(problem)
    require(bool(problem.takes), "problem", "must have takes; `takes` draws some")
    return hedging(problem, Option("seconds").require_limit(seconds), stop)
