"""Diving: a plan by deciding, round after round, what a mixture has nearly decided.

The states that are used most, though not wholly, must be used by one more robot; the master
is solved and priced again under these decisions, until whole robots use every state or
nothing more is to be decided. What comes out is rounded and improved (`primal`).
"""

import math

from cocap_opt.formulations.certificates.certificate import Decision
from cocap_opt.formulations.certificates.resources import Resource
from cocap_opt.formulations.column_generation.branching import amounts_of, whole_paths
from cocap_opt.formulations.column_generation.master import Master, Solution
from cocap_opt.formulations.column_generation.primal import (
    Incumbent,
    improved,
    incumbent_along,
    respond,
)
from cocap_opt.formulations.column_generation.search import Search
from cocap_opt.stop import Limit

NEARLY = 0.75  # fraction of a robot from which on a state is decided
SHARE = 0.15  # of the undecided states, at least, that are decided in a round
MOST_ROUNDS = 40
PRICINGS = 2  # in each round
WHOLE = 1e-3


def dive(search: Search, master: Master, solution: Solution) -> Incumbent | None:
    """Plan found by diving from a mixture; None where it ends in conflicts."""
    decisions = master.decisions
    taken: set[Resource] = set()
    for _ in range(MOST_ROUNDS):
        if search.stop() is not Limit.NONE:
            return None
        new = _nearly_decided(search, solution, taken)
        if not new:
            break
        taken |= set(new)
        decisions = (*decisions, *(Decision(r, "at least", k) for r, k in new.items()))
        master = _under(search, master, solution, decisions)
        solution = _priced_again(search, master)
    if search.stop() is not Limit.NONE:
        return None
    found = decided(search, solution)
    if found is not None:
        return found
    return improved(search.model, solution.columns, solution.mixture, master.arcs, search.stop)


def decided(search: Search, solution: Solution) -> Incumbent | None:
    """What becomes of a mixture in which whole robots use every state; None where they do not."""
    paths = whole_paths(search.model, solution.columns, solution.mixture)
    plan = None if paths is None else incumbent_along(search.model, paths)
    return None if plan is None else respond(search.model, plan.columns, search.stop)


def _nearly_decided(
    search: Search, solution: Solution, taken: set[Resource]
) -> dict[Resource, int]:
    """States that are to be used by one more robot than a mixture wholly does."""
    states = amounts_of(search.model, solution.columns, solution.mixture)[2]
    open_ = {
        resource: amount
        for resource, amount in states.items()
        if resource not in taken and amount - math.floor(amount + WHOLE) > WHOLE
    }
    ranked = sorted(open_, key=lambda r: (-(open_[r] % 1), r.t, repr(r)))
    # One robot's states of neighbouring steps decide one another: take every few.
    least = max(1, round(SHARE * len(search.model.problem.robots) * search.model.problem.horizon))
    chosen: dict[Resource, int] = {}
    steps: set[int] = set()
    for resource in ranked:
        fraction = open_[resource] % 1
        if fraction < NEARLY and (len(chosen) >= least or resource.t in steps):
            continue
        if fraction < 0.5 and chosen:
            break
        steps.add(resource.t)
        chosen[resource] = math.floor(open_[resource] + WHOLE) + 1
    return chosen


def _under(
    search: Search, master: Master, solution: Solution, decisions: tuple[Decision, ...]
) -> Master:
    """The master under more decisions, with the arcs, rows and cuts it has."""
    result = Master(search.model, master.penalty, decisions)
    for column in (*solution.columns, *master.columns):
        result.add(column)
    for resource in master.rows:
        result.add_row(resource)
    for cut in master.cuts:
        result.add_cut(cut)
    return result


def _priced_again(search: Search, master: Master) -> Solution:
    """Solve, with new columns."""
    solution = master.solve(search.stop)
    for _ in range(PRICINGS):
        priced = search.pricer(solution.duals, master.decisions)
        new = [master.add(column) for column in priced.columns]
        if not any(new):
            break
        solution = master.solve(search.stop)
    return solution
