"""Sequential planning with earlier robots as moving obstacles (prioritised planning).

Source: Greedy Perspectives, "sequential planning with inter-robot collision constraints".
Rounds of best responses and several orders of the robots are its usual extensions.
"""

from collections.abc import Iterator

import numpy as np

from cocap_opt.coordination.low_level import LowLevel, PlannedTeam, value_iteration
from cocap_opt.coordination.responses import Responses, followed, one_by_one, then_in_rounds
from cocap_opt.planners.lazy_value_iteration import LazyValueIteration
from cocap_opt.planners.results import hovering, result_of
from cocap_opt.problem import Problem
from cocap_opt.result import Reason, Result
from cocap_opt.stop import Limit, Stop, never
from cocap_opt.timing import timed

ORDERS = 10  # number of orders that `best_of_orders` tries


@timed
def sequential(
    problem: Problem, stop: Stop = never, low_level: LowLevel = value_iteration
) -> Result:
    """Plan the robots in order, each clear of the earlier ones' paths.

    The start cells of robots not yet planned are kept free at all steps, as in the source, so that
    a robot that cannot be planned in time can stay there. The attempt ends if a robot has no path
    left: the order has then failed, which proves nothing.
    """
    responses = Responses(low_level, stop)
    nobody = responses.nobody(problem)
    return _result(*followed(nobody, one_by_one(nobody, responses)))


def sequential_lazy(problem: Problem, stop: Stop = never) -> Result:
    """Find the same plan as `sequential`, but evaluate only the views that decide it."""
    return sequential(problem, stop, low_level=LazyValueIteration())


@timed
def sequential_rounds(problem: Problem, stop: Stop = never) -> Result:
    """Plan as `sequential` does, then in rounds of best responses that obey the rules.

    In a round, each robot in turn is replanned, clear of all others, for its marginal gain over
    what they see. The rounds end with a plan that no robot can improve by changing its own path
    alone.
    """
    responses = Responses(value_iteration, stop)
    nobody = responses.nobody(problem)
    return _result(*followed(nobody, then_in_rounds(nobody, responses)))


@timed
def best_of_orders(problem: Problem, stop: Stop = never) -> Result:
    """Plan sequentially in several orders, and keep the best plan.

    The first order is by robot number, the others are random.
    """
    responses = Responses(value_iteration, stop)
    nobody = responses.nobody(problem)
    return _result(*followed(nobody, _in_orders(nobody, responses)))


def _in_orders(nobody: PlannedTeam, responses: Responses) -> Iterator[PlannedTeam]:
    """Yields each better team; before the first whole team, also the partial teams on the way."""
    rng, best = np.random.default_rng(0), None
    for n in range(ORDERS):
        order = rng.permutation(nobody.size).tolist() if n else None
        for team in one_by_one(nobody, responses, order):
            if best is None or (team.is_whole and team.gains_over(best)):
                yield team
                best = team if team.is_whole else None


def _result(team: PlannedTeam, limit: Limit | None) -> Result:
    """Returns the result of a team that is planned as far as a limit or the other robots allow."""
    if not team.is_whole and limit is None:
        robot = team.found.index(None)
        is_first = not any(team.found)
        words = (
            f"drone {robot} has no path, even alone"
            if is_first
            else f"the drones planned before leave drone {robot} no path"
        )
        return Result.without_plan(Reason.FAILED, words, {"failed_robot": robot})
    whole = hovering(team)
    if limit is not None and not whole.is_whole:
        robot = next(i for i, single in enumerate(whole.found) if single and not single.path)
        return Result.stopped_without_plan(limit, {"failed_robot": robot})
    return result_of(whole, limit)
