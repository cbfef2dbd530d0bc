"""Rounds of best responses, then large neighbourhood search.

It combines parts of other planners: sequential planning and rounds of best responses give a first
plan, which large neighbourhood search improves (`coordination.neighbourhoods`). The search computes
best responses over few states of each robot, so that it can make many of them; it ends with rounds
of responses over all states. If sequential planning fails, CoCap's tree with a focal list, starting
from a root planned in rounds, takes over until it finds a plan or proves that none exists.
"""

from collections.abc import Iterator

import numpy as np

from cocap_opt.coordination.low_level import PlannedTeam, value_iteration
from cocap_opt.coordination.neighbourhoods import neighbourhood_search
from cocap_opt.coordination.responses import (
    Planning,
    Responses,
    followed,
    greedily_in_rounds,
    in_rounds,
    then_in_rounds,
)
from cocap_opt.coordination.restricted_value_iteration import RestrictedValueIteration
from cocap_opt.planners.cocap import EXHAUSTED, algorithm_1
from cocap_opt.planners.constraint_tree import ConstraintTree, FocalNodes
from cocap_opt.planners.results import hovering, result_of
from cocap_opt.problem import Problem
from cocap_opt.result import Reason, Result
from cocap_opt.stop import Stop, never
from cocap_opt.timing import timed

# Responses per robot. Measured on passage, bottleneck, the tight scenes and merge, seeds 0 to 9:
# they take 12 to 19 times the CPU time of sequential planning.
RESPONSES = 45


@timed
def cocap_lns(problem: Problem, stop: Stop = never, responses: int = RESPONSES) -> Result:
    """Plan by sequential planning, rounds of best responses and large neighbourhood search.

    Parameters
    ----------
    responses : number of paths per robot that the search computes before it ends; more paths take
        longer and give better plans

    Returns
    -------
    Result
        A plan that no robot can improve by changing its own path alone, or, if a limit was reached,
        the best plan so far. `statistics` holds the number of `responses` over all states.
    """
    asked = Responses(value_iteration, stop)
    nobody = asked.nobody(problem)
    changes = _better_and_better(nobody, asked, stop, responses * nobody.size)
    team, limit = followed(nobody, changes)
    if limit is None and not team.is_whole:
        return Result.without_plan(Reason.INFEASIBLE, EXHAUSTED)
    return result_of(hovering(team), limit, {"responses": asked.asked})


def first_plan(
    nobody: PlannedTeam, responses: Responses, stop: Stop, planning: Planning
) -> Iterator[PlannedTeam]:
    """Yields the team while its first plan is made; if there is no plan, the last team is not
    whole.
    """
    team = nobody
    for team in planning(nobody, responses):
        yield team
    if not team.is_whole:
        tree = ConstraintTree(nobody, responses, stop, FocalNodes(), greedily_in_rounds)
        found = algorithm_1(tree)
        if found is not None:
            yield found.team


def _better_and_better(
    nobody: PlannedTeam, responses: Responses, stop: Stop, asked: int
) -> Iterator[PlannedTeam]:
    """Yields the team while it is planned, and then each better team."""
    team = nobody
    for team in first_plan(nobody, responses, stop, then_in_rounds):
        yield team
    if not team.is_whole:
        return
    restricted = Responses(RestrictedValueIteration.beside(team, stop), stop)
    for better in neighbourhood_search(team, restricted, asked, np.random.default_rng(0)):
        yield (team := better)
    yield from in_rounds(team, responses)
