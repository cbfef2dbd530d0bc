"""Diving: makes a plan by fixing, round after round, what a mixture has nearly decided.

The states with the largest fractional use must be used by one more robot; the master is solved and
priced again under these decisions, until the mixture is integral or nothing remains to be decided.
The result is rounded and improved.
"""

import math

from cocap_opt.formulations.certificates import Decision
from cocap_opt.formulations.certificates.resources import Resource
from cocap_opt.formulations.column_generation.master.master import Master
from cocap_opt.formulations.column_generation.master.master_program import Solution
from cocap_opt.formulations.column_generation.master.resource_use import ResourceUse
from cocap_opt.formulations.column_generation.parameters import TreeParameters
from cocap_opt.formulations.column_generation.primal.incumbent import Incumbent
from cocap_opt.formulations.column_generation.search import Search
from cocap_opt.mixtures.mixture import Mixture
from cocap_opt.model import Model
from cocap_opt.stop import LimitReached


def dive(search: Search, master: Master, solution: Solution) -> Incumbent | None:
    """Returns a plan to which the solution of a master leads; None if it has conflicts or is
    stopped.
    """
    search.allow_responses(search.parameters.tree.dive_responses)
    try:
        mixture = _decided(search, master, solution).mixture
    except LimitReached:
        return None
    found = search.local_search.from_integral(mixture)
    if found is not None:
        return found
    return search.local_search.from_mixture(mixture, search.incumbent)


def _decided(search: Search, master: Master, solution: Solution) -> Solution:
    """Returns the solution after as many decisions as can be made.

    Raises
    ------
    LimitReached
        If the stopping criterion is reached first.
    """
    parameters, taken = search.parameters.tree, set[Resource]()
    for _ in range(parameters.most_dive_rounds):
        search.stop.check()
        new = _nearly_decided(search.model, solution.mixture, taken, parameters)
        if not new:
            break
        taken |= set(new)
        decisions = tuple(Decision(resource, "at least", k) for resource, k in new.items())
        columns = (*solution.mixture.columns, *master.columns)
        rows, cuts = master.rows, master.cuts
        master = Master(search.model, master.penalty, (*master.decisions, *decisions))
        master.add_all(columns, rows, cuts)
        solution = master.solve(search.stop)
        for _ in range(parameters.dive_pricings):
            priced = search.pricer(solution.duals, master.decisions)
            if not sum(master.add(column) for column in priced.columns):
                break
            solution = master.solve(search.stop)
    search.stop.check()
    return solution


def _nearly_decided(
    model: Model, mixture: Mixture, taken: set[Resource], parameters: TreeParameters
) -> dict[Resource, int]:
    """Returns states that one more robot must use, with the number of robots that must then use
    each.

    A robot's states at neighbouring steps determine each other, so states at a few steps are
    decided at a time.

    Parameters
    ----------
    taken : states that were decided before
    """
    tolerance = parameters.dive_tolerance
    open_ = {
        resource: amount
        for resource, amount in ResourceUse.of(model, mixture).states.items()
        if resource not in taken and amount - math.floor(amount + tolerance) > tolerance
    }
    ranked = sorted(open_, key=lambda r: (-(open_[r] % 1), r.t, repr(r)))
    robots, horizon = len(model.problem.robots), model.problem.horizon
    least = max(1, round(parameters.dive_share * robots * horizon))
    chosen: dict[Resource, int] = {}
    steps: set[int] = set()
    for resource in ranked:
        fraction = open_[resource] % 1
        enough = len(chosen) >= least or resource.t in steps
        if fraction < parameters.dive_nearly and enough:
            continue
        if fraction < 0.5 and chosen:
            break
        steps.add(resource.t)
        chosen[resource] = math.floor(open_[resource] + tolerance) + 1
    return chosen
