"""Diving: a plan by deciding, round after round, what a mixture has nearly decided.

The states that are used most, though by no integral number of robots, must be used by one more
robot; the master is solved and priced again under these decisions, until the mixture is integral
or nothing more is to be decided. It is then rounded and improved (`local_search`).
"""

import math

from cocap_opt.formulations.certificates import Decision
from cocap_opt.formulations.certificates.resources import Resource
from cocap_opt.formulations.column_generation.master.master import Master
from cocap_opt.formulations.column_generation.master.master_program import Solution
from cocap_opt.formulations.column_generation.master.mixture import Mixture, ResourceUse
from cocap_opt.formulations.column_generation.primal.incumbent import Incumbent
from cocap_opt.formulations.column_generation.search import Search
from cocap_opt.stop import LimitReached


def dive(search: Search, master: Master, solution: Solution) -> Incumbent | None:
    """Returns a plan found by diving from a mixture; None if it ends in conflicts or is stopped."""
    search.allow_responses(search.parameters.tree.dive_responses)
    try:
        master, solution = _dived(search, master, solution)
    except LimitReached:
        return None
    found = search.local_search.from_integral(solution.mixture)
    if found is not None:
        return found
    return search.local_search.from_mixture(solution.mixture, master.arcs, search.incumbent)


def _dived(search: Search, master: Master, solution: Solution) -> tuple[Master, Solution]:
    """Returns the master and its solution after as many decisions as there are to make.

    Raises
    ------
    LimitReached
        If the stopping criterion is reached before.
    """
    decisions = master.decisions
    taken: set[Resource] = set()
    for _ in range(search.parameters.tree.most_dive_rounds):
        search.stop.check()
        new = _nearly_decided(search, solution.mixture, taken)
        if not new:
            break
        taken |= set(new)
        decisions = (*decisions, *(Decision(r, "at least", k) for r, k in new.items()))
        columns = (*solution.mixture.columns, *master.columns)
        rows, cuts = master.rows, master.cuts
        master = Master(search.model, master.penalty, decisions)
        master.add_all(columns, rows, cuts)
        solution = _priced_again(search, master)
    search.stop.check()
    return master, solution


def _nearly_decided(search: Search, mixture: Mixture, taken: set[Resource]) -> dict[Resource, int]:
    """Returns states that one more robot is to use, and how many robots are to use each then.

    One robot's states of neighbouring steps decide one another: every few are taken.
    """
    states = ResourceUse.of(search.model, mixture).states
    open_ = {
        resource: amount
        for resource, amount in states.items()
        if resource not in taken
        and amount - math.floor(amount + search.parameters.tree.dive_tolerance)
        > search.parameters.tree.dive_tolerance
    }
    ranked = sorted(open_, key=lambda r: (-(open_[r] % 1), r.t, repr(r)))
    least = max(
        1,
        round(
            search.parameters.tree.dive_share
            * len(search.model.problem.robots)
            * search.model.problem.horizon
        ),
    )
    chosen: dict[Resource, int] = {}
    steps: set[int] = set()
    for resource in ranked:
        fraction = open_[resource] % 1
        if fraction < search.parameters.tree.dive_nearly and (
            len(chosen) >= least or resource.t in steps
        ):
            continue
        if fraction < 0.5 and chosen:
            break
        steps.add(resource.t)
        chosen[resource] = math.floor(open_[resource] + search.parameters.tree.dive_tolerance) + 1
    return chosen


def _priced_again(search: Search, master: Master) -> Solution:
    """Solves a master in turn with some rounds of pricing."""
    solution = master.solve(search.stop)
    for _ in range(search.parameters.tree.dive_pricings):
        priced = search.pricer(solution.duals, master.decisions)
        new = [master.add(column) for column in priced.columns]
        if not any(new):
            break
        solution = master.solve(search.stop)
    return solution
