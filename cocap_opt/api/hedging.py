"""Public function that compares plans for single takes with a plan for all of them."""

from cocap_opt.api.arguments import require_problem
from cocap_opt.data import require
from cocap_opt.problem import Problem
from cocap_opt.run.options import Option
from cocap_opt.run.takes import Hedging, hedging
from cocap_opt.stop import Stop, never


def compare_takes(problem: Problem, *, seconds: float = 10.0, stop: Stop = never) -> Hedging:
    """Compare two costs: planning for one take when another happens, and hedging against all.

    Branch-and-price searches for the best plan, and proves a bound, for each take alone and for the
    mean over all takes. All plans keep their distance from the people of all takes, so each plan
    can be flown whichever take happens.

    Parameters
    ----------
    problem : a problem with takes
    seconds : for each plan, including coverage
    stop : a further stopping criterion

    Returns
    -------
    Hedging
        With `plans`, one for each take, and `hedged`, the plan for all. Each has its `rewards` in
        each take, their `mean`, and the `bound` that no plan exceeds, with its certificate. `table`
        has a row for each plan. `sentences()` describes what plans for one take lose and what
        hedging costs; printing the object shows both.

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
    require(bool(problem.takes), "problem", "must have takes; use `takes` to draw some")
    return hedging(problem, Option("seconds").require_limit(seconds), stop)
